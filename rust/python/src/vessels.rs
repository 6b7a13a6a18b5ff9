//! `Drum`, `Silo`: vessels of grains in space.

use std::sync::Arc;

use pyo3::prelude::*;
use rover_core::geometry::{Drum as CoreDrum, Floor, Silo as CoreSilo, Support};
use rover_core::nalgebra::Vector3;

use crate::arguments::{Given, number, shown};
use crate::arrays::{triple, two};
use crate::errors::{BorderError, Kind, Value};
use crate::planar_ground::quantity;

const KIND: Kind = Kind::Terrain;

/// A drum that turns about its axis, which lies along z, between two ends at rest.
///
/// Args:
///     radius: Inner radius, m.
///     length: Distance between the ends, m.
///     rate: Angular velocity about +z, rad/s.
///     centre: Its middle, (3,), m; the origin by default.
///
/// Raises:
///     TerrainError: A number is not finite, or the radius or length is not positive.
#[pyclass(module = "rover_gym.mechanics", frozen, from_py_object)]
#[derive(Clone)]
pub struct Drum {
    inner: CoreDrum,
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
    ) -> PyResult<Self> {
        let radius = number(radius, KIND, "radius")?;
        let length = number(length, KIND, "length")?;
        let rate = rate.number(0.0, KIND, "rate")?;
        let centre = centre.map(|c| triple(c, KIND, "centre")).transpose()?;
        let centre = Vector3::from(centre.unwrap_or_default());
        let made = CoreDrum::new(centre, radius, length, rate);
        Ok(Self {
            inner: made.map_err(|e| quantity(KIND, &e))?,
        })
    }

    /// Inner radius, m.
    #[getter]
    fn radius(&self) -> f64 {
        self.inner.radius()
    }

    /// Distance between the ends, m.
    #[getter]
    fn length(&self) -> f64 {
        self.inner.length()
    }

    /// Angular velocity about +z, rad/s.
    #[getter]
    fn rate(&self) -> f64 {
        self.inner.rate()
    }

    /// Its middle, m.
    #[getter]
    fn centre(&self) -> (f64, f64, f64) {
        let centre = self.inner.centre();
        (centre.x, centre.y, centre.z)
    }

    fn __repr__(&self) -> String {
        let [radius, length, rate] = [self.radius(), self.length(), self.rate()];
        format!("Drum(radius={radius}, length={length}, rate={rate})")
    }
}

/// An upright tube, open above, perhaps on a flat floor with a round hole.
///
/// Without a floor it has no end. What falls through the hole is free.
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
#[pyclass(module = "rover_gym.mechanics", frozen, from_py_object)]
#[derive(Clone)]
pub struct Silo {
    inner: CoreSilo,
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
    ) -> PyResult<Self> {
        let radius = number(radius, KIND, "radius")?;
        let hole = hole.number(0.0, KIND, "hole")?;
        let floor = floor.maybe(KIND, "floor")?;
        if floor.is_none() && hole != 0.0 {
            return Err(BorderError {
                kind: KIND,
                message: format!("hole: must be 0 without a floor, is {hole}"),
                field: Some("hole".to_owned()),
                value: Value::Number(hole),
            }
            .into());
        }
        let axis = axis.map(|a| two(a, KIND, "axis")).transpose()?;
        let floor = floor.map(|height| Floor { height, hole });
        let made = CoreSilo::new(axis.unwrap_or_default(), radius, floor);
        Ok(Self {
            inner: made.map_err(|e| quantity(KIND, &e))?,
        })
    }

    /// Inner radius, m.
    #[getter]
    fn radius(&self) -> f64 {
        self.inner.radius()
    }

    /// Height of the floor, m, or None.
    #[getter]
    fn floor(&self) -> Option<f64> {
        self.inner.floor().map(|floor| floor.height)
    }

    /// Radius of the hole, m.
    #[getter]
    fn hole(&self) -> f64 {
        self.inner.floor().map_or(0.0, |floor| floor.hole)
    }

    /// Place (x, z) of the axis, m.
    #[getter]
    fn axis(&self) -> (f64, f64) {
        self.inner.axis().into()
    }

    fn __repr__(&self) -> String {
        match self.floor() {
            Some(floor) => format!(
                "Silo(radius={}, floor={floor}, hole={})",
                self.radius(),
                self.hole()
            ),
            None => format!("Silo(radius={})", self.radius()),
        }
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
    pub fn parse(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        given.extract::<Self>().map_err(|_| {
            let shown = shown(given);
            BorderError {
                kind: KIND,
                message: format!("vessel: must be a Drum or a Silo, is {shown}"),
                field: Some("vessel".to_owned()),
                value: Value::Text(shown),
            }
            .into()
        })
    }

    /// The core's view of it.
    pub fn support(&self) -> Arc<dyn Support<3>> {
        match self {
            Self::Drum(drum) => Arc::new(drum.inner),
            Self::Silo(silo) => Arc::new(silo.inner),
        }
    }

    /// Back to Python.
    pub fn to_object<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(match self {
            Self::Drum(drum) => drum.clone().into_pyobject(py)?.into_any(),
            Self::Silo(silo) => silo.clone().into_pyobject(py)?.into_any(),
        })
    }
}
