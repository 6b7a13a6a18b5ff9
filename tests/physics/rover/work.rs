//! Work and reproducibility: iteration counts, no allocation, equal bits in equal runs, snapshots.

use rover_core::integrator::StepOptions;
use rover_core::simulation::RoverSimulation;

use super::scenes::{VARIANTS, at_rest, on_slope};
use crate::shared::stepping;

fn driving(options: StepOptions) -> RoverSimulation {
    let mut simulation = at_rest(options);
    simulation
        .set_steering(&[-0.2, -0.2, 0.0, 0.2, 0.0, 0.2])
        .unwrap();
    simulation.set_wheel_torques(&[30.0; 6]).unwrap();
    simulation
}

#[test]
fn a_step_allocates_nothing() {
    for variant in VARIANTS {
        let mut simulation = driving(stepping(variant, 0.005));
        simulation.step(50).unwrap();
        let counted = allocation_counter::measure(|| {
            simulation.step(200).unwrap();
        });
        assert_eq!(counted.count_total, 0, "{variant:?}");
    }
}

#[test]
fn driving_takes_few_solver_iterations() {
    // A slower solver shows here without a clock. Measured: 2.7 per step on this drive.
    let mut simulation = driving(StepOptions::default());
    let report = simulation.step(1000).unwrap();
    assert!(report.is_converged());
    assert!(
        report.iterations <= 3000,
        "{} iterations in 1000 steps",
        report.iterations
    );
}

/// The rover on a slope of 10 degrees with all wheels steered about one
/// centre at a distance of 1 / curvature.
fn turning(curvature: f64, options: StepOptions) -> RoverSimulation {
    let mut simulation = on_slope(10.0, options);
    let places = [
        (0.66, -0.53),
        (0.66, 0.53),
        (-0.06, -0.53),
        (-0.66, -0.53),
        (-0.06, 0.53),
        (-0.66, 0.53),
    ];
    simulation
        .set_steering(&places.map(|(x, z): (f64, f64)| x.atan2(1.0 / curvature + z)))
        .unwrap();
    simulation
}

#[test]
fn wheels_that_fight_each_other_in_a_turn_take_few_iterations() {
    // The story: with all wheels steered about one centre W has rank 14 of 18, the steering joints
    // yield by 1e-6 rad when the rover accelerates, and four wheels slide at 1e-6 m/s with full
    // friction. Newton on predicted modes cycled, the proximal method took 60 to 1000 iterations
    // per step, and a control period took seven milliseconds.
    for curvature in [0.1, 0.7] {
        let mut simulation = turning(curvature, StepOptions::default());
        let mut iterations = 0;
        for step in 0..600 {
            let v = simulation.v();
            let speed = v[0].hypot(v[1]).hypot(v[2]);
            let drive = 30.0 + 15.0 * (1.0 - speed) + if step / 10 % 2 == 0 { 3.0 } else { -3.0 };
            simulation.set_wheel_torques(&[drive; 6]).unwrap();
            let report = simulation.step(1).unwrap();
            assert!(
                report.is_converged(),
                "curvature {curvature}, step {step}: {report:?}"
            );
            iterations += report.iterations;
        }
        assert!(
            iterations <= 600 * 6,
            "curvature {curvature}: {iterations} iterations in 600 steps"
        );
    }
}

#[test]
fn every_tolerance_comes_to_an_end() {
    // With tolerances of 1e-6 for the residual and 1e-9 m/s for the velocity a search once looped
    // for ever without an iteration.
    for tolerance in [1e-2, 1e-6, 1e-9, 1e-13, 1e-15] {
        let mut options = StepOptions::default();
        options.solver.tolerance = tolerance;
        let mut simulation = turning(0.7, options);
        simulation.set_wheel_torques(&[45.0; 6]).unwrap();
        let report = simulation.step(100).unwrap();
        assert!(report.iterations < 100 * 600, "{tolerance}: {report:?}");
        assert!(simulation.q().is_finite());
    }
}
