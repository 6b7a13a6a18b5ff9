//! Two boxes, with enough contact points for one to rest on the other.
//!
//! Fifteen axes can separate two boxes: the face normals and the cross products of the edges. If
//! the axis of largest separation is a face normal, the opposite face of the other box is clipped
//! to the outline of this face, which gives up to eight points:
//!
//! - a corner of either box over the other's face: its height over that
//!   face, along that face's normal;
//! - where two edges cross, seen along the normal of the first face: the height there.
//!
//! If it is the cross product of two edges, the contact is at the nearest points of these edges.
//! Cases that neither covers (corner to corner) use the nearest points of [`super::convex`].
//!
//! At corners and at a pair of edges the gap's rate equals the normal part of the relative velocity
//! exactly. At a crossing the error is of the order of the tilt between the two faces, since the
//! crossing slides along the edges; it vanishes for boxes that lie on each other.
//!
//! Source: Gottschalk, Lin and Manocha 1996 (separating axes); Sutherland
//! and Hodgman 1974 (clipping).

use nalgebra::{Vector2, Vector3};

use super::{PairPoint, convex};
use crate::geometry::{OrientedBox, SupportMap};

/// Fraction of the boxes' size by which another axis must separate them more than a face of the
/// first box to be chosen instead, so that the choice among equal axes does not change.
const PREFERENCE: f64 = 1e-4;

/// Fraction of the boxes' size by which a corner may lie outside a face and still count as over it:
/// boxes edge on edge touch.
const SLACK: f64 = 1e-6;

/// Distance, as a fraction of the boxes' size, within which two points coincide.
const SAME: f64 = 1e-3;

/// Sine below which two edges do not cross.
const PARALLEL: f64 = 1e-9;

/// Features from here on are points of two faces or of two edges.
const FACES: usize = 1 << 13;
const EDGES: usize = 1 << 14;

/// Points that two faces can have: corners of the second, corners of the first, crossings.
const CANDIDATES: usize = 24;

/// Visits all points whose gap is at most `reach`, m.
pub fn points(
    first: &OrientedBox,
    second: &OrientedBox,
    reach: f64,
    mut visit: impl FnMut(&PairPoint),
) {
    let axis = Axis::furthest(first, second);
    if axis.separation > reach {
        return;
    }
    let mut is_found = false;
    if let Some((edge, other)) = axis.edges {
        if let Some((point, is_within)) = crossing_edges(first, second, edge, other)
            && is_within
        {
            is_found = true;
            visit(&point);
        }
    } else {
        let faces = Faces::of(first, second, axis.is_of_second, axis.face);
        let mut places = [Vector2::zeros(); CANDIDATES];
        let mut n_places = 0;
        for candidate in 0..CANDIDATES {
            let Some((place, is_within)) = faces.place(candidate) else {
                continue;
            };
            let is_known =
                (places[..n_places].iter()).any(|p| (p - place).norm() < SAME * faces.size);
            if !is_within || is_known {
                continue;
            }
            places[n_places] = place;
            n_places += 1;
            is_found = true;
            let point = faces.point(candidate);
            if point.gap <= reach {
                visit(&point);
            }
        }
    }
    if !is_found {
        let nearest = convex::nearest_points(first, second);
        if nearest.gap <= reach {
            visit(&nearest);
        }
    }
}

/// The point of a feature, wherever it is.
#[must_use]
pub fn point(first: &OrientedBox, second: &OrientedBox, feature: usize) -> PairPoint {
    if feature & EDGES != 0 {
        let (edge, other) = (feature >> 4 & 15, feature & 15);
        if let Some((point, _)) = crossing_edges(first, second, edge, other) {
            return point;
        }
    } else if feature & FACES != 0 {
        let code = feature & (FACES - 1);
        let (candidate, face, incident) = (code & 31, code >> 5 & 7, code >> 8 & 7);
        let is_of_second = code >> 11 & 1 == 1;
        let (reference, other) = if is_of_second {
            (second, first)
        } else {
            (first, second)
        };
        let faces = Faces {
            reference: Side::of(reference, face),
            incident: Side::of(other, incident),
            is_of_second,
            size: first.bound() + second.bound(),
        };
        return faces.point(candidate);
    }
    convex::nearest_points(first, second)
}

/// Largest separation of the boxes over all axes, m: their signed distance if a face or two edges
/// are nearest, and otherwise a lower bound.
#[must_use]
pub fn separation(first: &OrientedBox, second: &OrientedBox) -> f64 {
    Axis::furthest(first, second).separation
}

/// The axis of largest separation of two boxes.
#[derive(Clone, Copy, Debug)]
struct Axis {
    separation: f64,
    is_of_second: bool,
    /// 2 k and one more where the side is the negative one.
    face: usize,
    /// The edges, where it is their cross product.
    edges: Option<(usize, usize)>,
}

impl Axis {
    fn furthest(first: &OrientedBox, second: &OrientedBox) -> Self {
        let between = second.centre - first.centre;
        let bias = PREFERENCE * (first.bound() + second.bound());
        let mut best = Self {
            separation: f64::NEG_INFINITY,
            is_of_second: false,
            face: 0,
            edges: None,
        };
        for is_of_second in [false, true] {
            let (own, other, towards) = if is_of_second {
                (second, first, -between)
            } else {
                (first, second, between)
            };
            for k in 0..3 {
                let n = own.axis(k);
                let along = n.dot(&towards);
                let separation = along.abs() - own.half_size[k] - half_width(other, &n);
                if separation > best.separation + bias {
                    best = Self {
                        separation,
                        is_of_second,
                        face: 2 * k + usize::from(along < 0.0),
                        edges: None,
                    };
                }
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                let across = first.axis(i).cross(&second.axis(j));
                let length = across.norm();
                if length <= PARALLEL {
                    continue;
                }
                let n = across / (length * between.dot(&across).signum());
                let separation = between.dot(&n) - half_width(first, &n) - half_width(second, &n);
                if separation > best.separation + bias {
                    best = Self {
                        separation,
                        edges: Some((edge(first, i, &n), edge(second, j, &-n))),
                        ..best
                    };
                }
            }
        }
        best
    }
}

/// Half the width of a box along a unit vector, m.
fn half_width(solid: &OrientedBox, n: &Vector3<f64>) -> f64 {
    solid.R.tr_mul(n).abs().dot(&solid.half_size)
}

/// Number of the edge along axis k that lies furthest along n: 4 k and two
/// bits for the sides along the next two axes.
fn edge(solid: &OrientedBox, k: usize, n: &Vector3<f64>) -> usize {
    let side = |axis: usize| usize::from(solid.axis(axis % 3).dot(n) > 0.0);
    4 * k + side(k + 1) + 2 * side(k + 2)
}

/// Nearest points of the lines of two edges, and whether they are within
/// both edges; none where the edges are parallel.
fn crossing_edges(
    first: &OrientedBox,
    second: &OrientedBox,
    edge: usize,
    other: usize,
) -> Option<(PairPoint, bool)> {
    let (p, d, half_p) = first.edge(edge);
    let (q, e, half_q) = second.edge(other);
    let across = d.cross(&e);
    let square = across.norm_squared();
    if square <= PARALLEL * PARALLEL {
        return None;
    }
    // Out of the first box, into the second.
    let outward = (p - first.centre) - (q - second.centre);
    let n = across * (across.dot(&outward).signum() / square.sqrt());
    let between = q - p;
    let s = between.cross(&e).dot(&across) / square;
    let t = between.cross(&d).dot(&across) / square;
    let gap = n.dot(&between);
    let slack = SLACK * (half_p + half_q);
    let is_within = s.abs() <= half_p + slack && t.abs() <= half_q + slack;
    let feature = EDGES | edge << 4 | other;
    Some((
        PairPoint::from_first(feature, &(p + d * s), &n, gap),
        is_within,
    ))
}

/// A face of a box: centre, outward normal, and two half edges.
#[derive(Clone, Copy, Debug)]
struct Side {
    number: usize,
    centre: Vector3<f64>,
    n: Vector3<f64>,
    /// Unit.
    edges: [Vector3<f64>; 2],
    half: Vector2<f64>,
}

impl Side {
    fn of(solid: &OrientedBox, number: usize) -> Self {
        let k = number / 2 % 3;
        let n = solid.axis(k) * if number.is_multiple_of(2) { 1.0 } else { -1.0 };
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        Self {
            number,
            centre: solid.centre + n * solid.half_size[k],
            n,
            edges: [solid.axis(i), solid.axis(j)],
            half: Vector2::new(solid.half_size[i], solid.half_size[j]),
        }
    }

    /// The corners one after the other around the face.
    fn corner(&self, k: usize) -> Vector3<f64> {
        let (x, y) = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][k % 4];
        self.centre + self.edges[0] * (x * self.half.x) + self.edges[1] * (y * self.half.y)
    }

    /// Coordinates along the two edges.
    fn local(&self, x: &Vector3<f64>) -> Vector2<f64> {
        let from_centre = x - self.centre;
        Vector2::new(
            self.edges[0].dot(&from_centre),
            self.edges[1].dot(&from_centre),
        )
    }

    fn height(&self, x: &Vector3<f64>) -> f64 {
        self.n.dot(&(x - self.centre))
    }

    fn contains(&self, place: &Vector2<f64>, slack: f64) -> bool {
        place.x.abs() <= self.half.x + slack && place.y.abs() <= self.half.y + slack
    }
}

/// Two opposite faces.
#[derive(Clone, Copy, Debug)]
struct Faces {
    reference: Side,
    incident: Side,
    /// Whether the reference is the second box's.
    is_of_second: bool,
    /// Sum of the bounding radii of both boxes, m.
    size: f64,
}

impl Faces {
    /// A face, and the face of the other box that is most opposed to it.
    fn of(first: &OrientedBox, second: &OrientedBox, is_of_second: bool, face: usize) -> Self {
        let (own, other) = if is_of_second {
            (second, first)
        } else {
            (first, second)
        };
        let reference = Side::of(own, face);
        let along = other.R.tr_mul(&reference.n);
        let k = along.iamax();
        let incident = Side::of(other, 2 * k + usize::from(along[k] > 0.0));
        Self {
            reference,
            incident,
            is_of_second,
            size: first.bound() + second.bound(),
        }
    }

    /// Where on the reference a candidate is, and whether it is within both
    /// faces; none where two edges do not cross.
    fn place(&self, candidate: usize) -> Option<(Vector2<f64>, bool)> {
        let slack = SLACK * self.size;
        match candidate {
            0..4 => {
                let place = self.reference.local(&self.incident.corner(candidate));
                Some((place, self.reference.contains(&place, slack)))
            }
            4..8 => {
                let corner = self.reference.corner(candidate - 4);
                let beneath = self.incident.local(&corner);
                let is_within = self.incident.contains(&beneath, slack);
                Some((self.reference.local(&corner), is_within))
            }
            _ => {
                let (t, x) = self.crossing(candidate)?;
                let place = self.reference.local(&x);
                let is_within = (0.0..=1.0).contains(&t) && self.reference.contains(&place, slack);
                Some((place, is_within))
            }
        }
    }

    /// Point of the incident's edge over the line of a reference's edge,
    /// and where along its edge that is, from 0 to 1.
    fn crossing(&self, candidate: usize) -> Option<(f64, Vector3<f64>)> {
        let (edge, line) = ((candidate - 8) / 4, (candidate - 8) % 4);
        let (begin, end) = (self.incident.corner(edge), self.incident.corner(edge + 1));
        let axis = line / 2;
        let level = self.reference.half[axis] * if line.is_multiple_of(2) { 1.0 } else { -1.0 };
        let (from, to) = (
            self.reference.local(&begin)[axis],
            self.reference.local(&end)[axis],
        );
        // An edge that does not leave the rim crosses it nowhere: its corners lie on the face.
        if (to - from).abs() <= 2.0 * SLACK * self.size {
            return None;
        }
        let t = (level - from) / (to - from);
        Some((t, begin + (end - begin) * t))
    }

    /// The point of a candidate.
    fn point(&self, candidate: usize) -> PairPoint {
        let Self {
            reference,
            incident,
            ..
        } = self;
        let feature = FACES
            | usize::from(self.is_of_second) << 11
            | incident.number << 8
            | reference.number << 5
            | candidate;
        // From the reference's box to the incident's: x on the first of them.
        let (x, n, gap) = match candidate {
            0..4 => {
                let corner = incident.corner(candidate);
                let gap = reference.height(&corner);
                (corner - reference.n * gap, reference.n, gap)
            }
            4..8 => {
                let corner = reference.corner(candidate - 4);
                (corner, -incident.n, incident.height(&corner))
            }
            _ => {
                // Edges that have become parallel keep their corner.
                let x = self
                    .crossing(candidate)
                    .map_or_else(|| incident.corner((candidate - 8) / 4), |(_, x)| x);
                let gap = reference.height(&x);
                (x - reference.n * gap, reference.n, gap)
            }
        };
        let point = PairPoint::from_first(feature, &x, &n, gap);
        if self.is_of_second {
            point.swapped()
        } else {
            point
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    fn solid(x: [f64; 3], turn: [f64; 3], half: [f64; 3]) -> OrientedBox {
        OrientedBox {
            centre: x.into(),
            R: *Rotation3::from_euler_angles(turn[0], turn[1], turn[2]).matrix(),
            half_size: half.into(),
        }
    }

    fn all(first: &OrientedBox, second: &OrientedBox) -> Vec<PairPoint> {
        let mut found = Vec::new();
        points(first, second, 0.05, |p| found.push(*p));
        found
    }

    proptest! {
        #[test]
        fn the_deepest_point_is_the_distance(
            x in prop::array::uniform3(-0.7..0.7), turns in (prop::array::uniform3(-3.0..3.0), prop::array::uniform3(-3.0..3.0)),
        ) {
            let first = solid([0.0; 3], turns.0, [0.3, 0.2, 0.1]);
            let second = solid(x, turns.1, [0.15, 0.25, 0.35]);
            let exact = convex::nearest_points(&first, &second);
            let axis = separation(&first, &second);
            let bias = 2e-3 * PREFERENCE.max(1e-3);
            prop_assert!(axis <= exact.gap + 1e-8);
            if exact.gap < 0.0 {
                prop_assert!(axis >= exact.gap - 2e-4 - bias, "{axis} {}", exact.gap);
            }
            let found = all(&first, &second);
            let deepest = found.iter().map(|p| p.gap).fold(f64::INFINITY, f64::min);
            if exact.gap > 0.05 {
                // Only a point that is no nearer than the shapes are may be found.
                prop_assert!(found.iter().all(|p| p.gap >= -1e-9));
            } else if exact.gap < 0.0 {
                prop_assert!(!found.is_empty());
                // No point is deeper than half an edge more than the way out: a long way in, the
                // corner of one is under another face.
                prop_assert!(deepest <= 0.0);
            }
            for p in &found {
                prop_assert!((p.n.norm() - 1.0).abs() < 1e-12);
                let again = point(&first, &second, p.feature);
                prop_assert!((again.gap - p.gap).abs() < 1e-12 && (again.point - p.point).norm() < 1e-12);
            }
        }

        #[test]
        fn from_the_other_side_it_is_the_same(
            x in prop::array::uniform3(-0.6..0.6), turns in (prop::array::uniform3(-3.0..3.0), prop::array::uniform3(-3.0..3.0)),
        ) {
            let first = solid([0.0; 3], turns.0, [0.3, 0.2, 0.1]);
            let second = solid(x, turns.1, [0.15, 0.25, 0.35]);
            let (there, back) = (all(&first, &second), all(&second, &first));
            let axis = separation(&first, &second);
            prop_assert!((axis - separation(&second, &first)).abs() < 2.0 * PREFERENCE);
            // Where no other axis comes near, the same points are found
            // with the normals turned round.
            let sum = |points: &[PairPoint]| points.iter().map(|p| p.gap).sum::<f64>();
            if there.len() == back.len() && (sum(&there) - sum(&back)).abs() < 1e-9 {
                for p in &there {
                    let twin = back.iter().any(|q| (q.point - p.point).norm() < 1e-9 && (q.n + p.n).norm() < 1e-9);
                    prop_assert!(twin, "{there:?} {back:?}");
                }
            }
        }

        #[test]
        fn gaps_change_as_the_material_points_part(
            tilt in -0.02..0.02, yaw in 0.1..1.4, v in prop::array::uniform3(-1.0..1.0), w in prop::array::uniform3(-1.0..1.0),
        ) {
            let first = solid([0.0; 3], [0.0; 3], [0.3, 0.1, 0.3]);
            let at = |s: f64| {
                let turn = Rotation3::new(Vector3::from(w) * s);
                OrientedBox {
                    centre: Vector3::new(0.05, 0.2, 0.02) + Vector3::from(v) * s,
                    R: turn.matrix() * Rotation3::from_euler_angles(tilt, yaw, tilt).matrix(),
                    half_size: Vector3::new(0.25, 0.1, 0.25),
                }
            };
            let (h, here) = (1e-6, at(0.0));
            for p in all(&first, &here) {
                let rate = (point(&first, &at(h), p.feature).gap - point(&first, &at(-h), p.feature).gap) / (2.0 * h);
                let velocity = Vector3::from(v) + Vector3::from(w).cross(&(p.point - here.centre));
                let is_crossing = p.feature & FACES != 0 && p.feature & 31 >= 8;
                let tolerance = if is_crossing { 0.3 } else { 1e-7 };
                prop_assert!((rate - p.n.dot(&velocity)).abs() < tolerance, "{rate} {}", p.n.dot(&velocity));
            }
        }
    }

    #[test]
    fn a_box_on_a_box_lies_on_four_points_and_turned_on_eight() {
        let lower = solid([0.0; 3], [0.0; 3], [0.3, 0.1, 0.3]);
        let upper = |yaw: f64, x: f64| solid([x, 0.2, 0.0], [0.0, yaw, 0.0], [0.3, 0.1, 0.3]);
        for (yaw, x, expected) in [(0.0, 0.0, 4), (0.3, 0.0, 8), (0.0, 0.1, 4), (1e-7, 1e-8, 4)] {
            let found = all(&lower, &upper(yaw, x));
            assert_eq!(found.len(), expected, "{yaw} {x} {found:?}");
            for p in &found {
                assert!(p.gap.abs() < 1e-12 && (p.n - Vector3::y()).norm() < 1e-12);
                assert!((p.point.y - 0.1).abs() < 1e-12);
                assert!(p.point.x.abs() <= 0.3 + 1e-6 && p.point.z.abs() <= 0.3 + 1e-6);
            }
        }
    }

    #[test]
    fn edges_that_cross_meet_in_one_point() {
        let tilted = |angles: [f64; 3], y: f64| solid([0.0, y, 0.0], angles, [0.5, 0.1, 0.1]);
        let quarter = std::f64::consts::FRAC_PI_4;
        let first = tilted([quarter, 0.0, 0.0], 0.0);
        let second = OrientedBox {
            R: Rotation3::from_axis_angle(&Vector3::y_axis(), 1.2).matrix() * first.R,
            ..tilted([0.0; 3], 0.2 * 2.0_f64.sqrt() + 0.01)
        };
        let found = all(&first, &second);
        assert_eq!(found.len(), 1);
        assert!((found[0].gap - 0.01).abs() < 1e-12, "{found:?}");
        assert!((found[0].n - Vector3::y()).norm() < 1e-12);
        assert!(found[0].point.xz().norm() < 1e-12);
    }
}
