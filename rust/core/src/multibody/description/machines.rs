//! Description of one of several machines.

use serde::{Deserialize, Serialize};

/// Machine in a model of several: a named group of the model's trees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineDescription {
    /// Name of the machine.
    pub name: String,
    /// Name of its first solid, a root. All solids before the first one of the next machine are its
    /// own.
    pub first: String,
    /// Whether parts of one tree of the machine collide with each other, except across a joint.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub self_contact: bool,
}
