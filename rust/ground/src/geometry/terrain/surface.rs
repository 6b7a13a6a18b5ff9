//! Pieces of a triangulated surface: faces, convex edges and convex vertices.
//!
//! The ground lies below the surface. A piece pushes along its normals: a face along its own, a
//! convex edge along those between its two faces', a convex vertex along those between its edges'.
//! A flat or concave edge pushes along nothing, so a part that rolls over it feels the faces alone.
//!
//! A part touches a face only with a point over it. What is over a face is bounded by an
//! [`EdgeHalfSpace`] through each of its edges: perpendicular to the face at a convex edge, where
//! the edge takes over, and through the bisector at any other, where the neighbour does. Two faces
//! with the same wall never both have a point, and one of them always has it.

use nalgebra::Vector3;

use super::plane::Plane;
use friction_contact::scalar::elementary::sin_cos;

/// Sine of the angle between two faces below which their edge is flat.
const FLAT: f64 = 1e-12;

/// How far a convex edge reaches over its faces, m, so that rounding leaves no slit between them.
/// Both push alike there.
pub const OVERLAP: f64 = 1e-10;

/// One side of a plane through an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeHalfSpace {
    /// Normal of the plane, of any length.
    normal: Vector3<f64>,
    offset: f64,
    /// The open side, where `normal · x < offset`; otherwise the closed one.
    is_open: bool,
}

impl EdgeHalfSpace {
    fn through(a: &Vector3<f64>, normal: Vector3<f64>, is_open: bool) -> Self {
        let offset = normal.dot(a);
        Self {
            normal,
            offset,
            is_open,
        }
    }

    /// Whether a point (world, m) is on this side.
    #[inline]
    #[must_use]
    pub fn admits(&self, x: &Vector3<f64>) -> bool {
        (self.normal.dot(x) >= self.offset) != self.is_open
    }

    /// Normal, offset, and whether the side is the open one, where `normal · x < offset`.
    #[inline]
    #[must_use]
    pub fn parts(&self) -> (&Vector3<f64>, f64, bool) {
        (&self.normal, self.offset, self.is_open)
    }

    /// How far a point (world, m) is beyond this side, m; negative on it.
    #[inline]
    #[must_use]
    pub fn beyond(&self, x: &Vector3<f64>) -> f64 {
        let past = (self.normal.dot(x) - self.offset) / self.normal.norm();
        if self.is_open { past } else { -past }
    }
}

/// A triangle of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Through its vertices.
    pub plane: Plane,
    /// Around what is over it.
    pub walls: [EdgeHalfSpace; 3],
}

impl Face {
    /// Whether a point (world, m) is over the face, or under it.
    #[inline]
    #[must_use]
    pub fn admits(&self, x: &Vector3<f64>) -> bool {
        self.walls.iter().all(|wall| wall.admits(x))
    }

    /// Whether a point of the face's plane (world, m) is in it.
    #[must_use]
    pub fn has(&self, x: &Vector3<f64>) -> bool {
        let [a, b, c] = self.corners(x);
        let n = self.plane.normal();
        let turns =
            [[a, b], [b, c], [c, a]].map(|[from, to]| n.dot(&(to - from).cross(&(x - from))));
        turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0)
    }

    /// Corners of the face, world, m; `near` (world, m): a place near them, for accuracy.
    #[must_use]
    pub fn corners(&self, near: &Vector3<f64>) -> [Vector3<f64>; 3] {
        let (n, height) = (self.plane.normal(), self.plane.distance(near));
        // n · x = −height, and a · x = p, b · x = q of the walls through two edges.
        [[0, 1], [1, 2], [2, 0]].map(|walls| {
            let [a, b] = walls.map(|k| &self.walls[k].normal);
            let [p, q] = walls.map(|k| self.walls[k].offset - self.walls[k].normal.dot(near));
            let across = a.cross(b);
            near + (b.cross(n) * p + n.cross(a) * q - across * height) / n.dot(&across)
        })
    }
}

/// A convex edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Start of the edge, world, m.
    pub start: Vector3<f64>,
    /// Unit direction.
    pub along: Vector3<f64>,
    /// m.
    pub length: f64,
    /// Unit normals of its faces: of the one on the side of `normal × along`, and of the other.
    pub normals: [Vector3<f64>; 2],
}

impl Edge {
    /// Whether a place along the edge belongs to it, as [`Self::has`], with the ends `slack` (m)
    /// further out: where a line ends on the edge's end, rounding leaves no gap between them.
    #[inline]
    #[must_use]
    pub fn has_within(&self, place: f64, depth: f64, slack: f64) -> bool {
        self.has(place + slack, depth) || self.has(place - slack, depth)
    }

    /// Which of the normals through a point x, given from the start of the edge (m), leads away
    /// from the edge: positive beyond the face of the first, where n is that of the second.
    #[inline]
    #[must_use]
    pub fn lean(&self, n: &Vector3<f64>, x: &Vector3<f64>) -> f64 {
        n.cross(&self.along).dot(x)
    }

    /// Whether the edge is so sharp that the gap of a rim which touches it may have more than one
    /// maximum among the admissible normals.
    #[inline]
    #[must_use]
    pub fn is_sharp(&self) -> bool {
        let [first, second] = &self.normals;
        first.dot(second) < SHARP
    }

    /// Whether a unit normal lies strictly between those of the faces.
    #[inline]
    #[must_use]
    pub fn admits(&self, n: &Vector3<f64>) -> bool {
        let [first, second] = &self.normals;
        self.lean(first, n) < 0.0 && self.lean(second, n) > 0.0
    }

    /// Whether the edge may bear a flat side or a straight line that it crosses, along a unit
    /// normal n across the edge: one between the faces' normals, or beyond them by a small share of
    /// the angle between them.
    ///
    /// What lies flat on one of the faces rests on the edge where that face ends, and then n is the
    /// face's normal but for rounding.
    #[inline]
    #[must_use]
    pub fn bears(&self, n: &Vector3<f64>) -> bool {
        let [first, second] = &self.normals;
        let (low, high) = (self.lean(first, n), self.lean(second, n));
        if low < 0.0 && high > 0.0 {
            return true;
        }
        let slack = BEYOND * (first - second).norm();
        low < slack && high > -slack
    }

    /// End of the edge, world, m.
    #[must_use]
    pub fn end(&self) -> Vector3<f64> {
        self.start + self.along * self.length
    }

    /// The place of the edge beside a point x, and the one midway between its faces' planes that is
    /// as far behind the edge, along an admissible unit normal n, as x; world, m.
    #[must_use]
    pub fn behind(&self, n: &Vector3<f64>, x: &Vector3<f64>) -> [Vector3<f64>; 2] {
        let from = x - self.start;
        let place = from.dot(&self.along).clamp(0.0, self.length);
        let outward = self.normals[0] + self.normals[1];
        let top = self.start + self.along * place;
        [top, top + outward * (n.dot(&from) / n.dot(&outward))]
    }

    /// Whether a place along the edge (m from its start) belongs to it, for a part that is `depth`
    /// (m) in the ground there: it leans off a vertex by no more than it is deep, and by a part of
    /// the edge's length at most.
    #[inline]
    #[must_use]
    pub fn has(&self, place: f64, depth: f64) -> bool {
        let over = depth.clamp(0.0, LEAN * self.length);
        place >= -over && place < self.length + over
    }
}

/// How far a part may lean off an edge, in lengths of the edge.
pub const LEAN: f64 = 0.2;

/// Cosine of the angle between the normals of a sharp edge.
const SHARP: f64 = 0.2;

/// Share of the size of an edge or a vertex, as an angle, by which a normal may leave its cone
/// ([`Edge::bears`], [`Vertex::bears`]).
///
/// A part that comes down flat may turn by 0.07 rad in a step before the second edge of a wall is
/// missed in it. A share, because a surface that is flat but for the rounding of its heights must
/// not bear a part with each of its edges.
pub(crate) const BEYOND: f64 = 0.05;

/// Most edges that bound a vertex.
pub const MAX_SPOKES: usize = 12;

/// A convex vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// World, m.
    pub place: Vector3<f64>,
    /// To its neighbours, m.
    pub spokes: [Vector3<f64>; MAX_SPOKES],
    /// Neighbours.
    pub n: usize,
}

impl Vertex {
    /// Vertex at `place` (world, m) with edges to its neighbours, which are given from it, m. Of
    /// more than [`MAX_SPOKES`] neighbours, those around the unit normal n are kept.
    #[must_use]
    pub fn among(
        place: Vector3<f64>,
        all: impl ExactSizeIterator<Item = Vector3<f64>> + Clone,
        n: &Vector3<f64>,
    ) -> Self {
        let mut spokes = [Vector3::zeros(); MAX_SPOKES];
        if all.len() <= MAX_SPOKES {
            let n = all.len();
            for (own, spoke) in spokes.iter_mut().zip(all) {
                *own = spoke;
            }
            return Self { place, spokes, n };
        }
        let right = crate::geometry::query::any_tangent(n);
        let ahead = n.cross(&right);
        for (k, spoke) in spokes.iter_mut().enumerate() {
            let (sine, cosine) = sin_cos(std::f64::consts::TAU * k as f64 / MAX_SPOKES as f64);
            let direction = right * cosine + ahead * sine;
            let along = |x: &Vector3<f64>| x.normalize().dot(&direction);
            let best = all.clone().max_by(|a, b| along(a).total_cmp(&along(b)));
            *spoke = best.unwrap_or(-n);
        }
        let n = MAX_SPOKES;
        Self { place, spokes, n }
    }

    /// Unit direction into the ground, away from all faces alike: the mean of its edges'.
    #[must_use]
    pub fn inward(&self) -> Vector3<f64> {
        let spokes = self.spokes[..self.n].iter();
        let sum: Vector3<f64> = spokes.map(Vector3::normalize).sum();
        sum.try_normalize(FLAT).unwrap_or_default()
    }

    /// Sine of the angle by which its steepest edge rises over the plane with a unit normal.
    #[must_use]
    pub fn steepest(&self, n: &Vector3<f64>) -> f64 {
        let spokes = self.spokes[..self.n].iter();
        let rises = spokes.map(|spoke| n.dot(spoke) / spoke.norm());
        rises.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether the vertex may bear a flat side or a straight line along a unit normal: whether the
    /// surface lies below the plane with this normal on all sides, or above it by a small share of
    /// its steepest descent. As [`Edge::bears`].
    #[inline]
    #[must_use]
    pub fn bears(&self, n: &Vector3<f64>) -> bool {
        if self.admits(n) {
            return true;
        }
        let (mut lowest, mut highest) = (0.0_f64, f64::NEG_INFINITY);
        for spoke in &self.spokes[..self.n] {
            let rise = n.dot(spoke) / spoke.norm();
            (lowest, highest) = (lowest.min(rise), highest.max(rise));
        }
        lowest < -OVERLAP && highest <= -BEYOND * lowest
    }

    /// Whether the surface lies below the plane with this unit normal on all sides, or in it but
    /// for one.
    #[inline]
    #[must_use]
    pub fn admits(&self, n: &Vector3<f64>) -> bool {
        let rises = || self.spokes[..self.n].iter().map(|spoke| n.dot(spoke));
        rises().all(|rise| rise <= OVERLAP) && rises().any(|rise| rise < -OVERLAP)
    }
}

/// An edge as its two faces see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hinge {
    /// Walls of the first and of the second face.
    pub walls: [EdgeHalfSpace; 2],
    /// Whether the surface bends away from the free side.
    pub is_convex: bool,
}

impl Hinge {
    /// Hinge at the edge from a to b (world, m) between a face with the unit normal `first`, on the
    /// side of `first × (b − a)`, and one with the unit normal `second`.
    #[inline]
    #[must_use]
    pub fn new(a: &Vector3<f64>, b: &Vector3<f64>, normals: [&Vector3<f64>; 2]) -> Self {
        let [first, second] = normals;
        let e = b - a;
        let into_first = first.cross(&e);
        let bend = into_first.dot(second);
        let is_convex = bend < 0.0 && bend * bend > FLAT * FLAT * e.norm_squared();
        let walls = if is_convex {
            let into_second = e.cross(second);
            [
                EdgeHalfSpace::through(a, into_first, false),
                EdgeHalfSpace::through(a, into_second, false),
            ]
        } else {
            let bisector = (first + second).cross(&e);
            [false, true].map(|is_open| EdgeHalfSpace::through(a, bisector, is_open))
        };
        Self { walls, is_convex }
    }
}

/// An edge of a part on one side of which a face ends.
#[derive(Clone, Copy, Debug)]
pub struct BorderEdge {
    /// Number of the face.
    pub face: u32,
    /// Number of the face's wall at the edge.
    pub wall: usize,
    /// Number of the convex edge that is a piece there, if there is one.
    pub piece: Option<u32>,
    /// Numbers of the vertices where it begins and ends.
    pub corners: [u32; 2],
    /// Begin, world, m.
    pub start: Vector3<f64>,
    /// End, world, m: the face is on the side of `normal × (end − start)`.
    pub end: Vector3<f64>,
    /// Unit normal of the face.
    pub normal: Vector3<f64>,
    /// Unit normal of the face beyond the edge; none at a border.
    pub beyond: Option<Vector3<f64>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn roof(left: f64, right: f64) -> [Vector3<f64>; 2] {
        // Slopes dy/dx on the side of negative and positive x.
        [left, right].map(|slope| Vector3::new(-slope, 1.0, 0.0).normalize())
    }

    #[test]
    fn a_ridge_is_convex_and_a_valley_and_a_plane_are_not() {
        let (a, b) = (Vector3::zeros(), -Vector3::z());
        for (slopes, is_convex) in [
            ((0.5, -0.5), true),
            ((-0.5, 0.5), false),
            ((0.3, 0.3), false),
            ((0.3, 0.2), true),
        ] {
            let [first, second] = roof(slopes.0, slopes.1);
            // The first face lies at negative x: y × (−z) = −x.
            let hinge = Hinge::new(&a, &b, [&first, &second]);
            assert_eq!(hinge.is_convex, is_convex, "{slopes:?}");
            let left = Vector3::new(-1.0, -slopes.0, 0.2);
            assert!(hinge.walls[0].admits(&left) && !hinge.walls[1].admits(&left));
        }
    }

    proptest! {
        #[test]
        fn a_face_knows_its_corners(
            heights in prop::array::uniform3(-1.0..1.0),
            others in prop::array::uniform3(prop::array::uniform2(-1.0..1.0)),
            near in prop::array::uniform3(-5.0..5.0),
        ) {
            let [a, b, c] = heights;
            let corners = [
                Vector3::new(0.0, a, 0.0), Vector3::new(0.2, b, 1.0), Vector3::new(1.1, c, 0.1),
            ];
            let [p, q, r] = corners;
            let n = (q - p).cross(&(r - p)).normalize();
            let mut walls = [[p, q], [q, r], [r, p]].into_iter().zip(others).map(|([a, b], [x, z])| {
                let beyond = Vector3::new(x, 1.0, z).normalize();
                Hinge::new(&a, &b, [&n, &beyond]).walls[0]
            });
            let plane = Plane::through(&p, n);
            let face = Face { plane, walls: std::array::from_fn(|_| walls.next().unwrap()) };
            for (found, expected) in face.corners(&near.into()).iter().zip([q, r, p]) {
                prop_assert!((found - expected).norm() < 1e-12, "{found} {expected}");
            }
        }

        #[test]
        fn one_of_two_faces_answers_at_an_edge_that_is_not_convex(
            left in -1.0..1.0, bend in 0.0..1.0, x in prop::array::uniform3(-1.0..1.0),
        ) {
            let [first, second] = roof(left, left + bend);
            let hinge = Hinge::new(&Vector3::zeros(), &-Vector3::z(), [&first, &second]);
            for x in [Vector3::from(x), Vector3::zeros(), Vector3::z()] {
                prop_assert!(hinge.walls[0].admits(&x) != hinge.walls[1].admits(&x));
            }
        }
    }
}
