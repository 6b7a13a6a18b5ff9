//! Description of a constraint that closes a kinematic loop.

use serde::{Deserialize, Serialize};

/// What a loop holds together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LoopKind {
    /// A point of one solid stays on a point of another, as a ball joint holds it.
    Connect,
    /// Two solids keep their relative pose.
    Weld,
    /// The coordinate of a joint is a polynomial in that of another.
    Joint,
}

impl LoopKind {
    /// Name of the kind in a file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Connect => "connect",
            Self::Weld => "weld",
            Self::Joint => "joint",
        }
    }
}

/// A constraint between two solids, or two joints, of the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoopDescription {
    /// Name of the loop.
    pub name: String,
    /// Kind of the loop: what it holds together.
    pub kind: LoopKind,
    /// The first solid, or the solid of the joint that follows.
    pub solid: String,
    /// The second solid, or the solid of the joint that is followed. `None` for the world, or for a
    /// joint at a constant coordinate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other: Option<String>,
    /// The common point in the frame of the first solid, m; its origin by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// The common point in the frame of the second solid, m. By default where it is at the zero of
    /// all joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_position: Option<[f64; 3]>,
    /// Rotation from the frame of the first solid to that of the second of a weld as a rotation
    /// vector, rad. By default as at the zero of all joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_rotation: Option<[f64; 3]>,
    /// Coefficients of the polynomial of a joint, the constant first, at most [`MAX_TERMS`];
    /// `[0, 1]` by default, or `[0]` without another joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub polynomial: Option<Vec<f64>>,
}

/// Most coefficients of a polynomial.
pub const MAX_TERMS: usize = 5;
