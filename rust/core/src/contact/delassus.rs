//! Contact Jacobian `H`, Delassus operator `W = Hᵀ M̂⁻¹ H` and the impulses' way back to velocities.
//!
//! With `M̂ = Lᵀ D L` and `Z = D^(-1/2) L^(-T) H` the operator is `W = Zᵀ Z`. A column of Z is nonzero only along its body's
//! path, so a block of W is a dot product over the path that two bodies share: never a dense product.

use std::ops::Range;

use super::contact_point::Contact;
use crate::multibody::{BASE, FactoredMassMatrix, Kinematics, Model};

/// One row of Z at one velocity: the columns n, t, b of a contact, padded so that two pairs of lanes carry it.
type Columns = [f64; 4];

/// The contacts of a step in matrix form. Scratch: grows to what was needed most, then reuses it.
#[derive(Clone, Debug, Default)]
pub struct ContactSystem {
    /// Delassus operator, row-major (3 n_c, 3 n_c).
    pub W: Vec<f64>,
    /// Local velocity `Hᵀ v` of the velocity handed to [`Self::assemble`] (3 n_c), m/s.
    pub u: Vec<f64>,
    /// Z along each contact's path: `Z[c * stride + k]` belongs to the k-th velocity of the path.
    Z: Vec<Columns>,
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
            Z: Vec::with_capacity(n * model.path_stride()),
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
        self.Z.resize(n * w, [0.0; 4]);
        self.u.resize(3 * n, 0.0);
        self.W.resize(9 * n * n, 0.0);
        for (c, contact) in contacts.iter().enumerate() {
            let path = model.path(contact.body);
            let rows = &mut self.Z[c * w..][..path.len()];
            jacobian_columns(model, kinematics, contact, rows);
            let u = path_product(model.split_path(contact.body), rows, v);
            self.u[3 * c..][..3].copy_from_slice(&u[..3]);
            factor.half_solve_path(path, rows);
        }
        let size = 3 * n;
        for c in 0..n {
            for d in 0..=c {
                let shared = model.common_path(self.bodies[c], self.bodies[d]);
                let (a, b) = (&self.Z[c * w..][..shared], &self.Z[d * w..][..shared]);
                // Nine sums that do not wait for each other.
                let mut block = [[0.0; 4]; 3];
                for (x, y) in a.iter().zip(b) {
                    for (sums, factor) in block.iter_mut().zip(x) {
                        for (sum, value) in sums.iter_mut().zip(y) {
                            *sum += factor * value;
                        }
                    }
                }
                for i in 0..3 {
                    let row = &mut self.W[(3 * c + i) * size + 3 * d..][..3];
                    row.copy_from_slice(&block[i][..3]);
                }
                for j in 0..3 {
                    let row = &mut self.W[(3 * d + j) * size + 3 * c..][..3];
                    row.copy_from_slice(&[block[0][j], block[1][j], block[2][j]]);
                }
            }
        }
    }

    /// `out = Zᵀ y` (3 n_c): what a velocity change `y` in factor coordinates does at the contacts.
    pub fn local(&self, model: &Model, y: &[f64], out: &mut [f64]) {
        for (c, values) in out.chunks_exact_mut(3).enumerate() {
            let path = model.split_path(self.bodies[c]);
            let u = path_product(path, &self.Z[c * self.stride..], y);
            values.copy_from_slice(&u[..3]);
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
        for (c, p) in p.chunks_exact(3).enumerate() {
            let (lead, rest) = model.split_path(self.bodies[c]);
            let (Z_lead, Z_rest) = self.Z[c * self.stride..].split_at(lead.len());
            let product = |z: &Columns| z[0] * p[0] + z[1] * p[1] + z[2] * p[2];
            if let (Some(y), Some(Z)) = (
                y[lead].first_chunk_mut::<BASE>(),
                Z_lead.first_chunk::<BASE>(),
            ) {
                for (y, z) in y.iter_mut().zip(Z) {
                    *y += product(z);
                }
            }
            for (z, &k) in Z_rest.iter().zip(rest) {
                y[k] += product(z);
            }
        }
    }
}

/// `Hᵀ` of one contact along its path: for each velocity, what it moves the point along n, t, b.
fn jacobian_columns(
    model: &Model,
    kinematics: &Kinematics,
    contact: &Contact,
    rows: &mut [Columns],
) {
    let [n, t, b] = contact.frame.rows();
    let x = &contact.point;
    let (xn, xt, xb) = (x.cross(&n), x.cross(&t), x.cross(&b));
    let (lead, rest) = rows.split_at_mut(model.lead(contact.body));
    if let Some(base) = lead.first_chunk_mut::<BASE>() {
        for i in 0..3 {
            base[i] = [n[i], t[i], b[i], 0.0];
            base[3 + i] = [xn[i], xt[i], xb[i], 0.0];
        }
    }
    for (row, &m) in rest.iter_mut().zip(model.motions(contact.body)) {
        let velocity = kinematics.motions[m].velocity_at(x);
        *row = [velocity.dot(&n), velocity.dot(&t), velocity.dot(&b), 0.0];
    }
}

/// Product of columns along a path with a full vector.
#[inline]
fn path_product((lead, rest): (Range<usize>, &[usize]), rows: &[Columns], v: &[f64]) -> Columns {
    let mut sums = [0.0; 4];
    let mut add = |row: &Columns, v: f64| {
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += value * v;
        }
    };
    let (of_lead, of_rest) = rows.split_at(lead.len());
    if let (Some(rows), Some(v)) = (of_lead.first_chunk::<BASE>(), v[lead].first_chunk::<BASE>()) {
        for (row, &v) in rows.iter().zip(v) {
            add(row, v);
        }
    }
    for (row, &k) in of_rest.iter().zip(rest) {
        add(row, v[k]);
    }
    sums
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
        let (lead, rest) = model.split_path(contact.body);
        if let Some(base) = out[lead].first_chunk_mut::<BASE>() {
            for i in 0..3 {
                base[i] += force[i];
                base[3 + i] += moment[i];
            }
        }
        for (&k, &m) in rest.iter().zip(model.motions(contact.body)) {
            out[k] += kinematics.motions[m].power(&force, &moment);
        }
    }
}
