//! Lanes that solve contact problems, each its own.
//!
//! A lane takes the next problem when its own is done, so that the cost follows the mean of the
//! steps and not the largest. No lane's bits depend on its neighbours.

use super::blocks::DenseSystem;
use super::dry::{DrySystem, PLACES};
use super::loaded::Loaded;
use super::problem::{
    ContactProblem, DENSE_BLOCKS, LARGE_BLOCKS, MAX_CONTACTS, MAX_DENSE, MAX_LARGE,
};
use super::velocities::VelocitySystem;
use crate::problem::{Answered, ContactScales, Magnitudes, Redundancy, Settled};
use crate::scalar::{Lane, LaneMask, MAX_LANES, inlined};
use crate::solver::pivoting::{FURTHER_ALPHAS, Few, Pivoting};

/// Most steps of a solve: those of the first attempt and of all further ones.
pub const MAX_ITERATIONS: usize =
    <DenseSystem<f64, MAX_DENSE, DENSE_BLOCKS> as Loaded<f64, MAX_DENSE>>::MAX_STEPS
        * (1 + FURTHER_ALPHAS.len());

/// What a problem has on its diagonal beside the machine's operator, relative to the mean diagonal,
/// from which on its answer is unique and the smallest `α` serves.
const DEFINITE: f64 = 1e-3;

/// Smallest pivot, relative to the mean diagonal of W and to `α`, of systems whose impulses the
/// motion determines. A null vector leaves a pivot of `α` over the square of its last entry, so
/// one whose last entry is a thousandth is still found.
const DETERMINED: [f64; 2] = [1e-3, 1e6];

/// What is known about other impulses with the motion of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Freedom {
    /// There are none.
    None,
    /// They are those of the null space of the last factors.
    OfFactors,
    /// There may be some.
    Unknown,
}

/// Where a solver gets its problems and leaves their answers.
pub(super) trait ProblemSource {
    /// Index of the next problem.
    fn next(&mut self) -> Option<usize>;

    /// A problem has ended.
    fn end(&mut self, index: usize);

    /// Whether to stop although lanes still work; asked when there is no problem for a lane.
    fn may_leave(&self, n_active: usize) -> bool;
}

/// Lanes for problems with their whole operator.
pub(super) type DenseSolver<T, const C: usize, const B: usize> =
    LaneSolver<T, C, DenseSystem<T, C, B>>;

/// Lanes for those with dry joints.
pub(super) type DrySolver<T> = LaneSolver<T, PLACES, DrySystem<T>>;

/// Lanes for those of many rigid discs.
pub(super) type LargeSolver<T> = DenseSolver<T, MAX_LARGE, LARGE_BLOCKS>;

/// Lanes for problems with a factored operator.
pub(super) type FactoredSolver<T> = LaneSolver<T, MAX_CONTACTS, VelocitySystem<T, MAX_CONTACTS>>;

/// Lanes with their problems of at most `C` contacts.
pub(super) struct LaneSolver<T: Lane, const C: usize, S: Loaded<T, C>> {
    system: S,
    pivoting: Pivoting<T, Few<C>>,
    /// Lanes with a problem, those that have taken all steps of an attempt, and those that begin
    /// another one.
    active: u32,
    late: u32,
    again: u32,
    /// Which problem each lane has, and how many steps its attempt has taken.
    problem: [usize; MAX_LANES],
    steps: [usize; MAX_LANES],
    /// Attempts of each lane that failed, and its steps in them.
    failed: [usize; MAX_LANES],
    before: [usize; MAX_LANES],
    redundancy: Redundancy,
}

impl<T: Lane, const C: usize, S: Loaded<T, C>> LaneSolver<T, C, S> {
    #[inline(always)]
    pub(super) fn new(token: T::Token) -> Self {
        Self {
            system: S::new(token),
            pivoting: Pivoting::new(token),
            active: 0,
            late: 0,
            again: 0,
            problem: [0; MAX_LANES],
            steps: [0; MAX_LANES],
            failed: [0; MAX_LANES],
            before: [0; MAX_LANES],
            redundancy: Redundancy::default(),
        }
    }

    /// Gives a lane a problem. [`Pivoting::begin`] follows.
    #[inline(always)]
    fn load(&mut self, lane: usize, index: usize, problem: &ContactProblem) {
        let n = problem.n_contacts;
        let mut trace = 0.0;
        let mut data = Magnitudes::default();
        let own = &mut self.pivoting;
        assert!(lane < T::LANES, "a lane");
        for i in self.system.load(lane, problem) {
            let contact = S::contact_at(problem, i);
            let is_used = contact.is_some();
            let contact = contact.unwrap_or(0);
            if !is_used {
                own.vacate(i, lane);
            }
            let w = S::block_of(problem, contact);
            let (normal, tangential) = if is_used {
                (w[0], w[4] + w[8])
            } else {
                (1.0, 2.0)
            };
            let scales = ContactScales::new::<3>(normal, tangential);
            let mu = if is_used { problem.mu[contact] } else { 0.0 };
            own.laws[i].set(lane, mu, scales);
            let start = if problem.has_start {
                &problem.start
            } else {
                &problem.p
            };
            for k in 0..3 {
                let at = 3 * contact + k;
                let [p, last, q] = if is_used {
                    [start[at], problem.p[at], problem.q[at]]
                } else {
                    [0.0; 3]
                };
                own.p[i][k].set(lane, p);
                own.centre[i][k].set(lane, last);
                self.system.free_velocity_mut(i)[k].set(lane, q);
            }
            if is_used {
                trace += normal + tangential;
                data.add(&problem.q[3 * contact..3 * contact + 3], scales.mass);
            }
        }
        let mean = trace / (3 * n) as f64;
        let [speed, impulse] = data.inverses();
        own.mean.set(lane, if mean > 0.0 { mean } else { 1.0 });
        own.asked.set(lane, 0.0);
        let here = T::mask(own.mean.token(), 1 << lane);
        own.definite = own.definite & !here;
        if S::least_softness(problem) > DEFINITE * mean {
            own.definite = own.definite | here;
        }
        own.inverses[0].set(lane, speed * speed);
        own.inverses[1].set(lane, impulse * impulse);
        self.steps[lane] = 0;
        self.failed[lane] = 0;
        self.before[lane] = 0;
        self.problem[lane] = index;
    }

    /// Lets a lane try its problem again, from the last step's impulses, with another `α`, if there
    /// is one left. [`Pivoting::begin`] follows.
    #[inline(always)]
    fn retry(&mut self, lane: usize, problem: &ContactProblem) -> bool {
        let Some(alpha) = FURTHER_ALPHAS.get(self.failed[lane]) else {
            return false;
        };
        self.failed[lane] += 1;
        self.before[lane] += self.steps[lane];
        self.steps[lane] = 0;
        let own = &mut self.pivoting;
        own.asked.set(lane, *alpha);
        for i in self.system.places() {
            if let Some(contact) = S::contact_at(problem, i) {
                for k in 0..3 {
                    let last = problem.p[3 * contact + k];
                    own.centre[i][k].set(lane, last);
                    own.p[i][k].set(lane, last);
                }
            }
        }
        true
    }

    /// Writes a lane's answer to its problem, or that there is none.
    #[inline(always)]
    fn store(&self, lane: usize, problem: &mut ContactProblem, is_solved: bool) {
        problem.iterations = self.before[lane] + self.steps[lane];
        problem.factorisations = problem.iterations;
        problem.is_solved = is_solved;
        if !is_solved {
            return;
        }
        let own = &self.pivoting;
        problem.residual = own.residual_of(lane);
        for i in self.system.places() {
            if let Some(contact) = S::contact_at(problem, i) {
                for k in 0..3 {
                    problem.p[3 * contact + k] = own.p[i][k].get(lane);
                    problem.u[3 * contact + k] = own.u[i][k].get(lane);
                }
            }
        }
    }

    /// Speed up to which a lane's contact is at rest, m/s.
    #[inline(always)]
    fn still(&self, lane: usize, tolerances: [T; 2]) -> f64 {
        (tolerances[0].get(lane) / self.pivoting.inverses[0].get(lane)).sqrt()
    }

    /// What the last factors of a lane say about other impulses with the motion of its answer.
    #[inline(always)]
    fn freedom(&self, lane: usize, problem: &ContactProblem, still: f64) -> Freedom {
        let own = &self.pivoting;
        if !problem.asks_least || own.definite.get(lane) {
            return Freedom::None;
        }
        if self.steps[lane] == 0 {
            // The factors are another problem's.
            let stays = problem.begins_least && !problem.has_start && self.failed[lane] == 0;
            return if stays {
                Freedom::None
            } else {
                Freedom::Unknown
            };
        }
        let pivot = self.system.least_pivot(lane);
        if pivot.is_nan() || pivot <= 0.0 {
            return Freedom::Unknown;
        }
        let mut slides = false;
        for i in self.system.places() {
            if S::contact_at(problem, i).is_none() {
                continue;
            }
            // The factors are those of the modes, the motion may allow more.
            let (closed, sticks) = own.mode_of(i, lane);
            let [n, t, b] = own.u[i].map(|u| u.get(lane));
            let is_smooth = own.laws[i].mu.get(lane) == 0.0;
            if closed && !sticks && !is_smooth {
                if t * t + b * b <= still * still {
                    return Freedom::Unknown;
                }
                slides = true;
            } else if !closed && n <= still {
                return Freedom::Unknown;
            }
        }
        let [of_mean, of_alpha] = DETERMINED;
        let least = (of_mean * own.mean.get(lane)).max(of_alpha * own.alpha_of(lane));
        if pivot > least {
            Freedom::None
        } else if slides {
            Freedom::Unknown
        } else {
            Freedom::OfFactors
        }
    }

    /// Takes the least impulses where the last factors give them. Returns those of the lanes
    /// `solved` that have them then.
    #[inline(always)]
    fn settle_together(
        &mut self,
        token: T::Token,
        solved: u32,
        problems: &[ContactProblem],
        tolerances: [T; 2],
    ) -> u32 {
        let (mut done, mut asks) = (0, 0);
        let mut left = solved;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let still = self.still(lane, tolerances);
            match self.freedom(lane, &problems[self.problem[lane]], still) {
                Freedom::None => done |= 1 << lane,
                Freedom::OfFactors => asks |= 1 << lane,
                Freedom::Unknown => {}
            }
        }
        if asks != 0 {
            let lanes = T::mask(token, asks);
            done |= self
                .pivoting
                .remove_null_part(&mut self.system, lanes)
                .bits();
        }
        done
    }

    /// Takes the least of the impulses that cause the same motion.
    #[inline(always)]
    fn settle(&mut self, lane: usize, problem: &mut ContactProblem, tolerances: [T; 2]) {
        let still = self.still(lane, tolerances);
        let n = problem.n_contacts;
        let mut p = problem.p;
        let answered = Answered {
            d: 3,
            block: |i, j| problem.block_at(i, j),
            mu: &problem.mu[..n],
            u: &problem.u[..3 * n],
            still,
        };
        let settled = self.redundancy.settle(&answered, 0..n, &mut p[..3 * n]);
        if settled != Settled::Unchanged {
            problem.p[..3 * n].copy_from_slice(&p[..3 * n]);
        }
        if settled == Settled::AtRest {
            problem.u[..3 * n].fill(0.0);
        }
    }

    /// A step of all lanes that have a problem.
    #[inline(always)]
    fn step(&mut self, token: T::Token, tolerances: [T; 2]) {
        let active = T::mask(token, self.active);
        self.pivoting.advance(&mut self.system, active, tolerances);
        self.late = 0;
        for lane in 0..T::LANES {
            self.steps[lane] += 1;
            self.late |= u32::from(self.steps[lane] >= S::MAX_STEPS) << lane;
        }
    }

    /// Forgets the problems of all lanes.
    pub(super) fn clear(&mut self) {
        (self.active, self.late, self.again) = (0, 0, 0);
    }

    /// Lanes with a problem.
    pub(super) fn n_active(&self) -> usize {
        (self.active | self.again).count_ones() as usize
    }

    /// Solves the problems of a line, until it has no more or lets the solver leave. Problems that
    /// are not solved then stay with their lanes. `tolerances`: squares.
    pub(super) fn run(
        &mut self,
        token: T::Token,
        problems: &mut [ContactProblem],
        tolerances: [T; 2],
        line: &mut impl ProblemSource,
    ) {
        inlined!(
            T::vectorize,
            token,
            self.solve(token, problems, tolerances, line)
        );
    }

    /// [`Self::run`], for the instructions that it is compiled for.
    #[inline(always)]
    fn solve(
        &mut self,
        token: T::Token,
        problems: &mut [ContactProblem],
        tolerances: [T; 2],
        line: &mut impl ProblemSource,
    ) {
        let mut has_gone_on = false;
        loop {
            let mut new = std::mem::take(&mut self.again);
            let mut idle = ((1_u32 << T::LANES) - 1) & !self.active & !new;
            while idle != 0 {
                let Some(index) = line.next() else {
                    break;
                };
                let lane = idle.trailing_zeros();
                idle &= idle - 1;
                self.load(lane as usize, index, &problems[index]);
                new |= 1 << lane;
            }
            self.active |= new;
            self.late &= !new;
            if new != 0 {
                self.pivoting.begin(&mut self.system, T::mask(token, new));
            }
            let n_active = self.n_active();
            if n_active == 0 || (has_gone_on && n_active < T::LANES && line.may_leave(n_active)) {
                return;
            }
            has_gone_on = true;
            let own = &mut self.pivoting;
            let solved = own.is_solved(tolerances);
            let ends = (solved | own.lost | !own.is_finite()).bits() | self.late;
            let ended = self.active & ends;
            if ended == 0 {
                self.step(token, tolerances);
                continue;
            }
            self.active &= !ended;
            let solved = solved.bits();
            let settled = self.settle_together(token, ended & solved, problems, tolerances);
            let mut left = ended;
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                let index = self.problem[lane];
                let problem = &mut problems[index];
                let is_solved = solved >> lane & 1 == 1;
                if !is_solved && self.retry(lane, problem) {
                    self.again |= 1 << lane;
                } else {
                    self.store(lane, problem, is_solved);
                    if is_solved && settled >> lane & 1 == 0 {
                        self.settle(lane, problem, tolerances);
                    }
                    line.end(index);
                }
            }
        }
    }
}
