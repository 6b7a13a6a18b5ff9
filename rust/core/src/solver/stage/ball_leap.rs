//! Leaps: where the impulses of [`super::ball_sweeps`] drift, they go on along their drift at once.
//!
//! A heavy machine on light balls leaves the sweeps a slow direction. A chain of balls that bears
//! the machine, or that no longer should, changes by about the mass of one ball times a residual
//! velocity in each sweep, and may have to change by the machine's weight. Along the drift
//! `d = p − p_anchor` of the last sweeps the energy `½ pᵀWp + pᵀq` is least at the share
//! `−dᵀu / dᵀWd`, `u = Wp + q`. With the velocities `v` that belong to p, and `v_d` to d, both
//! products are sums over balls: `dᵀWd = v_dᵀ M v_d` and `dᵀu = dᵀq + v_dᵀ M v`.
//!
//! The share ends where the first contact that loses much opens. The next sweep puts impulses
//! outside their cones back.

use super::ball_rows::{Ball, BallRow, MachineRow};
use crate::spatial::space::dot;

/// Largest share.
const LONGEST: f64 = 1e3;

/// Contacts whose normal impulse falls by less than this part of the largest fall do not end a
/// leap. 0.01, 0.1, 0.3 and 1 take 300, 252, 249 and 252 sweeps a step under a rover at Earth's
/// gravity, and 211, 231, 193 and 242 at Mars'.
const SMALL: f64 = 0.3;

/// Impulses and velocities at the start of a drift.
#[derive(Clone, Debug, Default)]
pub(super) struct Anchor {
    round: Vec<[f64; 3]>,
    machine: Vec<[f64; 3]>,
    balls: Vec<Ball>,
    own: Vec<f64>,
}

fn difference(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The normal parts of impulses and of their drift, of a list of contacts.
fn normals(
    drifts: impl Iterator<Item = ([f64; 3], [f64; 3], [f64; 3])>,
) -> impl Iterator<Item = (f64, f64)> {
    drifts.map(|(n, p, d)| (dot(&n, &p), dot(&n, &d)))
}

impl Anchor {
    /// Remembers where a drift starts.
    pub(super) fn set(
        &mut self,
        (rows, machine): (&[BallRow], &[MachineRow]),
        balls: &[Ball],
        own: &[f64],
    ) {
        self.round.clear();
        self.round.extend(rows.iter().map(|row| row.p));
        self.machine.clear();
        self.machine.extend(machine.iter().map(|row| row.p));
        self.balls.clear();
        self.balls.extend_from_slice(balls);
        self.own.clear();
        self.own.extend_from_slice(own);
    }

    /// The share of the drift that is added to it; None where energy falls no further along it.
    fn share(
        &self,
        (rows, machine): (&[BallRow], &[MachineRow]),
        balls: &[Ball],
        own: &[f64],
    ) -> Option<f64> {
        let (mut slope, mut curvature) = (0.0, 0.0);
        for (now, before) in balls.iter().zip(&self.balls) {
            for (now, before) in [(now.linear, before.linear), (now.turning, before.turning)] {
                if now[3] > 0.0 {
                    let (v, before) = ([now[0], now[1], now[2]], [before[0], before[1], before[2]]);
                    let d = difference(&v, &before);
                    slope += dot(&d, &v) / now[3];
                    curvature += dot(&d, &d) / now[3];
                }
            }
        }
        for (now, before) in own.iter().zip(&self.own) {
            slope += (now - before) * now;
            curvature += (now - before).powi(2);
        }
        let round = || {
            let drifts = rows.iter().zip(&self.round);
            drifts.map(|(row, before)| (row.n, row.p, difference(&row.p, before)))
        };
        let of_machine = || {
            let drifts = machine.iter().zip(&self.machine);
            drifts.map(|(row, before)| ([1.0, 0.0, 0.0], row.p, difference(&row.p, before)))
        };
        slope += rows
            .iter()
            .zip(round())
            .map(|(row, (.., d))| dot(&row.q, &d))
            .sum::<f64>();
        let machine_slopes = machine.iter().zip(of_machine());
        slope += machine_slopes
            .map(|(row, (.., d))| dot(&row.q, &d))
            .sum::<f64>();
        let wanted = -slope / curvature;
        // A NaN is no share either.
        if !(wanted > 0.0 && wanted.is_finite()) {
            return None;
        }
        let all = || normals(round()).chain(normals(of_machine()));
        let largest = all().map(|(_, d)| -d).fold(0.0, f64::max);
        let falling = all().filter(|(_, d)| -d > SMALL * largest);
        let opens = falling.map(|(p, d)| p / -d).fold(LONGEST, f64::min);
        Some(wanted.min(opens))
    }

    /// Adds a share of the drift to impulses and velocities, and to those of the previous sweep,
    /// so that the next one extrapolates nothing; whether there was any.
    pub(super) fn leap(
        &self,
        (rows, machine): (&mut [BallRow], &mut [MachineRow]),
        balls: &mut [Ball],
        own: &mut [f64],
    ) -> bool {
        let Some(share) = self.share((rows, machine), balls, own) else {
            return false;
        };
        let go_on = |x: &mut [f64], before: &[f64]| {
            for (x, before) in x.iter_mut().zip(before) {
                *x += share * (*x - before);
            }
        };
        for (row, before) in rows.iter_mut().zip(&self.round) {
            go_on(&mut row.p, before);
            row.before = row.p;
        }
        for (row, before) in machine.iter_mut().zip(&self.machine) {
            go_on(&mut row.p, before);
            row.before = row.p;
        }
        for (ball, before) in balls.iter_mut().zip(&self.balls) {
            go_on(&mut ball.linear[..3], &before.linear[..3]);
            go_on(&mut ball.turning[..3], &before.turning[..3]);
        }
        go_on(own, &self.own);
        true
    }
}
