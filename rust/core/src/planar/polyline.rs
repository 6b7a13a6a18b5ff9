//! Grounds of straight pieces: steps, kerbs, ramps. Corners are points of contact.

use nalgebra::Vector2;

use super::curve::{check_points, keep_nearest};
use super::error::PlanarError;
use super::ground::{PlanarFacing, PlanarGround, keep_few, keep_if};
use crate::geometry::Support;
use crate::quantity::{Demand, PLACES, QuantityError, within};
use crate::scalar::elementary::hypot;

/// Straight pieces between points, continued beyond the ends with the slope
/// of the last pieces (level where those are vertical).
///
/// Two consecutive points may share x: a vertical face.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyline {
    points: Vec<Vector2<f64>>,
}

impl Polyline {
    /// `x`: not decreasing, m. `y`: heights, m.
    ///
    /// # Errors
    /// Fewer than two points, other lengths, entries that are not finite, x
    /// that decreases, or the same point twice.
    pub fn new(x: &[f64], y: &[f64]) -> Result<Self, PlanarError> {
        check_points(x, y)?;
        for i in 1..x.len() {
            let (dx, dy) = (x[i] - x[i - 1], y[i] - y[i - 1]);
            if dx < 0.0 {
                return Err(PlanarError::NotAFunction {
                    index: i,
                    demand: "at least",
                    value: x[i],
                });
            }
            if hypot(dx, dy) <= 0.0 {
                return Err(PlanarError::RepeatedPoint {
                    index: i,
                    value: y[i],
                });
            }
        }
        let points = x.iter().zip(y).map(|(x, y)| Vector2::new(*x, *y)).collect();
        Ok(Self { points })
    }

    /// Level ground with a step up (or down) of `height` at x.
    ///
    /// # Errors
    /// A number that is not finite, or a height of zero.
    pub fn step(x: f64, height: f64) -> Result<Self, PlanarError> {
        within(|| "x".to_owned(), x, PLACES)?;
        within(|| "height".to_owned(), height, PLACES)?;
        if height.abs() <= 0.0 {
            return Err(QuantityError::new("height", Demand::Positive, height).into());
        }
        Self::new(&[x - 1.0, x, x, x + 1.0], &[0.0, 0.0, height, height])
    }

    /// The points, m.
    #[must_use]
    pub fn points(&self) -> &[Vector2<f64>] {
        &self.points
    }

    /// Unit direction of piece i along the curve; pieces -1 and n-1 are the
    /// continuations (given as 0 and n here).
    fn direction(&self, i: usize) -> Vector2<f64> {
        let last = self.points.len() - 1;
        let d = if i == 0 {
            self.points[1] - self.points[0]
        } else if i > last {
            self.points[last] - self.points[last - 1]
        } else {
            self.points[i] - self.points[i - 1]
        };
        if (i == 0 || i > last) && d.x <= 0.0 {
            return Vector2::x();
        }
        d.normalize()
    }

    /// All points that face the centre, whatever their distance and side.
    fn candidates(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<PlanarFacing>) {
        let n_points = self.points.len();
        // Only pieces within reach in x; they are in the order of x.
        let first = self.points.partition_point(|p| p.x < centre.x - reach);
        let last = self.points.partition_point(|p| p.x <= centre.x + reach);
        for i in first..=last {
            // Piece i runs to point i.
            let t = self.direction(i);
            let (from, to) = if i == 0 {
                (self.points[0], self.points[0])
            } else if i == n_points {
                (self.points[n_points - 1], self.points[n_points - 1])
            } else {
                (self.points[i - 1], self.points[i])
            };
            let n = Vector2::new(-t.y, t.x);
            let after = (centre - from).dot(&t);
            let before = (centre - to).dot(&t);
            let is_after = i == 0 || after > 0.0;
            let is_before = i == n_points || before < 0.0;
            if is_after && is_before {
                let distance = (centre - from).dot(&n);
                out.push(PlanarFacing {
                    foot: centre - n * distance,
                    n,
                    distance,
                });
            }
            if i < n_points {
                self.corner(i, centre, &t, out);
            }
        }
    }

    /// Corner i, if it faces the centre: `before`, the direction of the piece that leads to it.
    fn corner(
        &self,
        i: usize,
        centre: &Vector2<f64>,
        before: &Vector2<f64>,
        out: &mut Vec<PlanarFacing>,
    ) {
        let after = self.direction(i + 1);
        let away = centre - self.points[i];
        let is_between = away.dot(before) >= 0.0 && away.dot(&after) <= 0.0;
        let is_behind = away.dot(before) <= 0.0 && away.dot(&after) >= 0.0;
        let turn = before.perp(&after);
        let distance = away.norm();
        let bisector = Vector2::new(-before.y - after.y, before.x + after.x);
        let straight = bisector
            .try_normalize(f64::EPSILON)
            .unwrap_or_else(Vector2::y);
        if is_between && turn <= 0.0 {
            // Convex, seen from above: the centre is in the cone of its normals.
            let n = if distance > 0.0 {
                away / distance
            } else {
                straight
            };
            out.push(PlanarFacing {
                foot: self.points[i],
                n,
                distance,
            });
        } else if is_between || (is_behind && turn > 0.0) {
            // Concave: nearest from inside the ground only.
            let inside = away.dot(&straight) < 0.0;
            if inside && distance > 0.0 {
                out.push(PlanarFacing {
                    foot: self.points[i],
                    n: -away / distance,
                    distance: -distance,
                });
            }
        }
    }
}

impl PlanarGround for Polyline {
    fn height(&self, x: f64) -> f64 {
        let i = self.points.partition_point(|p| p.x <= x);
        let t = self.direction(i);
        let from = self.points[i.saturating_sub(1)];
        let mut y = from.y + (x - from.x) * t.y / t.x;
        // At a vertical face: the upper end. Points are in the order of x.
        let here = self.points[..i].iter().rev();
        for p in here.take_while(|p| p.x >= x) {
            y = y.max(p.y);
        }
        y
    }

    fn below(&self, centre: &Vector2<f64>) -> PlanarFacing {
        let i = self.points.partition_point(|p| p.x <= centre.x);
        let t = self.direction(i);
        let n = Vector2::new(-t.y, t.x);
        let y = self.height(centre.x);
        PlanarFacing {
            foot: Vector2::new(centre.x, y),
            n,
            distance: (centre.y - y) * n.y,
        }
    }
}

impl Support<2> for Polyline {
    fn facing(&self, centre: &Vector2<f64>, reach: f64, out: &mut Vec<PlanarFacing>) {
        let begin = out.len();
        let depth = (self.height(centre.x) - centre.y).max(0.0);
        self.candidates(centre, reach.max(depth) * (1.0 + 1e-9), out);
        let mut nearest = f64::INFINITY;
        for candidate in &out[begin..] {
            if candidate.distance.abs() < nearest.abs() {
                nearest = candidate.distance;
            }
        }
        if nearest < 0.0 {
            // From inside only the way out counts, and it leads through the nearest point.
            keep_if(out, begin, |f| f.distance < 0.0);
            keep_nearest(out, begin);
        } else {
            keep_if(out, begin, |f| (0.0..=reach).contains(&f.distance));
            keep_few(out, begin);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(ground: &Polyline, c: [f64; 2], reach: f64) -> Vec<PlanarFacing> {
        let mut out = Vec::new();
        ground.facing(&Vector2::new(c[0], c[1]), reach, &mut out);
        out
    }

    #[test]
    fn a_wheel_before_a_step_touches_floor_and_face_or_floor_and_edge() {
        let step = Polyline::step(1.0, 0.1).expect("sound");
        // Centre above the edge's height: the edge is a corner.
        let found = all(&step, [0.75, 0.3], 0.35);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].n - Vector2::y()).norm() < 1e-15);
        assert!((found[1].foot - Vector2::new(1.0, 0.1)).norm() < 1e-15);
        assert!((found[1].distance - 0.25_f64.hypot(0.2)).abs() < 1e-15);
        // Below it: the vertical face.
        let found = all(&step, [0.95, 0.05], 0.06);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(
            (found[1].n + Vector2::x()).norm() < 1e-15 && (found[1].distance - 0.05).abs() < 1e-15
        );
        // Away from it and on top of it: one.
        assert_eq!(all(&step, [-5.0, 0.2], 0.25).len(), 1);
        assert_eq!(all(&step, [7.0, 0.2], 0.25).len(), 1);
        // Inside the kerb: out by the shortest way.
        let found = all(&step, [1.02, 0.05], 0.2);
        assert!(
            found.len() == 1 && (found[0].n + Vector2::x()).norm() < 1e-15,
            "{found:?}"
        );
        assert!((found[0].distance + 0.02).abs() < 1e-15);
    }

    #[test]
    fn the_nearest_point_is_that_of_a_sampling() {
        let ground = Polyline::new(
            &[-1.0, 0.0, 0.4, 0.4, 1.0, 2.0],
            &[0.0, 0.3, 0.0, 0.5, 0.4, 0.9],
        )
        .expect("sound");
        let mut samples = Vec::new();
        let mut ends = ground.points().to_vec();
        ends.insert(0, Vector2::new(-5.0, -1.2));
        ends.push(Vector2::new(6.0, 2.9));
        for pair in ends.windows(2) {
            for k in 0..=4000 {
                samples.push(pair[0] + (pair[1] - pair[0]) * (f64::from(k) / 4000.0));
            }
        }
        for i in 0..400 {
            let i = f64::from(i);
            let c = Vector2::new(-1.5 + 0.01 * i, 0.4 + 0.8 * (1.7 * i).sin());
            let sampled = samples
                .iter()
                .map(|s| (c - s).norm())
                .fold(f64::INFINITY, f64::min);
            let found = all(&ground, [c.x, c.y], 1.5);
            let nearest = found
                .iter()
                .map(|f| f.distance.abs())
                .fold(f64::INFINITY, f64::min);
            assert!(
                (-1e-12..1e-5).contains(&(sampled - nearest)),
                "{c:?} {nearest} {sampled} {found:?}"
            );
            let is_inside = c.y < ground.height(c.x);
            for f in &found {
                assert_eq!(f.distance < 0.0, is_inside, "{c:?} {f:?}");
                assert!((c - f.foot - f.n * f.distance).norm() < 1e-12);
            }
        }
    }
}
