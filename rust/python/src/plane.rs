//! `Plane`.

use pyo3::prelude::*;
use rover_core::geometry::Plane as CorePlane;
use rover_task::draw::DrawnGround;

use crate::arguments::{Given, number};
use crate::arrays::{Array, fresh, triple};
use crate::errors::{Kind, Result, Value};
use crate::terrain::Terrain;

/// A plane as ground. The half-space `normal · x + offset >= 0` is free.
///
/// A normal of unit length is not normalised again, so the `normal` and `offset` of a plane
/// reproduce the plane bit for bit.
///
/// Args:
///     normal: Normal out of the ground, (3,), of any length; straight up by default.
///     offset: Gap between the world's origin and the plane, m; flat ground at height y has the
///         offset -y.
///
/// Raises:
///     TerrainError: A number is not finite, the normal has no direction, or the offset is beyond
///         1e6 m.
#[pyclass(module = "rover_gym.core", frozen, extends = Terrain)]
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
    ) -> Result<PyClassInitializer<Self>> {
        let offset = offset.number(0.0, Kind::Terrain, "offset")?;
        let normal = normal.map_or(Ok([0.0, 1.0, 0.0]), |n| triple(n, Kind::Terrain, "normal"))?;
        let inner = CorePlane::new(normal, offset)?;
        Ok(Self::of(inner))
    }

    /// The plane through the origin that rises by a slope in a direction.
    ///
    /// Args:
    ///     slope: Slope, rad.
    ///     uphill: Direction of steepest ascent, rad: an angle about +y from +x.
    ///
    /// Raises:
    ///     TerrainError: An angle is not a finite number.
    #[staticmethod]
    fn tilted(slope: &Bound<'_, PyAny>, uphill: &Bound<'_, PyAny>) -> Result<Py<Self>> {
        let angle = number(slope, Kind::Terrain, "slope")?;
        let uphill = number(uphill, Kind::Terrain, "uphill")?;
        Ok(Py::new(
            slope.py(),
            Self::of(rover_core::geometry::Plane::tilted(angle, uphill)?),
        )?)
    }

    /// Unit normal out of the ground, (3,).
    #[getter]
    fn normal(&self) -> Array {
        fresh(self.inner.normal().as_slice())
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
    fn height(&self, x: &Bound<'_, PyAny>, z: &Bound<'_, PyAny>) -> Result<f64> {
        let x = number(x, Kind::Terrain, "x")?;
        let z = number(z, Kind::Terrain, "z")?;
        let n = self.inner.normal();
        if n.y.abs() < 1e-12 {
            let message = "normal: a vertical plane has no height".to_owned();
            let value = Value::Numbers(n.as_slice().to_vec());
            return Err(Kind::Terrain.error("normal", message, value));
        }
        Ok(-(n.x * x + n.z * z + self.inner.offset()) / n.y)
    }

    fn __repr__(&self) -> String {
        let (n, offset) = (self.inner.normal(), self.inner.offset());
        format!("Plane(normal=({}, {}, {}), offset={offset})", n.x, n.y, n.z)
    }

    fn __getnewargs__(&self) -> ((f64, f64, f64), f64) {
        let n = self.inner.normal();
        ((n.x, n.y, n.z), self.inner.offset())
    }
}
