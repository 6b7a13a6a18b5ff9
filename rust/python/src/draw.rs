//! `EpisodeDistribution` and `DrawnEpisodes`: the next episodes of rovers, drawn at random.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use rover_core::simulation::RoverSimulation;
use rover_task::draw::{
    DomainDistribution, DrawnGround, FixedDraws, FixedStart, GroundDistribution, HillDistribution,
    Interval, Order, Pcg64, RockDistribution, SandDistribution, SceneDistribution,
    StartDistribution,
};
use rover_task::episode::{Beginning, EpisodeBatch, EpisodeDistribution as CoreDistribution};

use crate::arguments::{Named, below, number, refused, whole};
use crate::arrays::{Array, fresh_rows, two, vector};
use crate::episode::{GivenRules, GivenSimulation};
use crate::errors::{Kind, Result};
use crate::generators::generators;
use crate::reading::points;
use crate::shared::{Release, Watch};
use crate::simulation::Simulation;
use crate::terrain::{self, Terrain};

/// Distribution of the episodes of a task.
///
/// Random generators give the same numbers as NumPy's `PCG64`. A generator is four unsigned 64-bit
/// numbers: high and low half of its state, high and low half of its increment.
///
/// Args:
///     rules: What all episodes share; rocks keep the goal's tolerance free.
///     simulation: A rover with unscaled masses, which also sets the options of the time stepping.
///     start: Ranges (low, high) of `slope`, `uphill`, `heading`, `goal_distance`, `goal_bearing`
///         and `turn`, by name, rad and m. Each further goal lies at a distance drawn from
///         `goal_distance` from the previous goal, in the direction of the last leg, turned by
///         `turn`.
///     domain: Ranges of `mass_scale`, `friction`, `actuator_gain` and `gravity_scale`, by name.
///     trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N, before
///         scaling by masses and gravity.
///     rocks: A mapping with the range of `difficulty`, and `abundance` and `max_radius`, each of
///         which may be None; None for no rocks.
///     slope_by_difficulty: Whether the difficulty of the rocks determines the slope.
///     ground: A terrain for all episodes; None for a tilted plane.
///     hills: Root mean square slope of fractal ground, rise over run, or NaN if the difficulty of
///         the rocks determines it; None for no fractal ground. Not together with `ground`.
///     sand: Soft grounds from which the soil of each episode is drawn; None for rigid ground. The
///         surface is a tilted plane with ripples that grow with the difficulty of the rocks; the
///         surfaces of the given grounds are not used. Not together with `ground` or `hills`.
///
/// Raises:
///     OptionError: An argument is missing, not a number, or out of range.
///     TerrainError: `ground` is not a terrain.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct EpisodeDistribution {
    pub inner: CoreDistribution,
    /// Constructor arguments, for pickling.
    given: ((GivenRules, Py<Simulation>), Py<PyDict>),
}

/// Drawn episodes, in the order of the generators.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct DrawnEpisodes {
    pub drawn: Vec<Beginning>,
}

/// A range (low, high).
pub fn range(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Interval> {
    match vector(value, kind, field)?[..] {
        [low, high] if low.is_finite() && high.is_finite() && low <= high => Ok([low, high]),
        _ => Err(refused(
            value,
            kind,
            field,
            "a pair (low, high), low <= high",
        )),
    }
}

/// What replaces draws, by name.
fn fixed(given: &Bound<'_, PyAny>) -> Result<FixedDraws> {
    let named = Named::mapping(given, "fixed", Kind::Option)?;
    let state = |name: &str| -> Result<Option<Vec<f64>>> {
        named
            .some(name)?
            .map(|value| vector(&value, Kind::State, name))
            .transpose()
    };
    let further = |value: &Bound<'_, PyAny>, _, field: &str| points(value, field);
    let v = state("v")?;
    Ok(FixedDraws {
        start: FixedStart {
            slope: named.maybe("slope")?,
            uphill: named.maybe("uphill")?,
            position: named.read("position", two)?,
            heading: named.maybe("heading")?,
            goal: named.read("goal", two)?,
            further: named.read("further", further)?.unwrap_or_default(),
        },
        difficulty: named.maybe("difficulty")?,
        field_seed: named.read("field_seed", whole)?,
        state: state("q")?.map(|q| (q, v)),
    })
}

/// A list with one entry for each of `n` generators.
fn list<'py>(given: &Bound<'py, PyAny>, n: usize, field: &str) -> Result<Vec<Bound<'py, PyAny>>> {
    let fits = given.len().is_ok_and(|length| length == n);
    let found = fits.then(|| given.extract().ok()).flatten();
    found.ok_or_else(|| refused(given, Kind::Option, field, &format!("a list of {n}")))
}

/// Largest number of scenes drawn, and values that replace drawn ones.
pub struct Request {
    randoms: Vec<Pcg64>,
    difficulties: Vec<Option<Interval>>,
    fixed: Vec<FixedDraws>,
    attempts: usize,
}

impl Request {
    pub fn parse(
        generators: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Self> {
        let given = Named::keywords(generators.py(), options)?;
        let randoms = self::generators(generators)?;
        let n = randoms.len();
        let attempts = given.count("attempts", 100)?;
        let one = |(i, one): (usize, &Bound<'_, PyAny>)| {
            let given = Some(one).filter(|one| !one.is_none());
            given
                .map(|one| range(one, Kind::Option, &format!("difficulties[{i}]")))
                .transpose()
        };
        let difficulties = match given.some("difficulties")? {
            None => vec![None; n],
            Some(given) => {
                let entries = list(&given, n, "difficulties")?;
                entries.iter().enumerate().map(one).collect::<Result<_>>()?
            }
        };
        let fixed = match given.some("fixed")? {
            None => vec![FixedDraws::default()],
            Some(given) if given.cast::<PyMapping>().is_ok() => vec![fixed(&given)?],
            Some(given) => list(&given, n, "fixed")?
                .iter()
                .map(fixed)
                .collect::<Result<_>>()?,
        };
        given.finish()?;
        Ok(Self {
            randoms,
            difficulties,
            fixed,
            attempts,
        })
    }
}

impl EpisodeDistribution {
    /// Draws on the threads of a batch, with the interpreter free for others.
    pub fn draw_on(
        &self,
        py: Python<'_>,
        request: &Request,
        batch: &mut EpisodeBatch,
    ) -> Result<DrawnEpisodes> {
        let places = request.randoms.iter().zip(&request.difficulties);
        let orders: Vec<Order<'_>> = places
            .enumerate()
            .map(|(i, (random, difficulty))| Order {
                random: *random,
                difficulty: *difficulty,
                // One entry stands for all.
                fixed: request.fixed.get(i).unwrap_or(&request.fixed[0]),
            })
            .collect();
        let mut watch = Watch::new();
        let drawn = py.release(|| {
            batch.draw(&self.inner, &orders, request.attempts, &mut || {
                watch.go_on()
            })
        })?;
        Ok(DrawnEpisodes {
            drawn: watch.result(drawn)?.unwrap_or_default(),
        })
    }
}

#[pymethods]
impl EpisodeDistribution {
    #[new]
    #[pyo3(signature = (rules, simulation, **options),
        text_signature = "(rules, simulation, *, start, domain, trunk_load_limit, rocks=None, slope_by_difficulty=False, ground=None, hills=None, sand=None)")]
    fn new(
        rules: GivenRules,
        simulation: GivenSimulation<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Self> {
        let simulation = simulation.0;
        let py = simulation.py();
        let kept = options
            .map_or_else(|| Ok(PyDict::new(py)), pyo3::types::PyDictMethods::copy)?
            .unbind();
        let kept = ((rules.clone(), simulation.clone().unbind()), kept);
        let given = Named::keywords(py, options)?;
        let start = given.need("start", |v, k, _| Named::mapping(v, "start", k))?;
        let domain = given.need("domain", |v, k, _| Named::mapping(v, "domain", k))?;
        let (made, rules) = (simulation.get(), rules.0);
        let rover = made.open()?;
        let scenes = SceneDistribution {
            rover: rover.scene().clone(),
            options: rover.options().clone(),
            ground: ground_distribution(&given)?,
            rocks: given
                .some("rocks")?
                .as_ref()
                .map(rock_distribution)
                .transpose()?,
            slope_by_difficulty: given.flag("slope_by_difficulty", false)?,
            start: StartDistribution {
                slope: start.need("slope", range)?,
                uphill: start.need("uphill", range)?,
                heading: start.need("heading", range)?,
                goal_distance: start.need("goal_distance", range)?,
                goal_bearing: start.need("goal_bearing", range)?,
                further: rules.settings().goals - 1,
                turn: start.need("turn", range)?,
            },
            domain: DomainDistribution {
                mass_scale: domain.need("mass_scale", range)?,
                friction: domain.need("friction", range)?,
                actuator_gain: domain.need("actuator_gain", range)?,
                gravity_scale: domain.need("gravity_scale", range)?,
            },
            goal_tolerance: rules.settings().goal_tolerance,
        };
        let trunk_load_limit = given.need("trunk_load_limit", number)?;
        given.finish()?;
        Ok(Self {
            inner: CoreDistribution {
                scenes,
                rules,
                trunk_load_limit,
            },
            given: kept,
        })
    }

    fn __getnewargs_ex__(&self, py: Python<'_>) -> ((GivenRules, Py<Simulation>), Py<PyDict>) {
        let ((rules, simulation), options) = &self.given;
        (
            (rules.clone(), simulation.clone_ref(py)),
            options.clone_ref(py),
        )
    }
}

/// Sand of episodes: a list of soft grounds, whose surfaces do not count.
fn sand_distribution(sand: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<SandDistribution> {
    let wrong = || refused(sand, kind, field, "a list of one or more SoftGround");
    let mut soils = Vec::new();
    for one in sand.try_iter().map_err(|_| wrong())? {
        match one?.cast::<Terrain>().map(|one| one.get().ground.clone()) {
            Ok(DrawnGround::Soft(soft, _)) => soils.push(soft),
            _ => return Err(wrong()),
        }
    }
    if soils.is_empty() {
        return Err(wrong());
    }
    Ok(SandDistribution { soils })
}

/// The ground of episodes.
fn ground_distribution(given: &Named<'_>) -> Result<GroundDistribution> {
    let (ground, hills) = (given.some("ground")?, given.some("hills")?);
    if let Some(sand) = given.read("sand", sand_distribution)? {
        for (name, other) in [("ground", &ground), ("hills", &hills)] {
            if let Some(other) = other {
                return Err(given.refused(other, name, "None if sand is given"));
            }
        }
        return Ok(GroundDistribution::Sand(sand));
    }
    match (ground, hills) {
        (None, None) => Ok(GroundDistribution::Tilted),
        (Some(ground), None) => Ok(GroundDistribution::Given(terrain::parse(&ground)?)),
        (None, Some(hills)) => match hills.extract::<f64>() {
            Ok(slope) if slope.is_nan() || (0.0..=10.0).contains(&slope) => {
                let rms_slope = Some(slope).filter(|slope| !slope.is_nan());
                Ok(GroundDistribution::Hills(HillDistribution { rms_slope }))
            }
            _ => Err(given.refused(&hills, "hills", "a number from 0 to 10, or nan")),
        },
        (Some(_), Some(hills)) => Err(given.refused(&hills, "hills", "None if a ground is given")),
    }
}

fn rock_distribution(given: &Bound<'_, PyAny>) -> Result<RockDistribution> {
    let named = Named::mapping(given, "rocks", Kind::Option)?;
    Ok(RockDistribution {
        difficulty: named.need("difficulty", range)?,
        abundance: named.maybe("abundance")?,
        max_radius: named.maybe("max_radius")?,
    })
}

impl DrawnEpisodes {
    fn at(&self, index: &Bound<'_, PyAny>) -> Result<&Beginning> {
        Ok(&self.drawn[below(index, self.drawn.len())?])
    }
}

#[pymethods]
impl DrawnEpisodes {
    /// States of the generators after the draws, (m, 4) uint64.
    #[getter]
    fn generators(&self) -> Array<u64> {
        fresh_rows(self.drawn.iter().map(|one| one.random.state().halves()))
    }

    /// A new simulation of the rover at the start of an episode.
    ///
    /// Args:
    ///     index: Number of the episode.
    ///
    /// Raises:
    ///     OptionError: There is no such episode.
    fn simulation(&self, index: &Bound<'_, PyAny>) -> Result<Py<Simulation>> {
        let one = self.at(index)?;
        let made = RoverSimulation::placed(one.scene.placement.clone())?;
        let made = Simulation::of(made, one.scene.ground.clone());
        Ok(Py::new(index.py(), made)?)
    }

    fn __len__(&self) -> usize {
        self.drawn.len()
    }
}
