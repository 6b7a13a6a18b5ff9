//! The half-space below a plane as a terrain.

use nalgebra::Vector3;

use super::plane::Plane;
use super::{Primitive, Terrain};
use crate::geometry::ray::{self, Hit, Ray};

impl Terrain for Plane {
    #[inline]
    fn visit_near(
        &self,
        _centre: &Vector3<f64>,
        _reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        visit(0, &Primitive::Plane(*self));
    }

    #[inline]
    fn can_be_passed(&self) -> bool {
        false
    }

    #[inline]
    fn is_plane(&self) -> bool {
        true
    }

    #[inline]
    fn primitive(&self, _id: u32) -> Primitive {
        Primitive::Plane(*self)
    }

    fn n_primitives(&self) -> u32 {
        1
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        ray::plane::hit(ray, self, reach)
    }

    fn height(&self, x: f64, z: f64) -> Option<f64> {
        let n = self.normal();
        (n.y.abs() > 1e-12).then(|| -(n.x * x + n.z * z + self.offset()) / n.y)
    }

    fn ground(&self) -> Option<&Plane> {
        Some(self)
    }
}
