//! A soil through time.

use std::sync::Arc;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::{Disks, SoilContact, SoilError, SoilKey, SoilParts, SoilScene, SoilSystem};
use crate::integrator::{
    Integrator, NoProbe, OptionsError, Probe, Scratch, Stabilisation, StateMut, StepError,
    StepOptions, StepReport, WarmStart,
};
use crate::multibody::Energy;
use crate::quantity::finite;
use crate::simulation::SnapshotError;
use crate::solver::SolverOptions;
use crate::system::grains::{Renumbering, Sleep, SleepOptions, StepTaken};

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

/// A contact of the last step with what it did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoilActiveContact {
    /// Bodies, point, normal, gaps.
    pub contact: SoilContact,
    /// Impulse along n, t, N s, on the first body.
    pub impulse: [f64; 2],
    /// Local velocity after the step along n, t, m/s.
    pub velocity: [f64; 2],
}

/// All that a soil needs to continue bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SoilSnapshot {
    /// [`SoilScene::fingerprint`] of what moves.
    pub scene: u64,
    /// (x, y, θ) of each disk, then the machine's coordinates, m and rad.
    pub q: Vec<f64>,
    /// Their rates.
    pub v: Vec<f64>,
    /// s.
    pub time: f64,
    /// Steps taken.
    pub count: usize,
    /// Torques, N m.
    pub inputs: Vec<f64>,
    /// Force at the machine, N.
    pub pull: [f64; 2],
    /// Where the next solve starts.
    pub warm_start: WarmStart<SoilKey>,
    /// Who sleeps.
    pub sleep: Sleep,
}

/// A soil, its state and its scratch. The description is shared.
#[derive(Clone, Debug)]
pub struct SoilSimulation {
    scene: Arc<SoilScene>,
    options: StepOptions,
    sleep_options: Option<SleepOptions>,
    q: Vec<f64>,
    v: Vec<f64>,
    time: f64,
    count: usize,
    inputs: Vec<f64>,
    pull: Vector2<f64>,
    warm_start: WarmStart<SoilKey>,
    sleep: Sleep,
    parts: SoilParts,
    scratch: Scratch<Vec<f64>, SoilContact>,
    has_contacts: bool,
}

impl SoilSimulation {
    /// At rest in the configuration `q` (nv): (x, y, θ) of each disk, then the machine's coordinates.
    ///
    /// # Errors
    /// A description or configuration that cannot be: see [`SoilScene::check_configuration`].
    pub fn new(
        scene: Arc<SoilScene>,
        options: StepOptions,
        sleep_options: Option<SleepOptions>,
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
        scene.check()?;
        scene.check_configuration(&q)?;
        let (n, nv) = (scene.grains.len(), scene.nv());
        let n_inputs = scene.machine.as_ref().map_or(0, |m| m.n_inputs());
        Ok(Self {
            scratch: Scratch::new(&q, nv, 3 * n, 2),
            v: vec![0.0; nv],
            q,
            time: 0.0,
            count: 0,
            inputs: vec![0.0; n_inputs],
            pull: Vector2::zeros(),
            warm_start: WarmStart::default(),
            sleep: Sleep::new(scene.grains.kinematic()),
            parts: SoilParts::default(),
            has_contacts: false,
            scene,
            options,
            sleep_options,
        })
    }

    /// The description.
    #[must_use]
    pub fn scene(&self) -> &Arc<SoilScene> {
        &self.scene
    }

    /// Options of every step.
    #[must_use]
    pub fn options(&self) -> &StepOptions {
        &self.options
    }

    /// (x, y, θ) of each disk, then the machine's coordinates, m and rad.
    #[must_use]
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    /// Their rates.
    #[must_use]
    pub fn v(&self) -> &[f64] {
        &self.v
    }

    /// s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Torques of the machine, N m, positive forward.
    #[must_use]
    pub fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    /// Force at the machine's first two coordinates, N.
    #[must_use]
    pub fn pull(&self) -> Vector2<f64> {
        self.pull
    }

    /// Which disks sleep (n); kinematic ones always do.
    #[must_use]
    pub fn asleep(&self) -> &[bool] {
        self.sleep.asleep()
    }

    /// Contacts of the last step; none before the first and after a restore. Contacts among sleeping disks are not in it.
    pub fn contacts(&self) -> impl Iterator<Item = SoilActiveContact> + '_ {
        let count = if self.has_contacts {
            self.scratch.contacts().len()
        } else {
            0
        };
        let local = self.scratch.impulses().chunks_exact(2);
        let local = local.zip(self.scratch.velocities().chunks_exact(2));
        let contacts = self.scratch.contacts().iter().zip(local).take(count);
        contacts.map(|(contact, (p, u))| SoilActiveContact {
            contact: *contact,
            impulse: [p[0], p[1]],
            velocity: [u[0], u[1]],
        })
    }

    /// Sets configuration and rates (nv), those that kinematic disks keep among them; time 0, all awake, warm start forgotten, torques kept.
    ///
    /// # Errors
    /// As [`Self::new`]; nothing is changed then.
    pub fn set_state(&mut self, q: &[f64], v: &[f64]) -> Result<(), SoilError> {
        self.scene.check_configuration(q)?;
        if v.len() != q.len() {
            return Err(SoilError::Length {
                field: "velocity",
                expected: q.len(),
                count: v.len(),
            });
        }
        self.scene.check_finite("velocity", "machine_rate", v, 3)?;
        self.q.copy_from_slice(q);
        self.v.copy_from_slice(v);
        self.time = 0.0;
        self.count = 0;
        self.warm_start.clear();
        self.sleep = Sleep::new(self.scene.grains.kinematic());
        self.has_contacts = false;
        Ok(())
    }

    /// Takes the disks that are marked (n) out of the soil; the others go on as they are, under new numbers in the same order.
    ///
    /// Snapshots of before belong to another soil.
    ///
    /// # Errors
    /// Another number of marks; none would be left. Nothing is changed then.
    pub fn remove(&mut self, marked: &[bool]) -> Result<(), SoilError> {
        let n = self.scene.grains.len();
        if marked.len() != n {
            return Err(SoilError::Length {
                field: "which",
                expected: n,
                count: marked.len(),
            });
        }
        let renumbering = Renumbering::without(marked);
        let grains = self.scene.grains.without(&renumbering)?;
        self.scene = Arc::new(SoilScene {
            grains,
            ..(*self.scene).clone()
        });
        self.q = renumbering.keep(&self.q, 3);
        self.v = renumbering.keep(&self.v, 3);
        self.sleep = self.sleep.without(&renumbering);
        self.warm_start.persistent.clear();
        let impulses = self.warm_start.impulses.iter();
        self.warm_start.impulses = impulses
            .filter_map(|(key, p)| Some((renumbering.key(*key)?, *p)))
            .collect();
        self.scratch = Scratch::new(&self.q, self.scene.nv(), 3 * renumbering.left(), 2);
        self.has_contacts = false;
        Ok(())
    }

    /// Sets the torques, N m, positive forward. Wakes nothing: what turns does.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_inputs(&mut self, inputs: &[f64]) -> Result<(), SoilError> {
        if inputs.len() != self.inputs.len() {
            return Err(SoilError::Length {
                field: "torques",
                expected: self.inputs.len(),
                count: inputs.len(),
            });
        }
        for (k, value) in inputs.iter().enumerate() {
            finite(&format!("torques[{k}]"), *value)?;
        }
        self.inputs.copy_from_slice(inputs);
        Ok(())
    }

    /// Sets a force at the machine's first two coordinates, N: a drawbar.
    ///
    /// # Errors
    /// No machine, or an entry that is not finite; nothing is changed then.
    pub fn set_pull(&mut self, pull: [f64; 2]) -> Result<(), SoilError> {
        if self.scene.machine.is_none() {
            return Err(SoilError::NoMachine);
        }
        for (k, value) in pull.iter().enumerate() {
            finite(&format!("pull[{k}]"), *value)?;
        }
        self.pull = pull.into();
        Ok(())
    }

    /// Takes `n` steps, or stops at the first that fails, keeping the state before it.
    ///
    /// # Errors
    /// See [`StepError`]. A solver that did not converge is no error: see the report.
    pub fn step(&mut self, n: usize) -> Result<StepReport, StepError> {
        self.step_while(n, &mut || true)
    }

    /// The same, but stops after a whole step once `go_on`, which is asked after each, says no.
    ///
    /// The report's `steps` says how many were taken.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_while(
        &mut self,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<StepReport, StepError> {
        self.steps(n, go_on, &mut NoProbe)
    }

    /// The same, telling `probe` of the phases.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_probed(
        &mut self,
        n: usize,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        self.steps(n, &mut || true, probe)
    }

    fn steps(
        &mut self,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let variant = self.options.variant;
        let mut total = StepReport::default();
        for _ in 0..n {
            let mut system = SoilSystem {
                scene: &self.scene,
                asleep: self.sleep.asleep(),
                inputs: &self.inputs,
                pull: self.pull,
                parts: &mut self.parts,
            };
            let state = StateMut {
                configuration: &mut self.q,
                v: &mut self.v,
                time: &mut self.time,
            };
            let report = variant.step(
                &mut system,
                &self.options,
                state,
                &mut self.warm_start,
                &mut self.scratch,
                probe,
            )?;
            total.merge(&report);
            self.count += 1;
            self.has_contacts = true;
            if let Some(options) = &self.sleep_options {
                let taken = StepTaken {
                    scene: &self.scene,
                    weight_impulse: self.options.gravity.norm() * self.options.time_step,
                    q: &self.q,
                    v: &mut self.v,
                    contacts: self.scratch.contacts(),
                    impulses: self.scratch.impulses(),
                    count: self.count,
                };
                self.sleep.update(options, taken, &mut self.warm_start);
            }
            if !go_on() {
                break;
            }
        }
        Ok(total)
    }

    /// Kinetic and potential energy now, J, without kinematic disks.
    #[must_use]
    pub fn energy(&self) -> Energy {
        self.scene.energy(&self.q, &self.v, &self.options.gravity)
    }

    /// Momentum (x, y) of the disks that are not kinematic, kg m/s, and their moment of momentum about the origin, kg m²/s.
    #[must_use]
    pub fn momentum(&self) -> [f64; 3] {
        let (linear, moment) = self.scene.momentum(&self.q, &self.v);
        [linear.x, linear.y, moment.z]
    }

    /// Impulse (x, y) of the last step's contacts on the machine's wheels, N s.
    #[must_use]
    pub fn impulse_on_wheels(&self) -> [f64; 2] {
        let n = self.scene.grains.len();
        let mut sum = Vector2::zeros();
        for active in self.contacts().filter(|c| c.contact.key.a as usize >= n) {
            let [p_N, p_T] = active.impulse;
            sum += active.contact.n * p_N + active.contact.t() * p_T;
        }
        sum.into()
    }

    /// Deepest overlap now, m: 0 where nothing overlaps. Kinematic disks among themselves and in walls do not count.
    #[must_use]
    pub fn penetration(&self) -> f64 {
        self.scene.penetration(&self.q)
    }

    /// Wakes all disks.
    pub fn wake(&mut self) {
        self.sleep
            .wake_all(self.scene.grains.kinematic(), &mut self.warm_start);
    }

    /// Everything that is needed to continue bit for bit.
    #[must_use]
    pub fn snapshot(&self) -> SoilSnapshot {
        SoilSnapshot {
            scene: self.scene.fingerprint(),
            q: self.q.clone(),
            v: self.v.clone(),
            time: self.time,
            count: self.count,
            inputs: self.inputs.clone(),
            pull: self.pull.into(),
            warm_start: self.warm_start.clone(),
            sleep: self.sleep.clone(),
        }
    }

    /// Goes back to a snapshot.
    ///
    /// # Errors
    /// A snapshot of another scene or with damaged contents; nothing is changed then.
    pub fn restore(&mut self, snapshot: &SoilSnapshot) -> Result<(), SnapshotError> {
        let nv = self.scene.nv();
        if snapshot.scene != self.scene.fingerprint() {
            return Err(SnapshotError::OtherModel);
        }
        let warm = &snapshot.warm_start;
        let mut numbers = [&snapshot.q, &snapshot.v, &snapshot.inputs, &warm.persistent]
            .into_iter()
            .flatten()
            .chain(&snapshot.pull)
            .chain(warm.impulses.iter().flat_map(|(_, p)| p));
        let is_sound = [snapshot.q.len(), snapshot.v.len()] == [nv; 2]
            && snapshot.inputs.len() == self.inputs.len()
            && snapshot.count <= MAX_STEPS
            && [0, nv].contains(&warm.persistent.len())
            && snapshot.time.is_finite()
            && snapshot.sleep.is_of(self.scene.grains.kinematic())
            && numbers.all(|x| x.is_finite());
        if !is_sound {
            return Err(SnapshotError::Damaged);
        }
        self.q.copy_from_slice(&snapshot.q);
        self.v.copy_from_slice(&snapshot.v);
        self.time = snapshot.time;
        self.count = snapshot.count;
        self.inputs.clone_from(&snapshot.inputs);
        self.pull = snapshot.pull.into();
        self.warm_start.clone_from(&snapshot.warm_start);
        self.sleep.clone_from(&snapshot.sleep);
        self.has_contacts = false;
        Ok(())
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
