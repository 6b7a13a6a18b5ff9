//! The work of a solve. It is counted, not timed, so that a budget ends the solve at the same point
//! on every machine.
//!
//! The unit is one multiply–add in a product with `W`. Dense factorisations run in vector registers
//! and count at a fraction, so that a unit takes about the same time everywhere: a little more than
//! a nanosecond on a shared server of 2.5 GHz.

/// Units of one exact contact solution, in addition to its row of the product.
const ONE_CONTACT: u64 = 200;
/// Multiply–adds of a dense factorisation that make one unit.
const DENSE: u64 = 4;

/// Budget of a solve and the part of it that is spent.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::solver) struct WorkBudget {
    /// Units spent.
    pub spent: u64,
    /// Units allowed.
    pub budget: u64,
    /// Whether some work was refused for lack of budget.
    pub is_exhausted: bool,
    /// Factorisations since the last stage that was listed.
    pub factorisations: u32,
}

impl WorkBudget {
    /// Nothing spent yet.
    pub const fn new(budget: u64) -> Self {
        Self {
            spent: 0,
            budget,
            is_exhausted: false,
            factorisations: 0,
        }
    }

    /// Spends `cost`; false if the budget does not allow it.
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

/// Units of one pivot in a tableau of `n` pairs.
pub(in crate::solver) fn tableau_pivot(n: usize) -> u64 {
    (n * (n + 2)) as u64 / DENSE
}

/// Limits of the sweeps.
#[derive(Clone, Copy, Debug)]
pub(in crate::solver) struct SweepBudget {
    /// Most sweeps.
    pub sweeps: usize,
    /// Whether to stop as soon as the convergence rate of the last sweeps would miss the tolerance
    /// within the budget.
    pub predict: bool,
}
