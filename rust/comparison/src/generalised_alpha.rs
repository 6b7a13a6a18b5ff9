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

use crate::whole::Whole;
use rover_core::integrator::{
    Integrator, KeyOf, Probe, ScratchOf, StateMut, StepError, StepOptions, StepReport, StepStatus,
    WarmStart,
};
use rover_core::law::newton_impact::rebound;
use rover_core::solver::{SolveReport, SolverWorkspace};

use crate::acceleration::{accept, factorise, find, response, smooth_acceleration, solve_law};

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

/// α_m, α_f, β and γ of the method.
struct Coefficients {
    alpha_m: f64,
    alpha_f: f64,
    beta: f64,
    gamma: f64,
}

impl Coefficients {
    /// Coefficients for a spectral radius at infinite frequency.
    fn of(rho: f64) -> Self {
        let (alpha_m, alpha_f) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
        let gamma = 0.5 + alpha_f - alpha_m;
        Self {
            alpha_m,
            alpha_f,
            beta: 0.25 * (gamma + 0.5) * (gamma + 0.5),
            gamma,
        }
    }
}

/// The end of the step as far as it is iterated.
struct Iterate<S: Whole> {
    contacts: Vec<S::Contact>,
    /// ã⁺ and a⁺.
    rate: Vec<f64>,
    a: Vec<f64>,
    q: S::Configuration,
    v: Vec<f64>,
    /// Displacement of the step, divided by h.
    v_mean: Vec<f64>,
    w: Vec<f64>,
    p: Vec<f64>,
    u_before: Vec<f64>,
}

impl<S: Whole> Iterate<S> {
    /// From where the last step ended, near some contacts.
    fn new(memory: &Memory, q: &S::Configuration, contacts: Vec<S::Contact>) -> Self {
        let nv = memory.rate.len();
        Self {
            contacts,
            rate: memory.rate.clone(),
            a: memory.a.clone(),
            q: q.clone(),
            v: vec![0.0; nv],
            v_mean: vec![0.0; nv],
            w: vec![0.0; nv],
            p: Vec::new(),
            u_before: Vec::new(),
        }
    }

    /// The mean velocity with the impulses of this iterate, from the velocity `v` before the step.
    fn set_mean(&mut self, by: &Coefficients, memory: &Memory, v: &[f64], h: f64) {
        for i in 0..v.len() {
            self.v_mean[i] =
                v[i] + h * ((0.5 - by.beta) * memory.a[i] + by.beta * self.a[i]) + 0.5 * self.w[i];
        }
    }

    /// The smooth motion from the velocity `v` before the step.
    fn move_smoothly(&mut self, by: &Coefficients, memory: &Memory, v: &[f64], h: f64) {
        for i in 0..v.len() {
            self.a[i] = ((1.0 - by.alpha_f) * self.rate[i] + by.alpha_f * memory.rate[i]
                - by.alpha_m * memory.a[i])
                / (1.0 - by.alpha_m);
            self.v[i] = v[i] + h * ((1.0 - by.gamma) * memory.a[i] + by.gamma * self.a[i]);
        }
        self.set_mean(by, memory, v, h);
    }

    /// Adds what impacts change, where the velocity before the step is `v`.
    fn strike(
        &mut self,
        system: &mut S,
        options: &StepOptions,
        v: &[f64],
        time: f64,
        solver: &mut SolverWorkspace,
    ) -> Result<SolveReport, StepError> {
        let d = S::DIMENSION.components();
        system.place_middle(&self.q);
        system.place_end(&self.q);
        system.relocate(&mut self.contacts);
        factorise(system, options, time)?;
        self.u_before.resize(d * self.contacts.len(), 0.0);
        system.assemble(&self.contacts, v, &mut self.u_before);
        let mut free = vec![0.0; self.u_before.len()];
        system.add_local_of_velocity(&self.contacts, &self.v, &mut free);
        let rows = free.chunks_exact_mut(d);
        for (q, u) in rows.zip(self.u_before.chunks_exact(d)) {
            q[0] += rebound(options.restitution, u[0]);
        }
        let contacts = &self.contacts;
        let (solved, _) = solve_law(system, options, contacts, &free, &mut self.p, solver);
        self.w = response(system, &self.p);
        for (v, w) in self.v.iter_mut().zip(&self.w) {
            *v += w;
        }
        Ok(solved)
    }
}

impl<S: Whole> Integrator<S> for GeneralisedAlpha {
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
        let by = Coefficients::of(self.rho);
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
        let mut end = Iterate::<S>::new(memory, q, contacts);
        let mut report = StepReport {
            steps: 1,
            status: StepStatus::NotConverged,
            ..StepReport::default()
        };
        for iteration in 0..MOST {
            end.move_smoothly(&by, memory, v, h);
            system.set_moved(q, &end.v_mean, h, &mut end.q);
            if iteration == 0 {
                find(system, &end.q, &end.v, hover, slow, &mut end.contacts);
                end.p.resize(d * end.contacts.len(), 0.0);
                warm_start.recall(&end.contacts, d, &mut end.p);
                report.n_contacts = end.contacts.len();
            }
            let mut is_solved = true;
            if !end.contacts.is_empty() {
                let solved = end.strike(system, options, v, time, &mut memory.solver)?;
                report.iterations += solved.iterations;
                report.residual = solved.residual;
                is_solved = solved.is_converged();
                end.set_mean(&by, memory, v, h);
                system.set_moved(q, &end.v_mean, h, &mut end.q);
            }
            let at = (&end.q, &end.v[..], time);
            let solver = &mut memory.solver;
            let next = smooth_acceleration(system, options, &mut end.contacts, at, solver)?;
            let change = next
                .iter()
                .zip(&end.rate)
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            let size = end.v.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
            end.rate = next;
            report.newton_iterations = iteration + 1;
            if h * change <= SETTLED * size {
                if is_solved {
                    report.status = StepStatus::Converged;
                }
                break;
            }
        }
        accept(system, (end.q, &end.v), h, state)?;
        warm_start.remember(&end.contacts, d, &end.p);
        memory.time = time + h;
        memory.v = end.v;
        memory.rate = end.rate;
        memory.a = end.a;
        Ok(report)
    }
}
