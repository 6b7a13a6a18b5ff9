//! Schatzman–Paoli: central differences in the position, with the contact
//! law on a mean of positions.
//!
//! ```text
//! M(q_k) (v_{k+½} − v_{k−½}) = h F(q_k, ½ (v_{k−½} + v_{k+½})) + H p
//! q_{k+1} = q_k ⊕ h v_{k+½}
//! 0 ≤ g_N(q*) ⊥ p_N ≥ 0
//! q* = (q_{k+1} + e q_{k−1})/(1 + e) = q_k ⊕ h (v_{k+½} − e v_{k−½})/(1 + e)
//! ```
//!
//! with Coulomb's law on `H_Tᵀ v_{k+½}`. Normal velocities are not constrained: with e = 0 no
//! position penetrates; with e > 0 one does for a step, and the rebound is one step late. The
//! equations are solved by repeated linearisation of the gap at q*.
//!
//! The state's v is v_{k+½} where a contact acts, and otherwise moved on by
//! half a step to the time of q.
//!
//! Source: Paoli and Schatzman 2002, SIAM J. Numer. Anal. 40, 702–733;
//! friction as in Acary and Brogliato 2008, ch. 10.

use std::cell::RefCell;

use rover_core::integrator::{
    Integrator, KeyOf, MechanicalSystem, Probe, ScratchOf, Start, StateMut, StepError, StepOptions,
    StepReport, StepStatus, UnilateralContact, WarmStart,
};
use rover_core::solver::SolverWorkspace;

use crate::acceleration::{find, free_acceleration, response, smooth_acceleration, solve_law};

/// Change of the velocity, relative to 1 m/s and to the largest, below
/// which the iteration has settled.
const SETTLED: f64 = 1e-13;

/// Most iterations.
const MOST: usize = 60;

/// The scheme and what it carries from step to step.
#[derive(Debug, Default)]
pub struct SchatzmanPaoli {
    memory: RefCell<Memory>,
}

#[derive(Debug, Default)]
struct Memory {
    /// Where the last step ended; another time or velocity is a new run.
    time: f64,
    v: Vec<f64>,
    /// v_{k−½}.
    v_half: Vec<f64>,
    solver: SolverWorkspace,
}

impl<S: MechanicalSystem> Integrator<S> for SchatzmanPaoli {
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
        let (h, e) = (options.time_step, options.restitution);
        let d = S::DIMENSION.components();
        let time = *state.time;
        let g = options.gravity.norm();
        let memory = &mut *self.memory.borrow_mut();
        let (q, v) = (&*state.configuration, &*state.v);
        let nv = v.len();
        let mut contacts = Vec::new();
        if memory.time.to_bits() != time.to_bits() || memory.v != *v {
            let (hover, slow) = ((0.5 * g * h * h).max(1e-9), (2.0 * g * h).max(1e-9));
            find(system, q, v, hover, slow, &mut contacts);
            let at = (q, v, time);
            let a = smooth_acceleration(system, options, &mut contacts, at, &mut memory.solver)?;
            memory.v_half = v.iter().zip(&a).map(|(v, a)| v - 0.5 * h * a).collect();
        }
        let before = &memory.v_half;
        // All that the step could reach: a contact that it does not reach has no impulse.
        let reach = 3.0 * h * system.displacement(before) + 2.0 * g * h * h;
        find(system, q, before, reach, f64::INFINITY, &mut contacts);
        system.place_middle(q);
        system.update_mass_matrix(options);
        if !system.factorise(options) {
            return Err(StepError::SingularMassMatrix { time });
        }
        let mut report = StepReport {
            steps: 1,
            status: StepStatus::NotConverged,
            n_contacts: contacts.len(),
            ..StepReport::default()
        };
        let n = d * contacts.len();
        let mut v_end = before.clone();
        let (mut v_mean, mut v_star) = (vec![0.0; nv], vec![0.0; nv]);
        let (mut free, mut change) = (vec![0.0; nv], Vec::new());
        let (mut p, mut u, mut u_guess) = (vec![0.0; n], Vec::new(), vec![0.0; n]);
        warm_start.recall(&contacts, d, &mut p);
        let mut q_star = q.clone();
        for iteration in 0..MOST {
            for i in 0..nv {
                v_mean[i] = 0.5 * (before[i] + v_end[i]);
                v_star[i] = (v_end[i] - e * before[i]) / (1.0 + e);
            }
            let start = Start {
                configuration: q,
                v: before,
            };
            system.load(options, start, &v_mean, &mut free);
            system.half_solve(&mut free);
            system.half_solve_back(&mut free);
            for i in 0..nv {
                free[i] += before[i];
            }
            let mut next = free.clone();
            let mut is_solved = true;
            if n > 0 {
                system.set_moved(q, &v_star, h, &mut q_star);
                system.place_end(&q_star);
                system.relocate(&mut contacts);
                system.assemble(&contacts, &v_end, &mut u_guess);
                let mut q_free = vec![0.0; n];
                system.add_local_of_velocity(&contacts, &free, &mut q_free);
                let rows = q_free.chunks_exact_mut(d).zip(u_guess.chunks_exact(d));
                for (contact, (q, u)) in contacts.iter().zip(rows) {
                    q[0] += (1.0 + e) * contact.gap() / h - u[0];
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
                response(system, &p, &mut change);
                for i in 0..nv {
                    next[i] += change[i];
                }
            }
            let moved = next
                .iter()
                .zip(&v_end)
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            let size = next.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
            v_end = next;
            report.newton_iterations = iteration + 1;
            if moved <= SETTLED * size {
                if is_solved {
                    report.status = StepStatus::Converged;
                }
                break;
            }
        }
        let mut q_end = q.clone();
        system.set_moved(q, &v_end, h, &mut q_end);
        if !system.is_finite(&q_end) || v_end.iter().any(|x| !x.is_finite()) {
            return Err(StepError::NonFinite { time });
        }
        system.normalise(&mut q_end);
        let mut shown = v_end.clone();
        if p.iter().all(|p| *p == 0.0) {
            let mut a = Vec::new();
            free_acceleration(system, options, &q_end, &v_end, time, &mut a)?;
            for i in 0..nv {
                shown[i] += 0.5 * h * a[i];
            }
        }
        *state.configuration = q_end;
        state.v.copy_from_slice(&shown);
        *state.time += h;
        warm_start.remember(&contacts, d, &p);
        memory.time = *state.time;
        memory.v = shown;
        memory.v_half = v_end;
        Ok(report)
    }
}
