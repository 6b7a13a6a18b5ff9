//! A bed of free grains, perhaps with a machine on it.

use std::sync::Arc;

use nalgebra::{SVector, Vector3};
use serde::{Deserialize, Serialize};

use super::active_contact::LocatedContact;
use super::scene::{AcceptedStep, Scene, Snapshot};
use super::state::State;
use super::stepping::Simulation;
use crate::integrator::{OptionsError, Stabilisation, StepOptions, StepScratch};
use crate::multibody::Energy;
use crate::problem::BodyPairs;
use crate::quantity::finite;
use crate::solver::{SolverOptions, Swept};
use crate::spatial::space::body_velocities;
use crate::system::grains::contact::WALL;
use crate::system::grains::error::check_length;
use crate::system::grains::{
    self, COORDINATES, GrainContact, GrainError, GrainParts, GrainScene, GrainSystem, Grains,
    Moments, Renumbering, Sleep, SleepOptions,
};

/// Options that suit a bed of these grains.
///
/// θ = 1 and γ = 1, which the contact law needs; h = 1 ms; solver tolerance 1e-4 and at most 2000
/// sweeps. Position projection is off, since it lifts the grains above and adds energy. Circles and
/// spheres that approach by their gap along the normal do not overlap, so only the solver's
/// tolerance would be left to project. If requested, projection starts at 0.5% of the smallest
/// radius.
#[must_use]
pub fn grain_options<const D: usize>(grains: &Grains<D>) -> StepOptions {
    StepOptions {
        theta: 1.0,
        forecast: 1.0,
        time_step: 1e-3,
        stabilisation: Stabilisation::None,
        penetration_tolerance: Some(5e-3 * grains.smallest()),
        solver: SolverOptions {
            tolerance: 1e-4,
            velocity_tolerance: 1e-3,
            max_sweeps: 2000,
            ..SolverOptions::default()
        },
        ..StepOptions::default()
    }
}

/// Most steps that a snapshot may have behind it.
const MAX_STEPS: usize = 1 << 53;

/// Grains, their ground, and when they sleep. The description is shared.
#[derive(Clone, Debug)]
pub struct GrainBed<const D: usize> {
    /// The grains, their ground and their machine.
    pub description: Arc<GrainScene<D>>,
    /// When grains sleep; None: never.
    pub sleep: Option<SleepOptions>,
}

/// Command of a bed's machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BedCommand<const D: usize> {
    /// Torques, N m, positive forward.
    pub torques: Vec<f64>,
    /// Force at the machine's origin, N: a drawbar.
    pub pull: SVector<f64, D>,
}

/// Memory of a bed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BedMemory {
    /// Steps taken.
    pub count: usize,
    /// Time that walls have been moving, s.
    pub elapsed: f64,
    /// Who sleeps.
    pub sleep: Sleep,
    /// Moments of rolling friction, from which the next step's solver starts.
    pub moments: Moments,
}

impl BedMemory {
    /// Counts a step of h, s, and remembers what it found.
    pub(super) fn count_step<const D: usize>(&mut self, h: f64, parts: &GrainParts<D>) {
        self.count += 1;
        self.elapsed += h;
        parts.rolling.remember(&mut self.moments);
    }
}

/// A bed of grains, stepped through time.
pub type GrainSimulation<const D: usize> = Simulation<GrainBed<D>>;

/// A bed of disks, stepped through time.
pub type DiskSimulation = GrainSimulation<2>;

impl<const D: usize> LocatedContact for GrainContact<D> {
    fn normal(&self) -> [f64; D] {
        self.n.into()
    }

    fn is_finite(&self) -> bool {
        let numbers = [&self.n, &self.point].into_iter().flatten();
        numbers
            .chain([&self.gap, &self.gap_start])
            .all(|x| x.is_finite())
    }
}

impl<const D: usize> Scene for GrainBed<D>
where
    BodyPairs<D>: Swept<D>,
{
    /// [`COORDINATES`] of each grain, then the machine's, m and rad.
    type Configuration = Vec<f64>;
    type Moved = Vec<f64>;
    type Contact = GrainContact<D>;
    type Command = BedCommand<D>;
    type Memory = BedMemory;
    type Parts = GrainParts<D>;
    type System<'a> = GrainSystem<'a, D>;

    fn nv(&self) -> usize {
        self.description.nv()
    }

    fn moved(&self, q: &Vec<f64>) -> Vec<f64> {
        q.clone()
    }

    fn command(&self) -> BedCommand<D> {
        let machine = self.description.machine.as_ref();
        BedCommand {
            torques: vec![0.0; machine.map_or(0, |m| m.n_inputs())],
            pull: SVector::zeros(),
        }
    }

    fn memory(&self) -> BedMemory {
        BedMemory {
            count: 0,
            elapsed: 0.0,
            sleep: Sleep::new(self.description.grains.kinematic()),
            moments: Moments::new(),
        }
    }

    fn parts(&self) -> GrainParts<D> {
        GrainParts::default()
    }

    fn contact_capacity(&self) -> usize {
        3 * self.description.grains.len()
    }

    fn system<'a>(
        &'a self,
        _: &StepOptions,
        command: &'a BedCommand<D>,
        memory: &'a mut BedMemory,
        parts: &'a mut GrainParts<D>,
    ) -> GrainSystem<'a, D> {
        parts.wall_time = memory.elapsed;
        GrainSystem {
            scene: &self.description,
            asleep: memory.sleep.asleep(),
            moments: &memory.moments,
            inputs: &command.torques,
            pull: command.pull,
            parts,
        }
    }

    fn position(&self, _parts: &GrainParts<D>, contact: &GrainContact<D>) -> [f64; D] {
        contact.point.into()
    }

    /// Lets grains sleep and wake.
    fn after_step(&self, taken: AcceptedStep<'_, Self>) {
        (taken.memory).count_step(taken.options.time_step, taken.parts);
        let Some(options) = &self.sleep else {
            return;
        };
        let movers = (self.description).movers(&taken.state.configuration, &taken.state.v);
        let step = grains::StepTaken {
            scene: &self.description,
            weight_impulse: taken.options.gravity.norm() * taken.options.time_step,
            q: &taken.state.configuration,
            v: &mut taken.state.v,
            contacts: taken.scratch.contacts(),
            impulses: taken.scratch.impulses(),
            count: taken.memory.count,
            movers: &movers,
        };
        taken.memory.sleep.update(options, step, taken.warm_start);
    }

    /// Without kinematic disks.
    fn energy(
        &self,
        options: &StepOptions,
        state: &State<Vec<f64>>,
        _command: &Self::Command,
    ) -> Energy {
        let State {
            configuration, v, ..
        } = state;
        self.description.energy(configuration, v, &options.gravity)
    }

    fn fingerprint(&self) -> u64 {
        self.description.fingerprint()
    }

    fn admits(&self, snapshot: &Snapshot<Self>) -> bool {
        let GrainScene {
            grains, machine, ..
        } = &*self.description;
        let (torques, pull) = (&snapshot.command.torques, &snapshot.command.pull);
        let expected = machine
            .as_ref()
            .map_or([0; 2], |m| [m.n_inputs(), m.n_wheels()]);
        let mut numbers = snapshot
            .state
            .configuration
            .iter()
            .chain(torques)
            .chain(pull);
        let n_bodies = grains.len() + expected[1];
        let is_body = |body: u32| (body as usize) < n_bodies;
        let moments = &snapshot.memory.moments;
        let keys = snapshot.active.iter().map(|a| a.contact.key);
        let mut keys = keys.chain(moments.iter().map(|(key, _)| *key));
        snapshot.state.configuration.len() == self.description.nq()
            && torques.len() == expected[0]
            && snapshot.memory.count <= MAX_STEPS
            && snapshot.memory.elapsed.is_finite()
            && snapshot.memory.sleep.is_of(grains.kinematic())
            && numbers.all(|x| x.is_finite())
            && moments.iter().flat_map(|(_, s)| s).all(|x| x.is_finite())
            && keys.all(|key| is_body(key.a) && (key.b >= WALL || is_body(key.b)))
    }
}

impl<const D: usize> GrainSimulation<D>
where
    BodyPairs<D>: Swept<D>,
{
    /// At rest in the configuration `q` (nq): [`COORDINATES`] of each grain, then the machine's.
    ///
    /// # Errors
    /// An invalid description or configuration: see [`GrainScene::check_configuration`].
    pub fn new(
        description: Arc<GrainScene<D>>,
        options: StepOptions,
        sleep: Option<SleepOptions>,
        q: Vec<f64>,
    ) -> Result<Self, GrainSetupError> {
        options.check()?;
        for (field, value) in [("theta", options.theta), ("forecast", options.forecast)] {
            if value < 1.0 {
                return Err(GrainSetupError::Options(OptionsError::OutOfRange {
                    field,
                    range: "1 in a bed of grains",
                    value,
                }));
            }
        }
        description.check()?;
        description.check_configuration(&q)?;
        Ok(Self::of(GrainBed { description, sleep }, q, options)?)
    }

    /// The grains, their ground and their machine.
    #[must_use]
    pub fn description(&self) -> &Arc<GrainScene<D>> {
        &self.scene.description
    }

    /// Which grains sleep (n); kinematic ones always do.
    #[must_use]
    pub fn asleep(&self) -> &[bool] {
        self.memory.sleep.asleep()
    }

    /// Sets configuration (nq) and velocities (nv), including those that kinematic grains keep;
    /// time 0, all awake, warm start forgotten, torques kept.
    ///
    /// # Errors
    /// As [`Self::new`]; nothing is changed then.
    pub fn set_state(&mut self, q: &[f64], v: &[f64]) -> Result<(), GrainError> {
        self.description().check_configuration(q)?;
        check_length("velocity", self.description().nv(), v.len())?;
        let width = body_velocities(D);
        let description = self.description();
        description.check_finite("velocity", "machine_rate", v, width)?;
        self.place(q.to_vec(), v.to_vec());
        Ok(())
    }

    /// Removes the marked grains (n) from the bed; the others keep their state, renumbered in the
    /// same order.
    ///
    /// Earlier snapshots no longer fit.
    ///
    /// # Errors
    /// A wrong number of marks, or no grain left. Nothing is changed then.
    pub fn remove(&mut self, marked: &[bool]) -> Result<(), GrainError> {
        let n = self.description().grains.len();
        check_length("which", n, marked.len())?;
        let renumbering = Renumbering::without(marked);
        let grains = self.description().grains.without(&renumbering)?;
        let q = renumbering.keep(&self.state.configuration, COORDINATES);
        let v = renumbering.keep(&self.state.v, body_velocities(D));
        self.memory.sleep = self.memory.sleep.without(&renumbering);
        self.take(grains, q, v, &renumbering);
        Ok(())
    }

    /// Puts other grains in the place of those so far; time goes on.
    ///
    /// `q`, `v`: coordinates and velocities of all of them, without the machine's, which stay.
    /// `before`: the number of each among those so far, if it was there. Those keep their sleep and
    /// the impulses of their contacts; they stand in the same order. Overlaps are not refused: a
    /// run may have made them.
    ///
    /// Earlier snapshots no longer fit.
    ///
    /// # Errors
    /// A length that does not fit, an entry that is not finite, numbers that do not increase.
    /// Nothing is changed then.
    pub fn exchange(
        &mut self,
        grains: Grains<D>,
        q: &[f64],
        v: &[f64],
        before: &[Option<u32>],
    ) -> Result<(), GrainError> {
        let n = grains.len();
        for (field, expected, count) in [
            ("position", COORDINATES * n, q.len()),
            ("velocity", body_velocities(D) * n, v.len()),
            ("before", n, before.len()),
        ] {
            check_length(field, expected, count)?;
        }
        for (field, values, width) in [
            ("position", q, COORDINATES),
            ("velocity", v, body_velocities(D)),
        ] {
            for (k, value) in values.iter().enumerate() {
                finite(&format!("{field}[{}]", k / width), *value)?;
            }
        }
        let now = self.description().clone();
        let renumbering = Renumbering::of(before, now.grains.len())?;
        let grains = match now.grains.cohesion() {
            Some(cohesion) => grains.with_cohesion(*cohesion),
            None => grains,
        };
        self.memory.sleep = self.memory.sleep.exchanged(
            &renumbering,
            before,
            now.grains.kinematic(),
            grains.kinematic(),
        );
        let q = [q, now.machine_coordinates(self.q())].concat();
        let v = [v, now.machine_velocities(self.v())].concat();
        self.take(grains, q, v, &renumbering);
        Ok(())
    }

    /// Continues with other grains, whose sleep is set: impulses of contacts follow their bodies.
    fn take(&mut self, grains: Grains<D>, q: Vec<f64>, v: Vec<f64>, renumbering: &Renumbering) {
        self.scene.description = Arc::new(GrainScene {
            grains,
            ..(**self.description()).clone()
        });
        self.state.configuration = q;
        self.state.v = v;
        self.warm_start.persistent.clear();
        let impulses = self.warm_start.impulses.iter();
        self.warm_start.impulses = impulses
            .filter_map(|(key, p)| Some((renumbering.key(*key)?, *p)))
            .collect();
        let room = 3 * renumbering.left();
        let moments = self.memory.moments.iter();
        self.memory.moments = moments
            .filter_map(|(key, s)| Some((renumbering.key(*key)?, *s)))
            .collect();
        self.scratch = StepScratch::new(&self.state.configuration, room);
        self.active.clear();
    }

    /// Sets the torques, N m, positive forward. This wakes no grain; motion does.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_inputs(&mut self, inputs: &[f64]) -> Result<(), GrainError> {
        let own = &mut self.command.torques;
        check_length("torques", own.len(), inputs.len())?;
        for (k, value) in inputs.iter().enumerate() {
            finite(&format!("torques[{k}]"), *value)?;
        }
        own.copy_from_slice(inputs);
        Ok(())
    }

    /// Sets a force at the machine's origin, N: a drawbar.
    ///
    /// # Errors
    /// No machine, or an entry that is not finite; nothing is changed then.
    pub fn set_pull(&mut self, pull: [f64; D]) -> Result<(), GrainError> {
        if self.description().machine.is_none() {
            return Err(GrainError::NoMachine);
        }
        for (k, value) in pull.iter().enumerate() {
            finite(&format!("pull[{k}]"), *value)?;
        }
        self.command.pull = pull.into();
        Ok(())
    }

    /// Impulse of the last step's contacts on the machine's wheels, N s.
    #[must_use]
    pub fn impulse_on_wheels(&self) -> [f64; D] {
        let n = self.description().grains.len();
        let wheels = self.active.iter().filter(|c| c.contact.key.a as usize >= n);
        let mut sum = SVector::<f64, D>::zeros();
        for active in wheels {
            let frame = active.contact.frame();
            let mut impulse = frame[0] * active.impulse[0];
            for k in 1..D {
                impulse += frame[k] * active.impulse[k];
            }
            sum += impulse;
        }
        sum.into()
    }

    /// Current deepest overlap, m: 0 if nothing overlaps. Overlaps of kinematic grains with each
    /// other and with walls do not count.
    #[must_use]
    pub fn penetration(&self) -> f64 {
        self.description()
            .penetration(self.q(), self.memory.elapsed)
    }

    /// Momentum of the grains that are not kinematic, kg m/s, and their moment of momentum about
    /// the origin, kg m²/s; in the plane the moment is its z component.
    #[must_use]
    pub fn momentum(&self) -> (SVector<f64, D>, Vector3<f64>) {
        self.description().momentum(self.q(), self.v())
    }

    /// Wakes all grains.
    pub fn wake(&mut self) {
        let kinematic = self.scene.description.grains.kinematic();
        self.memory.sleep.wake_all(kinematic, &mut self.warm_start);
    }
}

impl<const D: usize> Simulation<GrainBed<D>>
where
    GrainBed<D>: Scene<Contact = GrainContact<D>, Memory = BedMemory>,
{
    /// Moment of rolling and drilling friction of a contact of the last step on its first body,
    /// N m s.
    #[must_use]
    pub fn moment(&self, contact: &GrainContact<D>) -> [f64; 3] {
        let radius = self.scene.description.grains.radius();
        grains::moment_of(radius, &self.memory.moments, contact.key)
    }
}

/// Errors in the description of a bed.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum GrainSetupError {
    /// An option.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The scene or its configuration.
    #[error(transparent)]
    Grains(#[from] GrainError),
}
