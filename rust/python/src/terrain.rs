//! `Terrain`, the base of every ground, and `Union`, which is made of others.

use std::sync::Arc;

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use rover_core::draw::DrawnGround;
use rover_core::geometry::{Union as CoreUnion, ray};

use crate::arguments::{Given, refused, shown};
use crate::arrays::{fresh, rows};
use crate::errors::{BorderError, Kind, Value};
use crate::height_field::HeightField;
use crate::plane::Plane;
use crate::rays::{Met, met, rays};
use crate::sphere_field::SphereField;
use crate::triangle_mesh::TriangleMesh;

/// Ground of any kind. Immutable.
///
/// `Plane`, `SphereField`, `HeightField`, `TriangleMesh` and `Union` are its kinds.
#[pyclass(module = "rover_gym.mechanics", frozen, subclass)]
pub struct Terrain {
    pub ground: DrawnGround,
}

impl Terrain {
    /// What a class of ground is built upon.
    pub fn base(ground: DrawnGround) -> PyClassInitializer<Self> {
        PyClassInitializer::from(Self { ground })
    }
}

/// Any object as ground, a list or tuple as a union, or a `TerrainError`.
pub fn parse(given: &Bound<'_, PyAny>) -> PyResult<DrawnGround> {
    if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
        return union(given);
    }
    if let Ok(terrain) = given.cast::<Terrain>() {
        return Ok(terrain.get().ground.clone());
    }
    let shown = shown(given);
    Err(BorderError {
        kind: Kind::Terrain,
        message: format!(
            "terrain: must be a Plane, SphereField, HeightField, TriangleMesh or Union, or a list \
             of them, is {shown}"
        ),
        field: Some("terrain".to_owned()),
        value: Value::Text(shown),
    }
    .into())
}

/// Back to Python.
pub fn object<'py>(py: Python<'py>, ground: &DrawnGround) -> PyResult<Bound<'py, PyAny>> {
    Ok(match ground {
        DrawnGround::Plane(plane) => Bound::new(py, Plane::of(*plane))?.into_any(),
        DrawnGround::Field(field) => Bound::new(py, SphereField::of(field.clone()))?.into_any(),
        DrawnGround::Map(map) => Bound::new(py, HeightField::of(map.clone()))?.into_any(),
        DrawnGround::Mesh(mesh) => Bound::new(py, TriangleMesh::of(mesh.clone()))?.into_any(),
        DrawnGround::Union(..) => {
            Bound::new(py, Terrain::base(ground.clone()).add_subclass(Union))?.into_any()
        }
    })
}

/// Several terrains as one.
fn union(parts: &Bound<'_, PyAny>) -> PyResult<DrawnGround> {
    let listed = parts
        .try_iter()
        .map_err(|_| refused(parts, Kind::Terrain, "parts", "a list of terrains"))?;
    let parts = (listed.map(|part| parse(&part?))).collect::<PyResult<Arc<[DrawnGround]>>>()?;
    let terrains = parts.iter().map(DrawnGround::terrain).collect();
    let union = CoreUnion::new(terrains).map_err(BorderError::from)?;
    Ok(DrawnGround::Union(Arc::new(union), parts))
}

#[pymethods]
impl Terrain {
    /// The height of the visible surface at places of the map.
    ///
    /// Args:
    ///     points: Places (x, z), (m, 2), m.
    ///
    /// Returns:
    ///     Heights y, (m,), m; nan where there is no ground or no data.
    ///
    /// Raises:
    ///     TerrainError: `points` has a wrong shape.
    fn heights<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (terrain, points) = (self.ground.terrain(), rows::<2>(points, "points")?);
        let height = |&[x, z]: &[f64; 2]| terrain.height(x, z).unwrap_or(f64::NAN);
        let heights: Vec<f64> = points.iter().map(height).collect();
        Ok(fresh(py, &heights))
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
        let (terrain, (rays, range)) =
            (self.ground.terrain(), rays(origins, directions, max_range)?);
        let hits = py.detach(|| ray::cast(&*terrain, &rays, range));
        met(py, &hits)
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
#[pyclass(module = "rover_gym.mechanics", frozen, extends = Terrain)]
pub struct Union;

impl Union {
    /// The terrains of one.
    fn grounds<'a>(slf: &'a PyRef<'_, Self>) -> &'a [DrawnGround] {
        match &slf.as_super().ground {
            DrawnGround::Union(_, parts) => parts,
            _ => &[],
        }
    }
}

#[pymethods]
impl Union {
    #[new]
    fn new(parts: &Bound<'_, PyAny>) -> PyResult<PyClassInitializer<Self>> {
        Ok(Terrain::base(union(parts)?).add_subclass(Self))
    }

    /// The terrains, in the order they were given.
    #[getter]
    fn parts<'py>(slf: PyRef<'py, Self>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let grounds = Self::grounds(&slf).iter();
        grounds.map(|ground| object(slf.py(), ground)).collect()
    }

    fn __len__(slf: PyRef<'_, Self>) -> usize {
        Self::grounds(&slf).len()
    }

    fn __repr__(slf: PyRef<'_, Self>) -> PyResult<String> {
        let parts = Self::parts(slf)?;
        let shown = parts.iter().map(|part| Ok(part.repr()?.to_string()));
        let shown = shown.collect::<PyResult<Vec<_>>>()?;
        Ok(format!("Union([{}])", shown.join(", ")))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let parts = (Self::parts(slf.borrow())?,);
        let parts = parts.into_pyobject(slf.py())?.into_any();
        Ok((slf.get_type().into_any(), parts))
    }
}
