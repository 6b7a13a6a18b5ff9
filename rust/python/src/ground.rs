//! What a simulation stands on: a terrain of any kind, or a list of several; and the terrains that
//! are made of others.

use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use rover_core::draw::DrawnGround;
use rover_core::geometry::{
    SoftGround as CoreGround, SphereField as CoreField, Terrain, Union as CoreUnion,
};

use crate::arguments::{Given, refused, shown};
use crate::errors::{BorderError, Kind, Value};
use crate::height_field::HeightField;
use crate::heights::heights;
use crate::planar_ground::quantity;
use crate::plane::Plane;
use crate::rays::{Met, cast_rays};
use crate::sand::{numbers_of, soil_of};
use crate::triangle_mesh::TriangleMesh;

/// Any terrain.
#[derive(Clone, FromPyObject)]
pub enum Ground {
    /// A plane.
    Plane(Plane),
    /// A field of spheres.
    Field(SphereField),
    /// A map of heights.
    Map(HeightField),
    /// A mesh of triangles.
    Mesh(TriangleMesh),
    /// Sand.
    Soft(SoftGround),
    /// Several at once.
    Union(Union),
}

impl Ground {
    /// The core's view of it.
    pub fn terrain(&self) -> Arc<dyn Terrain> {
        match self {
            Self::Plane(plane) => Arc::new(plane.inner),
            Self::Field(field) => field.inner.clone(),
            Self::Map(map) => map.inner.clone(),
            Self::Mesh(mesh) => mesh.inner.clone(),
            Self::Soft(soft) => soft.inner.clone(),
            Self::Union(union) => union.inner.clone(),
        }
    }

    /// What episodes are drawn on.
    pub fn drawn(&self) -> DrawnGround {
        match self {
            Self::Plane(plane) => DrawnGround::Plane(plane.inner),
            Self::Field(field) => DrawnGround::Field(field.inner.clone()),
            Self::Map(map) => DrawnGround::Map(map.inner.clone()),
            Self::Mesh(mesh) => DrawnGround::Mesh(mesh.inner.clone()),
            Self::Soft(soft) => soft.drawn(),
            Self::Union(union) => {
                let parts = union.parts.iter().map(Self::drawn).collect();
                DrawnGround::Union(union.inner.clone(), parts)
            }
        }
    }

    /// What an episode was drawn on.
    pub fn of(drawn: &DrawnGround) -> Self {
        match drawn {
            DrawnGround::Plane(plane) => Self::Plane(Plane { inner: *plane }),
            DrawnGround::Field(field) => Self::Field(SphereField {
                inner: field.clone(),
            }),
            DrawnGround::Map(map) => Self::Map(HeightField { inner: map.clone() }),
            DrawnGround::Mesh(mesh) => Self::Mesh(TriangleMesh {
                inner: mesh.clone(),
            }),
            DrawnGround::Soft(soft, surface) => Self::Soft(SoftGround::of(soft, surface)),
            DrawnGround::Union(union, parts) => Self::Union(Union {
                inner: union.clone(),
                parts: parts.iter().map(Self::of).collect(),
            }),
        }
    }

    /// Any object as ground, a list or tuple as a union, or a `TerrainError`.
    pub fn parse(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
            return Ok(Self::Union(Union::of(given)?));
        }
        given.extract::<Self>().map_err(|_| {
            let shown = shown(given);
            let message = format!(
                "terrain: must be a Plane, SphereField, HeightField, TriangleMesh, SoftGround or \
                 Union, or a list of them, is {shown}"
            );
            let (field, value) = (Some("terrain".to_owned()), Value::Text(shown));
            BorderError {
                kind: Kind::Terrain,
                message,
                field,
                value,
            }
            .into()
        })
    }

    /// Back to Python.
    pub fn to_object<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(match self {
            Self::Plane(plane) => plane.clone().into_pyobject(py)?.into_any(),
            Self::Field(field) => field.clone().into_pyobject(py)?.into_any(),
            Self::Map(map) => map.clone().into_pyobject(py)?.into_any(),
            Self::Mesh(mesh) => mesh.clone().into_pyobject(py)?.into_any(),
            Self::Soft(soft) => soft.clone().into_pyobject(py)?.into_any(),
            Self::Union(union) => union.clone().into_pyobject(py)?.into_any(),
        })
    }
}

/// Fixed spheres, with or without a plane under them. Immutable.
///
/// Args:
///     centres: Centres of the spheres, (n, 3), m.
///     radii: Their radii, (n,), m.
///     ground: The plane under them; none by default. Its material is "ground".
///     material: Name of the spheres' material, for the laws of a `Simulation` by pair of
///         materials.
///
/// Raises:
///     TerrainError: An array has a wrong shape, an entry is not finite or out of its range, or
///         there are no spheres or too many of them.
#[pyclass(module = "rover_gym.mechanics", frozen, from_py_object)]
#[derive(Clone)]
pub struct SphereField {
    pub inner: Arc<CoreField>,
}

/// Ground of sand, into which wheels sink. To every other part of a machine its surface is rigid.
///
/// The ruts belong to a simulation and are part of its snapshots. Rocks on sand are a `Union` of
/// both. Steps on soft ground take the general path, not the batch's.
///
/// Args:
///     surface: The undisturbed surface: a `Plane`, `HeightField` or `TriangleMesh`.
///     soil: A `rover_gym.sand.Soil`, or a mapping of its numbers.
///     rut_cell: Size of a cell of the map of ruts, from 0.001 to 1 m.
///
/// Raises:
///     TerrainError: The surface is no terrain, or a number of the soil is missing or out of its
///         range.
#[pyclass(module = "rover_gym.mechanics", frozen, from_py_object)]
#[derive(Clone)]
pub struct SoftGround {
    pub inner: Arc<CoreGround>,
    surface: Arc<Ground>,
}

impl SoftGround {
    pub fn drawn(&self) -> DrawnGround {
        DrawnGround::Soft(self.inner.clone(), Arc::new(self.surface.drawn()))
    }

    pub fn of(inner: &Arc<CoreGround>, surface: &DrawnGround) -> Self {
        Self {
            inner: inner.clone(),
            surface: Arc::new(Ground::of(surface)),
        }
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
    ) -> PyResult<Self> {
        let ground = Ground::parse(surface)?;
        let cell = rut_cell.number(0.02, Kind::Terrain, "rut_cell")?;
        let made = CoreGround::new(ground.terrain(), Arc::new(soil_of(soil)?), cell);
        Ok(Self {
            inner: Arc::new(made.map_err(|e| quantity(Kind::Terrain, &e))?),
            surface: Arc::new(ground),
        })
    }

    /// The undisturbed surface.
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.surface.to_object(py)
    }

    /// Numbers of the soil by their names.
    #[getter]
    fn soil<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        numbers_of(py, self.inner.soil())
    }

    /// Size of a cell of the map of ruts, m.
    #[getter]
    fn rut_cell(&self) -> f64 {
        self.inner.cell()
    }

    /// The height of the undisturbed surface at places of the map.
    ///
    /// Args:
    ///     points: Places (x, z), (m, 2), m.
    ///
    /// Returns:
    ///     Heights y, (m,), m; nan where there is no ground.
    ///
    /// Raises:
    ///     TerrainError: `points` has a wrong shape.
    fn heights<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        heights(&*self.inner, py, points)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = slf.py();
        let own = slf.get();
        let arguments = (own.surface(py)?, own.soil(py)?, own.rut_cell());
        let arguments = arguments.into_pyobject(py)?.into_any();
        Ok((slf.get_type().into_any(), arguments))
    }
}

/// Several terrains as one ground: a map with rocks on it, say. Immutable.
///
/// A rover touches whatever of them it meets. Where a part has a plane, the ground is known
/// everywhere; otherwise it is known where a height field knows it.
///
/// Args:
///     parts: Terrains of any kind, at least one; at most one of them may have a plane.
///
/// Raises:
///     TerrainError: A part is no terrain, there is none, or two have a plane.
#[pyclass(module = "rover_gym.mechanics", frozen, from_py_object)]
#[derive(Clone)]
pub struct Union {
    pub inner: Arc<CoreUnion>,
    parts: Vec<Ground>,
}

impl Union {
    fn of(parts: &Bound<'_, PyAny>) -> PyResult<Self> {
        let listed = parts
            .try_iter()
            .map_err(|_| refused(parts, Kind::Terrain, "parts", "a list of terrains"))?;
        let parts = listed
            .map(|part| Ground::parse(&part?))
            .collect::<PyResult<Vec<_>>>()?;
        let terrains = parts.iter().map(Ground::terrain).collect();
        let inner = Arc::new(CoreUnion::new(terrains).map_err(BorderError::from)?);
        Ok(Self { inner, parts })
    }
}

#[pymethods]
impl Union {
    #[new]
    fn new(parts: &Bound<'_, PyAny>) -> PyResult<Self> {
        Self::of(parts)
    }

    /// The terrains, in the order they were given.
    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        self.parts.iter().map(|part| part.to_object(py)).collect()
    }

    /// The height of the visible surface at places of the map.
    ///
    /// Args:
    ///     points: Places (x, z), (m, 2), m.
    ///
    /// Returns:
    ///     Heights y, (m,), m; nan where there is no ground.
    ///
    /// Raises:
    ///     TerrainError: `points` has a wrong shape.
    fn heights<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        heights(&*self.inner, py, points)
    }

    /// Where rays meet the ground first.
    ///
    /// A surface is met from either side. What depth cameras and laser scanners measure.
    ///
    /// Args:
    ///     origins: Where the rays begin, world frame, (n, 3) or one (3,) for all, m.
    ///     directions: Where they go, world frame, (n, 3) or one (3,) for all, of any length.
    ///     max_range: Distance to which they are followed, m; without end by default.
    ///
    /// Returns:
    ///     Distances, (n,), m, infinite where nothing is met, and the surface's unit normals there,
    ///     world frame, (n, 3), nan where nothing is met.
    ///
    /// Raises:
    ///     OptionError: An array has a wrong shape or an entry that is not finite, a direction is
    ///         zero, an origin is beyond 1e6 m, or `max_range` is not positive.
    #[pyo3(signature = (origins, directions, max_range = Given::MISSING),
        text_signature = "($self, origins, directions, max_range=None)")]
    fn cast_rays<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        max_range: Given<'_>,
    ) -> PyResult<Met<'py>> {
        cast_rays(&*self.inner, py, origins, directions, max_range)
    }

    fn __len__(&self) -> usize {
        self.parts.len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let parts = self.parts(py)?;
        let shown = parts.iter().map(|part| Ok(part.repr()?.to_string()));
        let shown = shown.collect::<PyResult<Vec<_>>>()?;
        Ok(format!("Union([{}])", shown.join(", ")))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = slf.py();
        let parts = (slf.get().parts(py)?,);
        Ok((
            slf.get_type().into_any(),
            parts.into_pyobject(py)?.into_any(),
        ))
    }
}
