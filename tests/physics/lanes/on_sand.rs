//! Rovers on sand in a batch: they move as they would alone, to the last bit, and as the general
//! step moves them.

use std::sync::Arc;

use rover_core::geometry::{Plane, SoftGround, SphereField, Terrain, Union};
use rover_core::multibody::Model;
use rover_core::sand::Soil;
use rover_core::scalar::Instructions;
use rover_core::simulation::RoverSimulation;
use rover_core::simulation::lane_batch::LaneBatch;

use super::lane_batch::{advance, assert_alike, command};
use super::surfaces::hills;
use crate::sand::sand_scenes::{bekker_sand, dry_sand, placed, wide};
use crate::shared::{Numbers, moving, quantile, step_beside_the_general_one};

fn soft(surface: Arc<dyn Terrain>, soil: Soil) -> Arc<dyn Terrain> {
    Arc::new(SoftGround::new(surface, Arc::new(soil), 0.02).unwrap())
}

/// Dry sand, with rocks, on hills, or on a slope; Bekker's sand; firm ground.
fn terrains() -> Vec<Arc<dyn Terrain>> {
    let plane = |normal| Arc::new(Plane::new(normal, 0.0).unwrap());
    let flat = || soft(plane([0.0, 1.0, 0.0]), dry_sand());
    let rocks: Vec<[f64; 3]> = (0..40)
        .map(|k| {
            [
                f64::from(k % 8) * 0.4 - 1.4,
                -0.02,
                f64::from(k / 8) * 0.35 - 0.7,
            ]
        })
        .collect();
    let rocks = SphereField::new(&rocks, &[0.06; 40], None).unwrap();
    vec![
        flat(),
        Arc::new(Union::new(vec![flat(), Arc::new(rocks)]).unwrap()),
        soft(hills(0.2, 5), dry_sand()),
        soft(plane([-0.1_f64.sin(), 0.1_f64.cos(), 0.0]), dry_sand()),
        soft(plane([0.0, 1.0, 0.0]), bekker_sand()),
        Arc::new(Union::new(vec![flat(), hills(0.2, 5)]).unwrap()),
        plane([0.0, 1.0, 0.0]),
    ]
}

fn rovers(model: &Arc<Model>, n: usize, numbers: &mut Numbers) -> Vec<RoverSimulation> {
    let (terrains, start) = (terrains(), placed(model, dry_sand(), 0.0, 0.005));
    let rovers = (0..n).map(|i| {
        let terrain = Arc::clone(&terrains[i % terrains.len()]);
        let mut q = start.q().clone();
        q.position.y += 0.05 + 0.05 * numbers.next();
        let v = (0..model.nv()).map(|_| 0.1 * numbers.next()).collect();
        moving(Arc::clone(model), terrain, start.options().clone(), q, v)
    });
    rovers.collect()
}

/// Torques that jump, on wheels with rounded edges, beside a rover on firm ground. In the middle of
/// the drive each rover of the batch is replaced by one that continues from its snapshot.
#[test]
fn a_rover_moves_as_it_would_alone() {
    let model = wide("open-rover", 0.08, 1.0);
    for instructions in Instructions::all_of_this_machine() {
        for (n, torque) in [(8, 2.0), (13, 0.5)] {
            let mut numbers = Numbers(n as u64);
            let mut together = rovers(&model, n, &mut numbers);
            let mut alone = together.clone();
            let mut batch = LaneBatch::new(instructions);
            for k in 0..8 {
                for (a, b) in together.iter_mut().zip(&mut alone) {
                    let mut same = Numbers(numbers.0);
                    command(a, torque, &mut numbers);
                    command(b, torque, &mut same);
                }
                let errors = advance(&mut batch, &mut together);
                assert!(errors.iter().all(Option::is_none), "{errors:?}");
                for (a, b) in together.iter_mut().zip(&mut alone) {
                    b.step(10).unwrap();
                    assert_alike(a, b);
                }
                if k == 4 {
                    for own in &mut together {
                        let text = serde_json::to_string(&own.snapshot()).unwrap();
                        own.set_state(own.q().clone(), vec![0.0; model.nv()]);
                        own.restore(&serde_json::from_str(&text).unwrap()).unwrap();
                    }
                }
            }
            let in_ruts =
                |rover: &&RoverSimulation| rover.sand().is_some_and(|sand| !sand.ruts.is_empty());
            assert!(together.iter().filter(in_ruts).count() > n / 2);
        }
    }
}

/// Where firm hills rise out of the sand a step takes the usual effort, and is what all effort
/// makes of the same state.
#[test]
fn firm_hills_beside_sand_are_met_with_the_usual_effort() {
    let model = wide("open-rover", 0.08, 1.0);
    let union = Union::new(vec![terrains()[0].clone(), hills(0.2, 5)]).unwrap();
    let start = placed(&model, dry_sand(), 0.0, 0.005);
    let (q, v) = (start.q().clone(), vec![0.0; model.nv()]);
    let mut own = moving(model, Arc::new(union), start.options().clone(), q, v);
    own.set_wheel_torques(&[1.0; 6]).unwrap();
    let (mut fallbacks, mut on_firm) = (0, 0);
    let mut differences = Vec::new();
    for _ in 0..200 {
        let (report, difference) = step_beside_the_general_one(&mut own);
        fallbacks += report.fallbacks;
        on_firm += own.contacts().len();
        differences.push(difference);
    }
    assert!(fallbacks < 10, "{fallbacks} steps of 200");
    assert!(on_firm > 200, "{on_firm} contacts");
    let typical = quantile(differences, 90);
    assert!(typical < 1e-3, "{typical:e}");
}

/// In a steady drive on sand no step is left to the general one. Each is what the general step
/// makes of the same state, up to what the sand is allowed to be off.
#[test]
fn the_quick_step_obeys_the_law_of_the_general_one() {
    let mut own = placed(&wide("open-rover", 0.08, 1.0), dry_sand(), 0.0, 0.005);
    own.set_wheel_torques(&[1.0; 6]).unwrap();
    let mut differences = Vec::new();
    for _ in 0..300 {
        let (report, difference) = step_beside_the_general_one(&mut own);
        assert!(report.is_converged());
        assert_eq!(report.fallbacks, 0);
        differences.push(difference);
    }
    let n_other = differences.iter().filter(|x| **x >= 1e-9).count();
    assert!(n_other <= 3, "{n_other}: {differences:?}");
}
