//! The energy balance of a step, and its audit as [`crate::integrator::energy_audit`] does it.

use crate::integrator::StepReport;
use crate::integrator::energy_audit::{Excess, GAIN};
use crate::integrator::work::{Ledger, Work};
use crate::multibody::mechanism::TreeSpan;
use crate::scalar::{Lane, MAX_LANES, Vec3};

/// What the energies of a step are judged by.
pub(super) struct Conditions<T: Lane> {
    /// Mass, kg.
    pub mass: T,
    /// Speed of a body that falls for the step from rest, m/s.
    pub fall: T,
    /// Lanes that nothing outside touches, and those of them without a contact whose scheme
    /// conserves energy.
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
    /// Work of the machine's own forces, and change of the energy that its springs store.
    pub work: Work<T>,
    pub stored: T,
    /// By wheels that yield.
    released: T,
    /// Work of the contacts by their law.
    pub contact_work: T,
    /// Energy beyond what was supplied; what the audit removed of it; what is left of it, as a
    /// fraction of the kinetic energy.
    excess: Option<Excess<T>>,
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
            work: Work {
                supplied: zero,
                damped: zero,
                of_springs: zero,
            },
            stored: zero,
            released: zero,
            contact_work: zero,
            excess: None,
            removed: zero,
            gain: zero,
            is_corrected: T::mask(token, 0),
        }
    }

    /// Measures the excess of energy. Returns the lanes whose step must be taken otherwise; of the
    /// others, those with too much are [to be corrected](Self::correct).
    ///
    /// `released`: by wheels that yield, J.
    #[inline(always)]
    pub fn audit(&mut self, released: T, conditions: &Conditions<T>, going: T::Mask) -> T::Mask {
        let work = self.work.total();
        let (zero, gain) = (work.like(0.0), work.like(GAIN));
        let Conditions {
            mass,
            fall,
            is_free,
            ..
        } = *conditions;
        self.released = released;
        let excess = Excess::new(self.before, self.after, [work, released], (mass, fall));
        let is_balanced = excess.is_balanced(is_free, [gain, zero]);
        let is_lost = excess.is_coarse(is_free, gain) & !is_balanced;
        self.is_corrected = !is_balanced & going & !is_lost;
        self.excess = Some(excess);
        self.gain = T::select(self.is_corrected, zero, excess.relative());
        self.removed = T::select(self.is_corrected, excess.value.max(zero), zero);
        is_lost
    }

    /// Removes the excess from the velocity `v` at the end of the step. Returns the lanes whose
    /// local velocities are shortened, and by which factor.
    #[inline(always)]
    pub fn correct(
        &self,
        conditions: &Conditions<T>,
        trees: &[TreeSpan],
        v: &mut [T],
    ) -> (T::Mask, T) {
        let zero = conditions.mass.like(0.0);
        let Some(excess) = self.excess else {
            return (self.is_corrected & !self.is_corrected, zero);
        };
        let (lanes, mass, momentum) = (self.is_corrected, conditions.mass, self.momentum);
        let (of_relative, is_enough) = excess.share_of_relative_motion(momentum, mass);
        let (is_free, is_gain) = (conditions.is_free, zero.lt(excess.value));
        let is_relative = conditions.untouched & (is_free | is_gain) & is_enough;
        let share = T::select(is_relative, of_relative, excess.share());
        // Free flight that loses more than its relative energy is left as it is.
        let lanes = lanes & (is_relative | is_gain);
        let translation = momentum * (mass.like(1.0) / mass);
        let common = [translation.x, translation.y, translation.z];
        for tree in trees {
            for (k, v) in v[tree.velocities.clone()].iter_mut().enumerate() {
                let common = if k < 3 {
                    T::select(is_relative, common[k], zero)
                } else {
                    zero
                };
                *v = T::select(lanes, common + share * (*v - common), *v);
            }
        }
        (lanes, share)
    }

    /// Enters the balance into the lanes' reports.
    #[inline(always)]
    pub fn report(&self, reports: &mut [StepReport; MAX_LANES]) {
        let [kinetic, potential] = self.before;
        let ledger = Ledger {
            work: self.work,
            stored: self.stored,
            contact_work: self.contact_work,
            released: self.released,
            removed: self.removed,
            change: (self.after[0] - kinetic) + (self.after[1] - potential),
        };
        let (mut gain, mut entries) = ([0.0; MAX_LANES], [[0.0; MAX_LANES]; 5]);
        self.gain.store(&mut gain[..T::LANES]);
        for (entry, x) in entries.iter_mut().zip(ledger.entries()) {
            x.store(&mut entry[..T::LANES]);
        }
        for (lane, report) in reports[..T::LANES].iter_mut().enumerate() {
            report.energy_gain = gain[lane];
            report.enter_energies(entries.map(|entry| entry[lane]));
        }
    }
}

/// `yes` in the lanes of a mask, `no` elsewhere.
#[inline(always)]
pub(super) fn select_both<T: Lane>(lanes: T::Mask, yes: [T; 2], no: [T; 2]) -> [T; 2] {
    [0, 1].map(|k| T::select(lanes, yes[k], no[k]))
}
