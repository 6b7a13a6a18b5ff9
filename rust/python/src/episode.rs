//! `EpisodeRun`: one episode of a driving task.

use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyRange};
use rover_core::draw::Domain;
use rover_core::episode::running::{Period, check_normals};
use rover_core::episode::{
    Ending, Episode as CoreEpisode, Last, N_QUANTITIES, N_TERMS, Progress, Quantities, Rules,
    Setting, action,
};
use rover_core::simulation::{ReadingScratch, RoverSimulation};

use crate::arguments::{Given, number, refused};
use crate::arrays::{array, fresh, fresh_rows, vector};
use crate::episode_rules::EpisodeRules;
use crate::errors::{BorderError, Kind, Value};
use crate::infos::info;
use crate::reading::{place, points};
use crate::rover_grains::RoverGrainSimulation;
use crate::shared::{Shared, Watch};
use crate::simulation::Simulation;

/// Observation, reward, whether the episode has ended, info.
type Step<'py> = (Bound<'py, PyArray1<f32>>, f64, bool, Bound<'py, PyDict>);

/// One episode of a driving task: what its simulation does not hold.
///
/// Args:
///     rules: What all episodes of the task share.
///     goal: The goal (x, z), m.
///     domain: Properties of rover and world: mass_scale, friction, actuator_gain, gravity_scale.
///     trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N.
///     difficulty: Difficulty of the rocks.
///     distance: Horizontal distance to the goal, m.
///     previous_action: The last action, (n_actions,).
///     energy: Work of the motors since the beginning, driving or braking, J.
///     energy_positive: Its driving part, J.
///     stuck_time: How long the rover has been high-centred, s.
///     observation: The last observation, (size,).
///     further: Goals after the first, (n, 2), x and z, m; none by default.
///     reached: How many goals have been reached.
///     outcome: What else is known of the last control period, as `state` returns it; by default
///         the episode runs, and its info tells its progress only.
///     owed: Standard normal numbers of an observation that lacks its heights, (size,), or (0,)
///         without noise; None where it lacks none.
///
/// Raises:
///     OptionError: An argument has a wrong shape or a number that is not finite.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct EpisodeRun(Shared<Inner>);

struct Inner {
    episode: CoreEpisode,
    scratch: ReadingScratch,
    commands: Vec<f64>,
}

/// Actions of a shape in row-major order, as float64.
pub fn actions(value: &Bound<'_, PyAny>, shape: &[usize]) -> PyResult<Vec<f64>> {
    let field = "action";
    let misshapen = |given: &[usize]| BorderError {
        kind: Kind::Command,
        message: format!("{field}: must have shape {shape:?}, has {given:?}"),
        field: Some(field.to_owned()),
        value: Value::Object(value.clone().unbind()),
    };
    if let Ok(ready) = value.extract::<PyReadonlyArrayDyn<'_, f32>>() {
        if ready.shape() != shape {
            return Err(misshapen(ready.shape()).into());
        }
        return Ok(match ready.as_slice() {
            Ok(entries) => entries.iter().map(|&a| f64::from(a)).collect(),
            Err(_) => ready.as_array().iter().map(|&a| f64::from(a)).collect(),
        });
    }
    if value.is_instance_of::<PyRange>() {
        // It may be of any length.
        return Err(refused(value, Kind::Command, field, "an array of numbers").into());
    }
    let given = array(value, Kind::Command, field)?;
    if given.shape() != shape {
        return Err(misshapen(given.shape()).into());
    }
    Ok(given.as_array().iter().copied().collect())
}

/// A simulation of the border.
pub fn simulation<'a, 'py>(
    value: &'a Bound<'py, PyAny>,
    field: &str,
) -> PyResult<&'a Bound<'py, Simulation>> {
    let cast = value.cast();
    cast.map_err(|_| refused(value, Kind::Option, field, "a Simulation").into())
}

/// Rules of the border.
pub fn rules(value: &Bound<'_, PyAny>) -> PyResult<Arc<Rules>> {
    let cast = value.cast::<EpisodeRules>();
    let found = cast.map_err(|_| refused(value, Kind::Option, "rules", "EpisodeRules"))?;
    Ok(found.get().inner.clone())
}

fn setting(
    goal: &Bound<'_, PyAny>,
    further: Option<&Bound<'_, PyAny>>,
    domain: &Bound<'_, PyAny>,
    trunk_load_limit: &Bound<'_, PyAny>,
    difficulty: &Bound<'_, PyAny>,
) -> PyResult<Setting> {
    let Ok([mass_scale, friction, actuator_gain, gravity_scale]) =
        <[f64; 4]>::try_from(vector(domain, Kind::Option, "domain")?)
    else {
        return Err(refused(domain, Kind::Option, "domain", "four numbers").into());
    };
    Ok(Setting {
        goal: place(Some(goal))?,
        further: further.map_or(Ok(Vec::new()), |given| points(given, "further"))?,
        domain: Domain {
            mass_scale,
            friction,
            actuator_gain,
            gravity_scale,
        },
        trunk_load_limit: number(trunk_load_limit, Kind::Option, "trunk_load_limit")?,
        difficulty: number(difficulty, Kind::Option, "difficulty")?,
    })
}

/// What else an episode knows of its last control period.
fn last(given: &Bound<'_, PyAny>) -> PyResult<Last> {
    let what = "what `EpisodeRun.state` returns";
    let refuse = || refused(given, Kind::Option, "outcome", what);
    let found: Option<(Vec<f64>, Vec<f64>, String)> = given.extract().ok();
    let (now, terms, name) = found.ok_or_else(refuse)?;
    let now = <[f64; N_QUANTITIES]>::try_from(now).map_err(|_| refuse())?;
    let terms = <[f64; N_TERMS]>::try_from(terms).map_err(|_| refuse())?;
    let ending = Ending::ALL.into_iter().find(|own| own.name() == name);
    if now.iter().chain(&terms).any(|x| x.is_nan()) {
        return Err(refuse().into());
    }
    Ok(Last {
        now: Quantities::from_row(now),
        terms,
        ending: ending.ok_or_else(refuse)?,
    })
}

fn normals(given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<f64>>> {
    given
        .map(|given| vector(given, Kind::Option, "normals"))
        .transpose()
}

/// The action and the normal numbers of a control period, checked.
fn given(
    rules: &Rules,
    action: &Bound<'_, PyAny>,
    normals: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Vec<f64>, Option<Vec<f64>>)> {
    let action = actions(action, &[rules.n_actions()])?;
    action::check(&action, action.len(), true).map_err(BorderError::from)?;
    let normals = self::normals(normals)?;
    check_normals(rules, normals.as_deref()).map_err(BorderError::from)?;
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
    pub fn copy(&self) -> PyResult<CoreEpisode> {
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
    ) -> PyResult<Step<'py>> {
        let outcome = self.episode.outcome();
        Ok((
            PyArray1::from_slice(py, observation),
            outcome.reward,
            outcome.ending.is_end(),
            info(py, &(&self.episode, message))?,
        ))
    }
}

#[pymethods]
impl EpisodeRun {
    #[new]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python class
    #[pyo3(signature = (rules, *, goal, domain, trunk_load_limit, difficulty, distance,
        previous_action, energy, energy_positive, stuck_time, observation, further = None,
        reached = Given::MISSING, outcome = None, owed = None),
        text_signature = "(rules, *, goal, domain, trunk_load_limit, difficulty, distance, previous_action, energy, energy_positive, stuck_time, observation, further=None, reached=0, outcome=None, owed=None)")]
    fn new(
        rules: &Bound<'_, PyAny>,
        goal: &Bound<'_, PyAny>,
        domain: &Bound<'_, PyAny>,
        trunk_load_limit: &Bound<'_, PyAny>,
        difficulty: &Bound<'_, PyAny>,
        distance: &Bound<'_, PyAny>,
        previous_action: &Bound<'_, PyAny>,
        energy: &Bound<'_, PyAny>,
        energy_positive: &Bound<'_, PyAny>,
        stuck_time: &Bound<'_, PyAny>,
        observation: &Bound<'_, PyAny>,
        further: Option<&Bound<'_, PyAny>>,
        reached: Given<'_>,
        outcome: Option<&Bound<'_, PyAny>>,
        owed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let option = |given, field| number(given, Kind::Option, field);
        let progress = Progress {
            distance: option(distance, "distance")?,
            previous_action: vector(previous_action, Kind::Option, "previous_action")?,
            energy: option(energy, "energy")?,
            energy_positive: option(energy_positive, "energy_positive")?,
            stuck_time: option(stuck_time, "stuck_time")?,
            reached: reached.count(0, Kind::Option, "reached")?,
        };
        #[allow(clippy::cast_possible_truncation)] // float32 is what an observation holds
        let observation = vector(observation, Kind::Option, "observation")?
            .into_iter()
            .map(|x| x as f32)
            .collect();
        let setting = setting(goal, further, domain, trunk_load_limit, difficulty)?;
        let last = outcome.map(last).transpose()?;
        let owed = owed.map(|given| vector(given, Kind::Option, "owed"));
        let rules = self::rules(rules)?;
        let owed = owed.transpose()?;
        let episode = CoreEpisode::resume(rules, setting, progress, observation, last, owed);
        Ok(Self::of(episode.map_err(BorderError::from)?))
    }

    /// The beginning of an episode.
    ///
    /// Args:
    ///     rules: What all episodes of the task share.
    ///     simulation: The rover at its start.
    ///     goal: The goal (x, z), m.
    ///     domain: As of the class.
    ///     trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N.
    ///     difficulty: Difficulty of the rocks.
    ///     normals: A standard normal number for each entry of the observation, (size,), where the
    ///         rules have noise.
    ///     further: As of the class.
    ///
    /// Returns:
    ///     The episode; None if its observation is not finite in float32.
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape or a number that is not finite, or the
    ///         rover's model does not fit the rules.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)] // keyword arguments in Python
    #[pyo3(signature = (rules, simulation, *, goal, domain, trunk_load_limit, difficulty,
        normals = None, further = None))]
    fn begin(
        rules: &Bound<'_, PyAny>,
        simulation: &Bound<'_, PyAny>,
        goal: &Bound<'_, PyAny>,
        domain: &Bound<'_, PyAny>,
        trunk_load_limit: &Bound<'_, PyAny>,
        difficulty: &Bound<'_, PyAny>,
        normals: Option<&Bound<'_, PyAny>>,
        further: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Option<Self>> {
        let rules = self::rules(rules)?;
        let setting = setting(goal, further, domain, trunk_load_limit, difficulty)?;
        let normals = self::normals(normals)?;
        let rover = self::simulation(simulation, "simulation")?.get().open()?;
        let begun = CoreEpisode::begin(rules, setting, &rover, normals.as_deref());
        Ok(begun.map_err(BorderError::from)?.map(Self::of))
    }

    /// Gives the simulation an action for one control period.
    ///
    /// Other threads run meanwhile. Ctrl-C, or whatever else a signal handler raises, ends the call
    /// after a whole physics step, whose state stays; the episode then stays as before the call.
    ///
    /// Args:
    ///     simulation: The rover of this episode, a `Simulation`, or a `RoverGrainSimulation` where
    ///         it drives among grains.
    ///     action: Torques, then steering, within [-1, 1], (n_actions,).
    ///     normals: A standard normal number for each entry of the observation, (size,), where the
    ///         rules have noise.
    ///     has_scan: Whether the heights are taken. Without, only a period that ends the episode
    ///         takes them; otherwise the last ones stay until `complete`.
    ///
    /// Returns:
    ///     Observation (size,) float32, reward, whether the episode has ended, and info.
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
    ) -> PyResult<Step<'py>> {
        let mut held = self.0.open()?;
        let inner = &mut *held;
        let rules = inner.episode.rules().clone();
        let (action, normals) = given(&rules, action, normals)?;
        let among = simulation.cast::<RoverGrainSimulation>().ok();
        let mut rover = match among {
            Some(among) => among.get().of_rover().open()?,
            None => self::simulation(simulation, "simulation")?.get().open()?,
        };
        rules
            .check_model(rover.model())
            .map_err(BorderError::from)?;
        (inner.episode)
            .command(&mut rover, &action, &mut inner.commands)
            .map_err(BorderError::from)?;
        let mut watch = Watch::new();
        let substeps = rules.settings().substeps;
        let moving = &mut *rover;
        let among = among.map(pyo3::Bound::get);
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

    /// Goes on by a control period that ended with a reading, without a simulation.
    ///
    /// Args:
    ///     reading: As of `Simulation.reading` with the goal as its target and the rules' scan.
    ///     action: As of `step`.
    ///     normals: As of `step`.
    ///     message: The message of the physics step that failed, if one did.
    ///
    /// Returns:
    ///     As `step`.
    ///
    /// Raises:
    ///     CommandError: As `step`.
    ///     OptionError: `reading` or `normals` has a wrong length.
    #[pyo3(signature = (reading, action, normals = None, *, message = None))]
    fn advance<'py>(
        &self,
        py: Python<'py>,
        reading: &Bound<'py, PyAny>,
        action: &Bound<'py, PyAny>,
        normals: Option<&Bound<'py, PyAny>>,
        message: Option<String>,
    ) -> PyResult<Step<'py>> {
        let mut held = self.0.open()?;
        let rules = held.episode.rules().clone();
        let (action, normals) = given(&rules, action, normals)?;
        let mut row = vector(reading, Kind::Option, "reading")?;
        let n_state = rules.places().size;
        let expected = n_state + rules.settings().scan.len();
        if row.len() != expected {
            let what = format!("{expected} numbers");
            return Err(refused(reading, Kind::Option, "reading", &what).into());
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

    /// Takes the heights that the last observation lacks, if it lacks any.
    ///
    /// Args:
    ///     simulation: The rover of this episode, which has not moved since.
    ///
    /// Returns:
    ///     The last observation, (size,) float32.
    fn complete<'py>(
        &self,
        py: Python<'py>,
        simulation: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let mut held = self.0.open()?;
        let rover = self::simulation(simulation, "simulation")?.get().open()?;
        held.episode.complete(&rover);
        Ok(PyArray1::from_slice(py, held.episode.observation()))
    }

    /// The last observation, (size,) float32.
    #[getter]
    fn observation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        Ok(PyArray1::from_slice(
            py,
            self.0.open()?.episode.observation(),
        ))
    }

    /// The present goal (x, z), m; the last one where all are reached.
    #[getter]
    fn goal(&self) -> PyResult<(f64, f64)> {
        Ok(self.0.open()?.episode.goal().into())
    }

    /// The info of the last period, or of the beginning.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        info(py, &(&self.0.open()?.episode, None))
    }

    /// The keyword arguments that make an episode which continues as this one.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let held = self.0.open()?;
        let (setting, progress) = (held.episode.setting(), held.episode.progress());
        let domain = &setting.domain;
        let domain = [
            domain.mass_scale,
            domain.friction,
            domain.actuator_gain,
            domain.gravity_scale,
        ];
        let state = PyDict::new(py);
        state.set_item("goal", (setting.goal[0], setting.goal[1]))?;
        state.set_item("domain", fresh(py, &domain))?;
        state.set_item("trunk_load_limit", setting.trunk_load_limit)?;
        state.set_item("difficulty", setting.difficulty)?;
        state.set_item("distance", progress.distance)?;
        state.set_item("previous_action", fresh(py, &progress.previous_action))?;
        state.set_item("energy", progress.energy)?;
        state.set_item("energy_positive", progress.energy_positive)?;
        state.set_item("stuck_time", progress.stuck_time)?;
        let observation = PyArray1::from_slice(py, held.episode.observation());
        state.set_item("observation", observation)?;
        state.set_item("further", fresh_rows(py, &setting.further)?)?;
        state.set_item("reached", progress.reached)?;
        let outcome = held.episode.outcome();
        let (now, terms) = (outcome.now.row(), outcome.terms);
        let told = (fresh(py, &now), fresh(py, &terms), outcome.ending.name());
        state.set_item("outcome", told)?;
        let owed = held.episode.owed();
        state.set_item("owed", owed.map(|owed| fresh(py, owed)))?;
        Ok(state)
    }

    #[allow(clippy::type_complexity)] // what pickle takes
    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<((Py<EpisodeRules>,), Bound<'py, PyDict>)> {
        let rules = EpisodeRules::of(self.0.open()?.episode.rules().clone());
        Ok(((Py::new(py, rules)?,), self.state(py)?))
    }

    fn __repr__(&self) -> String {
        let Ok(held) = self.0.open() else {
            return "EpisodeRun(stepping)".to_owned();
        };
        let distance = held.episode.progress().distance;
        format!("EpisodeRun({distance:.2} m to the goal)")
    }
}
