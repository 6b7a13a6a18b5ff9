//! Delassus operator `W = Hᵀ M̂⁻¹ H` of the contacts of one machine, and the map from impulses to
//! velocities.
//!
//! The rows (page `rows`) of a contact between two bodies lie along the union of their paths.

use std::ops::Range;

use super::body_motion::Still;
use super::jacobian::{for_each_row, relative_velocity, write_rows};
use super::joint_friction;
use super::limit;
use super::pair::Contact;
use super::part::Part;
use super::rollers;
use super::rows::{Path, Triple, add_product, add_scaled, along, close_stop, product, square};
use crate::multibody::{Factor, Kinematics, Model};

/// The contacts of a step in matrix form. The storage grows to the largest step and is then reused.
#[derive(Clone, Debug, Default)]
pub struct ContactSystem {
    /// Delassus operator, row-major (3 n_c, 3 n_c).
    pub W: Vec<f64>,
    /// Local velocity `Hᵀ v` for the velocity passed to [`Self::assemble`] (3 n_c), m/s.
    pub u: Vec<f64>,
    /// Z along each path: `Z[c * stride + k]` belongs to the k-th velocity of contact c's path.
    Z: Vec<Triple<f64>>,
    stride: usize,
    /// Body of each contact.
    bodies: Vec<usize>,
    /// Range in `unions` of the rows of a contact between two bodies; empty for any other. The
    /// vector is empty if there is none.
    spans: Vec<Range<usize>>,
    /// Velocities along the union of two paths, ascending, with Z.
    unions: Vec<(usize, Triple<f64>)>,
    /// One entry a velocity (nv), while a union is assembled.
    full: Vec<Triple<f64>>,
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
        let size = 3 * contacts.len();
        self.W.resize(size * size, 0.0);
        for (c, contact) in contacts.iter().enumerate() {
            for d in 0..c {
                let block = self.block(model, c, d);
                for i in 0..3 {
                    for j in 0..3 {
                        let (row, column) = (3 * c + i, 3 * d + j);
                        self.W[row * size + column] = block[3 * i + j];
                        self.W[column * size + row] = block[3 * i + j];
                    }
                }
            }
            let mut own = self.own_block(model, c);
            match contact.part {
                Part::Limit(..) => close_stop(&mut own),
                Part::Friction(_) => joint_friction::close(&mut own),
                Part::Wheel(_) if rollers::rollers_of(model, contact).is_some() => {
                    rollers::close(&mut own);
                }
                Part::Wheel(_) | Part::Box(_) | Part::Sphere(_) | Part::Collider(_) => {}
            }
            for (i, row) in own.chunks_exact(3).enumerate() {
                self.W[(3 * c + i) * size + 3 * c..][..3].copy_from_slice(row);
            }
        }
    }

    /// The entry of W on the diagonal of a contact's normal.
    #[must_use]
    pub fn normal_entry(&self, c: usize) -> f64 {
        let size = 3 * self.n_contacts();
        self.W[3 * c * (size + 1)]
    }

    /// Adds numbers along n, t, b of each contact (n_c), 1/kg, to W's diagonal.
    pub fn soften(&mut self, diagonal: impl Iterator<Item = [f64; 3]>) {
        let size = 3 * self.n_contacts();
        for (i, term) in diagonal.flatten().enumerate() {
            self.W[i * (size + 1)] += term;
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
        let n = contacts.len();
        let motion = Still {
            model,
            kinematics,
            v,
        };
        self.bodies.clear();
        self.bodies.extend(contacts.iter().map(|c| c.body));
        self.spans.clear();
        self.unions.clear();
        self.Z.resize(n * self.stride, [0.0; 3]);
        self.u.resize(3 * n, 0.0);
        for (c, contact) in contacts.iter().enumerate() {
            let u = if let Some(other) = contact.other {
                let begin = self.unions.len();
                let u = self.unite(&motion, factor, contact, other.body);
                self.spans.resize(n, 0..0);
                self.spans[c] = begin..self.unions.len();
                u
            } else {
                let path = Path::of(model.mechanism(), contact.body);
                let rows = &mut self.Z[c * self.stride..][..path.len()];
                let u = match limit::joint_row(model, contact) {
                    Some((_, sign, row)) => path.write_joint(row, sign, v, rows),
                    None => write_rows(&motion, contact, v, rows),
                };
                factor.half_solve_path(model.mechanism(), contact.body, rows);
                u
            };
            self.u[3 * c..][..3].copy_from_slice(&u);
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

    /// Rows of Z of a contact between two bodies, and its `Hᵀ v`, m/s.
    fn unite(
        &mut self,
        motion: &Still<'_>,
        factor: &Factor<f64>,
        contact: &Contact,
        other: usize,
    ) -> Triple<f64> {
        let model = motion.model;
        let begin = self.unions.len();
        // Both are in ascending order, so their union is a merge.
        let (mut left, mut right) = (model.path(contact.body), model.path(other));
        self.full.resize(model.nv(), [0.0; 3]);
        while let Some(&k) = smaller(left, right) {
            left = left.strip_prefix(&[k]).unwrap_or(left);
            right = right.strip_prefix(&[k]).unwrap_or(right);
            self.unions.push((k, [0.0; 3]));
            self.full[k] = [0.0; 3];
        }
        for_each_row(motion, contact, |k, row| {
            add_scaled(&mut self.full[k], &row, 1.0);
        });
        let mut u = [0.0; 3];
        for (k, _) in &self.unions[begin..] {
            add_scaled(&mut u, &self.full[*k], motion.v[*k]);
        }
        let velocities = self.unions[begin..].iter().map(|(k, _)| *k);
        factor.half_solve_columns(model.mechanism(), velocities, &mut self.full);
        for (k, z) in &mut self.unions[begin..] {
            *z = self.full[*k];
        }
        u
    }

    /// The block of W for two contacts.
    fn block(&self, model: &Model, c: usize, d: usize) -> [f64; 9] {
        if self.union(c).is_empty() && self.union(d).is_empty() {
            let shared = model.common_path(self.bodies[c], self.bodies[d]);
            let z = |c: usize| &self.Z[c * self.stride..][..shared];
            return product(0.0, z(c), z(d));
        }
        let mut block = [0.0; 9];
        let mut right = self.entries(model, d).peekable();
        for (k, x) in self.entries(model, c) {
            while right.next_if(|(j, _)| *j < k).is_some() {}
            if let Some((_, y)) = right.next_if(|(j, _)| *j == k) {
                add_product(&mut block, x, y);
            }
        }
        block
    }

    /// The block of W on the diagonal.
    fn own_block(&self, model: &Model, c: usize) -> [f64; 9] {
        let union = self.union(c);
        if union.is_empty() {
            let n = model.path(self.bodies[c]).len();
            return square(0.0, &self.Z[c * self.stride..][..n]);
        }
        let mut block = [0.0; 9];
        for (_, z) in union {
            add_product(&mut block, z, z);
        }
        block
    }

    /// Rows of a contact between two bodies; empty for any other.
    #[inline]
    fn union(&self, c: usize) -> &[(usize, Triple<f64>)] {
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
    ) -> impl Iterator<Item = (usize, &'a Triple<f64>)> {
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
            let mut u = [0.0; 3];
            if union.is_empty() {
                let path = Path::of(model.mechanism(), self.bodies[c]);
                u = path.add_local(&self.Z[c * self.stride..], y, u);
            } else {
                for (k, z) in union {
                    add_scaled(&mut u, z, y[*k]);
                }
            }
            values.copy_from_slice(&u);
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
            if let Some((k, sign, row)) = limit::joint_row(model, contact) {
                values[row] += sign * v[k];
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
        for (c, p) in p.as_chunks().0.iter().enumerate() {
            let union = self.union(c);
            if union.is_empty() {
                let path = Path::of(model.mechanism(), self.bodies[c]);
                path.push(true, &self.Z[c * self.stride..], p, y);
            } else {
                for (k, z) in union {
                    y[*k] += along(z, p);
                }
            }
        }
    }
}

/// The smaller of the first entries of two ascending lists.
fn smaller<'a>(left: &'a [usize], right: &'a [usize]) -> Option<&'a usize> {
    match (left.first(), right.first()) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}
