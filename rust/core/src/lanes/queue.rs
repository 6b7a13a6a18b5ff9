//! The queue of the contact problems of several rovers.
//!
//! Lanes take the next problem when theirs is done, so that the cost follows the mean of the steps
//! and not the largest. No lane's bits depend on its neighbours.
//!
//! Measured on recorded drives of the built-in rover in steps of 5 ms, with torques and set-points
//! drawn anew every ten steps: 2.2 systems a problem when it only steers, 3.3 with torques up to
//! 60 N m, 3.5 to 4.2 among rocks. Of 1.6 million problems of longer drives, on the plane and among
//! rocks, 4912 resist the first attempt and 67 all four.

use super::equations::Factors;
use super::pivoting::Pivoting;
use super::problem::{ContactProblem, MAX_CONTACTS, block};
use crate::problem::{ContactScales, Magnitudes, Residual};
use crate::scalar::{Lane, LaneMask, MAX_LANES};
use crate::solver::{FURTHER_ALPHAS, SolverOptions};

/// Most steps of an attempt. What is unsolved then goes in circles, mostly.
const MAX_STEPS: usize = 80;

/// Most steps of a solve: those of the first attempt and of all further ones.
pub const MAX_ITERATIONS: usize = MAX_STEPS * (1 + FURTHER_ALPHAS.len());

/// Contacts up to which the smaller system serves, that of a rover with six wheels on the plane.
const FEW: usize = 6;

/// Solves all problems. Up to the list's end each lane has one to work on.
///
/// A problem that takes too long, or goes in circles, is tried again from its start with another
/// `α`. One that resists, or has numbers that are not finite, keeps its starting
/// impulse.
///
/// # Panics
/// If a problem has more contacts than fit.
pub fn solve_all<T: Lane>(
    token: T::Token,
    problems: &mut [ContactProblem],
    options: &SolverOptions,
) {
    let mut most = 0;
    for problem in problems.iter_mut() {
        assert!(
            problem.n_contacts <= MAX_CONTACTS,
            "at most {MAX_CONTACTS} contacts"
        );
        problem.begin();
        if !problem.is_solved {
            most = most.max(problem.n_contacts);
        }
    }
    if most > 0 {
        T::vectorize(
            token,
            #[inline(always)]
            || solve_some::<T, FEW>(token, problems, options, 1),
        );
    }
    if most > FEW {
        T::vectorize(
            token,
            #[inline(always)]
            || solve_some::<T, MAX_CONTACTS>(token, problems, options, FEW + 1),
        );
    }
}

impl ContactProblem {
    /// Forgets any earlier answer. Without contacts or free velocity the answer is zero.
    fn begin(&mut self) {
        let n = self.n_unknowns();
        let at_rest = self.q[..n].iter().all(|x| *x == 0.0);
        self.iterations = 0;
        self.is_solved = at_rest;
        self.residual = Residual::UNSOLVED;
        if at_rest {
            self.p[..n].fill(0.0);
            self.u[..n].fill(0.0);
            self.residual = Residual {
                relative: 0.0,
                velocity: 0.0,
            };
        } else if !self.p[..n].iter().all(|x| x.is_finite()) {
            self.p[..n].fill(0.0);
        }
    }
}

/// Lanes with their problems.
struct Bench<T: Lane, const C: usize> {
    pivoting: Pivoting<T, C>,
    /// Which problem each lane has, and how many steps its attempt has taken.
    problem: [usize; MAX_LANES],
    steps: [usize; MAX_LANES],
    /// Attempts of each lane that failed, and its steps in them.
    failed: [usize; MAX_LANES],
    before: [usize; MAX_LANES],
}

impl<T: Lane, const C: usize> Bench<T, C> {
    #[inline(always)]
    fn new(token: T::Token) -> Self {
        Self {
            pivoting: Pivoting::new(token),
            problem: [0; MAX_LANES],
            steps: [0; MAX_LANES],
            failed: [0; MAX_LANES],
            before: [0; MAX_LANES],
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
        for (b, (own, w)) in own
            .W
            .iter_mut()
            .zip(&problem.W)
            .take(block(C, 0))
            .enumerate()
        {
            let is_used = b < block(n, 0);
            for k in 0..9 {
                own[k].set(lane, if is_used { w[k] } else { 0.0 });
            }
        }
        for i in 0..C {
            let is_used = i < n;
            let w = &problem.W[block(i, i)];
            let (normal, tangential) = if is_used {
                (w[0], w[4] + w[8])
            } else {
                (1.0, 2.0)
            };
            let scales = ContactScales::new::<3>(normal, tangential);
            let [rho_N, rho_T] = scales.modes;
            let law = &mut own.laws[i];
            law.mu.set(lane, if is_used { problem.mu[i] } else { 0.0 });
            law.rho[0].set(lane, rho_N);
            law.rho[1].set(lane, rho_T);
            law.inverse[0].set(lane, 1.0 / rho_N);
            law.inverse[1].set(lane, 1.0 / rho_T);
            law.mass_squared.set(lane, scales.mass * scales.mass);
            for k in 0..3 {
                let at = 3 * i + k;
                let (p, q) = if is_used {
                    (problem.p[at], problem.q[at])
                } else {
                    (0.0, 0.0)
                };
                own.p[i][k].set(lane, p);
                own.q[i][k].set(lane, q);
            }
            if is_used {
                trace += normal + tangential;
                data.add(&problem.q[3 * i..3 * i + 3], scales.mass);
            }
        }
        let mean = trace / (3 * n) as f64;
        let [speed, impulse] = data.inverses();
        own.mean.set(lane, if mean > 0.0 { mean } else { 1.0 });
        own.asked.set(lane, 0.0);
        own.inverses[0].set(lane, speed * speed);
        own.inverses[1].set(lane, impulse * impulse);
        self.steps[lane] = 0;
        self.failed[lane] = 0;
        self.before[lane] = 0;
        self.problem[lane] = index;
    }

    /// Lets a lane try its problem again from the start, with another `α`, if there is one left.
    /// [`Pivoting::begin`] follows.
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
        for i in 0..problem.n_contacts {
            for k in 0..3 {
                own.p[i][k].set(lane, problem.p[3 * i + k]);
            }
        }
        true
    }

    /// Writes a lane's answer to its problem, or that there is none.
    #[inline(always)]
    fn store(&self, lane: usize, problem: &mut ContactProblem, is_solved: bool) {
        problem.iterations = self.before[lane] + self.steps[lane];
        problem.is_solved = is_solved;
        if !is_solved {
            return;
        }
        let own = &self.pivoting;
        let [relative, largest] = own.residual();
        problem.residual = Residual {
            relative: relative.get(lane).sqrt(),
            velocity: largest.get(lane).sqrt(),
        };
        for i in 0..problem.n_contacts {
            for k in 0..3 {
                problem.p[3 * i + k] = own.p[i][k].get(lane);
                problem.u[3 * i + k] = own.u[i][k].get(lane);
            }
        }
    }

    /// A step of the lanes of a mask. Returns the lanes that have taken all that they may.
    #[inline(always)]
    fn step(&mut self, active: T::Mask, tolerances: [T; 2], factors: &mut Factors<T, C>) -> u32 {
        let own = &mut self.pivoting;
        own.correct(active);
        own.step(active, factors);
        let nearly = active & own.is_near() & !own.is_solved(tolerances);
        if nearly.any() {
            own.refine(nearly, factors);
        }
        let mut late = 0;
        for lane in 0..T::LANES {
            self.steps[lane] += 1;
            late |= u32::from(self.steps[lane] >= MAX_STEPS) << lane;
        }
        late
    }
}

/// Index of the next problem of `least` to `C` contacts that is to be solved.
#[inline(always)]
fn next<const C: usize>(problems: &[ContactProblem], from: usize, least: usize) -> usize {
    let mut at = from;
    while at < problems.len() {
        let problem = &problems[at];
        if !problem.is_solved && (least..=C).contains(&problem.n_contacts) {
            break;
        }
        at += 1;
    }
    at
}

/// Solves the problems of `least` to `C` contacts.
#[inline(always)]
fn solve_some<T: Lane, const C: usize>(
    token: T::Token,
    problems: &mut [ContactProblem],
    options: &SolverOptions,
    least: usize,
) {
    let zero = T::splat(token, 0.0);
    let square = |x: f64| T::splat(token, x * x);
    let tolerances = [
        square(options.tolerance),
        square(options.velocity_tolerance),
    ];
    let mut bench = Bench::<T, C>::new(token);
    let mut factors: Factors<T, C> = [[[zero; 9]; C]; C];
    let mut waiting = 0;
    let mut active = 0;
    let mut late = 0;
    // Lanes without a problem.
    let mut idle = (1_u32 << T::LANES) - 1;
    // Lanes that try their problem again.
    let mut again = 0;
    loop {
        let mut new = std::mem::take(&mut again);
        while idle != 0 {
            let lane = idle.trailing_zeros() as usize;
            idle &= idle - 1;
            waiting = next::<C>(problems, waiting, least);
            if waiting < problems.len() {
                bench.load(lane, waiting, &problems[waiting]);
                waiting += 1;
                new |= 1 << lane;
            }
        }
        active |= new;
        late &= !new;
        if active == 0 {
            return;
        }
        let own = &mut bench.pivoting;
        if new != 0 {
            own.begin(T::mask(token, new));
        }
        let solved = own.is_solved(tolerances);
        let ends = (solved | own.lost | !own.sums.is_finite()).bits() | late;
        let ended = active & ends;
        if ended != 0 {
            let solved = solved.bits();
            let mut left = ended;
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                let problem = &mut problems[bench.problem[lane]];
                let is_solved = solved >> lane & 1 == 1;
                if !is_solved && bench.retry(lane, problem) {
                    again |= 1 << lane;
                } else {
                    bench.store(lane, problem, is_solved);
                }
            }
            active &= !ended;
            idle = ended & !again;
            continue;
        }
        late = bench.step(T::mask(token, active), tolerances, &mut factors);
    }
}
