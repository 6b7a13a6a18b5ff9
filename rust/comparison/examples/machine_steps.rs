//! What a step of other machines costs: `machine_steps [STEPS]` prints microseconds of the general
//! step, of the fast step alone, and of each of 8 in a batch on one thread. With the name of a
//! machine and `general`, `alone` or `batch` it takes only such steps, for counting instructions:
//! `valgrind --tool=callgrind --toggle-collect='*counted*'`.
//!
//! Steps of 5 ms on a plane, for a name that ends in `-hills` on a rough map, and for `flying` and
//! `turning` high above the plane, with torques that change every ten steps.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // prints; stops at an impossible scene

#[path = "../../../tests/physics/rover_kinds.rs"]
#[allow(missing_docs, dead_code)]
mod rover_kinds;

use std::sync::Arc;
use std::time::Instant;

use rover_core::contact::placement::resting_pose;
use rover_core::geometry::{HeightField, Plane, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::integrator::moreau_jean::MoreauJean;
use rover_core::multibody::description::{LoopDescription, LoopKind};
use rover_core::multibody::{Model, ModelDescription, coordinates};
use rover_core::simulation::{Batch, RoverSimulation};
use rover_kinds::{dry, mecanum, tracked, with_a_bar};

const STEPS_A_COMMAND: usize = 10;
const STEPS_AT_REST: usize = 200;

/// Rovers of the batch.
const ROVERS: usize = 8;

/// Rounds of a measurement; the fastest counts.
const ROUNDS: usize = 3;

/// Largest torque, as a share of that which a wheel's part of the weight resists at the rim.
const EFFORT: f64 = 0.2;

/// Distance between rovers side by side, and between one and that which it pushes, m.
const APART: f64 = 3.0;
const PUSHED: f64 = 2.0;

/// Height of a rover in free flight, m, and how fast "turning" turns, rad/s.
const HEIGHT: f64 = 500.0;
const SPIN: [f64; 3] = [22.5, -17.5, 20.0];

/// Cells of the rough map, m.
const CELL: f64 = 0.25;

const NAMES: [&str; 16] = [
    "rover",
    "flying",
    "turning",
    "mecanum",
    "dry",
    "open-rover",
    "open-dry",
    "bar",
    "tracks",
    "two",
    "three",
    "push",
    "tow",
    "rover-hills",
    "two-hills",
    "three-hills",
];

/// Rovers in one description.
fn joined(n: usize, loops: Vec<LoopDescription>) -> ModelDescription {
    let rover = |k: usize| (format!("{k}"), ModelDescription::rover());
    ModelDescription::joined("rovers", (0..n).map(rover).collect(), loops)
}

/// A hitch of two rovers behind each other.
fn hitch() -> LoopDescription {
    LoopDescription {
        name: "hitch".into(),
        kind: LoopKind::Connect,
        solid: "0/trunk".into(),
        other: Some("1/trunk".into()),
        position: Some([-0.5 * APART, 0.0, 0.0]),
        other_position: Some([0.5 * APART, 0.0, 0.0]),
        other_rotation: None,
        polynomial: None,
    }
}

fn description(name: &str) -> ModelDescription {
    let open = || ModelDescription::named("open-rover").unwrap();
    match name.trim_end_matches("-hills") {
        "rover" | "flying" | "turning" => ModelDescription::rover(),
        "two" | "push" => joined(2, Vec::new()),
        "three" => joined(3, Vec::new()),
        "tow" => joined(2, vec![hitch()]),
        "mecanum" => mecanum(),
        "dry" => dry(ModelDescription::rover(), 2.0, 30.0),
        "open-rover" => open(),
        "open-dry" => dry(open(), 0.02, 0.3),
        "bar" => with_a_bar(),
        "tracks" => tracked(9),
        _ => panic!("a machine: one of {NAMES:?}"),
    }
}

/// Between −1 and 1, spread evenly.
fn drawn(seed: usize) -> f64 {
    let x = (seed as f64 + 1.0) * 0.618_033_988_749_894_9 * 7.31;
    2.0 * (x * x - (x * x).floor()) - 1.0
}

/// Torques of the wheels.
fn torques(model: &Model, k: usize) -> Vec<f64> {
    let n = model.wheels().len();
    let most = |i: usize| {
        let wheel = &model.wheels()[i];
        let share = EFFORT * 0.7 * 9.81 * model.mass() * wheel.radius / n as f64;
        share.min(wheel.torque_limit)
    };
    (0..n).map(|i| most(i) * drawn(17 * k + i)).collect()
}

/// Torques of the wheels of a named machine, N m. In "push" those of the second rover are never
/// negative, so that it pushes the first.
fn torques_of(name: &str, model: &Model, k: usize) -> Vec<f64> {
    let mut torques = torques(model, k);
    if name == "push" {
        let n = torques.len() / 2;
        torques[n..].iter_mut().for_each(|own| *own = own.abs());
    }
    torques
}

/// Hills of a few centimetres.
fn hills() -> HeightField {
    const N: usize = 161;
    let low = -0.5 * CELL * (N - 1) as f64;
    let at = |k: usize| low + CELL * k as f64;
    #[allow(clippy::cast_possible_truncation)] // a map is single
    let height = |k: usize| {
        let (x, z) = (at(k % N), at(k / N));
        (0.04 * (2.0 * x).sin() * (1.5 * z).cos() + 0.01 * (7.0 * x - z).sin()) as f32
    };
    HeightField::new(
        (0..N * N).map(height).collect(),
        [N; 2],
        [CELL; 2],
        [low; 2],
    )
    .unwrap()
}

/// Places of the machines, which stand side by side or behind each other.
fn places(model: &Model, name: &str) -> Vec<f64> {
    let ground = Plane::ground();
    let n = model.machines().len();
    if n == 1 {
        return resting_pose(model, &ground, [0.0, 0.0], 0.0).unwrap();
    }
    let rover = Model::rover();
    let place = |k: usize| match name {
        "push" => [-PUSHED * k as f64, 0.0],
        "tow" => [-APART * k as f64, 0.0],
        _ => [0.0, APART * k as f64],
    };
    let poses = (0..n).map(|k| resting_pose(&rover, &ground, place(k), 0.0).unwrap());
    poses.flatten().collect()
}

fn start(name: &str) -> RoverSimulation {
    let model = Arc::new(Model::from_description(description(name)).unwrap());
    let mut q = places(&model, name);
    let mut ground: Arc<dyn Terrain> = Arc::new(Plane::ground());
    if name.ends_with("-hills") {
        ground = Arc::new(hills());
        for machine in model.machines() {
            q[machine.velocities.start + 1] += 0.1;
        }
    }
    let mut v = vec![0.0; model.nv()];
    if let "flying" | "turning" = name {
        q[1] += HEIGHT;
    }
    if name == "turning" {
        v[3..6].copy_from_slice(&SPIN);
    }
    let q = coordinates::from_public(&model, &q).unwrap();
    let options = StepOptions::default();
    let mut sim = RoverSimulation::new(Arc::clone(&model), ground, options).unwrap();
    sim.set_state(q, v);
    sim.step(STEPS_AT_REST).unwrap();
    sim
}

#[inline(never)]
fn counted(sim: &mut RoverSimulation, name: &str, steps: usize, is_general: bool) -> usize {
    let mut fallbacks = 0;
    for k in 0..steps / STEPS_A_COMMAND {
        let torques = torques_of(name, sim.model(), k);
        sim.set_wheel_torques(&torques).unwrap();
        if is_general {
            sim.step_with(&MoreauJean, STEPS_A_COMMAND).unwrap();
        } else {
            fallbacks += sim.step(STEPS_A_COMMAND).unwrap().fallbacks;
        }
    }
    fallbacks
}

fn batch(name: &str) -> (Batch, Arc<Model>) {
    let start = start(name);
    let model = Arc::clone(start.model());
    let batch = Batch::new(vec![start; ROVERS], Vec::new(), Some(1)).unwrap();
    (batch, model)
}

#[inline(never)]
fn counted_batch((batch, model): &mut (Batch, Arc<Model>), name: &str, steps: usize) {
    let mut rows = vec![0.0; ROVERS * batch.layout().size()];
    let steering = vec![0.0; ROVERS * model.wheels().len()];
    for k in 0..steps / STEPS_A_COMMAND {
        let torques: Vec<f64> = (0..ROVERS)
            .flat_map(|i| torques_of(name, model, k + 100 * i))
            .collect();
        batch
            .step(&torques, &steering, STEPS_A_COMMAND, None, &mut rows)
            .unwrap();
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let steps = arguments.get(1).and_then(|n| n.parse().ok()).unwrap_or(500);
    if let [_, _, name, how] = &arguments[..] {
        match how.as_str() {
            "batch" => counted_batch(&mut batch(name), name, steps),
            _ => {
                counted(&mut start(name), name, steps, how == "general");
            }
        }
        return;
    }
    println!(
        "{:<12} {:>8} {:>8} {:>8}  us a step {:>9}",
        "machine", "general", "alone", "in batch", "fallbacks"
    );
    for name in NAMES {
        let mut fastest = [f64::INFINITY; 3];
        let mut fallbacks = 0;
        for _ in 0..ROUNDS {
            for (k, fastest) in fastest.iter_mut().enumerate() {
                let (mut sim, mut batch) = (start(name), batch(name));
                let begin = Instant::now();
                let n = if k == 2 {
                    counted_batch(&mut batch, name, steps);
                    ROVERS
                } else {
                    fallbacks = counted(&mut sim, name, steps, k == 0);
                    1
                };
                let micros = 1e6 * begin.elapsed().as_secs_f64();
                *fastest = fastest.min(micros / (n * steps) as f64);
            }
        }
        let [general, alone, together] = fastest;
        println!("{name:<12} {general:>8.1} {alone:>8.1} {together:>8.1} {fallbacks:>20}");
    }
}
