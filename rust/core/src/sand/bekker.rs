//! Bekker's pressure with the shear of Janosi and Hanamoto: the baseline of wheels on soft ground.
//!
//! ```text
//! σ = (k_c/b + k_φ) zⁿ,    τ = (c + σ tan φ) (1 − exp(−j/K_s))
//! ```
//!
//! z is the depth, b the width of the wheel, and j the way that a piece has sheared the soil since
//! it entered. Pressure acts on the part of the rim that pushes into the soil, and shear against
//! its sliding. A piece with the displacement x of [`super::memory`] at the arc l from where it
//! entered has `j = |x_t| l`, with x at the middle of that arc. Side walls bear nothing.
//!
//! Source: Bekker 1969, *Introduction to Terrain–Vehicle Systems*; Janosi and Hanamoto 1961,
//! *Analytical determination of drawbar pull as a function of slip*; Wong and Reece 1967.

use nalgebra::{Matrix3, Vector3};

use super::checks::{in_range, not_negative};
use super::piece::{Piece, Stress};
use super::wheel::Skin;
use crate::quantity::{QuantityError, positive};
use crate::scalar::elementary::{exp, ln};

/// A soil in the model of Bekker, Janosi and Hanamoto.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bekker {
    /// k_c, N/m^(n+1).
    pub cohesive_modulus: f64,
    /// k_φ, N/m^(n+2).
    pub frictional_modulus: f64,
    /// n.
    pub exponent: f64,
    /// c, N/m².
    pub cohesion: f64,
    /// tan φ.
    pub internal_friction: f64,
    /// K_s, m.
    pub shear_modulus: f64,
}

/// Displacement along the normal, relative to its size, below which the pressure fades, and
/// displacement that mobilises it.
const FADE: f64 = 0.05;

/// Length below which a vector has no direction.
const TINY: f64 = 1e-12;

impl Bekker {
    /// Stress on a piece.
    #[must_use]
    pub fn stress(&self, piece: &Piece<'_>) -> Stress {
        let (n, x) = (piece.normal, piece.x);
        let size = x.norm();
        if piece.skin == Skin::Wall || piece.depth <= 0.0 || size < TINY {
            return Stress::NONE;
        }
        let x_n = x.dot(n);
        let gate = 0.5 + x_n / (size * FADE);
        if gate <= 0.0 {
            return Stress::NONE;
        }
        let root = (size * size + FADE * FADE).sqrt();
        let along = x / size;
        let (mut share, mut by_x) = (size / root, along * (FADE * FADE / (root * root * root)));
        if gate < 1.0 {
            by_x = by_x * gate + (n - along * (x_n / size)) * (share / (size * FADE));
            share *= gate;
        }
        let modulus = self.cohesive_modulus / piece.width.max(TINY) + self.frictional_modulus;
        let sigma = modulus * exp(self.exponent * ln(piece.depth));
        let by_depth = self.exponent * sigma / piece.depth;
        let x_t = x - n * x_n;
        let t = x_t.norm();
        let (slide, spread) = if t > TINY {
            let slide = x_t / t;
            (
                slide,
                Matrix3::identity() - n * n.transpose() - slide * slide.transpose(),
            )
        } else {
            (Vector3::zeros(), Matrix3::zeros())
        };
        let rate = piece.arc / self.shear_modulus;
        let kept = exp(-t * rate);
        let limit = self.cohesion + sigma * self.internal_friction;
        let shear = limit * (1.0 - kept);
        let value = -n * sigma - slide * shear;
        let mut slope = slide * slide.transpose() * (-limit * rate * kept);
        if t > TINY {
            slope -= spread * (shear / t);
        }
        let tan = self.internal_friction * (1.0 - kept);
        Stress {
            value: value * share,
            by_x: slope * share + value * by_x.transpose(),
            by_depth: (-n - slide * tan) * (by_depth * share),
        }
    }

    pub(super) fn check(&self) -> Result<(), QuantityError> {
        not_negative("cohesive_modulus", self.cohesive_modulus)?;
        positive("frictional_modulus", self.frictional_modulus)?;
        in_range("exponent", self.exponent, [0.1, 3.0], "from 0.1 to 3")?;
        not_negative("cohesion", self.cohesion)?;
        let range = "from 0.05 to 2";
        in_range(
            "internal_friction",
            self.internal_friction,
            [0.05, 2.0],
            range,
        )?;
        in_range(
            "shear_modulus",
            self.shear_modulus,
            [1e-4, 1.0],
            "from 0.0001 to 1 m",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOIL: Bekker = Bekker {
        cohesive_modulus: 1370.0,
        frictional_modulus: 814_000.0,
        exponent: 1.0,
        cohesion: 800.0,
        internal_friction: 0.65,
        shear_modulus: 0.02,
    };

    fn piece<'a>(n: &'a Vector3<f64>, x: &'a Vector3<f64>, down: &'a Vector3<f64>) -> Piece<'a> {
        Piece {
            normal: n,
            x,
            down,
            depth: 0.03,
            arc: 0.05,
            skin: Skin::Rim,
            held: 0.0,
            width: 0.1,
            gravity: 9.81,
        }
    }

    #[test]
    fn a_plate_bears_bekkers_pressure() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        let stress = SOIL.stress(&piece(&down, &(down * 1e3), &down));
        let exact = (1370.0 / 0.1 + 814_000.0) * 0.03;
        assert!((stress.value.y - exact).abs() < 1e-5 * exact);
    }

    #[test]
    fn a_long_slide_reaches_coulombs_limit() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        let stress = SOIL.stress(&piece(&down, &Vector3::new(1e3, -1e3, 0.0), &down));
        let limit = 800.0 + stress.value.y * 0.65;
        assert!((stress.value.x + limit).abs() < 1e-3 * limit);
    }

    #[test]
    fn the_slopes_are_derivatives() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        for x in [Vector3::new(0.4, -0.3, 0.2), Vector3::new(0.5, 0.005, 0.1)] {
            let found = SOIL.stress(&piece(&down, &x, &down));
            for k in 0..3 {
                let mut step = Vector3::zeros();
                step[k] = 1e-7;
                let at = |x: Vector3<f64>| SOIL.stress(&piece(&down, &x, &down)).value;
                let change = (at(x + step) - at(x - step)) / 2e-7;
                assert!((found.by_x.column(k) - change).norm() < 1e-5 * (1.0 + change.norm()));
            }
        }
    }
}
