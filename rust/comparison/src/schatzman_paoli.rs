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

use crate::whole::Whole;
use rover_core::integrator::{
    Integrator, KeyOf, Probe, ScratchOf, StateMut, StepError, StepOptions, StepReport, StepStart,
    StepStatus, UnilateralContact, WarmStart,
};
use rover_core::solver::{SolveReport, SolverWorkspace};

use crate::acceleration::{
    factorise, find, free_acceleration, largest_displacement, response, smooth_acceleration,
    solve_law,
};

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

/// The contacts of a step, and their impulses as far as they are iterated.
struct Touching<S: Whole> {
    contacts: Vec<S::Contact>,
    /// Where their gaps are measured.
    q_star: S::Configuration,
    p: Vec<f64>,
    u_guess: Vec<f64>,
    /// Change of the velocity by the impulses.
    change: Vec<f64>,
}

impl<S: Whole> Touching<S> {
    fn new(contacts: Vec<S::Contact>, q: &S::Configuration) -> Self {
        let n = S::DIMENSION.components() * contacts.len();
        Self {
            contacts,
            q_star: q.clone(),
            p: vec![0.0; n],
            u_guess: vec![0.0; n],
            change: Vec::new(),
        }
    }

    /// Solves the law with the gaps linearised at `q_star`, about the velocity `guess`, for the
    /// velocity `free` without impulses.
    fn solve(
        &mut self,
        system: &mut S,
        options: &StepOptions,
        guess: &[f64],
        free: &[f64],
        solver: &mut SolverWorkspace,
    ) -> SolveReport {
        let (h, e) = (options.time_step, options.restitution);
        let d = S::DIMENSION.components();
        system.place_end(&self.q_star);
        system.relocate(&mut self.contacts);
        system.assemble(&self.contacts, guess, &mut self.u_guess);
        let mut q = vec![0.0; self.p.len()];
        system.add_local_of_velocity(&self.contacts, free, &mut q);
        let rows = q.chunks_exact_mut(d).zip(self.u_guess.chunks_exact(d));
        for (contact, (q, u)) in self.contacts.iter().zip(rows) {
            q[0] += (1.0 + e) * contact.gap() / h - u[0];
        }
        let contacts = &self.contacts;
        let (solved, _) = solve_law(system, options, contacts, &q, &mut self.p, solver);
        self.change = response(system, &self.p);
        solved
    }
}

/// Iterates on v_{k+½} and the impulses in `touching`. `start.v` is v_{k−½}.
fn iterate<S: Whole>(
    system: &mut S,
    options: &StepOptions,
    start: StepStart<'_, S::Configuration>,
    touching: &mut Touching<S>,
    solver: &mut SolverWorkspace,
    report: &mut StepReport,
) -> Vec<f64> {
    let (h, e) = (options.time_step, options.restitution);
    let (q, before) = (start.configuration, start.v);
    let nv = before.len();
    let mut v_end = before.to_vec();
    let (mut v_mean, mut v_star) = (vec![0.0; nv], vec![0.0; nv]);
    let mut free = vec![0.0; nv];
    for iteration in 0..MOST {
        for i in 0..nv {
            v_mean[i] = 0.5 * (before[i] + v_end[i]);
            v_star[i] = (v_end[i] - e * before[i]) / (1.0 + e);
        }
        system.load(options, start, &v_mean, &mut free);
        system.half_solve(&mut free);
        system.half_solve_back(&mut free);
        for i in 0..nv {
            free[i] += before[i];
        }
        let mut next = free.clone();
        let mut is_solved = true;
        if !touching.contacts.is_empty() {
            system.set_moved(q, &v_star, h, &mut touching.q_star);
            let solved = touching.solve(system, options, &v_end, &free, solver);
            report.iterations += solved.iterations;
            report.residual = solved.residual;
            is_solved = solved.is_converged();
            for i in 0..nv {
                next[i] += touching.change[i];
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
    v_end
}

impl<S: Whole> Integrator<S> for SchatzmanPaoli {
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
        let d = S::DIMENSION.components();
        let time = *state.time;
        let g = options.gravity.norm();
        let memory = &mut *self.memory.borrow_mut();
        let (q, v) = (&*state.configuration, &*state.v);
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
        let reach = 3.0 * h * largest_displacement(system, before) + 2.0 * g * h * h;
        find(system, q, before, reach, f64::INFINITY, &mut contacts);
        system.place_middle(q);
        factorise(system, options, time)?;
        let mut report = StepReport {
            steps: 1,
            status: StepStatus::NotConverged,
            n_contacts: contacts.len(),
            ..StepReport::default()
        };
        let mut touching = Touching::<S>::new(contacts, q);
        warm_start.recall(&touching.contacts, d, &mut touching.p);
        let start = StepStart::at(q, before);
        let solver = &mut memory.solver;
        let v_end = iterate(system, options, start, &mut touching, solver, &mut report);
        let mut q_end = q.clone();
        system.set_moved(q, &v_end, h, &mut q_end);
        if !system.is_finite(&q_end) || v_end.iter().any(|x| !x.is_finite()) {
            return Err(StepError::NonFinite { time });
        }
        system.normalise(&mut q_end);
        let mut shown = v_end.clone();
        if touching.p.iter().all(|p| *p == 0.0) {
            let a = free_acceleration(system, options, &q_end, &v_end, time)?;
            for i in 0..shown.len() {
                shown[i] += 0.5 * h * a[i];
            }
        }
        *state.configuration = q_end;
        state.v.copy_from_slice(&shown);
        *state.time += h;
        warm_start.remember(&touching.contacts, d, &touching.p);
        memory.time = *state.time;
        memory.v = shown;
        memory.v_half = v_end;
        Ok(report)
    }
}
