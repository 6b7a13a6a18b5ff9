//! Heaps of loose boxes, in which many contacts share few loads: every step is solved.

use super::heap_scenes::heap_of_boxes;

/// Drops `side³` boxes; the most contacts of a step.
fn solve_every_step(side: usize, seed: u64, steps: usize) -> usize {
    let mut simulation = heap_of_boxes(side, seed);
    let mut most = 0;
    for step in 0..steps {
        let report = simulation.step(1).unwrap();
        assert!(report.is_converged(), "step {step}: {report:?}");
        most = most.max(report.n_contacts);
    }
    most
}

/// The story: steps 337 to 343 were not solved within the budget, four of them within 1e-7 of an
/// answer that lay far away in the null space of `W`; later the solves of steps 358 and 362 used up
/// the budget of their steps. Seed 3 is the worst of twenty.
#[test]
fn every_step_of_27_boxes_is_solved_until_they_lie() {
    let most = solve_every_step(3, 3, 480);
    assert!(most > 100, "{most} contacts");
}

/// From the first touch until the lower half lies.
#[test]
fn every_step_of_64_boxes_is_solved() {
    solve_every_step(4, 1, 220);
}

/// Ignored because it takes 7 s and is the test above with more boxes, which runs always: `make
/// test-all` runs it.
#[test]
#[ignore = "tests/physics/contacts/heaps.rs::every_step_of_64_boxes_is_solved"]
fn every_step_of_125_boxes_is_solved() {
    let most = solve_every_step(5, 1, 225);
    assert!(most > 200, "{most} contacts");
}

/// The story: step 391 of seed 2, of 27 boxes, was not solved to 1e-12 of a q of 1e-8 m/s, the
/// difference of the velocities of two boxes that fall together. In step 346 of seed 13 pivoting
/// went round in circles. 22 400 steps.
/// Ignored because it takes minutes: `make test-all` runs it, and the test named below, which runs
/// always, is one of its heaps.
#[test]
#[ignore = "tests/physics/contacts/heaps.rs::every_step_of_27_boxes_is_solved_until_they_lie"]
fn every_step_of_fifty_heaps_is_solved() {
    for seed in 1..=40 {
        solve_every_step(3, seed, 480);
    }
    for seed in 1..=10 {
        solve_every_step(4, seed, 320);
    }
}
