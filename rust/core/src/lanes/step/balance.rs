//! The energy balance of a step, and its audit as [`crate::integrator::energy_audit`] does it.

use crate::integrator::StepReport;
use crate::integrator::energy_audit::{COARSE, GAIN, RAISE, ROUNDINGS};
use crate::scalar::{Lane, MAX_LANES, Vec3};

/// What the energies of a step are judged by.
pub(super) struct Conditions<T: Lane> {
    /// Mass, kg.
    pub mass: T,
    /// Speed of a body that falls for the step from rest, m/s.
    pub fall: T,
    /// Lanes without a contact, and those of them whose scheme conserves energy.
    pub untouched: T::Mask,
    pub is_free: T::Mask,
}

/// Energies of the lanes over a step, J.
pub(super) struct Balance<T: Lane> {
    /// Kinetic and potential energy at the start and at the end of the step.
    pub before: [T; 2],
    pub after: [T; 2],
    /// Linear momentum at the end of the step, kg m/s.
    pub momentum: Vec3<T>,
    /// Work of the actuators and of wheels that yield; the latter's alone.
    pub supplied: T,
    pub released: T,
    /// Work of the contacts by their law.
    pub contact_work: T,
    /// Energy beyond what was supplied; what the audit removed of it; what is left of it, as a
    /// fraction of the kinetic energy.
    excess: T,
    removed: T,
    gain: T,
    /// Lanes whose velocity the audit corrects.
    pub is_corrected: T::Mask,
}

impl<T: Lane> Balance<T> {
    /// Nothing.
    pub fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            before: [zero; 2],
            after: [zero; 2],
            momentum: Vec3::splat(token, [0.0; 3]),
            supplied: zero,
            released: zero,
            contact_work: zero,
            excess: zero,
            removed: zero,
            gain: zero,
            is_corrected: T::mask(token, 0),
        }
    }

    /// Measures the excess of energy. Returns the lanes whose step must be taken otherwise; of the
    /// others, those with too much are [to be corrected](Self::correct).
    ///
    /// `work`: the actuators'; `released`: by wheels that yield, J.
    #[inline(always)]
    pub fn audit(
        &mut self,
        (work, released): (T, T),
        conditions: &Conditions<T>,
        going: T::Mask,
    ) -> T::Mask {
        let zero = work.like(0.0);
        let ([kinetic, potential], [end_kinetic, end_potential]) = (self.before, self.after);
        self.released = released;
        self.supplied = work + released;
        let excess = (end_kinetic - kinetic) + (end_potential - potential) - self.supplied;
        let Conditions {
            mass,
            fall,
            is_free,
            ..
        } = *conditions;
        let least = zero.like(0.5) * mass * fall * fall;
        let size = kinetic.max(end_kinetic).max(least);
        let sum =
            kinetic.abs() + end_kinetic.abs() + potential.abs() + end_potential.abs() + work.abs();
        let rounding = zero.like(ROUNDINGS * f64::EPSILON) * sum;
        let allowed = rounding + T::select(is_free, zero, zero.like(GAIN) * size);
        let measured = T::select(is_free, excess.abs(), excess);
        let is_balanced = measured.le(allowed);
        let left = excess - end_kinetic;
        let is_left = !left.le(rounding + zero.like(GAIN) * size);
        // What is not finite is not within the bounds either.
        let is_coarse = !measured.le(zero.like(COARSE) * size) | is_left;
        let is_lost = is_coarse & !is_balanced;
        self.is_corrected = !is_balanced & going & !is_lost;
        self.excess = excess;
        let gain = (excess - rounding).max(zero) / size.max(zero.like(f64::MIN_POSITIVE));
        self.gain = T::select(self.is_corrected, zero, gain);
        self.removed = T::select(self.is_corrected, excess.max(zero), zero);
        is_lost
    }

    /// Removes the excess from the velocity `v` at the end of the step. Returns the lanes whose
    /// whole velocity was shortened, and by which factor.
    #[inline(always)]
    pub fn correct(&self, conditions: &Conditions<T>, v: &mut [T]) -> (T::Mask, T) {
        let excess = self.excess;
        let (zero, one) = (excess.like(0.0), excess.like(1.0));
        let [kinetic, _] = self.after;
        let (lanes, mass, momentum) = (self.is_corrected, conditions.mass, self.momentum);
        let whole = momentum.dot(momentum) / (mass.like(2.0) * mass);
        let relative = kinetic - whole;
        let is_relative =
            conditions.untouched & (conditions.is_free | zero.lt(excess)) & excess.lt(relative);
        let all = (one - excess / kinetic).max(zero).sqrt();
        let of_relative = (one - excess / relative).min(one.like(1.0 + RAISE)).sqrt();
        let share = T::select(is_relative, of_relative, all);
        // Free flight that loses more than its relative energy is left as it is.
        let lanes = lanes & (is_relative | zero.lt(excess));
        let translation = momentum * (one / mass);
        let common = [translation.x, translation.y, translation.z];
        for (k, v) in v.iter_mut().enumerate() {
            let common = if k < 3 {
                T::select(is_relative, common[k], zero)
            } else {
                zero
            };
            *v = T::select(lanes, common + share * (*v - common), *v);
        }
        (lanes & !is_relative, share)
    }

    /// Enters the balance into the lanes' reports.
    #[inline(always)]
    pub fn report(&self, reports: &mut [StepReport; MAX_LANES]) {
        let [kinetic, potential] = self.before;
        let change = (self.after[0] - kinetic) + (self.after[1] - potential);
        let lost = self.contact_work - (change - self.supplied) - self.removed;
        let mut entries = [[0.0; MAX_LANES]; 5];
        let balance = [
            self.gain,
            self.removed,
            self.contact_work,
            lost,
            self.released,
        ];
        for (entry, x) in entries.iter_mut().zip(balance) {
            x.store(&mut entry[..T::LANES]);
        }
        for (lane, report) in reports[..T::LANES].iter_mut().enumerate() {
            report.energy_gain = entries[0][lane];
            report.energy_removed = entries[1][lane];
            report.energy_dissipated = -entries[2][lane];
            report.energy_lost = entries[3][lane];
            report.energy_released = entries[4][lane];
        }
    }
}

/// `yes` in the lanes of a mask, `no` elsewhere.
#[inline(always)]
pub(super) fn select_both<T: Lane>(lanes: T::Mask, yes: [T; 2], no: [T; 2]) -> [T; 2] {
    [0, 1].map(|k| T::select(lanes, yes[k], no[k]))
}
