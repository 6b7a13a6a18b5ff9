//! Disc and box: a wheel on a block.
//!
//! If the direction between the shapes is a face's normal, the wheel stands on that face as on a
//! plane: its lowest rim point and, lying flat, one to either side ([`super::disc_plane`]), as far
//! as they are over the face; lying over the face's edge, also the ends of its chord there. If the
//! direction is the axle, the box's corners stand on the disc. At edges and corners
//! [`super::convex`] gives the nearest points or the shortest way out.
//!
//! The gap's rate is exact, except for the two rim points beside the lowest, as on a plane, and for
//! the ends of a chord, which slide along the edge as the disc turns.

use nalgebra::Vector3;

use super::{NEAREST, PairPoint, chord, convex, disc_plane};
use crate::geometry::{Disc, OrientedBox, SupportMap};
use friction_contact::scalar::elementary::hypot;

/// Sine of the angle to a face's normal, or to the axle, below which a direction counts as parallel
/// to it.
const ALONG: f64 = 1e-5;

/// Features from here on are rim points on a face or corners on the disc.
const RIM: usize = 1 << 13;
const CORNER: usize = 1 << 14;
/// Features from here on are ends of chords.
const CHORD: usize = 1 << 15;

/// Visits all points whose gap is at most `reach`, m; n from the disc to the box.
pub fn points(disc: &Disc, solid: &OrientedBox, reach: f64, mut visit: impl FnMut(&PairPoint)) {
    let near = convex::nearest_points(disc, solid);
    if near.gap > reach {
        return;
    }
    let mut is_found = false;
    let mut offer = |point: &PairPoint| {
        is_found = true;
        if point.gap <= reach {
            visit(point);
        }
    };
    // Out of the box, towards the disc.
    let outward = solid.R.tr_mul(&-near.n);
    let k = outward.iamax();
    let face = 2 * k + usize::from(outward[k] < 0.0);
    if hypot(hypot(outward.x, outward.y), outward.z) - outward[k].abs() < ALONG * ALONG {
        for feature in 0..3 {
            let point = rim_point(disc, solid, face, feature);
            if is_over(solid, k, &point.point) {
                offer(&point);
            }
        }
        let is_above = near.n.dot(&disc.axle) > 0.0;
        let is_up = usize::from(outward[k] > 0.0);
        for edge in (0..12).filter(|edge| edge / 4 != k) {
            // The side of the edge along the axis k.
            let bit = if (edge / 4 + 1) % 3 == k {
                edge
            } else {
                edge >> 1
            };
            if bit & 1 != is_up {
                continue;
            }
            for end in 0..2 {
                let code = usize::from(is_above) << 5 | edge << 1 | end;
                if let Some((point, true)) = chord_end(disc, solid, code) {
                    offer(&point);
                }
            }
        }
    }
    if near.n.cross(&disc.axle).norm() < ALONG {
        let is_above = usize::from(near.n.dot(&disc.axle) > 0.0);
        for corner in 0..8 {
            let from_centre = solid.corner(corner) - disc.centre;
            let side = if is_above == 1 { 1.0 } else { -1.0 };
            let height = side * disc.axle.dot(&from_centre);
            // Of the box's two ends along the axle the one that is nearer.
            let is_near = (solid.corner(corner) - solid.centre).dot(&near.n) < 0.0;
            let across = (from_centre.norm_squared() - height * height).max(0.0);
            if is_near && across <= disc.radius * disc.radius {
                offer(&corner_point(disc, solid, is_above, corner));
            }
        }
    }
    if !is_found {
        visit(&near);
    }
}

/// The end of the disc's chord over an edge of the box, and whether the edge reaches there. The
/// code is 32 if the box is towards the axle's head, and the edge's number, and the end.
fn chord_end(disc: &Disc, solid: &OrientedBox, code: usize) -> Option<(PairPoint, bool)> {
    let n = disc.axle * if code >> 5 & 1 == 1 { 1.0 } else { -1.0 };
    let (middle, along, half) = solid.edge(code >> 1 & 15);
    let end = chord::ends(disc, &n, &middle, &along)?[code & 1];
    let point = PairPoint::from_first(CHORD | code, &end.point, &n, -end.height);
    Some((point, end.place.abs() <= half))
}

/// The point of a feature, wherever it is.
#[must_use]
pub fn point(disc: &Disc, solid: &OrientedBox, feature: usize) -> PairPoint {
    let code = feature & (RIM - 1);
    if feature & CHORD != 0
        && let Some((point, _)) = chord_end(disc, solid, code)
    {
        point
    } else if feature & RIM != 0 {
        rim_point(disc, solid, code >> 2 & 7, code & 3)
    } else if feature & CORNER != 0 {
        corner_point(disc, solid, code >> 3 & 1, code & 7)
    } else {
        PairPoint {
            feature: NEAREST,
            ..convex::nearest_points(disc, solid)
        }
    }
}

/// A rim point of the disc on the plane of a face.
fn rim_point(disc: &Disc, solid: &OrientedBox, face: usize, feature: usize) -> PairPoint {
    let k = face / 2 % 3;
    let side = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
    let n = solid.axis(k) * side;
    let low =
        disc_plane::rim_point_over(disc, &n, &(solid.centre + n * solid.half_size[k]), feature);
    PairPoint {
        feature: RIM | face << 2 | feature,
        point: low.point - n * (0.5 * low.gap),
        n: -n,
        gap: low.gap,
    }
}

/// A corner of the box on the plane of the disc.
fn corner_point(disc: &Disc, solid: &OrientedBox, is_above: usize, corner: usize) -> PairPoint {
    let n = disc.axle * if is_above == 1 { 1.0 } else { -1.0 };
    let place = solid.corner(corner);
    let gap = n.dot(&(place - disc.centre));
    PairPoint {
        feature: CORNER | is_above << 3 | corner,
        point: place - n * (0.5 * gap),
        n,
        gap,
    }
}

/// Whether a point is over the face across axis k.
fn is_over(solid: &OrientedBox, k: usize, x: &Vector3<f64>) -> bool {
    let local = solid.R.tr_mul(&(x - solid.centre));
    let slack = 1e-6 * solid.bound();
    (0..3).all(|axis| axis == k || local[axis].abs() <= solid.half_size[axis] + slack)
}
