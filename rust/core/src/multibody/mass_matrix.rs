//! Mass matrix by composite rigid bodies, and its factor `M = Lᵀ D L`.
//!
//! Rows are stored **along paths**: row `k` holds `M[k][i]` for the ancestors `i` of `k`, base first,
//! itself last. An ancestor's row is then a prefix of its descendants' rows, so the factorisation and the
//! solves are dense loops over short contiguous pieces and never touch a structural zero.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 6 (composite bodies), ch. 8
//! (branch-induced sparsity).

use nalgebra::{DMatrix, Vector3};

use super::kinematics::Kinematics;
use super::model::Model;
use crate::spatial::SymmetricMatrix3;

/// The mass matrix, its lower triangle along paths; kg, kg m, kg m².
#[derive(Clone, Debug)]
pub struct MassMatrix {
    stride: usize,
    rows: Vec<f64>,
    mass: Vec<f64>,
    moment: Vec<Vector3<f64>>,
    inertia: Vec<SymmetricMatrix3>,
}

impl MassMatrix {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let n = model.bodies().len();
        Self {
            stride: model.path_stride(),
            rows: vec![0.0; model.nv() * model.path_stride()],
            mass: vec![0.0; n],
            moment: vec![Vector3::zeros(); n],
            inertia: vec![SymmetricMatrix3::default(); n],
        }
    }

    /// Recomputes M at the poses of `kinematics`.
    pub fn update(&mut self, model: &Model, kinematics: &Kinematics) {
        let bodies = model.bodies();
        for (b, body) in bodies.iter().enumerate() {
            let c = &kinematics.c[b];
            let mut inertia = match &body.principal_axes {
                None => {
                    SymmetricMatrix3::rotated_diagonal(&kinematics.R[b], &body.principal_inertia)
                }
                Some(P) => SymmetricMatrix3::rotated_diagonal(
                    &(kinematics.R[b] * P),
                    &body.principal_inertia,
                ),
            };
            inertia += SymmetricMatrix3::point_mass(body.mass, c);
            self.mass[b] = body.mass;
            self.moment[b] = c * body.mass;
            self.inertia[b] = inertia;
        }
        for b in (1..bodies.len()).rev() {
            let parent = bodies[b].parent;
            let a = kinematics.axis[b];
            // Momentum of the composite body when its joint turns at unit rate, about the trunk origin.
            let v = kinematics.r[b].cross(&a);
            let f = v * self.mass[b] + a.cross(&self.moment[b]);
            let n = self.inertia[b].times(&a) + self.moment[b].cross(&v);
            let row = &mut self.rows[(5 + b) * self.stride..][..self.stride];
            row[..3].copy_from_slice(f.as_slice());
            row[3..6].copy_from_slice(n.as_slice());
            for (entry, &k) in row.iter_mut().zip(model.path(b)).skip(6) {
                *entry = kinematics.axis[k - 5].dot(&(n - kinematics.r[k - 5].cross(&f)));
            }
            self.mass[parent] += self.mass[b];
            self.moment[parent] = self.moment[parent] + self.moment[b];
            let inertia = self.inertia[b];
            self.inertia[parent] += inertia;
        }
        let (m, s, I, w) = (self.mass[0], self.moment[0], self.inertia[0], self.stride);
        let base = [
            [m, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, m, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, m, 0.0, 0.0, 0.0],
            [0.0, -s.z, s.y, I.xx, 0.0, 0.0],
            [s.z, 0.0, -s.x, I.xy, I.yy, 0.0],
            [-s.y, s.x, 0.0, I.xz, I.yz, I.zz],
        ];
        for (k, row) in base.iter().enumerate() {
            self.rows[k * w..][..6].copy_from_slice(row);
        }
    }

    /// Diagonal entry of velocity `k` (a joint: `k ≥ 6`).
    #[inline]
    #[must_use]
    pub fn diagonal(&self, model: &Model, k: usize) -> f64 {
        self.rows[k * self.stride + last(model, k)]
    }

    /// Adds to the diagonal entry of velocity `k`: the implicit terms of a held joint.
    #[inline]
    pub fn add_to_diagonal(&mut self, model: &Model, k: usize, value: f64) {
        self.rows[k * self.stride + last(model, k)] += value;
    }

    /// `M v` (nv).
    pub fn times(&self, model: &Model, v: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for k in 0..model.nv() {
            let n = last(model, k);
            let row = &self.rows[k * self.stride..][..=n];
            let path = path(model, k);
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
        for k in 0..model.nv() {
            for (entry, &i) in self.rows[k * self.stride..].iter().zip(path(model, k)) {
                dense[(k, i)] = *entry;
                dense[(i, k)] = *entry;
            }
        }
        dense
    }

    /// Factor `M = Lᵀ D L` into the room of `factor`. Returns whether M was positive definite.
    pub fn factorise(&self, model: &Model, factor: &mut FactoredMassMatrix) -> bool {
        factor.rows.copy_from_slice(&self.rows);
        factor.update(model)
    }
}

/// Velocity indices from the base to velocity `k` itself.
#[inline]
fn path(model: &Model, k: usize) -> &[usize] {
    if k < 6 {
        &model.path(0)[..=k]
    } else {
        model.path(k - 5)
    }
}

/// Position of velocity `k` in its own row.
#[inline]
fn last(model: &Model, k: usize) -> usize {
    if k < 6 {
        k
    } else {
        model.path(k - 5).len() - 1
    }
}

/// `M = Lᵀ D L`, L unit lower triangular with M's sparsity. Holds `L` along paths and `D^(-1/2)`.
#[derive(Clone, Debug)]
pub struct FactoredMassMatrix {
    stride: usize,
    rows: Vec<f64>,
    inverse_root: Vec<f64>,
}

impl FactoredMassMatrix {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            stride: model.path_stride(),
            rows: vec![0.0; model.nv() * model.path_stride()],
            inverse_root: vec![0.0; model.nv()],
        }
    }

    fn update(&mut self, model: &Model) -> bool {
        let w = self.stride;
        for k in (0..model.nv()).rev() {
            let (above, rest) = self.rows.split_at_mut(k * w);
            let n = last(model, k);
            let row = &mut rest[..=n];
            let d = row[n];
            if d.is_nan() || d <= 0.0 {
                return false;
            }
            let inverse_root = 1.0 / d.sqrt();
            self.inverse_root[k] = inverse_root;
            let inverse = inverse_root * inverse_root;
            let path = path(model, k);
            for p in (0..n).rev() {
                let a = row[p] * inverse;
                let ancestor = &mut above[path[p] * w..][..=p];
                for (x, y) in ancestor.iter_mut().zip(&row[..=p]) {
                    *x -= a * y;
                }
                row[p] = a;
            }
        }
        true
    }

    /// `y ← D^(-1/2) L^(-T) y` for a full vector (nv).
    pub fn half_solve(&self, model: &Model, y: &mut [f64]) {
        for k in (0..model.nv()).rev() {
            let value = y[k];
            let row = &self.rows[k * self.stride..][..last(model, k)];
            for (entry, &i) in row.iter().zip(path(model, k)) {
                y[i] -= entry * value;
            }
            y[k] = value * self.inverse_root[k];
        }
    }

    /// `y ← D^(-1/2) L^(-T) y` for several columns along a path (nothing else is nonzero).
    #[inline]
    pub fn half_solve_path<const N: usize>(&self, path: &[usize], y: &mut [[f64; N]]) {
        for (p, &k) in path.iter().enumerate().rev() {
            let (before, own) = y.split_at_mut(p);
            let value = own[0];
            let row = &self.rows[k * self.stride..][..p];
            for (x, entry) in before.iter_mut().zip(row) {
                for (x, value) in x.iter_mut().zip(value) {
                    *x -= entry * value;
                }
            }
            own[0] = value.map(|x| x * self.inverse_root[k]);
        }
    }

    /// `x ← L^(-1) D^(-1/2) x`: with [`Self::half_solve`] before it, `M^(-1)`.
    pub fn half_solve_back(&self, model: &Model, x: &mut [f64]) {
        for k in 0..model.nv() {
            let row = &self.rows[k * self.stride..][..last(model, k)];
            let mut value = x[k] * self.inverse_root[k];
            for (entry, &i) in row.iter().zip(path(model, k)) {
                value -= entry * x[i];
            }
            x[k] = value;
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
        configuration.advance(&v, 1.0);
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
