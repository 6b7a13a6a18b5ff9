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

/// What planar machines stand on. Immutable, shared between threads.
pub trait Ground: Debug + Send + Sync {
    /// Height of the ground at x, m; the upper one at a vertical face.
    fn height(&self, x: f64) -> f64;

    /// Appends the points that face `centre` at a distance of at most `reach` (m), in the order of x.
    ///
    /// Those whose distance is smallest among their neighbours; from inside the ground the nearest of all, at any depth.
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
