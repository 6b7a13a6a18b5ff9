//! Scenes in which methods fail: everything stays finite, gains no energy and falls through
//! nothing.

use std::f64::consts::PI;

use rover_core::geometry::Plane;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Model, ModelDescription, coordinates};
use rover_core::simulation::RoverSimulation;

use super::scenes::{VARIANTS, at_rest, count, simulation};
use crate::shared::{flat, joints, largest, near_in, resting, stepping};

fn dropped(
    model: Model,
    options: StepOptions,
    height: f64,
    [roll, heading, pitch]: [f64; 3],
) -> RoverSimulation {
    let mut q = [0.0; 21];
    (q[1], q[3], q[4], q[5]) = (height, roll, heading, pitch);
    let mut dropped = simulation(model, Plane::ground(), options, &q, &[0.0; 21]);
    // Free wheels would keep the speed that an impact gives them.
    dropped.brake();
    dropped
}

/// Steps for some seconds; the energy never exceeds its initial value, and nothing stays sunk in
/// the ground.
fn settle(
    mut simulation: RoverSimulation,
    seconds: f64,
    allowed: f64,
    label: &str,
) -> RoverSimulation {
    let h = simulation.options().time_step;
    let before = simulation.energy().total();
    let mut fastest_fall = 0.0_f64;
    for _ in 0..count(seconds, h) {
        simulation.step(1).unwrap();
        let energy = simulation.energy().total();
        assert!(
            energy <= before + allowed,
            "{label}: {energy} J from {before} at {} s",
            simulation.time()
        );
        fastest_fall = fastest_fall.max(-simulation.v()[1]);
        let deepest = simulation
            .wheel_contacts()
            .iter()
            .fold(0.0_f64, |m, c| m.min(c.gap));
        // A wheel moves by at most its speed times the step in the step that it lands in.
        assert!(
            deepest > -(fastest_fall + 12.0) * h - 1e-3,
            "{label}: {deepest} m"
        );
    }
    simulation
}

#[test]
fn drops_from_two_metres_land_on_the_wheels() {
    for variant in VARIANTS {
        for h in [0.001, 0.005, 0.02, 0.05] {
            let options = stepping(variant, h);
            let start = dropped(Model::rover(), options, 2.35, [0.0; 3]);
            let landed = settle(start, 6.0, 1e-6, "2 m drop");
            let height = landed.q().position.y;
            near_in(&(variant, h), height, 0.35, 1e-6);
            let fastest = largest(landed.v());
            assert!(fastest < 1e-6, "{variant:?}, {h}: {fastest}");
        }
    }
}

/// Wheels that spin up and are steered against each other: at 20 ms Newton's iteration diverged
/// after 3.56 s until the mass matrix was NaN, and the step failed where the scheme should have
/// fallen back to the linearised step.
#[test]
fn an_iterate_that_runs_away_is_reported_and_the_step_is_taken() {
    let options = stepping(Variant::Newton, 0.02);
    let model = Model::rover().with_motors(None).unwrap();
    let mut spun = resting(model, flat(), options, |q| q.position.y = 0.35);
    spun.set_steering(&[0.22, 0.44, -0.33, 0.47, 0.45, -0.58])
        .unwrap();
    let mut n_unsettled = 0;
    for step in 0..181 {
        let torque = if step < 170 { 120.0 } else { -120.0 };
        spun.set_wheel_torques(&[torque; 6]).unwrap();
        let report = spun.step(1).unwrap();
        n_unsettled += report.retaken;
        assert!(spun.v().iter().all(|v| v.is_finite()));
    }
    assert!(n_unsettled > 0, "the scene no longer shows what it is for");
}

#[test]
fn upside_down_it_comes_to_rest_on_its_trunk() {
    for variant in VARIANTS {
        for h in [0.005, 0.02, 0.05] {
            let options = stepping(variant, h);
            let start = dropped(Model::rover(), options, 1.5, [PI, 0.0, 0.0]);
            let landed = settle(start, 6.0, 1e-6, "upside down");
            let height = landed.q().position.y;
            near_in(&(variant, h), height, 0.2, 1e-3);
            let up = landed.q().attitude * nalgebra::Vector3::y();
            assert!(up.y < -0.999, "{variant:?}, {h}: {up:?}");
        }
    }
}

#[test]
fn rolling_over_and_nose_dives_stay_finite_and_lose_energy() {
    for variant in VARIANTS {
        for h in [0.005, 0.02, 0.05] {
            for angles in [
                [1.3, 0.0, 0.0],
                [0.4, 2.0, -1.4],
                [0.0, 0.0, PI / 2.0],
                [-2.0, 1.0, 0.7],
            ] {
                let options = stepping(variant, h);
                let start = dropped(Model::rover(), options, 1.6, angles);
                let scene = format!("{variant:?}, h = {h}, {angles:?}");
                let end = settle(start, 4.0, 1e-6, &scene);
                assert!(end.q().position.y > 0.05);
            }
        }
    }
}

#[test]
fn a_wheel_lying_flat_carries_the_rover_without_a_jump() {
    // On its side the rover stands on the faces of three wheels (and a
    // corner of the trunk as it settles).
    let options = StepOptions::default();
    let start = dropped(Model::rover(), options, 0.75, [PI / 2.0, 0.0, 0.0]);
    let mut end = settle(start, 6.0, 1e-6, "on its side");
    let before = end.q().position;
    end.step(1000).unwrap();
    assert!((end.q().position - before).norm() < 1e-6);
}

#[test]
fn mass_ratios_of_a_hundred_thousand_rest() {
    for variant in VARIANTS {
        for h in [0.005, 0.05] {
            for (part, mass) in [("wheel", 6e-3), ("trunk", 3e6)] {
                let mut description = ModelDescription::rover();
                for solid in description
                    .solids
                    .iter_mut()
                    .filter(|s| s.name.starts_with(part))
                {
                    solid.mass = mass;
                }
                let model = Model::from_description(description).unwrap();
                let options = stepping(variant, h);
                let start = dropped(model, options, 0.5, [0.0; 3]);
                let rest = settle(start, 3.0, 1e-6 * mass.max(1.0), part);
                let scene = (part, variant, h);
                assert!(largest(rest.v()) < 1e-6, "{scene:?}");
                near_in(&scene, rest.q().position.y, 0.35, 1e-6);
            }
        }
    }
}

#[test]
fn turning_through_a_full_circle_is_smooth() {
    // The report's coordinates are singular at a heading of 90 degrees; ours must not be affected.
    for variant in VARIANTS {
        let mut simulation = at_rest(stepping(variant, 0.005));
        simulation
            .set_steering(&[-0.4, -0.4, 0.0, 0.4, 0.0, 0.4])
            .unwrap();
        simulation.set_wheel_torques(&[8.0; 6]).unwrap();
        simulation.step(200).unwrap();
        let mut turned = 0.0_f64;
        let heading = |s: &RoverSimulation| coordinates::to_public(s.model(), s.q())[4];
        let (mut last, mut rate) = (heading(&simulation), simulation.v()[4]);
        let mut steps = 0;
        while turned.abs() < 2.0 * PI {
            let torque = if simulation.v()[4].abs() > 0.6 {
                0.0
            } else {
                8.0
            };
            simulation.set_wheel_torques(&[torque; 6]).unwrap();
            assert!(simulation.step(10).unwrap().is_converged());
            let now = heading(&simulation);
            turned += (now - last + PI).rem_euclid(2.0 * PI) - PI;
            let change = (simulation.v()[4] - rate).abs();
            assert!(
                change < 0.1,
                "{variant:?}: the turn rate jumps by {change} rad/s at heading {now}"
            );
            (last, rate) = (now, simulation.v()[4]);
            steps += 1;
            assert!(steps < 4000, "{variant:?}: turned only {turned} rad");
        }
    }
}

#[test]
fn no_gain_and_no_step_make_a_held_joint_unstable() {
    for (stiffness, damping) in [(1e2, 0.0), (1e9, 0.0), (0.0, 1e9), (1e9, 1e9), (1e12, 1e6)] {
        for h in [0.001, 0.05] {
            let mut simulation = at_rest(stepping(Variant::default(), h));
            let joints = joints(&simulation);
            simulation
                .hold(&joints, Some(&[0.05; 15]), Some(stiffness), Some(damping))
                .unwrap();
            simulation.step(200).unwrap();
            let fastest = largest(simulation.v());
            assert!(
                fastest < 200.0,
                "K_p {stiffness}, K_d {damping}, h {h}: {fastest} rad/s"
            );
        }
    }
}
