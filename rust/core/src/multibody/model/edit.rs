//! Copies of a machine with some of its data changed, and several machines as one model.

use super::Model;
use crate::multibody::description::check_values::{in_range, length};
use crate::multibody::description::{LoopDescription, ModelDescription, WheelDescription};
use crate::multibody::error::{ModelError, ModelFault};
use crate::multibody::motor::Motor;

/// What of a copy of a machine is changed; `None` leaves it as it is.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Radius of all wheels, m, as of [`Model::with_wheel_radius`].
    pub wheel_radius: Option<f64>,
    /// Radius at which the wheels touch, m, as of [`Model::with_contact_radius`].
    pub contact_radius: Option<f64>,
    /// Normal stiffness of all wheels, N/m; 0 for rigid wheels, which state nothing else of their
    /// tread.
    pub wheel_stiffness: Option<f64>,
    /// Normal damping of all wheels, N s/m.
    pub wheel_damping: Option<f64>,
    /// Stiffness of all wheels along the surface relative to the normal one.
    pub wheel_tangential_ratio: Option<f64>,
    /// Relaxation length of all wheels, m.
    pub wheel_relaxation_length: Option<f64>,
    /// Masses by the solids' names, kg; inertias scale with them.
    pub masses: Vec<(String, f64)>,
    /// Factor of all masses and inertias.
    pub mass_scale: Option<f64>,
    /// Stiffness of every steering controller, N m/rad.
    pub steering_stiffness: Option<f64>,
    /// Damping of every steering controller, N m s/rad.
    pub steering_damping: Option<f64>,
    /// Largest torque of every wheel, N m.
    pub wheel_torque_limit: Option<f64>,
    /// The motor of all wheels, or none.
    pub motor: Option<Option<Motor>>,
}

impl Changes {
    /// Whether the stiffness of a wheel with a stated deflection would follow what changes.
    fn changes_what_yields(&self) -> bool {
        let of_wheels = [
            self.wheel_radius,
            self.contact_radius,
            self.wheel_stiffness,
            self.wheel_damping,
            self.wheel_relaxation_length,
        ];
        let scales = self
            .mass_scale
            .is_some_and(|scale| (scale - 1.0).abs() > 0.0);
        scales || !self.masses.is_empty() || of_wheels.iter().any(Option::is_some)
    }

    fn change_wheels(&self, wheels: &mut [WheelDescription]) {
        for wheel in wheels {
            wheel.torque_limit = self.wheel_torque_limit.unwrap_or(wheel.torque_limit);
            if let Some(stiffness) = self.wheel_stiffness {
                if stiffness == 0.0 {
                    wheel.forget_tread();
                }
                wheel.stiffness = Some(stiffness);
            }
            wheel.damping = self.wheel_damping.or(wheel.damping);
            wheel.tangential_ratio = self.wheel_tangential_ratio.or(wheel.tangential_ratio);
            wheel.relaxation_length = self.wheel_relaxation_length.or(wheel.relaxation_length);
            wheel.motor = self.motor.unwrap_or(wheel.motor);
        }
    }
}

impl Model {
    /// Machines side by side in one model, each on its own trees, perhaps with loops between them.
    ///
    /// A machine's name and a slash come before the names of its solids, wheels, tags and loops.
    /// The descriptions are those of models.
    ///
    /// # Errors
    /// The first invalid entry, named by its field; `NoSolids` without any machine.
    pub fn joined(
        name: &str,
        machines: Vec<(String, ModelDescription)>,
        loops: Vec<LoopDescription>,
    ) -> Result<Self, ModelError> {
        Self::from_description(ModelDescription::joined(name, machines, loops))
    }

    /// The description, with the stiffness of its wheels stated: it stays when masses and radii
    /// change.
    fn settled(&self) -> ModelDescription {
        let mut description = self.description.clone();
        description.state_treads();
        description
    }

    /// A copy with changes. The wheels keep their stiffness.
    ///
    /// # Errors
    /// A number out of its range; `UnknownName` for a solid that does not exist; `NotADisc` as of
    /// [`Model::with_wheel_radius`].
    pub fn changed(&self, changes: &Changes) -> Result<Self, ModelError> {
        let mut description = if changes.changes_what_yields() {
            self.settled()
        } else {
            self.description.clone()
        };
        changes.change_wheels(&mut description.wheels);
        for (name, mass) in &changes.masses {
            let Some(solid) = description.solids.iter_mut().find(|s| &s.name == name) else {
                let field = "masses".to_owned();
                return Err(ModelFault::UnknownName(name.clone()).at(field));
            };
            solid.set_mass(*mass);
        }
        let steering: Vec<_> = description
            .wheels
            .iter()
            .map(|w| w.steering.clone())
            .collect();
        for solid in &mut description.solids {
            if let Some(scale) = changes.mass_scale {
                solid.set_mass(solid.mass * scale);
            }
            if let Some(hold) = &mut solid.hold
                && steering.iter().flatten().any(|name| *name == solid.name)
            {
                hold.stiffness = changes.steering_stiffness.unwrap_or(hold.stiffness);
                hold.damping = changes.steering_damping.unwrap_or(hold.damping);
            }
        }
        let mut model = Self::from_description(description)?;
        if let Some(radius) = changes.wheel_radius {
            model = model.with_wheel_radius(radius)?;
        }
        if let Some(radius) = changes.contact_radius {
            model = model.with_contact_radius(radius)?;
        }
        Ok(model)
    }

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
            let found = solids.find(|s| &s.name == name && s.joint_kind().has_axis());
            let Some(solid) = found else {
                return Err(ModelFault::UnknownName(name.clone()).at(format!("joints[{i}]")));
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
        let mut description = self.settled();
        length("wheel_radius", radius)?;
        for wheel in &mut description.wheels {
            let mut solids = description.solids.iter_mut();
            let solid = solids.find(|s| s.name == wheel.solid);
            if let Some(solid) = solid {
                let Some(before) = solid.set_disc_radius(&wheel.axle, radius) else {
                    return Err(ModelFault::NotADisc(wheel.solid.clone()).at("wheel_radius"));
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
        let mut description = self.settled();
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
        let mut description = self.settled();
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
