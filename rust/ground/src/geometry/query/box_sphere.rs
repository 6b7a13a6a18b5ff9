//! Box on a sphere: the point of the box nearest to the sphere's centre.
//!
//! Outside, the nearest point E is the sphere's centre clamped to the box; inside,
//! it is on the nearest face and the distance counts negative.
//! `gap = ±|a − E| − r_s`, n from the sphere to the box. As E minimises over the
//! box, the gap's gradient is nᵀ times the Jacobian of the material point at E.

use nalgebra::Vector3;

use super::{NEAREST, SurfacePoint};
use crate::geometry::{OrientedBox, Sphere};

/// Nearest point of a box; `base` (m, world) is where its coordinates have their origin.
#[inline]
#[must_use]
pub fn nearest_point(solid: &OrientedBox, sphere: &Sphere, base: &Vector3<f64>) -> SurfacePoint {
    let local = solid.R.tr_mul(&(sphere.centre - base - solid.centre));
    let (point, n, distance) = nearest_local(&local, &solid.half_size);
    SurfacePoint::of_normal(
        NEAREST,
        solid.centre + solid.R * point,
        &(solid.R * n),
        distance - sphere.radius,
    )
}

/// Nearest point of the surface, normal into the box and signed distance of
/// a point, all in the box's axes.
#[inline]
#[must_use]
pub fn nearest_local(
    x: &Vector3<f64>,
    half_size: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>, f64) {
    let point = Vector3::from_fn(|k, _| x[k].clamp(-half_size[k], half_size[k]));
    let inward = point - x;
    let distance = inward.norm();
    if distance > 0.0 {
        return (point, inward / distance, distance);
    }
    let axis = (half_size - x.abs()).imin();
    let side = if x[axis] < 0.0 { -1.0 } else { 1.0 };
    through_side(x, half_size, axis, side)
}

/// Surface point straight through one side of a box from a point x inside, the normal into the box
/// there and the signed distance of x, all in the box's axes. `side`: 1 or −1, for the positive or
/// the negative side across `axis`.
#[inline]
#[must_use]
pub fn through_side(
    x: &Vector3<f64>,
    half_size: &Vector3<f64>,
    axis: usize,
    side: f64,
) -> (Vector3<f64>, Vector3<f64>, f64) {
    let (mut point, mut n) = (*x, Vector3::zeros());
    point[axis] = side * half_size[axis];
    n[axis] = -side;
    (point, n, side * x[axis] - half_size[axis])
}

/// The box's point over the tangent plane (normal n) at the point `touch`
/// where a sphere was first met.
///
/// For a box that may already be past the sphere; `touch` in the axes of `base`. The point lies on
/// the deepest corner, edge or face along the axes that the plane is tilted against, and at `touch`
/// along the others.
#[inline]
#[must_use]
pub fn point_over_tangent(
    solid: &OrientedBox,
    n: &Vector3<f64>,
    touch: &Vector3<f64>,
) -> SurfacePoint {
    let OrientedBox {
        centre,
        R,
        half_size,
    } = solid;
    let n_local = R.tr_mul(n);
    let local = R.tr_mul(&(touch - centre));
    let point = Vector3::from_fn(|k, _| {
        if n_local[k].abs() > TILTED {
            -half_size[k] * n_local[k].signum()
        } else {
            local[k].clamp(-half_size[k], half_size[k])
        }
    });
    let point = centre + R * point;
    SurfacePoint::of_normal(NEAREST, point, n, n.dot(&(point - touch)))
}

/// Sine of the tilt above which an edge of a box, and not a face, touches a plane: more than a box
/// turns in a step.
const TILTED: f64 = 0.1;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_point_of_the_surface_is_nearer(
            x in prop::array::uniform3(-1.0..1.0), other in prop::array::uniform3(-1.0..1.0), axis in 0..3_usize, up: bool,
        ) {
            let (x, half) = (Vector3::from(x), Vector3::new(0.6, 0.2, 0.5));
            let (E, n, distance) = nearest_local(&x, &half);
            let is_inside = (x.abs() - half).max() < 0.0;
            prop_assert_eq!(is_inside, distance < 0.0);
            prop_assert!((E - x - n * distance).norm() < 1e-12 && (n.norm() - 1.0).abs() < 1e-12);
            let mut on_surface = Vector3::from(other).component_mul(&half);
            on_surface[axis] = if up { half[axis] } else { -half[axis] };
            prop_assert!(distance.abs() <= (on_surface - x).norm() + 1e-12);
        }
    }

    #[test]
    fn on_a_crest_the_flat_bottom_touches_above_the_crest() {
        let sphere = Sphere::new(Vector3::new(0.1, 0.0, -0.2), 0.5);
        let solid = OrientedBox {
            centre: Vector3::new(0.0, 0.69, 0.0),
            R: nalgebra::Matrix3::identity(),
            half_size: Vector3::new(0.6, 0.2, 0.5),
        };
        let near = nearest_point(&solid, &sphere, &Vector3::zeros());
        assert!((near.gap + 0.01).abs() < 1e-12);
        assert!((near.n - Vector3::y()).norm() < 1e-12);
        assert!((near.point - Vector3::new(0.1, 0.49, -0.2)).norm() < 1e-12);
        let centre = nearest_local(&Vector3::zeros(), &Vector3::new(0.6, 0.2, 0.5));
        assert!((centre.2 + 0.2).abs() < 1e-15 && centre.1.norm() > 0.0);
    }
}
