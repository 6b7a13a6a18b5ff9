//! Balls in space as arguments and as arrays: what every class with balls reads and tells alike.

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::prelude::*;
use rover_core::draw::DrawnGround;
use rover_core::geometry::{Support, TerrainSupport};
use rover_core::integrator::StepOptions;
use rover_core::nalgebra::Vector3;
use rover_core::system::grains::{COORDINATES, Cohesion, GrainScene, Grains, SleepOptions, Wall};

use crate::arguments::{Given, refused};
use crate::arrays::fresh_rows;
use crate::bed_arguments::{self, StepArguments, Usual, check_rows, grain_error, rows};
use crate::errors::{BorderError, Kind, Value};
use crate::planar_ground::quantity;
use crate::terrain::parse;
use crate::vessels::Vessel;

/// Velocities of a ball: of its centre, then its spin.
const VELOCITIES: usize = 6;

/// A bed of balls as it was given.
pub struct BallArguments<'a, 'py> {
    pub radius: &'a Bound<'py, PyAny>,
    pub mass: &'a Bound<'py, PyAny>,
    pub position: &'a Bound<'py, PyAny>,
    pub kinematic: Given<'py>,
    pub walls: Option<&'a Bound<'py, PyAny>>,
    pub wall_velocity: Option<&'a Bound<'py, PyAny>>,
    pub vessel: Option<&'a Bound<'py, PyAny>>,
    pub terrain: Option<&'a Bound<'py, PyAny>>,
    pub friction: Given<'py>,
    pub wall_friction: Given<'py>,
    pub cohesion: Given<'py>,
    pub cohesion_range: Given<'py>,
    pub steps: StepArguments<'py>,
    pub sleep: Given<'py>,
    pub sleep_speed: Given<'py>,
    pub sleep_distance: Given<'py>,
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

impl BallArguments<'_, '_> {
    /// Reads everything.
    pub fn read(self) -> PyResult<Balls> {
        let grains = bed_arguments::grains::<3>(self.radius, self.mass, self.kinematic)?;
        let q = rows(self.position, Kind::State, "position", COORDINATES)?;
        check_rows("balls", grains.len(), &q)?;
        let options = self.steps.options(&grains, usual(&grains))?;
        let force = self.cohesion.number(0.0, Kind::Option, "cohesion")?;
        let range = (self.cohesion_range).maybe(Kind::Option, "cohesion_range")?;
        let cohesion = Cohesion::new(force, range, grains.smallest());
        let cohesion = cohesion.map_err(|e| grain_error(&e))?;
        let grains = if force > 0.0 {
            grains.with_cohesion(cohesion)
        } else {
            grains
        };
        let walls = moving(bed_arguments::walls(self.walls)?, self.wall_velocity)?;
        let vessel = self.vessel.map(Vessel::parse).transpose()?;
        let terrain = self.terrain.map(parse).transpose()?;
        let ground: Option<Arc<dyn Support<3>>> = match (&terrain, &vessel) {
            (Some(terrain), None) => Some(Arc::new(TerrainSupport::new(terrain.terrain()))),
            (None, Some(vessel)) => Some(vessel.support()),
            (None, None) => None,
            (Some(_), Some(_)) => {
                let message = "vessel: balls have a terrain or a vessel, not both".to_owned();
                return Err(BorderError::option("vessel", message, Value::Nothing).into());
            }
        };
        let friction = bed_arguments::friction(self.friction, self.wall_friction, Given::MISSING)?;
        Ok(Balls {
            scene: GrainScene {
                grains,
                walls,
                ground,
                machine: None,
                friction,
            },
            options,
            sleep: bed_arguments::sleep(self.sleep, self.sleep_speed, self.sleep_distance)?,
            q,
            terrain,
            vessel,
        })
    }
}

/// The same walls with their velocities, (m, 3).
fn moving(walls: Vec<Wall<3>>, velocity: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Wall<3>>> {
    let Some(velocity) = velocity else {
        return Ok(walls);
    };
    let flat = rows(velocity, Kind::Terrain, "wall_velocity", 3)?;
    let count = flat.len() / 3;
    if count != walls.len() {
        let n = walls.len();
        return Err(BorderError {
            kind: Kind::Terrain,
            message: format!("wall_velocity: needs one row for each of {n} walls, has {count}"),
            field: Some("wall_velocity".to_owned()),
            value: Value::Count(count),
        }
        .into());
    }
    let move_one = |(wall, v): (Wall<3>, &[f64])| {
        let moved = wall.moving(Vector3::new(v[0], v[1], v[2]));
        moved.map_err(|e| quantity(Kind::Terrain, &e).into())
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
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let read = |value: &Bound<'_, PyAny>, field: &str| -> PyResult<Vec<f64>> {
        let flat = rows(value, Kind::State, field, 3)?;
        if let Some(i) = flat.iter().position(|x| !x.is_finite()) {
            return Err(BorderError {
                kind: Kind::State,
                message: format!("{field}[{}]: must be finite, is {}", i / 3, flat[i]),
                field: Some(format!("{field}[{}]", i / 3)),
                value: Value::Number(flat[i]),
            }
            .into());
        }
        if flat.len() == 3 * n {
            return Ok(flat);
        }
        let count = flat.len() / 3;
        Err(BorderError {
            kind: Kind::State,
            message: format!("{field}: needs one row for each of the {n} balls, has {count}"),
            field: Some(field.to_owned()),
            value: Value::Count(count),
        }
        .into())
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
pub fn numbers(before: &Bound<'_, PyAny>) -> PyResult<Vec<Option<u32>>> {
    let wrong = |value: &Bound<'_, PyAny>, field: &str| {
        refused(value, Kind::Model, field, "a whole number from -1")
    };
    let entries = before.try_iter().map_err(|_| wrong(before, "before"))?;
    let read = |(i, entry): (usize, PyResult<Bound<'_, PyAny>>)| {
        let entry = entry?;
        match entry.extract::<i64>() {
            Ok(-1) => Ok(None),
            Ok(number) if u32::try_from(number).is_ok() => Ok(u32::try_from(number).ok()),
            _ => Err(wrong(&entry, &format!("before[{i}]")).into()),
        }
    };
    entries.enumerate().map(read).collect()
}

/// Columns `from` to `from + 2` of `n` rows of `width` entries as a fresh (n, 3) array.
fn columns<'py>(
    py: Python<'py>,
    values: &[f64],
    (n, width, from): (usize, usize, usize),
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows = values.chunks_exact(width).take(n);
    let three = rows.map(|row| [row[from], row[from + 1], row[from + 2]]);
    fresh_rows(py, &three.collect::<Vec<_>>())
}

/// Centres of the first `n` bodies, (n, 3).
pub fn centres<'py>(py: Python<'py>, q: &[f64], n: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    columns(py, q, (n, COORDINATES, 0))
}

/// Velocities of the centres of the first `n` bodies, (n, 3).
pub fn velocities<'py>(
    py: Python<'py>,
    v: &[f64],
    n: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    columns(py, v, (n, VELOCITIES, 0))
}

/// Spins of the first `n` bodies, (n, 3).
pub fn spins<'py>(py: Python<'py>, v: &[f64], n: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    columns(py, v, (n, VELOCITIES, 3))
}
