//! Locked joints: the welded model is the full one with that joint held.

use nalgebra::DMatrix;
use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Kinematics, Model, coordinates, momentum};

use super::scenes::simulation;

fn dense(model: &Model, q: &[f64]) -> DMatrix<f64> {
    let kinematics = Kinematics::of(model, &coordinates::from_public(model, q).unwrap());
    kinematics.mass_matrix(model)
}

/// Full and welded model, and which of the full velocities the welded one keeps.
fn pair(joints: &[(&str, f64)]) -> (Model, Model, Vec<usize>) {
    let full = Model::rover();
    let named: Vec<(String, f64)> = joints.iter().map(|(n, a)| ((*n).to_owned(), *a)).collect();
    let welded = full.with_locked_joints(&named).unwrap();
    let is_named = |body: &str| joints.iter().any(|(name, _)| *name == body);
    let name_of = |k: usize| full.bodies()[full.body_of_velocity(k)].name.as_str();
    let is_locked = |k: usize| k >= 6 && is_named(name_of(k));
    let kept = (0..full.nv()).filter(|&k| !is_locked(k)).collect();
    (full, welded, kept)
}

#[test]
fn mass_matrix_is_the_block_of_the_full_one() {
    for joints in [
        vec![("steering_FL", 0.0), ("steering_FR", 0.0)],
        vec![("front_axle", 0.3)],
        vec![
            ("left_bogie", -0.2),
            ("wheel_ML", 1.1),
            ("steering_BR", 0.4),
        ],
        Model::rover().bodies()[1..]
            .iter()
            .map(|b| (b.name.as_str(), 0.25))
            .collect(),
    ] {
        let (full, welded, kept) = pair(&joints);
        assert_eq!(welded.nv() + joints.len(), full.nv());
        let mut q: Vec<f64> = (0..21).map(|k| 0.3 * f64::from(k).sin()).collect();
        for (name, angle) in &joints {
            q[full.joint_velocity(full.joint_index(name).unwrap())] = *angle;
        }
        let reduced: Vec<f64> = kept.iter().map(|&k| q[k]).collect();
        let (M, M_welded) = (dense(&full, &q), dense(&welded, &reduced));
        for (i, &a) in kept.iter().enumerate() {
            for (j, &b) in kept.iter().enumerate() {
                let error = (M[(a, b)] - M_welded[(i, j)]).abs();
                assert!(error < 1e-12 * M[(0, 0)], "{joints:?} ({a}, {b}): {error}");
            }
        }
        let places = |model: &Model, q: &[f64]| {
            let kinematics = Kinematics::of(model, &coordinates::from_public(model, q).unwrap());
            let origins: Vec<_> = model
                .frames()
                .iter()
                .map(|f| kinematics.point(f.body, &f.position))
                .collect();
            (origins, momentum::centre_of_mass(model, &kinematics))
        };
        let ((a, c), (b, d)) = (places(&full, &q), places(&welded, &reduced));
        assert!((c - d).norm() < 1e-12 && a.iter().zip(&b).all(|(x, y)| (x - y).norm() < 1e-12));
    }
}

#[test]
fn a_straight_drive_needs_no_steering_joints() {
    let steering = ["FL", "FR", "ML", "BL", "MR", "BR"].map(|w| format!("steering_{w}"));
    let joints: Vec<(&str, f64)> = steering.iter().map(|n| (n.as_str(), 0.0)).collect();
    let (full, welded, _) = pair(&joints);
    let ends = [full, welded].map(|model| {
        let mut q = vec![0.0; model.nv()];
        q[1] = 0.36;
        let zero = vec![0.0; model.nv()];
        let mut simulation = simulation(model, Plane::ground(), StepOptions::default(), &q, &zero);
        // Rigid enough to be a weld.
        if simulation.model().nv() == 21 {
            simulation
                .hold(&steering, Some(&[0.0; 6]), Some(1e9), Some(1e9))
                .unwrap();
        }
        simulation.set_wheel_torques(&[15.0; 6]).unwrap();
        assert!(simulation.step(800).unwrap().is_converged());
        simulation.q().position
    });
    assert!(ends[0].x > 3.0, "{ends:?}");
    assert!((ends[0] - ends[1]).norm() < 1e-7, "{ends:?}");
}
