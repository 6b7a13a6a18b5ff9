//! Maps that the tests share.

use std::sync::Arc;

use rover_core::geometry::{HeightField, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Model, coordinates};
use rover_core::simulation::RoverSimulation;

/// A square map of a height function about the origin.
pub fn map(cells: u32, spacing: f64, mut height: impl FnMut(f64, f64) -> f64) -> HeightField {
    let n = cells as usize + 1;
    let low = -0.5 * f64::from(cells) * spacing;
    let at = |k: usize| low + k as f64 * spacing;
    #[allow(clippy::cast_possible_truncation)] // a map is single
    let heights = (0..n * n)
        .map(|k| height(at(k % n), at(k / n)) as f32)
        .collect();
    HeightField::new(heights, [n, n], [spacing; 2], [low; 2]).unwrap()
}

/// The rover in public coordinates on a terrain, at rest.
pub fn rover_on(terrain: Arc<dyn Terrain>, q: &[f64]) -> RoverSimulation {
    let model = Arc::new(Model::rover());
    let mut simulation = RoverSimulation::new(model, terrain, StepOptions::default()).unwrap();
    let configuration = coordinates::from_public(simulation.model(), q).unwrap();
    simulation.set_state(configuration, vec![0.0; 21]);
    simulation
}
