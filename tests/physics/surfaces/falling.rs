//! Nothing falls or drives through a surface, and off the map is an error.

use std::sync::Arc;

use rover_core::geometry::{HeightField, Terrain};
use rover_core::integrator::{StepError, StepOptions};
use rover_core::nalgebra::Vector3;

use super::surface_scenes::{map, rover_on};
use crate::spheres::sphere_scenes::{Random, WHEEL_RADIUS, lone_wheel, placed};

/// Bumps of random height.
pub fn bumpy(seed: u64, spacing: f64, height: f64) -> HeightField {
    let mut numbers = Random(seed);
    let cells = 200;
    let heights: Vec<f64> = (0..201 * 201).map(|_| height * numbers.uniform()).collect();
    let at = move |x: f64, z: f64| {
        let index = |x: f64| (x / spacing).round() + 100.0;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a node of the map
        heights[(index(z) * 201.0 + index(x)) as usize]
    };
    map(cells, spacing, at)
}

#[test]
fn the_rover_drops_onto_a_rough_map_and_comes_to_rest_on_it() {
    let mut rover = rover_on(Arc::new(bumpy(7, 0.1, 0.06)), 1.0);
    for _ in 0..4 {
        rover.step(100).unwrap();
    }
    let gaps: Vec<f64> = rover.wheel_contacts().iter().map(|c| c.gap).collect();
    assert!(gaps.iter().all(|g| g.abs() < 2e-3), "{gaps:?}");
}

#[test]
fn leaving_the_map_is_an_error_that_names_the_place_and_keeps_the_state() {
    let nan = |x: f64, _: f64| if x > 1.0 { f64::NAN } else { 0.0 };
    let fields = [map(10, 0.2, |_, _| 0.0), map(50, 0.2, nan)];
    for field in fields {
        let start = Vector3::new(0.0, WHEEL_RADIUS, 0.0);
        let mut wheel = placed(lone_wheel(), field, StepOptions::default(), start);
        let configuration = wheel.q().clone();
        let spin = -2.0 / WHEEL_RADIUS;
        wheel.set_state(configuration, vec![2.0, 0.0, 0.0, 0.0, 0.0, spin]);
        let error = wheel.step(1000).unwrap_err();
        let x = wheel.q().position.x;
        assert!((0.85..1.0).contains(&x), "{x}");
        let StepError::NoGround { x, .. } = error else {
            panic!("{error}")
        };
        assert!((0.8..1.3).contains(&x), "{error}");
        assert!(
            error.to_string().starts_with("terrain: the ground at"),
            "{error}"
        );
        assert!(wheel.step(1).is_err());
    }
}

#[test]
fn heights_are_those_of_the_triangles() {
    let field = map(4, 1.0, |x, z| x * z);
    // Inside the cell (0, 0): heights 0, 0, 0 and 1, cut from (0, 0) to (1, 1).
    for (x, z, y) in [(0.75, 0.25, 0.25), (0.25, 0.75, 0.25), (0.5, 0.5, 0.5)] {
        assert!((field.height(x, z).unwrap() - y).abs() < 1e-15);
    }
    assert!((field.height(2.0, 2.0).unwrap() - 4.0).abs() < 1e-15);
    assert!(field.height(2.1, 0.0).is_none());
}
