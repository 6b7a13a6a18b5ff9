//! Balls in space as arguments and as arrays: what every class with balls reads and tells alike.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::geometry::{Support, TerrainSupport};
use rover_core::integrator::StepOptions;
use rover_core::nalgebra::Vector3;
use rover_core::system::grains::{
    COORDINATES, Cohesion, GrainScene, Grains, Packing, SleepOptions, Wall,
};
use rover_task::draw::DrawnGround;

use crate::arguments::{Named, refused};
use crate::arrays::{Array, fresh, fresh_rows, triple};
use crate::bed_arguments::{self, Usual, check_rows, grain_error, rows};
use crate::errors::{Kind, Result, Value};
use crate::planar_ground::quantity;
use crate::shared::Release;
use crate::terrain::parse;
use crate::vessels::Vessel;

/// Velocities of a ball: of its centre, then its spin.
const VELOCITIES: usize = 6;

/// Radii, masses and centres of a packing.
pub type Packed = (Array, Array, Array);

/// Grains of a packing, built with the interpreter free for others.
pub fn packed<const D: usize>(py: Python<'_>, packing: &Packing<D>) -> Result<Packed> {
    let built = py.release(|| packing.build())?;
    let (grains, q) = built.map_err(|e| grain_error(&e))?;
    let centres: Vec<f64> = q
        .chunks_exact(COORDINATES)
        .flat_map(|c| &c[..D])
        .copied()
        .collect();
    let centres = Array::shaped(centres, &[grains.len(), D]);
    Ok((fresh(grains.radius()), fresh(grains.mass()), centres))
}

/// When the grains of a bed sleep; None where they never do.
pub fn sleep(given: &Named<'_>) -> Result<Option<SleepOptions>> {
    let usual = SleepOptions::default();
    let rest = SleepOptions {
        speed: given.maybe("sleep_speed")?.unwrap_or(usual.speed),
        distance: given.maybe("sleep_distance")?.unwrap_or(usual.distance),
        ..usual
    };
    rest.check()?;
    Ok(given.flag("sleep", false)?.then_some(rest))
}

/// A bed of balls that was read: without a machine, not yet checked as a whole.
pub struct Balls {
    pub scene: GrainScene<3>,
    pub options: StepOptions,
    pub sleep: Option<SleepOptions>,
    /// Centres, (3 n,).
    pub q: Vec<f64>,
    pub terrain: Option<DrawnGround>,
    pub vessel: Option<Vessel>,
}

/// Velocities are right to 25 times the tolerance, in units of the speed that the smallest ball
/// gains over its radius, √(g r): the same bed at another scale is solved alike.
fn usual(balls: &Grains<3>) -> Usual {
    const EARTH: f64 = 9.81;
    Usual {
        time_step: 2e-3,
        tolerance: 1e-3,
        speed: 25.0 * (EARTH * balls.smallest()).sqrt(),
    }
}

impl Balls {
    /// Reads everything: radii, masses, centres, and options by their names.
    pub fn read(
        radius: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Self> {
        let given = Named::keywords(radius.py(), options)?;
        let grains = bed_arguments::grains::<3>(radius, mass, given.get("kinematic")?)?;
        let q = rows(position, Kind::State, "position", COORDINATES)?;
        check_rows("balls", grains.len(), &q)?;
        let vessel = given
            .some("vessel")?
            .as_ref()
            .map(Vessel::parse)
            .transpose()?;
        let gravity = given.read("gravity", triple)?.map(Vector3::from);
        let how = (gravity, vessel.is_some());
        let mut options = bed_arguments::step_options(&given, &grains, how, usual(&grains))?;
        options.solver.threads = given.count("threads", 1)?;
        let force = given.number("cohesion", 0.0)?;
        let range = given.maybe("cohesion_range")?;
        let cohesion = Cohesion::new(force, range, grains.smallest());
        let cohesion = cohesion.map_err(|e| grain_error(&e.into()))?;
        let grains = if force > 0.0 {
            grains.with_cohesion(cohesion)
        } else {
            grains
        };
        let walls = bed_arguments::walls(given.some("walls")?.as_ref())?;
        let walls = moving(walls, given.some("wall_velocity")?.as_ref())?;
        let terrain = given.some("terrain")?.as_ref().map(parse).transpose()?;
        let ground: Option<Arc<dyn Support<3>>> = match (&terrain, &vessel) {
            (Some(terrain), None) => Some(Arc::new(TerrainSupport::new(terrain.terrain()))),
            (None, Some(vessel)) => Some(vessel.support()?),
            (None, None) => None,
            (Some(_), Some(_)) => {
                let message = "vessel: balls have a terrain or a vessel, not both".to_owned();
                return Err(Kind::Option.error("vessel", message, Value::Nothing));
            }
        };
        let friction = bed_arguments::friction(&given, false, false)?;
        let sleep = sleep(&given)?;
        given.finish()?;
        let scene = GrainScene {
            grains,
            walls,
            ground,
            machine: None,
            friction,
        };
        Ok(Self {
            scene,
            options,
            sleep,
            q,
            terrain,
            vessel,
        })
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
pub fn state(
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
pub fn numbers(before: &Bound<'_, PyAny>) -> Result<Vec<Option<u32>>> {
    let wrong = |value: &Bound<'_, PyAny>, field: &str| {
        refused(value, Kind::Model, field, "a whole number from -1")
    };
    let entries = before.try_iter().map_err(|_| wrong(before, "before"))?;
    let read = |(i, entry): (usize, PyResult<Bound<'_, PyAny>>)| {
        let entry = entry?;
        match entry.extract::<i64>() {
            Ok(-1) => Ok(None),
            Ok(number) if u32::try_from(number).is_ok() => Ok(u32::try_from(number).ok()),
            _ => Err(wrong(&entry, &format!("before[{i}]"))),
        }
    };
    entries.enumerate().map(read).collect()
}

/// Columns `from` to `from + 2` of `n` rows of `width` entries as a new (n, 3) array.
fn columns(values: &[f64], (n, width, from): (usize, usize, usize)) -> Array {
    fresh_rows(
        values
            .chunks_exact(width)
            .take(n)
            .map(|row| [row[from], row[from + 1], row[from + 2]]),
    )
}

/// Centres of the first `n` bodies, (n, 3).
pub fn centres(q: &[f64], n: usize) -> Array {
    columns(q, (n, COORDINATES, 0))
}

/// Velocities of the centres of the first `n` bodies, (n, 3).
pub fn velocities(v: &[f64], n: usize) -> Array {
    columns(v, (n, VELOCITIES, 0))
}

/// Spins of the first `n` bodies, (n, 3).
pub fn spins(v: &[f64], n: usize) -> Array {
    columns(v, (n, VELOCITIES, 3))
}
