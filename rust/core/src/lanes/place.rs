//! Configurations of the rovers of a block.

use super::machine::Machine;
use crate::multibody::Configuration;
use crate::scalar::elementary::sin_cos;
use crate::scalar::{Lane, LaneMask, Vec3};
use nalgebra::Quaternion;

/// A configuration a lane.
#[derive(Clone, Debug)]
pub struct Place<T: Lane> {
    /// Origin of the trunk, world, m.
    pub position: Vec3<T>,
    /// Attitude of the trunk: a unit quaternion x, y, z, w.
    pub attitude: [T; 4],
    /// Angles of the joints, rad (n_joints).
    pub joints: Vec<T>,
}

impl<T: Lane> Place<T> {
    /// The zero configuration.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            position: Vec3::new(zero, zero, zero),
            attitude: [zero, zero, zero, T::splat(token, 1.0)],
            joints: vec![zero; machine.n_joints()],
        }
    }

    /// Whether a lane has this configuration, to the last bit.
    pub fn is_lane(&self, lane: usize, q: &Configuration) -> bool {
        let is_same = |own: &T, x: &f64| own.get(lane).to_bits() == x.to_bits();
        let Vec3 { x, y, z } = &self.position;
        [x, y, z]
            .into_iter()
            .zip(q.position.iter())
            .all(|(own, x)| is_same(own, x))
            && self
                .attitude
                .iter()
                .zip(q.attitude.coords.iter())
                .all(|(own, x)| is_same(own, x))
            && self
                .joints
                .iter()
                .zip(&q.joints)
                .all(|(own, x)| is_same(own, x))
    }

    /// Replaces the configuration of a lane.
    pub fn set_lane(&mut self, lane: usize, q: &Configuration) {
        self.position.set(lane, q.position.into());
        for (own, x) in self.attitude.iter_mut().zip(q.attitude.coords.iter()) {
            own.set(lane, *x);
        }
        for (own, angle) in self.joints.iter_mut().zip(&q.joints) {
            own.set(lane, *angle);
        }
    }

    /// Writes the configuration of a lane.
    pub fn to_lane(&self, lane: usize, q: &mut Configuration) {
        q.position = self.position.get(lane).into();
        let [x, y, z, w] = self.attitude.map(|x| x.get(lane));
        q.attitude = nalgebra::Unit::new_unchecked(Quaternion::new(w, x, y, z));
        for (angle, own) in q.joints.iter_mut().zip(&self.joints) {
            *angle = own.get(lane);
        }
    }

    /// `self = from ⊕ h v`: moves with the velocity `v` (nv) for `h` seconds, the trunk along the
    /// exponential map.
    ///
    /// # Panics
    /// If sizes differ.
    #[inline(always)]
    pub fn set_moved(&mut self, from: &Self, v: &[T], h: f64) {
        let n = self.joints.len();
        let (base, rates) = v.split_at(6);
        assert!(from.joints.len() == n && rates.len() == n);
        let h = from.position.x.like(h);
        for j in 0..n {
            self.joints[j] = from.joints[j] + h * rates[j];
        }
        self.position = from.position + Vec3::new(base[0], base[1], base[2]) * h;
        let turn = exp_rotation(Vec3::new(base[3], base[4], base[5]) * h);
        self.attitude = product(&turn, &from.attitude);
    }

    /// Renormalises the attitude, which rounding has left within 1e-7 of unit length.
    #[inline(always)]
    pub fn normalise(&mut self) {
        let [x, y, z, w] = self.attitude;
        let square = x * x + y * y + z * z + w * w;
        let factor = x.like(0.5) * (x.like(3.0) - square);
        self.attitude = [x * factor, y * factor, z * factor, w * factor];
    }

    /// Takes another configuration in the lanes of a mask.
    #[inline(always)]
    pub fn select_from(&mut self, lanes: T::Mask, other: &Self) {
        self.position = Vec3::select(lanes, other.position, self.position);
        for (own, other) in self.attitude.iter_mut().zip(other.attitude) {
            *own = T::select(lanes, other, *own);
        }
        for (own, other) in self.joints.iter_mut().zip(&other.joints) {
            *own = T::select(lanes, *other, *own);
        }
    }

    /// Whether every entry is finite.
    #[inline(always)]
    pub fn is_finite(&self) -> T::Mask {
        let Vec3 { x, y, z } = self.position;
        let mut all = x.is_finite() & y.is_finite() & z.is_finite();
        for x in &self.attitude {
            all = all & x.is_finite();
        }
        for x in &self.joints {
            all = all & x.is_finite();
        }
        all
    }
}

/// Rotation by the vector `phi` (rad, world axes): the quaternion `exp(phi / 2)`, by the formulas
/// of [`crate::spatial::exp_rotation`].
#[inline(always)]
fn exp_rotation<T: Lane>(phi: Vec3<T>) -> [T; 4] {
    let number = |x: f64| phi.x.like(x);
    let one = number(1.0);
    let square = phi.dot(phi) * number(0.25);
    let is_small = square.lt(number(1e-4));
    let nested = |a: f64, b: f64, c: f64| {
        let inner = one - square * number(1.0 / b) * (one - square * number(1.0 / c));
        one - square * number(1.0 / a) * inner
    };
    let (mut w, mut s) = (
        nested(2.0, 12.0, 30.0),
        nested(6.0, 20.0, 42.0) * number(0.5),
    );
    if !is_small.all() {
        let half = square.sqrt();
        let (sin, cos) = sin_cos(half);
        w = T::select(is_small, w, cos);
        s = T::select(is_small, s, number(0.5) * sin / half);
    }
    [s * phi.x, s * phi.y, s * phi.z, w]
}

/// Product of two quaternions x, y, z, w.
#[inline(always)]
fn product<T: Lane>(a: &[T; 4], b: &[T; 4]) -> [T; 4] {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (*a, *b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}
