//! `EpisodeBatch`: many rovers with their episodes, one call a control period.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::draw::{Pcg64, Pcg64State};
use rover_core::episode::{EpisodeBatch as CoreBatch, EpisodeError};

use crate::arguments::{count, refused, whole};
use crate::batch::{index, mask};
use crate::episode::{Episode, actions, rules, simulation};
use crate::errors::{BorderError, Kind};
use crate::infos::{Told, info, infos};
use crate::shared::{Shared, Watch};
use crate::simulation::{Origin, Simulation};

/// Observations, rewards, which episodes have ended, which have reached the time limit, and the
/// indices of both.
type Step<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<bool>>,
    Vec<usize>,
);

/// Many rovers with their episodes, each bit for bit as it would be alone.
///
/// One call at a time: a call during another one raises BusyError.
///
/// Args:
///     rules: What all episodes share.
///     simulation: A rover of the task; the batch begins with copies of it, without episodes.
///     n: Number of rovers.
///     max_steps: Control periods until an episode is truncated; no limit by default.
///     threads: Number of threads; one a core by default.
///
/// Raises:
///     OptionError: An argument is out of its range, or the model does not fit the rules.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct EpisodeBatch(Shared<Inner>);

struct Inner {
    batch: CoreBatch,
    origins: Vec<Origin>,
}

impl Inner {
    /// What the infos tell of a rover.
    fn told(&self, index: usize) -> Result<Told<'_>, EpisodeError> {
        let message = self.batch.errors()[index].as_ref().map(ToString::to_string);
        Ok((self.batch.episode(index)?, message))
    }
}

/// A count of at least one.
fn at_least_one(given: &Bound<'_, PyAny>, field: &str) -> PyResult<usize> {
    match count(given, Kind::Option, field)? {
        0 => Err(refused(given, Kind::Option, field, "at least 1").into()),
        n => Ok(n),
    }
}

/// A generator from the numbers of `bit_generator.state["state"]`.
fn generator(given: &Bound<'_, PyAny>) -> PyResult<Pcg64> {
    let found = given.extract::<(u128, u128)>();
    let what = "the numbers (state, inc) of a PCG64";
    let (state, increment) =
        found.map_err(|_| refused(given, Kind::Option, "random_state", what))?;
    Ok(Pcg64::from_state(Pcg64State { state, increment }))
}

#[pymethods]
impl EpisodeBatch {
    #[new]
    #[pyo3(signature = (rules, simulation, n, *, max_steps = None, threads = None))]
    fn new(
        rules: &Bound<'_, PyAny>,
        simulation: &Bound<'_, PyAny>,
        n: &Bound<'_, PyAny>,
        max_steps: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let rules = self::rules(rules)?;
        let n = at_least_one(n, "n")?;
        let max_steps = max_steps.map(|given| whole(given, Kind::Option, "max_steps"));
        let threads = threads.map(|given| at_least_one(given, "threads"));
        let one = self::simulation(simulation, "simulation")?.get();
        let rover = one.open()?;
        let batch = CoreBatch::new(
            rules,
            &rover,
            n,
            max_steps.transpose()?,
            threads.transpose()?,
        );
        Ok(Self(Shared::new(Inner {
            batch: batch.map_err(BorderError::from)?,
            origins: vec![one.origin().clone(); n],
        })))
    }

    /// Number of threads.
    #[getter]
    fn threads(&self) -> PyResult<usize> {
        Ok(self.0.open()?.batch.threads())
    }

    /// Gives all rovers their actions for one control period.
    ///
    /// Ctrl-C ends the call after a whole physics step of each rover, which need not be the same
    /// one.
    ///
    /// Args:
    ///     actions: As of `Episode.step`, (n_rovers, 2 n_wheels).
    ///     active: Which rovers move, (n_rovers,); all by default. The others stay as they are.
    ///     has_scan: Whether the heights are taken. Without, only episodes that end or reach the
    ///         time limit take them; the others keep the last ones.
    ///
    /// Returns:
    ///     Observations (n_rovers, size) float32, rewards (n_rovers,), which episodes have ended,
    ///     which have reached the time limit, (n_rovers,), and the indices of all that have done
    ///     either. A rover that stays has the values of its last period.
    ///
    /// Raises:
    ///     CommandError: The actions have a wrong shape or an entry that is not finite or outside
    ///         [-1, 1]. No rover has moved.
    ///     OptionError: `active` is invalid, or an episode has not begun. No rover has moved.
    #[pyo3(signature = (actions, active = None, *, has_scan = true))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: &Bound<'py, PyAny>,
        active: Option<&Bound<'py, PyAny>>,
        has_scan: bool,
    ) -> PyResult<Step<'py>> {
        let mut held = self.0.open()?;
        let batch = &mut held.batch;
        let (n, rules) = (batch.rovers().len(), batch.rules().clone());
        let actions = self::actions(actions, &[n, rules.n_actions()])?;
        let active = active.map(|given| mask(given, n)).transpose()?;
        let rows = PyArray2::zeros(py, [n, rules.size()], false);
        {
            let mut writable = rows.readwrite();
            let out = writable.as_slice_mut()?;
            let mut watch = Watch::new();
            let active = active.as_deref();
            let done = py.detach(|| {
                batch.step_while(&actions, active, has_scan, out, &mut || watch.go_on())
            });
            watch.result(done)?;
        }
        let (mut rewards, mut ended, mut truncated) =
            (vec![0.0; n], vec![false; n], vec![false; n]);
        let mut over = Vec::new();
        for i in 0..n {
            let outcome = batch.episode(i).map_err(BorderError::from)?.outcome();
            rewards[i] = outcome.reward;
            ended[i] = outcome.ending.is_end();
            truncated[i] = batch.is_truncated(i).map_err(BorderError::from)?;
            if ended[i] || truncated[i] {
                over.push(i);
            }
        }
        Ok((
            rows,
            PyArray1::from_slice(py, &rewards),
            PyArray1::from_slice(py, &ended),
            PyArray1::from_slice(py, &truncated),
            over,
        ))
    }

    /// The infos of all rovers, of their last periods or beginnings.
    ///
    /// Returns:
    ///     For each entry an array (n_rovers,), and under its name after an underscore the mask of
    ///     the rovers that have it: all.
    ///
    /// Raises:
    ///     OptionError: An episode has not begun.
    fn infos<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let held = self.0.open()?;
        let told = (0..held.batch.rovers().len()).map(|i| held.told(i));
        let told: Vec<_> = told.collect::<Result<_, _>>().map_err(BorderError::from)?;
        infos(py, &told)
    }

    /// The info of one rover, of its last period or beginning.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or its episode has not begun.
    fn info<'py>(
        &self,
        py: Python<'py>,
        index: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        info(py, &held.told(index).map_err(BorderError::from)?)
    }

    /// The last observations of all rovers, (n_rovers, size) float32; zeros before an episode.
    fn observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let held = self.0.open()?;
        let (n, size) = (held.batch.rovers().len(), held.batch.rules().size());
        let rows = PyArray2::zeros(py, [n, size], false);
        let mut writable = rows.readwrite();
        for (i, row) in writable.as_slice_mut()?.chunks_exact_mut(size).enumerate() {
            if let Ok(episode) = held.batch.episode(i) {
                row.copy_from_slice(episode.observation());
            }
        }
        drop(writable);
        Ok(rows)
    }

    /// Puts copies of a simulation and its episode in the place of a rover.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///     simulation: Its replacement.
    ///     episode: The episode, which begins or goes on.
    ///     random_state: The numbers `state` and `inc` of the PCG64 that its noise is drawn from;
    ///         any by default.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, the episode has other rules, or an argument is
    ///         invalid. Nothing has changed.
    #[pyo3(signature = (index, simulation, episode, random_state = None))]
    fn replace(
        &self,
        index: &Bound<'_, PyAny>,
        simulation: &Bound<'_, PyAny>,
        episode: &Bound<'_, PyAny>,
        random_state: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let one = self::simulation(simulation, "simulation")?.get();
        let found = episode.cast::<Episode>();
        let refuse = |_| refused(episode, Kind::Option, "episode", "an Episode");
        let given = found.map_err(refuse)?.get().copy()?;
        let drawn = random_state.map(generator).transpose()?;
        let drawn = drawn.unwrap_or_else(|| Pcg64::seeded(&[0]));
        let rover = one.open()?.clone();
        let mut held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        let replaced = held.batch.replace(index, rover, given, drawn);
        replaced.map_err(BorderError::from)?;
        held.origins[index] = one.origin().clone();
        Ok(())
    }

    /// The numbers `state` and `inc` of the PCG64 that a rover's noise is drawn from.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or its episode has not begun.
    fn random_state(&self, index: &Bound<'_, PyAny>) -> PyResult<(u128, u128)> {
        let held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        let drawn = held.batch.generator(index).map_err(BorderError::from)?;
        let Pcg64State { state, increment } = drawn.state();
        Ok((state, increment))
    }

    /// Sets the numbers that `random_state` returns.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///     random_state: `state` and `inc`.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or its episode has not begun; or the numbers are
    ///         none of a PCG64.
    fn set_random_state(
        &self,
        index: &Bound<'_, PyAny>,
        random_state: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let drawn = generator(random_state)?;
        let mut held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        let set = held.batch.set_generator(index, drawn);
        Ok(set.map_err(BorderError::from)?)
    }

    /// Returns a copy of one rover.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Returns:
    ///     The copy; stepping it does not move the rover.
    ///
    /// Raises:
    ///     OptionError: There is no such rover.
    fn simulation(&self, index: &Bound<'_, PyAny>) -> PyResult<Simulation> {
        let held = self.0.open()?;
        let rovers = held.batch.rovers();
        let index = self::index(index, rovers)?;
        let origin = held.origins[index].clone();
        Ok(Simulation::of(rovers[index].clone(), origin))
    }

    fn __len__(&self) -> PyResult<usize> {
        Ok(self.0.open()?.batch.rovers().len())
    }

    fn __repr__(&self) -> String {
        let Ok(held) = self.0.open() else {
            return "EpisodeBatch(stepping)".to_owned();
        };
        let (n, threads) = (held.batch.rovers().len(), held.batch.threads());
        format!("EpisodeBatch({n} rovers, {threads} threads)")
    }
}
