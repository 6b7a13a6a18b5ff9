//! Chooses the module that measures the contact points of two moving shapes.

use super::{PairPoint, box_box, disc_box, dispatch, flats};
use crate::geometry::PlacedShape;

/// Visits the points of two moving shapes whose gap is at most `reach`, m;
/// n from the first to the second.
pub fn visit_pair(
    first: &PlacedShape<'_>,
    second: &PlacedShape<'_>,
    reach: f64,
    mut visit: impl FnMut(&PairPoint),
) {
    let (first, second) = as_mid_discs(first, second);
    match (&first, &second) {
        (PlacedShape::Box(a), PlacedShape::Box(b)) => box_box::points(a, b, reach, visit),
        (PlacedShape::Disc(a), PlacedShape::Box(b)) => disc_box::points(a, b, reach, visit),
        (PlacedShape::Box(a), PlacedShape::Disc(b)) => {
            disc_box::points(b, a, reach, |point| visit(&point.swapped()));
        }
        (first, second) if may_rest(first, second) => {
            flats::points(first, second, reach, visit);
        }
        (first, second) => {
            let near = dispatch::nearest_points(first, second);
            if near.gap <= reach {
                visit(&near);
            }
        }
    }
}

/// The point of a feature of two moving shapes, wherever it is; n from the first to the second.
#[must_use]
pub fn point_of_pair(
    first: &PlacedShape<'_>,
    second: &PlacedShape<'_>,
    feature: usize,
) -> PairPoint {
    let (first, second) = as_mid_discs(first, second);
    match (&first, &second) {
        (PlacedShape::Box(a), PlacedShape::Box(b)) => box_box::point(a, b, feature),
        (PlacedShape::Disc(a), PlacedShape::Box(b)) => disc_box::point(a, b, feature),
        (PlacedShape::Box(a), PlacedShape::Disc(b)) => disc_box::point(b, a, feature).swapped(),
        (first, second) if may_rest(first, second) => flats::point(first, second, feature),
        (first, second) => dispatch::nearest_points(first, second),
    }
}

/// Whether two shapes may touch at more than one point, on a page that is not their own.
fn may_rest(first: &PlacedShape<'_>, second: &PlacedShape<'_>) -> bool {
    let are = |is: fn(&PlacedShape<'_>) -> bool| [first, second].map(is);
    let are_discs = are(|shape| matches!(shape, PlacedShape::Disc(_)));
    let are_balls = are(|shape| matches!(shape, PlacedShape::Sphere(_)));
    are_discs != [true; 2] && are_balls == [false; 2]
}

/// Two shapes as their pair is measured: against a box or another wheel, a wheel with a width is
/// the disc midway along its axle.
fn as_mid_discs<'a>(
    first: &PlacedShape<'a>,
    second: &PlacedShape<'a>,
) -> (PlacedShape<'a>, PlacedShape<'a>) {
    let beside = |shape: &PlacedShape<'a>, other: &PlacedShape<'a>| match (shape, other) {
        (
            PlacedShape::Roller(roller),
            PlacedShape::Disc(_) | PlacedShape::Roller(_) | PlacedShape::Box(_),
        ) => PlacedShape::Disc(roller.middle()),
        _ => *shape,
    };
    (beside(first, second), beside(second, first))
}
