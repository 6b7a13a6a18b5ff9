//! Configurations of the rovers of a block.

use super::machine::Machine;
use crate::multibody::Configuration;
use crate::multibody::model::BASE;
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
    /// Coordinates of the revolute (rad) and prismatic (m) joints (n_joints).
    pub joints: Vec<T>,
    /// Rotations of the spherical joints, from the body's frame to the joint's: unit quaternions
    /// x, y, z, w.
    pub balls: Vec<[T; 4]>,
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
            balls: vec![[zero, zero, zero, T::splat(token, 1.0)]; machine.balls.len()],
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
            && (self.balls.iter().zip(&q.rotations))
                .all(|(own, q)| own.iter().zip(&q.coords).all(|(own, x)| is_same(own, x)))
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
        for (own, q) in self.balls.iter_mut().zip(&q.rotations) {
            for (own, x) in own.iter_mut().zip(&q.coords) {
                own.set(lane, *x);
            }
        }
    }

    /// Writes the configuration of a lane.
    pub fn to_lane(&self, lane: usize, q: &mut Configuration) {
        q.position = self.position.get(lane).into();
        let quaternion = |own: &[T; 4]| {
            let [x, y, z, w] = own.map(|x| x.get(lane));
            nalgebra::Unit::new_unchecked(Quaternion::new(w, x, y, z))
        };
        q.attitude = quaternion(&self.attitude);
        for (angle, own) in q.joints.iter_mut().zip(&self.joints) {
            *angle = own.get(lane);
        }
        for (q, own) in q.rotations.iter_mut().zip(&self.balls) {
            *q = quaternion(own);
        }
    }

    /// `self = from ⊕ h v`: moves with the velocity `v` (nv) for `h` seconds, along the exponential
    /// maps of the base and of the spherical joints.
    ///
    /// # Panics
    /// If an argument is of another machine.
    #[inline(always)]
    pub fn set_moved(&mut self, machine: &Machine, from: &Self, v: &[T], h: f64) {
        let n = self.joints.len();
        let (base, rates) = v.split_at(BASE);
        assert!(from.joints.len() == n && machine.joints.len() == n && rates.len() >= n);
        let h = from.position.x.like(h);
        if rates.len() == n {
            // The joints' velocities are in the order of their coordinates.
            for j in 0..n {
                self.joints[j] = from.joints[j] + h * rates[j];
            }
        } else {
            for j in 0..n {
                self.joints[j] = from.joints[j] + h * v[machine.joints[j].velocity];
            }
        }
        self.position = from.position + Vec3::new(base[0], base[1], base[2]) * h;
        let turn = exp_rotation(Vec3::new(base[3], base[4], base[5]) * h);
        self.attitude = product(&turn, &from.attitude);
        for ((own, before), &k) in self.balls.iter_mut().zip(&from.balls).zip(&machine.balls) {
            let turn = exp_rotation(Vec3::new(v[k], v[k + 1], v[k + 2]) * h);
            *own = product(&turn, before);
        }
    }

    /// Renormalises the quaternions, which rounding has left within 1e-7 of unit length.
    #[inline(always)]
    pub fn normalise(&mut self) {
        self.attitude = normalised(&self.attitude);
        for own in &mut self.balls {
            *own = normalised(own);
        }
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
        for (own, other) in self.balls.iter_mut().zip(&other.balls) {
            for (own, other) in own.iter_mut().zip(other) {
                *own = T::select(lanes, *other, *own);
            }
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
        for [x, y, z, w] in &self.balls {
            all = all & x.is_finite() & y.is_finite() & z.is_finite() & w.is_finite();
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

/// A quaternion of nearly unit length, renormalised.
#[inline(always)]
fn normalised<T: Lane>(q: &[T; 4]) -> [T; 4] {
    let [x, y, z, w] = *q;
    let square = x * x + y * y + z * z + w * w;
    let factor = x.like(0.5) * (x.like(3.0) - square);
    [x * factor, y * factor, z * factor, w * factor]
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
