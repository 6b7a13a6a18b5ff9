//! Work and bits: iteration counts, no allocation, the same twice, snapshots.

use std::sync::Arc;

use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Configuration, Model};
use rover_core::simulation::Simulation;

use crate::scenes::{VARIANTS, at_rest};

fn driving(options: StepOptions) -> Simulation {
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
        let mut simulation = driving(StepOptions {
            variant,
            ..StepOptions::default()
        });
        simulation.step(50).unwrap();
        let counted = allocation_counter::measure(|| {
            simulation.step(200).unwrap();
        });
        assert_eq!(counted.count_total, 0, "{variant:?}");
    }
}

#[test]
fn driving_takes_few_solver_iterations() {
    // A slower solver shows here without a clock. Measured: 2.7 a step on this drive.
    let mut simulation = driving(StepOptions::default());
    let report = simulation.step(1000).unwrap();
    assert!(report.is_converged());
    assert!(
        report.iterations <= 3000,
        "{} iterations in 1000 steps",
        report.iterations
    );
}

#[test]
fn equal_runs_give_equal_bits_on_any_thread() {
    let run = || {
        let mut simulation = driving(StepOptions::default());
        simulation.step(300).unwrap();
        simulation.snapshot()
    };
    let threads: Vec<_> = (0..3).map(|_| std::thread::spawn(run)).collect();
    let here = run();
    for thread in threads {
        assert_eq!(thread.join().unwrap(), here);
    }
}

#[test]
fn a_snapshot_continues_bit_for_bit_also_in_another_simulation() {
    for variant in VARIANTS {
        let options = StepOptions {
            variant,
            ..StepOptions::default()
        };
        let mut simulation = driving(options.clone());
        simulation.step(100).unwrap();
        let snapshot = simulation.snapshot();
        simulation.step(100).unwrap();
        let mut other = at_rest(options);
        other.restore(&snapshot).unwrap();
        other.step(100).unwrap();
        assert_eq!(other.snapshot(), simulation.snapshot());
    }
}

#[test]
fn a_snapshot_of_another_machine_is_refused() {
    let mut simulation = driving(StepOptions::default());
    let welded = Arc::new(
        Model::rover()
            .with_locked_joints(&[("front_axle".into(), 0.0)])
            .unwrap(),
    );
    let other = Simulation::new(welded, Arc::new(Plane::ground()), StepOptions::default()).unwrap();
    let before = simulation.snapshot();
    assert!(simulation.restore(&other.snapshot()).is_err());
    let mut damaged = before.clone();
    damaged.state.v[3] = f64::NAN;
    assert!(simulation.restore(&damaged).is_err());
    assert_eq!(simulation.snapshot(), before);
}

#[test]
fn models_and_terrains_are_shared_between_threads() {
    let (model, ground) = (Arc::new(Model::rover()), Arc::new(Plane::ground()));
    let handles: Vec<_> = (0..2)
        .map(|_| {
            let (model, ground) = (model.clone(), ground.clone());
            std::thread::spawn(move || {
                let mut simulation =
                    Simulation::new(model.clone(), ground, StepOptions::default()).unwrap();
                let mut start = Configuration::zero(&model);
                start.position.y = 0.35;
                simulation.set_state(start, vec![0.0; model.nv()]);
                simulation.step(10).unwrap().n_contacts
            })
        })
        .collect();
    for handle in handles {
        assert_eq!(handle.join().unwrap(), 6);
    }
}
