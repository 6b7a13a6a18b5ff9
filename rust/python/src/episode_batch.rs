//! `EpisodeBatch`: many rovers with their episodes, one call a control period.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::draw::Pcg64;
use rover_core::episode::{EpisodeBatch as CoreBatch, EpisodeError};

use crate::arguments::{Given, count, refused, whole};
use crate::arrays::fresh_table;
use crate::batch::{index, mask};
use crate::draw::{DrawnEpisodes, EpisodeDistribution, Request};
use crate::episode::{actions, rules, simulation};
use crate::errors::{BorderError, Kind};
use crate::generators::halves;
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

    /// Indices of rovers; as many as `expected`, where that is known.
    fn indices(&self, given: &Bound<'_, PyAny>, expected: Option<usize>) -> PyResult<Vec<usize>> {
        let found: Option<Vec<Bound<'_, PyAny>>> = given.extract().ok();
        let found = found.filter(|found| expected.is_none_or(|n| n == found.len()));
        let what = expected.map_or_else(
            || "indices of rovers".to_owned(),
            |n| format!("{n} indices of rovers"),
        );
        let found = found.ok_or_else(|| refused(given, Kind::Option, "indices", &what))?;
        let rovers = self.batch.rovers();
        found.iter().map(|one| index(one, rovers)).collect()
    }
}

/// A count of at least one.
fn at_least_one(given: &Bound<'_, PyAny>, field: &str) -> PyResult<usize> {
    match count(given, Kind::Option, field)? {
        0 => Err(refused(given, Kind::Option, field, "at least 1").into()),
        n => Ok(n),
    }
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
    ///     actions: As of `EpisodeRun.step`, (n_rovers, n_actions).
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

    /// Draws episodes on the threads of this batch; no rover changes.
    ///
    /// Args:
    ///     distribution: What the episodes are drawn from.
    ///     generators: Generators, (m, 4) uint64.
    ///     attempts: As of `EpisodeDistribution.draw`.
    ///     difficulties: As of `EpisodeDistribution.draw`.
    ///     fixed: As of `EpisodeDistribution.draw`.
    ///
    /// Returns:
    ///     The episodes, the same for any number of threads.
    ///
    /// Raises:
    ///     RoverGymError: As of `EpisodeDistribution.draw`, for the first rover that has one.
    #[pyo3(signature = (distribution, generators, *, attempts = Given::MISSING, difficulties = None, fixed = None),
        text_signature = "($self, distribution, generators, *, attempts=100, difficulties=None, fixed=None)")]
    fn draw(
        &self,
        py: Python<'_>,
        distribution: &Bound<'_, PyAny>,
        generators: &Bound<'_, PyAny>,
        attempts: Given<'_>,
        difficulties: Option<&Bound<'_, PyAny>>,
        fixed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<DrawnEpisodes> {
        let found = distribution.cast::<EpisodeDistribution>();
        let what = "an EpisodeDistribution";
        let refuse = |_| refused(distribution, Kind::Option, "distribution", what);
        let found = found.map_err(refuse)?;
        let request = Request::parse(generators, attempts, difficulties, fixed)?;
        let mut held = self.0.open()?;
        found.get().draw_on(py, &request, Some(&mut held.batch))
    }

    /// Begins drawn episodes.
    ///
    /// Args:
    ///     indices: Indices of the rovers, one for each episode.
    ///     episodes: Drawn episodes with the rules of the batch.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or the episodes do not fit. Nothing has changed.
    fn begin(&self, indices: &Bound<'_, PyAny>, episodes: &Bound<'_, PyAny>) -> PyResult<()> {
        let found = episodes.cast::<DrawnEpisodes>();
        let refuse = |_| refused(episodes, Kind::Option, "episodes", "DrawnEpisodes");
        let drawn = found.map_err(refuse)?.get();
        let mut held = self.0.open()?;
        let places = held.indices(indices, Some(drawn.drawn.len()))?;
        for (&index, one) in places.iter().zip(&drawn.drawn) {
            held.batch.check(index, one).map_err(BorderError::from)?;
        }
        for (&index, one) in places.iter().zip(&drawn.drawn) {
            let begun = held.batch.begin(index, one.clone());
            begun.map_err(BorderError::from)?;
            held.origins[index] = drawn.origin(one);
        }
        Ok(())
    }

    /// The generators of rovers, from which their noise is drawn.
    ///
    /// Args:
    ///     indices: Indices of the rovers.
    ///
    /// Returns:
    ///     (m, 4) uint64: high and low half of each state, high and low half of each increment.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or its episode has not begun.
    fn generators<'py>(
        &self,
        py: Python<'py>,
        indices: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<u64>>> {
        let held = self.0.open()?;
        let places = held.indices(indices, None)?;
        let found = places.iter().map(|&index| held.batch.generator(index));
        let found: Vec<Pcg64> = found.collect::<Result<_, _>>().map_err(BorderError::from)?;
        fresh_table(py, found.iter().map(halves))
    }

    /// Sets the generators of rovers.
    ///
    /// Args:
    ///     indices: Indices of the rovers.
    ///     generators: As `generators` returns them, (m, 4) uint64.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, its episode has not begun, or `generators` has a
    ///         wrong shape. Nothing has changed.
    fn set_generators(
        &self,
        indices: &Bound<'_, PyAny>,
        generators: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let given = crate::generators::generators(generators)?;
        let mut held = self.0.open()?;
        let places = held.indices(indices, Some(given.len()))?;
        for &index in &places {
            held.batch.generator(index).map_err(BorderError::from)?;
        }
        for (index, generator) in places.into_iter().zip(given) {
            let set = held.batch.set_generator(index, generator);
            set.map_err(BorderError::from)?;
        }
        Ok(())
    }

    /// The ground of one rover.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Raises:
    ///     OptionError: There is no such rover.
    fn terrain<'py>(
        &self,
        py: Python<'py>,
        index: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        held.origins[index].terrain.to_object(py)
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
