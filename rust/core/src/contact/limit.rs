//! A joint against its stop: `gap = q − lower` or `upper − q`, rad or m.
//!
//! A stop is an entry of the contact list. Forecast, impact law, projection and warm start are
//! those of every contact, and stops and contacts are solved together. Its normal row of H is ±1 at
//! the joint's velocity. At a revolute joint the normal velocity is in rad/s and the impulse in N m
//! s. Its tangential rows are zero and μ = 0. The tangential diagonal of W is set to that of the
//! normal, without coupling, so the tangential impulse is zero and W stays regular.

use nalgebra::Vector3;

use super::activation::Activation;
use super::body_motion::Still;
use super::frame::ContactFrame;
use super::pair::{Contact, ContactKey, Opposite};
use super::part::{Part, Side};
use crate::multibody::{JointModel, Model};

impl Side {
    /// Gap rate per unit of the joint's velocity.
    #[inline]
    #[must_use]
    pub fn sign(self) -> f64 {
        match self {
            Self::Lower => 1.0,
            Self::Upper => -1.0,
        }
    }
}

impl ContactKey {
    /// Key of a joint's stop.
    #[must_use]
    pub fn at_limit(joint: usize, side: Side) -> Self {
        Self {
            part: Part::Limit(joint, side).code(),
            feature: match side {
                Side::Lower => 0,
                Side::Upper => 1,
            },
            opposite: Opposite::Stop,
        }
    }
}

/// The only row of a stop or of a joint's friction, if the contact is one: index of the joint's
/// velocity, its entry, and which of n, t and b it is.
#[inline]
pub(crate) fn joint_row(model: &Model, contact: &Contact) -> Option<(usize, f64, usize)> {
    match contact.part {
        Part::Limit(joint, side) => Some((model.joint_velocity(joint), side.sign(), 0)),
        Part::Friction(joint) => Some((model.joint_velocity(joint), 1.0, 1)),
        _ => None,
    }
}

/// Adds to `out` the stops that a step must consider.
///
/// `joints`: coordinates of all joints (n_joints) at the poses of `motion`, rad or m.
pub(crate) fn detect_limits(
    model: &Model,
    motion: &Still<'_>,
    joints: &[f64],
    activation: &Activation,
    out: &mut Vec<Contact>,
) {
    for &joint in model.limited_joints() {
        let arm = model.mechanism().joints[joint].arm;
        for side in [Side::Lower, Side::Upper] {
            let gap = gap(model, joints, joint, side);
            let rate = || arm * side.sign() * motion.v[model.joint_velocity(joint)];
            if activation.admits(arm * gap, rate) {
                out.push(contact(model, motion, joint, side, gap));
            }
        }
    }
}

/// Updates point, frame and gap of a joint's stop to another configuration. `joints`: coordinates
/// of all joints (n_joints) at the poses of `motion`, rad or m.
pub(crate) fn relocate_limit(
    model: &Model,
    motion: &Still<'_>,
    joints: &[f64],
    stop: &mut Contact,
) {
    if let Part::Limit(joint, side) = stop.part {
        let gap = gap(model, joints, joint, side);
        *stop = contact(model, motion, joint, side, gap);
    }
}

/// Distance to a stop, rad or m; +∞ for a joint without stops.
fn gap(model: &Model, joints: &[f64], joint: usize, side: Side) -> f64 {
    let q = joints[joint];
    match (model.joints()[joint].limits, side) {
        (Some(limits), Side::Lower) => q - limits.lower,
        (Some(limits), Side::Upper) => limits.upper - q,
        (None, _) => f64::INFINITY,
    }
}

/// A stop as a contact: its normal opens the gap.
fn contact(model: &Model, motion: &Still<'_>, joint: usize, side: Side, gap: f64) -> Contact {
    let contact = of_joint(model, motion, joint, side.sign());
    Contact {
        key: ContactKey::at_limit(joint, side),
        part: Part::Limit(joint, side),
        gap,
        ..contact
    }
}

/// A joint's friction as a contact, or with another key a stop: its point is the origin of the body
/// that the joint carries, its normal the direction of its axis, times a sign.
pub(super) fn of_joint(model: &Model, motion: &Still<'_>, joint: usize, sign: f64) -> Contact {
    let body = model.joints()[joint].body;
    let moved = &motion.poses.motions[model.bodies()[body].motion];
    let axis: Vector3<f64> = model.bodies()[body].joint.direction(moved).into();
    Contact {
        key: ContactKey::of_friction(joint),
        part: Part::Friction(joint),
        body,
        other: None,
        point: motion.poses.bodies[body].r.into(),
        frame: ContactFrame::of_normal(&(axis * sign)),
        gap: 0.0,
        excess: 0.0,
    }
}
