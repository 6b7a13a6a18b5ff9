//! What rays meet on a rover's ground and on the rover itself.

use super::rover::RoverSimulation;
use crate::contact::Part;
use crate::geometry::ray::{Hit, Ray, nearer, shape};

impl RoverSimulation {
    /// What each ray meets first within `range` (m): the ground, or one of `parts` of the rover
    /// where it is now.
    #[must_use]
    pub fn cast(&self, rays: &[Ray], range: f64, parts: &[Part]) -> Vec<Option<Hit>> {
        let (model, kinematics) = (self.model(), self.kinematics());
        let placed: Vec<_> = parts
            .iter()
            .map(|part| {
                let origin = *kinematics.origin(part.body(model));
                (origin, part.place(model, &kinematics))
            })
            .collect();
        let of_ray = |ray: &Ray| {
            let mut nearest = self.terrain().first_hit(ray, range);
            for (origin, part) in &placed {
                let reach = nearest.map_or(range, |hit| hit.distance);
                let from_there = Ray {
                    origin: ray.origin - origin,
                    ..*ray
                };
                nearest = nearer(nearest, shape::hit(&from_there, part, reach));
            }
            nearest
        };
        rays.iter().map(of_ray).collect()
    }
}
