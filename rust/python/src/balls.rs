//! `GrainSimulation`, `ball_packing` and `arrange_balls`: grains in space.

use std::sync::{Arc, MutexGuard};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::geometry::{Support, TerrainSupport};
use rover_core::nalgebra::Vector3;
use rover_core::simulation::GrainSimulation as CoreSimulation;
use rover_core::spatial::space::body_velocities;
use rover_core::system::grains::{COORDINATES, Packing, Wall, arranged};
use rover_task::draw::DrawnGround;

use crate::arguments::{Named, count, each, number, refused};
use crate::arrays::{Array, vector};
use crate::bed_arguments::{self, Described, Packed, packed, rows};
use crate::bed_options::ball_options;
use crate::beds::{BedSimulation, SharedBed, columns};
use crate::errors::{Kind, Result, Value};
use crate::planar_ground::quantity;
use crate::shared::{Open, Release};
use crate::terrain::parse;
use crate::union;
use crate::vessels::{Drum, Silo, Vessel};

type Core = CoreSimulation<3>;

/// Velocities of a ball: of its centre, then its spin.
const VELOCITIES: usize = body_velocities(3);

/// Grains in space: free balls with friction, contained by walls or a vessel, or on a terrain.
///
/// World axes: x forward, y up, z to the right.
///
/// Args:
///     radius: Radii of the balls, (n,), m.
///     mass: Masses of the balls, which are homogeneous, (n,), kg.
///     position: Centres, (n, 3), m.
///     kinematic: Which balls have a prescribed velocity, (n,); none by default. Use it for grains
///         glued to a rough floor, or for a piston with the velocity given to `set_state`. These
///         balls may overlap each other and walls.
///     walls: A point of each wall and the normal to its free side, (m, 6), m; none by default.
///     wall_velocity: Velocities of the walls, (m, 3), m/s; at rest by default. `walls` gives their
///         places at time 0.
///     vessel: A `Drum` or a `Silo` around the balls; none by default.
///     terrain: A `Plane`, `SphereField`, `HeightField`, `TriangleMesh` or `Union`, or a list of
///         them, below the balls; none by default. Balls fall where the ground is unknown. A vessel
///         and a terrain cannot be combined.
///     gravity: Gravity, (3,), m/s²; (0, -9.81, 0) by default.
#[doc = ball_options!(documented)]
/// Raises:
///     ModelError: A radius or mass is not finite and positive.
///     StateError: Positions have a wrong shape or an entry that is not finite, or balls, walls or
///         terrain overlap.
///     TerrainError: A wall has no direction, or `terrain` is not a terrain, or `vessel` is not a
///         vessel.
///     OptionError: An option is out of its range, or both `terrain` and `vessel` are given.
#[pyclass(module = "rover_gym.core", extends = BedSimulation, frozen)]
pub struct GrainSimulation {
    pub inner: Arc<SharedBed<3>>,
    terrain: Option<DrawnGround>,
    vessel: Option<Vessel>,
}

impl GrainSimulation {
    fn open(&self) -> Result<MutexGuard<'_, Core>> {
        self.inner.open()
    }
}

/// Walls with their velocities (m, 3), m/s.
fn moving(walls: Vec<Wall<3>>, velocity: Option<&Bound<'_, PyAny>>) -> Result<Vec<Wall<3>>> {
    let Some(velocity) = velocity else {
        return Ok(walls);
    };
    let flat = rows(velocity, Kind::Terrain, "wall_velocity", 3)?;
    let count = flat.len() / 3;
    if count != walls.len() {
        let n = walls.len();
        return Err(Kind::Terrain.error(
            "wall_velocity",
            format!("wall_velocity: needs one row for each of {n} walls, has {count}"),
            Value::Count(count),
        ));
    }
    let move_one = |(wall, v): (Wall<3>, &[f64])| {
        let moved = wall.moving(Vector3::new(v[0], v[1], v[2]));
        moved.map_err(|e| quantity(Kind::Terrain, &e))
    };
    walls
        .into_iter()
        .zip(flat.chunks_exact(3))
        .map(move_one)
        .collect()
}

/// Centres (3 n) and velocities (6 n) of `n` balls from arrays (n, 3); at rest where none is given.
fn state(
    n: usize,
    position: &Bound<'_, PyAny>,
    velocity: Option<&Bound<'_, PyAny>>,
    spin: Option<&Bound<'_, PyAny>>,
) -> Result<(Vec<f64>, Vec<f64>)> {
    let read = |value: &Bound<'_, PyAny>, field: &str| -> Result<Vec<f64>> {
        let flat = rows(value, Kind::State, field, 3)?;
        if let Some(i) = flat.iter().position(|x| !x.is_finite()) {
            return Err(Kind::State.error(
                format!("{field}[{}]", i / 3),
                format!("{field}[{}]: must be finite, is {}", i / 3, flat[i]),
                Value::Number(flat[i]),
            ));
        }
        if flat.len() == 3 * n {
            return Ok(flat);
        }
        let count = flat.len() / 3;
        Err(Kind::State.error(
            field,
            format!("{field}: needs one row for each of the {n} balls, has {count}"),
            Value::Count(count),
        ))
    };
    let q = read(position, "position")?;
    let mut v = vec![0.0; VELOCITIES * n];
    for (given, field, from) in [(velocity, "velocity", 0), (spin, "spin", 3)] {
        if let Some(given) = given {
            let rows = read(given, field)?;
            for (v, row) in v.chunks_exact_mut(VELOCITIES).zip(rows.chunks_exact(3)) {
                v[from..from + 3].copy_from_slice(row);
            }
        }
    }
    Ok((q, v))
}

/// Numbers of balls, (n,); none for -1.
fn numbers(before: &Bound<'_, PyAny>) -> Result<Vec<Option<u32>>> {
    let what = "a whole number from -1";
    each(
        before,
        Kind::Model,
        ("before", what),
        |entry, kind, field| match entry.extract::<i64>() {
            Ok(-1) => Ok(None),
            Ok(number) if u32::try_from(number).is_ok() => Ok(u32::try_from(number).ok()),
            _ => Err(refused(entry, kind, field, what)),
        },
    )
}

#[pymethods]
impl GrainSimulation {
    #[new]
    #[pyo3(signature = (radius, mass, position, **options),
        text_signature = "(radius, mass, position, *, kinematic=None, walls=None, wall_velocity=None, vessel=None, terrain=None, gravity=None, **options)")]
    fn new(
        radius: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<PyClassInitializer<Self>> {
        let given = Named::keywords(radius.py(), options)?;
        let (terrain, vessel) = (given.some("terrain")?, given.some("vessel")?);
        let terrain = terrain.as_ref().map(parse).transpose()?;
        let vessel = vessel.as_ref().map(Vessel::parse).transpose()?;
        let ground: Option<Arc<dyn Support<3>>> = match (&terrain, &vessel) {
            (Some(terrain), None) => Some(Arc::new(TerrainSupport::new(terrain.terrain()))),
            (None, Some(vessel)) => Some(vessel.support()?),
            (None, None) => None,
            (Some(_), Some(_)) => {
                let message = "vessel: balls have a terrain or a vessel, not both".to_owned();
                return Err(Kind::Option.error("vessel", message, Value::Nothing));
            }
        };
        let ground = (ground, vessel.is_some());
        let mut bed = Described::read([radius, mass, position], &given, ground)?;
        bed.scene.walls = moving(bed.scene.walls, given.some("wall_velocity")?.as_ref())?;
        given.finish()?;
        let (base, inner) = BedSimulation::build(bed)?;
        Ok(base.add_subclass(Self {
            inner,
            terrain,
            vessel,
        }))
    }

    /// Angular velocities of the balls, world frame, (n, 3), rad/s.
    #[getter]
    fn spin(&self) -> Result<Array> {
        let inner = self.open()?;
        let n = inner.description().grains.len();
        Ok(columns(inner.v(), n, VELOCITIES, 3))
    }

    /// The terrain below the balls, or None.
    #[getter]
    fn terrain<'py>(&self, py: Python<'py>) -> Result<Option<Bound<'py, PyAny>>> {
        let terrain = self.terrain.as_ref();
        terrain.map(|ground| union::object(py, ground)).transpose()
    }

    /// The vessel around the balls, or None.
    #[getter]
    fn vessel<'py>(&self, py: Python<'py>) -> Result<Option<Bound<'py, PyAny>>> {
        self.vessel.as_ref().map(|v| v.to_object(py)).transpose()
    }

    /// Sets positions and velocities; time starts at 0.
    ///
    /// Args:
    ///     position: Centres, (n, 3), m.
    ///     velocity: Velocities of the centres, (n, 3), m/s; at rest by default.
    ///     spin: Angular velocities, (n, 3), rad/s; at rest by default.
    ///
    /// Raises:
    ///     StateError: An array has a wrong shape or an entry that is not finite, or bodies
    ///         overlap. Nothing has changed.
    #[pyo3(signature = (position, velocity = None, spin = None))]
    fn set_state(
        &self,
        position: &Bound<'_, PyAny>,
        velocity: Option<&Bound<'_, PyAny>>,
        spin: Option<&Bound<'_, PyAny>>,
    ) -> Result<()> {
        let mut inner = self.open()?;
        let (q, v) = state(inner.description().grains.len(), position, velocity, spin)?;
        Ok(inner.set_state(&q, &v)?)
    }

    /// Replaces the balls. Time and options do not change.
    ///
    /// Balls that are kept stay asleep, and keep their contact impulses for the warm start of the
    /// next step. Overlaps are allowed, because they can arise in a run. An earlier snapshot can be
    /// restored once the simulation has the same balls again.
    ///
    /// Args:
    ///     radius: Radii of the new set of balls, (n,), m.
    ///     mass: Their masses, (n,), kg.
    ///     position: Their centres, (n, 3), m.
    ///     before: Index of each ball in the present set, (n,); -1 for a new ball. The kept balls
    ///         must be in their present order.
    ///     kinematic: Which balls have a prescribed velocity, (n,); none by default.
    ///     velocity: Velocities of their centres, (n, 3), m/s; at rest by default.
    ///     spin: Their angular velocities, (n, 3), rad/s; at rest by default.
    ///
    /// Raises:
    ///     ModelError: A radius or mass is not finite and positive, or `before` does not increase.
    ///         Nothing has changed.
    ///     StateError: An array has a wrong shape or an entry that is not finite. Nothing has
    ///         changed.
    #[pyo3(signature = (radius, mass, position, before, **options),
        text_signature = "($self, radius, mass, position, before, *, kinematic=None, velocity=None, spin=None)")]
    fn exchange(
        &self,
        radius: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        before: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<()> {
        let mut inner = self.open()?;
        let given = Named::keywords(radius.py(), options)?;
        let grains = bed_arguments::grains::<3>(radius, mass, given.get("kinematic")?)?;
        let (velocity, spin) = (given.some("velocity")?, given.some("spin")?);
        given.finish()?;
        let (q, v) = state(grains.len(), position, velocity.as_ref(), spin.as_ref())?;
        let before = numbers(before)?;
        Ok(inner.exchange(grains, &q, &v, &before)?)
    }
}

/// Initial state for a bed: balls in loose layers over a rectangle, without overlap.
///
/// The radii are drawn uniformly from their range.
///
/// Args:
///     count: Number of balls, at most 1 000 000.
///     radius_min: Smallest radius, m.
///     radius_max: Largest radius, m.
///     mass: Mass of a ball of the mean radius, kg; masses are proportional to volume.
///     width: Width of the rectangle along x, m.
///     depth: Width of the rectangle along z, m.
///     left: Smallest x, m.
///     back: Smallest z, m.
///     bottom: Height of the lower edge, m.
///     seed: Seed of the random numbers; equal seeds give equal balls.
///
/// Returns:
///     Radii, (n,), m, masses, (n,), kg, and centres, (n, 3), m.
///
/// Raises:
///     ModelError: A number is not finite or out of its range, `radius_max` is below `radius_min`,
///         or a ball does not fit.
#[pyfunction]
#[pyo3(signature = (count, **options),
    text_signature = "(count, *, radius_min, radius_max, mass, width, depth, left=0.0, back=0.0, bottom=0.0, seed=0)")]
pub fn ball_packing(
    count: &Bound<'_, PyAny>,
    options: Option<&Bound<'_, PyDict>>,
) -> Result<Packed> {
    let given = Named::keywords(count.py(), options)?.of(Kind::Model);
    let packing = Packing::<3> {
        count: self::count(count, Kind::Model, "count")?,
        radius_min: given.need("radius_min", number)?,
        radius_max: given.need("radius_max", number)?,
        mass: given.need("mass", number)?,
        corner: corner(&given)?,
        sides: sides(&given)?,
        seed: given.whole("seed", 0)?,
    };
    given.finish()?;
    packed(count.py(), &packing)
}

/// Lowest corner of the rectangle that balls are laid over, m.
fn corner(given: &Named<'_>) -> Result<[f64; 3]> {
    let [left, bottom, back] = ["left", "bottom", "back"];
    Ok([
        given.number(left, 0.0)?,
        given.number(bottom, 0.0)?,
        given.number(back, 0.0)?,
    ])
}

/// Sides of the rectangle that balls are laid over, m, without an upper end.
fn sides(given: &Named<'_>) -> Result<[f64; 3]> {
    Ok([
        given.need("width", number)?,
        f64::INFINITY,
        given.need("depth", number)?,
    ])
}

/// Places balls of given radii in loose layers over a rectangle, without overlap.
///
/// Each ball gets a place as wide as the largest ball. Layers are filled in the order of `radius`.
///
/// Args:
///     radius: Radii, (n,), m.
///     width: Width of the rectangle along x, m.
///     depth: Width of the rectangle along z, m.
///     left: Smallest x, m.
///     back: Smallest z, m.
///     bottom: Height of the lower edge, m.
///     seed: Seed of the random numbers; equal seeds give equal places.
///
/// Returns:
///     Centres, (n, 3), m.
///
/// Raises:
///     ModelError: A number is not finite or out of its range, or a ball does not fit.
#[pyfunction]
#[pyo3(signature = (radius, **options), text_signature = "(radius, *, width, depth, left=0.0, back=0.0, bottom=0.0, seed=0)")]
pub fn arrange_balls(
    radius: &Bound<'_, PyAny>,
    options: Option<&Bound<'_, PyDict>>,
) -> Result<Array> {
    let given = Named::keywords(radius.py(), options)?.of(Kind::Model);
    let (corner, sides) = (corner(&given)?, sides(&given)?);
    let seed = given.whole("seed", 0)?;
    given.finish()?;
    let radii = vector(radius, Kind::Model, "radius")?;
    let py = radius.py();
    let q = py.release(|| arranged::<3>(&radii, corner, sides, seed))??;
    Ok(columns(&q, radii.len(), COORDINATES, 0))
}

/// Adds the classes of grains in space to the module.
pub fn register(module: &Bound<'_, PyModule>) -> Result<()> {
    module.add_class::<GrainSimulation>()?;
    module.add_class::<Drum>()?;
    module.add_class::<Silo>()?;
    module.add_function(wrap_pyfunction!(arrange_balls, module)?)?;
    module.add_function(wrap_pyfunction!(ball_packing, module)?)?;
    Ok(())
}
