//! A box among free spheres: a body of its own, which may lie on the plane
//! by its corners and carry spheres on its faces.

use rover_core::nalgebra::Vector3;

/// What the box is made of, and what pushes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// kg, spread evenly.
    pub mass: f64,
    /// Half of its edges, own axes, m.
    pub half: Vector3<f64>,
    /// μ between it and a sphere.
    pub friction: f64,
    /// Force at its centre, world, N.
    pub push: Vector3<f64>,
}

/// How many corners it has.
pub const CORNERS: usize = 8;

impl Slab {
    /// Moments of inertia about its own axes, kg m².
    #[must_use]
    pub fn inertia(&self) -> Vector3<f64> {
        let [x, y, z] = [0, 1, 2].map(|k| self.half[k] * self.half[k]);
        Vector3::new(y + z, x + z, x + y) * (self.mass / 3.0)
    }

    /// A corner, own axes, m. `k` below [`CORNERS`]: its bits are the signs.
    #[must_use]
    pub fn corner(&self, k: usize) -> Vector3<f64> {
        let sign = |bit: usize| if k & bit == 0 { -1.0 } else { 1.0 };
        self.half
            .component_mul(&Vector3::new(sign(1), sign(2), sign(4)))
    }

    /// Nearest point of the surface to a point x (m), its distance from x (m, negative if x is
    /// inside) and the outward normal there, all in own axes.
    #[must_use]
    pub fn nearest(&self, x: &Vector3<f64>) -> (Vector3<f64>, f64, Vector3<f64>) {
        let clamped = Vector3::from_fn(|k, _| x[k].clamp(-self.half[k], self.half[k]));
        let apart = x - clamped;
        let distance = apart.norm();
        if distance > 0.0 {
            return (clamped, distance, apart / distance);
        }
        // Inside: out through the nearest face.
        let depth = |k: usize| self.half[k] - x[k].abs();
        let k = (1..3).fold(0, |best, k| if depth(k) < depth(best) { k } else { best });
        let mut n = Vector3::zeros();
        n[k] = 1.0_f64.copysign(x[k]);
        (x + n * depth(k), -depth(k), n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: Slab = Slab {
        mass: 3.0,
        half: Vector3::new(1.0, 2.0, 3.0),
        friction: 0.5,
        push: Vector3::new(0.0, 0.0, 0.0),
    };

    #[test]
    fn nearest_points_lie_on_faces_edges_and_corners() {
        let cases = [
            ([0.5, 5.0, 1.0], [0.5, 2.0, 1.0], 3.0),
            ([4.0, 6.0, 0.0], [1.0, 2.0, 0.0], 5.0),
            ([-3.0, -3.0, 5.0], [-1.0, -2.0, 3.0], 3.0),
            ([-0.8, 1.0, -1.0], [-1.0, 1.0, -1.0], -0.2),
        ];
        for (x, point, distance) in cases {
            let x = Vector3::from(x);
            let (p, d, n) = BOX.nearest(&x);
            assert!((p - Vector3::from(point)).norm() < 1e-15, "{p}");
            assert!((d - distance).abs() < 1e-15, "{d}");
            assert!((p + n * d - x).norm() < 1e-15, "{n}");
        }
    }

    #[test]
    fn the_inertia_is_that_of_eight_small_boxes() {
        // Each octant by itself, moved out by Steiner's rule.
        let octant = Slab {
            mass: BOX.mass / 8.0,
            half: BOX.half / 2.0,
            ..BOX
        };
        let mut sum = octant.inertia() * 8.0;
        for k in 0..CORNERS {
            let r = octant.corner(k);
            let square = Vector3::from_element(r.norm_squared()) - r.component_mul(&r);
            sum += square * octant.mass;
        }
        assert!((sum - BOX.inertia()).norm() < 1e-13);
        assert!((BOX.inertia().y - 10.0).abs() < 1e-15, "m/12 (a² + c²)");
    }
}
