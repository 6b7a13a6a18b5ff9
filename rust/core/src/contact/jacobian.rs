//! Contact Jacobian H: relative velocity of a contact's two sides, `u = Hᵀ v`.
//!
//! For a ground contact a row is nonzero along the path of the contact's body. Between two bodies
//! it is the difference of two such rows at the common contact point. A velocity that moves both
//! bodies alike, of a common ancestor's joint or a free base, therefore contributes exactly zero.

use nalgebra::Vector3;

use super::body_motion::BodyMotion;
use super::limit;
use super::pair::Contact;
use crate::multibody::{BASE, Kinematics, Model};

/// Entries of a contact's three rows n, t, b for one velocity, padded to two pairs of SIMD lanes.
pub(super) type Columns = [f64; 4];

/// The contact point relative to the origin of another body's tree, m.
#[inline]
fn place_in_tree_of(kinematics: &Kinematics, contact: &Contact, body: usize) -> Vector3<f64> {
    contact.point + (kinematics.origin(contact.body) - kinematics.origin(body))
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

/// Rows of Hᵀ along the path of the contact's own body: velocity of the body's point along n, t, b
/// per unit of each joint velocity.
#[inline]
pub(super) fn columns(
    model: &Model,
    kinematics: &Kinematics,
    contact: &Contact,
    rows: &mut [Columns],
) {
    columns_at(
        model,
        kinematics,
        contact,
        contact.body,
        &contact.point,
        rows,
    );
}

/// The same along the path of the other body, before subtraction.
pub(super) fn columns_of_other(
    model: &Model,
    kinematics: &Kinematics,
    contact: &Contact,
    body: usize,
    rows: &mut [Columns],
) {
    let x = place_in_tree_of(kinematics, contact, body);
    columns_at(model, kinematics, contact, body, &x, rows);
}

#[allow(clippy::inline_always)] // as a call it costs a hundredth of a step
#[inline(always)]
fn columns_at(
    model: &Model,
    kinematics: &Kinematics,
    contact: &Contact,
    body: usize,
    x: &Vector3<f64>,
    rows: &mut [Columns],
) {
    let [n, t, b] = contact.frame.rows();
    let (lead, rest) = rows.split_at_mut(model.lead(body));
    if let Some(rows) = lead.first_chunk_mut::<BASE>() {
        let (xn, xt, xb) = (x.cross(&n), x.cross(&t), x.cross(&b));
        for i in 0..3 {
            rows[i] = [n[i], t[i], b[i], 0.0];
            rows[3 + i] = [xn[i], xt[i], xb[i], 0.0];
        }
    }
    let of_motion =
        |velocity: &Vector3<f64>| [velocity.dot(&n), velocity.dot(&t), velocity.dot(&b), 0.0];
    for (row, mover) in rest.iter_mut().zip(model.movers(body)) {
        *row = of_motion(&kinematics.velocity_at(mover.motion, x));
    }
}

/// `out = H p` (nv): generalized impulse, N s and N m s, of the impulses `p` (3 n_c) at the
/// contacts.
pub fn generalized_impulse(
    model: &Model,
    kinematics: &Kinematics,
    contacts: &[Contact],
    p: &[f64],
    out: &mut [f64],
) {
    out.fill(0.0);
    for (contact, p) in contacts.iter().zip(p.chunks_exact(3)) {
        if let Some((k, sign)) = limit::row(model, contact) {
            out[k] += sign * p[0];
            continue;
        }
        let [n, t, b] = contact.frame.rows();
        let force = n * p[0] + t * p[1] + b * p[2];
        push(model, kinematics, contact.body, &contact.point, &force, out);
        // The other body receives the opposite impulse at the same point.
        if let Some(other) = contact.other {
            push_other(model, kinematics, contact, other.body, &-force, out);
        }
    }
}

/// Adds the generalized impulse of an impulse applied to a body at a point.
#[allow(clippy::inline_always)] // as columns_at
#[inline(always)]
fn push(
    model: &Model,
    kinematics: &Kinematics,
    body: usize,
    x: &Vector3<f64>,
    force: &Vector3<f64>,
    out: &mut [f64],
) {
    let moment = x.cross(force);
    let (lead, _) = model.split_path(body);
    if let Some(out) = out[lead].first_chunk_mut::<BASE>() {
        for i in 0..3 {
            out[i] += force[i];
            out[3 + i] += moment[i];
        }
    }
    for mover in model.movers(body) {
        out[mover.velocity] += kinematics.power(mover.motion, force, &moment);
    }
}

/// The same for the other body of a contact, kept out of the loop over ground contacts.
#[cold]
fn push_other(
    model: &Model,
    kinematics: &Kinematics,
    contact: &Contact,
    body: usize,
    force: &Vector3<f64>,
    out: &mut [f64],
) {
    let x = place_in_tree_of(kinematics, contact, body);
    push(model, kinematics, body, &x, force, out);
}
