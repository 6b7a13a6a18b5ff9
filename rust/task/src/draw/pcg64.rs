//! PCG64, the generator of NumPy's `default_rng`: equal states give equal numbers.
//!
//! The state is a linear congruential generator of 128 bits; a number is the exclusive or of its
//! halves, rotated by its six highest bits (XSL-RR).
//!
//! ```text
//! s ← a s + c  (mod 2¹²⁸),    x = rotr(s₆₄..₁₂₇ ⊕ s₀..₆₃, s₁₂₂..₁₂₇)
//! ```
//!
//! Source: O'Neill 2014. The mapping of its numbers to
//! doubles and integers is that of NumPy's `Generator`.

use super::seed_sequence::SeedSequence;

/// The multiplier a.
const MULTIPLIER: u128 = 0x2360_ED05_1FC6_5DA4_4385_DF64_9FCC_F645;

/// The numbers in `bit_generator.state["state"]` of NumPy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pcg64State {
    /// s.
    pub state: u128,
    /// c, which is odd.
    pub increment: u128,
}

impl Pcg64State {
    /// High and low half of the state, high and low half of the increment.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // the halves are meant
    pub fn halves(self) -> [u64; 4] {
        let Self { state, increment } = self;
        [
            (state >> 64) as u64,
            state as u64,
            (increment >> 64) as u64,
            increment as u64,
        ]
    }

    /// What [`Self::halves`] tells.
    #[must_use]
    pub fn from_halves([a, b, c, d]: [u64; 4]) -> Self {
        let join = |high: u64, low: u64| (u128::from(high) << 64) | u128::from(low);
        Self {
            state: join(a, b),
            increment: join(c, d),
        }
    }
}

/// A generator.
///
/// It keeps no spare 32 bits: NumPy's do not change by what is drawn here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pcg64(Pcg64State);

impl Pcg64 {
    /// The generator that `numpy.random.PCG64(seed)` makes; `seed` is a whole number of any size in
    /// 32-bit words, the lowest first.
    #[must_use]
    pub fn seeded(seed: &[u32]) -> Self {
        let [a, b, c, d] = SeedSequence::new(seed).words();
        let join = |high: u64, low: u64| (u128::from(high) << 64) | u128::from(low);
        let mut made = Self(Pcg64State {
            state: 0,
            increment: (join(c, d) << 1) | 1,
        });
        made.advance();
        made.0.state = made.0.state.wrapping_add(join(a, b));
        made.advance();
        made
    }

    /// The generator in a state; its increment is made odd.
    #[must_use]
    pub fn from_state(state: Pcg64State) -> Self {
        Self(Pcg64State {
            increment: state.increment | 1,
            ..state
        })
    }

    /// The state, from which [`Self::from_state`] continues.
    #[must_use]
    pub fn state(&self) -> Pcg64State {
        self.0
    }

    fn advance(&mut self) {
        let Pcg64State { state, increment } = self.0;
        self.0.state = state.wrapping_mul(MULTIPLIER).wrapping_add(increment);
    }

    /// The next 64 bits.
    #[allow(clippy::cast_possible_truncation)] // the halves and the six highest bits are meant
    pub fn bits(&mut self) -> u64 {
        self.advance();
        let s = self.0.state;
        ((s >> 64) as u64 ^ s as u64).rotate_right((s >> 122) as u32)
    }

    /// Uniform in [0, 1), a multiple of 2⁻⁵³; `Generator.random()`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * 2.0_f64.powi(-53)
    }

    /// Uniform in [low, high); `Generator.uniform(low, high)`.
    pub fn uniform(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A whole number below `bound`, without bias; `Generator.integers(bound)`.
    ///
    /// Source: Lemire 2019.
    ///
    /// # Panics
    /// If `bound` is not above 2³²: below it NumPy draws 32 bits and keeps the spare ones.
    #[allow(clippy::cast_possible_truncation)] // the lower half is meant
    pub fn below(&mut self, bound: u64) -> u64 {
        assert!(bound > 1 << 32, "invariant: a bound beyond 32 bits");
        let scaled = |bits: u64| u128::from(bits) * u128::from(bound);
        let mut product = scaled(self.bits());
        if (product as u64) < bound {
            let least = bound.wrapping_neg() % bound;
            while (product as u64) < least {
                product = scaled(self.bits());
            }
        }
        (product >> 64) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `Generator(PCG64(7))`: two of `integers(2**63)`, one `random()`, two of `uniform(-2, 3)`, a
    /// thousand of `integers(3 * 2**61)`, and the state afterwards.
    #[test]
    #[allow(clippy::float_cmp)] // bit for bit
    fn a_mixture_of_draws_is_that_of_numpy() {
        let mut made = Pcg64::seeded(&[7]);
        assert_eq!(made.below(1 << 63), 5_765_488_047_046_174_021);
        assert_eq!(made.below(1 << 63), 8_275_336_682_942_969_162);
        made.unit();
        assert_eq!(made.uniform([-2.0, 3.0]), -0.873_964_050_047_040_7);
        assert_eq!(made.uniform([-2.0, 3.0]), -0.499_168_575_443_872_83);
        let sum = (0..1000).fold(0_u64, |sum, _| sum.wrapping_add(made.below(3 << 61)));
        assert_eq!(sum, 0x81B9_538D_CC9D_FE6A);
        let state = Pcg64State {
            state: 0xDD1B_2FB1_ACA2_7EAB_AB92_5EE3_AB80_5C5D,
            increment: 0xC475_1896_CE8A_CEBF_6688_7F5A_C070_D959,
        };
        assert_eq!(made.state(), state);
    }

    #[test]
    fn numbers_lie_in_their_ranges() {
        let mut made = Pcg64::seeded(&[1]);
        for _ in 0..1000 {
            assert!((-2.0..3.0).contains(&made.uniform([-2.0, 3.0])));
            assert!(made.below(3 << 62) < 3 << 62);
        }
    }
}
