//! Moreau–Jean with Newton on the forces at the end of the step, in momentum form.
//!
//! Unknown v⁺ (and p). With the mean velocity `v̄ = θ v⁺ + (1−θ) v`, `q⁺ = q ⊕ h v̄`,
//! `q_m = q ⊕ θ h v̄`, and the momentum `(P_i, L_i)` of body i about a point fixed in the world,
//! d'Alembert's principle over the step reads, for every velocity k with screw S_k(q_m),
//!
//! ```text
//! Σ_{i moved by k} S_k · (ΔP_i − h m_i g, ΔL_i − h c̄_i × m_i g) = h τ_k + (H(q⁺) p + r)_k
//! ```
//!
//! Momenta at both ends are evaluated exactly, so no bias is needed. Summed over the base's six
//! screws, total linear and angular momentum change by the impulses alone: free flight conserves
//! them to the tolerance of the iteration, at any step. For θ = ½ the scheme is symmetric and of
//! order 2. The energy of free flight oscillates with the third power of the rotation per step and
//! does not drift; the audit ([`super::energy_audit`]) accepts this, since a correction would
//! violate the momentum. The iteration matrix M̂(q_m) differs from the true Jacobian by O(h), which
//! is also the convergence factor.
//!
//! Source: the discrete d'Alembert principle, as in Simo and Wong 1991 for one body; contacts and
//! the correction r as in [`super::moreau_jean`].

use super::contacting::{KeyOf, UnilateralContact};
use super::energy_audit::{Audit, GAIN, Verdict, note_energy_before};
use super::error::StepError;
use super::forces::{MOST_REVISIONS, Start};
use super::groups::Group;
use super::mechanical_system::MechanicalSystem;
use super::moreau_jean::{MoreauJean, finish};
use super::options::StepOptions;
use super::probe::{Phase, Probe};
use super::report::{StepReport, StepStatus};
use super::scheme::{Integrator, StateMut};
use super::scratch::ScratchOf;
use super::step_contacts::{
    add_correction, assemble_contacts, close_end, excuse_gaps, find_impacts, solve_contacts,
};
use super::warm_start::WarmStart;
use crate::contact::Activation;

/// Relative change below which an iteration that no longer contracts has reached rounding.
const ROUNDING: f64 = 1e-8;

/// Consecutive iterates with unsolved contacts after which the iteration stops.
const MOST_UNSOLVED: usize = 2;

/// Rotation in a step, rad, up to which the relative energy error of free flight may grow with the
/// third power of the rotation.
const MOST_TURN: f64 = 0.1;

/// The Newton variant.
#[derive(Clone, Copy, Debug, Default)]
pub struct MoreauJeanNewton;

impl<S: MechanicalSystem> Integrator<S> for MoreauJeanNewton {
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let ws = scratch;
        ws.fit(system.nv(), system.n_clusters());
        let start = Start {
            configuration: &*state.configuration,
            v: &*state.v,
        };
        note_energy_before(system, options, start, ws);
        system.choose_branches(start);
        system.begin_balance(start);
        ws.v.copy_from_slice(start.v);
        let (mut report, is_settled) = settle(system, options, start, warm_start, ws, probe);
        ws.leaves_open = false;
        let verdict = if is_settled {
            move_to_the_end(system, options, start, ws);
            close_end(system, ws, &mut report);
            let audit = Audit {
                is_last: |_: &Group| false,
                gain: GAIN,
                drift: drift(system, options, start),
            };
            let is_solved = report.is_converged();
            if !ws.before.is_empty() || ws.groups.all().any(|own| own.is_same) {
                find_impacts(system, options, warm_start, ws);
            }
            let verdict = audit.judge(system, options, start, warm_start, ws, &mut report);
            if is_solved { verdict } else { Verdict::Coarse }
        } else {
            // An iterate that has not converged satisfies no law.
            Verdict::Coarse
        };
        if verdict == Verdict::Coarse {
            // Take the linearised step and report it.
            let taken = MoreauJean.step(system, options, state, warm_start, ws, probe)?;
            return Ok(StepReport {
                newton_iterations: report.newton_iterations,
                retaken: taken.retaken + 1,
                ..taken
            });
        }
        // The contacts were measured at the end of the last iterate, the end of the step.
        ws.gap_end.clear();
        ws.gap_end
            .extend(ws.contacts.iter().map(UnilateralContact::gap));
        excuse_gaps(system, ws);
        finish(system, options, state, warm_start, ws, report, probe)
    }
}

/// Newton's iteration on the forces at the end of the step: its report, and whether it settled.
///
/// The loads that the motion leaves open are found in the last iterate alone, which the contraction
/// so far predicts, or which is the last one allowed.
fn settle<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
    probe: &mut dyn Probe,
) -> (StepReport, bool) {
    let mut report = StepReport {
        steps: 1,
        status: StepStatus::NotConverged,
        ..StepReport::default()
    };
    let mut is_settled = false;
    let mut revisions = 0;
    let mut unsolved = 0;
    let mut last_change = f64::INFINITY;
    ws.leaves_open = options.newton_max_iterations > 1;
    for iteration in 0..options.newton_max_iterations {
        let Some(solved) = iterate(system, options, start, warm_start, ws, iteration, probe) else {
            break;
        };
        report.iterations += solved.iterations;
        report.residual = solved.residual;
        report.n_contacts = solved.n_contacts;
        report.immovable_contacts = solved.immovable_contacts;
        report.newton_iterations = iteration + 1;
        // A maximum ignores NaN, so check for it.
        if !ws.v.iter().all(|x| x.is_finite()) {
            break;
        }
        // Iterating on an iterate that violates the law is useless; smaller steps have
        // different problems.
        unsolved = if solved.is_converged() {
            0
        } else {
            unsolved + 1
        };
        if unsolved == MOST_UNSOLVED {
            break;
        }
        let change = ws.dv.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let size = ws.v.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        // Converged, or as far as rounding allows: the change is small and no longer shrinks.
        let is_small = change <= options.newton_tolerance * size;
        let is_rounding = change <= ROUNDING * size && change >= 0.5 * last_change;
        let expected = change * (change / last_change);
        let left_open = ws.leaves_open && report.n_contacts > 0;
        let will_end = last_change.is_finite() && expected <= options.newton_tolerance * size;
        ws.leaves_open = !will_end && iteration + 2 < options.newton_max_iterations;
        last_change = change;
        if is_small || is_rounding {
            let is_open = left_open && system.open_problem(&ws.q_free, &ws.mu).is_some();
            if is_open && iteration + 1 < options.newton_max_iterations {
                ws.leaves_open = false;
                continue;
            }
            if revisions < MOST_REVISIONS && system.revise(start, &ws.v) {
                revisions += 1;
                last_change = f64::INFINITY;
                continue;
            }
            is_settled = true;
            report.status = solved.status;
            report.budget_exhausted = solved.budget_exhausted;
            break;
        }
    }
    (report, is_settled)
}

/// `ws.end` for the velocity `ws.v`.
fn move_to_the_end<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
) {
    let (h, theta) = (options.time_step, options.theta);
    for ((mean, end), begin) in ws.v_mean.iter_mut().zip(&ws.v).zip(start.v) {
        *mean = theta * end + (1.0 - theta) * begin;
    }
    system.set_moved(start.configuration, &ws.v_mean, h, &mut ws.end);
}

/// Fraction of the kinetic energy that free flight may gain or lose in the step.
fn drift<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
) -> f64 {
    let turn = options.time_step * system.turning(start.v);
    if system.conserves_momenta() && turn <= MOST_TURN {
        turn * turn * turn
    } else {
        0.0
    }
}

/// One iteration: `ws.v` changes by `ws.dv`. None if the mass matrix cannot be factored, which
/// means that the iterate has diverged.
fn iterate<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
    iteration: usize,
    probe: &mut dyn Probe,
) -> Option<StepReport> {
    let (h, theta) = (options.time_step, options.theta);

    for ((mean, end), begin) in ws.v_mean.iter_mut().zip(&ws.v).zip(start.v) {
        *mean = theta * end + (1.0 - theta) * begin;
    }
    system.set_moved(start.configuration, &ws.v_mean, theta * h, &mut ws.middle);
    system.set_moved(start.configuration, &ws.v_mean, h, &mut ws.end);
    system.place_middle(&ws.middle);
    system.place_end(&ws.end);
    probe.end(Phase::Kinematics);
    if iteration == 0 {
        // The set of contacts of a step is decided once, by the forecast.
        let (gravity, measured) = (options.gravity.into(), theta * h);
        let activation = Activation::of_step(gravity, h, options.forecast, measured);
        system.detect(start.v, activation, &mut ws.contacts);
        (ws.groups).find(system, options, &ws.contacts, warm_start, &[]);
    }
    system.relocate(&mut ws.contacts);
    probe.end(Phase::Detection);
    system.update_mass_matrix(options);
    probe.end(Phase::MassMatrix);
    system.balance(
        options,
        start,
        &ws.v,
        &ws.v_mean,
        &mut ws.correction,
        &mut ws.impulse,
    );
    probe.end(Phase::Bias);
    if !system.factorise(options) {
        return None;
    }
    ws.half_solve(|impulse| system.half_solve(impulse));
    probe.end(Phase::Factor);
    assemble_contacts(system, options, start.v, warm_start, ws);
    add_correction(system, options, warm_start, ws);
    if iteration > 0 {
        ws.p.copy_from_slice(&ws.p_last);
    }
    probe.end(Phase::Delassus);
    let solved = solve_contacts(system, options, start.v, ws, iteration == 0, probe);
    ws.p_last.clone_from(&ws.p);
    probe.end(Phase::Update);
    Some(solved)
}
