//! Delassus operator `W = Hᵀ M̂⁻¹ H`, and the map from impulses to velocities.
//!
//! With `M̂ = Lᵀ D L` and `Z = D^(-1/2) L^(-T) H` the operator is `W = Zᵀ Z`. A column of Z is
//! nonzero only along its body's path, or along the union of its two bodies' paths. A block of W is
//! therefore a dot product over the velocities that two contacts share; no dense product is formed.

use std::ops::Range;

use super::body_motion::Still;
use super::jacobian::{Columns, columns, columns_of_other, relative_velocity};
use super::limit;
use super::pair::{Contact, Opposite};
use crate::multibody::{BASE, Factor, Kinematics, Model};

/// The contacts of a step in matrix form. The storage grows to the largest step and is then reused.
#[derive(Clone, Debug, Default)]
pub struct ContactSystem {
    /// Delassus operator, row-major (3 n_c, 3 n_c).
    pub W: Vec<f64>,
    /// Local velocity `Hᵀ v` for the velocity passed to [`Self::assemble`] (3 n_c), m/s.
    pub u: Vec<f64>,
    /// Z along each path: `Z[c * stride + k]` belongs to the k-th velocity of contact c's path.
    Z: Vec<Columns>,
    stride: usize,
    /// Body of each contact.
    bodies: Vec<usize>,
    /// Range in `unions` of the rows of a contact between two bodies, or of a stop; empty for a
    /// ground contact. The vector is empty if all contacts are ground contacts.
    spans: Vec<Range<usize>>,
    /// Velocities along the union of two paths, or along a stop's path, ascending, with Z.
    unions: Vec<(usize, Columns)>,
    /// One column per velocity (nv), while a union is assembled.
    full: Vec<Columns>,
    /// Rows along one path, while a union is assembled.
    path_rows: Vec<Columns>,
}

impl ContactSystem {
    /// Storage for `n` contacts of a model without further allocation.
    #[must_use]
    pub fn with_capacity(model: &Model, n: usize) -> Self {
        Self {
            W: Vec::with_capacity(9 * n * n),
            u: Vec::with_capacity(3 * n),
            Z: Vec::with_capacity(n * model.path_stride()),
            stride: model.path_stride(),
            bodies: Vec::with_capacity(n),
            spans: Vec::new(),
            unions: Vec::new(),
            full: Vec::new(),
            path_rows: Vec::new(),
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
        factor: &Factor<f64>,
        contacts: &[Contact],
        v: &[f64],
    ) {
        self.assemble_rows(model, kinematics, factor, contacts, v);
        let n = contacts.len();
        self.W.resize(9 * n * n, 0.0);
        if self.spans.is_empty() {
            self.fill_operator(n, |system, c, d| system.block_on_ground(model, c, d));
        } else {
            self.fill_operator(n, |system, c, d| system.block(model, c, d));
            self.close_stops(contacts);
        }
    }

    /// Adds a number for each contact (n_c), 1/kg, to the three entries on W's diagonal.
    pub fn soften(&mut self, diagonal: impl Iterator<Item = f64>) {
        let size = 3 * self.n_contacts();
        for (c, term) in diagonal.enumerate() {
            for i in 3 * c..3 * (c + 1) {
                self.W[i * (size + 1)] += term;
            }
        }
    }

    /// [`Self::assemble`] without W, which stays what it was.
    pub fn assemble_rows(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        factor: &Factor<f64>,
        contacts: &[Contact],
        v: &[f64],
    ) {
        let (n, w) = (contacts.len(), self.stride);
        self.bodies.clear();
        self.bodies.extend(contacts.iter().map(|c| c.body));
        self.spans.clear();
        self.unions.clear();
        self.Z.resize(n * w, [0.0; 4]);
        self.u.resize(3 * n, 0.0);
        for (c, contact) in contacts.iter().enumerate() {
            if matches!(contact.key.opposite, Opposite::Part(_) | Opposite::Stop) {
                let u = match (limit::row(model, contact), contact.other) {
                    (Some(row), _) => self.stop(model, factor, row, v),
                    (None, Some(other)) => {
                        self.unite(model, kinematics, factor, contact, other.body, v)
                    }
                    (None, None) => [0.0; 4],
                };
                self.u[3 * c..][..3].copy_from_slice(&u[..3]);
                self.spans.resize(n, 0..0);
                let begin = self.spans[..c].iter().map(|span| span.end).max();
                self.spans[c] = begin.unwrap_or(0)..self.unions.len();
                continue;
            }
            let path = model.path(contact.body);
            let rows = &mut self.Z[c * w..][..path.len()];
            columns(model, kinematics, contact, rows);
            let u = path_product(model.split_path(contact.body), rows, v);
            self.u[3 * c..][..3].copy_from_slice(&u[..3]);
            factor.half_solve_path(model.mechanism(), contact.body, rows);
        }
    }

    /// Appends the three rows n, t, b of Zᵀ of a contact, with zeros off its path (3 nv).
    pub fn push_dense_rows(&self, model: &Model, c: usize, out: &mut Vec<f64>) {
        let (nv, begin) = (model.nv(), out.len());
        out.resize(begin + 3 * nv, 0.0);
        for (k, z) in self.entries(model, c) {
            for (row, z) in z[..3].iter().enumerate() {
                out[begin + row * nv + k] = *z;
            }
        }
    }

    /// W from its blocks on and below the diagonal.
    #[inline]
    fn fill_operator(&mut self, n: usize, block: impl Fn(&Self, usize, usize) -> [Columns; 3]) {
        let size = 3 * n;
        for c in 0..n {
            for d in 0..=c {
                let block = block(self, c, d);
                for i in 0..3 {
                    let row = &mut self.W[(3 * c + i) * size + 3 * d..][..3];
                    row.copy_from_slice(&block[i][..3]);
                }
                if c == d {
                    continue; // Symmetric.
                }
                for j in 0..3 {
                    let row = &mut self.W[(3 * d + j) * size + 3 * c..][..3];
                    row.copy_from_slice(&[block[0][j], block[1][j], block[2][j]]);
                }
            }
        }
    }

    /// Rows of Z of a stop, along the path of the joint's velocity, and its `Hᵀ v`, rad/s or m/s.
    fn stop(
        &mut self,
        model: &Model,
        factor: &Factor<f64>,
        (k, sign): (usize, f64),
        v: &[f64],
    ) -> Columns {
        self.full.resize(model.nv(), [0.0; 4]);
        let path = model.velocity_path(k);
        for &j in path {
            self.full[j] = [0.0; 4];
        }
        self.full[k][0] = sign;
        factor.half_solve_columns(model.mechanism(), path.iter().copied(), &mut self.full);
        self.unions.extend(path.iter().map(|&j| (j, self.full[j])));
        [sign * v[k], 0.0, 0.0, 0.0]
    }

    /// Sets the tangential diagonals of stops, whose tangential rows are zero, to that of the
    /// normal.
    fn close_stops(&mut self, contacts: &[Contact]) {
        let size = 3 * contacts.len();
        for (c, contact) in contacts.iter().enumerate() {
            if contact.key.opposite == Opposite::Stop {
                let normal = self.W[3 * c * (size + 1)];
                for i in [3 * c + 1, 3 * c + 2] {
                    self.W[i * (size + 1)] = normal;
                }
            }
        }
    }

    /// Rows of Z of a contact between two bodies, and its `Hᵀ v`, m/s.
    fn unite(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        factor: &Factor<f64>,
        contact: &Contact,
        other: usize,
        v: &[f64],
    ) -> Columns {
        self.full.resize(model.nv(), [0.0; 4]);
        self.path_rows.resize(self.stride, [0.0; 4]);
        let begin = self.unions.len();
        let (path, path_of_other) = (model.path(contact.body), model.path(other));
        for &k in path.iter().chain(path_of_other) {
            self.full[k] = [0.0; 4];
        }
        columns(
            model,
            kinematics,
            contact,
            &mut self.path_rows[..path.len()],
        );
        for (row, &k) in self.path_rows.iter().zip(path) {
            add(&mut self.full[k], 1.0, row);
        }
        let rows = &mut self.path_rows[..path_of_other.len()];
        columns_of_other(model, kinematics, contact, other, rows);
        for (row, &k) in self.path_rows.iter().zip(path_of_other) {
            add(&mut self.full[k], -1.0, row);
        }
        // Both are in ascending order, so their union is a merge.
        let (mut left, mut right) = (path, path_of_other);
        while let Some(&k) = smaller(left, right) {
            left = left.strip_prefix(&[k]).unwrap_or(left);
            right = right.strip_prefix(&[k]).unwrap_or(right);
            self.unions.push((k, [0.0; 4]));
        }
        let mut u = [0.0; 4];
        for (k, _) in &self.unions[begin..] {
            add(&mut u, v[*k], &self.full[*k]);
        }
        let velocities = self.unions[begin..].iter().map(|(k, _)| *k);
        factor.half_solve_columns(model.mechanism(), velocities, &mut self.full);
        for (k, z) in &mut self.unions[begin..] {
            *z = self.full[*k];
        }
        u
    }

    /// The block of W for two contacts.
    fn block(&self, model: &Model, c: usize, d: usize) -> [Columns; 3] {
        if self.union(c).is_empty() && self.union(d).is_empty() {
            return self.block_on_ground(model, c, d);
        }
        let mut block = [[0.0; 4]; 3];
        let mut right = self.entries(model, d).peekable();
        for (k, x) in self.entries(model, c) {
            while right.next_if(|(j, _)| *j < k).is_some() {}
            if let Some((_, y)) = right.next_if(|(j, _)| *j == k) {
                add_product(&mut block, x, y);
            }
        }
        block
    }

    /// The block of W for two ground contacts.
    #[allow(clippy::inline_always)] // as a call it costs a hundredth of a step
    #[inline(always)]
    fn block_on_ground(&self, model: &Model, c: usize, d: usize) -> [Columns; 3] {
        let shared = model.common_path(self.bodies[c], self.bodies[d]);
        let (a, b) = (
            &self.Z[c * self.stride..][..shared],
            &self.Z[d * self.stride..][..shared],
        );
        let mut block = [[0.0; 4]; 3];
        for (x, y) in a.iter().zip(b) {
            add_product(&mut block, x, y);
        }
        block
    }

    /// Rows of a contact between two bodies or of a stop; empty for a ground contact.
    #[inline]
    fn union(&self, c: usize) -> &[(usize, Columns)] {
        if self.spans.is_empty() {
            &[]
        } else {
            &self.unions[self.spans[c].clone()]
        }
    }

    /// Velocities of a contact, ascending, with Z.
    fn entries<'a>(
        &'a self,
        model: &'a Model,
        c: usize,
    ) -> impl Iterator<Item = (usize, &'a Columns)> {
        let unions = self.union(c);
        let path = if unions.is_empty() {
            model.path(self.bodies[c])
        } else {
            &[]
        };
        let along_path = path.iter().copied().zip(&self.Z[c * self.stride..]);
        along_path.chain(unions.iter().map(|(k, z)| (*k, z)))
    }

    /// `out = Zᵀ y` (3 n_c): local velocities of a velocity change `y` in factor coordinates.
    pub fn local(&self, model: &Model, y: &[f64], out: &mut [f64]) {
        for (c, values) in out.chunks_exact_mut(3).enumerate() {
            let union = self.union(c);
            let u = if union.is_empty() {
                let path = model.split_path(self.bodies[c]);
                path_product(path, &self.Z[c * self.stride..], y)
            } else {
                let mut u = [0.0; 4];
                for (k, z) in union {
                    add(&mut u, y[*k], z);
                }
                u
            };
            values.copy_from_slice(&u[..3]);
        }
    }

    /// `out += Hᵀ v` for a velocity other than the one passed to [`Self::assemble`].
    pub fn add_local_of_velocity(
        &self,
        model: &Model,
        kinematics: &Kinematics,
        contacts: &[Contact],
        v: &[f64],
        out: &mut [f64],
    ) {
        for (contact, values) in contacts.iter().zip(out.chunks_exact_mut(3)) {
            if let Some((k, sign)) = limit::row(model, contact) {
                values[0] += sign * v[k];
                continue;
            }
            let velocity = relative_velocity(
                &Still {
                    model,
                    kinematics,
                    v,
                },
                contact,
            );
            for (value, d) in values.iter_mut().zip(contact.frame.rows()) {
                *value += velocity.dot(&d);
            }
        }
    }

    /// `y += Z p`: velocity change, in factor coordinates, due to impulses `p`.
    pub fn add_impulses(&self, model: &Model, p: &[f64], y: &mut [f64]) {
        for (c, p) in p.chunks_exact(3).enumerate() {
            let product = |z: &Columns| z[0] * p[0] + z[1] * p[1] + z[2] * p[2];
            let union = self.union(c);
            if !union.is_empty() {
                for (k, z) in union {
                    y[*k] += product(z);
                }
                continue;
            }
            let (lead, rest) = model.split_path(self.bodies[c]);
            let (Z_lead, Z_rest) = self.Z[c * self.stride..].split_at(lead.len());
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

/// `block += x yᵀ`: nine independent sums.
#[inline]
fn add_product(block: &mut [Columns; 3], x: &Columns, y: &Columns) {
    for (sums, factor) in block.iter_mut().zip(x) {
        add(sums, *factor, y);
    }
}

/// `sums += a x`.
#[inline]
fn add(sums: &mut Columns, a: f64, x: &Columns) {
    for (sum, value) in sums.iter_mut().zip(x) {
        *sum += a * value;
    }
}

/// The smaller of the first entries of two ascending lists.
fn smaller<'a>(left: &'a [usize], right: &'a [usize]) -> Option<&'a usize> {
    match (left.first(), right.first()) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

/// Product of the columns along a path with a full vector.
#[inline]
fn path_product((lead, rest): (Range<usize>, &[usize]), rows: &[Columns], v: &[f64]) -> Columns {
    let mut sums = [0.0; 4];
    let (of_lead, of_rest) = rows.split_at(lead.len());
    if let (Some(rows), Some(v)) = (of_lead.first_chunk::<BASE>(), v[lead].first_chunk::<BASE>()) {
        for (row, &v) in rows.iter().zip(v) {
            add(&mut sums, v, row);
        }
    }
    for (row, &k) in of_rest.iter().zip(rest) {
        add(&mut sums, v[k], row);
    }
    sums
}
