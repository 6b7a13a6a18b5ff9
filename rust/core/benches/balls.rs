//! What beds of balls in flow cost: `cargo bench --bench balls`, or `-- 2000 20000` for these
//! numbers of balls.
//!
//! Ten layers of balls of one density with radii spread by 20%, in a box: at rest ("rest"), with
//! gravity tilted by 30 degrees ("tilt"), and with an upright plate of kinematic balls that goes
//! through them at 0.5 m/s ("plough"). Nothing sleeps. Settled beds are kept under the target
//! folder. Times are the CPU time of all threads; `BALLS_THREADS=2` takes two.
#![allow(clippy::print_stdout)] // a bench reports

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use rover_core::integrator::StepOptions;
use rover_core::nalgebra::Vector3;
use rover_core::simulation::{GrainSimulation, grain_options};
use rover_core::system::grains::{
    COORDINATES, GrainFriction, GrainScene, Grains, Packing, SleepOptions, Wall,
};

const RADII: [f64; 2] = [0.012, 0.018];
const DENSITY: f64 = 2600.0;

/// CPU seconds of this process so far, all threads.
fn cpu_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else {
        return 0.0;
    };
    let of = |path: PathBuf| {
        let text = std::fs::read_to_string(path.join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    };
    threads
        .filter_map(|t| of(t.ok()?.path()))
        .map(|ns| 1e-9 * ns)
        .sum()
}

fn mass(radius: f64) -> f64 {
    DENSITY * 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)
}

/// Side of the box, m: ten layers.
fn side(count: usize) -> f64 {
    (count as f64 / 10.0).sqrt().ceil() * 2.0 * 0.5 * (RADII[0] + RADII[1]) * 1.02
}

fn walls(side: f64) -> Vec<Wall<3>> {
    let back = Wall::new(Vector3::zeros(), Vector3::z()).expect("a wall");
    let front = Wall::new(Vector3::z() * side, -Vector3::z()).expect("a wall");
    vec![
        Wall::floor(0.0),
        Wall::left(0.0),
        Wall::right(side),
        back,
        front,
    ]
}

fn simulation(
    grains: Grains<3>,
    side: f64,
    options: Option<StepOptions>,
    q: Vec<f64>,
) -> GrainSimulation<3> {
    let options = options.unwrap_or_else(|| grain_options(&grains));
    let scene = GrainScene {
        walls: walls(side),
        ground: None,
        machine: None,
        friction: GrainFriction::default(),
        grains,
    };
    GrainSimulation::new(Arc::new(scene), options, None::<SleepOptions>, q).expect("a bed")
}

/// Radii and centres of a settled bed, from the file if there is one.
fn settled(count: usize) -> (Vec<f64>, Vec<f64>) {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("balls-{count}.bin"));
    if let Ok(bytes) = std::fs::read(&path) {
        let numbers: Vec<f64> = bytes
            .as_chunks::<8>()
            .0
            .iter()
            .map(|b| f64::from_le_bytes(*b))
            .collect();
        return (numbers[..count].to_vec(), numbers[count..].to_vec());
    }
    let side = side(count);
    let packing = Packing::<3> {
        count,
        radius_min: RADII[0],
        radius_max: RADII[1],
        mass: mass(0.015),
        corner: [0.0; 3],
        sides: [side, f64::INFINITY, side],
        seed: 1,
    };
    let (grains, q) = packing.build().expect("a packing");
    let mut options = grain_options(&grains);
    options.time_step = 2e-3;
    options.solver.tolerance = 1e-3;
    options.solver.velocity_tolerance = 1e-2;
    options.solver.max_sweeps = 500;
    let radius = grains.radius().to_vec();
    let mut bed = simulation(grains, side, Some(options), q);
    bed.step(600).expect("finite");
    let numbers = radius.iter().chain(bed.q());
    let bytes: Vec<u8> = numbers.flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(path, bytes).expect("the target folder");
    (radius, bed.q().clone())
}

#[derive(Clone, Copy, PartialEq)]
enum Motion {
    Rest,
    Tilt,
    Plough,
}

fn scene(count: usize, motion: Motion, h: f64, tolerance: f64) -> GrainSimulation<3> {
    let (mut radius, mut q) = settled(count);
    let side = side(count);
    let mut kinematic = vec![false; count];
    let mut speed = vec![0.0; count];
    if motion == Motion::Plough {
        // A plate of half the width, four layers high, at a quarter of the length.
        let (x, r) = (0.25 * side, 0.015);
        let (low, high) = (0.25 * side, 0.75 * side);
        let mut plate = Vec::new();
        let (mut z, deep) = (low, 0.12);
        while z < high {
            for layer in 0..10 {
                plate.push(Vector3::new(x, deep + r * f64::from(layer) * 1.5, z));
            }
            z += 1.5 * r;
        }
        let keep = |i: usize| {
            let at = Vector3::new(q[3 * i], q[3 * i + 1], q[3 * i + 2]);
            plate.iter().all(|p| (p - at).norm() > radius[i] + r)
        };
        let kept: Vec<usize> = (0..count).filter(|i| keep(*i)).collect();
        q = kept
            .iter()
            .flat_map(|i| q[COORDINATES * i..COORDINATES * (i + 1)].to_vec())
            .collect();
        radius = kept.iter().map(|i| radius[*i]).collect();
        kinematic = vec![false; radius.len()];
        speed = vec![0.0; radius.len()];
        for p in plate {
            q.extend(p.iter());
            radius.push(r);
            kinematic.push(true);
            speed.push(0.5);
        }
    }
    let mass = radius.iter().map(|r| mass(*r)).collect();
    let grains = Grains::<3>::new(radius, mass)
        .and_then(|grains| grains.with_kinematic(kinematic))
        .expect("grains");
    let mut options = grain_options(&grains);
    options.time_step = h;
    options.solver.tolerance = tolerance;
    options.solver.velocity_tolerance = 10.0 * tolerance;
    if motion == Motion::Tilt {
        let angle = 30_f64.to_radians();
        options.gravity = 9.81 * Vector3::new(angle.sin(), -angle.cos(), 0.0);
    }
    let mut run = simulation(grains, side, Some(options), q.clone());
    let v: Vec<f64> = speed
        .iter()
        .flat_map(|s| [*s, 0.0, 0.0, 0.0, 0.0, 0.0])
        .collect();
    run.set_state(&q, &v).expect("a state");
    run
}

/// Takes so many steps and prints a line.
fn measure(name: &str, run: &mut GrainSimulation<3>, steps: usize) {
    let (before, clock) = (cpu_seconds(), Instant::now());
    let (mut sweeps, mut contacts, mut converged, mut visits) = (0, 0, 0, 0);
    let mut most = 0;
    for _ in 0..steps {
        let report = run.step(1).expect("finite");
        sweeps += report.iterations;
        most = most.max(report.iterations);
        visits += report.iterations * report.n_contacts;
        contacts += report.n_contacts;
        converged += usize::from(report.is_converged());
    }
    let (time, wall) = (cpu_seconds() - before, clock.elapsed().as_secs_f64());
    let n = run.description().grains.len();
    let h = run.options().time_step;
    let simulated = (n * steps) as f64 * h;
    let fastest = run
        .v()
        .chunks_exact(6)
        .map(|v| v[0].hypot(v[1]).hypot(v[2]))
        .sum::<f64>()
        / n as f64;
    println!(
        "{n:6} {:4.0} {:8.0e}  {name:6} {:13.1} {:13.1} {:8.1} {most:5} {:9.2} {:7.2} {:9.1} {:9.3} {:7.2}",
        1e3 * h,
        run.options().solver.tolerance,
        simulated / time,
        simulated / wall,
        sweeps as f64 / steps as f64,
        contacts as f64 / (steps * n) as f64,
        converged as f64 / steps as f64,
        1e9 * time / visits as f64,
        100.0 * run.penetration() / run.description().grains.smallest(),
        fastest,
    );
}

fn main() {
    let threads = std::env::var("BALLS_THREADS").ok();
    let threads = threads.and_then(|n| n.parse().ok()).unwrap_or(1);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().expect("threads").install(report);
}

fn report() {
    println!(
        " balls h, ms tolerance scene  grain-s/CPU s  grain-s/s  sweeps  most contacts/n solved ns/visit overlap, % speed"
    );
    let asked: Vec<f64> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let whole = |x: &f64| *x >= 100.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts
    let counts: Vec<usize> = asked
        .iter()
        .filter(|x| whole(x))
        .map(|x| *x as usize)
        .collect();
    let counts = if counts.is_empty() {
        vec![2000, 20_000]
    } else {
        counts
    };
    let steps_of = asked.iter().find(|x| !whole(x));
    for count in counts {
        let times = steps_of.map_or(vec![1e-3, 2e-3, 4e-3], |h| vec![1e-3 * h]);
        for h in times {
            let only = std::env::var("BALLS_ONLY").ok();
            for (name, motion) in [
                ("rest", Motion::Rest),
                ("tilt", Motion::Tilt),
                ("plough", Motion::Plough),
            ] {
                if only.as_ref().is_some_and(|only| only != name) {
                    continue;
                }
                let mut run = scene(count, motion, h, 1e-3);
                // In motion for 0.15 s; then 0.1 s, or less if there are many.
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts
                let whole = |time: f64| (time / h).round() as usize;
                run.step(whole(0.15)).expect("finite");
                let steps = whole(0.1).min(2_000_000 / count).max(5);
                measure(name, &mut run, steps);
            }
        }
    }
}
