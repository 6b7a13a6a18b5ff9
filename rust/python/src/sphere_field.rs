//! Methods of `SphereField`.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rover_core::geometry::{
    Clearing, Plane as CorePlane, Rocks, SphereField as CoreField, Terrain,
};

use crate::arguments::{Given, number, refused, whole};
use crate::arrays::{fresh_rows, one_or_two, rows, vector};
use crate::errors::{BorderError, Kind, Value};
use crate::files::{self, in_file, read_text};
use crate::ground::{Ground, SphereField};
use crate::heights::heights;
use crate::materials;
use crate::plane::Plane;
use crate::rays::{Met, cast_rays};

/// Longest file of spheres, bytes.
const MAX_FILE: usize = 1 << 28;

fn build(
    py: Python<'_>,
    centres: &[[f64; 3]],
    radii: &[f64],
    ground: Option<Plane>,
) -> Result<SphereField, BorderError> {
    let ground = ground.map(|plane| plane.inner);
    let field = py.detach(|| CoreField::new(centres, radii, ground))?;
    Ok(SphereField {
        inner: Arc::new(field),
    })
}

/// A plane, or none.
fn plane(given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Plane>> {
    let read = |given: &Bound<'_, PyAny>| {
        let found = given.extract::<Plane>();
        found.map_err(|_| refused(given, Kind::Terrain, "ground", "a Plane").into())
    };
    given.map(read).transpose()
}

impl SphereField {
    /// The same of another material, if one is given.
    fn of(self, material: Option<String>) -> Self {
        let Some(material) = material else {
            return self;
        };
        Self {
            inner: Arc::new(Arc::unwrap_or_clone(self.inner).with_material(&material)),
        }
    }
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
    ) -> PyResult<Self> {
        let material = materials::name(material)?;
        let centres = rows::<3>(centres, "centres")?;
        let radii = vector(radii, Kind::Terrain, "radii")?;
        let field = build(py, &centres, &radii, plane(ground)?)?;
        Ok(field.of(material))
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
    fn from_file(
        py: Python<'_>,
        path: &Bound<'_, PyAny>,
        ground: Option<&Bound<'_, PyAny>>,
        material: Given<'_>,
    ) -> PyResult<Self> {
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
        Ok(field.of(material))
    }

    /// The wavy ground of the 2010 report's Fig. 6.6.
    ///
    /// 50 x 25 spheres of radius 0.5 m, without a plane.
    ///
    /// Source: Yang 2010, Fig. 6.6.
    #[staticmethod]
    fn rug() -> Self {
        Self {
            inner: Arc::new(CoreField::rug()),
        }
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
    fn rocks(
        py: Python<'_>,
        abundance: &Bound<'_, PyAny>,
        area: &Bound<'_, PyAny>,
        seed: &Bound<'_, PyAny>,
        max_diameter: Given<'_>,
        min_diameter: Given<'_>,
        burial: Option<&Bound<'_, PyAny>>,
        ground: Option<&Bound<'_, PyAny>>,
        clear: Option<&Bound<'_, PyAny>>,
        material: Given<'_>,
    ) -> PyResult<Self> {
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
        let ground = ground.map(Ground::parse).transpose()?;
        let plane = match &ground {
            Some(Ground::Plane(plane)) => plane.inner,
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
            None | Some(Ground::Plane(_)) => CoreField::rocks(&rocks),
            Some(other) => CoreField::rocks_on(&rocks, &*other.terrain()),
        });
        let field = Self {
            inner: Arc::new(field.map_err(BorderError::from)?),
        };
        Ok(field.of(material))
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
    fn ground(&self) -> Option<Plane> {
        self.inner.ground().map(|plane| Plane { inner: *plane })
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
            own.ground(),
            own.material(),
        );
        Ok((
            slf.get_type().into_any(),
            arguments.into_pyobject(py)?.into_any(),
        ))
    }
}
