//! Removal of penetration: projection of the position onto gap ≥ 0 (combined scheme).
//!
//! The displacement is that of a friction-contact problem at position level, with the step's own operator:
//! `d = W λ + (gap, 0, 0)`, `0 ≤ d_N ⊥ λ_N ≥ 0`, and Coulomb's law on the tangential displacement. The friction keeps a parked rover from
//! being shifted down its slope by the correction. It runs only where more than `penetration_tolerance` is left, and leaves
//! alone a contact that is bouncing off and will be out by itself after the next step.
//!
//! Source: Acary 2013, *Projected event-capturing time-stepping schemes for nonsmooth mechanical systems with unilateral
//! contact and Coulomb's friction*, CMAME 256, 224–250.

use super::Scene;
use super::moreau_jean::note;
use super::options::Stabilisation;
use super::report::StepReport;
use super::workspace::Workspace;
use crate::problem::{Dimension, FrictionContactProblem};
use crate::solver::{SolveReport, SolveStatus, solve};

/// Corrects `ws.end`, where the contacts are predicted to have the gaps `ws.gap_end`.
pub(super) fn project(scene: &Scene<'_>, ws: &mut Workspace, report: &mut StepReport) {
    let options = scene.options;
    if options.stabilisation == Stabilisation::None {
        return;
    }
    let stays = |gap: f64, u_N: f64| gap + options.time_step * u_N < 0.0;
    let mut deepest = 0.0_f64;
    for (gap, u) in ws.gap_end.iter_mut().zip(ws.u.chunks_exact(3)) {
        if *gap < 0.0 && !stays(*gap, u[0]) {
            *gap = 0.0;
        }
        deepest = deepest.min(*gap);
    }
    if deepest >= -options.penetration_tolerance {
        return;
    }
    ws.q_free.fill(0.0);
    for (q, gap) in ws.q_free.chunks_exact_mut(3).zip(&ws.gap_end) {
        q[0] = *gap;
    }
    ws.p_position.resize(ws.p.len(), 0.0);
    ws.u_position.resize(ws.p.len(), 0.0);
    let limit = -FARTHEST * deepest;
    let mut solved = displace(scene, ws);
    let is_finite = solved.status != SolveStatus::NonFinite;
    if is_finite && (!solved.is_converged() || size(ws) > limit) {
        // Friction locks a wedge, or fights itself over nanometres: the shortest way out needs none.
        ws.mu.fill(0.0);
        solved = displace(scene, ws);
        ws.mu.fill(options.friction_coefficient);
    }
    note(report, &solved);
    let share = (limit / size(ws)).min(1.0);
    ws.end.advance(&ws.y, share);
}

/// Solves for the displacement `ws.y` with the coefficients in `ws.mu`.
fn displace(scene: &Scene<'_>, ws: &mut Workspace) -> SolveReport {
    ws.p_position.fill(0.0);
    let problem =
        FrictionContactProblem::from_assembled(Dimension::Three, &ws.system.W, &ws.q_free, &ws.mu);
    let solved = solve(
        &problem,
        &scene.options.solver,
        &mut ws.p_position,
        &mut ws.u_position,
        &mut ws.solver,
    );
    ws.y.fill(0.0);
    ws.system
        .add_impulses(scene.model, &ws.p_position, &mut ws.y);
    ws.factor.half_solve_back(scene.model, &mut ws.y);
    solved
}

/// How far a displacement goes, m: the contacts' points, the trunk's origin, and what turns by so much at arm's length.
fn size(ws: &Workspace) -> f64 {
    // d = W λ is what the answer u = d + (gap, 0, 0) holds beside the gaps.
    let points = ws.u_position.iter().zip(&ws.q_free).map(|(u, q)| u - q);
    let trunk = ws.y[..6].iter().copied();
    let joints = ws.y[6..].iter().map(|angle| angle * JOINT_ARM);
    let all = points.chain(trunk).chain(joints);
    all.fold(0.0_f64, |m, d| m.max(d.abs()))
}

/// Arm at which a joint's turn counts, m. A freely steered wheel that is freed of 2 cm turns by 0.4 rad.
const JOINT_ARM: f64 = 0.05;

/// How far a displacement may go, as a multiple of the deepest penetration; the rest is left to the next steps.
///
/// A wheel that an impact left in the wedge between a stone and the ground is locked there by friction: the linearised problem
/// then has its answer a metre away, and a rover was thrown up by that much over 2 cm.
const FARTHEST: f64 = 4.0;
