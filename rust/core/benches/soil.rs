//! Disk-steps per second of one core, for more and more disks and two tolerances: `cargo bench --bench soil`.
//!
//! A bed of ten layers in a box, poured and at rest ("rest"), and the same bed with gravity tilted by 30 degrees, which flows ("flow"). Nothing
//! sleeps. Times are the thread's CPU time where the system tells it.
#![allow(clippy::print_stdout)] // a bench reports

use std::sync::Arc;
use std::time::Instant;

use rover_core::integrator::StepOptions;
use rover_core::nalgebra::Vector3;
use rover_core::planar::soil::{
    Packing, SoilFriction, SoilScene, SoilSimulation, Wall, soil_options,
};

/// CPU seconds of this thread, wall seconds where /proc does not tell.
fn cpu_seconds(start: Instant) -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or_else(|| start.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

fn bed(count: usize, tolerance: f64) -> SoilSimulation {
    let width = 0.033 * count as f64 / 10.0 * 1.01;
    let packing = Packing {
        count,
        width,
        radius_min: 0.014,
        radius_max: 0.0165,
        ..Packing::default()
    };
    let (disks, q) = packing.build().expect("a packing");
    let mut options: StepOptions = soil_options(&disks);
    options.solver.tolerance = tolerance;
    let scene = SoilScene {
        walls: vec![Wall::floor(0.0), Wall::left(0.0), Wall::right(width)],
        ground: None,
        machine: None,
        friction: SoilFriction::default(),
        disks,
    };
    SoilSimulation::new(Arc::new(scene), options, None, q).expect("a soil")
}

/// Runs so many steps and tells (disk-steps/s, sweeps a step, contacts, share of converged steps).
fn measure(soil: &mut SoilSimulation, steps: usize) -> (f64, f64, usize, f64) {
    let start = Instant::now();
    let before = cpu_seconds(start);
    let (mut sweeps, mut contacts, mut converged) = (0, 0, 0);
    for _ in 0..steps {
        let report = soil.step(1).expect("finite");
        sweeps += report.iterations;
        contacts = contacts.max(report.n_contacts);
        converged += usize::from(report.is_converged());
    }
    let time = cpu_seconds(start) - before;
    let disks = soil.scene().disks.len();
    (
        (disks * steps) as f64 / time,
        sweeps as f64 / steps as f64,
        contacts,
        converged as f64 / steps as f64,
    )
}

fn main() {
    println!(
        "disks  tolerance  scene   disk-steps/s  sweeps/step  contacts  converged  penetration/r"
    );
    for count in std::env::args()
        .filter_map(|a| a.parse().ok())
        .collect::<Vec<usize>>()
        .into_iter()
        .chain([200, 2000, 20_000])
        .take(3)
    {
        for tolerance in [1e-4, 1e-8] {
            let mut soil = bed(count, 1e-4);
            soil.step(1500).expect("finite");
            let state = (soil.q().to_vec(), soil.v().to_vec());
            let steps = (400_000 / count).clamp(20, 400);
            for scene in ["rest", "flow"] {
                let mut options = soil.options().clone();
                options.solver.tolerance = tolerance;
                options.solver.velocity_tolerance = 10.0 * tolerance;
                if scene == "flow" {
                    let angle = 30.0_f64.to_radians();
                    options.gravity = 9.81 * Vector3::new(angle.sin(), -angle.cos(), 0.0);
                }
                let mut run =
                    SoilSimulation::new(soil.scene().clone(), options, None, state.0.clone())
                        .expect("a soil");
                run.set_state(&state.0, &state.1).expect("a state");
                // Until impulses are known, and until it flows.
                run.step(if scene == "flow" { 100 } else { 20 })
                    .expect("finite");
                let (rate, sweeps, contacts, converged) = measure(&mut run, steps);
                println!(
                    "{count:6} {tolerance:8.0e}   {scene}   {rate:12.3e}  {sweeps:11.1}  {contacts:8}  {converged:9.2}  {:.4}",
                    run.penetration() / run.scene().disks.smallest()
                );
            }
        }
    }
}
