//! What sand remembers of a wheel: where the wheel was displaced to, relative to the sand.
//!
//! A law of dry sand does not depend on how fast a wheel moves, only on where it moves. At rest it
//! has no direction, and yet the force stays. The memory of a wheel is a displacement δ of its
//! centre and a rotation φ, which follow the wheel and fade over the length K:
//!
//! ```text
//! dδ/dt = V − (r/K) δ,    dφ/dt = Ω − (r/K) φ,    r = √(V² + R² Ω²)
//! ```
//!
//! In steady motion δ = K V/r and φ = K Ω/r: the displacement `(δ + φ × r_i)/K` of a piece at r_i
//! has the direction of its velocity. At rest both stay, and with them the force: nothing creeps.
//! A wheel that reverses unloads the sand over a way of about K.
//!
//! A step of h takes them implicitly, so that they are bounded whatever the step.

use nalgebra::{Matrix6, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use friction_contact::scalar::Lane;

/// Velocity of a wheel: of its centre, m/s, and angular, rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelTwist {
    /// m/s.
    pub linear: Vector3<f64>,
    /// rad/s.
    pub angular: Vector3<f64>,
}

impl WheelTwist {
    /// Twist from six components, the linear ones first.
    #[must_use]
    pub fn of(six: &Vector6<f64>) -> Self {
        Self {
            linear: six.fixed_rows::<3>(0).into(),
            angular: six.fixed_rows::<3>(3).into(),
        }
    }

    /// Linear and then angular components.
    #[must_use]
    pub fn six(&self) -> Vector6<f64> {
        let (v, w) = (&self.linear, &self.angular);
        Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
    }
}

/// Displacement and rotation that the sand under a wheel remembers, in units of K: δ/K, and φ/K in
/// 1/m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    /// δ/K, world axes.
    pub shift: [f64; 3],
    /// φ/K, world axes, 1/m.
    pub turn: [f64; 3],
}

/// A memory at the end of a step, and its derivative by the twist of the step.
#[derive(Clone, Copy, Debug)]
pub struct Recalled {
    /// At the end.
    pub memory: Memory,
    /// Derivative of the six numbers, shift first, by linear and angular velocity.
    pub slope: Matrix6<f64>,
    /// Derivative of the six numbers by the velocities if the rate at which memory fades does not
    /// change: a multiple of the identity, s/m.
    pub fresh: f64,
}

impl Memory {
    /// The six numbers.
    #[must_use]
    pub fn six(&self) -> Vector6<f64> {
        let ([a, b, c], [d, e, f]) = (self.shift, self.turn);
        Vector6::new(a, b, c, d, e, f)
    }

    /// Memory from its six numbers, the shift first.
    #[must_use]
    pub fn of(six: &Vector6<f64>) -> Self {
        Self {
            shift: [six[0], six[1], six[2]],
            turn: [six[3], six[4], six[5]],
        }
    }

    /// Memory of the steady motion of a wheel of this radius, m; zero at rest.
    #[must_use]
    pub fn steady(twist: &WheelTwist, radius: f64) -> Self {
        let rate = rate(&twist.six().into(), radius);
        if rate > 0.0 {
            Self::of(&(twist.six() / rate))
        } else {
            Self::default()
        }
    }

    /// After a step of h with a twist, for a wheel of this radius in sand that forgets over
    /// `length`, m.
    #[must_use]
    pub fn after(&self, twist: &WheelTwist, radius: f64, (h, length): (f64, f64)) -> Recalled {
        let six = twist.six();
        let rate = rate(&six.into(), radius);
        let (end, fresh) = after_step::<f64>(&self.six().into(), &six.into(), radius, (h, length));
        let end = Vector6::from(end);
        let mut slope = Matrix6::from_diagonal_element(fresh);
        if rate > 0.0 {
            let mut by_rate = six / rate;
            for k in 3..6 {
                by_rate[k] *= radius * radius;
            }
            slope -= end * by_rate.transpose() * fresh;
        }
        Recalled {
            memory: Self::of(&end),
            slope,
            fresh,
        }
    }

    /// Size of the displacement of a wheel of this radius, m: 1 in steady motion.
    #[must_use]
    pub fn size(&self, radius: f64) -> f64 {
        let six = self.six();
        let turned = six.fixed_rows::<3>(3).norm_squared() * (radius * radius);
        (six.fixed_rows::<3>(0).norm_squared() + turned).sqrt()
    }

    /// Multiplied by a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self::of(&(self.six() * factor))
    }

    /// Displacement of a piece at `r` (m from the wheel's centre) in units of K.
    #[inline]
    #[must_use]
    pub fn at(&self, r: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from(self.shift) + Vector3::from(self.turn).cross(r)
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.shift.iter().chain(&self.turn).all(|x| x.is_finite())
    }
}

/// The six numbers of memories after a step of h with a twist ([`Memory::after`]), over lanes, and
/// the multiple of the identity in their derivative by the twist, s/m.
#[inline(always)]
#[must_use]
pub fn after_step<T: Lane>(
    memory: &[T; 6],
    twist: &[T; 6],
    radius: f64,
    times: (T, T),
) -> ([T; 6], T) {
    after_way(memory, twist, rate(twist, radius), times)
}

/// Memories after a step and their derivative as in [`after_step`], at a given speed of the wheel
/// relative to the sand (`rate`), m/s.
#[inline(always)]
#[must_use]
pub fn after_way<T: Lane>(
    memory: &[T; 6],
    twist: &[T; 6],
    rate: T,
    (h, length): (T, T),
) -> ([T; 6], T) {
    let one = h.like(1.0);
    let share = h / length;
    let kept = one / (one + h * rate / length);
    let mut end = *memory;
    for (own, x) in end.iter_mut().zip(twist) {
        *own = (*own + *x * share) * kept;
    }
    (end, share * kept)
}

/// Speed of a wheel of a radius (m) relative to the sand, m/s.
#[inline(always)]
#[must_use]
pub fn rate<T: Lane>(twist: &[T; 6], radius: f64) -> T {
    let [a, b, c, d, e, f] = *twist;
    let rim = (d * d + e * e + f * f) * a.like(radius * radius);
    (a * a + b * b + c * c + rim).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twist() -> WheelTwist {
        WheelTwist {
            linear: Vector3::new(0.2, -0.05, 0.1),
            angular: Vector3::new(0.3, 0.1, -2.0),
        }
    }

    #[test]
    fn steady_motion_is_reached_over_the_length_and_rest_keeps_it() {
        let (twist, steady) = (twist(), Memory::steady(&twist(), 0.1));
        let mut memory = Memory::default();
        for _ in 0..400 {
            memory = memory.after(&twist, 0.1, (0.002, 0.005)).memory;
        }
        assert!((memory.six() - steady.six()).norm() < 1e-9);
        assert_eq!(
            memory
                .after(&WheelTwist::default(), 0.1, (0.01, 0.005))
                .memory,
            memory
        );
        let at_once = Memory::default().after(&twist, 0.1, (1e9, 0.005)).memory;
        assert!((at_once.six() - steady.six()).norm() < 1e-9);
    }

    #[test]
    fn the_slope_is_the_derivative() {
        let start = Memory {
            shift: [0.3, -0.2, 0.1],
            turn: [1.0, 0.0, -3.0],
        };
        let of = |six: &Vector6<f64>| start.after(&WheelTwist::of(six), 0.1, (0.01, 0.005));
        let found = of(&twist().six());
        for k in 0..6 {
            let mut step = Vector6::zeros();
            step[k] = 1e-6;
            let (up, down) = (of(&(twist().six() + step)), of(&(twist().six() - step)));
            let change = (up.memory.six() - down.memory.six()) / 2e-6;
            assert!((found.slope.column(k) - change).norm() < 1e-6 * (1.0 + change.norm()));
        }
    }
}
