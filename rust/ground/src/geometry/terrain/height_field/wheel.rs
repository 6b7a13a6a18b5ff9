//! A wheel over the planes of a height field, for the cells of a register at once.
//!
//! Of a cell's faces those count whose plane is within reach of the lowest point of one of the
//! wheel's circles over it, if this point is about over the face; of its edges those that are
//! convex and between two such planes, with the lowest points over them beyond the edge. A cell
//! with a steep face around it is treated apart: there a lowest point may be far off its face.

use super::cells::Cells;
use super::neighbourhood::ROUNDING;
use super::planes::{AT_EDGE, HIGH, Heights, LOW, upright};
use crate::geometry::shape::Disc;
use crate::geometry::terrain::Neighbourhood;
use crate::geometry::terrain::surface::BEYOND;
use friction_contact::scalar::{Lane, Vec3};

/// Square of the length of a normal with a vertical component of 1 up to which a lowest point is
/// off its face, seen from above, by [`OFF`] gaps at most: normals lean by 45 degrees then, and
/// walls by as much from their face's, sin 45° + tan 45°.
const GENTLE: f64 = 2.0;
pub(super) const OFF: f64 = 1.75;

/// How deep a disc must be to touch a piece beside it, or how far above, in the distance between
/// them: walls that lean move the point by less than [`OFF`] gaps, and an edge has points beyond
/// its ends that are less than one gap away.
const SHARE: f64 = 0.5;

/// Sine of the angle up to which an axle is level enough: a vertex that pierces the face of the
/// disc has a slope beside it of more than 1.5.
const STANDS: f64 = 0.4;

/// Square of the length of a normal with a vertical component of 1 up to which an edge cannot be
/// sharp: slopes of up to 0.8.
const UNSHARP: f64 = 1.64;

/// Sine of the angle between axle and edge up to which the edge is alongside the wheel.
const ALONGSIDE: f64 = 1e-3;

/// Kinds of pieces of a cell, and whether a face at one of its edges is steep.
pub(super) const KINDS: usize = 7;
const VERTEX: usize = 5;
pub(super) const STEEP: usize = 6;

/// A wheel: a disc in its middle, the distance of its circles from there, 0 if there is one, and
/// what they are swept by, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct SweptWheel<'a> {
    pub part: &'a Neighbourhood<'a>,
    pub disc: &'a Disc,
    pub half: f64,
    pub rounding: f64,
}

/// A circle of the wheel over the planes at a cell.
struct Circle<T: Lane> {
    /// Lowest points of the circle over each plane, from the cell's corner, m.
    lows: [Vec3<T>; 4],
    /// Heights over each plane, in units of the normals' lengths, m: of the circle's centre, and of
    /// that centre over the lowest point.
    heights: [T; 4],
    drops: [T; 4],
    /// Cells where the circle is out of reach, for each plane.
    is_beyond: [T::Mask; 4],
}

/// The planes at the cells of a register.
struct Planes<T> {
    normals: [Vec3<T>; 4],
    /// Squares of their lengths, and their part along the axle.
    squares: [T; 4],
    along: [T; 4],
}

impl SweptWheel<'_> {
    /// Which pieces the wheel may touch, of the cells from number `at` on.
    #[inline(always)]
    pub fn compare<T: Lane>(
        &self,
        token: T::Token,
        spacing: [f64; 2],
        (cells, at): (&Cells, usize),
    ) -> [T::Mask; KINDS] {
        let height = |k: usize| T::load(token, &cells.heights[k][at..at + T::LANES]);
        let heights = Heights {
            own: [height(0), height(1), height(2), height(3)],
            before: height(4),
            left: height(5),
        };
        let (right, above) = (height(6), height(7));
        let [a, b, c, d] = heights.own;
        let from = Vec3::new(
            T::load(token, &cells.from[0][at..at + T::LANES]),
            a.like(self.part.centre.y) - a,
            T::load(token, &cells.from[1][at..at + T::LANES]),
        );
        let s = Vec3::splat(token, self.disc.axle.into());
        let per = [1.0 / spacing[0], 1.0 / spacing[1]];
        let normals = heights.normals(per);
        let mut planes = Planes {
            normals,
            squares: [a; 4],
            along: [a; 4],
        };
        let gentle = a.like(GENTLE);
        let steep = |m: Vec3<T>| gentle.lt(m.dot(m));
        let mut is_steep = steep(upright(right - d, d - b, per));
        is_steep = is_steep | steep(upright(d - c, above - d, per));
        for k in 0..4 {
            planes.squares[k] = normals[k].dot(normals[k]);
            planes.along[k] = normals[k].dot(s);
            is_steep = is_steep | gentle.lt(planes.squares[k]);
        }
        let (edges, convex) = (heights.edges(spacing), heights.convex());
        let none = T::mask(token, 0);
        let mut near = [none; KINDS];
        let beside = self.beside(&heights, spacing, from);
        let n_circles = if self.half > 0.0 { 2 } else { 1 };
        for place in [self.half, -self.half].into_iter().take(n_circles) {
            let from = from + s * a.like(place);
            let circle = self.circle(&planes, from, beside - a.like(place.abs()));
            for half in [LOW, HIGH] {
                near[half] = near[half] | self.is_over(&planes, &circle, half, spacing);
            }
            for k in 0..3 {
                let touches = self.may_touch_between(&planes, &circle, k, edges[k]);
                near[2 + k] = near[2 + k] | (convex[k] & touches);
            }
        }
        if self.half > 0.0 {
            for k in 0..3 {
                let crosses = self.may_cross(&planes, k, edges[k], from);
                near[2 + k] = near[2 + k] | (convex[k] & crosses);
            }
        }
        near[VERTEX] = heights.is_high() & self.may_touch_vertex(from);
        near[STEEP] = is_steep;
        near
    }

    /// Distance of a cell from the disc's plane, m: what lies beside a disc is touched only if the
    /// disc is about as deep in the ground.
    #[inline(always)]
    fn beside<T: Lane>(&self, heights: &Heights<T>, spacing: [f64; 2], from: Vec3<T>) -> T {
        let like = from.x;
        let s = &self.disc.axle;
        let (x, z) = (s.x * spacing[0], s.z * spacing[1]);
        let centre = Vec3::splat(like.token(), (*s).into()).dot(from);
        let (levels, rises) = ([0.0, x, z, x + z], heights.rises());
        let mut nearest = like.like(f64::INFINITY);
        let mut furthest = -nearest;
        for k in 0..4 {
            let place = like.like(levels[k]) + like.like(s.y) * rises[k] - centre;
            // What is no number is left out.
            nearest = place.min(nearest);
            furthest = place.max(furthest);
        }
        nearest.max(-furthest).max(like.like(0.0))
    }

    /// A circle whose centre is `from` (m) from the corner of a cell that is `beside` it, m.
    #[inline(always)]
    fn circle<T: Lane>(&self, planes: &Planes<T>, from: Vec3<T>, beside: T) -> Circle<T> {
        let like = beside;
        let (zero, half, one) = (like.like(0.0), like.like(0.5), like.like(1.0));
        let (s, radius) = (
            Vec3::splat(like.token(), self.disc.axle.into()),
            like.like(self.disc.radius),
        );
        let beside = (beside - like.like(self.rounding)).max(zero);
        let (reach, depth) = (
            like.like(self.reach() + ROUNDING),
            like.like(SHARE) * beside,
        );
        let least = T::select(depth.le(reach), reach, like.like(ROUNDING) - depth);
        let never = zero.lt(zero);
        let mut circle = Circle {
            lows: [from; 4],
            heights: [zero; 4],
            drops: [zero; 4],
            is_beyond: [never; 4],
        };
        for k in 0..4 {
            let (m, square, along) = (planes.normals[k], planes.squares[k], planes.along[k]);
            let height = m.dot(from);
            let rest = square - along * along;
            // At least the length, and the reach in its units.
            let bound = half * (one + square);
            let over = height - least.max(least * bound);
            circle.is_beyond[k] = zero.lt(over) & (radius * radius * rest).lt(over * over);
            let length = rest.max(zero).sqrt();
            circle.lows[k] = from - (m - s * along) * (radius / length);
            circle.heights[k] = height;
            circle.drops[k] = radius * length;
        }
        circle
    }

    /// Distance of a circle at which the wheel touches, m.
    #[inline(always)]
    pub fn reach(&self) -> f64 {
        self.part.reach + self.rounding
    }

    /// Where the lowest point of a circle over the plane of a face, moved by the rounding along the
    /// face's normal, may be over the face, or other points may be near it.
    #[inline(always)]
    fn is_over<T: Lane>(
        &self,
        planes: &Planes<T>,
        circle: &Circle<T>,
        half: usize,
        [dx, dz]: [f64; 2],
    ) -> T::Mask {
        let (mut low, height, drop) = (circle.lows[half], circle.heights[half], circle.drops[half]);
        let like = height;
        let (x, z) = (like.like(dx), like.like(dz));
        let (per_x, per_z) = (like.like(1.0 / dx), like.like(1.0 / dz));
        let mut gap = height - drop;
        if self.rounding > 0.0 {
            let length = planes.squares[half].sqrt();
            let rounding = like.like(self.rounding);
            low -= planes.normals[half] * (rounding / length);
            gap -= rounding * length;
        }
        // At least the gap.
        let off = like.like(OFF) * gap.abs() + like.like(ROUNDING);
        let is_beside = low.x.lt(-off) | (x + off).lt(low.x) | low.z.lt(-off) | (z + off).lt(low.z);
        let ahead = low.x * per_x - low.z * per_z;
        let beyond = off * per_x + off * per_z;
        let is_in_other = if half == LOW {
            ahead.lt(-beyond)
        } else {
            beyond.lt(ahead)
        };
        // The second and third point of the rim are higher by one and a half radii.
        let others = height + like.like(0.5) * drop;
        let bound = like.like(0.5) * (like.like(1.0) + planes.squares[half]);
        let is_upright = (like.like(self.reach() + ROUNDING) * bound).lt(others);
        !circle.is_beyond[half] & !((is_beside | is_in_other) & is_upright)
    }

    /// Where a circle may touch the edge between two planes at a normal between theirs: its lowest
    /// points over them lie off the faces, beyond the edge. A wheel that lies may have a chord of
    /// its side there. `along`: the edge, m.
    #[inline(always)]
    fn may_touch_between<T: Lane>(
        &self,
        planes: &Planes<T>,
        circle: &Circle<T>,
        k: usize,
        along: Vec3<T>,
    ) -> T::Mask {
        let [first, second] = AT_EDGE[k];
        let (rounding, unsharp) = (along.x.like(ROUNDING), along.x.like(UNSHARP));
        let one = planes.normals[first].cross(along).dot(circle.lows[first]);
        let two = planes.normals[second].cross(along).dot(circle.lows[second]);
        let may_be_sharp = unsharp.lt(planes.squares[first]) | unsharp.lt(planes.squares[second]);
        let mut is_between = one.lt(rounding) & (-rounding).lt(two);
        if self.disc.axle.y.abs() > STANDS {
            is_between = is_between | !is_between;
        }
        !(circle.is_beyond[first] | circle.is_beyond[second]) & (is_between | may_be_sharp)
    }

    /// Where the tread between the circles may touch the edge between two planes: at a normal
    /// between theirs, or almost ([`bears`](crate::geometry::terrain::surface::Edge::bears)), that is perpendicular to the axle and to the
    /// edge. `along`: the edge, from
    /// the corner from which the wheel's centre is `from`, m.
    #[inline(always)]
    fn may_cross<T: Lane>(
        &self,
        planes: &Planes<T>,
        k: usize,
        along: Vec3<T>,
        from: Vec3<T>,
    ) -> T::Mask {
        let like = from.x;
        let number = |x: f64| like.like(x);
        let [first, second] = AT_EDGE[k];
        let (first, second) = (planes.normals[first], planes.normals[second]);
        let s = Vec3::splat(like.token(), self.disc.axle.into());
        let across = s.cross(along);
        let (square, length) = (across.dot(across), along.dot(along));
        // Nearly parallel: the places along the axle are not accurate.
        let is_alongside = square.le(number(ALONGSIDE * ALONGSIDE) * length);
        let up = (first + second).dot(across);
        let size = number(1.0) / square.sqrt();
        let n = across * T::select(up.lt(number(0.0)), -size, size);
        let height = n.dot(from);
        let is_near = (height - number(self.disc.radius)).le(number(self.reach() + ROUNDING));
        // Unit normals differ by less than these, and these are no longer than 1.5.
        let bend = first - second;
        let beyond = number(1.5 * BEYOND) * bend.dot(bend).sqrt();
        let tolerance = (number(ROUNDING) + beyond) * length.sqrt();
        let is_between =
            first.cross(along).dot(n).lt(tolerance) & (-tolerance).lt(second.cross(along).dot(n));
        // from − n (n · from) + own s = place along
        let rest = from - n * height;
        let own = (s.dot(along) * rest.dot(along) - rest.dot(s) * length) / square;
        let is_on_tread = own.abs().le(number(self.half + ROUNDING));
        is_alongside | (is_near & is_between & is_on_tread)
    }

    /// Where a vertex may be touched from which the wheel's centre is `from`, m.
    #[inline(always)]
    fn may_touch_vertex<T: Lane>(&self, from: Vec3<T>) -> T::Mask {
        let like = from.x;
        let number = |x: f64| like.like(x);
        let reach = self.reach() + ROUNDING;
        let along = Vec3::splat(like.token(), self.disc.axle.into())
            .dot(from)
            .abs();
        let square = from.dot(from);
        if self.half + self.rounding > 0.0 {
            let radius = self.disc.radius + reach;
            let is_abreast = (square - along * along).le(number(radius * radius));
            return along.le(number(self.half + reach)) & is_abreast;
        }
        // Nothing but a needle pierces a disc that stands.
        if self.disc.axle.y.abs() < STANDS {
            along.le(number(reach))
        } else {
            let radius = self.part.radius() + ROUNDING;
            square.le(number(radius * radius))
        }
    }
}
