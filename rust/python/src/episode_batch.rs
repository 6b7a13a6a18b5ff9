//! `EpisodeBatch`: many rovers with their episodes, one call a control period.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_task::draw::{DrawnGround, Pcg64, RockDraw, Start};
use rover_task::episode::{
    BatchOutcome, EpisodeBatch as CoreBatch, EpisodeError, EpisodeOrigin as Began,
};

use crate::arguments::{self, Named, at_least_one, below, object, refused, text, whole};
use crate::arrays::{Array, fresh, fresh_rows};
use crate::batch::mask;
use crate::draw::{DrawnEpisodes, EpisodeDistribution, Request};
use crate::episode::{EpisodeRun, GivenRules, GivenSimulation, actions};
use crate::errors::{Kind, Result};
use crate::generators::generators;
use crate::infos::{InfoSource, info, infos};
use crate::rover_grains::{RoverGrainSimulation, Together};
use crate::shared::{Open, Release, Shared, Watch};
use crate::simulation::Simulation;
use crate::union;

/// Observations, rewards, which episodes have ended, which have reached the time limit, and infos.
type Step<'py> = (
    Array<f32>,
    Array,
    Array<bool>,
    Array<bool>,
    Bound<'py, PyDict>,
);

/// Whose infos are asked for.
enum Asked {
    Nobody,
    One(usize),
    All,
}

impl Asked {
    /// The argument `info` of a batch of `n` rovers.
    fn parse(given: Option<&Bound<'_, PyAny>>, n: usize) -> Result<Self> {
        Ok(match given {
            None => Self::Nobody,
            Some(given) if given.extract::<String>().is_ok_and(|word| word == "all") => Self::All,
            Some(index) => Self::One(below(index, n)?),
        })
    }
}

/// Start, rocks, seed of the rocks, and domain, as `EpisodeBatch.origin` tells them.
type OriginRows = (Vec<f64>, Vec<f64>, u64, Vec<f64>);

/// Steps many rovers and their episodes. Each gives the same bits as it would alone.
///
/// Only one call may run at a time; a second call raises BusyError. Methods that take the index of
/// a rover raise OptionError if there is no such rover or if its episode has not begun.
///
/// Args:
///     rules: Rules of the task.
///     simulation: A rover of the task. The batch starts with copies of it, without episodes.
///     n: Number of rovers.
///     max_steps: Control periods until an episode is truncated; no limit by default.
///     threads: Number of threads; one for each core by default.
///
/// Raises:
///     OptionError: An argument is out of its range, or the model does not fit the rules.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct EpisodeBatch(Shared<Inner>);

struct Inner {
    batch: CoreBatch,
    grounds: Vec<DrawnGround>,
    /// Simulations that Python has asked for.
    handed_out: Vec<Option<Py<Simulation>>>,
}

impl Inner {
    /// Source of the infos of a rover.
    fn info_source(&self, index: usize) -> Result<InfoSource<'_>, EpisodeError> {
        Ok((self.batch.episode(index)?, self.batch.message(index)))
    }

    /// The infos that are asked for; nobody's are empty.
    fn infos<'py>(&self, py: Python<'py>, asked: &Asked) -> Result<Bound<'py, PyDict>> {
        match *asked {
            Asked::Nobody => Ok(PyDict::new(py)),
            Asked::One(index) => info(py, &self.info_source(index)?),
            Asked::All => {
                let sources = (0..self.grounds.len()).map(|i| self.info_source(i));
                infos(py, &sources.collect::<Result<Vec<_>, _>>()?)
            }
        }
    }

    /// Keeps the ground of an episode that has begun.
    fn set_ground(&mut self, index: usize) -> Result<()> {
        self.grounds[index] = self.batch.origin(index)?.ground.clone();
        self.handed_out[index] = None;
        Ok(())
    }

    /// Indices of rovers; as many as `expected`, where that is known.
    fn indices(&self, given: &Bound<'_, PyAny>, expected: Option<usize>) -> Result<Vec<usize>> {
        let found: Option<Vec<Bound<'_, PyAny>>> = given.extract().ok();
        let found = found.filter(|found| expected.is_none_or(|n| n == found.len()));
        let what = match expected {
            Some(n) => format!("{n} indices of rovers"),
            None => "indices of rovers".to_owned(),
        };
        let found = found.ok_or_else(|| refused(given, Kind::Option, "indices", &what))?;
        found
            .iter()
            .map(|one| below(one, self.batch.rovers().len()))
            .collect()
    }
}

impl EpisodeBatch {
    /// Reads or changes something of one rover.
    fn one<T>(
        &self,
        index: &Bound<'_, PyAny>,
        act: impl FnOnce(&mut Inner, usize) -> Result<T>,
    ) -> Result<T> {
        let mut held = self.0.open()?;
        let index = below(index, held.batch.rovers().len())?;
        act(&mut held, index)
    }
}

/// The argument `among`: what links each rover of a batch with its grains.
fn links(given: &Bound<'_, PyAny>, batch: &CoreBatch) -> Result<Vec<Arc<Together>>> {
    let what = "a RoverGrainSimulation of each rover";
    let refuse = || refused(given, Kind::Option, "among", what);
    let found: Vec<Bound<'_, RoverGrainSimulation>> = given.extract().map_err(|_| refuse())?;
    let links: Vec<_> = found.iter().map(|one| one.get().together.clone()).collect();
    let rovers = batch.rovers();
    let fits = links.len() == rovers.len()
        && (links.iter().zip(rovers)).all(|(link, rover)| Arc::ptr_eq(&link.rover, rover));
    fits.then_some(links).ok_or_else(refuse)
}

/// Start and ground of an episode, as `EpisodeBatch.origin` returns them.
fn origin(given: &Bound<'_, PyAny>, ground: DrawnGround) -> Result<Began> {
    let what = "what `EpisodeBatch.origin` returns";
    let refuse = || refused(given, Kind::Option, "origin", what);
    let found: Option<OriginRows> = given.extract().ok();
    let (start, rocks, seed, _) = found.ok_or_else(refuse)?;
    let rocks = <[f64; 3]>::try_from(rocks).map_err(|_| refuse())?;
    if !start.iter().chain(&rocks).all(|x| x.is_finite()) {
        return Err(refuse());
    }
    let start = Start::from_row(&start).ok_or_else(refuse)?;
    Ok(Began {
        start,
        rocks: RockDraw::from_row(rocks, seed),
        ground,
    })
}

#[pymethods]
impl EpisodeBatch {
    #[new]
    #[pyo3(signature = (rules, simulation, n, *, max_steps = None, threads = None))]
    fn new(
        rules: GivenRules,
        simulation: GivenSimulation<'_>,
        n: &Bound<'_, PyAny>,
        max_steps: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self> {
        let n = at_least_one(n, Kind::Option, "n")?;
        let max_steps = max_steps.map(|given| whole(given, Kind::Option, "max_steps"));
        let (max_steps, threads) = (max_steps.transpose()?, arguments::threads(threads)?);
        let one = simulation.0.get();
        let batch = CoreBatch::new(rules.0, &*one.open()?, n, max_steps, threads)?;
        Ok(Self(Shared::new(Inner {
            batch,
            grounds: vec![one.ground().clone(); n],
            handed_out: (0..n).map(|_| None).collect(),
        })))
    }

    /// Number of threads.
    #[getter]
    fn threads(&self) -> Result<usize> {
        Ok(self.0.open()?.batch.threads())
    }

    /// Applies the actions of all rovers for one control period.
    ///
    /// Other Python threads run in the meantime. Ctrl-C, or another exception of a signal handler,
    /// ends the call after the current physics step of each rover. The rovers may then have taken
    /// different numbers of steps.
    ///
    /// Args:
    ///     actions: Torques, then steering, within [-1, 1], (n_rovers, n_actions).
    ///     active: Which rovers move, (n_rovers,); all by default. The others do not change.
    ///     has_scan: Whether to update the height scans. If False, they are updated only in
    ///         episodes that terminate or reach the time limit; the others keep the previous
    ///         heights.
    ///     among: A RoverGrainSimulation of each rover's `simulation`, if the rovers drive among
    ///         grains; they are then stepped one after the other.
    ///     info: Which infos to return: "all" as `infos`, an index as `info`; none by default.
    ///
    /// Returns:
    ///     Observations (n_rovers, size) float32, rewards (n_rovers,), which episodes are
    ///     terminated and which are truncated, (n_rovers,) each, and infos; an empty dictionary if
    ///     none are asked for. A rover that is not active keeps the values of its last period.
    ///
    /// Raises:
    ///     CommandError: The actions have a wrong shape or an entry that is not finite or outside
    ///         [-1, 1]. No rover has moved.
    ///     OptionError: `active`, `among` or `info` is invalid, or an episode has not begun. No
    ///         rover has moved.
    #[pyo3(signature = (actions, active = None, *, has_scan = true, among = None, info = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: &Bound<'_, PyAny>,
        active: Option<&Bound<'_, PyAny>>,
        has_scan: bool,
        among: Option<&Bound<'_, PyAny>>,
        info: Option<&Bound<'_, PyAny>>,
    ) -> Result<Step<'py>> {
        let mut held = self.0.open()?;
        let batch = &mut held.batch;
        let (n, size) = (batch.rovers().len(), batch.rules().size());
        let asked = Asked::parse(info, n)?;
        let given = self::actions(actions, &[n, batch.rules().n_actions()])?;
        let active = active.map(|given| mask(given, n)).transpose()?;
        let active = active.as_deref();
        let among = among.map(|given| links(given, batch)).transpose()?;
        let open = among
            .as_ref()
            .map(|links| links.iter().map(|link| link.open()).collect());
        let mut open: Option<Vec<_>> = open.transpose()?;
        let mut parts: Option<Vec<_>> = open.as_mut().map(|open| {
            let parts = open
                .iter_mut()
                .map(|(link, grains)| (&mut **link, &mut **grains));
            parts.collect()
        });
        let (mut rows, mut watch) = (vec![0.0; n * size], Watch::new());
        let out = &mut rows[..];
        let done = py.release(|| match &mut parts {
            None => batch.step_while(&given, active, has_scan, out, &mut || watch.go_on()),
            Some(parts) => batch.step_among(&given, active, has_scan, out, &mut |i, rover, n| {
                let (link, grains) = &mut parts[i];
                link.step(rover, grains, n, &mut || watch.go_on()).map(drop)
            }),
        })?;
        let BatchOutcome {
            rewards,
            ended,
            truncated,
            ..
        } = watch.result(done)?;
        Ok((
            Array::shaped(rows, &[n, size]),
            rewards.into(),
            ended.into(),
            truncated.into(),
            held.infos(py, &asked)?,
        ))
    }

    /// Sorted indices of the rovers whose episode is over and whose next has not begun.
    #[getter]
    fn over(&self) -> Result<Vec<usize>> {
        Ok(self.0.open()?.batch.over())
    }

    /// The infos of all rovers, each of its last control period or of its start.
    ///
    /// Returns:
    ///     For each entry an array (n_rovers,), and under its name with a leading underscore a mask
    ///     of the rovers that have the entry: all True.
    fn infos<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        self.0.open()?.infos(py, &Asked::All)
    }

    /// The info of one rover, of its last control period or of its start.
    ///
    /// Args:
    ///     index: Index of the rover.
    fn info<'py>(&self, index: &Bound<'py, PyAny>) -> Result<Bound<'py, PyDict>> {
        self.one(index, |held, i| held.infos(index.py(), &Asked::One(i)))
    }

    /// The last observations of all rovers, (n_rovers, size) float32; zeros before an episode.
    fn observations(&self) -> Result<Array<f32>> {
        let held = self.0.open()?;
        let (n, size) = (held.batch.rovers().len(), held.batch.rules().size());
        let mut rows = vec![0.0; n * size];
        for (i, row) in rows.chunks_exact_mut(size).enumerate() {
            if let Ok(episode) = held.batch.episode(i) {
                row.copy_from_slice(episode.observation());
            }
        }
        Ok(Array::shaped(rows, &[n, size]))
    }

    /// Draws one episode from each generator, on the threads of this batch.
    ///
    /// The rovers do not change. A scene is drawn again if the rover would penetrate the ground or
    /// a rock by more than 1 cm. The given generators do not change either:
    /// `DrawnEpisodes.generators` has their states after the draws.
    ///
    /// Args:
    ///     distribution: Distribution of the episodes.
    ///     generators: Generators, (m, 4) uint64.
    ///     attempts: Largest number of scenes drawn for each episode.
    ///     difficulties: For each generator, None or a range (low, high) of the rocks' difficulty
    ///         that replaces the distribution's; None by default.
    ///     fixed: Values that replace drawn ones, by name; the random numbers are drawn
    ///         nevertheless: `slope`, `uphill`, `position` (x, z), `heading`, `goal` (x, z),
    ///         `further` (n, 2) of the goals after it, `difficulty`, `field_seed`, `q`, `v`; one
    ///         mapping for all, or a list with one for each generator; none by default.
    ///
    /// Returns:
    ///     The episodes. They do not depend on the number of threads.
    ///
    /// Raises:
    ///     TerrainError: In all of the `attempts` scenes the rover penetrates the ground, or a
    ///         parameter of the ground is invalid.
    ///     StateError: `q` or `v` has a wrong length or an entry that is not finite, or float32
    ///         cannot hold the observation.
    ///     ModelError: A scaled mass is out of its range.
    ///     OptionError: Any other argument is invalid.
    #[pyo3(signature = (distribution, generators, **options),
        text_signature = "($self, distribution, generators, *, attempts=100, difficulties=None, fixed=None)")]
    fn draw(
        &self,
        distribution: &Bound<'_, PyAny>,
        generators: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<DrawnEpisodes> {
        let what = "an EpisodeDistribution";
        let of = object::<EpisodeDistribution>(distribution, Kind::Option, "distribution", what)?;
        let request = Request::parse(generators, options)?;
        let mut held = self.0.open()?;
        of.get().draw_on(generators.py(), &request, &mut held.batch)
    }

    /// Starts drawn episodes.
    ///
    /// Args:
    ///     indices: Indices of the rovers, one for each episode.
    ///     episodes: Drawn episodes with the rules of the batch.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or the episodes do not fit. Nothing has changed.
    fn begin(&self, indices: &Bound<'_, PyAny>, episodes: &Bound<'_, PyAny>) -> Result<()> {
        let what = "DrawnEpisodes";
        let drawn = object::<DrawnEpisodes>(episodes, Kind::Option, "episodes", what)?.get();
        let mut held = self.0.open()?;
        let places = held.indices(indices, Some(drawn.drawn.len()))?;
        for (&index, one) in places.iter().zip(&drawn.drawn) {
            held.batch.check(index, one)?;
        }
        for (&index, one) in places.iter().zip(&drawn.drawn) {
            held.batch.begin(index, one.clone())?;
            held.set_ground(index)?;
        }
        Ok(())
    }

    /// Replaces rovers by copies of a rover in the middle of its episode.
    ///
    /// With the `simulation`, `episode`, `origin`, `steps` and `generators` of one rover, the
    /// copies continue bit for bit.
    ///
    /// Args:
    ///     indices: Indices of the rovers to replace.
    ///     simulation: The rover.
    ///     episode: Its episode, with the rules of the batch.
    ///     origin: Start and ground of the episode, as returned by `origin`.
    ///     generator: Generator of the noise, (1, 4) uint64.
    ///     steps: Control periods since the episode began.
    ///     message: Message of the StepError, if one has ended the episode.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or an argument does not fit. Nothing has changed.
    #[pyo3(signature = (indices, simulation, episode, origin, **options),
        text_signature = "($self, indices, simulation, episode, origin, *, generator, steps=0, message=None)")]
    fn resume(
        &self,
        indices: &Bound<'_, PyAny>,
        simulation: GivenSimulation<'_>,
        episode: &Bound<'_, PyAny>,
        origin: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<()> {
        let one = simulation.0.get();
        let episode = object::<EpisodeRun>(episode, Kind::Option, "episode", "an EpisodeRun")?;
        let episode = episode.get().copy();
        let origin = self::origin(origin, one.ground().clone())?;
        let given = Named::keywords(indices.py(), options)?;
        let random = given.need("generator", |value, kind, field| {
            let rows = <[Pcg64; 1]>::try_from(generators(value)?);
            rows.map_err(|_| refused(value, kind, field, "one row"))
        });
        let [random] = random?;
        let steps = given.count("steps", 0)? as u64;
        let message = given.read("message", text)?;
        given.finish()?;
        let mut held = self.0.open()?;
        let places = held.indices(indices, None)?;
        let rover = one.open()?.clone();
        for index in places {
            let (rover, whole) = (rover.clone(), (episode.clone(), steps));
            let (began, failure) = (origin.clone(), message.clone());
            held.batch
                .resume(index, rover, whole, began, random, failure)?;
            held.grounds[index] = one.ground().clone();
            held.handed_out[index] = None;
        }
        Ok(())
    }

    /// A copy of the episode of one rover.
    ///
    /// Args:
    ///     index: Index of the rover.
    fn episode(&self, index: &Bound<'_, PyAny>) -> Result<EpisodeRun> {
        self.one(index, |held, i| {
            Ok(EpisodeRun::of(held.batch.episode(i)?.clone()))
        })
    }

    /// Control periods of one rover since its episode began.
    ///
    /// Args:
    ///     index: Index of the rover.
    fn steps(&self, index: &Bound<'_, PyAny>) -> Result<u64> {
        self.one(index, |held, i| Ok(held.batch.steps(i)?))
    }

    /// The random generators of rovers, from which noise and next episodes are drawn.
    ///
    /// Args:
    ///     indices: Indices of the rovers.
    ///
    /// Returns:
    ///     (m, 4) uint64: high and low half of each state, high and low half of each increment.
    fn generators(&self, indices: &Bound<'_, PyAny>) -> Result<Array<u64>> {
        let held = self.0.open()?;
        let places = held.indices(indices, None)?;
        let found = places.iter().map(|&index| held.batch.generator(index));
        let found: Vec<Pcg64> = found.collect::<Result<_, _>>()?;
        Ok(fresh_rows(
            found.iter().map(|random| random.state().halves()),
        ))
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
    ) -> Result<()> {
        let given = self::generators(generators)?;
        let mut held = self.0.open()?;
        let places = held.indices(indices, Some(given.len()))?;
        for &index in &places {
            held.batch.generator(index)?;
        }
        for (index, generator) in places.into_iter().zip(given) {
            held.batch.set_generator(index, generator)?;
        }
        Ok(())
    }

    /// Start and ground of a rover's episode.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Returns:
    ///     The start (5 + 2 n,), with n goals: slope, direction of steepest ascent, x and z,
    ///     heading, x and z of each goal, rad and m; the rocks (3,), zeros if there are none:
    ///     difficulty, abundance, radius of the largest rock in wheel radii; the seed of the rocks;
    ///     and mass scale, friction, actuator gain and gravity scale (4,).
    fn origin(&self, index: &Bound<'_, PyAny>) -> Result<(Array, Array, u64, Array)> {
        self.one(index, |held, i| {
            let (origin, episode) = (held.batch.origin(i)?, held.batch.episode(i)?);
            Ok((
                origin.start.row().into(),
                fresh(&RockDraw::row(origin.rocks)),
                origin.rocks.map_or(0, |rocks| rocks.seed),
                fresh(&episode.setting().domain.row()),
            ))
        })
    }

    /// The ground of one rover.
    ///
    /// Args:
    ///     index: Index of the rover.
    fn terrain<'py>(&self, index: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>> {
        self.one(index, |held, i| union::object(index.py(), &held.grounds[i]))
    }

    /// The simulation of one rover, which moves with it until its next episode begins.
    ///
    /// Args:
    ///     index: Index of the rover.
    fn simulation(&self, index: &Bound<'_, PyAny>) -> Result<Py<Simulation>> {
        let py = index.py();
        self.one(index, |held, i| {
            if let Some(known) = &held.handed_out[i] {
                return Ok(known.clone_ref(py));
            }
            let rover = held.batch.rovers()[i].clone();
            let made = Py::new(py, Simulation::shared(rover, held.grounds[i].clone())?)?;
            held.handed_out[i] = Some(made.clone_ref(py));
            Ok(made)
        })
    }

    /// Takes the heights that the last observation of one rover lacks, if it lacks any.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Returns:
    ///     The observation, (size,) float32.
    fn complete(&self, index: &Bound<'_, PyAny>) -> Result<Array<f32>> {
        self.one(index, |held, i| Ok(fresh(held.batch.complete(i)?)))
    }

    fn __len__(&self) -> Result<usize> {
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
