//! The ground of a planar scene: where a disc touches it.
//!
//! The ground is what lies below a curve. A disc touches it at every point of the curve that is
//! nearest to the disc's centre among its neighbours: one on a line, two in a valley that is
//! narrower than the disc, a corner of a step. Seen from a centre inside the ground only the
//! nearest point of all counts, and pushes out.

use nalgebra::Vector2;

use crate::geometry::Support;

/// A point of the ground that faces a disc's centre.
pub type Facing = crate::geometry::Facing<2>;

/// Most points of the ground that face one disc: the nearest of more.
pub const MAX_FACING: usize = 64;

/// Of what was appended since `begin`, keeps what is wanted, in its order.
pub(super) fn keep_if(out: &mut Vec<Facing>, begin: usize, is_wanted: impl Fn(&Facing) -> bool) {
    let mut kept = begin;
    for k in begin..out.len() {
        if is_wanted(&out[k]) {
            out[kept] = out[k];
            kept += 1;
        }
    }
    out.truncate(kept);
}

/// Of what was appended since `begin`, keeps the [`MAX_FACING`] nearest, in their order.
pub(super) fn keep_few(out: &mut Vec<Facing>, begin: usize) {
    if out.len() - begin <= MAX_FACING {
        return;
    }
    let mut distances: Vec<f64> = out[begin..].iter().map(|f| f.distance).collect();
    let (_, farthest, _) = distances.select_nth_unstable_by(MAX_FACING - 1, f64::total_cmp);
    let farthest = *farthest;
    keep_if(out, begin, |f| f.distance <= farthest);
    out.truncate(begin + MAX_FACING);
}

/// What planar machines stand on. Immutable, shared between threads.
///
/// The points that face a centre are those whose distance is smallest among
/// their neighbours, in the order of x, the [`MAX_FACING`] nearest of more;
/// from inside the ground the nearest of all, at any depth.
pub trait Ground: Support<2> {
    /// Height of the ground at x, m; the upper one at a vertical face.
    fn height(&self, x: f64) -> f64;

    /// The report's own rule: the point straight below the centre counts as
    /// nearest; its normal is the curve's there.
    ///
    /// The distance is that to the tangent, `(y − f(x))/√(1 + f'²)`, exact on a line.
    fn below(&self, centre: &Vector2<f64>) -> Facing;
}

/// How a disc meets a curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ContactRule {
    /// The curve's points nearest to the centre; the gap is their distance less the radius.
    #[default]
    Nearest,
    /// As the report's examples: the gap is the height of the disc's *centre* over the curve, so
    /// the disc sinks in by its radius, while friction acts at the radius. For comparison only.
    CentreHeight,
}
