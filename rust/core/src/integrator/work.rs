//! Work of a system's own forces over a step, and its energy balance.
//!
//! With V the energy stored in springs and position controls, besides gravity's:
//!
//! ```text
//! Δ(K + V_g + V) = supplied + released − dissipated − lost − removed + lifted
//! ```
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use std::ops::Add;

use super::report::StepReport;
use crate::scalar::Lane;

/// Work over a step, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work<T = f64> {
    /// By torques, motors and wrenches.
    pub supplied: T,
    /// Taken by dampers and by sand.
    pub damped: T,
    /// By springs and position controls, with the force that the step evaluated.
    pub of_springs: T,
}

impl<T: Lane> Work<T> {
    /// None. `zero`: 0 in every lane.
    #[inline(always)]
    pub(crate) fn none(zero: T) -> Self {
        Self {
            supplied: zero,
            damped: zero,
            of_springs: zero,
        }
    }

    /// Work of all forces.
    #[inline(always)]
    #[must_use]
    pub fn total(&self) -> T {
        self.supplied - self.damped + self.of_springs
    }

    /// The work of all with a motion that is `share` of it.
    #[must_use]
    pub fn times(&self, share: T) -> Self {
        Self {
            supplied: self.supplied * share,
            damped: self.damped * share,
            of_springs: self.of_springs * share,
        }
    }
}

impl<T: Lane> Add for Work<T> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            supplied: self.supplied + other.supplied,
            damped: self.damped + other.damped,
            of_springs: self.of_springs + other.of_springs,
        }
    }
}

/// What the report of a step says of its energy, J.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ledger<T = f64> {
    pub work: Work<T>,
    /// Change of the energy stored in springs and position controls.
    pub stored: T,
    /// Work of the contacts by their law.
    pub contact_work: T,
    /// By contacts that yield.
    pub released: T,
    /// By the audit.
    pub removed: T,
    /// Change of the kinetic energy and of that in gravity.
    pub change: T,
}

impl<T: Lane> Ledger<T> {
    /// Entries of the report: supplied, dissipated, lost, removed, released.
    ///
    /// A spring whose force is not that of the midpoint does less work than it releases: the scheme
    /// loses the rest.
    #[inline(always)]
    pub fn entries(&self) -> [T; 5] {
        let unexplained = self.change - (self.work.total() + self.released);
        let by_springs = self.work.of_springs + self.stored;
        [
            self.work.supplied,
            self.work.damped - self.contact_work,
            self.contact_work - unexplained - self.removed - by_springs,
            self.removed,
            self.released,
        ]
    }
}

impl StepReport {
    /// Adds the [entries](Ledger::entries) of a step or of a part of it.
    pub(crate) fn enter_energies(&mut self, entries: [f64; 5]) {
        let [supplied, dissipated, lost, removed, released] = entries;
        self.energy_supplied += supplied;
        self.energy_dissipated += dissipated;
        self.energy_lost += lost;
        self.energy_removed += removed;
        self.energy_released += released;
    }
}
