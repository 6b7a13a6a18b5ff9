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
    /// What W has on its diagonal beyond the squares of Z, 1/kg (n_c): for rows that are zero, and
    /// what a contact yields.
    beyond: Vec<Triple<f64>>,
    /// Directions in which closed loops let nothing move each contact; empty if there are none.
    held: Vec<[bool; 3]>,
    /// Z over all velocities (n_c, nv), of a machine with loops; empty of any other.
    spread: Vec<Triple<f64>>,
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
            beyond: Vec::with_capacity(n),
            held: Vec::new(),
            spread: Vec::new(),
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
        self.assemble_rows(model, factor, &[(kinematics, contacts)], v);
        self.multiply(model);
    }

    /// W of the assembled rows.
    pub(crate) fn multiply(&mut self, model: &Model) {
        let mut W = std::mem::take(&mut self.W);
        W.resize(9 * self.n_contacts() * self.n_contacts(), 0.0);
        if self.spread.is_empty() {
            let own = |c: usize| self.own_block(model, c);
            self.fill(&mut W, own, |c, d| self.block(model, c, d));
        } else {
            let rows = |c: usize| &self.spread[c * model.nv()..][..model.nv()];
            let block = |c: usize, d: usize| product(0.0, rows(c), rows(d));
            self.fill(&mut W, |c| block(c, c), block);
        }
        self.W = W;
    }

    /// Fills W with the blocks of contacts with themselves and with those before.
    #[inline]
    fn fill(
        &self,
        W: &mut [f64],
        own_block: impl Fn(usize) -> [f64; 9],
        block: impl Fn(usize, usize) -> [f64; 9],
    ) {
        let size = 3 * self.n_contacts();
        for c in 0..self.n_contacts() {
            for d in 0..c {
                let block = block(c, d);
                for i in 0..3 {
                    for j in 0..3 {
                        let (row, column) = (3 * c + i, 3 * d + j);
                        W[row * size + column] = block[3 * i + j];
                        W[column * size + row] = block[3 * i + j];
                    }
                }
            }
            let mut own = own_block(c);
            for k in 0..3 {
                own[4 * k] += self.beyond[c][k];
            }
            for (i, row) in own.chunks_exact(3).enumerate() {
                W[(3 * c + i) * size + 3 * c..][..3].copy_from_slice(row);
            }
        }
    }

    /// What W has on the diagonal of a contact beyond the squares of its rows, 1/kg.
    #[must_use]
    pub(crate) fn beyond(&self, c: usize) -> Triple<f64> {
        self.beyond[c]
    }

    /// Adds numbers along n, t, b of each contact (n_c), 1/kg, to W's diagonal.
    pub fn soften(&mut self, diagonal: impl Iterator<Item = [f64; 3]>) {
        let size = 3 * self.n_contacts();
        for (c, terms) in diagonal.enumerate() {
            for (k, term) in terms.into_iter().enumerate() {
                // Of a row that is held only this is left.
                let is_held = term > 0.0 && self.held.get(c).is_some_and(|held| held[k]);
                let beyond = &mut self.beyond[c][k];
                let own = self.W.get_mut((3 * c + k) * (size + 1));
                for entry in own.into_iter().chain([beyond]) {
                    *entry = if is_held { term } else { *entry + term };
                }
            }
        }
    }

    /// Begins with Z over all velocities, zero off each contact's path.
    pub(crate) fn spread(&mut self, model: &Model) {
        let nv = model.nv();
        let mut spread = std::mem::take(&mut self.spread);
        spread.clear();
        spread.resize(self.n_contacts() * nv, [0.0; 3]);
        for (c, rows) in spread.chunks_exact_mut(nv).enumerate() {
            for (k, z) in self.entries(model, c) {
                rows[k] = *z;
            }
        }
        self.spread = spread;
    }

    /// The rows of a contact after [`Self::spread`] (nv).
    pub(crate) fn spread_rows(&mut self, model: &Model, c: usize) -> &mut [Triple<f64>] {
        &mut self.spread[c * model.nv()..][..model.nv()]
    }

    /// Squares of their lengths, 1/kg.
    pub(crate) fn squares(&self, model: &Model, c: usize) -> Triple<f64> {
        let rows = &self.spread[c * model.nv()..][..model.nv()];
        [0, 1, 2].map(|k| rows.iter().map(|z| z[k] * z[k]).sum())
    }

    /// Makes the rows of H zero along directions in which nothing moves a contact. `free`: their
    /// squares without loops, 1/kg. On its diagonal W has the largest of these there, so that it is
    /// regular and the impulses are zero.
    pub(crate) fn hold(&mut self, model: &Model, c: usize, free: &Triple<f64>, held: [bool; 3]) {
        let nv = model.nv();
        self.held.push(held);
        if !held.contains(&true) {
            return;
        }
        let (union, path) = match self.spans.get(c) {
            Some(span) if !span.is_empty() => (span.clone(), 0),
            _ => (0..0, model.path(self.bodies[c]).len()),
        };
        let of_union = self.unions[union].iter_mut().map(|(_, z)| z);
        let rows = (self.Z[c * self.stride..][..path].iter_mut()).chain(of_union);
        for z in rows.chain(&mut self.spread[c * nv..][..nv]) {
            for k in 0..3 {
                z[k] = if held[k] { 0.0 } else { z[k] };
            }
        }
        for k in (0..3).filter(|k| held[*k]) {
            self.u[3 * c + k] = 0.0;
            self.beyond[c][k] = free[0].max(free[1]).max(free[2]);
        }
    }

    /// Whether nothing moves a contact along its normal.
    pub(crate) fn is_immovable(&self, c: usize) -> bool {
        self.held.get(c).is_some_and(|held| held[0])
    }

    /// [`Self::assemble`] without W, which stays what it was, of contacts at several poses.
    pub(crate) fn assemble_rows(
        &mut self,
        model: &Model,
        factor: &Factor<f64>,
        placed: &[(&Kinematics, &[Contact])],
        v: &[f64],
    ) {
        let n = placed.iter().map(|(_, contacts)| contacts.len()).sum();
        self.held.clear();
        self.spread.clear();
        self.bodies.clear();
        self.spans.clear();
        self.unions.clear();
        self.Z.resize(n * self.stride, [0.0; 3]);
        self.u.resize(3 * n, 0.0);
        self.beyond.clear();
        self.beyond.resize(n, [0.0; 3]);
        for (kinematics, contacts) in placed {
            let motion = Still {
                model,
                kinematics,
                v,
            };
            let first = self.bodies.len();
            self.bodies.extend(contacts.iter().map(|c| c.body));
            for (c, contact) in (first..).zip(*contacts) {
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
                self.close(model, c, contact);
            }
        }
    }

    /// Notes what makes W regular where rows of a contact are zero.
    fn close(&mut self, model: &Model, c: usize, contact: &Contact) {
        let close: fn(&mut [f64; 9]) = match contact.part {
            Part::Limit(..) => close_stop,
            Part::Friction(_) => joint_friction::close,
            Part::Wheel(_) if rollers::has_a_row_of_its_own(model, contact) => rollers::close,
            Part::Wheel(_) | Part::Box(_) | Part::Sphere(_) | Part::Collider(_) => return,
        };
        let own = self.own_block(model, c);
        let mut closed = own;
        close(&mut closed);
        self.beyond[c] = [0, 4, 8].map(|k| closed[k] - own[k]);
    }

    /// Appends the three rows n, t, b of Zᵀ of a contact, with zeros off its path (3 nv).
    pub fn push_dense_rows(&self, model: &Model, c: usize, out: &mut Vec<f64>) {
        let (nv, begin) = (model.nv(), out.len());
        out.resize(begin + 3 * nv, 0.0);
        let spread = self.spread.get(c * nv..(c + 1) * nv).unwrap_or(&[]);
        let entries = (self.entries(model, c)).take_while(|_| spread.is_empty());
        for (k, z) in entries.chain(spread.iter().enumerate()) {
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

    /// `out += Hᵀ v` for a velocity other than the one passed to [`Self::assemble`], of the
    /// contacts from the given number on.
    pub fn add_local_of_velocity(
        &self,
        model: &Model,
        kinematics: &Kinematics,
        (first, contacts): (usize, &[Contact]),
        v: &[f64],
        out: &mut [f64],
    ) {
        for (c, (contact, values)) in (first..).zip(contacts.iter().zip(out.chunks_exact_mut(3))) {
            let held = self.held.get(c).copied().unwrap_or_default();
            if let Some((k, sign, row)) = limit::joint_row(model, contact) {
                values[row] += if held[row] { 0.0 } else { sign * v[k] };
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
            for ((value, d), held) in values.iter_mut().zip(contact.frame.rows()).zip(held) {
                *value += if held { 0.0 } else { velocity.dot(&d) };
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
