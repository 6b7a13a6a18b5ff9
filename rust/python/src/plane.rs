//! `Plane`.

use numpy::PyArray1;
use pyo3::prelude::*;
use rover_core::geometry::Plane as CorePlane;

use crate::arguments::{Given, number};
use crate::arrays::{fresh, triple};
use crate::errors::{BorderError, Kind, Value};

type Normal = (f64, f64, f64);

/// The half-space n.x + offset >= 0 is free; the ground is below. `normal` is normalised.
#[pyclass(module = "rover_gym.mechanics", frozen, from_py_object)]
#[derive(Clone)]
pub struct Plane {
    pub inner: CorePlane,
}

#[pymethods]
impl Plane {
    #[new]
    #[pyo3(signature = (normal = None, offset = Given::MISSING), text_signature = "(normal=None, offset=0.0)")]
    fn new(normal: Option<&Bound<'_, PyAny>>, offset: Given<'_>) -> PyResult<Self> {
        let offset = offset.number(0.0, Kind::Terrain, "offset")?;
        let normal = normal.map_or(Ok([0.0, 1.0, 0.0]), |n| triple(n, Kind::Terrain, "normal"))?;
        Ok(Self {
            inner: CorePlane::new(normal, offset).map_err(BorderError::from)?,
        })
    }

    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        fresh(py, self.inner.normal().as_slice())
    }

    #[getter]
    fn offset(&self) -> f64 {
        self.inner.offset()
    }

    /// Height y of the plane at (x, z), m.
    fn height(&self, x: &Bound<'_, PyAny>, z: &Bound<'_, PyAny>) -> PyResult<f64> {
        let x = number(x, Kind::Terrain, "x")?;
        let z = number(z, Kind::Terrain, "z")?;
        let n = self.inner.normal();
        if n.y.abs() < 1e-12 {
            let message = "normal: a vertical plane has no height".to_owned();
            let value = Value::Numbers(n.as_slice().to_vec());
            return Err(BorderError {
                kind: Kind::Terrain,
                message,
                field: Some("normal".to_owned()),
                value,
            }
            .into());
        }
        Ok(-(n.x * x + n.z * z + self.inner.offset()) / n.y)
    }

    fn __repr__(&self) -> String {
        let n = self.inner.normal();
        format!(
            "Plane(normal=({}, {}, {}), offset={})",
            n.x,
            n.y,
            n.z,
            self.inner.offset()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, (Normal, f64)) {
        let n = slf.get().inner.normal();
        (
            slf.get_type().into_any(),
            ((n.x, n.y, n.z), slf.get().inner.offset()),
        )
    }
}
