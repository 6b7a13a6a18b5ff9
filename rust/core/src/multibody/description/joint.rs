//! Description of a joint.

use serde::{Deserialize, Serialize};

use crate::multibody::motor::Motor;

/// Joint type; see [`crate::multibody::joint`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Six degrees of freedom; roots only.
    Free,
    /// No motion relative to its parent or to the world.
    Fixed,
    /// Rotation about its axis.
    Revolute,
    /// Translation along its axis.
    Prismatic,
    /// Rotation about its origin.
    Spherical,
}

impl JointKind {
    /// Whether a joint of this type has an axis, and with it the coordinate that springs, limits
    /// and couplings act on.
    #[must_use]
    pub fn has_axis(self) -> bool {
        matches!(self, Self::Revolute | Self::Prismatic)
    }

    /// Name of the joint type in a file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Fixed => "fixed",
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
            Self::Spherical => "spherical",
        }
    }
}

/// PD gains of a joint held at a set-point: `τ = −stiffness (q − q*) − damping q̇`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hold {
    /// N m/rad or N/m.
    pub stiffness: f64,
    /// N m s/rad or N s/m.
    pub damping: f64,
}

/// Spring of a joint: `τ = −stiffness (q − rest)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// N m/rad or N/m.
    pub stiffness: f64,
    /// Rest position, rad or m; 0 by default.
    #[serde(default)]
    pub rest: f64,
}

/// Stops of a joint: `lower ≤ q ≤ upper`, unilateral like a contact and with the same restitution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointLimits {
    /// rad or m.
    pub lower: f64,
    /// rad or m.
    pub upper: f64,
}

/// Drive of a joint other than a wheel's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveDescription {
    /// Largest torque in either direction, N m.
    pub torque_limit: f64,
    /// Torque–speed line of its motor. Without one the torque equals the command at any speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<Motor>,
}

/// How a joint follows another: `q = ratio q_other + offset`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CouplingDescription {
    /// The solid whose joint it follows; must be listed earlier.
    pub joint: String,
    /// Rate of the joint per unit rate of the joint that it follows; −1 for a differential.
    pub ratio: f64,
    /// Coordinate of the joint at the zero of the joint that it follows, rad or m; 0 by default.
    #[serde(default)]
    pub offset: f64,
}
