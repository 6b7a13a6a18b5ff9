//! `EpisodeBatch`: many rovers with their episodes, one call a control period.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::draw::{DrawnGround, Pcg64};
use rover_core::episode::{
    Autoreset, EpisodeBatch as CoreBatch, EpisodeError, Origin as Began, Stepped, Succession,
};

use crate::arguments::{Given, at_least_one, refused, whole};
use crate::arrays::fresh_table;
use crate::batch::{index, mask};
use crate::draw::{
    DrawnEpisodes, EpisodeDistribution, Request, domain_row, range, rocks_of, rocks_row, start_of,
    start_row,
};
use crate::episode::{EpisodeRun, actions, rules, simulation};
use crate::errors::{BorderError, Kind};
use crate::generators::halves;
use crate::infos::{Told, info, infos};
use crate::options::SolverWords;
use crate::shared::{Shared, Watch};
use crate::simulation::{Origin, Simulation};

use crate::union;

/// Observations, rewards, which episodes have ended, which have reached the time limit, and the
/// indices of both.
type Step<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<bool>>,
    Vec<usize>,
);

/// Start, rocks, seed of the rocks, and domain, as `EpisodeBatch.origin` tells them.
type OriginRows = (Vec<f64>, Vec<f64>, u64, Vec<f64>);

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
        Ok((self.batch.episode(index)?, self.batch.message(index)))
    }

    /// One step, by a function of the batch, the actions and the room for the observations; and the
    /// rovers whose next episode has begun.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        actions: &Bound<'py, PyAny>,
        take: impl FnOnce(
            &mut CoreBatch,
            &[f64],
            &mut [f32],
            &mut dyn FnMut() -> bool,
        ) -> Result<Stepped, EpisodeError>
        + Send,
    ) -> PyResult<(Step<'py>, Vec<usize>)> {
        let batch = &mut self.batch;
        let (n, rules) = (batch.rovers().len(), batch.rules());
        let actions = self::actions(actions, &[n, rules.n_actions()])?;
        let rows = PyArray2::zeros(py, [n, rules.size()], false);
        let stepped = {
            let mut writable = rows.readwrite();
            let out = writable.as_slice_mut()?;
            let mut watch = Watch::new();
            let done = py.detach(|| take(batch, &actions, out, &mut || watch.go_on()));
            watch.result(done)?
        };
        let step = (
            rows,
            PyArray1::from_slice(py, &stepped.rewards),
            PyArray1::from_slice(py, &stepped.ended),
            PyArray1::from_slice(py, &stepped.truncated),
            stepped.over,
        );
        Ok((step, stepped.begun))
    }

    /// Keeps what Python is told of the simulation of an episode that has begun.
    fn set_origin(&mut self, index: usize, words: &SolverWords) -> PyResult<()> {
        let origin = self.batch.origin(index).map_err(BorderError::from)?;
        self.origins[index] = Origin {
            terrain: origin.ground.clone(),
            words: words.clone(),
        };
        Ok(())
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

fn distribution<'a, 'py>(
    given: &'a Bound<'py, PyAny>,
) -> PyResult<&'a Bound<'py, EpisodeDistribution>> {
    let found = given.cast::<EpisodeDistribution>();
    let what = "an EpisodeDistribution";
    found.map_err(|_| refused(given, Kind::Option, "distribution", what).into())
}

/// Where and on what an episode has begun, as `EpisodeBatch.origin` tells it.
fn origin(given: &Bound<'_, PyAny>, terrain: &DrawnGround) -> PyResult<Began> {
    let what = "what `EpisodeBatch.origin` returns";
    let refuse = || refused(given, Kind::Option, "origin", what);
    let found: Option<OriginRows> = given.extract().ok();
    let (start, rocks, seed, _) = found.ok_or_else(refuse)?;
    let rocks = <[f64; 3]>::try_from(rocks).map_err(|_| refuse())?;
    if !start.iter().chain(&rocks).all(|x| x.is_finite()) {
        return Err(refuse().into());
    }
    Ok(Began {
        start: start_of(&start).ok_or_else(refuse)?,
        rocks: rocks_of(rocks, seed),
        ground: terrain.clone(),
    })
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
        let n = at_least_one(n, Kind::Option, "n")?;
        let max_steps = max_steps.map(|given| whole(given, Kind::Option, "max_steps"));
        let threads = threads.map(|given| at_least_one(given, Kind::Option, "threads"));
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
        let n = held.batch.rovers().len();
        let active = active.map(|given| mask(given, n)).transpose()?;
        let active = active.as_deref();
        let (step, _) = held.step(py, actions, |batch, actions, out, go_on| {
            batch.step_while(actions, active, has_scan, out, go_on)
        })?;
        Ok(step)
    }

    /// Gives all rovers their actions for one control period and begins the next episodes.
    ///
    /// Those rovers begin anew whose episode is over; what they begin is drawn on the threads of
    /// this batch from their own generators. Ctrl-C ends the call as it ends that of `step`.
    ///
    /// Args:
    ///     actions: As of `step`.
    ///     distribution: What the next episodes are drawn from.
    ///     same_step: Whether an episode is followed by the next in the step that ends it, see
    ///         `finals`. If not, the next one begins in the following step; its rover does not move
    ///         in that step and earns nothing.
    ///     attempts: As of `EpisodeDistribution.draw`.
    ///     has_scan: As of `step`.
    ///
    /// Returns:
    ///     As of `step`. Where an episode has begun, the observation is its first; with `same_step`
    ///     all else is that of the episode that has ended. If an episode that is to follow in the
    ///     same step cannot be drawn, none begins, and the next call refuses it.
    ///
    /// Raises:
    ///     CommandError: As of `step`.
    ///     OptionError: An argument is invalid, or an episode has not begun. No rover has moved.
    ///     RoverGymError: As of `EpisodeDistribution.draw`, for the first rover that has one and
    ///         whose episode was over before this call. No rover has moved.
    #[pyo3(signature = (actions, distribution, *, same_step, attempts = Given::MISSING, has_scan = true),
        text_signature = "($self, actions, distribution, *, same_step, attempts=100, has_scan=True)")]
    fn step_on<'py>(
        &self,
        py: Python<'py>,
        actions: &Bound<'py, PyAny>,
        distribution: &Bound<'py, PyAny>,
        same_step: bool,
        attempts: Given<'_>,
        has_scan: bool,
    ) -> PyResult<Step<'py>> {
        let distribution = self::distribution(distribution)?.get();
        let succession = Succession {
            distribution: &distribution.inner,
            attempts: attempts.count(100, Kind::Option, "attempts")?,
            autoreset: if same_step {
                Autoreset::SameStep
            } else {
                Autoreset::NextStep
            },
        };
        let mut held = self.0.open()?;
        let (step, begun) = held.step(py, actions, |batch, actions, out, go_on| {
            batch.step_on(actions, &succession, has_scan, out, go_on)
        })?;
        for index in begun {
            held.set_origin(index, &distribution.words)?;
        }
        Ok(step)
    }

    /// Indices of the rovers whose episode is over and whose next has not begun, in order.
    #[getter]
    fn over(&self) -> PyResult<Vec<usize>> {
        Ok(self.0.open()?.batch.over())
    }

    /// The episodes that the last call of `step_on` with `same_step` has ended.
    ///
    /// Returns:
    ///     For each index of a rover, in order, the last observation (size,) float32 and the last
    ///     info. Empty after `step`.
    fn finals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let held = self.0.open()?;
        let finals = PyDict::new(py);
        for one in held.batch.finals() {
            let seen = PyArray1::from_slice(py, one.episode.observation());
            let message = one.error.as_ref().map(ToString::to_string);
            let told = info(py, &(&one.episode, message))?;
            finals.set_item(one.index, (seen, told))?;
        }
        Ok(finals)
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
        let distribution = self::distribution(distribution)?.get();
        let request = Request::parse(generators, attempts, difficulties, fixed)?;
        let mut held = self.0.open()?;
        distribution.draw_on(py, &request, Some(&mut held.batch))
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
            held.set_origin(index, &drawn.words)?;
        }
        Ok(())
    }

    /// Puts copies of a rover in the middle of its episode in the places of others.
    ///
    /// With `simulation`, `episode`, `origin`, `steps` and `generators` of one rover the copies
    /// continue it bit for bit.
    ///
    /// Args:
    ///     indices: Indices of the rovers that it replaces.
    ///     simulation: The rover.
    ///     episode: Its episode, with the rules of the batch.
    ///     origin: Where and on what it began, as `origin` tells.
    ///     generator: Generator of the noise, (1, 4) uint64.
    ///     steps: Control periods since the episode began.
    ///     message: Message of the physics step that failed, if that has ended the episode.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or an argument does not fit. Nothing has changed.
    #[allow(clippy::too_many_arguments)] // keyword arguments in Python
    #[pyo3(signature = (indices, simulation, episode, origin, *, generator, steps = Given::MISSING, message = None),
        text_signature = "($self, indices, simulation, episode, origin, *, generator, steps=0, message=None)")]
    fn resume(
        &self,
        indices: &Bound<'_, PyAny>,
        simulation: &Bound<'_, PyAny>,
        episode: &Bound<'_, PyAny>,
        origin: &Bound<'_, PyAny>,
        generator: &Bound<'_, PyAny>,
        steps: Given<'_>,
        message: Option<&str>,
    ) -> PyResult<()> {
        let one = self::simulation(simulation, "simulation")?.get();
        let cast = episode.cast::<EpisodeRun>();
        let refuse = |_| refused(episode, Kind::Option, "episode", "an EpisodeRun");
        let episode = cast.map_err(refuse)?.get().copy()?;
        let origin = self::origin(origin, &one.origin().terrain)?;
        let given = crate::generators::generators(generator)?;
        let [random] = <[Pcg64; 1]>::try_from(given)
            .map_err(|_| refused(generator, Kind::Option, "generator", "one row"))?;
        let steps = steps.count(0, Kind::Option, "steps")? as u64;
        let mut held = self.0.open()?;
        let places = held.indices(indices, None)?;
        let rover = one.open()?.clone();
        for index in places {
            let whole = (episode.clone(), steps);
            let batch = &mut held.batch;
            let resumed = batch.resume(
                index,
                rover.clone(),
                whole,
                origin.clone(),
                random,
                message.map(str::to_owned),
            );
            resumed.map_err(BorderError::from)?;
            held.origins[index] = one.origin().clone();
        }
        Ok(())
    }

    /// A copy of the episode of one rover.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or its episode has not begun.
    fn episode(&self, index: &Bound<'_, PyAny>) -> PyResult<EpisodeRun> {
        let held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        let episode = held.batch.episode(index).map_err(BorderError::from)?;
        Ok(EpisodeRun::of(episode.clone()))
    }

    /// Control periods of one rover since its episode began.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or its episode has not begun.
    fn steps(&self, index: &Bound<'_, PyAny>) -> PyResult<u64> {
        let held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        Ok(held.batch.steps(index).map_err(BorderError::from)?)
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

    /// Where and on what the episode of a rover has begun.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Returns:
    ///     Its rows of `DrawnEpisodes.starts`, `rocks`, `rock_seeds` and `domains`.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or its episode has not begun.
    #[allow(clippy::type_complexity)] // a tuple in Python
    fn origin<'py>(
        &self,
        py: Python<'py>,
        index: &Bound<'_, PyAny>,
    ) -> PyResult<(
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray1<f64>>,
        u64,
        Bound<'py, PyArray1<f64>>,
    )> {
        let held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        let origin = held.batch.origin(index).map_err(BorderError::from)?;
        let episode = held.batch.episode(index).map_err(BorderError::from)?;
        Ok((
            PyArray1::from_slice(py, &start_row(&origin.start)),
            PyArray1::from_slice(py, &rocks_row(origin.rocks)),
            origin.rocks.map_or(0, |rocks| rocks.seed),
            PyArray1::from_slice(py, &domain_row(&episode.setting().domain)),
        ))
    }

    /// Range (low, high) of the rocks' difficulty in the next episodes of a rover, if any is set.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Raises:
    ///     OptionError: There is no such rover.
    fn difficulty(&self, index: &Bound<'_, PyAny>) -> PyResult<Option<(f64, f64)>> {
        let held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        let found = held.batch.difficulty(index).map_err(BorderError::from)?;
        Ok(found.map(|[low, high]| (low, high)))
    }

    /// Sets the range of the rocks' difficulty in the episodes that `step_on` begins with a rover.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///     difficulty: The range (low, high); None for that of the distribution.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or `difficulty` is no range.
    fn set_difficulty(
        &self,
        index: &Bound<'_, PyAny>,
        difficulty: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mut held = self.0.open()?;
        let index = self::index(index, held.batch.rovers())?;
        let difficulty = difficulty.map(|given| range(given, "difficulty"));
        let set = held.batch.set_difficulty(index, difficulty.transpose()?);
        Ok(set.map_err(BorderError::from)?)
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
        union::object(py, &held.origins[index].terrain)
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
