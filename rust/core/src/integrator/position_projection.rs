//! Removal of penetration: projection of the position onto gap ≥ 0 (combined scheme).
//!
//! The displacement solves a friction-contact problem at position level with the operator of the
//! step: `d = W λ + (gap, 0, 0)`, `0 ≤ d_N ⊥ λ_N ≥ 0`, and Coulomb's law on the tangential
//! displacement. Friction prevents the correction from shifting a parked rover down its slope. The
//! projection runs only if penetration exceeds `penetration_tolerance`, and it skips a contact that
//! is bouncing off and will have separated after the next step. The velocity is scaled to the
//! kinetic energy before the projection (`carried_velocity`).
//!
//! Source: Acary 2013, *Projected event-capturing time-stepping schemes for nonsmooth mechanical
//! systems with unilateral contact and Coulomb's friction*, CMAME 256, 224–250.

use super::island::{Level, soften};
use super::mechanical_system::MechanicalSystem;
use super::options::{Stabilisation, StepOptions};
use super::report::StepReport;
use super::scratch::{Scratch, ScratchOf};
use super::step_contacts::{set_friction, solve_group};
use crate::problem::{FrictionContactProblem, Operator};
use crate::solver::{SolveReport, SolveStatus, SolverOptions, solve};

/// Corrects `ws.end`, where the contacts have the predicted gaps `ws.gap_end`; true if it moved, by
/// `ws.dv`.
pub(super) fn project<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
    report: &mut StepReport,
) -> bool {
    if options.stabilisation != Stabilisation::Projection {
        return false;
    }
    let d = S::DIMENSION.components();
    let stays = |gap: f64, u_N: f64| gap + options.time_step * u_N < 0.0;
    for (gap, u) in ws.gap_end.iter_mut().zip(ws.u.chunks_exact(d)) {
        if *gap < 0.0 && !stays(*gap, u[0]) {
            *gap = 0.0;
        }
    }
    let mut has_moved = false;
    for number in 0..ws.groups.n() {
        let own = ws.gap_end.iter().enumerate();
        let own = own.filter(|(i, _)| ws.groups.of_contact(*i) == number);
        let own = own.map(|(i, gap)| gap * system.lever(&ws.contacts[i]));
        let deepest = own.fold(0.0_f64, f64::min);
        if deepest >= -ws.groups.group(number).tolerated {
            continue;
        }
        if !has_moved {
            ws.p_position.clear();
            ws.p_position.resize(ws.p.len(), 0.0);
        }
        let share = project_group(system, options, ws, (number, deepest), report);
        has_moved = true;
        let own = ws.groups.group_mut(number);
        (own.is_moved, own.share) = (true, share);
    }
    if has_moved {
        for (k, displacement) in ws.dv.iter_mut().enumerate() {
            let group = ws.groups.of_cluster(system.cluster_of_velocity(k));
            *displacement *= ws.groups.group(group).share;
        }
        ws.keep_ends(system);
        system.advance(&mut ws.end, &ws.dv, 1.0);
    }
    has_moved
}

/// Adds the displacement of a group, whose deepest gap is `deepest`, to `ws.dv`; returns which
/// share of it is to be made.
fn project_group<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
    (number, deepest): (usize, f64),
    report: &mut StepReport,
) -> f64 {
    let d = S::DIMENSION.components();
    // The step's own problem stays to be read.
    std::mem::swap(&mut ws.q_free, &mut ws.q_position);
    ws.q_free.clear();
    ws.q_free.resize(ws.p.len(), 0.0);
    for (i, (q, gap)) in ws.q_free.chunks_exact_mut(d).zip(&ws.gap_end).enumerate() {
        if ws.groups.of_contact(i) == number {
            q[0] = *gap;
        }
    }
    ws.u_position.resize(ws.p.len(), 0.0);
    let limit = -FARTHEST * deepest;
    let mut solved = displace(system, options, ws, number, 0.0);
    let is_finite = solved.status != SolveStatus::NonFinite;
    if is_finite && (!solved.is_converged() || size(system, ws, number) > limit) {
        // Friction locks a wedge, or stalls over nanometres: retry without friction, along the
        // shortest way out.
        ws.mu.fill(0.0);
        solved = displace(system, options, ws, number, 0.0);
        if !solved.is_converged() {
            // A part wedged between opposed contacts cannot be freed. With slightly compliant
            // ground the problem has a solution, which opens each gap as far as the others allow.
            solved = displace(system, options, ws, number, COMPLIANCE);
        }
        set_friction(system, options, &ws.contacts, &mut ws.mu);
    }
    let residual = report.residual;
    report.enter(&solved);
    if solved.is_converged() {
        // The report's residual is that of the velocities, which are held to more.
        report.residual = residual;
    }
    let share = (limit / size(system, ws, number)).min(1.0);
    std::mem::swap(&mut ws.q_free, &mut ws.q_position);
    share
}

/// Share of the tolerated penetration that many contacts are projected to. Few are projected to the
/// last digits, which costs them nothing.
const EXACT: f64 = 1e-3;

/// Relative residual asked of the displacement for the gaps `ws.gap_end`.
fn tolerance<Q: Clone, C>(options: &StepOptions, ws: &Scratch<Q, C>, number: usize) -> f64 {
    let own = options.solver.tolerance;
    if ws.groups.group(number).n_contacts <= options.solver.direct_contacts {
        return own;
    }
    let gaps = ws.gap_end.iter().enumerate();
    let gaps = gaps.filter(|(i, _)| ws.groups.of_contact(*i) == number);
    let size = gaps.map(|(_, gap)| gap * gap).sum::<f64>().sqrt();
    own.max((EXACT * ws.groups.group(number).tolerated / size).min(EXACT))
}

/// Compliance of the ground for a wedged machine that nothing else frees, relative to that of W.
const COMPLIANCE: f64 = 1e-2;

/// Solves for the displacement `ws.dv` with the coefficients in `ws.mu`, on
/// ground of a compliance relative to W's mean.
fn displace<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
    number: usize,
    compliance: f64,
) -> SolveReport {
    let d = S::DIMENSION.components();
    for (i, p) in ws.p_position.chunks_exact_mut(d).enumerate() {
        if ws.groups.of_contact(i) == number {
            p.fill(0.0);
        }
    }
    let solver_options = SolverOptions {
        tolerance: tolerance(options, ws, number),
        ..ws.solver_options(&options.solver)
    };
    if ws.groups.are_several() {
        let solver_options = SolverOptions {
            budget: options.solver.budget,
            ..solver_options
        };
        ws.u_position.copy_from_slice(&ws.q_free);
        let level = Level::Position(compliance);
        if let Some(solved) = solve_group(system, &solver_options, ws, number, level) {
            ws.y.fill(0.0);
            system.add_impulses(&ws.p_position, &mut ws.y);
            ws.half_solve_back(|y| system.half_solve_back(y));
            return solved;
        }
    }
    let operator = (compliance > 0.0).then(|| system.problem(&ws.q_free, &ws.mu).operator());
    let solved = if let Some(Operator::Dense(W)) = operator {
        let mut W = W.to_vec();
        soften(&mut W, compliance);
        solve(
            &FrictionContactProblem::from_assembled(S::DIMENSION, &W, &ws.q_free, &ws.mu),
            &solver_options,
            &mut ws.p_position,
            &mut ws.u_position,
            &mut ws.solver,
        )
    } else {
        system.solve(
            &ws.q_free,
            &ws.mu,
            &solver_options,
            &mut ws.p_position,
            &mut ws.u_position,
            &mut ws.solver,
        )
    };
    ws.work_spent += solved.work;
    ws.y.fill(0.0);
    system.add_impulses(&ws.p_position, &mut ws.y);
    ws.half_solve_back(|y| system.half_solve_back(y));
    solved
}

/// Size of a displacement, m: the largest at the contact points and at the points that the system
/// adds.
fn size<S: MechanicalSystem>(system: &S, ws: &ScratchOf<S>, number: usize) -> f64 {
    let d = S::DIMENSION.components();
    let own = |i: &usize| ws.groups.of_contact(i / d) == number;
    // The answer is u = d + (gap, 0, 0) with d = W λ: subtract the gaps.
    let points = (0..ws.u_position.len()).filter(own);
    let points = points.map(|i| {
        let lever = system.lever(&ws.contacts[i / d]);
        (ws.u_position[i] - ws.q_free[i]) * lever
    });
    let clusters = 0..ws.groups.n();
    let clusters = clusters.filter(|own| ws.groups.of_cluster(*own) == number);
    let elsewhere = clusters.map(|own| system.displacement(&ws.dv, own));
    let elsewhere = elsewhere.fold(0.0, f64::max);
    points.fold(elsewhere, |m, d| m.max(d.abs()))
}

/// Largest displacement, as a multiple of the deepest penetration; the rest is left to the next
/// steps.
///
/// Friction locks a wheel that an impact left wedged between a stone and the ground. The solution
/// of the linearised problem may then lie a metre away: without this limit a penetration of 2 cm
/// threw a rover up by that much.
pub(crate) const FARTHEST: f64 = 4.0;
