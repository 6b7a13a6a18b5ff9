//! Signed distance, points and normal of a pair of shapes: one module per pair, one dispatcher.
//!
//! | | plane | sphere of the ground | triangles | disc | box | sphere |
//! |---|---|---|---|---|---|---|
//! | disc | [`disc_plane`] | [`roller_sphere`] | [`disc_triangle`] | [`disc_disc`] | [`disc_box`] | [`roller_sphere`] |
//! | wheel with a width | [`roller_plane`] | [`roller_sphere`] | [`roller_triangle`] | as a disc | as a disc | [`roller_sphere`] |
//! | box | [`box_plane`] | [`box_sphere`] | [`box_triangle`] | | [`box_box`] | [`box_sphere`] |
//! | sphere | [`sphere_plane`] | [`sphere_sphere`] | [`sphere_triangle`] | | | [`sphere_sphere`] |
//! | cylinder, capsule | [`roller_plane`] | [`roller_sphere`] | [`roller_triangle`] | [`flats`] | [`flats`] | [`roller_sphere`] |
//! | ellipsoid | [`ellipsoid_plane`] | [`ellipsoid_sphere`] | [`ellipsoid_triangle`] | [`flats`] | [`flats`] | [`ellipsoid_sphere`] |
//! | polytope | [`hull_plane`] | [`hull_sphere`] | [`hull_triangle`] | [`flats`] | [`flats`] | [`hull_sphere`] |
//!
//! [`flats`] measures cylinders, capsules, ellipsoids and polytopes against each other and against
//! wheels and boxes.
//!
//! The gap is positive where the shapes are apart. Its rate is the normal part of the relative
//! velocity of the two *material* points, exactly unless a module states the error. [`convex`]
//! measures any two shapes by their support maps, for pairs without a formula of their own;
//! [`sweep`] finds the normal for a part that passes a sphere within one step.
//!
//! Against boxes and other wheels, but not against the other shapes, a wheel with a width is the
//! disc midway along its axle.
//!
//! Only [`dispatch`] and [`pairs`] know all pairs.

pub mod box_box;
pub mod box_plane;
pub mod box_sphere;
pub mod box_triangle;
mod chord;
pub mod convex;
mod crossing;
pub mod disc_box;
pub mod disc_disc;
pub mod disc_plane;
pub mod disc_triangle;
pub mod dispatch;
pub mod ellipsoid_plane;
pub mod ellipsoid_sphere;
pub mod ellipsoid_triangle;
pub mod flats;
pub mod hull_plane;
pub mod hull_sphere;
pub mod hull_triangle;
pub mod pairs;
pub mod roller_plane;
pub mod roller_sphere;
pub mod roller_triangle;
pub mod section;
pub mod sphere_plane;
pub mod sphere_sphere;
pub mod sphere_triangle;
pub mod sweep;

use nalgebra::Vector3;

/// The feature number of a pair that is measured by its nearest points.
pub const NEAREST: usize = 0;

/// Feature of the lowest point of a wheel's second circle, and the distance between features of its
/// two circles.
pub const CIRCLE: usize = 16;

/// Feature of the first end of the chord of a wheel's circle that lies on an edge.
pub const CHORD: usize = 3;

/// Whether a feature of a wheel is the lowest point of its rim, or of one of its circles, or on its
/// tread, or the end of a chord, which may be the lowest over an edge.
#[inline]
#[must_use]
pub fn is_lowest(feature: usize) -> bool {
    feature.is_multiple_of(CIRCLE) || feature % CIRCLE >= CHORD
}

/// A point of a shape at a primitive of the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Identifies the point among all that the pair can have.
    pub feature: usize,
    /// The shape's point, m.
    pub point: Vector3<f64>,
    /// Unit normal from the ground to the shape.
    pub n: Vector3<f64>,
    /// Rolling direction of a disc where its axle is along n; zero for shapes that do not roll.
    pub rolling: Vector3<f64>,
    /// m, negative inside.
    pub gap: f64,
}

impl SurfacePoint {
    /// A point of a shape that does not roll.
    #[inline]
    #[must_use]
    pub fn of_normal(feature: usize, point: Vector3<f64>, n: &Vector3<f64>, gap: f64) -> Self {
        Self {
            feature,
            point,
            n: *n,
            rolling: Vector3::zeros(),
            gap,
        }
    }
}

/// A point where two shapes are near each other.
///
/// The points of the two surfaces are `point ∓ ½ gap n`. Both shapes are pushed at the same place,
/// so no couple arises.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairPoint {
    /// Identifies the point among all that the pair can have.
    pub feature: usize,
    /// Halfway between the surfaces, m.
    pub point: Vector3<f64>,
    /// Unit normal from the first shape to the second.
    pub n: Vector3<f64>,
    /// m, negative where the shapes overlap.
    pub gap: f64,
}

impl PairPoint {
    /// Between a point of the first shape and the one of the second that lies `gap` along n.
    #[inline]
    #[must_use]
    pub(crate) fn from_first(feature: usize, x: &Vector3<f64>, n: &Vector3<f64>, gap: f64) -> Self {
        Self {
            feature,
            point: x + n * (0.5 * gap),
            n: *n,
            gap,
        }
    }

    /// Exchanges the first and the second shape: reverses the normal.
    #[inline]
    #[must_use]
    pub fn swapped(self) -> Self {
        Self { n: -self.n, ..self }
    }

    /// The first shape's point, m.
    #[must_use]
    pub fn on_first(&self) -> Vector3<f64> {
        self.point - self.n * (0.5 * self.gap)
    }

    /// The second shape's point, m.
    #[must_use]
    pub fn on_second(&self) -> Vector3<f64> {
        self.point + self.n * (0.5 * self.gap)
    }
}

/// Some unit vector perpendicular to a unit vector.
#[must_use]
pub(crate) fn any_tangent(n: &Vector3<f64>) -> Vector3<f64> {
    let e = if n.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::z()
    };
    (e - n * n.dot(&e)).normalize()
}
