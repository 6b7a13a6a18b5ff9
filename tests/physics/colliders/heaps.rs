//! Heaps of hulls, capsules, cylinders, ellipsoids, boxes and balls.

use std::sync::Arc;

use rover_core::geometry::Terrain;
use rover_core::nalgebra::Vector3;
use rover_core::simulation::RoverSimulation;

use super::collider_scenes::prism;
use crate::contacts::contact_scenes::overlap;
use crate::contacts::heap_scenes::heap;
use crate::shared::{flat, step_without_gain};
use crate::spheres::sphere_scenes::Random;
use crate::surfaces::surface_scenes::map;

/// A stone: the hull of twelve random points.
fn stone(random: &mut Random) -> String {
    let points: Vec<String> = (0..12)
        .map(|_| {
            let mut x = || random.between(-1.0, 1.0);
            let x = Vector3::new(x(), x(), x()).normalize();
            format!("[{}, {}, {}]", 0.13 * x.x, 0.1 * x.y, 0.12 * x.z)
        })
        .collect();
    format!("kind = 'hull', points = [{}]", points.join(", "))
}

fn heap_of_all_shapes(n: usize, seed: u64, ground: Arc<dyn Terrain>) -> RoverSimulation {
    let mut random = Random(seed);
    let solids: Vec<String> = (0..n)
        .map(|i| {
            let shape = match i % 7 {
                0 | 1 => stone(&mut random),
                2 => prism(),
                3 => "kind = 'capsule', radius = 0.07, height = 0.2".to_owned(),
                4 => "kind = 'cylinder', radius = 0.1, height = 0.15".to_owned(),
                5 => "kind = 'ellipsoid', radii = [0.15, 0.08, 0.1]".to_owned(),
                _ if i % 2 == 0 => "kind = 'box', size = [0.2, 0.16, 0.24]".to_owned(),
                _ => "kind = 'sphere', radius = 0.1".to_owned(),
            };
            let mass = random.between(4.0, 8.0);
            format!("mass = {mass}\nshapes = [{{ {shape}, collides = true }}]")
        })
        .collect();
    let places = (0..n).map(|i| {
        let grid = Vector3::new((i % 2) as f64, (i / 4) as f64, (i / 2 % 2) as f64);
        let mut x = || random.between(-1.0, 1.0);
        let position = 0.45 * grid + Vector3::new(0.02 * x(), 0.35 + 0.02 * x(), 0.02 * x());
        [position, Vector3::new(x(), x(), x()) * 2.0]
    });
    heap(ground, &solids, places)
}

#[test]
fn a_heap_of_all_shapes_falls_and_lies_without_gaining_energy() {
    let rough = map(30, 0.15, |x, z| 0.05 * ((7.0 * x).sin() + (5.0 * z).cos()));
    let grounds: [Arc<dyn Terrain>; 2] = [flat(), Arc::new(rough)];
    for (seed, ground) in grounds.into_iter().enumerate() {
        let mut simulation = heap_of_all_shapes(14, 3 + seed as u64, ground);
        let start = simulation.energy().potential;
        let (mut deepest, mut most) = (0.0_f64, 0);
        for step in 0..900 {
            let report = step_without_gain(&mut simulation, 1e-4);
            most = most.max(report.n_contacts);
            if step % 50 == 0 {
                deepest = deepest.min(overlap(&simulation));
            }
        }
        assert!(most > 25, "{seed}: {most} contacts");
        assert!(deepest > -0.01, "{seed}: {deepest}");
        // What is round rolls on.
        let energy = simulation.energy();
        assert!(energy.kinetic < 0.03 * start, "{seed}: {energy:?}");
    }
}
