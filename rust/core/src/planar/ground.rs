//! The ground of a planar scene: where a disc touches it.
//!
//! The ground is the region below a curve. A disc touches it at every local minimum of the distance
//! between curve and centre: one point on a line, two in a valley narrower than the disc, a corner
//! of a step. For a centre inside the ground only the nearest point of all counts, and it pushes
//! the disc out.

use nalgebra::Vector2;

use crate::geometry::Support;

/// A point of the ground that faces a disc's centre.
pub type PlanarFacing = crate::geometry::Facing<2>;

/// Most points of the ground that face one disc: the nearest of more.
pub const MAX_FACING: usize = 64;

/// Filters the points appended since `begin`, in their order.
pub(super) fn keep_if(
    out: &mut Vec<PlanarFacing>,
    begin: usize,
    is_wanted: impl Fn(&PlanarFacing) -> bool,
) {
    let mut kept = begin;
    for k in begin..out.len() {
        if is_wanted(&out[k]) {
            out[kept] = out[k];
            kept += 1;
        }
    }
    out.truncate(kept);
}

/// Keeps the [`MAX_FACING`] nearest of the points appended since `begin`, in their order.
pub(super) fn keep_few(out: &mut Vec<PlanarFacing>, begin: usize) {
    if out.len() - begin <= MAX_FACING {
        return;
    }
    let mut distances: Vec<f64> = out[begin..].iter().map(|f| f.distance).collect();
    let (_, farthest, _) = distances.select_nth_unstable_by(MAX_FACING - 1, f64::total_cmp);
    let farthest = *farthest;
    keep_if(out, begin, |f| f.distance <= farthest);
    out.truncate(begin + MAX_FACING);
}

/// The ground of planar machines. Immutable, shared between threads.
///
/// The points that face a centre are the local minima of the distance, in the order of x, and at
/// most the [`MAX_FACING`] nearest. From inside the ground only the nearest of all counts, at any
/// depth.
pub trait PlanarGround: Support<2> {
    /// Height of the ground at x, m; the upper one at a vertical face.
    fn height(&self, x: f64) -> f64;

    /// The report's own rule: the point straight below the centre counts as
    /// nearest; its normal is the curve's there.
    ///
    /// The distance is that to the tangent, `(y − f(x))/√(1 + f'²)`, exact on a line.
    fn below(&self, centre: &Vector2<f64>) -> PlanarFacing;
}

/// Contact rule of a disc on a curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ContactRule {
    /// The curve's points nearest to the centre; the gap is their distance less the radius.
    #[default]
    Nearest,
    /// Rule of the report's examples: the gap is the distance of the disc's *centre* from the
    /// curve's tangent below it, so the disc sinks in by its radius, while friction acts at the
    /// radius. For comparison only.
    CentreHeight,
}
