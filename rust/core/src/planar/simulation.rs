//! A planar machine on a ground, stepped through time by the rover's own schemes.

use std::sync::Arc;

use nalgebra::{SMatrix, SVector, Vector2};
use serde::{Deserialize, Serialize};

use super::ground::{ContactRule, Facing, Ground};
use super::machine::{PlanarContact, PlanarKey, PlanarMachine, PlanarScratch, PlanarSystem};
use crate::integrator::{
    Integrator, NoProbe, OptionsError, Scratch, StateMut, StepError, StepOptions, StepReport,
    WarmStart,
};
use crate::multibody::{Energy, StateError};
use crate::simulation::{CommandError, SnapshotError, check_command};

/// A contact of the last step with what it did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanarActiveContact {
    /// Point, normal and gap where the step evaluated them.
    pub contact: PlanarContact,
    /// Impulse along n, t, N s.
    pub impulse: [f64; 2],
    /// Local velocity after the step along n, t, m/s.
    pub velocity: [f64; 2],
}

/// All that a planar simulation needs to continue bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanarSnapshot {
    /// [`PlanarMachine::fingerprint`] of the machine.
    pub machine: u64,
    /// Coordinates (nv), m and rad.
    pub q: Vec<f64>,
    /// Their rates (nv).
    pub v: Vec<f64>,
    /// s.
    pub time: f64,
    /// Torques, N m.
    pub inputs: Vec<f64>,
    /// Where the next solve starts.
    pub warm_start: WarmStart<PlanarKey>,
    /// Contacts of the last step.
    pub active: Vec<PlanarActiveContact>,
}

/// A machine on a ground. The ground is shared; everything else is its own.
#[derive(Clone, Debug)]
pub struct PlanarSimulation<const NV: usize, M> {
    machine: M,
    ground: Arc<dyn Ground>,
    rule: ContactRule,
    options: StepOptions,
    q: SVector<f64, NV>,
    v: SVector<f64, NV>,
    time: f64,
    inputs: Vec<f64>,
    warm_start: WarmStart<PlanarKey>,
    parts: PlanarScratch<NV>,
    scratch: Scratch<SVector<f64, NV>, PlanarContact>,
    active: Vec<PlanarActiveContact>,
}

impl<const NV: usize, M: PlanarMachine<NV>> PlanarSimulation<NV, M> {
    /// At rest with all coordinates 0, no torque.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn new(
        machine: M,
        ground: Arc<dyn Ground>,
        rule: ContactRule,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        options.check()?;
        let q = SVector::zeros();
        Ok(Self {
            inputs: vec![0.0; machine.n_inputs()],
            scratch: Scratch::new(&q, NV, 2 * machine.n_discs(), 2),
            machine,
            ground,
            rule,
            options,
            q,
            v: SVector::zeros(),
            time: 0.0,
            warm_start: WarmStart::default(),
            parts: PlanarScratch::default(),
            active: Vec::new(),
        })
    }

    /// The machine.
    pub fn machine(&self) -> &M {
        &self.machine
    }

    /// The ground.
    pub fn ground(&self) -> &Arc<dyn Ground> {
        &self.ground
    }

    /// How discs meet the ground.
    pub fn rule(&self) -> ContactRule {
        self.rule
    }

    /// Options of every step.
    pub fn options(&self) -> &StepOptions {
        &self.options
    }

    /// Coordinates, m and rad.
    pub fn q(&self) -> &SVector<f64, NV> {
        &self.q
    }

    /// Their rates.
    pub fn v(&self) -> &SVector<f64, NV> {
        &self.v
    }

    /// s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Torques, N m, positive forward.
    pub fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    /// Contacts of the last step.
    pub fn contacts(&self) -> &[PlanarActiveContact] {
        &self.active
    }

    /// The last step's friction-contact problem: W (row-major), free velocity, friction.
    pub fn last_problem(&self) -> (&[f64], &[f64], &[f64]) {
        (
            self.parts.operator(),
            self.scratch.free_velocity(),
            self.scratch.friction_coefficients(),
        )
    }

    /// Sets coordinates and rates; time 0, warm start forgotten, torques kept.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_state(&mut self, q: &[f64], v: &[f64]) -> Result<(), StateError> {
        for (field, values) in [("q", q), ("v", v)] {
            if values.len() != NV {
                return Err(StateError::Length {
                    field,
                    expected: NV,
                    actual: values.len(),
                });
            }
            if let Some(index) = values.iter().position(|x| !x.is_finite()) {
                return Err(StateError::NotFinite {
                    field,
                    index,
                    value: values[index],
                });
            }
        }
        self.q.copy_from_slice(q);
        self.v.copy_from_slice(v);
        self.time = 0.0;
        self.warm_start.clear();
        self.active.clear();
        Ok(())
    }

    /// Sets the torques, N m, positive forward; each saturates at its limit ([`PlanarMachine::torque_limit`]).
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_inputs(&mut self, inputs: &[f64]) -> Result<(), CommandError> {
        check_command("torques", inputs, self.machine.n_inputs())?;
        for (i, (own, input)) in self.inputs.iter_mut().zip(inputs).enumerate() {
            let limit = self.machine.torque_limit(i);
            *own = input.clamp(-limit, limit);
        }
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
        let variant = self.options.variant;
        self.steps_of(&variant, n, go_on)
    }

    /// Takes `n` steps of another scheme, with the same options.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_with<I>(&mut self, integrator: &I, n: usize) -> Result<StepReport, StepError>
    where
        I: for<'a> Integrator<PlanarSystem<'a, NV, M>>,
    {
        self.steps_of(integrator, n, &mut || true)
    }

    fn steps_of<I>(
        &mut self,
        integrator: &I,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<StepReport, StepError>
    where
        I: for<'a> Integrator<PlanarSystem<'a, NV, M>>,
    {
        let mut total = StepReport::default();
        for _ in 0..n {
            let mut system = PlanarSystem {
                machine: &self.machine,
                ground: &*self.ground,
                rule: self.rule,
                inputs: &self.inputs,
                parts: &mut self.parts,
            };
            let state = StateMut {
                configuration: &mut self.q,
                v: self.v.as_mut_slice(),
                time: &mut self.time,
            };
            let report = integrator.step(
                &mut system,
                &self.options,
                state,
                &mut self.warm_start,
                &mut self.scratch,
                &mut NoProbe,
            )?;
            total.merge(&report);
            self.list_active();
            if !go_on() {
                break;
            }
        }
        Ok(total)
    }

    fn list_active(&mut self) {
        self.active.clear();
        let impulses = self.scratch.impulses().chunks_exact(2);
        let local = impulses.zip(self.scratch.velocities().chunks_exact(2));
        let active = |(contact, (p, u)): (&PlanarContact, (&[f64], &[f64]))| PlanarActiveContact {
            contact: *contact,
            impulse: [p[0], p[1]],
            velocity: [u[0], u[1]],
        };
        self.active
            .extend(self.scratch.contacts().iter().zip(local).map(active));
    }

    /// `M(q)` now.
    pub fn mass_matrix(&self) -> SMatrix<f64, NV, NV> {
        self.machine.mass_matrix(&self.q)
    }

    /// Kinetic and potential energy now, J.
    pub fn energy(&self) -> Energy {
        let momentum = self.mass_matrix() * self.v;
        let gravity: Vector2<f64> = self.options.gravity.xy();
        Energy {
            kinetic: 0.5 * self.v.dot(&momentum),
            potential: self.machine.potential(&self.q, &gravity),
        }
    }

    /// Smallest gap of every disc now, m; negative where it overlaps the ground.
    pub fn gaps(&self) -> Vec<f64> {
        let mut facing: Vec<Facing> = Vec::new();
        let gap = |i: usize| {
            let disc = self.machine.disc(i, &self.q);
            match self.rule {
                ContactRule::CentreHeight => self.ground.below(&disc.centre).distance,
                ContactRule::Nearest => {
                    // The nearest point is no farther than the one straight below.
                    let height = disc.centre.y - self.ground.height(disc.centre.x);
                    facing.clear();
                    self.ground
                        .facing(&disc.centre, height.abs() * (1.0 + 1e-9), &mut facing);
                    let nearest = facing.iter().map(|f| f.distance);
                    nearest.fold(height, f64::min) - disc.radius
                }
            }
        };
        (0..self.machine.n_discs()).map(gap).collect()
    }

    /// Everything that is needed to continue bit for bit.
    pub fn snapshot(&self) -> PlanarSnapshot {
        PlanarSnapshot {
            machine: self.machine.fingerprint(),
            q: self.q.as_slice().to_vec(),
            v: self.v.as_slice().to_vec(),
            time: self.time,
            inputs: self.inputs.clone(),
            warm_start: self.warm_start.clone(),
            active: self.active.clone(),
        }
    }

    /// Goes back to a snapshot.
    ///
    /// # Errors
    /// A snapshot of another kind of machine or with damaged contents; nothing is changed then.
    pub fn restore(&mut self, snapshot: &PlanarSnapshot) -> Result<(), SnapshotError> {
        if snapshot.machine != self.machine.fingerprint() {
            return Err(SnapshotError::OtherModel);
        }
        let warm = &snapshot.warm_start;
        let numbers = snapshot
            .q
            .iter()
            .chain(&snapshot.v)
            .chain(&snapshot.inputs)
            .chain(&warm.persistent)
            .chain(warm.impulses.iter().flat_map(|(_, p)| p));
        let active = |a: &PlanarActiveContact| {
            let numbers = [a.contact.point, a.contact.foot, a.contact.n];
            (a.contact.key.disc as usize) < self.machine.n_discs()
                && numbers.iter().flatten().all(|x| x.is_finite())
                && a.impulse.iter().chain(&a.velocity).all(|x| x.is_finite())
                && a.contact.gap.is_finite()
        };
        let is_sound = [snapshot.q.len(), snapshot.v.len()] == [NV; 2]
            && snapshot.inputs.len() == self.inputs.len()
            && snapshot.active.iter().all(active)
            && [0, NV].contains(&warm.persistent.len())
            && snapshot.time.is_finite()
            && numbers.copied().all(f64::is_finite);
        if !is_sound {
            return Err(SnapshotError::Damaged);
        }
        self.q.copy_from_slice(&snapshot.q);
        self.v.copy_from_slice(&snapshot.v);
        self.time = snapshot.time;
        self.inputs.clone_from(&snapshot.inputs);
        self.warm_start.clone_from(&snapshot.warm_start);
        self.active.clone_from(&snapshot.active);
        Ok(())
    }
}

/// The ball on a ground.
pub type BallSimulation = PlanarSimulation<3, super::ball::Ball>;

/// The two-wheel rover on a ground.
pub type TwoWheelRoverSimulation = PlanarSimulation<5, super::two_wheel_rover::TwoWheelRover>;

/// The six-wheel rover, driven straight on a ground.
pub type MirroredRoverSimulation = PlanarSimulation<7, super::mirrored_rover::MirroredRover<7>>;
