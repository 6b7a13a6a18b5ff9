//! Smooth grounds `y = f(x)`: a line, a sine, a table of points; and the search for the points
//! that face a centre.
//!
//! With the centre c and `D(x) = ½ |(x, f(x)) − c|²`, the search finds the minima of D: the roots
//! of `g(x) = (x − c_x) + (f(x) − c_y) f'(x)` at which g rises. It works on cells [a, b] with the
//! bounds |f''| ≤ B₂ and so on. A cell has no root if g at its centre is larger than the bound on
//! |g'| lets g change in half the cell. It has at most one if the same holds of g' and the bound
//! on |g''|. Any other cell is halved, so no root is missed. Cells are visited in the order of the
//! least distance that their curve can have. The search therefore ends at the reach, from inside
//! the ground at the nearest root, and at the [`MAX_FACING`] nearest roots where there are more.
//! Two roots closer than 1e-9 of the window, or of a metre, count as none.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::sync::Arc;

use nalgebra::Vector2;

use super::error::PlanarError;
use super::ground::{MAX_FACING, PlanarFacing, PlanarGround};
use crate::geometry::Support;
use crate::quantity::{AdmissibleRange, Demand, PLACES, QuantityError, finite, within};
use crate::scalar::elementary::{hypot, sin_cos};

/// Slopes, m/m.
const SLOPES: AdmissibleRange = AdmissibleRange::new([-1e3, 1e3], "at most 1000 either way");

/// Wavelengths, m: shorter ones are mere roughness to a disc.
const WAVELENGTHS: AdmissibleRange = AdmissibleRange::new([1e-3, 1e9], "from 1e-3 to 1e9 m");

/// Phases, rad.
const PHASES: AdmissibleRange = AdmissibleRange::new([-1e6, 1e6], "at most 1e6 rad either way");

/// Most points of a curve.
pub const MAX_POINTS: usize = 2_000_000;

/// Value and derivatives at a place: `[f, f', f'', f''']`.
pub type Jet = [f64; 4];

/// A function with continuous second derivative.
pub trait Curve: std::fmt::Debug + Send + Sync {
    /// `[f, f', f'', f''']` at x, m per mⁿ.
    fn jet(&self, x: f64) -> Jet;

    /// Bounds of `|f'|`, `|f''|`, `|f'''|` on [a, b].
    fn bounds(&self, a: f64, b: f64) -> [f64; 3];

    /// Bounds of f on [a, b], below and above, m.
    fn range(&self, a: f64, b: f64) -> [f64; 2];
}

/// `y = slope x + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    slope: f64,
    offset: f64,
}

impl Line {
    /// # Errors
    /// A number that is not finite or out of its range.
    pub fn new(slope: f64, offset: f64) -> Result<Self, PlanarError> {
        Ok(Self {
            slope: within(|| "slope".to_owned(), slope, SLOPES)?,
            offset: within(|| "offset".to_owned(), offset, PLACES)?,
        })
    }

    /// `slope`, 1.
    #[must_use]
    pub fn slope(&self) -> f64 {
        self.slope
    }

    /// Height at x = 0, m.
    #[must_use]
    pub fn offset(&self) -> f64 {
        self.offset
    }
}

impl PlanarGround for Line {
    fn height(&self, x: f64) -> f64 {
        self.slope * x + self.offset
    }

    fn below(&self, centre: &Vector2<f64>) -> PlanarFacing {
        let y = self.height(centre.x);
        tangent_facing(centre, y, self.slope)
    }
}

impl Support<2> for Line {
    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<PlanarFacing>) {
        let facing = self.below(centre);
        if facing.distance <= reach {
            out.push(PlanarFacing {
                foot: centre - facing.n * facing.distance,
                ..facing
            });
        }
    }
}

/// The point (c_x, y) of a curve with the given slope there, seen from a centre above it.
fn tangent_facing(centre: &Vector2<f64>, y: f64, slope: f64) -> PlanarFacing {
    let length = hypot(slope, 1.0);
    PlanarFacing {
        foot: Vector2::new(centre.x, y),
        n: Vector2::new(-slope, 1.0) / length,
        distance: (centre.y - y) / length,
    }
}

/// `y = amplitude sin(2π x / wavelength + phase) + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine {
    amplitude: f64,
    wavelength: f64,
    phase: f64,
    offset: f64,
    k: f64,
}

impl Sine {
    /// # Errors
    /// A number that is not finite or out of its range: wavelengths from a millimetre, slopes
    /// `2π amplitude/wavelength` up to 1000.
    pub fn new(
        amplitude: f64,
        wavelength: f64,
        phase: f64,
        offset: f64,
    ) -> Result<Self, PlanarError> {
        let wavelength = within(|| "wavelength".to_owned(), wavelength, WAVELENGTHS)?;
        let k = std::f64::consts::TAU / wavelength;
        let steepest = SLOPES.ends[1] / k;
        within(|| "amplitude".to_owned(), amplitude, PLACES)?;
        if amplitude.abs() > steepest {
            let range = Demand::Within("at most 1000/2π of the wavelength either way");
            return Err(QuantityError::new("amplitude", range, amplitude).into());
        }
        Ok(Self {
            amplitude,
            wavelength,
            phase: within(|| "phase".to_owned(), phase, PHASES)?,
            offset: within(|| "offset".to_owned(), offset, PLACES)?,
            k,
        })
    }

    /// Amplitude (m), wavelength (m), phase (rad), offset (m).
    #[must_use]
    pub fn parameters(&self) -> [f64; 4] {
        [self.amplitude, self.wavelength, self.phase, self.offset]
    }
}

impl Curve for Sine {
    fn jet(&self, x: f64) -> Jet {
        let (sin, cos) = sin_cos(self.k * x + self.phase);
        let (a, k) = (self.amplitude, self.k);
        [
            a * sin + self.offset,
            a * k * cos,
            -a * k * k * sin,
            -a * k * k * k * cos,
        ]
    }

    fn bounds(&self, _a: f64, _b: f64) -> [f64; 3] {
        let (a, k) = (self.amplitude.abs(), self.k);
        [a * k, a * k * k, a * k * k * k]
    }

    fn range(&self, _a: f64, _b: f64) -> [f64; 2] {
        let a = self.amplitude.abs();
        [self.offset - a, self.offset + a]
    }
}

/// The natural cubic spline through a table of points, continued beyond its
/// ends by its tangents there: C² everywhere.
///
/// Source: de Boor 1978, *A Practical Guide to Splines*, ch. 4.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    x: Vec<f64>,
    y: Vec<f64>,
    /// f'' at the points, 1/m.
    m: Vec<f64>,
}

impl Spline {
    /// `x`: strictly increasing, m. `y`: heights, m.
    ///
    /// # Errors
    /// Fewer than two points, other lengths, entries that are not finite,
    /// or x that does not increase.
    pub fn new(x: &[f64], y: &[f64]) -> Result<Self, PlanarError> {
        check_points(x, y)?;
        for (index, pair) in x.windows(2).enumerate() {
            if pair[1] <= pair[0] {
                return Err(PlanarError::NotAFunction {
                    index: index + 1,
                    demand: "greater than",
                    value: pair[1],
                });
            }
        }
        let n = x.len();
        let mut m = vec![0.0; n];
        // Thomas' algorithm on h_{i-1} m_{i-1} + 2 (h_{i-1} + h_i) m_i + h_i
        // m_{i+1} = 6 (slope_i − slope_{i-1}), m_0 = m_{n-1} = 0.
        let mut upper = vec![0.0; n];
        for i in 1..n - 1 {
            let (h0, h1) = (x[i] - x[i - 1], x[i + 1] - x[i]);
            let bend = 6.0 * ((y[i + 1] - y[i]) / h1 - (y[i] - y[i - 1]) / h0);
            let pivot = 2.0 * (h0 + h1) - h0 * upper[i - 1];
            upper[i] = h1 / pivot;
            m[i] = (bend - h0 * m[i - 1]) / pivot;
        }
        for i in (1..n - 1).rev() {
            m[i] -= upper[i] * m[i + 1];
        }
        if let Some(index) = m.iter().position(|x| !x.is_finite()) {
            finite(&format!("y[{index}]"), m[index])?;
        }
        Ok(Self {
            x: x.to_vec(),
            y: y.to_vec(),
            m,
        })
    }

    /// The points' x, m.
    #[must_use]
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// The points' y, m.
    #[must_use]
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// Number of the piece that holds x, inside the table.
    fn piece(&self, x: f64) -> usize {
        self.x
            .partition_point(|&knot| knot <= x)
            .clamp(1, self.x.len() - 1)
            - 1
    }
}

impl Curve for Spline {
    fn jet(&self, x: f64) -> Jet {
        let (first, last) = (self.x[0], self.x[self.x.len() - 1]);
        let inside = x.clamp(first, last);
        let i = self.piece(inside);
        let h = self.x[i + 1] - self.x[i];
        let (a, b) = (self.x[i + 1] - inside, inside - self.x[i]);
        let (m0, m1) = (self.m[i], self.m[i + 1]);
        let (y0, y1) = (self.y[i], self.y[i + 1]);
        let value = (m0 * a * a * a + m1 * b * b * b) / (6.0 * h)
            + (y0 / h - m0 * h / 6.0) * a
            + (y1 / h - m1 * h / 6.0) * b;
        let slope = (m1 * b * b - m0 * a * a) / (2.0 * h) + (y1 - y0) / h - (m1 - m0) * h / 6.0;
        let beyond = x - inside;
        if beyond.abs() > 0.0 {
            return [value + slope * beyond, slope, 0.0, 0.0];
        }
        [value, slope, (m0 * a + m1 * b) / h, (m1 - m0) / h]
    }

    fn bounds(&self, a: f64, b: f64) -> [f64; 3] {
        let mut bounds = [self.jet(a)[1].abs(), 0.0, 0.0];
        let (first, last) = (self.x[0], self.x[self.x.len() - 1]);
        let (a, b) = (a.clamp(first, last), b.clamp(first, last));
        for i in self.piece(a)..=self.piece(b) {
            bounds[1] = bounds[1].max(self.m[i].abs()).max(self.m[i + 1].abs());
            let third = (self.m[i + 1] - self.m[i]) / (self.x[i + 1] - self.x[i]);
            bounds[2] = f64::max(bounds[2], third.abs());
        }
        bounds[0] += bounds[1] * (b - a);
        bounds
    }

    fn range(&self, a: f64, b: f64) -> [f64; 2] {
        // Beyond the table the curve is straight, so its ends bound it; within a piece it leaves
        // the chord by max|f''| h²/8 at most.
        let ends = [self.jet(a)[0], self.jet(b)[0]];
        let mut range = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let (first, last) = (self.x[0], self.x[self.x.len() - 1]);
        let (a, b) = (a.clamp(first, last), b.clamp(first, last));
        for i in self.piece(a)..=self.piece(b) {
            let h = self.x[i + 1] - self.x[i];
            let bulge = self.m[i].abs().max(self.m[i + 1].abs()) * h * h / 8.0;
            let (y0, y1) = (self.y[i], self.y[i + 1]);
            range[0] = range[0].min(y0.min(y1) - bulge);
            range[1] = range[1].max(y0.max(y1) + bulge);
        }
        range
    }
}

pub(super) fn check_points(x: &[f64], y: &[f64]) -> Result<(), PlanarError> {
    if x.len() < 2 {
        return Err(PlanarError::TooFewPoints {
            needed: 2,
            count: x.len(),
        });
    }
    if x.len() > MAX_POINTS {
        return Err(PlanarError::TooManyPoints {
            count: x.len(),
            limit: MAX_POINTS,
        });
    }
    if y.len() != x.len() {
        return Err(PlanarError::MismatchedLengths {
            expected: x.len(),
            count: y.len(),
        });
    }
    for (name, values) in [("x", x), ("y", y)] {
        for (index, value) in values.iter().enumerate() {
            within(|| format!("{name}[{index}]"), *value, PLACES)?;
        }
    }
    Ok(())
}

impl PlanarGround for Sine {
    fn height(&self, x: f64) -> f64 {
        self.jet(x)[0]
    }

    fn below(&self, centre: &Vector2<f64>) -> PlanarFacing {
        let [y, slope, ..] = self.jet(centre.x);
        tangent_facing(centre, y, slope)
    }
}

impl Support<2> for Sine {
    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<PlanarFacing>) {
        facing(self, centre, reach, out);
    }
}

impl PlanarGround for Spline {
    fn height(&self, x: f64) -> f64 {
        self.jet(x)[0]
    }

    fn below(&self, centre: &Vector2<f64>) -> PlanarFacing {
        let [y, slope, ..] = self.jet(centre.x);
        tangent_facing(centre, y, slope)
    }
}

impl Support<2> for Spline {
    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<PlanarFacing>) {
        facing(self, centre, reach, out);
    }
}

/// `Arc`s of grounds are grounds, so that scenes can share them.
impl PlanarGround for Arc<dyn PlanarGround> {
    fn height(&self, x: f64) -> f64 {
        (**self).height(x)
    }

    fn below(&self, centre: &Vector2<f64>) -> PlanarFacing {
        (**self).below(centre)
    }
}

/// The points of a smooth curve that face a centre, see the page above.
fn facing(curve: &dyn Curve, centre: &Vector2<f64>, reach: f64, out: &mut Vec<PlanarFacing>) {
    let below = centre.y - curve.jet(centre.x)[0];
    let is_inside = below < 0.0;
    // The nearest point is no farther than the one straight above or below.
    let half = if is_inside { -below } else { reach };
    if half.is_nan() || half <= 0.0 {
        if below.abs() <= 0.0 {
            out.push(tangent_facing(centre, centre.y, curve.jet(centre.x)[1]));
        }
        return;
    }
    let begin = out.len();
    // Slightly more than the window: a foot at its very end is a root at its very end.
    let (a, b) = (
        centre.x - half * (1.0 + 1e-6),
        centre.x + half * (1.0 + 1e-6),
    );
    let limit = if is_inside { f64::INFINITY } else { reach };
    minima(curve, centre, a, b, limit, &mut |x| {
        let [y, slope, ..] = curve.jet(x);
        let length = hypot(slope, 1.0);
        let n = Vector2::new(-slope, 1.0) / length;
        let away = centre - Vector2::new(x, y);
        let distance = away.norm();
        let side = away.dot(&n);
        if distance <= limit && (side < 0.0) == is_inside {
            out.push(PlanarFacing {
                foot: Vector2::new(x, y),
                n,
                distance: side,
            });
        }
        let is_enough = out.len() - begin >= MAX_FACING;
        // From inside only the nearest counts: search no farther.
        match (is_enough, is_inside) {
            (true, _) => 0.0,
            (false, true) => distance,
            (false, false) => limit,
        }
    });
    out[begin..].sort_by(|a, b| a.foot.x.total_cmp(&b.foot.x));
    if is_inside {
        keep_nearest(out, begin);
        if out.len() == begin {
            // So deep that all distances are equal in double precision: straight up.
            let [y, slope, ..] = curve.jet(centre.x);
            out.push(tangent_facing(centre, y, slope));
        }
    }
}

/// Keeps the shallowest of the points appended since `begin`.
pub(super) fn keep_nearest(out: &mut Vec<PlanarFacing>, begin: usize) {
    let nearest = out[begin..]
        .iter()
        .copied()
        .max_by(|a, b| a.distance.total_cmp(&b.distance));
    out.truncate(begin);
    out.extend(nearest);
}

/// `g` and `g'` at x.
fn gradient(curve: &dyn Curve, centre: &Vector2<f64>, x: f64) -> (f64, f64) {
    let [f, d1, d2, _] = curve.jet(x);
    let above = f - centre.y;
    (x - centre.x + above * d1, 1.0 + d1 * d1 + above * d2)
}

/// Cells narrower than this fraction of the window, or of a metre, are not halved further.
const NARROWEST: f64 = 1e-9;

/// Most cells of one search. A disc that touches 64 points takes some thousand.
const MAX_CELLS: usize = 100_000;

/// A cell of x and the least distance that the curve over it can have from the centre.
struct Cell {
    a: f64,
    b: f64,
    /// Bounds of the derivatives.
    bounds: [f64; 3],
    /// Size of f's height over the centre, at the middle.
    above: f64,
    /// How far the middle is from the centre, along x.
    aside: f64,
    least: f64,
}

impl Cell {
    fn new(curve: &dyn Curve, centre: &Vector2<f64>, a: f64, b: f64) -> Self {
        let across = (a - centre.x).max(centre.x - b).max(0.0);
        let [low, high] = curve.range(a, b);
        let beside = (low - centre.y).max(centre.y - high).max(0.0);
        let bounds = curve.bounds(a, b);
        let above = (curve.jet(0.5 * (a + b))[0] - centre.y).abs();
        let beside = beside.max(above - bounds[0] * 0.5 * (b - a));
        Self {
            a,
            b,
            bounds,
            above,
            aside: (0.5 * (a + b) - centre.x).abs(),
            // Less than what rounding could add.
            least: hypot(across, beside) * (1.0 - 1e-9),
        }
    }
}

/// The nearest comes first out of a heap.
impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_distance = other.least.total_cmp(&self.least);
        by_distance.then_with(|| other.aside.total_cmp(&self.aside))
    }
}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Cell {}

/// Calls `found` with every minimum of the distance in [a, b], nearer cells first, up to a distance
/// of `limit` (m) and then of the least that `found` returned.
fn minima(
    curve: &dyn Curve,
    centre: &Vector2<f64>,
    a: f64,
    b: f64,
    mut limit: f64,
    found: &mut dyn FnMut(f64) -> f64,
) {
    let narrowest = NARROWEST * (b - a).min(1.0);
    // A minimum: g is below zero before and not after.
    let mut cells = BinaryHeap::from([Cell::new(curve, centre, a, b)]);
    for _ in 0..MAX_CELLS {
        let Some(cell) = cells.pop() else {
            return;
        };
        if cell.least > limit {
            return;
        }
        let (a, b, [b1, b2, b3]) = (cell.a, cell.b, cell.bounds);
        let (mid, half) = (0.5 * (a + b), 0.5 * (b - a));
        let (value, rate) = gradient(curve, centre, mid);
        let above = cell.above + b1 * half;
        let steepest = 1.0 + b1 * b1 + above * b2;
        if value.abs() > steepest * half {
            continue;
        }
        // g'' = 3 f' f'' + (f − c_y) f'''.
        let bend = 3.0 * b1 * b2 + above * b3;
        let is_monotone = rate.abs() > bend * half;
        if !is_monotone && b - a > narrowest && a < mid && mid < b {
            cells.push(Cell::new(curve, centre, a, mid));
            cells.push(Cell::new(curve, centre, mid, b));
            continue;
        }
        let (low, high) = (gradient(curve, centre, a).0, gradient(curve, centre, b).0);
        if low < 0.0 && high >= 0.0 {
            limit = limit.min(found(root(curve, centre, a, b)));
        }
    }
}

/// The root of a rising g in [a, b]: Newton, kept in the bracket by halving.
fn root(curve: &dyn Curve, centre: &Vector2<f64>, mut a: f64, mut b: f64) -> f64 {
    let mut x = 0.5 * (a + b);
    for _ in 0..100 {
        let (value, rate) = gradient(curve, centre, x);
        if value < 0.0 {
            a = x;
        } else {
            b = x;
        }
        let newton = x - value / rate;
        let next = if newton > a && newton < b {
            newton
        } else {
            0.5 * (a + b)
        };
        let is_settled = (next - x).abs() <= f64::EPSILON * (x.abs() + (b - a));
        x = next;
        if is_settled {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(ground: &dyn PlanarGround, c: [f64; 2], reach: f64) -> Vec<PlanarFacing> {
        let mut out = Vec::new();
        ground.facing(&Vector2::new(c[0], c[1]), reach, &mut out);
        out
    }

    #[test]
    fn a_disc_in_a_valley_narrower_than_itself_touches_twice() {
        // sin x has radius of curvature 1 at its bottom.
        let sine = Sine::new(1.0, std::f64::consts::TAU, 0.0, 0.0).expect("sound");
        let bottom = -0.5 * std::f64::consts::PI;
        let wide = all(&sine, [bottom, 1.0], 3.0);
        assert_eq!(wide.len(), 2, "{wide:?}");
        assert!((wide[0].distance - wide[1].distance).abs() < 1e-12);
        assert!((wide[0].foot.x + wide[1].foot.x - 2.0 * bottom).abs() < 1e-9);
        let narrow = all(&sine, [bottom, -0.2], 3.0);
        assert_eq!(narrow.len(), 1, "{narrow:?}");
        assert!((narrow[0].distance - 0.8).abs() < 1e-12);
    }

    #[test]
    fn no_nearest_point_of_a_fine_sampling_is_missed() {
        let sine = Sine::new(0.7, 1.3, 0.4, 0.2).expect("sound");
        let table: Vec<f64> = (0..30).map(f64::from).collect();
        let heights: Vec<f64> = table
            .iter()
            .map(|x| (1.7 * x).sin() + 0.3 * (5.1 * x).cos())
            .collect();
        let spline = Spline::new(&table, &heights).expect("sound");
        for (ground, shift) in [(&sine as &dyn PlanarGround, 0.0), (&spline, 11.0)] {
            for i in 0..200 {
                let i = f64::from(i);
                let centre = [shift + 0.037 * i, 1.8 * (0.9 * i).sin() + 0.4];
                let found = all(ground, centre, 1.5);
                let is_inside = centre[1] < ground.height(centre[0]);
                let mut sampled = f64::INFINITY;
                for k in -4000..=4000 {
                    let x = centre[0] + f64::from(k) * 1e-3;
                    sampled = sampled.min((x - centre[0]).hypot(ground.height(x) - centre[1]));
                }
                let nearest = found
                    .iter()
                    .map(|f| f.distance.abs())
                    .fold(f64::INFINITY, f64::min);
                if is_inside || sampled < 1.5 {
                    assert!(
                        (-1e-12..3e-3).contains(&(sampled - nearest)),
                        "{centre:?}: {nearest} {sampled}"
                    );
                } else {
                    assert!(found.is_empty());
                }
                for f in &found {
                    let away = Vector2::new(centre[0], centre[1]) - f.foot;
                    assert!((away - f.n * f.distance).norm() < 1e-9, "{f:?}");
                    assert_eq!(f.distance < 0.0, is_inside);
                }
            }
        }
    }

    #[test]
    fn splines_are_twice_differentiable_and_pass_their_points() {
        let x = [0.0, 0.5, 2.0, 2.3, 4.0];
        let y = [1.0, -0.3, 0.4, 0.6, 0.0];
        let spline = Spline::new(&x, &y).expect("sound");
        for (x, y) in x.iter().zip(&y) {
            assert!((spline.jet(*x)[0] - y).abs() < 1e-15);
        }
        let step = 1e-5;
        for i in 0..120 {
            let x = -1.0 + 0.05 * f64::from(i) + 1e-3;
            let (before, here, after) = (spline.jet(x - step), spline.jet(x), spline.jet(x + step));
            for order in 0..3 {
                let slope = (after[order] - before[order]) / (2.0 * step);
                assert!((slope - here[order + 1]).abs() < 1e-4, "{x} {order}");
            }
        }
        // A spline through points of a line is the line, also beyond them.
        let line = Spline::new(&[0.0, 1.0, 5.0], &[1.0, 3.0, 11.0]).expect("sound");
        assert!((line.height(-2.0) + 3.0).abs() < 1e-12 && (line.height(9.0) - 19.0).abs() < 1e-12);
    }

    /// A ball at y = −1e9 searched every wavelength within two million kilometres for its nearest
    /// point and never returned.
    #[test]
    fn a_ball_a_million_kilometres_deep_finds_its_way_out_at_once() {
        let sine = Sine::new(1.0, 0.1, 0.0, 0.0).expect("sound");
        let knots: Vec<f64> = (0..20_000).map(|i| 0.01 * f64::from(i)).collect();
        let heights: Vec<f64> = knots.iter().map(|x| (13.0 * x).sin()).collect();
        let spline = Spline::new(&knots, &heights).expect("sound");
        for depth in [1e3, 1e6, 1e9, 1e300] {
            let found = all(&sine, [17.3, -depth], 1.0);
            assert_eq!(found.len(), 1);
            // The nearest trough.
            assert!(
                (-found[0].distance / (depth - 1.0) - 1.0).abs() < 1e-7,
                "{found:?}"
            );
            // The spline continues steeply downwards beyond its ends, and its side is nearer than
            // its top.
            let found = all(&spline, [17.3, -depth], 1.0);
            assert_eq!(found.len(), 1);
            assert!(
                (-depth..-0.05 * depth).contains(&found[0].distance),
                "{found:?}"
            );
        }
    }

    #[test]
    fn of_very_many_crests_within_reach_the_nearest_are_kept() {
        let sine = Sine::new(0.1, 1e-3, 0.0, 0.0).expect("sound");
        for reach in [1.0, 1e3, 1e30] {
            let found = all(&sine, [0.0, 0.3], reach);
            assert!(found.len() <= MAX_FACING, "{}", found.len());
            assert!(found.is_sorted_by_key(|f| f.foot.x));
            let nearest = found
                .iter()
                .map(|f| f.distance)
                .fold(f64::INFINITY, f64::min);
            assert!((nearest - 0.2).abs() < 1e-6, "{nearest}");
        }
    }
}
