//! A bed of disks, for counting instructions: `valgrind --tool=callgrind disk_steps 200 [rover]`.
//!
//! Arguments: number of 1 ms steps (after 100 of run-in), and `rover` for a two-wheel rover that
//! drives over the bed; without it the bed flows under tilted gravity. Prints a digest of all bits
//! of the state, to compare two builds.

#![allow(clippy::print_stdout)] // it prints its result

use std::error::Error;
use std::sync::Arc;

use rover_core::nalgebra::{Vector2, Vector3};
use rover_core::planar::{PlanarWheel, TwoWheelRover};
use rover_core::simulation::{DiskSimulation, grain_options};
use rover_core::system::grains::{GrainFriction, GrainScene, Packing, SleepOptions, Wall};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let steps = arguments.get(1).map_or(Ok(200), |n| n.parse())?;
    let drives = arguments.get(2).is_some_and(|word| word == "rover");
    let packing = Packing::default();
    let (disks, mut q) = packing.build()?;
    let mut options = grain_options(&disks);
    if !drives {
        options.gravity = Vector3::new(4.0, -9.0, 0.0);
    }
    let mut scene = GrainScene {
        grains: disks,
        walls: vec![Wall::floor(0.0), Wall::left(0.0), Wall::right(2.4494)],
        ground: None,
        machine: None,
        friction: GrainFriction::default(),
    };
    if drives {
        let wheel = |x: f64| PlanarWheel {
            mass: 60.0,
            radius: 0.2,
            inertia: 1.2,
            axle: Vector2::new(x, 0.0),
        };
        let rover = TwoWheelRover::new(130.0, 130.0 * 0.64 / 12.0, wheel(-0.4), wheel(0.4))?;
        scene.machine = Some(Arc::new(rover.into()));
        q.extend([0.7, 0.32, 0.0, 0.0, 0.0]);
    }
    let sleep = drives.then(SleepOptions::default);
    let mut sim = DiskSimulation::new(Arc::new(scene), options, sleep, q)?;
    if drives {
        sim.set_inputs(&[50.0, 50.0])?;
    }
    sim.step(100)?;
    sim.step(steps)?;
    let all = sim.q().iter().chain(sim.v());
    let digest = all.fold(0_u64, |hash, x| {
        (hash.rotate_left(5) ^ x.to_bits()).wrapping_mul(0x9E37_79B9_7F4A_7C15)
    });
    println!("{digest:016x}");
    Ok(())
}
