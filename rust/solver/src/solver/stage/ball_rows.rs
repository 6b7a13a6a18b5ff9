//! Contact rows of [`super::ball_sweeps`]: all data that a visit reads and writes, side by side.
//!
//! Velocities and impulses are vectors of the world, so that a visit needs no tangents. With
//! `R = r_a ω_a + r_b ω_b` the two rims that touch along n move apart with
//!
//! ```text
//! u = v_a − v_b + n × R
//! ```
//!
//! An impulse p on the first changes `v` by `± p/m` and `r ω` by `(p × n) r²/J`. W is diagonal in
//! the normal and the tangent plane, so that with all others fixed the law's answer is a clamp of
//! the normal part and a shortening of the tangential one.

#![allow(clippy::inline_always)] // a visit is one piece of code: calls cost as much as sums

use crate::law::coulomb::Coulomb;
use crate::law::one_contact::solve_one_contact;
use crate::law::rolling::RollingFriction;
use crate::problem::{BodyPairs, RollingContact, RoundPair};
use crate::space::dot;

/// A ball: its velocity with 1/m, and `r ω` with `r²/J`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(super) struct BallVelocity {
    pub linear: [f64; 4],
    pub turning: [f64; 4],
}

/// A contact of two balls, or of one with a fixed body: two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct BallRow {
    /// Places of the balls, from the block's first.
    pub bodies: [u32; 2],
    pub mu: f64,
    pub n: [f64; 3],
    /// `1/W_NN`, `1/W_TT`, kg.
    pub inverse: [f64; 2],
    pub q: [f64; 3],
    pub p: [f64; 3],
    /// p of the previous sweep.
    pub before: [f64; 3],
}

#[inline(always)]
fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// A vector of a contact's frame in the world's axes.
#[inline]
fn to_world(frame: &[[f64; 3]; 3], x: &[f64; 3]) -> [f64; 3] {
    let mut out = [0.0; 3];
    for k in 0..3 {
        out[k] = frame[0][k] * x[0] + frame[1][k] * x[1] + frame[2][k] * x[2];
    }
    out
}

/// A vector of the world in a contact's frame.
#[inline]
pub(super) fn to_frame(frame: &[[f64; 3]; 3], x: &[f64; 3]) -> [f64; 3] {
    [dot(&frame[0], x), dot(&frame[1], x), dot(&frame[2], x)]
}

fn invert(w: f64) -> f64 {
    if w > 0.0 { 1.0 / w } else { 0.0 }
}

/// Violation of the law by one contact and its weight.
#[derive(Clone, Copy)]
pub(super) struct Judged {
    /// Square, (m/s)².
    pub square: f64,
    /// Mass of the contact, kg.
    pub mass: f64,
    /// pᵀu, pᵀq, J.
    pub work: f64,
    pub free: f64,
}

/// 3 over the trace of W.
pub(super) fn mass_of([i_n, i_t]: [f64; 2]) -> f64 {
    let sum = 2.0 * i_n + i_t;
    if sum > 0.0 {
        3.0 * i_n * i_t / sum
    } else {
        1.0
    }
}

impl BallRow {
    pub(super) fn new(
        pair: &RoundPair<3>,
        bodies: [u32; 2],
        q: &[f64; 3],
        mu: f64,
        p: &[f64; 3],
    ) -> Self {
        let p = to_world(&pair.frame, p);
        Self {
            bodies,
            mu,
            n: pair.frame[0],
            inverse: pair.block().map(invert),
            q: to_world(&pair.frame, q),
            p,
            before: p,
        }
    }

    /// u.
    #[inline(always)]
    pub(super) fn velocity(&self, balls: &[BallVelocity]) -> [f64; 3] {
        let [a, b] = self.bodies;
        let (a, b) = (&balls[a as usize], &balls[b as usize]);
        let mut rim = [0.0; 3];
        for k in 0..3 {
            rim[k] = a.turning[k] + b.turning[k];
        }
        let mut u = cross(&self.n, &rim);
        for k in 0..3 {
            u[k] += a.linear[k] - b.linear[k] + self.q[k];
        }
        u
    }

    /// The effect of an impulse.
    #[inline(always)]
    pub(super) fn add(&self, p: &[f64; 3], balls: &mut [BallVelocity]) {
        let turn = cross(p, &self.n);
        let [a, b] = self.bodies;
        let ball = &mut balls[a as usize];
        let (c, s) = (ball.linear[3], ball.turning[3]);
        for k in 0..3 {
            ball.linear[k] += c * p[k];
            ball.turning[k] += s * turn[k];
        }
        let ball = &mut balls[b as usize];
        let (c, s) = (ball.linear[3], ball.turning[3]);
        for k in 0..3 {
            ball.linear[k] -= c * p[k];
            ball.turning[k] += s * turn[k];
        }
    }

    /// Solves the contact law from the impulse extrapolated by `share`; returns the square of its
    /// change.
    #[inline(always)]
    pub(super) fn visit(&mut self, share: f64, balls: &mut [BallVelocity]) -> f64 {
        let u = self.velocity(balls);
        let mut start = self.p;
        for k in 0..3 {
            start[k] += share * (self.p[k] - self.before[k]);
        }
        self.before = self.p;
        self.p = Coulomb(self.mu).answer_of_round(&self.n, self.inverse, &start, &u);
        let mut change = self.p;
        for k in 0..3 {
            change[k] -= start[k];
        }
        self.add(&change, balls);
        dot(&change, &change)
    }

    /// Takes its part of velocities extrapolated by `share` back; the impulse stays.
    #[inline]
    pub(super) fn take_back(&mut self, share: f64, balls: &mut [BallVelocity]) {
        let mut back = [0.0; 3];
        for k in 0..3 {
            back[k] = -share * (self.p[k] - self.before[k]);
        }
        self.add(&back, balls);
        self.before = self.p;
    }

    /// Violation of Coulomb's law, measured as by [`crate::law::coulomb::violation`].
    #[inline(always)]
    pub(super) fn judge(&self, balls: &[BallVelocity]) -> Judged {
        let u = self.velocity(balls);
        let mass = mass_of(self.inverse);
        let or_mass = |i: f64| if i > 0.0 { i } else { mass };
        let scales = self.inverse.map(or_mass);
        Judged {
            square: Coulomb(self.mu).violation_of_round(&self.n, scales, &self.p, &u),
            mass,
            work: dot(&self.p, &u),
            free: dot(&self.p, &self.q),
        }
    }
}

/// Rolling and drilling friction of the contact of a [`BallRow`]. A visit of the row precedes each
/// of its own, which takes the normal impulse as given.
#[derive(Clone, Copy, Debug)]
pub(super) struct BallRollRow {
    /// k of each body.
    levers: [f64; 2],
    law: RollingFriction,
    /// 1/W of the rolling velocity, kg.
    pub inverse: f64,
    pub q: [f64; 3],
    /// The impulse, N s.
    pub s: [f64; 3],
    /// s of the previous sweep.
    pub before: [f64; 3],
}

impl BallRollRow {
    pub(super) fn new(contact: &RollingContact, pair: &RoundPair<3>) -> Self {
        Self {
            levers: contact.levers,
            law: contact.law,
            inverse: invert(contact.mobility(pair)),
            q: contact.free,
            s: contact.impulse,
            before: contact.impulse,
        }
    }

    /// w.
    #[inline(always)]
    fn velocity(&self, row: &BallRow, balls: &[BallVelocity]) -> [f64; 3] {
        let [a, b] = row.bodies.map(|body| &balls[body as usize].turning);
        let [k_a, k_b] = self.levers;
        std::array::from_fn(|k| k_a * a[k] - k_b * b[k] + self.q[k])
    }

    /// The effect of an impulse.
    #[inline(always)]
    pub(super) fn add(&self, s: &[f64; 3], row: &BallRow, balls: &mut [BallVelocity]) {
        let [k_a, k_b] = self.levers;
        for (body, lever) in row.bodies.into_iter().zip([k_a, -k_b]) {
            let turning = &mut balls[body as usize].turning;
            let c = lever * turning[3];
            for k in 0..3 {
                turning[k] += c * s[k];
            }
        }
    }

    /// Nearest admissible impulse under the row's normal impulse.
    #[inline(always)]
    pub(super) fn admissible(&self, row: &BallRow, s: &[f64; 3]) -> [f64; 3] {
        self.law.project(&row.n, dot(&row.n, &row.p), s)
    }

    /// Solves the law of rolling friction from the impulse extrapolated by `share`; returns the
    /// square of its change.
    #[inline(always)]
    pub(super) fn visit(&mut self, row: &BallRow, share: f64, balls: &mut [BallVelocity]) -> f64 {
        let w = self.velocity(row, balls);
        let mut start = self.s;
        let mut wanted = self.s;
        for k in 0..3 {
            start[k] += share * (self.s[k] - self.before[k]);
            wanted[k] = start[k] - self.inverse * w[k];
        }
        self.before = self.s;
        self.s = self.admissible(row, &wanted);
        let change = std::array::from_fn(|k| self.s[k] - start[k]);
        self.add(&change, row, balls);
        dot(&change, &change)
    }

    /// Takes the rolling impulse's part of velocities extrapolated by `share` back; the impulse
    /// stays.
    #[inline]
    pub(super) fn take_back(&mut self, row: &BallRow, share: f64, balls: &mut [BallVelocity]) {
        let back = std::array::from_fn(|k| -share * (self.s[k] - self.before[k]));
        self.add(&back, row, balls);
        self.before = self.s;
    }

    /// Violation of the law of rolling friction under the row's normal impulse.
    #[inline(always)]
    pub(super) fn judge(&self, row: &BallRow, balls: &[BallVelocity]) -> Judged {
        let w = self.velocity(row, balls);
        let mass = if self.inverse > 0.0 {
            self.inverse
        } else {
            1.0
        };
        let pressed = (&row.n, dot(&row.n, &row.p));
        Judged {
            square: self.law.violation(pressed, &self.s, &w, mass),
            mass,
            work: dot(&self.s, &w),
            free: dot(&self.s, &self.q),
        }
    }
}

/// A contact of the machine with a ball or with something fixed, in the contact's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct MachineBallRow {
    /// Place of its ball, or of what is fixed.
    pub ball: u32,
    frame: [[f64; 3]; 3],
    block: [[f64; 3]; 3],
    /// See [`BodyPairs::beyond`].
    pub beyond: [f64; 3],
    pub q: [f64; 3],
    pub mu: f64,
    pub p: [f64; 3],
    /// p of the previous sweep.
    pub before: [f64; 3],
}

impl MachineBallRow {
    /// `ball`: its place, or that of what is fixed.
    pub(super) fn new(
        pairs: &BodyPairs<3>,
        i: usize,
        ball: u32,
        q: &[f64; 3],
        mu: f64,
        p: &[f64; 3],
    ) -> Self {
        Self {
            ball,
            frame: pairs.machine[i].frame,
            block: pairs.machine_block(i),
            beyond: pairs.beyond_of(i),
            q: *q,
            mu,
            p: *p,
            before: *p,
        }
    }

    /// `1/W_NN` and over the mean of the tangential diagonal, kg.
    pub(super) fn inverse(&self) -> [f64; 2] {
        let [[w_n, ..], [_, w_t, _], [.., w_b]] = self.block;
        [w_n, 0.5 * (w_t + w_b)].map(invert)
    }

    /// u of the machine's contact i under the impulse `p`.
    pub(super) fn velocity(
        &self,
        pairs: &BodyPairs<3>,
        (i, p): (usize, &[f64; 3]),
        balls: &[BallVelocity],
        own: &[f64],
    ) -> [f64; 3] {
        let ball = &balls[self.ball as usize];
        let [x, y, z, _] = ball.turning;
        let mut world = cross(&self.frame[0], &[x, y, z]);
        for k in 0..3 {
            world[k] -= ball.linear[k];
        }
        let mut u = to_frame(&self.frame, &world);
        for k in 0..3 {
            u[k] += self.q[k] + self.beyond[k] * p[k];
        }
        pairs.add_local_of_machine(i, own, &mut u);
        u
    }

    pub(super) fn add(
        &self,
        pairs: &BodyPairs<3>,
        i: usize,
        p: &[f64; 3],
        balls: &mut [BallVelocity],
        own: &mut [f64],
    ) {
        let world = to_world(&self.frame, p);
        let turn = cross(&world, &self.frame[0]);
        let ball = &mut balls[self.ball as usize];
        let (c, s) = (ball.linear[3], ball.turning[3]);
        for k in 0..3 {
            ball.linear[k] -= c * world[k];
            ball.turning[k] += s * turn[k];
        }
        pairs.add_to_machine(i, p, own);
    }

    pub(super) fn visit(
        &mut self,
        pairs: &BodyPairs<3>,
        i: usize,
        share: f64,
        balls: &mut [BallVelocity],
        own: &mut [f64],
    ) -> f64 {
        let mut start = self.p;
        for k in 0..3 {
            start[k] += share * (self.p[k] - self.before[k]);
        }
        self.before = self.p;
        let mut free = self.velocity(pairs, (i, &start), balls, own);
        for (free, row) in free.iter_mut().zip(&self.block) {
            *free -= dot(row, &start);
        }
        // A NaN of the data shows in the change.
        self.p = solve_one_contact(&self.block, &free, self.mu).impulse;
        let mut change = self.p;
        for k in 0..3 {
            change[k] -= start[k];
        }
        self.add(pairs, i, &change, balls, own);
        dot(&change, &change)
    }
}
