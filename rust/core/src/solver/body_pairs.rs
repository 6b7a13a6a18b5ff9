//! Gauss–Seidel for many bodies that share nothing but their contacts: no operator is built at all.
//!
//! A contact touches two bodies, so its sweep needs only their velocities: with `u = Zᵀ y + q` and `y = Z p` in factor coordinates
//! (see [`crate::integrator::mechanical_system`]) one contact reads six numbers, solves its law and changes six numbers. A sweep costs the same for
//! each contact, however many there are, and a disc against a disc has a diagonal block of W: normal and tangent are solved one after the other,
//! exactly.
//!
//! Contacts are swept forwards and backwards in turn. The answer is judged as every solver's: by the natural map of the returned impulse, with
//! `y = Z p` summed anew.
//!
//! Source: Jean 1999; Moreau 1999 (contact by contact on the bodies' velocities).

use super::one_contact::solve_one_contact;
use super::options::{Method, SolverOptions};
use super::report::{SolveReport, SolveStatus};
use crate::law::coulomb::natural_map;
use crate::problem::Residual;

/// Coordinates of the one body that is no disc.
pub const WIDE: usize = 5;

/// A contact of two discs, or of a disc with what does not move.
///
/// `u = (n·(w_a − w_b), t·(w_a − w_b) + s_a y_a3 + s_b y_b3)` with `w = c (y_1, y_2)`, t = n × e_z.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DiscPair {
    /// Place of each body's three factor coordinates; any place, with c = s = 0, for one that does not move.
    pub bodies: [u32; 2],
    /// Unit normal, from the second body into the first.
    pub n: [f64; 2],
    /// c: `1/√m` of each body, 0 for one that does not move.
    pub linear: [f64; 2],
    /// s: `r/√J` of each body, 0 for one that does not move.
    pub angular: [f64; 2],
}

/// A contact of the wide body with a disc, or with what does not move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WidePair {
    /// Rows n and t of Zᵀ in the wide body's factor coordinates.
    pub rows: [[f64; WIDE]; 2],
    /// The disc as second body: its place, c, s and the normal from it into the wide body.
    pub disc: DiscPair,
}

/// All contacts of a step: first the discs' pairs, then the wide body's.
#[derive(Clone, Debug, Default)]
pub struct BodyPairs {
    /// Contacts among discs.
    pub discs: Vec<DiscPair>,
    /// Contacts of the wide body.
    pub wide: Vec<WidePair>,
    /// Place of the wide body's coordinates.
    pub wide_at: usize,
    /// Number of factor coordinates.
    pub n_coordinates: usize,
}

/// Scratch of [`solve_body_pairs`].
#[derive(Clone, Debug, Default)]
pub struct BodyPairsWorkspace {
    y: Vec<f64>,
    rows: Vec<Row>,
}

/// What a sweep reads and writes of a contact among discs, side by side in memory.
#[derive(Clone, Copy, Debug)]
struct Row {
    pair: DiscPair,
    /// `1/W_NN`, `1/W_TT`, kg.
    inverse: [f64; 2],
    q: [f64; 2],
    mu: f64,
    p: [f64; 2],
}

impl DiscPair {
    /// u without q.
    #[inline]
    #[must_use]
    pub fn local(&self, y: &[f64]) -> [f64; 2] {
        let (a, b) = (self.bodies[0] as usize, self.bodies[1] as usize);
        let (ya, yb) = (&y[a..a + 3], &y[b..b + 3]);
        let [n_x, n_y] = self.n;
        let [ca, cb] = self.linear;
        let [sa, sb] = self.angular;
        let (wx, wy) = (ca * ya[0] - cb * yb[0], ca * ya[1] - cb * yb[1]);
        [
            n_x * wx + n_y * wy,
            n_y * wx - n_x * wy + sa * ya[2] + sb * yb[2],
        ]
    }

    /// `y += Z p`.
    #[inline]
    pub fn add(&self, p: [f64; 2], y: &mut [f64]) {
        let (a, b) = (self.bodies[0] as usize, self.bodies[1] as usize);
        let [n_x, n_y] = self.n;
        let (fx, fy) = (n_x * p[0] + n_y * p[1], n_y * p[0] - n_x * p[1]);
        let ya = &mut y[a..a + 3];
        ya[0] += self.linear[0] * fx;
        ya[1] += self.linear[0] * fy;
        ya[2] += self.angular[0] * p[1];
        let yb = &mut y[b..b + 3];
        yb[0] -= self.linear[1] * fx;
        yb[1] -= self.linear[1] * fy;
        yb[2] += self.angular[1] * p[1];
    }

    /// `W_NN`, `W_TT`, 1/kg; `W_NT` is 0.
    #[inline]
    #[must_use]
    pub fn block(&self) -> [f64; 2] {
        let square = |[a, b]: [f64; 2]| a * a + b * b;
        let normal = square(self.linear);
        [normal, normal + square(self.angular)]
    }
}

impl WidePair {
    /// u without q.
    #[inline]
    #[must_use]
    pub fn local(&self, wide_at: usize, y: &[f64]) -> [f64; 2] {
        let mut u = self.disc.local(y);
        let own = &y[wide_at..wide_at + WIDE];
        for (u, row) in u.iter_mut().zip(&self.rows) {
            *u += row.iter().zip(own).map(|(a, b)| a * b).sum::<f64>();
        }
        u
    }

    /// `y += Z p`.
    #[inline]
    pub fn add(&self, wide_at: usize, p: [f64; 2], y: &mut [f64]) {
        self.disc.add(p, y);
        let own = &mut y[wide_at..wide_at + WIDE];
        for (row, p) in self.rows.iter().zip(p) {
            for (y, z) in own.iter_mut().zip(row) {
                *y += z * p;
            }
        }
    }

    /// Block of W, 1/kg.
    #[must_use]
    pub fn block(&self) -> [[f64; 2]; 2] {
        let dot = |a: &[f64; WIDE], b: &[f64; WIDE]| a.iter().zip(b).map(|(a, b)| a * b).sum();
        let [n, t] = &self.rows;
        let [disc_n, disc_t] = self.disc.block();
        let cross: f64 = dot(n, t);
        let (own_n, own_t): (f64, f64) = (dot(n, n), dot(t, t));
        [[own_n + disc_n, cross], [cross, own_t + disc_t]]
    }
}

impl BodyPairs {
    /// Number of contacts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.discs.len() + self.wide.len()
    }

    /// Whether there is no contact.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `y += Z p`.
    pub fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        let (discs, wide) = p.split_at(2 * self.discs.len());
        for (pair, p) in self.discs.iter().zip(discs.chunks_exact(2)) {
            pair.add([p[0], p[1]], y);
        }
        for (pair, p) in self.wide.iter().zip(wide.chunks_exact(2)) {
            pair.add(self.wide_at, [p[0], p[1]], y);
        }
    }

    /// `out = Zᵀ y`.
    pub fn local(&self, y: &[f64], out: &mut [f64]) {
        let (discs, wide) = out.split_at_mut(2 * self.discs.len());
        for (pair, out) in self.discs.iter().zip(discs.chunks_exact_mut(2)) {
            out.copy_from_slice(&pair.local(y));
        }
        for (pair, out) in self.wide.iter().zip(wide.chunks_exact_mut(2)) {
            out.copy_from_slice(&pair.local(self.wide_at, y));
        }
    }

    /// The residual of p as [`crate::problem::residual::evaluate_into`] defines it, with `u = Zᵀ Z p + q` on the way.
    fn measure(&self, q: &[f64], mu: &[f64], p: &[f64], u: &mut [f64], y: &mut [f64]) -> Residual {
        y.fill(0.0);
        self.add_impulses(p, y);
        self.local(y, u);
        let (mut map, mut data, mut velocity) = (0.0, 0.0, 0.0_f64);
        for i in 0..self.len() {
            let [normal, tangent] = if let Some(pair) = self.discs.get(i) {
                pair.block()
            } else {
                let block = self.wide[i - self.discs.len()].block();
                [block[0][0], block[1][1]]
            };
            let trace = normal + tangent;
            let rho = if trace > 0.0 { 2.0 / trace } else { 1.0 };
            u[2 * i] += q[2 * i];
            u[2 * i + 1] += q[2 * i + 1];
            let [f_n, f_t] = natural_map(
                &[p[2 * i], p[2 * i + 1]],
                &[u[2 * i], u[2 * i + 1]],
                mu[i],
                rho,
            );
            let square = f_n * f_n + f_t * f_t;
            map += square;
            velocity = velocity.max(square / (rho * rho));
            let (q_n, q_t) = (rho * q[2 * i], rho * q[2 * i + 1]);
            data += q_n * q_n + q_t * q_t;
        }
        // A NaN anywhere is in the sum.
        if !f64::is_finite(map) {
            return Residual::UNSOLVED;
        }
        Residual {
            relative: if data > 0.0 {
                f64::sqrt(map / data)
            } else {
                f64::sqrt(map)
            },
            velocity: velocity.sqrt(),
        }
    }
}

#[inline]
fn sweep_disc(row: &mut Row, y: &mut [f64]) {
    let [w_n, w_t] = row.pair.local(y);
    let [i_n, i_t] = row.inverse;
    let p_n = (row.p[0] - (w_n + row.q[0]) * i_n).max(0.0);
    let limit = row.mu * p_n;
    let p_t = (row.p[1] - (w_t + row.q[1]) * i_t).clamp(-limit, limit);
    let change = [p_n - row.p[0], p_t - row.p[1]];
    row.p = [p_n, p_t];
    row.pair.add(change, y);
}

/// Solves `K_μ* ∋ ũ ⊥ p ∈ K_μ`, `u = Zᵀ Z p + q`, in the plane.
///
/// q (2 n_c), m/s; mu (n_c); p (2 n_c), N s: in, the warm start, out, the impulses inside their cones; u (2 n_c), m/s: out. Only
/// the tolerances and `max_sweeps` of the options matter. Allocates only when there are more contacts than ever before.
///
/// # Panics
/// If a length does not fit.
pub fn solve_body_pairs(
    pairs: &BodyPairs,
    q: &[f64],
    mu: &[f64],
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut BodyPairsWorkspace,
) -> SolveReport {
    let n = pairs.len();
    assert!(
        q.len() == 2 * n && mu.len() == n && p.len() == 2 * n && u.len() == 2 * n,
        "q, mu, p and u must be of the same contacts"
    );
    let mut report = SolveReport {
        status: SolveStatus::Converged,
        iterations: 0,
        residual: 0.0,
        velocity_error: 0.0,
        method: Method::GaussSeidel,
    };
    let BodyPairsWorkspace { y, rows } = workspace;
    y.resize(pairs.n_coordinates, 0.0);
    let n_discs = pairs.discs.len();
    for (p, &mu) in p.chunks_exact_mut(2).zip(mu) {
        // A start outside its cone (another μ, another step) is drawn in.
        let is_sound = p[0].is_finite() && p[1].is_finite();
        p[0] = if is_sound { p[0].max(0.0) } else { 0.0 };
        p[1] = if is_sound {
            p[1].clamp(-mu * p[0], mu * p[0])
        } else {
            0.0
        };
    }
    rows.clear();
    rows.extend(pairs.discs.iter().enumerate().map(|(i, pair)| {
        let invert = |w: f64| if w > 0.0 { 1.0 / w } else { 0.0 };
        Row {
            pair: *pair,
            inverse: pair.block().map(invert),
            q: [q[2 * i], q[2 * i + 1]],
            mu: mu[i],
            p: [p[2 * i], p[2 * i + 1]],
        }
    }));
    loop {
        let residual = pairs.measure(q, mu, p, u, y);
        (report.residual, report.velocity_error) = (residual.relative, residual.velocity);
        if !residual.is_finite() {
            report.status = SolveStatus::NonFinite;
            p.fill(0.0);
            u.fill(0.0);
            return report;
        }
        if residual.relative <= options.tolerance && residual.velocity <= options.velocity_tolerance
        {
            return report;
        }
        if report.iterations >= options.max_sweeps {
            report.status = SolveStatus::MaxIterations;
            return report;
        }
        // The measure costs a sweep: look often at first, then every tenth sweep.
        let batch = (report.iterations / 2)
            .clamp(2, 10)
            .min(options.max_sweeps - report.iterations);
        for k in 0..batch {
            if (report.iterations + k).is_multiple_of(2) {
                for row in rows.iter_mut() {
                    sweep_disc(row, y);
                }
                sweep_wide(pairs, q, mu, p, y);
            } else {
                sweep_wide(pairs, q, mu, p, y);
                for row in rows.iter_mut().rev() {
                    sweep_disc(row, y);
                }
            }
        }
        report.iterations += batch;
        for (row, p) in rows.iter().zip(p[..2 * n_discs].chunks_exact_mut(2)) {
            p.copy_from_slice(&row.p);
        }
    }
}

fn sweep_wide(pairs: &BodyPairs, q: &[f64], mu: &[f64], p: &mut [f64], y: &mut [f64]) {
    for (i, pair) in (pairs.discs.len()..).zip(&pairs.wide) {
        let own = &mut p[2 * i..2 * i + 2];
        let block = pair.block();
        let u = pair.local(pairs.wide_at, y);
        let free =
            [0, 1].map(|r| u[r] + q[2 * i + r] - block[r][0] * own[0] - block[r][1] * own[1]);
        let solved = solve_one_contact(&block, &free, mu[i]).impulse;
        if !(solved[0].is_finite() && solved[1].is_finite()) {
            continue;
        }
        pair.add(pairs.wide_at, [solved[0] - own[0], solved[1] - own[1]], y);
        own.copy_from_slice(&solved);
    }
}
