//! Mass matrix by the composite rigid body algorithm, and its factor `M = Lᵀ D L`.
//!
//! Rows are stored **along paths**: row `k` holds `M[k][i]` for the ancestors `i` of `k`, base
//! first and `k` itself last. An ancestor's row is then a prefix of its descendants' rows, so the
//! factorisation and the solves are dense loops over short contiguous segments and skip all
//! structural zeros. In a tree on a free base every path begins with the six velocities of the
//! base; loops over these are separate because their length is known.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 6 (composite bodies), ch. 8
//! (branch-induced sparsity).

use std::cmp::Ordering;
use std::ops::Range;

use nalgebra::{DMatrix, Vector3};

use super::joint::Motion;
use super::kinematics::Kinematics;
use super::model::{BASE, Model, Tree};
use crate::spatial::SymmetricMatrix3;

/// The mass matrix, its lower triangle along paths; kg, kg m, kg m².
#[derive(Clone, Debug)]
pub struct MassMatrix {
    stride: usize,
    rows: Vec<f64>,
    composites: Vec<Composite>,
}

/// A composite body: mass, first moment and inertia of a body and everything it carries, about its
/// tree's origin.
#[derive(Clone, Copy, Debug, Default)]
struct Composite {
    mass: f64,
    moment: Vector3<f64>,
    inertia: SymmetricMatrix3,
}

impl Composite {
    /// Linear momentum, and angular momentum about the tree's origin, at unit rate of a motion.
    #[inline]
    fn momentum(&self, motion: &Motion) -> (Vector3<f64>, Vector3<f64>) {
        let (a, v) = motion.twist();
        let f = v * self.mass + a.cross(&self.moment);
        let n = self.inertia.times(&a) + self.moment.cross(&v);
        (f, n)
    }
}

impl MassMatrix {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            stride: model.path_stride(),
            rows: vec![0.0; model.nv() * model.path_stride()],
            composites: vec![Composite::default(); model.bodies().len()],
        }
    }

    /// Recomputes M at the poses of `kinematics`.
    pub fn update(&mut self, model: &Model, kinematics: &Kinematics) {
        let bodies = model.bodies();
        let poses = kinematics.R.iter().zip(&kinematics.c);
        for ((composite, body), (R, c)) in self.composites.iter_mut().zip(bodies).zip(poses) {
            let I = &body.principal_inertia;
            let mut inertia = match &body.principal_axes {
                None => SymmetricMatrix3::rotated_diagonal(R, I),
                Some(P) => SymmetricMatrix3::rotated_diagonal(&(R * P), I),
            };
            inertia += SymmetricMatrix3::point_mass(body.mass, c);
            *composite = Composite {
                mass: body.mass,
                moment: c * body.mass,
                inertia,
            };
        }
        for tree in model.trees() {
            if tree.is_free {
                self.update_tree::<BASE>(model, tree, kinematics);
            } else {
                self.update_tree::<0>(model, tree, kinematics);
            }
        }
        for &b in model.coupled_bodies() {
            self.add_coupled(model, kinematics, b);
        }
        for &(k, inertia) in model.armatures() {
            self.add_to_diagonal(model, k, inertia);
        }
    }

    /// Rows of a tree in which `LEAD` velocities belong to a free root. Coupled joints contribute
    /// only the composite inertia that they carry.
    fn update_tree<const LEAD: usize>(
        &mut self,
        model: &Model,
        tree: &Tree,
        kinematics: &Kinematics,
    ) {
        let bodies = model.bodies();
        let Range { start, end } = tree.bodies;
        for b in (start..end).rev() {
            let body = &bodies[b];
            let composite = self.composites[b];
            let n_rows = if body.is_coupled { 0 } else { body.n_motions };
            for i in 0..n_rows {
                let motion = &kinematics.motions[body.motion + i];
                let (f, n) = composite.momentum(motion);
                let row = &mut self.rows[(body.velocity + i) * self.stride..];
                let (base, joints) = row.split_at_mut(LEAD);
                if let Some(base) = base.first_chunk_mut::<BASE>() {
                    *base = [f.x, f.y, f.z, n.x, n.y, n.z];
                }
                for (entry, &m) in joints.iter_mut().zip(model.motions(b)) {
                    *entry = kinematics.motions[m].power(&f, &n);
                }
            }
            if let Some(parent) = body.parent {
                let parent = &mut self.composites[parent];
                parent.mass += composite.mass;
                parent.moment += composite.moment;
                parent.inertia += composite.inertia;
            }
        }
        if LEAD == 0 {
            return;
        }
        let (base, w) = (self.composites[tree.bodies.start], self.stride);
        let (m, s, I) = (base.mass, base.moment, base.inertia);
        let base = [
            [m, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, m, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, m, 0.0, 0.0, 0.0],
            [0.0, -s.z, s.y, I.xx, 0.0, 0.0],
            [s.z, 0.0, -s.x, I.xy, I.yy, 0.0],
            [-s.y, s.x, 0.0, I.xz, I.yz, I.zz],
        ];
        for (k, row) in base.iter().enumerate() {
            self.rows[(tree.velocities.start + k) * w..][..BASE].copy_from_slice(row);
        }
    }

    /// Adds the products of a coupled joint's motion with all motions that move its carrier, and
    /// with itself.
    fn add_coupled(&mut self, model: &Model, kinematics: &Kinematics, b: usize) {
        let body = &model.bodies()[b];
        let (k, own) = (body.velocity, &kinematics.motions[body.motion]);
        let (f, n) = self.composites[b].momentum(own);
        let at = last(model, k);
        let w = self.stride;
        self.rows[k * w + at] += own.power(&f, &n);
        let Some(parent) = body.parent else {
            return;
        };
        let (lead, rest) = model.split_path(parent);
        let of_base = f.iter().chain(&n).copied();
        for (entry, value) in self.rows[k * w..].iter_mut().zip(of_base).take(lead.len()) {
            *entry += value;
        }
        for ((p, &i), &m) in rest.iter().enumerate().zip(model.motions(parent)) {
            let shared = kinematics.motions[m].power(&f, &n);
            match i.cmp(&k) {
                Ordering::Less => self.rows[k * w + lead.len() + p] += shared,
                Ordering::Equal => self.rows[k * w + at] += 2.0 * shared,
                Ordering::Greater => self.rows[i * w + at] += shared,
            }
        }
    }

    /// Diagonal entry of velocity `k`.
    #[inline]
    #[must_use]
    pub fn diagonal(&self, model: &Model, k: usize) -> f64 {
        self.rows[k * self.stride + last(model, k)]
    }

    /// Adds the implicit terms of a held joint to the diagonal entry of velocity `k`.
    #[inline]
    pub fn add_to_diagonal(&mut self, model: &Model, k: usize, value: f64) {
        self.rows[k * self.stride + last(model, k)] += value;
    }

    /// Adds a symmetric matrix over the velocities of a body's path: `entry` gives that of two
    /// places on the path. Entries between velocities of which none moves the other's body are left
    /// out.
    pub(crate) fn add_quadratic(
        &mut self,
        model: &Model,
        path: &[usize],
        entry: impl Fn(usize, usize) -> f64,
    ) {
        for (p, &k) in path.iter().enumerate() {
            let own = model.velocity_path(k);
            for (q, &i) in path.iter().enumerate().filter(|(_, i)| **i <= k) {
                if let Some(at) = own.iter().position(|&j| j == i) {
                    self.rows[k * self.stride + at] += entry(p, q);
                }
            }
        }
    }

    /// `M v` (nv).
    pub fn times(&self, model: &Model, v: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for k in 0..model.nv() {
            let n = last(model, k);
            let row = &self.rows[k * self.stride..][..=n];
            let path = model.velocity_path(k);
            out[k] += row[n] * v[k];
            for (entry, &i) in row[..n].iter().zip(path) {
                out[k] += entry * v[i];
                out[i] += entry * v[k];
            }
        }
    }

    /// As a full symmetric matrix (nv, nv).
    #[must_use]
    pub fn to_dense(&self, model: &Model) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(model.nv(), model.nv());
        self.add_to_dense(model, &mut dense);
        dense
    }

    /// Adds M to a full matrix (nv, nv).
    pub fn add_to_dense(&self, model: &Model, dense: &mut DMatrix<f64>) {
        for (k, row) in self.rows.chunks_exact(self.stride).enumerate() {
            let path = model.velocity_path(k);
            for (entry, &i) in row.iter().zip(&path[..path.len() - 1]) {
                dense[(k, i)] += entry;
                dense[(i, k)] += entry;
            }
            dense[(k, k)] += row[path.len() - 1];
        }
    }

    /// Computes `M = Lᵀ D L` in the storage of `factor`. Returns whether M is positive definite.
    pub fn factorise(&self, model: &Model, factor: &mut FactoredMassMatrix) -> bool {
        factor.rows.copy_from_slice(&self.rows);
        factor.update(model)
    }
}

/// Position of velocity `k` in its own row.
#[inline]
fn last(model: &Model, k: usize) -> usize {
    model.velocity_path(k).len() - 1
}

/// `M = Lᵀ D L`, L unit lower triangular with M's sparsity. Holds `L` along paths and `D^(-1/2)`.
#[derive(Clone, Debug)]
pub struct FactoredMassMatrix {
    stride: usize,
    rows: Vec<f64>,
    inverse_root: Vec<f64>,
    /// Whether a velocity belongs to a tree on a free base.
    is_free: Vec<bool>,
    /// Range in `ancestors` of each velocity.
    spans: Vec<Range<usize>>,
    /// The velocities that precede each one on its path, without those of a free base, counted from
    /// the tree's first joint: the indices of the loops over one tree.
    ancestors: Vec<usize>,
}

impl FactoredMassMatrix {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let (mut spans, mut ancestors) = (Vec::new(), Vec::new());
        for tree in model.trees() {
            let first = tree.velocities.start + tree.lead();
            for k in tree.velocities.clone() {
                let path = model.velocity_path(k);
                let before = path[..path.len() - 1].iter().skip(tree.lead());
                let begin = ancestors.len();
                ancestors.extend(before.map(|i| i - first));
                spans.push(begin..ancestors.len());
            }
        }
        Self {
            spans,
            ancestors,
            stride: model.path_stride(),
            rows: vec![0.0; model.nv() * model.path_stride()],
            inverse_root: vec![0.0; model.nv()],
            is_free: (model.trees().iter())
                .flat_map(|tree| tree.velocities.clone().map(|_| tree.is_free))
                .collect(),
        }
    }

    fn update(&mut self, model: &Model) -> bool {
        (model.trees().iter()).all(|tree| {
            if tree.is_free {
                self.update_tree::<BASE>(tree)
            } else {
                self.update_tree::<0>(tree)
            }
        })
    }

    fn update_tree<const LEAD: usize>(&mut self, tree: &Tree) -> bool {
        let w = self.stride;
        let Range { start, end } = tree.velocities;
        let spans = &self.spans[start + LEAD..end];
        let roots = &mut self.inverse_root[start..end];
        let rows = &mut self.rows[start * w..end * w];
        let (base_rows, joint_rows) = rows.split_at_mut(LEAD * w);
        for (j, span) in spans.iter().enumerate().rev() {
            let (above, own) = joint_rows.split_at_mut(j * w);
            let ancestors = &self.ancestors[span.clone()];
            let n = ancestors.len();
            let (base, joints) = own[..=LEAD + n].split_at_mut(LEAD);
            let Some(inverse_root) = inverse_root(joints[n]) else {
                return false;
            };
            roots[LEAD + j] = inverse_root;
            let inverse = inverse_root * inverse_root;
            for p in (0..n).rev() {
                let a = joints[p] * inverse;
                let (ancestor, rest) = above[ancestors[p] * w..].split_at_mut(LEAD);
                subtract(ancestor, a, base);
                subtract(&mut rest[..=p], a, &joints[..=p]);
                joints[p] = a;
            }
            let factors: [f64; LEAD] = std::array::from_fn(|p| base[p] * inverse);
            for p in 0..LEAD {
                subtract(&mut base_rows[p * w..][..=p], factors[p], &base[..=p]);
            }
            base.copy_from_slice(&factors);
        }
        for k in (0..LEAD).rev() {
            let (above, own) = base_rows.split_at_mut(k * w);
            let Some(inverse_root) = inverse_root(own[k]) else {
                return false;
            };
            roots[k] = inverse_root;
            let inverse = inverse_root * inverse_root;
            for p in (0..k).rev() {
                let a = own[p] * inverse;
                subtract(&mut above[p * w..][..=p], a, &own[..=p]);
                own[p] = a;
            }
        }
        true
    }

    /// `y ← D^(-1/2) L^(-T) y` for a full vector (nv).
    pub fn half_solve(&self, model: &Model, y: &mut [f64]) {
        for tree in model.trees() {
            if tree.is_free {
                self.half_solve_tree::<BASE>(tree, y);
            } else {
                self.half_solve_tree::<0>(tree, y);
            }
        }
    }

    fn half_solve_tree<const LEAD: usize>(&self, tree: &Tree, y: &mut [f64]) {
        let Range { start, end } = tree.velocities;
        let rows = &self.rows[start * self.stride..end * self.stride];
        let roots = &self.inverse_root[start..end];
        let spans = &self.spans[start + LEAD..end];
        let (base, joints) = y[start..end].split_at_mut(LEAD);
        let joint_rows = rows[LEAD * self.stride..].chunks_exact(self.stride);
        for (j, (row, span)) in joint_rows.zip(spans).enumerate().rev() {
            let value = joints[j];
            let (row, rest) = row.split_at(LEAD);
            subtract(base, value, row);
            for (entry, &i) in rest.iter().zip(&self.ancestors[span.clone()]) {
                joints[i] -= entry * value;
            }
            joints[j] = value * roots[LEAD + j];
        }
        for k in (0..LEAD).rev() {
            let value = base[k];
            subtract(&mut base[..k], value, &rows[k * self.stride..][..k]);
            base[k] = value * roots[k];
        }
    }

    /// `y ← D^(-1/2) L^(-T) y` for several columns along a path (nothing else is nonzero).
    #[inline]
    pub fn half_solve_path<const N: usize>(&self, path: &[usize], y: &mut [[f64; N]]) {
        match path.first() {
            Some(&k) if self.is_free[k] => self.half_solve_path_of::<N, BASE>(path, y),
            _ => self.half_solve_path_of::<N, 0>(path, y),
        }
    }

    #[inline]
    fn half_solve_path_of<const N: usize, const LEAD: usize>(
        &self,
        path: &[usize],
        y: &mut [[f64; N]],
    ) {
        let (base, joints) = y.split_at_mut(LEAD);
        for (p, &k) in path[LEAD..].iter().enumerate().rev() {
            let (before, own) = joints.split_at_mut(p);
            let value = own[0];
            let (row, rest) = self.rows[k * self.stride..].split_at(LEAD);
            subtract_columns(base, &value, row);
            subtract_columns(before, &value, &rest[..p]);
            own[0] = value.map(|x| x * self.inverse_root[k]);
        }
        let start = path.first().copied().unwrap_or(0);
        for k in (0..LEAD).rev() {
            let (before, own) = base.split_at_mut(k);
            let value = own[0];
            subtract_columns(before, &value, &self.rows[(start + k) * self.stride..][..k]);
            own[0] = value.map(|x| x * self.inverse_root[start + k]);
        }
    }

    /// `y ← D^(-1/2) L^(-T) y` for several columns (nv) with the given nonzero velocities:
    /// ascending, and closed under ancestors.
    pub fn half_solve_columns<const N: usize>(
        &self,
        model: &Model,
        velocities: impl DoubleEndedIterator<Item = usize>,
        y: &mut [[f64; N]],
    ) {
        for k in velocities.rev() {
            let value = y[k];
            let path = model.velocity_path(k);
            let row = &self.rows[k * self.stride..];
            for (entry, &i) in row.iter().zip(&path[..path.len() - 1]) {
                for (y, x) in y[i].iter_mut().zip(&value) {
                    *y -= entry * x;
                }
            }
            y[k] = value.map(|x| x * self.inverse_root[k]);
        }
    }

    /// `x ← L^(-1) D^(-1/2) x`; after [`Self::half_solve`] the result is `M^(-1)` times the vector.
    pub fn half_solve_back(&self, model: &Model, x: &mut [f64]) {
        for tree in model.trees() {
            if tree.is_free {
                self.half_solve_back_tree::<BASE>(tree, x);
            } else {
                self.half_solve_back_tree::<0>(tree, x);
            }
        }
    }

    fn half_solve_back_tree<const LEAD: usize>(&self, tree: &Tree, x: &mut [f64]) {
        let Range { start, end } = tree.velocities;
        let rows = &self.rows[start * self.stride..end * self.stride];
        let roots = &self.inverse_root[start..end];
        let spans = &self.spans[start + LEAD..end];
        let (base, joints) = x[start..end].split_at_mut(LEAD);
        for k in 0..LEAD {
            let mut value = base[k] * roots[k];
            for (entry, x) in rows[k * self.stride..][..k].iter().zip(&*base) {
                value -= entry * x;
            }
            base[k] = value;
        }
        let joint_rows = rows[LEAD * self.stride..].chunks_exact(self.stride);
        for (j, (row, span)) in joint_rows.zip(spans).enumerate() {
            let (row, rest) = row.split_at(LEAD);
            let mut value = joints[j] * roots[LEAD + j];
            for (entry, x) in row.iter().zip(&*base) {
                value -= entry * x;
            }
            for (entry, &i) in rest.iter().zip(&self.ancestors[span.clone()]) {
                value -= entry * joints[i];
            }
            joints[j] = value;
        }
    }
}

/// `1/√pivot`; `None` if the matrix is not positive definite.
#[inline]
fn inverse_root(pivot: f64) -> Option<f64> {
    (pivot > 0.0).then(|| 1.0 / pivot.sqrt())
}

/// `x −= a y`.
#[inline]
fn subtract(x: &mut [f64], a: f64, y: &[f64]) {
    for (x, y) in x.iter_mut().zip(y) {
        *x -= a * y;
    }
}

/// `x −= y ⊗ a`, row by row.
#[inline]
fn subtract_columns<const N: usize>(x: &mut [[f64; N]], a: &[f64; N], y: &[f64]) {
    for (x, y) in x.iter_mut().zip(y) {
        for (x, a) in x.iter_mut().zip(a) {
            *x -= y * a;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::multibody::state::Configuration;

    #[test]
    fn factor_solves_what_the_dense_matrix_multiplies() {
        let model = Model::rover();
        let mut configuration = Configuration::zero(&model);
        let v: Vec<f64> = (0..model.nv()).map(|k| (k as f64 * 0.7).sin()).collect();
        configuration.advance(&model, &v, 1.0);
        let kinematics = Kinematics::of(&model, &configuration);
        let mut M = MassMatrix::new(&model);
        M.update(&model, &kinematics);
        let dense = M.to_dense(&model);
        let mut b = vec![0.0; model.nv()];
        M.times(&model, &v, &mut b);
        let expected = &dense * nalgebra::DVector::from_column_slice(&v);
        assert!((nalgebra::DVector::from_column_slice(&b) - expected).norm() < 1e-10);
        let mut factor = FactoredMassMatrix::new(&model);
        assert!(M.factorise(&model, &mut factor));
        factor.half_solve(&model, &mut b);
        factor.half_solve_back(&model, &mut b);
        for (x, y) in b.iter().zip(&v) {
            assert!((x - y).abs() < 1e-12, "{x} {y}");
        }
    }
}
