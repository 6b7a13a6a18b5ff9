//! Two solids with enough contact points for one to rest on the other: any pair with a cylinder, a
//! capsule, an ellipsoid or a polytope.
//!
//! The nearest points ([`super::convex`]) give the direction between the shapes. If it is the
//! normal of a flat side of one of them, the other stands on that side as on a plane, with those of
//! its points that are over the side's outline; where the outlines cross, they touch, too: straight
//! lines of both, a circle and a line (at the ends of the chord), two circles. Sides and lines:
//!
//! | | flat sides | lines |
//! |---|---|---|
//! | box, polytope | faces | edges of the side in contact |
//! | cylinder, wheel with a width | ends | the line of the tread, with its radius |
//! | capsule | | its axis, with its radius |
//! | disc, ellipsoid, sphere | | |
//!
//! Two lines that cross have the gap `n · (b − a) − r_a − r_b` with the normal n across both. A
//! tread beside another one, or along an edge, almost parallel, touches it at the ends of what they
//! share: the ends of the one that are abreast of the other. Whatever no such point explains is
//! left to the nearest points, so that the deepest place always counts.
//!
//! The gap's rate is exact at vertices, at treads and at lines that cross; at the two points of a
//! rim beside the lowest it is as on a plane ([`super::disc_plane`]).

use nalgebra::Vector3;

use super::{NEAREST, PairPoint, chord, dispatch, hull_sphere};
use crate::geometry::{Disc, PlacedShape, Plane, SupportMap};

/// Difference between a direction and a flat side's normal below which they are the same.
const ALONG: f64 = 1e-5;

/// Sine below which the axes of two treads have no common normal worth using.
const PARALLEL: f64 = 0.1;

/// Sine below which two lines, at least one of them an edge, have no common normal worth using.
/// Where edges of two outlines cross at a smaller angle, cutting off their corner takes 0.025 % of
/// their length at most.
const SKEW: f64 = 1e-3;

/// Sine of the angle between a common normal of lines and the direction between the shapes, at
/// most.
const ASIDE: f64 = 0.1;

/// Fraction of the shapes' size by which a point may lie outside an outline, and by which a nearest
/// point may be deeper than the other points without being one itself.
const SLACK: f64 = 1e-6;

/// Features from here on are points on a flat side, crossings of lines, ends of lines, ends of
/// chords, and crossings of circles.
const ON_FLAT: usize = 1 << 20;
const CROSSING: usize = 1 << 21;
const END: usize = 1 << 22;
const CHORD: usize = 1 << 23;
const CIRCLES: usize = 1 << 24;

/// Bits of a side or a line.
const BITS: usize = 8;
const LOW: usize = (1 << BITS) - 1;

/// Visits all points whose gap is at most `reach`, m; n from the first shape to the second.
pub fn points(
    first: &PlacedShape<'_>,
    second: &PlacedShape<'_>,
    reach: f64,
    mut visit: impl FnMut(&PairPoint),
) {
    let near = dispatch::nearest_points(first, second);
    if near.gap > reach {
        return;
    }
    let size = first.bound() + second.bound();
    let mut deepest = f64::INFINITY;
    let mut offer = |point: &PairPoint| {
        if point.gap <= reach {
            deepest = deepest.min(point.gap);
            visit(point);
        }
    };
    let sides = [side_along(first, &near.n), side_along(second, &-near.n)];
    for is_of_second in [false, true] {
        let (own, other) = if is_of_second {
            (second, first)
        } else {
            (first, second)
        };
        let Some(side) = sides[usize::from(is_of_second)] else {
            continue;
        };
        let Some(plane) = flat_side(own, side) else {
            continue;
        };
        dispatch::visit_on_plane(other, &plane, &Vector3::zeros(), reach, |low| {
            if is_over(own, side, &low.point, SLACK * size) {
                let feature =
                    ON_FLAT | usize::from(is_of_second) << (2 * BITS) | side << BITS | low.feature;
                let x = low.point - low.n * low.gap;
                let point = PairPoint::from_first(feature, &x, &low.n, low.gap);
                offer(&if is_of_second { point.swapped() } else { point });
            }
        });
    }
    // Along another normal than the nearest points' a place of two lines may only look deeper.
    let is_alike = |point: &PairPoint| {
        point.n.dot(&near.n) > 0.0
            && point.n.cross(&near.n).norm() < ASIDE
            && point.gap > near.gap - SLACK * size
    };
    visit_lines(first, second, sides, &near.n, &mut |point| {
        if is_alike(point) {
            offer(point);
        }
    });
    if deepest > near.gap + SLACK * size {
        visit(&near);
    }
}

/// Visits the crossings and ends of straight lines, the ends of chords and the crossings of
/// circles. `sides`: the flat sides that lie along the direction n between the shapes.
fn visit_lines(
    first: &PlacedShape<'_>,
    second: &PlacedShape<'_>,
    sides: [Option<usize>; 2],
    n: &Vector3<f64>,
    offer: &mut dyn FnMut(&PairPoint),
) {
    let is_on_side = sides.iter().any(Option::is_some);
    let treads = [is_tread(first), is_tread(second)];
    if is_on_side || treads.contains(&true) {
        let lines = [
            lines_along(first, sides[0], n),
            lines_along(second, sides[1], &-n),
        ];
        let mut offer_alike = |found: Option<(PairPoint, bool)>| {
            if let Some((point, true)) = found {
                offer(&point);
            }
        };
        let may_cross = is_on_side || treads == [true; 2];
        for a in lines[0].iter() {
            for b in lines[1].iter() {
                if may_cross {
                    offer_alike(crossing(first, second, [a, b]));
                }
                for code in (0..4).filter(|_| treads.contains(&true)) {
                    offer_alike(end(first, second, code, [a, b]));
                }
            }
        }
        for (of, side) in sides.iter().enumerate() {
            let Some(side) = side.filter(|_| treads[of]) else {
                continue;
            };
            for line in lines[1 - of].iter() {
                for end in 0..2 {
                    offer_alike(chord_end(first, second, of << 2 | side << 1 | end, line));
                }
            }
        }
        if let ([Some(a), Some(b)], [true, true]) = (sides, treads) {
            for end in 0..2 {
                offer_alike(circles(first, second, a << 2 | b << 1 | end));
            }
        }
    }
}

/// The point of a feature, wherever it is.
#[must_use]
pub fn point(first: &PlacedShape<'_>, second: &PlacedShape<'_>, feature: usize) -> PairPoint {
    let found = if feature & ON_FLAT != 0 {
        let is_of_second = feature >> (2 * BITS) & 1 == 1;
        let (own, other) = if is_of_second {
            (second, first)
        } else {
            (first, second)
        };
        flat_side(own, feature >> BITS & LOW).map(|plane| {
            let low = dispatch::point_on_plane(other, &plane, &Vector3::zeros(), feature & LOW);
            let x = low.point - low.n * low.gap;
            let point = PairPoint::from_first(feature, &x, &low.n, low.gap);
            if is_of_second { point.swapped() } else { point }
        })
    } else if feature & CROSSING != 0 {
        let lines = [feature >> BITS & LOW, feature & LOW];
        crossing(first, second, lines).map(|(point, _)| point)
    } else if feature & END != 0 {
        let lines = [feature >> BITS & LOW, feature & LOW];
        end(first, second, feature >> (2 * BITS) & 3, lines).map(|(point, _)| point)
    } else if feature & CHORD != 0 {
        chord_end(first, second, feature >> BITS & LOW, feature & LOW).map(|(point, _)| point)
    } else if feature & CIRCLES != 0 {
        circles(first, second, feature & LOW).map(|(point, _)| point)
    } else {
        None
    };
    found.unwrap_or_else(|| PairPoint {
        feature: NEAREST,
        ..dispatch::nearest_points(first, second)
    })
}

/// The plane of a flat side; none if the shape has no such side.
fn flat_side(shape: &PlacedShape<'_>, side: usize) -> Option<Plane> {
    let (n, at) = match shape {
        PlacedShape::Box(solid) if side < 6 => {
            let n = solid.axis(side / 2) * if side.is_multiple_of(2) { 1.0 } else { -1.0 };
            (n, solid.centre + n * solid.half_size[side / 2])
        }
        PlacedShape::Hull(hull) => {
            let face = hull.polytope.faces().get(side)?;
            (
                hull.R * face.normal,
                hull.place(&(face.normal * face.offset)),
            )
        }
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller)
            if side < 2 && roller.core.radius > 0.0 =>
        {
            let n = roller.core.axle * if side == 0 { 1.0 } else { -1.0 };
            (n, roller.core.centre + n * (roller.half + roller.rounding))
        }
        _ => return None,
    };
    Some(Plane::through(&at, n))
}

/// Number of the flat side whose normal is a direction.
fn side_along(shape: &PlacedShape<'_>, n: &Vector3<f64>) -> Option<usize> {
    let is_along = |normal: Vector3<f64>| (normal - n).norm() < ALONG;
    match shape {
        PlacedShape::Box(solid) => {
            let local = solid.R.tr_mul(n);
            let k = local.iamax();
            let side = 2 * k + usize::from(local[k] < 0.0);
            is_along(solid.axis(k) * local[k].signum()).then_some(side)
        }
        PlacedShape::Hull(hull) => {
            let local = hull.R.tr_mul(n);
            let mut faces = hull.polytope.faces().iter();
            faces.position(|face| (face.normal - local).norm() < ALONG)
        }
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) if roller.core.radius > 0.0 => {
            let lean = roller.core.axle.dot(n);
            is_along(roller.core.axle * lean.signum()).then_some(usize::from(lean < 0.0))
        }
        _ => None,
    }
}

/// Whether a place is over a flat side's outline, or outside by at most `slack`, m.
fn is_over(shape: &PlacedShape<'_>, side: usize, x: &Vector3<f64>, slack: f64) -> bool {
    match shape {
        PlacedShape::Box(solid) => {
            let local = solid.R.tr_mul(&(x - solid.centre)).abs();
            (0..3).all(|k| k == side / 2 || local[k] <= solid.half_size[k] + slack)
        }
        PlacedShape::Hull(hull) => {
            let face = &hull.polytope.faces()[side];
            hull_sphere::is_over(hull.polytope, face, &hull.local(x), slack)
        }
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            let offset = x - roller.core.centre;
            let across = offset - roller.core.axle * roller.core.axle.dot(&offset);
            across.norm() <= roller.core.radius + slack
        }
        _ => false,
    }
}

/// A set of lines of a shape.
struct Lines([u64; 4]);

impl Lines {
    fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        (0..256).filter(|k| self.0[k / 64] >> (k % 64) & 1 == 1)
    }

    fn add(&mut self, k: usize) {
        self.0[k / 64] |= 1 << (k % 64);
    }
}

/// The lines of a shape that may touch along an outward direction n: of the side in contact, or of
/// the side that faces n most.
fn lines_along(shape: &PlacedShape<'_>, side: Option<usize>, n: &Vector3<f64>) -> Lines {
    let mut lines = Lines([0; 4]);
    match shape {
        PlacedShape::Box(solid) => {
            let local = solid.R.tr_mul(n);
            let k = side.map_or_else(|| local.iamax(), |side| side / 2);
            for edge in (0..12).filter(|edge| edge / 4 != k) {
                let (axis, bits) = (edge / 4, edge % 4);
                let bit = if (axis + 1) % 3 == k {
                    bits & 1
                } else {
                    bits >> 1
                };
                if (bit == 1) == (local[k] > 0.0) {
                    lines.add(edge);
                }
            }
        }
        PlacedShape::Hull(hull) => {
            let local = hull.R.tr_mul(n);
            let facing = |k: usize| hull.polytope.faces()[k].normal.dot(&local);
            let all = 0..hull.polytope.faces().len();
            let most = side.or_else(|| all.max_by(|a, b| facing(*a).total_cmp(&facing(*b))));
            for (k, edge) in hull.polytope.edges().iter().enumerate() {
                if most.is_some_and(|most| edge.faces.contains(&most)) {
                    lines.add(k);
                }
            }
        }
        PlacedShape::Roller(_) | PlacedShape::Cylinder(_) => lines.add(0),
        PlacedShape::Disc(_) | PlacedShape::Sphere(_) | PlacedShape::Ellipsoid(_) => {}
    }
    lines
}

/// Middle, unit direction, half length and radius of a line of a shape.
fn line(shape: &PlacedShape<'_>, number: usize) -> Option<(Vector3<f64>, Vector3<f64>, f64, f64)> {
    match shape {
        PlacedShape::Box(solid) if number < 12 => {
            let (middle, along, half) = solid.edge(number);
            Some((middle, along, half, 0.0))
        }
        PlacedShape::Hull(hull) => {
            let edge = hull.polytope.edges().get(number)?;
            let [p, q] = edge.ends.map(|k| hull.vertex(k));
            let half = (q - p) * 0.5;
            let length = half.norm();
            Some((p + half, half / length, length, 0.0))
        }
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => Some((
            roller.core.centre,
            roller.core.axle,
            roller.half,
            roller.radius(),
        )),
        _ => None,
    }
}

fn is_tread(shape: &PlacedShape<'_>) -> bool {
    matches!(shape, PlacedShape::Roller(_) | PlacedShape::Cylinder(_))
}

/// Where two lines cross, and whether both have that place; none if they are parallel.
fn crossing(
    first: &PlacedShape<'_>,
    second: &PlacedShape<'_>,
    [a, b]: [usize; 2],
) -> Option<(PairPoint, bool)> {
    let (p, d, half_p, r_p) = line(first, a)?;
    let (q, e, half_q, r_q) = line(second, b)?;
    let across = d.cross(&e);
    let square = across.norm_squared();
    let least = if r_p > 0.0 && r_q > 0.0 {
        PARALLEL
    } else {
        SKEW
    };
    if square <= least * least {
        return None;
    }
    let between = q - p;
    // Out of the first shape, into the second.
    let outward = second.centre() - first.centre();
    let n = across * (across.dot(&outward).signum() / square.sqrt());
    let s = between.cross(&e).dot(&across) / square;
    let t = between.cross(&d).dot(&across) / square;
    let gap = n.dot(&between) - r_p - r_q;
    let slack = SLACK * (first.bound() + second.bound());
    let is_within = s.abs() <= half_p + slack && t.abs() <= half_q + slack;
    let feature = CROSSING | a << BITS | b;
    let point = PairPoint::from_first(feature, &(p + d * s + n * r_p), &n, gap);
    Some((point, is_within))
}

/// An end of one line abreast of another one almost along it, of which one at least is a tread, and
/// whether the other one has that place. The code is 2 for an end of the second shape's line, and
/// one more for its end towards the tail.
fn end(
    first: &PlacedShape<'_>,
    second: &PlacedShape<'_>,
    code: usize,
    [a, b]: [usize; 2],
) -> Option<(PairPoint, bool)> {
    let is_of_second = code & 2 != 0;
    let lines = [line(first, a)?, line(second, b)?];
    let (p, d, half, radius) = lines[usize::from(is_of_second)];
    let (q, e, half_other, radius_other) = lines[usize::from(!is_of_second)];
    if radius + radius_other <= 0.0 || d.cross(&e).norm() > PARALLEL {
        return None;
    }
    let centre = p + d * if code & 1 == 0 { half } else { -half };
    let from_middle = centre - q;
    let place = e.dot(&from_middle);
    let across = e * place - from_middle;
    let distance = across.norm();
    // From the line with the end to the other one.
    let n = across.try_normalize(0.0)?;
    let (x, gap) = (centre + n * radius, distance - radius - radius_other);
    let feature = END | code << (2 * BITS) | a << BITS | b;
    let point = PairPoint::from_first(feature, &x, &n, gap);
    let is_within = place.abs() <= half_other;
    let point = if is_of_second { point.swapped() } else { point };
    Some((point, is_within))
}

/// A flat round side of a shape: its circle, its outward normal and its rounding, m.
fn round_side(shape: &PlacedShape<'_>, side: usize) -> Option<(Disc, Vector3<f64>, f64)> {
    match shape {
        PlacedShape::Roller(roller) | PlacedShape::Cylinder(roller) => {
            let n = roller.core.axle * if side == 0 { 1.0 } else { -1.0 };
            Some((roller.circle(side), n, roller.rounding))
        }
        _ => None,
    }
}

/// An end of the chord that a flat round side has over an edge of the other shape, and whether the
/// edge reaches there. The code is 4 for a side of the second shape, 2 for its second side, and the
/// end.
fn chord_end(
    first: &PlacedShape<'_>,
    second: &PlacedShape<'_>,
    code: usize,
    number: usize,
) -> Option<(PairPoint, bool)> {
    let is_of_second = code & 4 != 0;
    let (own, other) = if is_of_second {
        (second, first)
    } else {
        (first, second)
    };
    let (circle, n, rounding) = round_side(own, code >> 1 & 1)?;
    let (q, e, half, radius) = line(other, number)?;
    if radius > 0.0 {
        return None;
    }
    let end = chord::ends(&circle, &n, &q, &e)?[code & 1];
    let x = end.point + n * rounding;
    let feature = CHORD | code << BITS | number;
    let point = PairPoint::from_first(feature, &x, &n, -end.height - rounding);
    let point = if is_of_second { point.swapped() } else { point };
    Some((point, end.place.abs() <= half))
}

/// Where the circles of two flat round sides cross, seen along the normal of the first one. The
/// code has the numbers of the sides and of the crossing.
fn circles(
    first: &PlacedShape<'_>,
    second: &PlacedShape<'_>,
    code: usize,
) -> Option<(PairPoint, bool)> {
    let (own, n, rounding) = round_side(first, code >> 2 & 1)?;
    let (other, m, rounding_other) = round_side(second, code >> 1 & 1)?;
    let between = other.centre - own.centre;
    let across = between - n * n.dot(&between);
    let distance = across.norm();
    if distance <= SLACK * own.radius {
        return None;
    }
    let u = across / distance;
    let (r, s) = (own.radius, other.radius);
    let x = 0.5 * (distance + (r - s) * (r + s) / distance);
    let square = (r - x) * (r + x);
    if square <= 0.0 {
        return None;
    }
    let side = n.cross(&u) * if code & 1 == 0 { 1.0 } else { -1.0 };
    let place = own.centre + u * x + side * square.sqrt();
    // To the plane of the second side.
    let way = m.dot(&(other.centre - place)) / m.dot(&n);
    let gap = way - rounding - rounding_other;
    let x = place + n * rounding;
    Some((PairPoint::from_first(CIRCLES | code, &x, &n, gap), true))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::query::pairs;
    use crate::geometry::{Ellipsoid, Hull, OrientedBox, Roller};
    use crate::spatial::Polytope;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    /// A hull without symmetry, and a prism whose faces are flats of four and six corners.
    fn polytopes() -> [Polytope; 2] {
        let rock = [
            [0.3, 0.0, 0.0],
            [-0.25, 0.1, 0.15],
            [-0.1, 0.05, -0.25],
            [0.0, -0.2, 0.05],
            [0.05, 0.25, 0.0],
            [0.1, -0.1, -0.2],
            [0.1, 0.1, 0.25],
        ];
        let prism: Vec<_> = (0..6)
            .flat_map(|k| {
                let (sin, cos) = (std::f64::consts::FRAC_PI_3 * f64::from(k)).sin_cos();
                [-0.1, 0.1].map(|y| Vector3::new(0.25 * cos, y, 0.25 * sin))
            })
            .collect();
        [
            Polytope::hull_of(&rock.map(Vector3::from)).unwrap(),
            Polytope::hull_of(&prism).unwrap(),
        ]
    }

    const KINDS: usize = 8;

    fn shape(
        kind: usize,
        x: Vector3<f64>,
        turn: [f64; 3],
        polytopes: &[Polytope; 2],
    ) -> PlacedShape<'_> {
        let R = *Rotation3::from_euler_angles(turn[0], turn[1], turn[2]).matrix();
        let disc = |radius: f64| Disc {
            centre: x,
            axle: R.column(1).into(),
            spoke: R.column(0).into(),
            radius,
        };
        match kind {
            0 => PlacedShape::Cylinder(Roller::new(disc(0.2), 0.3, 0.0)),
            1 => PlacedShape::Cylinder(Roller::new(disc(0.12), 0.6, 0.12)),
            2 => PlacedShape::Ellipsoid(Ellipsoid {
                centre: x,
                R,
                radii: Vector3::new(0.3, 0.2, 0.15),
            }),
            3 | 4 => PlacedShape::Hull(Hull {
                centre: x,
                R,
                polytope: &polytopes[kind - 3],
            }),
            5 => PlacedShape::Box(OrientedBox {
                centre: x,
                R,
                half_size: Vector3::new(0.3, 0.2, 0.15),
            }),
            6 => PlacedShape::Roller(Roller::new(disc(0.25), 0.2, 0.05)),
            _ => PlacedShape::Sphere(crate::geometry::Sphere::new(x, 0.2)),
        }
    }

    /// Separation along n: the signed distance is its largest value.
    fn separation(first: &PlacedShape<'_>, second: &PlacedShape<'_>, n: &Vector3<f64>) -> f64 {
        n.dot(&second.support(&-n)) - n.dot(&first.support(n))
    }

    fn all(first: &PlacedShape<'_>, second: &PlacedShape<'_>, reach: f64) -> Vec<PairPoint> {
        let mut found = Vec::new();
        pairs::visit_pair(first, second, reach, |point| found.push(*point));
        found
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]
        #[test]
        fn no_direction_parts_them_further(
            kinds in (0..5_usize, 0..KINDS), x in prop::array::uniform3(-0.6..0.6),
            turns in (prop::array::uniform3(-3.0..3.0), prop::array::uniform3(-3.0..3.0)),
            d in prop::array::uniform3(-1.0..1.0), small in 0.0..0.02_f64,
        ) {
            let polytopes = polytopes();
            let first = shape(kinds.0, Vector3::new(0.1, 0.2, -0.1), turns.0, &polytopes);
            let second = shape(kinds.1, Vector3::new(0.1, 0.2, -0.1) + Vector3::from(x), turns.1, &polytopes);
            let near = dispatch::nearest_points(&first, &second);
            if near.gap < -0.1 {
                return Ok(()); // deep: whichever way out
            }
            let own = separation(&first, &second, &near.n);
            let tolerance = if near.gap > 0.0 { 1e-7 } else { 2e-6 };
            prop_assert!((own - near.gap).abs() < tolerance, "{own} {}", near.gap);
            let d = Vector3::from(d).try_normalize(1e-3).unwrap_or_else(Vector3::y);
            prop_assert!(separation(&first, &second, &d) <= near.gap + tolerance);
            let beside = (near.n + d * small).normalize();
            prop_assert!(separation(&first, &second, &beside) <= near.gap + tolerance);
            // No point of contact is deeper, and the deepest one is there.
            let found = all(&first, &second, 0.05);
            if near.gap <= 0.05 {
                let deepest = found.iter().map(|p| p.gap).fold(f64::INFINITY, f64::min);
                prop_assert!((deepest - near.gap).abs() < 2e-6, "{deepest} {}", near.gap);
            }
            for point in found {
                let again = pairs::point_of_pair(&first, &second, point.feature);
                prop_assert!((again.point - point.point).norm() < 1e-9 && (again.gap - point.gap).abs() < 1e-9);
            }
        }

        /// Along a straight path with a turn, from apart to overlapping.
        #[test]
        fn gap_and_normal_are_continuous_through_the_first_touch(
            kinds in (0..5_usize, 0..KINDS), aside in prop::array::uniform3(-0.3..0.3),
            turns in (prop::array::uniform3(-3.0..3.0), prop::array::uniform3(-3.0..3.0)),
            way in prop::array::uniform3(-1.0..1.0),
        ) {
            let polytopes = polytopes();
            let way = Vector3::from(way).try_normalize(0.1).unwrap_or_else(Vector3::y);
            let first = shape(kinds.0, Vector3::zeros(), turns.0, &polytopes);
            let aside = Vector3::from(aside);
            let aside = (aside - way * way.dot(&aside)) * 0.5;
            let at = |s: f64| {
                let turn = turns.1.map(|angle| angle + 0.5 * s);
                shape(kinds.1, aside + way * s, turn, &polytopes)
            };
            let gap = |s: f64| dispatch::nearest_points(&first, &at(s)).gap;
            let (mut low, mut high) = (0.0, 1.5);
            prop_assert!(gap(high) > 0.0);
            if gap(low) > 0.0 {
                return Ok(());
            }
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if gap(middle) > 0.0 { high = middle } else { low = middle }
            }
            let path = [1e-3, 1e-4, 1e-6, 1e-8, 1e-9, 0.0, -1e-9, -1e-8, -1e-6, -1e-4, -1e-3];
            let near: Vec<_> = path.iter().map(|s| dispatch::nearest_points(&first, &at(high + s))).collect();
            for k in 1..near.len() {
                let (before, after) = (near[k - 1], near[k]);
                let moved = path[k - 1] - path[k];
                // Speed of a point of the second shape relative to the first one.
                prop_assert!((before.gap - after.gap).abs() <= 1.6 * moved + 1e-10, "{k} {before:?} {after:?}");
            }
            // The normal just before and just after the touch.
            let (before, after) = (near[3], near[7]);
            let turned = (before.n - after.n).norm();
            prop_assert!(turned < 1e-3, "{turned} {before:?} {after:?}");
            prop_assert!((before.n - near[2].n).norm() < 1e-2 && (after.n - near[8].n).norm() < 1e-2);
        }
    }

    #[test]
    fn flat_on_flat_rests_on_several_points_and_a_capsule_on_two() {
        let polytopes = polytopes();
        let level = [0.0; 3];
        let on_side = [0.0, 0.3, std::f64::consts::FRAC_PI_2];
        let y = Vector3::y();
        let spread = |points: &[PairPoint]| {
            let axes = [Vector3::x(), Vector3::z()];
            axes.map(|e| {
                let places = points.iter().map(|p| e.dot(&p.point));
                places.clone().fold(0.0, f64::max) - places.fold(0.0, f64::min)
            })
        };
        let ground = |half: [f64; 3]| {
            PlacedShape::Box(OrientedBox {
                centre: Vector3::zeros(),
                R: nalgebra::Matrix3::identity(),
                half_size: half.into(),
            })
        };
        let (wide, narrow) = (ground([2.0, 0.1, 2.0]), ground([0.1, 0.1, 2.0]));
        let gap = -1e-6;
        let standing = shape(0, y * (0.25 + gap), level, &polytopes);
        let points = all(&wide, &standing, 1e-4);
        assert!(
            points.len() >= 3 && spread(&points).iter().all(|s| *s > 0.25),
            "{points:?}"
        );
        let prism = shape(4, y * (0.2 + gap), level, &polytopes);
        let points = all(&wide, &prism, 1e-4);
        assert!(points.len() == 6, "{points:?}");
        let across = shape(4, y * (0.2 + gap), level, &polytopes);
        let points = all(&narrow, &across, 1e-4);
        assert!(points.len() >= 4 && spread(&points)[0] > 0.19, "{points:?}");
        let lying = shape(1, y * (0.22 + gap), on_side, &polytopes);
        for ground in [&wide, &narrow] {
            let points = all(ground, &lying, 1e-4);
            assert!(points.len() == 2 && spread(&points)[0] > 0.19, "{points:?}");
            assert!(
                points
                    .iter()
                    .all(|p| (p.n - y).norm() < 1e-9 && (p.gap - gap).abs() < 1e-9)
            );
        }
        let above = shape(1, y * (0.46 + gap), on_side, &polytopes);
        let below = shape(1, y * 0.22, on_side, &polytopes);
        let points = all(&below, &above, 1e-4);
        assert!(points.len() >= 2 && spread(&points)[0] > 0.3, "{points:?}");
        let stacked = shape(0, y * (0.55 + gap), level, &polytopes);
        let points = all(&standing, &stacked, 1e-4);
        assert!(
            points.len() >= 3 && spread(&points).iter().all(|s| *s > 0.25),
            "{points:?}"
        );
    }

    /// A log along an edge had one point there, and rolled about it; a drum that stood half over an
    /// edge, or over another drum, had those of its rim that happened to be over the other.
    #[test]
    fn along_an_edge_and_half_over_one_a_drum_touches_at_the_ends_of_what_is_shared() {
        let polytopes = polytopes();
        let gap = -1e-6;
        let block = PlacedShape::Box(OrientedBox {
            centre: Vector3::zeros(),
            R: nalgebra::Matrix3::identity(),
            half_size: Vector3::new(0.3, 0.2, 0.4),
        });
        let extent = |points: &[PairPoint], axis: usize| {
            let places = points.iter().map(|p| p.point[axis]);
            [
                places.clone().fold(f64::INFINITY, f64::min),
                places.fold(f64::NEG_INFINITY, f64::max),
            ]
        };
        let are = |points: &[PairPoint], axis: usize, expected: [f64; 2]| {
            let found = extent(points, axis);
            let is = (0..2).all(|k| (found[k] - expected[k]).abs() < 1e-5);
            assert!(
                is && points.iter().all(|p| (p.gap - gap).abs() < 1e-8),
                "{points:?}"
            );
        };
        // Beside the block's edge at an angle of 45 degrees, and beyond its end.
        let out = Vector3::new(1.0, 1.0, 0.0).normalize();
        let place = Vector3::new(0.3, 0.2, 0.35) + out * (0.2 + gap);
        let log = shape(
            0,
            place,
            [std::f64::consts::FRAC_PI_2, 0.0, 0.0],
            &polytopes,
        );
        for (first, second) in [(&block, &log), (&log, &block)] {
            let points = all(first, second, 1e-4);
            are(&points, 2, [0.2, 0.4]);
            assert!(points.len() >= 2, "{points:?}");
        }
        // Standing, its middle just over the block; and just over another drum.
        let standing = shape(0, Vector3::new(0.29, 0.35 + gap, 0.1), [0.0; 3], &polytopes);
        let half = (0.04_f64 - 1e-4).sqrt();
        for (first, second) in [(&block, &standing), (&standing, &block)] {
            are(&all(first, second, 1e-4), 2, [0.1 - half, 0.1 + half]);
        }
        let lower = shape(0, Vector3::new(0.0, 0.05, 0.0), [0.0; 3], &polytopes);
        let upper = shape(0, Vector3::new(0.19, 0.35 + gap, 0.0), [0.0; 3], &polytopes);
        let half = (0.04_f64 - 0.095 * 0.095).sqrt();
        for (first, second) in [(&lower, &upper), (&upper, &lower)] {
            let points = all(first, second, 1e-4);
            are(&points, 2, [-half, half]);
        }
        // A lying wheel of no width.
        let wheel = PlacedShape::Disc(Disc {
            centre: Vector3::new(0.29, 0.2 + gap, 0.1),
            axle: Vector3::y(),
            spoke: Vector3::x(),
            radius: 0.2,
        });
        let half = (0.04_f64 - 1e-4).sqrt();
        are(&all(&wheel, &block, 1e-4), 2, [0.1 - half, 0.1 + half]);
    }
}
