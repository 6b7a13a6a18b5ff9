//! `EpisodeDistribution` and `DrawnEpisodes`: the next episodes of rovers, drawn at random.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use rover_core::draw::{
    Domain, DomainDistribution, DrawnGround, Fixed, FixedStart, GroundDistribution,
    HillDistribution, Order, Pcg64, Range, RockDistribution, RockDraw, SandDistribution,
    SceneDistribution, Start, StartDistribution,
};
use rover_core::episode::{Beginning, EpisodeBatch, EpisodeDistribution as CoreDistribution};
use rover_core::geometry::Plane as CorePlane;
use rover_core::simulation::RoverSimulation;

use crate::arguments::{Given, count, number, refused, whole};
use crate::arrays::{fresh_table, two, vector};
use crate::episode::{self, EpisodeRun};
use crate::errors::{BorderError, Kind};
use crate::generators::{generators, halves};
use crate::options::SolverWords;
use crate::plane::Plane;
use crate::reading::points;
use crate::shared::Watch;
use crate::simulation::{Origin, Simulation};
use crate::{terrain, union};

/// Positional and keyword arguments.
type NewArguments<'py> = ((Bound<'py, PyAny>, Bound<'py, PyAny>), Bound<'py, PyDict>);

/// What the episodes of a task are drawn from.
///
/// Draws come from generators that are number for number NumPy's `PCG64`; a generator is given and
/// returned as four unsigned 64-bit numbers: high and low half of its state, high and low half of
/// its increment.
///
/// Args:
///     rules: What all episodes share; rocks leave the goal clear within its tolerance.
///     simulation: The rover, before its masses are scaled, and the options of its steps.
///     start: Ranges (low, high) of `slope`, `uphill`, `heading`, `goal_distance`, `goal_bearing`
///         and `turn`, by name, rad and m. A goal after the first lies at a distance from
///         `goal_distance` from the one before it, in the direction of the last leg turned by
///         `turn`.
///     domain: Ranges of `mass_scale`, `friction`, `actuator_gain` and `gravity_scale`, by name.
///     trunk_load_limit: Force on the trunk beyond which the rover is high-centred, before masses
///         and gravity are scaled, N.
///     rocks: Range of `difficulty`, and `abundance` and `max_radius` or None, by name; None for no
///         rocks.
///     slope_by_difficulty: Whether the slope follows from the difficulty of the rocks.
///     ground: The ground of every episode, a terrain of any kind; None for a tilted plane.
///     hills: Fractal ground: root mean square of its slope, rise over run, or nan for one that
///         follows from the difficulty of the rocks; None for none. Not together with `ground`.
///     sand: Soft grounds, one of which is drawn, on a tilted plane with ripples by the difficulty
///         of the rocks; their surfaces do not count; None for none. Not together with the two
///         others.
///
/// Raises:
///     OptionError: An argument is missing, no number, or out of its range.
///     TerrainError: `ground` is no terrain.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct EpisodeDistribution {
    pub inner: CoreDistribution,
    pub words: SolverWords,
    /// What it was made with, for pickling.
    given: (Py<PyAny>, Py<PyAny>, Py<PyDict>),
}

/// Drawn episodes, in the order of the generators.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct DrawnEpisodes {
    pub drawn: Vec<Beginning>,
    pub words: SolverWords,
}

/// A range (low, high).
pub fn range(value: &Bound<'_, PyAny>, field: &str) -> PyResult<Range> {
    let found = vector(value, Kind::Option, field)?;
    match found[..] {
        [low, high] if low.is_finite() && high.is_finite() && low <= high => Ok([low, high]),
        _ => Err(refused(
            value,
            Kind::Option,
            field,
            "a pair (low, high), low <= high",
        )
        .into()),
    }
}

/// A mapping that was given by name.
struct Named<'a, 'py> {
    given: &'a Bound<'py, PyMapping>,
    field: &'static str,
}

impl<'a, 'py> Named<'a, 'py> {
    fn of(given: &'a Bound<'py, PyAny>, field: &'static str) -> PyResult<Self> {
        let found = given.cast::<PyMapping>();
        let given = found.map_err(|_| refused(given, Kind::Option, field, "a mapping"))?;
        Ok(Self { given, field })
    }

    /// What has a name, if it is there and not None.
    fn some(&self, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        if !self.given.contains(name)? {
            return Ok(None);
        }
        Ok(Some(self.given.get_item(name)?).filter(|value| !value.is_none()))
    }

    fn path(&self, name: &str) -> String {
        format!("{}.{name}", self.field)
    }

    fn number(&self, name: &str) -> PyResult<Option<f64>> {
        let found = self.some(name)?;
        let read = |value: Bound<'py, PyAny>| number(&value, Kind::Option, &self.path(name));
        found.map(read).transpose()
    }

    fn point(&self, name: &str) -> PyResult<Option<[f64; 2]>> {
        let read = |value: Bound<'py, PyAny>| two(&value, Kind::Option, &self.path(name));
        self.some(name)?.map(read).transpose()
    }

    fn range(&self, name: &str) -> PyResult<Range> {
        if let Some(value) = self.some(name)? {
            return range(&value, &self.path(name));
        }
        let what = format!("a mapping with the range {name:?}");
        Err(refused(self.given.as_any(), Kind::Option, self.field, &what).into())
    }
}

/// What replaces draws, by name.
fn fixed(given: &Bound<'_, PyAny>) -> PyResult<Fixed> {
    let named = Named::of(given, "fixed")?;
    let read = |name, field| {
        let found: Option<Bound<'_, PyAny>> = named.some(name)?;
        found
            .map(|value| vector(&value, Kind::State, field))
            .transpose()
    };
    let v = read("v", "v")?;
    Ok(Fixed {
        start: FixedStart {
            slope: named.number("slope")?,
            uphill: named.number("uphill")?,
            position: named.point("position")?,
            heading: named.number("heading")?,
            goal: named.point("goal")?,
            further: (named.some("further")?).map_or(Ok(Vec::new()), |given| {
                points(&given, &named.path("further"))
            })?,
        },
        difficulty: named.number("difficulty")?,
        field_seed: (named.some("field_seed")?)
            .map(|given| whole(&given, Kind::Option, &named.path("field_seed")))
            .transpose()?,
        state: read("q", "q")?.map(|q| (q, v)),
    })
}

/// A list with one entry for each of `n` generators.
fn list<'py>(given: &Bound<'py, PyAny>, n: usize, field: &str) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let fits = given.len().is_ok_and(|length| length == n);
    let found = fits.then(|| given.extract::<Vec<Bound<'py, PyAny>>>().ok());
    let found = found.flatten();
    found.ok_or_else(|| refused(given, Kind::Option, field, &format!("a list of {n}")).into())
}

/// How many scenes are drawn at most, and what replaces draws.
pub struct Request {
    randoms: Vec<Pcg64>,
    difficulties: Vec<Option<Range>>,
    fixed: Vec<Fixed>,
    attempts: usize,
}

impl Request {
    pub fn parse(
        generators: &Bound<'_, PyAny>,
        attempts: Given<'_>,
        difficulties: Option<&Bound<'_, PyAny>>,
        fixed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let randoms = self::generators(generators)?;
        let n = randoms.len();
        let attempts = attempts.count(100, Kind::Option, "attempts")?;
        let read = |(i, one): (usize, &Bound<'_, PyAny>)| {
            let given = Some(one).filter(|one| !one.is_none());
            let field = format!("difficulties[{i}]");
            given.map(|one| range(one, &field)).transpose()
        };
        let difficulties = match difficulties {
            None => vec![None; n],
            Some(given) => {
                let entries = list(given, n, "difficulties")?;
                let read = entries.iter().enumerate().map(read);
                read.collect::<PyResult<_>>()?
            }
        };
        let fixed = match fixed {
            None => vec![Fixed::default()],
            Some(given) if given.cast::<PyMapping>().is_ok() => vec![self::fixed(given)?],
            Some(given) => {
                let entries = list(given, n, "fixed")?;
                entries.iter().map(self::fixed).collect::<PyResult<_>>()?
            }
        };
        Ok(Self {
            randoms,
            difficulties,
            fixed,
            attempts,
        })
    }
}

impl EpisodeDistribution {
    /// Draws with the interpreter free for others, on the threads of a batch where one is given.
    pub fn draw_on(
        &self,
        py: Python<'_>,
        request: &Request,
        batch: Option<&mut EpisodeBatch>,
    ) -> PyResult<DrawnEpisodes> {
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
        let drawn = py.detach(|| {
            let go_on = &mut || watch.go_on();
            match batch {
                Some(batch) => batch.draw(&self.inner, &orders, request.attempts, go_on),
                None => self.inner.draw(&orders, request.attempts, None, go_on),
            }
        });
        Ok(DrawnEpisodes {
            drawn: watch.result(drawn)?.unwrap_or_default(),
            words: self.words.clone(),
        })
    }
}

#[pymethods]
impl EpisodeDistribution {
    #[new]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python class
    #[pyo3(signature = (rules, simulation, *, start, domain, trunk_load_limit, rocks = None, slope_by_difficulty = Given::MISSING,
        ground = None, hills = None, sand = None),
        text_signature = "(rules, simulation, *, start, domain, trunk_load_limit, rocks=None, slope_by_difficulty=False, ground=None, hills=None, sand=None)")]
    fn new(
        rules: &Bound<'_, PyAny>,
        simulation: &Bound<'_, PyAny>,
        start: &Bound<'_, PyAny>,
        domain: &Bound<'_, PyAny>,
        trunk_load_limit: &Bound<'_, PyAny>,
        rocks: Option<&Bound<'_, PyAny>>,
        slope_by_difficulty: Given<'_>,
        ground: Option<&Bound<'_, PyAny>>,
        hills: Option<&Bound<'_, PyAny>>,
        sand: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let slope_by_difficulty =
            slope_by_difficulty.flag(false, Kind::Option, "slope_by_difficulty")?;
        let given = PyDict::new(simulation.py());
        for (name, value) in [
            ("start", Some(start)),
            ("domain", Some(domain)),
            ("trunk_load_limit", Some(trunk_load_limit)),
            ("rocks", rocks),
            ("ground", ground),
            ("hills", hills),
            ("sand", sand),
        ] {
            given.set_item(name, value)?;
        }
        given.set_item("slope_by_difficulty", slope_by_difficulty)?;
        let given = (
            rules.clone().unbind(),
            simulation.clone().unbind(),
            given.unbind(),
        );

        let rules = episode::rules(rules)?;
        let made = episode::simulation(simulation, "simulation")?.get();
        let rover = made.open()?;
        let ground = match sand {
            Some(sand) => sand_distribution(sand, &[("ground", ground), ("hills", hills)])?,
            None => ground_distribution(ground, hills)?,
        };
        let (start, domain) = (Named::of(start, "start")?, Named::of(domain, "domain")?);
        let scenes = SceneDistribution {
            rover: rover.scene().clone(),
            options: rover.options().clone(),
            ground,
            rocks: rocks.map(rock_distribution).transpose()?,
            slope_by_difficulty,
            start: StartDistribution {
                slope: start.range("slope")?,
                uphill: start.range("uphill")?,
                heading: start.range("heading")?,
                goal_distance: start.range("goal_distance")?,
                goal_bearing: start.range("goal_bearing")?,
                further: rules.settings().goals - 1,
                turn: start.range("turn")?,
            },
            domain: DomainDistribution {
                mass_scale: domain.range("mass_scale")?,
                friction: domain.range("friction")?,
                actuator_gain: domain.range("actuator_gain")?,
                gravity_scale: domain.range("gravity_scale")?,
            },
            goal_tolerance: rules.settings().goal_tolerance,
        };
        Ok(Self {
            inner: CoreDistribution {
                scenes,
                rules,
                trunk_load_limit: number(trunk_load_limit, Kind::Option, "trunk_load_limit")?,
            },
            words: made.origin().words.clone(),
            given,
        })
    }

    /// Draws one episode from each generator; `EpisodeBatch.draw` does it on several threads.
    ///
    /// A scene in which the rover would stand deeper than 1 cm in the ground or in a sphere is
    /// drawn again. The given generators do not change: see `DrawnEpisodes.generators`.
    ///
    /// Args:
    ///     generators: Generators, (m, 4) uint64.
    ///     attempts: Most scenes drawn for a rover until it has room.
    ///     difficulties: For each generator a range (low, high) that replaces that of the rocks'
    ///         difficulty, or None; by default none.
    ///     fixed: Values that replace draws, which are made all the same, by name: `slope`,
    ///         `uphill`, `position` (x, z), `heading`, `goal` (x, z), `further` (n, 2) of the goals
    ///         after it, `difficulty`, `field_seed`, `q`, `v`; one mapping for all or a list of one
    ///         for each generator; none by default.
    ///
    /// Returns:
    ///     The episodes.
    ///
    /// Raises:
    ///     TerrainError: A rover has no room in `attempts` scenes, or the ground refuses a number.
    ///     StateError: `q` or `v` has a wrong length or an entry that is not finite, or float32
    ///         cannot hold the observation.
    ///     ModelError: A scaled mass is out of its range.
    ///     OptionError: Any other argument is invalid.
    #[pyo3(signature = (generators, *, attempts = Given::MISSING, difficulties = None, fixed = None),
        text_signature = "($self, generators, *, attempts=100, difficulties=None, fixed=None)")]
    fn draw(
        &self,
        py: Python<'_>,
        generators: &Bound<'_, PyAny>,
        attempts: Given<'_>,
        difficulties: Option<&Bound<'_, PyAny>>,
        fixed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<DrawnEpisodes> {
        let request = Request::parse(generators, attempts, difficulties, fixed)?;
        self.draw_on(py, &request, None)
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> NewArguments<'py> {
        let (rules, simulation, given) = &self.given;
        let first = (rules.bind(py).clone(), simulation.bind(py).clone());
        (first, given.bind(py).clone())
    }
}

/// The ground of episodes.
fn ground_distribution(
    ground: Option<&Bound<'_, PyAny>>,
    hills: Option<&Bound<'_, PyAny>>,
) -> PyResult<GroundDistribution> {
    match (ground, hills) {
        (None, None) => Ok(GroundDistribution::Tilted),
        (Some(ground), None) => Ok(GroundDistribution::Given(terrain::parse(ground)?)),
        (None, Some(hills)) => {
            let what = "a number from 0 to 10, or nan";
            let wrong = || refused(hills, Kind::Option, "hills", what);
            let slope: f64 = hills.extract().map_err(|_| wrong())?;
            if !(slope.is_nan() || (0.0..=10.0).contains(&slope)) {
                return Err(wrong().into());
            }
            Ok(GroundDistribution::Hills(HillDistribution {
                rms_slope: Some(slope).filter(|slope| !slope.is_nan()),
            }))
        }
        (Some(_), Some(hills)) => {
            Err(refused(hills, Kind::Option, "hills", "None beside a ground").into())
        }
    }
}

/// Sand of episodes: a list of soft grounds, whose surfaces do not count.
fn sand_distribution(
    sand: &Bound<'_, PyAny>,
    others: &[(&str, Option<&Bound<'_, PyAny>>)],
) -> PyResult<GroundDistribution> {
    for (name, other) in others {
        if let Some(other) = other {
            return Err(refused(other, Kind::Option, name, "None beside sand").into());
        }
    }
    let wrong = || {
        refused(
            sand,
            Kind::Option,
            "sand",
            "a list of one or more SoftGround",
        )
    };
    let mut soils = Vec::new();
    for one in sand.try_iter().map_err(|_| wrong())? {
        match terrain::parse(&one?)? {
            DrawnGround::Soft(soft, _) => soils.push(soft),
            _ => return Err(wrong().into()),
        }
    }
    if soils.is_empty() {
        return Err(wrong().into());
    }
    Ok(GroundDistribution::Sand(SandDistribution { soils }))
}

fn rock_distribution(given: &Bound<'_, PyAny>) -> PyResult<RockDistribution> {
    let named = Named::of(given, "rocks")?;
    Ok(RockDistribution {
        difficulty: named.range("difficulty")?,
        abundance: named.number("abundance")?,
        max_radius: named.number("max_radius")?,
    })
}

impl DrawnEpisodes {
    fn at(&self, index: &Bound<'_, PyAny>) -> PyResult<&Beginning> {
        let i = count(index, Kind::Option, "index")?;
        let len = self.drawn.len();
        let found = self.drawn.get(i);
        found.ok_or_else(|| refused(index, Kind::Option, "index", &format!("below {len}")).into())
    }
}

/// A row of `DrawnEpisodes.starts`.
pub fn start_row(start: &Start) -> Vec<f64> {
    let [x, z] = start.position;
    let pose = [start.slope, start.uphill, x, z, start.heading];
    pose.into_iter().chain(start.goals().flatten()).collect()
}

/// What a row of `DrawnEpisodes.starts` tells; None if it has another length.
pub fn start_of(row: &[f64]) -> Option<Start> {
    let (&[slope, uphill, x, z, heading, goal_x, goal_z], rest) = row.split_first_chunk()?;
    let (further, []) = rest.as_chunks() else {
        return None;
    };
    Some(Start {
        slope,
        uphill,
        position: [x, z],
        heading,
        goal: [goal_x, goal_z],
        further: further.to_vec(),
    })
}

/// A row of `DrawnEpisodes.domains`.
pub fn domain_row(domain: &Domain) -> [f64; 4] {
    let (mass, gravity) = (domain.mass_scale, domain.gravity_scale);
    [mass, domain.friction, domain.actuator_gain, gravity]
}

/// A row of `DrawnEpisodes.rocks`.
pub fn rocks_row(rocks: Option<RockDraw>) -> [f64; 3] {
    rocks.map_or([0.0; 3], |r| [r.difficulty, r.abundance, r.max_radius])
}

/// What a row of `DrawnEpisodes.rocks` tells; None for that of no rocks.
pub fn rocks_of([difficulty, abundance, max_radius]: [f64; 3], seed: u64) -> Option<RockDraw> {
    (max_radius > 0.0).then_some(RockDraw {
        difficulty,
        abundance,
        max_radius,
        seed,
    })
}

#[pymethods]
impl DrawnEpisodes {
    /// The generators after the draws, (m, 4) uint64.
    #[getter]
    fn generators<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u64>>> {
        fresh_table(py, self.drawn.iter().map(|one| halves(&one.random)))
    }

    /// First observations, (m, size) float32.
    #[getter]
    fn observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let size = (self.drawn.first()).map_or(0, |one| one.episode.observation().len());
        let entries = self.drawn.iter().flat_map(|one| one.episode.observation());
        PyArray1::from_iter(py, entries.copied()).reshape([self.drawn.len(), size])
    }

    /// Starts, (m, 5 + 2 n) with n goals, rad and m.
    ///
    /// Slope, direction of steepest ascent, x and z of the start, heading, x and z of each goal.
    #[getter]
    fn starts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows: Vec<_> = self
            .drawn
            .iter()
            .map(|one| start_row(&one.scene.start))
            .collect();
        let width = rows.first().map_or(0, Vec::len);
        PyArray1::from_iter(py, rows.into_iter().flatten()).reshape([self.drawn.len(), width])
    }

    /// Properties of rover and world, (m, 4).
    ///
    /// Factor of the masses, friction, gain of the motors, factor of gravity.
    #[getter]
    fn domains<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let row = |one: &Beginning| domain_row(&one.scene.domain);
        fresh_table(py, self.drawn.iter().map(row))
    }

    /// Rocks, (m, 3); zeros where there are none.
    ///
    /// Difficulty, abundance, radius of the largest in wheel radii.
    #[getter]
    fn rocks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let row = |one: &Beginning| rocks_row(one.scene.rocks);
        fresh_table(py, self.drawn.iter().map(row))
    }

    /// Seeds of the rocks, (m,) uint64; zeros where there are none.
    #[getter]
    fn rock_seeds<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        let seed = |one: &Beginning| one.scene.rocks.map_or(0, |rocks| rocks.seed);
        PyArray1::from_iter(py, self.drawn.iter().map(seed))
    }

    /// An episode, which has begun.
    ///
    /// Args:
    ///     index: Number of the episode.
    ///
    /// Raises:
    ///     OptionError: There is no such episode.
    fn episode(&self, index: &Bound<'_, PyAny>) -> PyResult<EpisodeRun> {
        Ok(EpisodeRun::of(self.at(index)?.episode.clone()))
    }

    /// The ground of an episode.
    ///
    /// Args:
    ///     index: Number of the episode.
    ///
    /// Raises:
    ///     OptionError: There is no such episode.
    fn terrain<'py>(
        &self,
        py: Python<'py>,
        index: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        union::object(py, &self.at(index)?.scene.ground)
    }

    /// The plane of an episode, under rocks too; None where the ground has none.
    ///
    /// Args:
    ///     index: Number of the episode.
    ///
    /// Raises:
    ///     OptionError: There is no such episode.
    fn plane<'py>(&self, index: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, Plane>>> {
        let terrain = &self.at(index)?.scene.placement.scene.terrain;
        let plane = |plane: &CorePlane| Bound::new(index.py(), Plane::of(*plane));
        terrain.ground().map(plane).transpose()
    }

    /// A new simulation of the rover at the start of an episode.
    ///
    /// Args:
    ///     index: Number of the episode.
    ///
    /// Raises:
    ///     OptionError: There is no such episode.
    fn simulation(&self, index: &Bound<'_, PyAny>) -> PyResult<Simulation> {
        let one = self.at(index)?;
        let made = RoverSimulation::placed(one.scene.placement.clone());
        let made = made.map_err(BorderError::from)?;
        let origin = Origin {
            terrain: one.scene.ground.clone(),
            words: self.words.clone(),
        };
        Ok(Simulation::of(made, origin))
    }

    fn __len__(&self) -> usize {
        self.drawn.len()
    }
}
