//! `SphereField`.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rover_core::draw::DrawnGround;
use rover_core::geometry::{
    Clearing, Plane as CorePlane, Rocks, SphereField as CoreField, Terrain as _,
};

use crate::arguments::{Given, number, refused, whole};
use crate::arrays::{fresh_rows, one_or_two, rows, vector};
use crate::errors::{BorderError, Kind, Value};
use crate::files::{self, in_file, read_text};
use crate::materials;
use crate::plane::Plane;
use crate::terrain::{Terrain, parse};

/// Longest file of spheres, bytes.
const MAX_FILE: usize = 1 << 28;

fn build(
    py: Python<'_>,
    centres: &[[f64; 3]],
    radii: &[f64],
    ground: Option<CorePlane>,
) -> Result<CoreField, BorderError> {
    Ok(py.detach(|| CoreField::new(centres, radii, ground))?)
}

/// A plane, or none.
fn plane(given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<CorePlane>> {
    let read = |given: &Bound<'_, PyAny>| match given.cast::<Plane>() {
        Ok(plane) => Ok(plane.get().inner),
        Err(_) => Err(refused(given, Kind::Terrain, "ground", "a Plane").into()),
    };
    given.map(read).transpose()
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
#[pyclass(module = "rover_gym.mechanics", frozen, extends = Terrain)]
pub struct SphereField {
    pub inner: Arc<CoreField>,
}

impl SphereField {
    /// A field of the core, for Python.
    pub fn of(inner: Arc<CoreField>) -> PyClassInitializer<Self> {
        Terrain::base(DrawnGround::Field(inner.clone())).add_subclass(Self { inner })
    }
}

/// A field of a material, if one is given.
fn made(field: CoreField, material: Option<String>) -> PyClassInitializer<SphereField> {
    SphereField::of(Arc::new(match material {
        Some(material) => field.with_material(&material),
        None => field,
    }))
}

#[pymethods]
impl SphereField {
    #[new]
    #[pyo3(signature = (centres, radii, ground = None, material = Given::MISSING),
        text_signature = "(centres, radii, ground=None, material='rock')")]
    fn new(
        py: Python<'_>,
        centres: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        ground: Option<&Bound<'_, PyAny>>,
        material: Given<'_>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let material = materials::name(material)?;
        let centres = rows::<3>(centres, "centres")?;
        let radii = vector(radii, Kind::Terrain, "radii")?;
        let field = build(py, &centres, &radii, plane(ground)?)?;
        Ok(made(field, material))
    }

    /// Reads spheres from a CSV file with the header `x,y,z,radius`, in m.
    ///
    /// Args:
    ///     path: Path of the file.
    ///     ground: The plane under the spheres; none by default.
    ///     material: Name of the spheres' material.
    ///
    /// Returns:
    ///     The field.
    ///
    /// Raises:
    ///     TerrainError: The file does not describe spheres; the message names the path.
    ///     OSError: The file cannot be read.
    #[staticmethod]
    #[pyo3(signature = (path, ground = None, material = Given::MISSING),
        text_signature = "(path, ground=None, material='rock')")]
    fn from_file<'py>(
        py: Python<'py>,
        path: &Bound<'_, PyAny>,
        ground: Option<&Bound<'_, PyAny>>,
        material: Given<'_>,
    ) -> PyResult<Bound<'py, Self>> {
        let material = materials::name(material)?;
        let ground = plane(ground)?;
        let path = files::path(path, Kind::Terrain)?;
        let text = read_text(py, &path, Kind::Terrain, MAX_FILE)?;
        let refuse = |message: String| {
            let (field, value) = (
                Some("path".to_owned()),
                Value::Text(path.display().to_string()),
            );
            PyErr::from(BorderError {
                kind: Kind::Terrain,
                message,
                field,
                value,
            })
        };
        let mut lines = text.lines();
        let header: Vec<String> = lines
            .next()
            .unwrap_or("")
            .split(',')
            .map(|s| s.trim().to_lowercase())
            .collect();
        if header != ["x", "y", "z", "radius"] {
            return Err(refuse(format!(
                "path: {} must begin with the header x,y,z,radius",
                path.display()
            )));
        }
        let body: Vec<&str> = lines.collect();
        let kwargs = pyo3::types::PyDict::new(py);
        kwargs.set_item("delimiter", ",")?;
        kwargs.set_item("ndmin", 2)?;
        let table = py
            .import("numpy")?
            .call_method("loadtxt", (body,), Some(&kwargs))
            .map_err(|e| {
                refuse(format!(
                    "path: {} is not a table of numbers ({})",
                    path.display(),
                    e.value(py)
                ))
            })?;
        let table = rows::<4>(&table, "path")?;
        let centres: Vec<[f64; 3]> = table.iter().map(|r| [r[0], r[1], r[2]]).collect();
        let radii: Vec<f64> = table.iter().map(|r| r[3]).collect();
        let field = build(py, &centres, &radii, ground).map_err(|e| in_file(e, &path))?;
        Bound::new(py, made(field, material))
    }

    /// The wavy ground of the 2010 report's Fig. 6.6.
    ///
    /// 50 x 25 spheres of radius 0.5 m, without a plane.
    ///
    /// Source: Yang 2010, Fig. 6.6.
    #[staticmethod]
    fn rug(py: Python<'_>) -> PyResult<Bound<'_, Self>> {
        Bound::new(py, Self::of(Arc::new(CoreField::rug())))
    }

    /// Rocks on a plane, with the size-frequency distribution of rocks on Mars.
    ///
    /// Args:
    ///     abundance: Fraction of the ground that rocks of all sizes cover, 0 to 0.5.
    ///     area: Corners x_min, z_min, x_max, z_max of the rectangle, m.
    ///     seed: Seed of the random numbers; equal seeds give equal rocks.
    ///     max_diameter: Largest diameter, m.
    ///     min_diameter: Smallest diameter, m; the number of rocks grows without bound as it
    ///         shrinks.
    ///     burial: Fraction of its diameter that a rock is sunk into the ground, 0 to 0.5, or a
    ///         range from which it is drawn for each rock; 0.5 by default.
    ///     ground: What the rocks lie on; flat ground at height 0 by default. A plane is part of
    ///         the field. Rocks on any other terrain are raised by its height, and the terrain is
    ///         not part of the field: combine them as `Union([terrain, rocks])`.
    ///     clear: Circles x, z, radius that no rock reaches into, (n, 3), m; none by default.
    ///     material: Name of the rocks' material.
    ///
    /// Returns:
    ///     The field.
    ///
    /// Raises:
    ///     TerrainError: An argument is out of its range.
    ///
    /// Source: Golombek and Rapp 1997.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python function
    #[pyo3(signature = (abundance, area, seed, *, max_diameter = Given::MISSING, min_diameter = Given::MISSING, burial = None, ground = None,
        clear = None, material = Given::MISSING),
        text_signature = "(abundance, area, seed, *, max_diameter=0.5, min_diameter=0.05, burial=None, ground=None, clear=None, \
        material='rock')")]
    fn rocks<'py>(
        py: Python<'py>,
        abundance: &Bound<'_, PyAny>,
        area: &Bound<'_, PyAny>,
        seed: &Bound<'_, PyAny>,
        max_diameter: Given<'_>,
        min_diameter: Given<'_>,
        burial: Option<&Bound<'_, PyAny>>,
        ground: Option<&Bound<'_, PyAny>>,
        clear: Option<&Bound<'_, PyAny>>,
        material: Given<'_>,
    ) -> PyResult<Bound<'py, Self>> {
        let material = materials::name(material)?;
        let burial = burial.map_or(Ok([0.5; 2]), |given| {
            one_or_two(given, Kind::Terrain, "burial")
        })?;
        let corners = vector(area, Kind::Terrain, "area")?;
        let [x_min, z_min, x_max, z_max] = corners[..] else {
            let what = "the four numbers x_min, z_min, x_max, z_max";
            return Err(refused(area, Kind::Terrain, "area", what).into());
        };
        let clear = clear.map_or_else(|| Ok(Vec::new()), |c| rows::<3>(c, "clear"))?;
        let ground = ground.map(parse).transpose()?;
        let plane = match &ground {
            Some(DrawnGround::Plane(plane)) => *plane,
            _ => CorePlane::ground(),
        };
        let rocks = Rocks {
            abundance: number(abundance, Kind::Terrain, "abundance")?,
            area: [x_max - x_min, z_max - z_min],
            middle: [0.5 * (x_min + x_max), 0.5 * (z_min + z_max)],
            seed: whole(seed, Kind::Terrain, "seed")?,
            max_diameter: max_diameter.number(0.5, Kind::Terrain, "max_diameter")?,
            min_diameter: min_diameter.number(0.05, Kind::Terrain, "min_diameter")?,
            burial,
            clearings: clear
                .iter()
                .map(|&[x, z, radius]| Clearing { x, z, radius })
                .collect(),
            ground: plane,
        };
        let field = py.detach(|| match ground {
            None | Some(DrawnGround::Plane(_)) => CoreField::rocks(&rocks),
            Some(other) => CoreField::rocks_on(&rocks, &*other.terrain()),
        });
        let field = field.map_err(BorderError::from)?;
        Bound::new(py, made(field, material))
    }

    /// Name of the spheres' material.
    #[getter]
    fn material(&self) -> &str {
        self.inner.material(1)
    }

    /// Centres of the spheres, (n, 3), m.
    #[getter]
    fn centres<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let centres: Vec<[f64; 3]> = self.inner.spheres().map(|s| s.centre.into()).collect();
        fresh_rows(py, &centres)
    }

    /// Radii of the spheres, (n,), m.
    #[getter]
    fn radii<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.inner.spheres().map(|s| s.radius))
    }

    /// The plane under the spheres, or None.
    #[getter]
    fn ground<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, Plane>>> {
        let plane = self.inner.ground();
        plane
            .map(|plane| Bound::new(py, Plane::of(*plane)))
            .transpose()
    }

    fn __len__(&self) -> usize {
        self.inner.spheres().len()
    }

    fn __repr__(&self) -> String {
        let ground = if self.inner.ground().is_some() {
            "on a plane"
        } else {
            "without a plane"
        };
        format!(
            "SphereField({} spheres, {ground})",
            self.inner.spheres().len()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let py = slf.py();
        let own = slf.get();
        let arguments = (
            own.centres(py)?,
            own.radii(py),
            own.ground(py)?,
            own.material(),
        );
        Ok((
            slf.get_type().into_any(),
            arguments.into_pyobject(py)?.into_any(),
        ))
    }
}
