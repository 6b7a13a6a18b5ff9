//! Coriolis matrix `C(q, v)` with `C v = N(q, v) v` and `C + Cᵀ = Ṁ`: what a step needs to take gyroscopic terms implicitly.
//!
//! With the inertia I of a body, its spatial velocity V, and `B = ½ (V×* I + (I V)×̄* − I V×)`,
//!
//! ```text
//! C_jk = Σ S_jᵀ (I Ṡ_k + B S_k)      over the bodies that both j and k move
//! ```
//!
//! Spatial vectors are (angular, linear) at the trunk origin, world axes. `B + Bᵀ = İ` and `B V = V×* I V`, which gives both properties.
//!
//! Source: Echeandia, Wensing 2021, *Numerical methods to compute the Coriolis matrix and Christoffel symbols for rigid-body systems*,
//! J. Comput. Nonlinear Dynam. 16, 091004.

use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3, Vector6};

use super::kinematics::Kinematics;
use super::model::Model;
use crate::spatial::SymmetricMatrix3;

/// Scratch of [`coriolis_matrix`]: sized once for a model.
#[derive(Clone, Debug, Default)]
pub struct CoriolisScratch {
    velocity: Vec<Vector6<f64>>,
    inertia: Vec<Matrix6<f64>>,
    B: Vec<Matrix6<f64>>,
    S: Vec<Vector6<f64>>,
    S_dot: Vec<Vector6<f64>>,
}

/// `C(q, v)` (nv, nv) at the poses of `kinematics`, without gravity; `out` is overwritten.
///
/// `v`: (nv). Times a velocity it gives N and N m.
pub fn coriolis_matrix(
    model: &Model,
    kinematics: &Kinematics,
    v: &[f64],
    scratch: &mut CoriolisScratch,
    out: &mut DMatrix<f64>,
) {
    let bodies = model.bodies();
    let (n, nv) = (bodies.len(), model.nv());
    let s = scratch;
    s.velocity.resize(n, Vector6::zeros());
    s.inertia.resize(n, Matrix6::zeros());
    s.B.resize(n, Matrix6::zeros());
    s.S.resize(nv, Vector6::zeros());
    s.S_dot.resize(nv, Vector6::zeros());
    let origin_velocity = Vector3::new(v[0], v[1], v[2]);
    for k in 0..3 {
        let e = Vector3::ith(k, 1.0);
        s.S[k] = spatial(&Vector3::zeros(), &e);
        s.S_dot[k] = Vector6::zeros();
        // The trunk turns about its own origin, which moves.
        s.S[3 + k] = spatial(&e, &Vector3::zeros());
        s.S_dot[3 + k] = spatial(&Vector3::zeros(), &origin_velocity.cross(&e));
    }
    for (b, body) in bodies.iter().enumerate() {
        if b == 0 {
            s.velocity[0] = spatial(&Vector3::new(v[3], v[4], v[5]), &origin_velocity);
        } else {
            let a = kinematics.axis[b];
            let S = spatial(&a, &kinematics.r[b].cross(&a));
            let carrier = s.velocity[body.parent];
            s.S[5 + b] = S;
            s.S_dot[5 + b] = cross_motion(&carrier) * S;
            s.velocity[b] = carrier + S * v[5 + b];
        }
        let I = spatial_inertia(model, kinematics, b);
        let V = s.velocity[b];
        let across = cross_motion(&V);
        // V×* = −(V×)ᵀ
        s.B[b] = (cross_force_bar(&(I * V)) - across.transpose() * I - I * across) * 0.5;
        s.inertia[b] = I;
    }
    out.fill(0.0);
    for b in (0..n).rev() {
        let own = if b == 0 { 0..6 } else { 5 + b..6 + b };
        let (I, B) = (s.inertia[b], s.B[b]);
        for k in own {
            let F1 = I * s.S_dot[k] + B * s.S[k];
            let F2 = I * s.S[k];
            let F3 = B.transpose() * s.S[k];
            for &j in model.path(b).iter().take_while(|&&j| j <= k || b == 0) {
                out[(j, k)] = s.S[j].dot(&F1);
                out[(k, j)] = s.S_dot[j].dot(&F2) + s.S[j].dot(&F3);
            }
            out[(k, k)] = s.S[k].dot(&F1);
        }
        if b > 0 {
            let parent = bodies[b].parent;
            s.inertia[parent] += I;
            s.B[parent] += B;
        }
    }
}

fn spatial(angular: &Vector3<f64>, linear: &Vector3<f64>) -> Vector6<f64> {
    let (a, l) = (angular, linear);
    Vector6::new(a.x, a.y, a.z, l.x, l.y, l.z)
}

fn parts(x: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (
        Vector3::new(x[0], x[1], x[2]),
        Vector3::new(x[3], x[4], x[5]),
    )
}

fn blocks(a: &Matrix3<f64>, b: &Matrix3<f64>, c: &Matrix3<f64>, d: &Matrix3<f64>) -> Matrix6<f64> {
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(a);
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(b);
    out.fixed_view_mut::<3, 3>(3, 0).copy_from(c);
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(d);
    out
}

/// `V×`, the derivative of a motion vector that moves with V.
fn cross_motion(V: &Vector6<f64>) -> Matrix6<f64> {
    let (w, v) = parts(V);
    let (w, v) = (w.cross_matrix(), v.cross_matrix());
    blocks(&w, &Matrix3::zeros(), &v, &w)
}

/// `f×̄*` with `(f×̄*) V = V×* f`.
fn cross_force_bar(f: &Vector6<f64>) -> Matrix6<f64> {
    let (n, f) = parts(f);
    let (n, f) = (n.cross_matrix(), f.cross_matrix());
    blocks(&-n, &-f, &-f, &Matrix3::zeros())
}

fn spatial_inertia(model: &Model, kinematics: &Kinematics, b: usize) -> Matrix6<f64> {
    let body = &model.bodies()[b];
    let c = &kinematics.c[b];
    let A = match &body.principal_axes {
        None => kinematics.R[b],
        Some(P) => kinematics.R[b] * P,
    };
    let mut about_origin = SymmetricMatrix3::rotated_diagonal(&A, &body.principal_inertia);
    about_origin += SymmetricMatrix3::point_mass(body.mass, c);
    let moment = c.cross_matrix() * body.mass;
    blocks(
        &about_origin.to_matrix(),
        &moment,
        &moment.transpose(),
        &(Matrix3::identity() * body.mass),
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::multibody::bias::{BiasScratch, bias};
    use crate::multibody::{Configuration, MassMatrix};

    fn somewhere(model: &Model) -> (Configuration, Vec<f64>) {
        let mut q = Configuration::zero(model);
        let v: Vec<f64> = (0..model.nv()).map(|k| (1.7 * k as f64).sin()).collect();
        let turn: Vec<f64> = (0..model.nv()).map(|k| (0.3 + k as f64).cos()).collect();
        q.advance(&turn, 1.0);
        (q, v)
    }

    /// Also with welded joints, whose bodies have their mass centres off their origins.
    fn models() -> [Model; 2] {
        let rover = Model::rover();
        let joints = [
            ("right_bogie".to_owned(), 0.3),
            ("steering_FL".to_owned(), -0.4),
        ];
        let welded = rover.with_locked_joints(&joints).unwrap();
        [rover, welded]
    }

    #[test]
    fn times_the_velocity_it_is_the_bias_of_newton_and_euler() {
        for model in models() {
            let (q, v) = somewhere(&model);
            let kinematics = Kinematics::of(&model, &q);
            let mut C = DMatrix::zeros(model.nv(), model.nv());
            coriolis_matrix(
                &model,
                &kinematics,
                &v,
                &mut CoriolisScratch::default(),
                &mut C,
            );
            let product = &C * DVector::from_column_slice(&v);
            let mut expected = vec![0.0; model.nv()];
            let mut scratch = BiasScratch::new(&model);
            bias(
                &model,
                &kinematics,
                &v,
                &Vector3::zeros(),
                &mut scratch,
                &mut expected,
            );
            let expected = DVector::from_vec(expected);
            assert!((product - &expected).norm() < 1e-12 * expected.norm());
        }
    }

    #[test]
    fn with_its_transpose_it_is_the_rate_of_the_mass_matrix() {
        for model in models() {
            let (q, v) = somewhere(&model);
            let mut C = DMatrix::zeros(model.nv(), model.nv());
            let kinematics = Kinematics::of(&model, &q);
            coriolis_matrix(
                &model,
                &kinematics,
                &v,
                &mut CoriolisScratch::default(),
                &mut C,
            );
            let h = 1e-5;
            let mass_matrix_at = |time: f64| {
                let mut moved = q.clone();
                moved.advance(&v, time);
                let mut M = MassMatrix::new(&model);
                M.update(&model, &Kinematics::of(&model, &moved));
                M.to_dense(&model)
            };
            let rate = (mass_matrix_at(h) - mass_matrix_at(-h)) / (2.0 * h);
            assert!((&C + C.transpose() - &rate).norm() < 1e-8 * rate.norm());
        }
    }
}
