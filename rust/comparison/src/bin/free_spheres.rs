//! Runs the scenes of free spheres and prints JSON:
//! `free_spheres [--start] [--scene NAME] [--duration S] STEP...` (steps in s).
//!
//! Run: `cargo run --release -p rover-comparison --bin free_spheres -- 0.01 0.005`. `--start`
//! prints the centres at the start instead, for other engines.

#![allow(clippy::print_stdout)] // it prints its result

use std::error::Error;
use std::time::Instant;

use rover_comparison::sphere_scenes::{SphereScene, run};
use rover_core::nalgebra::Vector3;

/// CPU time of this thread if the system provides it, otherwise wall time, s.
fn clock(origin: Instant) -> f64 {
    // Nanoseconds on a processor come first.
    let statistics = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let first = statistics.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    first.map_or_else(|| origin.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut steps = Vec::new();
    let (mut wanted, mut duration, mut only_start) = (None, None, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--start" => only_start = true,
            "--scene" => wanted = arguments.next(),
            "--duration" => duration = arguments.next().map(|s| s.parse::<f64>()).transpose()?,
            step => steps.push(step.parse::<f64>()?),
        }
    }
    let is_wanted = |scene: &SphereScene| wanted.as_deref().is_none_or(|name| name == scene.name());
    let origin = Instant::now();
    let mut scenes = Vec::new();
    for scene in SphereScene::ALL.into_iter().filter(is_wanted) {
        let mut runs = Vec::new();
        for &treatment in scene.treatments().iter().filter(|_| !only_start) {
            for &step in &steps {
                let seconds = duration.unwrap_or(scene.duration());
                let shown = run(scene, step, treatment, seconds, || clock(origin))?;
                runs.push(serde_json::json!({ "treatment": treatment, "run": shown }));
            }
        }
        let array = |x: &Vector3<f64>| [x.x, x.y, x.z];
        let centres: Vec<[f64; 3]> = if only_start {
            scene.centres().iter().map(array).collect()
        } else {
            Vec::new()
        };
        let slab = scene.slab().map(|(slab, centre)| {
            serde_json::json!({
                "mass": slab.mass,
                "half": array(&slab.half),
                "friction": slab.friction,
                "push": array(&slab.push),
                "centre": array(&centre),
            })
        });
        let kind = scene.kind();
        scenes.push(serde_json::json!({
            "scene": scene.name(),
            "duration": scene.duration(),
            "restitution": scene.restitution(),
            "friction": scene.friction(),
            "mass": kind.mass,
            "radius": kind.radius,
            "centres": centres,
            "slab": slab,
            "accelerations": scene.accelerations().map(|both| both.map(|a| array(&a))),
            "runs": runs,
        }));
    }
    println!("{}", serde_json::to_string_pretty(&scenes)?);
    Ok(())
}
