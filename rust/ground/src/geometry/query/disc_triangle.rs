//! Disc on a triangulated surface.
//!
//! Against a face the disc's points are those over a plane ([`super::disc_plane`]) that lie over
//! the face. Against a convex edge with the start a and the unit direction e the contact normal is
//! the one between the faces' that separates most, `max n · (E(n) − a)` with the lowest rim point
//! E(n) over the plane of normal n. There the rim point lies over the edge:
//! `(n × e) · (E(n) − a) = 0`,
//! found by a safeguarded secant iteration on `n ∝ (1 − τ) n₁ + τ n₂`. If the lowest point for a
//! face's own normal is over that face, the face touches and the edge does not, so contacts hand
//! over from face to edge with gap, point and normal continuous.
//!
//! A disc that lies flat on an edge has it along a chord and touches it with both ends, along its
//! axle. The normal that separates most belongs to the lower end; the higher one comes in as the
//! disc tips over, as rim points do on a plane (`chord_ends`). A vertex is a ball of radius
//! zero: the rim never reaches into it, since it is the edges that lift a rim with a vertex above
//! it, but a vertex may be beyond the face of the disc.
//!
//! Each gap is a maximum over normals, so its gradient is nᵀ times the Jacobian of the material
//! point (envelope theorem).

use nalgebra::Vector3;

use super::chord::{self, LIES};
use super::crossing::crossing;
use super::disc_plane::rim_point_over;
use super::{CHORD, NEAREST, SurfacePoint, roller_sphere};
use crate::geometry::terrain::surface::{Edge, OVERLAP, Vertex};
use crate::geometry::{Disc, Roller};

/// Sine of the angle between a disc and an edge up to which the ends of the chord are the only
/// points. The lower one is then the point of the normal that separates most but for half the
/// square of this, relative to the radius, and rounding does not swap the names of the ends.
const FLAT: f64 = 1e-6;

/// Fraction of the radius by which the end of a chord may lie beyond the edge.
const ENDS: f64 = 1e-9;

/// Whether a disc leans against a plane of normal n by so little that its points beside the lowest
/// may support it. Of a disc that stands they are one and a half radii higher: where they are in
/// reach the lowest one is as deep, as behind the side of a block on which the disc lies.
#[inline]
pub(super) fn may_lie(disc: &Disc, n: &Vector3<f64>) -> bool {
    let along = disc.axle.dot(n);
    along * along > 0.75
}

/// Visits the points at an edge whose gap is at most `reach`: the rim point over it, if its normal
/// lies strictly between the faces', and the ends of the chord of a disc that lies on it.
#[inline]
pub fn rim_points_at_edge(
    disc: &Disc,
    edge: &Edge,
    base: &Vector3<f64>,
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let mut offer = |point: &SurfacePoint| {
        let place = (point.point - (edge.start - base)).dot(&edge.along);
        if point.gap <= reach && edge.has_within(place, -point.gap, ENDS * disc.radius) {
            visit(point);
        }
    };
    if visit_chord(disc, edge, base, None, &mut offer) {
        return;
    }
    let point = rim_point_between(disc, edge, base).filter(|point| point.gap <= reach);
    let place = |point: &SurfacePoint| (point.point - (edge.start - base)).dot(&edge.along);
    if let Some(point) = point.filter(|point| edge.has(place(point), -point.gap)) {
        visit(&point);
    }
}

/// Visits the ends of the chord of a disc that lies on an edge: both if it lies flat, and the
/// higher one otherwise. `down`: the only direction along the axle in which it may lie. Whether
/// both ends were visited.
#[inline]
pub(super) fn visit_chord(
    disc: &Disc,
    edge: &Edge,
    base: &Vector3<f64>,
    down: Option<Vector3<f64>>,
    visit: &mut impl FnMut(&SurfacePoint),
) -> bool {
    let lean = disc.axle.dot(&edge.along).abs();
    if lean > LIES {
        return false; // as most wheels that stand
    }
    let Some(ends) = chord_ends(disc, edge, &(edge.start - base)) else {
        return false;
    };
    let n = &ends[0].n;
    if down.is_some_and(|down| n.dot(&down) > 0.0) || !edge.bears(n) {
        return false;
    }
    let is_flat = lean <= FLAT;
    let higher = usize::from(ends[1].gap > ends[0].gap);
    for (k, end) in ends.iter().enumerate() {
        if is_flat || k == higher {
            visit(end);
        }
    }
    is_flat
}

/// The ends of the chord of a disc over the line of an edge, towards the edge's start and towards
/// its end: points of the rim over the line, along the axle out of the ground.
fn chord_ends(disc: &Disc, edge: &Edge, start: &Vector3<f64>) -> Option<[SurfacePoint; 2]> {
    let up = (edge.normals[0] + edge.normals[1]).dot(&disc.axle);
    let n = if up < 0.0 { -disc.axle } else { disc.axle };
    let ends = chord::ends(disc, &n, start, &edge.along)?;
    Some([0, 1].map(|k| SurfacePoint {
        feature: CHORD + k,
        point: ends[k].point,
        n,
        rolling: disc.spoke,
        gap: ends[k].height,
    }))
}

/// The point of a feature at an edge, wherever it is.
#[inline]
#[must_use]
pub fn point_at_edge(
    disc: &Disc,
    edge: &Edge,
    base: &Vector3<f64>,
    feature: usize,
) -> SurfacePoint {
    let ends = || chord_ends(disc, edge, &(edge.start - base));
    let end = feature
        .checked_sub(CHORD)
        .and_then(|k| ends()?.get(k).copied());
    end.unwrap_or_else(|| nearest_at_edge(disc, edge, base))
}

/// Rim point over the line of an edge, also beyond the edge's ends, if its normal lies between
/// those of the faces.
#[inline]
#[must_use]
pub(super) fn rim_point_between(
    disc: &Disc,
    edge: &Edge,
    base: &Vector3<f64>,
) -> Option<SurfacePoint> {
    let start = edge.start - base;
    if let Some(part) = Bracket::at_crossing(disc, edge, &start) {
        return Some(over_edge(disc, edge, &start, &part));
    }
    let whole = Bracket::whole(disc, edge, &start);
    let is_between = whole.low < OVERLAP && whole.high > -OVERLAP;
    is_between.then(|| between(disc, edge, &start, &whole))
}

/// The rim point that an edge pushes, with the admissible normal that separates most.
#[inline]
#[must_use]
pub fn nearest_at_edge(disc: &Disc, edge: &Edge, base: &Vector3<f64>) -> SurfacePoint {
    let start = edge.start - base;
    match Bracket::at_crossing(disc, edge, &start) {
        Some(part) => over_edge(disc, edge, &start, &part),
        None => between(disc, edge, &start, &Bracket::whole(disc, edge, &start)),
    }
}

#[inline]
fn between(disc: &Disc, edge: &Edge, start: &Vector3<f64>, whole: &Bracket) -> SurfacePoint {
    let [first, second] = &edge.normals;
    if whole.low >= 0.0 && whole.high <= 0.0 {
        // Both may be maxima, or one a minimum that rounding tilts.
        let ends = edge
            .normals
            .map(|n| rim_point_over(disc, &n, start, NEAREST));
        ends[usize::from(ends[1].gap > ends[0].gap)]
    } else if whole.low >= 0.0 {
        rim_point_over(disc, first, start, NEAREST)
    } else if whole.high <= 0.0 {
        rim_point_over(disc, second, start, NEAREST)
    } else {
        over_edge(disc, edge, start, whole)
    }
}

/// The point that a vertex pushes, wherever it is: of the face, along the axle and with a sign, if
/// the vertex may push that way and is abreast of the face; of the rim otherwise.
#[inline]
#[must_use]
pub fn nearest_at_vertex(disc: &Disc, vertex: &Vertex, base: &Vector3<f64>) -> SurfacePoint {
    let offset = vertex.place - base - disc.centre;
    let near = roller_sphere::nearest_to(&Roller::thin(*disc), &offset);
    let abreast = offset - disc.axle * offset.dot(&disc.axle);
    let is_on_face = abreast.norm_squared() < disc.radius * disc.radius;
    let mut sides = [disc.axle, -disc.axle].into_iter();
    match sides.find(|n| is_on_face && vertex.bears(n)) {
        Some(n) => SurfacePoint {
            n,
            gap: -n.dot(&offset),
            ..near
        },
        None => near,
    }
}

/// Where the line from a vertex into the ground crosses the face of a disc, world, m, if it does.
///
/// `near`: the point of [`nearest_at_vertex`].
#[must_use]
pub fn pierced(
    disc: &Disc,
    vertex: &Vertex,
    near: &SurfacePoint,
    base: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let inward = vertex.inward();
    let way = near.gap / near.n.dot(&inward);
    let place = vertex.place + inward * way;
    let is_on_face = (place - base - disc.centre).norm_squared() <= disc.radius * disc.radius;
    (way.is_finite() && way >= 0.0 && is_on_face).then_some(place)
}

/// Normals at an edge, from one to another, and the derivatives of the gap at both, up to a
/// positive factor and with the sign reversed.
struct Bracket {
    ends: [Vector3<f64>; 2],
    low: f64,
    high: f64,
}

impl Bracket {
    #[inline]
    fn between(disc: &Disc, edge: &Edge, start: &Vector3<f64>, ends: [Vector3<f64>; 2]) -> Self {
        let [low, high] = ends.map(|n| slope(disc, edge, start, &n).0);
        Self { ends, low, high }
    }

    /// From the normal of one face to that of the other.
    #[inline]
    fn whole(disc: &Disc, edge: &Edge, start: &Vector3<f64>) -> Self {
        Self::between(disc, edge, start, edge.normals)
    }

    /// About the normal of a rim that just touches the edge where this crosses the disc's plane.
    ///
    /// Along the normals n(θ) of an edge the gap is f = n · w − R |n × s|, with the axle s, and
    /// f'' + f ≤ 0. So where a rim just touches (f = 0) the gap has no second maximum within a
    /// quarter turn, and only an edge sharper than that has use for this.
    #[inline]
    fn at_crossing(disc: &Disc, edge: &Edge, start: &Vector3<f64>) -> Option<Self> {
        if edge.is_sharp() {
            Self::search(disc, edge, start)
        } else {
            None
        }
    }

    #[cold]
    fn search(disc: &Disc, edge: &Edge, start: &Vector3<f64>) -> Option<Self> {
        let s = &disc.axle;
        let across = s.dot(&edge.along);
        let outward = start - disc.centre;
        // Times `across`, so that an edge along the disc's plane divides by nothing.
        let outward = (outward * across - edge.along * s.dot(&outward)) * across.signum();
        let n = s.cross(&outward).cross(&edge.along);
        let [first, second] = edge.normals;
        let middle = [n, -n].into_iter().find(|n| edge.admits(n))?.normalize();
        let lean = slope(disc, edge, start, &middle).0;
        // From the normal at touch towards where the gap grows, in doubled steps.
        let end = if lean < 0.0 { second } else { first };
        let mut inner = middle;
        let mut part = 1.0 / 64.0;
        while part <= 1.0 {
            let outer = (middle * (1.0 - part) + end * part).normalize();
            let own = slope(disc, edge, start, &outer).0;
            if lean < 0.0 && own > 0.0 {
                return Some(Self::between(disc, edge, start, [inner, outer]));
            }
            if lean >= 0.0 && own < 0.0 {
                return Some(Self::between(disc, edge, start, [outer, inner]));
            }
            inner = outer;
            part *= 2.0;
        }
        None
    }
}

#[inline]
fn slope(disc: &Disc, edge: &Edge, start: &Vector3<f64>, n: &Vector3<f64>) -> (f64, SurfacePoint) {
    let point = rim_point_over(disc, n, start, NEAREST);
    (edge.lean(n, &(point.point - start)), point)
}

/// The [slope] at normals `m = (1 − τ) n₁ + τ n₂` of any length: with the edge's direction e, the
/// disc's axle s and the way d from the edge's start to its centre,
/// `(m × e) · d + R ((m × e) · s) (m · s) / √(m² − (m · s)²)`.
struct Slopes {
    /// At τ = 0, and what is added at τ = 1: of `(m × e) · d`, `(m × e) · s` and `m · s`.
    levels: [[f64; 2]; 3],
    /// Coefficients of m² in ascending powers of τ.
    squares: [f64; 3],
    radius: f64,
}

impl Slopes {
    fn new(disc: &Disc, edge: &Edge, start: &Vector3<f64>, ends: &[Vector3<f64>; 2]) -> Self {
        let [first, second] = ends;
        let (change, d) = (second - first, disc.centre - start);
        let [about_d, about_s] = [&d, &disc.axle].map(|x| edge.along.cross(x));
        let level = |x: &Vector3<f64>| [first.dot(x), change.dot(x)];
        Self {
            levels: [level(&about_d), level(&about_s), level(&disc.axle)],
            squares: [
                first.norm_squared(),
                2.0 * first.dot(&change),
                change.norm_squared(),
            ],
            radius: disc.radius,
        }
    }

    /// The slope, and the length of m.
    #[inline]
    fn at(&self, tau: f64) -> (f64, f64) {
        let [beside, across, along] = self.levels.map(|[level, rise]| level + rise * tau);
        let [one, two, three] = self.squares;
        let square = one + tau * (two + tau * three);
        let length = (square - along * along).max(f64::MIN_POSITIVE).sqrt();
        (
            beside + self.radius * across * along / length,
            square.sqrt(),
        )
    }
}

/// The rim point over an edge, between normals where the slope is below and above zero.
fn over_edge(disc: &Disc, edge: &Edge, start: &Vector3<f64>, bracket: &Bracket) -> SurfacePoint {
    let [first, second] = &bracket.ends;
    let slopes = Slopes::new(disc, edge, start, &bracket.ends);
    let root = crossing([bracket.low, bracket.high], |tau| {
        let (slope, length) = slopes.at(tau);
        (slope, 2e-15 * disc.radius * length)
    });
    let n = (first * (1.0 - root) + second * root).normalize();
    rim_point_over(disc, &n, start, NEAREST)
}
