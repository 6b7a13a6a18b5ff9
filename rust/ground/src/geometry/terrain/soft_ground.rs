//! Ground that wheels sink into.

use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;

use super::{Area, Coverage, KnownRules, Neighbourhood, Plane, Primitive, SoftLayer, Terrain};
use crate::geometry::ray::{Hit, Ray};
use crate::geometry::shape::{PlacedShape, Sphere};
use crate::sand::Soil;
use friction_contact::quantity::{QuantityError, between};

/// A layer of sand under a surface. Wheels sink into it; to every other part of a machine the
/// surface is rigid. Immutable: the ruts belong to a simulation.
#[derive(Clone)]
pub struct SoftGround {
    surface: Arc<dyn Terrain>,
    soil: Arc<Soil>,
    cell: f64,
    known: Arc<KnownRules>,
}

impl fmt::Debug for SoftGround {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SoftGround")
            .field("soil", &self.soil)
            .finish_non_exhaustive()
    }
}

impl SoftGround {
    /// Sand with ruts on a grid of this cell, m.
    ///
    /// # Errors
    /// A number of the soil or the cell out of its range.
    pub fn new(
        surface: Arc<dyn Terrain>,
        soil: Arc<Soil>,
        cell: f64,
    ) -> Result<Self, QuantityError> {
        soil.check()?;
        between("rut_cell", cell, [1e-3, 1.0], "from 0.001 to 1 m")?;
        Ok(Self {
            surface,
            soil,
            cell,
            known: Arc::default(),
        })
    }

    /// A layer of this sand under another surface.
    #[must_use]
    pub fn under(&self, surface: Arc<dyn Terrain>) -> Self {
        Self {
            surface,
            ..self.clone()
        }
    }

    /// The soil.
    #[must_use]
    pub fn soil(&self) -> &Arc<Soil> {
        &self.soil
    }

    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &Arc<dyn Terrain> {
        &self.surface
    }

    /// Size of a cell of the ruts, m.
    #[must_use]
    pub fn cell(&self) -> f64 {
        self.cell
    }
}

impl Terrain for SoftGround {
    fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        self.surface.visit_near(centre, reach, visit);
    }

    fn visit_around(&self, part: &Neighbourhood<'_>, visit: &mut dyn FnMut(u32, &Primitive)) {
        match part.shape {
            PlacedShape::Disc(_) | PlacedShape::Roller(_) => {}
            _ => self.surface.visit_around(part, visit),
        }
    }

    fn visit_spheres(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Sphere),
    ) {
        self.surface.visit_spheres(centre, reach, visit);
    }

    fn can_be_passed(&self) -> bool {
        self.surface.can_be_passed()
    }

    fn has_surface(&self) -> bool {
        self.surface.has_surface()
    }

    fn primitive(&self, id: u32) -> Primitive {
        self.surface.primitive(id)
    }

    fn material(&self, id: u32) -> &str {
        self.surface.material(id)
    }

    fn n_primitives(&self) -> u32 {
        self.surface.n_primitives()
    }

    fn is_inside(&self, id: u32, point: &Vector3<f64>) -> bool {
        self.surface.is_inside(id, point)
    }

    fn coverage(&self, centre: &Vector3<f64>, radius: f64) -> Coverage {
        self.surface.coverage(centre, radius)
    }

    fn covers(&self, area: &Area, is_joined: &dyn Fn(u32) -> bool) -> Coverage {
        self.surface.covers(area, is_joined)
    }

    fn known_within(&self) -> Option<Area> {
        self.surface.known_within()
    }

    fn furthest(&self, n: &Vector3<f64>, centre: &Vector3<f64>, radius: f64) -> f64 {
        self.surface.furthest(n, centre, radius)
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        self.surface.first_hit(ray, reach)
    }

    fn first_hit_of(&self, ray: &Ray, reach: f64) -> Option<(Hit, Option<(u32, Sphere)>)> {
        self.surface.first_hit_of(ray, reach)
    }

    fn smooth_normal(&self, place: &Vector3<f64>) -> Option<Vector3<f64>> {
        self.surface.smooth_normal(place)
    }

    fn height(&self, x: f64, z: f64) -> Option<f64> {
        self.surface.height(x, z)
    }

    fn ground(&self) -> Option<&Plane> {
        self.surface.ground()
    }

    fn soft(&self) -> Option<SoftLayer<'_>> {
        Some(SoftLayer {
            surface: &*self.surface,
            soil: &self.soil,
            cell: self.cell,
            known: &self.known,
            is_alone: !self.surface.can_be_passed(),
        })
    }
}
