//! `EpisodeRun`: one episode of a driving task.

use std::sync::Arc;

use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyRange, PyTuple};
use rover_task::draw::Domain;
use rover_task::episode::{Ending, Episode as CoreEpisode, EpisodeSetting, EpisodeState, Rules};

use crate::arguments::{Named, number, object, refused};
use crate::arrays::{Array, array, fresh, vector};
use crate::episode_rules::EpisodeRules;
use crate::errors::{Kind, Result, Value};
use crate::infos::info;
use crate::reading::{place, points};
use crate::simulation::Simulation;
use crate::snapshot::{read_bytes, written_bytes};

/// State of an episode of a driving task, beside its simulation.
///
/// Create it by `begin` or `from_bytes`.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct EpisodeRun(CoreEpisode);

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
    object(value, Kind::Option, field, "a Simulation")
}

/// The argument `rules`: `EpisodeRules`.
#[derive(Clone)]
pub struct GivenRules(pub Arc<Rules>);

impl FromPyObject<'_, '_> for GivenRules {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        let rules = object::<EpisodeRules>(&given, Kind::Option, "rules", "EpisodeRules")?;
        Ok(Self(rules.get().inner.clone()))
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

impl EpisodeRun {
    pub fn of(episode: CoreEpisode) -> Self {
        Self(episode)
    }

    /// A copy of what it holds.
    pub fn copy(&self) -> CoreEpisode {
        self.0.clone()
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
        let setting = EpisodeSetting {
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

    /// The last observation, (size,) float32.
    #[getter]
    fn observation(&self) -> Array<f32> {
        fresh(self.0.observation())
    }

    /// The last action, (n_actions,); zeros at the beginning.
    #[getter]
    fn previous_action(&self) -> Array {
        fresh(&self.0.progress().previous_action)
    }

    /// The present goal (x, z), m; the last one if all are reached.
    #[getter]
    fn goal(&self) -> (f64, f64) {
        self.0.goal().into()
    }

    /// The info of the last control period, or of the start.
    fn info<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        info(py, &(&self.0, None))
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
        let (mut rules, mut state) = (self.0.rules().clone(), self.0.state());
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
            let other = &seen.get().0;
            let EpisodeState {
                observation,
                pending_normals,
                ..
            } = other.state();
            (rules, state.observation, state.pending_normals) =
                (other.rules().clone(), observation, pending_normals);
        }
        given.finish()?;
        Ok(Self::of(CoreEpisode::resume(rules, state)?))
    }

    /// The state of the episode as bytes, for `from_bytes`.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyBytes>> {
        let state = written_bytes(&self.0.state(), "episode")?;
        Ok(PyBytes::new(py, &state))
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
        let rules = GivenRules(own.0.rules().clone());
        let given = (rules, own.to_bytes(py)?);
        Ok((slf.get_type().getattr("from_bytes")?, given).into_pyobject(py)?)
    }

    fn __repr__(&self) -> String {
        let distance = self.0.progress().distance;
        format!("EpisodeRun({distance:.2} m to the goal)")
    }
}
