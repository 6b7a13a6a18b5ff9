//! Servos that hold the speeds of wheels.

use std::sync::Arc;

use nalgebra::Vector3;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{JointKind, Model, ModelDescription, Motor, WheelDescription};
use rover_core::simulation::{Batch, RoverSimulation, WheelCommands};

use super::machines::{machine, simulation, solid, standing};
use crate::rover_kinds::tracked;
use crate::shared::{VARIANTS, apart, bits, flat, moving, near, stepping};

/// Of a disc of 1 kg and a radius of 0.1 m.
const INERTIA: f64 = 0.005;

/// A wheel in the air, on an axle that is fixed to the world.
fn wheel(speed_gain: Option<f64>, torque_limit: f64, motor: Option<Motor>) -> ModelDescription {
    let mut own = machine(vec![solid("wheel", None, JointKind::Revolute)]);
    own.wheels = vec![WheelDescription {
        name: "W".into(),
        solid: "wheel".into(),
        axle: [0.0, 0.0, 1.0],
        radius: 0.1,
        torque_limit,
        drive_sign: -1.0,
        motor,
        speed_gain,
        ..WheelDescription::default()
    }];
    own
}

fn run(own: ModelDescription, variant: Variant, h: f64, speed: f64) -> RoverSimulation {
    let model = Model::from_description(own).unwrap();
    let mut run = simulation(model, stepping(variant, h));
    run.set_wheel_speeds(&[speed]).unwrap();
    run
}

/// `I ω̇ = k (ω_s − ω)`: `ω = ω_s (1 − exp(−k t / I))`, exactly, at any gain.
#[test]
fn a_wheel_in_the_air_reaches_its_speed_with_the_time_constant() {
    for variant in VARIANTS {
        for gain in [1e-3, 0.1, 1.0, 40.0, 1e12] {
            let h = 5e-3;
            let mut run = run(wheel(Some(gain), 1e18, None), variant, h, 8.0);
            for n in 1..40 {
                let report = run.step(1).unwrap();
                assert!(report.is_converged());
                let expected = 8.0 * (1.0 - (-gain * h * f64::from(n) / INERTIA).exp());
                near(-run.v()[0], expected, 1e-9);
            }
            // The work of the drive is the energy of the wheel.
            let last = run.last_call();
            assert!(last.work >= 0.0, "{last:?}");
        }
    }
}

/// A stiff servo accelerates with its limit, `ω = τ t / I`, and then holds the speed; in the other
/// direction, too.
#[test]
fn a_bound_torque_accelerates_at_the_limit_until_the_speed_is_reached() {
    for variant in VARIANTS {
        for gain in [40.0, 1e12] {
            let (h, limit) = (5e-3, 0.05);
            let mut run = run(wheel(Some(gain), limit, None), variant, h, 3.03);
            let each = limit * h / INERTIA;
            for n in 1..=60 {
                run.step(1).unwrap();
                near(-run.v()[0], each * f64::from(n), 1e-9);
                near(run.motor_torques()[0], limit, 1e-9);
            }
            run.step(10).unwrap();
            near(-run.v()[0], 3.03, 1e-9);
            run.set_wheel_speeds(&[-1.0]).unwrap();
            run.step(20).unwrap();
            near(-run.v()[0], 3.03 - 20.0 * each, 1e-9);
        }
    }
}

/// On its line a motor runs up as `ω = ω₀ (1 − exp(−τ₀ t / (I ω₀)))`, whatever its servo asks; a
/// servo brakes with its own torque, and no motor turns faster than without load.
#[test]
fn a_servo_stays_within_the_line_of_its_motor() {
    for (variant, regenerating) in [
        (Variant::Linearised, true),
        (Variant::Linearised, false),
        (Variant::Newton, true),
    ] {
        let motor = Motor {
            stall_torque: 0.008,
            no_load_speed: 5.0,
            regenerating,
        };
        let h = 1e-3;
        let own = wheel(Some(1e6), 0.5, Some(motor));
        let mut run = run(own, variant, h, 9.0);
        let rate = motor.stall_torque / (INERTIA * motor.no_load_speed);
        for n in 1..1000 {
            run.step(1).unwrap();
            let expected = motor.no_load_speed * (1.0 - (-rate * h * f64::from(n)).exp());
            // The weight of the stiff servo makes the line first order.
            near(-run.v()[0], expected, 5e-4);
        }
        let before = -run.v()[0];
        run.set_wheel_speeds(&[0.5]).unwrap();
        run.step(100).unwrap();
        near(
            -run.v()[0],
            before - 0.1 * motor.stall_torque / INERTIA,
            1e-9,
        );
        run.step(2000).unwrap();
        near(-run.v()[0], 0.5, 1e-9);
    }
}

/// `k = (I + (m/n) r²) / T`.
#[test]
fn the_default_gain_is_that_of_a_time_step_for_each_machine() {
    let rover = Model::rover();
    let expected = (0.5 * 30.0 * 0.01 + 960.0 / 6.0 * 0.01) / 5e-4;
    for wheel in rover.wheels() {
        near(wheel.speed_gain, expected, 1e-9 * expected);
    }
    let parts = [
        ("a".to_owned(), rover.description().clone()),
        ("b".to_owned(), tracked(4)),
    ];
    let joined = Model::joined("both", parts.to_vec(), Vec::new()).unwrap();
    let alone = Model::from_description(tracked(4)).unwrap();
    let both = rover.wheels().iter().chain(alone.wheels());
    for (own, wheel) in joined.wheels().iter().zip(both) {
        near(own.speed_gain, wheel.speed_gain, 1e-12 * wheel.speed_gain);
    }
    for (stated, is_refused) in [(0.0, true), (f64::NAN, true), (1e13, true), (1e12, false)] {
        let built = Model::from_description(wheel(Some(stated), 1.0, None));
        let field = built.err().map(|error| error.to_string());
        let names = field
            .as_ref()
            .is_some_and(|e| e.contains("wheels[0].speed_gain"));
        assert_eq!(names, is_refused, "{stated} {field:?}");
    }
}

/// A rover on level ground.
fn driving(model: Model, variant: Variant) -> RoverSimulation {
    let start = standing(&model);
    let v = vec![0.0; model.nv()];
    let options = StepOptions {
        variant,
        ..StepOptions::default()
    };
    moving(Arc::new(model), flat(), options, start, v)
}

/// Rolling without slip, a rover of wheels of radius r has the speed r ω; wheels of one track have
/// the mean of their speeds.
#[test]
fn a_rover_drives_at_the_speed_of_its_wheels() {
    for variant in VARIANTS {
        let mut run = driving(Model::rover(), variant);
        run.set_wheel_speeds(&[4.0; 6]).unwrap();
        run.step(400).unwrap();
        near(run.v()[0], 0.4, 1e-4);
        assert!(run.last_call().positive_work > 0.0);
        run.set_wheel_speeds(&[0.0; 6]).unwrap();
        run.step(400).unwrap();
        near(run.v()[0], 0.0, 1e-4);
        let work = run.last_call();
        assert!(work.positive_work < work.work, "{work:?}");
    }
    let mut run = driving(
        Model::from_description(tracked(4)).unwrap(),
        Variant::Linearised,
    );
    run.set_wheel_speeds(&[1.0, 2.0, 3.0, 4.0, 2.5, 2.5, 2.5, 2.5])
        .unwrap();
    run.step(400).unwrap();
    near(run.v()[0], 0.375, 1e-3);
}

/// The fast step and the general one agree, and rovers side by side have the bits of each alone.
#[test]
fn servos_in_lanes_are_those_of_a_rover_alone() {
    let speeds: Vec<Vec<f64>> = (0..9)
        .map(|i| (0..6).map(|k| 9.0 * f64::from(i + 2 * k).sin()).collect())
        .collect();
    let rovers: Vec<_> = (0..9)
        .map(|i| {
            let motor = Motor {
                stall_torque: 80.0,
                no_load_speed: 6.0,
                regenerating: true,
            };
            let model = Model::rover().with_motors((i % 3 == 0).then_some(motor));
            driving(model.unwrap(), Variant::Linearised)
        })
        .collect();
    let mut alone = rovers.clone();
    let (mut retaken, mut fallbacks) = (0, 0);
    for (own, speeds) in alone.iter_mut().zip(&speeds) {
        own.set_wheel_speeds(speeds).unwrap();
        for _ in 0..40 {
            let mut general = own.clone();
            general.step_with(&Variant::Linearised, 1).unwrap();
            let report = own.step(1).unwrap();
            (retaken, fallbacks) = (retaken + report.retaken, fallbacks + report.fallbacks);
            if report.fallbacks == 0 {
                assert!(apart(own.v(), general.v()) < 1e-6, "{report:?}");
            }
        }
    }
    assert!(retaken > 20 && fallbacks < 20, "{retaken} {fallbacks}");
    let mut batch = Batch::new(rovers, Vec::new(), Some(1)).unwrap();
    let mut rows = vec![0.0; 9 * batch.layout().size()];
    let all = speeds.concat();
    let (steering, commands) = (vec![0.0; 54], WheelCommands::Speeds(&all));
    (batch.step_while(commands, &steering, 40, None, &mut rows, &mut || true)).unwrap();
    for (own, alone) in batch.rovers().iter().zip(&alone) {
        assert_eq!(bits(own.v()), bits(alone.v()));
        assert_eq!(own.motor_torques(), alone.motor_torques());
    }
}

/// The derivatives by state and speeds are those of real steps.
#[test]
fn the_tangent_of_a_servo_equals_differences() {
    let mut model = ModelDescription::named("four-steered").unwrap();
    model.wheels[2].torque_limit = 1.0;
    // Uphill each wheel needs some 2 N m.
    let options = StepOptions {
        gravity: Vector3::new(-1.3, -9.7, 0.0),
        ..StepOptions::default()
    };
    let model = Model::from_description(model).unwrap();
    let (start, v) = (standing(&model), vec![0.0; model.nv()]);
    let mut run = moving(model, flat(), options, start, v);
    run.set_wheel_speeds(&[4.0; 4]).unwrap();
    run.step(100).unwrap();
    near(run.motor_torques()[2], 1.0, 1e-9);
    let found = run.linearise(&[], Some(1e-6)).unwrap();
    let check = found.check.unwrap();
    let nx = found.state.len();
    let broken: Vec<_> = (0..nx + 4)
        .filter(|&k| !check.holds[k])
        .map(|k| (k, check.errors[k]))
        .collect();
    assert!(broken.is_empty(), "{broken:?}");
    assert_eq!(bits(&found.command[..4]), bits(&[4.0; 4]));
    // The wheel at its limit does not answer.
    let answers: Vec<bool> = (0..4).map(|k| found.b.column(k).amax() > 1e-3).collect();
    assert_eq!(answers, [true, true, false, true]);
}

/// A snapshot holds the speeds; torques and brakes replace them.
#[test]
fn a_snapshot_goes_on_and_other_commands_replace_the_speeds() {
    let mut run = driving(Model::rover(), Variant::Linearised);
    run.set_wheel_speeds(&[3.0; 6]).unwrap();
    run.step(7).unwrap();
    let snapshot = run.snapshot();
    let mut other = driving(Model::rover(), Variant::Linearised);
    other.restore(&snapshot).unwrap();
    assert_eq!(other.wheel_speeds(), Some(&[3.0; 6][..]));
    run.step(20).unwrap();
    other.step(20).unwrap();
    assert_eq!(bits(run.v()), bits(other.v()));

    assert!(run.set_wheel_speeds(&[1.0; 5]).is_err());
    assert!(run.set_speed_commands(&[1.0; 6], &[9.0; 6]).is_err());
    assert_eq!(run.wheel_speeds(), Some(&[3.0; 6][..]));
    run.set_wheel_torques(&[0.0; 6]).unwrap();
    assert_eq!(run.wheel_speeds(), None);
    run.step(1).unwrap();
    assert_eq!(run.motor_torques(), [0.0; 6]);
    other.brake();
    assert_eq!(other.wheel_speeds(), None);
}
