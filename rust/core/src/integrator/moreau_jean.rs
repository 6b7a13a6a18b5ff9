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
//! If the spin ([`super::dynamics::Dynamics::is_gyroscopic`]) or the energy audit
//! ([`super::energy_audit`]) requires it, the gyroscopic terms are implicit:
//! `bias = G + C(q_m, v_m) (v + (1−θ) Δv)`, where Δv includes the impulses of persistent contact.
//! The scheme is then stable at any spin and any step.
//!
//! The PD controller of a held joint is implicit with an exponentially fitted θ_j
//! ([`crate::system::fitted_theta`]), and stable at any gain and any step. The forecast
//! `gap + γ h u_N ≤ 0`, measured from q_m, activates contacts.
//!
//! Source: Moreau 1988; Jean 1999; Acary and Brogliato 2008, ch. 10.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use super::contacting::KeyOf;
use super::energy_audit::{Audit, GAIN, Verdict, carry_velocity, note_energy_before};
use super::error::StepError;
use super::forces::Start;
use super::groups::Group;
use super::mechanical_system::MechanicalSystem;
use super::options::StepOptions;
use super::position_projection;
use super::probe::{Phase, Probe};
use super::report::{StepReport, StepStatus};
use super::scheme::{Integrator, StateMut};
use super::scratch::{Scratch, ScratchOf};
use super::step_contacts::{
    add_correction, assemble_contacts, close_end, find_impacts, place, solve_contacts,
    take_persistent,
};
use super::warm_start::WarmStart;
use crate::contact::Activation;

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
        scratch.fit(system.nv(), system.n_clusters());
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

/// Most attempts at a step with all its parts, beyond repetitions for another branch and the parts
/// that fast turning asks for.
const MOST_ATTEMPTS: usize = 16;

/// Most times that a step is halved.
const MOST_HALVINGS: usize = 3;

/// Rotation of a frame in a step, rad, above which the step is split.
pub(crate) const MOST_TURN: f64 = 0.5;

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
        note_energy_before(system, options, start, ws);
        system.choose_branches(start);
        ws.gyroscopic.clear();
        let clusters = 0..system.n_clusters();
        (ws.gyroscopic).extend(clusters.map(|own| system.is_gyroscopic(options, start.v, own)));
        let mut retaken = 0;
        let mut report = loop {
            *self.attempts = self.attempts.saturating_sub(1);
            // Where sweeps end early by design they would do so in a smaller step too.
            let can_halve = self.depth < MOST_HALVINGS
                && *self.attempts > 1
                && ws.has_work_left(&options.solver)
                && system.solves_to_the_end();
            let attempted = attempt(system, options, start, warm_start, ws, probe);
            let Some(mut report) = attempted else {
                if can_halve {
                    return self.divide(2.0, system, state, warm_start, ws, probe);
                }
                return Err(StepError::SingularMassMatrix { time: *state.time });
            };
            report.retaken += retaken;
            retaken += 1;
            if retaken <= system.most_revisions() {
                if system.revise(start, &ws.v) {
                    *self.attempts += 1;
                    continue;
                }
            } else if !system.is_settled(&ws.v) {
                report.status = StepStatus::NotConverged;
            }
            let is_solved = report.is_converged();
            if !ws.before.is_empty() || ws.groups.all().any(|own| own.is_same) {
                find_impacts(system, options, warm_start, ws);
            }
            let audit = Audit {
                // With implicit terms there is no other way than halves.
                is_last: |own: &Group| own.is_gyroscopic && !can_halve,
                gain: GAIN * self.share,
                drift: 0.0,
            };
            let verdict = audit.judge(system, options, start, warm_start, ws, &mut report);
            let turns_implicit =
                verdict == Verdict::Coarse && ws.groups.make_coarse_implicit(&mut ws.gyroscopic);
            if turns_implicit {
                continue;
            }
            if can_halve && (verdict == Verdict::Coarse || !is_solved) {
                return self.divide(2.0, system, state, warm_start, ws, probe);
            }
            break report;
        };
        probe.end(Phase::Update);
        report.steps = 1;
        let report = finish(system, options, state, warm_start, ws, report, probe)?;
        if self.depth > 0 {
            ws.add_part(S::DIMENSION.components());
        }
        Ok(report)
    }

    /// Takes the step in `n` equal parts, or leaves everything as it was, also where one panics.
    /// The remembered impulses are those of a part meanwhile.
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
        warm_start.scale(1.0 / n);
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
            let taken = catch_unwind(AssertUnwindSafe(|| {
                part.advance(system, state, warm_start, ws, probe)
            }));
            if let Ok(Ok(report)) = taken {
                total.merge(&report);
                k += 1.0;
                continue;
            }
            configuration.clone_from(&kept.0);
            v.copy_from_slice(&kept.1);
            *time = kept.2;
            *warm_start = kept.3;
            return taken.unwrap_or_else(|panic| resume_unwind(panic));
        }
        warm_start.scale(n);
        *time = kept.2 + self.options.time_step;
        total.steps = 1;
        total.retaken += 1;
        Ok(total)
    }
}

/// Passes over the mean velocity at which implicit gyroscopic terms are frozen: the second makes
/// the step second order.
pub(crate) const GYROSCOPIC_PASSES: usize = 2;

/// One attempt at the step: `ws.v`, `ws.end`, `ws.p` and `ws.gap_end`. None if the mass matrix
/// cannot be factored.
fn attempt<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
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
    let (gravity, measured) = (options.gravity.into(), (1.0 - theta) * h);
    let activation = Activation::of_step(gravity, h, options.forecast, measured);
    system.detect(start.v, activation, &mut ws.contacts);
    system.relocate(&mut ws.contacts);
    (ws.groups).find(system, options, &ws.contacts, warm_start, &ws.gyroscopic);
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
    load(system, options, start, warm_start, ws);
    probe.end(Phase::Bias);
    let mut report = solve_contacts(system, options, start.v, ws, true, probe);
    place(system, options, ws);
    close_end(system, ws, &mut report);
    Some(report)
}

/// The free change `ws.y` (factor coordinates), with implicit gyroscopic terms in the groups that
/// need them.
fn load<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    take_persistent::<S>(ws);
    let n_implicit = ws.groups.all().filter(|own| own.is_gyroscopic).count();
    let is_mixed = n_implicit > 0 && n_implicit < ws.groups.all().count();
    if n_implicit == 0 || is_mixed {
        load_explicitly(system, options, start, ws);
    }
    if is_mixed {
        ws.v_kept.copy_from_slice(&ws.y);
    }
    if n_implicit > 0 {
        load_implicitly(system, options, start, ws);
    }
    if is_mixed {
        for (k, (y, explicit)) in ws.y.iter_mut().zip(&ws.v_kept).enumerate() {
            let group = ws.groups.of_cluster(system.cluster_of_velocity(k));
            if !ws.groups.group(group).is_gyroscopic {
                *y = *explicit;
            }
        }
    }
    add_correction(system, options, warm_start, ws);
}

/// The free change `ws.y` (factor coordinates): first from the forces at v, then from those at the
/// resulting velocity.
fn load_explicitly<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
) {
    ws.v_mean.copy_from_slice(start.v);
    for is_last in [false, true] {
        system.load(options, start, &ws.v_mean, &mut ws.impulse);
        if is_last {
            system.add_given(options, &mut ws.impulse);
        }
        ws.half_solve(|impulse| system.half_solve(impulse));
        if !is_last {
            system.close_velocity(options, start.v, start.v, &mut ws.y);
            // Impulses of an impact do not predict those of this step: v_m would be far off, and
            // the bias is quadratic in it.
            if ws.groups.any_persists() {
                system.add_impulses(&ws.p_position, &mut ws.y);
            }
            ws.half_solve_back(|y| system.half_solve_back(y));
            for (mean, change) in ws.v_mean.iter_mut().zip(&ws.dv) {
                *mean += (1.0 - options.theta) * change;
            }
        }
    }
}

/// The free change `ws.y` (factor coordinates) with implicit gyroscopic
/// terms; the correction r is part of the forecast impulse.
fn load_implicitly<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
) {
    let is_persistent = ws.groups.any_persists();
    ws.forecast.fill(0.0);
    if is_persistent {
        system.generalized_impulse(&ws.contacts, &ws.p_position, &mut ws.forecast);
    }
    ws.v_mean.copy_from_slice(start.v);
    for pass in 0..GYROSCOPIC_PASSES {
        system.load_gyroscopic(options, start, &ws.v_mean, &ws.forecast, &mut ws.y);
        if pass + 1 < GYROSCOPIC_PASSES {
            system.close_velocity(options, start.v, start.v, &mut ws.y);
            let forecast = if is_persistent {
                &ws.p_position[..]
            } else {
                &[]
            };
            system.add_loop_impulse(forecast, &mut ws.forecast);
            if is_persistent {
                system.add_impulses(&ws.p_position, &mut ws.y);
            }
            ws.half_solve_back(|y| system.half_solve_back(y));
            for ((mean, change), v) in ws.v_mean.iter_mut().zip(&ws.dv).zip(start.v) {
                *mean = v + (1.0 - options.theta) * change;
            }
        }
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
    system.stored(&ws.end, &mut ws.stored[1]);
    if position_projection::project(system, options, ws, &mut report) {
        close_end(system, ws, &mut report);
        system.normalise(&mut ws.end);
        return_unmoved(system, ws);
        let start = Start {
            configuration: &*configuration,
            v: &*v,
        };
        carry_velocity(system, options, start, ws, &mut report);
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
    let is_persistent = note_persistent::<S>(ws);
    warm_start.remember(&ws.contacts, d, &ws.p);
    warm_start.forget(&ws.bounces);
    warm_start.stored.clone_from(&ws.elastic[1]);
    warm_start.persistent.clear();
    if is_persistent {
        warm_start.persistent.resize(system.nv(), 0.0);
        system.generalized_impulse(&ws.contacts, &ws.p, &mut warm_start.persistent);
        for (k, x) in warm_start.persistent.iter_mut().enumerate() {
            let group = ws.groups.of_cluster(system.cluster_of_velocity(k));
            if !ws.groups.group(group).persists {
                *x = 0.0;
            }
        }
    }
    Ok(report)
}

/// Returns to the groups that the projection did not move what they had before it.
fn return_unmoved<S: MechanicalSystem>(system: &S, ws: &mut ScratchOf<S>) {
    ws.return_ends(system, |_, own| !own.is_moved);
}

/// Notes whose contacts persisted in this step; whether any did.
fn note_persistent<S: MechanicalSystem>(ws: &mut ScratchOf<S>) -> bool {
    for number in 0..ws.groups.n() {
        let own = ws.groups.group_mut(number);
        own.persists = own.is_same && own.n_contacts > 0;
    }
    for i in 0..ws.contacts.len() {
        let own = ws.groups.group_mut(ws.groups.of_contact(i));
        own.persists = own.persists && !ws.impact[i];
    }
    ws.groups.any_persists()
}
