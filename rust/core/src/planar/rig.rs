//! Test rig: one wheel on a carriage, with prescribed rates of travel and rotation, free to sink.
//!
//! Coordinates (x, y, –, θ_w, –): travel of the carriage, height of the wheel, its angle. Mass and
//! inertia of travel and angle are so large that no soil changes their rates in double precision.
//! The slip `1 − ẋ/(r |θ̇_w|)` is thus prescribed, and the drawbar pull, the horizontal force of
//! the soil on the wheel, is the result.

use nalgebra::{SMatrix, SVector, Vector2};

use super::error::PlanarError;
use super::machine::{Disc, PlanarMachine, fingerprint};
use crate::quantity::{LENGTHS, MASSES, within};

/// A wheel of the test rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelRig {
    mass: f64,
    radius: f64,
}

/// Multiple of the wheel's mass that keeps a rate constant.
const HEAVY: f64 = 1e12;

impl WheelRig {
    /// `mass` (kg) that the soil carries, `radius` in m.
    ///
    /// # Errors
    /// A number that is not finite and positive.
    pub fn new(mass: f64, radius: f64) -> Result<Self, PlanarError> {
        Ok(Self {
            mass: within(|| "mass".to_owned(), mass, MASSES)?,
            radius: within(|| "radius".to_owned(), radius, LENGTHS)?,
        })
    }

    /// Rates (5) of a wheel that travels forward at `speed` (m/s) with the
    /// slip `1 − speed/(r ω)`, below 1.
    #[must_use]
    pub fn rates(&self, speed: f64, slip: f64) -> [f64; 5] {
        let turning = speed / (self.radius * (1.0 - slip));
        [speed, 0.0, 0.0, -turning, 0.0]
    }

    /// m.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }
}

impl PlanarMachine<5> for WheelRig {
    fn mass_matrix(&self, _q: &SVector<f64, 5>) -> SMatrix<f64, 5, 5> {
        let heavy = HEAVY * self.mass;
        let turning = heavy * self.radius * self.radius;
        SMatrix::from_diagonal(&SVector::from([
            heavy, self.mass, turning, turning, turning,
        ]))
    }

    fn force(
        &self,
        _q: &SVector<f64, 5>,
        _v: &SVector<f64, 5>,
        gravity: &Vector2<f64>,
        _torques: &[f64],
    ) -> SVector<f64, 5> {
        SVector::from([0.0, self.mass * gravity.y, 0.0, 0.0, 0.0])
    }

    fn potential(&self, q: &SVector<f64, 5>, gravity: &Vector2<f64>) -> f64 {
        -self.mass * gravity.y * q[1]
    }

    fn n_inputs(&self) -> usize {
        0
    }

    fn turning(&self, _v: &SVector<f64, 5>) -> f64 {
        0.0
    }

    fn n_discs(&self) -> usize {
        1
    }

    fn disc(&self, _i: usize, q: &SVector<f64, 5>) -> Disc {
        Disc {
            centre: q.xy(),
            radius: self.radius,
        }
    }

    fn point_jacobian(
        &self,
        _i: usize,
        q: &SVector<f64, 5>,
        point: &Vector2<f64>,
    ) -> SMatrix<f64, 2, 5> {
        let rim = point - q.xy();
        let mut J = SMatrix::<f64, 2, 5>::zeros();
        J[(0, 0)] = 1.0;
        J[(1, 1)] = 1.0;
        (J[(0, 3)], J[(1, 3)]) = (-rim.y, rim.x);
        J
    }

    fn arms(&self) -> SVector<f64, 5> {
        SVector::from([1.0, 1.0, 0.0, self.radius, 0.0])
    }

    fn fingerprint(&self) -> u64 {
        fingerprint("rig", [self.mass, self.radius])
    }
}
