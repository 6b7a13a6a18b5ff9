//! The sweeps of [`super::body_sweeps`] over thousands of disks.
//!
//! Sweeps visit four places of the list in turn, so that a contact need not wait for the results of
//! the one before it.

use super::accelerated::{Relaxation, SolutionQuality};
use super::disk_rows::{DiskRollRow, MachineDiskRow, Row, Velocity};
use crate::law::coulomb::violation;
use crate::problem::{BodyPairs, Magnitudes, RollingContact, ViolationSums};
use crate::space::{body_velocities, dot};

/// Places of the list that are visited in turn.
const PLACES: usize = 4;

/// Scratch.
#[derive(Clone, Debug, Default)]
pub(super) struct DiskSweeps {
    rows: Vec<Row>,
    /// Number of each row's contact.
    order: Vec<u32>,
    /// Rolling friction of each row; none where no contact has any.
    rolls: Vec<DiskRollRow>,
    machine: Vec<MachineDiskRow>,
    /// Velocity of each body due to the impulses: of its centre, and r ω, m/s. The last entry
    /// stands for everything fixed.
    velocity: Vec<Velocity>,
    velocity_before: Vec<Velocity>,
    /// Velocity of the machine due to the impulses, in its factor coordinates.
    own: Vec<f64>,
    own_before: Vec<f64>,
}

/// Dimensions.
const D: usize = 2;

impl DiskSweeps {
    /// Takes over a problem with its start.
    pub(super) fn fit(
        &mut self,
        pairs: &BodyPairs<2>,
        (q, mu, p): (&[f64], &[f64], &[f64]),
        rolling: &[RollingContact],
    ) {
        let round = pairs.round.len();
        let bodies = pairs.n_coordinates / body_velocities(2);
        #[allow(clippy::cast_possible_truncation)] // bodies and contacts are numbered by u32
        let still = bodies as u32;
        for velocity in [&mut self.velocity, &mut self.velocity_before] {
            velocity.clear();
            velocity.resize(bodies + 1, Velocity::default());
        }
        self.order.clear();
        let length = round.div_ceil(PLACES);
        for k in 0..length {
            #[allow(clippy::cast_possible_truncation)]
            let places = (k..round).step_by(length).map(|i| i as u32);
            self.order.extend(places);
        }
        let (q, p) = (q.as_chunks::<D>().0, p.as_chunks::<D>().0);
        self.rows.clear();
        self.rows.extend(self.order.iter().map(|&i| {
            let i = i as usize;
            let pair = &pairs.round[i];
            Row::new(pair, pair.block(), still, &q[i], mu[i], &p[i])
        }));
        self.rolls.clear();
        if !rolling.is_empty() {
            self.rolls
                .extend(self.order.iter().zip(&self.rows).map(|(&i, row)| {
                    let i = i as usize;
                    DiskRollRow::new(&rolling[i], &pairs.round[i], row)
                }));
        }
        self.machine.clear();
        let machine = pairs.machine.iter().enumerate();
        self.machine.extend(machine.map(|(k, pair)| {
            let i = round + k;
            let block = pairs.machine_block(k);
            let scales = [block[0][0], block[1][1]];
            MachineDiskRow {
                round: Row::new(pair, scales, still, &q[i], mu[i], &p[i]),
                block,
            }
        }));
        self.own.resize(pairs.width, 0.0);
        self.sum(pairs);
        self.velocity_before.clone_from(&self.velocity);
        self.own_before.clone_from(&self.own);
    }

    /// Recomputes the velocities from the impulses.
    fn sum(&mut self, pairs: &BodyPairs<2>) {
        self.velocity.fill(Velocity::default());
        self.own.fill(0.0);
        for row in &self.rows {
            row.add(row.p, &mut self.velocity);
        }
        for (row, roll) in self.rows.iter().zip(&self.rolls) {
            roll.add(roll.s, row, &mut self.velocity);
        }
        for (i, row) in self.machine.iter().enumerate() {
            let (velocity, own) = (&mut self.velocity, &mut self.own);
            row.add(pairs, i, row.round.p, velocity, own);
        }
    }

    /// One sweep from the impulses extrapolated by `share`; the square of its change, N² s².
    fn sweep(&mut self, pairs: &BodyPairs<2>, share: f64) -> f64 {
        if share > 0.0 {
            for (v, before) in self.velocity.iter_mut().zip(&mut self.velocity_before) {
                for k in 0..body_velocities(2) {
                    let now = v[k];
                    v[k] += share * (now - before[k]);
                    before[k] = now;
                }
            }
            for (v, before) in self.own.iter_mut().zip(&mut self.own_before) {
                let now = *v;
                *v += share * (now - *before);
                *before = now;
            }
        } else {
            self.velocity_before.copy_from_slice(&self.velocity);
            self.own_before.copy_from_slice(&self.own);
        }
        let mut change = 0.0;
        if self.rolls.is_empty() {
            for row in &mut self.rows {
                change += row.visit(share, &mut self.velocity);
            }
        } else {
            for (row, roll) in self.rows.iter_mut().zip(&mut self.rolls) {
                change += row.visit(share, &mut self.velocity);
                change += roll.visit(row, share, &mut self.velocity);
            }
        }
        for (i, row) in self.machine.iter_mut().enumerate() {
            change += row.visit(pairs, i, share, &mut self.velocity, &mut self.own);
        }
        change
    }

    /// The residual as [`crate::problem::evaluate_into`] defines it; writes p and u.
    fn measure(
        &mut self,
        pairs: &BodyPairs<2>,
        (p, u): (&mut [f64], &mut [f64]),
        rolling: &mut [RollingContact],
    ) -> SolutionQuality {
        self.sum(pairs);
        let (mut violations, mut data) = (ViolationSums::default(), Magnitudes::default());
        let (mut work, mut free) = (0.0, 0.0);
        let mut judge = |i: usize, row: &Row, own: [f64; D]| {
            let [i_n, i_t] = row.inverse;
            // 2 over the trace.
            let sum = i_n + i_t;
            let mass = if sum > 0.0 {
                2.0 * i_n * i_t / sum
            } else {
                1.0
            };
            let scale = |inverse: f64| if inverse > 0.0 { inverse } else { mass };
            let off = violation(&row.p, &own, row.mu, [scale(i_n), scale(i_t)]);
            violations.add(dot(&off, &off), mass);
            data.add(&row.q, mass);
            work += dot(&row.p, &own);
            free += dot(&row.p, &row.q);
            p[D * i..D * (i + 1)].copy_from_slice(&row.p);
            u[D * i..D * (i + 1)].copy_from_slice(&own);
        };
        for (row, i) in self.rows.iter().zip(&self.order) {
            judge(*i as usize, row, row.local(&self.velocity));
        }
        for (i, row) in self.machine.iter().enumerate() {
            let own = row.local(pairs, i, &self.velocity, &self.own);
            judge(self.rows.len() + i, &row.round, own);
        }
        for ((row, roll), i) in self.rows.iter().zip(&self.rolls).zip(&self.order) {
            let ([w, q], [square, mass]) = roll.judge(row, &self.velocity);
            violations.add(square, mass);
            work += roll.s * w;
            free += roll.s * q;
            rolling[*i as usize].impulse = [0.0, 0.0, roll.s];
        }
        let [inverse_speed, inverse_data] = data.inverses();
        let residual = violations.residual(inverse_speed, inverse_data);
        SolutionQuality {
            residual,
            work,
            free,
        }
    }

    /// Multiplies all impulses.
    fn scale(&mut self, share: f64) {
        let machine = self.machine.iter_mut().map(|row| &mut row.round);
        for row in self.rows.iter_mut().chain(machine) {
            row.p = row.p.map(|p| share * p);
        }
        for roll in &mut self.rolls {
            roll.s *= share;
        }
    }
}

/// A solve under way.
pub(super) struct DiskSolve<'a> {
    pub sweeps: &'a mut DiskSweeps,
    pub pairs: &'a BodyPairs<2>,
    /// Impulses and velocities of the last measurement.
    pub p: &'a mut [f64],
    pub u: &'a mut [f64],
    pub rolling: &'a mut [RollingContact],
}

impl Relaxation for DiskSolve<'_> {
    const KEPT: f64 = 0.0;
    const PATIENCE: usize = 50;

    fn sweep(&mut self, share: f64, _is_hard: bool) -> f64 {
        self.sweeps.sweep(self.pairs, share)
    }

    fn measure(&mut self) -> SolutionQuality {
        let answer = (&mut *self.p, &mut *self.u);
        self.sweeps.measure(self.pairs, answer, self.rolling)
    }

    fn scale(&mut self, share: f64) {
        self.sweeps.scale(share);
    }
}
