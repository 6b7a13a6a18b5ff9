//! Bodies with several shapes at rest on flat ground, against statics.

use rover_core::contact::Part;
use rover_core::integrator::Variant;
use rover_core::multibody::Model;
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

use crate::shared::{VARIANTS, body, flat, near_in, resting, stepping};

const GRAVITY: f64 = 9.81;

/// Dropped from a height (m) at an angle about z (rad) and simulated for three seconds.
fn settled(model: Model, height: f64, angle: f64, variant: Variant) -> RoverSimulation {
    let mut simulation = resting(model, flat(), stepping(variant, 0.005), |q| {
        q.position.y = height;
        q.attitude = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
    });
    assert!(simulation.step(600).unwrap().is_converged());
    let energy = simulation.energy();
    assert!(energy.kinetic < 1e-6, "{energy:?}");
    simulation
}

/// Ground reaction on a part, N.
fn force(simulation: &RoverSimulation, part: Part) -> f64 {
    let contacts = simulation.contacts().iter();
    let own = contacts.filter(|a| a.contact.part == part);
    own.map(|a| a.impulse[0] / 0.005).sum()
}

#[test]
fn each_ball_of_a_dumbbell_bears_what_it_weighs() {
    for variant in VARIANTS {
        let model = body(
            4.0,
            "shapes = [
            { kind = 'sphere', radius = 0.1, mass = 3.0, collides = true },
            { kind = 'sphere', radius = 0.05, mass = 1.0, position = [0.5, -0.05, 0.0], collides = true }]",
        );
        let simulation = settled(model, 0.15, 0.1, variant);
        for (part, mass) in [(Part::Sphere(0), 3.0), (Part::Sphere(1), 1.0)] {
            let force = force(&simulation, part);
            assert!((force - mass * GRAVITY).abs() < 1e-3, "{part:?}: {force}");
        }
        let kinematics = simulation.kinematics();
        for ball in simulation.model().spheres() {
            let place = kinematics.point(ball.body, &ball.centre) + kinematics.origin(ball.body);
            // A gap that closes within a step is not corrected: less than g h² = 0.2 mm.
            assert!((place.y - ball.radius).abs() < 1e-4, "{place}");
        }
    }
}

/// Foot and column of 0.1 m width: the position of the mass centre determines the load on the heel.
#[test]
fn an_l_stands_on_its_foot() {
    for variant in VARIANTS {
        let model = body(
            4.2,
            "shapes = [
            { kind = 'box', size = [0.6, 0.1, 0.3], position = [0.3, 0.05, 0.0], collides = true },
            { kind = 'box', size = [0.1, 0.8, 0.3], position = [0.05, 0.5, 0.0], collides = true }]",
        );
        // By volume the foot has 1.8 kg and the column 2.4 kg.
        let toe = (1.8 * 0.3 + 2.4 * 0.05) * GRAVITY / 0.6;
        let simulation = settled(model, 0.01, 0.0, variant);
        let of_toe: f64 = (simulation.contacts().iter())
            .filter(|a| a.position[0] > 0.3)
            .map(|a| a.impulse[0] / 0.005)
            .sum();
        assert!((of_toe - toe).abs() < 1e-3, "{of_toe}, not {toe}");
        let whole = force(&simulation, Part::Box(0));
        assert!((whole - 4.2 * GRAVITY).abs() < 1e-3, "{whole}");
        let heel = &simulation.q().position;
        assert!(heel.y.abs() < 1e-5, "{heel}");
    }
}

/// The inverted L has its mass centre beyond its foot: it tips over and lies on both boxes.
#[test]
fn an_l_that_stands_on_its_column_tips_over() {
    for variant in VARIANTS {
        let model = body(
            4.2,
            "shapes = [
            { kind = 'box', size = [0.1, 0.8, 0.3], position = [0.05, 0.4, 0.0], collides = true },
            { kind = 'box', size = [0.6, 0.1, 0.3], position = [0.4, 0.75, 0.0], collides = true }]",
        );
        // It lies on the line from the column's corner (0.1, 0) to the
        // arm's (0.7, 0.7), the mass centre at (0.2, 0.55).
        let share = (0.1 * 0.6 + 0.55 * 0.7) / (0.6 * 0.6 + 0.7 * 0.7);
        let weight = 4.2 * GRAVITY;
        let simulation = settled(model, 0.0, 0.0, variant);
        for (part, expected) in [
            (Part::Box(0), (1.0 - share) * weight),
            (Part::Box(1), share * weight),
        ] {
            let force = force(&simulation, part);
            near_in(&part, force, expected, 1e-3);
        }
    }
}
