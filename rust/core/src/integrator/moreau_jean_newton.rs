//! Moreau–Jean with Newton on the forces at the end of the step, in momentum form.
//!
//! Unknown v⁺ (and p). With the mean velocity `v̄ = θ v⁺ + (1−θ) v`, `q⁺ = q ⊕ h v̄`, `q_m = q ⊕ θ h v̄`, and the momentum `(P_i, L_i)` of body i
//! about a point fixed in the world, d'Alembert's principle over the step reads, for every velocity k with screw S_k(q_m),
//!
//! ```text
//! Σ_{i moved by k} S_k · (ΔP_i − h m_i g, ΔL_i − h c̄_i × m_i g) = h τ_k + (H(q⁺) p + r)_k
//! ```
//!
//! Momenta at both ends are evaluated exactly, so no bias is needed and, summed over the base's six screws, total linear and
//! angular momentum change by the impulses alone: in free flight they are conserved to the tolerance of the iteration, at
//! any step. For θ = ½ the scheme is symmetric and of order 2. The iteration uses M̂(q_m) as its matrix, which
//! differs from the true Jacobian by O(h) and converges by that factor.
//!
//! Source: the discrete d'Alembert principle, as in Simo, Wong 1991 for one body; contacts and the
//! correction r as in [`super::moreau_jean`].

use nalgebra::Vector3;

use super::command::Command;
use super::error::StepError;
use super::moreau_jean::{
    MoreauJean, activation, add_command, add_correction, assemble_contacts, factorise, finish,
    set_held_theta, solve_contacts,
};
use super::probe::{Phase, Probe};
use super::report::{StepReport, StepStatus};
use super::workspace::{WarmStart, Workspace};
use super::{Integrator, Scene};
use crate::contact::{detect, relocate};
use crate::multibody::momentum::body_momenta;
use crate::multibody::{Model, State};

/// Relative change below which an iteration that no longer shrinks has met rounding.
const ROUNDING: f64 = 1e-8;

/// The Newton variant.
#[derive(Clone, Copy, Debug, Default)]
pub struct MoreauJeanNewton;

impl Integrator for MoreauJeanNewton {
    fn step(
        &self,
        scene: &Scene<'_>,
        command: &Command,
        state: &mut State,
        warm_start: &mut WarmStart,
        workspace: &mut Workspace,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let Scene { model, options, .. } = *scene;
        let (h, theta) = (options.time_step, options.theta);
        let ws = workspace;
        ws.kinematics.update_for_step(model, &state.configuration);
        ws.c_start.copy_from_slice(&ws.kinematics.c);
        body_momenta(
            model,
            &ws.kinematics,
            &state.v,
            &Vector3::zeros(),
            &mut ws.momenta,
        );
        ws.v.copy_from_slice(&state.v);
        let mut report = StepReport {
            steps: 1,
            status: StepStatus::NotConverged,
            ..StepReport::default()
        };
        let mut is_settled = false;
        let mut last_change = f64::INFINITY;
        for iteration in 0..options.newton_max_iterations {
            let solved = iterate(scene, command, state, warm_start, ws, iteration, probe)?;
            report.iterations += solved.iterations;
            report.residual = solved.residual;
            report.n_contacts = solved.n_contacts;
            report.newton_iterations = iteration + 1;
            // ws.y is now the change of v in this iteration.
            let change = ws.y.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let size = ws.v.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
            // Settled, or as settled as rounding allows: no longer shrinking, and small.
            let is_small = change <= options.newton_tolerance * size;
            let is_rounding = change <= ROUNDING * size && change >= 0.5 * last_change;
            last_change = change;
            if is_small || is_rounding {
                is_settled = true;
                report.status = solved.status;
                break;
            }
            if change.is_nan() {
                break;
            }
        }
        if !is_settled {
            // An iterate that has not settled obeys no law: take the step that needs no iteration, and say so.
            let taken = MoreauJean.step(scene, command, state, warm_start, ws, probe)?;
            return Ok(StepReport {
                newton_iterations: report.newton_iterations,
                status: StepStatus::NotConverged,
                ..taken
            });
        }
        for ((mean, end), begin) in ws.v_mean.iter_mut().zip(&ws.v).zip(&state.v) {
            *mean = theta * end + (1.0 - theta) * begin;
        }
        ws.end.set_moved(&state.configuration, &ws.v_mean, h);
        // The contacts were measured at the end of the last iterate, which is the end of the step.
        ws.gap_end.clear();
        ws.gap_end
            .extend(ws.contacts.iter().map(|contact| contact.gap));
        finish(scene, state, warm_start, ws, report, probe)
    }
}

/// One iteration: `ws.v` moves by `ws.y`.
fn iterate(
    scene: &Scene<'_>,
    command: &Command,
    state: &State,
    warm_start: &WarmStart,
    ws: &mut Workspace,
    iteration: usize,
    probe: &mut dyn Probe,
) -> Result<StepReport, StepError> {
    let Scene {
        model,
        terrain,
        options,
    } = *scene;
    let (h, theta) = (options.time_step, options.theta);

    for ((mean, end), begin) in ws.v_mean.iter_mut().zip(&ws.v).zip(&state.v) {
        *mean = theta * end + (1.0 - theta) * begin;
    }
    ws.configuration
        .set_moved(&state.configuration, &ws.v_mean, theta * h);
    ws.end.set_moved(&state.configuration, &ws.v_mean, h);
    ws.kinematics.update_for_step(model, &ws.configuration);
    ws.kinematics_end.update_for_step(model, &ws.end);
    probe.end(Phase::Kinematics);
    if iteration == 0 {
        // The set of contacts of a step is decided once, by the forecast.
        let activation = activation(model, options, &state.v, theta * h);
        detect(
            model,
            &ws.kinematics,
            &ws.kinematics_end,
            terrain,
            &state.v,
            &activation,
            &mut ws.contacts,
        );
    }
    for contact in &mut ws.contacts {
        relocate(model, &ws.kinematics_end, terrain, contact);
    }
    probe.end(Phase::Detection);
    ws.mass_matrix.update(model, &ws.kinematics);
    probe.end(Phase::MassMatrix);
    momentum_residual(
        model,
        &options.gravity,
        h,
        theta,
        &state.configuration.position,
        ws,
    );
    set_held_theta(model, options, command, ws);
    add_command(
        options,
        command,
        &state.configuration.joints,
        &state.v,
        &ws.v,
        &ws.theta_held,
        &mut ws.y,
    );
    probe.end(Phase::Bias);
    factorise(model, options, command, ws)
        .ok_or(StepError::SingularMassMatrix { time: state.time })?;
    ws.factor.half_solve(model, &mut ws.y);
    probe.end(Phase::Factor);
    assemble_contacts(scene, &state.v, warm_start, ws);
    add_correction(scene, warm_start, ws);
    if iteration > 0 {
        ws.p.copy_from_slice(&ws.p_last);
    }
    probe.end(Phase::Delassus);
    let solved = solve_contacts(scene, ws, iteration == 0, probe);
    ws.p_last.clone_from(&ws.p);
    probe.end(Phase::Update);
    Ok(solved)
}

/// `ws.y = −(left side)` of the principle above at the iterate `ws.v`, without commands and contacts.
fn momentum_residual(
    model: &Model,
    gravity: &Vector3<f64>,
    h: f64,
    theta: f64,
    start: &Vector3<f64>,
    ws: &mut Workspace,
) {
    let end = ws.kinematics_end.base - start;
    body_momenta(model, &ws.kinematics_end, &ws.v, &end, &mut ws.momenta_end);
    let middle = ws.kinematics.base - start;
    let bodies = model.bodies();
    ws.sums.copy_from_slice(&ws.momenta_end);
    for (b, (sum, begin)) in ws.sums.iter_mut().zip(&ws.momenta).enumerate() {
        let weight = gravity * (bodies[b].mass * h);
        // Both mass centres relative to the point of reference, the trunk origin at the start of the step.
        let centre = (ws.kinematics_end.c[b] + end) * theta + ws.c_start[b] * (1.0 - theta);
        sum.linear -= begin.linear + weight;
        sum.angular -= begin.angular + centre.cross(&weight);
    }
    for b in (0..bodies.len()).rev() {
        let (P, L) = (ws.sums[b].linear, ws.sums[b].angular);
        // About the trunk origin at the midpoint, where the screws are taken.
        let about_middle = L - middle.cross(&P);
        if b == 0 {
            for k in 0..3 {
                ws.y[k] = -P[k];
                ws.y[3 + k] = -about_middle[k];
            }
        } else {
            let a = &ws.kinematics.axis[b];
            ws.y[5 + b] = -a.dot(&(about_middle - ws.kinematics.r[b].cross(&P)));
            let parent = bodies[b].parent;
            ws.sums[parent].linear += P;
            ws.sums[parent].angular += L;
        }
    }
}
