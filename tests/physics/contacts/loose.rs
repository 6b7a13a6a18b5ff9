//! Free bodies: colliding balls, stacked and pushed stones, colliding machines.

use rover_core::contact::{ContactKey, Part, generalized_impulse};
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Configuration, JointKind, Kinematics, Model, ModelDescription};
use rover_core::nalgebra::{UnitQuaternion, Vector3};

use super::contact_scenes::{nearby, overlap};
use crate::shared::{
    VARIANTS, flat, largest, model, moving, near, nothing, step_without_gain, stepping,
};

const BALL: &str = "shape = { kind = \"sphere\", radius = 0.1 }";
const BLOCK: &str = "shape = { kind = \"box\", size = [0.4, 0.2, 0.3] }";

/// Free solids that collide.
fn loose(shapes: &[(&str, f64)]) -> Model {
    let solids = shapes.iter().enumerate().map(|(i, (shape, mass))| {
        format!("[[solids]]\nname = \"stone{i}\"\njoint = \"free\"\nmass = {mass}\ncollides = true\n{shape}\n")
    });
    model(&format!(
        "name = \"stones\"\n{}",
        solids.collect::<String>()
    ))
}

/// Configuration of the free bodies, in order.
fn at(model: &Model, places: &[([f64; 3], [f64; 3])]) -> Configuration {
    let mut q = Configuration::zero(model);
    for (i, (x, turn)) in places.iter().enumerate() {
        let attitude = UnitQuaternion::from_euler_angles(turn[0], turn[1], turn[2]);
        if i == 0 {
            (q.position, q.attitude) = ((*x).into(), attitude);
        } else {
            (q.others[i - 1].position, q.others[i - 1].attitude) = ((*x).into(), attitude);
        }
    }
    q
}

fn weightless(variant: Variant) -> StepOptions {
    StepOptions {
        gravity: Vector3::zeros(),
        variant,
        ..StepOptions::default()
    }
}

#[test]
fn balls_collide_by_the_closed_form() {
    for variant in VARIANTS {
        for (restitution, m1, m2) in [(0.0, 1.0, 1.0), (0.5, 1.0, 3.0), (1.0, 2.0, 1.0)] {
            let model = loose(&[(BALL, m1), (BALL, m2)]);
            let q = at(&model, &[([0.0; 3], [0.0; 3]), ([0.5, 0.0, 0.0], [0.0; 3])]);
            let mut v = vec![0.0; 12];
            (v[0], v[6]) = (1.0, -0.5);
            let options = StepOptions {
                restitution,
                ..weightless(variant)
            };
            let mut simulation = moving(model, nothing(), options, q, v);
            assert!(simulation.step(100).unwrap().is_converged());
            // Momentum is conserved, and the balls separate e times as fast as they approached.
            let common = (m1 - 0.5 * m2) / (m1 + m2);
            let apart = 1.5 * restitution / (m1 + m2);
            let v = simulation.v();
            assert!((v[0] - (common - m2 * apart)).abs() < 1e-9, "{v:?}");
            assert!((v[6] - (common + m1 * apart)).abs() < 1e-9, "{v:?}");
        }
    }
}

#[test]
fn an_impulse_between_two_bodies_is_no_force_and_no_couple_on_both_together() {
    for shapes in [[BLOCK, BLOCK], [BLOCK, BALL], [BALL, BALL]] {
        let model = loose(&[(shapes[0], 2.0), (shapes[1], 3.0)]);
        let places = [
            ([5.0, 1.0, -3.0], [0.3, 0.1, 0.2]),
            ([5.3, 1.2, -2.9], [0.1, 0.5, -0.2]),
        ];
        let q = at(&model, &places);
        let kinematics = Kinematics::of(&model, &q);
        let contacts = nearby(&model, &kinematics);
        assert!(!contacts.is_empty(), "{shapes:?}");
        for contact in contacts {
            // A nonzero gap, and friction across it.
            let mut push = vec![0.0; 12];
            generalized_impulse(
                &model,
                kinematics.poses(),
                &[contact],
                &[1.0, 0.7, -0.4],
                &mut push,
            );
            let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
            for (body, push) in push.chunks_exact(6).enumerate() {
                let own = Vector3::new(push[0], push[1], push[2]);
                force += own;
                moment += Vector3::new(push[3], push[4], push[5]);
                moment += kinematics.origin(body).cross(&own);
            }
            assert!(force.norm() == 0.0, "{force}");
            assert!(moment.norm() < 1e-14, "{moment}");
        }
    }
}

/// The story: half the features of two boxes looked like those on a surface. The next step knew
/// such a contact as one with the ground, and the boxes were judged apart while they collided.
#[test]
fn the_next_step_knows_both_sides_of_a_contact_between_bodies() {
    for feature in 0..1 << 15 {
        let key = ContactKey::between(Part::Box(0), feature, Part::Box(1));
        assert_eq!(key.lasting(), key, "{feature}");
    }
    let key = ContactKey::on_ground(Part::Wheel(0), 0, 3).on_surface();
    assert_ne!(key.lasting(), key);
}

#[test]
fn a_collision_keeps_the_momentum_and_takes_energy() {
    for variant in VARIANTS {
        for shapes in [[BLOCK, BLOCK], [BLOCK, BALL], [BALL, BALL]] {
            let model = loose(&[(shapes[0], 2.0), (shapes[1], 3.0)]);
            let q = at(
                &model,
                &[
                    ([5.0, 1.0, -3.0], [0.3, 0.1, 0.2]),
                    ([5.5, 1.05, -2.95], [0.1, 0.5, -0.2]),
                ],
            );
            let mut v = vec![0.0; 12];
            v[..4].copy_from_slice(&[1.0, 0.1, 0.2, 0.5]);
            v[6..10].copy_from_slice(&[-1.0, 0.0, 0.1, -0.3]);
            let mut simulation = moving(model, nothing(), weightless(variant), q, v);
            let mut has_touched = false;
            for _ in 0..200 {
                let (before, energy) = (simulation.momentum(), simulation.energy().kinetic);
                simulation.step(1).unwrap();
                has_touched |= !simulation.contacts().is_empty();
                let after = simulation.momentum();
                let linear = (after.linear - before.linear).norm();
                assert!(linear < 1e-9, "{shapes:?} {linear}");
                let angular = (after.angular - before.angular).norm();
                // The impulse acts at the predicted end of the step, displaced from the true one by
                // half a step of relative sliding.
                assert!(angular < 5e-3, "{shapes:?} {variant:?}: {angular}");
                assert!(simulation.energy().kinetic <= energy * (1.0 + 1e-8));
            }
            assert!(has_touched, "{shapes:?}");
        }
    }
}

#[test]
fn a_stack_of_blocks_stands() {
    for variant in VARIANTS {
        let model = loose(&[(BLOCK, 5.0), (BLOCK, 3.0), (BLOCK, 1.0)]);
        let q = at(
            &model,
            &[
                ([0.0, 0.101, 0.0], [0.0; 3]),
                ([0.03, 0.303, 0.02], [0.0, 0.4, 0.0]),
                ([-0.02, 0.505, 0.0], [0.0, -0.2, 0.0]),
            ],
        );
        let v = vec![0.0; 18];
        let mut simulation = moving(model, flat(), stepping(variant, 0.005), q, v);
        simulation.step(400).unwrap();
        let (q, v) = (simulation.q(), simulation.v());
        assert!(largest(v) < 1e-6, "{v:?}");
        near(q.position.y, 0.1, 1e-6);
        near(q.others[0].position.y, 0.3, 1e-6);
        near(q.others[1].position.y, 0.5, 1e-6);
        assert!(overlap(&simulation) > -1e-7);
    }
}

/// The rover's description under other names.
fn rover(prefix: &str) -> ModelDescription {
    let mut rover = ModelDescription::rover();
    for solid in &mut rover.solids {
        solid.name.insert_str(0, prefix);
        if let Some(parent) = &mut solid.parent {
            parent.insert_str(0, prefix);
        }
    }
    for wheel in &mut rover.wheels {
        wheel.name.insert_str(0, prefix);
        wheel.solid.insert_str(0, prefix);
        if let Some(steering) = &mut wheel.steering {
            steering.insert_str(0, prefix);
        }
    }
    rover.solids[0].joint = Some(JointKind::Free);
    rover.tags.clear();
    rover
}

#[test]
fn a_rover_pushes_a_stone_which_comes_to_rest() {
    for shape in [
        "shape = { kind = \"sphere\", radius = 0.15 }",
        "shape = { kind = \"box\", size = [0.3, 0.3, 0.3] }",
    ] {
        let mut both = rover("");
        let stone = loose(&[(shape, 8.0)]).description().solids[0].clone();
        both.solids.push(stone);
        let model = Model::from_description(both).unwrap();
        let q = at(
            &model,
            &[([0.0, 0.35, 0.0], [0.0; 3]), ([1.1, 0.15, -0.5], [0.0; 3])],
        );
        let v = vec![0.0; model.nv()];
        let mut simulation = moving(model, flat(), StepOptions::default(), q, v);
        simulation.set_wheel_torques(&[15.0; 6]).unwrap();
        simulation.step(400).unwrap();
        let x = simulation.q().others[0].position.x;
        assert!(x > 1.3, "{shape}: {x}");
        assert!(overlap(&simulation) > -2e-3, "{shape}");
        simulation.set_wheel_torques(&[0.0; 6]).unwrap();
        simulation.brake();
        simulation.step(800).unwrap();
        let stone = &simulation.v()[21..];
        // A ball rolls until a contact stops it; a block comes to rest.
        if shape.contains("box") {
            assert!(stone.iter().all(|x| x.abs() < 1e-5), "{shape}: {stone:?}");
        }
        let height = simulation.q().others[0].position.y;
        assert!((height - 0.15).abs() < 0.01, "{shape}: {height}");
    }
}

#[test]
fn two_rovers_drive_into_each_other_and_neither_passes() {
    for variant in VARIANTS {
        let mut both = rover("a_");
        let other = rover("b_");
        both.solids.extend(other.solids);
        both.wheels.extend(other.wheels);
        let model = Model::from_description(both).unwrap();
        let about = std::f64::consts::PI;
        let q = at(
            &model,
            &[
                ([0.0, 0.35, 0.0], [0.0; 3]),
                ([2.2, 0.35, 0.1], [0.0, about, 0.0]),
            ],
        );
        let mut v = vec![0.0; model.nv()];
        (v[0], v[21]) = (1.0, -1.0);
        let mut simulation = moving(model, flat(), stepping(variant, 0.005), q, v);
        let mut met = 0;
        for _ in 0..300 {
            let kinetic = simulation.energy().kinetic;
            step_without_gain(&mut simulation, 1e-6 * kinetic.max(1.0));
            let between = simulation.contacts().iter();
            met += between.filter(|a| a.contact.other.is_some()).count();
            let q = simulation.q();
            assert!(q.others[0].position.x - q.position.x > 1.2);
        }
        assert!(met > 0);
    }
}
