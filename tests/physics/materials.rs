//! Friction and restitution by pair of materials.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use crate::shared::{body, flat, model, moving, near, near_in};
use crate::spheres::sphere_scenes::{field, lone_wheel};
use crate::surfaces::surface_scenes::map;
use rover_core::geometry::{Plane, Terrain, Union};
use rover_core::integrator::StepOptions;
use rover_core::law::materials::{MaterialPair, Materials};
use rover_core::multibody::{Configuration, Model};
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

fn pairs(listed: &[(&str, &str, f64, f64)]) -> Materials {
    let pair = |&(a, b, friction_coefficient, restitution): &(&str, &str, f64, f64)| MaterialPair {
        materials: [a.to_owned(), b.to_owned()],
        friction_coefficient,
        restitution,
    };
    Materials::new(listed.iter().map(pair).collect())
}

fn options(materials: Materials) -> StepOptions {
    StepOptions {
        materials,
        ..StepOptions::default()
    }
}

/// A simulation at a place with a velocity; a disc lies flat.
fn flung(
    model: Model,
    terrain: Arc<dyn Terrain>,
    options: StepOptions,
    position: Vector3<f64>,
    v: [f64; 6],
) -> RoverSimulation {
    let mut start = Configuration::zero(&model);
    start.position = position;
    start.attitude = UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
    moving(model, terrain, options, start, v.to_vec())
}

/// A ball of 0.1 m.
fn ball(material: &str) -> Model {
    body(
        2.0,
        &format!("collides = true\n{material}\nshape = {{ kind = \"sphere\", radius = 0.1 }}"),
    )
}

#[test]
fn a_wheel_that_slides_is_slowed_by_the_friction_of_its_pair() {
    let laws = pairs(&[("rock", "wheel", 0.3, 0.0), ("wheel", "ground", 0.6, 0.0)]);
    let rock = map(10, 1.0, |_, _| 0.0).with_material("rock");
    let sand = map(10, 1.0, |_, _| 0.0).with_material("sand");
    let grounds: [(Arc<dyn Terrain>, f64); 4] = [
        (flat(), 0.6),
        (Arc::new(map(10, 1.0, |_, _| 0.0)), 0.6),
        (Arc::new(rock), 0.3),
        // It is not listed.
        (Arc::new(sand), 0.7),
    ];
    for (ground, mu) in grounds {
        let v = [1.5, 0.0, 0.0, 0.0, 0.0, 0.0];
        let options = options(laws.clone());
        let mut wheel = flung(lone_wheel(), ground, options, Vector3::zeros(), v);
        wheel.step(20).unwrap();
        let expected = 1.5 - mu * 9.81 * 0.1;
        let speed = wheel.v()[0];
        assert!((speed - expected).abs() < 1e-9, "{mu}: {speed} {expected}");
    }
}

#[test]
fn a_ball_bounces_by_the_restitution_of_its_pair() {
    let laws = pairs(&[
        ("body", "rock", 0.0, 0.5),
        ("body", "ground", 0.0, 0.8),
        ("rubber", "rock", 0.0, 0.9),
    ]);
    let stone = || -> Arc<dyn Terrain> { Arc::new(field(&[[0.0, -1.0, 0.0, 1.0]])) };
    let sand: Arc<dyn Terrain> = Arc::new(field(&[[0.0, -1.0, 0.0, 1.0]]).with_material("sand"));
    let both = Union::new(vec![
        stone(),
        Arc::new(Plane::new([0.0, 1.0, 0.0], 5.0).unwrap()),
    ]);
    for (material, ground, e) in [
        ("", stone(), 0.5),
        ("", flat(), 0.8),
        ("material = \"rubber\"", stone(), 0.9),
        ("", Arc::new(both.unwrap()) as Arc<dyn Terrain>, 0.5),
        // It is not listed: the restitution of every contact, 0.
        ("", sand, 0.0),
    ] {
        let options = StepOptions {
            gravity: Vector3::zeros(),
            ..options(laws.clone())
        };
        let (place, v) = (Vector3::y() * 0.12, [0.0, -2.0, 0.0, 0.0, 0.0, 0.0]);
        let mut ball = flung(ball(material), ground, options, place, v);
        ball.step(8).unwrap();
        let rebound = ball.v()[1];
        near_in(&(material, e), rebound, 2.0 * e, 1e-9);
    }
}

#[test]
fn two_bodies_meet_by_the_law_of_their_materials() {
    let two = model(
        "name = \"balls\"\n[[solids]]\nname = \"a\"\nmass = 2.0\ncollides = true\n\
         shape = { kind = \"sphere\", radius = 0.1 }\n[[solids]]\nname = \"b\"\njoint = \"free\"\n\
         mass = 2.0\n\
         shapes = [{ kind = \"sphere\", radius = 0.1, collides = true, material = \"steel\" }]\n",
    );
    let options = StepOptions {
        gravity: Vector3::zeros(),
        ..options(pairs(&[("steel", "body", 0.0, 0.6)]))
    };
    let mut start = Configuration::zero(&two);
    start.position.y = 3.0;
    start.others[0].position = Vector3::new(0.21, 3.0, 0.0);
    let mut v = vec![0.0; 12];
    v[0] = 1.0;
    let mut balls = moving(two, flat(), options, start, v);
    balls.step(10).unwrap();
    let (a, b) = (balls.v()[0], balls.v()[6]);
    near(b - a, 0.6, 1e-9);
    near(a + b, 1.0, 1e-9);
}
