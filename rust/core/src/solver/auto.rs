//! The choice of method, and what all methods share: prepared scales, the acceptance test, the final report.

use super::methods::{Algorithm, Outcome};
use super::modes::Proximal;
use super::nsgs::Budget;
use super::report::{SolveReport, SolveStatus};
use super::workspace::SolverWorkspace;
use super::{Method, SolverOptions, guided, islands, newton, nsgs, pivoting, proximal};
use crate::law::coulomb::natural_map;
use crate::problem::{FrictionContactProblem, Operator, Residual, evaluate_contact};

/// The problem's slices and the scales derived from them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prepared<'a> {
    /// Delassus operator, 1/kg.
    pub W: Operator<'a>,
    /// Free velocity (n), m/s.
    pub q: &'a [f64],
    /// Friction coefficients.
    pub mu: &'a [f64],
    /// Number of unknowns.
    pub n: usize,
    /// Mean diagonal entry of `W`, 1/kg; 1 if not positive.
    pub mean_diagonal: f64,
    /// `1/|(ρ_i q_i)|`, or 1 if that is no number.
    pub inverse_data: f64,
}

impl<'a> Prepared<'a> {
    fn new<const D: usize>(
        problem: &FrictionContactProblem<'a>,
        W: Operator<'a>,
        workspace: &mut SolverWorkspace,
    ) -> Self {
        let dimension = problem.dimension();
        let (q, mu, n) = (
            problem.free_velocity(),
            problem.friction_coefficients(),
            problem.n_unknowns(),
        );
        let mut trace = 0.0;
        let mut data = 0.0;
        for i in 0..mu.len() {
            let normal = W.diagonal(dimension, n, i, 0);
            let mut tangential = 0.0;
            for k in 1..D {
                tangential += W.diagonal(dimension, n, i, k);
            }
            let own = normal + tangential;
            let rho = if own > 0.0 { D as f64 / own } else { 1.0 };
            workspace.rho[i] = rho;
            trace += normal + tangential;
            tangential /= (D - 1) as f64;
            workspace.rho_modes[i] = [
                if normal > 0.0 { 1.0 / normal } else { rho },
                if tangential > 0.0 {
                    1.0 / tangential
                } else {
                    rho
                },
            ];
            for q in &q[D * i..D * (i + 1)] {
                data += (rho * q) * (rho * q);
            }
        }
        let mean = trace / n.max(1) as f64;
        let inverse = 1.0 / data.sqrt();
        Self {
            W,
            q,
            mu,
            n,
            mean_diagonal: if mean > 0.0 && mean.is_finite() {
                mean
            } else {
                1.0
            },
            inverse_data: if inverse.is_finite() && inverse > 0.0 {
                inverse
            } else {
                1.0
            },
        }
    }

    /// Diagonal block of contact `i`, 1/kg.
    #[inline]
    pub fn block<const D: usize>(&self, i: usize) -> [[f64; D]; D] {
        self.W.block(self.n, i)
    }

    /// Residual of `(p, u)`; the same numbers as [`crate::problem::evaluate`], with the scales already at hand.
    #[inline]
    pub fn measure<const D: usize>(&self, rho: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let (mut map, mut velocity) = (0.0, 0.0_f64);
        for (i, (&mu, &rho)) in self.mu.iter().zip(rho).enumerate() {
            let square = evaluate_contact::<D>(p, u, D * i, mu, rho);
            map += square;
            velocity = velocity.max(square / (rho * rho));
        }
        if map.is_finite() {
            Residual {
                relative: map.sqrt() * self.inverse_data,
                velocity: velocity.sqrt(),
            }
        } else {
            Residual::UNSOLVED
        }
    }

    /// Squared natural map of the regularised problem (`W + α I`, `q − α c`) at `(p, u)`, `u = W p + q`, in (N s)².
    pub fn merit<const D: usize>(
        &self,
        rho: &[f64],
        prox: Proximal<'_>,
        p: &[f64],
        u: &[f64],
    ) -> f64 {
        let mut sum = 0.0;
        for (i, (&mu, &rho)) in self.mu.iter().zip(rho).enumerate() {
            let p_i: [f64; D] = std::array::from_fn(|k| p[D * i + k]);
            let u_hat = std::array::from_fn(|k| {
                u[D * i + k] + prox.alpha * (p_i[k] - prox.centre[D * i + k])
            });
            sum += natural_map(&p_i, &u_hat, mu, rho)
                .iter()
                .map(|x| x * x)
                .sum::<f64>();
        }
        sum
    }

    /// Whether both tolerances hold.
    #[inline]
    pub fn accepts(options: &SolverOptions, residual: Residual) -> bool {
        residual.relative <= options.tolerance && residual.velocity <= options.velocity_tolerance
    }

    /// Whether each contact's violation is within the rounding of its own rows of `W p + q`: then no impulse does better.
    pub fn is_within_rounding<const D: usize>(&self, rho: &[f64], p: &[f64], u: &[f64]) -> bool {
        self.mu.iter().zip(rho).enumerate().all(|(i, (&mu, &rho))| {
            let violation = evaluate_contact::<D>(p, u, D * i, mu, rho).sqrt() / rho;
            let size: f64 = (D * i..D * (i + 1))
                .map(|r| self.W.row_magnitude(r, p) + self.q[r].abs())
                .sum();
            violation <= 4.0 * f64::EPSILON * size
        })
    }
}

/// Solves in dimension `D`, see [`solve`](super::solve).
pub(super) fn solve_in<A: Algorithm, const D: usize>(
    problem: &FrictionContactProblem<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    if p.iter().any(|x| !x.is_finite()) {
        p.fill(0.0);
    }
    let (n_contacts, n) = (problem.n_contacts(), problem.n_unknowns());
    if let W @ Operator::Dense(_) = problem.operator()
        && n_contacts <= options.direct_contacts
    {
        workspace.fit(n_contacts, n, W);
        let data = Prepared::new::<D>(problem, W, workspace);
        return judge::<A, D>(&data, options, p, u, workspace);
    }
    // Taken out of the workspace while the solve borrows it.
    let mut storage = std::mem::take(&mut workspace.storage);
    let W = storage.choose(problem, options.direct_contacts);
    workspace.fit(n_contacts, n, W);
    let data = Prepared::new::<D>(problem, W, workspace);
    let report = judge::<A, D>(&data, options, p, u, workspace);
    workspace.storage = storage;
    report
}

/// Runs the method and judges what it returns.
fn judge<A: Algorithm, const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    let mut iterations = 0;
    let (method, status, residual) = A::run::<D>(data, options, p, u, workspace, &mut iterations);
    // An infinite velocity can hide from the natural map of an open contact.
    let is_finite = residual.is_finite() && p.iter().chain(u.iter()).all(|x| x.is_finite());
    if status == SolveStatus::NonFinite || !is_finite {
        p.fill(0.0);
        u.fill(0.0);
        return SolveReport {
            status: SolveStatus::NonFinite,
            iterations,
            residual: f64::INFINITY,
            velocity_error: f64::INFINITY,
            method,
        };
    }
    SolveReport {
        status,
        iterations,
        residual: residual.relative,
        velocity_error: residual.velocity,
        method,
    }
}

/// Most sweeps over many contacts before Newton. Dense, a Newton step costs about as much as `n` sweeps; block-sparse the fill grows with the problem; 20, 50 and 200 were
/// tried on the recorded ones.
fn sweep_budget(data: &Prepared<'_>) -> usize {
    match data.W {
        Operator::Dense(_) => 2 * data.n,
        Operator::BlockSparse(_) => (data.mu.len() / 20).max(50),
    }
}

/// [`Method::Auto`]: what is cheap first, what is robust last.
pub(super) fn escalate<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    workspace: &mut SolverWorkspace,
    iterations: &mut usize,
) -> Outcome {
    workspace.start.copy_from_slice(p);
    let steps = newton::FULL_STEPS.min(options.max_newton_steps);
    let is_few = data.mu.len() <= options.direct_contacts;
    let is_warm = p.iter().any(|x| x.abs() > 0.0);
    if !is_few {
        let budget = Budget {
            sweeps: sweep_budget(data),
            predict: true,
        };
        let (status, residual) =
            nsgs::sweeps::<D>(data, options, budget, p, u, workspace, iterations);
        if matches!(status, SolveStatus::Converged | SolveStatus::NonFinite) {
            return (Method::GaussSeidel, status, residual);
        }
        if let Operator::BlockSparse(W) = data.W
            && let Some(outcome) =
                islands::solve::<D>(data, W, options, p, u, workspace, iterations)
            && outcome.1 == SolveStatus::Converged
        {
            return outcome;
        }
        workspace.start.copy_from_slice(p);
    } else if is_warm {
        // Where the modes of the last step serve, this is the end; where they do not, more full steps seldom help.
        let few = newton::WARM_STEPS.min(steps);
        let (status, residual) =
            newton::full_steps::<D>(data, options, few, p, u, workspace, iterations);
        if status == SolveStatus::Converged {
            return (Method::Newton, status, residual);
        }
        p.copy_from_slice(&workspace.start);
        let (status, residual) = pivoting::pivots::<D>(data, options, p, u, workspace, iterations);
        if status == SolveStatus::Converged {
            return (Method::Newton, status, residual);
        }
        // A warm start can mislead where zero does not.
        p.fill(0.0);
    } else if data.q.chunks_exact(D).any(|q| q[0] < 0.0) {
        if let Some(residual) = guided::solve::<D>(data, options, p, u, workspace, iterations) {
            return (Method::Newton, SolveStatus::Converged, residual);
        }
        p.fill(0.0);
    }
    let (status, residual) =
        newton::full_steps::<D>(data, options, steps, p, u, workspace, iterations);
    if status == SolveStatus::Converged {
        return (Method::Newton, status, residual);
    }
    p.copy_from_slice(&workspace.start);
    let (status, residual) = proximal::solve::<D>(data, options, p, u, workspace, iterations);
    (Method::ProximalPoint, status, residual)
}
