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
//! does not drift; the audit accepts this, since a correction would
//! violate the momentum. The iteration matrix M̂(q_m) differs from the true Jacobian by O(h), which
//! is also the convergence factor.
//!
//! Source: the discrete d'Alembert principle, as in Simo and Wong 1991 for one body; contacts and
//! the correction r as in [`super::scheme`].

use super::balance::{AuditLimits, GAIN};
use super::closing::close_end;
use super::dynamics::Dynamics;
use super::error::StepError;
use super::forces::{Forces, MOST_REVISIONS, StepStart};
use super::impacts::{find_contact_work, find_impacts};
use super::listed::{Listed, ListedData, PosedOf};
use super::load::correct_impulse;
use super::local::Local;
use super::mechanical_system::{ConfigurationOf, KeyOf, MechanicalSystem};
use super::moreau_jean::{advance, begin, project_and_accept};
use super::options::StepOptions;
use super::probe::{Phase, Probe};
use super::report::{StepReport, StepStatus};
use super::scheme::recall;
use super::scratch::{ScratchOf, StateMut, StepScratch};
use super::shortening::judge_at_last;
use super::stepping::Integrator;
use super::systems::Systems;
use super::warm_start::WarmStart;
use super::yielding::{add_shifts, forget_bounces, remove_shifts, yield_under_load};
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
        mut state: StateMut<'_, ConfigurationOf<S>>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        scratch.load(system, &state, warm_start);
        let StepScratch {
            data: d,
            list,
            problems,
            gaps,
            ..
        } = &mut *scratch;
        let s = &mut Listed {
            system,
            options,
            list,
        };
        let (report, is_settled) = settle(s, d, problems, probe);
        s.list.leaves_open = false;
        let report = if is_settled && conclude(s, d, problems, report) {
            // The contacts were measured at the end of the last iterate, the end of the step.
            d.is_at_end = true;
            project_and_accept(s, d, gaps, probe)?;
            d.reports[0]
        } else {
            // An iterate that has not converged satisfies no law: take the linearised step and
            // report it.
            let taken = advance(system, options, scratch, probe)?;
            StepReport {
                newton_iterations: report.newton_iterations,
                retaken: report.retaken + taken.retaken + 1,
                ..taken
            }
        };
        scratch.store(&mut state, warm_start);
        Ok(report)
    }
}

/// The end of a step whose iteration settled, and its energy; whether it stands.
fn conclude<S: MechanicalSystem>(
    s: &mut Listed<'_, S>,
    d: &mut ListedData<S>,
    problems: &mut PosedOf<S>,
    report: StepReport,
) -> bool {
    let (reports, memories) = (&mut d.reports, &mut d.next_memories);
    s.take_answers(s.options, true, problems, reports, memories);
    forget_bounces(s, d);
    d.reports[0] = report;
    find_mean(s, d);
    s.machine()
        .set_moved(&d.start, &d.v_mean, s.options.time_step, &mut d.end);
    close_end(s, d, true);
    let is_solved = d.reports[0].is_converged();
    s.machine().normalise(&mut d.end);
    find_impacts(s, d);
    find_contact_work(s, d);
    let limits = AuditLimits {
        gain: GAIN,
        drift: drift(s, d),
    };
    judge_at_last(s, d, problems, limits) && is_solved
}

/// `d.v_mean` for the iterate `d.v_end`.
fn find_mean<S: MechanicalSystem>(s: &Listed<'_, S>, d: &mut ListedData<S>) {
    let theta = s.options.theta;
    for ((mean, end), begin) in d.v_mean.iter_mut().zip(&d.v_end).zip(&d.v) {
        *mean = theta * end + (1.0 - theta) * begin;
    }
}

/// Newton's iteration on the forces at the end of the step: its report, and whether it settled.
///
/// The loads that the motion leaves open are found in the last iterate alone, which the contraction
/// so far predicts, or which is the last one allowed.
fn settle<S: MechanicalSystem>(
    s: &mut Listed<'_, S>,
    d: &mut ListedData<S>,
    problems: &mut PosedOf<S>,
    probe: &mut dyn Probe,
) -> (StepReport, bool) {
    let options = s.options;
    let mut report = StepReport {
        steps: 1,
        status: StepStatus::NotConverged,
        ..StepReport::default()
    };
    begin_iteration(s, d);
    let mut is_settled = false;
    let mut revisions = 0;
    let mut unsolved = 0;
    let mut last_change = f64::INFINITY;
    s.list.leaves_open = options.newton_max_iterations > 1;
    for iteration in 0..options.newton_max_iterations {
        if !iterate(s, d, problems, iteration, probe) {
            break;
        }
        let solved = problems.report;
        report.iterations += solved.iterations;
        report.retaken += solved.retaken;
        report.residual = solved.residual;
        report.n_contacts = s.list.contacts.len();
        report.immovable_contacts = (0..report.n_contacts).filter(|i| s.immovable(*i)).count();
        report.newton_iterations = iteration + 1;
        // A maximum ignores NaN, so check for it.
        if !d.v_end.iter().all(|x| x.is_finite()) {
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
        let change = d.y.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let size = d.v_end.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        // Converged, or as far as rounding allows: the change is small and no longer shrinks.
        let is_small = change <= options.newton_tolerance * size;
        let is_rounding = change <= ROUNDING * size && change >= 0.5 * last_change;
        let expected = change * (change / last_change);
        let left_open = s.list.leaves_open && report.n_contacts > 0;
        let will_end = last_change.is_finite() && expected <= options.newton_tolerance * size;
        s.list.leaves_open = !will_end && iteration + 2 < options.newton_max_iterations;
        last_change = change;
        if is_small || is_rounding {
            if left_open && S::SETTLES && iteration + 1 < options.newton_max_iterations {
                s.list.leaves_open = false;
                continue;
            }
            if revisions < MOST_REVISIONS && s.machine_mut().revise(true, &d.v, &d.v_end) {
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

/// The first iterate is the velocity before the step.
fn begin_iteration<S: MechanicalSystem>(s: &mut Listed<'_, S>, d: &mut ListedData<S>) {
    begin(s, d);
    (d.going, d.is_last) = (true, true);
    d.obstacles[0] = None;
    d.shares.clear();
    d.is_gyroscopic.fill(false);
    s.machine_mut().choose_branches(&d.v);
    s.system.begin_residual(StepStart::at(&d.start, &d.v));
    d.v_end.copy_from_slice(&d.v);
}

/// Fraction of the kinetic energy that free flight may gain or lose in the step.
fn drift<S: MechanicalSystem>(s: &mut Listed<'_, S>, d: &mut ListedData<S>) -> f64 {
    let turning = s
        .system
        .machine_mut()
        .turning(s.options, &d.v, &mut d.is_gyroscopic);
    d.is_gyroscopic.fill(false); // the balance is at the end of the step
    let turn = s.options.time_step * turning.unwrap_or(0.0);
    if s.machine().conserves_momenta() && turn <= MOST_TURN {
        turn * turn * turn
    } else {
        0.0
    }
}

/// One iteration: `d.v_end` changes by `d.y`. False if the mass matrix cannot be factored, which
/// means that the iterate has diverged.
fn iterate<S: MechanicalSystem>(
    s: &mut Listed<'_, S>,
    d: &mut ListedData<S>,
    problems: &mut PosedOf<S>,
    iteration: usize,
    probe: &mut dyn Probe,
) -> bool {
    let options = s.options;
    let (h, theta) = (options.time_step, options.theta);
    find_mean(s, d);
    s.machine()
        .set_moved(&d.start, &d.v_mean, theta * h, &mut d.middle);
    s.machine().set_moved(&d.start, &d.v_mean, h, &mut d.end);
    s.machine_mut().place_middle(&d.middle);
    s.machine_mut().place_end(&d.end);
    probe.end(Phase::Kinematics);
    if iteration == 0 {
        // The set of contacts of a step is decided once, by the forecast.
        let (gravity, measured) = (options.gravity.into(), theta * h);
        let activation = Activation::of_step(gravity, h, options.forecast, measured);
        s.find_contacts(&d.v, activation);
        recall(s, d, problems);
        s.read_start(problems, &mut d.p_last);
    }
    s.system.relocate(&mut s.list.contacts);
    probe.end(Phase::Detection);
    s.machine_mut().update_mass_matrix(options, true, true);
    probe.end(Phase::MassMatrix);
    let start = StepStart::at(&d.start, &d.v);
    let (v_end, v_mean) = (&d.v_end, &d.v_mean);
    (s.system).residual(options, start, v_end, v_mean, &mut d.foreseen, &mut d.y);
    probe.end(Phase::Bias);
    if !s.machine_mut().factorise(options) {
        return false;
    }
    probe.end(Phase::Factor);
    s.assemble(&d.v);
    yield_at_end(s, d);
    let is_any = d.persists.contains(&true);
    if is_any {
        s.generalized_impulse(true, &d.p_last, &mut d.pushed);
    }
    correct_impulse(s, d, is_any);
    probe.end(Phase::Delassus);
    s.machine_mut()
        .close_velocity(options, &d.v, &d.v_end, &mut d.y);
    s.system.local(&d.y, Local::flat_mut(&mut d.u));
    let u = Local::flat_mut(&mut d.u);
    (s.system).add_local_of_velocity(&s.list.contacts, &d.v_end, u);
    add_shifts(s, d);
    s.pose(options, (&d.u, &d.y), &d.p_last, &d.is_same, true, problems);
    s.solve(&d.v_end, (&d.y, &d.laws), problems);
    probe.end(Phase::Solve);
    s.read(problems, &mut d.p, &mut d.u);
    remove_shifts(s, d);
    s.add_impulses(true, &d.p, &mut d.y);
    s.add_moments(&mut d.y);
    s.machine().half_solve_back(&mut d.y);
    for (v, change) in d.v_end.iter_mut().zip(&d.y) {
        *v += change;
    }
    probe.end(Phase::Update);
    true
}

/// The laws of contacts that yield, for the iterate.
fn yield_at_end<S: MechanicalSystem>(s: &mut Listed<'_, S>, d: &mut ListedData<S>) {
    if d.laws.is_empty() {
        return;
    }
    let u = Local::flat_mut(&mut d.pushes);
    u.fill(0.0);
    (s.system).add_local_of_velocity(&s.list.contacts, &d.v_end, u);
    yield_under_load(s, d, true);
    s.soften(&d.laws);
}
