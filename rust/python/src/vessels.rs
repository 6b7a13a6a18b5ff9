//! `Drum`, `Silo`: vessels of grains in space.

use std::sync::Arc;

use pyo3::prelude::*;
use rover_core::geometry::{Drum as CoreDrum, Floor, Silo as CoreSilo, Support};
use rover_core::nalgebra::Vector3;

use crate::arguments::{Given, number, refused};
use crate::arrays::{triple, two};
use crate::errors::{Kind, Result, Value};
use crate::planar_ground::quantity;

const KIND: Kind = Kind::Terrain;

/// A drum that rotates about its axis along z, with two fixed ends.
///
/// Args:
///     radius: Inner radius, m.
///     length: Distance between the ends, m.
///     rate: Angular velocity about +z, rad/s.
///     centre: Centre of the drum, (3,), m; the origin by default.
///
/// Raises:
///     TerrainError: A number is not finite, or the radius or length is not positive.
#[pyclass(module = "rover_gym.core", frozen, from_py_object, get_all)]
#[derive(Clone)]
pub struct Drum {
    /// Inner radius, m.
    radius: f64,
    /// Distance between the ends, m.
    length: f64,
    /// Angular velocity about +z, rad/s.
    rate: f64,
    /// Centre of the drum, m.
    centre: (f64, f64, f64),
}

#[pymethods]
impl Drum {
    #[new]
    #[pyo3(signature = (radius, length, rate = Given::MISSING, *, centre = None), text_signature = "(radius, length, rate=0.0, *, centre=None)")]
    fn new(
        radius: &Bound<'_, PyAny>,
        length: &Bound<'_, PyAny>,
        rate: Given<'_>,
        centre: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self> {
        let centre = centre.map(|c| triple(c, KIND, "centre")).transpose()?;
        let made = Self {
            radius: number(radius, KIND, "radius")?,
            length: number(length, KIND, "length")?,
            rate: rate.number(0.0, KIND, "rate")?,
            centre: centre.unwrap_or_default().into(),
        };
        made.inner()?;
        Ok(made)
    }

    fn __repr__(&self) -> String {
        let (radius, length, rate) = (self.radius, self.length, self.rate);
        format!("Drum(radius={radius}, length={length}, rate={rate})")
    }
}

impl Drum {
    /// The drum of the core.
    fn inner(&self) -> Result<CoreDrum> {
        let centre = Vector3::from(<[f64; 3]>::from(self.centre));
        let made = CoreDrum::new(centre, self.radius, self.length, self.rate);
        made.map_err(|e| quantity(KIND, &e))
    }
}

/// A vertical tube, open at the top, with an optional flat floor with a round hole.
///
/// Without a floor the tube has infinite length. Grains that fall through the hole leave the silo.
///
/// Args:
///     radius: Inner radius, m.
///     floor: Height of the floor, m; no floor by default.
///     hole: Radius of the hole in the middle of the floor, m; 0 for none.
///     axis: Place (x, z) of the axis, (2,), m; the origin by default.
///
/// Raises:
///     TerrainError: A number is not finite, the radius is not positive, or the hole is as wide as
///         the tube.
#[pyclass(module = "rover_gym.core", frozen, from_py_object, get_all)]
#[derive(Clone)]
pub struct Silo {
    /// Inner radius, m.
    radius: f64,
    /// Height of the floor, m, or None.
    floor: Option<f64>,
    /// Radius of the hole, m.
    hole: f64,
    /// Place (x, z) of the axis, m.
    axis: (f64, f64),
}

#[pymethods]
impl Silo {
    #[new]
    #[pyo3(signature = (radius, *, floor = Given::MISSING, hole = Given::MISSING, axis = None), text_signature = "(radius, *, floor=None, hole=0.0, axis=None)")]
    fn new(
        radius: &Bound<'_, PyAny>,
        floor: Given<'_>,
        hole: Given<'_>,
        axis: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self> {
        let radius = number(radius, KIND, "radius")?;
        let hole = hole.number(0.0, KIND, "hole")?;
        let floor = floor.maybe(KIND, "floor")?;
        if floor.is_none() && hole != 0.0 {
            let message = format!("hole: must be 0 without a floor, is {hole}");
            return Err(KIND.error("hole", message, Value::Number(hole)));
        }
        let axis = axis.map(|a| two(a, KIND, "axis")).transpose()?;
        let made = Self {
            radius,
            floor,
            hole,
            axis: axis.unwrap_or_default().into(),
        };
        made.inner()?;
        Ok(made)
    }

    fn __repr__(&self) -> String {
        let Self { radius, hole, .. } = self;
        match self.floor {
            Some(floor) => format!("Silo(radius={radius}, floor={floor}, hole={hole})"),
            None => format!("Silo(radius={radius})"),
        }
    }
}

impl Silo {
    /// The silo of the core.
    fn inner(&self) -> Result<CoreSilo> {
        let floor = self.floor.map(|height| Floor {
            height,
            hole: self.hole,
        });
        let made = CoreSilo::new(self.axis.into(), self.radius, floor);
        made.map_err(|e| quantity(KIND, &e))
    }
}

/// Any vessel.
#[derive(Clone, FromPyObject)]
pub enum Vessel {
    /// A drum.
    Drum(Drum),
    /// A silo.
    Silo(Silo),
}

impl Vessel {
    /// Any object as a vessel, or a `TerrainError`.
    pub fn parse(given: &Bound<'_, PyAny>) -> Result<Self> {
        let wrong = |_| refused(given, KIND, "vessel", "a Drum or a Silo");
        given.extract::<Self>().map_err(wrong)
    }

    /// The core's view of it.
    pub fn support(&self) -> Result<Arc<dyn Support<3>>> {
        Ok(match self {
            Self::Drum(drum) => Arc::new(drum.inner()?),
            Self::Silo(silo) => Arc::new(silo.inner()?),
        })
    }

    /// Back to Python.
    pub fn to_object<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>> {
        Ok(match self {
            Self::Drum(drum) => drum.clone().into_pyobject(py)?.into_any(),
            Self::Silo(silo) => silo.clone().into_pyobject(py)?.into_any(),
        })
    }
}
