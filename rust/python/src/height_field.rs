//! `HeightField`.

use std::sync::Arc;

use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::geometry::{HeightField as CoreField, Terrain as _};
use rover_task::draw::DrawnGround;

use crate::arguments::{Given, number, refused};
use crate::arrays::{Array, check_size, one_or_two, two, vector};
use crate::errors::{Kind, Result, Value};
use crate::materials;
use crate::shared::Release;
use crate::terrain::Terrain;

/// A height map as ground: two triangles in each cell, solid below. Immutable.
///
/// Row j and column i stand at z = origin[1] + j spacing[1] and x = origin[0] + i spacing[0]. Each
/// cell is cut along the diagonal from its corner (j, i) to (j + 1, i + 1). A height of NaN means
/// unknown ground. If a rover comes near unknown ground or the border of the map, the step raises a
/// `StepError` that gives the place. Heights are stored in single precision.
/// `HeightField.from_file` reads a map, `HeightField.fractal` generates one from a seed.
///
/// Args:
///     heights: Heights y, (n_z, n_x), m; NaN where unknown.
///     spacing: Distance of columns and of rows, m: one number, or (dx, dz).
///     origin: Place (x, z) of the first height, m. By default the middle of the map is at the
///         world's origin.
///     material: Name of its material, for the laws of a `Simulation` by pair of materials.
///     map_frame: Easting and northing of the world's origin in the coordinates of a map, and
///         their change per metre along x and along z, (4,). `from_file` reads it from a GeoTIFF.
///
/// Raises:
///     TerrainError: The array has a wrong shape, a height is infinite or beyond 1e6 m, no cell
///         has data, the spacing is not positive, or a change per metre is 0.
#[pyclass(module = "rover_gym.core", frozen, extends = Terrain)]
pub struct HeightField {
    pub inner: Arc<CoreField>,
    map_frame: Option<[f64; 4]>,
}

/// Checks the four numbers of a map's frame.
fn frame_of(given: &Bound<'_, PyAny>) -> Result<[f64; 4]> {
    let numbers = vector(given, Kind::Terrain, "map_frame")?;
    let what = "four finite numbers, of which the last two are not 0";
    match <[f64; 4]>::try_from(numbers) {
        Ok(frame) if frame[2] * frame[3] != 0.0 && frame.iter().all(|x| x.is_finite()) => Ok(frame),
        _ => Err(refused(given, Kind::Terrain, "map_frame", what)),
    }
}

/// Numbers of two dimensions in single precision.
fn table(value: &Bound<'_, PyAny>) -> Result<(Vec<f32>, [usize; 2])> {
    let wrong = || refused(value, Kind::Terrain, "heights", "an array of numbers");
    check_size(value, Kind::Terrain, "heights")?;
    let numpy = value.py().import("numpy")?;
    let found = numpy
        .call_method1("asarray", (value,))
        .map_err(|_| wrong())?;
    let letter: char = found.getattr("dtype")?.getattr("kind")?.extract()?;
    if !"fiu".contains(letter) {
        return Err(wrong());
    }
    let options = PyDict::new(value.py());
    options.set_item("over", "ignore")?;
    let quiet = numpy.call_method("errstate", (), Some(&options))?;
    quiet.call_method0("__enter__")?;
    let single = numpy.call_method1("asarray", (&found, "float32"));
    let nothing = value.py().None();
    quiet.call_method1("__exit__", (&nothing, &nothing, &nothing))?;
    let single = single?
        .cast_into::<PyArrayDyn<f32>>()
        .map_err(PyErr::from)?;
    let view = single.readonly();
    let view = view.as_array();
    let [rows, columns] = *view.shape() else {
        let message = format!("heights: needs shape (n_z, n_x), has {:?}", view.shape());
        return Err(Kind::Terrain.error("heights", message, Value::Count(view.ndim())));
    };
    Ok((view.iter().copied().collect(), [rows, columns]))
}

impl HeightField {
    /// A map of the core, for Python.
    pub fn of(inner: Arc<CoreField>) -> PyClassInitializer<Self> {
        Self::placed(inner, None)
    }

    fn placed(inner: Arc<CoreField>, map_frame: Option<[f64; 4]>) -> PyClassInitializer<Self> {
        Terrain::base(DrawnGround::Map(inner.clone())).add_subclass(Self { inner, map_frame })
    }

    /// The frame of its map; an error without one.
    fn frame(&self) -> Result<[f64; 4]> {
        let message = "map_frame: this ground has no map coordinates; a GeoTIFF gives them";
        self.map_frame
            .ok_or_else(|| Kind::Terrain.error("map_frame", message.to_owned(), Value::Nothing))
    }
}

#[pymethods]
impl HeightField {
    #[new]
    #[pyo3(signature = (heights, spacing, origin = None, material = Given::MISSING, map_frame = None),
        text_signature = "(heights, spacing, origin=None, material='ground', map_frame=None)")]
    fn new(
        py: Python<'_>,
        heights: &Bound<'_, PyAny>,
        spacing: &Bound<'_, PyAny>,
        origin: Option<&Bound<'_, PyAny>>,
        material: Given<'_>,
        map_frame: Option<&Bound<'_, PyAny>>,
    ) -> Result<PyClassInitializer<Self>> {
        let material = materials::name(material)?;
        let (heights, shape) = table(heights)?;
        let spacing = one_or_two(spacing, Kind::Terrain, "spacing")?;
        let middle = |n: usize, step: f64| -0.5 * step * (n.max(1) - 1) as f64;
        let origin = match origin {
            Some(origin) => two(origin, Kind::Terrain, "origin")?,
            None => [middle(shape[1], spacing[0]), middle(shape[0], spacing[1])],
        };
        let mut field = py.release(|| CoreField::new(heights, shape, spacing, origin))??;
        if let Some(material) = material {
            field = field.with_material(&material);
        }
        let map_frame = map_frame.map(frame_of).transpose()?;
        Ok(Self::placed(Arc::new(field), map_frame))
    }

    /// Easting and northing of the world's origin, and their change per metre; None without a map.
    ///
    /// Four numbers: the last two are the changes of easting along x and of northing along z.
    #[getter]
    fn map_frame(&self) -> Option<(f64, f64, f64, f64)> {
        self.map_frame.map(Into::into)
    }

    /// Place (x, z), m, of a point in map coordinates.
    ///
    /// Args:
    ///     easting: Easting, in the unit of the map.
    ///     northing: Northing, in the unit of the map.
    ///
    /// Raises:
    ///     TerrainError: The ground has no map coordinates, or a number is not finite.
    fn place_of(
        &self,
        easting: &Bound<'_, PyAny>,
        northing: &Bound<'_, PyAny>,
    ) -> Result<(f64, f64)> {
        let [e, n, per_x, per_z] = self.frame()?;
        let easting = number(easting, Kind::Terrain, "easting")?;
        let northing = number(northing, Kind::Terrain, "northing")?;
        Ok(((easting - e) / per_x, (northing - n) / per_z))
    }

    /// Easting and northing of a place, in the unit of the map.
    ///
    /// Args:
    ///     x: Along x, m.
    ///     z: Along z, m.
    ///
    /// Raises:
    ///     TerrainError: The ground has no map coordinates, or a number is not finite.
    fn coordinates_of(&self, x: &Bound<'_, PyAny>, z: &Bound<'_, PyAny>) -> Result<(f64, f64)> {
        let [e, n, per_x, per_z] = self.frame()?;
        let (x, z) = (
            number(x, Kind::Terrain, "x")?,
            number(z, Kind::Terrain, "z")?,
        );
        Ok((e + per_x * x, n + per_z * z))
    }

    /// Name of its material.
    #[getter]
    fn material(&self) -> &str {
        self.inner.material(0)
    }

    /// Heights, (n_z, n_x) float32, m; NaN where unknown.
    #[getter]
    fn grid(&self) -> Array<f32> {
        Array::shaped(self.inner.heights().to_vec(), &self.inner.shape())
    }

    /// Number of rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        self.inner.shape().into()
    }

    /// Distance of columns and of rows, (dx, dz), m.
    #[getter]
    fn spacing(&self) -> (f64, f64) {
        self.inner.spacing().into()
    }

    /// Place (x, z) of the first height, m.
    #[getter]
    fn origin(&self) -> (f64, f64) {
        self.inner.origin().into()
    }

    /// Corners x_min, z_min, x_max, z_max of the map, m.
    #[getter]
    fn bounds(&self) -> (f64, f64, f64, f64) {
        let ([rows, columns], [dx, dz]) = (self.inner.shape(), self.inner.spacing());
        let [x, z] = self.inner.origin();
        let end = |low: f64, n: usize, step: f64| low + (n - 1) as f64 * step;
        (x, z, end(x, columns, dx), end(z, rows, dz))
    }

    fn __repr__(&self) -> String {
        let ([rows, columns], [dx, dz]) = (self.inner.shape(), self.inner.spacing());
        format!("HeightField({rows} x {columns} heights, spacing=({dx}, {dz}))")
    }

    #[allow(clippy::type_complexity)] // the arguments of `new`
    fn __getnewargs__(
        &self,
    ) -> (
        Array<f32>,
        (f64, f64),
        (f64, f64),
        &str,
        Option<(f64, f64, f64, f64)>,
    ) {
        (
            self.grid(),
            self.spacing(),
            self.origin(),
            self.material(),
            self.map_frame(),
        )
    }
}
