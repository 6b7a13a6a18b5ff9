//! Contact Jacobian H: relative velocity of a contact's two sides, `u = Hᵀ v`.
//!
//! For a ground contact a row is nonzero along the path of the contact's body. Between two bodies
//! it is the difference of two such rows at the common contact point. A velocity that moves both
//! bodies alike, of a common ancestor's joint or a free base, therefore contributes exactly zero.

use nalgebra::Vector3;

use super::body_motion::{BodyMotion, Still};
use super::limit;
use super::pair::Contact;
use super::rows::{Place, Triple, VelocityPath};
use crate::multibody::mechanism::Mechanism;
use crate::multibody::{Model, Poses};
use crate::scalar::Vec3;

/// The contact point relative to the origin of a body's tree, and the contact's frame.
#[inline]
fn place_at(motion: &impl BodyMotion, contact: &Contact, body: usize) -> Place<f64> {
    let x = contact.point + (motion.origin(contact.body) - motion.origin(body));
    let [n, t, b] = contact.frame.rows().map(Vec3::from);
    let x = x.into();
    Place { x, n, t, b }
}

/// Velocity (m/s, world) of the contact's part relative to its other side, at the contact point.
#[inline]
#[must_use]
pub(crate) fn relative_velocity(motion: &impl BodyMotion, contact: &Contact) -> Vector3<f64> {
    let velocity = motion.point_velocity(contact.body, &contact.point);
    let Some(other) = contact.other else {
        return velocity;
    };
    let x = contact.point + (motion.origin(contact.body) - motion.origin(other.body));
    velocity - motion.point_velocity(other.body, &x)
}

/// Rows of Hᵀ of a contact without another body, along the path of its own, and `Hᵀ v`.
pub(super) fn write_rows(
    model: &Model,
    motion: &Still<'_>,
    contact: &Contact,
    rows: &mut [Triple<f64>],
) -> Triple<f64> {
    let place = place_at(motion, contact, contact.body);
    let path = VelocityPath::of(motion.mechanism, contact.body);
    let mut u = path.write(|m| motion.motion(m), &place, motion.v, rows);
    if contact.part.has_rigid_ends(model) {
        path.level(motion.v, rows, &mut u);
    }
    u
}

/// Calls `act` with each velocity that moves a contact and its entries of the rows of Hᵀ. One that
/// moves both bodies comes twice, with opposite entries.
pub(crate) fn for_each_row(
    motion: &impl BodyMotion,
    contact: &Contact,
    mut act: impl FnMut(usize, Triple<f64>),
) {
    for (body, sign, path) in sides(motion.mechanism(), contact) {
        let place = place_at(motion, contact, body);
        let signed = |k, row: Triple<f64>| act(k, row.map(|x| sign * x));
        path.for_each_row(|m| motion.motion(m), &place, signed);
    }
}

/// The bodies of a contact, the signs of their velocities in the relative one, and their paths. The
/// base that carries both does not count.
#[inline]
pub(crate) fn sides<'a>(
    mechanism: &'a Mechanism,
    contact: &Contact,
) -> impl Iterator<Item = (usize, f64, VelocityPath<'a>)> {
    let own = VelocityPath::of(mechanism, contact.body);
    let other =
        (contact.other).map(|other| (other.body, -1.0, VelocityPath::of(mechanism, other.body)));
    let base = other.and_then(|(.., path)| path.base);
    let is_common = base.is_some() && base == own.base;
    let all = std::iter::once((contact.body, 1.0, own)).chain(other);
    all.map(move |(body, sign, path)| {
        let base = path.base.filter(|_| !is_common);
        (body, sign, VelocityPath { base, ..path })
    })
}

/// `out = H p` (nv): generalized impulse, N s and N m s, of the impulses `p` (3 n_c) at the
/// contacts.
pub fn generalized_impulse(
    model: &Model,
    poses: &Poses<f64>,
    contacts: &[Contact],
    p: &[f64],
    out: &mut [f64],
) {
    let motion = Still::new(model.mechanism(), poses, &[]);
    out.fill(0.0);
    for (contact, p) in contacts.iter().zip(p.as_chunks().0) {
        match limit::joint_row(model, contact) {
            Some((k, sign, row)) => out[k] += sign * p[row],
            None => add_impulse(&motion, contact, *p, |k, x| out[k] += x),
        }
    }
}

/// Calls `act` with each velocity and the generalized impulse on it of a contact's impulse `p`,
/// N s. The other body receives the opposite impulse at the same point.
#[inline]
pub(crate) fn add_impulse(
    motion: &impl BodyMotion,
    contact: &Contact,
    p: Triple<f64>,
    mut act: impl FnMut(usize, f64),
) {
    for (body, sign, path) in sides(motion.mechanism(), contact) {
        let place = place_at(motion, contact, body);
        let [force, moment] = place.wrench(p.map(|p| sign * p));
        if let Some(first) = path.base {
            let both = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
            (first..).zip(both).for_each(|(k, x)| act(k, x));
        }
        for mover in path.movers {
            act(
                mover.velocity,
                motion.motion(mover.motion).power(force, moment),
            );
        }
    }
}
