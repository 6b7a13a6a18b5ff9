//! The energy balance of a step and its audit; see [`super::audit`].
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::excess::Excess;
use super::report::StepReport;
use super::work::{Ledger, Work};
use crate::scalar::{Lane, MAX_LANES, Vec3};

/// Largest gain in a step that is tolerated, as a fraction of the kinetic energy.
pub(crate) const GAIN: f64 = 5e-10;

/// What the energies of a step are judged by.
pub(crate) struct Conditions<T: Lane> {
    /// Mass, kg.
    pub mass: T,
    /// Speed of a body that falls for the step from rest, m/s.
    pub fall: T,
    /// Lanes that nothing outside touches, and those of them without a contact whose scheme
    /// conserves energy.
    pub untouched: T::Mask,
    pub is_free: T::Mask,
}

/// Limits of an audit, as fractions of the kinetic energy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AuditLimits {
    /// What may be gained, see [`GAIN`].
    pub gain: f64,
    /// What free flight may gain or lose: an error of the scheme's order that does not accumulate.
    pub drift: f64,
}

impl AuditLimits {
    /// The limits of a whole step.
    pub const USUAL: Self = Self {
        gain: GAIN,
        drift: 0.0,
    };
}

/// Energies of the clusters over a step, J.
#[derive(Clone, Debug)]
pub(crate) struct Energies<T: Lane> {
    /// Kinetic and potential energy at the start and at the end of the step.
    pub before: Vec<[T; 2]>,
    pub after: Vec<[T; 2]>,
    /// After the projection.
    pub lifted: Vec<[T; 2]>,
    /// Kinetic energies and momenta of the groups after the projection, kg m/s; and how their
    /// velocities are carried there.
    pub kinetic: Vec<T>,
    pub momentum: [Vec<T>; 3],
    /// Work of the own forces, and of contacts that yield.
    pub of_drives: Vec<Work<T>>,
    pub released: Vec<T>,
    /// What wheels that yield hold before and after the step, and what they gave.
    pub elastic: [Vec<T>; 3],
    /// Sums over the contacts.
    pub of_contacts: [Vec<T>; 4],
    /// Masses, kg, and numbers and lanes on their way from group to cluster.
    pub mass: Vec<T>,
    /// What the springs store before and after the step or the projection.
    pub stored: [Vec<T>; 2],
    pub number: Vec<T>,
    pub in_touch: Vec<T::Mask>,
    pub on_ground: Vec<T::Mask>,
}

impl<T: Lane> Default for Energies<T> {
    /// Energies of no cluster: all lists are empty.
    fn default() -> Self {
        Self {
            before: Vec::new(),
            after: Vec::new(),
            lifted: Vec::new(),
            kinetic: Vec::new(),
            momentum: std::array::from_fn(|_| Vec::new()),
            of_drives: Vec::new(),
            released: Vec::new(),
            elastic: std::array::from_fn(|_| Vec::new()),
            of_contacts: std::array::from_fn(|_| Vec::new()),
            mass: Vec::new(),
            stored: [Vec::new(), Vec::new()],
            number: Vec::new(),
            in_touch: Vec::new(),
            on_ground: Vec::new(),
        }
    }
}

impl<T: Lane> Energies<T> {
    /// Nothing, of so many clusters.
    pub fn new(token: T::Token, n: usize) -> Self {
        let zeros = || vec![T::splat(token, 0.0); n];
        let both = || vec![[T::splat(token, 0.0); 2]; n];
        Self {
            before: both(),
            after: both(),
            lifted: both(),
            kinetic: zeros(),
            momentum: std::array::from_fn(|_| zeros()),
            of_drives: vec![Work::none(T::splat(token, 0.0)); n],
            released: zeros(),
            elastic: std::array::from_fn(|_| zeros()),
            of_contacts: std::array::from_fn(|_| zeros()),
            mass: zeros(),
            stored: [zeros(), zeros()],
            number: zeros(),
            in_touch: vec![T::mask(token, 0); n],
            on_ground: vec![T::mask(token, 0); n],
        }
    }
}

/// Energies of a group over a step, J; 0 in the lanes of a cluster that does not lead it.
#[derive(Clone, Debug)]
pub(crate) struct Balance<T: Lane> {
    /// Kinetic and potential energy at the start and at the end of the step.
    pub before: [T; 2],
    pub after: [T; 2],
    /// Linear momentum at the end of the step, kg m/s.
    pub momentum: Vec3<T>,
    /// Work of the machine's own forces, and change of the energy that its springs store.
    pub work: Work<T>,
    pub stored: T,
    /// By wheels that yield.
    pub released: T,
    /// Work of the contacts by their law.
    pub contact_work: T,
    /// Energy beyond what was supplied; what the audit removed of it; what is left of it, as a
    /// fraction of the kinetic energy.
    pub excess: Option<Excess<T>>,
    removed: T,
    gain: T,
    /// Lanes whose step must be taken otherwise, and those whose velocity the audit corrects.
    pub is_lost: T::Mask,
    pub is_corrected: T::Mask,
}

/// How the audit corrects the velocity of a group: lanes, the share that is left of the motion, and
/// the lanes in which it is left relative to a translation, m/s.
#[derive(Clone, Copy)]
pub(crate) struct Correction<T: Lane> {
    pub lanes: T::Mask,
    pub share: T,
    pub is_relative: T::Mask,
    pub translation: [T; 3],
}

impl<T: Lane> Correction<T> {
    /// Corrects a velocity; `axis`: along which it translates its tree, if it does.
    #[inline(always)]
    pub fn apply(&self, axis: Option<usize>, v: T) -> T {
        let zero = self.share.like(0.0);
        let common = axis.map_or(zero, |axis| {
            T::select(self.is_relative, self.translation[axis], zero)
        });
        T::select(self.lanes, common + self.share * (v - common), v)
    }

    /// Takes over another's lane.
    pub fn take(&mut self, token: T::Token, lane: usize, other: &Self) {
        let own = T::mask(token, 1 << lane);
        self.lanes = (self.lanes & !own) | (other.lanes & own);
        self.is_relative = (self.is_relative & !own) | (other.is_relative & own);
        self.share.set(lane, other.share.get(lane));
        for (own, other) in self.translation.iter_mut().zip(&other.translation) {
            own.set(lane, other.get(lane));
        }
    }
}

impl<T: Lane> Balance<T> {
    /// Nothing.
    pub fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            before: [zero; 2],
            after: [zero; 2],
            momentum: Vec3::splat(token, [0.0; 3]),
            work: Work::none(zero),
            stored: zero,
            released: zero,
            contact_work: zero,
            excess: None,
            removed: zero,
            gain: zero,
            is_lost: T::mask(token, 0),
            is_corrected: T::mask(token, 0),
        }
    }

    /// Measures the excess of energy, and finds the lanes that are lost or corrected.
    ///
    /// `released`: by wheels that yield, J. `last`: lanes with no other way to take the step.
    #[inline(always)]
    pub fn audit(
        &mut self,
        released: T,
        conditions: &Conditions<T>,
        limits: AuditLimits,
        [going, last]: [T::Mask; 2],
    ) {
        let work = self.work.total();
        let (zero, gain, drift) = (
            work.like(0.0),
            work.like(limits.gain),
            work.like(limits.drift),
        );
        let Conditions {
            mass,
            fall,
            is_free,
            ..
        } = *conditions;
        self.released = released;
        let excess = Excess::new(self.before, self.after, [work, released], (mass, fall));
        let is_balanced = excess.is_balanced(is_free, [gain, drift]);
        self.is_lost = excess.is_coarse(is_free, gain) & !is_balanced & going & !last;
        self.is_corrected = !is_balanced & going & !self.is_lost & excess.value.is_finite();
        self.excess = Some(excess);
        self.gain = T::select(self.is_corrected, zero, excess.relative());
        self.removed = T::select(self.is_corrected, excess.value.max(zero), zero);
    }

    /// How the excess is removed from the velocity at the end of the step.
    #[inline(always)]
    pub fn correction(&self, conditions: &Conditions<T>) -> Correction<T> {
        let (lanes, mass, momentum) = (self.is_corrected, conditions.mass, self.momentum);
        let Some(excess) = self.excess else {
            let zero = mass.like(0.0);
            return Correction {
                lanes: lanes & !lanes,
                share: zero,
                is_relative: lanes,
                translation: [zero; 3],
            };
        };
        let (of_relative, is_enough) = excess.share_of_relative_motion(momentum, mass);
        let (is_free, is_gain) = (conditions.is_free, excess.is_gain());
        let is_relative = conditions.untouched & (is_free | is_gain) & is_enough;
        let translation = momentum * (mass.like(1.0) / mass);
        Correction {
            // Free flight that loses more than its relative energy is left as it is.
            lanes: lanes & (is_relative | is_gain),
            share: T::select(is_relative, of_relative, excess.share()),
            is_relative,
            translation: [translation.x, translation.y, translation.z],
        }
    }

    /// Adds the balance to the lanes' reports.
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
            report.energy_gain = report.energy_gain.max(gain[lane]);
            report.enter_energies(entries.map(|entry| entry[lane]));
        }
    }
}

/// `yes` in the lanes of a mask, `no` elsewhere.
#[inline(always)]
pub(crate) fn select_both<T: Lane>(lanes: T::Mask, yes: [T; 2], no: [T; 2]) -> [T; 2] {
    [0, 1].map(|k| T::select(lanes, yes[k], no[k]))
}
