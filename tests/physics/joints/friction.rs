//! Dry friction in joints, against paper.

use std::sync::Arc;

use rover_core::integrator::Variant;
use rover_core::multibody::{
    Configuration, JointKind, LoopKind, Model, ModelDescription, SolidDescription,
};
use rover_core::simulation::RoverSimulation;

use super::machines::{energy, machine, model, simulation, solid, standing};
use crate::shared::{VARIANTS, closure, flat, follows, largest, limits, moving, near_in, stepping};

/// Length of a pendulum of 1 kg, m, and its largest torque, N m.
const LENGTH: f64 = 0.8;
const WEIGHT: f64 = 9.81 * LENGTH;

fn pendulum(friction: f64) -> SolidDescription {
    let mut bob = solid("bob", None, JointKind::Revolute);
    bob.centre_of_mass = Some([0.0, -LENGTH, 0.0]);
    bob.friction = Some(friction);
    bob
}

fn at(model: Model, h: f64, variant: Variant, angle: f64, rate: f64) -> RoverSimulation {
    let mut run = simulation(model, stepping(variant, h));
    let mut q = Configuration::zero(run.model());
    q.joints[0] = angle;
    let mut v = vec![0.0; run.model().nv()];
    v[0] = rate;
    run.set_state(q, v);
    run
}

/// `m g l sin α ≤ τ_f`.
#[test]
fn a_pendulum_sticks_where_its_weight_is_too_small() {
    let limit: f64 = 0.6;
    for variant in VARIANTS {
        for sign in [-1.0, 1.0] {
            let place = |share: f64| {
                let model = model(vec![pendulum(limit * WEIGHT)]);
                let angle = sign * (share * limit).asin();
                let mut run = at(model, 5e-3, variant, angle, 0.0);
                assert!(run.step(400).unwrap().is_converged());
                (run.q().joints[0] - angle, run.v()[0])
            };
            let (way, rate) = place(1.0 - 1e-6);
            assert!(
                way.abs() < 1e-12 && rate.abs() < 1e-12,
                "{variant:?}: {way} {rate}"
            );
            let (way, _) = place(1.0 + 1e-3);
            assert!(-sign * way > 1e-4, "{variant:?}: {way}");
        }
    }
}

/// `E_0 − E = τ_f |Δα|` on the way down, and rest within the angle of sticking.
#[test]
fn a_swing_loses_friction_times_angle() {
    let friction = 0.1 * WEIGHT;
    for variant in VARIANTS {
        let mut errors = Vec::new();
        for h in [4e-3, 2e-3] {
            let mut run = at(model(vec![pendulum(friction)]), h, variant, 1.2, 0.0);
            let before = energy(&run);
            while run.q().joints[0] > -0.3 {
                run.step(1).unwrap();
            }
            let angle = 1.2 - run.q().joints[0];
            errors.push((before - energy(&run) - friction * angle).abs());
        }
        assert!(
            errors[1] < 2e-3 && errors[1] < 0.6 * errors[0],
            "{variant:?} {errors:?}"
        );
        let mut run = at(model(vec![pendulum(friction)]), 5e-3, variant, 1.2, 0.0);
        let report = run.step(4000).unwrap();
        assert!(report.is_converged());
        assert!(run.v()[0].abs() < 1e-12, "{}", run.v()[0]);
        assert!(run.q().joints[0].sin().abs() <= 0.1 + 1e-9);
        let change = energy(&run) + WEIGHT * 1.2_f64.cos();
        let dissipated = report.energy_dissipated;
        assert!((change + dissipated).abs() < 1e-2, "{dissipated} {change}");
    }
}

/// `ω = ω_0 − τ_f t / I` until it is zero, and stays zero; the angle is `I ω_0² / (2 τ_f)`.
#[test]
fn a_flywheel_slows_down_and_stops() {
    for variant in VARIANTS {
        let mut wheel = solid("wheel", None, JointKind::Revolute);
        wheel.friction = Some(0.01);
        let (inertia, rate, h) = (0.5 * 0.1 * 0.1, 10.0, 1e-3);
        let mut run = at(model(vec![wheel]), h, variant, 0.0, rate);
        run.step(1000).unwrap();
        assert!((run.v()[0] - (rate - 0.01 / inertia)).abs() < 1e-10);
        run.step(5000).unwrap();
        assert!(run.v()[0].abs() < 1e-12, "{}", run.v()[0]);
        let angle = inertia * rate * rate / 0.02;
        assert!((run.q().joints[0] - angle).abs() < rate * h, "{variant:?}");
    }
}

/// A motor shaft of friction τ_f behind a gear of ratio n holds a load up to n τ_f, whether the
/// gear is a coupled joint or a loop.
#[test]
fn a_gear_train_holds_its_load() {
    let ratio = 20.0;
    let friction = 0.1;
    let shaft = || {
        let mut shaft = solid("shaft", None, JointKind::Revolute);
        shaft.friction = Some(friction);
        shaft
    };
    let load = |share: f64| {
        let mut arm = solid("arm", None, JointKind::Revolute);
        arm.centre_of_mass = Some([share * ratio * friction / 9.81, 0.0, 0.0]);
        arm
    };
    for share in [0.999, 1.01] {
        let mut gear = closure("gear", LoopKind::Joint, "shaft", Some("arm"));
        gear.polynomial = Some(vec![0.0, ratio]);
        let looped = Model::from_description(ModelDescription {
            loops: vec![gear],
            ..machine(vec![load(share), shaft()])
        });
        let mut base = solid("base", None, JointKind::Fixed);
        base.mass = 1.0;
        let (mut arm, mut coupled) = (load(share), shaft());
        (arm.parent, coupled.parent) = (Some("base".into()), Some("base".into()));
        coupled.coupled = Some(follows("arm", ratio, 0.0));
        let coupled = model(vec![base, arm, coupled]);
        for variant in VARIANTS {
            for model in [looped.clone().unwrap(), coupled.clone()] {
                let mut run = at(model, 5e-3, variant, 0.0, 0.0);
                assert!(run.step(200).unwrap().is_converged());
                let angle = run.q().joints[0];
                let holds = angle.abs() < 1e-11;
                assert_eq!(holds, share < 1.0, "{variant:?} {share}: {angle}");
            }
        }
    }
}

/// Against a stop, friction and the stop bear the load together: the joint rests.
#[test]
fn a_joint_with_friction_rests_on_its_stop() {
    for variant in VARIANTS {
        let mut bob = pendulum(0.2 * WEIGHT);
        bob.limits = Some(limits(0.7, 1.5));
        let mut run = at(model(vec![bob]), 5e-3, variant, 1.0, 0.0);
        assert!(run.step(600).unwrap().is_converged());
        assert!((run.q().joints[0] - 0.7).abs() < 1e-9 && run.v()[0].abs() < 1e-9);
    }
}

/// On level ground each wheel brakes by `τ_f / R`: `(M + Σ I / R²) a = −Σ τ_f / R`.
#[test]
fn a_rover_that_rolls_is_braked_by_its_bearings() {
    let mut description = ModelDescription::rover();
    let wheels: Vec<String> = description.wheels.iter().map(|w| w.solid.clone()).collect();
    for solid in &mut description.solids {
        if wheels.contains(&solid.name) {
            solid.friction = Some(4.0);
        }
    }
    let model = Arc::new(Model::from_description(description).unwrap());
    let radius = model.wheels()[0].radius;
    let rolling = model.mass() + 6.0 * 0.5 * 30.0;
    let braking = 6.0 * 4.0 / radius / rolling;
    for variant in VARIANTS {
        let q = standing(&model);
        let mut v = vec![0.0; model.nv()];
        v[0] = 0.5;
        for wheel in model.wheels() {
            v[model.joint_velocity(wheel.joint.unwrap())] = -0.5 / radius;
        }
        let mut run = moving(model.clone(), flat(), stepping(variant, 5e-3), q, v);
        let report = run.step(200).unwrap();
        assert!(report.is_converged() && report.fallbacks == 0);
        let expected = 0.5 - braking;
        near_in(&variant, run.v()[0], expected, 1e-3);
        run.step(400).unwrap();
        assert!(largest(run.v()) < 1e-9, "{variant:?}: it parks");
    }
}

#[test]
fn no_friction_is_negative_or_on_a_joint_without_an_axis() {
    let refused = |solid| {
        Model::from_description(machine(vec![solid]))
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        refused(pendulum(-1.0)),
        "solids[0].friction: must not be negative, is -1"
    );
    let mut ball = solid("ball", None, JointKind::Spherical);
    ball.friction = Some(1.0);
    assert_eq!(
        refused(ball),
        "solids[0].friction: a spherical joint has no friction"
    );
}
