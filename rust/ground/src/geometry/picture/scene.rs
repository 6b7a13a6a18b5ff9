//! What a picture can show, and shadows.

use nalgebra::Vector3;

use super::drawing::may_meet;
use super::{Colour, PlacedDrawing, RutRelief, Stone};
use crate::geometry::ray::{Hit, Ray};
use crate::geometry::shape::Sphere;
use crate::geometry::terrain::{SphereField, Terrain};

/// Shadows begin this far above a surface, m, which then does not shade itself.
const CLEARANCE: f64 = 1e-4;

/// What a ray has met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
    /// A plane, a height field or a mesh, at a depth in a rut, m.
    Ground {
        /// Under the undisturbed surface, m; 0 outside ruts.
        depth: f64,
    },
    /// A sphere of the ground.
    Rock(Sphere),
    /// A grain, by its number.
    Ball(u32),
    /// A part of the machine, of this colour.
    Machine(Colour),
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// From the ray's origin, m.
    pub distance: f64,
    /// Place, world, m.
    pub place: Vector3<f64>,
    /// Unit normal, on the side from which the ray comes.
    pub normal: Vector3<f64>,
    /// Unit normal of the shading, on the same side.
    pub shading: Vector3<f64>,
    /// The surface that the ray met.
    pub surface: Surface,
}

/// All that casts light back.
pub struct PictureScene<'a> {
    terrain: &'a dyn Terrain,
    ruts: Option<RutRelief<'a>>,
    balls: Option<&'a SphereField>,
    drawings: Vec<PlacedDrawing<'a>>,
    /// Which of the drawings are seen; all cast shadows.
    is_seen: Vec<bool>,
    /// A ball around all drawings.
    machine: Option<Sphere>,
}

impl<'a> PictureScene<'a> {
    /// A ground with its ruts, grains, and the drawings of a machine; those that are not seen only
    /// cast shadows.
    #[must_use]
    pub fn new(
        terrain: &'a dyn Terrain,
        ruts: Option<RutRelief<'a>>,
        balls: Option<&'a SphereField>,
        drawings: Vec<(PlacedDrawing<'a>, bool)>,
    ) -> Self {
        let (drawings, is_seen): (Vec<_>, Vec<_>) = drawings.into_iter().unzip();
        let n = drawings.len() as f64;
        let sum: Vector3<f64> = drawings.iter().map(|one| one.around.centre).sum();
        let reach =
            |one: &PlacedDrawing<'_>| (one.around.centre - sum / n).norm() + one.around.radius;
        let radius = drawings.iter().map(reach).fold(0.0, f64::max);
        Self {
            terrain,
            ruts,
            balls,
            machine: (n > 0.0).then(|| Sphere::new(sum / n, radius)),
            drawings,
            is_seen,
        }
    }

    /// What a ray meets first within `range`, m.
    #[must_use]
    pub fn first(&self, ray: &Ray, range: f64) -> Option<Seen> {
        let (mut nearest, mut shading) = (self.ground(ray, range), None);
        let within =
            |nearest: &Option<(Hit, Surface)>| nearest.map_or(range, |(hit, _)| hit.distance);
        if let Some(balls) = self.balls
            && let Some((hit, Some((index, _)))) = balls.first_hit_of(ray, within(&nearest))
        {
            nearest = Some((hit, Surface::Ball(index)));
        }
        if self.meets_machine(ray, within(&nearest)) {
            let seen = self.drawings.iter().zip(&self.is_seen);
            for (drawing, _) in seen.filter(|(_, is_seen)| **is_seen) {
                if let Some((hit, smooth, colour)) = drawing.first_hit(ray, within(&nearest)) {
                    nearest = Some((hit, Surface::Machine(colour)));
                    shading = Some(smooth);
                }
            }
        }
        let (hit, surface) = nearest?;
        let place = ray.at(hit.distance);
        let shading = shading.or_else(|| match surface {
            Surface::Rock(sphere) => Some(Stone::over(&sphere.centre).normal(&hit.normal)),
            Surface::Ground { depth } if depth <= 0.0 => self.terrain.smooth_normal(&place),
            _ => None,
        });
        let side = -hit.normal.dot(&ray.direction).signum();
        Some(Seen {
            distance: hit.distance,
            place,
            normal: hit.normal * side,
            shading: shading.unwrap_or(hit.normal) * side,
            surface,
        })
    }

    /// Whether the ground is sand.
    #[must_use]
    pub fn is_sand(&self) -> bool {
        self.terrain.soft().is_some()
    }

    fn meets_machine(&self, ray: &Ray, reach: f64) -> bool {
        self.machine.is_some_and(|ball| may_meet(ray, &ball, reach))
    }

    fn ground(&self, ray: &Ray, range: f64) -> Option<(Hit, Surface)> {
        let (hit, sphere) = self.terrain.first_hit_of(ray, range)?;
        if let Some((_, sphere)) = sphere {
            return Some((hit, Surface::Rock(sphere)));
        }
        let bottom = self.ruts.as_ref().and_then(|ruts| ruts.under(ray, &hit));
        let (hit, depth) = bottom.map_or((hit, 0.0), |bottom| (bottom.hit, bottom.depth));
        Some((hit, Surface::Ground { depth }))
    }

    /// Whether the Sun in the unit direction `sun` shines on a place, as far as `range` (m) tells.
    #[must_use]
    pub fn is_sunlit(&self, seen: &Seen, sun: &Vector3<f64>, range: f64) -> bool {
        if seen.normal.dot(sun) <= 0.0 {
            return false;
        }
        let mut to_sun = Ray {
            origin: seen.place + seen.normal * CLEARANCE,
            direction: *sun,
        };
        if let (Surface::Ground { depth }, Some(ruts)) = (seen.surface, &self.ruts)
            && depth > 0.0
        {
            // Vertical, as the surface around a rut is nearly level.
            if ruts.shades(&to_sun, &Vector3::y(), depth) {
                return false;
            }
            to_sun.origin = to_sun.at((depth + CLEARANCE) / sun.y.max(1e-3));
        }
        let is_grain = |balls: &SphereField| balls.first_hit(&to_sun, range).is_some();
        let is_part = |one: &PlacedDrawing<'_>| one.first_hit(&to_sun, range).is_some();
        let is_dark = self.terrain.first_hit(&to_sun, range).is_some()
            || self.balls.is_some_and(is_grain)
            || (self.meets_machine(&to_sun, range) && self.drawings.iter().any(is_part));
        !is_dark
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::picture::Drawing;
    use crate::geometry::terrain::Plane;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_shadow_of_a_rock_lies_where_a_line_to_the_sun_meets_it(
            centre in prop::array::uniform3(-1.0..1.0), radius in 0.1..0.6, place in prop::array::uniform2(-4.0..4.0),
            sun in prop::array::uniform3(-1.0..1.0),
        ) {
            let centre = Vector3::from(centre) + Vector3::y() * 2.0;
            let sun = (Vector3::from(sun) + Vector3::y() * 1.2).normalize();
            let field = SphereField::new(&[centre.into()], &[radius], Some(Plane::ground())).unwrap();
            let scene = PictureScene::new(&field, None, None, Vec::new());
            let place = Vector3::new(place[0], 0.0, place[1]);
            let seen = Seen {
                distance: 1.0,
                place,
                normal: Vector3::y(),
                shading: Vector3::y(),
                surface: Surface::Ground { depth: 0.0 },
            };
            let across = (centre - place) - sun * sun.dot(&(centre - place));
            prop_assume!((across.norm() - radius).abs() > 1e-3);
            prop_assert_eq!(scene.is_sunlit(&seen, &sun, 100.0), across.norm() > radius);
            let below = Seen { normal: -seen.normal, ..seen };
            prop_assert!(!scene.is_sunlit(&below, &sun, 100.0));
        }
    }

    #[test]
    fn a_hidden_solid_is_not_seen_but_casts_its_shadow() {
        let up = [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0];
        let roof = [-1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 2.0];
        let drawing = Drawing::new(&[roof], &[up], &[[0.25; 3]]).unwrap();
        let placed = drawing.placed(Vector3::zeros(), Matrix3::identity());
        let down = Ray::new(Vector3::y() * 3.0, -Vector3::y()).unwrap();
        let ground = Plane::ground();
        let scene =
            |is_seen| PictureScene::new(&ground, None, None, vec![(placed.clone(), is_seen)]);
        let roof = scene(true).first(&down, 9.0).unwrap();
        assert_eq!(roof.surface, Surface::Machine([0.25; 3]));
        assert!((roof.distance - 2.0).abs() < 1e-12 && roof.normal.y > 0.99);
        let floor = scene(false).first(&down, 9.0).unwrap();
        assert!((floor.distance - 3.0).abs() < 1e-12);
        assert!(!scene(false).is_sunlit(&floor, &Vector3::y(), 9.0));
    }
}
