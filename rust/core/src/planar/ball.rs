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

use nalgebra::Vector2;

use super::error::PlanarError;
use super::tree::{DiscWheel, PlanarBody, PlanarTree, fingerprint};
use crate::quantity::{INERTIAS, LENGTHS, MASSES, within};

/// A disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarBall {
    mass: f64,
    radius: f64,
    inertia: f64,
}

impl PlanarBall {
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
}

impl From<PlanarBall> for PlanarTree {
    fn from(ball: PlanarBall) -> Self {
        let PlanarBall {
            mass,
            radius,
            inertia,
        } = ball;
        Self::new(
            vec![PlanarBody::centred(Vector2::zeros(), mass, inertia)],
            vec![DiscWheel::driven(0, radius)],
            fingerprint("ball", [mass, radius, inertia]),
        )
    }
}
