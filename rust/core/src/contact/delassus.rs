//! Delassus operator `W = Hᵀ M̂⁻¹ H` of the contacts of one machine, and the map from impulses to
//! velocities.
//!
//! The rows of a contact (page `rows`) are kept along the path of its body, and over all velocities
//! between two bodies and where loops restrict them.

use super::body_motion::Still;
use super::jacobian::{for_each_row, relative_velocity, write_rows};
use super::joint_friction;
use super::limit;
use super::pair::Contact;
use super::part::Part;
use super::rollers;
use super::rows::{
    Triple, VelocityPath, add_product, add_scaled, along, close_stop, product, square,
};
use crate::multibody::{Factor, Mechanism, Model, Poses};

/// The contacts of a step in matrix form. The storage grows to the largest step and is then reused.
#[derive(Clone, Debug, Default)]
pub struct ContactSystem {
    /// Delassus operator, row-major (3 n_c, 3 n_c).
    pub W: Vec<f64>,
    /// Local velocity `Hᵀ v` before the step (3 n_c), m/s.
    pub u: Vec<f64>,
    nv: usize,
    /// Z along the path of each contact, from its start on.
    Z: Vec<Triple<f64>>,
    starts: Vec<usize>,
    /// Body of each contact that moves along the path of one body; none between two bodies.
    bodies: Vec<Option<usize>>,
    /// All velocities, ascending.
    all: Vec<usize>,
    /// What W has on its diagonal beyond the squares of Z, 1/kg (n_c): for rows that are zero, and
    /// what a contact yields.
    beyond: Vec<Triple<f64>>,
    /// Z without the motions that would open a loop (n_c, nv), of a machine with loops; empty of
    /// any other.
    restricted: Vec<Triple<f64>>,
    /// Directions in which closed loops let nothing move each contact; empty if there are none.
    held: Vec<[bool; 3]>,
}

impl ContactSystem {
    /// Storage for `n` contacts of a machine with `nv` velocities without further allocation.
    #[must_use]
    pub fn with_capacity(nv: usize, n: usize) -> Self {
        Self {
            W: Vec::with_capacity(9 * n * n),
            u: Vec::with_capacity(3 * n),
            nv,
            Z: Vec::with_capacity(n * nv),
            starts: Vec::with_capacity(n + 1),
            bodies: Vec::with_capacity(n),
            all: (0..nv).collect(),
            beyond: Vec::with_capacity(n),
            ..Self::default()
        }
    }

    /// The contacts of a machine at poses and a velocity (nv), with W.
    #[must_use]
    pub fn of(
        model: &Model,
        (poses, v): (&Poses<f64>, &[f64]),
        factor: &Factor<f64>,
        contacts: &[Contact],
    ) -> Self {
        let mut system = Self::with_capacity(model.nv(), contacts.len());
        let still = Still::new(model.mechanism(), poses, v);
        system.assemble(model, factor, &[(still, contacts)]);
        system.multiply(model);
        system
    }

    /// Number of contacts.
    #[must_use]
    pub fn n_contacts(&self) -> usize {
        self.bodies.len()
    }

    /// Builds Z and `u = Hᵀ v` of contacts at the poses and the velocity of each `Still`. W stays
    /// what it was.
    pub(crate) fn assemble(
        &mut self,
        model: &Model,
        factor: &Factor<f64>,
        placed: &[(Still<'_>, &[Contact])],
    ) {
        self.held.clear();
        self.restricted.clear();
        self.Z.clear();
        self.u.clear();
        self.bodies.clear();
        self.starts.clear();
        self.starts.push(0);
        self.beyond.clear();
        for (motion, contacts) in placed {
            for contact in *contacts {
                self.push(model, factor, motion, contact);
            }
        }
    }

    fn push(&mut self, model: &Model, factor: &Factor<f64>, motion: &Still<'_>, contact: &Contact) {
        let mechanism = model.mechanism();
        let (c, first) = (self.n_contacts(), self.Z.len());
        self.bodies.push(match contact.other {
            None => Some(contact.body),
            Some(_) => None,
        });
        let path = along_path(mechanism, &self.all, self.bodies[c]);
        self.Z.resize(first + path.len(), [0.0; 3]);
        self.starts.push(self.Z.len());
        let rows = &mut self.Z[first..];
        let u = if contact.other.is_some() {
            for_each_row(motion, contact, |k, row| {
                add_scaled(&mut rows[k], &row, 1.0);
            });
            let mut u = [0.0; 3];
            for (row, v) in rows.iter().zip(motion.v) {
                add_scaled(&mut u, row, *v);
            }
            factor.half_solve_columns(mechanism, 0..self.nv, rows);
            u
        } else {
            let u = match limit::joint_row(model, contact) {
                Some((_, sign, row)) => {
                    VelocityPath::of(mechanism, contact.body).write_joint(row, sign, motion.v, rows)
                }
                None => write_rows(model, motion, contact, rows),
            };
            factor.half_solve_path(mechanism, contact.body, rows);
            u
        };
        self.u.extend(u);
        self.beyond.push([0.0; 3]);
        let close: fn(&mut [f64; 9]) = match contact.part {
            Part::Limit(..) => close_stop,
            Part::Friction(_) => joint_friction::close,
            Part::Wheel(_) if rollers::has_a_row_of_its_own(model, contact) => rollers::close,
            Part::Wheel(_) | Part::Box(_) | Part::Sphere(_) | Part::Collider(_) => return,
        };
        let own = self.own_block(c);
        let mut closed = own;
        close(&mut closed);
        self.beyond[c] = [0, 4, 8].map(|k| closed[k] - own[k]);
    }

    /// Z of a contact along its path.
    fn rows(&self, c: usize) -> &[Triple<f64>] {
        &self.Z[self.starts[c]..self.starts[c + 1]]
    }

    /// Calls `each` with the velocities of a contact, ascending, and its entries of Z.
    fn for_each<'a>(
        &'a self,
        model: &'a Model,
        c: usize,
        mut each: impl FnMut(usize, &Triple<f64>),
    ) {
        let path = along_path(model.mechanism(), &self.all, self.bodies[c]);
        for (&k, z) in path.iter().zip(self.rows(c)) {
            each(k, z);
        }
    }

    /// Z of a contact over all velocities, without the motions that would open a loop, as the rows
    /// of n, t and b (3 nv) at the end of `out`.
    pub(crate) fn push_rows(&self, model: &Model, c: usize, out: &mut Vec<f64>) {
        let (first, nv) = (out.len(), self.nv);
        out.resize(first + 3 * nv, 0.0);
        let out = &mut out[first..];
        let mut push = |k: usize, z: &Triple<f64>| {
            for i in 0..3 {
                out[i * nv + k] = z[i];
            }
        };
        if self.restricted.is_empty() {
            self.for_each(model, c, push);
        } else {
            let rows = &self.restricted[c * nv..][..nv];
            rows.iter().enumerate().for_each(|(k, z)| push(k, z));
        }
    }

    /// W of the assembled contacts.
    pub(crate) fn multiply(&mut self, model: &Model) {
        let (n, size) = (self.n_contacts(), 3 * self.n_contacts());
        let mut W = std::mem::take(&mut self.W);
        W.resize(size * size, 0.0);
        for c in 0..n {
            for d in 0..c {
                let block = self.block(model, c, d);
                for i in 0..3 {
                    for j in 0..3 {
                        let (row, column) = (3 * c + i, 3 * d + j);
                        W[row * size + column] = block[3 * i + j];
                        W[column * size + row] = block[3 * i + j];
                    }
                }
            }
            let mut own = self.own_block(c);
            for k in 0..3 {
                own[4 * k] += self.beyond[c][k];
            }
            for (i, row) in own.chunks_exact(3).enumerate() {
                W[(3 * c + i) * size + 3 * c..][..3].copy_from_slice(row);
            }
        }
        self.W = W;
    }

    /// The block of W for a contact with itself, without what is beyond the squares of Z.
    fn own_block(&self, c: usize) -> [f64; 9] {
        if self.restricted.is_empty() {
            square(0.0, self.rows(c))
        } else {
            square(0.0, &self.restricted[c * self.nv..][..self.nv])
        }
    }

    /// The block of W for two contacts.
    fn block(&self, model: &Model, c: usize, d: usize) -> [f64; 9] {
        if !self.restricted.is_empty() {
            let [x, y] = [c, d].map(|c| &self.restricted[c * self.nv..][..self.nv]);
            return product(0.0, x, y);
        }
        let (x, y) = (self.rows(c), self.rows(d));
        let mut block = [0.0; 9];
        match [self.bodies[c], self.bodies[d]] {
            [Some(a), Some(b)] => {
                let shared = model.common_path(a, b);
                return product(0.0, &x[..shared], &y[..shared]);
            }
            [None, None] => return product(0.0, x, y),
            [Some(_), None] => self.for_each(model, c, |k, x| add_product(&mut block, x, &y[k])),
            [None, Some(_)] => self.for_each(model, d, |k, y| add_product(&mut block, &x[k], y)),
        }
        block
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

    /// Begins with the rows as they are without loops, over all velocities.
    pub(crate) fn begin_restriction(&mut self, model: &Model) {
        let mut restricted = std::mem::take(&mut self.restricted);
        restricted.resize(self.n_contacts() * self.nv, [0.0; 3]);
        for (c, rows) in restricted.chunks_exact_mut(self.nv).enumerate() {
            self.for_each(model, c, |k, z| rows[k] = *z);
        }
        self.restricted = restricted;
    }

    /// The rows of a contact that loops restrict (nv).
    pub(crate) fn restricted_mut(&mut self, c: usize) -> &mut [Triple<f64>] {
        &mut self.restricted[c * self.nv..][..self.nv]
    }

    /// Makes the rows of H zero along directions in which nothing moves a contact. `free`: their
    /// squares without loops, 1/kg. On its diagonal W has the largest of these there, so that it is
    /// regular and the impulses are zero.
    pub(crate) fn hold(&mut self, c: usize, free: &Triple<f64>, held: [bool; 3]) {
        self.held.push(held);
        if !held.contains(&true) {
            return;
        }
        let own = &mut self.Z[self.starts[c]..self.starts[c + 1]];
        for z in own
            .iter_mut()
            .chain(&mut self.restricted[c * self.nv..][..self.nv])
        {
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

    /// `out = Zᵀ y` (3 n_c): local velocities of a velocity change `y` in factor coordinates.
    pub fn local(&self, model: &Model, y: &[f64], out: &mut [f64]) {
        for (c, values) in out.as_chunks_mut().0.iter_mut().enumerate() {
            *values = [0.0; 3];
            self.for_each(model, c, |k, z| add_scaled(values, z, y[k]));
        }
    }

    /// `out += Hᵀ v` for the velocity of `motion`, of the contacts from the given number on.
    pub(crate) fn add_local_of_velocity(
        &self,
        model: &Model,
        motion: &Still<'_>,
        (first, contacts): (usize, &[Contact]),
        out: &mut [f64],
    ) {
        for (c, (contact, values)) in (first..).zip(contacts.iter().zip(out.chunks_exact_mut(3))) {
            let held = self.held.get(c).copied().unwrap_or_default();
            if let Some((k, sign, row)) = limit::joint_row(model, contact) {
                values[row] += if held[row] { 0.0 } else { sign * motion.v[k] };
                continue;
            }
            let velocity = relative_velocity(motion, contact);
            for ((value, d), held) in values.iter_mut().zip(contact.frame.rows()).zip(held) {
                *value += if held { 0.0 } else { velocity.dot(&d) };
            }
        }
    }

    /// `y += Z p`: velocity change, in factor coordinates, due to impulses `p`.
    pub fn add_impulses(&self, model: &Model, p: &[f64], y: &mut [f64]) {
        for (c, p) in p.as_chunks().0.iter().enumerate() {
            self.for_each(model, c, |k, z| y[k] += along(z, p));
        }
    }
}

/// Velocities that move a contact on a body, ascending; `all` of them between two.
fn along_path<'a>(mechanism: &'a Mechanism, all: &'a [usize], body: Option<usize>) -> &'a [usize] {
    body.map_or(all, |body| mechanism.path(body))
}
