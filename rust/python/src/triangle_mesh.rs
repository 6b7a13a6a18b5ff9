//! `TriangleMesh`.

use std::sync::Arc;

use pyo3::prelude::*;
use rover_core::geometry::{Terrain as _, TriangleMesh as CoreMesh};
use rover_task::draw::DrawnGround;

use crate::arguments::{Given, refused};
use crate::arrays::{Array, array, fresh_rows, rows};
use crate::errors::{Kind, Result};
use crate::materials;
use crate::shared::Release;
use crate::terrain::Terrain;

/// A triangle mesh as fixed ground, for instance a rock. Immutable.
///
/// Corners are listed counterclockwise, seen from outside. A closed mesh is solid inside, an open
/// one below.
///
/// Corners at exactly equal positions are merged, so each triangle may have its own three corners,
/// as in an STL file. Corners that differ by rounding are not merged, and wheels catch on the seam
/// between them. `TriangleMesh.from_file` reads a mesh.
///
/// Args:
///     vertices: Corners, (n, 3), m.
///     triangles: Numbers of the three corners of each triangle, (m, 3).
///     material: Name of its material, for the laws of a `Simulation` by pair of materials.
///
/// Raises:
///     TerrainError: An array has a wrong shape, an entry is not finite, a triangle has no area or
///         an index out of range, or neighbouring triangles have opposite orientations.
#[pyclass(module = "rover_gym.core", frozen, extends = Terrain)]
pub struct TriangleMesh {
    pub inner: Arc<CoreMesh>,
}

/// Whole numbers (m, 3).
fn indices(value: &Bound<'_, PyAny>) -> Result<Vec<[usize; 3]>> {
    let given = array(value, Kind::Terrain, "triangles")?;
    let wrong = || refused(value, Kind::Terrain, "triangles", "whole numbers, (m, 3)");
    let view = given.as_array();
    if !view.is_empty() && (view.ndim() != 2 || view.shape()[1] != 3) {
        return Err(wrong());
    }
    let whole = |x: f64| {
        let fits = (0.0..4.0e9).contains(&x) && x.fract().abs() <= 0.0;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked
        fits.then_some(x as usize).ok_or_else(wrong)
    };
    let flat: Vec<usize> = view.iter().map(|&x| whole(x)).collect::<Result<_>>()?;
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
    ) -> Result<PyClassInitializer<Self>> {
        let material = materials::name(material)?;
        let vertices = rows::<3>(vertices, "vertices")?;
        let triangles = indices(triangles)?;
        let mut mesh = py.release(|| CoreMesh::new(&vertices, &triangles))??;
        if let Some(material) = material {
            mesh = mesh.with_material(&material);
        }
        Ok(Self::of(Arc::new(mesh)))
    }

    /// Name of its material.
    #[getter]
    fn material(&self) -> &str {
        self.inner.material(0)
    }

    /// Corners, (n, 3), m.
    #[getter]
    fn vertices(&self) -> Array {
        fresh_rows(self.inner.vertices().iter().map(|&v| v.into()))
    }

    /// Numbers of the corners of each triangle, (m, 3).
    #[getter]
    fn triangles(&self) -> Array<u32> {
        fresh_rows(self.inner.triangles().iter().copied())
    }

    /// Whether the mesh is closed, so that no triangle has a free edge.
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

    fn __getnewargs__(&self) -> (Array, Array<u32>, &str) {
        (self.vertices(), self.triangles(), self.material())
    }
}
