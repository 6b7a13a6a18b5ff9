//! Arguments that every bed of grains takes: read in one way, and told again in one way.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::integrator::{Stabilisation, StepOptions};
use rover_core::law::rolling::RollingFriction;
use rover_core::nalgebra::{SVector, Vector3};
use rover_core::simulation::{SoilSetupError, soil_options};
use rover_core::system::grains::{COORDINATES, GrainError, GrainFriction, Grains, Wall};

use crate::arguments::{Given, Named, flags, text};
use crate::arrays::{array, vector};
use crate::errors::{BorderError, Kind, Result, Value};
use crate::options::{GRAIN_STABILISATIONS, choice, name_of};
use crate::planar_ground::quantity;

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
pub fn setup_error(e: SoilSetupError) -> BorderError {
    match e {
        SoilSetupError::Options(e) => e.into(),
        SoilSetupError::Soil(e) => grain_error(&e),
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

/// Checks that there is one row of coordinates for each grain. `noun`: "disk" or "ball", for the
/// message.
pub fn check_rows(noun: &str, n: usize, q: &[f64]) -> Result<(), BorderError> {
    let count = q.len() / COORDINATES;
    if count == n {
        return Ok(());
    }
    Err(BorderError {
        kind: Kind::State,
        message: format!("position: needs one row for each of the {n} {noun}, has {count}"),
        field: Some("position".to_owned()),
        value: Value::Count(count),
    })
}

/// Walls: a point of each and the normal to its free side, (m, 2 D).
pub fn walls<const D: usize>(walls: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Wall<D>>> {
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

/// What a class takes where an option of its steps is not given.
#[derive(Clone, Copy)]
pub struct Usual {
    /// s.
    pub time_step: f64,
    /// Tolerance of the contact problem's relative residual.
    pub tolerance: f64,
    /// Largest error of a velocity in the contact problem, m/s, under the usual gravity and by the
    /// tolerance.
    pub speed: f64,
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

/// The options of the steps of these grains, by their names. `gravity` has been read; `is_hollow`:
/// whether what slides along a surface goes into it, as along the inside of a curve.
pub fn step_options<const D: usize>(
    given: &Named<'_>,
    grains: &Grains<D>,
    (gravity, is_hollow): (Option<Vector3<f64>>, bool),
    usual: Usual,
) -> Result<StepOptions> {
    let mut options = soil_options(grains);
    let usual_weight = options.gravity.norm();
    options.gravity = gravity.unwrap_or(options.gravity);
    options.restitution = given.number("restitution", 0.0)?;
    options.solver.tolerance = given.number("tolerance", usual.tolerance)?;
    options.time_step = given.number("time_step", usual.time_step)?;
    options.solver.max_sweeps = given.count("max_iterations", 2000)?;
    let stabilisation = usual_stabilisation(D, options.restitution, is_hollow);
    let stabilisation = given
        .read("stabilisation", text)?
        .unwrap_or_else(|| stabilisation.to_owned());
    options.stabilisation =
        choice::<Stabilisation>("stabilisation", &stabilisation, &GRAIN_STABILISATIONS)?;
    options.solver.velocity_tolerance =
        usual.speed * options.solver.tolerance * speed_scale(options.gravity.norm(), usual_weight);
    if let Some(depth) = given.maybe("penetration_tolerance")? {
        options.penetration_tolerance = Some(depth);
    }
    Ok(options)
}

/// Coulomb's coefficients, and those of rolling friction, by their names; `wheel_friction` where
/// there are wheels, `drilling_friction` in space.
pub fn friction(given: &Named<'_>, has_wheels: bool, is_flat: bool) -> Result<GrainFriction> {
    let usual = GrainFriction::default();
    let optional = |is_one: bool, name: &'static str, usual: f64| {
        if is_one {
            given.number(name, usual)
        } else {
            Ok(usual)
        }
    };
    Ok(GrainFriction {
        grains: given.number("friction", usual.grains)?,
        walls: given.number("wall_friction", usual.walls)?,
        wheels: optional(has_wheels, "wheel_friction", usual.wheels)?,
        rolling: RollingFriction {
            rolling: given.number("rolling_friction", 0.0)?,
            drilling: optional(!is_flat, "drilling_friction", 0.0)?,
        },
    })
}

/// The options of contacts and solver by the names of the arguments, without gravity.
pub fn settings<'py>(
    py: Python<'py>,
    options: &StepOptions,
    friction: &GrainFriction,
) -> PyResult<Bound<'py, PyDict>> {
    let settings = PyDict::new(py);
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
    Ok(settings)
}
