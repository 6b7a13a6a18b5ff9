//! A drive in a curve, for counting instructions:
//! `valgrind --tool=callgrind drive_steps 1000 [linearised|newton] [spheres] [rigid|yielding]`.
//!
//! Arguments: number of 5 ms steps (after 400 of run-in), the variant, and the number of spheres
//! just below the ground, which the search visits and the wheels never touch; the wheels, rigid
//! unless they are to yield as the gallery's.

use std::sync::Arc;

use rover_core::geometry::{Plane, SphereField, Terrain};
use rover_core::integrator::{StepError, StepOptions, Variant};
use rover_core::multibody::{Configuration, Model};
use rover_core::simulation::RoverSimulation;

/// A plane, with spheres of 5 cm in rows half a metre apart, 1 mm below it.
fn ground(n_spheres: u32) -> Option<Arc<dyn Terrain>> {
    if n_spheres == 0 {
        return Some(Arc::new(Plane::ground()));
    }
    let rows = f64::from(n_spheres).sqrt().ceil();
    let place = |i: u32| {
        let row = (f64::from(i) / rows).floor();
        let x = 0.5 * (f64::from(i) - rows * row) - 0.25 * rows;
        [x, -0.051, 0.5 * row - 0.25 * rows]
    };
    let centres: Vec<[f64; 3]> = (0..n_spheres).map(place).collect();
    let field = SphereField::new(&centres, &vec![0.05; centres.len()], Some(Plane::ground()));
    field.ok().map(|field| Arc::new(field) as Arc<dyn Terrain>)
}

fn main() -> Result<(), StepError> {
    let arguments: Vec<String> = std::env::args().collect();
    let steps = arguments
        .get(1)
        .and_then(|n| n.parse().ok())
        .unwrap_or(1000);
    let is_newton = arguments.get(2).is_some_and(|v| v == "newton");
    let variant = if is_newton {
        Variant::Newton
    } else {
        Variant::Linearised
    };
    let yields = arguments.get(4).is_some_and(|v| v == "yielding");
    let model = Arc::new(if yields {
        Model::gallery_rover()
    } else {
        Model::rover()
    });
    let mut start = Configuration::zero(&model);
    start.position.y = 0.35;
    let options = StepOptions {
        variant,
        ..StepOptions::default()
    };
    let n_spheres = arguments.get(3).and_then(|n| n.parse().ok()).unwrap_or(0);
    let Some(terrain) = ground(n_spheres) else {
        return Ok(());
    };
    let Ok(mut simulation) = RoverSimulation::new(model.clone(), terrain, options) else {
        return Ok(());
    };
    simulation.set_state(start, vec![0.0; model.nv()]);
    let is_set = simulation
        .set_steering(&[-0.1, -0.1, 0.0, 0.0, 0.0, 0.0])
        .is_ok()
        && simulation.set_wheel_torques(&[20.0; 6]).is_ok();
    simulation.step(400)?;
    let report = simulation.step(steps)?;
    std::process::exit(i32::from(!(is_set && report.is_converged())));
}
