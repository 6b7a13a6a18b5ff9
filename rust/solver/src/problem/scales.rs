//! The scales of a problem: factors between a contact's velocity and its impulse, and units in
//! which no square overflows.

use super::{Dimension, FrictionContactProblem};

/// The scales of one contact, kg.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ContactScales {
    /// `ρ = d / tr W_ii`; 1 where the block has no positive trace.
    pub mass: f64,
    /// `[ρ_N, ρ_T]`: inverse of `W_NN` and of the mean tangential diagonal;
    /// `ρ` where that is not positive.
    pub modes: [f64; 2],
}

impl ContactScales {
    /// From `W_NN` and the sum of the tangential diagonal entries, 1/kg.
    #[inline]
    pub(crate) fn new<const D: usize>(normal: f64, tangential: f64) -> Self {
        let (own, mean) = (normal + tangential, tangential / (D - 1) as f64);
        let mass = if own > 0.0 { D as f64 / own } else { 1.0 };
        let inverse = |x: f64| if x > 0.0 { 1.0 / x } else { mass };
        Self {
            mass,
            modes: [inverse(normal), inverse(mean)],
        }
    }
}

/// The scales of contact `contact`, kg.
#[inline]
pub(crate) fn contact_scales(
    problem: &FrictionContactProblem<'_>,
    contact: usize,
) -> ContactScales {
    let (dimension, n, W) = (
        problem.dimension(),
        problem.n_unknowns(),
        problem.operator(),
    );
    let entry = |k| W.diagonal(dimension, n, contact, k);
    match dimension {
        Dimension::Two => ContactScales::new::<2>(entry(0), entry(1)),
        Dimension::Three => ContactScales::new::<3>(entry(0), entry(1) + entry(2)),
    }
}

/// The largest power of two within `x`, for exact scaling; 1 for what is not positive and finite.
#[inline]
pub(crate) fn power_of_two(x: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    if x > 0.0 && x.is_finite() {
        f64::from_bits(x.to_bits() & EXPONENT).max(f64::MIN_POSITIVE)
    } else {
        1.0
    }
}

/// The scales of all contacts, kept between solves so that none allocates.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scales {
    /// Mass of each contact, kg.
    pub masses: Vec<f64>,
    /// Normal and tangential scale of each contact, kg.
    pub modes: Vec<[f64; 2]>,
}

impl Scales {
    /// Makes room for `n_contacts`; the contents are unspecified.
    #[inline]
    pub fn resize(&mut self, n_contacts: usize) {
        self.masses.resize(n_contacts, 0.0);
        self.modes.resize(n_contacts, [0.0; 2]);
    }
}
