//! The built-in rover with hulls in the place of its boxes moves as it does with boxes, in lanes
//! and in the general step.

use std::sync::Arc;

use rover_core::contact::Part;
use rover_core::geometry::Terrain;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Configuration, Model, ModelDescription, Shape, ShapeDescription};
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

use crate::shared::{apart, flat, moving, quantile, step_beside_the_general_one};
use crate::spheres::sphere_scenes::Random;
use crate::surfaces::surface_scenes::map;

/// The built-in rover, whose colliding boxes are hulls of their eight corners.
fn with_hulls() -> ModelDescription {
    let mut rover = ModelDescription::rover();
    for solid in rover.solids.iter_mut().filter(|solid| solid.collides) {
        let Some(Shape::Box { size }) = solid.shape.take() else {
            continue;
        };
        solid.collides = false;
        let points = (0..8).map(|k| {
            [0, 1, 2].map(|axis| size[axis] * if k >> axis & 1 == 1 { 0.5 } else { -0.5 })
        });
        solid.shapes = vec![ShapeDescription {
            shape: Shape::Hull {
                points: points.collect(),
            },
            position: None,
            rotation: None,
            collides: true,
            material: None,
            colour: None,
            visible: true,
            mass: None,
        }];
    }
    rover
}

fn fallen(description: ModelDescription, ground: &Arc<dyn Terrain>) -> RoverSimulation {
    let model = Model::from_description(description).unwrap();
    let mut q = Configuration::zero(&model);
    q.position.y = 0.6;
    q.attitude = UnitQuaternion::from_scaled_axis(Vector3::new(2.9, 0.2, 0.1));
    let mut random = Random(9);
    let v = (0..model.nv()).map(|_| random.between(-0.3, 0.3)).collect();
    moving(model, ground.clone(), StepOptions::default(), q, v)
}

#[test]
fn hulls_of_boxes_move_as_the_boxes_do() {
    let rough = map(40, 0.2, |x, z| 0.04 * ((3.0 * x).sin() + (4.0 * z).cos()));
    let grounds: [Arc<dyn Terrain>; 2] = [flat(), Arc::new(rough)];
    for (k, ground) in grounds.iter().enumerate() {
        let mut boxes = fallen(ModelDescription::rover(), ground);
        let mut hulls = fallen(with_hulls(), ground);
        let (mut met, mut fallbacks) = (0, 0);
        let mut differences = [Vec::new(), Vec::new()];
        for _ in 0..120 {
            // The same start for both, and for the general step: without a memory of impulses.
            let (q, v) = (boxes.q().clone(), boxes.v().to_vec());
            boxes.set_state(q.clone(), v.clone());
            hulls.set_state(q, v);
            boxes.step(1).unwrap();
            let (report, difference) = step_beside_the_general_one(&mut hulls);
            assert!(report.is_converged());
            fallbacks += report.fallbacks;
            let is_hull = |part: &Part| matches!(part, Part::Collider(_));
            met += hulls
                .contacts()
                .iter()
                .filter(|a| is_hull(&a.contact.part))
                .count();
            differences[0].push(apart(hulls.v(), boxes.v()));
            differences[1].push(difference);
        }
        assert!(met > 50, "{k}: {met}");
        assert!(fallbacks < 30, "{k}: {fallbacks}");
        for (other, differences) in differences.into_iter().enumerate() {
            // A few friction problems have several answers.
            let typical = quantile(differences, 85);
            assert!(typical < 1e-8, "{k} {other}: {typical:e}");
        }
    }
}
