//! `SphereField`.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::geometry::{
    Clearing, Plane as CorePlane, Rocks, SphereField as CoreField, Terrain as _,
};
use rover_task::draw::DrawnGround;

use crate::arguments::{Given, Named, number, object, refused, whole};
use crate::arrays::{Array, fresh_rows, one_or_two, rows, vector};
use crate::errors::{Kind, Result};
use crate::materials;
use crate::plane::Plane;
use crate::shared::Release;
use crate::terrain::{Terrain, parse};

/// A plane, or none.
fn plane(given: Option<&Bound<'_, PyAny>>) -> Result<Option<CorePlane>> {
    let read = |given| object::<Plane>(given, Kind::Terrain, "ground", "a Plane");
    Ok(given.map(read).transpose()?.map(|plane| plane.get().inner))
}

/// Fixed spheres, with or without a plane under them. Immutable.
///
/// `SphereField.from_file` reads them.
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
#[pyclass(module = "rover_gym.core", frozen, extends = Terrain)]
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
    ) -> Result<PyClassInitializer<Self>> {
        let material = materials::name(material)?;
        let centres = rows::<3>(centres, "centres")?;
        let radii = vector(radii, Kind::Terrain, "radii")?;
        let ground = plane(ground)?;
        let field = py.release(|| CoreField::new(&centres, &radii, ground))??;
        Ok(made(field, material))
    }

    /// The wavy ground of the 2010 report's Fig. 6.6.
    ///
    /// 50 x 25 spheres of radius 0.5 m, without a plane.
    ///
    /// Source: Yang 2010, Fig. 6.6.
    #[staticmethod]
    fn rug(py: Python<'_>) -> Result<Py<Self>> {
        Ok(Py::new(py, Self::of(Arc::new(CoreField::rug())))?)
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
    ///     burial: Buried fraction of each rock's diameter, 0 to 0.5, or a range from which it is
    ///         drawn for each rock; 0.5 by default.
    ///     ground: Ground under the rocks; flat at height 0 by default. A plane becomes part of the
    ///         field. Any other terrain only sets the height of the rocks; combine both as
    ///         `Union([terrain, rocks])`.
    ///     clear: Circles x, z, radius to keep free of rocks, (n, 3), m; none by default.
    ///     material: Name of the rocks' material.
    ///
    /// Raises:
    ///     TerrainError: An argument is out of its range.
    ///
    /// Source: Golombek and Rapp 1997.
    #[staticmethod]
    #[pyo3(signature = (abundance, area, seed, **options),
        text_signature = "(abundance, area, seed, *, max_diameter=0.5, min_diameter=0.05, burial=None, ground=None, clear=None, \
        material='rock')")]
    fn rocks(
        py: Python<'_>,
        abundance: &Bound<'_, PyAny>,
        area: &Bound<'_, PyAny>,
        seed: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Py<Self>> {
        let given = Named::keywords(py, options)?.of(Kind::Terrain);
        let material = materials::name(given.get("material")?)?;
        let corners = vector(area, Kind::Terrain, "area")?;
        let [x_min, z_min, x_max, z_max] = corners[..] else {
            let what = "the four numbers x_min, z_min, x_max, z_max";
            return Err(refused(area, Kind::Terrain, "area", what));
        };
        let clear = given
            .some("clear")?
            .map(|c| rows::<3>(&c, "clear"))
            .transpose()?;
        let clear = clear.unwrap_or_default().into_iter();
        let ground = given.some("ground")?.as_ref().map(parse).transpose()?;
        let plane = match &ground {
            Some(DrawnGround::Plane(plane)) => *plane,
            _ => CorePlane::ground(),
        };
        let rocks = Rocks {
            abundance: number(abundance, Kind::Terrain, "abundance")?,
            area: [x_max - x_min, z_max - z_min],
            middle: [0.5 * (x_min + x_max), 0.5 * (z_min + z_max)],
            seed: whole(seed, Kind::Terrain, "seed")?,
            max_diameter: given.number("max_diameter", 0.5)?,
            min_diameter: given.number("min_diameter", 0.05)?,
            burial: given.read("burial", one_or_two)?.unwrap_or([0.5; 2]),
            clearings: clear
                .map(|[x, z, radius]| Clearing { x, z, radius })
                .collect(),
            ground: plane,
        };
        given.finish()?;
        let field = py.release(|| match ground {
            None | Some(DrawnGround::Plane(_)) => CoreField::rocks(&rocks),
            Some(other) => CoreField::rocks_on(&rocks, &*other.terrain()),
        })??;
        Ok(Py::new(py, made(field, material))?)
    }

    /// Name of the spheres' material.
    #[getter]
    fn material(&self) -> &str {
        self.inner.material(1)
    }

    /// Centres of the spheres, (n, 3), m.
    #[getter]
    fn centres(&self) -> Array {
        fresh_rows(self.inner.spheres().map(|s| s.centre.into()))
    }

    /// Radii of the spheres, (n,), m.
    #[getter]
    fn radii(&self) -> Array {
        self.inner.spheres().map(|s| s.radius).collect()
    }

    /// The plane under the spheres, or None.
    #[getter]
    fn ground(&self, py: Python<'_>) -> Result<Option<Py<Plane>>> {
        let plane = self.inner.ground();
        Ok(plane
            .map(|plane| Py::new(py, Plane::of(*plane)))
            .transpose()?)
    }

    fn __len__(&self) -> usize {
        self.inner.spheres().len()
    }

    fn __repr__(&self) -> String {
        let (n, is_on) = (self.inner.spheres().len(), self.inner.ground().is_some());
        format!(
            "SphereField({n} spheres, {} a plane)",
            if is_on { "on" } else { "without" }
        )
    }

    #[allow(clippy::type_complexity)] // the arguments of the class
    fn __getnewargs__(&self, py: Python<'_>) -> Result<(Array, Array, Option<Py<Plane>>, &str)> {
        Ok((
            self.centres(),
            self.radii(),
            self.ground(py)?,
            self.material(),
        ))
    }
}
