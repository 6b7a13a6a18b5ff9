//! How the contacts of a step are solved: sweeps, and where they end early a search by factorisation.

use super::system::GrainSystem;
use crate::problem::{
    BodyPairs, FrictionContactProblem, Residual, dot, evaluate_into, passive_share,
};
use crate::solver::{
    LocalProblem, Method, SolveReport, SolveStatus, SolverOptions, SolverWorkspace, Swept, solve,
    solve_body_pairs,
};

/// Contacts up to which an answer that the sweeps did not reach is sought by factorisation: a step costs some 3 µs a contact there.
const FEW: usize = 1000;

/// Factorisations of such a search; wedged wheels have taken 77.
const ESCALATION_STEPS: usize = 200;

/// Such searches for one step, each after all the sweeps that are allowed.
const ESCALATIONS: usize = 3;

impl<const D: usize> GrainSystem<'_, D>
where
    BodyPairs<D>: Swept<D>,
{
    /// The problem of the step's contacts, with W.
    pub(super) fn sparse_problem<'a>(
        &'a self,
        q: &'a [f64],
        mu: &'a [f64],
    ) -> FrictionContactProblem<'a> {
        let operator = self.parts.operator();
        FrictionContactProblem::from_assembled_sparse(operator, q, mu)
    }

    /// Solves as the options' method asks; the usual way is sweeps with escalation.
    pub(super) fn solve_contacts(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        let sweep = |p: &mut [f64], u: &mut [f64], workspace: &mut SolverWorkspace| {
            let scratch = &mut workspace.body_sweeps;
            let problem = LocalProblem { q, mu };
            solve_body_pairs(&self.parts.pairs, problem, options, p, u, scratch)
        };
        match options.method {
            Method::GaussSeidel => sweep(p, u, workspace),
            Method::Auto => {
                let mut report = sweep(p, u, workspace);
                for _ in 0..ESCALATIONS {
                    if report.status != SolveStatus::MaxIterations || mu.len() > FEW {
                        break;
                    }
                    report = self.escalate(q, mu, options, (p, u), report, workspace);
                    if report.is_converged() {
                        break;
                    }
                    let (p_before, u_before) = (p.to_vec(), u.to_vec());
                    let swept = sweep(p, u, workspace);
                    let iterations = report.iterations + swept.iterations;
                    if !swept.is_converged() && excess(options, &report) < excess(options, &swept) {
                        // The sweeps led away from the nearest answer so far, and would again.
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
                report
            }
            _ => solve(&self.sparse_problem(q, mu), options, p, u, workspace),
        }
    }

    /// Goes on from where the sweeps stopped by the proximal-point method. The better of both answers stays, and adds no energy.
    fn escalate(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        (p, u): (&mut [f64], &mut [f64]),
        report: SolveReport,
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        let proximal = SolverOptions {
            method: Method::ProximalPoint,
            max_newton_steps: ESCALATION_STEPS,
            ..*options
        };
        let (p_swept, u_swept) = (p.to_vec(), u.to_vec());
        let problem = self.sparse_problem(q, mu);
        let mut found = solve(&problem, &proximal, p, u, workspace);
        found.iterations += report.iterations;
        if let Some(share) = passive_share(dot(p, u), dot(p, q)) {
            for p in &mut *p {
                *p *= share;
            }
            let Residual { relative, velocity } = evaluate_into(&problem, p, u);
            (found.residual, found.velocity_error) = (relative, velocity);
            if excess(options, &found) > 1.0 {
                found.status = SolveStatus::Stalled;
            }
        }
        if found.is_converged() || excess(options, &found) < excess(options, &report) {
            return found;
        }
        p.copy_from_slice(&p_swept);
        u.copy_from_slice(&u_swept);
        SolveReport {
            iterations: found.iterations,
            ..report
        }
    }
}

/// How far an answer is above the tolerances, as a factor.
fn excess(options: &SolverOptions, report: &SolveReport) -> f64 {
    (report.residual / options.tolerance).max(report.velocity_error / options.velocity_tolerance)
}
