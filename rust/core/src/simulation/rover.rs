//! A rover on a terrain.

use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::active_contact::LocatedContact;
use super::own_block::OwnBlock;
use super::rover_command::RoverCommand;
use super::scene::{
    AcceptedStep, DenseOperator, Scene, SceneScratch, Snapshot, UsualOutcome, UsualStep,
};
use super::state::State;
use super::stepping::Simulation;
use crate::contact::loops;
use crate::contact::slots::machine::SharedMachine;
use crate::contact::{Contact, Opposite, Part};
use crate::geometry::Terrain;
use crate::integrator::{OptionsError, Probe, StepOptions, StepReport};
use crate::multibody::{
    Configuration, Energy, Kinematics, LaneConfiguration, Model, Momentum, momentum,
};
use crate::sand::SandState;
use crate::scalar::Single;
use crate::system::tree::TreeScene;
use crate::system::{TreeScratch, TreeSystem};

/// A machine on a terrain, both shared.
#[derive(Clone)]
pub struct RoverScene {
    /// The machine.
    pub model: Arc<Model>,
    /// The ground.
    pub terrain: Arc<dyn Terrain>,
    /// What rovers in a block have in common.
    pub(super) machine: Arc<SharedMachine>,
}

impl RoverScene {
    /// A machine on a terrain.
    #[must_use]
    pub fn new(model: Arc<Model>, terrain: Arc<dyn Terrain>) -> Self {
        let machine = Arc::new(SharedMachine::of(&model));
        Self {
            model,
            terrain,
            machine,
        }
    }

    fn admits_memory(&self, memory: &RoverMemory) -> bool {
        let n = self.model.wheels().len();
        let is_of_sand = memory.sand.as_ref().is_none_or(|sand| sand.is_of(n));
        memory.wheel_torque.len() == n
            && memory.wheel_torque.iter().all(|x| x.is_finite())
            && memory.sand.is_some() == self.terrain.soft().is_some()
            && is_of_sand
    }

    /// Scene of the same machine on another terrain.
    #[must_use]
    pub fn on(&self, terrain: Arc<dyn Terrain>) -> Self {
        Self {
            terrain,
            ..self.clone()
        }
    }
}

impl fmt::Debug for RoverScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RoverScene")
            .field("model", &self.model.description().name)
            .finish_non_exhaustive()
    }
}

/// A rover on a terrain, stepped through time.
pub type RoverSimulation = Simulation<RoverScene>;

/// A rover in a state on a terrain, before it is simulated.
#[derive(Clone, Debug)]
pub struct PlacedRover {
    /// The rover and the ground.
    pub scene: RoverScene,
    /// Options of the steps.
    pub options: StepOptions,
    /// Configuration of the rover.
    pub configuration: Configuration,
    /// Velocities of the rover (nv), m/s and rad/s.
    pub v: Vec<f64>,
}

/// Scratch of a rover's steps.
#[derive(Clone, Debug)]
pub struct RoverParts {
    pub(super) tree: TreeScratch,
    pub(super) own: OwnBlock,
    /// Work of each joint's drive in the last call, J.
    pub(super) drive_work: Vec<f64>,
    /// Gap of each wheel to the nearest grain after the last call, m; empty without grains.
    pub(super) gaps_to_grains: Vec<f64>,
}

impl DenseOperator for RoverParts {
    fn operator(&self) -> &[f64] {
        self.own.operator().unwrap_or(self.tree.operator())
    }
}

impl LocatedContact for Contact {
    fn normal(&self) -> [f64; 3] {
        self.frame.rows()[0].into()
    }

    fn is_finite(&self) -> bool {
        let [n, t, b] = self.frame.rows();
        let numbers = [&self.point, &n, &t, &b].into_iter().flatten();
        numbers.chain([&self.gap]).all(|x| x.is_finite())
    }
}

/// What a rover remembers between steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoverMemory {
    /// Mean torque of each wheel's drive in the last step, positive forward, N m.
    pub wheel_torque: Vec<f64>,
    /// The sand under its wheels; none on firm ground.
    pub sand: Option<SandState>,
}

impl Scene for RoverScene {
    type Configuration = Configuration;
    type Moved = LaneConfiguration<f64>;
    type Contact = Contact;
    type Command = RoverCommand;
    type Memory = RoverMemory;
    type Parts = RoverParts;
    type System<'a> = TreeSystem<'a>;

    fn nv(&self) -> usize {
        self.model.nv()
    }

    fn moved(&self, q: &Configuration) -> LaneConfiguration<f64> {
        let mut moved = LaneConfiguration::new(Single::best(), self.model.mechanism());
        moved.set_lane(0, q);
        moved
    }

    fn command(&self) -> RoverCommand {
        RoverCommand::idle(&self.model)
    }

    fn memory(&self) -> RoverMemory {
        let n = self.model.wheels().len();
        RoverMemory {
            wheel_torque: vec![0.0; n],
            sand: self.terrain.soft().map(|_| SandState::new(n)),
        }
    }

    fn parts(&self) -> RoverParts {
        RoverParts {
            tree: TreeScratch::new(&self.model, self.contact_capacity()),
            own: OwnBlock::default(),
            drive_work: vec![0.0; self.model.n_joints()],
            gaps_to_grains: Vec::new(),
        }
    }

    /// Most contacts on a plane: three rim points per wheel, or six if it has a width, four corners
    /// per box, one point per ball, four per collider, both stops of a joint, and its dry friction.
    fn contact_capacity(&self) -> usize {
        let model = &self.model;
        let stops = 2 * model.limited_joints().len() + model.rubbing_joints().len();
        let rims = (model.wheels().iter()).map(|wheel| if wheel.is_wide() { 6 } else { 3 });
        let solids = 4 * (model.boxes().len() + model.colliders().len()) + model.spheres().len();
        rims.sum::<usize>() + solids + stops
    }

    #[inline]
    fn system<'a>(
        &'a self,
        options: &StepOptions,
        command: &'a RoverCommand,
        memory: &'a mut RoverMemory,
        parts: &'a mut RoverParts,
    ) -> TreeSystem<'a> {
        parts.own.set_last(false);
        let scene = TreeScene {
            model: &self.model,
            terrain: &self.terrain,
            command: &command.actuators,
            gravity: options.gravity.into(),
            drive_work: &parts.drive_work,
            sand: memory.sand.as_mut(),
        };
        TreeSystem::new(scene, &mut parts.tree)
    }

    #[inline]
    fn position(&self, parts: &RoverParts, contact: &Contact) -> [f64; 3] {
        let tree = self.model.bodies()[contact.body].tree;
        let origin = match parts.own.last() {
            Some((block, _)) => block.origin(0, tree),
            None => parts.tree.origin(tree),
        };
        (Vector3::from(origin) + contact.point).into()
    }

    fn begin_call(&self, parts: &mut RoverParts) {
        parts.drive_work.fill(0.0);
        parts.gaps_to_grains.clear();
    }

    fn recover(&self, parts: &mut RoverParts, memory: &mut RoverMemory) {
        if let (Some(block), Some(sand)) = (&mut parts.own.block, &mut memory.sand) {
            block.recover_ruts(0, &mut sand.ruts);
        }
        *parts = RoverParts {
            drive_work: std::mem::take(&mut parts.drive_work),
            ..self.parts()
        };
    }

    /// Records torques and work of the drives.
    fn after_step(&self, taken: AcceptedStep<'_, Self>) {
        let drives = taken.parts.tree.drives();
        drives.to_lane(0, &mut taken.parts.drive_work);
        let RoverMemory { wheel_torque, sand } = taken.memory;
        for (torque, wheel) in wheel_torque.iter_mut().zip(self.model.wheels()) {
            let impulse = wheel.joint.map_or(0.0, |j| drives.impulse(0, j));
            *torque = wheel.drive_sign * impulse * wheel.share / taken.options.time_step;
        }
        taken.parts.tree.end_sand(sand.as_mut());
    }

    fn usual_step(&self, step: &mut UsualStep<'_, Self>, probe: &mut dyn Probe) -> UsualOutcome {
        self.take_usual_step(step, probe)
    }

    fn show_last(&self, parts: &mut RoverParts, scratch: &mut SceneScratch<Self>) {
        if let Some((block, problems)) = parts.own.last() {
            scratch.show(
                |show| {
                    block.visit_contacts(0, |contact, _, p, u| show(contact, p, u));
                },
                problems.iter().flat_map(|own| &own.q[..own.n_unknowns()]),
                problems.iter().flat_map(|own| &own.mu[..own.n_contacts]),
            );
        }
    }

    /// With springs and position controls.
    fn energy(
        &self,
        options: &StepOptions,
        state: &State<Configuration>,
        command: &RoverCommand,
    ) -> Energy {
        let kinematics = Kinematics::of(&self.model, &state.configuration);
        let mut energy = kinematics.energy(&self.model, &state.v, &options.gravity);
        let joints = &state.configuration.joints;
        energy.potential += self.model.spring_energy(joints);
        energy.potential += self.stored(state, command);
        energy
    }

    fn stored(&self, state: &State<Configuration>, command: &RoverCommand) -> f64 {
        command.actuators.stored(&state.configuration.joints)
    }

    fn fingerprint(&self) -> u64 {
        self.model.fingerprint()
    }

    fn admits(&self, snapshot: &Snapshot<Self>) -> bool {
        let model = &*self.model;
        let configuration = &snapshot.state.configuration;
        let is_part = |part: Part, body: usize| part.is_of(model) && part.body(model) == body;
        let is_sound = |contact: &Contact| {
            let is_of_two = matches!(contact.key.opposite, Opposite::Part(_));
            let is_stop = matches!(contact.key.opposite, Opposite::Stop);
            is_part(contact.part, contact.body)
                && is_stop == matches!(contact.part, Part::Limit(..) | Part::Friction(_))
                && is_of_two == contact.other.is_some()
                && (contact.other).is_none_or(|other| is_part(other.part, other.body))
        };
        configuration.is_finite()
            && configuration.is_of(model)
            && snapshot.command.is_of(model)
            && self.admits_memory(&snapshot.memory)
            && (snapshot.active.iter()).all(|a| is_sound(&a.contact))
    }
}

/// Results of the last call of [`Simulation::step`]; not part of the state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LastCall {
    /// Report of its steps; empty if one failed.
    pub report: StepReport,
    /// Work through the drives of wheels and other joints, Σ |∫ τ_i dφ_i|, driving or braking, J.
    pub work: f64,
    /// Driving part of the work through the drives, Σ max(∫ τ_i dφ_i, 0), J.
    pub positive_work: f64,
}

/// Options with the friction of the model's materials.
fn with_laws_of(model: &Model, mut options: StepOptions) -> StepOptions {
    let restitution = options.restitution;
    options.materials = (options.materials).with_own(model.own_frictions(), restitution);
    options
}

impl RoverSimulation {
    /// At rest in the zero configuration, with all loops closed; steering joints held at zero, all
    /// others free.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn new(
        model: Arc<Model>,
        terrain: Arc<dyn Terrain>,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        let (configuration, v) = (Configuration::zero(&model), vec![0.0; model.nv()]);
        let options = with_laws_of(&model, options);
        let mut made = Self::of(
            RoverScene::new(model, terrain),
            configuration.clone(),
            options,
        )?;
        made.place_closed(configuration, v);
        Ok(made)
    }

    /// A placed rover with all loops closed; steering joints held at zero, all others free.
    ///
    /// # Errors
    /// An option out of its range.
    ///
    /// # Panics
    /// If the sizes of the state do not fit the model.
    pub fn placed(placement: PlacedRover) -> Result<Self, OptionsError> {
        let PlacedRover {
            scene,
            options,
            configuration,
            v,
        } = placement;
        assert!(
            configuration.is_of(&scene.model),
            "invariant: a configuration of this model"
        );
        let options = with_laws_of(&scene.model, options);
        let mut made = Self::of(scene, configuration.clone(), options)?;
        made.place_closed(configuration, v);
        Ok(made)
    }

    /// Begins anew in another scene: bit for bit what [`Self::placed`] makes, but in the memory of
    /// this simulation if the model is the same.
    ///
    /// # Errors
    /// An option out of its range; nothing is changed then.
    ///
    /// # Panics
    /// If the sizes of the state do not fit the model.
    pub fn begin(&mut self, placement: PlacedRover) -> Result<(), OptionsError> {
        if placement.scene.model.fingerprint() != self.model().fingerprint() {
            *self = Self::placed(placement)?;
            return Ok(());
        }
        placement.options.check()?;
        assert!(
            placement.configuration.is_of(self.model()),
            "invariant: a configuration of this model"
        );
        self.restart(placement);
        Ok(())
    }

    /// The machine.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        &self.scene.model
    }

    /// The ground.
    #[must_use]
    pub fn terrain(&self) -> &Arc<dyn Terrain> {
        &self.scene.terrain
    }

    /// Sets configuration and velocity, as checked by [`crate::multibody::coordinates`]; time 0,
    /// warm start forgotten. Loops are closed, and the velocity loses what would open them.
    ///
    /// # Panics
    /// If the sizes do not fit the model.
    pub fn set_state(&mut self, configuration: Configuration, v: Vec<f64>) {
        assert!(
            configuration.is_of(self.model()),
            "invariant: a configuration of this model"
        );
        self.place_closed(configuration, v);
    }

    /// Sets a state that obeys the closed loops. Loops that stay open are in the step's report.
    fn place_closed(&mut self, configuration: Configuration, mut v: Vec<f64>) {
        let closed = loops::closed(self.model(), &configuration, &mut v);
        self.place(closed.unwrap_or(configuration), v);
    }

    fn restart(&mut self, placement: PlacedRover) {
        self.command = placement.scene.command();
        self.scene = placement.scene;
        self.options = with_laws_of(&self.scene.model, placement.options);
        self.place_closed(placement.configuration, placement.v);
    }

    /// Results of the last call of [`Self::step`].
    #[must_use]
    pub fn last_call(&self) -> LastCall {
        // A joint's work over the call counts as driving or as braking.
        let work = self.parts.drive_work.iter();
        LastCall {
            report: *self.last_report(),
            work: work.clone().map(|joules| joules.abs()).sum(),
            positive_work: work.map(|joules| joules.max(0.0)).sum(),
        }
    }

    /// Mean torque that the drive of each wheel gave in the last step,
    /// positive forward (N m): the command, within the motor's line.
    ///
    /// Zero before any step and where the wheel is locked.
    #[must_use]
    pub fn motor_torques(&self) -> &[f64] {
        &self.memory.wheel_torque
    }

    /// Mean reactions of the rows of the loops in the last step (n_loop_rows), N and N m: along and
    /// about the world's axes on the first end of each loop.
    #[must_use]
    pub fn loop_forces(&self) -> Vec<f64> {
        let h = self.options.time_step;
        let impulses = self.parts.tree.loop_impulses().iter();
        impulses.map(|impulse| impulse / h).collect()
    }

    /// The sand under the wheels; none on firm ground.
    #[must_use]
    pub fn sand(&self) -> Option<&SandState> {
        self.memory.sand.as_ref()
    }

    /// Current poses of the bodies.
    #[must_use]
    pub fn kinematics(&self) -> Kinematics {
        Kinematics::of(self.model(), &self.state.configuration)
    }

    /// Linear momentum, and angular momentum about the world's origin.
    #[must_use]
    pub fn momentum(&self) -> Momentum {
        momentum::momentum(self.model(), &self.kinematics(), &self.state.v)
    }

    /// Mass centre, world, m.
    #[must_use]
    pub fn centre_of_mass(&self) -> Vector3<f64> {
        momentum::centre_of_mass(self.model(), &self.kinematics())
    }
}
