//! Accelerated Gauss–Seidel on the velocities of thousands of free bodies.
//!
//! A sweep visits contact after contact: it reads the velocities of the two bodies, solves the
//! contact law exactly and updates the velocities. The cost per contact does not depend on the
//! number of contacts. The next sweep starts not from the impulses p_k but from
//! `p_k + β (p_k − p_{k−1})`, with β from Nesterov's sequence. The sequence restarts when the
//! change per sweep grows. Velocities are linear in the impulses and are extrapolated alike. On
//! flowing soil this needs a third to a fifth of the plain sweeps.
//!
//! Sweeps visit four places of the list in turn, so that a contact need not wait for the results of
//! the one before it.
//!
//! The answer is judged like that of every solver: by the violation of the returned impulse, with
//! the velocities summed anew. It never adds energy: an approximate answer with `pᵀu > 0` is scaled
//! down until pᵀu = 0.
//!
//! Source: Jean 1999 and Moreau 1999 (the sweep); Nesterov 1983, O'Donoghue
//! and Candès 2015 (extrapolation with restart).

use super::body_rows::{MachineRow, Row, draw_in, square};
use crate::law::coulomb::violation;
use crate::problem::{BodyPairs, Magnitudes, Residual, Violations, passive_share};
use crate::solver::options::{Method, SolverOptions};
use crate::solver::report::{Rung, Rungs, SolveReport, SolveStatus, Stage};
use crate::spatial::space::{body_velocities, dot};

/// Places of the list that are visited in turn.
const PLACES: usize = 4;

/// Sweeps after which the residual is computed, whatever the change per sweep.
const PATIENCE: usize = 50;

/// Work of one visit of a contact, in units of [`SolverOptions::budget`].
const UNITS: u64 = 30;

/// Scratch of [`solve_body_pairs`].
#[derive(Clone, Debug, Default)]
pub struct BodySweeps {
    disks: Sweeps<2, 0, 4>,
    balls: Sweeps<3, 3, 8>,
}

/// Contacts that the sweeps support: among disks, and among balls.
pub trait Swept<const D: usize> {
    /// Solves them as [`solve_body_pairs`] says.
    fn sweep(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        sweeps: &mut BodySweeps,
    ) -> SolveReport;
}

impl Swept<2> for BodyPairs<2> {
    fn sweep(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        sweeps: &mut BodySweeps,
    ) -> SolveReport {
        sweeps.disks.solve(self, q, mu, options, p, u)
    }
}

impl Swept<3> for BodyPairs<3> {
    fn sweep(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        sweeps: &mut BodySweeps,
    ) -> SolveReport {
        sweeps.balls.solve(self, q, mu, options, p, u)
    }
}

/// The sweeps in D dimensions. T numbers store a contact's tangents: none in the plane, the first
/// tangent in space. A body has S numbers: its velocity, that of its rim, and zeros as padding.
#[derive(Clone, Debug, Default)]
struct Sweeps<const D: usize, const T: usize, const S: usize> {
    rows: Vec<Row<D, T>>,
    /// Number of each row's contact.
    order: Vec<u32>,
    machine: Vec<MachineRow<D, T>>,
    /// Velocity of each body due to the impulses: of its centre, and r ω, m/s. The last entry
    /// stands for everything fixed.
    velocity: Vec<[f64; S]>,
    velocity_before: Vec<[f64; S]>,
    /// Of the machine, in its factor coordinates.
    own: Vec<f64>,
    own_before: Vec<f64>,
}

/// Quality of an answer.
struct Measured {
    residual: Residual,
    /// pᵀu, J.
    work: f64,
    /// pᵀq, J.
    free: f64,
}

impl Measured {
    fn is_within(&self, options: &SolverOptions) -> bool {
        self.residual.relative <= options.tolerance
            && self.residual.velocity <= options.velocity_tolerance
    }
}

impl<const D: usize, const T: usize, const S: usize> Sweeps<D, T, S> {
    fn fit(&mut self, pairs: &BodyPairs<D>, q: &[f64], mu: &[f64], p: &[f64]) {
        let round = pairs.round.len();
        let bodies = pairs.n_coordinates / body_velocities(D);
        #[allow(clippy::cast_possible_truncation)] // bodies and contacts are numbered by u32
        let still = bodies as u32;
        for velocity in [&mut self.velocity, &mut self.velocity_before] {
            velocity.clear();
            velocity.resize(bodies + 1, [0.0; S]);
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
        self.machine.clear();
        let machine = pairs.machine.iter().enumerate();
        self.machine.extend(machine.map(|(k, pair)| {
            let i = round + k;
            let block = pairs.machine_block(k);
            let tangential: f64 = (1..D).map(|k| block[k][k]).sum();
            let scales = [block[0][0], tangential / (D - 1) as f64];
            MachineRow {
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
    fn sum(&mut self, pairs: &BodyPairs<D>) {
        self.velocity.fill([0.0; S]);
        self.own.fill(0.0);
        for row in &self.rows {
            row.add(&row.frame(), row.p, &mut self.velocity);
        }
        for (i, row) in self.machine.iter().enumerate() {
            let (velocity, own) = (&mut self.velocity, &mut self.own);
            row.add(pairs, i, row.round.p, velocity, own);
        }
    }

    /// One sweep from the impulses extrapolated by `share`; the square of its change, N² s².
    fn sweep(&mut self, pairs: &BodyPairs<D>, share: f64) -> f64 {
        if share > 0.0 {
            for (v, before) in self.velocity.iter_mut().zip(&mut self.velocity_before) {
                for k in 0..body_velocities(D) {
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
        for row in &mut self.rows {
            change += row.visit(share, &mut self.velocity);
        }
        for (i, row) in self.machine.iter_mut().enumerate() {
            change += row.visit(pairs, i, share, &mut self.velocity, &mut self.own);
        }
        change
    }

    /// The residual as [`crate::problem::evaluate_into`] defines it; writes p and u.
    fn measure(&mut self, pairs: &BodyPairs<D>, p: &mut [f64], u: &mut [f64]) -> Measured {
        self.sum(pairs);
        let (mut violations, mut data) = (Violations::default(), Magnitudes::default());
        let (mut work, mut free) = (0.0, 0.0);
        let mut judge = |i: usize, row: &Row<D, T>, own: [f64; D]| {
            let [i_n, i_t] = row.inverse;
            // D over the trace: D − 1 tangents.
            let sum = (D - 1) as f64 * i_n + i_t;
            let mass = if sum > 0.0 {
                D as f64 * i_n * i_t / sum
            } else {
                1.0
            };
            let scale = |inverse: f64| if inverse > 0.0 { inverse } else { mass };
            let off = violation(&row.p, &own, row.mu, [scale(i_n), scale(i_t)]);
            violations.add(square(&off), mass);
            data.add(&row.q, mass);
            work += dot(&row.p, &own);
            free += dot(&row.p, &row.q);
            p[D * i..D * (i + 1)].copy_from_slice(&row.p);
            u[D * i..D * (i + 1)].copy_from_slice(&own);
        };
        for (row, i) in self.rows.iter().zip(&self.order) {
            judge(*i as usize, row, row.local(&row.frame(), &self.velocity));
        }
        for (i, row) in self.machine.iter().enumerate() {
            let own = row.local(pairs, i, &self.velocity, &self.own);
            judge(self.rows.len() + i, &row.round, own);
        }
        let [inverse_speed, inverse_data] = data.inverses();
        let residual = violations.residual(inverse_speed, inverse_data);
        Measured {
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
    }

    /// See [`solve_body_pairs`].
    fn solve(
        &mut self,
        pairs: &BodyPairs<D>,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
    ) -> SolveReport {
        let n = pairs.len();
        assert!(
            q.len() == D * n && mu.len() == n && p.len() == D * n && u.len() == D * n,
            "q, mu, p and u must be of the same contacts"
        );
        let mut report = SolveReport {
            status: SolveStatus::Converged,
            iterations: 0,
            residual: 0.0,
            velocity_error: 0.0,
            work: 0,
            method: Method::GaussSeidel,
            stage: Stage::BodySweeps,
            rungs: Rungs::default(),
        };
        for (p, &mu) in p.as_chunks_mut::<D>().0.iter_mut().zip(mu) {
            // Project a start outside its cone (another μ, another step).
            if p.iter().all(|x| x.is_finite()) {
                p[0] = p[0].max(0.0);
                let limit = mu * p[0];
                draw_in(p, limit);
            } else {
                *p = [0.0; D];
            }
        }
        self.fit(pairs, q, mu, p);
        let (mut t, mut share, mut last_change) = (1.0_f64, 0.0, f64::INFINITY);
        // Violation, in tolerances, per N s of a sweep's change: tells when to compute the
        // residual.
        let (mut rate, mut last_look) = (f64::INFINITY, 0);
        loop {
            if report.iterations < options.max_sweeps {
                let change = self.sweep(pairs, share);
                report.iterations += 1;
                if change > last_change {
                    t = 1.0;
                }
                last_change = change;
                let is_due = rate * change.sqrt() <= 1.0
                    || report.iterations - last_look >= PATIENCE
                    || report.iterations == 1
                    || report.iterations == options.max_sweeps;
                if !is_due {
                    share = next_share(&mut t);
                    continue;
                }
            }
            let is_last = report.iterations >= options.max_sweeps;
            let mut measured = self.measure(pairs, p, u);
            if (is_last || measured.is_within(options))
                && let Some(share) = passive_share(measured.work, measured.free)
            {
                self.scale(share);
                measured = self.measure(pairs, p, u);
                t = 1.0;
            }
            let Residual { relative, velocity } = measured.residual;
            (report.residual, report.velocity_error) = (relative, velocity);
            if !measured.residual.is_finite() {
                report.status = SolveStatus::NonFinite;
                p.fill(0.0);
                u.fill(0.0);
                return report;
            }
            if measured.is_within(options) {
                return report;
            }
            if is_last {
                report.status = SolveStatus::MaxIterations;
                return report;
            }
            let violation =
                (relative / options.tolerance).max(velocity / options.velocity_tolerance);
            (rate, last_look) = (violation / last_change.sqrt(), report.iterations);
            share = next_share(&mut t);
        }
    }
}

/// Solves `K_μ* ∋ ũ ⊥ p ∈ K_μ`, `u = Zᵀ Z p + q`, among round bodies and a machine.
///
/// q (D n_c), m/s; mu (n_c); p (D n_c), N s: on entry the warm start, on return the impulses inside
/// their cones; u (D n_c), m/s: on return. Only the tolerances and `max_sweeps` of the options
/// apply, not the budget. Allocates only when there are more contacts than ever before.
///
/// # Panics
/// If a length does not fit.
pub fn solve_body_pairs<const D: usize>(
    pairs: &BodyPairs<D>,
    q: &[f64],
    mu: &[f64],
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    sweeps: &mut BodySweeps,
) -> SolveReport
where
    BodyPairs<D>: Swept<D>,
{
    let mut report = pairs.sweep(q, mu, options, p, u, sweeps);
    report.work = UNITS * (pairs.len() * report.iterations) as u64;
    report.rungs.push(Rung {
        stage: report.stage,
        status: report.status,
        iterations: report.iterations,
        ..Rung::default()
    });
    report
}

/// Extrapolation factor after a sweep; advances Nesterov's sequence.
fn next_share(t: &mut f64) -> f64 {
    let next = 0.5 * (1.0 + (1.0 + 4.0 * *t * *t).sqrt());
    let share = (*t - 1.0) / next;
    *t = next;
    share
}
