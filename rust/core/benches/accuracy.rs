//! The figures of `docs/accuracy.md`: drive, section 6.1, parking, sliding,
//! energy in flight and in elastic tumbling.
//!
//! Run: `cargo bench -p rover-core --bench accuracy` (a minute). It only reports;
//! `tests/physics/rover/` holds the bounds. The drive is the one on which three other engines agree
//! at a fine step: 12.585 m along and 18.770 m across the start heading after 10 s. Cost is the
//! time of one thread per simulated second.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // prints; stops at an impossible scene

#[allow(dead_code)] // what the tests share beyond this
#[path = "../../../tests/physics/rover/scenes.rs"]
mod scenes;

use std::time::Instant;

use nalgebra::Vector3;
use rover_core::geometry::Plane;
use rover_core::integrator::{Stabilisation, StepOptions};
use rover_core::multibody::Model;
use scenes::{
    VARIANTS, at_rest, check_drive, count, golden, numbers, on_slope, report_scene, simulation,
};

fn drives() {
    println!("flat drive: final position error (cm), cost (ms per simulated second)");
    for variant in VARIANTS {
        for h in [0.05, 0.02, 0.01, 0.005, 0.002, 0.001] {
            let start = Instant::now();
            let (moved, _, _) = check_drive(variant, h);
            let cost = start.elapsed().as_secs_f64() * 1e3 / 12.0;
            let error = (moved.x - 12.585).hypot(moved.z - 18.770);
            println!(
                "{:<11} {:>6} ms {:>8.3} cm {cost:>8.2} ms/s",
                format!("{variant:?}"),
                h * 1e3,
                error * 100.0
            );
        }
    }
}

fn section_6_1() {
    println!("\nsection 6.1 after 10 s: distance (mm) from Siconos at 0.2 ms and at 5 ms");
    let end_of = |name: &str| {
        let q = numbers(golden(name)["q"].as_array().unwrap().last().unwrap());
        Vector3::new(q[0], q[1], q[2])
    };
    let (fine, coarse) = (
        end_of("siconos_plane_h200us.json"),
        end_of("siconos_plane_h5ms.json"),
    );
    for variant in VARIANTS {
        for stabilisation in [Stabilisation::None, Stabilisation::Projection] {
            for h in [0.005, 0.0002, 0.000_02] {
                let mut simulation = report_scene(variant, h, stabilisation);
                simulation.step(count(10.0, h)).unwrap();
                let end = simulation.state().configuration.position;
                let (a, b) = ((end - fine).norm() * 1e3, (end - coarse).norm() * 1e3);
                println!(
                    "{:<11} {:<11} {:>6} ms {a:>9.4} {b:>9.4}",
                    format!("{variant:?}"),
                    format!("{stabilisation:?}"),
                    h * 1e3
                );
            }
        }
    }
}

fn parking_and_sliding() {
    let mut resting = at_rest(StepOptions::default());
    resting.brake();
    resting.step(200).unwrap();
    let front = 9.81 * (600.0 * 40.0 / 102.0 + 120.0) / 2.0;
    let load = resting.wheel_forces()[0][0];
    println!(
        "\nfront wheel's load on the flat: {:.1e} off the closed form",
        (load / front - 1.0).abs()
    );
    println!("parked at 2 ms, mu 0.7: mean speed (m/s) over the last 10 of 20 s");
    for degrees in [15.0, 25.0, 30.0, 34.9] {
        let options = StepOptions {
            time_step: 0.002,
            ..StepOptions::default()
        };
        let mut simulation = on_slope(degrees, options);
        simulation.brake();
        simulation.step(5000).unwrap();
        let from = simulation.state().configuration.position;
        simulation.step(5000).unwrap();
        let creep = (simulation.state().configuration.position - from).norm() / 10.0;
        println!("{degrees:>9} deg {creep:>12.1e}");
    }
    println!("sliding, brakes on: acceleration off g (sin a - mu cos a), relative to it");
    for degrees in [35.1_f64, 36.0, 40.0] {
        let a = degrees.to_radians();
        let mut simulation = on_slope(degrees, StepOptions::default());
        simulation.brake();
        simulation.step(200).unwrap();
        let speed = |v: &[f64]| Vector3::new(v[0], v[1], v[2]).norm();
        let before = speed(&simulation.state().v);
        simulation.step(200).unwrap();
        let expected = 9.81 * (a.sin() - 0.7 * a.cos());
        let error = (speed(&simulation.state().v) - before) / expected - 1.0;
        println!("{degrees:>9} deg {:>12.1e}", error.abs());
    }
}

/// Largest energy above the start's (J) over so many seconds from a height with a velocity.
fn largest_gain(options: StepOptions, height: f64, roll: f64, v: &[f64], seconds: f64) -> f64 {
    let mut q = [0.0; 21];
    (q[1], q[3]) = (height, roll);
    let steps = count(seconds, options.time_step);
    // A motor that brakes would take energy out.
    let model = Model::rover().with_motors(None).unwrap();
    let mut simulation = simulation(model, Plane::ground(), options, &q, v);
    let start = simulation.energy().total();
    (0..steps).fold(0.0_f64, |worst, _| {
        simulation.step(1).unwrap();
        worst.max(simulation.energy().total() - start)
    })
}

fn energies() {
    println!(
        "\nlargest gain of energy (J): tumbling in flight (17 kJ); elastic, without friction, dropped with a roll (12 kJ)"
    );
    let mut tumble = [0.0; 21];
    (tumble[0], tumble[3], tumble[4], tumble[5]) = (3.0, 3.0, 1.0, 2.0);
    for variant in VARIANTS {
        for h in [0.005, 0.02, 0.05] {
            let options = StepOptions {
                variant,
                time_step: h,
                ..StepOptions::default()
            };
            let flight = largest_gain(options.clone(), 1.5, 0.3, &tumble, 0.4);
            let elastic = StepOptions {
                restitution: 1.0,
                friction_coefficient: 0.0,
                ..options
            };
            let bounces = largest_gain(elastic, 1.35, 0.2, &[0.0; 21], 5.0);
            println!(
                "{:<11} {:>6} ms {flight:>10.2e} {bounces:>10.2e}",
                format!("{variant:?}"),
                h * 1e3
            );
        }
    }
}

fn main() {
    drives();
    section_6_1();
    parking_and_sliding();
    energies();
}
