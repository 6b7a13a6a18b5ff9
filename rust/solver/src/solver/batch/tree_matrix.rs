//! Matrices with the [pattern](super::pattern) of a machine's tree, side by side: assembly from
//! products, factors, solution.
//!
//! The base's block is whole. A joint has its row and its column with the base and with the joints
//! that carry it. Elimination from the leaves to the root fills nothing in.

use super::pattern::BASE;
use super::pattern::Pattern;
use super::problem::Triple;
use crate::scalar::Lane;

/// A number for each velocity of the base.
pub(super) type Base<T> = [T; BASE];

/// Three columns over the velocities that move a contact, each with its part of the base; joints
/// are in the order of the contact's path.
#[derive(Clone, Debug)]
pub(super) struct JacobianColumns<T> {
    pub base: [Base<T>; 3],
    pub joints: Vec<Triple<T>>,
}

/// The matrix, or its factors: rows divided by their pivots, columns, and inverse pivots.
#[derive(Clone, Debug)]
pub(super) struct TreeMatrix<T> {
    base: [Base<T>; BASE],
    joints: Vec<Joint<T>>,
    /// Entries between joints below the diagonal, and those above it.
    rows: Vec<T>,
    columns: Vec<T>,
}

/// Entries of a joint with the base, and its own.
#[derive(Clone, Copy, Debug)]
struct Joint<T> {
    row: Base<T>,
    column: Base<T>,
    pivot: T,
}

impl<T: Lane> JacobianColumns<T> {
    pub(super) fn new(zero: T, n_joints: usize) -> Self {
        Self {
            base: [[zero; BASE]; 3],
            joints: vec![[zero; 3]; n_joints],
        }
    }
}

impl<T: Lane> TreeMatrix<T> {
    /// Without rows.
    pub(super) fn new(zero: T) -> Self {
        Self {
            base: [[zero; BASE]; BASE],
            joints: Vec::new(),
            rows: Vec::new(),
            columns: Vec::new(),
        }
    }

    /// Makes room for a pattern.
    pub(super) fn adopt(&mut self, pattern: &Pattern, zero: T) {
        let joint = Joint {
            row: [zero; BASE],
            column: [zero; BASE],
            pivot: zero,
        };
        self.joints.resize(pattern.n_joints(), joint);
        for entries in [&mut self.rows, &mut self.columns] {
            entries.resize(pattern.n_entries(), zero);
        }
    }

    /// The unit matrix.
    #[inline(always)]
    pub(super) fn clear(&mut self, zero: T) {
        let one = zero.like(1.0);
        for i in 0..BASE {
            self.base[i] = [zero; BASE];
            self.base[i][i] = one;
        }
        for joint in &mut self.joints {
            (joint.row, joint.column) = ([zero; BASE], [zero; BASE]);
            joint.pivot = one;
        }
        for k in 0..self.rows.len() {
            (self.rows[k], self.columns[k]) = (zero, zero);
        }
    }

    /// Adds `Y Xᵀ` for three columns along the path of a slot. The second product is symmetric; so
    /// is the third, which is left out unless `HAS_THIRD`.
    #[inline(always)]
    pub(super) fn add<const HAS_THIRD: bool>(
        &mut self,
        pattern: &Pattern,
        slot: usize,
        Y: &JacobianColumns<T>,
        X: &JacobianColumns<T>,
    ) {
        let ([y0, y1, y2], [x0, x1, x2]) = (&Y.base, &X.base);
        for i in 0..BASE {
            let own = &mut self.base[i];
            for k in 0..BASE {
                let mut sum = y0[i] * x0[k] + y1[i] * x1[k];
                if HAS_THIRD {
                    sum += y2[i] * x2[k];
                }
                own[k] += sum;
            }
        }
        let path = pattern.joints(slot);
        for (i, &joint) in path.iter().enumerate() {
            let ([a0, a1, a2], [b0, b1, b2]) = (Y.joints[i], X.joints[i]);
            let own = &mut self.joints[joint];
            for k in 0..BASE {
                let mut both = a1 * x1[k];
                if HAS_THIRD {
                    both += a2 * x2[k];
                }
                own.row[k] += both + a0 * x0[k];
                own.column[k] += both + b0 * y0[k];
            }
            let mut sum = a0 * b0 + a1 * b1;
            if HAS_THIRD {
                sum += a2 * b2;
            }
            own.pivot += sum;
            let entries = pattern.row(joint);
            let rows = &mut self.rows[entries.clone()][..i];
            let columns = &mut self.columns[entries][..i];
            let (ys, xs) = (&Y.joints[..i], &X.joints[..i]);
            for k in 0..i {
                let mut both = a1 * xs[k][1];
                if HAS_THIRD {
                    both += a2 * xs[k][2];
                }
                rows[k] += both + a0 * xs[k][0];
                columns[k] += both + b0 * ys[k][0];
            }
        }
    }

    /// Factors the matrix from the leaves to the root.
    #[inline(always)]
    pub(super) fn factorise(&mut self, pattern: &Pattern) {
        for joint in (0..self.joints.len()).rev() {
            let Joint {
                mut row,
                column,
                pivot,
            } = self.joints[joint];
            let inverse = pivot.like(1.0) / pivot;
            for x in &mut row {
                *x *= inverse;
            }
            (self.joints[joint].row, self.joints[joint].pivot) = (row, inverse);
            for i in 0..BASE {
                for k in 0..BASE {
                    self.base[i][k] -= column[i] * row[k];
                }
            }
            let first = pattern.row(joint).start;
            let ancestors = pattern.ancestors(joint);
            // The entries of an ancestor come before its descendants'.
            let (before, rows) = self.rows.split_at_mut(first);
            let (columns_before, columns) = self.columns.split_at_mut(first);
            let rows = &mut rows[..ancestors.len()];
            let columns = &columns[..ancestors.len()];
            for i in 0..ancestors.len() {
                let (x, y) = (rows[i] * inverse, columns[i]);
                rows[i] = x;
                let own = &mut self.joints[ancestors[i]];
                own.pivot -= y * x;
                for k in 0..BASE {
                    own.row[k] -= y * row[k];
                    own.column[k] -= column[k] * x;
                }
                let entries = pattern.row(ancestors[i]);
                let rows_of = &mut before[entries.clone()][..i];
                let columns_of = &mut columns_before[entries][..i];
                for k in 0..i {
                    rows_of[k] -= y * rows[k];
                    columns_of[k] -= columns[k] * x;
                }
            }
        }
        for j in (0..BASE).rev() {
            let inverse = self.base[j][j].like(1.0) / self.base[j][j];
            self.base[j][j] = inverse;
            let row = self.base[j];
            for k in 0..j {
                self.base[j][k] = row[k] * inverse;
            }
            for i in 0..j {
                for k in 0..j {
                    let x = self.base[j][k];
                    self.base[i][k] -= self.base[i][j] * x;
                }
            }
        }
    }

    /// Solves the factored system, in place of its right-hand side.
    #[inline(always)]
    pub(super) fn solve(&self, pattern: &Pattern, base: &mut Base<T>, joints: &mut [T]) {
        let joints = &mut joints[..self.joints.len()];
        let mut sums = *base;
        for joint in (0..joints.len()).rev() {
            let own = &self.joints[joint];
            let value = joints[joint] * own.pivot;
            joints[joint] = value;
            for k in 0..BASE {
                sums[k] -= own.column[k] * value;
            }
            let columns = &self.columns[pattern.row(joint)];
            let ancestors = &pattern.ancestors(joint)[..columns.len()];
            for k in 0..columns.len() {
                joints[ancestors[k]] -= columns[k] * value;
            }
        }
        for j in (0..BASE).rev() {
            let value = sums[j] * self.base[j][j];
            sums[j] = value;
            for k in 0..j {
                sums[k] -= self.base[k][j] * value;
            }
        }
        for j in 0..BASE {
            for k in 0..j {
                let value = sums[k];
                sums[j] -= self.base[j][k] * value;
            }
        }
        *base = sums;
        for joint in 0..joints.len() {
            let own = &self.joints[joint];
            let mut value = joints[joint] - product(&own.row, &sums);
            let rows = &self.rows[pattern.row(joint)];
            let ancestors = &pattern.ancestors(joint)[..rows.len()];
            for k in 0..rows.len() {
                value -= rows[k] * joints[ancestors[k]];
            }
            joints[joint] = value;
        }
    }
}

/// The sum of products, in two chains.
#[inline(always)]
pub(super) fn product<T: Lane>(a: &Base<T>, b: &Base<T>) -> T {
    (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}
