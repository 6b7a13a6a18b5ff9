//! Dry friction of a joint: a torque or force f on its velocity with
//!
//! ```text
//! |f| ≤ τ_f,     f = −τ_f sign q̇  where  q̇ ≠ 0
//! ```
//!
//! It is an entry of the contact list, like a stop ([`super::limit`]), and solved together with
//! all contacts: a joint sticks at zero velocity exactly. Its row t of H is 1 at the joint's
//! velocity. Its normal row is zero, with a diagonal w of W and a free velocity `−w τ_f h`, so that
//! `0 ≤ u_N ⊥ p_N ≥ 0` gives the normal impulse `p_N = τ_f h`; with μ = 1 Coulomb's law is the law
//! above. The row b is zero, too, and its diagonal that of t.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::body_motion::Still;
use super::limit;
use super::pair::{Contact, ContactKey, Opposite};
use super::part::Part;
use crate::multibody::Model;

impl ContactKey {
    /// Key of a joint's dry friction.
    #[must_use]
    pub(crate) fn of_friction(joint: usize) -> Self {
        Self {
            part: Part::Friction(joint).code(),
            feature: 2,
            opposite: Opposite::Stop,
        }
    }
}

/// Adds to `out` the friction of all joints that have it.
pub(crate) fn list_friction(model: &Model, motion: &Still<'_>, out: &mut Vec<Contact>) {
    let joints = model.rubbing_joints().iter();
    out.extend(joints.map(|&joint| limit::of_joint(model, motion, joint, 1.0)));
}

/// Index of the joint, if the contact is the friction of one.
#[inline]
pub(crate) fn joint_of(contact: &Contact) -> Option<usize> {
    match contact.part {
        Part::Friction(joint) => Some(joint),
        _ => None,
    }
}

/// Makes the own block of W of such a contact regular; its only entry is that of t.
#[inline(always)]
pub(crate) fn close<T: Copy>(own: &mut [T; 9]) {
    (own[0], own[8]) = (own[4], own[4]);
}
