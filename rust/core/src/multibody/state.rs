//! The configuration: small, cloneable, without any scratch.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::model::Model;
use crate::spatial::exp_rotation;

/// Where the machine is: trunk origin and attitude, joint angles. A point of R³ × SO(3) × R^n.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub struct Configuration {
    /// Trunk origin, world, m.
    pub position: Vector3<f64>,
    /// Attitude `R_WB`.
    pub attitude: UnitQuaternion<f64>,
    /// Joint angles in the order of the bodies, rad.
    pub joints: Vec<f64>,
}

impl Clone for Configuration {
    fn clone(&self) -> Self {
        Self {
            position: self.position,
            attitude: self.attitude,
            joints: self.joints.clone(),
        }
    }

    /// Does not allocate where the sizes agree.
    fn clone_from(&mut self, other: &Self) {
        self.position = other.position;
        self.attitude = other.attitude;
        self.joints.clone_from(&other.joints);
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
        }
    }

    /// `self = from ⊕ h v`: moves with the velocity `v` (nv) for `h` seconds along the exponential map.
    ///
    /// The angular velocity is in world axes, so the turn multiplies from the left.
    pub fn set_moved(&mut self, from: &Self, v: &[f64], h: f64) {
        self.position = from.position + Vector3::new(v[0], v[1], v[2]) * h;
        let turn = exp_rotation(&(Vector3::new(v[3], v[4], v[5]) * h));
        self.attitude = turn * from.attitude;
        for ((q, q0), rate) in self.joints.iter_mut().zip(&from.joints).zip(&v[6..]) {
            *q = q0 + h * rate;
        }
    }

    /// `self ⊕= h v`, in place.
    pub fn advance(&mut self, v: &[f64], h: f64) {
        self.position += Vector3::new(v[0], v[1], v[2]) * h;
        self.attitude = exp_rotation(&(Vector3::new(v[3], v[4], v[5]) * h)) * self.attitude;
        for (q, rate) in self.joints.iter_mut().zip(&v[6..]) {
            *q += h * rate;
        }
    }

    /// Whether every entry is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.position
            .iter()
            .chain(self.attitude.coords.iter())
            .chain(&self.joints)
            .all(|x| x.is_finite())
    }
}
