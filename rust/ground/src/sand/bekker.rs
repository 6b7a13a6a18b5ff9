//! The law of Bekker, Wong and Reece with the shear of Janosi and Hanamoto: the baseline of wheels
//! on soft ground.
//!
//! ```text
//! σ(θ) = (k_c/b + k_φ) z(θ*)ⁿ,    τ = (c + σ tan φ) (1 − exp(−j/K_s))
//! θ* = θ                                    for θ >= θ_m
//! θ* = θ₁ − θ (θ₁ − θ_m)/θ_m               for θ < θ_m
//! θ_m = (a₀ + a₁ s) θ₁,    n = n₀ + n₁ s
//! ```
//!
//! z is the depth of the piece at an angle, θ₁ the angle at which the rim enters, b the width of
//! the wheel, and j the way that the piece has sheared the soil since it entered
//! ([`super::sliding`]). Stress acts on the part of the rim that presses into the soil, which in
//! steady motion ends at the lowest point. With a₀ = a₁ = 0 it is greatest there. n₁ is the
//! slip-sinkage of Ding et al. 2010, and s the slip of a driven wheel, 0 of one that is drawn. All
//! is multiplied by the part that the wheel's memory mobilises ([`mobilised`]), 1 in steady motion.
//! Side walls bear nothing.
//!
//! Source: Bekker 1969, *Introduction to Terrain–Vehicle Systems*; Janosi and Hanamoto 1961,
//! *Analytical determination of drawbar pull as a function of slip*; Wong and Reece 1967.

use super::piece::{Piece, Stress, WheelConditions};
use super::wheel::Skin;
use friction_contact::quantity::{QuantityError, between, not_negative, positive};
use friction_contact::scalar::elementary::{exp_m1, ln};
use friction_contact::scalar::{Lane, LaneMask};

/// A soil in the model of Bekker, Janosi and Hanamoto.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// a₀.
    pub stress_angle: f64,
    /// a₁.
    pub stress_angle_slip: f64,
    /// n₁.
    pub slip_sinkage: f64,
}

/// Least share of the angle of greatest stress, from either end.
const LEAST_SHARE: f64 = 0.001;

/// Size of a wheel's memory that mobilises the stress of the sand.
///
/// It is one number for all pieces, since a piece at the bottom of a rolling wheel hardly moves and
/// yet bears its pressure. With less, a heavy wheel that has sunk deeper than its weight needs
/// never comes to rest: its pressure then changes faster with its place than its shear can hold it.
/// With half of it, one step in forty after a fall onto 17 degrees did not converge.
const MOBILISED: f64 = 0.6;

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
    /// The angle of greatest stress relative to the angle at which the rim enters; none if it is
    /// the lowest point at any slip.
    #[must_use]
    pub fn greatest(&self, slip: f64) -> Option<f64> {
        let is_moved = self.stress_angle > 0.0 || self.stress_angle_slip > 0.0;
        let share = self.stress_angle + self.stress_angle_slip * slip;
        is_moved.then(|| share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE))
    }

    /// Stress on pieces; its derivatives if they are wanted.
    #[inline(always)]
    #[must_use]
    pub fn stress<T: Lane>(
        &self,
        piece: &Piece<T>,
        setting: &WheelConditions,
        wants_slopes: bool,
    ) -> Stress<T> {
        let (n, slid) = (piece.normal, &piece.slid);
        let number = |value: f64| n.x.like(value);
        let (zero, one, tiny) = (number(0.0), number(1.0), number(TINY));
        let mut found = Stress::none(n.x.token());
        let is_felt = piece.depth.gt(zero);
        if piece.skin == Skin::Wall || !is_felt.any() {
            return found;
        }
        let share = T::select(is_felt, one, zero);
        let modulus = self.cohesive_modulus / setting.width.max(TINY) + self.frictional_modulus;
        let exponent = self.exponent + self.slip_sinkage * setting.slip;
        let depth = T::select(is_felt, piece.depth, one);
        let sigma = number(modulus) * power(depth, exponent);
        let [along, across] = slid.way;
        let way = (along * along + across * across).sqrt();
        let per_way = one / way.max(tiny);
        let unit = [along * per_way, across * per_way];
        let [e, d] = slid.tangents;
        let direction = e * unit[0] + d * unit[1];
        let per_modulus = number(1.0 / self.shear_modulus);
        let risen = -exp_m1(-(way * per_modulus));
        let tan = number(self.internal_friction);
        let limit = number(self.cohesion) + sigma * tan;
        let value = -(n * sigma) - direction * (limit * risen);
        found.value = value * share;
        if !wants_slopes {
            return found;
        }
        let by_depth = number(exponent) * sigma / depth * share;
        found.by_depth = -(n + direction * (tan * risen)) * by_depth;
        // The shear by the way: along its direction, and across it as it turns.
        let turning = T::select(way.lt(tiny), per_modulus, risen * per_way) * limit;
        let excess = limit * (one - risen) * per_modulus - turning;
        for (k, tangent) in slid.tangents.into_iter().enumerate() {
            let slope = direction * (unit[k] * excess) + tangent * turning;
            found.by_way[k] = -(slope * share);
            found.by_depth += found.by_way[k] * slid.by_depth[k];
        }
        found
    }

    pub(super) fn check(&self) -> Result<(), QuantityError> {
        not_negative("cohesive_modulus", self.cohesive_modulus)?;
        positive("frictional_modulus", self.frictional_modulus)?;
        not_negative("cohesion", self.cohesion)?;
        let (tan, way) = (self.internal_friction, self.shear_modulus);
        for (field, value, ends, range) in [
            ("exponent", self.exponent, [0.1, 3.0], "from 0.1 to 3"),
            ("internal_friction", tan, [0.05, 2.0], "from 0.05 to 2"),
            ("shear_modulus", way, [1e-4, 1.0], "from 0.0001 to 1 m"),
            ("stress_angle", self.stress_angle, [0.0, 1.0], "from 0 to 1"),
            (
                "stress_angle_slip",
                self.stress_angle_slip,
                [0.0, 1.0],
                "from 0 to 1",
            ),
            ("slip_sinkage", self.slip_sinkage, [0.0, 2.0], "from 0 to 2"),
        ] {
            between(field, value, ends, range)?;
        }
        Ok(())
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

    use super::super::sliding::Slid;
    use super::*;
    use friction_contact::scalar::Vec3;

    const SOIL: Bekker = Bekker {
        cohesive_modulus: 1370.0,
        frictional_modulus: 814_000.0,
        exponent: 1.0,
        cohesion: 800.0,
        internal_friction: 0.65,
        shear_modulus: 0.02,
        stress_angle: 0.0,
        stress_angle_slip: 0.0,
        slip_sinkage: 0.0,
    };

    const SETTING: WheelConditions = WheelConditions {
        held: 0.0,
        width: 0.1,
        gravity: 9.81,
        slip: 0.0,
    };

    /// Stress on a piece of a plate that faces down.
    fn stress(way: [f64; 2], depth: f64) -> Stress<f64> {
        let axes = [Vector3::x(), Vector3::z()];
        let down = Vector3::new(0.0, -1.0, 0.0);
        let piece = Piece::<f64> {
            normal: down.into(),
            x: down.into(),
            down: down.into(),
            depth,
            slid: Slid {
                tangents: axes.map(Vec3::from),
                way,
                by_depth: [0.0; 2],
                by_memory: [[0.0; 2]; 6],
                deeper: 0.0,
            },
            skin: Skin::Rim,
        };
        SOIL.stress(&piece, &SETTING, true)
    }

    #[test]
    fn a_plate_bears_bekkers_pressure() {
        let found = stress([0.0; 2], 0.03).value;
        let exact = (1370.0 / 0.1 + 814_000.0) * 0.03;
        assert!((found.y - exact).abs() < 1e-9 * exact);
        assert!(found.x.abs() + found.z.abs() < 1e-12 * exact);
    }

    #[test]
    fn the_shear_is_janosis_and_hanamotos() {
        let found = stress([0.03, -0.04], 0.03).value;
        let shear = (800.0 + found.y * 0.65) * (1.0 - (-0.05_f64 / 0.02).exp());
        assert!((found.x + 0.6 * shear).abs() < 1e-12 * shear);
        assert!((found.z - 0.8 * shear).abs() < 1e-12 * shear);
    }

    #[test]
    fn the_slopes_are_derivatives() {
        let step = 1e-7;
        let difference = |up: Stress<f64>, down: Stress<f64>| {
            (Vector3::from(up.value) - Vector3::from(down.value)) / (2.0 * step)
        };
        let near = |slope: Vec3<f64>, change: Vector3<f64>| {
            assert!((Vector3::from(slope) - change).norm() < 1e-5 * (1.0 + change.norm()));
        };
        for way in [[0.01, -0.004], [0.0, 0.0]] {
            let found = stress(way, 0.03);
            for k in 0..2 {
                let (mut up, mut down) = (way, way);
                up[k] += step;
                down[k] -= step;
                near(
                    found.by_way[k],
                    difference(stress(up, 0.03), stress(down, 0.03)),
                );
            }
            let [up, down] = [0.03 + step, 0.03 - step].map(|depth| stress(way, depth));
            near(found.by_depth, difference(up, down));
        }
    }
}
