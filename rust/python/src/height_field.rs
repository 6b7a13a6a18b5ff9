//! `HeightField`.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::draw::DrawnGround;
use rover_core::geometry::{HeightField as CoreField, Terrain as _};

use crate::arguments::{Given, refused};
use crate::arrays::{check_size, one_or_two, two};
use crate::errors::{BorderError, Kind, Value};
use crate::materials;
use crate::terrain::Terrain;

/// A map of heights as ground: two triangles a cell, solid below. Immutable.
///
/// Row j and column i stand at z = origin[1] + j spacing[1] and x = origin[0] + i spacing[0]. Each
/// cell is cut along the diagonal from its corner (j, i) to (j + 1, i + 1). A height that is nan is
/// no data: a rover that comes near it, or to the border of the map, ends the call with a
/// `StepError` that names the place. Heights are kept in single precision.
///
/// Args:
///     heights: Heights y, (n_z, n_x), m; nan for no data.
///     spacing: Distance of columns and of rows, m: one number, or (dx, dz).
///     origin: Place (x, z) of the first height, m; by default such that the map's middle is at
///         the world's origin.
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
fn table(value: &Bound<'_, PyAny>) -> PyResult<(Vec<f32>, [usize; 2])> {
    let wrong = || refused(value, Kind::Terrain, "heights", "an array of numbers");
    check_size(value, Kind::Terrain, "heights")?;
    let numpy = value.py().import("numpy")?;
    let found = numpy
        .call_method1("asarray", (value,))
        .map_err(|_| wrong())?;
    let letter: char = found.getattr("dtype")?.getattr("kind")?.extract()?;
    if !"fiu".contains(letter) {
        return Err(wrong().into());
    }
    let options = PyDict::new(value.py());
    options.set_item("over", "ignore")?;
    let quiet = numpy.call_method("errstate", (), Some(&options))?;
    quiet.call_method0("__enter__")?;
    let single = numpy.call_method1("asarray", (&found, "float32"));
    let nothing = value.py().None();
    quiet.call_method1("__exit__", (&nothing, &nothing, &nothing))?;
    let single = single?.cast_into::<PyArrayDyn<f32>>()?;
    let view = single.readonly();
    let view = view.as_array();
    let [rows, columns] = *view.shape() else {
        return Err(BorderError {
            kind: Kind::Terrain,
            message: format!("heights: needs shape (n_z, n_x), has {:?}", view.shape()),
            field: Some("heights".to_owned()),
            value: Value::Count(view.ndim()),
        }
        .into());
    };
    Ok((view.iter().copied().collect(), [rows, columns]))
}

/// Calls a function of the package that gives heights, spacing and origin.
fn from_package<'py>(
    py: Python<'py>,
    name: &str,
    arguments: impl pyo3::call::PyCallArgs<'py>,
    options: Option<&Bound<'py, PyDict>>,
    material: Given<'py>,
) -> PyResult<Bound<'py, HeightField>> {
    let maps = py.import("rover_gym.maps")?;
    let made = maps.getattr(name)?.call(arguments, options)?;
    let (heights, spacing, origin) =
        made.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
    let field = HeightField::new(py, &heights, &spacing, Some(&origin), material)?;
    Bound::new(py, field)
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
    ) -> PyResult<PyClassInitializer<Self>> {
        let material = materials::name(material)?;
        let (heights, shape) = table(heights)?;
        let spacing = one_or_two(spacing, Kind::Terrain, "spacing")?;
        let origin = if let Some(origin) = origin {
            two(origin, Kind::Terrain, "origin")?
        } else {
            let middle = |n: usize, step: f64| -0.5 * step * (n.max(1) - 1) as f64;
            [middle(shape[1], spacing[0]), middle(shape[0], spacing[1])]
        };
        let field = py.detach(|| CoreField::new(heights, shape, spacing, origin));
        let mut field = field.map_err(BorderError::from)?;
        if let Some(material) = material {
            field = field.with_material(&material);
        }
        Ok(Self::of(Arc::new(field)))
    }

    /// Reads a map from a GeoTIFF, a PNG or a .npy file.
    ///
    /// Columns run along x and rows along z; of a map with north up, x is east and z south. A
    /// GeoTIFF brings its spacing, its unit and its mark for no data.
    ///
    /// Args:
    ///     path: Path of the file; its ending tells the format.
    ///     spacing: Distance of columns and of rows, m; needed unless the file gives it.
    ///     origin: Place (x, z) of the first height, m; by default such that the map's middle is
    ///         at the world's origin.
    ///     height_range: Of a PNG: heights of black and white, (2,), m.
    ///     scale: Factor from the file's numbers to m; of a GeoTIFF by default its own.
    ///     datum: Height of the file that becomes 0, in its own numbers; of a GeoTIFF by default
    ///         its lowest, otherwise 0.
    ///     band: Band of a GeoTIFF, from 1; needed if the file has several.
    ///     material: Name of its material.
    ///
    /// Returns:
    ///     The map.
    ///
    /// Raises:
    ///     TerrainError: The file is no such map or does not say enough; the message names it.
    ///     OSError: The file cannot be read.
    ///     MissingExtraError: The extra `maps` is not installed.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python function
    #[pyo3(signature = (path, *, spacing = None, origin = None, height_range = None, scale = None, datum = None, band = Given::MISSING, material = Given::MISSING),
        text_signature = "(path, *, spacing=None, origin=None, height_range=None, scale=None, datum=None, band=None, material='ground')")]
    fn from_file<'py>(
        py: Python<'py>,
        path: &Bound<'py, PyAny>,
        spacing: Option<&Bound<'py, PyAny>>,
        origin: Option<&Bound<'py, PyAny>>,
        height_range: Option<&Bound<'py, PyAny>>,
        scale: Option<&Bound<'py, PyAny>>,
        datum: Option<&Bound<'py, PyAny>>,
        band: Given<'py>,
        material: Given<'py>,
    ) -> PyResult<Bound<'py, Self>> {
        let options = PyDict::new(py);
        options.set_item(
            "spacing",
            spacing
                .map(|s| one_or_two(s, Kind::Terrain, "spacing"))
                .transpose()?,
        )?;
        options.set_item(
            "origin",
            origin
                .map(|o| two(o, Kind::Terrain, "origin"))
                .transpose()?,
        )?;
        options.set_item("height_range", height_range)?;
        options.set_item("scale", scale)?;
        options.set_item("datum", datum)?;
        if let Some(band) = band.given() {
            options.set_item("band", band)?;
        }
        from_package(py, "read_map", (path,), Some(&options), material)
    }

    /// Rough ground made by a seed: a self-affine surface, with craters and ripples on demand.
    ///
    /// The power of a wave of k cycles a metre falls as k^(-2 hurst - 2) from `longest_wave` to two
    /// cells. Craters are bowls with a rim, a fifth as deep as wide; those as wide as D or wider
    /// number D^-2. Ripples are waves across x, steeper on one side.
    ///
    /// Args:
    ///     size: Extent along x and z, m: one number, or two.
    ///     spacing: Distance of columns and of rows, m.
    ///     roughness: Root mean square of the rough part's heights, m.
    ///     hurst: Hurst exponent, in (0, 1); 0.7 by default.
    ///     longest_wave: Longest wave, m; half the smaller extent by default.
    ///     craters: Expected number of craters in each m² of a diameter of 1 m or more; 0 by
    ///         default.
    ///     crater_diameter: Smallest and largest diameter of craters, m; (0.5, 5) by default.
    ///     ripple_height: Height of ripples from trough to crest, m; 0 by default.
    ///     ripple_length: Their wavelength, m.
    ///     seed: Seed of the random numbers; equal seeds give equal ground.
    ///     origin: Place (x, z) of the first height, m; by default such that the map's middle is
    ///         at the world's origin.
    ///     material: Name of its material.
    ///
    /// Returns:
    ///     The map.
    ///
    /// Raises:
    ///     TerrainError: An argument is out of its range.
    ///
    /// Source: Turcotte 1997 (spectral synthesis); Pike 1977 and McGetchin, Settle and Head
    /// 1973 (craters).
    #[staticmethod]
    #[pyo3(signature = (size, spacing, roughness, *, material = Given::MISSING, **options),
        text_signature = "(size, spacing, roughness, *, hurst=0.7, longest_wave=None, craters=0.0, crater_diameter=(0.5, 5.0), ripple_height=0.0, ripple_length=1.0, seed=0, origin=None, material='ground')")]
    fn fractal<'py>(
        py: Python<'py>,
        size: &Bound<'py, PyAny>,
        spacing: &Bound<'py, PyAny>,
        roughness: &Bound<'py, PyAny>,
        material: Given<'py>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, Self>> {
        from_package(
            py,
            "fractal_map",
            (size, spacing, roughness),
            options,
            material,
        )
    }

    /// Name of its material.
    #[getter]
    fn material(&self) -> &str {
        self.inner.material(0)
    }

    /// Heights, (n_z, n_x) float32, m; nan for no data.
    #[getter]
    fn grid<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        PyArray1::from_slice(py, self.inner.heights()).reshape(self.inner.shape())
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

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = slf.py();
        let own = slf.get();
        let arguments = (own.grid(py)?, own.spacing(), own.origin(), own.material());
        Ok((
            slf.get_type().into_any(),
            arguments.into_pyobject(py)?.into_any(),
        ))
    }
}
