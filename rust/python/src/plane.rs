//! `Plane`.

use numpy::PyArray1;
use pyo3::prelude::*;
use rover_core::draw::{DrawnGround, tilted_plane};
use rover_core::geometry::Plane as CorePlane;

use crate::arguments::{Given, number};
use crate::arrays::{fresh, triple};
use crate::errors::{BorderError, Kind, Value};
use crate::terrain::Terrain;

type Normal = (f64, f64, f64);

/// A plane as ground: the half-space `normal · x + offset >= 0` is free, the ground lies below.
///
/// A normal of unit length is taken as it is, so a plane's own `normal` and `offset` make the same
/// plane to the bit.
///
/// Args:
///     normal: Direction out of the ground, (3,), of any length; straight up by default.
///     offset: Gap between the world's origin and the plane, m; flat ground at height y has the
///         offset -y.
///
/// Raises:
///     TerrainError: A number is not finite, the normal has no direction, or the offset is beyond
///         1e6 m.
#[pyclass(module = "rover_gym.mechanics", frozen, extends = Terrain)]
pub struct Plane {
    pub inner: CorePlane,
}

impl Plane {
    /// A plane of the core, for Python.
    pub fn of(inner: CorePlane) -> PyClassInitializer<Self> {
        Terrain::base(DrawnGround::Plane(inner)).add_subclass(Self { inner })
    }
}

#[pymethods]
impl Plane {
    #[new]
    #[pyo3(signature = (normal = None, offset = Given::MISSING), text_signature = "(normal=None, offset=0.0)")]
    fn new(
        normal: Option<&Bound<'_, PyAny>>,
        offset: Given<'_>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let offset = offset.number(0.0, Kind::Terrain, "offset")?;
        let normal = normal.map_or(Ok([0.0, 1.0, 0.0]), |n| triple(n, Kind::Terrain, "normal"))?;
        let inner = CorePlane::new(normal, offset).map_err(BorderError::from)?;
        Ok(Self::of(inner))
    }

    /// The plane through the origin that rises by a slope in a direction.
    ///
    /// Args:
    ///     slope: Slope, rad.
    ///     uphill: Direction of steepest ascent, rad: an angle about +y from +x.
    ///
    /// Returns:
    ///     The plane.
    ///
    /// Raises:
    ///     TerrainError: An angle is no finite number.
    #[staticmethod]
    fn tilted<'py>(
        slope: &Bound<'py, PyAny>,
        uphill: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, Self>> {
        let py = slope.py();
        let slope = number(slope, Kind::Terrain, "slope")?;
        let uphill = number(uphill, Kind::Terrain, "uphill")?;
        let inner = tilted_plane(slope, uphill).map_err(BorderError::from)?;
        Bound::new(py, Self::of(inner))
    }

    /// Unit normal out of the ground, (3,).
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        fresh(py, self.inner.normal().as_slice())
    }

    /// Gap between the world's origin and the plane, m; flat ground at height y has the offset -y.
    #[getter]
    fn offset(&self) -> f64 {
        self.inner.offset()
    }

    /// The height of the plane at a place.
    ///
    /// Args:
    ///     x: Coordinate forward, m.
    ///     z: Coordinate to the right, m.
    ///
    /// Returns:
    ///     The height y, m.
    ///
    /// Raises:
    ///     TerrainError: The plane is vertical, or an argument is not a number.
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
