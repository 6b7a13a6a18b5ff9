//! Shapes of a machine's parts, placed in space: one file per shape with its data, bounding radius
//! and support map.
//!
//! All coordinates are in world axes, relative to an origin chosen by the caller, usually the
//! trunk's. A machine far from the world's origin then loses no precision.

pub mod disc;
pub mod ellipsoid;
pub mod hull;
pub mod oriented_box;
pub mod roller;
pub mod sphere;
pub mod support_map;

use nalgebra::{Matrix3, Vector3};

pub use disc::Disc;
pub use ellipsoid::Ellipsoid;
pub use hull::Hull;
pub use oriented_box::OrientedBox;
pub use roller::Roller;
pub use sphere::Sphere;
pub use support_map::SupportMap;

/// The shape of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlacedShape<'a> {
    /// A wheel of zero width.
    Disc(Disc),
    /// A wheel with a width.
    Roller(Roller),
    /// A box.
    Box(OrientedBox),
    /// A ball.
    Sphere(Sphere),
    /// A cylinder, with rounded edges or without; a capsule if its circles have no radius.
    Cylinder(Roller),
    /// An ellipsoid.
    Ellipsoid(Ellipsoid),
    /// A convex polytope of a model.
    Hull(Hull<'a>),
}

/// The rotations about its centre that leave a shape as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Roundness {
    /// All.
    Ball,
    /// Rotations about an axis, a unit vector.
    About(Vector3<f64>),
    /// None, or a few.
    None,
}

impl PlacedShape<'_> {
    /// The rotations that leave it as it is.
    #[inline]
    #[must_use]
    pub fn roundness(&self) -> Roundness {
        match self {
            Self::Disc(disc) => Roundness::About(disc.axle),
            Self::Roller(roller) | Self::Cylinder(roller) => Roundness::About(roller.core.axle),
            Self::Sphere(_) => Roundness::Ball,
            Self::Box(_) | Self::Ellipsoid(_) | Self::Hull(_) => Roundness::None,
        }
    }

    /// The middle disc of a wheel, which has a rolling direction; of any other shape `None`.
    #[inline]
    #[must_use]
    pub fn wheel(&self) -> Option<&Disc> {
        match self {
            Self::Disc(disc) => Some(disc),
            Self::Roller(roller) => Some(&roller.core),
            _ => None,
        }
    }

    /// Whether a point, relative to the centre, is further than `within` (m) from it, by an
    /// inexpensive bound.
    #[inline]
    #[must_use]
    pub fn is_beyond(&self, x: &Vector3<f64>, within: f64) -> bool {
        match self {
            Self::Disc(disc) => disc.axle.dot(x).abs() > within,
            Self::Roller(roller) | Self::Cylinder(roller) => {
                let beside = roller.core.axle.dot(x).abs();
                beside > within + roller.half + roller.rounding
            }
            Self::Box(solid) => {
                let local = solid.R.tr_mul(x);
                let outside = (local.abs() - solid.half_size).map(|x| x.max(0.0));
                outside.norm_squared() > within * within
            }
            Self::Sphere(_) => false,
            Self::Ellipsoid(_) | Self::Hull(_) => {
                let reach = within + self.bound();
                x.norm_squared() > reach * reach
            }
        }
    }

    /// A box around it; `base` (m) is added to its place.
    #[inline]
    #[must_use]
    pub fn bounding_box(&self, base: &Vector3<f64>) -> OrientedBox {
        let round = |disc: &Disc, radius: f64, half: f64| {
            let side = disc.axle.cross(&disc.spoke);
            OrientedBox {
                centre: base + disc.centre,
                R: Matrix3::from_columns(&[disc.spoke, side, disc.axle]),
                half_size: Vector3::new(radius, radius, half),
            }
        };
        match self {
            Self::Disc(disc) => round(disc, disc.radius, 0.0),
            Self::Roller(roller) | Self::Cylinder(roller) => {
                let half = roller.half + roller.rounding;
                round(&roller.core, roller.radius(), half)
            }
            Self::Box(solid) => OrientedBox {
                centre: base + solid.centre,
                ..*solid
            },
            Self::Sphere(sphere) => OrientedBox {
                centre: base + sphere.centre,
                R: Matrix3::identity(),
                half_size: Vector3::repeat(sphere.radius),
            },
            Self::Ellipsoid(solid) => OrientedBox {
                centre: base + solid.centre,
                R: solid.R,
                half_size: solid.radii,
            },
            Self::Hull(hull) => {
                let (middle, half_size) = hull.polytope.bounding_box();
                OrientedBox {
                    centre: base + hull.place(&middle),
                    R: hull.R,
                    half_size,
                }
            }
        }
    }

    /// The shape moved by `shift`, m.
    #[must_use]
    pub fn moved(mut self, shift: &Vector3<f64>) -> Self {
        *match &mut self {
            Self::Disc(disc) => &mut disc.centre,
            Self::Roller(roller) | Self::Cylinder(roller) => &mut roller.core.centre,
            Self::Box(solid) => &mut solid.centre,
            Self::Sphere(sphere) => &mut sphere.centre,
            Self::Ellipsoid(solid) => &mut solid.centre,
            Self::Hull(hull) => &mut hull.centre,
        } += shift;
        self
    }

    /// Whether a point (m) is in the shape; a disc has no volume, and none is.
    #[must_use]
    pub fn holds(&self, x: &Vector3<f64>) -> bool {
        match self {
            Self::Disc(_) => false,
            Self::Roller(roller) | Self::Cylinder(roller) => roller.holds(x),
            Self::Box(solid) => {
                let local = solid.R.tr_mul(&(x - solid.centre));
                (local.abs() - solid.half_size).max() <= 0.0
            }
            Self::Sphere(sphere) => sphere.distance(x) <= 0.0,
            Self::Ellipsoid(solid) => solid.holds(x),
            Self::Hull(hull) => hull.holds(x),
        }
    }
}

impl SupportMap for PlacedShape<'_> {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Disc(disc) => disc.support(direction),
            Self::Roller(roller) | Self::Cylinder(roller) => roller.support(direction),
            Self::Box(solid) => solid.support(direction),
            Self::Sphere(sphere) => sphere.support(direction),
            Self::Ellipsoid(solid) => solid.support(direction),
            Self::Hull(hull) => hull.support(direction),
        }
    }

    fn centre(&self) -> Vector3<f64> {
        match self {
            Self::Disc(disc) => disc.centre,
            Self::Roller(roller) | Self::Cylinder(roller) => roller.core.centre,
            Self::Box(solid) => solid.centre,
            Self::Sphere(sphere) => sphere.centre,
            Self::Ellipsoid(solid) => solid.centre,
            Self::Hull(hull) => hull.centre,
        }
    }

    fn bound(&self) -> f64 {
        match self {
            Self::Disc(disc) => disc.bound(),
            Self::Roller(roller) | Self::Cylinder(roller) => roller.bound(),
            Self::Box(solid) => solid.bound(),
            Self::Sphere(sphere) => sphere.bound(),
            Self::Ellipsoid(solid) => solid.bound(),
            Self::Hull(hull) => hull.bound(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::oriented_box::signs;
    use super::*;
    use crate::spatial::Polytope;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_support_point_is_in_the_shape_and_furthest(
            angles in prop::array::uniform3(-3.0..3.0), d in prop::array::uniform3(-1.0..1.0), phi in 0.0..6.3,
        ) {
            let R = *Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).matrix();
            let centre = Vector3::new(0.3, -0.2, 0.1);
            let d = Vector3::from(d);
            let disc = Disc { centre, axle: R.column(2).into(), spoke: R.column(0).into(), radius: 0.3 };
            let E = disc.support(&d) - centre;
            prop_assert!(E.norm() <= 0.3 + 1e-12 && E.dot(&disc.axle).abs() < 1e-12);
            let rim = R * Vector3::new(f64::cos(phi), f64::sin(phi), 0.0) * 0.3;
            prop_assert!(d.dot(&rim) <= d.dot(&E) + 1e-12);
            let solid = OrientedBox { centre, R, half_size: Vector3::new(0.4, 0.2, 0.1) };
            let E = R.tr_mul(&(solid.support(&d) - centre));
            prop_assert!((E.abs() - solid.half_size).norm() < 1e-12);
            for k in 0..8 {
                prop_assert!(d.dot(&solid.corner(k)) <= d.dot(&solid.support(&d)) + 1e-12);
            }
            let points: Vec<_> = (0..8).map(|k| solid.half_size.component_mul(&signs(k)) * (1.0 + 0.1 * k as f64)).collect();
            let polytope = Polytope::hull_of(&points).unwrap();
            let hull = Hull { centre, R, polytope: &polytope };
            for k in 0..polytope.vertices().len() {
                prop_assert!(d.dot(&hull.vertex(k)) <= d.dot(&hull.support(&d)) + 1e-12);
                prop_assert!(hull.holds(&(centre + (hull.vertex(k) - centre) * 0.999)));
            }
            let ellipsoid = Ellipsoid { centre, R, radii: Vector3::new(0.4, 0.2, 0.1) };
            let along = Vector3::new(f64::cos(phi) * 0.6, f64::sin(phi) * 0.6, 0.8).component_mul(&ellipsoid.radii);
            prop_assert!(d.dot(&(centre + R * along)) <= d.dot(&ellipsoid.support(&d)) + 1e-12);
            prop_assert!((d.dot(&(ellipsoid.support(&d) - centre)) - ellipsoid.extent(&d)).abs() < 1e-12);
            for shape in [
                PlacedShape::Disc(disc), PlacedShape::Box(solid), PlacedShape::Sphere(Sphere { centre, radius: 0.2 }),
                PlacedShape::Cylinder(Roller::new(disc, 0.5, 0.0)), PlacedShape::Cylinder(Roller::new(disc, 0.9, 0.3)),
                PlacedShape::Ellipsoid(ellipsoid), PlacedShape::Hull(hull),
            ] {
                let around = shape.bounding_box(&Vector3::zeros());
                let beyond = around.R.tr_mul(&(shape.support(&d) - around.centre)).abs() - around.half_size;
                prop_assert!(beyond.max() < 1e-12);
                prop_assert!((shape.support(&d) - shape.centre()).norm() <= shape.bound() + 1e-12);
            }
        }
    }
}
