//! A scene: the description of everything that a simulation steps, without its state; and a
//! snapshot: all data that a simulation of it needs to continue bit for bit.
//!
//! A scene is a machine, or many bodies, on a ground. It provides a [`MechanicalSystem`] for each
//! step, defines its command and its memory between steps, and checks its own part of a snapshot.
//! Everything else is written once, in [`super::Simulation`].

use serde::{Deserialize, Serialize};

use super::active_contact::{ActiveContact, LocatedContact};
use super::state::{Moved, State};
use crate::integrator::{
    Dynamics, MechanicalSystem, Obstacle, Probe, StepOptions, StepReport, StepScratch,
    UnilateralContact, WarmStart,
};
use crate::multibody::Energy;

/// Key of a scene's contacts.
pub type SceneKey<S> = <<S as Scene>::Contact as UnilateralContact>::Key;

/// Scratch of a scene's steps.
pub type SceneScratch<S> = StepScratch<<S as Scene>::Moved, <S as Scene>::Contact>;

/// A system that can be simulated.
pub trait Scene: Clone {
    /// A point of the configuration space.
    type Configuration: Clone + PartialEq;
    /// A configuration in the form that steps move.
    type Moved: Moved<Self::Configuration> + Clone + PartialEq;
    /// A contact of a step.
    type Contact: LocatedContact;
    /// Command, which holds until the next one: torques, held joints.
    type Command: Clone + PartialEq;
    /// Memory between steps beyond the state.
    type Memory: Clone + PartialEq;
    /// Scratch of its matrices. It holds no state: a fresh one gives the same bits.
    type Parts: Clone;
    /// The scene as a step sees it.
    type System<'a>: MechanicalSystem<Machine: Dynamics<Configuration = Self::Moved>, Contact = Self::Contact>
    where
        Self: 'a;

    /// Number of velocities.
    fn nv(&self) -> usize;

    /// A configuration in the form that steps move.
    fn moved(&self, q: &Self::Configuration) -> Self::Moved;

    /// The command of a new simulation.
    fn command(&self) -> Self::Command;

    /// The memory of a new simulation.
    fn memory(&self) -> Self::Memory;

    /// Fresh scratch.
    fn parts(&self) -> Self::Parts;

    /// Usual upper bound of the number of contacts, for which memory is reserved.
    fn contact_capacity(&self) -> usize;

    /// The system at the start of a step. What it takes from the memory it gives back when it is
    /// dropped.
    fn system<'a>(
        &'a self,
        options: &StepOptions,
        command: &'a Self::Command,
        memory: &'a mut Self::Memory,
        parts: &'a mut Self::Parts,
    ) -> Self::System<'a>;

    /// Where a contact of the last step lies, world, m.
    fn position(
        &self,
        parts: &Self::Parts,
        contact: &Self::Contact,
    ) -> <Self::Contact as UnilateralContact>::Local;

    /// Called at the start of a call, or after the state was set: resets sums over a call. By
    /// default there are none.
    fn begin_call(&self, _parts: &mut Self::Parts) {}

    /// Called after a step that panicked: makes the scratch anew and takes from it what belongs to
    /// the memory. By default nothing does.
    fn recover(&self, parts: &mut Self::Parts, _memory: &mut Self::Memory) {
        *parts = self.parts();
    }

    /// Called after each accepted step. By default it does nothing.
    fn after_step(&self, _taken: AcceptedStep<'_, Self>) {}

    /// Takes a step with the usual effort, by the law of the options' variant. By default all steps
    /// are taken with all effort.
    fn usual_step(&self, _step: &mut UsualStep<'_, Self>, _probe: &mut dyn Probe) -> UsualOutcome {
        UsualOutcome::None
    }

    /// Called at the end of a call: makes `scratch` that of the last step, whichever way it was
    /// taken. By default it is.
    fn show_last(&self, _parts: &mut Self::Parts, _scratch: &mut SceneScratch<Self>) {}

    /// Kinetic and potential energy of a state under a command, J.
    fn energy(
        &self,
        options: &StepOptions,
        state: &State<Self::Configuration>,
        command: &Self::Command,
    ) -> Energy;

    /// The part of it that position controls store, which a command changes at once, J. By default
    /// there are none.
    fn stored(&self, _state: &State<Self::Configuration>, _command: &Self::Command) -> f64 {
        0.0
    }

    /// A number that is equal for two scenes only if a snapshot of one fits the other.
    fn fingerprint(&self) -> u64;

    /// Whether a snapshot's configuration, command, memory and contacts fit this scene. The caller
    /// has already checked the velocities, the warm start and the numbers of contacts.
    fn admits(&self, snapshot: &Snapshot<Self>) -> bool;
}

/// State, command, memory, the solver's starting point and the last step's contacts.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound(
    serialize = "S::Configuration: Serialize, S::Command: Serialize, S::Memory: Serialize, SceneKey<S>: Serialize, \
                 S::Contact: Serialize, <S::Contact as UnilateralContact>::Local: Serialize",
    deserialize = "S::Configuration: Deserialize<'de>, S::Command: Deserialize<'de>, S::Memory: Deserialize<'de>, \
                   SceneKey<S>: Deserialize<'de>, S::Contact: Deserialize<'de>, \
                   <S::Contact as UnilateralContact>::Local: Deserialize<'de>"
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
    /// Whether the snapshot has the sizes of a scene with this many velocities, and only finite
    /// numbers.
    pub(super) fn is_sound(&self, nv: usize) -> bool {
        let warm = &self.warm_start;
        let impulses = warm.impulses.iter().flat_map(|(_, p)| p);
        let mut numbers = (self.state.v.iter())
            .chain(&warm.persistent)
            .chain(&warm.stored)
            .chain(impulses);
        self.state.v.len() == nv
            && [0, nv].contains(&warm.persistent.len())
            && self.state.time.is_finite()
            && numbers.all(|x| x.is_finite())
            && self.active.iter().all(ActiveContact::is_finite)
    }
}

/// What came of a step with the usual effort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UsualOutcome {
    /// The scene has no such steps.
    None,
    /// The step takes more effort, for a reason; nothing has changed.
    Refused(Obstacle),
    /// The step was taken.
    Taken(StepReport),
}

/// A step that a scene may take with the usual effort.
pub struct UsualStep<'a, S: Scene> {
    /// The step's options.
    pub options: &'a StepOptions,
    /// Configuration, velocity and time.
    pub state: &'a mut State<S::Configuration>,
    /// The command.
    pub command: &'a S::Command,
    /// The scene's memory.
    pub memory: &'a mut S::Memory,
    /// The scene's scratch.
    pub parts: &'a mut S::Parts,
    /// Where the solve starts.
    pub warm_start: &'a mut WarmStart<SceneKey<S>>,
}

/// A step that was just accepted.
pub struct AcceptedStep<'a, S: Scene> {
    /// The step's options.
    pub options: &'a StepOptions,
    /// Configuration, velocity and time, which the scene may correct.
    pub state: &'a mut State<S::Configuration>,
    /// The scene's memory.
    pub memory: &'a mut S::Memory,
    /// The scene's scratch.
    pub parts: &'a mut S::Parts,
    /// Where the next solve starts.
    pub warm_start: &'a mut WarmStart<SceneKey<S>>,
    /// Contacts, impulses and local velocities of the step.
    pub scratch: &'a SceneScratch<S>,
}

/// Scratch that holds W as a dense matrix.
pub trait DenseOperator {
    /// Delassus operator of the last step, row-major, 1/kg.
    fn operator(&self) -> &[f64];
}
