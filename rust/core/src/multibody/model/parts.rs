//! Parts carried by the bodies: frames of the solids, wheels, boxes, balls and other colliders.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use crate::law::compliance::Tread;
use crate::multibody::motor::Motor;
use crate::scalar::elementary::hypot;
use crate::spatial::Polytope;

/// The frame of a solid, fixed to a moving body.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Name of the solid.
    pub name: String,
    /// Index of the body that carries it.
    pub body: usize,
    /// Origin in the body's frame, m.
    pub position: Vector3<f64>,
    /// Rotation from the solid's frame to the body's.
    pub rotation: Matrix3<f64>,
}

/// A wheel fixed to a body: a thin disc, or a cylinder with rounded edges.
#[derive(Clone, Debug)]
pub struct Wheel {
    /// Short name, such as `FL`.
    pub name: String,
    /// Body that it is fixed to.
    pub body: usize,
    /// Centre in the body's frame, m.
    pub centre: Vector3<f64>,
    /// Unit axle in the body's frame.
    pub axle: Vector3<f64>,
    /// A unit vector in the wheel's plane, body's frame: the rolling direction when axle and normal
    /// define none.
    pub spoke: Vector3<f64>,
    /// Contact radius, m.
    pub radius: f64,
    /// Width of the tread with its rounded edges, m; 0 for a thin disc.
    pub width: f64,
    /// Radius of its edges, m: at most half the width.
    pub rounding: f64,
    /// Sine and cosine of the angle of its rollers from the axle, if it has any.
    pub rollers: Option<[f64; 2]>,
    /// Friction across over that along, if its material states both.
    pub across: Option<f64>,
    /// Height of the grousers over the rim, m. Only sand feels them.
    pub grouser_height: f64,
    /// Number of grousers around the rim.
    pub grousers: u32,
    /// Spring and damper where it touches; `None` if it is rigid.
    pub tread: Option<Tread>,
    /// Name of its material.
    pub material: String,
    /// Largest driving torque, N m.
    pub torque_limit: f64,
    /// 1 or −1: joint torque of a positive (forward) command.
    pub drive_sign: f64,
    /// Torque–speed line of its motor, if any.
    pub motor: Option<Motor>,
    /// Gain of its speed servo, N m s/rad.
    pub speed_gain: f64,
    /// Index of its own joint ([`Model::joint_index`](super::Model::joint_index)), or of the one
    /// that it follows at the same rate; `None` if it is locked or follows otherwise.
    pub joint: Option<usize>,
    /// One over the number of wheels with the same joint.
    pub share: f64,
    /// Index of its steering joint; `None` if it has none or the joint is locked.
    pub steering: Option<usize>,
    /// Largest steering set-point in either direction, rad.
    pub steering_limit: f64,
}

impl Wheel {
    /// Whether the wheel has a width, unlike a thin disc.
    #[inline]
    #[must_use]
    pub fn is_wide(&self) -> bool {
        self.width > 0.0
    }

    /// Whether the wheel may touch with the two ends of a rigid tread.
    #[inline]
    #[must_use]
    pub(crate) fn has_rigid_ends(&self) -> bool {
        0.5 * self.width > self.rounding && self.tread.is_none()
    }

    /// Radius of a bounding ball about the centre, m.
    #[inline]
    #[must_use]
    pub fn bound(&self) -> f64 {
        if self.is_wide() {
            let inner = self.radius - self.rounding;
            hypot(inner, 0.5 * self.width - self.rounding) + self.rounding
        } else {
            self.radius
        }
    }
}

/// A box that collides with the ground and with other bodies.
#[derive(Clone, Debug)]
pub struct CollisionBox {
    /// Body that carries it.
    pub body: usize,
    /// Name of its solid.
    pub name: String,
    /// Name of its material.
    pub material: String,
    /// Centre in the body's frame, m.
    pub centre: Vector3<f64>,
    /// Rotation from the box's frame to the body's.
    pub rotation: Matrix3<f64>,
    /// Half edge lengths, m.
    pub half_size: Vector3<f64>,
}

/// A ball that collides with the ground and with other bodies.
#[derive(Clone, Debug)]
pub struct CollisionSphere {
    /// Body that carries it.
    pub body: usize,
    /// Name of its solid.
    pub name: String,
    /// Name of its material.
    pub material: String,
    /// Centre in the body's frame, m.
    pub centre: Vector3<f64>,
    /// Radius, m.
    pub radius: f64,
}

/// A cylinder, a capsule, an ellipsoid or a convex hull that collides with the ground and with
/// other bodies.
#[derive(Clone, Debug)]
pub struct Collider {
    /// Body that carries it.
    pub body: usize,
    /// Name of its solid.
    pub name: String,
    /// Name of its material.
    pub material: String,
    /// Centre in the body's frame, m; of a hull its centroid.
    pub centre: Vector3<f64>,
    /// Rotation from the collider's axes to the body's.
    pub rotation: Matrix3<f64>,
    /// Type and dimensions of the collider's shape.
    pub form: ColliderForm,
}

/// The shape of a [`Collider`]; cylinders and capsules are about their y axis.
#[derive(Clone, Debug)]
pub enum ColliderForm {
    /// Radius and half height, m.
    Cylinder {
        /// m.
        radius: f64,
        /// m.
        half: f64,
    },
    /// Two half balls, and a cylinder between their centres.
    Capsule {
        /// m.
        radius: f64,
        /// Distance of each centre from the middle, m.
        half: f64,
    },
    /// Semi-axes, m.
    Ellipsoid {
        /// m.
        radii: Vector3<f64>,
    },
    /// The hull of some points.
    Hull {
        /// About its centroid.
        polytope: Arc<Polytope>,
    },
}

impl Collider {
    /// Radius of a bounding ball about the centre, m.
    #[must_use]
    pub fn bound(&self) -> f64 {
        match &self.form {
            ColliderForm::Cylinder { radius, half } => hypot(*radius, *half),
            ColliderForm::Capsule { radius, half } => radius + half,
            ColliderForm::Ellipsoid { radii } => radii.max(),
            ColliderForm::Hull { polytope } => polytope.bound(),
        }
    }

    /// Middle and half edge lengths of a box around it with its axes, m, relative to the centre.
    #[must_use]
    pub fn bounding_box(&self) -> (Vector3<f64>, Vector3<f64>) {
        let about = |half_size| (Vector3::zeros(), half_size);
        match &self.form {
            ColliderForm::Cylinder { radius, half } => about(Vector3::new(*radius, *half, *radius)),
            ColliderForm::Capsule { radius, half } => {
                about(Vector3::new(*radius, radius + half, *radius))
            }
            ColliderForm::Ellipsoid { radii } => about(*radii),
            ColliderForm::Hull { polytope } => polytope.bounding_box(),
        }
    }
}
