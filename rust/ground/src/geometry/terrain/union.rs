//! Several terrains as one.

use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;

use super::error::TerrainError;
use super::plane::Plane;
use super::seams::Seams;
use super::{Area, Coverage, Neighbourhood, Primitive, SoftLayer, Terrain};
use crate::geometry::ray::{Hit, Ray};
use crate::geometry::shape::{Disc, Sphere};

/// Everything that any of several terrains has. Immutable.
///
/// The primitives of a part are numbered from where those of the part before it end. The part with
/// a plane comes first, since a plane has number 0. The parts of a union in it count as its own.
/// Where parts meet, their borders are inner edges (`seams`), whose pieces follow after the parts'.
#[derive(Clone)]
pub struct Union {
    parts: Vec<Arc<dyn Terrain>>,
    /// Number of the first primitive of each part, and after all.
    first: Vec<u32>,
    seams: Arc<Seams>,
    /// Whether more than one part has faces.
    may_overlap: bool,
}

impl fmt::Debug for Union {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Union")
            .field("first", &self.first)
            .finish_non_exhaustive()
    }
}

impl Union {
    /// Joins several terrains into one.
    ///
    /// # Errors
    /// `NoParts`, `SecondPlane`, `SecondSand`, `TooManyPieces`.
    pub fn new(parts: Vec<Arc<dyn Terrain>>) -> Result<Self, TerrainError> {
        if parts.is_empty() {
            return Err(TerrainError::NoParts);
        }
        let mut planes = (0..parts.len()).filter(|&k| parts[k].ground().is_some());
        if let (Some(_), Some(index)) = (planes.next(), planes.next()) {
            return Err(TerrainError::SecondPlane { index });
        }
        let mut soft = (0..parts.len()).filter(|&k| parts[k].soft().is_some());
        if let (Some(_), Some(index)) = (soft.next(), soft.next()) {
            return Err(TerrainError::SecondSand { index });
        }
        let members = parts.into_iter().flat_map(|part| match part.members() {
            [] => vec![part],
            members => members.to_vec(),
        });
        let mut parts: Vec<_> = members.collect();
        if let Some(plane) = parts.iter().position(|part| part.ground().is_some()) {
            parts[..=plane].rotate_right(1);
        }
        let mut first = Vec::with_capacity(parts.len() + 1);
        let mut sum = 0_u32;
        for part in &parts {
            first.push(sum);
            let next = sum.checked_add(part.n_primitives());
            sum = next.ok_or(TerrainError::TooManyPieces)?;
        }
        let has_faces = |part: &&Arc<dyn Terrain>| part.has_surface() || part.ground().is_some();
        let may_overlap = parts.iter().filter(has_faces).count() > 1;
        let seams = Seams::find(&parts, &first);
        let n_own = u32::try_from(seams.n_pieces()).map_err(|_| TerrainError::TooManyPieces)?;
        first.push(sum);
        sum.checked_add(n_own).ok_or(TerrainError::TooManyPieces)?;
        Ok(Self {
            parts,
            first,
            seams: Arc::new(seams),
            may_overlap,
        })
    }

    /// Parts of the union in the order of their numbers.
    #[must_use]
    pub fn parts(&self) -> &[Arc<dyn Terrain>] {
        &self.parts
    }

    /// Number of the first piece of the seams.
    fn first_of_seams(&self) -> u32 {
        self.first[self.parts.len()]
    }

    /// The number of a piece among those of the seams.
    fn of_seams(&self, id: u32) -> Option<usize> {
        id.checked_sub(self.first_of_seams()).map(|k| k as usize)
    }

    /// Number of the part that has a piece, and the piece's in it.
    fn owner_of(&self, id: u32) -> (usize, u32) {
        let first = &self.first[..self.parts.len()];
        let k = first.partition_point(|&first| first <= id) - 1;
        (k, id - first[k])
    }

    /// The part that has a primitive, one of the seams' being of a face beside it.
    fn owner(&self, id: u32) -> (&dyn Terrain, u32) {
        let id = self.of_seams(id).map_or(id, |k| self.seams.piece(k).1);
        let (k, own) = self.owner_of(id);
        (&*self.parts[k], own)
    }

    /// Visits a primitive of a part as it is in the union.
    #[inline]
    fn show(&self, id: u32, primitive: &Primitive, visit: &mut dyn FnMut(u32, &Primitive)) {
        if self.seams.is_empty() {
            visit(id, primitive);
        } else if let Some(shown) = self.seams.shown(id, primitive) {
            visit(id, &shown);
        }
    }

    fn visit_seams(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        let first = self.first_of_seams();
        self.seams
            .visit_near(centre, reach, |k, piece| visit(first + k, piece));
    }

    /// Whether the parts together know the ground all over a rectangle.
    fn knows(&self, area: &Area) -> bool {
        let areas = self.parts.iter().filter_map(|part| part.known_within());
        area.cut(areas).all(|cell| {
            // Meshes beside each other know it together: those with a border in it not at all.
            let (mut is_known, mut ends) = (false, false);
            for (part, &first) in self.parts.iter().zip(&self.first) {
                let is_joined = |id: u32| self.seams.is_joined(first + id);
                let is_bounded = part.known_within().is_some();
                match part.covers(&cell, &is_joined) {
                    Coverage::Known if is_bounded => return true,
                    Coverage::Known => is_known = true,
                    Coverage::Unknown(_) => ends |= !is_bounded,
                    Coverage::Silent => {}
                }
            }
            is_known && !ends
        })
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
                self.show(first + id, primitive, visit);
            });
        }
        self.visit_seams(centre, reach, visit);
    }

    fn visit_around(&self, part: &Neighbourhood<'_>, visit: &mut dyn FnMut(u32, &Primitive)) {
        for (own, first) in self.parts.iter().zip(&self.first) {
            own.visit_around(part, &mut |id, primitive| {
                self.show(first + id, primitive, visit);
            });
        }
        self.visit_seams(&part.centre, part.radius(), visit);
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
        disc: (&Disc, f64),
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
        if let Some(k) = self.of_seams(id) {
            return self.seams.piece(k).0;
        }
        let (part, own) = self.owner(id);
        let piece = part.primitive(own);
        self.seams.shown(id, &piece).unwrap_or(piece)
    }

    fn material(&self, id: u32) -> &str {
        let (part, own) = self.owner(id);
        part.material(own)
    }

    fn n_primitives(&self) -> u32 {
        self.parts
            .iter()
            .map(|part| part.n_primitives())
            .sum::<u32>()
            + u32::try_from(self.seams.n_pieces()).unwrap_or(0)
    }

    /// In the ground of the piece's part; of a piece of the seams, of any part.
    fn is_inside(&self, id: u32, point: &Vector3<f64>) -> bool {
        if self.of_seams(id).is_some() {
            let mut surfaces = self.parts.iter().filter(|part| part.has_surface());
            return surfaces.any(|part| part.is_inside(0, point));
        }
        let (part, own) = self.owner(id);
        part.is_inside(own, point)
    }

    fn members(&self) -> &[Arc<dyn Terrain>] {
        &self.parts
    }

    fn may_overlap(&self) -> bool {
        self.may_overlap
    }

    /// Whether a place just before a piece is in the ground of another part. Before a wall it is
    /// looked for a little lower, so that two blocks beside each other may differ by the tolerance.
    fn is_buried(&self, id: u32, place: &Vector3<f64>, n: &Vector3<f64>) -> bool {
        if !self.may_overlap || self.of_seams(id).is_some() {
            return false;
        }
        let (own, _) = self.owner_of(id);
        let drop = if n.y.abs() < WALL {
            self.seams.tolerance
        } else {
            0.0
        };
        let before = place + n * (4.0 * self.seams.tolerance) - Vector3::y() * drop;
        let within = 10.0 * self.seams.tolerance;
        let mut others = self.parts.iter().enumerate();
        others.any(|(k, part)| k != own && part.buries(&before, within))
    }

    /// Known where the parts together know it; unknown where one that should does not.
    fn coverage(&self, centre: &Vector3<f64>, radius: f64) -> Coverage {
        let mut coverage = Coverage::Silent;
        for part in &self.parts {
            match part.coverage(centre, radius) {
                Coverage::Known => return Coverage::Known,
                Coverage::Silent => {}
                unknown @ Coverage::Unknown(_) => coverage = unknown,
            }
        }
        let is_unknown = matches!(coverage, Coverage::Unknown(_));
        if is_unknown && self.may_overlap && self.knows(&Area::around([centre.x, centre.z], radius))
        {
            return Coverage::Known;
        }
        coverage
    }

    fn furthest(&self, n: &Vector3<f64>, centre: &Vector3<f64>, radius: f64) -> f64 {
        let surfaces = self.parts.iter().filter(|part| part.has_surface());
        let distances = surfaces.map(|part| part.furthest(n, centre, radius));
        distances.fold(f64::NEG_INFINITY, f64::max)
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        self.first_hit_of(ray, reach).map(|(hit, _)| hit)
    }

    fn first_hit_of(&self, ray: &Ray, reach: f64) -> Option<(Hit, Option<(u32, Sphere)>)> {
        let nothing: Option<(Hit, Option<(u32, Sphere)>)> = None;
        self.parts.iter().fold(nothing, |nearest, part| {
            let reach = nearest.map_or(reach, |(hit, _)| hit.distance);
            part.first_hit_of(ray, reach).or(nearest)
        })
    }

    fn smooth_normal(&self, place: &Vector3<f64>) -> Option<Vector3<f64>> {
        self.parts.iter().find_map(|part| part.smooth_normal(place))
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

/// Vertical part of a normal up to which a piece is a wall.
const WALL: f64 = 0.1;
