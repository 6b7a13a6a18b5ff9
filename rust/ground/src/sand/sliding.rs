//! How far the pieces of a wheel have slid over the soil since they entered it.
//!
//! The law of Janosi and Hanamoto takes the shear displacement j. A piece on a ring of radius ρ at
//! the angle θ from the lowest point has turned there from θ₁, where the ring enters the soil, so
//!
//! ```text
//! j(θ) = ∫ v dt = ∫ v dθ/ω = ρ [(θ₁ − θ) − (1 − s) (sin θ₁ − sin θ)],    1 − s = V/(ρ ω)
//! ```
//!
//! along the rim (Wong and Reece 1967), and in the same way across it, v being the velocity of
//! the piece. Velocities are those that the sand remembers ([`super::memory`]): of j, only their
//! ratio counts.
//!
//! A wheel that turns the other way enters at −θ₁. A wheel that hardly turns has no such side: with
//! `u = φ R/SLOW`, where φ is the rotation that the sand remembers, the side and 1/|u| become
//! polynomials for |u| < 1. So j is smooth in what the sand remembers. Of a locked wheel it is
//! proportional to its displacement: such a wheel is held as by a spring, and rests on a slope.
//!
//! # The surface that presses
//!
//! In steady motion the stress ends at the lowest point. A wheel that sinks presses on both sides,
//! a wheel that is lifted on neither. In general, the surface within a right angle of the *front*
//! presses. The front is the direction of travel in the wheel's plane, plus a part of the speed of
//! the rim: a wheel that spins in place has a front, too. Without travel and rotation it points
//! down.
//!
//! Source: Wong and Reece 1967, *Prediction of rigid wheel performance based on the analysis of
//! soil–wheel stresses*.

use nalgebra::Vector3;

use friction_contact::scalar::elementary::{acos, atan2, sin_cos};
use friction_contact::scalar::{Lane, Vec3};

/// Speed of the rim, relative to that of the wheel, below which a wheel hardly turns: the law is
/// the published one from a slip of −1.29 on.
const SLOW: f64 = 0.4;

/// Way of a piece per displacement of a locked wheel, in units of half the chord of its arc.
const LOCKED: f64 = 1.0;

/// Part of the speed of the rim in the front. Steady motion has the same front with any part.
const SPINNING: f64 = 0.5;

/// Size of the front, relative to that of the memory, below which it points down. In steady motion
/// the surface that presses then ends within 0.001 rad of the lowest point.
const NO_FRONT: f64 = 0.05;

/// Least sine of the angle at which a rim enters the sand, for the change of that angle with the
/// depth.
const STEEP: f64 = 0.05;

/// Length below which a memory is none.
const TINY: f64 = 1e-12;

/// Motion of a wheel in its own axes (down, along, axle) as far as sliding depends on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rolling {
    shift: Vector3<f64>,
    turn: Vector3<f64>,
    /// From −1 to 1: which end of an arc enters the sand; and its derivative by the turn.
    pub entry: f64,
    entry_by_turn: f64,
    /// Inverse of the turn, and its relative change with the turn.
    per_turn: f64,
    fades: f64,
    /// Change of the depth at the end of an arc with the depth of the wheel.
    level: f64,
    /// 1 − V/(R ω), from 0 to 1; 0 for a wheel that hardly turns.
    pub slip: f64,
    /// Angle of greatest stress, relative to the angle at which the rim enters.
    pub greatest: Option<f64>,
    /// Direction of the middle of the surface that presses, down and along.
    pub front: [f64; 2],
    /// Change of its angle by the shift down and along, and by the turn.
    pub front_turns: [f64; 3],
}

/// The way of pieces over the soil since they entered, m, along the rim and across it.
#[derive(Clone, Copy, Debug)]
pub struct Slid<T> {
    /// Unit vectors along the rim and across it.
    pub tangents: [Vec3<T>; 2],
    /// m.
    pub way: [T; 2],
    /// Derivatives by the depth.
    pub by_depth: [T; 2],
    /// Derivatives by the six numbers of the memory.
    pub by_memory: [[T; 2]; 6],
    /// How much deeper the place is whose pressure acts on them, m.
    pub deeper: T,
}

impl<T: Lane> Slid<T> {
    /// None.
    #[inline(always)]
    pub(super) fn none(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            tangents: [Vec3::splat(token, [0.0; 3]); 2],
            way: [zero; 2],
            by_depth: [zero; 2],
            by_memory: [[zero; 2]; 6],
            deeper: zero,
        }
    }
}

/// Points of rings: cosine and sine of their angles, cosine of the angles at which their rings
/// leave the sand, radii, offsets along the axle, and components of their normals.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnRing<T> {
    pub angle: [T; 2],
    pub end: T,
    pub radius: T,
    pub offset: T,
    pub normal: [T; 2],
}

/// 1/|u| and its derivative, as they are on the module's page.
fn inverse(u: f64) -> [f64; 2] {
    if u.abs() >= 1.0 {
        return [1.0 / u.abs(), -1.0 / (u * u.abs())];
    }
    // The even polynomial of degree 4 that has this value at 0, and at 1 value and slope of 1/u.
    let (square, least) = (u * u, SLOW * LOCKED);
    let [b, d] = [2.5 - 2.0 * least, least - 1.5];
    [
        least + square * (b + square * d),
        u * (2.0 * b + 4.0 * square * d),
    ]
}

/// The sign of u and its derivative, as they are on the module's page.
fn side(u: f64) -> [f64; 2] {
    if u.abs() >= 1.0 {
        return [u.signum(), 0.0];
    }
    [0.5 * u * (3.0 - u * u), 1.5 * (1.0 - u * u)]
}

/// The front of a wheel with a shift and a displacement of its rim, and the change of its angle by
/// the shift down and along and by the rim. `size`: of the memory.
fn front(shift: &Vector3<f64>, rim: f64, size: f64) -> ([f64; 2], [f64; 3]) {
    let along = shift.y - SPINNING * rim;
    let least = NO_FRONT * size.max(TINY);
    let square = least * least;
    let share = 1.0 / (square + along * along);
    let down = shift.x + least * square * share;
    let by_along = -2.0 * least * square * share * share * along;
    let by_size = NO_FRONT * square * share * (3.0 - 2.0 * square * share);
    let per = 1.0 / (down * down + along * along).max(TINY * TINY);
    let per_size = by_size / size.max(TINY);
    let by_down = -along * per;
    let by_shift = (down - along * by_along) * per;
    let turns = [
        by_down * (1.0 + per_size * shift.x),
        by_shift + by_down * per_size * shift.y,
        -SPINNING * by_shift + by_down * per_size * rim,
    ];
    ([down, along], turns)
}

impl Rolling {
    /// Motion of a wheel of a radius (m) from its memory (shift and turn, in its own axes) and the
    /// size of that memory. `level`: sine of the angle between axle and normal of the bed.
    pub fn new(
        (shift, turn): (Vector3<f64>, Vector3<f64>),
        (radius, size): (f64, f64),
        level: f64,
    ) -> Self {
        let unit = SLOW / radius;
        let u = turn.z / unit;
        let ([inverse, falls], [sign, turning]) = (inverse(u), side(u));
        let per_turn = inverse / unit;
        let carried = -shift.y * sign * per_turn / radius;
        let (front, [down, along, rim]) = front(&shift, turn.z * radius, size);
        Self {
            shift,
            turn,
            entry: -sign,
            entry_by_turn: -turning / unit,
            per_turn,
            fades: falls / (inverse * unit),
            level,
            slip: sign * sign * (1.0 - carried).clamp(0.0, 1.0),
            greatest: None,
            front,
            front_turns: [down, along, rim * radius],
        }
    }

    /// The way of points over the soil since they entered.
    #[inline(always)]
    pub fn slid<T: Lane>(&self, at: &OnRing<T>) -> Slid<T> {
        let number = |value: f64| at.end.like(value);
        let ([cos, sin], [c, a]) = (at.angle, at.normal);
        let (zero, one, o) = (number(0.0), number(1.0), at.offset);
        let (mut theta, mut theta_end) = (zero, zero);
        for lane in 0..T::LANES {
            theta.set(lane, atan2(sin.get(lane), cos.get(lane)));
            theta_end.set(lane, acos(at.end.get(lane)));
        }
        let sin_end = (one - at.end * at.end).max(zero).sqrt();
        // What angle, sine and cosine have changed by since the piece entered.
        let entry = number(self.entry);
        let d_theta = theta_end - entry * theta;
        let d_sin = sin_end - entry * sin;
        let d_cos = entry * (at.end - cos);
        let per = number(self.per_turn);
        let (ways, radius) = ([d_theta * per, d_sin * per, d_cos * per], at.radius);
        let combined = |[d_theta, d_sin, d_cos]: [T; 3]| {
            let A = number(self.shift.x) + number(self.turn.y) * o;
            let B = number(self.shift.y) - number(self.turn.x) * o;
            let across = number(self.shift.z) * d_theta
                - radius * (number(self.turn.x) * d_cos + number(self.turn.y) * d_sin);
            let along = number(self.turn.z) * radius * d_theta + B * d_sin + A * d_cos;
            [along, c * across - a * (A * d_sin - B * d_cos)]
        };
        let way = combined(ways);
        let turning = number(self.entry_by_turn) * per;
        let by_entry = combined([-theta * turning, -sin * turning, (at.end - cos) * turning]);
        let mut slid = Slid {
            tangents: [Vec3::new(-sin, cos, zero), Vec3::new(-a * cos, -a * sin, c)],
            way,
            by_depth: [zero; 2],
            by_memory: by_memory(ways, at),
            deeper: self.deeper(at, theta, theta_end),
        };
        for k in 0..2 {
            slid.by_memory[5][k] += by_entry[k] + way[k] * number(self.fades);
        }
        let turned = per / (sin_end.max(number(STEEP)) * radius * number(self.level.max(TINY)));
        slid.by_depth = combined([turned, at.end * turned, -(entry * sin_end * turned)]);
        slid
    }

    /// How much deeper than points the places are whose pressure acts on them: behind the angle of
    /// greatest stress, those as far before it, relative to both ends.
    #[inline(always)]
    fn deeper<T: Lane>(&self, at: &OnRing<T>, theta: T, end: T) -> T {
        let (zero, number) = (end.like(0.0), |value: f64| end.like(value));
        let Some(share) = self.greatest else {
            return zero;
        };
        let forward = theta * number(1.0_f64.copysign(self.entry));
        let is_behind = forward.lt(end * number(share));
        let moved = end - forward.max(zero) * number((1.0 - share) / share);
        let mut cos = zero;
        for lane in 0..T::LANES {
            cos.set(lane, sin_cos(moved.get(lane)).1);
        }
        let deeper = (cos - at.angle[0]) * at.radius * number(self.level);
        // A wheel that hardly turns presses as a plate does.
        T::select(is_behind, deeper * number(self.entry * self.entry), zero)
    }
}

/// Derivatives of the way by the six numbers of the memory, the side of entry held.
#[inline(always)]
fn by_memory<T: Lane>([d_theta, d_sin, d_cos]: [T; 3], at: &OnRing<T>) -> [[T; 2]; 6] {
    let ([c, a], o, radius) = (at.normal, at.offset, at.radius);
    let zero = o.like(0.0);
    [
        [d_cos, -(a * d_sin)],
        [d_sin, a * d_cos],
        [zero, c * d_theta],
        [-(o * d_sin), -(a * o + c * radius) * d_cos],
        [o * d_cos, -(a * o + c * radius) * d_sin],
        [radius * d_theta, zero],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 0.1;

    fn point(theta: f64) -> OnRing<f64> {
        let diagonal = std::f64::consts::FRAC_1_SQRT_2;
        OnRing {
            angle: [theta.cos(), theta.sin()],
            end: 0.5_f64.cos(),
            radius: RADIUS,
            offset: 0.03,
            normal: [diagonal, diagonal],
        }
    }

    fn rolling(six: [f64; 6]) -> Rolling {
        let [a, b, c, d, e, f] = six;
        let parts = (Vector3::new(a, b, c), Vector3::new(d, e, f));
        Rolling::new(parts, (RADIUS, 1.0), 1.0)
    }

    /// The integral of Wong and Reece in closed form, at slips of a driven and of a drawn wheel,
    /// forward and backward.
    #[test]
    fn a_piece_has_slid_since_it_entered() {
        for (slip, sign) in [(0.0, 1.0), (0.2, 1.0), (0.9, 1.0), (-2.0, 1.0), (0.2, -1.0)] {
            let omega = 7.0 * sign;
            let found = rolling([0.0, RADIUS * omega * (1.0 - slip), 0.0, 0.0, 0.0, -omega]);
            for theta in [-0.1, 0.2, 0.45] {
                let way = found.slid(&point(sign * theta)).way[0];
                let entered: f64 = 0.5;
                let turned = entered - theta - (1.0 - slip) * (entered.sin() - theta.sin());
                let exact = -sign * RADIUS * turned;
                assert!((way - exact).abs() < 1e-14, "{slip} {theta}: {way} {exact}");
            }
        }
    }

    /// Derivatives of the way by the memory match finite differences, even for a wheel that hardly
    /// turns.
    #[test]
    fn the_slopes_are_derivatives() {
        for turn in [-7.0, 4.0, -0.4, 0.3] {
            let start = [0.1, 0.5, 0.2, 0.3, -0.4, turn];
            let found = rolling(start).slid(&point(0.2));
            for k in 0..6 {
                let moved = |sign: f64| {
                    let mut six = start;
                    six[k] += sign * 1e-6;
                    rolling(six).slid(&point(0.2)).way
                };
                let (up, down) = (moved(1.0), moved(-1.0));
                for n in 0..2 {
                    let change = (up[n] - down[n]) / 2e-6;
                    let error = (found.by_memory[k][n] - change).abs();
                    assert!(
                        error < 1e-7 * (1.0 + change.abs()),
                        "{turn} {k} {n}: {error}"
                    );
                }
            }
        }
    }

    /// Derivatives of the front's angle match finite differences for wheels that roll, spin, sink
    /// and are lifted.
    #[test]
    fn the_front_turns_as_its_slopes_say() {
        for [down, along, turn] in [
            [0.0, 0.7, -7.0],
            [0.3, 0.1, -9.0],
            [0.9, 0.02, 0.1],
            [-0.5, -0.4, 3.0],
        ] {
            let size = |x: [f64; 3]| (x[0] * x[0] + x[1] * x[1] + (RADIUS * x[2]).powi(2)).sqrt();
            let angle = |x: [f64; 3]| {
                let parts = (Vector3::new(x[0], x[1], 0.0), Vector3::new(0.0, 0.0, x[2]));
                let [down, along] = Rolling::new(parts, (RADIUS, size(x)), 1.0).front;
                along.atan2(down)
            };
            let start = [down, along, turn];
            let parts = (Vector3::new(down, along, 0.0), Vector3::new(0.0, 0.0, turn));
            let found = Rolling::new(parts, (RADIUS, size(start)), 1.0).front_turns;
            for k in 0..3 {
                let moved = |sign: f64| {
                    let mut x = start;
                    x[k] += sign * 1e-6;
                    angle(x)
                };
                let change = (moved(1.0) - moved(-1.0)) / 2e-6;
                let error = (found[k] - change).abs();
                assert!(
                    error < 1e-6 * (1.0 + change.abs()),
                    "{start:?} {k}: {error}"
                );
            }
        }
    }

    #[test]
    fn the_slope_by_the_depth_is_that_by_the_end() {
        let start = rolling([0.1, 0.5, 0.2, 0.3, -0.4, -7.0]);
        let found = start.slid(&point(0.2));
        let moved = |depth: f64| {
            let end = point(0.2).end - depth / RADIUS;
            start.slid(&OnRing { end, ..point(0.2) }).way
        };
        let (up, down) = (moved(1e-7), moved(-1e-7));
        for n in 0..2 {
            let change = (up[n] - down[n]) / 2e-7;
            assert!((found.by_depth[n] - change).abs() < 1e-6 * (1.0 + change.abs()));
        }
    }

    /// A wheel that starts to turn either way, or stops.
    #[test]
    fn the_way_is_continuous_in_the_turn() {
        let at = |turn: f64| {
            rolling([0.3, 0.5, 0.2, 0.3, -0.4, turn])
                .slid(&point(0.2))
                .way
        };
        for turn in [-1.0, 0.0, 1.0] {
            let (before, after) = (at(turn - 1e-9), at(turn + 1e-9));
            assert!((before[0] - after[0]).abs() + (before[1] - after[1]).abs() < 1e-6);
        }
    }
}
