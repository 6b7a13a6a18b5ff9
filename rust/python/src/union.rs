//! `Union`, the ground that is made of others.

use pyo3::prelude::*;
use rover_task::draw::DrawnGround;

use crate::errors::Result;
use crate::height_field::HeightField;
use crate::plane::Plane;
use crate::soft_ground::SoftGround;
use crate::sphere_field::SphereField;
use crate::terrain::{Terrain, union};
use crate::triangle_mesh::TriangleMesh;

/// A ground of the core as the object of its kind.
pub fn object<'py>(py: Python<'py>, ground: &DrawnGround) -> Result<Bound<'py, PyAny>> {
    Ok(match ground {
        DrawnGround::Plane(plane) => Bound::new(py, Plane::of(*plane))?.into_any(),
        DrawnGround::Field(field) => Bound::new(py, SphereField::of(field.clone()))?.into_any(),
        DrawnGround::Map(map) => Bound::new(py, HeightField::of(map.clone()))?.into_any(),
        DrawnGround::Mesh(mesh) => Bound::new(py, TriangleMesh::of(mesh.clone()))?.into_any(),
        DrawnGround::Soft(soft, surface) => {
            let own = object(py, surface)?.unbind();
            Bound::new(py, SoftGround::of(soft.clone(), (surface.clone(), own)))?.into_any()
        }
        DrawnGround::Union(..) => {
            Bound::new(py, Terrain::base(ground.clone()).add_subclass(Union))?.into_any()
        }
    })
}

/// Several terrains combined, for instance a map with rocks on it. Immutable.
///
/// A rover can touch each of them. With a plane the ground is known everywhere; otherwise it is
/// known where the parts together have it: height fields, and meshes beside them.
///
/// Where parts meet, their borders are no edges: a box slides from one to the next, and a ridge
/// between them is one ridge. Parts meet within 1e-5 of the length of an edge. Where they coincide,
/// a contact counts once, with the material of the first. What lies inside another part is not
/// touched.
///
/// Args:
///     parts: Terrains of any kind, at least one; at most one of them may have a plane.
///
/// Raises:
///     TerrainError: A part is not a terrain, the list is empty, or two parts contain a plane.
#[pyclass(module = "rover_gym.core", frozen, extends = Terrain)]
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
    fn new(parts: &Bound<'_, PyAny>) -> Result<PyClassInitializer<Self>> {
        Ok(Terrain::base(union(parts)?).add_subclass(Self))
    }

    /// The terrains, in the order they were given.
    #[getter]
    fn parts(slf: PyRef<'_, Self>) -> Result<Vec<Bound<'_, PyAny>>> {
        let grounds = Self::grounds(&slf).iter();
        grounds.map(|ground| object(slf.py(), ground)).collect()
    }

    fn __len__(slf: PyRef<'_, Self>) -> usize {
        Self::grounds(&slf).len()
    }

    fn __repr__(slf: PyRef<'_, Self>) -> Result<String> {
        let parts = Self::parts(slf)?;
        let shown = parts.iter().map(|part| Ok(part.repr()?.to_string()));
        Ok(format!(
            "Union([{}])",
            shown.collect::<PyResult<Vec<_>>>()?.join(", ")
        ))
    }

    fn __getnewargs__(slf: PyRef<'_, Self>) -> Result<(Vec<Bound<'_, PyAny>>,)> {
        Ok((Self::parts(slf)?,))
    }
}
