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

/// The ground under a rover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ground {
    /// Flat ground.
    Plane,
    /// Rocks of difficulty 0.5 on a slope, the rover halfway to its goal.
    Rocks,
    /// Rough hills with cells of 0.25 m.
    Hills,
    /// The same hills with cells of 0.05 m, and the roughness that those can show.
    FineHills,
}

/// The wheels of the built-in rover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wheels {
    /// As they are.
    BuiltIn,
    /// Thin discs that touch at 0.20 m and yield, as those below.
    Discs,
    /// Cylinders of that radius, 0.15 m wide.
    Cylinders,
    /// Cylinders that do not yield.
    RigidCylinders,
    /// Cylinders with fully rounded edges.
    Tori,
}

/// Where a rover explores, and on which wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scene {
    pub ground: Ground,
    pub wheels: Wheels,
}

impl Ground {
    const ALL: [Self; 4] = [Self::Plane, Self::Rocks, Self::Hills, Self::FineHills];

    const fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::Rocks => "rocks",
            Self::Hills => "hills, cells 0.25 m",
            Self::FineHills => "hills, cells 0.05 m",
        }
    }
}

impl Wheels {
    const ALL: [Self; 5] = [
        Self::BuiltIn,
        Self::Discs,
        Self::Cylinders,
        Self::RigidCylinders,
        Self::Tori,
    ];

    /// What a scene's name has behind that of the ground.
    const fn suffix(self) -> &'static str {
        match self {
            Self::BuiltIn => "",
            Self::Discs => ", wheels 0.20 m",
            Self::Cylinders => ", cylinders",
            Self::RigidCylinders => ", rigid cylinders",
            Self::Tori => ", tori",
        }
    }

    /// The built-in rover on them.
    fn model(self) -> Model {
        let model = Model::rover();
        if self == Self::BuiltIn {
            return model;
        }
        let model = model.with_contact_radius(LARGE).unwrap();
        let mut own = model.description().clone();
        let rounding = if self == Self::Tori { 0.5 * WIDTH } else { 0.0 };
        for wheel in &mut own.wheels {
            if self != Self::Discs {
                (wheel.width, wheel.rounding) = (Some(WIDTH), Some(rounding));
            }
            if self == Self::RigidCylinders {
                wheel.stiffness = Some(0.0);
            } else {
                wheel.deflection = Some(DEFLECTION);
            }
        }
        Model::from_description(own).unwrap()
    }
}

impl Scene {
    const fn new(ground: Ground, wheels: Wheels) -> Self {
        Self { ground, wheels }
    }

    /// The built-in rover on flat ground, and among rocks.
    pub const PLANE: Self = Self::new(Ground::Plane, Wheels::BuiltIn);
    pub const ROCKS: Self = Self::new(Ground::Rocks, Wheels::BuiltIn);

    /// Scenes of the tables and tests.
    pub const ALL: [Self; 7] = [
        Self::PLANE,
        Self::new(Ground::Plane, Wheels::Discs),
        Self::ROCKS,
        Self::new(Ground::Plane, Wheels::Cylinders),
        Self::new(Ground::Plane, Wheels::Tori),
        Self::new(Ground::Hills, Wheels::Discs),
        Self::new(Ground::FineHills, Wheels::Discs),
    ];

    /// Name in tables and on command lines.
    pub fn name(self) -> String {
        self.ground.name().to_owned() + self.wheels.suffix()
    }

    /// The scene of a name.
    pub fn of(name: &str) -> Option<Self> {
        let all = |ground| Wheels::ALL.map(|wheels| Self::new(ground, wheels));
        let mut all = Ground::ALL.into_iter().flat_map(all);
        all.find(|scene| scene.name() == name)
    }
}

/// Contact radius of large wheels, m.
const LARGE: f64 = 0.20;

/// Width of wide wheels, m.
const WIDTH: f64 = 0.15;

/// Deflection of large wheels that yield, in radii: that of the package's rover, 0.33 mm.
const DEFLECTION: f64 = 1.65e-3;

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

/// All recorded drives in a scene, with torques of up to `torque`, N m.
pub fn drives(scene: Scene, torque: f64, options: &StepOptions) -> Vec<Drive> {
    let record = include_str!("../../benchmarks/comparison/exploring.json");
    let record: Value = serde_json::from_str(record).unwrap();
    let drives = record["drives"].as_array().unwrap().iter();
    drives.map(|d| drive(d, scene, torque, options)).collect()
}

fn drive(record: &Value, scene: Scene, torque: f64, options: &StepOptions) -> Drive {
    static HILLS: [OnceLock<HeightField>; 2] = [const { OnceLock::new() }; 2];
    let model = scene.wheels.model();
    let [first, ..] = model.wheels() else {
        panic!("a rover has wheels")
    };
    let limit = first.steering_limit;
    let mut q = vec![0.0; 21];
    q[1] = 0.25 + first.radius;
    let mut terrain: Arc<dyn Terrain> = Arc::new(Plane::ground());
    let hills = |own: &'static OnceLock<HeightField>, spacing: f64| {
        let hills = own.get_or_init(|| hills(spacing)).clone();
        let around =
            (-4..=4).flat_map(|i| (-4..=4).map(move |j| [i, j].map(|k| 0.2 * f64::from(k))));
        let heights = around.filter_map(|[x, z]| hills.height(x, z));
        (heights.fold(0.0, f64::max), hills)
    };
    let hills = match scene.ground {
        Ground::Plane => None,
        Ground::Rocks => {
            q = numbers(&record["q"]);
            if scene.wheels != Wheels::BuiltIn {
                q[1] += LIFT;
            }
            terrain = Arc::new(rocks(record));
            None
        }
        Ground::Hills => Some(hills(&HILLS[0], 0.25)),
        Ground::FineHills => Some(hills(&HILLS[1], 0.05)),
    };
    if let Some((highest, hills)) = hills {
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
