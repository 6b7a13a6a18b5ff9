//! Very many free bodies: sweeps on their velocities first, and methods that factor `W` if the
//! sweeps do not converge.
//!
//! The cost of a sweep is linear in the number of contacts, and it needs no `W`. Sweeps converge
//! slowly for wedged bodies. There the proximal point method continues from their result, and if it
//! does not converge either, the sweeps continue from the better of the two.

use super::islands::SolvePart;
use crate::problem::{
    BlockSparseDelassus, BodyPairs, FrictionContactProblem, Residual, dot, evaluate_into,
    passive_share,
};
use crate::solver::options::{Method, SolverOptions};
use crate::solver::report::{Rung, Rungs, SolveReport, SolveStatus};
use crate::solver::stage::body_sweeps::{BodySweeps, ContactSolution, Swept, solve_body_pairs};

/// Most contacts for which factorisation follows unsuccessful sweeps: a step then costs some 3 µs
/// per contact.
const FEW: usize = 1000;

/// Most factorisations of such a search; wedged wheels have needed 77.
const FACTORISATIONS: usize = 200;

/// Most such searches in a solve, each after all the sweeps that are allowed.
const SEARCHES: usize = 3;

/// The problem `u = Zᵀ Z p + q` of the contacts of free bodies and a machine in D dimensions.
#[derive(Clone, Copy)]
pub struct ManyBodies<'a, const D: usize> {
    /// The contacts, each with the data that it reads and changes.
    pub pairs: &'a BodyPairs<D>,
    /// Free velocity (D `n_c`), m/s.
    pub q: &'a [f64],
    /// Friction coefficients (`n_c`).
    pub mu: &'a [f64],
    /// `W`, used only if the sweeps do not converge.
    pub operator: &'a dyn Fn() -> &'a BlockSparseDelassus,
}

impl<const D: usize> std::fmt::Debug for ManyBodies<'_, D> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ManyBodies")
            .field("n_contacts", &self.mu.len())
            .finish_non_exhaustive()
    }
}

impl<'a, const D: usize> ManyBodies<'a, D> {
    /// Friction-contact problem of the bodies, with `W` assembled.
    fn problem(&self) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled_sparse((self.operator)(), self.q, self.mu)
    }
}

/// Solves with the chosen method. `solve` is the solver for a problem with `W`, which lies above
/// this module.
pub(in crate::solver) fn solve<const D: usize>(
    bodies: &ManyBodies<'_, D>,
    options: &SolverOptions,
    answer: ContactSolution<'_>,
    sweeps: &mut BodySweeps,
    solve: &mut SolvePart<'_>,
) -> SolveReport
where
    BodyPairs<D>: Swept<D>,
{
    // No method that factors W knows of moments.
    let method = if answer.rolling.is_empty() {
        options.method
    } else {
        Method::GaussSeidel
    };
    match method {
        Method::GaussSeidel => {
            solve_body_pairs(bodies.pairs, bodies.q, bodies.mu, options, answer, sweeps)
        }
        Method::Auto => escalate(bodies, options, answer, sweeps, solve),
        _ => solve(&bodies.problem(), options, answer.p, answer.u),
    }
}

/// Sweeps, and searches by factorisation with sweeps between them.
fn escalate<const D: usize>(
    bodies: &ManyBodies<'_, D>,
    options: &SolverOptions,
    ContactSolution { p, u, .. }: ContactSolution<'_>,
    sweeps: &mut BodySweeps,
    solve: &mut SolvePart<'_>,
) -> SolveReport
where
    BodyPairs<D>: Swept<D>,
{
    let mut sweep = |p: &mut [f64], u: &mut [f64]| {
        let rolling = &mut [];
        let answer = ContactSolution { p, u, rolling };
        solve_body_pairs(bodies.pairs, bodies.q, bodies.mu, options, answer, sweeps)
    };
    let mut report = sweep(p, u);
    let mut rungs = report.rungs;
    for _ in 0..SEARCHES {
        if report.status != SolveStatus::MaxIterations || bodies.mu.len() > FEW {
            break;
        }
        report = search(
            bodies,
            options,
            (&mut *p, &mut *u),
            &report,
            &mut rungs,
            solve,
        );
        if report.is_converged() {
            break;
        }
        let (p_before, u_before) = (p.to_vec(), u.to_vec());
        let swept = sweep(p, u);
        for rung in swept.rungs.as_slice() {
            rungs.push(*rung);
        }
        let iterations = report.iterations + swept.iterations;
        if !swept.is_converged() && excess(options, &report) < excess(options, &swept) {
            // The sweeps moved away from the best answer so far, and would do so again.
            p.copy_from_slice(&p_before);
            u.copy_from_slice(&u_before);
            report.iterations = iterations;
            break;
        }
        report = SolveReport {
            iterations,
            ..swept
        };
    }
    report.rungs = rungs;
    report
}

/// Continues from the result of the sweeps with the proximal point method. Keeps the better of the
/// two answers, which adds no energy.
fn search<const D: usize>(
    bodies: &ManyBodies<'_, D>,
    options: &SolverOptions,
    (p, u): (&mut [f64], &mut [f64]),
    report: &SolveReport,
    rungs: &mut Rungs,
    solve: &mut SolvePart<'_>,
) -> SolveReport {
    let proximal = SolverOptions {
        method: Method::ProximalPoint,
        max_newton_steps: FACTORISATIONS,
        ..*options
    };
    let (p_swept, u_swept) = (p.to_vec(), u.to_vec());
    let problem = bodies.problem();
    let mut found = solve(&problem, &proximal, p, u);
    if let Some(share) = passive_share(dot(p, u), dot(p, bodies.q)) {
        for p in &mut *p {
            *p *= share;
        }
        let Residual { relative, velocity } = evaluate_into(&problem, p, u);
        (found.residual, found.velocity_error) = (relative, velocity);
        if excess(options, &found) > 1.0 {
            found.status = SolveStatus::Stalled;
        }
    }
    rungs.push(Rung {
        stage: found.stage,
        status: found.status,
        iterations: Rung::count(found.iterations),
        factorisations: Rung::count(found.factorisations()),
    });
    found.iterations += report.iterations;
    if found.is_converged() || excess(options, &found) < excess(options, report) {
        return found;
    }
    p.copy_from_slice(&p_swept);
    u.copy_from_slice(&u_swept);
    SolveReport {
        iterations: found.iterations,
        ..*report
    }
}

/// Factor by which an answer exceeds the tolerances.
fn excess(options: &SolverOptions, report: &SolveReport) -> f64 {
    options.excess(Residual {
        relative: report.residual,
        velocity: report.velocity_error,
    })
}
