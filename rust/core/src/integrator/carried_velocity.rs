//! Velocity of a machine whose position is projected.
//!
//! A projection moves q and leaves the generalised velocity, so it changes `½ vᵀ M(q) v`: joints
//! turn, and the same rates move other masses. A box of 1 kg that carries 100 kg on a ball joint
//! gained a factor of 1e5 in a second of tumbling. So the velocity is scaled to the kinetic energy
//! that it had before the projection:
//!
//! ```text
//! v⁺ ← s v⁺,    s² = K(q, v⁺) / K(q + d, v⁺)
//! ```
//!
//! Signorini's condition at e = 0, Coulomb's law and closed loops are homogeneous in the velocity,
//! so they still hold. Where nothing outside touches the system, only the motion relative to the
//! mass centre is scaled, and the linear momentum P is the one before:
//!
//! ```text
//! v⁺ ← P/m + s (v⁺ − P(q + d, v⁺)/m)
//! ```
//!
//! What is left of a projection's energy is its work against gravity and springs.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::scalar::{Lane, Vec3};

/// Most by which a velocity is raised: as much as the audit raises that of free flight. The rest of
/// the energy is lost.
const RAISE: f64 = 2.0;

/// Kinetic energy, J, and linear momentum, kg m/s, of a state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnergyMomentum<T> {
    pub kinetic: T,
    pub momentum: Vec3<T>,
}

/// How the velocity of a projected position follows from the one before the projection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carried<T> {
    /// s.
    pub share: T,
    /// Velocity that is added to all that translates, m/s.
    pub common: Vec3<T>,
}

impl<T: Lane> Carried<T> {
    /// `before` and `after`: at the positions before and after the projection, with the same
    /// generalised velocity. `mass`: of the whole, kg. `is_alone`: where nothing outside touches
    /// the system.
    #[inline(always)]
    pub(crate) fn new(
        before: EnergyMomentum<T>,
        after: EnergyMomentum<T>,
        mass: T,
        is_alone: T::Mask,
    ) -> Self {
        let (zero, one) = (mass.like(0.0), mass.like(1.0));
        let share = |before: T, after: T| {
            let ratio = (before.max(zero) / after).min(mass.like(RAISE));
            // At rest, and where the motion relative to the mass centre is rounding.
            T::select(zero.lt(after), ratio, one).sqrt()
        };
        let whole = share(before.kinetic, after.kinetic);
        let inner = |state: &EnergyMomentum<T>| {
            state.kinetic - state.momentum.dot(state.momentum) / (mass.like(2.0) * mass)
        };
        let relative = share(inner(&before), inner(&after));
        let shift = (before.momentum - after.momentum * relative) * (one / mass);
        Self {
            share: T::select(is_alone, relative, whole),
            common: Vec3::new(
                T::select(is_alone, shift.x, zero),
                T::select(is_alone, shift.y, zero),
                T::select(is_alone, shift.z, zero),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASSES: [f64; 2] = [1.0, 100.0];

    fn moving(velocities: &[Vec3<f64>; 2]) -> EnergyMomentum<f64> {
        let both = || MASSES.iter().zip(velocities);
        let kinetic = both().map(|(m, v)| 0.5 * m * v.dot(*v)).sum();
        let momentum = both().map(|(m, v)| *v * *m);
        EnergyMomentum {
            kinetic,
            momentum: momentum.fold(Vec3::new(0.0, 0.0, 0.0), |sum, p| sum + p),
        }
    }

    #[test]
    fn the_kinetic_energy_is_kept_and_alone_the_momentum_too() {
        let before = moving(&[Vec3::new(1.0, -2.0, 0.5), Vec3::new(0.1, 0.3, -0.2)]);
        let moved = [Vec3::new(3.0, -1.0, 0.0), Vec3::new(0.2, 0.2, -0.1)];
        for is_alone in [false, true] {
            let carried = Carried::new(before, moving(&moved), 101.0, is_alone);
            let after = moving(&moved.map(|v| carried.common + v * carried.share));
            assert!((after.kinetic - before.kinetic).abs() < 1e-14);
            let change = after.momentum - before.momentum;
            assert_eq!(change.norm() < 1e-13, is_alone);
        }
    }

    #[test]
    fn what_rests_stays_at_rest_and_no_velocity_is_raised_by_much() {
        let rest = moving(&[Vec3::new(0.0, 0.0, 0.0); 2]);
        let slow = moving(&[Vec3::new(1e-9, 0.0, 0.0); 2]);
        let fast = moving(&[Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 0.0, 0.0)]);
        for is_alone in [false, true] {
            assert!(Carried::new(rest, rest, 101.0, is_alone).share.is_finite());
            assert!(Carried::new(fast, slow, 101.0, is_alone).share < 1.5);
        }
    }
}
