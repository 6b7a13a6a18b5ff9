//! `EpisodeRun`: one episode of a driving task.

use std::sync::Arc;

use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyRange, PyTuple};
use rover_core::draw::Domain;
use rover_core::episode::running::{Period, check_normals};
use rover_core::episode::{Ending, Episode as CoreEpisode, EpisodeState, Rules, Setting, action};
use rover_core::simulation::{ReadingScratch, RoverSimulation};

use crate::arguments::{Named, number, refused};
use crate::arrays::{Array, array, fresh, vector};
use crate::episode_rules::EpisodeRules;
use crate::errors::{Kind, Result, Value};
use crate::infos::info;
use crate::reading::{place, points};
use crate::rover_grains::RoverGrainSimulation;
use crate::shared::{Shared, Watch};
use crate::simulation::Simulation;
use crate::snapshot::{damaged, read_bytes};

/// Observation, reward, whether the episode has ended, info.
type Step<'py> = (Array<f32>, f64, bool, Bound<'py, PyDict>);

/// State of an episode of a driving task, beside its simulation.
///
/// Create it by `begin` or `from_bytes`.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct EpisodeRun(Shared<Inner>);

struct Inner {
    episode: CoreEpisode,
    scratch: ReadingScratch,
    commands: Vec<f64>,
}

/// Actions of a shape in row-major order, as float64.
pub fn actions(value: &Bound<'_, PyAny>, shape: &[usize]) -> Result<Vec<f64>> {
    let (kind, field) = (Kind::Command, "action");
    let check = |given: &[usize]| {
        if given == shape {
            return Ok(());
        }
        let message = format!("{field}: must have shape {shape:?}, has {given:?}");
        Err(kind.error(field, message, Value::Object(value.clone().unbind())))
    };
    if let Ok(ready) = value.extract::<PyReadonlyArrayDyn<'_, f32>>() {
        check(ready.shape())?;
        return Ok(match ready.as_slice() {
            Ok(entries) => entries.iter().map(|&a| f64::from(a)).collect(),
            Err(_) => ready.as_array().iter().map(|&a| f64::from(a)).collect(),
        });
    }
    if value.is_instance_of::<PyRange>() {
        // It may be of any length.
        return Err(refused(value, kind, field, "an array of numbers"));
    }
    let given = array(value, kind, field)?;
    check(given.shape())?;
    Ok(given.as_array().iter().copied().collect())
}

/// The argument `simulation`: a `Simulation`.
pub struct GivenSimulation<'py>(pub Bound<'py, Simulation>);

impl<'py> FromPyObject<'_, 'py> for GivenSimulation<'py> {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        Ok(Self(simulation(&given, "simulation")?.clone()))
    }
}

/// A simulation of the border.
pub fn simulation<'a, 'py>(
    value: &'a Bound<'py, PyAny>,
    field: &str,
) -> Result<&'a Bound<'py, Simulation>> {
    value
        .cast()
        .map_err(|_| refused(value, Kind::Option, field, "a Simulation"))
}

/// The argument `rules`: `EpisodeRules`.
#[derive(Clone)]
pub struct GivenRules(pub Arc<Rules>);

impl FromPyObject<'_, '_> for GivenRules {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        let found = given.cast::<EpisodeRules>();
        let wrong = |_| refused(&given, Kind::Option, "rules", "EpisodeRules");
        Ok(Self(found.map_err(wrong)?.get().inner.clone()))
    }
}

impl<'py> IntoPyObject<'py> for GivenRules {
    type Target = EpisodeRules;
    type Output = Bound<'py, EpisodeRules>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        Bound::new(py, EpisodeRules::of(self.0))
    }
}

/// Properties of rover and world, by their order.
fn domain(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Domain> {
    let numbers = <[f64; 4]>::try_from(vector(value, kind, field)?);
    let numbers = numbers.map_err(|_| refused(value, kind, field, "four numbers"))?;
    Ok(numbers.into())
}

fn normals(given: Option<&Bound<'_, PyAny>>) -> Result<Option<Vec<f64>>> {
    given
        .map(|given| vector(given, Kind::Option, "normals"))
        .transpose()
}

/// The action and the normal numbers of a control period, checked.
fn given(
    rules: &Rules,
    action: &Bound<'_, PyAny>,
    normals: Option<&Bound<'_, PyAny>>,
) -> Result<(Vec<f64>, Option<Vec<f64>>)> {
    let action = actions(action, &[rules.n_actions()])?;
    action::check(&action, action.len(), true)?;
    let normals = self::normals(normals)?;
    check_normals(rules, normals.as_deref())?;
    Ok((action, normals))
}

impl EpisodeRun {
    pub fn of(episode: CoreEpisode) -> Self {
        Self(Shared::new(Inner {
            commands: vec![0.0; episode.rules().n_commands()],
            scratch: ReadingScratch::default(),
            episode,
        }))
    }

    /// A copy of what it holds.
    pub fn copy(&self) -> Result<CoreEpisode> {
        Ok(self.0.open()?.episode.clone())
    }
}

impl Inner {
    /// Reads the rover after its steps and goes on by a period; returns the observation.
    fn advance(
        &mut self,
        rover: &RoverSimulation,
        action: &[f64],
        normals: Option<&[f64]>,
        has_scan: bool,
        has_failed: bool,
    ) -> Vec<f32> {
        let rules = self.episode.rules().clone();
        let scan = &rules.settings().scan;
        let mut numbers = std::mem::take(&mut self.scratch.numbers);
        numbers.resize(rules.places().size + scan.len(), 0.0);
        let (reading, heights) = numbers.split_at_mut(rules.places().size);
        rover.read_state(self.episode.goal(), &mut self.scratch, reading);
        if has_scan {
            rover.read_heights(scan, heights);
        }
        let mut observation = vec![0.0; rules.size()];
        let period = Period {
            action,
            heights: has_scan.then_some(&*heights),
            normals,
            has_failed,
        };
        self.episode.advance(reading, &period, &mut observation);
        self.scratch.numbers = numbers;
        observation
    }

    /// What a period gives.
    fn told<'py>(
        &self,
        py: Python<'py>,
        observation: &[f32],
        message: Option<String>,
    ) -> Result<Step<'py>> {
        let outcome = self.episode.outcome();
        Ok((
            fresh(observation),
            outcome.reward,
            outcome.ending.is_end(),
            info(py, &(&self.episode, message))?,
        ))
    }
}

#[pymethods]
impl EpisodeRun {
    /// Begins an episode.
    ///
    /// Args:
    ///     rules: Rules of the task.
    ///     simulation: The rover at the start of the episode.
    ///     goal: The goal (x, z), m.
    ///     domain: Physical properties of the episode: mass_scale, friction, actuator_gain,
    ///         gravity_scale.
    ///     trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N.
    ///     difficulty: Difficulty of the rocks.
    ///     normals: A standard normal number for each entry of the observation, (size,); needed if
    ///         the rules have noise.
    ///     further: Goals after the first, (n, 2), x and z, m; none by default.
    ///
    /// Returns:
    ///     The episode; None if its first observation is not finite in float32.
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape or a number that is not finite, or the
    ///         rover's model does not fit the rules.
    #[staticmethod]
    #[pyo3(signature = (rules, simulation, **options),
        text_signature = "(rules, simulation, *, goal, domain, trunk_load_limit, difficulty, normals=None, further=None)")]
    fn begin(
        rules: GivenRules,
        simulation: GivenSimulation<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Option<Self>> {
        let given = Named::keywords(simulation.0.py(), options)?;
        let further = |value: &Bound<'_, PyAny>, _, field: &str| points(value, field);
        let setting = Setting {
            goal: given.need("goal", |value, _, _| place(Some(value)))?,
            further: given.read("further", further)?.unwrap_or_default(),
            domain: given.need("domain", domain)?,
            trunk_load_limit: given.need("trunk_load_limit", number)?,
            difficulty: given.need("difficulty", number)?,
        };
        let normals = given.read("normals", vector)?;
        given.finish()?;
        let rover = simulation.0.get().open()?;
        let begun = CoreEpisode::begin(rules.0, setting, &rover, normals.as_deref());
        Ok(begun?.map(Self::of))
    }

    /// Applies an action for one control period.
    ///
    /// Other Python threads run in the meantime. Ctrl-C, or another exception of a signal handler,
    /// ends the call after the current physics step. The simulation then has the state after that
    /// step, the episode the state before the call.
    ///
    /// Args:
    ///     simulation: The rover of this episode: a `Simulation`, or a `RoverGrainSimulation` if it
    ///         drives among grains.
    ///     action: Torques, then steering, within [-1, 1], (n_actions,).
    ///     normals: A standard normal number for each entry of the observation, (size,); needed if
    ///         the rules have noise.
    ///     has_scan: Whether to update the height scan. If False, it is updated only when the
    ///         episode ends; otherwise the observation keeps the previous heights until `complete`
    ///         is called.
    ///
    /// Returns:
    ///     Observation (size,) float32, reward, whether the episode has terminated, and info.
    ///
    /// Raises:
    ///     CommandError: The action has a wrong shape or an entry that is not finite or outside
    ///         [-1, 1]. Nothing has changed.
    ///     OptionError: `normals` has a wrong length. Nothing has changed.
    #[pyo3(signature = (simulation, action, normals = None, *, has_scan = true))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        simulation: &Bound<'py, PyAny>,
        action: &Bound<'py, PyAny>,
        normals: Option<&Bound<'py, PyAny>>,
        has_scan: bool,
    ) -> Result<Step<'py>> {
        let mut held = self.0.open()?;
        let inner = &mut *held;
        let rules = inner.episode.rules().clone();
        let (action, normals) = given(&rules, action, normals)?;
        let among = simulation.cast::<RoverGrainSimulation>().ok();
        let mut rover = match among {
            Some(among) => among.get().together.rover.open()?,
            None => self::simulation(simulation, "simulation")?.get().open()?,
        };
        rules.check_model(rover.model())?;
        (inner.episode).command(&mut rover, &action, &mut inner.commands)?;
        let mut watch = Watch::new();
        let substeps = rules.settings().substeps;
        let moving = &mut *rover;
        let among = among.map(|among| &among.get().together);
        let done = py.detach(|| match among {
            Some(among) => among.step_with(moving, substeps, &mut || watch.go_on()),
            None => Ok(moving.step_while(substeps, &mut || watch.go_on())),
        })?;
        watch.raised()?;
        let error = done.err();
        let failed = error.is_some();
        let mut observation = inner.advance(&rover, &action, normals.as_deref(), has_scan, failed);
        if inner.episode.outcome().ending.is_end() && inner.episode.lacks_heights() {
            inner.episode.complete(&rover);
            observation.copy_from_slice(inner.episode.observation());
        }
        inner.told(py, &observation, error.map(|e| e.to_string()))
    }

    /// Advances the episode by a control period, from a reading instead of a simulation.
    ///
    /// Args:
    ///     reading: A reading from `Simulation.reading` at the end of the period, with the goal as
    ///         target and the scan of the rules.
    ///     action: As for `step`.
    ///     normals: As for `step`.
    ///     message: The message of the StepError, if a physics step failed.
    ///
    /// Returns:
    ///     As for `step`.
    ///
    /// Raises:
    ///     CommandError: As for `step`.
    ///     OptionError: `reading` or `normals` has a wrong length.
    #[pyo3(signature = (reading, action, normals = None, *, message = None))]
    fn advance<'py>(
        &self,
        py: Python<'py>,
        reading: &Bound<'py, PyAny>,
        action: &Bound<'py, PyAny>,
        normals: Option<&Bound<'py, PyAny>>,
        message: Option<String>,
    ) -> Result<Step<'py>> {
        let mut held = self.0.open()?;
        let rules = held.episode.rules().clone();
        let (action, normals) = given(&rules, action, normals)?;
        let mut row = vector(reading, Kind::Option, "reading")?;
        let n_state = rules.places().size;
        let expected = n_state + rules.settings().scan.len();
        if row.len() != expected {
            let what = format!("{expected} numbers");
            return Err(refused(reading, Kind::Option, "reading", &what));
        }
        let (state, heights) = row.split_at_mut(n_state);
        let period = Period {
            action: &action,
            heights: Some(heights),
            normals: normals.as_deref(),
            has_failed: message.is_some(),
        };
        let mut observation = vec![0.0; rules.size()];
        held.episode.advance(state, &period, &mut observation);
        held.told(py, &observation, message)
    }

    /// Updates the height scan of the last observation, if `step` left it out.
    ///
    /// Args:
    ///     simulation: The rover of this episode, in the state of the last observation.
    ///
    /// Returns:
    ///     The last observation, (size,) float32.
    fn complete(&self, simulation: GivenSimulation<'_>) -> Result<Array<f32>> {
        let mut held = self.0.open()?;
        held.episode.complete(&*simulation.0.get().open()?);
        Ok(fresh(held.episode.observation()))
    }

    /// The last observation, (size,) float32.
    #[getter]
    fn observation(&self) -> Result<Array<f32>> {
        Ok(fresh(self.0.open()?.episode.observation()))
    }

    /// The last action, (n_actions,); zeros at the beginning.
    #[getter]
    fn previous_action(&self) -> Result<Array> {
        Ok(fresh(&self.0.open()?.episode.progress().previous_action))
    }

    /// The present goal (x, z), m; the last one if all are reached.
    #[getter]
    fn goal(&self) -> Result<(f64, f64)> {
        Ok(self.0.open()?.episode.goal().into())
    }

    /// The info of the last control period, or of the start.
    fn info<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        info(py, &(&self.0.open()?.episode, None))
    }

    /// Returns a copy of the episode with another goal, other properties, or other rules.
    ///
    /// Args:
    ///     goal: The first goal, (x, z), m. No goal then counts as reached, and a terminated
    ///         episode continues.
    ///     distance: Horizontal distance to the present goal, m.
    ///     domain: Physical properties, as for `begin`.
    ///     trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N.
    ///     seen: An episode whose rules and observation are copied.
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape or a number that is not finite, or does not
    ///         fit the rules.
    #[pyo3(signature = (**changes), text_signature = "($self, *, goal=None, distance=None, domain=None, trunk_load_limit=None, seen=None)")]
    fn changed(&self, py: Python<'_>, changes: Option<&Bound<'_, PyDict>>) -> Result<Self> {
        let given = Named::keywords(py, changes)?;
        let held = self.0.open()?;
        let (mut rules, mut state) = (held.episode.rules().clone(), held.episode.state());
        drop(held);
        if let Some(goal) = given.read("goal", |value, _, _| place(Some(value)))? {
            (state.setting.goal, state.progress.reached) = (goal, 0);
            state.outcome.ending = Ending::None;
        }
        if let Some(distance) = given.maybe("distance")? {
            (state.progress.distance, state.outcome.now.distance) = (distance, distance);
        }
        if let Some(domain) = given.read("domain", domain)? {
            state.setting.domain = domain;
        }
        if let Some(limit) = given.maybe("trunk_load_limit")? {
            state.setting.trunk_load_limit = limit;
        }
        if let Some(seen) =
            given
                .get("seen")?
                .object::<Bound<'_, Self>>(Kind::Option, "seen", "an EpisodeRun")?
        {
            let other = seen.get().copy()?;
            let EpisodeState {
                observation, owed, ..
            } = other.state();
            (rules, state.observation, state.owed) = (other.rules().clone(), observation, owed);
        }
        given.finish()?;
        Ok(Self::of(CoreEpisode::resume(rules, state)?))
    }

    /// The state of the episode as bytes, for `from_bytes`.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyBytes>> {
        let state = postcard::to_stdvec(&self.0.open()?.episode.state());
        Ok(PyBytes::new(
            py,
            &state.map_err(|e| damaged("episode", &e))?,
        ))
    }

    /// Restores an episode.
    ///
    /// Args:
    ///     rules: Rules of the task.
    ///     data: Bytes from `to_bytes`.
    ///
    /// Raises:
    ///     StateError: The bytes are not an episode.
    ///     OptionError: The episode does not fit the rules.
    #[staticmethod]
    fn from_bytes(rules: GivenRules, data: &Bound<'_, PyAny>) -> Result<Self> {
        let state: EpisodeState = read_bytes(data, "episode")?;
        Ok(Self::of(CoreEpisode::resume(rules.0, state)?))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Result<Bound<'py, PyTuple>> {
        let (py, own) = (slf.py(), slf.get());
        let rules = GivenRules(own.0.open()?.episode.rules().clone());
        let given = (rules, own.to_bytes(py)?);
        Ok((slf.get_type().getattr("from_bytes")?, given).into_pyobject(py)?)
    }

    fn __repr__(&self) -> String {
        let Ok(held) = self.0.open() else {
            return "EpisodeRun(stepping)".to_owned();
        };
        let distance = held.episode.progress().distance;
        format!("EpisodeRun({distance:.2} m to the goal)")
    }
}
