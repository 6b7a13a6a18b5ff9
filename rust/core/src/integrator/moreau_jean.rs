//! Moreau–Jean, one linearised step.
//!
//! Forces are evaluated at `q_m = q ⊕ (1−θ) h v` (for θ = ½ the midpoint of Moreau 1988) and
//! `v_m = v + (1−θ) Δv`, where Δv is the change due to the forces at (q_m, v) and the last step's
//! impulses. Contacts are evaluated at the predicted end `q̃ = q ⊕ h v`:
//!
//! ```text
//! M̂ (v⁺ − v) = h (τ − bias(q_m, v_m)) + H(q̃) p + r
//! M̂  = M(q_m) + h θ_j K_d + h² θ_j θ K_p on held joints
//! q⁺ = q_m ⊕ θ h v⁺
//! ```
//!
//! The contact law on `H(q̃)ᵀ v⁺` thus holds at the end of the step, where v⁺ belongs, and not half
//! a step earlier. In persistent contact the term `r = (1−θ) (H(q_k) − H(q̃)) p_k`, with the
//! impulses p_k of the step before, turns the reaction back to its mean direction over the step.
//! This correction is deferred by one step so that W stays symmetric. Without both measures the
//! path of a turning rover lags by h/2 and its speed decays with h ω²/2: the error is five times
//! larger on the flat drive of the tests.
//!
//! If the spin ([`MechanicalSystem::is_gyroscopic`]) or the energy audit ([`super::energy_audit`])
//! requires it, the gyroscopic terms are implicit: `bias = G + C(q_m, v_m) (v + (1−θ) Δv)`, where
//! Δv includes the impulses of persistent contact. The scheme is then stable at any spin and any
//! step.
//!
//! The PD controller of a held joint is implicit with an exponentially fitted θ_j
//! ([`crate::system::fitted_theta`]), and stable at any gain and any step. The forecast
//! `gap + γ h u_N ≤ 0`, measured from q_m, activates contacts.
//!
//! Source: Moreau 1988; Jean 1999; Acary and Brogliato 2008, ch. 10.

use super::energy_audit::{Audit, GAIN, Verdict, count_lift, energy_before};
use super::error::StepError;
use super::mechanical_system::{MechanicalSystem, Start, UnilateralContact};
use super::options::StepOptions;
use super::position_projection;
use super::probe::{Phase, Probe};
use super::report::{StepReport, StepStatus};
use super::scratch::Scratch;
use super::warm_start::WarmStart;
use super::{Integrator, KeyOf, ScratchOf, StateMut};
use crate::contact::Activation;
use crate::solver::SolveReport;

/// The linearised variant.
#[derive(Clone, Copy, Debug, Default)]
pub struct MoreauJean;

impl<S: MechanicalSystem> Integrator<S> for MoreauJean {
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        scratch.fit(system.nv());
        scratch.grant_work(&options.solver, system.solves_to_the_end());
        let mut attempts = MOST_ATTEMPTS;
        let whole = Part {
            options,
            share: 1.0,
            depth: 0,
            attempts: &mut attempts,
        };
        whole.advance(system, state, warm_start, scratch, probe)
    }
}

/// Most attempts at a step with all its parts, beyond the parts that fast turning asks for.
const MOST_ATTEMPTS: usize = 16;

/// Most times that a step is halved.
const MOST_HALVINGS: usize = 3;

/// Rotation of a frame in a step, rad, above which the step is split.
const MOST_TURN: f64 = 0.5;

/// Most parts of a step that fast rotation is given. Faster rotation is not resolved; the audit
/// controls its energy.
const MOST_PARTS: f64 = 64.0;

/// Takes a step or a part of one. A part that fails is repeated in halves, which are different and
/// mostly easier problems.
struct Part<'a> {
    options: &'a StepOptions,
    /// Fraction of the whole step.
    share: f64,
    depth: usize,
    attempts: &'a mut usize,
}

impl Part<'_> {
    fn advance<S: MechanicalSystem>(
        self,
        system: &mut S,
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        ws: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let options = self.options;
        let start = Start {
            configuration: &*state.configuration,
            v: &*state.v,
        };
        let turn = options.time_step * system.turning(start.v);
        if self.depth == 0 && turn > MOST_TURN {
            let n = (turn / MOST_TURN).min(MOST_PARTS).ceil();
            return self.divide(n, system, state, warm_start, ws, probe);
        }
        let before = energy_before(system, options, start, ws);
        system.choose_branches(start);
        let mut is_gyroscopic = system.is_gyroscopic(options, start.v);
        let mut retaken = 0;
        let mut report = loop {
            *self.attempts = self.attempts.saturating_sub(1);
            // Where sweeps end early by design they would do so in a smaller step too.
            let can_halve = self.depth < MOST_HALVINGS
                && *self.attempts > 1
                && ws.work_left > 0
                && system.solves_to_the_end();
            let attempted = attempt(system, options, start, warm_start, ws, is_gyroscopic, probe);
            let Some(mut report) = attempted else {
                if can_halve {
                    return self.divide(2.0, system, state, warm_start, ws, probe);
                }
                return Err(StepError::SingularMassMatrix { time: *state.time });
            };
            report.retaken += retaken;
            retaken += 1;
            if retaken <= MOST_REVISIONS && system.revise(start, &ws.v) {
                continue;
            }
            let is_solved = report.is_converged();
            let audit = Audit {
                before,
                is_last: is_gyroscopic && !can_halve,
                gain: GAIN * self.share,
                drift: 0.0,
            };
            let verdict = audit.judge(system, options, start, ws, &mut report);
            if verdict == Verdict::Coarse && !is_gyroscopic {
                is_gyroscopic = true;
            } else if can_halve && (verdict == Verdict::Coarse || !is_solved) {
                return self.divide(2.0, system, state, warm_start, ws, probe);
            } else {
                break report;
            }
        };
        probe.end(Phase::Update);
        report.steps = 1;
        finish(system, options, state, warm_start, ws, report, probe)
    }

    /// Takes the step in `n` equal parts, or leaves everything as it was.
    fn divide<S: MechanicalSystem>(
        self,
        n: f64,
        system: &mut S,
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        ws: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let StateMut {
            configuration,
            v,
            time,
        } = state;
        let kept = (configuration.clone(), v.to_vec(), *time, warm_start.clone());
        let options = StepOptions {
            time_step: self.options.time_step / n,
            ..self.options.clone()
        };
        let mut total = StepReport::default();
        let mut k = 0.0;
        while k < n {
            let part = Part {
                options: &options,
                share: self.share / n,
                depth: self.depth + 1,
                attempts: &mut *self.attempts,
            };
            let state = StateMut {
                configuration: &mut *configuration,
                v: &mut *v,
                time: &mut *time,
            };
            match part.advance(system, state, warm_start, ws, probe) {
                Ok(report) => total.merge(&report),
                Err(error) => {
                    configuration.clone_from(&kept.0);
                    v.copy_from_slice(&kept.1);
                    *time = kept.2;
                    *warm_start = kept.3;
                    return Err(error);
                }
            }
            k += 1.0;
        }
        *time = kept.2 + self.options.time_step;
        total.steps = 1;
        total.retaken += 1;
        Ok(total)
    }
}

/// Most repetitions of a step because a piecewise force changed its branch. A motor that reaches
/// its torque–speed line needs one, a single wheel at most four.
pub(super) const MOST_REVISIONS: usize = 6;

/// Passes over the mean velocity at which implicit gyroscopic terms are frozen: the second makes
/// the step second order.
const GYROSCOPIC_PASSES: usize = 2;

/// One attempt at the step: `ws.v`, `ws.end`, `ws.p` and `ws.gap_end`. None if the mass matrix
/// cannot be factored.
fn attempt<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
    is_gyroscopic: bool,
    probe: &mut dyn Probe,
) -> Option<StepReport> {
    let (h, theta) = (options.time_step, options.theta);
    system.set_moved(
        start.configuration,
        start.v,
        (1.0 - theta) * h,
        &mut ws.middle,
    );
    system.place_middle(&ws.middle);
    system.set_moved(start.configuration, start.v, h, &mut ws.end);
    system.place_end(&ws.end);
    probe.end(Phase::Kinematics);
    let activation = activation(options, (1.0 - theta) * h);
    system.detect(start.v, activation, &mut ws.contacts);
    system.relocate(&mut ws.contacts);
    probe.end(Phase::Detection);
    system.update_mass_matrix(options);
    probe.end(Phase::MassMatrix);
    if !system.factorise(options) {
        return None;
    }
    probe.end(Phase::Factor);
    ws.v.copy_from_slice(start.v);
    assemble_contacts(system, options, start.v, warm_start, ws);
    probe.end(Phase::Delassus);
    if is_gyroscopic {
        load_implicitly(system, options, start, warm_start, ws);
    } else {
        load_explicitly(system, options, start, warm_start, ws);
    }
    probe.end(Phase::Bias);
    let report = solve_contacts(system, options, ws, true, probe);
    place(system, options, ws);
    Some(report)
}

/// `q⁺ = q_m ⊕ θ h v⁺` for the velocity `ws.v`, and the gaps there.
pub(super) fn place<S: MechanicalSystem>(system: &S, options: &StepOptions, ws: &mut ScratchOf<S>) {
    let share = options.theta * options.time_step;
    system.set_moved(&ws.middle, &ws.v, share, &mut ws.end);
    ws.gap_end.clear();
    let d = S::DIMENSION.components();
    let local = ws.u.chunks_exact(d).zip(ws.u_before.chunks_exact(d));
    let moved = |(contact, (u, before)): (&S::Contact, (&[f64], &[f64]))| {
        contact.gap() + share * (u[0] - before[0])
    };
    ws.gap_end.extend(ws.contacts.iter().zip(local).map(moved));
}

/// The free change `ws.y` (factor coordinates): first from the forces at v, then from those at the
/// resulting velocity.
pub(super) fn load_explicitly<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    ws.v_mean.copy_from_slice(start.v);
    for is_last in [false, true] {
        system.load(options, start, &ws.v_mean, &mut ws.impulse);
        ws.half_solve(|impulse| system.half_solve(impulse));
        if !is_last {
            // Impulses of an impact do not predict those of this step: v_m would be far off, and
            // the bias is quadratic in it.
            if is_persistent(options, warm_start, &ws.contacts) {
                system.add_impulses(&ws.p, &mut ws.y);
            }
            ws.half_solve_back(|y| system.half_solve_back(y));
            for (mean, change) in ws.v_mean.iter_mut().zip(&ws.dv) {
                *mean += (1.0 - options.theta) * change;
            }
        }
    }
    add_correction(system, options, warm_start, ws);
}

/// The free change `ws.y` (factor coordinates) with implicit gyroscopic
/// terms; the correction r is part of the forecast impulse.
pub(super) fn load_implicitly<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    let is_persistent = is_persistent(options, warm_start, &ws.contacts);
    ws.forecast.fill(0.0);
    if is_persistent {
        system.generalized_impulse(&ws.contacts, &ws.p, &mut ws.forecast);
    }
    ws.v_mean.copy_from_slice(start.v);
    for pass in 0..GYROSCOPIC_PASSES {
        system.load_gyroscopic(options, start, &ws.v_mean, &ws.forecast, &mut ws.y);
        if pass + 1 < GYROSCOPIC_PASSES {
            if is_persistent {
                system.add_impulses(&ws.p, &mut ws.y);
            }
            ws.half_solve_back(|y| system.half_solve_back(y));
            for ((mean, change), v) in ws.v_mean.iter_mut().zip(&ws.dv).zip(start.v) {
                *mean = v + (1.0 - options.theta) * change;
            }
        }
    }
    add_correction(system, options, warm_start, ws);
}

/// The contact forecast, measured from `q_m`, with the margin within which a resting contact stays
/// closed.
///
/// `measured`: seconds after the start of the step at which the gaps are measured.
pub(super) fn activation(options: &StepOptions, measured: f64) -> Activation {
    let h = options.time_step;
    // In one step gravity moves a resting body by g h²/2 and accelerates it by g h.
    let g = options.gravity.norm();
    Activation {
        lead: options.forecast * h - measured,
        hover: (0.5 * g * h * h).max(1e-9),
        slow: (2.0 * g * h).max(1e-9),
        margin: 0.0,
    }
}

/// Contact Jacobian, operator, velocity before the step and the solver's starting point, at the end
/// pose.
///
/// Newton's law refers to `v_before`, the velocity before the step.
pub(super) fn assemble_contacts<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    v_before: &[f64],
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    let d = S::DIMENSION.components();
    let n = ws.contacts.len();
    for local in [&mut ws.u_before, &mut ws.q_free, &mut ws.p, &mut ws.u] {
        local.resize(d * n, 0.0);
    }
    set_friction(system, options, &ws.contacts, &mut ws.mu);
    system.assemble(&ws.contacts, v_before, &mut ws.u_before);
    if options.warm_start {
        warm_start.recall(&ws.contacts, d, &mut ws.p);
    } else {
        ws.p.fill(0.0);
    }
}

/// μ of every contact.
pub(super) fn set_friction<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    contacts: &[S::Contact],
    mu: &mut Vec<f64>,
) {
    mu.clear();
    mu.extend(
        contacts
            .iter()
            .map(|contact| system.friction_coefficient(options, contact)),
    );
}

/// Whether the last step had the same contacts and none of them was new or in impact, so that its
/// impulses equal those of this step up to O(h).
fn is_persistent<C: UnilateralContact>(
    options: &StepOptions,
    warm_start: &WarmStart<C::Key>,
    contacts: &[C],
) -> bool {
    options.warm_start && !warm_start.persistent.is_empty() && warm_start.is_of(contacts)
}

/// Adds the deferred correction r to `ws.y` if the last step had the same contacts and all of them
/// persisted.
///
/// `ws.p` must still hold the last step's impulses.
pub(super) fn add_correction<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    if !is_persistent(options, warm_start, &ws.contacts) {
        return;
    }
    let share = 1.0 - options.theta;
    system.generalized_impulse(&ws.contacts, &ws.p, &mut ws.correction);
    for (r, before) in ws.correction.iter_mut().zip(&warm_start.persistent) {
        *r = share * (before - *r);
    }
    system.half_solve(&mut ws.correction);
    for (y, r) in ws.y.iter_mut().zip(&ws.correction) {
        *y += r;
    }
}

/// Solves the assembled contacts for the free change `ws.y` (factor coordinates) from `ws.v`, and
/// adds the total change `ws.dv` to `ws.v`.
///
/// Newton's law of restitution with friction may have no solution: a wheel held by friction between
/// two slopes cannot leave both. If the solver finds none, the impact is taken as inelastic. That
/// problem always has a solution, since rest is admissible on ground at rest.
///
/// Starts from `ws.p`. `is_from_start`: `ws.v` is still the velocity before
/// the step, whose local velocity is known.
pub(super) fn solve_contacts<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
    is_from_start: bool,
    probe: &mut dyn Probe,
) -> StepReport {
    let d = S::DIMENSION.components();
    let n = ws.contacts.len();
    let mut report = StepReport {
        n_contacts: n,
        ..StepReport::default()
    };
    if n > 0 {
        system.local(&ws.y, &mut ws.q_free);
        if is_from_start {
            for (q, u) in ws.q_free.iter_mut().zip(&ws.u_before) {
                *q += u;
            }
        } else {
            system.add_local_of_velocity(&ws.contacts, &ws.v, &mut ws.q_free);
        }
        add_shifts(system, options, ws, 1.0);
        let mut solved = solve_problem(system, options, ws);
        let inelastic;
        let mut law = options;
        let is_elastic = options.restitution > 0.0 || options.materials.is_elastic();
        if !solved.is_converged() && is_elastic && system.solves_to_the_end() {
            inelastic = StepOptions {
                restitution: 0.0,
                materials: options.materials.inelastic(),
                ..options.clone()
            };
            add_shifts(system, law, ws, -1.0);
            law = &inelastic;
            add_shifts(system, law, ws, 1.0);
            ws.p.fill(0.0);
            solved = solve_problem(system, options, ws);
            report.retaken = 1;
        }
        // u contains the shift: remove it.
        for ((u, contact), before) in
            (ws.u.chunks_exact_mut(d).zip(&ws.contacts)).zip(ws.u_before.chunks_exact(d))
        {
            u[0] -= system.normal_shift(law, contact, before[0]);
        }
        note(&mut report, &solved);
        system.add_impulses(&ws.p, &mut ws.y);
        probe.end(Phase::Solve);
    }
    ws.half_solve_back(|y| system.half_solve_back(y));
    for (v, dv) in ws.v.iter_mut().zip(&ws.dv) {
        *v += dv;
    }
    report
}

/// Adds `sign` times the impact law's shift to the normal free velocities `ws.q_free`.
fn add_shifts<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
    sign: f64,
) {
    let d = S::DIMENSION.components();
    let contacts = ws.contacts.iter().zip(ws.u_before.chunks_exact(d));
    for (q, (contact, before)) in ws.q_free.chunks_exact_mut(d).zip(contacts) {
        q[0] += sign * system.normal_shift(options, contact, before[0]);
    }
}

/// Solves the assembled problem from `ws.p` and charges the step's budget.
fn solve_problem<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
) -> SolveReport {
    let solved = system.solve(
        &ws.q_free,
        &ws.mu,
        &ws.solver_options(&options.solver),
        &mut ws.p,
        &mut ws.u,
        &mut ws.solver,
    );
    ws.work_left = ws.work_left.saturating_sub(solved.work);
    solved
}

/// Enters a solver's report into a step's.
pub(super) fn note(report: &mut StepReport, solved: &SolveReport) {
    report.iterations += solved.iterations;
    report.factorisations += solved.factorisations();
    report.pivots += solved.pivots();
    report.residual = report.residual.max(solved.residual);
    if !solved.is_converged() {
        report.status = StepStatus::NotConverged;
    }
}

/// Projects the position, checks that everything is finite, and only then changes state and warm
/// start.
pub(super) fn finish<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    state: StateMut<'_, S::Configuration>,
    warm_start: &mut WarmStart<KeyOf<S>>,
    ws: &mut Scratch<S::Configuration, S::Contact>,
    mut report: StepReport,
    probe: &mut dyn Probe,
) -> Result<StepReport, StepError> {
    let StateMut {
        configuration,
        v,
        time,
    } = state;
    let d = S::DIMENSION.components();
    if position_projection::project(system, options, ws, &mut report) {
        system.normalise(&mut ws.end);
        count_lift(system, options, ws, &mut report);
    }
    probe.end(Phase::Projection);
    let is_finite = system.is_finite(&ws.end) && ws.v.iter().chain(&ws.p).all(|x| x.is_finite());
    if !is_finite {
        return Err(StepError::NonFinite { time: *time });
    }
    if let Some([x, z]) = system.unknown_ground() {
        return Err(StepError::NoGround { time: *time, x, z });
    }
    system.accept();
    std::mem::swap(configuration, &mut ws.end);
    v.copy_from_slice(&ws.v);
    *time += options.time_step;
    let slow = 2.0 * options.gravity.norm() * options.time_step;
    let is_persistent = warm_start.is_of(&ws.contacts)
        && ws.u_before.iter().step_by(d).all(|u_N| u_N.abs() <= slow);
    warm_start.remember(&ws.contacts, d, &ws.p);
    warm_start.persistent.clear();
    if is_persistent && !ws.contacts.is_empty() {
        warm_start.persistent.resize(system.nv(), 0.0);
        system.generalized_impulse(&ws.contacts, &ws.p, &mut warm_start.persistent);
    }
    Ok(report)
}
