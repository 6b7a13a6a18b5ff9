//! How a contact's point, frame and gap change with the poses of its bodies.
//!
//! A contact on the ground depends on the six coordinates of one body's pose, one between two
//! bodies on twelve. Whatever the shapes and the ground, its derivatives are central differences of
//! [`super::relocation`] to fourth order, with an error of about 1e-12.

use nalgebra::{Matrix3, Vector3};

use super::body_motion::{BodyMotion, Still};
use super::pair::Contact;
use super::relocation::relocate_to;
use crate::geometry::Terrain;
use crate::multibody::mechanism::Mechanism;
use crate::multibody::{Kinematics, Model, Motion};
use crate::scalar::elementary::sin_cos;

/// Point relative to a fixed origin (m), normal, rolling direction, binormal and gap (m) of a
/// contact.
pub(crate) type ContactNumbers = [f64; 13];

/// Derivatives by a displacement of a body (m, world) and by a turn about its origin (rad, world).
pub(crate) type SlopeOfBody = [ContactNumbers; 6];

/// Derivatives of a contact by the poses of its body and of the other one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactSlope {
    pub own: SlopeOfBody,
    pub other: Option<SlopeOfBody>,
}

/// Step of the differences, m and rad.
const STEP: f64 = 1e-4;

impl ContactSlope {
    /// Of a contact that is placed at the poses of `kinematics`.
    pub(crate) fn of(
        model: &Model,
        kinematics: &Kinematics,
        terrain: &dyn Terrain,
        contact: &Contact,
    ) -> Self {
        let slope = |body: usize| {
            [0, 1, 2, 3, 4, 5].map(|k| {
                let at = |amount: f64| {
                    let moved = Moved::new((model, kinematics), body, k, amount * STEP);
                    let mut contact = *contact;
                    relocate_to(model, &moved, terrain, &mut contact);
                    numbers(&contact)
                };
                let (near, far) = ([at(1.0), at(-1.0)], [at(2.0), at(-2.0)]);
                std::array::from_fn(|i| {
                    (8.0 * (near[0][i] - near[1][i]) - (far[0][i] - far[1][i])) / (12.0 * STEP)
                })
            })
        };
        Self {
            own: slope(contact.body),
            other: contact.other.map(|other| slope(other.body)),
        }
    }
}

fn numbers(contact: &Contact) -> ContactNumbers {
    let mut out = [0.0; 13];
    let [n, t, b] = contact.frame.rows();
    for (out, part) in out.chunks_exact_mut(3).zip([contact.point, n, t, b]) {
        out.copy_from_slice(part.as_slice());
    }
    out[12] = contact.gap;
    out
}

/// A machine with one body out of its place.
struct Moved<'a> {
    still: Still<'a>,
    body: usize,
    R: Matrix3<f64>,
    r: Vector3<f64>,
}

impl<'a> Moved<'a> {
    /// With a body moved along (0 to 2) or turned about (3 to 5) a world axis by an amount.
    fn new(
        (model, kinematics): (&'a Model, &'a Kinematics),
        body: usize,
        axis: usize,
        amount: f64,
    ) -> Self {
        let still = Still {
            model,
            kinematics,
            v: &[],
        };
        let (mut R, mut r) = still.pose(body);
        if axis < 3 {
            r[axis] += amount;
        } else {
            let (sin, cos) = sin_cos(amount);
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            for k in 0..3 {
                let (a, b) = (R[(i, k)], R[(j, k)]);
                R[(i, k)] = cos * a - sin * b;
                R[(j, k)] = sin * a + cos * b;
            }
        }
        Self { still, body, R, r }
    }
}

impl BodyMotion for Moved<'_> {
    fn mechanism(&self) -> &Mechanism {
        self.still.mechanism()
    }

    fn origin(&self, body: usize) -> Vector3<f64> {
        self.still.origin(body)
    }

    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>) {
        if body == self.body {
            return (self.R, self.r);
        }
        self.still.pose(body)
    }

    fn motion(&self, motion: usize) -> Motion<f64> {
        self.still.motion(motion)
    }

    fn velocity(&self, k: usize) -> f64 {
        self.still.velocity(k)
    }
}
