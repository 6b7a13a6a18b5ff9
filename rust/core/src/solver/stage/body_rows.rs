//! Contact rows of [`super::body_sweeps`]: all data that a visit reads and writes, side by side.

use crate::problem::{BodyPairs, RoundPair, rim_impulse, rim_velocity};
use crate::solver::local::one_contact::solve_one_contact;
use crate::spatial::space::{body_velocities, dot};

/// A contact among round bodies with all data that a sweep reads and writes: two cache lines in the
/// plane, three in space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<const D: usize, const T: usize> {
    bodies: [u32; 2],
    n: [f64; D],
    t: [f64; T],
    /// 1/m of each body, 1/kg.
    linear: [f64; 2],
    /// r²/J of each body, 1/kg.
    angular: [f64; 2],
    /// `1/W_NN`, `1/W_TT`, kg.
    pub(super) inverse: [f64; 2],
    pub(super) q: [f64; D],
    pub(super) mu: f64,
    pub(super) p: [f64; D],
    /// p of the previous sweep.
    before: [f64; D],
}

/// A contact of the machine.
#[derive(Clone, Copy, Debug)]
pub(super) struct MachineRow<const D: usize, const T: usize> {
    /// The side of the round body, the second body.
    pub(super) round: Row<D, T>,
    pub(super) block: [[f64; D]; D],
}

/// Projects the tangential part of an impulse onto the friction disc of a nonnegative radius.
#[inline]
pub(super) fn draw_in<const D: usize>(p: &mut [f64; D], limit: f64) {
    if D == 2 {
        p[1] = p[1].min(limit).max(-limit);
        return;
    }
    let square = p[1] * p[1] + p[2] * p[2];
    if square > limit * limit {
        let share = limit / square.sqrt();
        p[1] *= share;
        p[2] *= share;
    }
}

/// `|x|²`.
#[inline]
pub(super) fn square<const D: usize>(x: &[f64; D]) -> f64 {
    dot(x, x)
}

impl<const D: usize, const T: usize> Row<D, T> {
    /// `still`: the place of fixed bodies.
    pub(super) fn new(
        pair: &RoundPair<D>,
        block: [f64; 2],
        still: u32,
        q: &[f64; D],
        mu: f64,
        p: &[f64; D],
    ) -> Self {
        #[allow(clippy::cast_possible_truncation)] // 3 or 6
        let V = body_velocities(D) as u32;
        let place = |k: usize| {
            let moves = pair.linear[k] > 0.0;
            if moves { pair.bodies[k] / V } else { still }
        };
        let invert = |w: f64| if w > 0.0 { 1.0 / w } else { 0.0 };
        let mut t = [0.0; T];
        t.copy_from_slice(&pair.frame[1][..T]);
        Self {
            bodies: [place(0), place(1)],
            n: pair.frame[0],
            t,
            linear: pair.linear.map(|c| c * c),
            angular: pair.angular.map(|s| s * s),
            inverse: block.map(invert),
            q: *q,
            mu,
            p: *p,
            before: *p,
        }
    }

    /// n, t, b: in the plane t = n × e_z, in space b = t × n.
    #[inline]
    pub(super) fn frame(&self) -> [[f64; D]; D] {
        let mut frame = [self.n; D];
        let (n, t) = (&self.n, &self.t);
        if D == 2 {
            (frame[1][0], frame[1][1]) = (n[1], -n[0]);
        } else {
            for k in 0..T {
                frame[1][k] = t[k];
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                frame[2][k] = t[i] * n[j] - t[j] * n[i];
            }
        }
        frame
    }

    /// u.
    #[inline]
    pub(super) fn local<const S: usize>(
        &self,
        frame: &[[f64; D]; D],
        velocity: &[[f64; S]],
    ) -> [f64; D] {
        let [a, b] = self.bodies.map(|body| &velocity[body as usize]);
        let mut between = [0.0; D];
        for k in 0..D {
            between[k] = a[k] - b[k];
        }
        let mut rim = [0.0; S];
        for k in D..body_velocities(D) {
            rim[k - D] = a[k] + b[k];
        }
        let mut u = [0.0; D];
        u[0] = dot(&frame[0], &between) + self.q[0];
        for k in 1..D {
            u[k] = dot(&frame[k], &between) + rim_velocity(frame, k, &rim) + self.q[k];
        }
        u
    }

    #[inline]
    pub(super) fn add<const S: usize>(
        &self,
        frame: &[[f64; D]; D],
        p: [f64; D],
        velocity: &mut [[f64; S]],
    ) {
        let mut force = [0.0; D];
        for k in 0..D {
            force[k] = frame[0][k] * p[0];
            for r in 1..D {
                force[k] += frame[r][k] * p[r];
            }
        }
        let mut turn = [0.0; S];
        for k in D..body_velocities(D) {
            turn[k] = rim_impulse(frame, &p, k - D);
        }
        let linear = [self.linear[0], -self.linear[1]];
        for side in 0..2 {
            let v = &mut velocity[self.bodies[side] as usize];
            let mut new = [0.0; S];
            for k in 0..D {
                new[k] = v[k] + linear[side] * force[k];
            }
            for k in D..body_velocities(D) {
                new[k] = v[k] + self.angular[side] * turn[k];
            }
            *v = new;
        }
    }

    /// p at the start of the sweep; stores the previous one.
    #[inline]
    pub(super) fn extrapolate(&mut self, share: f64) -> [f64; D] {
        let mut start = self.p;
        for k in 0..D {
            start[k] += share * (self.p[k] - self.before[k]);
        }
        self.before = self.p;
        start
    }

    /// Solves the contact law; returns the square of the impulse's change.
    #[inline]
    pub(super) fn visit<const S: usize>(&mut self, share: f64, velocity: &mut [[f64; S]]) -> f64 {
        let frame = self.frame();
        let z = self.extrapolate(share);
        let u = self.local(&frame, velocity);
        let mut p = z;
        p[0] = (z[0] - u[0] * self.inverse[0]).max(0.0);
        for k in 1..D {
            p[k] = z[k] - u[k] * self.inverse[1];
        }
        let limit = self.mu * p[0];
        draw_in(&mut p, limit);
        self.p = p;
        let mut change = p;
        for k in 0..D {
            change[k] -= z[k];
        }
        self.add(&frame, change, velocity);
        square(&change)
    }
}

impl<const D: usize, const T: usize> MachineRow<D, T> {
    /// u of the machine's contact i.
    pub(super) fn local<const S: usize>(
        &self,
        pairs: &BodyPairs<D>,
        i: usize,
        velocity: &[[f64; S]],
        own: &[f64],
    ) -> [f64; D] {
        let mut u = self.round.local(&self.round.frame(), velocity);
        pairs.add_local_of_machine(i, own, &mut u);
        u
    }

    pub(super) fn add<const S: usize>(
        &self,
        pairs: &BodyPairs<D>,
        i: usize,
        p: [f64; D],
        velocity: &mut [[f64; S]],
        own: &mut [f64],
    ) {
        self.round.add(&self.round.frame(), p, velocity);
        pairs.add_to_machine(i, &p, own);
    }

    pub(super) fn visit<const S: usize>(
        &mut self,
        pairs: &BodyPairs<D>,
        i: usize,
        share: f64,
        velocity: &mut [[f64; S]],
        own: &mut [f64],
    ) -> f64 {
        let z = self.round.extrapolate(share);
        let mut free = self.local(pairs, i, velocity, own);
        for (free, row) in free.iter_mut().zip(&self.block) {
            for (w, z) in row.iter().zip(&z) {
                *free -= w * z;
            }
        }
        let p = solve_one_contact(&self.block, &free, self.round.mu).impulse;
        // A NaN of the data shows in the change.
        self.round.p = p;
        let mut change = p;
        for k in 0..D {
            change[k] -= z[k];
        }
        self.add(pairs, i, change, velocity, own);
        square(&change)
    }
}
