//! Nonsmooth generalised-α: the smooth motion by the generalised-α method,
//! impulses by backward Euler.
//!
//! ```text
//! M(q⁺) ã⁺ = F(q⁺, v⁺) + H(q⁺) λ⁺               λ: reactions of persistent contact
//! (1 − α_m) a⁺ + α_m a = (1 − α_f) ã⁺ + α_f ã
//! v⁺ = v + h ((1 − γ) a + γ a⁺) + w,    M(q⁺) w = H(q⁺) p          p: what impacts add
//! q⁺ = q ⊕ (h v + h² ((½ − β) a + β a⁺) + ½ h w)
//! u = Hᵀ(q⁺) v⁺:  Newton's impact law and Coulomb's law with p,
//!                 where the gap at the predicted end is closed
//! ```
//!
//! The smooth part, of order 2, includes the reactions of persistent contact at acceleration level,
//! as D1MinusLinear does. In the original only bilateral constraints enter it, and unilateral
//! contact is of order 1. Both inherit Painlevé's paradox from the acceleration level. The implicit
//! equations are solved by iterating on ã⁺, which contracts by O(h) and excludes stiff forces.
//!
//! Source: Chen, Acary, Virlez and Brüls 2013, IJNME 96, 487–511; Brüls,
//! Acary and Cardona 2014; Schindler and Acary 2014 for λ.

use std::cell::RefCell;

use rover_core::integrator::{
    Integrator, KeyOf, MechanicalSystem, Probe, ScratchOf, StateMut, StepError, StepOptions,
    StepReport, StepStatus, WarmStart,
};
use rover_core::law::newton_impact::rebound;
use rover_core::solver::SolverWorkspace;

use crate::acceleration::{find, response, smooth_acceleration, solve_law};

/// Change of h ã⁺, relative to 1 m/s and to the largest velocity, below
/// which the iteration has settled.
const SETTLED: f64 = 1e-13;

/// Most iterations.
const MOST: usize = 60;

/// The scheme and what it carries from step to step.
#[derive(Debug, Default)]
pub struct GeneralisedAlpha {
    /// Share of the highest frequency that a step leaves, ρ∞ in [0, 1].
    pub rho: f64,
    memory: RefCell<Memory>,
}

#[derive(Debug, Default)]
struct Memory {
    /// Where the last step ended; another time or velocity is a new run.
    time: f64,
    v: Vec<f64>,
    /// ã, acceleration.
    rate: Vec<f64>,
    /// a, its filtered companion.
    a: Vec<f64>,
    solver: SolverWorkspace,
}

impl GeneralisedAlpha {
    /// With the spectral radius ρ∞ at infinite frequency.
    #[must_use]
    pub fn new(rho: f64) -> Self {
        Self {
            rho,
            ..Self::default()
        }
    }
}

impl<S: MechanicalSystem> Integrator<S> for GeneralisedAlpha {
    #[allow(clippy::too_many_lines)] // the page's equations, line by line in their order
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        _scratch: &mut ScratchOf<S>,
        _probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let h = options.time_step;
        let (alpha_m, alpha_f) = (
            (2.0 * self.rho - 1.0) / (self.rho + 1.0),
            self.rho / (self.rho + 1.0),
        );
        let gamma = 0.5 + alpha_f - alpha_m;
        let beta = 0.25 * (gamma + 0.5) * (gamma + 0.5);
        let d = S::DIMENSION.components();
        let time = *state.time;
        let g = options.gravity.norm();
        let (hover, slow) = ((0.5 * g * h * h).max(1e-9), (2.0 * g * h).max(1e-9));
        let memory = &mut *self.memory.borrow_mut();
        let (q, v) = (&*state.configuration, &*state.v);
        let mut contacts = Vec::new();
        if memory.time.to_bits() != time.to_bits() || memory.v != *v {
            find(system, q, v, hover, slow, &mut contacts);
            let at = (q, v, time);
            memory.rate =
                smooth_acceleration(system, options, &mut contacts, at, &mut memory.solver)?;
            memory.a.clone_from(&memory.rate);
        }
        let nv = v.len();
        let mut rate = memory.rate.clone();
        let mut a = memory.a.clone();
        let (mut v_end, mut v_mean) = (vec![0.0; nv], vec![0.0; nv]);
        let mut q_end = q.clone();
        let mut w = vec![0.0; nv];
        let (mut p, mut u, mut u_before) = (Vec::new(), Vec::new(), Vec::new());
        let mut report = StepReport {
            steps: 1,
            status: StepStatus::NotConverged,
            ..StepReport::default()
        };
        for iteration in 0..MOST {
            for i in 0..nv {
                a[i] = ((1.0 - alpha_f) * rate[i] + alpha_f * memory.rate[i]
                    - alpha_m * memory.a[i])
                    / (1.0 - alpha_m);
                v_end[i] = v[i] + h * ((1.0 - gamma) * memory.a[i] + gamma * a[i]);
                v_mean[i] = v[i] + h * ((0.5 - beta) * memory.a[i] + beta * a[i]) + 0.5 * w[i];
            }
            system.set_moved(q, &v_mean, h, &mut q_end);
            if iteration == 0 {
                find(system, &q_end, &v_end, hover, slow, &mut contacts);
                p.resize(d * contacts.len(), 0.0);
                warm_start.recall(&contacts, d, &mut p);
                report.n_contacts = contacts.len();
            }
            let mut is_solved = true;
            if !contacts.is_empty() {
                system.place_middle(&q_end);
                system.place_end(&q_end);
                system.relocate(&mut contacts);
                system.update_mass_matrix(options);
                if !system.factorise(options) {
                    return Err(StepError::SingularMassMatrix { time });
                }
                u_before.resize(d * contacts.len(), 0.0);
                system.assemble(&contacts, v, &mut u_before);
                let mut q_free = vec![0.0; u_before.len()];
                system.add_local_of_velocity(&contacts, &v_end, &mut q_free);
                for (q, u) in q_free.chunks_exact_mut(d).zip(u_before.chunks_exact(d)) {
                    q[0] += rebound(options.restitution, u[0]);
                }
                let solved = solve_law(
                    system,
                    options,
                    &contacts,
                    &q_free,
                    &mut p,
                    &mut u,
                    &mut memory.solver,
                );
                report.iterations += solved.iterations;
                report.residual = solved.residual;
                is_solved = solved.is_converged();
                response(system, &p, &mut w);
                for i in 0..nv {
                    v_end[i] += w[i];
                }
                // The mean velocity with the impulses of this iterate.
                for i in 0..nv {
                    v_mean[i] = v[i] + h * ((0.5 - beta) * memory.a[i] + beta * a[i]) + 0.5 * w[i];
                }
                system.set_moved(q, &v_mean, h, &mut q_end);
            }
            let at = (&q_end, &v_end[..], time);
            let next = smooth_acceleration(system, options, &mut contacts, at, &mut memory.solver)?;
            let change = next
                .iter()
                .zip(&rate)
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            let size = v_end.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
            rate = next;
            report.newton_iterations = iteration + 1;
            if h * change <= SETTLED * size {
                if is_solved {
                    report.status = StepStatus::Converged;
                }
                break;
            }
        }
        if !system.is_finite(&q_end) || v_end.iter().any(|x| !x.is_finite()) {
            return Err(StepError::NonFinite { time });
        }
        system.normalise(&mut q_end);
        *state.configuration = q_end;
        state.v.copy_from_slice(&v_end);
        *state.time += h;
        warm_start.remember(&contacts, d, &p);
        memory.time = *state.time;
        memory.v = v_end;
        memory.rate = rate;
        memory.a = a;
        Ok(report)
    }
}
