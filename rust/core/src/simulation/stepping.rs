//! The simulation of a scene.

use super::active_contact::ActiveContact;
use super::error::SnapshotError;
use super::profile::Stopwatch;
use super::scene::{
    AcceptedStep, DenseOperator, Scene, SceneKey, SceneScratch, Snapshot, UsualOutcome, UsualStep,
};
use super::state::{Moved, State};
use crate::caught::caught;
use crate::integrator::{
    Integrator, Local, NoProbe, Obstacle, OptionsError, Probe, StateMut, StepError, StepOptions,
    StepReport, StepScratch, UnilateralContact, WarmStart,
};
use crate::multibody::Energy;
use crate::problem::{Dimension, FrictionContactProblem, undetermined_loads};

/// Steps of a copy that a profile takes before it measures.
const WARM_UP: usize = 10;

/// A scene, its state and its scratch. Copies share what the scene shares; each owns everything
/// else.
#[derive(Clone, Debug)]
pub struct Simulation<S: Scene> {
    pub(super) scene: S,
    pub(super) options: StepOptions,
    pub(super) state: State<S::Configuration>,
    moved: S::Moved,
    pub(super) command: S::Command,
    pub(super) memory: S::Memory,
    pub(super) warm_start: WarmStart<SceneKey<S>>,
    pub(super) parts: S::Parts,
    pub(super) scratch: SceneScratch<S>,
    pub(super) active: Vec<ActiveContact<S::Contact>>,
    last_report: StepReport,
    /// Energy in position controls at the end of the last call, J; none if the state was set since.
    stored: Option<f64>,
    /// What the commands since then have changed of it, J.
    set: f64,
}

impl<S: Scene> Simulation<S> {
    /// At rest in a configuration, with the scene's initial command.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn of(
        scene: S,
        configuration: S::Configuration,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        options.check()?;
        let (nv, n) = (scene.nv(), scene.contact_capacity());
        Ok(Self {
            command: scene.command(),
            memory: scene.memory(),
            parts: scene.parts(),
            scratch: StepScratch::new(&scene.moved(&configuration), n),
            moved: scene.moved(&configuration),
            state: State::at_rest(configuration, nv),
            warm_start: WarmStart::with_capacity(n, nv),
            active: Vec::with_capacity(n),
            last_report: StepReport::default(),
            stored: None,
            set: 0.0,
            scene,
            options,
        })
    }

    /// The description.
    #[must_use]
    pub fn scene(&self) -> &S {
        &self.scene
    }

    /// Options of every step.
    #[must_use]
    pub fn options(&self) -> &StepOptions {
        &self.options
    }

    /// Configuration, velocity and time.
    #[must_use]
    pub fn state(&self) -> &State<S::Configuration> {
        &self.state
    }

    /// Configuration.
    #[must_use]
    pub fn q(&self) -> &S::Configuration {
        &self.state.configuration
    }

    /// Velocity (nv).
    #[must_use]
    pub fn v(&self) -> &[f64] {
        &self.state.v
    }

    /// s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.state.time
    }

    /// The command.
    #[must_use]
    pub fn command(&self) -> &S::Command {
        &self.command
    }

    /// Matrices of the last step.
    #[must_use]
    pub fn parts(&self) -> &S::Parts {
        &self.parts
    }

    /// Contacts of the last step.
    #[must_use]
    pub fn contacts(&self) -> &[ActiveContact<S::Contact>] {
        &self.active
    }

    /// Report of the last call of [`Self::step`]; empty before any call, and after a step that
    /// failed.
    #[must_use]
    pub fn last_report(&self) -> &StepReport {
        &self.last_report
    }

    /// Current kinetic and potential energy, J.
    #[must_use]
    pub fn energy(&self) -> Energy {
        (self.scene).energy(&self.options, &self.state, &self.command)
    }

    /// Sets configuration and velocity; time 0, warm start and memory forgotten, the command kept.
    ///
    /// # Panics
    /// If the size of the velocity does not fit the scene.
    pub fn place(&mut self, configuration: S::Configuration, v: Vec<f64>) {
        assert_eq!(
            v.len(),
            self.scene.nv(),
            "invariant: a velocity of this scene"
        );
        self.state = State {
            configuration,
            v,
            time: 0.0,
        };
        self.memory = self.scene.memory();
        self.warm_start.clear();
        self.forget_last_call();
    }

    /// Clears the results of the last call of [`Self::step`].
    pub(super) fn forget_last_call(&mut self) {
        self.stored = None;
        self.active.clear();
        self.scene.begin_call(&mut self.parts);
        self.last_report = StepReport::default();
    }

    /// Takes `n` steps, or stops at the first that fails, keeping the state before it.
    ///
    /// # Errors
    /// See [`StepError`]. A solver that did not converge is not an error; the report says so.
    pub fn step(&mut self, n: usize) -> Result<StepReport, StepError> {
        self.step_while(n, &mut || true)
    }

    /// Takes `n` steps as [`Self::step`] does, but asks `go_on` after each and stops once it
    /// returns false.
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
        self.call(&variant, true, n, go_on, &mut NoProbe)
    }

    /// Takes `n` steps of another scheme, with the same options.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_with<I>(&mut self, integrator: &I, n: usize) -> Result<StepReport, StepError>
    where
        I: for<'a> Integrator<S::System<'a>>,
    {
        self.call(integrator, false, n, &mut || true, &mut NoProbe)
    }

    /// Takes `n` steps of a copy and returns the time of each part; `go_on` as for
    /// [`Self::step_while`].
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn profile(
        &self,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Stopwatch, StepError> {
        let mut copy = self.clone();
        let variant = copy.options.variant;
        copy.call(&variant, true, n.min(WARM_UP), go_on, &mut NoProbe)?;
        let mut stopwatch = Stopwatch::start();
        let report = copy.call(&variant, true, n, go_on, &mut stopwatch)?;
        stopwatch.finish(report.steps);
        Ok(stopwatch)
    }

    /// Takes `n` steps and tells `probe` where each part of a step ends.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_probed(
        &mut self,
        n: usize,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let variant = self.options.variant;
        self.call(&variant, true, n, &mut || true, probe)
    }

    /// One call: its report is kept. `may_be_usual`: whether the scene's steps with the usual
    /// effort are the integrator's.
    fn call<I: for<'a> Integrator<S::System<'a>>>(
        &mut self,
        integrator: &I,
        may_be_usual: bool,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        self.begin_call();
        let result = self.steps(integrator, may_be_usual, n, go_on, probe);
        self.end_call(result.clone().unwrap_or_default());
        result.map(|_| self.last_report)
    }

    /// Resets what counts over a call.
    pub(super) fn begin_call(&mut self) {
        self.scene.begin_call(&mut self.parts);
        self.last_report = StepReport::default();
        self.active.clear();
        let stored = self.scene.stored(&self.state, &self.command);
        self.set = self.stored.map_or(0.0, |before| stored - before);
    }

    /// Keeps the report of a call.
    pub(super) fn end_call(&mut self, report: StepReport) {
        self.last_report = report;
        if report.steps > 0 {
            self.last_report.energy_of_set_points = self.set;
            self.stored = Some(self.scene.stored(&self.state, &self.command));
        }
    }

    fn steps<I: for<'a> Integrator<S::System<'a>>>(
        &mut self,
        integrator: &I,
        may_be_usual: bool,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let mut total = StepReport::default();
        for _ in 0..n {
            let usual = if may_be_usual {
                self.usual_step(probe)?
            } else {
                UsualOutcome::None
            };
            let report = match usual {
                UsualOutcome::Taken(report) => report,
                UsualOutcome::None => self.step_with_all_effort(integrator, probe)?,
                UsualOutcome::Refused(obstacle) => self.step_past(obstacle, integrator, probe)?,
            };
            total.merge(&report);
            if !go_on() {
                break;
            }
        }
        if total.steps > 0 {
            self.scene.show_last(&mut self.parts, &mut self.scratch);
            self.list_active();
        }
        Ok(total)
    }

    /// Takes the steps that are left of a call of `n`, after those of a report.
    pub(super) fn resume(
        &mut self,
        before: &StepReport,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<(), StepError> {
        if before.steps == 0 {
            self.begin_call();
        }
        let (variant, left) = (self.options.variant, n.saturating_sub(before.steps));
        let taken = self.steps(&variant, true, left, go_on, &mut NoProbe);
        let mut total = *before;
        total.merge(&taken.clone().unwrap_or_default());
        let total = if taken.is_ok() {
            total
        } else {
            StepReport::default()
        };
        self.end_call(total);
        taken.map(|_| ())
    }

    /// Calls `step`, and where it panics makes all scratch anew. The state is then that before it.
    fn guard<R>(&mut self, step: impl FnOnce(&mut Self) -> R) -> Result<R, StepError> {
        let time = self.state.time;
        caught(|| step(self)).map_err(|fault| {
            self.scene.recover(&mut self.parts, &mut self.memory);
            let n = self.scene.contact_capacity();
            self.scratch = StepScratch::new(&self.moved, n);
            StepError::Internal { time, fault }
        })
    }

    /// A step with the usual effort.
    pub(super) fn usual_step(&mut self, probe: &mut dyn Probe) -> Result<UsualOutcome, StepError> {
        self.guard(|own| {
            let mut step = UsualStep {
                options: &own.options,
                state: &mut own.state,
                command: &own.command,
                memory: &mut own.memory,
                parts: &mut own.parts,
                warm_start: &mut own.warm_start,
            };
            own.scene.usual_step(&mut step, probe)
        })
    }

    /// A step with all effort that has met an obstacle with the usual one.
    pub(super) fn step_past<I: for<'a> Integrator<S::System<'a>>>(
        &mut self,
        obstacle: Obstacle,
        integrator: &I,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        self.scratch.note(obstacle);
        Ok(StepReport {
            fallbacks: 1,
            ..self.step_with_all_effort(integrator, probe)?
        })
    }

    /// A step of any scene and integrator, with all effort.
    pub(super) fn step_with_all_effort<I: for<'a> Integrator<S::System<'a>>>(
        &mut self,
        integrator: &I,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        self.guard(|own| own.take_with_all_effort(integrator, probe))?
    }

    fn take_with_all_effort<I: for<'a> Integrator<S::System<'a>>>(
        &mut self,
        integrator: &I,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        self.moved.read(&self.state.configuration);
        let (command, memory) = (&self.command, &mut self.memory);
        let mut system = (self.scene).system(&self.options, command, memory, &mut self.parts);
        let state = StateMut {
            configuration: &mut self.moved,
            v: &mut self.state.v[..],
            time: &mut self.state.time,
        };
        let report = integrator.step(
            &mut system,
            &self.options,
            state,
            &mut self.warm_start,
            &mut self.scratch,
            probe,
        )?;
        drop(system);
        self.moved.write(&mut self.state.configuration);
        self.scene.after_step(AcceptedStep {
            options: &self.options,
            state: &mut self.state,
            memory: &mut self.memory,
            parts: &mut self.parts,
            warm_start: &mut self.warm_start,
            scratch: &self.scratch,
        });
        Ok(report)
    }

    pub(super) fn list_active(&mut self) {
        let (scene, parts) = (&self.scene, &self.parts);
        let d = <S::Contact as UnilateralContact>::Local::N;
        let impulses = self.scratch.impulses().chunks_exact(d);
        let local = impulses.zip(self.scratch.velocities().chunks_exact(d));
        let active = |(contact, (p, u)): (&S::Contact, (&[f64], &[f64]))| ActiveContact {
            contact: *contact,
            position: scene.position(parts, contact),
            impulse: Local::of(p),
            velocity: Local::of(u),
        };
        self.active.clear();
        self.active
            .extend(self.scratch.contacts().iter().zip(local).map(active));
    }

    /// All data needed to continue bit for bit.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot<S> {
        Snapshot {
            scene: self.scene.fingerprint(),
            state: self.state.clone(),
            command: self.command.clone(),
            memory: self.memory.clone(),
            warm_start: self.warm_start.clone(),
            active: self.active.clone(),
        }
    }

    /// Goes back to a snapshot.
    ///
    /// # Errors
    /// A snapshot of another scene or with damaged contents; nothing is changed then.
    pub fn restore(&mut self, snapshot: &Snapshot<S>) -> Result<(), SnapshotError> {
        if snapshot.scene != self.scene.fingerprint() {
            return Err(SnapshotError::OtherModel);
        }
        if !(snapshot.is_sound(self.scene.nv()) && self.scene.admits(snapshot)) {
            return Err(SnapshotError::Damaged);
        }
        self.state.clone_from(&snapshot.state);
        self.command.clone_from(&snapshot.command);
        self.memory.clone_from(&snapshot.memory);
        self.warm_start.clone_from(&snapshot.warm_start);
        self.forget_last_call();
        self.stored = Some(self.scene.stored(&self.state, &self.command));
        self.active.clone_from(&snapshot.active);
        Ok(())
    }
}

impl<S: Scene> Simulation<S>
where
    S::Parts: DenseOperator,
{
    /// The last step's friction-contact problem: W (row-major), free velocity, friction.
    #[must_use]
    pub fn last_problem(&self) -> (&[f64], &[f64], &[f64]) {
        (
            self.parts.operator(),
            self.scratch.free_velocity(),
            self.scratch.friction_coefficients(),
        )
    }

    /// Contacts whose impulses the motion of the last step leaves open; see [`undetermined_loads`].
    #[must_use]
    pub fn undetermined_loads(&self) -> usize {
        let dimension = match <S::Contact as UnilateralContact>::Local::N {
            2 => Dimension::Two,
            _ => Dimension::Three,
        };
        let (W, q, mu) = self.last_problem();
        let p = self.scratch.impulses_of_problem();
        if W.len() != q.len() * q.len() || p.len() != q.len() {
            return 0; // no contact, or no step yet
        }
        let problem = FrictionContactProblem::from_assembled(dimension, W, q, mu);
        let tolerance = self.options.solver.tolerance;
        undetermined_loads(&problem, tolerance, p)
    }
}
