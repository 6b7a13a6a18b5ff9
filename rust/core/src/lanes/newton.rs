//! Semismooth Newton on several contact problems side by side.
//!
//! A step predicts each contact's [mode](super::modes) and solves the
//! [equations](super::equations) of those modes, regularised by a proximal term `α (p − c)` about the
//! present impulse. Its length is halved until the violation of the law is at most ten times that
//! before: without that bound the modes cycle, with a stricter one the iteration stops beside the
//! answer, since the law has no potential that every step could lower. If no length serves, the
//! step ends where the first contact would leave its cone and this contact changes its mode, as in
//! [pivoting](crate::solver), and `α` grows. Every fourth time the shortest length is taken
//! instead, which ends the cycles of that rule.
//!
//! Measured on recorded steps of 5 ms of the built-in rover with torques and set-points redrawn
//! every ten steps, from the impulses of the step before: 1.5 systems on average in a curve, 4.3
//! with torques up to 60 N m and 4.5 up to 150 N m on the plane, 5.6 among rocks; after
//! [`MAX_STEPS`] 0.2 %, 0.2 % and 1.0 % were unsolved. From zero, for positions instead of
//! velocities, 8.
//!
//! Lanes take the next problem when theirs is done, so that the cost follows the mean of the steps
//! and not the largest. No lane's bits depend on its neighbours.

use super::equations::{Block, Factors, Triple, newton_point, velocities};
use super::modes::{Law, Limit, Mode, Projected, Violations, judge, limit};
use super::problem::{ContactProblem, MAX_BLOCKS, MAX_CONTACTS, block};
use crate::problem::{ContactScales, Magnitudes, Residual};
use crate::scalar::{Lane, LaneMask, MAX_LANES};
use crate::solver::SolverOptions;

/// Most steps. What is unsolved then mostly cycles.
pub const MAX_STEPS: usize = 24;

/// Contacts up to which the smaller system serves, that of a rover with six wheels on the plane.
const FEW: usize = 6;

/// Largest growth of the squared violation in a step.
const GROWTH: f64 = 10.0;

/// Halvings of a step's length.
const HALVINGS: usize = 3;

/// Squared relative residual below which the modes of the first step are read from the impulses.
/// They are better than predicted ones if little has changed: wheels that work against each other
/// slip at 1e-6 m/s, which the velocity does not show until the modes are right.
const FAMILIAR: f64 = 0.01;

/// First `α` relative to the [regularisation](SolverOptions::regularisation) where a contact slides
/// at the start, and its smallest value once a length was refused. Where nothing slides the first is
/// the regularisation itself: the rounding `ε/α` in the null space of `W` would add up in a machine
/// at rest.
const FIRST: f64 = 0.1;
const FLOOR: f64 = 0.3;

/// Growth of `α` when no length served, its fall after a full step, and its largest value relative
/// to the mean diagonal of `W`.
const RISE: f64 = 100.0;
const FALL: f64 = 0.2;
const LARGEST: f64 = 0.1;

/// With settled modes a step should reduce the squared residual at least to this share; otherwise
/// `α` dominates what remains and is smaller by the second factor for one step.
const SLOW: f64 = 0.01;
const RELIEF: f64 = 0.01;

/// Every so many refused steps the shortest length is taken instead of a change of modes.
const PERSIST: u32 = 4;

/// Solves all problems. Up to the list's end each lane has one to work on.
///
/// A problem that is not solved in [`MAX_STEPS`], or has numbers that are not finite, keeps its
/// starting impulse.
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

/// The problems that are being solved, one a lane.
#[derive(Clone, Debug)]
struct Bench<T: Lane, const C: usize> {
    W: [Block<T>; MAX_BLOCKS],
    q: [Triple<T>; C],
    laws: [Law<T>; C],
    p: [Triple<T>; C],
    u: [Triple<T>; C],
    /// `α`, its smallest value and the mean diagonal, 1/kg.
    alpha: T,
    floor: T,
    mean: T,
    /// Options' regularisation.
    regularisation: f64,
    /// Squares of `1/|q|` and `1/|(ρ_i q_i)|`.
    inverses: [T; 2],
    /// The Newton point, and one on the way to it.
    trial: Point<T, C>,
    some: Point<T, C>,
    /// Of the present impulses.
    sums: Violations<T>,
    seen: [Projected<T>; C],
    /// Modes of the next step, and contacts that must slide or open in it.
    modes: [Mode<T>; C],
    forced: [[T::Mask; 2]; C],
    is_forced: bool,
    /// Steps since a mode last changed, and the squared residual before the last step.
    settled: T,
    last: T,
    /// Steps done, how many of them were refused, and the lanes that have done all.
    steps: [usize; MAX_LANES],
    refused: [u32; MAX_LANES],
    late: u32,
    /// Which problem each lane has.
    problem: [usize; MAX_LANES],
}

impl<T: Lane, const C: usize> Bench<T, C> {
    #[inline(always)]
    fn new(token: T::Token, regularisation: f64) -> Self {
        let zero = T::splat(token, 0.0);
        let one = T::splat(token, 1.0);
        let law = Law {
            mu: zero,
            rho: [one; 2],
            inverse: [one; 2],
            mass_squared: one,
        };
        Self {
            W: [[zero; 9]; MAX_BLOCKS],
            q: [[zero; 3]; C],
            laws: [law; C],
            p: [[zero; 3]; C],
            u: [[zero; 3]; C],
            trial: Point::new(zero),
            some: Point::new(zero),
            alpha: one,
            floor: one,
            mean: one,
            regularisation,
            inverses: [zero, one],
            sums: Violations::none(zero),
            seen: [Projected::none(zero); C],
            modes: [Mode::open(zero); C],
            forced: [[T::mask(token, 0); 2]; C],
            is_forced: false,
            settled: zero,
            last: zero,
            steps: [0; MAX_LANES],
            refused: [0; MAX_LANES],
            late: 0,
            problem: [0; MAX_LANES],
        }
    }

    /// Gives a lane a problem.
    #[inline(always)]
    fn load(&mut self, lane: usize, index: usize, problem: &ContactProblem) {
        let n = problem.n_contacts;
        let mut trace = 0.0;
        let mut data = Magnitudes::default();
        let mut slides = false;
        for i in 0..C {
            let is_used = i < n;
            for j in 0..=i {
                let (own, w) = (&mut self.W[block(i, j)], &problem.W[block(i, j)]);
                for k in 0..9 {
                    own[k].set(lane, if is_used { w[k] } else { 0.0 });
                }
            }
            let w = &problem.W[block(i, i)];
            let (normal, tangential) = if is_used {
                (w[0], w[4] + w[8])
            } else {
                (1.0, 2.0)
            };
            let scales = ContactScales::new::<3>(normal, tangential);
            let [rho_N, rho_T] = scales.modes;
            let law = &mut self.laws[i];
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
                self.p[i][k].set(lane, p);
                self.q[i][k].set(lane, q);
            }
            if is_used {
                let [p_N, p_t, p_b] = [0, 1, 2].map(|k| problem.p[3 * i + k]);
                let radius = problem.mu[i] * p_N * (1.0 - 1e-9);
                slides |= p_N > 0.0 && p_t * p_t + p_b * p_b >= radius * radius;
                trace += normal + tangential;
                data.add(&problem.q[3 * i..3 * i + 3], scales.mass);
            }
        }
        let mean = trace / (3 * n) as f64;
        let mean = if mean > 0.0 { mean } else { 1.0 };
        let [speed, impulse] = data.inverses();
        self.mean.set(lane, mean);
        let first = if slides { FIRST } else { 1.0 };
        let alpha = first * self.regularisation * mean;
        self.alpha.set(lane, alpha);
        self.floor.set(lane, alpha);
        self.inverses[0].set(lane, speed * speed);
        self.inverses[1].set(lane, impulse * impulse);
        self.settled.set(lane, 0.0);
        self.last.set(lane, f64::INFINITY);
        self.steps[lane] = 0;
        self.refused[lane] = 0;
        self.late &= !(1 << lane);
        self.problem[lane] = index;
    }

    /// Writes a lane's answer to its problem, or that there is none.
    #[inline(always)]
    fn store(&self, lane: usize, problem: &mut ContactProblem, is_solved: bool) {
        problem.iterations = self.steps[lane];
        problem.is_solved = is_solved;
        if !is_solved {
            return;
        }
        let [relative, largest] = self.residual();
        problem.residual = Residual {
            relative: relative.get(lane).sqrt(),
            velocity: largest.get(lane).sqrt(),
        };
        for i in 0..problem.n_contacts {
            for k in 0..3 {
                problem.p[3 * i + k] = self.p[i][k].get(lane);
                problem.u[3 * i + k] = self.u[i][k].get(lane);
            }
        }
    }

    /// Squares of the two numbers of the residual.
    #[inline(always)]
    fn residual(&self) -> [T; 2] {
        let speed = self.sums.squares * self.inverses[0];
        let impulse = self.sums.weighted * self.inverses[1];
        [speed.max(impulse), self.sums.largest]
    }

    /// Velocities of the lanes with a new problem, and the violations of all.
    #[inline(always)]
    fn place(&mut self, is_new: T::Mask) {
        velocities(&self.W, &self.q, &self.p, &mut self.trial.u);
        pick(is_new, &self.trial.u, &mut self.u);
        self.judge();
    }

    /// Violations at the present impulses.
    #[inline(always)]
    fn judge(&mut self) {
        self.sums = judge(&self.laws, &self.p, &self.u, &mut self.seen);
    }

    /// Modes of the next step. `relative`: square of the relative residual.
    #[inline(always)]
    fn predict(&mut self, is_fresh: T::Mask, relative: T) {
        let recalls = is_fresh & relative.lt(relative.like(FAMILIAR));
        let recalls_any = recalls.any();
        let (zero, one) = (relative.like(0.0), relative.like(1.0));
        let mut changes = is_fresh;
        for i in 0..C {
            let (law, p, u) = (&self.laws[i], &self.p[i], &self.u[i]);
            let mut mode = Mode::predict(law, &self.seen[i], p[0], u[0]);
            if recalls_any {
                mode = Mode::select(recalls, &Mode::recall(law.mu, p, u), &mode);
            }
            if self.is_forced {
                let [slides, opens] = self.forced[i];
                let (slides, opens) = (slides & !is_fresh, opens & !is_fresh);
                mode = Mode::select(slides, &Mode::slide(law.mu, p, u), &mode);
                mode = Mode::select(opens, &Mode::open(law.mu), &mode);
            }
            changes = changes | mode.differs(&self.modes[i]);
            self.modes[i] = mode;
        }
        self.is_forced = false;
        self.settled = T::select(changes, zero, self.settled + one);
        let is_slow = one.lt(self.settled) & (relative.like(SLOW) * self.last).lt(relative);
        self.alpha = T::select(is_slow, relative.like(RELIEF) * self.alpha, self.alpha);
        self.last = relative;
    }

    /// Takes a step with the predicted modes.
    #[inline(always)]
    fn step(&mut self, active: T::Mask, factors: &mut Factors<T, C>) {
        let like = self.alpha;
        let Point { p, u } = &mut self.trial;
        newton_point(&self.W, &self.q, &self.p, like, &self.modes, factors, p);
        velocities(&self.W, &self.q, p, u);
        let after = judge(&self.laws, p, u, &mut self.seen);
        let bound = like.like(GROWTH) * self.sums.weighted;
        let refused = active & !after.weighted.le(bound);
        let gentler = (like.like(FALL) * like).max(self.floor);
        if refused.any() {
            self.alpha = T::select(refused, like, gentler);
            let t = self.shorten(refused, bound);
            self.between(t);
            pick(refused, &self.some.p, &mut self.trial.p);
            pick(refused, &self.some.u, &mut self.trial.u);
        } else {
            self.alpha = gentler;
            self.sums = after;
        }
        self.p = self.trial.p;
        self.u = self.trial.u;
        if refused.any() {
            self.judge();
        }
        for lane in 0..T::LANES {
            self.steps[lane] += 1;
            if self.steps[lane] == MAX_STEPS {
                self.late |= 1 << lane;
            }
        }
    }

    /// Fraction of the refused steps to take.
    #[inline(always)]
    fn shorten(&mut self, refused: T::Mask, bound: T) -> T {
        let (one, half) = (bound.like(1.0), bound.like(0.5));
        let mut left = refused;
        let mut t = half;
        for _ in 0..HALVINGS {
            left = left & !self.between(t).weighted.le(bound);
            if !left.any() {
                return t;
            }
            t = T::select(left, half * t, t);
        }
        let mut persists = 0;
        let bits = left.bits();
        for lane in 0..T::LANES {
            if bits >> lane & 1 == 1 {
                self.refused[lane] += 1;
                if self.refused[lane].is_multiple_of(PERSIST) {
                    persists |= 1 << lane;
                }
            }
        }
        let persists = T::mask(bound.token(), persists);
        let mut first = one;
        let mut limits = [Limit {
            t: one,
            slides: left,
        }; C];
        for i in 0..C {
            limits[i] = limit(
                &self.modes[i],
                self.laws[i].mu,
                &self.p[i],
                &self.trial.p[i],
            );
            first = limits[i].t.min(first);
        }
        let changes = left & !persists & first.lt(one);
        for i in 0..C {
            let Limit { t, slides } = limits[i];
            let hit = changes & t.le(first);
            self.forced[i] = [hit & slides, hit & !slides];
        }
        self.is_forced = true;
        let floor = bound.like(FLOOR * self.regularisation) * self.mean;
        let largest = bound.like(LARGEST) * self.mean;
        let harder = (bound.like(RISE) * self.alpha).min(largest);
        self.floor = T::select(left, floor, self.floor);
        self.alpha = T::select(left, harder.max(self.floor), self.alpha);
        T::select(changes, first, t)
    }

    /// Impulses and velocities at a fraction of the step to the trial, and their violations.
    #[inline(always)]
    fn between(&mut self, t: T) -> Violations<T> {
        let Self {
            p, u, trial, some, ..
        } = self;
        for i in 0..C {
            for k in 0..3 {
                some.p[i][k] = p[i][k] + t * (trial.p[i][k] - p[i][k]);
                some.u[i][k] = u[i][k] + t * (trial.u[i][k] - u[i][k]);
            }
        }
        judge(&self.laws, &some.p, &some.u, &mut self.seen)
    }
}

/// Impulses and velocities.
#[derive(Clone, Debug)]
struct Point<T, const C: usize> {
    p: [Triple<T>; C],
    u: [Triple<T>; C],
}

impl<T: Lane, const C: usize> Point<T, C> {
    #[inline(always)]
    fn new(zero: T) -> Self {
        Self {
            p: [[zero; 3]; C],
            u: [[zero; 3]; C],
        }
    }
}

/// `yes` where the mask is true, `no` elsewhere.
#[inline(always)]
fn pick<T: Lane, const C: usize>(mask: T::Mask, yes: &[Triple<T>; C], no: &mut [Triple<T>; C]) {
    for i in 0..C {
        for k in 0..3 {
            no[i][k] = T::select(mask, yes[i][k], no[i][k]);
        }
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
    let mut bench = Bench::<T, C>::new(token, options.regularisation);
    let mut factors: Factors<T, C> = [[[zero; 9]; C]; C];
    let mut waiting = 0;
    let mut active = 0;
    // Lanes without a problem, and lanes that have not made a step with theirs.
    let mut idle = (1_u32 << T::LANES) - 1;
    let mut fresh = 0;
    loop {
        let mut new = 0;
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
        fresh |= new;
        if active == 0 {
            return;
        }
        if new != 0 {
            bench.place(T::mask(token, new));
        }
        let [relative, largest] = bench.residual();
        let solved = relative.le(tolerances[0]) & largest.le(tolerances[1]);
        let ends = (solved | !bench.sums.is_finite()).bits() | bench.late;
        let ended = active & ends;
        if ended != 0 {
            let solved = solved.bits();
            let mut left = ended;
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                let problem = &mut problems[bench.problem[lane]];
                bench.store(lane, problem, solved >> lane & 1 == 1);
            }
            active &= !ended;
            idle = ended;
            continue;
        }
        bench.predict(T::mask(token, fresh), relative);
        fresh = 0;
        bench.step(T::mask(token, active), &mut factors);
    }
}
