//! The ground of a planar scene: where a disc touches it.
//!
//! The ground is what lies below a curve. A disc touches it at every point of the curve that is nearest to the disc's centre among its
//! neighbours: one on a line, two in a valley that is narrower than the disc, a corner of a step. Seen from a centre inside the ground
//! only the nearest point of all counts, and pushes out.

use std::fmt::Debug;

use nalgebra::Vector2;

/// A point of the ground that faces a disc's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facing {
    /// The point, m.
    pub foot: Vector2<f64>,
    /// Unit normal, out of the ground.
    pub n: Vector2<f64>,
    /// Signed distance of the centre from the ground along n, m; negative inside.
    pub distance: f64,
}

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
pub trait Ground: Debug + Send + Sync {
    /// Height of the ground at x, m; the upper one at a vertical face.
    fn height(&self, x: f64) -> f64;

    /// Appends the points that face `centre` at a distance of at most `reach` (m), in the order of x.
    ///
    /// Those whose distance is smallest among their neighbours, the [`MAX_FACING`] nearest of more; from inside the ground the nearest of
    /// all, at any depth.
    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<Facing>);

    /// The report's own rule: the point straight below the centre counts as nearest; its normal is the curve's there.
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
    /// As the report's examples: the gap is the height of the disc's *centre* over the curve, so the disc sinks in by its radius,
    /// while friction acts at the radius. For comparison only.
    CentreHeight,
}
