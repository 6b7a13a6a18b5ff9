//! Lanes in a register: the lane types of the SIMD library.

use fearless_simd::{
    Bytes, Select, Simd, SimdBase, SimdFloat, SimdMask, f64x4, f64x8, mask64x4, mask64x8, u64x4,
    u64x8,
};

use super::lane::{EXPONENT_IN_LAST_BITS, Lane, LaneMask, MANTISSA_BITS, MAX_LANES};

/// A lane type of the SIMD library, for every instruction set that it knows.
macro_rules! lanes {
    ($vector:ident, $mask:ident, $whole:ident, $n:literal) => {
        impl<S: Simd> LaneMask for $mask<S> {
            #[inline(always)]
            #[allow(clippy::cast_possible_truncation)] // one bit a lane
            fn bits(self) -> u32 {
                self.to_bitmask() as u32
            }

            #[inline(always)]
            fn any(self) -> bool {
                self.any_true()
            }

            #[inline(always)]
            fn all(self) -> bool {
                self.all_true()
            }
        }

        impl<S: Simd> Lane for $vector<S> {
            type Mask = $mask<S>;
            type Token = S;

            const LANES: usize = $n;

            #[inline(always)]
            fn splat(token: S, x: f64) -> Self {
                SimdBase::splat(token, x)
            }

            #[inline(always)]
            fn load(token: S, x: &[f64]) -> Self {
                Self::from_slice(token, x)
            }

            #[inline(always)]
            fn store(self, out: &mut [f64]) {
                self.store_slice(out);
            }

            #[inline(always)]
            fn mask(token: S, bits: u32) -> $mask<S> {
                $mask::from_bitmask(token, u64::from(bits))
            }

            #[inline(always)]
            fn transpose(x: &[Self; 8], out: &mut [[f64; 8]; MAX_LANES]) {
                for (part, x) in x.chunks_exact($n).enumerate() {
                    let mut rows = [x[0]; $n];
                    rows.copy_from_slice(x);
                    let mut stage = 1;
                    while stage < $n {
                        let before = rows;
                        for i in 0..$n / 2 {
                            let (low, high) = (before[i], before[i + $n / 2]);
                            rows[2 * i] = low.zip_low(high);
                            rows[2 * i + 1] = low.zip_high(high);
                        }
                        stage *= 2;
                    }
                    for (out, row) in out.iter_mut().zip(&rows) {
                        row.store_slice(&mut out[$n * part..][..$n]);
                    }
                }
            }

            #[inline(always)]
            fn token(self) -> S {
                self.simd
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                SimdFloat::sqrt(self)
            }

            #[inline(always)]
            fn abs(self) -> Self {
                SimdBase::abs(self)
            }

            #[inline(always)]
            fn exp2_of_integer(self) -> Self {
                let sum: $whole<S> = (self + self.like(EXPONENT_IN_LAST_BITS)).bitcast();
                (sum << MANTISSA_BITS).bitcast()
            }

            #[inline(always)]
            fn lt(self, other: Self) -> $mask<S> {
                self.simd_lt(other)
            }

            #[inline(always)]
            fn le(self, other: Self) -> $mask<S> {
                self.simd_le(other)
            }

            #[inline(always)]
            fn select(mask: $mask<S>, yes: Self, no: Self) -> Self {
                mask.select(yes, no)
            }

            #[inline(always)]
            fn vectorize<R>(token: S, f: impl FnOnce() -> R) -> R {
                token.vectorize(f)
            }

            #[inline(always)]
            fn get(self, lane: usize) -> f64 {
                self.as_slice()[lane]
            }

            #[inline(always)]
            fn set(&mut self, lane: usize, x: f64) {
                self.as_mut_slice()[lane] = x;
            }
        }
    };
}

lanes!(f64x4, mask64x4, u64x4, 4);
lanes!(f64x8, mask64x8, u64x8, 8);

#[cfg(test)]
mod tests {
    use super::super::instructions::Single;
    use super::*;
    use fearless_simd::Level;

    /// A formula with every operation, over any scalar.
    #[inline(always)]
    fn formula<T: Lane>(a: T, b: T) -> T {
        let c = (a * b - b / a + a.like(0.3)).abs().sqrt();
        T::select(a.lt(b), c.max(a), -c.min(b))
    }

    fn agrees<T: Lane>(token: T::Token) {
        let number = |k: usize| 1.7 * (3.1 * k as f64).sin();
        let mut a = [0.0; MAX_LANES];
        for (k, a) in a.iter_mut().enumerate() {
            *a = number(k);
        }
        let mut b = a;
        b.reverse();
        let x = T::load(token, &a[..T::LANES]);
        let y = T::load(token, &b[..T::LANES]);
        let found = T::vectorize(token, || formula(x, y));
        for k in 0..T::LANES {
            let alone = formula(a[k], b[k]);
            assert_eq!(found.get(k).to_bits(), alone.to_bits(), "lane {k}");
            assert_eq!(x.lt(y).get(k), a[k] < b[k]);
        }
        let mut columns = [x; 8];
        for (k, column) in columns.iter_mut().enumerate() {
            *column = x + x.like(10.0 * k as f64);
        }
        let mut rows = [[0.0; 8]; MAX_LANES];
        T::transpose(&columns, &mut rows);
        for lane in 0..T::LANES {
            for k in 0..8 {
                assert_eq!(rows[lane][k].to_bits(), columns[k].get(lane).to_bits());
            }
        }
        assert_eq!(T::mask(token, 0b10).bits(), 0b10 & ((1 << T::LANES) - 1));
    }

    #[test]
    fn every_lane_has_the_bits_of_f64() {
        agrees::<f64>(Single::best());
        let level = Level::new();
        fearless_simd::dispatch!(level, token => {
            agrees::<f64x4<_>>(token);
            agrees::<f64x8<_>>(token);
        });
    }
}
