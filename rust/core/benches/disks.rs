//! Disk-steps per second of one core, for growing numbers of disks and several tolerances:
//! `cargo bench --bench disks`, or `-- 2000` for that number of disks.
//!
//! A bed of ten layers in a box, poured and at rest ("rest"), and the same bed with gravity tilted
//! by 30 degrees, which flows ("flow"). Nothing sleeps. Times are the thread's CPU time if the
//! system provides it.
#![allow(clippy::print_stdout)] // a bench reports

use std::sync::Arc;
use std::time::Instant;

use rover_core::integrator::StepOptions;
use rover_core::nalgebra::Vector3;
use rover_core::simulation::{DiskSimulation, grain_options};
use rover_core::system::grains::{GrainFriction, GrainScene, Packing, Wall};

/// CPU seconds of this thread, or wall seconds without /proc.
fn cpu_seconds(start: Instant) -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or_else(|| start.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

/// Ten layers in a box, poured and at rest.
fn bed(count: usize) -> DiskSimulation {
    let width = 0.033 * count as f64 / 10.0 * 1.01;
    let packing = Packing {
        count,
        sides: [width, f64::INFINITY],
        radius_min: 0.014,
        radius_max: 0.0165,
        ..Packing::default()
    };
    let (disks, q) = packing.build().expect("a packing");
    let mut options: StepOptions = grain_options(&disks);
    options.solver.tolerance = 1e-3;
    let scene = GrainScene {
        walls: vec![Wall::floor(0.0), Wall::left(0.0), Wall::right(width)],
        ground: None,
        machine: None,
        friction: GrainFriction::default(),
        grains: disks,
    };
    let mut sim = DiskSimulation::new(Arc::new(scene), options, None, q).expect("a bed");
    // Until it rests, or for 12 s.
    for _ in 0..120 {
        sim.step(100).expect("finite");
        let mass: f64 = sim.description().grains.mass().iter().sum();
        if 2.0 * sim.energy().kinetic < 1e-10 * mass {
            break;
        }
    }
    sim
}

/// The bed goes on with gravity tilted by `tilt` degrees, solved to `tolerance`.
fn go_on(bed: &DiskSimulation, tilt: f64, tolerance: f64) -> DiskSimulation {
    let mut options = bed.options().clone();
    options.solver.tolerance = tolerance;
    options.solver.velocity_tolerance = 10.0 * tolerance;
    let angle = tilt.to_radians();
    options.gravity = 9.81 * Vector3::new(angle.sin(), -angle.cos(), 0.0);
    let mut run = DiskSimulation::new(bed.description().clone(), options, None, bed.q().clone())
        .expect("a bed");
    run.set_state(bed.q(), bed.v()).expect("a state");
    run
}

/// Takes so many steps and prints a line.
fn measure(name: &str, sim: &mut DiskSimulation, steps: usize) {
    let before = cpu_seconds(Instant::now());
    let (mut sweeps, mut contacts, mut converged, mut visits) = (0, 0, 0, 0);
    let mut gain = f64::NEG_INFINITY;
    for _ in 0..steps {
        let energy = sim.energy().total();
        let report = sim.step(1).expect("finite");
        gain = gain.max(sim.energy().total() - energy);
        sweeps += report.iterations;
        visits += report.iterations * report.n_contacts;
        contacts = contacts.max(report.n_contacts);
        converged += usize::from(report.is_converged());
    }
    let time = cpu_seconds(Instant::now()) - before;
    let disks = sim.description().grains.len();
    println!(
        "{disks:6} {:8.0e}   {name:5}  {:12.2e}  {:11.1}  {contacts:8}  {:9.2}  {:17.1}  {:13.4}  {gain:9.1e}",
        sim.options().solver.tolerance,
        (disks * steps) as f64 / time,
        sweeps as f64 / steps as f64,
        converged as f64 / steps as f64,
        1e9 * time / visits as f64,
        sim.penetration() / sim.description().grains.smallest(),
    );
}

fn main() {
    println!(
        " disks  tolerance  scene  disk-steps/s  sweeps/step  contacts  converged  ns/contact, sweep  penetration/r  most gain of energy in a step, J"
    );
    let asked: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let counts = if asked.is_empty() {
        vec![200, 2000, 20_000]
    } else {
        asked
    };
    for count in counts {
        let bed = bed(count);
        let steps = (200_000 / count).clamp(20, 400);
        for tolerance in [1e-3, 1e-4, 1e-6, 1e-8] {
            let mut rest = go_on(&bed, 0.0, tolerance);
            rest.step(200_000 / count + 5).expect("finite");
            measure("rest", &mut rest, steps);
            let mut flow = go_on(&bed, 0.0, 1e-3);
            flow.step(20).expect("finite");
            let mut flow = go_on(&flow, 30.0, 1e-3);
            flow.step(100).expect("finite");
            let mut flow = go_on(&flow, 30.0, tolerance);
            flow.step(5).expect("finite");
            measure("flow", &mut flow, steps / 2);
        }
    }
}
