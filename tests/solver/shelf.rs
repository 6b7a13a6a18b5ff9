//! The shelf's hard problems, `tests/shelf`: piles, stacks, mass ratios,
//! jams, the rover's wheels; always tested.

use std::collections::BTreeMap;

use crate::npz::{Recorded, shelf};
use crate::solving::cold;
use friction_contact::problem::FrictionContactProblem;
use friction_contact::solver::{SolveReport, SolverOptions};
use serde::Deserialize;

/// `tests/shelf/bounds.json`: the relative residual that every problem is
/// solved to, and larger ones for those that are not.
#[derive(Deserialize)]
struct Bounds {
    aim: f64,
    not_reached: BTreeMap<String, f64>,
}

/// Work for what is not solved, so that the tests do not wait for it.
const SCANT: u64 = 300_000_000;

/// How well a problem is solved from rest with the default options but for the tolerance, relative
/// and in m/s, and the budget.
fn answer(recorded: &Recorded, tolerance: f64, budget: Option<u64>) -> SolveReport {
    let problem =
        FrictionContactProblem::new(recorded.dimension, &recorded.W, &recorded.q, &recorded.mu)
            .expect("a sound problem");
    let options = SolverOptions {
        tolerance,
        velocity_tolerance: tolerance.max(1e-9),
        budget,
        ..SolverOptions::default()
    };
    let (_, _, report) = cold(&problem, &options);
    report
}

#[test]
fn every_problem_of_the_shelf_within_its_bound() {
    let bounds: Bounds =
        serde_json::from_str(include_str!("../shelf/bounds.json")).expect("the bounds' file");
    let problems = shelf(|_| true);
    for name in bounds.not_reached.keys() {
        assert!(
            problems.iter().any(|problem| problem.name == *name),
            "{name} is not on the shelf"
        );
    }
    let missed: Vec<String> = problems
        .iter()
        .filter_map(|problem| {
            let bound = bounds.not_reached.get(&problem.name);
            let report = answer(problem, bounds.aim, bound.map(|_| SCANT));
            let holds = match bound {
                Some(bound) => report.residual <= *bound,
                None => report.is_converged() && report.residual <= bounds.aim,
            };
            (!holds).then(|| format!("{}: {report:?}", problem.name))
        })
        .collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// The problems of the rover's steps are solved to the tolerance of its simulation.
#[test]
fn the_rovers_steps_to_the_last_digits() {
    let problems = shelf(|name| name.starts_with("rover"));
    assert!(!problems.is_empty());
    for problem in problems {
        let report = answer(&problem, 1e-12, None);
        assert!(
            report.is_converged() && report.residual < 1e-12,
            "{}: {report:?}",
            problem.name
        );
    }
}

/// A budget ends every solve, with a finite answer that is better than zero.
#[test]
fn a_scant_budget_holds() {
    for problem in shelf(|name| name.contains("460") || name == "wall_hit") {
        let report = answer(&problem, 1e-12, Some(SCANT));
        assert!(report.work <= SCANT);
        assert!(report.residual < 0.1, "{}: {report:?}", problem.name);
    }
}

/// The story: a step got a quarter of a budget that did not grow, and heaps of boxes stayed
/// unsolved that a larger budget solves.
#[test]
fn the_usual_budget_grows_with_the_contacts() {
    let usual = SolverOptions::usual_budget;
    assert_eq!(usual(6), usual(64));
    assert_eq!(4 * usual(64), usual(65));
    assert_eq!(usual(65), usual(200));
    assert_eq!(usual(400), 4 * usual(200));
    assert_eq!(SolverOptions::default().budget_of(400), usual(400));
    let given = SolverOptions {
        budget: Some(7),
        ..SolverOptions::default()
    };
    assert_eq!(given.budget_of(400), 7);
}
