//! What a simulation steps: a description of all that there is, without its state.
//!
//! A scene is a machine, or many bodies, with the ground under them. It hands out a
//! [`MechanicalSystem`] for each step, says what can be commanded and what it remembers from step
//! to step, and checks the part of a snapshot that only it understands. Everything else of a
//! simulation is written once, in [`super::Simulation`].

use super::active_contact::LocatedContact;
use super::snapshot::Snapshot;
use super::state::State;
use crate::integrator::{MechanicalSystem, Scratch, StepOptions, UnilateralContact, WarmStart};
use crate::multibody::Energy;

/// Names the contacts of a scene.
pub type SceneKey<S> = <<S as Scene>::Contact as UnilateralContact>::Key;

/// Scratch of a scene's steps.
pub type SceneScratch<S> = Scratch<<S as Scene>::Configuration, <S as Scene>::Contact>;

/// A system that can be simulated.
pub trait Scene: Clone {
    /// A point of the configuration space.
    type Configuration: Clone + PartialEq;
    /// A contact of a step.
    type Contact: LocatedContact;
    /// What can be set from outside and holds until it is set anew: torques, held joints.
    type Command: Clone + PartialEq;
    /// What the scene remembers from step to step beside its state.
    type Memory: Clone + PartialEq;
    /// Scratch of its matrices. Nothing in it is state: a fresh one gives the same bits.
    type Parts: Clone;
    /// The scene as a step sees it.
    type System<'a>: MechanicalSystem<Configuration = Self::Configuration, Contact = Self::Contact>
    where
        Self: 'a;

    /// Number of velocities.
    fn nv(&self) -> usize;

    /// The command of a new simulation.
    fn command(&self) -> Self::Command;

    /// The memory of a new simulation.
    fn memory(&self) -> Self::Memory;

    /// Fresh scratch.
    fn parts(&self) -> Self::Parts;

    /// How many contacts a step usually has at most: room that is made in advance.
    fn contact_capacity(&self) -> usize;

    /// The system of a step that begins.
    fn system<'a>(
        &'a self,
        command: &'a Self::Command,
        memory: &'a Self::Memory,
        parts: &'a mut Self::Parts,
    ) -> Self::System<'a>;

    /// Where a contact of the last step lies, world, m.
    fn position(
        &self,
        parts: &Self::Parts,
        contact: &Self::Contact,
    ) -> <Self::Contact as LocatedContact>::Vector;

    /// A call begins, or the state was set: what is summed over a call
    /// starts anew. By default nothing is.
    fn begin_call(&self, _parts: &mut Self::Parts) {}

    /// After each step that became the state. By default nothing is to do.
    fn after_step(&self, _taken: StepTaken<'_, Self>) {}

    /// Kinetic and potential energy of a state, J.
    fn energy(&self, options: &StepOptions, state: &State<Self::Configuration>) -> Energy;

    /// A number that two scenes share only if a snapshot of one fits the other.
    fn fingerprint(&self) -> u64;

    /// Whether a snapshot's configuration, command, memory and contacts can be this scene's.
    /// Velocities, the warm start and the numbers of contacts have been looked at already.
    fn admits(&self, snapshot: &Snapshot<Self>) -> bool;
}

/// A step that has just become the state.
pub struct StepTaken<'a, S: Scene> {
    /// The step's options.
    pub options: &'a StepOptions,
    /// Configuration, velocity and time, which the scene may correct.
    pub state: &'a mut State<S::Configuration>,
    /// What the scene remembers.
    pub memory: &'a mut S::Memory,
    /// Its scratch.
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
