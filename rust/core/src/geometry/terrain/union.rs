//! Several terrains as one.

use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;

use super::error::TerrainError;
use super::plane::Plane;
use super::{Coverage, Neighbourhood, Primitive, SoftLayer, Terrain};
use crate::geometry::ray::{Hit, Ray};
use crate::geometry::shape::{Disc, Sphere};

/// Everything that any of several terrains has. Immutable.
///
/// The primitives of a part are numbered from where those of the part before it end. The part with
/// a plane comes first, since a plane has number 0.
#[derive(Clone)]
pub struct Union {
    parts: Vec<Arc<dyn Terrain>>,
    /// Number of the first primitive of each part.
    first: Vec<u32>,
}

impl fmt::Debug for Union {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Union")
            .field("first", &self.first)
            .finish_non_exhaustive()
    }
}

impl Union {
    /// Of its parts.
    ///
    /// # Errors
    /// `NoParts`, `SecondPlane`, `SecondSand`, `TooManyPieces`.
    pub fn new(mut parts: Vec<Arc<dyn Terrain>>) -> Result<Self, TerrainError> {
        if parts.is_empty() {
            return Err(TerrainError::NoParts);
        }
        let mut planes = (0..parts.len()).filter(|&k| parts[k].ground().is_some());
        if let (Some(plane), second) = (planes.next(), planes.next()) {
            if let Some(index) = second {
                return Err(TerrainError::SecondPlane { index });
            }
            parts[..=plane].rotate_right(1);
        }
        let mut soft = (0..parts.len()).filter(|&k| parts[k].soft().is_some());
        if let (Some(_), Some(index)) = (soft.next(), soft.next()) {
            return Err(TerrainError::SecondSand { index });
        }
        let mut first = Vec::with_capacity(parts.len());
        let mut sum = 0_u32;
        for part in &parts {
            first.push(sum);
            let next = sum.checked_add(part.n_primitives());
            sum = next.ok_or(TerrainError::TooManyPieces)?;
        }
        Ok(Self { parts, first })
    }

    /// Its parts in the order of their numbers.
    #[must_use]
    pub fn parts(&self) -> &[Arc<dyn Terrain>] {
        &self.parts
    }

    fn owner(&self, id: u32) -> (&dyn Terrain, u32) {
        let k = self.first.partition_point(|&first| first <= id) - 1;
        (&*self.parts[k], id - self.first[k])
    }

    /// The part with a surface, if it is a single one.
    fn only_surface(&self) -> Option<&dyn Terrain> {
        let mut surfaces = self.parts.iter().filter(|part| part.has_surface());
        let only = surfaces.next().filter(|_| surfaces.next().is_none())?;
        Some(&**only)
    }
}

impl Terrain for Union {
    fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        for (part, first) in self.parts.iter().zip(&self.first) {
            part.visit_near(centre, reach, &mut |id, primitive| {
                visit(first + id, primitive);
            });
        }
    }

    fn visit_around(&self, part: &Neighbourhood<'_>, visit: &mut dyn FnMut(u32, &Primitive)) {
        for (own, first) in self.parts.iter().zip(&self.first) {
            own.visit_around(part, &mut |id, primitive| visit(first + id, primitive));
        }
    }

    fn visit_spheres(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Sphere),
    ) {
        for (part, first) in self.parts.iter().zip(&self.first) {
            part.visit_spheres(centre, reach, &mut |id, sphere| visit(first + id, sphere));
        }
    }

    fn visit_ahead(
        &self,
        disc: &Disc,
        reach: [f64; 2],
        visit: &mut dyn FnMut(&Primitive),
    ) -> Option<f64> {
        self.only_surface()?.visit_ahead(disc, reach, visit)
    }

    fn level_near(&self, centre: &Vector3<f64>, radius: f64) -> Option<Plane> {
        self.only_surface()?.level_near(centre, radius)
    }

    fn can_be_passed(&self) -> bool {
        self.parts.iter().any(|part| part.can_be_passed())
    }

    fn is_plane(&self) -> bool {
        self.parts.iter().all(|part| part.is_plane())
    }

    fn has_surface(&self) -> bool {
        self.parts.iter().any(|part| part.has_surface())
    }

    fn primitive(&self, id: u32) -> Primitive {
        let (part, own) = self.owner(id);
        part.primitive(own)
    }

    fn material(&self, id: u32) -> &str {
        let (part, own) = self.owner(id);
        part.material(own)
    }

    fn n_primitives(&self) -> u32 {
        self.parts.iter().map(|part| part.n_primitives()).sum()
    }

    fn is_inside(&self, id: u32, point: &Vector3<f64>) -> bool {
        let (part, own) = self.owner(id);
        part.is_inside(own, point)
    }

    /// Known where one part knows it; unknown where one that should does not.
    fn coverage(&self, centre: &Vector3<f64>, radius: f64) -> Coverage {
        let mut coverage = Coverage::Silent;
        for part in &self.parts {
            match part.coverage(centre, radius) {
                Coverage::Known => return Coverage::Known,
                Coverage::Silent => {}
                unknown @ Coverage::Unknown(_) => coverage = unknown,
            }
        }
        coverage
    }

    fn furthest(&self, n: &Vector3<f64>, centre: &Vector3<f64>, radius: f64) -> f64 {
        let surfaces = self.parts.iter().filter(|part| part.has_surface());
        let distances = surfaces.map(|part| part.furthest(n, centre, radius));
        distances.fold(f64::NEG_INFINITY, f64::max)
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        self.parts.iter().fold(None, |nearest: Option<Hit>, part| {
            let reach = nearest.map_or(reach, |hit| hit.distance);
            part.first_hit(ray, reach).or(nearest)
        })
    }

    fn height(&self, x: f64, z: f64) -> Option<f64> {
        let heights = self.parts.iter().filter_map(|part| part.height(x, z));
        heights.reduce(f64::max)
    }

    fn ground(&self) -> Option<&Plane> {
        self.parts[0].ground()
    }

    fn soft(&self) -> Option<SoftLayer<'_>> {
        let (own, layer) =
            (self.parts.iter().enumerate()).find_map(|(own, part)| Some((own, part.soft()?)))?;
        let mut others = self.parts.iter().enumerate().filter(|(k, _)| *k != own);
        let is_firm = others.any(|(_, part)| part.has_surface() || part.ground().is_some());
        Some(SoftLayer {
            is_alone: layer.is_alone && !is_firm,
            ..layer
        })
    }
}
