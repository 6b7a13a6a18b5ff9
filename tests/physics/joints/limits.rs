//! Joints at their stops.

use std::sync::Arc;

use nalgebra::Vector3;
use rover_core::contact::{ContactKey, Side};
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Configuration, JointKind, ModelDescription, Shape, SolidDescription};
use rover_core::simulation::RoverSimulation;

use super::machines::{energy, model, simulation, solid};
use crate::shared::{VARIANTS, flat, limits, near, resting, stepping};

const G: f64 = 9.81;
const LENGTH: f64 = 0.8;
/// Inertia of the pendulum about its axis, kg m².
const INERTIA: f64 = LENGTH * LENGTH + 0.5 * 0.1 * 0.1;

/// A pendulum with a bob of 1 kg, hanging at zero.
fn pendulum(lower: f64, upper: f64) -> SolidDescription {
    let mut bob = solid("bob", None, JointKind::Revolute);
    bob.centre_of_mass = Some([0.0, -LENGTH, 0.0]);
    bob.limits = Some(limits(lower, upper));
    bob
}

fn start(run: &mut RoverSimulation, joints: &[f64], v: &[f64]) {
    let mut q = Configuration::zero(run.model());
    q.joints.copy_from_slice(joints);
    run.set_state(q, v.to_vec());
}

/// Impulse of a joint's stop over the last step divided by the step size, N m or N.
fn reaction(run: &RoverSimulation, joint: usize, side: Side) -> f64 {
    let key = ContactKey::at_limit(joint, side);
    let found = run.contacts().iter().find(|a| a.contact.key == key);
    found.map_or(0.0, |active| active.impulse[0]) / run.options().time_step
}

/// `½ I ω² = m g l (cos a − cos b)` down to the stop, `ω⁺ = −e ω⁻` at the stop, and a rebound to
/// the angle of `e²` times that energy.
#[test]
fn a_pendulum_bounces_off_its_stop() {
    for variant in VARIANTS {
        for (lower, upper, from) in [(-0.2, 2.0, 1.2_f64), (-2.0, 0.2, -1.2)] {
            let h = 2e-4;
            let options = StepOptions {
                restitution: 0.5,
                ..stepping(variant, h)
            };
            let mut run = simulation(model(vec![pendulum(lower, upper)]), options);
            start(&mut run, &[from], &[0.0]);
            let mut bounce = None;
            let mut highest = 0.0_f64;
            for _ in 0..10_000 {
                let before = run.v()[0];
                run.step(1).unwrap();
                let (q, v) = (run.q().joints[0], run.v()[0]);
                let beyond = (lower - q).max(q - upper);
                assert!(beyond <= h * before.abs(), "{variant:?} {beyond}");
                if bounce.is_none() && v * before < 0.0 {
                    bounce = Some((before, v));
                }
                if bounce.is_some() {
                    highest = highest.max(q * from.signum());
                    if v * from < 0.0 {
                        break;
                    }
                }
            }
            let (before, after) = bounce.unwrap();
            assert!((after + 0.5 * before).abs() < 1e-9, "{before} {after}");
            let fall = G * LENGTH * (0.2_f64.cos() - 1.2_f64.cos());
            let rate = (2.0 * fall / INERTIA).sqrt();
            assert!((before.abs() - rate).abs() < 2e-3 * rate, "{before} {rate}");
            let top = (0.2_f64.cos() - 0.25 * fall / (G * LENGTH)).acos();
            assert!((highest - top).abs() < 2e-3, "{variant:?} {highest} {top}");
        }
    }
}

/// A pendulum at rest on its stop at an angle a exerts the torque `m g l sin a`.
#[test]
fn a_pendulum_rests_on_its_stop() {
    for variant in VARIANTS {
        let mut run = simulation(model(vec![pendulum(0.3, 1.5)]), stepping(variant, 5e-3));
        start(&mut run, &[0.8], &[0.0]);
        run.step(400).unwrap();
        let (q, v) = (run.q().joints[0], run.v()[0]);
        assert!((q - 0.3).abs() < 1e-7 && v.abs() < 1e-9, "{q} {v}");
        let torque = reaction(&run, 0, Side::Lower);
        let expected = G * LENGTH * 0.3_f64.sin();
        assert!((torque - expected).abs() < 1e-6, "{torque} {expected}");
        let [active] = run.contacts() else {
            panic!("one stop, no more");
        };
        assert!(active.impulse[1..] == [0.0; 2] && active.velocity[1..] == [0.0; 2]);
        let n = Vector3::from(active.contact.frame.rows()[0]);
        assert!((n - Vector3::z()).norm() < 1e-15, "{n}");
    }
}

/// With a forecast over the whole step the joint does not overshoot its stop.
#[test]
fn a_stop_that_is_foreseen_is_never_passed() {
    for variant in VARIANTS {
        let options = StepOptions {
            forecast: 1.0,
            ..stepping(variant, 5e-3)
        };
        let depth = 1e-8; // of a machine of a metre
        let mut run = simulation(model(vec![pendulum(-0.2, 0.9)]), options);
        start(&mut run, &[0.8], &[2.0]);
        let mut reached = [false; 2];
        for _ in 0..400 {
            run.step(1).unwrap();
            let q = run.q().joints[0];
            assert!((-0.2 - depth..=0.9 + depth).contains(&q), "{variant:?} {q}");
            let sides = [Side::Lower, Side::Upper];
            for (reached, side) in reached.iter_mut().zip(sides) {
                *reached |= reaction(&run, 0, side) > 0.0;
            }
        }
        assert_eq!(reached, [true; 2]);
    }
}

/// A prismatic joint on its stop carries the weight of everything below it.
#[test]
fn a_slide_rests_on_its_stop() {
    for variant in VARIANTS {
        for (up, side) in [(1.0, Side::Lower), (-1.0, Side::Upper)] {
            let mut slide = solid("slide", None, JointKind::Prismatic);
            slide.axis = Some([0.0, up, 0.0]);
            slide.limits = Some(limits(-0.3, 0.3));
            let mut load = solid("load", Some("slide"), JointKind::Revolute);
            load.centre_of_mass = Some([0.0, -0.4, 0.0]);
            load.mass = 3.0;
            let mut run = simulation(model(vec![slide, load]), stepping(variant, 2e-3));
            run.step(500).unwrap();
            let force = reaction(&run, 0, side);
            assert!((force - 4.0 * G).abs() < 1e-6, "{variant:?} {force}");
            let q = run.q().joints[0];
            assert!((q + 0.3 * up).abs() < 1e-7, "{q}");
        }
    }
}

/// Two links that strike their stops successively and simultaneously.
#[test]
fn stops_give_no_energy() {
    for variant in VARIANTS {
        for restitution in [0.0, 0.5, 1.0] {
            let upper = pendulum(-0.2, 0.3);
            let mut lower = pendulum(-0.1, 0.15);
            lower.name = "lower".into();
            lower.parent = Some("bob".into());
            lower.position = Some([0.0, -LENGTH, 0.0]);
            let options = StepOptions {
                restitution,
                ..stepping(variant, 2e-3)
            };
            let mut run = simulation(model(vec![upper, lower]), options);
            start(&mut run, &[0.2, 0.0], &[-2.0, 3.0]);
            let mut least = energy(&run);
            let scale = least.abs();
            let mut struck = 0;
            for _ in 0..1500 {
                run.step(1).unwrap();
                struck += run.contacts().len();
                let now = energy(&run);
                assert!(
                    now < least + 1e-6 * scale,
                    "{variant:?} {restitution}: {now} {least}"
                );
                least = least.min(now);
            }
            assert!(struck >= 10, "{variant:?} {restitution}: {struck}");
        }
    }
}

/// A stop acts between two bodies. In free flight it conserves momentum and, with e = 1, energy
/// except for what the energy audit removes at an impact.
#[test]
fn a_stop_keeps_the_momenta() {
    let body = solid("body", None, JointKind::Free);
    let mut arm = pendulum(-0.1, 0.2);
    arm.parent = Some("body".into());
    arm.position = Some([0.1, 0.2, -0.1]);
    let options = StepOptions {
        gravity: Vector3::zeros(),
        restitution: 1.0,
        ..stepping(Variant::Newton, 1e-3)
    };
    let mut run = simulation(model(vec![body, arm]), options);
    start(&mut run, &[0.0], &[0.1, 0.2, -0.1, 0.3, 0.2, -0.4, 3.0]);
    let (before, momentum) = (energy(&run), run.momentum());
    let mut struck = 0;
    for _ in 0..500 {
        run.step(1).unwrap();
        struck += run.contacts().len();
        let now = run.momentum();
        assert!((now.linear - momentum.linear).norm() < 1e-5);
        assert!((now.angular - momentum.angular).norm() < 1e-5);
    }
    assert!(struck > 2, "{struck}");
    assert!((energy(&run) - before).abs() < 1e-5 * before);
}

/// A body on two front feet and an arm: moments about the front feet require `F · 0.9 = 10 g · 0.4
/// + g · 0.9`, and the stop carries `(F − g) · 0.5`.
#[test]
fn a_stop_carries_what_the_ground_presses() {
    let foot = |name: &str, joint| {
        let mut foot = solid(name, Some("body"), joint);
        foot.shape = Some(Shape::Sphere { radius: 0.1 });
        foot.collides = true;
        foot
    };
    let mut body = solid("body", None, JointKind::Free);
    body.mass = 10.0;
    body.shape = Some(Shape::Box {
        size: [1.0, 0.2, 0.6],
    });
    let mut solids = vec![body];
    for (name, z) in [("left", -0.3), ("right", 0.3)] {
        let mut front = foot(name, JointKind::Fixed);
        front.position = Some([0.4, -0.2, z]);
        solids.push(front);
    }
    let mut arm = foot("arm", JointKind::Revolute);
    arm.centre_of_mass = Some([-0.5, -0.2, 0.0]);
    arm.limits = Some(limits(0.0, 1.0));
    solids.push(arm);
    let model = Arc::new(model(solids));
    for variant in VARIANTS {
        let options = StepOptions {
            friction_coefficient: 0.0,
            ..stepping(variant, 5e-3)
        };
        let mut run = resting(model.clone(), flat(), options, |q| q.position.y = 0.3);
        run.step(400).unwrap();
        assert_eq!(run.contacts().len(), 4);
        let weight = 13.0 * G;
        assert!((run.body_force() - weight).abs() < 1e-5 * weight);
        let torque = reaction(&run, 0, Side::Lower);
        let expected = 4.0 * G / 0.9 * 0.5;
        near(torque, expected, 1e-4 * expected);
        // Bitwise identical from a snapshot, whose contacts include the stop.
        let snapshot = run.snapshot();
        run.step(5).unwrap();
        let end = run.state().clone();
        run.restore(&snapshot).unwrap();
        run.step(5).unwrap();
        assert_eq!(run.state(), &end);
    }
}

/// The projection returns a joint that starts beyond its stop, without adding to its rate.
#[test]
fn a_joint_beyond_its_stop_is_put_back() {
    for variant in VARIANTS {
        for gravity in [0.0, -G] {
            let options = StepOptions {
                gravity: Vector3::new(0.0, gravity, 0.0),
                ..stepping(variant, 5e-3)
            };
            let mut run = simulation(model(vec![pendulum(-1.0, 0.5)]), options);
            start(&mut run, &[0.6], &[0.0]);
            let before = energy(&run);
            run.step(1).unwrap();
            let (q, v) = (run.q().joints[0], run.v()[0]);
            assert!(q <= 0.5 + 1e-8, "{variant:?} {q}");
            // No more than gravity adds in one step.
            assert!(v.abs() <= -gravity * 5e-3 / LENGTH, "{v}");
            assert!(energy(&run) <= before + 1e-12);
        }
    }
}

#[test]
fn limits_survive_both_formats_and_a_lock() {
    let free = model(vec![pendulum(-0.5, 0.7)]);
    let description = free.description();
    let toml = description.to_toml().unwrap();
    assert_eq!(&ModelDescription::from_toml(&toml).unwrap(), description);
    let json = description.to_json().unwrap();
    assert_eq!(&ModelDescription::from_json(&json).unwrap(), description);
    assert_eq!(free.limited_joints(), [0]);
    let locked = free.with_locked_joints(&[("bob".into(), 0.1)]).unwrap();
    assert!(locked.limited_joints().is_empty());
}
