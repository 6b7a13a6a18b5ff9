//! Accuracy by request: step, scheme and tolerance for a given error of the path.
//!
//! The numbers are measured (`make chart`, `docs/accuracy.md`). The error of a path is proportional
//! to the step: over 22 m of a curve on flat ground its root mean square is 0.21 m/s times the
//! step, for steps from 0.1 to 50 ms. On rocks the error is larger and a single drive is not
//! representative: `docs/tables/comparison.md` has medians and quartiles over ensembles.

use super::options::{StepOptions, Variant};

/// Available steps, s, coarsest first.
const STEPS: [f64; 8] = [0.02, 0.01, 0.005, 0.002, 0.001, 5e-4, 2e-4, 1e-4];

/// Error of the path on flat ground divided by the step, m/s: the measured 0.21 plus a fifth.
const ERROR_PER_STEP: f64 = 0.25;

/// Step, scheme and tolerance of the contact solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// h, s.
    pub time_step: f64,
    /// Scheme.
    pub variant: Variant,
    /// Relative tolerance of the contact solver.
    pub tolerance: f64,
}

impl Accuracy {
    /// 20 ms to 1e-10: for learning and planning. With 1e-8 a parked rover collects energy by what
    /// the solver leaves, and each of its steps is repeated.
    pub const FAST: Self = Self {
        time_step: 0.02,
        variant: Variant::Linearised,
        tolerance: 1e-10,
    };
    /// The defaults of [`StepOptions`]: 5 ms to 1e-12.
    pub const BALANCED: Self = Self {
        time_step: 0.005,
        variant: Variant::Linearised,
        tolerance: 1e-12,
    };
    /// 0.2 ms to 1e-12: the reference for comparisons.
    ///
    /// Uses the linearised scheme: the Newton variant is just as far from the finest paths, over
    /// rocks too, at two to three times the cost.
    pub const REFERENCE: Self = Self {
        time_step: 2e-4,
        variant: Variant::Linearised,
        tolerance: 1e-12,
    };
    /// Smallest error that [`Self::for_error`] promises, m.
    pub const FINEST: f64 = ERROR_PER_STEP * STEPS[STEPS.len() - 1];

    /// The coarsest step whose path on 20 m of flat ground stays within an
    /// error (m); none below [`Self::FINEST`].
    #[must_use]
    pub fn for_error(metres: f64) -> Option<Self> {
        let fits = |h: &f64| ERROR_PER_STEP * h <= metres * (1.0 + 1e-12);
        STEPS.into_iter().find(fits).map(|time_step| Self {
            time_step,
            ..Self::BALANCED
        })
    }

    /// Writes these values into options.
    pub fn apply(&self, options: &mut StepOptions) {
        options.time_step = self.time_step;
        options.variant = self.variant;
        options.solver.tolerance = self.tolerance;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balanced_is_the_default() {
        let mut options = StepOptions::default();
        Accuracy::BALANCED.apply(&mut options);
        assert_eq!(options, StepOptions::default());
    }

    #[test]
    fn finer_accuracies_have_finer_steps_and_tolerances() {
        let names = [Accuracy::FAST, Accuracy::BALANCED, Accuracy::REFERENCE];
        assert!(names.windows(2).all(|w| w[0].time_step > w[1].time_step));
        assert!(names.windows(2).all(|w| w[0].tolerance >= w[1].tolerance));
    }

    #[test]
    fn a_smaller_error_never_gets_a_larger_step() {
        let step = |metres| Accuracy::for_error(metres).map(|a| a.time_step);
        assert_eq!(step(1.0), Some(0.02));
        assert_eq!(step(0.005), Some(0.02));
        assert_eq!(step(0.0049), Some(0.01));
        assert_eq!(step(Accuracy::FINEST), Some(1e-4));
        assert_eq!(step(0.9 * Accuracy::FINEST), None);
        assert_eq!(step(f64::NAN), None);
        assert_eq!(step(-1.0), None);
    }
}
