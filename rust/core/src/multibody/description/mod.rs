//! The model as data: the content of a machine's file, readable and writable, not yet checked.
//!
//! [`Model::from_description`](super::Model::from_description) checks it and builds the trees.

use serde::{Deserialize, Serialize};

pub(super) mod check;
pub(super) mod check_loops;
mod check_shapes;
pub(super) mod check_values;
pub mod closure;
mod gallery;
mod join;
pub mod joint;
mod laying;
mod machines;
mod masses;
pub mod shape;
mod tracks;
mod yielding;

use super::error::{ModelError, ModelFault};
use super::motor::Motor;
pub use closure::{LoopDescription, LoopKind};
pub use joint::{CouplingDescription, DriveDescription, Hold, JointKind, JointLimits, Spring};
pub use machines::MachineDescription;
pub use masses::MassProperties;
pub use shape::{DrawingDescription, Shape, ShapeDescription};
pub use tracks::TrackDescription;

/// The built-in rover: Table 4.1 and Fig. 4.5 of the report, in SI units.
const ROVER: &str = include_str!("../../../models/rover.toml");

/// The version of the format that is read and written.
pub const FORMAT: u32 = 1;

fn current_format() -> u32 {
    FORMAT
}

/// Kinematic trees of solids, with their wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelDescription {
    /// Version of the format, [`FORMAT`]; a file without one has the first.
    #[serde(default = "current_format", skip_serializing)]
    pub format: u32,
    /// Name of the machine.
    pub name: String,
    /// Solids. Parents precede their children, and the solids of one tree are listed together.
    /// Their order is the order of the coordinates.
    pub solids: Vec<SolidDescription>,
    /// Wheels in the order of every public array.
    #[serde(default)]
    pub wheels: Vec<WheelDescription>,
    /// Tracks. A model has their wheels instead.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tracks: Vec<TrackDescription>,
    /// Named points.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tags: Vec<TagDescription>,
    /// Constraints that close kinematic loops.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub loops: Vec<LoopDescription>,
    /// Materials with a friction of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<MaterialDescription>,
    /// Whether parts of one tree collide with each other, except across a joint. Parts of two trees
    /// always collide.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub self_contact: bool,
    /// Machines of which it consists, in the order of their solids and wheels; none for a single
    /// machine.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub machines: Vec<MachineDescription>,
}

/// A point fixed to a solid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TagDescription {
    /// Name of the tag.
    pub name: String,
    /// The solid that carries it.
    pub solid: String,
    /// Position in the solid's frame, m.
    pub position: [f64; 3],
    /// Rotation from axes at the point to the solid's frame as a rotation vector (axis times
    /// angle), rad; the identity by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f64; 3]>,
}

/// A material with a friction of its own, which holds with every other material whose pair has no
/// law in the step's options. Between two such materials the smaller friction holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialDescription {
    /// Name of the material, by which wheels and shapes refer to it.
    pub name: String,
    /// Coulomb's coefficient.
    pub friction: f64,
    /// Coefficient across a wheel on the ground, if it differs from that along its rolling
    /// direction, `friction`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_across: Option<f64>,
}

impl MaterialDescription {
    /// Friction across over that along, if they differ.
    #[must_use]
    pub fn across(&self) -> Option<f64> {
        let ratio = self.friction_across? / self.friction;
        Some(ratio).filter(|ratio| (ratio - 1.0).abs() > 0.0)
    }
}

/// One solid and the joint that carries it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolidDescription {
    /// Name of the solid and of its joint.
    pub name: String,
    /// Name of the solid that carries it; `None` for a root, which its joint connects to the world.
    ///
    /// A root other than the first must specify its `joint`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// Type of the joint: by default free for a root and revolute for all other solids.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointKind>,
    /// Origin of the joint's frame in the parent's frame, m; in the world for a root that is not
    /// free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// Rotation from the joint's frame to the parent's as a rotation vector (axis times angle),
    /// rad; the identity by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f64; 3]>,
    /// Axis of a revolute or prismatic joint in the joint's frame; need not be a unit vector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// Mass, kg.
    pub mass: f64,
    /// Only shape of the solid, centred at its mass centre; defines the appearance and, by default,
    /// the inertia.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<Shape>,
    /// Shapes of the solid, each with a pose, instead of `shape` and `collides`. Optional for a
    /// solid with a given inertia.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shapes: Vec<ShapeDescription>,
    /// Meshes that are drawn in place of its shapes that are not visible. They touch nothing and
    /// have no mass.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drawings: Vec<DrawingDescription>,
    /// Mass centre in the solid's frame, m; the origin by default. A solid with `shapes` specifies
    /// both this and `inertia`, or neither.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre_of_mass: Option<[f64; 3]>,
    /// Inertia about the mass centre in the axes of the frame, kg m²: xx, yy, zz, xy, xz, yz.
    /// Computed from the shape or the shapes by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<[f64; 6]>,
    /// Whether `shape` collides with the ground and with other bodies; a disc cannot. In a solid
    /// with `shapes` each shape has its own flag.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub collides: bool,
    /// Name of the material of `shape`; `body` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// PD gains that hold the joint at a set-point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold: Option<Hold>,
    /// Spring of the joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spring: Option<Spring>,
    /// Viscous damping of the joint, N m s/rad or N s/m; 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<f64>,
    /// Dry friction of the joint, N m or N: largest torque or force with which it resists; 0 by
    /// default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Rotor inertia reflected to the joint, kg m² or kg; 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub armature: Option<f64>,
    /// Stops of the joint, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<JointLimits>,
    /// Drive of a revolute joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<DriveDescription>,
    /// Another joint that this one follows, so that it has no coordinate of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coupled: Option<CouplingDescription>,
    /// Angle (rad) or displacement (m) at which the joint is locked (welded), which removes its
    /// coordinate. Not locked by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub locked: Option<f64>,
}

/// A wheel, fixed to a solid: a thin disc, or a cylinder with rounded edges.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WheelDescription {
    /// Short name, such as `FL`.
    pub name: String,
    /// The rotating solid; its origin is the wheel's centre.
    pub solid: String,
    /// Direction of the axle in the solid's frame.
    pub axle: [f64; 3],
    /// Radius, m; equal to that of the disc if the solid's shape is a disc.
    pub radius: f64,
    /// Contact radius with the ground, m, if it differs from the disc's; `radius` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_radius: Option<f64>,
    /// Width along the axle, m, with the solid's origin in its middle; 0, a thin disc, by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<f64>,
    /// Radius of the rounded edges of its rim, m, from 0 for a cylinder, the default, to half the
    /// width for a torus.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rounding: Option<f64>,
    /// Height of the grousers over the rim, m, which sand feels; 0, a smooth wheel, by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grouser_height: Option<f64>,
    /// Number of grousers around the rim; 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grousers: Option<u32>,
    /// Deflection where it touches, as a share of its radius, under its share of the machine's
    /// weight on Earth. By default 3e-4 for a wheel that can stand on a line, and any other one is
    /// rigid. Not read beside a stiffness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deflection: Option<f64>,
    /// Normal stiffness where it touches, N/m; 0: rigid. By default that of the deflection.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Normal damping where it touches, N s/m. By default critical beside a deflection, and 0
    /// beside a stiffness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<f64>,
    /// Stiffness along the surface relative to the normal one; 1 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tangential_ratio: Option<f64>,
    /// Relaxation length, m: the way of rolling over which the deflection along the surface is
    /// renewed. By default half the length of the contact of a wheel that yields under its share of
    /// the weight.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relaxation_length: Option<f64>,
    /// Free rollers around its rim, as on a mecanum wheel: angle of the roller that touches the
    /// ground from the axle, rad, positive if its axis points forward on the right side. π/2 for an
    /// omni wheel; no rollers by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rollers: Option<f64>,
    /// Name of its material; `wheel` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Largest driving torque, N m.
    pub torque_limit: f64,
    /// 1 or −1: joint torque of a positive (forward) command.
    pub drive_sign: f64,
    /// Torque–speed line of its motor. Without one the torque equals the command at any speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<Motor>,
    /// Gain of its speed servo: torque for each rad/s that is missing, N m s/rad. By default a
    /// wheel that rolls with its share of the machine has a time constant of 0.5 ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_gain: Option<f64>,
    /// The solid whose joint steers it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steering: Option<String>,
    /// Largest steering set-point in either direction, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steering_limit: Option<f64>,
}

/// Largest number of solids in a model, and of wheels and tags. Beyond it a step takes seconds and
/// matrices take gigabytes.
pub const MAX_SOLIDS: usize = 1000;

/// Largest total number of shapes in a model.
pub const MAX_SHAPES: usize = 4000;

/// Largest total number of triangles that a model draws: a page with them is ten megabytes.
pub const MAX_TRIANGLES: usize = 200_000;

/// Largest length of a description's text, bytes: a model of [`MAX_SOLIDS`] solids needs a
/// twentieth of it.
pub const MAX_TEXT: usize = 16 << 20;

/// What a text of any format says about itself.
#[derive(Deserialize)]
struct Header {
    #[serde(default = "first_format")]
    format: i64,
}

fn first_format() -> i64 {
    1
}

/// What was read; where that is of another format, or failed because of it, an error that says so.
fn read<E: ToString>(
    parsed: Result<ModelDescription, E>,
    format: impl Fn() -> Option<i64>,
) -> Result<ModelDescription, ModelError> {
    match parsed {
        Ok(description) if description.format == FORMAT => Ok(description),
        other => match format() {
            Some(format) if format != i64::from(FORMAT) => {
                Err(ModelFault::UnknownFormat(format).at("format"))
            }
            _ => other.map_err(|e| ModelError::Unreadable {
                message: e.to_string(),
            }),
        },
    }
}

fn check_length(text: &str) -> Result<(), ModelError> {
    if text.len() > MAX_TEXT {
        return Err(ModelFault::TooMany {
            what: "bytes",
            count: text.len(),
            limit: MAX_TEXT,
        }
        .at("text"));
    }
    Ok(())
}

impl SolidDescription {
    /// Type of its joint: as specified, otherwise free for a root and revolute for all other
    /// solids.
    #[must_use]
    pub fn joint_kind(&self) -> JointKind {
        self.joint.unwrap_or(if self.parent.is_some() {
            JointKind::Revolute
        } else {
            JointKind::Free
        })
    }

    /// Radius of the disc of a wheel with this axle, m: that of the only shape, or the largest of
    /// the discs about the axle through the origin.
    pub(super) fn disc_radius(&self, axle: &[f64; 3]) -> Option<f64> {
        let radius = |shape: &Shape| match *shape {
            Shape::Disc { radius } => Some(radius),
            _ => None,
        };
        let of_shapes = (self.shapes.iter()).filter(|shape| shape.is_disc_about(axle));
        let radii = of_shapes.filter_map(|placed| radius(&placed.shape));
        self.shape
            .as_ref()
            .and_then(radius)
            .or_else(|| radii.reduce(f64::max))
    }

    /// Changes the radius (m) of that disc and of all discs of the same size about the same axle.
    /// Returns the previous radius; `None` if there is no such disc.
    pub(super) fn set_disc_radius(&mut self, axle: &[f64; 3], radius: f64) -> Option<f64> {
        let before = self.disc_radius(axle)?;
        let of_shapes = (self.shapes.iter_mut()).filter(|shape| shape.is_disc_about(axle));
        for shape in (self.shape.iter_mut()).chain(of_shapes.map(|placed| &mut placed.shape)) {
            if let Shape::Disc { radius: own } = shape
                && *own >= before
            {
                *own = radius;
            }
        }
        Some(before)
    }

    /// Sets its mass (kg). A specified inertia and the specified masses of its shapes scale with
    /// it.
    pub fn set_mass(&mut self, mass: f64) {
        let scale = mass / self.mass;
        let stated = self.inertia.iter_mut().flatten();
        let of_shapes = self
            .shapes
            .iter_mut()
            .filter_map(|shape| shape.mass.as_mut());
        for value in stated.chain(of_shapes) {
            *value *= scale;
        }
        self.mass = mass;
    }
}

impl ModelDescription {
    /// The rover of the report: the gallery's on rigid wheels.
    ///
    /// # Panics
    /// If the built-in file cannot be read, which the tests exclude.
    #[must_use]
    pub fn rover() -> Self {
        let mut rover = Self::gallery_rover();
        for wheel in &mut rover.wheels {
            wheel.forget_tread();
        }
        rover
    }

    /// The rover of the gallery, whose wheels yield.
    ///
    /// # Panics
    /// If the built-in file cannot be read, which the tests exclude.
    #[must_use]
    pub fn gallery_rover() -> Self {
        let parsed = Self::from_toml(ROVER);
        assert!(parsed.is_ok(), "the built-in rover is readable");
        parsed.unwrap_or_else(|_| Self::empty())
    }

    /// A description of nothing.
    fn empty() -> Self {
        Self {
            format: FORMAT,
            name: String::new(),
            solids: Vec::new(),
            wheels: Vec::new(),
            tracks: Vec::new(),
            tags: Vec::new(),
            loops: Vec::new(),
            materials: Vec::new(),
            self_contact: false,
            machines: Vec::new(),
        }
    }

    /// Reads TOML.
    ///
    /// # Errors
    /// [`ModelError::Unreadable`] with line and column; [`ModelFault::TooMany`] beyond
    /// [`MAX_TEXT`].
    pub fn from_toml(text: &str) -> Result<Self, ModelError> {
        check_length(text)?;
        let format = || Some(toml::from_str::<Header>(text).ok()?.format);
        read(toml::from_str(text), format)
    }

    /// Writes TOML from which [`Self::from_toml`] reads the same description.
    ///
    /// # Errors
    /// [`ModelError::Unreadable`] if a value has no TOML form.
    pub fn to_toml(&self) -> Result<String, ModelError> {
        let text = toml::to_string(self).map_err(|e| ModelError::Unreadable {
            message: e.to_string(),
        })?;
        Ok(format!("format = {FORMAT}\n{text}"))
    }

    /// Reads JSON.
    ///
    /// # Errors
    /// [`ModelError::Unreadable`] with line and column; [`ModelFault::TooMany`] beyond
    /// [`MAX_TEXT`].
    pub fn from_json(text: &str) -> Result<Self, ModelError> {
        check_length(text)?;
        let format = || Some(serde_json::from_str::<Header>(text).ok()?.format);
        read(serde_json::from_str(text), format)
    }

    /// Writes JSON.
    ///
    /// # Errors
    /// [`ModelError::Unreadable`] if a value has no JSON form.
    pub fn to_json(&self) -> Result<String, ModelError> {
        serde_json::to_string(self).map_err(|e| ModelError::Unreadable {
            message: e.to_string(),
        })
    }
}
