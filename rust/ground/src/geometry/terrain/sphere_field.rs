//! Field of fixed spheres, with or without a plane under them.

use std::sync::Arc;

use nalgebra::Vector3;

use super::error::TerrainError;
use super::limits::{check_count, check_entry};
use super::plane::Plane;
use super::rocks::Rocks;
use super::{Coverage, GROUND, Primitive, ROCK, Terrain};
use crate::geometry::broad_phase::BallTree;
use crate::geometry::ray::{self, Hit, Ray};
use crate::geometry::shape::Sphere;
use friction_contact::scalar::elementary::{hypot, sin_cos};

/// Spheres and an optional ground plane. Immutable.
///
/// Number 0 is reserved for the plane; sphere i (from 0, in the given order) is primitive i + 1.
#[derive(Clone, Debug)]
pub struct SphereField {
    ground: Option<Plane>,
    /// The spheres, which are many: nothing else holds them.
    tree: BallTree,
    /// Name of the spheres' material, if it is not the default.
    material: Option<Arc<str>>,
}

impl SphereField {
    /// Gives the spheres the material `name`; see [`is_name`](friction_contact::law::materials::is_name).
    #[must_use]
    pub fn with_material(mut self, name: &str) -> Self {
        self.material = Some(name.into());
        self
    }

    /// From centres (n, 3) and radii (n), m.
    ///
    /// # Errors
    /// `MismatchedLengths`, `TooMany`, `Empty`, `EntryNotFinite`, `NonPositiveRadius`, `TooFar`.
    pub fn new(
        centres: &[[f64; 3]],
        radii: &[f64],
        ground: Option<Plane>,
    ) -> Result<Self, TerrainError> {
        if centres.len() != radii.len() {
            return Err(TerrainError::MismatchedLengths {
                centres: centres.len(),
                radii: radii.len(),
            });
        }
        check_count(centres.len())?;
        if centres.is_empty() && ground.is_none() {
            return Err(TerrainError::Empty);
        }
        let mut spheres = Vec::with_capacity(centres.len());
        for (index, (centre, &radius)) in centres.iter().zip(radii).enumerate() {
            for &value in centre {
                check_entry("centres", index, value)?;
            }
            check_entry("radii", index, radius)?;
            if radius <= 0.0 {
                return Err(TerrainError::NonPositiveRadius { index, radius });
            }
            spheres.push(Sphere::new(Vector3::from(*centre), radius));
        }
        let tree = BallTree::new(&spheres);
        Ok(Self {
            ground,
            tree,
            material: None,
        })
    }

    /// The rug of the report's Fig. 6.6: 50 x 25 spheres of radius 0.5 m at x = 0.6 i, z = 0.6 j,
    /// y = −0.5 + 0.5 sin(x/5 + π/2), without a plane.
    #[must_use]
    pub fn rug() -> Self {
        let spheres: Vec<Sphere> = (0..50)
            .flat_map(|i| (0..25).map(move |j| (0.6 * f64::from(i), 0.6 * f64::from(j))))
            .map(|(x, z)| {
                let y = -0.5 + 0.5 * sin_cos(x / 5.0 + std::f64::consts::FRAC_PI_2).0;
                Sphere::new(Vector3::new(x, y, z), 0.5)
            })
            .collect();
        Self {
            material: None,
            tree: BallTree::new(&spheres),
            ground: None,
        }
    }

    /// Rocks scattered over a plane with the size–frequency distribution of Mars: see [`Rocks`].
    ///
    /// # Errors
    /// A number out of its range; `TooMany`.
    pub fn rocks(rocks: &Rocks) -> Result<Self, TerrainError> {
        let spheres = rocks.sample()?;
        for (index, sphere) in spheres.iter().enumerate() {
            (sphere.centre.iter()).try_for_each(|&x| check_entry("centres", index, x))?;
        }
        let tree = BallTree::new(&spheres);
        Ok(Self {
            material: None,
            ground: Some(rocks.ground),
            tree,
        })
    }

    /// Rocks that lie on another terrain, which is not part of the field: each is raised by the
    /// height of the ground under its middle. Where there is none there are no rocks.
    ///
    /// # Errors
    /// As [`Self::rocks`]; `Empty` if no rock is left.
    pub fn rocks_on(rocks: &Rocks, ground: &dyn Terrain) -> Result<Self, TerrainError> {
        let flat = Rocks {
            ground: Plane::ground(),
            ..rocks.clone()
        };
        let raised = |sphere: Sphere| {
            let [x, y, z]: [f64; 3] = sphere.centre.into();
            let height = ground.height(x, z)?;
            let centre = Vector3::new(x, y + height, z);
            Some(Sphere { centre, ..sphere })
        };
        let spheres: Vec<Sphere> = flat.sample()?.into_iter().filter_map(raised).collect();
        if spheres.is_empty() {
            return Err(TerrainError::Empty);
        }
        for (index, sphere) in spheres.iter().enumerate() {
            (sphere.centre.iter()).try_for_each(|&x| check_entry("centres", index, x))?;
        }
        let tree = BallTree::new(&spheres);
        Ok(Self {
            ground: None,
            tree,
            material: None,
        })
    }

    /// The spheres in the order they were given.
    #[must_use]
    pub fn spheres(&self) -> impl ExactSizeIterator<Item = &Sphere> {
        (0..self.tree.len()).map(|index| self.tree.ball(index))
    }
}

impl Terrain for SphereField {
    fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        if let Some(plane) = self.ground {
            visit(0, &Primitive::Plane(plane));
        }
        self.tree.visit_near(centre, reach, |index, sphere| {
            visit(index + 1, &Primitive::Sphere(*sphere));
        });
    }

    fn can_be_passed(&self) -> bool {
        !self.tree.is_empty()
    }

    fn is_plane(&self) -> bool {
        self.ground.is_some() && self.tree.is_empty()
    }

    fn primitive(&self, id: u32) -> Primitive {
        match (id, self.ground) {
            (0, Some(plane)) => Primitive::Plane(plane),
            (id, _) => Primitive::Sphere(*self.tree.ball(id as usize - 1)),
        }
    }

    fn material(&self, id: u32) -> &str {
        if id == 0 {
            return GROUND;
        }
        self.material.as_deref().unwrap_or(ROCK)
    }

    #[allow(clippy::cast_possible_truncation)] // at most the limit of spheres
    fn n_primitives(&self) -> u32 {
        self.tree.len() as u32 + 1
    }

    fn coverage(&self, _centre: &Vector3<f64>, _radius: f64) -> Coverage {
        if self.ground.is_some() {
            Coverage::Known
        } else {
            Coverage::Silent
        }
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        self.first_hit_of(ray, reach).map(|(hit, _)| hit)
    }

    fn first_hit_of(&self, ray: &Ray, reach: f64) -> Option<(Hit, Option<(u32, Sphere)>)> {
        let ground = self.ground.as_ref();
        let ground = ground.and_then(|plane| ray::plane::hit(ray, plane, reach));
        let reach = ground.map_or(reach, |hit| hit.distance);
        let sphere = self.tree.first_hit(ray, reach);
        let sphere = sphere.map(|(hit, index, sphere)| (hit, Some((index, sphere))));
        sphere.or(ground.map(|hit| (hit, None)))
    }

    /// The highest of ground and spheres.
    fn height(&self, x: f64, z: f64) -> Option<f64> {
        let mut highest = self.ground.as_ref().and_then(|plane| plane.height(x, z));
        self.tree.visit_column(x, z, |sphere| {
            let across = hypot(sphere.centre.x - x, sphere.centre.z - z);
            let top = sphere.centre.y + (sphere.radius.powi(2) - across.powi(2)).max(0.0).sqrt();
            highest = Some(highest.map_or(top, |y| y.max(top)));
        });
        highest
    }

    fn ground(&self) -> Option<&Plane> {
        self.ground.as_ref()
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn primitives_have_the_numbers_that_a_visit_gives() {
        let field = SphereField::new(
            &[[0.0; 3], [5.0, 0.0, 0.0]],
            &[1.0, 2.0],
            Some(Plane::ground()),
        )
        .unwrap();
        let mut seen = Vec::new();
        field.visit_near(&Vector3::new(0.0, 1.5, 0.0), 1.0, &mut |id, primitive| {
            assert_eq!(*primitive, field.primitive(id));
            seen.push(id);
        });
        assert_eq!(seen, [0, 1]);
    }
}
