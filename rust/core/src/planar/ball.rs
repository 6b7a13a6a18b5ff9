//! The ball of the report's section 3.1: a disc with the coordinates (x, y, θ).
//!
//! ```text
//! m ẍ = F_x,   m ÿ = −m g + F_y,   J θ̈ = r t · F
//! F = n p_N + t p_T at the rim point E = c − r n
//! ```
//!
//! so the columns of H are (n, 0) and (t, r): the normal row is the gap's
//! gradient, and turning does not change the gap. The report's (3.8) has the
//! opposite sign, and its (3.17) turns the contact point with the ball.

use nalgebra::{SMatrix, SVector, Vector2};

use super::error::PlanarError;
use super::machine::{Disc, PlanarMachine, fingerprint};
use crate::quantity::{INERTIAS, LENGTHS, MASSES, within};

/// A disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    mass: f64,
    radius: f64,
    inertia: f64,
}

impl Ball {
    /// `mass` in kg, `radius` in m, `inertia` about the centre in kg m².
    ///
    /// # Errors
    /// A number that is not finite and positive, or out of its range.
    pub fn new(mass: f64, radius: f64, inertia: f64) -> Result<Self, PlanarError> {
        Ok(Self {
            mass: within(|| "mass".to_owned(), mass, MASSES)?,
            radius: within(|| "radius".to_owned(), radius, LENGTHS)?,
            inertia: within(|| "inertia".to_owned(), inertia, INERTIAS)?,
        })
    }

    /// kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// m.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// kg m².
    #[must_use]
    pub fn inertia(&self) -> f64 {
        self.inertia
    }
}

impl PlanarMachine<3> for Ball {
    fn mass_matrix(&self, _q: &SVector<f64, 3>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal(&SVector::from([self.mass, self.mass, self.inertia]))
    }

    fn force(
        &self,
        _q: &SVector<f64, 3>,
        _v: &SVector<f64, 3>,
        gravity: &Vector2<f64>,
        torques: &[f64],
    ) -> SVector<f64, 3> {
        SVector::from([
            self.mass * gravity.x,
            self.mass * gravity.y,
            // A positive torque drives forward.
            -torques[0],
        ])
    }

    fn potential(&self, q: &SVector<f64, 3>, gravity: &Vector2<f64>) -> f64 {
        -self.mass * gravity.dot(&q.xy())
    }

    fn n_inputs(&self) -> usize {
        1
    }

    /// It looks the same from all sides.
    fn turning(&self, _v: &SVector<f64, 3>) -> f64 {
        0.0
    }

    fn n_discs(&self) -> usize {
        1
    }

    fn disc(&self, _i: usize, q: &SVector<f64, 3>) -> Disc {
        Disc {
            centre: q.xy(),
            radius: self.radius,
        }
    }

    fn point_jacobian(
        &self,
        _i: usize,
        q: &SVector<f64, 3>,
        point: &Vector2<f64>,
    ) -> SMatrix<f64, 2, 3> {
        let r = point - q.xy();
        SMatrix::<f64, 2, 3>::new(1.0, 0.0, -r.y, 0.0, 1.0, r.x)
    }

    fn arms(&self) -> SVector<f64, 3> {
        SVector::from([1.0, 1.0, self.radius])
    }

    fn fingerprint(&self) -> u64 {
        fingerprint("ball", [self.mass, self.radius, self.inertia])
    }
}
