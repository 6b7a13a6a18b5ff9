//! Microseconds per step of the rover on a plane, on one thread, and their breakdown.
//!
//! Run: `cargo bench -p rover-core --bench step`. It only reports. Each figure is the median of 21
//! batches of 1000 steps of 5 ms; the breakdown is one run with a clock read after every phase
//! (about 0.03 µs each, included).

#![allow(clippy::print_stdout)] // a bench prints

use std::sync::Arc;
use std::time::Instant;

use rover_core::geometry::Plane;
use rover_core::integrator::{StepError, StepOptions, Variant};
use rover_core::multibody::{Configuration, Model};
use rover_core::simulation::RoverSimulation;

/// A scene: its name, driving torque (N m), front and back steering (rad), time step factor.
const SCENES: [(&str, f64, f64); 3] = [
    ("parked, six contacts", 0.0, 0.0),
    ("straight drive, six contacts", 20.0, 0.0),
    ("drive in a curve, six contacts", 20.0, 0.1),
];

fn scene(variant: Variant, torque: f64, steering: f64, height: f64) -> Option<RoverSimulation> {
    let model = Arc::new(Model::rover());
    let mut start = Configuration::zero(&model);
    start.position.y = height;
    let options = StepOptions {
        variant,
        ..StepOptions::default()
    };
    let mut simulation =
        RoverSimulation::new(model.clone(), Arc::new(Plane::ground()), options).ok()?;
    simulation.set_state(start, vec![0.0; model.nv()]);
    if torque == 0.0 {
        simulation.brake();
    }
    simulation.set_wheel_torques(&[torque; 6]).ok()?;
    simulation
        .set_steering(&[-steering, -steering, 0.0, steering, 0.0, steering])
        .ok()?;
    Some(simulation)
}

fn median_microseconds(simulation: &RoverSimulation) -> Result<(f64, f64), StepError> {
    let mut times = Vec::new();
    for _ in 0..21 {
        let mut copy = simulation.clone();
        let start = Instant::now();
        copy.step(1000)?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok((times[10], times[0]))
}

fn main() -> Result<(), StepError> {
    println!(
        "{:<34} {:<12} {:>10} {:>10}  iterations",
        "scene, 5 ms steps", "variant", "median us", "best us"
    );
    let mut profiled = None;
    for variant in [Variant::Linearised, Variant::Newton] {
        for (name, torque, steering) in SCENES {
            let Some(mut simulation) = scene(variant, torque, steering, 0.35) else {
                continue;
            };
            simulation.step(400)?;
            let (median, best) = median_microseconds(&simulation)?;
            let report = simulation.clone().step(1000)?;
            let mean = report.iterations as f64 / 1000.0;
            println!(
                "{name:<34} {:<12} {median:>10.2} {best:>10.2}  {mean:.2}",
                format!("{variant:?}")
            );
            if variant == Variant::Linearised {
                profiled = Some(simulation);
            }
        }
        if let Some(flying) = scene(variant, 20.0, 0.1, 1e4) {
            let (median, best) = median_microseconds(&flying)?;
            println!(
                "{:<34} {:<12} {median:>10.2} {best:>10.2}  0",
                "free flight",
                format!("{variant:?}")
            );
        }
    }
    if let Some(simulation) = profiled {
        let parts = simulation.profile(20_000, &mut || true)?.microseconds();
        let total: f64 = parts.iter().map(|(_, t)| t).sum();
        println!("\nwhere a step of the curve goes ({total:.2} us with the clock):");
        for (phase, time) in parts {
            println!(
                "  {:<12} {time:>6.2} us {:>5.1} %",
                format!("{phase:?}"),
                100.0 * time / total
            );
        }
    }
    Ok(())
}
