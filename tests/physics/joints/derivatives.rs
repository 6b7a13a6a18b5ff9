//! Mass matrix, bias, Coriolis matrix and Jacobians of trees with every joint type, against finite
//! differences of the poses.

use nalgebra::{DMatrix, DVector, Vector3};
use rover_core::multibody::{Configuration, Factor, Kinematics, MassMatrix, Model};
use rover_core::scalar::Single;

use super::machines::{GRAVITY, ROOTS, menagerie, somewhere};
use crate::shared::{apart, near_in};

const H: f64 = 1e-5;

fn moved(model: &Model, q: &Configuration, v: &[f64], h: f64) -> Configuration {
    let mut at = q.clone();
    at.advance(model, v, h);
    at
}

fn mass_matrix(model: &Model, q: &Configuration) -> DMatrix<f64> {
    Kinematics::of(model, q).mass_matrix(model)
}

/// World position of a point of a body.
fn point(model: &Model, q: &Configuration, b: usize, p: &Vector3<f64>) -> Vector3<f64> {
    let kinematics = Kinematics::of(model, q);
    kinematics.origin(b) + kinematics.point(b, p)
}

/// `½ vᵀ M v` equals the kinetic energy of point masses with finite-difference velocities.
#[test]
fn the_mass_matrix_is_that_of_the_moving_points() {
    for root in ROOTS {
        let model = menagerie(root);
        for seed in [0.3, 1.1, 2.9] {
            let (q, v) = somewhere(&model, seed);
            let mut kinetic = 0.0;
            for (b, body) in model.bodies().iter().enumerate() {
                // A rigid body is equivalent to its mass at the centre and a pair of points along
                // each principal axis.
                let c = body.centre_of_mass;
                let axes = (body.principal_axes).unwrap_or_else(nalgebra::Matrix3::identity);
                let I = body.principal_inertia;
                let speed = |p: &Vector3<f64>| {
                    let ahead = point(&model, &moved(&model, &q, &v, H), b, p);
                    let behind = point(&model, &moved(&model, &q, &v, -H), b, p);
                    (ahead - behind) / (2.0 * H)
                };
                let centre = speed(&c);
                kinetic += 0.5 * body.mass * centre.norm_squared();
                for i in 0..3 {
                    // ∫ x_i² dm along axis i.
                    let second = 0.5 * (I.sum() - 2.0 * I[i]);
                    let axis: Vector3<f64> = axes.column(i).into();
                    let turning = speed(&(c + axis)) - centre;
                    kinetic += 0.5 * second * turning.norm_squared();
                }
            }
            for (k, inertia) in model.armatures() {
                kinetic += 0.5 * inertia * v[*k] * v[*k];
            }
            let M = mass_matrix(&model, &q);
            let v_column = DVector::from_column_slice(&v);
            let expected = 0.5 * v_column.dot(&(&M * &v_column));
            near_in(&root, kinetic, expected, 1e-8 * expected);
            let kinematics = Kinematics::of(&model, &q);
            let swept = kinematics.energy(&model, &v, &GRAVITY).kinetic;
            assert!((swept - expected).abs() < 1e-12 * expected);
        }
    }
}

#[test]
fn the_factor_solves_what_the_mass_matrix_multiplies() {
    for root in ROOTS {
        let model = menagerie(root);
        let (q, v) = somewhere(&model, 0.7);
        let (token, mechanism) = (Single::best(), model.mechanism());
        let kinematics = Kinematics::of(&model, &q);
        let mut M = MassMatrix::new(token, mechanism);
        M.update(mechanism, model.inertias(), kinematics.poses());
        let mut y = vec![0.0; model.nv()];
        M.times(mechanism, &v, &mut y);
        let dense = kinematics.mass_matrix(&model) * DVector::from_column_slice(&v);
        assert!((DVector::from_column_slice(&y) - dense).norm() < 1e-12);
        let mut factor = Factor::new(token, mechanism);
        assert!(M.factorise(mechanism, &mut factor));
        factor.half_solve(mechanism, &mut y);
        factor.half_solve_back(mechanism, &mut y);
        assert!(apart(&v, &y) < 1e-11, "{root:?}");
    }
}

/// `C v` and the bias of gravity add up to the bias, and `C + Cᵀ` is the rate of the mass matrix.
#[test]
fn the_coriolis_matrix_has_both_of_its_properties() {
    for root in ROOTS {
        let model = menagerie(root);
        let (q, v) = somewhere(&model, 1.9);
        let kinematics = Kinematics::of(&model, &q);
        let (C, weight) = kinematics.coriolis(&model, &v, &GRAVITY);
        let rate = (mass_matrix(&model, &moved(&model, &q, &v, H))
            - mass_matrix(&model, &moved(&model, &q, &v, -H)))
            / (2.0 * H);
        assert!(
            (&C + C.transpose() - &rate).norm() < 1e-8 * rate.norm().max(1.0),
            "{root:?} {}",
            (&C + C.transpose() - &rate).norm() / rate.norm()
        );
        let product = &C * DVector::from_column_slice(&v);
        for (gravity, sum) in [
            (Vector3::zeros(), product.clone()),
            (GRAVITY, product + DVector::from_vec(weight)),
        ] {
            let expected = DVector::from_vec(kinematics.bias(&model, &v, &gravity));
            assert!(
                (&sum - &expected).norm() < 1e-12 * expected.norm(),
                "{root:?} {sum} {expected}"
            );
        }
    }
}

/// The gravity part of the bias equals the gradient of the potential energy.
#[test]
fn gravity_is_the_slope_of_the_potential_energy() {
    for root in ROOTS {
        let model = menagerie(root);
        let nv = model.nv();
        let (q, _) = somewhere(&model, 0.4);
        let at_rest = vec![0.0; nv];
        let G = Kinematics::of(&model, &q).bias(&model, &at_rest, &GRAVITY);
        for k in 0..nv {
            let mut e = vec![0.0; nv];
            e[k] = 1.0;
            let potential = |h: f64| {
                let kinematics = Kinematics::of(&model, &moved(&model, &q, &e, h));
                kinematics.energy(&model, &at_rest, &GRAVITY).potential
            };
            let slope = (potential(H) - potential(-H)) / (2.0 * H);
            near_in(&(root, k), slope, G[k], 1e-7);
        }
    }
}

#[test]
fn jacobians_are_the_derivatives_of_the_points() {
    for root in ROOTS {
        let model = menagerie(root);
        let (q, v) = somewhere(&model, 2.2);
        let kinematics = Kinematics::of(&model, &q);
        let p = Vector3::new(0.3, -0.2, 0.5);
        let d = Vector3::new(0.6, 0.64, -0.48);
        for b in 0..model.bodies().len() {
            let speed = |v: &[f64]| {
                let ahead = point(&model, &moved(&model, &q, v, H), b, &p);
                (ahead - point(&model, &moved(&model, &q, v, -H), b, &p)) / (2.0 * H)
            };
            let x = kinematics.point(b, &p);
            let velocity = kinematics.point_velocity(&model, b, &x, &v);
            assert!((speed(&v) - velocity).norm() < 1e-8, "{root:?} {b}");
            let path = model.path(b);
            let mut row = vec![0.0; path.len()];
            kinematics.point_jacobian_row(&model, b, &x, &d, &mut row);
            let mut along = vec![0.0; model.nv()];
            for (entry, &k) in row.iter().zip(path) {
                along[k] = *entry;
            }
            for k in 0..model.nv() {
                let mut e = vec![0.0; model.nv()];
                e[k] = 1.0;
                near_in(&(root, b, k), speed(&e).dot(&d), along[k], 1e-8);
            }
        }
    }
}

#[test]
fn coordinates_survive_both_ways() {
    use rover_core::multibody::coordinates::{from_public, from_report, to_public, to_report};
    for root in ROOTS {
        let model = menagerie(root);
        let (q, v) = somewhere(&model, 0.2);
        let public = to_public(&model, &q);
        let back = from_public(&model, &public).unwrap();
        let (report, rates) = to_report(&model, &q, &v).unwrap();
        let again = from_report(&model, &report).unwrap();
        for other in [back, again] {
            let (a, b) = (Kinematics::of(&model, &q), Kinematics::of(&model, &other));
            for b_index in 0..model.bodies().len() {
                assert!((a.R(b_index) - b.R(b_index)).norm() < 1e-13);
                assert!((a.c(b_index) - b.c(b_index)).norm() < 1e-13);
            }
        }
        // The rates of the report's coordinates are their derivatives.
        let later = to_report(&model, &moved(&model, &q, &v, H), &v).unwrap().0;
        let sooner = to_report(&model, &moved(&model, &q, &v, -H), &v).unwrap().0;
        for k in 0..model.nv() {
            let rate = (later[k] - sooner[k]) / (2.0 * H);
            near_in(&(root, k), rate, rates[k], 1e-7);
        }
    }
}
