//! What a search for primitives around a part of a machine knows of the part.

use nalgebra::Vector3;

use crate::geometry::shape::{OrientedBox, PlacedShape, SupportMap};

/// Covers the rounding of distances, m, for coordinates up to the size of a terrain.
const ROUNDING: f64 = 1e-6;

/// A part, and how near it a primitive must come.
#[derive(Clone, Copy, Debug)]
pub struct Neighbourhood<'a> {
    /// Shape of the part, in coordinates with their origin at `base`.
    pub shape: &'a PlacedShape<'a>,
    /// Centre of the shape, world, m.
    pub centre: Vector3<f64>,
    /// Largest gap of a contact, m.
    pub reach: f64,
    /// How far the part moves, m: it may pass a sphere on its way, but no piece of a surface.
    pub motion: f64,
    /// Origin of the shape's coordinates, world, m.
    pub base: &'a Vector3<f64>,
}

impl<'a> Neighbourhood<'a> {
    /// Neighbourhood of a part at rest, by its shape in coordinates with their origin at `base`
    /// (world, m).
    #[must_use]
    pub fn new(shape: &'a PlacedShape<'a>, base: &'a Vector3<f64>, reach: f64) -> Self {
        Self {
            shape,
            centre: base + shape.centre(),
            reach,
            motion: 0.0,
            base,
        }
    }

    /// Radius of a ball about the centre that has all that can be touched, m.
    #[inline]
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.shape.bound() + self.reach + self.motion
    }

    /// A box with all that can be touched of a surface, world, m.
    #[inline]
    #[must_use]
    pub fn solid(&self) -> OrientedBox {
        self.shape.bounding_box(self.base).grown(self.reach)
    }

    /// How far the shape extends from its centre along a unit vector, either way, m.
    #[inline]
    pub(super) fn extent(&self, d: &Vector3<f64>) -> f64 {
        let beside = |axle: &Vector3<f64>| {
            let along = d.dot(axle);
            (1.0 - along * along).max(0.0).sqrt()
        };
        match self.shape {
            PlacedShape::Disc(disc) => disc.radius * beside(&disc.axle),
            PlacedShape::Roller(roller) => {
                let axle = &roller.core.axle;
                let flat = roller.half * d.dot(axle).abs();
                roller.core.radius * beside(axle) + flat + roller.rounding
            }
            PlacedShape::Box(solid) => (solid.R.tr_mul(d).abs()).dot(&solid.half_size),
            PlacedShape::Sphere(sphere) => sphere.radius,
            PlacedShape::Cylinder(_) | PlacedShape::Ellipsoid(_) | PlacedShape::Hull(_) => {
                let along =
                    |d: &Vector3<f64>| d.dot(&(self.shape.support(d) - self.shape.centre()));
                along(d).max(along(&-d))
            }
        }
    }

    /// Whether the whole shape is further from a plane than `reach` (m), whatever the rounding.
    /// `m`: a normal of the plane of length at least 1; `height`: of the shape's centre over the
    /// plane, in units of that length, m.
    #[inline]
    pub(super) fn is_beyond(&self, m: &Vector3<f64>, height: f64, reach: f64) -> bool {
        let square = m.norm_squared();
        // At least the length, and the reach in its units.
        let length = 0.5 * (1.0 + square);
        let reach = reach + ROUNDING;
        let rest = height - reach.max(reach * length);
        // Whether a circle about an axle is below what is left.
        let clears = |rest: f64, radius: f64, along: f64| {
            rest > 0.0 && rest * rest > radius * radius * (square - along * along)
        };
        match self.shape {
            PlacedShape::Disc(disc) => clears(rest, disc.radius, m.dot(&disc.axle)),
            PlacedShape::Roller(roller) => {
                let along = m.dot(&roller.core.axle);
                let rest = rest - roller.half * along.abs() - roller.rounding * length;
                clears(rest, roller.core.radius, along)
            }
            PlacedShape::Box(solid) => rest > (solid.R.tr_mul(m).abs()).dot(&solid.half_size),
            PlacedShape::Sphere(sphere) => rest > sphere.radius * length,
            PlacedShape::Cylinder(_) | PlacedShape::Ellipsoid(_) | PlacedShape::Hull(_) => {
                rest > m.dot(&(self.shape.centre() - self.shape.support(&-m)))
            }
        }
    }

    /// Whether no point at a convex edge is in reach, of whose faces' planes the shape is out of
    /// reach or not.
    ///
    /// The normal of a point at the edge is a combination of the faces' with positive weights whose
    /// sum is at least 1, and its gap that of theirs or more; of a round shape it is the largest
    /// for all normals.
    #[inline]
    pub(super) fn is_beyond_edge(&self, [first, second]: [bool; 2]) -> bool {
        match self.shape {
            PlacedShape::Disc(_) | PlacedShape::Sphere(_) | PlacedShape::Ellipsoid(_) => {
                first || second
            }
            PlacedShape::Roller(_)
            | PlacedShape::Box(_)
            | PlacedShape::Cylinder(_)
            | PlacedShape::Hull(_) => first && second,
        }
    }
}
