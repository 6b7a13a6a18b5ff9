//! The configuration: small, cloneable, without scratch.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::joint::joint_model::{JointCoordinates, JointModel, advanced};
use super::joint::{Free, FreePose};
use super::model::Model;
use crate::scalar::Vec3;

/// Tolerance on the squared length of a unit quaternion; steps keep it within rounding.
const UNIT: f64 = 1e-12;

/// Configuration of the machine: a point in the product of its joints' manifolds.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Configuration {
    /// Origin of the first body, world, m; zero where that body is not free.
    pub position: Vector3<f64>,
    /// Attitude `R_WB` of the first body; the identity where it is not free.
    pub attitude: UnitQuaternion<f64>,
    /// Coordinates of the revolute (rad) and prismatic (m) joints in the order of the bodies
    /// (n_joints).
    pub joints: Vec<f64>,
    /// Poses of the free bodies other than the first.
    pub others: Vec<FreePose>,
    /// Rotations of the spherical joints, from the body's frame to the joint's.
    pub rotations: Vec<UnitQuaternion<f64>>,
}

impl Clone for Configuration {
    fn clone(&self) -> Self {
        Self {
            position: self.position,
            attitude: self.attitude,
            joints: self.joints.clone(),
            others: self.others.clone(),
            rotations: self.rotations.clone(),
        }
    }

    /// Does not allocate if the sizes agree.
    fn clone_from(&mut self, other: &Self) {
        self.position = other.position;
        self.attitude = other.attitude;
        self.joints.clone_from(&other.joints);
        self.others.clone_from(&other.others);
        self.rotations.clone_from(&other.rotations);
    }
}

impl Configuration {
    /// The zero configuration of a model.
    #[must_use]
    pub fn zero(model: &Model) -> Self {
        Self {
            position: Vector3::zeros(),
            attitude: UnitQuaternion::identity(),
            joints: vec![0.0; model.n_joints()],
            others: vec![FreePose::default(); model.n_poses() - 1],
            rotations: vec![UnitQuaternion::identity(); model.n_rotations()],
        }
    }

    /// Pose of a free body.
    #[inline]
    #[must_use]
    pub fn pose(&self, free: Free) -> FreePose {
        match free.pose.checked_sub(1) {
            None => FreePose {
                position: self.position,
                attitude: self.attitude,
            },
            Some(i) => self.others[i],
        }
    }

    /// Sets the pose of a free body.
    #[inline]
    pub fn set_pose(&mut self, free: Free, pose: FreePose) {
        match free.pose.checked_sub(1) {
            None => (self.position, self.attitude) = (pose.position, pose.attitude),
            Some(i) => self.others[i] = pose,
        }
    }

    /// `self = from ⊕ h v`: moves with the velocity `v` (nv) for `h` seconds along the exponential
    /// maps of the joints.
    pub fn set_moved(&mut self, model: &Model, from: &Self, v: &[f64], h: f64) {
        self.clone_from(from);
        self.advance(model, v, h);
    }

    /// `self ⊕= h v`, in place.
    pub fn advance(&mut self, model: &Model, v: &[f64], h: f64) {
        for (q, &k) in self.joints.iter_mut().zip(model.joint_velocities()) {
            *q = advanced(*q, v[k], h);
        }
        for (joint, k) in model.rotating_joints() {
            joint.advance(self, &v[*k..], h);
        }
    }

    /// Renormalises the unit quaternions.
    pub fn normalise(&mut self) {
        self.attitude.renormalize_fast();
        for pose in &mut self.others {
            pose.attitude.renormalize_fast();
        }
        for rotation in &mut self.rotations {
            rotation.renormalize_fast();
        }
    }

    fn attitudes(&self) -> impl Iterator<Item = &UnitQuaternion<f64>> {
        std::iter::once(&self.attitude)
            .chain(self.others.iter().map(|pose| &pose.attitude))
            .chain(&self.rotations)
    }

    /// Whether the configuration has the sizes that a model needs, and unit quaternions.
    #[must_use]
    pub fn is_of(&self, model: &Model) -> bool {
        self.joints.len() == model.n_joints()
            && self.others.len() + 1 == model.n_poses()
            && self.rotations.len() == model.n_rotations()
            && (self.attitudes()).all(|q| (q.norm_squared() - 1.0).abs() <= UNIT)
    }

    /// Whether every entry is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.position
            .iter()
            .chain(self.others.iter().flat_map(|pose| &pose.position))
            .chain(self.attitudes().flat_map(|q| q.coords.iter()))
            .chain(&self.joints)
            .all(|x| x.is_finite())
    }
}

/// Components x, y, z, w of a rotation.
pub(super) fn components(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    rotation.coords.into()
}

/// The rotation with the components x, y, z, w.
pub(super) fn rotation_of([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    Unit::new_unchecked(Quaternion::new(w, x, y, z))
}

impl JointCoordinates<f64> for Configuration {
    fn number_at(&self, joint: usize) -> f64 {
        self.joints[joint]
    }

    fn rotation_at(&self, index: usize) -> [f64; 4] {
        components(&self.rotations[index])
    }

    fn set_rotation_at(&mut self, index: usize, rotation: [f64; 4]) {
        self.rotations[index] = rotation_of(rotation);
    }

    fn pose_at(&self, index: usize) -> (Vec3<f64>, [f64; 4]) {
        let FreePose { position, attitude } = self.pose(Free { pose: index });
        (position.into(), components(&attitude))
    }

    fn set_pose_at(&mut self, index: usize, (position, attitude): (Vec3<f64>, [f64; 4])) {
        let pose = FreePose {
            position: position.into(),
            attitude: rotation_of(attitude),
        };
        self.set_pose(Free { pose: index }, pose);
    }
}
