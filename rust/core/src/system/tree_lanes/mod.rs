//! Trees of one mechanism in the lanes of a scalar: what moves, and the forces on it without those
//! of contacts.
//!
//! [`TreeLanes`] has the [`Dynamics`](crate::integrator::Dynamics) of the tree (`dynamics`) and its
//! [`Forces`](crate::integrator::Forces) (`forces`): drives, wrenches (`pushing`), sand (`sinking`)
//! and closed loops. Whoever holds one adds the contacts: [`super::block`], [`super::tree`],
//! [`super::tangent`].
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

mod dynamics;
mod forces;
mod pushing;
mod sinking;

use std::sync::Arc;

use super::command::{Command, Wrench};
use super::drives::Drives;
use super::gyroscopic::Gyroscopic;
use super::sand::SandContact;
use crate::contact::loops::Loops;
use crate::contact::placed_wheel::PlacedWheel;
use crate::geometry::Terrain;
use crate::integrator::StepOptions;
use crate::multibody::bias::BiasScratch;
use crate::multibody::model::Loop;
use crate::multibody::{EnergyScratch, Factor, Inertias, MassMatrix, Mechanism, Model, Poses};
use crate::sand::{RutMap, SandState};
use crate::scalar::{Lane, MAX_LANES, Vec3};

/// Trees of one mechanism: their descriptions, commands, and the matrices of a step.
#[derive(Clone)]
pub struct TreeLanes<T: Lane> {
    pub token: T::Token,
    pub mechanism: Arc<Mechanism>,
    pub models: [Option<Arc<Model>>; MAX_LANES],
    pub inertias: Inertias<T>,
    /// m/s².
    pub gravity: Vec3<T>,
    pub drives: Drives<T>,
    /// What pushes the tree of each lane, and its generalized force at the midpoint (nv).
    pub wrenches: [Vec<Wrench>; MAX_LANES],
    pub applied: Vec<T>,
    /// Wheels as sand meets them; the sand, once a tree stands on soft ground, that ground in each
    /// lane, and the ruts of each.
    in_sand: Vec<PlacedWheel>,
    sand: Option<Box<SandContact<T>>>,
    soft: [Option<Arc<dyn Terrain>>; MAX_LANES],
    ruts: Vec<RutMap>,
    /// Work of the sand on each cluster, J.
    of_sand: Vec<T>,
    /// An impulse (nv) that does not depend on the velocity; empty if there is none.
    pub given: Vec<T>,
    /// Whether the energy is audited.
    pub is_audited: bool,
    pub poses_middle: Poses<T>,
    pub poses_end: Poses<T>,
    /// Coordinates of the joints at the midpoint and at the predicted end.
    pub joints_middle: Vec<T>,
    pub joints_end: Vec<T>,
    pub mass_matrix: MassMatrix<T>,
    pub factor: Factor<T>,
    bias_scratch: BiasScratch<T>,
    /// Scratch of implicit gyroscopic terms, from the first step with them on.
    implicit: Option<Box<Gyroscopic<T>>>,
    /// Whether a tree may need implicit gyroscopic terms in the present step: M̂ is then kept
    /// beside its factor.
    turns: bool,
    /// Whether steps are taken with all effort, which may ask for implicit terms at any time.
    pub is_thorough: bool,
    energy_scratch: EnergyScratch<T>,
    /// Closed loops, which number the contacts by their places, and how many there are.
    pub loops: Option<Box<Loops<T>>>,
    n_places: usize,
    /// Impulse of torques, sand and wrenches over the step (nv).
    torque: Vec<T>,
    /// Bias at the middle of the step and the velocity before it (nv); empty until it is known.
    bias_before: Vec<T>,
}

impl<T: Lane> TreeLanes<T> {
    /// Room for trees with these closed loops and wheels, and `n_places` for contacts.
    pub(crate) fn new(
        token: T::Token,
        mechanism: &Arc<Mechanism>,
        loops: &[Loop],
        in_sand: Vec<PlacedWheel>,
        n_places: usize,
    ) -> Self {
        let zero = T::splat(token, 0.0);
        let vector = || vec![zero; mechanism.nv()];
        Self {
            token,
            models: [const { None }; MAX_LANES],
            inertias: Inertias::new(token, mechanism),
            gravity: Vec3::splat(token, [0.0; 3]),
            drives: Drives::new(token, mechanism),
            wrenches: [const { Vec::new() }; MAX_LANES],
            applied: vector(),
            in_sand,
            sand: None,
            soft: [const { None }; MAX_LANES],
            ruts: vec![RutMap::default(); T::LANES],
            of_sand: vec![zero; mechanism.n_clusters()],
            given: Vec::new(),
            is_audited: true,
            poses_middle: Poses::new(token, mechanism),
            poses_end: Poses::new(token, mechanism),
            joints_middle: vec![zero; mechanism.joints.len()],
            joints_end: vec![zero; mechanism.joints.len()],
            mass_matrix: MassMatrix::new(token, mechanism),
            factor: Factor::new(token, mechanism),
            bias_scratch: BiasScratch::new(token, mechanism),
            implicit: None,
            turns: false,
            is_thorough: false,
            energy_scratch: EnergyScratch::new(token, mechanism),
            loops: Loops::new(token, mechanism, loops, 0),
            n_places,
            torque: vector(),
            bias_before: vector(),
            mechanism: Arc::clone(mechanism),
        }
    }

    /// Gives a lane a tree under a command on a terrain. `work`: of each drive since the call began
    /// (n_joints), J. [`Drives::finish_loading`] follows after all lanes.
    pub fn load_tree(
        &mut self,
        lane: usize,
        (model, terrain): (&Arc<Model>, &Arc<dyn Terrain>),
        gravity: [f64; 3],
        command: &Command,
        work: &[f64],
        sand: Option<&mut SandState>,
    ) {
        if !(self.models[lane].as_ref()).is_some_and(|own| Arc::ptr_eq(own, model)) {
            self.inertias.set_lane(lane, model.inertias());
            self.models[lane] = Some(Arc::clone(model));
        }
        self.gravity.set(lane, gravity);
        self.wrenches[lane].clone_from(&command.wrenches);
        self.drives.set_lane(lane, model.joints(), command);
        self.drives.set_work(lane, work);
        self.load_sand(lane, terrain, sand);
    }

    #[inline(always)]
    fn number(&self, x: f64) -> T {
        T::splat(self.token, x)
    }

    /// h and θ.
    #[inline(always)]
    fn step(&self, options: &StepOptions) -> (T, T) {
        (self.number(options.time_step), self.number(options.theta))
    }
}
