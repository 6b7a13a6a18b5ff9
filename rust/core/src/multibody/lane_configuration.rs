//! Configurations over the scalar.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};

use super::joint::joint_model::{JointCoordinates, JointModel, advanced};
use super::joint::{Joint, free};
use super::mechanism::Mechanism;
use super::state::Configuration;
use crate::scalar::{Dual, Lane, Vec3};
use crate::spatial::quaternion::normalised;

/// A configuration a lane.
#[derive(Debug)]
pub struct LaneConfiguration<T: Lane> {
    /// Origin of the first body, world, m; zero where that body is not free.
    pub position: Vec3<T>,
    /// Attitude of the first body: a unit quaternion x, y, z, w.
    pub attitude: [T; 4],
    /// Coordinates of the revolute (rad) and prismatic (m) joints (n_joints).
    pub joints: Vec<T>,
    /// Rotations of the spherical joints, from the body's frame to the joint's: unit quaternions
    /// x, y, z, w.
    pub rotations: Vec<[T; 4]>,
    /// Positions and attitudes of the free bodies other than the first.
    others: Vec<(Vec3<T>, [T; 4])>,
}

impl<T: Lane> Clone for LaneConfiguration<T> {
    fn clone(&self) -> Self {
        Self {
            position: self.position,
            attitude: self.attitude,
            joints: self.joints.clone(),
            rotations: self.rotations.clone(),
            others: self.others.clone(),
        }
    }

    /// Does not allocate if the sizes agree.
    fn clone_from(&mut self, other: &Self) {
        (self.position, self.attitude) = (other.position, other.attitude);
        self.joints.clone_from(&other.joints);
        self.rotations.clone_from(&other.rotations);
        self.others.clone_from(&other.others);
    }
}

impl PartialEq for LaneConfiguration<f64> {
    fn eq(&self, other: &Self) -> bool {
        let place = |x: &Vec3<f64>| [x.x, x.y, x.z];
        let others = (self.others.iter()).map(|(position, attitude)| (place(position), attitude));
        place(&self.position) == place(&other.position)
            && self.attitude == other.attitude
            && self.joints == other.joints
            && self.rotations == other.rotations
            && others.eq((other.others.iter()).map(|(position, own)| (place(position), own)))
    }
}

impl<T: Lane> LaneConfiguration<T> {
    /// The zero configuration.
    #[must_use]
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let zero = T::splat(token, 0.0);
        let (nowhere, unturned) = (
            Vec3::new(zero, zero, zero),
            [zero, zero, zero, T::splat(token, 1.0)],
        );
        Self {
            position: nowhere,
            attitude: unturned,
            joints: vec![zero; mechanism.n_joints()],
            rotations: vec![unturned; mechanism.n_rotations],
            others: vec![(nowhere, unturned); mechanism.n_poses.saturating_sub(1)],
        }
    }

    /// Position and attitude of a free body, by the index of its pose.
    #[inline(always)]
    pub(super) fn pose(&self, pose: usize) -> (&Vec3<T>, &[T; 4]) {
        match pose.checked_sub(1) {
            None => (&self.position, &self.attitude),
            Some(other) => (&self.others[other].0, &self.others[other].1),
        }
    }

    /// Whether a lane has this configuration, to the last bit.
    pub fn is_lane(&self, lane: usize, q: &Configuration) -> bool {
        let is_same = |own: &T, x: &f64| own.get(lane).to_bits() == x.to_bits();
        let is_place = |own: &Vec3<T>, x: &Vector3<f64>| {
            let Vec3 { x: a, y: b, z: c } = own;
            is_same(a, &x.x) && is_same(b, &x.y) && is_same(c, &x.z)
        };
        let is_turn = |own: &[T; 4], x: &UnitQuaternion<f64>| {
            (own.iter().zip(&x.coords)).all(|(own, x)| is_same(own, x))
        };
        is_place(&self.position, &q.position)
            && is_turn(&self.attitude, &q.attitude)
            && (self.joints.iter().zip(&q.joints)).all(|(own, x)| is_same(own, x))
            && (self.rotations.iter().zip(&q.rotations)).all(|(own, q)| is_turn(own, q))
            && (self.others.iter().zip(&q.others)).all(|((position, attitude), q)| {
                is_place(position, &q.position) && is_turn(attitude, &q.attitude)
            })
    }

    /// Replaces the configuration of a lane.
    #[inline]
    pub fn set_lane(&mut self, lane: usize, q: &Configuration) {
        let turn = |own: &mut [T; 4], x: &UnitQuaternion<f64>| {
            for (own, x) in own.iter_mut().zip(&x.coords) {
                own.set(lane, *x);
            }
        };
        self.position.set(lane, q.position.into());
        turn(&mut self.attitude, &q.attitude);
        for (own, angle) in self.joints.iter_mut().zip(&q.joints) {
            own.set(lane, *angle);
        }
        for (own, q) in self.rotations.iter_mut().zip(&q.rotations) {
            turn(own, q);
        }
        for ((position, attitude), q) in self.others.iter_mut().zip(&q.others) {
            position.set(lane, q.position.into());
            turn(attitude, &q.attitude);
        }
    }

    /// Writes the configuration of a lane.
    pub fn to_lane(&self, lane: usize, q: &mut Configuration) {
        q.position = self.position.get(lane).into();
        let quaternion = |own: &[T; 4]| {
            let [x, y, z, w] = own.map(|x| x.get(lane));
            Unit::new_unchecked(Quaternion::new(w, x, y, z))
        };
        q.attitude = quaternion(&self.attitude);
        for (angle, own) in q.joints.iter_mut().zip(&self.joints) {
            *angle = own.get(lane);
        }
        for (q, own) in q.rotations.iter_mut().zip(&self.rotations) {
            *q = quaternion(own);
        }
        for (q, (position, attitude)) in q.others.iter_mut().zip(&self.others) {
            q.position = position.get(lane).into();
            q.attitude = quaternion(attitude);
        }
    }

    /// `self = from ⊕ h v`: moves with the velocity `v` (nv) for `h` seconds, along the exponential
    /// maps of the base and of the spherical joints.
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    #[inline(always)]
    pub fn set_moved(&mut self, mechanism: &Mechanism, from: &Self, v: &[T], h: f64) {
        let n = self.joints.len();
        let (trees, joints) = (&mechanism.trees[..], &mechanism.joints[..n]);
        assert!(from.joints.len() == n && v.len() == mechanism.nv());
        let h = from.position.x.like(h);
        let first = trees[0].lead();
        if v.len() == first + n && trees.len() == 1 {
            // The joints' velocities are in the order of their coordinates.
            let rates = &v[first..][..n];
            for j in 0..n {
                self.joints[j] = advanced(from.joints[j], rates[j], h);
            }
        } else {
            for j in 0..n {
                self.joints[j] = advanced(from.joints[j], v[joints[j].velocity], h);
            }
        }
        if trees[0].is_free {
            (self.position, self.attitude) = free::moved((&from.position, &from.attitude), v, h);
        }
        let others = &mechanism.rotating[usize::from(trees[0].is_free)..];
        if !others.is_empty() {
            self.rotate(others, from, v, h);
        }
    }

    /// Moves the free bodies other than the first, and the spherical joints.
    #[inline(always)]
    fn rotate(&mut self, joints: &[(Joint, usize)], from: &Self, v: &[T], h: T) {
        self.rotations.clone_from(&from.rotations);
        self.others.clone_from(&from.others);
        for (joint, k) in joints {
            joint.advance(self, &v[*k..], h);
        }
    }

    /// Renormalises the quaternions, which rounding has left within 1e-7 of unit length.
    #[inline(always)]
    pub fn normalise(&mut self) {
        self.attitude = normalised(&self.attitude);
        for own in &mut self.rotations {
            *own = normalised(own);
        }
        for (_, attitude) in &mut self.others {
            *attitude = normalised(attitude);
        }
    }

    /// Takes another configuration in the lanes of a mask.
    #[inline(always)]
    pub fn select_from(&mut self, lanes: T::Mask, other: &Self) {
        let select = |own: &mut [T], other: &[T]| {
            for (own, other) in own.iter_mut().zip(other) {
                *own = T::select(lanes, *other, *own);
            }
        };
        self.position = Vec3::select(lanes, other.position, self.position);
        select(&mut self.attitude, &other.attitude);
        select(&mut self.joints, &other.joints);
        for (own, other) in self.rotations.iter_mut().zip(&other.rotations) {
            select(own, other);
        }
        for ((position, attitude), other) in self.others.iter_mut().zip(&other.others) {
            *position = Vec3::select(lanes, other.0, *position);
            select(attitude, &other.1);
        }
    }

    /// Takes the coordinates of each cluster from another configuration in the lanes of its mask.
    #[inline(always)]
    pub fn select_clusters_from(
        &mut self,
        mechanism: &Mechanism,
        lanes: impl Fn(usize) -> T::Mask,
        other: &Self,
    ) {
        let joints = self.joints.iter_mut().zip(&other.joints);
        for ((own, other), joint) in joints.zip(&mechanism.joints) {
            *own = T::select(lanes(joint.cluster), *other, *own);
        }
        let select = |lanes, own: [T; 4], other: [T; 4]| {
            [0, 1, 2, 3].map(|k| T::select(lanes, other[k], own[k]))
        };
        for (joint, k) in &mechanism.rotating {
            let lanes = lanes(mechanism.cluster_of_velocity(*k));
            match joint {
                Joint::Free(free) => {
                    let (own, other) = (self.pose_at(free.pose), other.pose_at(free.pose));
                    let position = Vec3::select(lanes, other.0, own.0);
                    self.set_pose_at(free.pose, (position, select(lanes, own.1, other.1)));
                }
                Joint::Spherical(joint) => {
                    let (own, other) = (&mut self.rotations, &other.rotations);
                    let k = joint.rotation;
                    own[k] = select(lanes, own[k], other[k]);
                }
                _ => {}
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
        for [x, y, z, w] in &self.rotations {
            all = all & x.is_finite() & y.is_finite() & z.is_finite() & w.is_finite();
        }
        for (Vec3 { x, y, z }, attitude) in &self.others {
            all = all & x.is_finite() & y.is_finite() & z.is_finite();
            for x in attitude {
                all = all & x.is_finite();
            }
        }
        all
    }
}

impl<T: Lane> LaneConfiguration<Dual<T>> {
    /// The velocity (nv) along which the configuration changes with the direction of its
    /// derivatives.
    #[inline(always)]
    pub fn slope(&self, mechanism: &Mechanism, out: &mut [T]) {
        for (j, own) in self.joints.iter().enumerate() {
            out[mechanism.joints[j].velocity] = own.slope;
        }
        for (joint, k) in &mechanism.rotating {
            let out = &mut out[*k..];
            match joint {
                Joint::Free(free) => {
                    let (Vec3 { x, y, z }, attitude) = self.pose_at(free.pose);
                    out[..3].copy_from_slice(&[x.slope, y.slope, z.slope]);
                    out[3..6].copy_from_slice(&turning(&attitude));
                }
                Joint::Spherical(joint) => {
                    out[..3].copy_from_slice(&turning(&self.rotation_at(joint.rotation)));
                }
                _ => {}
            }
        }
    }
}

/// Angular velocity `2 q' q⁻¹` of a unit quaternion's derivative.
#[inline(always)]
fn turning<T: Lane>(q: &[Dual<T>; 4]) -> [T; 3] {
    let [x, y, z, w] = *q;
    let (value, slope) = (
        Vec3::new(x.value, y.value, z.value),
        Vec3::new(x.slope, y.slope, z.slope),
    );
    let half = slope * w.value + -(value * w.slope) + value.cross(slope);
    [half.x, half.y, half.z].map(|x| x + x)
}

impl<T: Lane> JointCoordinates<T> for LaneConfiguration<T> {
    #[inline(always)]
    fn number_at(&self, joint: usize) -> T {
        self.joints[joint]
    }

    #[inline(always)]
    fn rotation_at(&self, index: usize) -> [T; 4] {
        self.rotations[index]
    }

    #[inline(always)]
    fn set_rotation_at(&mut self, index: usize, rotation: [T; 4]) {
        self.rotations[index] = rotation;
    }

    #[inline(always)]
    fn pose_at(&self, index: usize) -> (Vec3<T>, [T; 4]) {
        let (position, attitude) = self.pose(index);
        (*position, *attitude)
    }

    #[inline(always)]
    fn set_pose_at(&mut self, index: usize, (position, attitude): (Vec3<T>, [T; 4])) {
        match index.checked_sub(1) {
            None => (self.position, self.attitude) = (position, attitude),
            Some(other) => self.others[other] = (position, attitude),
        }
    }
}
