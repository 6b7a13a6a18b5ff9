//! Wheels whose friction differs by direction. Free rollers, such as those of mecanum wheels, have
//! friction along the axis of the roller that touches and none across it; materials may have
//! another friction across the wheel than along it.
//!
//! The frame of such a contact has t along the roller's axis and no b:
//!
//! ```text
//! t = b₀ cos γ + t₀ sin γ,     b = 0
//! ```
//!
//! with the frame (n, t₀, b₀) of the wheel and the angle γ of the roller from the axle. The row b
//! of H is then zero, and so is the impulse along it once W has a diagonal there: Coulomb's law in
//! the plane of n and t. Rollers have no inertia.
//!
//! A friction of μ along and s μ across is an ellipse. The frame then has s b₀ for b: u and p along
//! it are s u_b and p_b/s, and Coulomb's disc of radius μ in these numbers is the ellipse, with the
//! slip that dissipates most. A wheel that yields is s² as stiff across as along.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::pair::{Contact, Opposite};
use super::part::Part;
use crate::multibody::Model;
use crate::scalar::{Lane, Vec3};

/// Turns the frame of a wheel's contact with the ground or a grain to the wheel's rollers, if it
/// has any.
#[inline]
pub(crate) fn turn_to_rollers(model: &Model, contact: &mut Contact) {
    if let Some([sine, cosine]) = rollers_of(model, contact) {
        let frame = &mut contact.frame;
        frame.t = axis_of(frame.t.into(), frame.b.into(), [sine, cosine]).into();
        frame.b.fill(0.0);
    } else if let Some(across) = across_of(model, contact) {
        contact.frame.b *= across;
    }
}

/// Friction across over that along of a wheel that stands on the ground or a grain, if they differ.
#[inline]
pub(crate) fn across_of(model: &Model, contact: &Contact) -> Option<f64> {
    match (contact.part, contact.key.opposite) {
        (Part::Wheel(i), Opposite::Ground(_) | Opposite::Grain(_)) => {
            let wheel = &model.wheels()[i];
            wheel.across.filter(|_| wheel.rollers.is_none())
        }
        _ => None,
    }
}

/// Axis t of rollers at an angle of the given sine and cosine, from the frame of their wheel.
#[inline(always)]
pub(crate) fn axis_of<T: Lane>(t: Vec3<T>, b: Vec3<T>, [sine, cosine]: [f64; 2]) -> Vec3<T> {
    b * t.x.like(cosine) + t * t.x.like(sine)
}

/// Sine and cosine of the angle of the rollers on which a contact stands.
#[inline]
pub(super) fn rollers_of(model: &Model, contact: &Contact) -> Option<[f64; 2]> {
    match (contact.part, contact.key.opposite) {
        (Part::Wheel(i), Opposite::Ground(_) | Opposite::Grain(_)) => model.wheels()[i].rollers,
        _ => None,
    }
}

/// Whether row b of a contact is not that of its wheel's frame, and may be zero.
#[inline]
pub(super) fn has_a_row_of_its_own(model: &Model, contact: &Contact) -> bool {
    rollers_of(model, contact).is_some() || across_of(model, contact).is_some()
}

/// Makes the own block of W of such a contact regular, where its row b is zero.
#[inline(always)]
pub(crate) fn close<T: Lane>(own: &mut [T; 9]) {
    let zero = own[8].like(0.0);
    own[8] = T::select(own[8].le(zero), own[4], own[8]);
}
