//! Bekker's pressure with the shear of Janosi and Hanamoto: the baseline of wheels on soft ground.
//!
//! ```text
//! σ = (k_c/b + k_φ) zⁿ,    τ = (c + σ tan φ) (1 − exp(−j/K_s))
//! ```
//!
//! z is the depth, b the width of the wheel, and j the way that a piece has sheared the soil since
//! it entered. Pressure acts on the part of the rim that pushes into the soil, and shear against
//! its sliding, both times the part that the wheel's memory mobilises ([`mobilised`]). A piece with
//! the displacement x of [`super::memory`] at the arc l from where it
//! entered has `j = |x_t| l`, with x at the middle of that arc. Side walls bear nothing.
//!
//! Source: Bekker 1969, *Introduction to Terrain–Vehicle Systems*; Janosi and Hanamoto 1961,
//! *Analytical determination of drawbar pull as a function of slip*; Wong and Reece 1967.

use super::checks::{in_range, not_negative};
use super::piece::{Piece, Setting, Stress};
use super::wheel::Skin;
use crate::quantity::{QuantityError, positive};
use crate::scalar::elementary::{exp_m1, ln};
use crate::scalar::{Lane, LaneMask, Vec3};

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

/// Displacement along the normal, relative to its size, below which the pressure fades.
const FADE: f64 = 0.05;

/// Size of a wheel's memory that mobilises the stress of the sand.
///
/// It is one number for all pieces, since a piece at the bottom of a rolling wheel hardly moves and
/// yet bears its pressure. With less, a heavy wheel that has sunk deeper than its weight needs
/// never comes to rest: its pressure then changes faster with its place than its shear can hold it.
const MOBILISED: f64 = 0.3;

/// Length below which a vector has no direction.
const TINY: f64 = 1e-12;

/// The part of the stress that a memory of a size mobilises, and its derivative; 1 in steady
/// motion.
#[must_use]
pub fn mobilised(stirred: f64) -> (f64, f64) {
    let rest = MOBILISED * MOBILISED;
    let per = 1.0 / (stirred * stirred + rest).sqrt();
    let steady = (1.0 + rest).sqrt();
    (steady * stirred * per, steady * rest * per * per * per)
}

impl Bekker {
    /// Stress on pieces; its derivatives if they are wanted.
    #[inline(always)]
    #[must_use]
    pub fn stress<T: Lane>(
        &self,
        piece: &Piece<T>,
        setting: &Setting,
        wants_slopes: bool,
    ) -> Stress<T> {
        let (n, x) = (piece.normal, piece.x);
        let number = |value: f64| n.x.like(value);
        let (zero, one, tiny) = (number(0.0), number(1.0), number(TINY));
        let mut found = Stress::none(n.x.token());
        let length = x.norm();
        let x_n = x.dot(n);
        let least = number((FADE * setting.stirred).max(TINY));
        let per_size = one / (length * length + least * least).sqrt();
        let gate = number(0.5) + x_n * per_size * number(1.0 / FADE);
        let is_felt = piece.depth.gt(zero) & length.ge(tiny) & gate.gt(zero);
        if piece.skin == Skin::Wall || !is_felt.any() {
            return found;
        }
        let along = x * per_size;
        let is_partial = gate.lt(one);
        let limited = T::select(is_partial, gate, one);
        let share = T::select(is_felt, limited, zero);
        let modulus = self.cohesive_modulus / setting.width.max(TINY) + self.frictional_modulus;
        let depth = T::select(is_felt, piece.depth, one);
        let sigma = number(modulus) * power(depth, self.exponent);
        let x_t = x - n * x_n;
        let t = x_t.norm();
        let per_t = one / t.max(tiny);
        let slide = x_t * per_t;
        let [arc, arc_by_depth] = piece.arc;
        let per_modulus = number(1.0 / self.shear_modulus);
        let rate = arc * per_modulus;
        let risen = -exp_m1(-(t * rate));
        let tan = number(self.internal_friction);
        let limit = number(self.cohesion) + sigma * tan;
        let shear = limit * risen;
        let value = -(n * sigma) - slide * shear;
        found.value = value * share;
        if !wants_slopes {
            return found;
        }
        let by_depth = number(self.exponent) * sigma / depth * share;
        let left = limit * (one - risen);
        found.by_arc = -slide * (left * t * per_modulus * share);
        found.by_depth = found.by_arc * arc_by_depth - (n + slide * (tan * risen)) * by_depth;
        let by_gate = T::select(is_partial, per_size * number(1.0 / FADE), zero);
        let share_by_x = (n - along * (x_n * per_size)) * by_gate;
        let by_t = -(left * rate);
        let turning = shear * per_t;
        let parts = [share_by_x.x, share_by_x.y, share_by_x.z];
        let units = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for ((column, unit), part) in found.by_x.iter_mut().zip(units).zip(parts) {
            let e = Vec3::splat(n.x.token(), unit);
            let along_slide = slide.dot(e);
            let across = e - n * n.dot(e) - slide * along_slide;
            let slope = slide * (by_t * along_slide) - across * turning;
            let slope = slope * share + value * part;
            *column = Vec3::select(is_felt, slope, *column);
        }
        found
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

/// `xⁿ` of a positive x.
#[inline(always)]
fn power<T: Lane>(x: T, n: f64) -> T {
    let mut logarithm = x;
    for lane in 0..T::LANES {
        logarithm.set(lane, ln(x.get(lane)));
    }
    exp_m1(logarithm * x.like(n)) + x.like(1.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    const SOIL: Bekker = Bekker {
        cohesive_modulus: 1370.0,
        frictional_modulus: 814_000.0,
        exponent: 1.0,
        cohesion: 800.0,
        internal_friction: 0.65,
        shear_modulus: 0.02,
    };

    const SETTING: Setting = Setting {
        held: 0.0,
        width: 0.1,
        gravity: 9.81,
        stirred: 1.0,
    };

    /// Stress on a piece of a plate that faces down, and its derivative by the displacement.
    fn stress(x: Vector3<f64>) -> [Vector3<f64>; 4] {
        let down = Vector3::new(0.0, -1.0, 0.0);
        let piece = Piece::<f64> {
            normal: down.into(),
            x: x.into(),
            down: down.into(),
            depth: 0.03,
            arc: [0.05, 0.0],
            skin: Skin::Rim,
        };
        let found = SOIL.stress(&piece, &SETTING, true);
        let [a, b, c] = found.by_x.map(Vector3::from);
        [found.value.into(), a, b, c]
    }

    #[test]
    fn a_plate_bears_bekkers_pressure() {
        let [stress, ..] = stress(Vector3::new(0.0, -1e3, 0.0));
        let exact = (1370.0 / 0.1 + 814_000.0) * 0.03;
        assert!((stress.y - exact).abs() < 1e-5 * exact);
    }

    #[test]
    fn a_long_slide_reaches_coulombs_limit() {
        let [stress, ..] = stress(Vector3::new(1e3, -1e3, 0.0));
        let limit = 800.0 + stress.y * 0.65;
        assert!((stress.x + limit).abs() < 1e-3 * limit);
    }

    #[test]
    fn the_slopes_are_derivatives() {
        for x in [Vector3::new(0.4, -0.3, 0.2), Vector3::new(0.5, 0.005, 0.1)] {
            let found = stress(x);
            for k in 0..3 {
                let mut step = Vector3::zeros();
                step[k] = 1e-7;
                let change = (stress(x + step)[0] - stress(x - step)[0]) / 2e-7;
                assert!((found[1 + k] - change).norm() < 1e-5 * (1.0 + change.norm()));
            }
        }
    }
}
