//! The queue of the contact problems of several rovers.
//!
//! Rovers never wait for each other: while one problem takes long, the groups whose problems are
//! all done go on to their next step and bring new ones.
//!
//! Measured on recorded drives of the built-in rover in steps of 5 ms, with torques and set-points
//! drawn anew every ten steps: 2.2 systems a problem when it only steers, 3.3 with torques up to
//! 60 N m, 3.5 to 4.2 among rocks. Of 1.6 million problems of longer drives, on the plane and among
//! rocks, 4912 resist the first attempt and 67 all four.

use std::collections::VecDeque;
use std::sync::Arc;

use super::lane_solver::{DenseSolver, DrySolver, FactoredSolver, LargeSolver, ProblemSource};
use super::pattern::Pattern;
use super::problem::{ContactProblem, DENSE_BLOCKS, MAX_CONTACTS, MAX_DENSE, MAX_DRY, block};
use crate::problem::Residual;
use crate::scalar::Lane;
use crate::solver::options::SolverOptions;

pub use super::lane_solver::MAX_ITERATIONS;

/// Contacts up to which the smaller system serves, that of a rover with six wheels on the plane.
const FEW: usize = 6;

/// Patterns whose solvers are kept from one call to the next.
const MOST_PATTERNS: usize = 8;

/// Squares of the tolerances.
#[inline(always)]
fn squares<T: Lane>(token: T::Token, options: &SolverOptions) -> [T; 2] {
    [options.tolerance, options.velocity_tolerance].map(|x| T::splat(token, x * x))
}

impl ContactProblem {
    /// Forgets any earlier answer. Without contacts or free velocity the answer is zero.
    ///
    /// # Panics
    /// If there are more contacts than fit.
    fn begin(&mut self) {
        let (most, most_dry) = if self.is_factored() {
            (MAX_CONTACTS, MAX_CONTACTS)
        } else {
            (MAX_DENSE + self.n_dry, MAX_DRY)
        };
        assert!(self.n_contacts <= most, "at most {most} contacts");
        assert!(self.n_dry <= most_dry, "at most {most_dry} dry joints");
        let n = self.n_unknowns();
        let at_rest = self.q[..n].iter().all(|x| *x == 0.0);
        (self.iterations, self.factorisations, self.pivots) = (0, 0, 0);
        (self.is_escalated, self.is_acceptable) = (false, false);
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
        self.has_start &= self.start[..n].iter().all(|x| x.is_finite());
    }
}

/// Problems of several groups of equal size, which enter at any time: problem `k` is of group
/// `k / size`.
pub struct Queue<T: Lane> {
    token: T::Token,
    few: Box<DenseSolver<T, FEW, { block(FEW, 0) }>>,
    many: Box<DenseSolver<T, MAX_DENSE, DENSE_BLOCKS>>,
    dry: Box<DrySolver<T>>,
    large: Option<Box<LargeSolver<T>>>,
    /// Solvers of problems with factors, by pattern.
    factored: Vec<(Arc<Pattern>, Box<FactoredSolver<T>>)>,
    /// Problems that wait for a lane of each solver: [`Kind::index`].
    waiting: Vec<VecDeque<usize>>,
    groups: Groups,
}

/// Which of the solvers a problem needs.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Few,
    Many,
    Dry,
    Large,
    /// Solver of a pattern, by its place in `Queue::factored`.
    Factored(usize),
}

impl Kind {
    /// Kind of solver of a problem with the whole operator.
    fn of_dense(problem: &ContactProblem) -> Self {
        if problem.n_dry > 0 {
            Self::Dry
        } else if problem.n_contacts > FEW {
            Self::Many
        } else {
            Self::Few
        }
    }

    /// Place of the solver among all kinds.
    #[inline(always)]
    fn index(self) -> usize {
        match self {
            Self::Few => 0,
            Self::Many => 1,
            Self::Dry => 2,
            Self::Large => 3,
            Self::Factored(place) => 4 + place,
        }
    }
}

/// How far the groups are.
#[derive(Debug, Default)]
struct Groups {
    size: usize,
    /// Number of problems of each group that have not ended.
    left: Vec<usize>,
    /// Groups without any problem left, in the order in which they ended.
    ready: VecDeque<usize>,
}

/// The waiting problems of a solver.
struct Waiting<'a> {
    problems: &'a mut VecDeque<usize>,
    groups: &'a mut Groups,
    /// Problems of the other solver that has most.
    n_others: usize,
}

impl ProblemSource for Waiting<'_> {
    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        self.problems.pop_front()
    }

    #[inline(always)]
    fn end(&mut self, index: usize) {
        self.groups.end(index);
    }

    #[inline(always)]
    fn may_leave(&self, n_active: usize) -> bool {
        !self.groups.ready.is_empty() || self.n_others > n_active
    }
}

impl Groups {
    #[inline(always)]
    fn end(&mut self, index: usize) {
        let group = index / self.size;
        self.left[group] -= 1;
        if self.left[group] == 0 {
            self.ready.push_back(group);
        }
    }
}

impl<T: Lane> Queue<T> {
    /// Without problems.
    #[must_use]
    pub fn new(token: T::Token) -> Self {
        Self {
            token,
            few: Box::new(DenseSolver::new(token)),
            many: Box::new(DenseSolver::new(token)),
            dry: Box::new(DrySolver::new(token)),
            large: None,
            factored: Vec::new(),
            waiting: vec![VecDeque::new(); Kind::Factored(0).index()],
            groups: Groups::default(),
        }
    }

    /// Makes room for `n` groups of `size` problems and forgets all earlier ones.
    pub fn begin(&mut self, n: usize, size: usize) {
        self.few.clear();
        self.many.clear();
        self.dry.clear();
        if let Some(large) = &mut self.large {
            large.clear();
        }
        self.waiting.iter_mut().for_each(VecDeque::clear);
        if self.factored.len() > MOST_PATTERNS {
            self.factored.clear();
            self.waiting.truncate(Kind::Factored(0).index());
        }
        for (_, solver) in &mut self.factored {
            solver.clear();
        }
        self.groups.size = size;
        self.groups.left.clear();
        self.groups.left.resize(n, 0);
        self.groups.ready.clear();
    }

    /// Enters those problems of a group that `is_asked` names by their place in it; the others are
    /// left as they are.
    ///
    /// A problem that takes too long, or goes in circles, is tried again from the impulses of the
    /// last step with another `α`. One that resists, or has numbers that are not finite, keeps
    /// those impulses.
    ///
    /// # Panics
    /// If a problem has more contacts than fit, or there are more groups than [`Self::begin`] said.
    pub fn enter(
        &mut self,
        group: usize,
        problems: &mut [ContactProblem],
        is_asked: impl Fn(usize) -> bool,
    ) {
        let size = self.groups.size;
        let first = group * size;
        let own = &mut problems[first..][..size];
        let mut left = 0;
        for (place, problem) in own.iter_mut().enumerate().filter(|(k, _)| is_asked(*k)) {
            problem.begin();
            if !problem.is_solved {
                let kind = match &problem.factored.pattern {
                    Some(_) if problem.factored.is_multiplied => Kind::Large,
                    Some(pattern) => self.kind_of(pattern),
                    None => Kind::of_dense(problem),
                };
                self.waiting[kind.index()].push_back(first + place);
                left += 1;
            }
        }
        self.groups.left[group] = left;
        if left == 0 {
            self.groups.ready.push_back(group);
        }
    }

    /// The solver of problems with factors of a pattern.
    fn kind_of(&mut self, pattern: &Arc<Pattern>) -> Kind {
        let is_own = |(own, _): &(Arc<Pattern>, _)| Arc::ptr_eq(own, pattern);
        let place = self.factored.iter().position(is_own);
        Kind::Factored(place.unwrap_or_else(|| {
            let solver = Box::new(FactoredSolver::new(self.token));
            self.factored.push((Arc::clone(pattern), solver));
            self.waiting.push(VecDeque::new());
            self.factored.len() - 1
        }))
    }

    /// Works as long as its lanes are full, and until the problems of a group have all ended.
    /// Returns such a group; None if there are no problems. `problems`: those of all groups.
    pub fn next_group(
        &mut self,
        problems: &mut [ContactProblem],
        options: &SolverOptions,
    ) -> Option<usize> {
        let tolerances = squares::<T>(self.token, options);
        loop {
            let waiting = |kind: Kind| self.waiting[kind.index()].len();
            let factored = self.factored.iter().enumerate();
            let n_large = self.large.as_ref().map_or(0, |large| large.n_active());
            let others = [
                (Kind::Many, self.many.n_active()),
                (Kind::Dry, self.dry.n_active()),
                (Kind::Large, n_large),
            ];
            let others = (others.into_iter()).chain(
                factored.map(|(place, (_, solver))| (Kind::Factored(place), solver.n_active())),
            );
            let (mut kind, mut n_others) = (Kind::Few, 0);
            let mut most = waiting(kind) + self.few.n_active();
            for (other, n_active) in others {
                let count = waiting(other) + n_active;
                n_others = n_others.max(count.min(most));
                if count > most {
                    (kind, most) = (other, count);
                }
            }
            if most < T::LANES
                && let Some(group) = self.groups.ready.pop_front()
            {
                return Some(group);
            }
            if most == 0 {
                return None;
            }
            self.work(problems, tolerances, kind, n_others);
        }
    }

    /// Lets one of the solvers work; `n_others`: as of [`Waiting`].
    fn work(
        &mut self,
        problems: &mut [ContactProblem],
        tolerances: [T; 2],
        kind: Kind,
        n_others: usize,
    ) {
        let token = self.token;
        let mut line = Waiting {
            problems: &mut self.waiting[kind.index()],
            groups: &mut self.groups,
            n_others,
        };
        match kind {
            Kind::Few => self.few.run(token, problems, tolerances, &mut line),
            Kind::Many => self.many.run(token, problems, tolerances, &mut line),
            Kind::Dry => self.dry.run(token, problems, tolerances, &mut line),
            Kind::Large => {
                let large = self
                    .large
                    .get_or_insert_with(|| Box::new(LargeSolver::new(token)));
                large.run(token, problems, tolerances, &mut line);
            }
            Kind::Factored(place) => {
                let own = &mut self.factored[place].1;
                own.run(token, problems, tolerances, &mut line);
            }
        }
    }
}
