//! Drives of random policies: the record in `benchmarks/comparison/exploring.json`, ready to be
//! played.
//!
//! Torques and steering set-points change every 50 ms. One record serves every torque, which scales
//! it. `benchmarks/comparison/exploring.py` says how the drives were recorded, and plays them
//! in Python.

#![allow(dead_code, clippy::unwrap_used)] // each program uses some of them; the record is ours

use std::sync::{Arc, OnceLock};

use rover_core::geometry::{HeightField, Plane, SphereField, Terrain};
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
    /// Rough hills with cells of 0.25 m, wheels that touch at 0.20 m.
    Hills,
    /// The same hills with cells of 0.05 m, and the roughness that those can show.
    FineHills,
    /// Cylinders that do not yield.
    RigidCylinders,
    /// Cylinders on the other grounds.
    CylindersAmongRocks,
    RigidCylindersAmongRocks,
    CylindersOnHills,
    CylindersOnFineHills,
}

impl Ground {
    /// The grounds of the tables and tests.
    pub const ALL: [Self; 7] = [
        Self::Plane,
        Self::LargeWheels,
        Self::Rocks,
        Self::Cylinders,
        Self::Tori,
        Self::Hills,
        Self::FineHills,
    ];

    /// Those that are only counted.
    const MORE: [Self; 5] = [
        Self::RigidCylinders,
        Self::CylindersAmongRocks,
        Self::RigidCylindersAmongRocks,
        Self::CylindersOnHills,
        Self::CylindersOnFineHills,
    ];

    /// Name in tables and on command lines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::LargeWheels => "plane, wheels 0.20 m",
            Self::Rocks => "rocks",
            Self::Cylinders => "plane, cylinders",
            Self::Tori => "plane, tori",
            Self::Hills => "hills, cells 0.25 m",
            Self::FineHills => "hills, cells 0.05 m",
            Self::RigidCylinders => "plane, rigid cylinders",
            Self::CylindersAmongRocks => "rocks, cylinders",
            Self::RigidCylindersAmongRocks => "rocks, rigid cylinders",
            Self::CylindersOnHills => "hills, cells 0.25 m, cylinders",
            Self::CylindersOnFineHills => "hills, cells 0.05 m, cylinders",
        }
    }

    /// Whether it has rocks.
    const fn has_rocks(self) -> bool {
        matches!(
            self,
            Self::Rocks | Self::CylindersAmongRocks | Self::RigidCylindersAmongRocks
        )
    }

    /// Distance of the heights of its map, m.
    const fn spacing(self) -> Option<f64> {
        match self {
            Self::Hills | Self::CylindersOnHills => Some(0.25),
            Self::FineHills | Self::CylindersOnFineHills => Some(0.05),
            _ => None,
        }
    }

    /// Width and rounding of the wheels, m, if they have any.
    const fn tread(self) -> Option<[f64; 2]> {
        match self {
            Self::Plane | Self::LargeWheels | Self::Rocks | Self::Hills | Self::FineHills => None,
            Self::Tori => Some([0.15, 0.075]),
            _ => Some([0.15, 0.0]),
        }
    }

    /// Whether the wheels are rigid although they are cylinders.
    const fn is_rigid(self) -> bool {
        matches!(self, Self::RigidCylinders | Self::RigidCylindersAmongRocks)
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
            if self.is_rigid() {
                wheel.stiffness = Some(0.0);
            }
        }
        Model::from_description(wide).unwrap()
    }

    /// The ground of a name.
    pub fn of(name: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter().chain(Self::MORE);
        all.find(|ground| ground.name() == name)
    }
}

/// Contact radius of large wheels, m.
const LARGE: f64 = 0.20;

/// How much higher large wheels begin among rocks, m.
const LIFT: f64 = 0.15;

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

    /// Torques and steering of one of the commands.
    pub fn command(&self, command: usize) -> ([f64; 6], [f64; 6]) {
        let Command { torques, steering } = self.commands[command];
        (torques, steering)
    }

    /// Gives one of the commands.
    pub fn give(&mut self, command: usize) {
        let (torques, steering) = self.command(command);
        self.simulation.set_wheel_torques(&torques).unwrap();
        self.simulation.set_steering(&steering).unwrap();
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
    let record = include_str!("../../benchmarks/comparison/exploring.json");
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
    if ground.has_rocks() {
        q = numbers(&record["q"]);
        if ground != Ground::Rocks {
            q[1] += LIFT;
        }
        terrain = Arc::new(rocks(record));
    }
    if let Some(spacing) = ground.spacing() {
        static HILLS: [OnceLock<HeightField>; 2] = [const { OnceLock::new() }; 2];
        let made = &HILLS[usize::from(ground == Ground::FineHills)];
        let hills = made.get_or_init(|| hills(spacing)).clone();
        let around =
            (-4..=4).flat_map(|i| (-4..=4).map(move |j| [i, j].map(|k| 0.2 * f64::from(k))));
        let highest = around
            .filter_map(|[x, z]| hills.height(x, z))
            .fold(0.0, f64::max);
        q[1] += highest;
        terrain = Arc::new(hills);
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

/// Side of the hills, m, their longest wave, m, and the waves of an octave.
const SIDE: f64 = 20.0;
const LONGEST: f64 = 8.0;
const OCTAVE: f64 = 8.0;

/// Self-affine hills of exponent 0.7: a sum of waves in all directions, down to those of two cells.
/// They are no wilder than `HeightField.fractal(40.0, spacing, 0.15, longest_wave=20.0)` in Python.
pub fn hills(spacing: f64) -> HeightField {
    let waves: Vec<[f64; 4]> = (0..u8::MAX)
        .map(|n| (f64::from(n), LONGEST * (-f64::from(n) / OCTAVE).exp2()))
        .take_while(|(_, length)| *length >= 2.0 * spacing)
        .map(|(n, length)| {
            let (sine, cosine) = (2.4 * n).sin_cos();
            let k = std::f64::consts::TAU / length;
            [k * cosine, k * sine, n * n, 0.009 * length.powf(0.7)]
        })
        .collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few hundred
    let n = (SIDE / spacing).round() as usize + 1;
    let place = |k: usize| spacing * k as f64 - 0.5 * SIDE;
    let height = |x: f64, z: f64| {
        let waves = waves.iter();
        let all = waves.map(|[k, l, phase, size]| size * (k * x + l * z + phase).sin());
        all.sum::<f64>()
    };
    #[allow(clippy::cast_possible_truncation)] // a map is single
    let heights = (0..n * n).map(|at| height(place(at % n), place(at / n)) as f32);
    let corner = [-0.5 * SIDE; 2];
    HeightField::new(heights.collect(), [n, n], [spacing; 2], corner).unwrap()
}

fn numbers(list: &Value) -> Vec<f64> {
    let list = list.as_array().unwrap().iter();
    list.map(|x| x.as_f64().unwrap()).collect()
}
