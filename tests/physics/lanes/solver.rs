//! The solver over lanes: its answers obey the law, and no lane's bits depend on its neighbours.

use proptest::prelude::*;
use rover_core::integrator::{StepOptions, UnilateralContact};
use rover_core::multibody::Model;
use rover_core::problem::{Dimension, FrictionContactProblem, evaluate};
use rover_core::scalar::{Lane, Single};
use rover_core::solver::SolverOptions;
use rover_core::solver::batch::problem::{ContactProblem, MAX_DENSE, block};
use rover_core::solver::batch::queue::{MAX_ITERATIONS, Queue};

use super::{OverLanes, on_every_register};
use crate::shared::{flat, resting};

/// `W` as a whole, row-major.
fn operator(problem: &ContactProblem) -> Vec<f64> {
    let n = problem.n_unknowns();
    let mut W = vec![0.0; n * n];
    for i in 0..problem.n_contacts {
        for j in 0..=i {
            for (k, w) in problem.W[block(i, j)].iter().enumerate() {
                let (r, c) = (3 * i + k / 3, 3 * j + k % 3);
                W[r * n + c] = *w;
                W[c * n + r] = *w;
            }
        }
    }
    W
}

/// The problem of an operator (row-major), free velocities, friction and a starting impulse.
fn problem(W: &[f64], q: &[f64], mu: &[f64], p: &[f64]) -> ContactProblem {
    let n = q.len();
    let mut problem = ContactProblem {
        n_contacts: mu.len(),
        ..ContactProblem::default()
    };
    for i in 0..mu.len() {
        for j in 0..=i {
            for (k, w) in problem.W[block(i, j)].iter_mut().enumerate() {
                *w = W[(3 * i + k / 3) * n + 3 * j + k % 3];
            }
        }
    }
    problem.q[..n].copy_from_slice(q);
    problem.mu[..mu.len()].copy_from_slice(mu);
    problem.p[..n].copy_from_slice(p);
    problem
}

/// Panics unless a solved answer obeys the law and an unsolved problem has kept its start.
fn assert_sound(problem: &ContactProblem, start: &ContactProblem) {
    let n = problem.n_unknowns();
    assert!(problem.p.iter().chain(&problem.u).all(|x| x.is_finite()));
    assert!(problem.iterations <= MAX_ITERATIONS);
    if !problem.is_solved {
        assert_eq!(problem.p, start.p);
        return;
    }
    let (W, mu) = (operator(problem), &problem.mu[..problem.n_contacts]);
    let data = FrictionContactProblem::from_assembled(Dimension::Three, &W, &problem.q[..n], mu);
    let residual = evaluate(&data, &problem.p[..n]);
    let options = SolverOptions::default();
    // Two orders of the same sums.
    assert!(
        residual.relative <= 1.01 * options.tolerance,
        "{residual:?}"
    );
    assert!(
        residual.velocity <= options.velocity_tolerance,
        "{residual:?}"
    );
    let difference = (residual.relative - problem.residual.relative).abs();
    let rounding = rounding_of_velocities(&W, problem);
    assert!(difference < 1e-14 + rounding, "{difference:e} {rounding:e}");
}

/// What the order of the sums in `W p` may change of the relative residual.
fn rounding_of_velocities(W: &[f64], problem: &ContactProblem) -> f64 {
    let n = problem.n_unknowns();
    let magnitude = |row: &[f64]| -> f64 {
        let terms = row.iter().zip(&problem.p[..n]);
        terms.map(|(w, p)| (w * p).abs()).sum()
    };
    let largest = W.chunks_exact(n.max(1)).map(magnitude).fold(0.0, f64::max);
    let speed = problem.q[..n].iter().map(|q| q * q).sum::<f64>().sqrt();
    if speed == 0.0 {
        return 0.0;
    }
    n as f64 * f64::EPSILON * largest / speed
}

/// Solves all problems, side by side.
fn solve_all<T: Lane>(token: T::Token, problems: &mut Vec<ContactProblem>) {
    let n = problems.len();
    problems.resize_with(n.next_multiple_of(T::LANES), ContactProblem::default);
    let n_groups = problems.len() / T::LANES;
    let mut queue = Queue::<T>::new(token);
    queue.begin(n_groups, T::LANES);
    for group in 0..n_groups {
        queue.enter(group, problems, |_| true);
    }
    while queue
        .next_group(problems, &SolverOptions::default())
        .is_some()
    {}
    problems.truncate(n);
}

/// Each problem solved alone.
fn solve_alone(problems: &[ContactProblem]) -> Vec<ContactProblem> {
    let solve = |problem: &ContactProblem| {
        let mut alone = vec![problem.clone()];
        solve_all::<f64>(Single::best(), &mut alone);
        alone.remove(0)
    };
    problems.iter().map(solve).collect()
}

fn assert_same(found: &ContactProblem, alone: &ContactProblem) {
    let bits = |p: &ContactProblem| {
        let numbers = [p.residual.relative, p.residual.velocity];
        let n = p.n_unknowns();
        let numbers = numbers.iter().chain(&p.p[..n]).chain(&p.u[..n]);
        numbers.map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(found.is_solved, alone.is_solved);
    assert_eq!(found.iterations, alone.iterations);
    assert_eq!(bits(found), bits(alone));
}

/// The answers to a list of problems, one list for each number of lanes.
struct Solved<'a> {
    problems: &'a [ContactProblem],
    found: Vec<Vec<ContactProblem>>,
}

impl OverLanes for Solved<'_> {
    fn run<T: Lane>(&mut self, token: T::Token) {
        let mut found = self.problems.to_vec();
        solve_all::<T>(token, &mut found);
        self.found.push(found);
    }
}

fn solve_over_lanes(problems: &[ContactProblem]) -> Vec<Vec<ContactProblem>> {
    let mut solved = Solved {
        problems,
        found: Vec::new(),
    };
    on_every_register(&mut solved);
    solved.found
}

/// Solves the list with every width and compares each answer with that of the problem alone.
fn assert_alike(problems: &[ContactProblem], alone: &[ContactProblem]) {
    for found in solve_over_lanes(problems) {
        for (found, alone) in found.iter().zip(alone) {
            assert_same(found, alone);
        }
    }
}

/// Numbers in [-1, 1] that look random.
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// The solves of a rover on the plane whose torques and set-points change every ten steps, each
/// from the impulses of the step before.
fn drive(largest: f64, steps: usize) -> Vec<ContactProblem> {
    drive_of(Model::rover(), 0.35, largest, steps)
}

/// The same of a model whose trunk starts at a height of `height`, m.
fn drive_of(model: Model, height: f64, largest: f64, steps: usize) -> Vec<ContactProblem> {
    let mut draw = Draw(0x9e37_79b9_7f4a_7c15);
    let mut simulation = resting(model, flat(), StepOptions::default(), |q| {
        q.position.y = height;
    });
    simulation.step(100).expect("steps at rest");
    let mut problems = Vec::new();
    for step in 0..steps {
        if step % 10 == 0 {
            let torques: Vec<f64> = (0..6).map(|_| largest * draw.next()).collect();
            let steering: Vec<f64> = (0..6).map(|_| 0.7 * draw.next()).collect();
            simulation.set_wheel_torques(&torques).expect("six torques");
            simulation.set_steering(&steering).expect("six set-points");
        }
        let before = simulation.contacts().to_vec();
        simulation.step(1).expect("a step");
        let contacts = simulation.contacts();
        let (W, q, mu) = simulation.last_problem();
        if q.len() != 3 * contacts.len() || mu.len() > MAX_DENSE {
            continue;
        }
        let recalled = contacts.iter().flat_map(|contact| {
            let key = contact.contact.key();
            let same = before.iter().find(|b| b.contact.key() == key);
            same.map_or([0.0; 3], |same| same.impulse)
        });
        problems.push(problem(W, q, mu, &recalled.collect::<Vec<_>>()));
    }
    problems
}

#[test]
fn an_exploring_rover_is_solved_in_few_steps() {
    for (torque, mean, unsolved) in [(0.0, 3.0, 0), (60.0, 4.4, 0), (150.0, 5.2, 0)] {
        let problems = drive(torque, 600);
        assert!(problems.len() > 500);
        let found = solve_alone(&problems);
        for (found, start) in found.iter().zip(&problems) {
            assert_sound(found, start);
        }
        let steps: usize = found.iter().map(|p| p.iterations).sum();
        let steps = steps as f64 / found.len() as f64;
        let left = found.iter().filter(|p| !p.is_solved).count();
        assert!(steps < mean, "{torque} N m: {steps} steps");
        assert!(left <= unsolved, "{torque} N m: {left} unsolved");
        assert_alike(&problems, &found);
    }
}

/// Wheels that start in the ground are lifted out of it and then press against each other up to the
/// limit of friction. Whether one slides is then decided by slips of 1e-12 m/s.
#[test]
fn squeezed_wheels_are_solved() {
    let model = Model::rover().with_contact_radius(0.2).expect("a radius");
    let problems = drive_of(model, 0.0, 0.0, 1000);
    assert!(problems.len() > 900);
    let found = solve_alone(&problems);
    for (found, start) in found.iter().zip(&problems) {
        assert_sound(found, start);
    }
    let left = found.iter().filter(|p| !p.is_solved).count();
    assert!(left == 0, "{left} unsolved");
}

#[test]
fn positions_are_solved_from_zero() {
    let mut draw = Draw(1);
    let mut problems = drive(60.0, 300);
    for problem in &mut problems {
        problem.p.fill(0.0);
        problem.q.fill(0.0);
        for i in 0..problem.n_contacts {
            problem.q[3 * i] = 1.5e-4 * draw.next() - 0.5e-4;
        }
    }
    let mut found = problems.clone();
    solve_all::<f64>(Single::best(), &mut found);
    for (found, start) in found.iter().zip(&problems) {
        assert_sound(found, start);
    }
    let left = found.iter().filter(|p| !p.is_solved).count();
    assert!(100 * left <= 2 * found.len(), "{left} unsolved");
}

/// Where a solve starts decides how long it takes. Impulses may differ where wheels work against
/// each other; the motion does not.
#[test]
fn a_start_of_its_own_leaves_the_motion_as_it_is() {
    let mut draw = Draw(2);
    let mut problems = drive(60.0, 200);
    let found = solve_alone(&problems);
    for problem in &mut problems {
        problem.has_start = true;
        for i in 0..problem.n_contacts {
            let pressed = problem.p[3 * i] * (1.0 + 0.5 * draw.next());
            problem.start[3 * i] = pressed;
            problem.start[3 * i + 1] = 0.3 * pressed * draw.next();
        }
    }
    let elsewhere = solve_alone(&problems);
    let mut longer = 0;
    for ((one, other), start) in found.iter().zip(&elsewhere).zip(&problems) {
        assert_sound(other, start);
        if !(one.is_solved && other.is_solved) {
            continue;
        }
        longer += usize::from(other.iterations > one.iterations);
        for (a, b) in one.u.iter().zip(&other.u).take(one.n_unknowns()) {
            assert!((a - b).abs() < 1e-8, "{a} {b}");
        }
    }
    assert!(longer > 10, "the start was not taken: {longer}");
}

#[test]
fn what_is_not_finite_is_unsolved_and_harms_no_neighbour() {
    let sound = drive(20.0, 40);
    let alone = solve_alone(&sound);
    for bad in [f64::NAN, f64::INFINITY] {
        let mut problems = sound.clone();
        problems[3].q[4] = bad;
        problems[9].W[block(2, 1)][5] = bad;
        problems[10].mu[0] = bad;
        for problems in solve_over_lanes(&problems) {
            for (k, (found, alone)) in problems.iter().zip(&alone).enumerate() {
                if [3, 9, 10].contains(&k) {
                    assert!(!found.is_solved);
                    assert!(found.p.iter().chain(&found.u).all(|x| x.is_finite()));
                } else {
                    assert_same(found, alone);
                }
            }
        }
    }
    // A start that is not finite counts as none.
    let mut problems = sound.clone();
    problems[5].p[2] = f64::NAN;
    let mut zero = sound[5].clone();
    zero.p.fill(0.0);
    solve_all::<f64>(Single::best(), &mut problems);
    assert_same(&problems[5], &solve_alone(&[zero])[0]);
}

#[test]
fn without_free_velocity_or_contacts_the_answer_is_zero() {
    let mut problems = drive(20.0, 20);
    problems[1].q.fill(0.0);
    problems[2].n_contacts = 0;
    solve_all::<f64>(Single::best(), &mut problems);
    for problem in &problems[1..3] {
        assert!(problem.is_solved && problem.iterations == 0);
        let n = problem.n_unknowns();
        assert!(
            problem.p[..n]
                .iter()
                .chain(&problem.u[..n])
                .all(|x| *x == 0.0)
        );
    }
}

/// Lets each group of problems through a queue as often as there are rounds; a group goes on with
/// its next problems while others are still at work.
struct ThroughAQueue<'a>(&'a [Vec<ContactProblem>]);

impl OverLanes for ThroughAQueue<'_> {
    fn run<T: Lane>(&mut self, token: T::Token) {
        assert_queue_gives_the_same::<T>(token, self.0);
    }
}

fn assert_queue_gives_the_same<T: Lane>(token: T::Token, rounds: &[Vec<ContactProblem>]) {
    let options = SolverOptions::default();
    let n_groups = rounds[0].len() / T::LANES;
    let mut problems = rounds[0].clone();
    let mut queue = Queue::<T>::new(token);
    queue.begin(n_groups, T::LANES);
    for group in 0..n_groups {
        queue.enter(group, &mut problems, |_| true);
    }
    let mut done = vec![0; n_groups];
    while let Some(group) = queue.next_group(&mut problems, &options) {
        let own = group * T::LANES..(group + 1) * T::LANES;
        let alone = solve_alone(&rounds[done[group]][own.clone()]);
        for (found, alone) in problems[own.clone()].iter().zip(&alone) {
            assert_same(found, alone);
        }
        done[group] += 1;
        if let Some(next) = rounds.get(done[group]) {
            problems[own.clone()].clone_from_slice(&next[own]);
            queue.enter(group, &mut problems, |_| true);
        }
    }
    assert!(done.iter().all(|done| *done == rounds.len()));
}

#[test]
fn groups_that_never_wait_for_each_other_get_the_same_answers() {
    let mut draw = Draw(7);
    let rounds: Vec<Vec<ContactProblem>> = (0..6)
        .map(|round| {
            let mut problems = drive(150.0, 32 * (round + 1)).split_off(32 * round);
            problems.truncate(24);
            // Some have more contacts than the smaller system takes, or none, or resist.
            for k in 0..8 {
                let n = [8, 0, 7, 6][k % 4];
                problems.insert(3 * k, random_problem(&mut draw, n, 5, k % 3 == 0));
            }
            problems
        })
        .collect();
    assert!(rounds.iter().all(|round| round.len() == 32));
    on_every_register(&mut ThroughAQueue(&rounds));
}

/// `W = G Gᵀ` of `rank` columns, `q` in its range.
fn random_problem(draw: &mut Draw, n_contacts: usize, rank: usize, cold: bool) -> ContactProblem {
    let n = 3 * n_contacts;
    let columns: Vec<Vec<f64>> = (0..rank)
        .map(|_| (0..n).map(|_| draw.next()).collect())
        .collect();
    let (mut W, mut q) = (vec![0.0; n * n], vec![0.0; n]);
    for column in &columns {
        let share = draw.next();
        for r in 0..n {
            q[r] += share * column[r];
            for c in 0..n {
                W[r * n + c] += column[r] * column[c];
            }
        }
    }
    let mu: Vec<f64> = (0..n_contacts)
        .map(|i| if i == 4 { 0.0 } else { draw.next().abs() })
        .collect();
    let p: Vec<f64> = (0..n)
        .map(|k| {
            if cold {
                0.0
            } else {
                draw.next() + f64::from(k % 3 == 0)
            }
        })
        .collect();
    problem(&W, &q, &mu, &p)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn every_answer_has_the_bits_of_the_problem_alone(
        seed in 1..u64::MAX,
        sizes in prop::collection::vec((0..=MAX_DENSE, 3..20_usize, any::<bool>()), 0..40),
    ) {
        let mut draw = Draw(seed);
        let mut problems: Vec<ContactProblem> = sizes
            .iter()
            .map(|&(n, rank, cold)| random_problem(&mut draw, n, rank, cold))
            .collect();
        let mut alone = solve_alone(&problems);
        for (found, start) in alone.iter().zip(&problems) {
            assert_sound(found, start);
        }
        assert_alike(&problems, &alone);
        problems.reverse();
        alone.reverse();
        assert_alike(&problems, &alone);
        let third = problems.len() / 3;
        assert_alike(&problems[third..], &alone[third..]);
    }
}
