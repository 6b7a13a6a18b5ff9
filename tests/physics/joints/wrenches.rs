//! Forces and moments from outside on the solids of a machine.

use std::sync::Arc;

use nalgebra::Vector3;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{JointKind, Model};
use rover_core::simulation::CommandError;

use super::machines::{energy, model, simulation, solid, standing};
use crate::shared::{VARIANTS, flat, moving, near_in, stepping};

/// `v = F t / m − g t`, and about a principal axis `ω = M t / I`; the work is the kinetic energy.
#[test]
fn a_free_body_answers_by_mass_and_inertia() {
    for variant in VARIANTS {
        let mut body = solid("body", None, JointKind::Free);
        body.mass = 2.0;
        body.inertia = Some([0.1, 0.2, 0.3, 0.0, 0.0, 0.0]);
        let mut run = simulation(model(vec![body]), stepping(variant, 1e-2));
        run.apply_wrench("body", [3.0, 2.0 * 9.81, 0.0], [0.0, 0.4, 0.0], [0.0; 3])
            .unwrap();
        let report = run.step(100).unwrap();
        let expected = [1.5, 0.0, 0.0, 0.0, 2.0, 0.0];
        for (v, expected) in run.v().iter().zip(expected) {
            assert!((v - expected).abs() < 1e-12, "{variant:?} {:?}", run.v());
        }
        assert!(report.energy_removed.abs() < 1e-9 && report.energy_lost.abs() < 1e-9);
        // Taken away, the body flies on.
        run.apply_wrench("body", [0.0; 3], [0.0; 3], [0.0; 3])
            .unwrap();
        run.step(10).unwrap();
        assert!((run.v()[1] + 0.981).abs() < 1e-12 && (run.v()[4] - 2.0).abs() < 1e-12);
    }
}

/// A force at a point of an arm is the torque `x F_y − y F_x` about its axis.
#[test]
fn a_force_on_an_arm_turns_it_as_its_moment_does() {
    let arm = || {
        let mut arm = solid("arm", None, JointKind::Revolute);
        let mut hand = solid("hand", Some("arm"), JointKind::Fixed);
        hand.position = Some([0.5, 0.0, 0.0]);
        hand.rotation = Some([0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        arm.centre_of_mass = Some([0.0, 0.0, 0.0]);
        hand.mass = 0.5;
        model(vec![arm, hand])
    };
    for variant in VARIANTS {
        let mut pushed = simulation(arm(), stepping(variant, 5e-3));
        // The point lies 0.2 m along the hand's x, the arm's y.
        pushed
            .apply_wrench("hand", [0.0, 4.0, 1.0], [0.0, 0.0, 0.3], [0.2, 0.0, 0.0])
            .unwrap();
        let mut held = simulation(arm(), stepping(variant, 5e-3));
        held.set_joint_torques(&[4.0 * 0.5 + 0.3]).unwrap();
        for run in [&mut pushed, &mut held] {
            run.step(1).unwrap();
        }
        assert!((pushed.v()[0] - held.v()[0]).abs() < 1e-4, "{variant:?}");
        let before = energy(&pushed);
        let (mut work, mut q) = (0.0, pushed.q().joints[0]);
        for _ in 0..200 {
            pushed.step(1).unwrap();
            let (next, middle) = (pushed.q().joints[0], 0.5 * (pushed.q().joints[0] + q));
            let lever = 0.5 * middle.cos() - 0.2 * middle.sin();
            work += (4.0 * lever + 0.3) * (next - q);
            q = next;
        }
        let gained = energy(&pushed) - before;
        near_in(&variant, gained, work, 1e-3 * work.abs().max(1.0));
    }
}

/// Sideways, a parked rover holds what friction holds, and slides beyond.
#[test]
fn a_parked_rover_is_pushed_away_beyond_its_friction() {
    let model = Arc::new(Model::rover());
    let q = standing(&model);
    for (share, moves) in [(0.9, false), (1.1, true)] {
        let options = stepping(Variant::Linearised, 5e-3);
        let push = share * options.friction_coefficient * model.mass() * 9.81;
        let v = vec![0.0; model.nv()];
        let mut run = moving(model.clone(), flat(), options, q.clone(), v);
        run.brake();
        run.apply_wrench("trunk", [0.0, 0.0, push], [0.0; 3], [0.0; 3])
            .unwrap();
        let report = run.step(100).unwrap();
        assert!(report.is_converged() && report.fallbacks == 0);
        assert_eq!(run.q().position.z > 1e-2, moves, "{}", run.q().position.z);
        let snapshot = run.snapshot();
        let mut again = run.clone();
        again.clear_wrenches();
        again.restore(&snapshot).unwrap();
        run.step(5).unwrap();
        again.step(5).unwrap();
        assert_eq!(run.v(), again.v());
        assert!(run.linearise(&[], None).is_ok());
        run.clear_wrenches();
    }
}

#[test]
fn a_wrench_on_nobody_or_without_numbers_is_refused() {
    let mut run = simulation(
        model(vec![solid("body", None, JointKind::Free)]),
        stepping(Variant::Linearised, 1e-2),
    );
    let zero = [0.0; 3];
    assert_eq!(
        run.apply_wrench("nobody", zero, zero, zero)
            .unwrap_err()
            .to_string(),
        "solid: there is no solid named \"nobody\""
    );
    let infinite = [0.0, f64::INFINITY, 0.0];
    assert!(matches!(
        run.apply_wrench("body", zero, infinite, zero),
        Err(CommandError::NotFinite {
            field: "moment",
            index: 1,
            ..
        })
    ));
}

/// A force at a point of a wheel's rim did not turn with the wheel: a step leaves the rotation of
/// wheels about their axles out of their poses.
#[test]
fn a_force_at_a_rim_turns_with_its_wheel() {
    let rover = Model::rover();
    let wheel = &rover.wheels()[0];
    let joint = wheel.joint.unwrap();
    let k = rover.joint_velocity(joint);
    let rate = |angle: f64| {
        let options = StepOptions {
            gravity: Vector3::zeros(),
            ..stepping(Variant::Linearised, 1e-3)
        };
        let mut run = simulation(rover.clone(), options);
        let mut q = run.q().clone();
        q.joints[joint] = angle;
        run.set_state(q, vec![0.0; rover.nv()]);
        run.apply_wrench("wheel_FL", [0.0, 1.0, 0.0], [0.0; 3], [0.1, 0.0, 0.0])
            .unwrap();
        run.step(1).unwrap();
        run.v()[k]
    };
    // The rover turns under the force at the wheel's centre, too.
    let common = 0.5 * (rate(0.0) + rate(std::f64::consts::PI));
    let most = rate(0.0) - common;
    assert!(most > 1e-5);
    for angle in [0.7, 2.0, 3.1, -1.0_f64] {
        let off = rate(angle) - common - most * angle.cos();
        assert!(off.abs() < 1e-6 * most, "{angle}: {off}");
    }
}
