//! Error and cost on the flat drive, creep of the parked rover, by variant and step.
//!
//! Run: `cargo bench -p rover-core --bench accuracy`. It informs and does not gate; `tests/physics/rover/` holds the bounds.
//! The drive is the one on which three other engines agree at a fine step: 12.585 m along and 18.770 m across the start heading after
//! 10 s. Cost is CPU time of one thread per simulated second.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // a bench prints, and stops where a scene is impossible

#[allow(dead_code)] // what the tests share beyond this
#[path = "../../../tests/physics/rover/scenes.rs"]
mod scenes;

use std::time::Instant;

use rover_core::geometry::Plane;
use rover_core::integrator::{StepOptions, Variant};
use scenes::{VARIANTS, check_machine, count, on_slope, simulation};

fn drive(variant: Variant, h: f64) -> (f64, f64) {
    let mut q = [0.0; 21];
    q[1] = 0.50;
    let options = StepOptions {
        variant,
        time_step: h,
        ..StepOptions::default()
    };
    let mut simulation = simulation(check_machine(), Plane::ground(), options, &q, &[0.0; 21]);
    let start = Instant::now();
    simulation.step(count(2.0, h)).unwrap();
    let from = simulation.state().configuration.position;
    simulation
        .set_steering(&[-0.1, -0.1, 0.0, 0.0, 0.0, 0.0])
        .unwrap();
    simulation.set_wheel_torques(&[20.0; 6]).unwrap();
    simulation.step(count(10.0, h)).unwrap();
    let cost = start.elapsed().as_secs_f64() * 1e3 / 12.0;
    let moved = simulation.state().configuration.position - from;
    ((moved.x - 12.585).hypot(moved.z - 18.770), cost)
}

fn main() {
    println!("flat drive: final position error (cm), cost (ms per simulated second)");
    println!(
        "{:>9} {:>12} {:>9} {:>12} {:>9}",
        "step ms", "linearised", "ms/s", "newton", "ms/s"
    );
    for h in [0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001] {
        let [(a, b), (c, d)] = VARIANTS.map(|variant| drive(variant, h));
        println!(
            "{:>9} {:>12.3} {b:>9.2} {:>12.3} {d:>9.2}",
            h * 1e3,
            a * 100.0,
            c * 100.0
        );
    }
    println!("\nparked at 2 ms, mu 0.7: mean speed (m/s) over the last 10 of 20 s");
    for degrees in [15.0, 25.0, 30.0, 34.9] {
        let mut simulation = on_slope(
            degrees,
            StepOptions {
                time_step: 0.002,
                ..StepOptions::default()
            },
        );
        simulation.brake();
        simulation.step(5000).unwrap();
        let from = simulation.state().configuration.position;
        simulation.step(5000).unwrap();
        let creep = (simulation.state().configuration.position - from).norm() / 10.0;
        println!("{degrees:>9} deg {creep:>12.1e}");
    }
}
