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
use crate::solver::solve;

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
    ws.p_position.fill(0.0);
    let problem =
        FrictionContactProblem::from_assembled(Dimension::Three, &ws.system.W, &ws.q_free, &ws.mu);
    let solved = solve(
        &problem,
        &options.solver,
        &mut ws.p_position,
        &mut ws.u_position,
        &mut ws.solver,
    );
    note(report, &solved);
    ws.y.fill(0.0);
    ws.system
        .add_impulses(scene.model, &ws.p_position, &mut ws.y);
    ws.factor.half_solve_back(scene.model, &mut ws.y);
    ws.end.advance(&ws.y, 1.0);
}
