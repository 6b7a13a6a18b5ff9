//! `HeightField`.

use std::sync::Arc;

use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::draw::DrawnGround;
use rover_core::geometry::{HeightField as CoreField, Terrain as _};

use crate::arguments::{Given, refused};
use crate::arrays::{Array, check_size, one_or_two, two};
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
///
/// Raises:
///     TerrainError: The array has a wrong shape, a height is infinite or beyond 1e6 m, no cell
///         has data, or the spacing is not positive.
#[pyclass(module = "rover_gym.mechanics", frozen, extends = Terrain)]
pub struct HeightField {
    pub inner: Arc<CoreField>,
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
        Terrain::base(DrawnGround::Map(inner.clone())).add_subclass(Self { inner })
    }
}

#[pymethods]
impl HeightField {
    #[new]
    #[pyo3(signature = (heights, spacing, origin = None, material = Given::MISSING),
        text_signature = "(heights, spacing, origin=None, material='ground')")]
    fn new(
        py: Python<'_>,
        heights: &Bound<'_, PyAny>,
        spacing: &Bound<'_, PyAny>,
        origin: Option<&Bound<'_, PyAny>>,
        material: Given<'_>,
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
        Ok(Self::of(Arc::new(field)))
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

    fn __getnewargs__(&self) -> (Array<f32>, (f64, f64), (f64, f64), &str) {
        (self.grid(), self.spacing(), self.origin(), self.material())
    }
}
