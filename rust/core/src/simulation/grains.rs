//! A bed of free grains, perhaps with a machine on it.

use std::sync::Arc;

use nalgebra::{SVector, Vector2};
use serde::{Deserialize, Serialize};

use super::active_contact::LocatedContact;
use super::scene::{Scene, StepTaken};
use super::snapshot::Snapshot;
use super::state::State;
use super::stepping::Simulation;
use crate::integrator::{OptionsError, Scratch, Stabilisation, StepOptions};
use crate::multibody::Energy;
use crate::planar::error::finite;
use crate::planar::soil::contact::WALL;
use crate::planar::soil::grid::Grid;
use crate::planar::soil::removal::Renumbering;
use crate::planar::soil::sleep::{self, Sleep, SleepOptions};
use crate::planar::soil::{Disks, SoilContact, SoilError, SoilParts, SoilScene, SoilSystem};
use crate::solver::SolverOptions;

/// Options that suit a soil of these disks.
///
/// θ = 1 and γ = 1, which the contact's law needs; h = 1 ms; solver tolerance 1e-4 and at most 2000 sweeps. Penetration is
/// not projected away, which lifts what lies above and adds energy: circles that come together by their gap along the normal do
/// not overlap, so nothing but the solver's tolerance is left to project. Asked for, projection begins at 0.5% of the smallest radius.
#[must_use]
pub fn soil_options(disks: &Disks) -> StepOptions {
    StepOptions {
        theta: 1.0,
        forecast: 1.0,
        time_step: 1e-3,
        stabilisation: Stabilisation::None,
        penetration_tolerance: 5e-3 * disks.smallest(),
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

/// Grains, what they lie on, and when they sleep. The description is shared.
#[derive(Clone, Debug)]
pub struct GrainBed {
    /// What there is.
    pub soil: Arc<SoilScene>,
    /// When grains sleep; by None never.
    pub sleep: Option<SleepOptions>,
}

/// What a bed's machine is told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BedCommand {
    /// Torques, N m, positive forward.
    pub torques: Vec<f64>,
    /// Force at the machine's first two coordinates, N: a drawbar.
    pub pull: Vector2<f64>,
}

/// What a bed remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BedMemory {
    /// Steps taken.
    pub count: usize,
    /// Who sleeps.
    pub sleep: Sleep,
}

/// A bed of grains, stepped through time.
pub type SoilSimulation = Simulation<GrainBed>;

impl LocatedContact for SoilContact {
    type Vector = [f64; 2];

    fn normal(&self) -> [f64; 2] {
        self.n.into()
    }

    fn is_finite(&self) -> bool {
        let numbers = [&self.n, &self.point].into_iter().flatten();
        numbers
            .chain([&self.gap, &self.gap_start])
            .all(|x| x.is_finite())
    }
}

/// The machine's part of coordinates or rates.
fn own(disks: &Disks, all: &[f64]) -> SVector<f64, 5> {
    SVector::from_column_slice(&all[3 * disks.len()..])
}

impl Scene for GrainBed {
    /// (x, y, θ) of each disk, then the machine's coordinates, m and rad.
    type Configuration = Vec<f64>;
    type Contact = SoilContact;
    type Command = BedCommand;
    type Memory = BedMemory;
    type Parts = SoilParts;
    type System<'a> = SoilSystem<'a>;

    fn nv(&self) -> usize {
        self.soil.nv()
    }

    fn command(&self) -> BedCommand {
        let machine = self.soil.machine.as_ref();
        BedCommand {
            torques: vec![0.0; machine.map_or(0, |m| m.n_inputs())],
            pull: Vector2::zeros(),
        }
    }

    fn memory(&self) -> BedMemory {
        BedMemory {
            count: 0,
            sleep: Sleep::new(self.soil.disks.kinematic()),
        }
    }

    fn parts(&self) -> SoilParts {
        SoilParts::default()
    }

    fn contact_capacity(&self) -> usize {
        3 * self.soil.disks.len()
    }

    fn system<'a>(
        &'a self,
        command: &'a BedCommand,
        memory: &'a BedMemory,
        parts: &'a mut SoilParts,
    ) -> SoilSystem<'a> {
        SoilSystem {
            scene: &self.soil,
            asleep: memory.sleep.asleep(),
            inputs: &command.torques,
            pull: command.pull,
            parts,
        }
    }

    fn position(&self, _parts: &SoilParts, contact: &SoilContact) -> [f64; 2] {
        contact.point.into()
    }

    /// Lets grains sleep and wake.
    fn after_step(&self, taken: StepTaken<'_, Self>) {
        taken.memory.count += 1;
        let Some(options) = &self.sleep else {
            return;
        };
        let step = sleep::StepTaken {
            scene: &self.soil,
            weight_impulse: taken.options.gravity.norm() * taken.options.time_step,
            q: &taken.state.configuration,
            v: &mut taken.state.v,
            contacts: taken.scratch.contacts(),
            impulses: taken.scratch.impulses(),
            count: taken.memory.count,
        };
        taken.memory.sleep.update(options, step, taken.warm_start);
    }

    /// Without kinematic disks.
    fn energy(&self, options: &StepOptions, state: &State<Vec<f64>>) -> Energy {
        let disks = &self.soil.disks;
        let gravity = options.gravity.xy();
        let mut energy = Energy::default();
        let free = |(i, _): &(usize, &f64)| !disks.kinematic()[*i];
        for (i, m) in disks.mass().iter().enumerate().filter(free) {
            let q = &state.configuration[3 * i..3 * i + 3];
            let v = &state.v[3 * i..3 * i + 3];
            energy.kinetic += 0.5 * m * (v[0] * v[0] + v[1] * v[1]);
            energy.kinetic += 0.5 * disks.inertia(i) * v[2] * v[2];
            energy.potential -= m * (gravity.x * q[0] + gravity.y * q[1]);
        }
        if let Some(machine) = &self.soil.machine {
            let (pose, rate) = (own(disks, &state.configuration), own(disks, &state.v));
            energy.kinetic += 0.5 * rate.dot(&(machine.mass_matrix(&pose) * rate));
            energy.potential += machine.potential(&pose, &gravity);
        }
        energy
    }

    fn fingerprint(&self) -> u64 {
        self.soil.fingerprint()
    }

    fn admits(&self, snapshot: &Snapshot<Self>) -> bool {
        let SoilScene { disks, machine, .. } = &*self.soil;
        let (torques, pull) = (&snapshot.command.torques, &snapshot.command.pull);
        let expected = machine
            .as_ref()
            .map_or([0; 2], |m| [m.n_inputs(), m.n_discs()]);
        let mut numbers = snapshot
            .state
            .configuration
            .iter()
            .chain(torques)
            .chain(pull);
        let n_bodies = disks.len() + expected[1];
        let is_body = |body: u32| (body as usize) < n_bodies;
        let mut keys = snapshot.active.iter().map(|a| a.contact.key);
        snapshot.state.configuration.len() == self.nv()
            && torques.len() == expected[0]
            && snapshot.memory.count <= MAX_STEPS
            && snapshot.memory.sleep.is_of(disks.kinematic())
            && numbers.all(|x| x.is_finite())
            && keys.all(|key| is_body(key.a) && (key.b >= WALL || is_body(key.b)))
    }
}

impl SoilSimulation {
    /// At rest in the configuration `q` (nv): (x, y, θ) of each disk, then the machine's coordinates.
    ///
    /// # Errors
    /// A description or configuration that cannot be: see [`SoilScene::check_configuration`].
    pub fn new(
        soil: Arc<SoilScene>,
        options: StepOptions,
        sleep: Option<SleepOptions>,
        q: Vec<f64>,
    ) -> Result<Self, SoilSetupError> {
        options.check()?;
        for (field, value) in [("theta", options.theta), ("forecast", options.forecast)] {
            if value < 1.0 {
                return Err(SoilSetupError::Options(OptionsError::OutOfRange {
                    field,
                    range: "1 in a soil",
                    value,
                }));
            }
        }
        soil.check()?;
        soil.check_configuration(&q)?;
        Ok(Self::of(GrainBed { soil, sleep }, q, options)?)
    }

    /// The description.
    #[must_use]
    pub fn soil(&self) -> &Arc<SoilScene> {
        &self.scene.soil
    }

    /// Which disks sleep (n); kinematic ones always do.
    #[must_use]
    pub fn asleep(&self) -> &[bool] {
        self.memory.sleep.asleep()
    }

    /// Sets configuration and rates (nv), those that kinematic disks keep among them; time 0, all awake, warm start forgotten, torques kept.
    ///
    /// # Errors
    /// As [`Self::new`]; nothing is changed then.
    pub fn set_state(&mut self, q: &[f64], v: &[f64]) -> Result<(), SoilError> {
        self.soil().check_configuration(q)?;
        if v.len() != q.len() {
            return Err(SoilError::Length {
                field: "velocity",
                expected: q.len(),
                count: v.len(),
            });
        }
        let n = self.soil().disks.len();
        for (k, value) in v.iter().enumerate() {
            let field = if k < 3 * n {
                format!("velocity[{}]", k / 3)
            } else {
                format!("machine_rate[{}]", k - 3 * n)
            };
            finite(&field, *value)?;
        }
        self.place(q.to_vec(), v.to_vec());
        Ok(())
    }

    /// Takes the disks that are marked (n) out of the bed; the others go on as they are, under new numbers in the same order.
    ///
    /// Snapshots of before belong to another bed.
    ///
    /// # Errors
    /// Another number of marks; none would be left. Nothing is changed then.
    pub fn remove(&mut self, marked: &[bool]) -> Result<(), SoilError> {
        let n = self.soil().disks.len();
        if marked.len() != n {
            return Err(SoilError::Length {
                field: "which",
                expected: n,
                count: marked.len(),
            });
        }
        let renumbering = Renumbering::without(marked);
        let disks = self.soil().disks.without(&renumbering)?;
        self.scene.soil = Arc::new(SoilScene {
            disks,
            ..(**self.soil()).clone()
        });
        self.state.configuration = renumbering.keep(&self.state.configuration, 3);
        self.state.v = renumbering.keep(&self.state.v, 3);
        self.memory.sleep = self.memory.sleep.without(&renumbering);
        self.warm_start.persistent.clear();
        let impulses = self.warm_start.impulses.iter();
        self.warm_start.impulses = impulses
            .filter_map(|(key, p)| Some((renumbering.key(*key)?, *p)))
            .collect();
        let room = 3 * renumbering.left();
        self.scratch = Scratch::new(&self.state.configuration, self.scene.nv(), room, 2);
        self.active.clear();
        Ok(())
    }

    /// Sets the torques, N m, positive forward. Wakes nothing: what turns does.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_inputs(&mut self, inputs: &[f64]) -> Result<(), SoilError> {
        let own = &mut self.command.torques;
        if inputs.len() != own.len() {
            return Err(SoilError::Length {
                field: "torques",
                expected: own.len(),
                count: inputs.len(),
            });
        }
        for (k, value) in inputs.iter().enumerate() {
            finite(&format!("torques[{k}]"), *value)?;
        }
        own.copy_from_slice(inputs);
        Ok(())
    }

    /// Sets a force at the machine's first two coordinates, N: a drawbar.
    ///
    /// # Errors
    /// No machine, or an entry that is not finite; nothing is changed then.
    pub fn set_pull(&mut self, pull: [f64; 2]) -> Result<(), SoilError> {
        if self.soil().machine.is_none() {
            return Err(SoilError::NoMachine);
        }
        for (k, value) in pull.iter().enumerate() {
            finite(&format!("pull[{k}]"), *value)?;
        }
        self.command.pull = pull.into();
        Ok(())
    }

    /// Momentum (x, y) of the disks that are not kinematic, kg m/s, and their moment of momentum about the origin, kg m²/s.
    #[must_use]
    pub fn momentum(&self) -> [f64; 3] {
        let disks = &self.soil().disks;
        let mut sum = [0.0; 3];
        let free = |(i, _): &(usize, &f64)| !disks.kinematic()[*i];
        for (i, m) in disks.mass().iter().enumerate().filter(free) {
            let (q, v) = (&self.q()[3 * i..3 * i + 3], &self.v()[3 * i..3 * i + 3]);
            sum[0] += m * v[0];
            sum[1] += m * v[1];
            sum[2] += m * (q[0] * v[1] - q[1] * v[0]) + disks.inertia(i) * v[2];
        }
        sum
    }

    /// Impulse (x, y) of the last step's contacts on the machine's wheels, N s.
    #[must_use]
    pub fn impulse_on_wheels(&self) -> [f64; 2] {
        let n = self.soil().disks.len();
        let wheels = self.active.iter().filter(|c| c.contact.key.a as usize >= n);
        let mut sum = Vector2::zeros();
        for active in wheels {
            let [p_N, p_T] = active.impulse;
            sum += active.contact.n * p_N + active.contact.t() * p_T;
        }
        sum.into()
    }

    /// Deepest overlap now, m: 0 where nothing overlaps. Kinematic disks among themselves and in walls do not count.
    #[must_use]
    pub fn penetration(&self) -> f64 {
        let disks = &self.soil().disks;
        let (n, radius, kinematic) = (disks.len(), disks.radius(), disks.kinematic());
        let mut grid = Grid::default();
        grid.fill(self.q(), radius, 2.0 * disks.largest());
        let mut facing = Vec::new();
        let mut least = 0.0_f64;
        let mut meet = |i: usize, x: f64, y: f64, r: f64| {
            let is_kinematic = i < n && kinematic[i];
            grid.near(x, y, r + disks.largest(), |item| {
                let other = item.index as usize;
                if other != i && !(is_kinematic && kinematic[other]) {
                    least = least.min((item.x - x).hypot(item.y - y) - r - item.radius);
                }
            });
            if is_kinematic {
                return;
            }
            for wall in &self.soil().walls {
                least = least.min(wall.distance(x, y) - r);
            }
            if let Some(ground) = &self.soil().ground {
                facing.clear();
                ground.facing(&Vector2::new(x, y), r, &mut facing);
                least = facing.iter().fold(least, |l, f| l.min(f.distance - r));
            }
        };
        for (i, r) in radius.iter().enumerate() {
            meet(i, self.q()[3 * i], self.q()[3 * i + 1], *r);
        }
        if let Some(machine) = &self.soil().machine {
            let pose = own(disks, self.q());
            for k in 0..machine.n_discs() {
                let disc = machine.disc(k, &pose);
                meet(n + k, disc.centre.x, disc.centre.y, disc.radius);
            }
        }
        -least
    }

    /// Wakes all disks.
    pub fn wake(&mut self) {
        let kinematic = self.scene.soil.disks.kinematic();
        self.memory.sleep.wake_all(kinematic, &mut self.warm_start);
    }
}

/// What a soil's simulation cannot be built from.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum SoilSetupError {
    /// An option.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The scene or its configuration.
    #[error(transparent)]
    Soil(#[from] SoilError),
}
