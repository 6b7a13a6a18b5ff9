//! Contact rows of [`super::disk_sweeps`]: all data that a visit reads and writes, side by side.

use crate::cone::draw_in;
use crate::law::one_contact::solve_one_contact;
use crate::law::rolling::RollingFriction;
use crate::problem::{BodyPairs, RollingContact, RoundPair};
use crate::space::{body_velocities, dot};

/// Numbers of a body: its velocity, that of its rim, and a zero as padding.
pub(super) type Velocity = [f64; 4];

/// A contact among disks with all data that a sweep reads and writes: two cache lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    bodies: [u32; 2],
    n: [f64; 2],
    /// 1/m of each body, 1/kg.
    linear: [f64; 2],
    /// r²/J of each body, 1/kg.
    angular: [f64; 2],
    /// `1/W_NN`, `1/W_TT`, kg.
    pub(super) inverse: [f64; 2],
    pub(super) q: [f64; 2],
    pub(super) mu: f64,
    pub(super) p: [f64; 2],
    /// p of the previous sweep.
    before: [f64; 2],
}

/// Rolling friction of the contact of a [`Row`], which is visited before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct DiskRollRow {
    /// k of each disk.
    levers: [f64; 2],
    law: RollingFriction,
    /// 1/W of the rolling velocity, kg.
    inverse: f64,
    q: f64,
    /// The impulse, N s.
    pub(super) s: f64,
    /// s of the previous sweep.
    before: f64,
}

impl DiskRollRow {
    /// `row`: that of the contact, whose impulse bounds the first one.
    pub(super) fn new(contact: &RollingContact, pair: &RoundPair<2>, row: &Row) -> Self {
        let w = contact.mobility(pair);
        let s = contact.law.project_in_plane(row.p[0], contact.impulse[2]);
        Self {
            levers: contact.levers,
            law: contact.law,
            inverse: if w > 0.0 { 1.0 / w } else { 0.0 },
            q: contact.free[2],
            s,
            before: s,
        }
    }

    /// w.
    #[inline]
    fn local(&self, row: &Row, velocity: &[Velocity]) -> f64 {
        let [a, b] = row.bodies.map(|body| velocity[body as usize][2]);
        self.levers[0] * a - self.levers[1] * b + self.q
    }

    #[inline]
    pub(super) fn add(&self, s: f64, row: &Row, velocity: &mut [Velocity]) {
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            let v = &mut velocity[row.bodies[side] as usize];
            v[2] += sign * self.levers[side] * row.angular[side] * s;
        }
    }

    /// Solves the law of rolling friction from the impulse extrapolated by `share`; returns the
    /// square of its change.
    #[inline]
    pub(super) fn visit(&mut self, row: &Row, share: f64, velocity: &mut [Velocity]) -> f64 {
        let start = self.s + share * (self.s - self.before);
        let wanted = start - self.inverse * self.local(row, velocity);
        self.before = self.s;
        self.s = self.law.project_in_plane(row.p[0], wanted);
        let change = self.s - start;
        self.add(change, row, velocity);
        change * change
    }

    /// The impulse, and w; the square of the violation, (m/s)², and the contact's mass, kg.
    pub(super) fn judge(&self, row: &Row, velocity: &[Velocity]) -> ([f64; 2], [f64; 2]) {
        let w = self.local(row, velocity);
        let mass = if self.inverse > 0.0 {
            self.inverse
        } else {
            1.0
        };
        let projected = self.law.project_in_plane(row.p[0], self.s - mass * w);
        let off = (self.s - projected) / mass;
        ([w, self.q], [off * off, mass])
    }
}

/// A contact of the machine.
#[derive(Clone, Copy, Debug)]
pub(super) struct MachineDiskRow {
    /// The side of the round body, the second body.
    pub(super) round: Row,
    pub(super) block: [[f64; 2]; 2],
}

impl Row {
    /// `still`: the place of fixed bodies.
    pub(super) fn new(
        pair: &RoundPair<2>,
        block: [f64; 2],
        still: u32,
        q: &[f64; 2],
        mu: f64,
        p: &[f64; 2],
    ) -> Self {
        #[allow(clippy::cast_possible_truncation)] // 3
        const V: u32 = body_velocities(2) as u32;
        let place = |k: usize| {
            let moves = pair.linear[k] > 0.0;
            if moves { pair.bodies[k] / V } else { still }
        };
        let invert = |w: f64| if w > 0.0 { 1.0 / w } else { 0.0 };
        Self {
            bodies: [place(0), place(1)],
            n: pair.frame[0],
            linear: pair.linear.map(|c| c * c),
            angular: pair.angular.map(|s| s * s),
            inverse: block.map(invert),
            q: *q,
            mu,
            p: *p,
            before: *p,
        }
    }

    /// t = n × e_z.
    #[inline]
    fn tangent(&self) -> [f64; 2] {
        [self.n[1], -self.n[0]]
    }

    /// u.
    #[inline]
    pub(super) fn local(&self, velocity: &[Velocity]) -> [f64; 2] {
        let [a, b] = self.bodies.map(|body| &velocity[body as usize]);
        let between = [a[0] - b[0], a[1] - b[1]];
        [
            dot(&self.n, &between) + self.q[0],
            dot(&self.tangent(), &between) + (a[2] + b[2]) + self.q[1],
        ]
    }

    #[inline]
    pub(super) fn add(&self, p: [f64; 2], velocity: &mut [Velocity]) {
        let t = self.tangent();
        let force = [
            self.n[0] * p[0] + t[0] * p[1],
            self.n[1] * p[0] + t[1] * p[1],
        ];
        let linear = [self.linear[0], -self.linear[1]];
        for side in 0..2 {
            let v = &mut velocity[self.bodies[side] as usize];
            *v = [
                v[0] + linear[side] * force[0],
                v[1] + linear[side] * force[1],
                v[2] + self.angular[side] * p[1],
                0.0,
            ];
        }
    }

    /// p at the start of the sweep; stores the previous one.
    #[inline]
    pub(super) fn extrapolate(&mut self, share: f64) -> [f64; 2] {
        let mut start = self.p;
        for k in 0..2 {
            start[k] += share * (self.p[k] - self.before[k]);
        }
        self.before = self.p;
        start
    }

    /// Solves the contact law; returns the square of the impulse's change.
    #[inline]
    pub(super) fn visit(&mut self, share: f64, velocity: &mut [Velocity]) -> f64 {
        let z = self.extrapolate(share);
        let u = self.local(velocity);
        let mut p = z;
        p[0] = (z[0] - u[0] * self.inverse[0]).max(0.0);
        p[1] = z[1] - u[1] * self.inverse[1];
        let limit = self.mu * p[0];
        draw_in(&mut p, limit);
        self.p = p;
        let mut change = p;
        for k in 0..2 {
            change[k] -= z[k];
        }
        self.add(change, velocity);
        dot(&change, &change)
    }
}

impl MachineDiskRow {
    /// u of the machine's contact i.
    pub(super) fn local(
        &self,
        pairs: &BodyPairs<2>,
        i: usize,
        velocity: &[Velocity],
        own: &[f64],
    ) -> [f64; 2] {
        let mut u = self.round.local(velocity);
        debug_assert!(pairs.beyond.is_empty(), "planar contacts do not yield");
        pairs.add_local_of_machine(i, own, &mut u);
        u
    }

    pub(super) fn add(
        &self,
        pairs: &BodyPairs<2>,
        i: usize,
        p: [f64; 2],
        velocity: &mut [Velocity],
        own: &mut [f64],
    ) {
        self.round.add(p, velocity);
        pairs.add_to_machine(i, &p, own);
    }

    pub(super) fn visit(
        &mut self,
        pairs: &BodyPairs<2>,
        i: usize,
        share: f64,
        velocity: &mut [Velocity],
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
        for k in 0..2 {
            change[k] -= z[k];
        }
        self.add(pairs, i, change, velocity, own);
        dot(&change, &change)
    }
}
