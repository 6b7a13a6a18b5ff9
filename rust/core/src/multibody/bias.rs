//! Bias `N(q, v) v + G(q)` by recursive Newton–Euler: what must be pushed to keep all accelerations zero.
//!
//! Source: Luh, Walker, Paul 1980; here in world axes about the trunk origin.

use nalgebra::Vector3;

use super::kinematics::Kinematics;
use super::model::Model;

/// Scratch of [`bias`]: sized once for a model.
#[derive(Clone, Debug)]
pub struct BiasScratch {
    omega: Vec<Vector3<f64>>,
    alpha: Vec<Vector3<f64>>,
    origin: Vec<Vector3<f64>>,
    force: Vec<Vector3<f64>>,
    moment: Vec<Vector3<f64>>,
}

impl BiasScratch {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let zeros = vec![Vector3::zeros(); model.bodies().len()];
        Self {
            omega: zeros.clone(),
            alpha: zeros.clone(),
            origin: zeros.clone(),
            force: zeros.clone(),
            moment: zeros,
        }
    }
}

/// Bias `b` in `M v̇ + b = τ`: Coriolis, centrifugal, gyroscopic and gravity terms.
///
/// `v`, `out`: (nv), N for the first three, N m for the others. `gravity`: m/s², world.
pub fn bias(
    model: &Model,
    kinematics: &Kinematics,
    v: &[f64],
    gravity: &Vector3<f64>,
    scratch: &mut BiasScratch,
    out: &mut [f64],
) {
    let bodies = model.bodies();
    let s = scratch;
    s.omega[0] = Vector3::new(v[3], v[4], v[5]);
    s.alpha[0] = Vector3::zeros();
    s.origin[0] = Vector3::zeros();
    for (b, body) in bodies.iter().enumerate() {
        if b > 0 {
            let p = body.parent;
            let d = kinematics.r[b] - kinematics.r[p];
            let spin = kinematics.axis[b] * v[5 + b];
            s.origin[b] =
                s.origin[p] + s.alpha[p].cross(&d) + s.omega[p].cross(&s.omega[p].cross(&d));
            s.alpha[b] = s.alpha[p] + s.omega[p].cross(&spin);
            s.omega[b] = s.omega[p] + spin;
        }
        let (omega, alpha) = (s.omega[b], s.alpha[b]);
        let lever = kinematics.c[b] - kinematics.r[b];
        let acceleration = s.origin[b] + alpha.cross(&lever) + omega.cross(&omega.cross(&lever));
        let f = (acceleration - gravity) * body.mass;
        let R = &kinematics.R[b];
        let I = &body.principal_inertia;
        let gyroscopic = match &body.principal_axes {
            None => {
                let (w, a) = (R.tr_mul(&omega), R.tr_mul(&alpha));
                R * (I.component_mul(&a) + w.cross(&I.component_mul(&w)))
            }
            Some(P) => {
                let A = R * P;
                let (w, a) = (A.tr_mul(&omega), A.tr_mul(&alpha));
                A * (I.component_mul(&a) + w.cross(&I.component_mul(&w)))
            }
        };
        s.force[b] = f;
        s.moment[b] = gyroscopic + kinematics.c[b].cross(&f);
    }
    for b in (1..bodies.len()).rev() {
        let (f, n) = (s.force[b], s.moment[b]);
        out[5 + b] = kinematics.axis[b].dot(&(n - kinematics.r[b].cross(&f)));
        let p = bodies[b].parent;
        s.force[p] += f;
        s.moment[p] += n;
    }
    out[..3].copy_from_slice(s.force[0].as_slice());
    out[3..6].copy_from_slice(s.moment[0].as_slice());
}
