//! Event-driven scheme for planar systems: a Runge–Kutta method of order 4 between located events,
//! and the impact law at impacts.
//!
//! Between events each contact is open, sticks or slides in one direction,
//! and λ solves linear equations:
//!
//! ```text
//! M a = F + H λ,    d/dt u_N = 0,    stick: d/dt u_T = 0,    slide: λ_T = −μ sign(u_T) λ_N
//! ```
//!
//! Projection after each step removes the drift in gap and velocity. An event is a gap that closes,
//! a λ_N or a friction reserve μ λ_N − |λ_T| that reaches zero, or a slip that stops; bisection on
//! the length of the step locates it. At an impact all touching contacts obey Newton's and
//! Coulomb's laws together, as in Moreau–Jean. The contact law at acceleration level then decides
//! the mode of each.
//!
//! All quantities converge with the order 4 of the Runge–Kutta method, which makes the scheme the
//! reference for scenes with few contacts. It cannot pass a point where infinitely many impacts
//! accumulate: after `max_impacts` in one step it refuses the step. Two opposite events of one kind
//! within a step go unnoticed. Painlevé's paradox remains unsolved at acceleration level.

use std::cell::RefCell;

use crate::whole::Whole;
use rover_core::integrator::{
    Dynamics, Integrator, KeyOf, Probe, ScratchOf, StateMut, StepError, StepOptions, StepReport,
    StepStatus, UnilateralContact, WarmStart,
};
use rover_core::law::newton_impact::rebound;
use rover_core::nalgebra::{DMatrix, DVector};
use rover_core::problem::{Dimension, Operator};
use rover_core::solver::SolverWorkspace;

use crate::acceleration::{
    accept, add_response, convective_acceleration, factorise, find, free_acceleration, friction,
    largest_displacement, response, solve_law,
};

/// Speed below which a contact neither approaches nor parts nor slides, m/s.
const AT_REST: f64 = 1e-10;

/// Gap below which a contact touches, m.
const TOUCHING: f64 = 1e-9;

/// Depth that is rounding, m.
const ROUNDING: f64 = 1e-13;

/// Most events of any kind in a step.
const MOST_EVENTS: usize = 200;

/// The scheme.
#[derive(Debug)]
pub struct EventDriven {
    /// Impacts in one step after which it is refused.
    pub max_impacts: usize,
    solver: RefCell<SolverWorkspace>,
}

impl Default for EventDriven {
    fn default() -> Self {
        Self {
            max_impacts: 20,
            solver: RefCell::default(),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Stick,
    /// In the direction of this sign.
    Slide(f64),
}

/// An event that decides how one contact goes on, whatever rounding says.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Decision<K> {
    Opens(K),
    Slides(K, f64),
}

/// The closed contacts between two events.
struct Motion<C> {
    contacts: Vec<C>,
    modes: Vec<Mode>,
    mu: Vec<f64>,
}

impl<C: UnilateralContact> Motion<C> {
    fn holds(&self, key: C::Key) -> bool {
        self.contacts.iter().any(|c| c.key() == key)
    }
}

/// What is about to end the motion; negative where it has.
#[derive(Clone, Copy, Debug)]
enum Reserve<K> {
    Gap(f64),
    Normal(f64, K),
    Friction(f64, K, f64),
    Slip(f64),
}

impl<K> Reserve<K> {
    fn value(&self) -> f64 {
        match self {
            Self::Gap(x) | Self::Normal(x, _) | Self::Friction(x, _, _) | Self::Slip(x) => *x,
        }
    }

    /// How the contact that ended the motion goes on, where that is decided.
    fn decision(self) -> Option<Decision<K>> {
        match self {
            Self::Gap(_) | Self::Slip(_) => None,
            Self::Normal(_, key) => Some(Decision::Opens(key)),
            Self::Friction(_, key, sign) => Some(Decision::Slides(key, sign)),
        }
    }
}

/// Configuration and velocity after a part of the step, and what is about to end the motion there.
type Reached<S> = (<S as Dynamics>::Configuration, Vec<f64>, Reserve<KeyOf<S>>);

/// One step's view: system, options and the solver's scratch.
struct Run<'a, S: Whole> {
    system: &'a mut S,
    options: &'a StepOptions,
    solver: &'a mut SolverWorkspace,
    time: f64,
    status: StepStatus,
}

impl<S: Whole> Run<'_, S> {
    /// Bisects for the event that ends the motion from (q, v) before `end`, a time from there, s,
    /// and what is reached then.
    fn locate(
        &mut self,
        motion: &mut Motion<S::Contact>,
        (q, v): (&S::Configuration, &[f64]),
        end: (f64, Reached<S>),
        reach: f64,
    ) -> Result<(f64, Reached<S>), StepError> {
        let h = self.options.time_step;
        // Bracket: nothing has ended at `low`, something has at `high`.
        let (mut high, mut found) = end;
        let mut low = 0.0;
        let mut trial = 0.5 * high;
        let mut is_bracketed = false;
        for _ in 0..100 {
            let (q_trial, v_trial) = self.advance(motion, q, v, trial)?;
            let there = self.reserve(motion, &q_trial, &v_trial, reach)?;
            if there.value() < 0.0 {
                high = trial;
                found = (q_trial, v_trial, there);
            } else {
                low = trial;
                is_bracketed = true;
            }
            if high - low <= 1e-15 * h.max(self.time) {
                break;
            }
            trial = 0.5 * (low + high);
            if !is_bracketed && high < 1e-12 * h {
                break;
            }
        }
        Ok((high, found))
    }

    /// Decides at (q, v) which contacts stay closed and in which mode; `decision` overrides cases
    /// that rounding would decide.
    fn begin(
        &mut self,
        q: &S::Configuration,
        v: &[f64],
        decision: Option<Decision<KeyOf<S>>>,
    ) -> Result<Motion<S::Contact>, StepError> {
        let mut contacts = Vec::new();
        find(self.system, q, v, TOUCHING, AT_REST, &mut contacts);
        let mut u = vec![0.0; 2 * contacts.len()];
        self.system.assemble(&contacts, v, &mut u);
        let mut rest = u.chunks_exact(2).map(|u| u[0].abs() <= AT_REST);
        contacts.retain(|contact| {
            let is_opening = matches!(decision, Some(Decision::Opens(key)) if key == contact.key());
            rest.next().unwrap_or(false) && !is_opening
        });
        if contacts.is_empty() {
            return Ok(Motion {
                contacts,
                modes: Vec::new(),
                mu: Vec::new(),
            });
        }
        let a = free_acceleration(self.system, self.options, q, v, self.time)?;
        let mut b = Vec::new();
        convective_acceleration(self.system, &mut contacts, q, v, &mut u, &mut b);
        self.system.add_local_of_velocity(&contacts, &a, &mut b);
        let large = 1e3 * b.iter().fold(1.0_f64, |m, b| m.max(b.abs()));
        let slips: Vec<Option<f64>> = contacts
            .iter()
            .zip(u.chunks_exact(2))
            .map(|(contact, u)| match decision {
                Some(Decision::Slides(key, sign)) if key == contact.key() => Some(sign),
                _ if u[1].abs() > AT_REST => Some(u[1].signum()),
                _ => None,
            })
            .collect();
        for (b, slip) in b.chunks_exact_mut(2).zip(&slips) {
            if let Some(sign) = slip {
                b[1] = sign * large;
            }
        }
        let (force, u) = self.solve(&contacts, &b);
        let scale = b.iter().step_by(2).fold(1e-3_f64, |m, b| m.max(b.abs()));
        let mut modes = Vec::new();
        let mut local = force.chunks_exact(2).zip(u.chunks_exact(2)).zip(&slips);
        contacts.retain(|_| {
            let Some(((_, u), slip)) = local.next() else {
                return false;
            };
            let is_parting = u[0] > 1e-9 * scale;
            if !is_parting {
                modes.push(match slip {
                    Some(sign) => Mode::Slide(*sign),
                    None if u[1].abs() > 1e-9 * scale => Mode::Slide(u[1].signum()),
                    None => Mode::Stick,
                });
            }
            !is_parting
        });
        let mu = friction(self.system, self.options, &contacts);
        Ok(Motion {
            contacts,
            modes,
            mu,
        })
    }

    /// Acceleration and reactions at (q, v); the closed contacts' velocities in `u`.
    fn accelerate(
        &mut self,
        motion: &mut Motion<S::Contact>,
        q: &S::Configuration,
        v: &[f64],
        u: &mut Vec<f64>,
    ) -> Result<(Vec<f64>, Vec<f64>), StepError> {
        let mut a = free_acceleration(self.system, self.options, q, v, self.time)?;
        let n = 2 * motion.contacts.len();
        if n == 0 {
            u.clear();
            return Ok((a, Vec::new()));
        }
        let mut b = Vec::new();
        convective_acceleration(self.system, &mut motion.contacts, q, v, u, &mut b);
        self.system
            .add_local_of_velocity(&motion.contacts, &a, &mut b);
        let W = self.system.problem(&b, &motion.mu).operator();
        let mut A = dense(W, n);
        let mut rhs = DVector::from_iterator(n, b.iter().map(|b| -b));
        for (i, (mode, mu)) in motion.modes.iter().zip(&motion.mu).enumerate() {
            if let Mode::Slide(sign) = mode {
                let row = 2 * i + 1;
                A.row_mut(row).fill(0.0);
                A[(row, row)] = 1.0;
                A[(row, 2 * i)] = mu * sign;
                rhs[row] = 0.0;
            }
        }
        let force = self.solve_linear(A, &rhs)?;
        add_response(self.system, &force, &mut a);
        Ok((a, force))
    }

    /// Impulses, or forces, of the contact law and the local velocities, from a free velocity.
    fn solve(&mut self, contacts: &[S::Contact], free: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut p = vec![0.0; free.len()];
        let (system, solver) = (&*self.system, &mut *self.solver);
        let (solved, u) = solve_law(system, self.options, contacts, free, &mut p, solver);
        if !solved.is_converged() {
            self.status = StepStatus::NotConverged;
        }
        (p, u)
    }

    fn solve_linear(&self, A: DMatrix<f64>, rhs: &DVector<f64>) -> Result<Vec<f64>, StepError> {
        let answer = A.lu().solve(rhs);
        let sound = answer.filter(|x| x.iter().all(|x| x.is_finite()));
        // Redundant contacts: this scheme has no rule to share a load among them.
        sound
            .map(|x| x.as_slice().to_vec())
            .ok_or(StepError::SingularMassMatrix { time: self.time })
    }

    /// Moves (q, v) by `dt` in one Runge–Kutta step and projects the drift away.
    fn advance(
        &mut self,
        motion: &mut Motion<S::Contact>,
        q: &S::Configuration,
        v: &[f64],
        dt: f64,
    ) -> Result<(S::Configuration, Vec<f64>), StepError> {
        let mut u = Vec::new();
        let mut at = q.clone();
        let sum = |v: &[f64], share: f64, a: &[f64]| -> Vec<f64> {
            v.iter().zip(a).map(|(v, a)| v + share * a).collect()
        };
        let (a1, _) = self.accelerate(motion, q, v, &mut u)?;
        let v2 = sum(v, 0.5 * dt, &a1);
        self.system.set_moved(q, v, 0.5 * dt, &mut at);
        let (a2, _) = self.accelerate(motion, &at, &v2, &mut u)?;
        let v3 = sum(v, 0.5 * dt, &a2);
        self.system.set_moved(q, &v2, 0.5 * dt, &mut at);
        let (a3, _) = self.accelerate(motion, &at, &v3, &mut u)?;
        let v4 = sum(v, dt, &a3);
        self.system.set_moved(q, &v3, dt, &mut at);
        let (a4, _) = self.accelerate(motion, &at, &v4, &mut u)?;
        let mean = |x: [&[f64]; 4], i: usize| (x[0][i] + 2.0 * (x[1][i] + x[2][i]) + x[3][i]) / 6.0;
        let nv = v.len();
        let v_mean: Vec<f64> = (0..nv).map(|i| mean([v, &v2, &v3, &v4], i)).collect();
        let a_mean: Vec<f64> = (0..nv).map(|i| mean([&a1, &a2, &a3, &a4], i)).collect();
        self.system.set_moved(q, &v_mean, dt, &mut at);
        let mut v_end = sum(v, dt, &a_mean);
        self.project(motion, &mut at, &mut v_end)?;
        Ok((at, v_end))
    }

    /// Newton's iteration on the gaps of the closed contacts, then their velocities, along M⁻¹ H.
    fn project(
        &mut self,
        motion: &mut Motion<S::Contact>,
        q: &mut S::Configuration,
        v: &mut [f64],
    ) -> Result<(), StepError> {
        let n = 2 * motion.contacts.len();
        if n == 0 {
            return Ok(());
        }
        let mut u = vec![0.0; n];
        for iteration in 0..4 {
            self.system.place_middle(q);
            factorise(self.system, self.options, self.time)?;
            self.system.place_end(q);
            self.system.relocate(&mut motion.contacts);
            self.system.assemble(&motion.contacts, v, &mut u);
            let is_last = iteration == 3;
            let W = self.system.problem(&u, &motion.mu).operator();
            let mut A = dense(W, n);
            let mut rhs = DVector::zeros(n);
            for (i, (contact, mode)) in motion.contacts.iter().zip(&motion.modes).enumerate() {
                rhs[2 * i] = if is_last { -u[2 * i] } else { -contact.gap() };
                let row = 2 * i + 1;
                if is_last && *mode == Mode::Stick {
                    rhs[row] = -u[row];
                } else {
                    A.row_mut(row).fill(0.0);
                    A[(row, row)] = 1.0;
                }
            }
            let p = self.solve_linear(A, &rhs)?;
            if is_last {
                add_response(self.system, &p, v);
            } else {
                let change = response(self.system, &p);
                self.system.advance(q, &change, 1.0);
            }
        }
        Ok(())
    }

    /// What is nearest to its end at (q, v).
    fn reserve(
        &mut self,
        motion: &mut Motion<S::Contact>,
        q: &S::Configuration,
        v: &[f64],
        reach: f64,
    ) -> Result<Reserve<KeyOf<S>>, StepError> {
        let mut near = Vec::new();
        find(self.system, q, v, reach, f64::INFINITY, &mut near);
        let mut least = Reserve::Gap(reach);
        let mut enter = |candidate: Reserve<KeyOf<S>>| {
            if candidate.value() < least.value() {
                least = candidate;
            }
        };
        for contact in &near {
            if !motion.holds(contact.key()) {
                enter(Reserve::Gap(contact.gap() + ROUNDING));
            }
        }
        let mut u = Vec::new();
        let (_, force) = self.accelerate(motion, q, v, &mut u)?;
        let rows = force.chunks_exact(2).zip(u.chunks_exact(2));
        for (i, (force, u)) in rows.enumerate() {
            let (key, mu) = (motion.contacts[i].key(), motion.mu[i]);
            enter(Reserve::Normal(force[0], key));
            match motion.modes[i] {
                Mode::Stick => enter(Reserve::Friction(
                    mu * force[0] - force[1].abs(),
                    key,
                    -force[1].signum(),
                )),
                Mode::Slide(sign) => enter(Reserve::Slip(sign * u[1] + 1e-13)),
            }
        }
        Ok(least)
    }

    /// The impact law for all touching contacts.
    fn strike(&mut self, q: &S::Configuration, v: &mut [f64]) -> Result<(), StepError> {
        let mut contacts = Vec::new();
        find(self.system, q, v, TOUCHING, f64::INFINITY, &mut contacts);
        factorise(self.system, self.options, self.time)?;
        let mut free = vec![0.0; 2 * contacts.len()];
        self.system.assemble(&contacts, v, &mut free);
        for u in free.chunks_exact_mut(2) {
            u[0] += rebound(self.options.restitution, u[0]);
        }
        let (p, _) = self.solve(&contacts, &free);
        add_response(self.system, &p, v);
        Ok(())
    }
}

impl<S: Whole> Integrator<S> for EventDriven {
    /// # Panics
    /// If the contacts have two tangents.
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, S::Configuration>,
        _warm_start: &mut WarmStart<KeyOf<S>>,
        _scratch: &mut ScratchOf<S>,
        _probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        assert!(
            S::DIMENSION == Dimension::Two,
            "the event-driven scheme knows slip in a plane only"
        );
        let h = options.time_step;
        let time = *state.time;
        let mut q = state.configuration.clone();
        let mut v = state.v.to_vec();
        // No further than what moves in the step and a little: what lies beyond cannot close.
        let reach = 4.0 * h * largest_displacement(system, &v)
            + 2.0 * options.gravity.norm() * h * h
            + 1e-6;
        let solver = &mut *self.solver.borrow_mut();
        let mut run = Run {
            system,
            options,
            solver,
            time,
            status: StepStatus::Converged,
        };
        let mut left = h;
        let (mut events, mut impacts) = (0, 0);
        let mut motion = run.begin(&q, &v, None)?;
        let mut n_contacts = motion.contacts.len();
        while left > 0.0 {
            let (q_end, v_end) = run.advance(&mut motion, &q, &v, left)?;
            let at_end = run.reserve(&mut motion, &q_end, &v_end, reach)?;
            if at_end.value() >= 0.0 {
                (q, v) = (q_end, v_end);
                break;
            }
            let end = (left, (q_end, v_end, at_end));
            let (until, event) = run.locate(&mut motion, (&q, &v), end, reach)?;
            left -= until;
            let ended;
            (q, v, ended) = event;
            events += 1;
            match ended {
                Reserve::Gap(_) => {
                    impacts += 1;
                    run.strike(&q, &mut v)?;
                }
                Reserve::Slip(_) => stop_slip(&mut run, &mut motion, &mut q, &mut v)?,
                Reserve::Normal(..) | Reserve::Friction(..) => {}
            }
            if impacts > self.max_impacts || events > MOST_EVENTS {
                return Err(StepError::Accumulation {
                    time: time + h - left,
                    events,
                });
            }
            motion = run.begin(&q, &v, ended.decision())?;
            n_contacts = n_contacts.max(motion.contacts.len());
        }
        let status = run.status;
        accept(&*run.system, (q, &v), h, state)?;
        Ok(StepReport {
            steps: 1,
            status,
            iterations: events,
            n_contacts,
            ..StepReport::default()
        })
    }
}

/// Takes a slip below the event's accuracy out of v, so that the contact may stick; a contact that
/// still slides is left alone.
fn stop_slip<S: Whole>(
    run: &mut Run<'_, S>,
    motion: &mut Motion<S::Contact>,
    q: &mut S::Configuration,
    v: &mut [f64],
) -> Result<(), StepError> {
    let mut u = vec![0.0; 2 * motion.contacts.len()];
    run.system.place_end(q);
    run.system.relocate(&mut motion.contacts);
    run.system.assemble(&motion.contacts, v, &mut u);
    for (mode, u) in motion.modes.iter_mut().zip(u.chunks_exact(2)) {
        *mode = if u[1].abs() > 1e-9 {
            Mode::Slide(u[1].signum())
        } else {
            Mode::Stick
        };
    }
    run.project(motion, q, v)
}

/// The operator as a matrix, column by column.
fn dense(W: Operator<'_>, n: usize) -> DMatrix<f64> {
    let zero = vec![0.0; n];
    let mut A = DMatrix::zeros(n, n);
    for (j, mut column) in A.column_iter_mut().enumerate() {
        let mut unit = zero.clone();
        unit[j] = 1.0;
        W.multiply_add(&unit, &zero, column.as_mut_slice());
    }
    A
}
