//! `TriangleMesh`.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::draw::DrawnGround;
use rover_core::geometry::{Terrain as _, TriangleMesh as CoreMesh};

use crate::arguments::{Given, refused};
use crate::arrays::{array, fresh_rows, rows};
use crate::errors::{BorderError, Kind};
use crate::materials;
use crate::terrain::Terrain;

/// A mesh of triangles as ground: rocks, or anything else that stands still. Immutable.
///
/// Triangles turn counterclockwise, seen from outside. A closed mesh is solid; an open one is
/// solid below.
///
/// Corners at exactly equal positions are joined, so triangles may each bring their own three
/// corners, as in an STL file. `triangles` then names the first of equal corners. Corners that
/// differ by rounding are not joined: wheels catch on the seam between them.
///
/// Args:
///     vertices: Corners, (n, 3), m.
///     triangles: Numbers of the three corners of each triangle, (m, 3).
///     material: Name of its material, for the laws of a `Simulation` by pair of materials.
///
/// Raises:
///     TerrainError: An array has a wrong shape, an entry is not finite, a triangle has no area or
///         names a corner that is not there, or two triangles turn opposite ways.
#[pyclass(module = "rover_gym.mechanics", frozen, extends = Terrain)]
pub struct TriangleMesh {
    pub inner: Arc<CoreMesh>,
}

/// Whole numbers (m, 3).
fn indices(value: &Bound<'_, PyAny>) -> PyResult<Vec<[usize; 3]>> {
    let given = array(value, Kind::Terrain, "triangles")?;
    let wrong = || refused(value, Kind::Terrain, "triangles", "whole numbers, (m, 3)");
    let view = given.as_array();
    if !view.is_empty() && (view.ndim() != 2 || view.shape()[1] != 3) {
        return Err(wrong().into());
    }
    let whole = |x: f64| {
        let fits = (0.0..4.0e9).contains(&x) && x.fract().abs() <= 0.0;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked
        fits.then_some(x as usize).ok_or_else(wrong)
    };
    let flat: Vec<usize> = view.iter().map(|&x| whole(x)).collect::<Result<_, _>>()?;
    Ok(flat.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect())
}

impl TriangleMesh {
    /// A mesh of the core, for Python.
    pub fn of(inner: Arc<CoreMesh>) -> PyClassInitializer<Self> {
        Terrain::base(DrawnGround::Mesh(inner.clone())).add_subclass(Self { inner })
    }
}

#[pymethods]
impl TriangleMesh {
    #[new]
    #[pyo3(signature = (vertices, triangles, material = Given::MISSING),
        text_signature = "(vertices, triangles, material='ground')")]
    fn new(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        material: Given<'_>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let material = materials::name(material)?;
        let vertices = rows::<3>(vertices, "vertices")?;
        let triangles = indices(triangles)?;
        let mesh = py.detach(|| CoreMesh::new(&vertices, &triangles));
        let mut mesh = mesh.map_err(BorderError::from)?;
        if let Some(material) = material {
            mesh = mesh.with_material(&material);
        }
        Ok(Self::of(Arc::new(mesh)))
    }

    /// Reads a mesh from a file: OBJ, PLY, STL, GLB and what else `trimesh` reads.
    ///
    /// Equal corners are joined, and triangles without an area are left out.
    ///
    /// Args:
    ///     path: Path of the file; its ending tells the format.
    ///     scale: Factor from the file's numbers to m.
    ///     position: Place of the file's origin, (3,), m; the world's origin by default.
    ///     up: Axis of the file that points up: "y" or "z".
    ///     material: Name of its material.
    ///
    /// Returns:
    ///     The mesh.
    ///
    /// Raises:
    ///     TerrainError: The file holds no such mesh; the message names it.
    ///     OSError: The file cannot be read.
    ///     MissingExtraError: The extra `maps` is not installed.
    #[staticmethod]
    #[pyo3(signature = (path, *, material = Given::MISSING, **options),
        text_signature = "(path, *, scale=1.0, position=(0.0, 0.0, 0.0), up='y', material='ground')")]
    fn from_file<'py>(
        py: Python<'py>,
        path: &Bound<'py, PyAny>,
        material: Given<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Bound<'py, Self>> {
        let maps = py.import("rover_gym.maps")?;
        let made = maps.getattr("read_mesh")?.call((path,), options)?;
        let (vertices, triangles) = made.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
        Bound::new(py, Self::new(py, &vertices, &triangles, material)?)
    }

    /// Name of its material.
    #[getter]
    fn material(&self) -> &str {
        self.inner.material(0)
    }

    /// Corners, (n, 3), m.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let vertices: Vec<[f64; 3]> = self.inner.vertices().iter().map(|&v| v.into()).collect();
        fresh_rows(py, &vertices)
    }

    /// Numbers of the corners of each triangle, (m, 3).
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let triangles = self.inner.triangles();
        PyArray1::from_iter(py, triangles.iter().flatten().copied()).reshape([triangles.len(), 3])
    }

    /// Whether no triangle has a free border.
    #[getter]
    fn is_closed(&self) -> bool {
        self.inner.is_closed()
    }

    fn __len__(&self) -> usize {
        self.inner.triangles().len()
    }

    fn __repr__(&self) -> String {
        let (n, m) = (self.inner.vertices().len(), self.inner.triangles().len());
        format!("TriangleMesh({n} vertices, {m} triangles)")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = slf.py();
        let own = slf.get();
        let arguments = (own.vertices(py)?, own.triangles(py)?, own.material());
        Ok((
            slf.get_type().into_any(),
            arguments.into_pyobject(py)?.into_any(),
        ))
    }
}
