//! Where a function of one variable passes zero.

/// Most evaluations. For the normal at an edge the mean is 5 for discs and 8 for ellipsoids. Of
/// 3000 random edges whose faces lean by up to 0.3 radians each, none needs more than 20 for a
/// disc.
const MAX_EVALUATIONS: usize = 60;

/// Every how many-th of them halves.
const HALVED: usize = 8;

/// Where between 0 and 1 a function rises through zero, by a safeguarded secant iteration. `ends`:
/// its values there, below and above zero. `f`: its value, and how near zero is near enough.
#[inline]
pub(super) fn crossing(ends: [f64; 2], mut f: impl FnMut(f64) -> (f64, f64)) -> f64 {
    let (mut a, mut b, [mut fa, mut fb]) = (0.0, 1.0, ends);
    let (mut x, mut last) = (0.0, 0.0);
    for k in 0..MAX_EVALUATIONS {
        let secant = (a * fb - b * fa) / (fb - fa);
        let is_halved = k % HALVED == HALVED - 1 || !(secant > a && secant < b);
        x = if is_halved { 0.5 * (a + b) } else { secant };
        let (fx, tolerance) = f(x);
        if fx.abs() <= tolerance || b - a <= f64::EPSILON || !(x > a && x < b) {
            break;
        }
        // By Illinois' rule an end that stays twice counts half, so that both ends move.
        if fx < 0.0 {
            if last < 0.0 {
                fb *= 0.5;
            }
            (a, fa) = (x, fx);
        } else {
            if last > 0.0 {
                fa *= 0.5;
            }
            (b, fb) = (x, fx);
        }
        last = fx;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_crossing_is_found_to_rounding(root in 0.01..0.99_f64, bend in 0.0..60.0_f64) {
            // Steep on one side of the root and almost flat on the other.
            let f = |x: f64| (bend * x).exp() - (bend * root).exp() + x - root;
            let rounding = 1e-15 * (bend * root).exp();
            let mut n = 0;
            let x = crossing([f(0.0), f(1.0)], |x| {
                n += 1;
                (f(x), rounding)
            });
            prop_assert!((x - root).abs() < 1e-13, "{x} {root}");
            prop_assert!(n < MAX_EVALUATIONS, "{n}");
        }
    }
}
