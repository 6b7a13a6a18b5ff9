//! The planes of the faces around a corner of a height field, of one cell or of several at once.

use friction_contact::scalar::{Lane, Vec3};

/// The faces at a cell's edges, by number in [`Heights::normals`].
pub(super) const LOW: usize = 0;
pub(super) const HIGH: usize = 1;
const BEFORE: usize = 2;
const LEFT: usize = 3;

/// Faces at the edges k = 2, 3, 4 of a corner, in the order of
/// [`Hinge`](crate::geometry::terrain::surface::Hinge).
pub(super) const AT_EDGE: [[usize; 2]; 3] = [[BEFORE, LOW], [HIGH, LEFT], [LOW, HIGH]];

/// Heights of a cell's corners, and of those before and left of the first, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heights<T> {
    pub own: [T; 4],
    pub before: T,
    pub left: T,
}

impl<T: Lane> Heights<T> {
    /// Heights of the corners over the first, m.
    #[inline(always)]
    pub fn rises(&self) -> [T; 4] {
        let [a, b, c, d] = self.own;
        [a.like(0.0), b - a, c - a, d - a]
    }

    /// Normals with a vertical component of 1 of the cell's two faces, and of those before and left
    /// of it; `per`: 1/dx, 1/dz, 1/m.
    #[inline(always)]
    pub fn normals(&self, per: [f64; 2]) -> [Vec3<T>; 4] {
        let Self {
            own: [a, b, c, d],
            before,
            left,
        } = *self;
        [
            upright(b - a, d - b, per),
            upright(d - c, c - a, per),
            upright(b - a, a - before, per),
            upright(a - left, c - a, per),
        ]
    }

    /// Which edges are convex: the middle of the edge is above that of the corners on its sides.
    #[inline(always)]
    pub fn convex(&self) -> [T::Mask; 3] {
        let [a, b, c, d] = self.own;
        [
            (d + self.before).lt(a + b),
            (d + self.left).lt(a + c),
            (b + c).lt(a + d),
        ]
    }

    /// The edges k = 2, 3, 4 from the first corner, m.
    #[inline(always)]
    pub fn edges(&self, [dx, dz]: [f64; 2]) -> [Vec3<T>; 3] {
        let [zero, b, c, d] = self.rises();
        let (x, z) = (zero.like(dx), zero.like(dz));
        [
            Vec3::new(x, b, zero),
            Vec3::new(zero, c, z),
            Vec3::new(x, d, z),
        ]
    }

    /// Whether the vertex at the first corner may be convex.
    #[inline(always)]
    pub fn is_high(&self) -> T::Mask {
        let [a, b, c, _] = self.own;
        let twice = a + a;
        (b + self.left).le(twice) & (c + self.before).le(twice)
    }
}

/// The normal with a vertical component of 1 of a face that rises so along x and z, m.
#[inline(always)]
pub(super) fn upright<T: Lane>(x: T, z: T, per: [f64; 2]) -> Vec3<T> {
    let one = x.like(1.0);
    Vec3::new(-x * x.like(per[0]), one, -z * x.like(per[1]))
}
