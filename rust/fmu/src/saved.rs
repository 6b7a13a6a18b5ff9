//! The state of a unit, which a master keeps, restores, and writes as bytes.

use rover_core::simulation::sealed::{seal, unseal};
use rover_core::simulation::{RoverScene, Snapshot};
use serde::{Deserialize, Serialize};

use crate::refusal::Refusal;
use crate::state::{Inputs, LastStep, Parameters, UnitMode};

/// Everything that changes in a unit.
#[derive(Clone, Serialize, Deserialize)]
pub struct Saved {
    /// Token of the unit that the state belongs to.
    pub token: String,
    pub mode: UnitMode,
    pub parameters: Parameters,
    pub inputs: Inputs,
    /// Time of the master, s.
    pub time: f64,
    /// Where the run ends, s.
    pub stop: Option<f64>,
    pub last: LastStep,
    pub rover: Snapshot<RoverScene>,
}

impl Saved {
    /// The state as bytes with a checksum, for [`Self::from_bytes`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, Refusal> {
        Ok(seal(postcard::to_stdvec(self).map_err(|e| damaged(&e))?))
    }

    /// Reads exactly these bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        let bytes = unseal(bytes).map_err(|e| damaged(&e))?;
        let (saved, rest) = postcard::take_from_bytes(bytes).map_err(|e| damaged(&e))?;
        if rest.is_empty() {
            return Ok(saved);
        }
        Err(Refusal::State {
            message: format!("{} bytes follow its end", rest.len()),
        })
    }
}

fn damaged(e: &impl ToString) -> Refusal {
    Refusal::State {
        message: format!("is damaged ({})", e.to_string()),
    }
}
