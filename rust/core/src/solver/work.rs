//! The work of a solve, counted and not timed, so that a budget ends it at
//! the same place on every machine.
//!
//! The unit is one multiplication with its addition in a product with `W`. Dense factors run in
//! vector registers and are counted at a fraction, so that a unit takes about as long everywhere: a
//! little more than a nanosecond on a shared server of 2.5 GHz.

/// Units of one contact solved exactly, beside its row of the product.
const ONE_CONTACT: u64 = 200;
/// Multiplications of a dense factorisation in one unit.
const DENSE: u64 = 4;

/// What a solve has spent of its budget.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::solver) struct Work {
    /// Units spent.
    pub spent: u64,
    /// Units allowed.
    pub budget: u64,
    /// Whether something was left undone for want of budget.
    pub is_exhausted: bool,
}

impl Work {
    /// Nothing spent yet.
    pub const fn new(budget: u64) -> Self {
        Self {
            spent: 0,
            budget,
            is_exhausted: false,
        }
    }

    /// Spends `cost`, or says that it is too much.
    #[inline]
    pub fn affords(&mut self, cost: u64) -> bool {
        let spent = self.spent + cost;
        if spent > self.budget {
            self.is_exhausted = true;
            return false;
        }
        self.spent = spent;
        true
    }
}

/// Units of one Gauss–Seidel sweep over `n_contacts` contacts.
pub(in crate::solver) fn sweep(product: u64, n_contacts: usize) -> u64 {
    product + ONE_CONTACT * n_contacts as u64
}

/// Units of a dense LU of `m` unknowns, or of half of it.
pub(in crate::solver) fn dense(m: usize, is_symmetric: bool) -> u64 {
    let m = m as u64;
    let shares = if is_symmetric { 6 } else { 3 };
    m * m * m / (shares * DENSE) + m * m
}

/// How long to sweep, and when to give up.
#[derive(Clone, Copy, Debug)]
pub(in crate::solver) struct SweepBudget {
    /// Most sweeps.
    pub sweeps: usize,
    /// Whether to stop as soon as the rate of the last sweeps would not
    /// reach the tolerance within the budget.
    pub predict: bool,
}
