//! Heaps: loose bodies that fall onto each other and onto the ground.

use std::sync::Arc;

use rover_core::geometry::Terrain;
use rover_core::integrator::Variant;
use rover_core::multibody::Configuration;
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

use crate::shared::{Numbers, flat, model, moving, stepping};

/// Free bodies at rest on a ground, with steps of 2 ms. `solids`: what the description says of each
/// but its name and joint. `places`: position and scaled axis of rotation of each.
pub fn heap(
    ground: Arc<dyn Terrain>,
    solids: &[String],
    places: impl Iterator<Item = [Vector3<f64>; 2]>,
) -> RoverSimulation {
    let solids = solids.iter().enumerate();
    let solids: Vec<String> = solids
        .map(|(i, own)| format!("[[solids]]\nname = 'b{i}'\njoint = 'free'\n{own}\n"))
        .collect();
    let text = format!("name = 'heap'\n{}", solids.concat());
    let model = model(&text);
    let mut q = Configuration::zero(&model);
    for (i, [position, turn]) in places.enumerate() {
        let attitude = UnitQuaternion::from_scaled_axis(turn);
        if i == 0 {
            (q.position, q.attitude) = (position, attitude);
        } else {
            let other = &mut q.others[i - 1];
            (other.position, other.attitude) = (position, attitude);
        }
    }
    let v = vec![0.0; model.nv()];
    moving(model, ground, stepping(Variant::default(), 2e-3), q, v)
}

/// `side³` boxes of about 0.2 m and 6 to 10 kg, turned anyhow, on a grid that leaves some
/// centimetres between them; they fall with a millimetre's start on level ground.
pub fn heap_of_boxes(side: usize, seed: u64) -> RoverSimulation {
    let mut numbers = Numbers(seed);
    let count = side * side * side;
    let boxes: Vec<String> = (0..count)
        .map(|_| {
            let size = Vector3::new(0.2, 0.16, 0.24) + 0.03 * numbers.vector();
            let mass = 8.0 + 2.0 * numbers.next();
            format!(
                "mass = {mass}\ncollides = true\n\
                 shape = {{ kind = \"box\", size = [{}, {}, {}] }}",
                size.x, size.y, size.z
            )
        })
        .collect();
    let places = (0..count).map(|i| {
        let (level, row, column) = (i / (side * side), i / side % side, i % side);
        let grid = 0.3 * Vector3::new(column as f64, level as f64, row as f64);
        let position = grid + Vector3::new(0.0, 0.2, 0.0) + 0.02 * numbers.vector();
        [position, numbers.vector()]
    });
    heap(flat(), &boxes, places)
}
