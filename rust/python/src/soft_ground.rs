//! `SoftGround`.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::geometry::SoftGround as CoreGround;
use rover_task::draw::DrawnGround;

use crate::arguments::{Given, object};
use crate::errors::{Kind, Result};
use crate::planar_ground::quantity;
use crate::sand::{numbers_of, soil_of};
use crate::terrain::Terrain;

/// Sand, into which wheels sink. All other parts of a machine touch its surface as rigid ground.
///
/// The ruts belong to a simulation and are part of its snapshots. For rocks on sand, use a `Union`
/// of both. Beside firm ground other than spheres, contacts are found one rover at a time, which is
/// slower in a batch.
///
/// Args:
///     surface: The undisturbed surface: a `Plane`, `HeightField` or `TriangleMesh`.
///     soil: A `rover_gym.ground.sand.Soil`, or a mapping of its numbers.
///     rut_cell: Size of a cell of the map of ruts, from 0.001 to 1 m.
///
/// Raises:
///     TerrainError: The surface is not a terrain, or a number of the soil is missing or out of
///         range.
#[pyclass(module = "rover_gym.core", frozen, extends = Terrain)]
pub struct SoftGround {
    inner: Arc<CoreGround>,
    surface: Py<PyAny>,
}

impl SoftGround {
    /// Sand of the core, for Python; `surface`: its surface for the core and for Python.
    pub fn of(
        inner: Arc<CoreGround>,
        (drawn, surface): (Arc<DrawnGround>, Py<PyAny>),
    ) -> PyClassInitializer<Self> {
        let ground = DrawnGround::Soft(inner.clone(), drawn);
        Terrain::base(ground).add_subclass(Self { inner, surface })
    }
}

#[pymethods]
impl SoftGround {
    #[new]
    #[pyo3(signature = (surface, soil, rut_cell = Given::MISSING),
        text_signature = "(surface, soil, rut_cell=0.02)")]
    fn new(
        surface: &Bound<'_, PyAny>,
        soil: &Bound<'_, PyAny>,
        rut_cell: Given<'_>,
    ) -> Result<PyClassInitializer<Self>> {
        let what = "a Plane, HeightField or TriangleMesh";
        let drawn = object::<Terrain>(surface, Kind::Terrain, "surface", what)?;
        let drawn = drawn.get().ground.clone();
        let cell = rut_cell.number(0.02, Kind::Terrain, "rut_cell")?;
        let made = CoreGround::new(drawn.terrain(), Arc::new(soil_of(soil)?), cell);
        let made = made.map_err(|e| quantity(Kind::Terrain, &e))?;
        let surface = (Arc::new(drawn), surface.clone().unbind());
        Ok(Self::of(Arc::new(made), surface))
    }

    /// The undisturbed surface.
    #[getter]
    fn surface(&self, py: Python<'_>) -> Py<PyAny> {
        self.surface.clone_ref(py)
    }

    /// Numbers of the soil by their names.
    #[getter]
    fn soil<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        numbers_of(py, self.inner.soil())
    }

    /// Size of a cell of the map of ruts, m.
    #[getter]
    fn rut_cell(&self) -> f64 {
        self.inner.cell()
    }

    fn __getnewargs__<'py>(&self, py: Python<'py>) -> Result<(Py<PyAny>, Bound<'py, PyDict>, f64)> {
        Ok((self.surface(py), self.soil(py)?, self.rut_cell()))
    }
}
