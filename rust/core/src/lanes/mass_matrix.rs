//! Mass matrix by the composite rigid body algorithm, and its factor `M = Lᵀ D L`.
//!
//! Entries are stored as in [`crate::multibody::mass_matrix`], along paths: the row of a joint's
//! velocity is its six entries with the base, then those with the velocities before it on its path,
//! then its own. The block of the base is apart, by the rows of its lower triangle.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 6 (composite bodies), ch. 8
//! (branch-induced sparsity).

use std::cmp::Ordering;

use super::inertias::{Inertia, Inertias};
use super::machine::{Link, Machine};
use super::poses::{Motion, Pose, Poses};
use crate::multibody::model::BASE;
use crate::scalar::{Lane, Vec3};

/// Entries of the base's lower triangle.
const BLOCK: usize = BASE * (BASE + 1) / 2;

/// The mass matrix; kg, kg m, kg m².
#[derive(Clone, Debug)]
pub struct MassMatrix<T: Lane> {
    token: T::Token,
    block: [T; BLOCK],
    /// Of each row.
    base: Vec<[T; BASE]>,
    joints: Vec<T>,
    composites: Vec<Composite<T>>,
    /// Momenta at a unit of each coupled joint's motion.
    coupled: Vec<Momentum<T>>,
}

/// Momentum, and angular momentum about the trunk's origin.
#[derive(Clone, Copy, Debug)]
struct Momentum<T> {
    linear: Vec3<T>,
    angular: Vec3<T>,
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

    /// Momentum at unit rate of a motion.
    #[inline(always)]
    fn momentum(&self, motion: &Motion<T>) -> Momentum<T> {
        Momentum {
            linear: motion.swing * self.mass + motion.axis.cross(self.moment),
            angular: self.inertia.times(motion.axis) + self.moment.cross(motion.swing),
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
        let nothing = Momentum {
            linear: composite.moment,
            angular: composite.moment,
        };
        Self {
            token,
            block: [zero; BLOCK],
            base: vec![[zero; BASE]; machine.rows.len()],
            joints: vec![zero; machine.columns.len()],
            composites: vec![composite; machine.n_bodies()],
            coupled: vec![nothing; machine.coupled.len()],
        }
    }

    /// Recomputes M at the poses, rotors included.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn update(&mut self, machine: &Machine, inertias: &Inertias<T>, poses: &Poses<T>) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.update_here(machine, inertias, poses),
        );
    }

    #[inline(always)]
    fn update_here(&mut self, machine: &Machine, inertias: &Inertias<T>, poses: &Poses<T>) {
        let n = machine.links.len();
        let links = &machine.links[..n];
        let rotors = &inertias.rotors;
        let (bodies, inertias) = (&poses.bodies[..n], &inertias.bodies[..n]);
        let carried = &mut self.composites[..n];
        let motions = &poses.motions[..machine.n_motions()];
        let n_rows = machine.rows.len();
        let (rows, base) = (&machine.rows[..n_rows], &mut self.base[..n_rows]);
        let columns = &machine.column_motions[..];
        let entries = &mut self.joints[..columns.len()];
        let (mut row, mut n_coupled) = (n_rows, machine.coupled.len());
        for b in (1..n).rev() {
            let (link, pose) = (&links[b], &bodies[b]);
            let mut composite = Composite::of(link, &inertias[b], pose);
            if !link.is_leaf {
                composite = composite.plus(&carried[b]);
            }
            if link.n_rows == 1 {
                row -= 1;
                let own = composite.momentum(&motions[link.motion]);
                base[row] = own.entries();
                let (start, end) = (rows[row].start, rows[row].end);
                own.along_all(motions, &columns[start..end], &mut entries[start..end]);
            } else if link.is_coupled() {
                n_coupled -= 1;
                self.coupled[n_coupled] = composite.momentum(&motions[link.motion]);
            } else {
                for m in (link.motion..link.motion + link.n_rows).rev() {
                    row -= 1;
                    let own = composite.momentum(&motions[m]);
                    base[row] = own.entries();
                    let own_row = rows[row].clone();
                    own.along_all(motions, &columns[own_row.clone()], &mut entries[own_row]);
                }
            }
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
        for k in 0..machine.coupled.len() {
            self.add_coupled(machine, poses, k);
        }
        for (&joint, &inertia) in machine.rotors.iter().zip(rotors) {
            self.add_to_diagonal(machine, machine.joints[joint].velocity, inertia);
        }
    }

    /// Adds the products of a coupled joint's motion with all motions that move its carrier, and
    /// with itself.
    #[inline(always)]
    fn add_coupled(&mut self, machine: &Machine, poses: &Poses<T>, number: usize) {
        let (link, own) = (
            &machine.links[machine.coupled[number]],
            self.coupled[number],
        );
        let k = link.velocity;
        let row = &machine.rows[k - BASE];
        let at = row.len() - 1;
        self.joints[row.end - 1] += own.along(&poses.motions[link.motion]);
        for (entry, x) in self.base[k - BASE].iter_mut().zip(own.entries()) {
            *entry += x;
        }
        for (p, mover) in machine.movers(link.parent).iter().enumerate() {
            let shared = own.along(&poses.motions[mover.motion]);
            match mover.velocity.cmp(&k) {
                Ordering::Less => self.joints[row.start + p] += shared,
                Ordering::Equal => self.joints[row.end - 1] += shared + shared,
                Ordering::Greater => {
                    self.joints[machine.rows[mover.velocity - BASE].start + at] += shared;
                }
            }
        }
    }

    /// Diagonal entry of a joint's velocity.
    #[inline(always)]
    pub fn diagonal(&self, machine: &Machine, velocity: usize) -> T {
        self.joints[machine.rows[velocity - BASE].end - 1]
    }

    /// Adds the implicit terms of a held joint to the diagonal entry of its velocity.
    #[inline(always)]
    pub fn add_to_diagonal(&mut self, machine: &Machine, velocity: usize, value: T) {
        self.joints[machine.rows[velocity - BASE].end - 1] += value;
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
        for (k, row) in machine.rows.iter().enumerate() {
            for (j, x) in self.base[k].iter().enumerate() {
                set(k + BASE, j, *x);
            }
            for (j, x) in machine.columns[row.clone()]
                .iter()
                .zip(&self.joints[row.clone()])
            {
                set(k + BASE, j + BASE, *x);
            }
        }
        dense
    }

    /// Computes `M = Lᵀ D L`, and leaves M undefined until [`Self::update`]. Returns where M is
    /// positive definite; the factor of any other lane has no meaning.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn factorise(&mut self, machine: &Machine, factor: &mut Factor<T>) -> T::Mask {
        factor.block = self.block;
        std::mem::swap(&mut factor.base, &mut self.base);
        std::mem::swap(&mut factor.joints, &mut self.joints);
        T::vectorize(
            self.token,
            #[inline(always)]
            || factor.factorise_here(machine),
        )
    }
}

impl<T: Lane> Momentum<T> {
    /// Its products with the motions of the base.
    #[inline(always)]
    fn entries(&self) -> [T; BASE] {
        let (f, l) = (self.linear, self.angular);
        [f.x, f.y, f.z, l.x, l.y, l.z]
    }

    /// Its products with motions, by their indices.
    #[inline(always)]
    fn along_all(&self, motions: &[Motion<T>], indices: &[usize], out: &mut [T]) {
        for p in 0..indices.len() {
            out[p] = self.along(&motions[indices[p]]);
        }
    }

    /// Its product with a motion.
    #[inline(always)]
    fn along(&self, motion: &Motion<T>) -> T {
        motion.power(self.linear, self.angular)
    }
}

/// `M = Lᵀ D L`, L unit lower triangular with M's sparsity. Holds `L` and `D^(-1/2)`.
#[derive(Clone, Debug)]
pub struct Factor<T: Lane> {
    block: [T; BLOCK],
    base: Vec<[T; BASE]>,
    joints: Vec<T>,
    block_root: [T; BASE],
    /// Of each row.
    root: Vec<T>,
}

impl<T: Lane> Factor<T> {
    /// Room for a machine.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            block: [zero; BLOCK],
            base: vec![[zero; BASE]; machine.rows.len()],
            joints: vec![zero; machine.columns.len()],
            block_root: [zero; BASE],
            root: vec![zero; machine.rows.len()],
        }
    }

    /// Turns the entries of M into those of its factor.
    #[inline(always)]
    fn factorise_here(&mut self, machine: &Machine) -> T::Mask {
        let n = machine.rows.len();
        let (own_rows, columns) = (&machine.rows[..n], &machine.columns[..]);
        let (base_rows, roots) = (&mut self.base[..n], &mut self.root[..n]);
        let entries = &mut self.joints[..columns.len()];
        let mut block = self.block;
        let (zero, one) = (block[0].like(0.0), block[0].like(1.0));
        let mut is_positive = zero.lt(one);
        let mut end = columns.len();
        for j in (0..n).rev() {
            let start = own_rows[j].start;
            let columns = &columns[start..end];
            let (above, own) = entries[..end].split_at_mut(start);
            let (base_above, base_row) = base_rows.split_at_mut(j);
            end = start;
            let last = columns.len() - 1;
            let own = &mut own[..=last];
            let base = base_row[0];
            let pivot = own[last];
            is_positive = is_positive & pivot.gt(zero);
            let inverse = one / pivot;
            roots[j] = inverse.sqrt();
            for p in (0..last).rev() {
                let a = own[p] * inverse;
                let ancestor = columns[p];
                subtract(&mut base_above[ancestor], a, &base);
                let row = &mut above[own_rows[ancestor].start..][..=p];
                for i in 0..=p {
                    row[i] -= a * own[i];
                }
                own[p] = a;
            }
            let factors = scaled(&base, inverse);
            subtract_product(&mut block, &factors, &base);
            base_row[0] = factors;
        }
        let roots = &mut self.block_root;
        is_positive = is_positive & eliminate::<T, 5>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 4>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 3>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 2>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 1>(&mut block, roots);
        is_positive = is_positive & eliminate::<T, 0>(&mut block, roots);
        self.block = block;
        is_positive
    }

    /// `y ← D^(-1/2) L^(-T) y` (nv).
    #[inline(always)]
    pub fn half_solve(&self, machine: &Machine, y: &mut [T]) {
        let n = machine.rows.len();
        let (own_rows, columns) = (&machine.rows[..n], &machine.columns[..]);
        let (rows, roots) = (&self.base[..n], &self.root[..n]);
        let entries = &self.joints[..columns.len()];
        let (base, joints) = y.split_at_mut(BASE);
        let joints = &mut joints[..n];
        let mut sum = [base[0], base[1], base[2], base[3], base[4], base[5]];
        let mut end = columns.len();
        for j in (0..n).rev() {
            let start = own_rows[j].start;
            let (columns, entries) = (&columns[start..end], &entries[start..end]);
            end = start;
            let value = joints[j];
            subtract(&mut sum, value, &rows[j]);
            for p in 0..columns.len() - 1 {
                joints[columns[p]] -= entries[p] * value;
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
        let n = machine.rows.len();
        let (own_rows, columns) = (&machine.rows[..n], &machine.columns[..]);
        let (rows, roots) = (&self.base[..n], &self.root[..n]);
        let entries = &self.joints[..columns.len()];
        let (base, joints) = x.split_at_mut(BASE);
        let joints = &mut joints[..n];
        let mut known = [base[0]; BASE];
        for k in 0..BASE {
            let mut value = base[k] * self.block_root[k];
            for i in 0..k {
                value -= self.block[k * (k + 1) / 2 + i] * known[i];
            }
            known[k] = value;
            base[k] = value;
        }
        for j in 0..n {
            let mut value = joints[j] * roots[j];
            for i in 0..BASE {
                value -= rows[j][i] * known[i];
            }
            let (start, end) = (own_rows[j].start, own_rows[j].end - 1);
            let (columns, entries) = (&columns[start..end], &entries[start..end]);
            for p in 0..columns.len() {
                value -= entries[p] * joints[columns[p]];
            }
            joints[j] = value;
        }
    }

    /// `y ← D^(-1/2) L^(-T) y` for three columns along the path of body `b`: `y` has the length of
    /// [`Machine::path`], and nothing else is nonzero.
    #[inline(always)]
    pub fn half_solve_path(&self, machine: &Machine, b: usize, y: &mut [[T; 3]]) {
        let (base, joints) = y.split_at_mut(BASE);
        let mut sum = [base[0], base[1], base[2], base[3], base[4], base[5]];
        let columns = machine.row(b);
        let joints = &mut joints[..columns.len()];
        for p in (0..columns.len()).rev() {
            let j = columns[p];
            let value = joints[p];
            let row = &self.base[j];
            for i in 0..BASE {
                subtract_columns(&mut sum[i], row[i], &value);
            }
            let entries = &self.joints[machine.rows[j].start..][..p];
            for i in 0..p {
                subtract_columns(&mut joints[i], entries[i], &value);
            }
            let root = self.root[j];
            joints[p] = [value[0] * root, value[1] * root, value[2] * root];
        }
        for k in (0..BASE).rev() {
            let value = sum[k];
            for i in 0..k {
                subtract_columns(&mut sum[i], self.block[k * (k + 1) / 2 + i], &value);
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

/// `x −= a y` for three columns.
#[inline(always)]
fn subtract_columns<T: Lane>(x: &mut [T; 3], a: T, y: &[T; 3]) {
    for c in 0..3 {
        x[c] -= a * y[c];
    }
}

/// `a y`.
#[inline(always)]
fn scaled<T: Lane>(y: &[T; BASE], a: T) -> [T; BASE] {
    [y[0] * a, y[1] * a, y[2] * a, y[3] * a, y[4] * a, y[5] * a]
}

/// Eliminates velocity K of the base, when all after it are. Returns where its pivot is positive. K
/// is a constant so that the block stays in registers.
#[inline(always)]
fn eliminate<T: Lane, const K: usize>(block: &mut [T; BLOCK], roots: &mut [T; BASE]) -> T::Mask {
    let start = K * (K + 1) / 2;
    let pivot = block[start + K];
    let inverse = pivot.like(1.0) / pivot;
    roots[K] = inverse.sqrt();
    for p in (0..K).rev() {
        let a = block[start + p] * inverse;
        for i in 0..=p {
            block[p * (p + 1) / 2 + i] -= a * block[start + i];
        }
        block[start + p] = a;
    }
    pivot.gt(pivot.like(0.0))
}

/// `A −= a yᵀ`, where the product is symmetric; the lower triangle by its rows.
#[inline(always)]
fn subtract_product<T: Lane>(A: &mut [T; BLOCK], a: &[T; BASE], y: &[T; BASE]) {
    for i in 0..BASE {
        for k in 0..=i {
            A[i * (i + 1) / 2 + k] -= a[i] * y[k];
        }
    }
}
