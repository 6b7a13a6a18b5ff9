//! Rest on sand: sinkage under the weight, no creep, every step and mass.

use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::sand::{Bekker, Soil, StressLaw};
use rover_core::simulation::RoverSimulation;

use super::published_law::SIMULANT;
use super::sand_scenes::{bekker_sand, dry_sand, placed, total_force, wide};

/// Moves a rover up, m.
fn lift(sim: &mut RoverSimulation, way: f64) {
    let (mut q, v) = (sim.q().clone(), sim.v().to_vec());
    q.position.y += way;
    sim.set_state(q, v);
}

/// Mean of the forces of the sand on the wheels over so many steps, N.
fn mean_force(sim: &mut RoverSimulation, steps: usize) -> Vector3<f64> {
    let forces = (0..steps).map(|_| {
        sim.step(1).unwrap();
        total_force(sim)
    });
    forces.sum::<Vector3<f64>>() / steps as f64
}

/// After it has settled, a rover that is left alone stays where it is, on level sand and on ten
/// degrees, light or heavy, at every step; the sand bears its weight.
#[test]
fn a_rover_rests_without_creep() {
    let (sand, bekker) = (dry_sand(), bekker_sand());
    for (name, width, factor, soils) in [
        ("mars-rover", 0.4, 1.0, vec![&sand]),
        ("open-rover", 0.08, 3.0 / 12.7, vec![&sand, &bekker]),
    ] {
        let model = wide(name, width, factor);
        let weight = 9.81 * model.mass();
        for h in [0.005, 0.02] {
            for angle in [0.0, 10.0_f64.to_radians()] {
                for soil in &soils {
                    let mut sim = placed(&model, (*soil).clone(), angle, h);
                    sim.brake();
                    let settle = (2.0 / h) as usize;
                    let report = sim.step(settle).unwrap();
                    assert!(report.is_converged());
                    let before = sim.q().position;
                    sim.step(settle).unwrap();
                    let creep = (sim.q().position - before).norm() / 2.0;
                    let force = total_force(&sim);
                    assert!(creep < 1e-6, "{name} {h} {angle}: {creep} m/s");
                    let error = (force - Vector3::new(0.0, weight, 0.0)).norm();
                    assert!(
                        error < 0.01 * weight,
                        "{name} {h} {angle}: {force}, {weight}"
                    );
                }
            }
        }
    }
}

/// A heavy rover that falls into Bekker's soil sinks deeper than its weight needs. It comes to rest
/// there all the same.
#[test]
fn a_heavy_rover_comes_to_rest_in_bekkers_soil_after_a_fall() {
    let model = wide("mars-rover", 0.4, 1.0);
    let weight = 9.81 * model.mass();
    for (h, angle) in [(0.005, 0.0), (0.02, 0.0), (0.005, 10.0_f64.to_radians())] {
        let mut sim = placed(&model, bekker_sand(), angle, h);
        lift(&mut sim, 0.5);
        sim.brake();
        let settle = (1.5 / h) as usize;
        assert!(sim.step(settle).unwrap().is_converged());
        let before = sim.q().position;
        let mean = mean_force(&mut sim, settle);
        let creep = (sim.q().position - before).norm() / 1.5;
        assert!(creep < 1e-3, "{h} {angle}: {creep} m/s");
        let error = (mean - Vector3::new(0.0, weight, 0.0)).norm();
        assert!(error < 0.01 * weight, "{h} {angle}: {mean}, {weight}");
    }
}

/// Deep in Bekker's soil, which could bear thirty times the weight, a small displacement changes
/// the force by much. Steps are divided until the force is that at the solution.
#[test]
fn a_rover_that_is_placed_deep_in_bekkers_soil_rests() {
    let model = wide("mars-rover", 0.4, 1.0);
    let weight = 9.81 * model.mass();
    for h in [0.005, 0.02] {
        let mut sim = placed(&model, bekker_sand(), 10.0_f64.to_radians(), h);
        lift(&mut sim, -0.2);
        sim.brake();
        let steps = (0.5 / h) as usize;
        assert!(sim.step(steps).unwrap().is_converged());
        let mean = mean_force(&mut sim, steps);
        let error = (mean - Vector3::new(0.0, weight, 0.0)).norm();
        assert!(error < 0.02 * weight, "{h}: {mean}, {weight}");
    }
}

/// With the shear along the arc, wheels in Bekker's soil crept at rest, or their steps did not
/// converge: the shear changed its side within a rotation that no step resolves. Rovers rest along,
/// askew and across a slope, after they have driven up, rolled back or spun their wheels, with the
/// moving angle of greatest stress and with slip-sinkage.
#[test]
fn a_rover_rests_in_bekkers_soil_after_any_motion() {
    let moving = Bekker {
        stress_angle: 0.4,
        stress_angle_slip: 0.3,
        ..SIMULANT
    };
    let sinking = Bekker {
        stress_angle_slip: 0.3,
        slip_sinkage: 0.4,
        ..SIMULANT
    };
    let [moving, sinking] = [moving, sinking].map(|law| Soil {
        law: StressLaw::Bekker(law),
        ..bekker_sand()
    });
    let model = wide("open-rover", 0.08, 3.0 / 12.7);
    let weight = 9.81 * model.mass();
    for soil in [bekker_sand(), moving, sinking] {
        for (drive, turn) in [
            (0.0, 90.0),
            (0.0, 40.0),
            (0.3, 0.0),
            (-0.3, 0.0),
            (2.4, 0.0),
        ] {
            for h in [0.005, 0.02] {
                let mut sim = placed(&model, soil.clone(), 10.0_f64.to_radians(), h);
                let (mut q, v) = (sim.q().clone(), sim.v().to_vec());
                q.attitude *=
                    UnitQuaternion::from_axis_angle(&Vector3::y_axis(), f64::to_radians(turn));
                sim.set_state(q, v);
                sim.brake();
                let torque = drive * weight / 6.0 * model.wheels()[0].radius;
                if torque != 0.0 {
                    sim.set_wheel_torques(&[torque; 6]).unwrap();
                }
                let mut is_converged = sim.step((0.6 / h) as usize).unwrap().is_converged();
                sim.brake();
                let second = (1.0 / h) as usize;
                is_converged &= sim.step(2 * second).unwrap().is_converged();
                let before = sim.q().position;
                is_converged &= sim.step(second).unwrap().is_converged();
                let creep = (sim.q().position - before).norm();
                let error = (total_force(&sim) - Vector3::new(0.0, weight, 0.0)).norm();
                let scene = format!("drive {drive}, turned by {turn}, {h} s");
                assert!(is_converged, "{scene}");
                assert!(creep < 1e-6, "{scene}: {creep} m/s");
                assert!(error < 1e-3 * weight, "{scene}: {error} N");
            }
        }
    }
}
