//! Dual numbers: a number a lane, and its derivative in a direction a lane.
//!
//! ```text
//! (a + a' ε) (b + b' ε) = a b + (a' b + a b') ε,    ε² = 0
//! ```
//!
//! Sources that are generic over [`Lane`] compute exact derivatives when they run over
//! [`Dual`]: to rounding, without a step size. Each lane may have another direction.
//!
//! Numbers that are loaded or set are constants. Masks compare values, so a source takes the branch
//! that it takes without derivatives.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use super::lane::{Lane, MAX_LANES};

/// A number with its derivative.
#[derive(Clone, Copy, Debug)]
pub struct Dual<T> {
    /// The number.
    pub value: T,
    /// Derivative of the number.
    pub slope: T,
}

impl<T: Lane> Dual<T> {
    /// A number with its derivative.
    #[inline(always)]
    #[must_use]
    pub fn new(value: T, slope: T) -> Self {
        Self { value, slope }
    }

    /// A number that does not change.
    #[inline(always)]
    #[must_use]
    pub fn constant(value: T) -> Self {
        let slope = value.like(0.0);
        Self { value, slope }
    }
}

impl<T: Lane> Add for Dual<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.value + other.value, self.slope + other.slope)
    }
}

impl<T: Lane> Sub for Dual<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.value - other.value, self.slope - other.slope)
    }
}

impl<T: Lane> Mul for Dual<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let slope = self.slope * other.value + self.value * other.slope;
        Self::new(self.value * other.value, slope)
    }
}

impl<T: Lane> Div for Dual<T> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self::new(value, (self.slope - value * other.slope) / other.value)
    }
}

impl<T: Lane> Neg for Dual<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.value, -self.slope)
    }
}

impl<T: Lane> AddAssign for Dual<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<T: Lane> SubAssign for Dual<T> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<T: Lane> MulAssign for Dual<T> {
    #[inline(always)]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl<T: Lane> DivAssign for Dual<T> {
    #[inline(always)]
    fn div_assign(&mut self, other: Self) {
        *self = *self / other;
    }
}

impl<T: Lane> Lane for Dual<T> {
    type Mask = T::Mask;
    type Token = T::Token;

    const LANES: usize = T::LANES;

    #[inline(always)]
    fn splat(token: T::Token, x: f64) -> Self {
        Self::constant(T::splat(token, x))
    }

    #[inline(always)]
    fn load(token: T::Token, x: &[f64]) -> Self {
        Self::constant(T::load(token, x))
    }

    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        self.value.store(out);
    }

    #[inline(always)]
    fn mask(token: T::Token, bits: u32) -> T::Mask {
        T::mask(token, bits)
    }

    #[inline(always)]
    fn transpose(x: &[Self; 8], out: &mut [[f64; 8]; MAX_LANES]) {
        T::transpose(&x.map(|x| x.value), out);
    }

    #[inline(always)]
    fn token(self) -> T::Token {
        self.value.token()
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self::new(root, self.slope / (root + root))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        let is_negative = self.value.lt(self.value.like(0.0));
        let slope = T::select(is_negative, -self.slope, self.slope);
        Self::new(self.value.abs(), slope)
    }

    #[inline(always)]
    fn nearest_whole(self) -> Self {
        Self::constant(self.value.nearest_whole())
    }

    #[inline(always)]
    fn exp2_of_integer(self) -> Self {
        Self::constant(self.value.exp2_of_integer())
    }

    #[inline(always)]
    fn lt(self, other: Self) -> T::Mask {
        self.value.lt(other.value)
    }

    #[inline(always)]
    fn le(self, other: Self) -> T::Mask {
        self.value.le(other.value)
    }

    #[inline(always)]
    fn select(mask: T::Mask, yes: Self, no: Self) -> Self {
        Self::new(
            T::select(mask, yes.value, no.value),
            T::select(mask, yes.slope, no.slope),
        )
    }

    #[inline(always)]
    fn vectorize<R>(token: T::Token, f: impl FnOnce() -> R) -> R {
        T::vectorize(token, f)
    }

    #[inline(always)]
    fn get(self, lane: usize) -> f64 {
        self.value.get(lane)
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, x: f64) {
        self.value.set(lane, x);
        self.slope.set(lane, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::super::elementary::{exp_m1, sin_cos};
    use super::super::instructions::Single;
    use super::*;

    /// A number whose derivative is 1.
    fn varying(x: f64) -> Dual<f64> {
        Dual::new(x, 1.0)
    }

    /// The derivative agrees with central differences.
    fn is_derivative(f: impl Fn(Dual<f64>) -> Dual<f64>, x: f64) {
        let h = 1e-5;
        let ahead = |k: f64| f(varying(x + k * h)).value;
        let difference =
            (8.0 * (ahead(1.0) - ahead(-1.0)) - (ahead(2.0) - ahead(-2.0))) / (12.0 * h);
        let found = f(varying(x)).slope;
        let error = (found - difference).abs() / found.abs().max(1.0);
        assert!(error < 1e-9, "at {x}: {found}, differences {difference}");
    }

    #[test]
    fn every_operation_has_its_derivative() {
        for x in [-2.3, -0.4, 0.7, 3.9] {
            let two = Dual::splat(Single::best(), 2.0);
            is_derivative(|x| x * x - two / (x + two * two) + x, x);
            is_derivative(|x| (x * x + two).sqrt(), x);
            is_derivative(|x| (x - two).abs() * -x, x);
            is_derivative(|x| x.max(two) + (x * x).min(two), x);
        }
    }

    #[test]
    fn sines_and_exponentials_too_also_far_from_zero() {
        for x in [-40.0, -2.3, -1e-3, 0.0, 0.4, 1.6, 3.1, 250.0] {
            is_derivative(|x| sin_cos(x).0, x);
            is_derivative(|x| sin_cos(x).1, x);
        }
        for x in [-30.0, -2.3, -0.2, 0.0, 0.4, 2.0] {
            is_derivative(exp_m1, x);
        }
        let (sin, cos) = sin_cos(varying(3e5));
        assert!((sin.slope - cos.value).abs() + (cos.slope + sin.value).abs() < 1e-15);
    }

    #[test]
    fn values_have_the_bits_of_plain_numbers() {
        for k in 0..400 {
            let x = 13.7 * (0.37 * f64::from(k)).sin();
            let (plain, dual) = (sin_cos(x), sin_cos(varying(x)));
            assert_eq!(plain.0.to_bits(), dual.0.value.to_bits());
            assert_eq!(plain.1.to_bits(), dual.1.value.to_bits());
            assert_eq!(exp_m1(x).to_bits(), exp_m1(varying(x)).value.to_bits());
        }
    }
}
