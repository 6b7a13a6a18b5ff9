//! Whether a rover's steps are ordinary, and if not, why.

use thiserror::Error;

use super::rover::RoverSimulation;
use crate::integrator::{StepOptions, Variant};
use crate::lanes::machine::{Machine, NotOrdinary};
use crate::scalar::Instructions;
use crate::solver::Method;

/// Why no step of a simulation is ordinary.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NeverOrdinary {
    /// The machine has no ordinary step.
    #[error(transparent)]
    Machine(#[from] NotOrdinary),
    /// The variant is not [`Variant::Linearised`].
    #[error("the variant is Newton's")]
    Variant,
    /// Contacts bounce.
    #[error("the restitution is {0}, not 0")]
    Restitution(f64),
    /// The solver does not start from the last impulses.
    #[error("the warm start is off")]
    WarmStart,
    /// The solver's method is not [`Method::Auto`].
    #[error("the solver's method is chosen, not automatic")]
    Method,
}

impl RoverSimulation {
    /// Why none of its steps is ordinary; None if they are, save those that [`crate::lanes`]
    /// declines.
    #[must_use]
    pub fn never_ordinary(&self) -> Option<NeverOrdinary> {
        of_options(self.options()).or_else(|| Some(Machine::of(self.model()).err()?.into()))
    }

    /// Rovers to a register in its ordinary steps, in a batch on this machine; 1 if it has none.
    #[must_use]
    pub fn lanes(&self) -> usize {
        match self.never_ordinary() {
            Some(_) => 1,
            None => Instructions::of_this_machine().lanes(),
        }
    }
}

fn of_options(options: &StepOptions) -> Option<NeverOrdinary> {
    if options.variant != Variant::Linearised {
        Some(NeverOrdinary::Variant)
    } else if options.restitution != 0.0 {
        Some(NeverOrdinary::Restitution(options.restitution))
    } else if !options.warm_start {
        Some(NeverOrdinary::WarmStart)
    } else if options.solver.method != Method::Auto {
        Some(NeverOrdinary::Method)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::step::admits;
    use crate::solver::SolverOptions;

    #[test]
    fn there_is_a_reason_for_exactly_the_options_that_are_not_admitted() {
        for k in 0..16_u8 {
            let is = |bit: u8| k >> bit & 1 == 1;
            let options = StepOptions {
                variant: [Variant::Linearised, Variant::Newton][usize::from(is(0))],
                restitution: if is(1) { 0.2 } else { 0.0 },
                warm_start: !is(2),
                solver: SolverOptions {
                    method: [Method::Auto, Method::Newton][usize::from(is(3))],
                    ..SolverOptions::default()
                },
                ..StepOptions::default()
            };
            assert_eq!(of_options(&options).is_none(), admits(&options), "{k}");
        }
    }
}
