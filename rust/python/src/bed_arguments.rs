//! Arguments that every bed of grains takes: read in one way, and told again in one way.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rover_core::geometry::Support;
use rover_core::integrator::{Stabilisation, StepOptions};
use rover_core::law::rolling::RollingFriction;
use rover_core::nalgebra::{SVector, Vector3};
use rover_core::simulation::{GrainSetupError, grain_options};
use rover_core::system::grains::{
    COORDINATES, GrainError, GrainFriction, GrainScene, Grains, Packing, SleepOptions, Wall,
};

use crate::arguments::{Given, Named, flags, text};
use crate::arrays::{Array, array, fresh, triple, vector};
use crate::errors::{BorderError, Kind, Result, Value};
use crate::options::{GRAIN_STABILISATIONS, choice, name_of};
use crate::planar::pair;
use crate::planar_ground::quantity;
use crate::shared::Release;

/// An error of the grains on its way to Python.
pub fn grain_error(e: &GrainError) -> BorderError {
    let field = e.field();
    let kind = match field.split('[').next().unwrap_or_default() {
        "position" | "velocity" | "spin" | "machine" | "machine_rate" => Kind::State,
        "torques" | "pull" => Kind::Command,
        "friction" | "wall_friction" | "wheel_friction" | "rolling_friction"
        | "drilling_friction" | "cohesion" | "cohesion_range" => Kind::Option,
        _ => Kind::Model,
    };
    let value = match e {
        GrainError::Number(number) => return quantity(kind, number),
        GrainError::Cohesion(e) => Value::Number(e.value()),
        GrainError::Length { count, .. } | GrainError::TooMany { count, .. } => {
            Value::Count(*count)
        }
        GrainError::Before { value, .. } => Value::Count(*value),
        GrainError::Overlap { value, .. }
        | GrainError::InWall { value, .. }
        | GrainError::WheelIn { value, .. }
        | GrainError::TooNarrow { value, .. }
        | GrainError::Range { value } => Value::Number(*value),
        GrainError::Empty => Value::Count(0),
        _ => Value::Nothing,
    };
    BorderError {
        kind,
        message: e.to_string(),
        field: Some(field),
        value,
    }
}

/// An error of a bed that cannot be set up on its way to Python.
pub fn setup_error(e: GrainSetupError) -> BorderError {
    match e {
        GrainSetupError::Options(e) => e.into(),
        GrainSetupError::Grains(e) => grain_error(&e),
    }
}

/// An (n, width) array as rows, flattened.
pub fn rows(value: &Bound<'_, PyAny>, kind: Kind, field: &str, width: usize) -> PyResult<Vec<f64>> {
    let any = array(value, kind, field)?;
    let view = any.as_array();
    if view.ndim() != 2 || view.shape()[1] != width {
        let message = format!("{field}: needs shape (n, {width}), has {:?}", view.shape());
        return Err(BorderError {
            kind,
            message,
            field: Some(field.to_owned()),
            value: Value::Count(view.len()),
        }
        .into());
    }
    Ok(view.iter().copied().collect())
}

/// Grains of these radii and masses, (n,), of which some may be kinematic.
pub fn grains<const D: usize>(
    radius: &Bound<'_, PyAny>,
    mass: &Bound<'_, PyAny>,
    kinematic: Given<'_>,
) -> PyResult<Grains<D>> {
    let radius = vector(radius, Kind::Model, "radius")?;
    let mass = vector(mass, Kind::Model, "mass")?;
    let grains = Grains::new(radius, mass).map_err(|e| grain_error(&e))?;
    let Some(kinematic) = kinematic.some() else {
        return Ok(grains);
    };
    let kinematic = flags(&kinematic, Kind::Model, "kinematic")?;
    Ok(grains
        .with_kinematic(kinematic)
        .map_err(|e| grain_error(&e))?)
}

/// Coordinates of grains, (n, 3), or their rates: of disks the angle may be missing.
pub fn coordinates<const D: usize>(value: &Bound<'_, PyAny>, field: &str) -> Result<Vec<f64>> {
    let columns = array(value, Kind::State, field)?
        .as_array()
        .shape()
        .get(1)
        .copied();
    if D != 2 || columns != Some(2) {
        return Ok(rows(value, Kind::State, field, COORDINATES)?);
    }
    let flat = rows(value, Kind::State, field, 2)?;
    Ok(flat
        .chunks_exact(2)
        .flat_map(|r| [r[0], r[1], 0.0])
        .collect())
}

/// Checks that there is one row of coordinates for each grain.
fn check_rows<const D: usize>(n: usize, q: &[f64]) -> Result<()> {
    let count = q.len() / COORDINATES;
    if count == n {
        return Ok(());
    }
    let noun = if D == 2 { "disks" } else { "balls" };
    let message = format!("position: needs one row for each of the {n} {noun}, has {count}");
    Err(Kind::State.error("position", message, Value::Count(count)))
}

/// Walls: a point of each and the normal to its free side, (m, 2 D).
fn walls<const D: usize>(walls: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Wall<D>>> {
    let Some(walls) = walls else {
        return Ok(Vec::new());
    };
    let flat = rows(walls, Kind::Terrain, "walls", 2 * D)?;
    let wall = |row: &[f64]| {
        let half = |from: usize| SVector::<f64, D>::from_column_slice(&row[from..from + D]);
        Wall::new(half(0), half(D)).map_err(|e| quantity(Kind::Terrain, &e).into())
    };
    flat.chunks_exact(2 * D).map(wall).collect()
}

/// Gravity of the Earth, m/s².
const EARTH: f64 = 9.81;

/// Time step (s), tolerance of the contact problem's relative residual, and largest error of a
/// velocity under the usual gravity by that tolerance (m/s), where they are not given.
///
/// Velocities of balls are right to 25 times the tolerance, in units of the speed that the smallest
/// one gains over its radius, √(g r): the same bed at another scale is solved alike.
fn usual<const D: usize>(grains: &Grains<D>) -> [f64; 3] {
    if D == 2 {
        [1e-3, 1e-4, 10.0]
    } else {
        [2e-3, 1e-3, 25.0 * (EARTH * grains.smallest()).sqrt()]
    }
}

/// What is struck away meets others that were not forecast, and goes into them. Under a machine
/// balls sink into the ground by what the solver's tolerance allows.
fn usual_stabilisation(dimension: usize, restitution: f64, is_hollow: bool) -> &'static str {
    if restitution > 0.0 || is_hollow {
        "projection"
    } else if dimension == 3 {
        "push_out"
    } else {
        "none"
    }
}

/// Speeds go with the root of gravity, so the same bed under another gravity is solved alike; 1
/// without gravity.
fn speed_scale(gravity: f64, usual: f64) -> f64 {
    if gravity > 0.0 {
        (gravity / usual).sqrt()
    } else {
        1.0
    }
}

/// The options of the steps of these grains, by their names. `is_hollow`: whether what slides along
/// a surface goes into it, as along the inside of a curve.
fn step_options<const D: usize>(
    given: &Named<'_>,
    grains: &Grains<D>,
    is_hollow: bool,
) -> Result<StepOptions> {
    let mut options = grain_options(grains);
    let usual_weight = options.gravity.norm();
    let [time_step, tolerance, speed] = usual(grains);
    let gravity = given.read("gravity", |value, kind, field| match D {
        2 => Ok(pair(value, kind, field)?.push(0.0)),
        _ => triple(value, kind, field).map(Vector3::from),
    })?;
    options.gravity = gravity.unwrap_or(options.gravity);
    options.restitution = given.number("restitution", 0.0)?;
    options.solver.tolerance = given.number("tolerance", tolerance)?;
    options.time_step = given.number("time_step", time_step)?;
    options.solver.max_sweeps = given.count("max_iterations", 2000)?;
    let stabilisation = usual_stabilisation(D, options.restitution, is_hollow);
    let stabilisation = given
        .read("stabilisation", text)?
        .unwrap_or_else(|| stabilisation.to_owned());
    options.stabilisation =
        choice::<Stabilisation>("stabilisation", &stabilisation, &GRAIN_STABILISATIONS)?;
    options.solver.velocity_tolerance =
        speed * options.solver.tolerance * speed_scale(options.gravity.norm(), usual_weight);
    if let Some(depth) = given.maybe("penetration_tolerance")? {
        options.penetration_tolerance = Some(depth);
    }
    Ok(options)
}

/// Coulomb's coefficients, and those of rolling friction, by their names: `wheel_friction` in the
/// plane, `drilling_friction` in space.
fn friction<const D: usize>(given: &Named<'_>) -> Result<GrainFriction> {
    let usual = GrainFriction::default();
    let (mut wheels, mut drilling) = (usual.wheels, 0.0);
    let (own, name) = match D {
        2 => (&mut wheels, "wheel_friction"),
        _ => (&mut drilling, "drilling_friction"),
    };
    *own = given.number(name, *own)?;
    Ok(GrainFriction {
        grains: given.number("friction", usual.grains)?,
        walls: given.number("wall_friction", usual.walls)?,
        wheels,
        rolling: RollingFriction {
            rolling: given.number("rolling_friction", 0.0)?,
            drilling,
        },
    })
}

/// When the grains of a bed sleep; None where they never do.
fn sleep(given: &Named<'_>) -> Result<Option<SleepOptions>> {
    let usual = SleepOptions::default();
    let rest = SleepOptions {
        speed: given.maybe("sleep_speed")?.unwrap_or(usual.speed),
        distance: given.maybe("sleep_distance")?.unwrap_or(usual.distance),
        ..usual
    };
    rest.check()?;
    Ok(given.flag("sleep", false)?.then_some(rest))
}

/// A bed of grains that was read: without a machine, not yet checked as a whole.
pub struct Described<const D: usize> {
    pub scene: GrainScene<D>,
    pub options: StepOptions,
    pub sleep: Option<SleepOptions>,
    /// Coordinates of the grains, (3 n,).
    pub q: Vec<f64>,
}

impl<const D: usize> Described<D> {
    /// Reads what beds in the plane and in space have in common. `ground`, and whether it is
    /// hollow, has been read.
    pub fn read(
        [radius, mass, position]: [&Bound<'_, PyAny>; 3],
        given: &Named<'_>,
        (ground, is_hollow): (Option<Arc<dyn Support<D>>>, bool),
    ) -> Result<Self> {
        let grains = grains(radius, mass, given.get("kinematic")?)?;
        let q = coordinates::<D>(position, "position")?;
        check_rows::<D>(grains.len(), &q)?;
        Ok(Self {
            options: step_options(given, &grains, is_hollow)?,
            sleep: sleep(given)?,
            q,
            scene: GrainScene {
                grains,
                walls: walls(given.some("walls")?.as_ref())?,
                ground,
                machine: None,
                friction: friction::<D>(given)?,
            },
        })
    }
}

/// The options of contacts, gravity and solver by the names of the arguments.
pub fn settings<'py, const D: usize>(
    py: Python<'py>,
    options: &StepOptions,
    scene: &GrainScene<D>,
) -> PyResult<Bound<'py, PyDict>> {
    let (settings, friction) = (PyDict::new(py), &scene.friction);
    settings.set_item("friction", friction.grains)?;
    settings.set_item("wall_friction", friction.walls)?;
    settings.set_item("rolling_friction", friction.rolling.rolling)?;
    settings.set_item("restitution", options.restitution)?;
    settings.set_item("time_step", options.time_step)?;
    settings.set_item("tolerance", options.solver.tolerance)?;
    settings.set_item("max_iterations", options.solver.max_sweeps)?;
    let stabilisation = name_of(options.stabilisation, &GRAIN_STABILISATIONS);
    settings.set_item("stabilisation", stabilisation)?;
    settings.set_item(
        "penetration_tolerance",
        options.penetration_tolerance.unwrap_or_default(),
    )?;
    if D == 2 {
        settings.set_item("wheel_friction", friction.wheels)?;
    } else {
        settings.set_item("drilling_friction", friction.rolling.drilling)?;
        let cohesion = scene.grains.cohesion();
        settings.set_item("cohesion", cohesion.map_or(0.0, |c| c.force))?;
        settings.set_item("cohesion_range", cohesion.map(|c| c.range))?;
    }
    let gravity = &options.gravity.as_slice()[..D];
    settings.set_item("gravity", PyTuple::new(py, gravity)?)?;
    Ok(settings)
}

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
