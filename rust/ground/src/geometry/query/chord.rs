//! The chord of a circle along a straight line: where a flat round side lies on an edge.

use nalgebra::Vector3;

use crate::geometry::Disc;

/// Sine of the angle between a disc and a line up to which the disc may lie on the line: more than
/// it turns in a step.
pub(super) const LIES: f64 = 0.1;

/// An end of a chord.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChordEnd {
    /// End point of the chord, on the circle, m.
    pub point: Vector3<f64>,
    /// Position along the line, from its `start`, of the point under the end of the chord, m.
    pub place: f64,
    /// Height of the end of the chord over the line, along the given normal, m.
    pub height: f64,
}

/// The ends of the chord of a disc over a line from `start` (m) with the unit direction `along`,
/// seen along n, which is the axle or opposite to it: the one that is earlier on the line first.
/// None if the line passes beside the disc or leans against it by more than [`LIES`].
#[inline]
pub(super) fn ends(
    disc: &Disc,
    n: &Vector3<f64>,
    start: &Vector3<f64>,
    along: &Vector3<f64>,
) -> Option<[ChordEnd; 2]> {
    let lean = n.dot(along);
    if lean.abs() > LIES {
        return None;
    }
    let from = start - disc.centre;
    let height = -n.dot(&from);
    // In the disc's plane.
    let flat = along - n * lean;
    let cosine = flat.norm();
    let flat = flat / cosine;
    let across = from + n * height;
    let origin = across.dot(&flat);
    let beside = across - flat * origin;
    let square = disc.radius * disc.radius - beside.norm_squared();
    if square.is_nan() || square <= 0.0 {
        return None;
    }
    let half = square.sqrt();
    Some([-half, half].map(|x| {
        let place = (x - origin) / cosine;
        ChordEnd {
            point: disc.centre + beside + flat * x,
            place,
            height: height - lean * place,
        }
    }))
}
