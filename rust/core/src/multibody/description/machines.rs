//! Description of one of several machines.

use serde::{Deserialize, Serialize};

/// One of several machines: a name for some of the trees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineDescription {
    /// Its name.
    pub name: String,
    /// Name of its first solid, a root. All solids before the first one of the next machine are its
    /// own.
    pub first: String,
    /// As [`super::ModelDescription::self_contact`], for the trees of this machine.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub self_contact: bool,
}
