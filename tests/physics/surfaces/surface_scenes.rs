//! Maps that the tests share.

use std::sync::Arc;

use proptest::prelude::*;
use rover_core::geometry::{Disc, HeightField, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::nalgebra::Vector3;
use rover_core::simulation::RoverSimulation;

use crate::shared::resting;

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

/// The rover at rest at a height over the origin, m.
pub fn rover_on(terrain: Arc<dyn Terrain>, height: f64) -> RoverSimulation {
    resting(Model::rover(), terrain, StepOptions::default(), |q| {
        q.position.y = height;
    })
}

/// A disc with its axle along a direction.
pub fn disc(centre: Vector3<f64>, axle: Vector3<f64>, radius: f64) -> Disc {
    let spoke = axle.cross(&Vector3::y()).normalize();
    Disc {
        centre,
        axle,
        spoke,
        radius,
    }
}

/// Maps of 11 by 11 random heights, of at most so much times their spacing, which is 0.03 m to
/// 0.2 m.
pub fn rough(steepness: std::ops::Range<f64>) -> impl Strategy<Value = HeightField> {
    let heights = prop::collection::vec(-1.0..1.0, 11 * 11);
    (heights, steepness, 0.03..0.2_f64).prop_map(|(heights, steepness, spacing)| {
        #[allow(clippy::cast_possible_truncation)] // a map is single
        let heights = (heights.iter())
            .map(|h: &f64| (h * steepness * spacing) as f32)
            .collect();
        HeightField::new(heights, [11, 11], [spacing; 2], [-5.0 * spacing; 2]).unwrap()
    })
}
