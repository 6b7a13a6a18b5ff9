//! How a contact's point, frame and gap change with the poses of its bodies.
//!
//! A contact on the ground depends on the six coordinates of one body's pose, one between two
//! bodies on twelve. Whatever the shapes and the ground, its derivatives are central differences of
//! [`super::relocation`] to fourth order, with an error of about 1e-12. Where two second-order
//! differences disagree, because a facet of the ground ends between their points, smaller steps
//! follow.

use nalgebra::{Matrix3, Vector3};

use super::body_motion::{BodyMotion, Still};
use super::pair::Contact;
use super::relocation::relocate_to;
use crate::geometry::Terrain;
use crate::multibody::mechanism::Mechanism;
use crate::multibody::{Model, Motion};
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

/// Steps of the differences, m and rad: the first over which the contact changes smoothly. With
/// 1e-4 alone one column in 400 of rovers on rough maps was wrong by 0.03 to 6%: a wheel was that
/// close to the end of an edge, or its contact moved along an edge 800 times as fast.
const STEPS: [f64; 4] = [1e-4, 1e-5, 1e-6, 1e-7];

/// Difference of two second-order derivatives, relative to the largest entry, that smoothness
/// explains: (step / radius)² for a wheel on an edge, so wheels from 3 cm on take the first step.
const SMOOTH: f64 = 1e-5;

/// Size below which entries are rounding where they are not zero: a turn about an axle moves
/// nothing.
const NOTHING: f64 = 1e-3;

impl ContactSlope {
    /// Derivatives of a contact that is placed at the poses of `still`.
    pub(crate) fn of(
        model: &Model,
        still: Still<'_>,
        terrain: &dyn Terrain,
        contact: &Contact,
    ) -> Self {
        let slope = |body: usize| {
            [0, 1, 2, 3, 4, 5].map(|k| {
                let at = |amount: f64| {
                    let moved = Moved::new(still, body, k, amount);
                    let mut contact = *contact;
                    relocate_to(model, &moved, terrain, &mut contact);
                    numbers(&contact)
                };
                derivative(at)
            })
        };
        Self {
            own: slope(contact.body),
            other: contact.other.map(|other| slope(other.body)),
        }
    }
}

/// Derivative at 0.
fn derivative(at: impl Fn(f64) -> ContactNumbers) -> ContactNumbers {
    let mut found = [0.0; 13];
    for step in STEPS {
        let of = |reach: f64| {
            let [ahead, back] = [at(reach), at(-reach)];
            let slope = |i: usize| (ahead[i] - back[i]) / (2.0 * reach);
            std::array::from_fn::<f64, 13, _>(slope)
        };
        let (near, far) = (of(step), of(2.0 * step));
        found = std::array::from_fn(|i| (4.0 * near[i] - far[i]) / 3.0);
        let largest = found.iter().fold(NOTHING, |most, x| most.max(x.abs()));
        let mut apart = near.iter().zip(&far).map(|(a, b)| (a - b).abs());
        if apart.all(|apart| apart <= SMOOTH * largest) {
            break;
        }
    }
    found
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
    fn new(still: Still<'a>, body: usize, axis: usize, amount: f64) -> Self {
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
