//! Smooth grounds `y = f(x)`: line, sine, table of points; and the search for the points that face a centre.
//!
//! With the centre c and `D(x) = ½ |(x, f(x)) − c|²` the points sought are the minima of D, roots of
//! `g(x) = (x − c_x) + (f(x) − c_y) f'(x)` where g rises. On a cell [a, b] with the bounds |f''| ≤ B₂ etc. a centre value that
//! |g'|'s bound cannot bring to zero excludes roots, a derivative that |g''|'s bound cannot bring to zero leaves one at most, and any
//! other cell is halved: no root is missed, however many there are. A root pair closer than 1e-9 of the cell is none.

use std::sync::Arc;

use nalgebra::Vector2;

use super::error::{PlanarError, finite, positive};
use super::ground::{Facing, Ground};

/// Value and derivatives at a place: `[f, f', f'', f''']`.
pub type Jet = [f64; 4];

/// A function with continuous second derivative.
pub trait Curve: std::fmt::Debug + Send + Sync {
    /// `[f, f', f'', f''']` at x, m per mⁿ.
    fn jet(&self, x: f64) -> Jet;

    /// Bounds of `|f'|`, `|f''|`, `|f'''|` on [a, b].
    fn bounds(&self, a: f64, b: f64) -> [f64; 3];
}

/// `y = slope x + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    slope: f64,
    offset: f64,
}

impl Line {
    /// # Errors
    /// A number that is not finite.
    pub fn new(slope: f64, offset: f64) -> Result<Self, PlanarError> {
        Ok(Self {
            slope: finite("slope", slope)?,
            offset: finite("offset", offset)?,
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

impl Ground for Line {
    fn height(&self, x: f64) -> f64 {
        self.slope * x + self.offset
    }

    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<Facing>) {
        let facing = self.below(centre);
        if facing.distance <= reach {
            out.push(Facing {
                foot: centre - facing.n * facing.distance,
                ..facing
            });
        }
    }

    fn below(&self, centre: &Vector2<f64>) -> Facing {
        let y = self.height(centre.x);
        tangent_facing(centre, y, self.slope)
    }
}

/// The point (c_x, y) of a curve with the given slope there, seen from a centre above it.
fn tangent_facing(centre: &Vector2<f64>, y: f64, slope: f64) -> Facing {
    let length = slope.hypot(1.0);
    Facing {
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
    /// A number that is not finite, or a wavelength that is not positive.
    pub fn new(
        amplitude: f64,
        wavelength: f64,
        phase: f64,
        offset: f64,
    ) -> Result<Self, PlanarError> {
        Ok(Self {
            amplitude: finite("amplitude", amplitude)?,
            wavelength: positive("wavelength", wavelength)?,
            phase: finite("phase", phase)?,
            offset: finite("offset", offset)?,
            k: std::f64::consts::TAU / wavelength,
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
        let (sin, cos) = (self.k * x + self.phase).sin_cos();
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
}

/// The natural cubic spline through a table of points, continued beyond its ends by its tangents there: C² everywhere.
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
    /// Fewer than two points, other lengths, entries that are not finite, or x that does not increase.
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
        // Thomas' algorithm on h_{i-1} m_{i-1} + 2 (h_{i-1} + h_i) m_i + h_i m_{i+1} = 6 (slope_i − slope_{i-1}), m_0 = m_{n-1} = 0.
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
        for (index, value) in m.iter().enumerate() {
            finite(&format!("y[{index}]"), *value)?;
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
}

pub(super) fn check_points(x: &[f64], y: &[f64]) -> Result<(), PlanarError> {
    if x.len() < 2 {
        return Err(PlanarError::TooFewPoints {
            needed: 2,
            count: x.len(),
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
            finite(&format!("{name}[{index}]"), *value)?;
        }
    }
    Ok(())
}

impl Ground for Sine {
    fn height(&self, x: f64) -> f64 {
        self.jet(x)[0]
    }
    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<Facing>) {
        facing(self, centre, reach, out);
    }
    fn below(&self, centre: &Vector2<f64>) -> Facing {
        let [y, slope, ..] = self.jet(centre.x);
        tangent_facing(centre, y, slope)
    }
}

impl Ground for Spline {
    fn height(&self, x: f64) -> f64 {
        self.jet(x)[0]
    }
    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<Facing>) {
        facing(self, centre, reach, out);
    }
    fn below(&self, centre: &Vector2<f64>) -> Facing {
        let [y, slope, ..] = self.jet(centre.x);
        tangent_facing(centre, y, slope)
    }
}

/// `Arc`s of grounds are grounds, so that scenes can share them.
impl Ground for Arc<dyn Ground> {
    fn height(&self, x: f64) -> f64 {
        (**self).height(x)
    }
    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<Facing>) {
        (**self).facing(centre, reach, out);
    }
    fn below(&self, centre: &Vector2<f64>) -> Facing {
        (**self).below(centre)
    }
}

/// The points of a smooth curve that face a centre, see the page above.
fn facing(curve: &dyn Curve, centre: &Vector2<f64>, reach: f64, out: &mut Vec<Facing>) {
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
    // A little more than the window: a foot at its very end is a root at its very end.
    let (a, b) = (
        centre.x - half * (1.0 + 1e-6),
        centre.x + half * (1.0 + 1e-6),
    );
    minima(curve, centre, a, b, &mut |x| {
        let [y, slope, ..] = curve.jet(x);
        let length = slope.hypot(1.0);
        let n = Vector2::new(-slope, 1.0) / length;
        let away = centre - Vector2::new(x, y);
        let distance = away.norm();
        let side = away.dot(&n);
        let limit = if is_inside { f64::INFINITY } else { reach };
        if distance <= limit && (side < 0.0) == is_inside {
            out.push(Facing {
                foot: Vector2::new(x, y),
                n,
                distance: side,
            });
        }
    });
    if is_inside {
        keep_nearest(out, begin);
    }
}

/// Of what was appended since `begin`, keeps the shallowest.
pub(super) fn keep_nearest(out: &mut Vec<Facing>, begin: usize) {
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

/// Cells narrower than this share of the window are not halved any more.
const NARROWEST: f64 = 1e-9;

/// Calls `found` with every minimum of the distance in [a, b], in the order of x.
fn minima(curve: &dyn Curve, centre: &Vector2<f64>, a: f64, b: f64, found: &mut dyn FnMut(f64)) {
    let narrowest = NARROWEST * (b - a);
    // A minimum: g is below zero before and not after. Cells come in the order of x.
    let mut cells = vec![(a, b)];
    while let Some((a, b)) = cells.pop() {
        let (mid, half) = (0.5 * (a + b), 0.5 * (b - a));
        let (value, rate) = gradient(curve, centre, mid);
        let [b1, b2, b3] = curve.bounds(a, b);
        let above = (curve.jet(mid)[0] - centre.y).abs() + b1 * half;
        let steepest = 1.0 + b1 * b1 + above * b2;
        if value.abs() > steepest * half {
            continue;
        }
        // g'' = 3 f' f'' + (f − c_y) f'''.
        let bend = 3.0 * b1 * b2 + above * b3;
        let is_monotone = rate.abs() > bend * half;
        if !is_monotone && b - a > narrowest {
            cells.push((mid, b));
            cells.push((a, mid));
            continue;
        }
        let (low, high) = (gradient(curve, centre, a).0, gradient(curve, centre, b).0);
        if low < 0.0 && high >= 0.0 {
            found(root(curve, centre, a, b));
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

    fn all(ground: &dyn Ground, c: [f64; 2], reach: f64) -> Vec<Facing> {
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
        for (ground, shift) in [(&sine as &dyn Ground, 0.0), (&spline, 11.0)] {
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

    #[test]
    fn data_that_is_no_function_is_refused() {
        let refused = Spline::new(&[0.0, 1.0, 1.0], &[0.0; 3]).expect_err("refused");
        assert_eq!(refused.field(), "x[2]");
        let refused = Spline::new(&[0.0, 1.0], &[0.0, f64::NAN]).expect_err("refused");
        assert_eq!(refused.field(), "y[1]");
        assert_eq!(
            Spline::new(&[0.0], &[0.0]).expect_err("refused").field(),
            "x"
        );
        assert_eq!(
            Spline::new(&[0.0, 1.0], &[0.0])
                .expect_err("refused")
                .field(),
            "y"
        );
        assert_eq!(
            Sine::new(1.0, 0.0, 0.0, 0.0).expect_err("refused").field(),
            "wavelength"
        );
        assert_eq!(
            Line::new(f64::INFINITY, 0.0).expect_err("refused").field(),
            "slope"
        );
    }
}
