//! Contact Jacobian `H`, Delassus operator `W = Hᵀ M̂⁻¹ H` and the impulses' way back to velocities.
//!
//! With `M̂ = Lᵀ D L` and `Z = D^(-1/2) L^(-T) H` the operator is `W = Zᵀ Z`. A column of Z is nonzero only along its body's
//! path, so a block of W is a dot product over the path that two bodies share: never a dense product.

use super::contact_point::Contact;
use crate::multibody::{FactoredMassMatrix, Kinematics, Model};

/// The contacts of a step in matrix form. Scratch: grows to what was needed most, then reuses it.
#[derive(Clone, Debug, Default)]
pub struct ContactSystem {
    /// Delassus operator, row-major (3 n_c, 3 n_c).
    pub W: Vec<f64>,
    /// Local velocity `Hᵀ v` of the velocity handed to [`Self::assemble`] (3 n_c), m/s.
    pub u: Vec<f64>,
    Z: Vec<f64>,
    bodies: Vec<usize>,
    stride: usize,
}

impl ContactSystem {
    /// Room for `n` contacts of a model without further allocation.
    #[must_use]
    pub fn with_capacity(model: &Model, n: usize) -> Self {
        Self {
            W: Vec::with_capacity(9 * n * n),
            u: Vec::with_capacity(3 * n),
            Z: Vec::with_capacity(3 * n * model.path_stride()),
            bodies: Vec::with_capacity(n),
            stride: model.path_stride(),
        }
    }

    /// Number of contacts.
    #[must_use]
    pub fn n_contacts(&self) -> usize {
        self.bodies.len()
    }

    /// Builds Z, W and `u = Hᵀ v` at the poses of `kinematics`.
    pub fn assemble(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        factor: &FactoredMassMatrix,
        contacts: &[Contact],
        v: &[f64],
    ) {
        let (n, w) = (contacts.len(), self.stride);
        self.bodies.clear();
        self.bodies.extend(contacts.iter().map(|c| c.body));
        self.Z.resize(3 * n * w, 0.0);
        self.u.resize(3 * n, 0.0);
        self.W.resize(9 * n * n, 0.0);
        for (c, contact) in contacts.iter().enumerate() {
            let path = model.path(contact.body);
            for (k, d) in contact.frame.rows().iter().enumerate() {
                let row = &mut self.Z[(3 * c + k) * w..][..path.len()];
                kinematics.point_jacobian_row(path, &contact.point, d, row);
                self.u[3 * c + k] = path_dot(path, row, v);
                factor.half_solve_path(path, row);
            }
        }
        let size = 3 * n;
        for c in 0..n {
            for d in 0..=c {
                let shared = model.common_path(self.bodies[c], self.bodies[d]);
                for i in 0..3 {
                    let a = &self.Z[(3 * c + i) * w..][..shared];
                    for j in 0..3 {
                        let b = &self.Z[(3 * d + j) * w..][..shared];
                        let value: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
                        self.W[(3 * c + i) * size + 3 * d + j] = value;
                        self.W[(3 * d + j) * size + 3 * c + i] = value;
                    }
                }
            }
        }
    }

    /// `out = Zᵀ y` (3 n_c): what a velocity change `y` in factor coordinates does at the contacts.
    pub fn local(&self, model: &Model, y: &[f64], out: &mut [f64]) {
        for (row, value) in out.iter_mut().enumerate() {
            let path = model.path(self.bodies[row / 3]);
            *value = path_dot(path, &self.Z[row * self.stride..][..path.len()], y);
        }
    }

    /// `out += Hᵀ v` for another velocity than the one handed to [`Self::assemble`].
    pub fn add_local_of_velocity(
        &self,
        model: &Model,
        kinematics: &Kinematics,
        contacts: &[Contact],
        v: &[f64],
        out: &mut [f64],
    ) {
        for (contact, values) in contacts.iter().zip(out.chunks_exact_mut(3)) {
            let velocity = kinematics.point_velocity(model, contact.body, &contact.point, v);
            for (value, d) in values.iter_mut().zip(contact.frame.rows()) {
                *value += velocity.dot(&d);
            }
        }
    }

    /// `y += Z p`: impulses to a velocity change in factor coordinates.
    pub fn add_impulses(&self, model: &Model, p: &[f64], y: &mut [f64]) {
        for (row, &value) in p.iter().enumerate() {
            let path = model.path(self.bodies[row / 3]);
            for (z, &k) in self.Z[row * self.stride..].iter().zip(path) {
                y[k] += z * value;
            }
        }
    }
}

/// `out = H p` (nv): generalized impulse, N s and N m s, of the impulses `p` (3 n_c) at the contacts.
pub fn generalized_impulse(
    model: &Model,
    kinematics: &Kinematics,
    contacts: &[Contact],
    p: &[f64],
    out: &mut [f64],
) {
    out.fill(0.0);
    for (contact, p) in contacts.iter().zip(p.chunks_exact(3)) {
        let [n, t, b] = contact.frame.rows();
        let force = n * p[0] + t * p[1] + b * p[2];
        let moment = contact.point.cross(&force);
        for i in 0..3 {
            out[i] += force[i];
            out[3 + i] += moment[i];
        }
        for &k in &model.path(contact.body)[6..] {
            out[k] += kinematics.axis[k - 5].dot(&(moment - kinematics.r[k - 5].cross(&force)));
        }
    }
}

/// Dot product of a row along a path with a full vector.
#[inline]
fn path_dot(path: &[usize], row: &[f64], v: &[f64]) -> f64 {
    let base: f64 = row[..6].iter().zip(&v[..6]).map(|(a, b)| a * b).sum();
    row[6..]
        .iter()
        .zip(&path[6..])
        .fold(base, |sum, (a, &k)| sum + a * v[k])
}
