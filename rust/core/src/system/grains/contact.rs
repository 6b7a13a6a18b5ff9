//! A contact of a grain, and its key.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use crate::contact::ContactFrame;
use crate::integrator::UnilateralContact;

/// Numbers of second bodies from here on are walls.
pub(crate) const WALL: u32 = 1 << 31;
/// Numbers of second bodies from here on are points of the ground.
pub(crate) const GROUND: u32 = (1 << 31) | (1 << 30);

/// Key of a contact: its two bodies. Numbers 0 to n − 1 are grains, then come the machine's wheels,
/// walls, and points of the ground.
///
/// Of two grains the smaller number comes first, and a wheel comes before a grain. Contacts are
/// listed in this order, so bisection finds the impulse of the last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct GrainKey {
    /// The first body.
    pub a: u32,
    /// The second body.
    pub b: u32,
}

/// A contact of a grain or of a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GrainContact<const D: usize> {
    /// Key of the contact from step to step.
    pub key: GrainKey,
    /// Unit normal, from the second body into the first.
    pub n: SVector<f64, D>,
    /// Point on the first body's rim, world, m.
    pub point: SVector<f64, D>,
    /// Predicted at the end of the step without contact, m.
    pub gap: f64,
    /// At the start of the step, m.
    pub gap_start: f64,
}

impl<const D: usize> GrainContact<D> {
    /// Unit normal and tangents: t = n × e_z in the plane; t, b as
    /// [`ContactFrame::of_normal`] has them in space.
    #[inline]
    #[must_use]
    pub fn frame(&self) -> [SVector<f64, D>; D] {
        frame(&self.n)
    }

    /// The first tangent: n × e_z in the plane.
    #[must_use]
    pub fn t(&self) -> SVector<f64, D> {
        self.frame()[1]
    }

    /// Whether the second body is a grain.
    #[must_use]
    pub fn is_with_grain(&self) -> bool {
        self.key.b < WALL
    }
}

impl<const D: usize> UnilateralContact for GrainContact<D> {
    type Key = GrainKey;
    type Local = [f64; D];

    fn key(&self) -> GrainKey {
        self.key
    }

    fn gap(&self) -> f64 {
        self.gap
    }
}

/// See [`GrainContact::frame`].
#[inline]
fn frame<const D: usize>(n: &SVector<f64, D>) -> [SVector<f64, D>; D] {
    let mut frame = [*n; D];
    if D == 2 {
        (frame[1][0], frame[1][1]) = (n[1], -n[0]);
    } else {
        let in_space = ContactFrame::of_normal(&n.fixed_rows::<3>(0).into_owned());
        for k in 0..D {
            frame[1][k] = in_space.t[k];
            frame[2][k] = in_space.b[k];
        }
    }
    frame
}
