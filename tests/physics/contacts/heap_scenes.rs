//! Heaps: loose bodies that fall onto each other and onto the ground.

use std::sync::Arc;

use rover_core::geometry::{Plane, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Configuration, Model, ModelDescription};
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

/// Numbers in [−1, 1] that look random.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.next(), self.next(), self.next())
    }
}

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
    let description = ModelDescription::from_toml(&text).unwrap();
    let model = Arc::new(Model::from_description(description).unwrap());
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
    let options = StepOptions {
        time_step: 2e-3,
        ..StepOptions::default()
    };
    let mut simulation = RoverSimulation::new(model, ground, options).unwrap();
    simulation.set_state(q, v);
    simulation
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
    heap(Arc::new(Plane::ground()), &boxes, places)
}
