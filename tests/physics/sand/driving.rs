//! Driving on sand: energy, snapshots, order, rocks, ruts.

use std::sync::Arc;

use rover_core::geometry::{Plane, SoftGround, SphereField, Terrain, Union};
use rover_core::simulation::RoverSimulation;

use super::sand_scenes::{dry_sand, placed, wide};
use crate::shared::moving;

fn driven(h: f64) -> RoverSimulation {
    let model = wide("open-rover", 0.08, 1.0);
    let mut sim = placed(&model, dry_sand(), 0.0, h);
    sim.set_wheel_torques(&[1.0; 6]).unwrap();
    sim
}

fn steps(time: f64, h: f64) -> usize {
    (time / h).round() as usize
}

/// The sand takes energy; it never gives more than it took. What the drives put in is what the
/// rover has and the sand took, apart from the errors of the step.
#[test]
fn sand_takes_energy_and_creates_none() {
    let mut sim = driven(0.005);
    let mut before = sim.energy();
    for _ in 0..40 {
        let report = sim.step(10).unwrap();
        assert!(report.is_converged());
        let absorbed: f64 = sim.sand().unwrap().wheels.iter().map(|w| w.absorbed).sum();
        assert!(absorbed > -1e-9, "{absorbed}");
        let after = sim.energy();
        let gained = after.kinetic + after.potential - before.kinetic - before.potential;
        assert!(gained <= sim.last_call().positive_work + 1.0, "{gained}");
        before = after;
    }
    let sinkage = sim.sand().unwrap().wheels.iter().map(|w| w.sinkage);
    assert!(sinkage.fold(0.0, f64::max) > 0.002);
    assert!(sim.q().position.x > 0.1, "{}", sim.q().position);
    assert!(!sim.sand().unwrap().ruts.is_empty());
}

#[test]
fn a_snapshot_continues_bit_for_bit() {
    let mut sim = driven(0.005);
    sim.step(150).unwrap();
    let snapshot = sim.snapshot();
    sim.step(100).unwrap();
    let (q, v, sand) = (sim.q().clone(), sim.v().to_vec(), sim.sand().cloned());
    let text = serde_json::to_string(&snapshot).unwrap();
    let read = serde_json::from_str(&text).unwrap();
    let mut other = driven(0.005);
    other.restore(&read).unwrap();
    other.step(100).unwrap();
    assert_eq!(other.q(), &q);
    assert_eq!(other.v(), &v[..]);
    assert_eq!(other.sand().cloned(), sand);
}

/// The place after half a second converges with the step, at first order: forces of the sand are
/// those at the end of the step.
#[test]
fn the_path_converges_at_first_order() {
    let end = |h: f64| {
        let mut sim = driven(h);
        sim.step(steps(0.5, h)).unwrap();
        sim.q().position
    };
    let exact = end(0.000_25);
    let errors = [0.008, 0.004, 0.002].map(|h| (end(h) - exact).norm());
    assert!(errors[0] < 0.01, "{errors:?}");
    let order = (errors[0] / errors[2]).log2() / 2.0;
    assert!(order > 0.7, "{order} {errors:?}");
}

/// A rock on sand is a rigid contact of the same problem.
#[test]
fn wheels_touch_rocks_that_lie_on_sand() {
    let model = wide("open-rover", 0.08, 1.0);
    let plane = Plane::new([0.0, 1.0, 0.0], 0.0).unwrap();
    let sand = SoftGround::new(Arc::new(plane), Arc::new(dry_sand()), 0.02).unwrap();
    let field = placed(&model, dry_sand(), 0.0, 0.005);
    let start = field.q().clone();
    let kinematics = field.kinematics();
    let wheel = &model.wheels()[0];
    let c = kinematics.origin(wheel.body) + kinematics.point(wheel.body, &wheel.centre);
    let rock = SphereField::new(&[[c.x + 0.16, 0.0, c.z]], &[0.05], None).unwrap();
    let union: Arc<dyn Terrain> =
        Arc::new(Union::new(vec![Arc::new(sand) as Arc<dyn Terrain>, Arc::new(rock)]).unwrap());
    let (options, v) = (field.options().clone(), vec![0.0; model.nv()]);
    let mut sim = moving(model, union, options, start, v);
    sim.set_wheel_torques(&[1.5; 6]).unwrap();
    let mut touched = false;
    for _ in 0..400 {
        let report = sim.step(1).unwrap();
        assert!(report.is_converged());
        touched |= !sim.contacts().is_empty();
    }
    assert!(touched);
    assert!(sim.sand().unwrap().wheels.iter().any(|w| w.sinkage > 0.0));
}

/// The report's rover has wheels without width: sand bears none of its 960 kg, and it sinks until
/// its trunk lies on the ground.
#[test]
fn the_rover_of_the_report_sinks_to_its_trunk() {
    let model = Arc::new(rover_core::multibody::Model::rover());
    let mut sim = placed(&model, dry_sand(), 0.0, 0.005);
    sim.brake();
    sim.step(400).unwrap();
    let deepest = |sim: &RoverSimulation| {
        let wheels = sim.sand().unwrap().wheels.iter();
        wheels.map(|wheel| wheel.sinkage).fold(0.0, f64::max)
    };
    assert!(deepest(&sim) > 0.14, "{}", deepest(&sim));
    assert!((sim.q().position.y - 0.2).abs() < 1e-3);
    assert!(!sim.contacts().is_empty());
}
