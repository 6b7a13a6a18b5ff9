//! Mass matrix by the composite rigid body algorithm, and its factor `M = Lᵀ D L`.
//!
//! Entries are stored as in [`crate::multibody::mass_matrix`], along paths: the row of a joint is
//! its six entries with the base, then those with its ancestors, then its own. The block of the
//! base is apart, by the rows of its lower triangle.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 6 (composite bodies), ch. 8
//! (branch-induced sparsity).

use super::inertias::{Inertia, Inertias};
use super::machine::{Link, Machine, velocity};
use super::poses::{Pose, Poses};
use crate::multibody::model::BASE;
use crate::scalar::{Lane, Vec3};

/// Entries of the base's lower triangle.
const BLOCK: usize = BASE * (BASE + 1) / 2;

/// The mass matrix; kg, kg m, kg m².
#[derive(Clone, Debug)]
pub struct MassMatrix<T: Lane> {
    token: T::Token,
    block: [T; BLOCK],
    /// Of each joint.
    base: Vec<[T; BASE]>,
    joints: Vec<T>,
    composites: Vec<Composite<T>>,
}

/// Mass, first moment and inertia of a body and everything it carries, about the trunk's origin.
#[derive(Clone, Copy, Debug)]
struct Composite<T> {
    mass: T,
    moment: Vec3<T>,
    inertia: Symmetric<T>,
}

/// A symmetric matrix.
#[derive(Clone, Copy, Debug)]
struct Symmetric<T> {
    xx: T,
    yy: T,
    zz: T,
    xy: T,
    xz: T,
    yz: T,
}

impl<T: Lane> Symmetric<T> {
    #[inline(always)]
    fn times(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// Adds `k a aᵀ`.
    #[inline(always)]
    fn add_square(&mut self, k: T, a: Vec3<T>) {
        let ka = a * k;
        self.xx += ka.x * a.x;
        self.yy += ka.y * a.y;
        self.zz += ka.z * a.z;
        self.xy += ka.x * a.y;
        self.xz += ka.x * a.z;
        self.yz += ka.y * a.z;
    }
}

impl<T: Lane> Composite<T> {
    /// A single body.
    #[inline(always)]
    fn of(link: &Link, inertia: &Inertia<T>, pose: &Pose<T>) -> Self {
        let Inertia { mass, rest, .. } = *inertia;
        let Vec3 { x, y, z } = pose.c;
        let moment = pose.c * mass;
        let (xx, yy, zz) = (moment.x * x, moment.y * y, moment.z * z);
        // About the trunk's origin: m (|c|² 1 − c cᵀ) more than about the mass centre.
        let mut sum = Symmetric {
            xx: rest + (yy + zz),
            yy: rest + (xx + zz),
            zz: rest + (xx + yy),
            xy: -(moment.x * y),
            xz: -(moment.x * z),
            yz: -(moment.y * z),
        };
        let (a, b) = inertia.axes(link.symmetry, &pose.R);
        sum.add_square(inertia.first, a);
        if let Some(b) = b {
            sum.add_square(inertia.second, b);
        }
        Self {
            mass,
            moment,
            inertia: sum,
        }
    }

    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        let (a, b) = (&self.inertia, &other.inertia);
        Self {
            mass: self.mass + other.mass,
            moment: self.moment + other.moment,
            inertia: Symmetric {
                xx: a.xx + b.xx,
                yy: a.yy + b.yy,
                zz: a.zz + b.zz,
                xy: a.xy + b.xy,
                xz: a.xz + b.xz,
                yz: a.yz + b.yz,
            },
        }
    }
}

impl<T: Lane> MassMatrix<T> {
    /// Room for a machine.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        let zero = T::splat(token, 0.0);
        let composite = Composite {
            mass: zero,
            moment: Vec3::new(zero, zero, zero),
            inertia: Symmetric {
                xx: zero,
                yy: zero,
                zz: zero,
                xy: zero,
                xz: zero,
                yz: zero,
            },
        };
        Self {
            token,
            block: [zero; BLOCK],
            base: vec![[zero; BASE]; machine.n_joints()],
            joints: vec![zero; machine.n_entries()],
            composites: vec![composite; machine.n_bodies()],
        }
    }

    /// Recomputes M at the poses.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn update(&mut self, machine: &Machine, inertias: &Inertias<T>, poses: &Poses<T>) {
        T::vectorize(self.token, || self.update_here(machine, inertias, poses));
    }

    #[inline(always)]
    fn update_here(&mut self, machine: &Machine, inertias: &Inertias<T>, poses: &Poses<T>) {
        let n = machine.links.len();
        let links = &machine.links[..n];
        let (bodies, inertias) = (&poses.bodies[..n], &inertias.bodies[..n]);
        let carried = &mut self.composites[..n];
        let base = &mut self.base[..n - 1];
        for b in (1..n).rev() {
            let (link, pose) = (&links[b], &bodies[b]);
            let mut composite = Composite::of(link, &inertias[b], pose);
            if !link.is_leaf {
                composite = composite.plus(&carried[b]);
            }
            let Composite {
                mass,
                moment,
                inertia,
            } = composite;
            // Momentum, and angular momentum about the trunk's origin, at unit rate of the joint.
            let f = pose.swing * mass + pose.axis.cross(moment);
            let l = inertia.times(pose.axis) + moment.cross(pose.swing);
            base[b - 1] = [f.x, f.y, f.z, l.x, l.y, l.z];
            let ancestors = machine.ancestors(b);
            let row = &mut self.joints[link.row..][..=ancestors.len()];
            for (entry, &a) in row.iter_mut().zip(ancestors) {
                *entry = bodies[a].power(f, l);
            }
            row[ancestors.len()] = pose.power(f, l);
            carried[link.parent] = if link.is_last {
                composite
            } else {
                carried[link.parent].plus(&composite)
            };
        }
        let mut trunk = Composite::of(&links[0], &inertias[0], &bodies[0]);
        if n > 1 {
            trunk = trunk.plus(&carried[0]);
        }
        let (m, s, I) = (trunk.mass, trunk.moment, trunk.inertia);
        let o = m.like(0.0);
        self.block = [
            m, //
            o, m, //
            o, o, m, //
            o, -s.z, s.y, I.xx, //
            s.z, o, -s.x, I.xy, I.yy, //
            -s.y, s.x, o, I.xz, I.yz, I.zz,
        ];
    }

    /// Diagonal entry of the joint of body `b`.
    #[inline(always)]
    pub fn diagonal(&self, machine: &Machine, b: usize) -> T {
        self.joints[machine.links[b].row + machine.ancestors(b).len()]
    }

    /// Adds the implicit terms of a held joint to the diagonal entry of the joint of body `b`.
    #[inline(always)]
    pub fn add_to_diagonal(&mut self, machine: &Machine, b: usize, value: T) {
        self.joints[machine.links[b].row + machine.ancestors(b).len()] += value;
    }

    /// Lane `lane` as a full symmetric matrix (nv, nv).
    #[must_use]
    pub fn to_dense(&self, machine: &Machine, lane: usize) -> nalgebra::DMatrix<f64> {
        let nv = machine.nv();
        let mut dense = nalgebra::DMatrix::zeros(nv, nv);
        let mut set = |i: usize, j: usize, x: T| {
            dense[(i, j)] = x.get(lane);
            dense[(j, i)] = x.get(lane);
        };
        for i in 0..BASE {
            for j in 0..=i {
                set(i, j, self.block[i * (i + 1) / 2 + j]);
            }
        }
        for b in 1..machine.n_bodies() {
            let row = self.base[b - 1]
                .iter()
                .chain(&self.joints[machine.links[b].row..]);
            for (&j, &x) in machine.path(b).iter().zip(row) {
                set(velocity(b), j, x);
            }
        }
        dense
    }

    /// Computes `M = Lᵀ D L`. Returns where M is positive definite; the factor of any other lane is
    /// not a number.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn factorise(&self, machine: &Machine, factor: &mut Factor<T>) -> T::Mask {
        T::vectorize(self.token, || factor.update_here(machine, self))
    }
}

impl<T: Lane> Pose<T> {
    /// Generalized force on its joint of a force and its moment about the trunk's origin.
    #[inline(always)]
    pub fn power(&self, force: Vec3<T>, moment: Vec3<T>) -> T {
        self.axis.dot(moment) + self.swing.dot(force)
    }
}

/// `M = Lᵀ D L`, L unit lower triangular with M's sparsity. Holds `L` and `D^(-1/2)`.
#[derive(Clone, Debug)]
pub struct Factor<T: Lane> {
    block: [T; BLOCK],
    base: Vec<[T; BASE]>,
    joints: Vec<T>,
    block_root: [T; BASE],
    /// Of each joint.
    root: Vec<T>,
}

impl<T: Lane> Factor<T> {
    /// Room for a machine.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            block: [zero; BLOCK],
            base: vec![[zero; BASE]; machine.n_joints()],
            joints: vec![zero; machine.n_entries()],
            block_root: [zero; BASE],
            root: vec![zero; machine.n_joints()],
        }
    }

    #[inline(always)]
    fn update_here(&mut self, machine: &Machine, M: &MassMatrix<T>) -> T::Mask {
        let n = machine.n_joints();
        let (base_rows, roots) = (&mut self.base[..n], &mut self.root[..n]);
        base_rows.copy_from_slice(&M.base);
        self.joints.copy_from_slice(&M.joints);
        let mut block = M.block;
        let one = block[0].like(1.0);
        let zero = block[0].like(0.0);
        let mut is_positive = block[0].gt(zero);
        for j in (0..n).rev() {
            let ancestors = machine.ancestors(j + 1);
            let p_own = ancestors.len();
            let (above, own) = self.joints.split_at_mut(machine.links[j + 1].row);
            let (base_above, base) = base_rows.split_at_mut(j);
            let (own, base) = (&mut own[..=p_own], &mut base[0]);
            let pivot = own[p_own];
            is_positive = is_positive & pivot.gt(zero);
            let root = one / pivot.sqrt();
            let inverse = root * root;
            roots[j] = root;
            for p in (0..p_own).rev() {
                let a = own[p] * inverse;
                let ancestor = ancestors[p];
                subtract(&mut base_above[ancestor - 1], a, base);
                let row = &mut above[machine.links[ancestor].row..][..=p];
                for (x, y) in row.iter_mut().zip(&*own) {
                    *x -= a * *y;
                }
                own[p] = a;
            }
            let mut at = 0;
            for i in 0..BASE {
                let a = base[i] * inverse;
                for k in 0..=i {
                    block[at] -= a * base[k];
                    at += 1;
                }
            }
            for x in base {
                *x *= inverse;
            }
        }
        for k in (0..BASE).rev() {
            let start = k * (k + 1) / 2;
            let pivot = block[start + k];
            is_positive = is_positive & pivot.gt(zero);
            let root = one / pivot.sqrt();
            let inverse = root * root;
            self.block_root[k] = root;
            for p in (0..k).rev() {
                let a = block[start + p] * inverse;
                for i in 0..=p {
                    block[p * (p + 1) / 2 + i] -= a * block[start + i];
                }
                block[start + p] = a;
            }
        }
        self.block = block;
        is_positive
    }

    /// `y ← D^(-1/2) L^(-T) y` (nv).
    #[inline(always)]
    pub fn half_solve(&self, machine: &Machine, y: &mut [T]) {
        let n = machine.n_joints();
        let (rows, roots) = (&self.base[..n], &self.root[..n]);
        let (base, joints) = y.split_at_mut(BASE);
        let joints = &mut joints[..n];
        let mut sum = [base[0]; BASE];
        sum.copy_from_slice(base);
        for j in (0..n).rev() {
            let value = joints[j];
            subtract(&mut sum, value, &rows[j]);
            let ancestors = machine.ancestors(j + 1);
            let entries = &self.joints[machine.links[j + 1].row..][..ancestors.len()];
            for (entry, &a) in entries.iter().zip(ancestors) {
                joints[a - 1] -= *entry * value;
            }
            joints[j] = value * roots[j];
        }
        for k in (0..BASE).rev() {
            let value = sum[k];
            for i in 0..k {
                sum[i] -= self.block[k * (k + 1) / 2 + i] * value;
            }
            base[k] = value * self.block_root[k];
        }
    }

    /// `x ← L^(-1) D^(-1/2) x` (nv); after [`Self::half_solve`] the result is `M^(-1)` times the
    /// vector.
    #[inline(always)]
    pub fn half_solve_back(&self, machine: &Machine, x: &mut [T]) {
        let n = machine.n_joints();
        let (rows, roots) = (&self.base[..n], &self.root[..n]);
        let (base, joints) = x.split_at_mut(BASE);
        let joints = &mut joints[..n];
        let mut known = [base[0]; BASE];
        for k in 0..BASE {
            let mut value = base[k] * self.block_root[k];
            for i in 0..k {
                value -= self.block[k * (k + 1) / 2 + i] * known[i];
            }
            known[k] = value;
        }
        base.copy_from_slice(&known);
        for j in 0..n {
            let mut value = joints[j] * roots[j];
            for i in 0..BASE {
                value -= rows[j][i] * known[i];
            }
            let ancestors = machine.ancestors(j + 1);
            let entries = &self.joints[machine.links[j + 1].row..][..ancestors.len()];
            for (entry, &a) in entries.iter().zip(ancestors) {
                value -= *entry * joints[a - 1];
            }
            joints[j] = value;
        }
    }

    /// `y ← D^(-1/2) L^(-T) y` for three columns along the path of body `b`: `y` has the length of
    /// [`Machine::path`], and nothing else is nonzero.
    #[inline(always)]
    pub fn half_solve_path(&self, machine: &Machine, b: usize, y: &mut [[T; 3]]) {
        let (base, joints) = y.split_at_mut(BASE);
        let mut sum = [base[0]; BASE];
        sum.copy_from_slice(base);
        if b > 0 {
            let ancestors = machine.ancestors(b);
            for p in (0..=ancestors.len()).rev() {
                let body = if p < ancestors.len() { ancestors[p] } else { b };
                let value = joints[p];
                let row = &self.base[body - 1];
                for i in 0..BASE {
                    for c in 0..3 {
                        sum[i][c] -= row[i] * value[c];
                    }
                }
                let entries = &self.joints[machine.links[body].row..][..p];
                for (x, entry) in joints.iter_mut().zip(entries) {
                    for c in 0..3 {
                        x[c] -= *entry * value[c];
                    }
                }
                let root = self.root[body - 1];
                joints[p] = [value[0] * root, value[1] * root, value[2] * root];
            }
        }
        for k in (0..BASE).rev() {
            let value = sum[k];
            for i in 0..k {
                let entry = self.block[k * (k + 1) / 2 + i];
                for c in 0..3 {
                    sum[i][c] -= entry * value[c];
                }
            }
            let root = self.block_root[k];
            base[k] = [value[0] * root, value[1] * root, value[2] * root];
        }
    }
}

/// `x −= a y`.
#[inline(always)]
fn subtract<T: Lane>(x: &mut [T; BASE], a: T, y: &[T; BASE]) {
    for i in 0..BASE {
        x[i] -= a * y[i];
    }
}
