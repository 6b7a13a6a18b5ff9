//! The friction-contact problems of one system, solved with all effort.

use super::dynamics::Dynamics;
use super::island::{Level, left_of, settle, soften};
use super::listed::{Listed, ListedData, Posed, PosedOf};
use super::local::Local;
use super::mechanical_system::{LocalOf, MechanicalSystem};
use super::options::StepOptions;
use super::projection::FARTHEST;
use super::report::StepReport;
use super::systems::Systems;
use crate::law::compliance::Yielding;
use crate::problem::{FrictionContactProblem, Operator};
use crate::solver::{SolveReport, SolveStatus, SolverOptions, solve};

impl<S: MechanicalSystem> Listed<'_, S> {
    /// Whether the step's solves have left some of its budget.
    pub fn has_work_left(&self) -> bool {
        let whole = self.options.solver.budget_of(self.list.contacts.len());
        self.list.work_spent < whole
    }

    /// The options of the step's next solve: all solves of a step share one budget.
    fn solver_options(&self) -> SolverOptions {
        let whole = self.options.solver.budget_of(self.list.contacts.len());
        SolverOptions {
            budget: Some(left_of(whole, self.list.work_spent)),
            ..self.options.solver
        }
    }

    /// Solves the step's problems for the free change `d.y` (factor coordinates) of the velocity v.
    ///
    /// Newton's law of restitution with friction may have no solution: a wheel held by friction
    /// between two slopes cannot leave both. If the solver finds none, the impact is taken as
    /// inelastic. That problem always has a solution, since rest is admissible on ground at rest.
    pub fn solve(
        &mut self,
        v: &[f64],
        (y, laws): (&[f64], &[Yielding]),
        problems: &mut PosedOf<S>,
    ) {
        let free = (v, y);
        problems.report = StepReport::default();
        if self.list.contacts.is_empty() {
            return;
        }
        self.list.island.forget_answers();
        let groups = std::mem::take(&mut self.list.groups);
        let unsolved = self.solve_groups(free, problems, &groups, groups.len() > 1);
        let is_elastic = self.options.is_elastic() && self.system.solves_to_the_end();
        if !unsolved.is_empty() && is_elastic && self.list.inelastic.is_none() {
            self.take_as_inelastic(&unsolved, laws, problems);
            self.solve_groups(free, problems, &unsolved, groups.len() > 1);
            problems.report.retaken = 1;
        }
        self.list.groups = groups;
        self.list.island.enter_answers(&mut problems.report);
    }

    /// Turns the problems of some groups into those of inelastic impacts.
    fn take_as_inelastic(
        &mut self,
        groups: &[usize],
        laws: &[Yielding],
        problems: &mut PosedOf<S>,
    ) {
        let own = (0..self.list.contacts.len())
            .filter(|i| groups.contains(&self.list.group_leader_of(*i)));
        let own: Vec<usize> = own.collect();
        let elastic: Vec<f64> = own.iter().map(|&i| self.shift(i)).collect();
        self.list.inelastic = Some(StepOptions {
            restitution: 0.0,
            materials: self.options.materials.inelastic(),
            ..self.options.clone()
        });
        for &leader in groups {
            self.list.is_inelastic[leader] = true;
        }
        for (&i, elastic) in own.iter().zip(elastic) {
            if !laws.get(i).is_some_and(Yielding::is_soft) {
                problems.q[i][0] += self.shift(i) - elastic;
            }
            problems.p[i] = Local::splat(0.0);
        }
    }

    /// Solves the problems of some groups; returns those that are not solved. `are_several`:
    /// whether the contacts of the step are in several.
    fn solve_groups(
        &mut self,
        free: (&[f64], &[f64]),
        problems: &mut PosedOf<S>,
        groups: &[usize],
        are_several: bool,
    ) -> Vec<usize> {
        let mut unsolved = Vec::new();
        for &leader in groups {
            let options = SolverOptions {
                rounding: rounding(free.0),
                is_brief: self.list.may_halve,
                ..self.options.solver
            };
            let solved = if are_several {
                self.solve_group(&options, problems, leader, Level::Velocity)
            } else {
                None
            };
            let solved = solved.unwrap_or_else(|| self.solve_all(free, problems));
            if !solved.is_converged() {
                unsolved.push(leader);
            }
            self.list.island.keep_answer(leader, solved);
        }
        unsolved
    }

    /// Solves the problem of all contacts and charges the step's budget. Impulses that the motion
    /// leaves open are those of least norm.
    fn solve_all(&mut self, free: (&[f64], &[f64]), problems: &mut PosedOf<S>) -> SolveReport {
        let options = SolverOptions {
            rounding: rounding(free.0),
            is_brief: self.list.may_halve,
            ..self.solver_options()
        };
        let list = &mut *self.list;
        let Posed { q, p, u, .. } = problems;
        let q = Local::flat(q);
        let (p, u) = (Local::flat_mut(p), Local::flat_mut(u));
        let (data, answer) = ((q, &list.mu[..]), (&mut *p, &mut *u));
        let mut solved = (self.system).solve(Some(free), data, &options, answer, &mut list.solver);
        list.work_spent += solved.work;
        if solved.is_converged() && !list.leaves_open && S::SETTLES {
            let problem = self.system.problem(q, &list.mu);
            let tolerance = self.options.solver.tolerance;
            settle(
                &mut list.redundancy,
                &problem,
                tolerance,
                &mut solved,
                (p, u),
            );
        }
        solved
    }

    /// Solves the contacts of a group, as [`super::MechanicalSystem::solve`] does those of all.
    ///
    /// The answer is the same without the other groups. Its options are those of a problem of its
    /// size.
    fn solve_group(
        &mut self,
        options: &SolverOptions,
        problems: &mut PosedOf<S>,
        group: usize,
        level: Level,
    ) -> Option<SolveReport> {
        let list = &mut *self.list;
        let mut own = std::mem::take(&mut list.island.contacts);
        own.clear();
        own.extend((0..list.contacts.len()).filter(|i| list.group_leader_of(*i) == group));
        let budget = options.budget_of(own.len());
        list.island.contacts = own;
        let spent = list.island.spent.get(group).copied().unwrap_or(0);
        let options = SolverOptions {
            budget: Some(left_of(budget, spent)),
            ..*options
        };
        let Posed { q, p, u, .. } = problems;
        let q = Local::flat(q);
        let problem = self.system.problem(q, &list.mu);
        let compliance = match level {
            Level::Velocity => 0.0,
            Level::Position(compliance) => compliance,
        };
        let is_settled = matches!(level, Level::Velocity) && !list.leaves_open && S::SETTLES;
        let redundancy = is_settled.then_some(&mut list.redundancy);
        let report = list.island.solve(
            &problem,
            compliance,
            &options,
            [Local::flat_mut(p), Local::flat_mut(u)],
            &mut list.solver,
            redundancy,
        )?;
        if let Some(own) = list.island.spent.get_mut(group) {
            *own += report.work;
        }
        list.work_spent += report.work;
        Some(report)
    }

    /// Solves the problems of the position projection.
    pub fn solve_gaps(&mut self, d: &mut ListedData<S>, problems: &mut PosedOf<S>) {
        for k in 0..self.list.groups.len() {
            let leader = self.list.groups[k];
            if d.is_deep[leader] {
                self.free_group(d, problems, leader);
            }
        }
    }

    /// Finds the displacement of a group.
    fn free_group(&mut self, d: &mut ListedData<S>, problems: &mut PosedOf<S>, leader: usize) {
        let limit = -FARTHEST * d.deepest[leader];
        let mut solved = self.displace(d, problems, (leader, 0.0));
        let is_finite = solved.status != SolveStatus::NonFinite;
        let is_far = |own: &Self, d: &mut ListedData<S>, problems: &Posed<_>| {
            own.size(d, problems, leader) > limit
        };
        if is_finite && (!solved.is_converged() || is_far(self, d, problems)) {
            // Friction locks a wedge, or stalls over nanometres: retry without friction, along the
            // shortest way out.
            self.list.mu.fill(0.0);
            solved = self.displace(d, problems, (leader, 0.0));
            if !solved.is_converged() {
                // A part wedged between opposed contacts cannot be freed. With slightly compliant
                // ground the problem has a solution, which opens each gap as far as the others
                // allow.
                solved = self.displace(d, problems, (leader, COMPLIANCE));
            }
            self.set_friction();
        }
        let residual = problems.report.residual;
        problems.report.enter(&solved);
        if solved.is_converged() {
            // The report's residual is that of the velocities, which are held to more.
            problems.report.residual = residual;
        }
    }

    /// Relative residual asked of the displacement of a group.
    fn tolerance(&self, d: &ListedData<S>, leader: usize) -> f64 {
        let own = self.options.solver.tolerance;
        let contacts =
            || (0..self.list.contacts.len()).filter(|i| self.list.group_leader_of(*i) == leader);
        if contacts().count() <= self.options.solver.direct_contacts {
            return own;
        }
        let gaps = contacts().map(|i| d.gaps[i][0]);
        let size = gaps.map(|gap| gap * gap).sum::<f64>().sqrt();
        let clusters = 0..self.list.n_clusters();
        let clusters = clusters.filter(|own| self.list.leader_of(*own) == leader);
        let tolerated = clusters.map(|own| self.machine().tolerated(self.options, own));
        let tolerated = tolerated.fold(f64::INFINITY, f64::min);
        own.max((EXACT * tolerated / size).min(EXACT))
    }

    /// Solves for the displacement of a group with the coefficients in `mu`, on ground of a
    /// compliance relative to W's mean.
    fn displace(
        &mut self,
        d: &ListedData<S>,
        problems: &mut PosedOf<S>,
        (leader, compliance): (usize, f64),
    ) -> SolveReport {
        for (i, p) in problems.p.iter_mut().enumerate() {
            if self.list.group_leader_of(i) == leader {
                *p = Local::splat(0.0);
            }
        }
        let options = SolverOptions {
            tolerance: self.tolerance(d, leader),
            acceptable: 0.0, // is a speed, not a displacement
            ..self.solver_options()
        };
        if self.list.groups.len() > 1 {
            let options = SolverOptions {
                budget: self.options.solver.budget,
                ..options
            };
            let level = Level::Position(compliance);
            if let Some(solved) = self.solve_group(&options, problems, leader, level) {
                return solved;
            }
        }
        let list = &mut *self.list;
        let Posed { q, p, u, .. } = problems;
        let q = Local::flat(q);
        let (p, u) = (Local::flat_mut(p), Local::flat_mut(u));
        let operator = (compliance > 0.0).then(|| self.system.problem(q, &list.mu).operator());
        let solved = if let Some(Operator::Dense(W)) = operator {
            let mut W = W.to_vec();
            soften(&mut W, compliance);
            let softer = FrictionContactProblem::from_assembled(S::DIMENSION, &W, q, &list.mu);
            solve(&softer, &options, p, u, &mut list.solver)
        } else {
            (self.system).solve(None, (q, &list.mu), &options, (p, u), &mut list.solver)
        };
        list.work_spent += solved.work;
        solved
    }

    /// Size of the displacement of a group, m: the largest at the contact points and at the points
    /// that the system adds. `d.y` is overwritten.
    fn size(&self, d: &mut ListedData<S>, problems: &PosedOf<S>, leader: usize) -> f64 {
        d.y.fill(0.0);
        self.system.add_impulses(Local::flat(&problems.p), &mut d.y);
        self.machine().half_solve_back(&mut d.y);
        let mut most = 0.0_f64;
        for (i, (u, q)) in problems.u.iter().zip(&problems.q).enumerate() {
            if self.list.group_leader_of(i) == leader {
                let lever = self.system.lever(&self.list.contacts[i]);
                for k in 0..LocalOf::<S>::N {
                    most = most.max((u[k] - q[k]).abs() * lever);
                }
            }
        }
        let clusters = 0..self.list.n_clusters();
        let own = clusters.filter(|own| self.list.leader_of(*own) == leader);
        own.map(|own| self.machine().displacement(&d.y, own))
            .fold(most, f64::max)
    }
}

/// Rounding of contact velocities, m/s, where the bodies move with `v` (m/s, rad/s): a few units in
/// the last place of its largest entry. Levers are of the order of a metre.
fn rounding(v: &[f64]) -> f64 {
    4.0 * f64::EPSILON * v.iter().fold(0.0_f64, |most, v| most.max(v.abs()))
}

/// Share of the tolerated penetration that many contacts are projected to. Few are projected to the
/// last digits, which costs them nothing.
const EXACT: f64 = 1e-3;

/// Compliance of the ground for a wedged machine that nothing else frees, relative to that of W.
const COMPLIANCE: f64 = 1e-2;
