//! A snapshot: all data that a simulation needs to continue bit for bit.

use serde::{Deserialize, Serialize};

use super::active_contact::{ActiveContact, LocatedContact};
use super::scene::{Scene, SceneKey};
use super::state::State;
use crate::integrator::WarmStart;

/// State, command, memory, the solver's starting point and the last step's contacts.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound(
    serialize = "S::Configuration: Serialize, S::Command: Serialize, S::Memory: Serialize, SceneKey<S>: Serialize, \
                 S::Contact: Serialize, <S::Contact as LocatedContact>::Vector: Serialize",
    deserialize = "S::Configuration: Deserialize<'de>, S::Command: Deserialize<'de>, S::Memory: Deserialize<'de>, \
                   SceneKey<S>: Deserialize<'de>, S::Contact: Deserialize<'de>, \
                   <S::Contact as LocatedContact>::Vector: Deserialize<'de>"
))]
pub struct Snapshot<S: Scene> {
    /// [`Scene::fingerprint`] of its scene.
    pub scene: u64,
    /// Configuration, velocity and time.
    pub state: State<S::Configuration>,
    /// The command.
    pub command: S::Command,
    /// The scene's memory.
    pub memory: S::Memory,
    /// Where the next solve starts.
    pub warm_start: WarmStart<SceneKey<S>>,
    /// Contacts of the last step.
    pub active: Vec<ActiveContact<S::Contact>>,
}

impl<S: Scene> PartialEq for Snapshot<S> {
    fn eq(&self, other: &Self) -> bool {
        self.scene == other.scene
            && self.state == other.state
            && self.command == other.command
            && self.memory == other.memory
            && self.warm_start == other.warm_start
            && self.active == other.active
    }
}

impl<S: Scene> Snapshot<S> {
    /// Whether it has the sizes of a scene with this many velocities, and only finite numbers.
    pub(super) fn is_sound(&self, nv: usize) -> bool {
        let warm = &self.warm_start;
        let impulses = warm.impulses.iter().flat_map(|(_, p)| p);
        let mut numbers = self.state.v.iter().chain(&warm.persistent).chain(impulses);
        self.state.v.len() == nv
            && [0, nv].contains(&warm.persistent.len())
            && self.state.time.is_finite()
            && numbers.all(|x| x.is_finite())
            && self.active.iter().all(ActiveContact::is_finite)
    }
}
