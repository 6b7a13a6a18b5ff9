//! Drives of random policies: the record in `tests/comparison/exploring.json`, ready to be played.
//!
//! Torques and steering set-points change every 50 ms. One record serves every torque, which scales
//! it. `tests/comparison/exploring.py` says how the drives were recorded, and plays them in Python.

#![allow(dead_code, clippy::unwrap_used)] // each program uses some of them; the record is ours

use std::sync::Arc;

use rover_core::geometry::{Plane, SphereField, Terrain};
use rover_core::integrator::{StepError, StepOptions, StepReport};
use rover_core::multibody::{Model, coordinates};
use rover_core::simulation::RoverSimulation;
use serde_json::Value;

/// Where the rover explores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ground {
    /// Flat ground.
    Plane,
    /// Flat ground, wheels that touch at 0.20 m.
    LargeWheels,
    /// Rocks of difficulty 0.5 on a slope, the rover halfway to its goal.
    Rocks,
    /// Flat ground, wheels that touch at 0.20 m, cylinders 0.15 m wide.
    Cylinders,
    /// The same wheels with fully rounded edges.
    Tori,
}

impl Ground {
    /// All grounds.
    pub const ALL: [Self; 5] = [
        Self::Plane,
        Self::LargeWheels,
        Self::Rocks,
        Self::Cylinders,
        Self::Tori,
    ];

    /// Name in tables and on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::LargeWheels => "plane, wheels 0.20 m",
            Self::Rocks => "rocks",
            Self::Cylinders => "plane, cylinders",
            Self::Tori => "plane, tori",
        }
    }

    /// Width and rounding of the wheels, m, if they have any.
    const fn tread(self) -> Option<[f64; 2]> {
        match self {
            Self::Cylinders => Some([0.15, 0.0]),
            Self::Tori => Some([0.15, 0.075]),
            Self::Plane | Self::LargeWheels | Self::Rocks => None,
        }
    }

    /// The built-in rover on the wheels of the scene.
    pub fn model(self) -> Model {
        let model = Model::rover();
        if matches!(self, Self::Plane | Self::Rocks) {
            return model;
        }
        let model = model.with_contact_radius(LARGE).unwrap();
        let Some([width, rounding]) = self.tread() else {
            return model;
        };
        let mut wide = model.description().clone();
        for wheel in &mut wide.wheels {
            (wheel.width, wheel.rounding) = (Some(width), Some(rounding));
        }
        Model::from_description(wide).unwrap()
    }

    /// The ground of a name.
    pub fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|ground| ground.name() == name)
    }
}

/// Contact radius of large wheels, m.
const LARGE: f64 = 0.20;

/// Largest torques, N m; with 0 the rover only steers.
pub const TORQUES: [f64; 4] = [0.0, 20.0, 60.0, 150.0];

/// Steps of 5 ms from one command to the next, and before the first.
pub const STEPS_A_COMMAND: usize = 10;
const STEPS_AT_REST: usize = 100;

/// A recorded drive, at rest before its first command.
#[derive(Clone, Debug)]
pub struct Drive {
    pub simulation: RoverSimulation,
    commands: Arc<[Command]>,
}

#[derive(Clone, Copy, Debug)]
struct Command {
    torques: [f64; 6],
    steering: [f64; 6],
}

impl Drive {
    /// Number of commands.
    pub fn n_commands(&self) -> usize {
        self.commands.len()
    }

    /// Gives one of the commands.
    pub fn give(&mut self, command: usize) {
        let Command { torques, steering } = &self.commands[command];
        self.simulation.set_wheel_torques(torques).unwrap();
        self.simulation.set_steering(steering).unwrap();
    }

    /// Torques and set-points of one of the commands.
    pub fn command(&self, command: usize) -> ([f64; 6], [f64; 6]) {
        let Command { torques, steering } = &self.commands[command];
        (*torques, *steering)
    }

    /// Plays the whole drive.
    ///
    /// # Errors
    /// As [`RoverSimulation::step`].
    pub fn play(&mut self) -> Result<StepReport, StepError> {
        let mut total = StepReport::default();
        for command in 0..self.n_commands() {
            self.give(command);
            total.merge(&self.simulation.step(STEPS_A_COMMAND)?);
        }
        Ok(total)
    }

    /// Plays the whole drive and hands over the report of each step.
    ///
    /// # Errors
    /// As [`RoverSimulation::step`].
    pub fn play_by_step(&mut self, mut note: impl FnMut(&StepReport)) -> Result<(), StepError> {
        for command in 0..self.n_commands() {
            self.give(command);
            for _ in 0..STEPS_A_COMMAND {
                note(&self.simulation.step(1)?);
            }
        }
        Ok(())
    }
}

/// All recorded drives on a ground, with torques of up to `torque`, N m.
pub fn drives(ground: Ground, torque: f64, options: &StepOptions) -> Vec<Drive> {
    let record = include_str!("../comparison/exploring.json");
    let record: Value = serde_json::from_str(record).unwrap();
    let drives = record["drives"].as_array().unwrap().iter();
    drives.map(|d| drive(d, ground, torque, options)).collect()
}

fn drive(record: &Value, ground: Ground, torque: f64, options: &StepOptions) -> Drive {
    let model = ground.model();
    let [first, ..] = model.wheels() else {
        panic!("a rover has wheels")
    };
    let limit = first.steering_limit;
    let mut q = vec![0.0; 21];
    q[1] = 0.25 + first.radius;
    let mut terrain: Arc<dyn Terrain> = Arc::new(Plane::ground());
    if ground == Ground::Rocks {
        q = numbers(&record["q"]);
        terrain = Arc::new(rocks(record));
    }
    let commands = record["actions"].as_array().unwrap().iter().map(|row| {
        let row = numbers(row);
        Command {
            torques: std::array::from_fn(|i| torque * row[i]),
            steering: std::array::from_fn(|i| limit * row[6 + i]),
        }
    });
    let commands = commands.collect();
    let mut simulation = RoverSimulation::new(Arc::new(model), terrain, options.clone()).unwrap();
    let start = coordinates::from_public(simulation.model(), &q).unwrap();
    simulation.set_state(start, vec![0.0; 21]);
    simulation.step(STEPS_AT_REST).unwrap();
    Drive {
        simulation,
        commands,
    }
}

/// The rocks of a record on their plane.
fn rocks(record: &Value) -> SphereField {
    let normal: [f64; 3] = numbers(&record["normal"]).try_into().unwrap();
    let spheres: Vec<Vec<f64>> = (record["spheres"].as_array().unwrap().iter())
        .map(numbers)
        .collect();
    let centres: Vec<[f64; 3]> = spheres.iter().map(|s| [s[0], s[1], s[2]]).collect();
    let radii: Vec<f64> = spheres.iter().map(|s| s[3]).collect();
    let plane = Plane::new(normal, 0.0).unwrap();
    SphereField::new(&centres, &radii, Some(plane)).unwrap()
}

fn numbers(list: &Value) -> Vec<f64> {
    let list = list.as_array().unwrap().iter();
    list.map(|x| x.as_f64().unwrap()).collect()
}
