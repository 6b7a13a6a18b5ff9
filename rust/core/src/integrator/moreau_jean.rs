//! Moreau–Jean, one linearised step.
//!
//! Forces are evaluated at `q_m = q ⊕ (1−θ) h v` (for θ = ½ the midpoint of Moreau 1988) and `v_m = v + (1−θ) Δv`, Δv the change that the
//! forces at (q_m, v) and the last step's impulses would make; the contacts at the predicted end `q̃ = q ⊕ h v`:
//!
//! ```text
//! M̂ (v⁺ − v) = h (τ − bias(q_m, v_m)) + H(q̃) p + r,      M̂ = M(q_m) + h θ_j K_d + h² θ_j θ K_p on held joints
//! q⁺ = q_m ⊕ θ h v⁺
//! ```
//!
//! The velocity law `H(q̃)ᵀ v⁺` thus holds where v⁺ does, at the end of the step, and not half a step before. In persistent
//! contact `r = (1−θ) (H(q_k) − H(q̃)) p_k`, with the impulses p_k of the step before, turns the reaction back to its mean direction
//! over the step (a correction deferred by one step, so that W stays symmetric). Without the two a turning rover's path is late by
//! h/2 and its speed decays with h ω²/2: on the flat drive of the tests the error was five times larger.
//!
//! The PD of a held joint is implicit with an exponentially fitted θ_j ([`super::fitted_theta`]), so no gain and
//! no step make it unstable. Contacts enter by the forecast `gap + γ h u_N ≤ 0`, measured from q_m.
//!
//! Source: Moreau 1988; Jean 1999; Acary, Brogliato 2008, ch. 10.

use super::command::Command;
use super::error::StepError;
use super::fitted_theta::fitted_theta;
use super::options::StepOptions;
use super::position_projection;
use super::probe::{Phase, Probe};
use super::report::{StepReport, StepStatus};
use super::workspace::{ActiveContact, WarmStart, Workspace};
use super::{Integrator, Scene};
use crate::contact::{Activation, Contact, detect, generalized_impulse, relocate};
use crate::law::newton_impact::rebound;
use crate::multibody::{Model, State, bias};
use crate::problem::{Dimension, FrictionContactProblem};
use crate::solver::{SolveReport, solve};

/// The linearised variant.
#[derive(Clone, Copy, Debug, Default)]
pub struct MoreauJean;

impl Integrator for MoreauJean {
    fn step(
        &self,
        scene: &Scene<'_>,
        command: &Command,
        state: &mut State,
        warm_start: &mut WarmStart,
        workspace: &mut Workspace,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let Scene {
            model,
            terrain,
            options,
        } = *scene;
        let (h, theta) = (options.time_step, options.theta);
        let ws = workspace;
        ws.configuration
            .set_moved(&state.configuration, &state.v, (1.0 - theta) * h);
        ws.kinematics.update_for_step(model, &ws.configuration);
        ws.end.set_moved(&state.configuration, &state.v, h);
        ws.kinematics_end.update_for_step(model, &ws.end);
        probe.end(Phase::Kinematics);
        let activation = activation(model, options, &state.v, (1.0 - theta) * h);
        detect(
            model,
            &ws.kinematics,
            &ws.kinematics_end,
            terrain,
            &state.v,
            &activation,
            &mut ws.contacts,
        );
        for contact in &mut ws.contacts {
            relocate(model, &ws.kinematics_end, terrain, contact);
        }
        probe.end(Phase::Detection);
        ws.mass_matrix.update(model, &ws.kinematics);
        set_held_theta(model, options, command, ws);
        probe.end(Phase::MassMatrix);
        factorise(model, options, command, ws)
            .ok_or(StepError::SingularMassMatrix { time: state.time })?;
        probe.end(Phase::Factor);
        ws.v.copy_from_slice(&state.v);
        assemble_contacts(scene, &state.v, warm_start, ws);
        probe.end(Phase::Delassus);
        // Forces at v, then at the velocity that they lead to.
        ws.v_mean.copy_from_slice(&state.v);
        for is_last in [false, true] {
            bias(
                model,
                &ws.kinematics,
                &ws.v_mean,
                &options.gravity,
                &mut ws.bias_scratch,
                &mut ws.force,
            );
            for (y, f) in ws.y.iter_mut().zip(&ws.force) {
                *y = -h * f;
            }
            let joints = &state.configuration.joints;
            add_command(
                options,
                command,
                joints,
                &state.v,
                &state.v,
                &ws.theta_held,
                &mut ws.y,
            );
            ws.factor.half_solve(model, &mut ws.y);
            if !is_last {
                ws.system.add_impulses(model, &ws.p, &mut ws.y);
                ws.factor.half_solve_back(model, &mut ws.y);
                for (mean, change) in ws.v_mean.iter_mut().zip(&ws.y) {
                    *mean += (1.0 - theta) * change;
                }
            }
        }
        add_correction(scene, warm_start, ws);
        probe.end(Phase::Bias);
        let mut report = solve_contacts(scene, ws, true, probe);
        ws.end.copy_from(&ws.configuration);
        ws.end.advance(&ws.v, theta * h);
        ws.gap_end.clear();
        let local = ws.u.chunks_exact(3).zip(ws.u_before.chunks_exact(3));
        let moved = |(contact, (u, before)): (&Contact, (&[f64], &[f64]))| {
            contact.gap + theta * h * (u[0] - before[0])
        };
        ws.gap_end.extend(ws.contacts.iter().zip(local).map(moved));
        probe.end(Phase::Update);
        report.steps = 1;
        finish(scene, state, warm_start, ws, report, probe)
    }
}

/// The contact forecast measured from `q_m`, and how close to rest a contact stays closed.
///
/// `measured`: seconds after the start of the step at which the gaps are measured.
pub(super) fn activation(
    model: &Model,
    options: &StepOptions,
    v: &[f64],
    measured: f64,
) -> Activation {
    let h = options.time_step;
    let lead = options.forecast * h - measured;
    // In one step gravity moves what rests by g h²/2 and speeds it up by g h.
    let g = options.gravity.norm();
    let reach: f64 = model
        .bodies()
        .iter()
        .map(|b| b.position.norm())
        .sum::<f64>()
        + 1.0;
    let linear = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let turning: f64 = v[3..].iter().map(|w| w.abs()).sum();
    Activation {
        lead,
        hover: (0.5 * g * h * h).max(1e-9),
        slow: (2.0 * g * h).max(1e-9),
        margin: lead.abs() * (linear + turning * reach),
    }
}

/// How implicit each held joint's PD is.
pub(super) fn set_held_theta(
    model: &Model,
    options: &StepOptions,
    command: &Command,
    ws: &mut Workspace,
) {
    let h = options.time_step;
    for (j, held) in command.held.iter().enumerate() {
        if let Some(held) = held {
            let inertia = ws.mass_matrix.diagonal(model, 6 + j);
            let z = h * (held.damping + 0.5 * h * held.stiffness) / inertia;
            ws.theta_held[j] = fitted_theta(z).max(options.theta);
        }
    }
}

/// Adds `h τ` to `y`: torques, and the PD at the θ_j-weighted position and velocity of the iterate `v_end`.
pub(super) fn add_command(
    options: &StepOptions,
    command: &Command,
    joints: &[f64],
    v: &[f64],
    v_end: &[f64],
    theta_held: &[f64],
    y: &mut [f64],
) {
    let (h, theta) = (options.time_step, options.theta);
    for (j, (torque, held)) in command.torque.iter().zip(&command.held).enumerate() {
        let mut tau = *torque;
        if let Some(held) = held {
            let (theta_j, rate, rate_end) = (theta_held[j], v[6 + j], v_end[6 + j]);
            let mean = theta * rate_end + (1.0 - theta) * rate;
            tau -= held.stiffness * (joints[j] + h * theta_j * mean - held.set_point);
            tau -= held.damping * (rate + theta_j * (rate_end - rate));
        }
        y[6 + j] += h * tau;
    }
}

/// `M̂ = M + h θ_j K_d + h² θ_j θ K_p` on held joints, and its factor.
pub(super) fn factorise(
    model: &Model,
    options: &StepOptions,
    command: &Command,
    ws: &mut Workspace,
) -> Option<()> {
    let (h, theta) = (options.time_step, options.theta);
    for (j, held) in command.held.iter().enumerate() {
        if let Some(held) = held {
            let theta_j = ws.theta_held[j];
            let implicit = h * theta_j * (held.damping + h * theta * held.stiffness);
            ws.mass_matrix.add_to_diagonal(model, 6 + j, implicit);
        }
    }
    ws.mass_matrix
        .factorise(model, &mut ws.factor)
        .then_some(())
}

/// Contact Jacobian, operator, velocity before the step and the solver's starting point, at the end's poses.
///
/// Newton's law looks at `v_before`, the velocity before the step.
pub(super) fn assemble_contacts(
    scene: &Scene<'_>,
    v_before: &[f64],
    warm_start: &WarmStart,
    ws: &mut Workspace,
) {
    let n = ws.contacts.len();
    for local in [&mut ws.u_before, &mut ws.q_free, &mut ws.p, &mut ws.u] {
        local.resize(3 * n, 0.0);
    }
    ws.mu.resize(n, scene.options.friction_coefficient);
    ws.system.assemble(
        scene.model,
        &ws.kinematics_end,
        &ws.factor,
        &ws.contacts,
        v_before,
    );
    ws.u_before.copy_from_slice(&ws.system.u);
    if scene.options.warm_start {
        warm_start.recall(&ws.contacts, &mut ws.p);
    } else {
        ws.p.fill(0.0);
    }
}

/// Adds the deferred correction r to `ws.y` where the last step had the same contacts and all of them persisted.
///
/// `ws.p` must still hold the last step's impulses.
pub(super) fn add_correction(scene: &Scene<'_>, warm_start: &WarmStart, ws: &mut Workspace) {
    if !scene.options.warm_start
        || warm_start.persistent.is_empty()
        || !warm_start.is_of(&ws.contacts)
    {
        return;
    }
    let share = 1.0 - scene.options.theta;
    generalized_impulse(
        scene.model,
        &ws.kinematics_end,
        &ws.contacts,
        &ws.p,
        &mut ws.correction,
    );
    for (r, before) in ws.correction.iter_mut().zip(&warm_start.persistent) {
        *r = share * (before - *r);
    }
    ws.factor.half_solve(scene.model, &mut ws.correction);
    for (y, r) in ws.y.iter_mut().zip(&ws.correction) {
        *y += r;
    }
}

/// Solves the assembled contacts for the free change `ws.y` (factor coordinates) from `ws.v`, and adds both to `ws.v`.
///
/// Starts from `ws.p`. `is_from_start`: `ws.v` is still the velocity before the step, whose local velocity is known.
pub(super) fn solve_contacts(
    scene: &Scene<'_>,
    ws: &mut Workspace,
    is_from_start: bool,
    probe: &mut dyn Probe,
) -> StepReport {
    let Scene { model, options, .. } = *scene;
    let n = ws.contacts.len();
    let mut report = StepReport {
        n_contacts: n,
        ..StepReport::default()
    };
    if n > 0 {
        ws.system.local(model, &ws.y, &mut ws.q_free);
        if is_from_start {
            for (q, u) in ws.q_free.iter_mut().zip(&ws.u_before) {
                *q += u;
            }
        } else {
            ws.system.add_local_of_velocity(
                model,
                &ws.kinematics_end,
                &ws.contacts,
                &ws.v,
                &mut ws.q_free,
            );
        }
        for (q, u) in ws
            .q_free
            .chunks_exact_mut(3)
            .zip(ws.u_before.chunks_exact(3))
        {
            q[0] += rebound(options.restitution, u[0]);
        }
        let problem = FrictionContactProblem::from_assembled(
            Dimension::Three,
            &ws.system.W,
            &ws.q_free,
            &ws.mu,
        );
        let solved = solve(
            &problem,
            &options.solver,
            &mut ws.p,
            &mut ws.u,
            &mut ws.solver,
        );
        note(&mut report, &solved);
        // u came with the restitution term inside: take it out again.
        for (u, before) in ws.u.chunks_exact_mut(3).zip(ws.u_before.chunks_exact(3)) {
            u[0] -= rebound(options.restitution, before[0]);
        }
        ws.system.add_impulses(model, &ws.p, &mut ws.y);
        probe.end(Phase::Solve);
    }
    ws.factor.half_solve_back(model, &mut ws.y);
    for (v, dv) in ws.v.iter_mut().zip(&ws.y) {
        *v += dv;
    }
    report
}

/// Enters a solver's report into a step's.
pub(super) fn note(report: &mut StepReport, solved: &SolveReport) {
    report.iterations += solved.iterations;
    report.residual = report.residual.max(solved.residual);
    if !solved.is_converged() {
        report.status = StepStatus::NotConverged;
    }
}

/// Projects the position, checks that all is finite, and only then changes state and warm start.
pub(super) fn finish(
    scene: &Scene<'_>,
    state: &mut State,
    warm_start: &mut WarmStart,
    ws: &mut Workspace,
    mut report: StepReport,
    probe: &mut dyn Probe,
) -> Result<StepReport, StepError> {
    position_projection::project(scene, ws, &mut report);
    probe.end(Phase::Projection);
    let is_finite = ws.end.is_finite() && ws.v.iter().chain(&ws.p).all(|x| x.is_finite());
    if !is_finite {
        return Err(StepError::NonFinite { time: state.time });
    }
    ws.end.attitude.renormalize_fast();
    state.configuration.copy_from(&ws.end);
    state.v.copy_from_slice(&ws.v);
    state.time += scene.options.time_step;
    let slow = 2.0 * scene.options.gravity.norm() * scene.options.time_step;
    let is_persistent = warm_start.is_of(&ws.contacts)
        && ws.u_before.iter().step_by(3).all(|u_N| u_N.abs() <= slow);
    warm_start.remember(&ws.contacts, &ws.p);
    warm_start.persistent.clear();
    if is_persistent && !ws.contacts.is_empty() {
        warm_start.persistent.resize(scene.model.nv(), 0.0);
        generalized_impulse(
            scene.model,
            &ws.kinematics_end,
            &ws.contacts,
            &ws.p,
            &mut warm_start.persistent,
        );
    }
    ws.active.clear();
    let local = ws.p.chunks_exact(3).zip(ws.u.chunks_exact(3));
    ws.active.extend(
        ws.contacts
            .iter()
            .zip(local)
            .map(|(contact, (p, u))| ActiveContact {
                contact: *contact,
                position: ws.kinematics_end.base + contact.point,
                impulse: [p[0], p[1], p[2]],
                velocity: [u[0], u[1], u[2]],
            }),
    );
    Ok(report)
}
