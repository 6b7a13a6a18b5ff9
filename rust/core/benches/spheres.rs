//! Microseconds per step of the rover on fields of spheres, on one thread, at equal numbers of
//! contacts.
//!
//! Run: `cargo bench -p rover-core --bench spheres`. It only reports. The drive is that of the
//! bench `step`: six wheels on the plane. The spheres lie clear of the wheels' tracks, so only
//! search and distance computations differ. The figures are medians of 21 batches, taken in turns.
//! Then the rug of the report's Fig. 6.6, and driving over rocks.

#![allow(clippy::print_stdout)] // a bench prints
#![allow(clippy::unwrap_used)] // and stops where its own scenes are wrong

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector3;
use rover_core::geometry::{Plane, Rocks, SphereField, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Configuration, Hold, Model, ModelDescription};
use rover_core::nalgebra;
use rover_core::simulation::RoverSimulation;

const BATCHES: usize = 21;

fn simulation(
    model: &Arc<Model>,
    terrain: Arc<dyn Terrain>,
    options: StepOptions,
    position: Vector3<f64>,
) -> RoverSimulation {
    let mut simulation = RoverSimulation::new(model.clone(), terrain, options).unwrap();
    let mut start = Configuration::zero(model);
    start.position = position;
    simulation.set_state(start, vec![0.0; model.nv()]);
    simulation
}

/// `n` spheres on a square of one per 0.25 m², none within 5 cm of the two
/// strips that the wheels of a straight drive roll on.
fn beside_the_tracks(n: u32) -> SphereField {
    let side = (f64::from(n) * 0.25).sqrt();
    let mut state = 1_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 * 2.0_f64.powi(-53)
    };
    let mut centres = Vec::new();
    let mut radii = Vec::new();
    while centres.len() < n as usize {
        let (x, z) = (side * (uniform() - 0.2), side * (uniform() - 0.5));
        let radius = 0.02 + 0.08 * uniform();
        if (z.abs() - 0.53).abs() > radius + 0.05 {
            centres.push([x, -0.3 * radius, z]);
            radii.push(radius);
        }
    }
    SphereField::new(&centres, &radii, Some(Plane::ground())).unwrap()
}

fn at_equal_contacts() {
    let model = Arc::new(Model::rover());
    let terrains: [(&str, Arc<dyn Terrain>); 4] = [
        ("plane", Arc::new(Plane::ground())),
        ("100 spheres", Arc::new(beside_the_tracks(100))),
        ("2000 spheres", Arc::new(beside_the_tracks(2000))),
        ("100 000 spheres", Arc::new(beside_the_tracks(100_000))),
    ];
    let mut driving = Vec::new();
    for (name, terrain) in terrains {
        let start = Vector3::new(0.0, 0.35, 0.0);
        let mut s = simulation(&model, terrain, StepOptions::default(), start);
        s.set_wheel_torques(&[3.0; 6]).unwrap();
        s.step(400).unwrap();
        driving.push((name, s, Vec::new()));
    }
    let mut contacts = vec![0; driving.len()];
    for _ in 0..BATCHES {
        for ((_, s, times), most) in driving.iter_mut().zip(&mut contacts) {
            let mut copy = s.clone();
            let start = Instant::now();
            let report = copy.step(500).unwrap();
            times.push(start.elapsed().as_secs_f64() * 1e6 / 500.0);
            *most = report.n_contacts;
        }
    }
    println!(
        "{:<34} {:>10} {:>8}  contacts",
        "straight drive, 5 ms steps", "median us", "ratio"
    );
    let mut plane = 0.0;
    for ((name, _, mut times), contacts) in driving.into_iter().zip(contacts) {
        times.sort_by(f64::total_cmp);
        let median = times[BATCHES / 2];
        if name == "plane" {
            plane = median;
        }
        println!(
            "{name:<34} {median:>10.2} {:>8.3}  {contacts}",
            median / plane
        );
    }
}

/// The machine of the report: its masses, wheels of 0.30 m, gains of 1.5.
fn report_machine() -> Model {
    let path =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden/rover_model.json");
    let golden: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let masses = golden["meta"]["masses_880"].as_array().unwrap();
    let mut description = ModelDescription::rover();
    for (solid, mass) in description.solids.iter_mut().zip(masses) {
        solid.mass = mass.as_f64().unwrap();
        if solid.name.starts_with("steering") {
            solid.hold = Some(Hold {
                stiffness: 1.5,
                damping: 1.5,
            });
        }
    }
    for wheel in &mut description.wheels {
        wheel.contact_radius = Some(0.30);
    }
    Model::from_description(description).unwrap()
}

/// Prints the mean, the median of the batches and the solver's report of a run.
fn run(
    name: &str,
    mut simulation: RoverSimulation,
    batch: usize,
    batches: usize,
    speed: Option<f64>,
) {
    let (mut times, mut contacts, mut unsolved, mut iterations) = (Vec::new(), 0, 0, 0);
    let mut worst = 0.0_f64;
    for _ in 0..batches {
        let mut elapsed = 0.0;
        for _ in 0..batch {
            if let Some(speed) = speed {
                let v = &simulation.state().v;
                let now = v[0].hypot(v[1]).hypot(v[2]);
                simulation
                    .set_wheel_torques(&[60.0 * (speed - now); 6])
                    .unwrap();
            }
            let start = Instant::now();
            let report = simulation.step(1).unwrap();
            let spent = start.elapsed().as_secs_f64() * 1e6;
            elapsed += spent;
            worst = worst.max(spent);
            contacts += report.n_contacts;
            iterations += report.iterations;
            unsolved += usize::from(!report.is_converged());
        }
        times.push(elapsed / batch as f64);
    }
    let steps = (batch * batches) as f64;
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    times.sort_by(f64::total_cmp);
    println!(
        "{name:<34} mean {mean:.2} us, median {:.2}, worst step {worst:.0}; {:.2} contacts, {:.2} iterations a step, {unsolved} of {steps} not \
         converged; ends at {:.2?}",
        times[times.len() / 2],
        contacts as f64 / steps,
        iterations as f64 / steps,
        simulation.state().configuration.position.as_slice()
    );
}

fn main() {
    at_equal_contacts();

    let mut random_places = Vec::new();
    for i in 0..100_000_u32 {
        let (x, z) = (f64::from(i % 400) * 0.25, f64::from(i / 400) * 0.25);
        random_places.push([x + 0.1 * z.sin(), 0.0, z + 0.1 * x.sin()]);
    }
    let radii = vec![0.1; random_places.len()];
    let start = Instant::now();
    let field = SphereField::new(&random_places, &radii, None).unwrap();
    println!(
        "\n{} spheres load in {:.1} ms",
        field.spheres().len(),
        start.elapsed().as_secs_f64() * 1e3
    );

    let model = Arc::new(report_machine());
    for (h, steps) in [(0.005, 200), (0.001, 1000)] {
        let options = StepOptions {
            gravity: Vector3::new(0.0, -0.0981, 0.0),
            friction_coefficient: 0.8,
            restitution: 0.1,
            time_step: h,
            ..StepOptions::default()
        };
        let start = Vector3::new(12.5, 0.75, 6.25);
        let mut rug = simulation(&model, Arc::new(SphereField::rug()), options, start);
        // −0.4 N m about the wheels' axes
        rug.set_wheel_torques(&[0.4; 6]).unwrap();
        run(&format!("rug, {h} s steps"), rug, steps, 20, None);
    }

    let model = Arc::new(Model::rover());
    for abundance in [0.05, 0.1, 0.2] {
        let rocks = Rocks {
            abundance,
            area: [60.0, 20.0],
            max_diameter: 0.2,
            ..Rocks::default()
        };
        let field = SphereField::rocks(&rocks).unwrap();
        let name = format!("rocks, k = {abundance}, {} spheres", field.spheres().len());
        let start = Vector3::new(-25.0, 0.6, 0.0);
        let rover = simulation(&model, Arc::new(field), StepOptions::default(), start);
        run(&name, rover, 200, 20, Some(1.0));
    }
}
