//! Copies of a machine with some of its data changed.

use super::Model;
use crate::multibody::description::JointKind;
use crate::multibody::description::check_values::{in_range, length};
use crate::multibody::error::ModelError;
use crate::multibody::motor::Motor;

impl Model {
    /// A copy with joints locked at angles (rad) or displacements (m): their solids are merged and
    /// their coordinates removed.
    ///
    /// # Errors
    /// `UnknownName` for a joint that does not exist or has no single coordinate, `NotFinite` for
    /// an angle that is not finite, `CoupledApart` if another joint follows one of these.
    pub fn with_locked_joints(&self, joints: &[(String, f64)]) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        for (i, (name, angle)) in joints.iter().enumerate() {
            let mut solids = description.solids.iter_mut();
            let is_joint = |kind| matches!(kind, JointKind::Revolute | JointKind::Prismatic);
            let found = solids.find(|s| &s.name == name && is_joint(s.joint_kind()));
            let Some(solid) = found else {
                return Err(ModelError::UnknownName {
                    field: format!("joints[{i}]"),
                    name: name.clone(),
                });
            };
            in_range(&format!("joints[{name}]"), *angle, 1e9, "at most 1e9 rad")?;
            solid.locked = Some(*angle);
        }
        Self::build(description)
    }

    /// A copy with another wheel radius (m): shape, inertia and contact radius change together. If
    /// the solid has several shapes, the wheel's disc changes. An inertia stated in the description
    /// is scaled by the square of the radius.
    ///
    /// # Errors
    /// `NotADisc` for a wheel whose solid has another shape; a radius out of range.
    pub fn with_wheel_radius(&self, radius: f64) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        length("wheel_radius", radius)?;
        for wheel in &mut description.wheels {
            let mut solids = description.solids.iter_mut();
            let solid = solids.find(|s| s.name == wheel.solid);
            if let Some(solid) = solid {
                let Some(before) = solid.set_disc_radius(&wheel.axle, radius) else {
                    return Err(ModelError::NotADisc {
                        field: "wheel_radius",
                        solid: wheel.solid.clone(),
                    });
                };
                let scale = (radius / before).powi(2);
                for entry in solid.inertia.iter_mut().flatten() {
                    *entry *= scale;
                }
            }
            wheel.radius = radius;
            wheel.contact_radius = None;
        }
        Self::from_description(description)
    }

    /// A copy whose wheels touch the ground at a radius (m) other than that of their discs. Masses,
    /// inertias and appearance stay the same.
    ///
    /// # Errors
    /// A radius out of range.
    pub fn with_contact_radius(&self, radius: f64) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        length("contact_radius", radius)?;
        for wheel in &mut description.wheels {
            wheel.contact_radius = Some(radius);
        }
        Self::from_description(description)
    }

    /// A copy with all masses and inertias multiplied by a factor.
    ///
    /// # Errors
    /// A mass or an inertia that leaves its range.
    pub fn with_masses_scaled(&self, factor: f64) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        for solid in &mut description.solids {
            solid.set_mass(solid.mass * factor);
        }
        Self::from_description(description)
    }

    /// A copy with another torque–speed line, or none, on all wheels.
    ///
    /// # Errors
    /// `NotPositive` or `NotFinite` for an invalid torque or speed.
    pub fn with_motors(&self, motor: Option<Motor>) -> Result<Self, ModelError> {
        let mut description = self.description.clone();
        for wheel in &mut description.wheels {
            wheel.motor = motor;
        }
        Self::from_description(description)
    }
}
