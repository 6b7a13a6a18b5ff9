//! The six-wheel rover in its plane of symmetry: the full rover, with less of it.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, SVector, Vector2, Vector3};
use rover_core::geometry::Plane;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::bias::BiasScratch;
use rover_core::multibody::{Kinematics, MassMatrix, Model, ModelDescription, bias, coordinates};
use rover_core::planar::{
    ContactRule, Line, MirroredRover, MirroredRoverSimulation, PlanarError, PlanarMachine,
};
use rover_core::simulation::Simulation;

use crate::scenes::{G, VARIANTS, options};

fn planar() -> MirroredRover<7> {
    MirroredRover::new(&Model::rover()).unwrap()
}

/// `P`: planar velocities to those of the full model.
fn injection(rover: &MirroredRover<7>) -> DMatrix<f64> {
    let mut P = DMatrix::zeros(rover.model().nv(), 7);
    for k in 0..7 {
        for i in rover.full_indices(k) {
            P[(i, k)] = 1.0;
        }
    }
    P
}

#[test]
fn mass_matrix_and_bias_are_the_full_ones_projected() {
    let rover = planar();
    let (model, P) = (rover.model(), injection(&rover));
    for seed in 0..10 {
        let number = |k: usize| (1.7 * f64::from(seed) + 0.9 * k as f64).sin();
        let q = SVector::<f64, 7>::from_fn(|k, _| number(k));
        let w = SVector::<f64, 7>::from_fn(|k, _| 2.0 * number(k + 30));
        let (full_q, full_v) = (&P * q, &P * w);
        let place = coordinates::from_public(model, full_q.as_slice()).unwrap();
        let kinematics = Kinematics::of(model, &place);
        let mut M = MassMatrix::new(model);
        M.update(model, &kinematics);
        let expected = P.transpose() * M.to_dense(model) * &P;
        let ours = rover.mass_matrix(&q);
        assert!((expected - ours).norm() < 1e-12 * ours.norm());

        let mut b = vec![0.0; model.nv()];
        let gravity = Vector3::new(0.3, -G, 0.0);
        let mut scratch = BiasScratch::new(model);
        bias(
            model,
            &kinematics,
            full_v.as_slice(),
            &gravity,
            &mut scratch,
            &mut b,
        );
        let force = rover.force(&q, &w, &Vector2::new(0.3, -G), &[0.0; 3]);
        let expected = P.transpose() * DVector::from_vec(b);
        assert!((expected + force).norm() < 1e-12 * force.norm());
    }
}

#[test]
fn point_jacobians_are_the_discs_rates() {
    let rover = planar();
    let q = SVector::<f64, 7>::from_fn(|k, _| 0.4 * (k as f64).cos());
    let step = 1e-6;
    for disc in 0..3 {
        let centre = rover.disc(disc, &q).centre;
        let J = rover.point_jacobian(disc, &q, &centre);
        for k in 0..7 {
            let at = |x: f64| {
                let mut q = q;
                q[k] += x;
                rover.disc(disc, &q).centre
            };
            let rate = (at(step) - at(-step)) / (2.0 * step);
            assert!((rate - J.column(k)).norm() < 1e-9);
        }
    }
}

/// Six coordinates of the base and free pairs against the planar image: dropped from a hand's breadth, driven for ten seconds.
fn largest_distance(slope: f64, torque: f64, options: &StepOptions) -> f64 {
    let planar = planar();
    let P = injection(&planar);
    let model = Arc::new(planar.model().clone());
    let normal = Vector3::new(-slope, 1.0, 0.0).normalize();
    let mut q = SVector::<f64, 7>::zeros();
    q[1] = 0.4 * (1.0 + slope * slope).sqrt();
    q[2] = slope.atan();
    let start = &P * q;
    let mut full = Simulation::new(
        model,
        Arc::new(Plane::new(normal.into(), 0.0).unwrap()),
        options.clone(),
    )
    .unwrap();
    let configuration = coordinates::from_public(full.model(), start.as_slice()).unwrap();
    let zero = vec![0.0; start.len()];
    full.set_state(configuration, zero);
    full.set_wheel_torques(&[torque; 6]).unwrap();
    let line = Arc::new(Line::new(slope, 0.0).unwrap());
    let mut reduced =
        MirroredRoverSimulation::new(planar, line, ContactRule::Nearest, options.clone()).unwrap();
    reduced.set_state(q.as_slice(), &[0.0; 7]).unwrap();
    reduced.set_inputs(&[torque; 3]).unwrap();
    let mut largest = 0.0_f64;
    for _ in 0..200 {
        assert!(full.step(10).unwrap().is_converged());
        assert!(reduced.step(10).unwrap().is_converged());
        let full_q = coordinates::to_public(&full.state().configuration);
        largest = largest.max((DVector::from_vec(full_q) - &P * reduced.q()).amax());
    }
    assert!(reduced.q()[0].abs() > 2.0, "it drives: {}", reduced.q()[0]);
    largest
}

#[test]
fn ten_seconds_straight_ahead_are_those_of_the_full_rover() {
    for variant in VARIANTS {
        // The Newton variant of the tree balances momenta of solids, the planar one forces: equal to second order only.
        let bound = match variant {
            Variant::Linearised => 1e-8,
            Variant::Newton => 5e-4,
        };
        for slope in [0.0, 0.05, -0.2] {
            let options = StepOptions {
                variant,
                ..options(G, 0.7, 0.0, 0.005)
            };
            let distance = largest_distance(slope, 15.0, &options);
            assert!(distance < bound, "{variant:?}, slope {slope}: {distance:e}");
        }
    }
}

#[test]
fn at_the_motors_line_the_planar_rover_is_as_fast_as_the_full_one() {
    // 60 N m come to their line at 24 rad/s within four seconds; downhill the motors brake at 30 rad/s.
    for (variant, bound) in VARIANTS.into_iter().zip([1e-8, 5e-4]) {
        for (slope, torque) in [(0.0, 60.0), (-0.2, 0.0)] {
            let options = StepOptions {
                variant,
                ..options(G, 0.7, 0.0, 0.005)
            };
            let distance = largest_distance(slope, torque, &options);
            assert!(distance < bound, "{variant:?}, slope {slope}: {distance:e}");
        }
    }
}

#[test]
fn a_rover_without_a_mirror_image_is_refused_by_name() {
    let mut description = ModelDescription::rover();
    let bogie = description
        .solids
        .iter_mut()
        .find(|s| s.name == "right_bogie");
    bogie.unwrap().mass = 51.0;
    let model = Model::from_description(description).unwrap();
    let refused = MirroredRover::<7>::new(&model).unwrap_err();
    assert_eq!(refused.field(), "model");
    let PlanarError::NotMirrored { body } = refused else {
        panic!("{refused}");
    };
    assert_eq!(body, "left_bogie");

    let bent = Model::rover()
        .with_locked_joints(&[("steering_ML".to_owned(), 0.1)])
        .unwrap();
    assert!(matches!(
        MirroredRover::<7>::new(&bent),
        Err(PlanarError::NotMirrored { .. })
    ));
    let stiff = Model::rover()
        .with_locked_joints(&[
            ("left_bogie".to_owned(), 0.0),
            ("right_bogie".to_owned(), 0.0),
        ])
        .unwrap();
    assert_eq!(
        MirroredRover::<7>::new(&stiff).unwrap_err(),
        PlanarError::CoordinateCount {
            expected: 7,
            count: 6
        }
    );
}
