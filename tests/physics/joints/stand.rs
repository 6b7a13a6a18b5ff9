//! Machines on a test stand: loops hold the trunk, so that nothing moves their wheels' contacts.
//!
//! Noise stood on W's diagonal there. At a heading of 0.3 rad the wheels got forces of 1e11 N and
//! were braked to a stop, in steps that had converged.

use rover_core::contact::loops::check_closed;
use rover_core::contact::placement::resting_pose;
use rover_core::geometry::Plane;
use rover_core::integrator::StepReport;
use rover_core::integrator::Variant;
use rover_core::integrator::moreau_jean::MoreauJean;
use rover_core::multibody::{Configuration, LoopDescription, LoopKind, Model, ModelDescription};
use rover_core::multibody::{coordinates, description::WheelDescription};
use rover_core::simulation::RoverSimulation;

use crate::shared::{closure, flat, moving, stepping};

/// A cart whose trunk is welded to the world at a heading, lowered by so much, m.
fn on_stand(change: &dyn Fn(&mut WheelDescription), heading: f64, lower: f64) -> RoverSimulation {
    let mut description = ModelDescription::named("skid-steered").unwrap();
    description.wheels.iter_mut().for_each(change);
    let free = Model::from_description(description.clone()).unwrap();
    let mut place = resting_pose(&free, &Plane::ground(), [0.0, 0.0], heading).unwrap();
    place[1] -= lower;
    let welded = |turn: f64| {
        let mut description = description.clone();
        description.loops.push(LoopDescription {
            position: Some([0.0; 3]),
            other_position: Some([place[0], place[1], place[2]]),
            other_rotation: Some([0.0, turn, 0.0]),
            ..closure("stand", LoopKind::Weld, &description.solids[0].name, None)
        });
        let model = Model::from_description(description).unwrap();
        let q = coordinates::from_public(&model, &place).unwrap();
        (model, q)
    };
    let is_closed = |(model, q): &(Model, Configuration)| check_closed(model, q).is_ok();
    let (model, q) = [heading, -heading]
        .map(welded)
        .into_iter()
        .find(is_closed)
        .unwrap();
    let v = vec![0.0; model.nv()];
    moving(model, flat(), stepping(Variant::Linearised, 5e-3), q, v)
}

fn rigid(wheel: &mut WheelDescription) {
    wheel.stiffness = Some(0.0);
}

const STIFFNESS: f64 = 1e5;

fn soft(wheel: &mut WheelDescription) {
    (wheel.stiffness, wheel.damping) = (Some(STIFFNESS), Some(1e3));
}

/// Rates of the wheels, rad/s, forward.
fn rates(run: &RoverSimulation) -> Vec<f64> {
    let model = run.model();
    let of = |wheel: &rover_core::multibody::Wheel| {
        let joint = wheel.joint.unwrap();
        wheel.drive_sign * run.v()[model.joints()[joint].velocity]
    };
    model.wheels().iter().map(of).collect()
}

/// Takes a step, fast or general.
fn step(run: &mut RoverSimulation, is_fast: bool) -> StepReport {
    let report = if is_fast {
        run.step(1).unwrap()
    } else {
        run.step_with(&MoreauJean, 1).unwrap()
    };
    assert!(
        report.is_converged() && report.loop_gap < 1e-9,
        "{report:?}"
    );
    report
}

#[test]
fn rigid_wheels_of_a_machine_on_a_stand_turn_freely_and_bear_nothing() {
    for (heading, lower) in [(0.0, 0.0), (0.3, 0.0), (0.3, 1e-3), (1.0, 1e-3)] {
        for is_fast in [true, false] {
            let mut run = on_stand(&rigid, heading, lower);
            run.set_wheel_torques(&[2.0; 4]).unwrap();
            let mut half = Vec::new();
            for k in 1..=20 {
                let report = step(&mut run, is_fast);
                assert_eq!(report.immovable_contacts, 4, "{heading} {lower}");
                assert!(report.iterations <= 4, "{report:?}");
                let forces = run.wheel_forces();
                assert!(
                    forces.as_flattened().iter().all(|f| f.abs() < 1e-9),
                    "{forces:?}"
                );
                if k == 10 {
                    half = rates(&run);
                }
            }
            for (rate, half) in rates(&run).iter().zip(half) {
                assert!(
                    half > 0.1 && (rate - 2.0 * half).abs() < 1e-9 * half,
                    "{rate} {half}"
                );
            }
        }
    }
}

#[test]
fn wheels_that_yield_on_a_stand_press_and_rub_by_their_springs() {
    let lower = 1e-3;
    for is_fast in [true, false] {
        for torque in [2.0, 30.0] {
            let mut run = on_stand(&soft, 0.3, lower);
            run.set_wheel_torques(&[torque; 4]).unwrap();
            let load = STIFFNESS * lower;
            let mu = run.options().friction_coefficient;
            let holds = torque < mu * load * run.model().wheels()[0].radius;
            assert_eq!(holds, torque < 10.0);
            for _ in 0..40 {
                assert_eq!(step(&mut run, is_fast).immovable_contacts, 4);
            }
            for ([n, t, b], rate) in run.wheel_forces().into_iter().zip(rates(&run)) {
                assert!((n - load).abs() < 0.02 * load, "{n} {load}");
                assert!(b.abs() < 1e-9 * load, "{b}");
                if holds {
                    assert!(
                        rate.abs() < 1e-9
                            && (t.abs() - torque / run.model().wheels()[0].radius).abs()
                                < 1e-6 * load,
                        "{rate} {t}"
                    );
                } else {
                    assert!(
                        rate > 0.1 && (t.abs() - mu * n).abs() < 1e-9 * load,
                        "{rate} {t}"
                    );
                }
            }
        }
    }
}
