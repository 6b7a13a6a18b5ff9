//! `Terrain`, the base of every ground.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use rover_core::geometry::{Union as CoreUnion, ray};
use rover_task::draw::DrawnGround;

use crate::arguments::{Given, is_path, refused};
use crate::arrays::{Array, rows};
use crate::errors::{Kind, Result};
use crate::rays::{Met, met, rays};
use crate::shared::Release;

/// Base class of all grounds. Immutable.
///
/// Its subclasses are `Plane`, `SphereField`, `HeightField`, `TriangleMesh`, `SoftGround` and
/// `Union`.
#[pyclass(module = "rover_gym.core", frozen, subclass)]
pub struct Terrain {
    pub ground: DrawnGround,
}

impl Terrain {
    /// What a class of ground is built upon.
    pub fn base(ground: DrawnGround) -> PyClassInitializer<Self> {
        PyClassInitializer::from(Self { ground })
    }
}

/// Any object as ground, a path as the map or mesh in that file, a list or tuple as a union, or a
/// `TerrainError`.
pub fn parse(given: &Bound<'_, PyAny>) -> Result<DrawnGround> {
    if is_path(given)? {
        let class = given.py().get_type::<Terrain>();
        return parse(&class.call_method1("_opened", (given,))?);
    }
    if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
        return union(given);
    }
    if let Ok(terrain) = given.cast::<Terrain>() {
        return Ok(terrain.get().ground.clone());
    }
    let what = "a Plane, SphereField, HeightField, TriangleMesh, SoftGround or Union, a file of a \
                map or a mesh, or a list of them";
    Err(refused(given, Kind::Terrain, "terrain", what))
}

/// Several terrains as one.
pub fn union(parts: &Bound<'_, PyAny>) -> Result<DrawnGround> {
    let listed = parts
        .try_iter()
        .map_err(|_| refused(parts, Kind::Terrain, "parts", "a list of terrains"))?;
    let parts = (listed.map(|part| parse(&part?))).collect::<Result<Arc<[DrawnGround]>>>()?;
    let terrains = parts.iter().map(DrawnGround::terrain).collect();
    let union = CoreUnion::new(terrains)?;
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
    ///     Heights y, (m,), m; NaN if there is no ground or no data.
    ///
    /// Raises:
    ///     TerrainError: `points` has a wrong shape.
    fn heights(&self, points: &Bound<'_, PyAny>) -> Result<Array> {
        let (terrain, points) = (self.ground.terrain(), rows::<2>(points, "points")?);
        let height = |&[x, z]: &[f64; 2]| terrain.height(x, z).unwrap_or(f64::NAN);
        Ok(points.iter().map(height).collect())
    }

    /// Finds the first point at which each ray hits the ground.
    ///
    /// Surfaces are hit from both sides. Use it to simulate depth cameras and laser scanners.
    ///
    /// Args:
    ///     origins: Origins of the rays, world frame, (n, 3) or one (3,) for all, m.
    ///     directions: Directions of the rays, world frame, (n, 3) or one (3,) for all, of any
    ///         length.
    ///     max_range: Largest distance, m; unlimited by default.
    ///
    /// Returns:
    ///     Distances, (n,), m, and the surface's unit normals at the hits, world frame, (n, 3). A
    ///     ray without a hit has an infinite distance and a NaN normal.
    ///
    /// Raises:
    ///     OptionError: An array has a wrong shape or an entry that is not finite, a direction is
    ///         zero, an origin is beyond 1e6 m, or `max_range` is not positive.
    #[pyo3(signature = (origins, directions, max_range = Given::MISSING),
        text_signature = "($self, origins, directions, max_range=None)")]
    fn cast_rays(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        max_range: Given<'_>,
    ) -> Result<Met> {
        let (terrain, (rays, range)) =
            (self.ground.terrain(), rays(origins, directions, max_range)?);
        let hits = py.release(|| ray::cast(&*terrain, &rays, range))?;
        Ok(met(&hits))
    }
}
