//! Elementary functions whose bits are the same in every lane, on every machine.
//!
//! The C library chooses its sine by the processor that it finds, with fused multiply-adds on one
//! machine and without on the next. What a simulation computes comes from this page instead: IEEE
//! operations in one order, no fused multiply-add, no table, no branch on a lane's value.
//!
//! [`sin_cos`] and [`exp_m1`] run in lanes. Their rare arguments, and the functions that a step
//! does not need, go to the crate `libm`, which is plain Rust and asks no processor.
//!
//! Source: Cody and Waite 1980 for the reduction; the constants are those of fdlibm 5.3 of Sun
//! Microsystems (`e_rem_pio2.c`, `k_sin.c`, `k_cos.c`, `s_expm1.c`).

use super::lane::{Lane, LaneMask, MAX_LANES};

/// Largest angle (rad) that is reduced in lanes; up to here the parts of π/2 suffice.
const FAR: f64 = 1e5;

/// π/2 in three parts, the first two of 33 bits: `n` times each is exact for `|n| < 2²⁰`.
const HALF_PI: [f64; 3] = [
    1.570_796_326_734_125_6,
    6.077_100_506_303_966e-11,
    2.022_266_248_795_950_6e-21,
];

/// `sin r = r + Σ S_k r^(2k+3)` for `|r| ≤ π/4`, to 2⁻⁵⁸.
const S: [f64; 6] = [
    -0.166_666_666_666_666_32,
    0.008_333_333_333_322_49,
    -0.000_198_412_698_298_579_5,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];

/// `cos r = 1 − r²/2 + Σ C_k r^(2k+4)` for `|r| ≤ π/4`, to 2⁻⁵⁸.
const C: [f64; 6] = [
    0.041_666_666_666_666_6,
    -0.001_388_888_888_887_411,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// ln 2 in two parts, the first of 33 bits.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];

/// `6/r ((e^r + 1)/(e^r − 1) − 2/r) = 1 + Σ Q_k (r²/2)^(k+1)` for `|r| ≤ ln 2/2`, to 2⁻⁶¹.
const Q: [f64; 5] = [
    -0.033_333_333_333_333_13,
    0.001_587_301_587_254_814_6,
    -7.936_507_578_674_88e-5,
    4.008_217_827_329_362e-6,
    -2.010_992_181_836_243_7e-7,
];

/// Largest x whose exponential is finite.
const OVERFLOW: f64 = 709.782_712_893_384;

/// Below this `e^x − 1` is −1 to the last bit.
const NOTHING_LEFT: f64 = -56.0 * std::f64::consts::LN_2;

/// Sine and cosine of x (rad), each within 1 ulp; not a number where x is not finite.
///
/// `sin(−x) = −sin x` and `cos(−x) = cos x` to the bit.
#[inline(always)]
#[must_use]
pub fn sin_cos<T: Lane>(x: T) -> (T, T) {
    let (sin, cos) = near_sin_cos(x);
    let far = is_far(x);
    if far.any() {
        return far_lanes(x, far, sin, cos);
    }
    (sin, cos)
}

/// Sines and cosines of several angles (rad), each as by [`sin_cos`]. A loop over `f64` is one over
/// registers, too.
///
/// # Panics
/// If the slices differ in length.
#[inline(always)]
pub fn sines_cosines<T: Lane>(x: &[T], sin: &mut [T], cos: &mut [T]) {
    let n = x.len();
    assert!(sin.len() == n && cos.len() == n, "as many sines as angles");
    for k in 0..n {
        (sin[k], cos[k]) = near_sin_cos(x[k]);
    }
    let Some(first) = x.first() else {
        return;
    };
    let mut any = is_far(*first);
    for k in 1..n {
        any = any | is_far(x[k]);
    }
    if any.any() {
        for k in 0..n {
            (sin[k], cos[k]) = far_lanes(x[k], is_far(x[k]), sin[k], cos[k]);
        }
    }
}

/// Where the reduction in lanes does not suffice.
#[inline(always)]
fn is_far<T: Lane>(x: T) -> T::Mask {
    x.like(FAR).lt(x.abs())
}

/// Sine and cosine of x up to [`FAR`].
#[inline(always)]
fn near_sin_cos<T: Lane>(x: T) -> (T, T) {
    let number = |value: f64| x.like(value);
    // x = n π/2 + r + low, with n whole and |r| ≤ π/4 (three parts)
    let n = (x * number(std::f64::consts::FRAC_2_PI)).nearest_whole();
    let first = x - n * number(HALF_PI[0]); // exact
    let part = n * number(HALF_PI[1]); // exact
    let second = first - part;
    let kept = second + part;
    let lost = (first - kept) + ((kept - second) - part); // first − part − second, exactly
    let part = n * number(HALF_PI[2]) - lost;
    let r = second - part;
    let low = (second - r) - part;

    let z = r * r;
    let half_z = number(0.5) * z;
    let cube = z * r;
    let sum = number(S[1])
        + z * (number(S[2]) + z * (number(S[3]) + z * (number(S[4]) + z * number(S[5]))));
    let s = r - ((z * (number(0.5) * low - cube * sum) - low) - cube * number(S[0]));
    let sum = number(C[0])
        + z * (number(C[1])
            + z * (number(C[2]) + z * (number(C[3]) + z * (number(C[4]) + z * number(C[5])))));
    let one = number(1.0);
    let w = one - half_z;
    let c = w + (((one - w) - half_z) + (z * z * sum - r * low));

    // n = 4 m + quarter, with the quarter in −2..=2; 2 and −2 are the same
    let quarter = n - (n * number(0.25)).nearest_whole() * number(4.0);
    let (half, more) = (number(0.5), number(1.5));
    let odd = half.lt(quarter.abs()) & quarter.abs().lt(more);
    let (sin, cos) = (T::select(odd, c, s), T::select(odd, s, c));
    let sin = T::select(quarter.lt(-half) | more.lt(quarter), -sin, sin);
    let cos = T::select(half.lt(quarter) | quarter.lt(-more), -cos, cos);

    (sin, cos)
}

/// `sin` and `cos` with the lanes of `far` replaced, one by one.
#[inline(always)]
fn far_lanes<T: Lane>(x: T, far: T::Mask, sin: T, cos: T) -> (T, T) {
    let mut lanes = [[0.0; MAX_LANES]; 3];
    for (lanes, number) in lanes.iter_mut().zip([x, sin, cos]) {
        number.store(&mut lanes[..T::LANES]);
    }
    replace_far(far.bits(), &mut lanes);
    // The numbers as they were loaded do not vary; x may (`Dual`).
    let [x_0, sin_0, cos_0] = lanes.map(|lanes| T::load(x.token(), &lanes[..T::LANES]));
    let change = x - x_0;
    (
        T::select(far, sin_0 + cos_0 * change, sin),
        T::select(far, cos_0 - sin_0 * change, cos),
    )
}

/// `[x, sin x, cos x]` with the functions renewed in the lanes of `far`.
#[cold]
#[inline(never)]
fn replace_far(far: u32, [x, sin, cos]: &mut [[f64; MAX_LANES]; 3]) {
    for k in 0..MAX_LANES {
        if far >> k & 1 == 1 {
            (sin[k], cos[k]) = libm::sincos(x[k]);
        }
    }
}

/// `e^x − 1` within 2 ulp, also near 0.
#[inline(always)]
#[must_use]
pub fn exp_m1<T: Lane>(x: T) -> T {
    let number = |value: f64| x.like(value);
    let one = number(1.0);
    let too_large = number(OVERFLOW).lt(x);
    let within = T::select(too_large, number(OVERFLOW), x);
    let within = T::select(x.lt(number(NOTHING_LEFT)), number(NOTHING_LEFT), within);
    // x = n ln 2 + r + low, with n whole and |r| ≤ ln 2/2
    let n = (within * number(std::f64::consts::LOG2_E)).nearest_whole();
    let high = within - n * number(LN_2[0]); // exact
    let part = n * number(LN_2[1]);
    let r = high - part;
    let low = (high - r) - part;

    // e^r − 1 = r − e
    let half_r = number(0.5) * r;
    let z = r * half_r;
    let sum = one
        + z * (number(Q[0])
            + z * (number(Q[1]) + z * (number(Q[2]) + z * (number(Q[3]) + z * number(Q[4])))));
    let t = number(3.0) - sum * half_r;
    let e = z * ((sum - t) / (number(6.0) - r * t));
    let e = (r * (e - low) - low) - z;

    // 2ⁿ (1 + r − e) − 1 = 2ⁿ ((1 − 2⁻ⁿ) + r − e); 2ⁿ in two factors, so that 2¹⁰²⁴ is none, and
    // 2⁻⁶⁰ for what is smaller: 1 − 2⁻ⁿ is 1 either way
    let scaled = ((one - (-n).max(number(-60.0)).exp2_of_integer()) + r) - e;
    let scaled = scaled * (n - one).exp2_of_integer() * number(2.0);
    let near = T::select(n.abs().lt(number(0.5)), r - e, scaled);
    T::select(too_large, number(f64::INFINITY), near)
}

/// `e^x` within 1 ulp.
#[must_use]
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Natural logarithm within 1 ulp.
#[must_use]
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// `ln(1 + x)` within 1 ulp, also near 0.
#[must_use]
pub fn ln_1p(x: f64) -> f64 {
    libm::log1p(x)
}

/// Angle (rad) of a cosine, in 0..=π, within 1 ulp; not a number outside −1..=1.
#[must_use]
pub fn acos(x: f64) -> f64 {
    libm::acos(x)
}

/// Angle (rad) of a sine, in −π/2..=π/2, within 1 ulp; not a number outside −1..=1.
#[must_use]
pub fn asin(x: f64) -> f64 {
    libm::asin(x)
}

/// Angle (rad) of the point (x, y), in −π..=π, within 1 ulp.
#[must_use]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// `√(x² + y²)` within 1 ulp, without overflow on the way.
#[inline]
#[must_use]
pub fn hypot(x: f64, y: f64) -> f64 {
    let (x, y) = (x.abs(), y.abs());
    let (large, small) = if x < y { (y, x) } else { (x, y) };
    if (1e-140..1e150).contains(&large) {
        return (large * large + small * small).sqrt();
    }
    extreme_hypot(large, small)
}

/// [`hypot`] of numbers whose squares are not all normal.
#[cold]
fn extreme_hypot(large: f64, small: f64) -> f64 {
    if large.is_infinite() || small.is_infinite() {
        return f64::INFINITY;
    }
    let (scale, back) = if large < 1.0 {
        (2.0_f64.powi(600), 2.0_f64.powi(-600))
    } else {
        (2.0_f64.powi(-600), 2.0_f64.powi(600))
    };
    let (large, small) = (large * scale, small * scale);
    (large * large + small * small).sqrt() * back
}

#[cfg(test)]
mod tests {
    use super::super::instructions::Single;
    use super::*;
    use fearless_simd::{Level, f64x4, f64x8};
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Rows of `tests/golden/elementary.json`.
    fn references(function: &str) -> Vec<Vec<f64>> {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/golden/elementary.json"
        );
        let all: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        serde_json::from_value(all[function].clone()).unwrap()
    }

    /// Units in the last place between `found` and the reference, a number and what it leaves.
    fn ulps(found: f64, reference: &[f64]) -> f64 {
        let next = f64::from_bits(reference[0].abs().to_bits() + 1);
        ((found - reference[0]) - reference[1]).abs() / (next - reference[0].abs())
    }

    #[test]
    fn agrees_with_the_references() {
        for row in references("sin_cos") {
            let (s, c) = sin_cos(row[0]);
            let errors = [ulps(s, &row[1..3]), ulps(c, &row[3..])];
            assert!(errors.iter().all(|e| *e < 0.85), "{row:?}: {errors:?}");
        }
        one_argument("exp_m1", exp_m1, 1.5);
        one_argument("exp", exp, 1.0);
        one_argument("ln", ln, 1.0);
        one_argument("ln_1p", ln_1p, 1.0);
        one_argument("acos", acos, 1.0);
        one_argument("asin", asin, 1.0);
        two_arguments("atan2", atan2);
        two_arguments("hypot", hypot);
    }

    fn one_argument(name: &str, function: fn(f64) -> f64, bound: f64) {
        for row in references(name) {
            let error = ulps(function(row[0]), &row[1..]);
            assert!(error < bound, "{name} {row:?}: {error}");
        }
    }

    fn two_arguments(name: &str, function: fn(f64, f64) -> f64) {
        for row in references(name) {
            let error = ulps(function(row[0], row[1]), &row[2..]);
            assert!(error < 1.0, "{name} {row:?}: {error}");
        }
    }

    #[test]
    fn ends_of_the_range() {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let (s, c) = sin_cos(x);
            assert!(s.is_nan() && c.is_nan());
        }
        for zero in [0.0_f64, -0.0] {
            let (s, c) = sin_cos(zero);
            assert_eq!(
                (s.to_bits(), c.to_bits()),
                (zero.to_bits(), 1.0_f64.to_bits())
            );
            assert_eq!(exp_m1(zero).to_bits(), zero.to_bits());
            assert_eq!(hypot(zero, zero).to_bits(), 0);
        }
        assert_eq!(sin_cos(5e-324).0.to_bits(), 1);
        assert!(exp_m1(f64::NAN).is_nan() && hypot(f64::NAN, 1.0).is_nan());
        assert!(exp_m1(709.782).is_finite() && exp_m1(709.783).is_infinite());
        assert!(exp_m1(f64::INFINITY).is_infinite());
        for x in [-1e300, f64::NEG_INFINITY, -60.0] {
            assert_eq!(exp_m1(x).to_bits(), (-1.0_f64).to_bits());
        }
        assert!(hypot(f64::NEG_INFINITY, 1.0).is_infinite());
        // the two reductions meet
        for x in [FAR, FAR.next_up()] {
            let (s, c) = sin_cos(x);
            let (far_s, far_c) = libm::sincos(x);
            assert!((s - far_s).abs() + (c - far_c).abs() < 2e-16);
        }
    }

    /// Bits of every function in every lane, and of the same run as `f64`.
    fn lanes_agree<T: Lane>(token: T::Token, x: &[f64; MAX_LANES]) {
        let number = T::load(token, &x[..T::LANES]);
        let ((s, c), e) = T::vectorize(token, || (sin_cos(number), exp_m1(number)));
        for k in 0..T::LANES {
            let (sin, cos) = sin_cos(x[k]);
            let wide = [s, c, e].map(|lanes| lanes.get(k));
            for (wide, alone) in wide.into_iter().zip([sin, cos, exp_m1(x[k])]) {
                let same = wide.to_bits() == alone.to_bits() || wide.is_nan() && alone.is_nan();
                assert!(same, "lane {k} of {x:?}: {wide:e}, alone {alone:e}");
            }
        }
    }

    fn all_widths_agree(x: &[f64; MAX_LANES]) {
        lanes_agree::<f64>(Single::best(), x);
        for level in [Level::new(), Level::baseline()] {
            fearless_simd::dispatch!(level, token => {
                lanes_agree::<f64x4<_>>(token, x);
                lanes_agree::<f64x8<_>>(token, x);
            });
        }
    }

    #[test]
    fn rare_numbers_leave_the_other_lanes_alone() {
        let rare = [f64::NAN, f64::INFINITY, -1e300, 2e5, -0.0, 1e-310, 710.0];
        for x in rare {
            for lane in 0..MAX_LANES {
                let mut numbers = [0.3, -1.7, 40.0, 9e4, -3e-9, -37.5, FRAC_PI_2, PI];
                numbers[lane] = x;
                all_widths_agree(&numbers);
            }
        }
    }

    proptest! {
        #[test]
        fn every_lane_has_the_bits_of_f64(
            x in prop::array::uniform8(-1.0..1.0_f64),
            scale in prop::array::uniform8(-30..30_i32),
        ) {
            let mut numbers = x;
            for (x, scale) in numbers.iter_mut().zip(scale) {
                *x *= 2.0_f64.powi(scale);
            }
            all_widths_agree(&numbers);
        }

        #[test]
        fn sine_is_odd_and_cosine_even(x in -1.0..1.0_f64, scale in -30..40_i32) {
            let x = x * 2.0_f64.powi(scale);
            let ((s, c), (mirrored_s, mirrored_c)) = (sin_cos(x), sin_cos(-x));
            prop_assert_eq!((-s).to_bits(), mirrored_s.to_bits());
            prop_assert_eq!(c.to_bits(), mirrored_c.to_bits());
            prop_assert!((s * s + c * c - 1.0).abs() < 3.0 * f64::EPSILON);
        }

        #[test]
        fn angle_and_length_return_the_point(x in -1e3..1e3_f64, y in -1e3..1e3_f64) {
            let (s, c) = sin_cos(atan2(y, x));
            let length = hypot(x, y);
            prop_assert!((length * c - x).abs() + (length * s - y).abs() < 2e-15 * length);
        }

        #[test]
        fn exponential_and_logarithm_undo_each_other(x in -30.0..30.0_f64) {
            prop_assert!((ln(exp(x)) - x).abs() < 1e-14);
            prop_assert!((exp_m1(x) - (exp(x) - 1.0)).abs() < 1e-15 * exp(x).max(1.0));
        }
    }
}
