//! The six-wheel rover in its plane of symmetry moves as the full rover.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, SVector, Vector2, Vector3};
use rover_core::geometry::Plane;
use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{Kinematics, Model, ModelDescription, Motor, coordinates};
use rover_core::planar::{Line, MirroredRover, PlanarError, Sine};

use super::scenes::{G, VARIANTS, at_rest, force, level, mass_matrix, options, options_of, placed};
use crate::shared::{limits, moving};

fn planar() -> MirroredRover {
    MirroredRover::new(&Model::rover()).unwrap()
}

/// Without motors, whose torques do not depend on the speed, and with
/// motors weak enough to reach their line in a second.
fn with_and_without_motors() -> [MirroredRover; 3] {
    let weak = |regenerating| Motor {
        stall_torque: 120.0,
        no_load_speed: 6.0,
        regenerating,
    };
    [None, Some(weak(true)), Some(weak(false))]
        .map(|motor| MirroredRover::new(&Model::rover().with_motors(motor).unwrap()).unwrap())
}

/// `P`: planar velocities to those of the full model.
fn injection(rover: &MirroredRover) -> DMatrix<f64> {
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
        let expected = P.transpose() * kinematics.mass_matrix(model) * &P;
        let ours = mass_matrix(rover.tree(), &q);
        assert!((expected - ours).norm() < 1e-12 * ours.norm());

        let gravity = Vector3::new(0.3, -G, 0.0);
        let b = kinematics.bias(model, full_v.as_slice(), &gravity);
        let force = force(rover.tree(), &q, &w, &Vector2::new(0.3, -G), &[0.0; 3]);
        let expected = P.transpose() * DVector::from_vec(b);
        assert!((expected + force).norm() < 1e-12 * force.norm());
    }
}

#[test]
fn point_jacobians_are_the_discs_rates() {
    let rover = planar();
    let tree = rover.tree();
    let q = SVector::<f64, 7>::from_fn(|k, _| 0.4 * (k as f64).cos());
    let step = 1e-6;
    for disc in 0..3 {
        let at = |q: &SVector<f64, 7>| tree.disc(disc, &tree.poses(q.as_slice())).centre;
        let (mut J, axes) = (Vec::new(), [Vector2::x(), Vector2::y()]);
        tree.push_rows(disc, &tree.poses(q.as_slice()), &at(&q), &axes, &mut J);
        for k in 0..7 {
            let mut shift = SVector::zeros();
            shift[k] = step;
            let rate = (at(&(q + shift)) - at(&(q - shift))) / (2.0 * step);
            assert!((rate - Vector2::new(J[k], J[7 + k])).norm() < 1e-9);
        }
    }
}

/// Six coordinates of the base and free pairs against the planar image:
/// dropped from a hand's breadth, driven for ten seconds.
fn largest_distance(
    planar: MirroredRover,
    slope: f64,
    torques: impl Fn(f64) -> f64,
    options: &StepOptions,
) -> f64 {
    let P = injection(&planar);
    let model = planar.model().clone();
    let normal = Vector3::new(-slope, 1.0, 0.0).normalize();
    let mut q = SVector::<f64, 7>::zeros();
    q[1] = 0.4 * (1.0 + slope * slope).sqrt();
    q[2] = slope.atan();
    let start = coordinates::from_public(&model, (&P * q).as_slice()).unwrap();
    let v = vec![0.0; model.nv()];
    let plane = Arc::new(Plane::new(normal.into(), 0.0).unwrap());
    let mut full = moving(model, plane, options.clone(), start, v);
    let line = Line::new(slope, 0.0).unwrap();
    let start: [f64; 7] = q.into();
    let mut reduced = at_rest(line, planar, options.clone(), start);
    let (mut largest, mut way) = (0.0_f64, 0.0_f64);
    for _ in 0..200 {
        let torque = torques(full.time());
        full.set_wheel_torques(&[torque; 6]).unwrap();
        reduced.set_inputs(&[torque; 3]).unwrap();
        assert!(full.step(10).unwrap().is_converged());
        assert!(reduced.step(10).unwrap().is_converged());
        let full_q = coordinates::to_public(full.model(), full.q());
        way = way.max(reduced.q()[0].abs());
        let image = &P * SVector::<f64, 7>::from_column_slice(reduced.q());
        largest = largest.max((DVector::from_vec(full_q) - image).amax());
    }
    assert!(way > 2.0, "it drives: {way}");
    largest
}

#[test]
fn ten_seconds_straight_ahead_are_those_of_the_full_rover() {
    for variant in VARIANTS {
        // The Newton variant of the tree balances momenta of solids, the
        // planar one forces: equal to second order only.
        let bound = match variant {
            Variant::Linearised => 1e-8,
            Variant::Newton => 5e-4,
        };
        for slope in [0.0, 0.05, -0.2] {
            let options = options_of(variant, G, 0.7, 0.0, 0.005);
            for planar in with_and_without_motors() {
                let distance = largest_distance(planar, slope, |_| 15.0, &options);
                assert!(distance < bound, "{variant:?}, slope {slope}: {distance:e}");
            }
        }
    }
}

/// The motors reach their torque–speed lines, exceed their no-load speed downhill, and brake. The
/// image once ignored the lines and was 90 m ahead.
#[test]
fn full_throttle_is_that_of_the_full_rover_to_the_motors_line_and_beyond() {
    // Downhill in either direction, five seconds full ahead and five full astern.
    let swinging = |t: f64| if t % 10.0 < 5.0 { 60.0 } else { -60.0 };
    let options = options(G, 0.7, 0.0, 0.005);
    for slope in [0.05, -0.05] {
        for planar in with_and_without_motors() {
            let distance = largest_distance(planar, slope, swinging, &options);
            assert!(distance < 1e-8, "slope {slope}: {distance:e}");
        }
    }
}

/// Locked joints leave the plane fewer coordinates.
#[test]
fn a_stiff_rover_has_one_coordinate_less() {
    let locked = ["left_bogie", "right_bogie"].map(|name| (name.to_owned(), 0.0));
    let stiff = Model::rover().with_locked_joints(&locked).unwrap();
    let rover = MirroredRover::new(&stiff).unwrap();
    assert_eq!(rover.tree().nv(), 6);
    let q = [0.0, 0.4, 0.0, 0.0, 0.0, 0.0];
    let mut rover = at_rest(level(), rover, options(G, 0.7, 0.0, 0.005), q);
    rover.set_inputs(&[15.0; 3]).unwrap();
    assert!(rover.step(400).unwrap().is_converged());
    assert!(rover.q()[0] > 0.2, "it drives: {:?}", rover.q());
}

#[test]
fn a_pair_of_unlike_motors_is_refused_by_name() {
    let mut description = ModelDescription::rover();
    description.wheels[0].motor = None;
    let model = Model::from_description(description).unwrap();
    let refused = MirroredRover::new(&model).unwrap_err();
    let name = model.wheels()[1].name.clone();
    assert_eq!(refused, PlanarError::NotMirrored { body: name });
}

#[test]
fn the_torques_are_those_that_the_motors_can_give() {
    let options = options(G, 0.7, 0.0, 0.005);
    let mut rover = at_rest(level(), planar(), options, [0.0; 7]);
    rover.set_inputs(&[1e3, -1e3, 10.0]).unwrap();
    // They once stood there as given, while a different torque acted.
    assert_eq!(*rover.command(), [150.0, -150.0, 10.0]);
}

/// Wheels held by friction in the valleys of a steep wave had to bounce off both slopes at once. No
/// velocity does, and thousands of iterations searched for one.
#[test]
fn where_restitution_has_no_answer_the_impact_is_inelastic() {
    for variant in VARIANTS {
        let options = options_of(variant, G, 1.9, 0.5, 0.005);
        let wave = Sine::new(0.43, 0.366, 0.0, 0.0).unwrap();
        let q = [0.119, 0.49, -0.29, 0.0, -0.25, 0.0, 0.0];
        let v = [0.5, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut rover = placed(wave, planar(), options, q, v);
        let mut retaken = 0;
        for k in 0..300 {
            let report = rover.step(1).unwrap();
            retaken += report.retaken;
            assert!(report.is_converged(), "{variant:?}, step {k}: {report:?}");
        }
        assert!(retaken > 0);
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
    let refused = MirroredRover::new(&model).unwrap_err();
    assert_eq!(refused.field(), "model");
    let body = "left_bogie".to_owned();
    let not_mirrored = PlanarError::NotMirrored { body };
    assert_eq!(refused, not_mirrored);

    let mut stopped = ModelDescription::rover();
    for solid in &mut stopped.solids {
        if solid.name.ends_with("bogie") {
            solid.limits = Some(limits(-0.5, 0.5));
        }
    }
    let stopped = Model::from_description(stopped).unwrap();
    assert_eq!(MirroredRover::new(&stopped).unwrap_err(), not_mirrored);

    let bent = Model::rover()
        .with_locked_joints(&[("steering_ML".to_owned(), 0.1)])
        .unwrap();
    assert!(matches!(
        MirroredRover::new(&bent),
        Err(PlanarError::NotMirrored { .. })
    ));
}
