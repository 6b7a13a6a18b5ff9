//! A moving body of a model.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use crate::multibody::joint::Joint;

/// A moving body: one or several rigidly connected solids, carried by one joint.
#[derive(Clone, Debug)]
pub struct Body {
    /// Name of its first solid and of its joint.
    pub name: String,
    /// Index of the body that carries it; `None` for a root.
    pub parent: Option<usize>,
    /// Index of its tree.
    pub tree: usize,
    /// Joint origin in the parent's frame, m; in the world for a root.
    pub position: Vector3<f64>,
    /// Fixed rotation from the joint's frame to the parent's; `None` for the identity.
    pub rotation: Option<Matrix3<f64>>,
    /// The joint between its parent and it.
    pub joint: Joint,
    /// Index of its joint's first velocity; for a coupled joint, of the velocity that it follows.
    pub velocity: usize,
    /// Index of its joint's first motion, and the number of motions.
    pub motion: usize,
    /// See [`Self::motions`].
    pub n_motions: usize,
    /// Whether the body's joint follows another joint.
    pub is_coupled: bool,
    /// kg.
    pub mass: f64,
    /// Mass centre in the body's frame, m.
    pub centre_of_mass: Vector3<f64>,
    /// Principal moments about the mass centre, kg m².
    pub principal_inertia: Vector3<f64>,
    /// Principal axes as columns, in the body's frame; `None` if they are the frame's axes.
    pub principal_axes: Option<Matrix3<f64>>,
    /// Whether a rotation about its own joint changes only its appearance: an axisymmetric body
    /// that spins about its axis of symmetry and carries only wheels on the same axle. A step need
    /// not rotate it.
    pub is_spinner: bool,
}

impl Body {
    /// Whether the mass centre coincides with the origin of the body's frame.
    #[inline]
    #[must_use]
    pub fn is_centred(&self) -> bool {
        self.centre_of_mass == Vector3::zeros()
    }

    /// Attitude of its principal axes, where `R` is that of its frame.
    #[inline]
    #[must_use]
    pub fn principal_attitude(&self, R: Matrix3<f64>) -> Matrix3<f64> {
        match &self.principal_axes {
            None => R,
            Some(P) => R * P,
        }
    }

    /// Indices of the joint's motions in
    /// [`Kinematics::motions`](crate::multibody::Kinematics::motions).
    #[inline]
    #[must_use]
    pub fn motions(&self) -> Range<usize> {
        self.motion..self.motion + self.n_motions
    }
}
