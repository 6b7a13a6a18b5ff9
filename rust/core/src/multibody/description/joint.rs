//! What a description says of a joint.

use serde::{Deserialize, Serialize};

use crate::multibody::motor::Motor;

/// Kind of a joint: see [`crate::multibody::joint`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Moves anywhere; only of a root.
    Free,
    /// Does not move relative to its parent, or to the world.
    Fixed,
    /// Turns about its axis.
    Revolute,
    /// Slides along its axis.
    Prismatic,
    /// Turns about its origin.
    Spherical,
}

impl JointKind {
    /// As it is written.
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

/// Gains of a joint held at a set-point: `τ = −stiffness (q − q*) − damping q̇`.
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
    /// Where it is slack, rad or m; 0 by default.
    #[serde(default)]
    pub rest: f64,
}

/// Stops of a joint: `lower ≤ q ≤ upper`, as unilateral as a contact and with the same restitution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// rad or m.
    pub lower: f64,
    /// rad or m.
    pub upper: f64,
}

/// Drive of a joint that is no wheel's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveDescription {
    /// Largest torque either way, N m.
    pub torque_limit: f64,
    /// Torque–speed line of its motor; without one the torque is the command at any speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<Motor>,
}

/// How a joint follows another: `q = ratio q_other + offset`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CouplingDescription {
    /// The solid whose joint it follows, listed before.
    pub joint: String,
    /// Its rate per unit of the other's; −1 for a differential.
    pub ratio: f64,
    /// Its coordinate where the other's is zero, rad or m; 0 by default.
    #[serde(default)]
    pub offset: f64,
}
