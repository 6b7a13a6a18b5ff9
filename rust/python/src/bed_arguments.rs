//! Arguments that every bed of grains takes, but for its options.

use std::sync::Arc;

use pyo3::prelude::*;
use rover_core::geometry::Support;
use rover_core::integrator::StepOptions;
use rover_core::nalgebra::SVector;
use rover_core::simulation::GrainSetupError;
use rover_core::system::grains::{
    COORDINATES, Cohesion, GrainError, GrainScene, Grains, Packing, SleepOptions, Wall,
};

use crate::arguments::{Given, Named, flags};
use crate::arrays::{Array, fresh, shaped, vector};
use crate::bed_options::BedOptions;
use crate::errors::{BorderError, Kind, Result, Value};
use crate::planar_ground::quantity;
use crate::shared::Release;

impl From<GrainError> for BorderError {
    fn from(e: GrainError) -> Self {
        let field = e.field();
        let kind = match field.split('[').next().unwrap_or_default() {
            "position" | "velocity" | "spin" | "machine" | "machine_rate" => Kind::State,
            "torques" | "pull" => Kind::Command,
            "friction" | "wall_friction" | "wheel_friction" | "rolling_friction"
            | "drilling_friction" | "cohesion" | "cohesion_range" => Kind::Option,
            _ => Kind::Model,
        };
        let value = match &e {
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
        kind.error(field, e.to_string(), value)
    }
}

impl From<GrainSetupError> for BorderError {
    fn from(e: GrainSetupError) -> Self {
        match e {
            GrainSetupError::Options(e) => e.into(),
            GrainSetupError::Grains(e) => e.into(),
        }
    }
}

/// An (n, width) array as rows, flattened.
pub fn rows(value: &Bound<'_, PyAny>, kind: Kind, field: &str, width: usize) -> Result<Vec<f64>> {
    let what = format!("(n, {width})");
    let fits = |shape: &[usize]| matches!(*shape, [_, n] if n == width);
    Ok(shaped(value, kind, (field, &what), fits)?.0)
}

/// Grains of these radii and masses, (n,), of which some may be kinematic.
pub fn grains<const D: usize>(
    radius: &Bound<'_, PyAny>,
    mass: &Bound<'_, PyAny>,
    kinematic: Given<'_>,
) -> Result<Grains<D>> {
    let radius = vector(radius, Kind::Model, "radius")?;
    let mass = vector(mass, Kind::Model, "mass")?;
    let grains = Grains::new(radius, mass)?;
    let Some(kinematic) = kinematic.some() else {
        return Ok(grains);
    };
    let kinematic = flags(&kinematic, Kind::Model, "kinematic")?;
    Ok(grains.with_kinematic(kinematic)?)
}

/// Coordinates of grains, (n, 3), or their rates: of disks the angle may be missing.
pub fn coordinates<const D: usize>(value: &Bound<'_, PyAny>, field: &str) -> Result<Vec<f64>> {
    let what = format!("(n, {COORDINATES})");
    let (flat, shape) = shaped(
        value,
        Kind::State,
        (field, &what),
        |shape| matches!(*shape, [_, n] if n == COORDINATES || n == D),
    )?;
    if shape[1] == COORDINATES {
        return Ok(flat);
    }
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
fn walls<const D: usize>(walls: Option<&Bound<'_, PyAny>>) -> Result<Vec<Wall<D>>> {
    let Some(walls) = walls else {
        return Ok(Vec::new());
    };
    let flat = rows(walls, Kind::Terrain, "walls", 2 * D)?;
    let wall = |row: &[f64]| {
        let half = |from: usize| SVector::<f64, D>::from_column_slice(&row[from..from + D]);
        Wall::new(half(0), half(D)).map_err(|e| quantity(Kind::Terrain, &e))
    };
    flat.chunks_exact(2 * D).map(wall).collect()
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
        let options = BedOptions::read(given, &grains, is_hollow)?;
        let (force, range) = (options.cohesion, options.cohesion_range);
        let cohesion = Cohesion::new(force, range, grains.smallest()).map_err(GrainError::from)?;
        Ok(Self {
            sleep: options.sleep(),
            scene: GrainScene {
                grains: if force > 0.0 {
                    grains.with_cohesion(cohesion)
                } else {
                    grains
                },
                walls: walls(given.some("walls")?.as_ref())?,
                ground,
                machine: None,
                friction: options.friction,
            },
            options: options.step,
            q,
        })
    }
}

/// Radii, masses and centres of a packing.
pub type Packed = (Array, Array, Array);

/// Grains of a packing, built with the interpreter free for others.
pub fn packed<const D: usize>(py: Python<'_>, packing: &Packing<D>) -> Result<Packed> {
    let (grains, q) = py.release(|| packing.build())??;
    let centres: Vec<f64> = q
        .chunks_exact(COORDINATES)
        .flat_map(|c| &c[..D])
        .copied()
        .collect();
    let centres = Array::shaped(centres, &[grains.len(), D]);
    Ok((fresh(grains.radius()), fresh(grains.mass()), centres))
}
