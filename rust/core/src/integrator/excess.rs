//! By how much the energy of a step exceeds what was supplied.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::scalar::{Lane, Vec3};

/// Excess, as a fraction of the kinetic energy, above which the step is repeated.
const COARSE: f64 = 1e-3;

/// Rounding errors allowed in the difference of two energies.
const ROUNDINGS: f64 = 64.0;

/// Largest relative increase of the energy of free motion in a step.
const RAISE: f64 = 1.0;

/// Excess of the change of the energy over what was supplied, and what it is compared with, J.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Excess<T> {
    pub value: T,
    /// Kinetic energy after the step.
    kinetic: T,
    /// The kinetic energy at hand. A machine at rest has none as a measure: at least what gravity
    /// adds in a step of free fall.
    size: T,
    /// Rounding of the balance.
    rounding: T,
}

impl<T: Lane> Excess<T> {
    /// `before` and `after`: kinetic and potential energy; `supplied`: work of the actuators, and
    /// what contacts release; `fall`: speed of a body that falls for the step from rest, m/s.
    #[inline(always)]
    pub(crate) fn new(
        before: [T; 2],
        after: [T; 2],
        [work, released]: [T; 2],
        (mass, fall): (T, T),
    ) -> Self {
        let [kinetic, _] = after;
        let change = (after[0] - before[0]) + (after[1] - before[1]);
        let least = work.like(0.5) * mass * fall * fall;
        let sizes = before[0].abs() + after[0].abs() + before[1].abs() + after[1].abs();
        Self {
            value: change - (work + released),
            kinetic,
            size: before[0].max(kinetic).max(least),
            rounding: work.like(ROUNDINGS * f64::EPSILON) * (sizes + work.abs()),
        }
    }

    /// Free flight may neither gain nor lose.
    #[inline(always)]
    fn measured(&self, is_free: T::Mask) -> T {
        T::select(is_free, self.value.abs(), self.value)
    }

    /// Where the step is accepted as it is; `gain` and, in free flight, `drift`: fractions of the
    /// kinetic energy.
    #[inline(always)]
    pub(crate) fn is_balanced(&self, is_free: T::Mask, [gain, drift]: [T; 2]) -> T::Mask {
        let allowed = self.rounding + T::select(is_free, drift, gain) * self.size;
        self.measured(is_free).le(allowed)
    }

    /// Where the excess is coarse, or some remains at v⁺ = 0. An excess that is not finite is
    /// coarse.
    #[inline(always)]
    pub(crate) fn is_coarse(&self, is_free: T::Mask, gain: T) -> T::Mask {
        let coarse = self.size.like(COARSE) * self.size;
        !self.measured(is_free).le(coarse) | self.is_left(gain)
    }

    /// Where an excess remains at v⁺ = 0.
    #[inline(always)]
    pub(crate) fn is_left(&self, gain: T) -> T::Mask {
        !(self.value - self.kinetic).le(self.rounding + gain * self.size)
    }

    /// Where there is more energy than supplied.
    #[inline(always)]
    pub(crate) fn is_gain(&self) -> T::Mask {
        self.value.like(0.0).lt(self.value)
    }

    /// Excess beyond rounding, as a fraction of the kinetic energy.
    #[inline(always)]
    pub(crate) fn relative(&self) -> T {
        let (zero, tiny) = (self.value.like(0.0), self.value.like(f64::MIN_POSITIVE));
        (self.value - self.rounding).max(zero) / self.size.max(tiny)
    }

    /// Scale of the velocity that removes it.
    #[inline(always)]
    pub(crate) fn share(&self) -> T {
        let (zero, one) = (self.value.like(0.0), self.value.like(1.0));
        (one - self.value / self.kinetic).max(zero).sqrt()
    }

    /// Scale of the motion relative to the mass centre that removes it, and where it is no larger
    /// than the energy of that motion.
    #[inline(always)]
    pub(crate) fn share_of_relative_motion(&self, momentum: Vec3<T>, mass: T) -> (T, T::Mask) {
        let one = mass.like(1.0);
        let whole = momentum.dot(momentum) / (mass.like(2.0) * mass);
        let relative = self.kinetic - whole;
        let share = (one - self.value / relative)
            .min(mass.like(1.0 + RAISE))
            .sqrt();
        (share, self.value.lt(relative))
    }
}
