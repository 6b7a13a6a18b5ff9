//! The scalar of the lane sources: one rover, or several side by side in a register.
//!
//! Sources that are generic over [`Lane`] run as `f64` and as four or eight lanes. Every operation
//! is the IEEE one in every lane: no fused multiply-add, no approximate reciprocal, no branch on a
//! lane's value. A lane therefore has the bits of the same source run as `f64`.

use std::fmt::Debug;
use std::ops::{
    Add, AddAssign, BitAnd, BitOr, Div, DivAssign, Mul, MulAssign, Neg, Not, Sub, SubAssign,
};

use super::instructions::Single;

/// One truth value a lane.
pub trait LaneMask:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + Not<Output = Self>
{
    /// Bit k is the value of lane k; higher bits are zero.
    fn bits(self) -> u32;

    /// Whether any lane is true.
    fn any(self) -> bool;

    /// Whether all lanes are true.
    fn all(self) -> bool;

    /// The value of a lane.
    #[inline(always)]
    fn get(self, lane: usize) -> bool {
        self.bits() >> lane & 1 == 1
    }
}

/// A number a lane, with the arithmetic of `f64` in each.
pub trait Lane:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// One truth value a lane.
    type Mask: LaneMask;

    /// Proof that this machine has the instructions.
    type Token: Copy + Debug + Send + Sync + 'static;

    /// Number of lanes.
    const LANES: usize;

    /// The number `x` in every lane.
    fn splat(token: Self::Token, x: f64) -> Self;

    /// The numbers of a slice of [`Self::LANES`].
    fn load(token: Self::Token, x: &[f64]) -> Self;

    /// Writes the lanes to a slice of [`Self::LANES`].
    fn store(self, out: &mut [f64]);

    /// A mask whose lane k is bit k.
    fn mask(token: Self::Token, bits: u32) -> Self::Mask;

    /// Writes lane k of eight numbers to `out[k]`, for [`Self::LANES`] lanes.
    fn transpose(x: &[Self; 8], out: &mut [[f64; 8]; MAX_LANES]);

    /// The token that this number was made with.
    fn token(self) -> Self::Token;

    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;

    /// Absolute value.
    #[must_use]
    fn abs(self) -> Self;

    /// The whole number nearest to a number of at most 2⁵¹, ties to even.
    #[inline(always)]
    #[must_use]
    fn nearest_whole(self) -> Self {
        let magic = self.like(NO_FRACTION);
        (self + magic) - magic
    }

    /// `2ⁿ` of a whole number `−1022 <= n <= 1023`.
    #[must_use]
    fn exp2_of_integer(self) -> Self;

    /// `self < other`.
    fn lt(self, other: Self) -> Self::Mask;

    /// `self <= other`.
    fn le(self, other: Self) -> Self::Mask;

    /// `yes` where the mask is true, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Runs `f` compiled for the instructions of the token; whatever `f` calls must be inlined, and
    /// `f` itself, as [`inlined!`](super::inlined) makes sure, or a large one is compiled for the
    /// baseline.
    fn vectorize<R>(token: Self::Token, f: impl FnOnce() -> R) -> R;

    /// The number `x` in every lane.
    #[inline(always)]
    #[must_use]
    fn like(self, x: f64) -> Self {
        Self::splat(self.token(), x)
    }

    /// `self > other`.
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }

    /// `self >= other`.
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }

    /// The smaller number; `other` where one is not a number.
    #[inline(always)]
    #[must_use]
    fn min(self, other: Self) -> Self {
        Self::select(self.lt(other), self, other)
    }

    /// The larger number; `other` where one is not a number.
    #[inline(always)]
    #[must_use]
    fn max(self, other: Self) -> Self {
        Self::select(other.lt(self), self, other)
    }

    /// Whether the number is finite.
    #[inline(always)]
    fn is_finite(self) -> Self::Mask {
        self.abs().le(self.like(f64::MAX))
    }

    /// The number of a lane.
    fn get(self, lane: usize) -> f64;

    /// Replaces the number of a lane.
    fn set(&mut self, lane: usize, x: f64);
}

/// Most lanes of any scalar.
pub const MAX_LANES: usize = 8;

/// Added to a number of at most 2⁵¹, it leaves no bits for a fraction.
const NO_FRACTION: f64 = 6_755_399_441_055_744.0; // 1.5 · 2⁵²

/// Added to a whole number n, it leaves the exponent field of 2ⁿ in the last bits of the sum.
pub(super) const EXPONENT_IN_LAST_BITS: f64 = 6_755_399_441_056_767.0; // 1.5 · 2⁵² + 1023

/// Bits of an `f64` behind its exponent field.
pub(super) const MANTISSA_BITS: u32 = 52;

impl LaneMask for bool {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }

    #[inline(always)]
    fn any(self) -> bool {
        self
    }

    #[inline(always)]
    fn all(self) -> bool {
        self
    }
}

impl Lane for f64 {
    type Mask = bool;
    type Token = Single;

    const LANES: usize = 1;

    #[inline(always)]
    fn splat(_: Single, x: f64) -> Self {
        x
    }

    #[inline(always)]
    fn load(_: Single, x: &[f64]) -> Self {
        x[0]
    }

    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        out[0] = self;
    }

    #[inline(always)]
    fn mask(_: Single, bits: u32) -> bool {
        bits & 1 == 1
    }

    #[inline(always)]
    fn transpose(x: &[Self; 8], out: &mut [[f64; 8]; MAX_LANES]) {
        out[0] = *x;
    }

    #[inline(always)]
    fn token(self) -> Single {
        Single::Baseline
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }

    #[inline(always)]
    fn exp2_of_integer(self) -> Self {
        f64::from_bits((self + EXPONENT_IN_LAST_BITS).to_bits() << MANTISSA_BITS)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }

    #[inline(always)]
    fn vectorize<R>(token: Single, f: impl FnOnce() -> R) -> R {
        token.vectorize(f)
    }

    #[inline(always)]
    fn get(self, _lane: usize) -> f64 {
        self
    }

    #[inline(always)]
    fn set(&mut self, _lane: usize, x: f64) {
        *self = x;
    }
}
