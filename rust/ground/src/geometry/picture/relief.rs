//! Ruts as a relief under the undisturbed surface of sand.
//!
//! Within the few centimetres of a rut the surface counts as the plane that a ray has met. From
//! there the ray is followed in steps of half a cell until it is below the rut's bottom.

use nalgebra::Vector3;

use crate::geometry::ray::{Hit, Ray};
use crate::sand::ruts::{Rut, RutMap, RutsNear, Window};

/// Most steps along a ray.
const STEPS: u32 = 64;

/// Brightness at the bottom of a rut as deep as it is wide, as frames have it.
const DARKEST: f64 = 0.5;

/// Width of a rut by which its depth is judged, m.
const WIDE: f64 = 0.06;

/// The ruts of a machine.
#[derive(Clone, Debug)]
pub struct RutRelief<'a> {
    ruts: &'a RutMap,
    nothing: Window,
    /// Size of a cell, m.
    cell: f64,
    /// Greatest depth, m.
    deepest: f64,
}

/// A place in a rut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bottom {
    /// Where the ray meets it.
    pub hit: Hit,
    /// Under the undisturbed surface, m, along its normal.
    pub depth: f64,
}

impl<'a> RutRelief<'a> {
    /// The relief of ruts on a grid with cells of this size, m; none where nothing was driven on.
    #[must_use]
    pub fn new(ruts: &'a RutMap, cell: f64) -> Option<Self> {
        let depths = ruts.cells().into_iter().map(|(.., depth)| depth);
        let deepest = depths.fold(0.0, f64::max);
        (deepest > 0.0).then(|| Self {
            ruts,
            nothing: Window::default(),
            cell,
            deepest,
        })
    }

    fn at(&self, place: &Vector3<f64>) -> Rut<f64> {
        let near = RutsNear {
            map: self.ruts,
            window: &self.nothing,
            cell: self.cell,
        };
        near.at([place.x, place.z])
    }

    /// Length of a step along a ray that passes a layer as deep as the deepest rut, m, with the
    /// rate at which it goes down or up.
    fn step(&self, direction: &Vector3<f64>, rate: f64) -> f64 {
        let level = direction.xz().norm().max(1e-3);
        let through = self.deepest / rate.abs().max(1e-6);
        (0.5 * self.cell / level)
            .max(through / f64::from(STEPS))
            .min(through)
    }

    /// The bottom that a ray meets after it has met the undisturbed surface from above; none where
    /// there is no rut.
    #[must_use]
    pub fn under(&self, ray: &Ray, surface: &Hit) -> Option<Bottom> {
        let (normal, rate) = (surface.normal, surface.normal.dot(&ray.direction));
        if rate >= 0.0 || normal.y <= 0.0 || self.at(&ray.at(surface.distance)).depth <= 0.0 {
            return None;
        }
        let step = self.step(&ray.direction, rate);
        let over = |t: f64| rate * t + self.at(&ray.at(surface.distance + t)).depth * normal.y;
        let (mut t, mut before) = (0.0, over(0.0));
        for _ in 0..=STEPS + 1 {
            let now = over(t + step);
            if now <= 0.0 {
                t += step * before / (before - now);
                break;
            }
            (t, before) = (t + step, now);
        }
        let rut = self.at(&ray.at(surface.distance + t));
        let [along_x, along_z] = rut.slope;
        let bottom = Vector3::new(
            normal.x / normal.y + along_x,
            1.0,
            normal.z / normal.y + along_z,
        );
        let hit = Hit {
            distance: surface.distance + t,
            normal: bottom.normalize(),
        };
        Some(Bottom {
            hit,
            depth: -rate * t,
        })
    }

    /// Whether sand lies between a place in a rut, `depth` (m) under a surface with this normal,
    /// and the Sun, before the ray is out of the rut.
    #[must_use]
    pub fn shades(&self, to_sun: &Ray, normal: &Vector3<f64>, depth: f64) -> bool {
        let rate = normal.dot(&to_sun.direction);
        if rate <= 0.0 {
            return true;
        }
        let step = self.step(&to_sun.direction, rate);
        let leaves = depth / rate;
        let mut t = step;
        while t < leaves {
            let under = depth - rate * t;
            if under > self.at(&to_sun.at(t)).depth * normal.y {
                return true;
            }
            t += step;
        }
        false
    }

    /// Brightness of pressed sand at a depth, m.
    #[must_use]
    pub fn brightness(depth: f64) -> f64 {
        1.0 - (1.0 - DARKEST) * (depth / WIDE).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ray::plane;
    use crate::geometry::terrain::Plane;

    const CELL: f64 = 0.01;
    const DEPTH: f64 = 0.05;

    /// A groove along x, 0.2 m wide, in level ground.
    fn groove() -> RutMap {
        let rows = (-100..100).flat_map(|i| (-10..10).map(move |k| (i, k, DEPTH)));
        let listed = serde_json::json!({ "depths": rows.collect::<Vec<_>>(), "under": [] });
        serde_json::from_value(listed).unwrap()
    }

    fn bottom(relief: &RutRelief<'_>, from: [f64; 3], along: [f64; 3]) -> Option<(Ray, Bottom)> {
        let ray = Ray::new(from.into(), along.into()).unwrap();
        let surface = plane::hit(&ray, &Plane::ground(), 9.0).unwrap();
        relief.under(&ray, &surface).map(|bottom| (ray, bottom))
    }

    #[test]
    fn a_ray_meets_the_bottom_or_a_wall() {
        let ruts = groove();
        let relief = RutRelief::new(&ruts, CELL).unwrap();
        let (_, down) = bottom(&relief, [0.1, 1.0, 0.02], [0.0, -1.0, 0.0]).unwrap();
        assert!(
            (down.depth - DEPTH).abs() < 1e-9 && (down.hit.distance - 1.0 - DEPTH).abs() < 1e-9
        );
        assert!((down.hit.normal - Vector3::y()).norm() < 1e-9);
        let (ray, slanted) = bottom(&relief, [0.0, 1.0, -1.06], [0.0, -1.0, 1.0]).unwrap();
        let place = ray.at(slanted.hit.distance);
        assert!((place.y + DEPTH).abs() < 1e-6 && (place.z + 0.06 - DEPTH).abs() < 1e-6);
        let (_, wall) = bottom(&relief, [0.0, 1.0, -0.905], [0.0, -1.0, 1.0]).unwrap();
        assert!(wall.depth < DEPTH && wall.hit.normal.z < -0.5, "{wall:?}");
        assert!(bottom(&relief, [0.0, 1.0, 0.3], [0.0, -1.0, 0.0]).is_none());
        assert!(RutRelief::new(&RutMap::new(1), CELL).is_none());
    }

    #[test]
    fn a_wall_shades_as_far_as_the_sun_is_low() {
        let ruts = groove();
        let relief = RutRelief::new(&ruts, CELL).unwrap();
        // Shadows are twice as long as walls are high.
        let sun = Vector3::new(0.0, 0.5, -1.0).normalize();
        for (from_wall, is_dark) in [(0.03, true), (0.085, true), (0.12, false), (0.17, false)] {
            let place = Vector3::new(0.0, -DEPTH, -0.1 + from_wall);
            let to_sun = Ray {
                origin: place,
                direction: sun,
            };
            let dark = relief.shades(&to_sun, &Vector3::y(), DEPTH);
            assert_eq!(dark, is_dark, "{from_wall} m");
        }
    }
}
