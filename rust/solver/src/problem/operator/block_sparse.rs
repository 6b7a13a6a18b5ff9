//! The Delassus operator of many contacts: only the blocks of contacts that share a body.
//!
//! `W_ij = Σ_b J_ib M_b⁻¹ J_jbᵀ` over the bodies `b` that touch both contacts. In a heap each
//! contact has a handful of such neighbours, whatever the size of the heap. Rows are therefore
//! stored as lists of `d × d` blocks (block CSR): memory and the cost of a product with `W` grow
//! with the number of contacts, not with its square.

use crate::problem::{Dimension, ProblemError};

/// One contact between two bodies, for [`BlockSparseDelassus::assemble`]. `D` components, `V`
/// velocities a body (3 in the plane, 6 in space).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairContact<const D: usize, const V: usize> {
    /// The two bodies, different ones; `None` is the fixed world.
    pub bodies: [Option<usize>; 2],
    /// Jacobians with their signs: `u = Σ_s jacobians[s] v[bodies[s]]`,
    /// rows `[normal, tangent, (tangent)]`.
    pub jacobians: [[[f64; V]; D]; 2],
}

/// Block rows of `W` in compressed form. Reassembly reuses the memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlockSparseDelassus {
    /// Components per contact.
    components: usize,
    /// First block of each row; one more entry than contacts.
    row_starts: Vec<usize>,
    /// Column (contact) of each block, ascending in a row.
    columns: Vec<usize>,
    /// Position of each row's diagonal block.
    diagonal: Vec<usize>,
    /// `d × d` blocks, row-major, 1/kg.
    blocks: Vec<f64>,
    /// Contacts of each body, for the assembly: starts and lists.
    body_starts: Vec<usize>,
    body_contacts: Vec<usize>,
}

impl BlockSparseDelassus {
    /// No contact yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The blocks of a dense row-major `W` (`n × n`, 1/kg) that are not
    /// zero, and the diagonal ones.
    ///
    /// # Errors
    /// [`ProblemError::OperatorShape`] unless `W` has `n × n` entries with
    /// `n` a multiple of the components.
    pub fn from_dense(
        dimension: Dimension,
        n_contacts: usize,
        W: &[f64],
    ) -> Result<Self, ProblemError> {
        let n = dimension.components() * n_contacts;
        if W.len() != n * n {
            return Err(ProblemError::OperatorShape { n, found: W.len() });
        }
        let mut sparse = Self::default();
        sparse.read_dense(dimension, n_contacts, W);
        Ok(sparse)
    }

    /// Takes block rows of which some may lack their diagonal block, which then is zero; otherwise
    /// as [`Self::from_rows`].
    ///
    /// # Errors
    /// As [`Self::from_rows`].
    ///
    /// # Panics
    /// If `row_starts` lead beyond the columns or blocks.
    pub fn from_partial_rows(
        dimension: Dimension,
        starts: &[usize],
        columns: &[usize],
        blocks: &[f64],
    ) -> Result<Self, ProblemError> {
        let size = dimension.components().pow(2);
        let (mut all_starts, mut all_columns, mut all_blocks) = (vec![0], Vec::new(), Vec::new());
        for (row, ends) in starts.windows(2).enumerate() {
            let own = &columns[ends[0]..ends[1]];
            let before = own.partition_point(|&column| column < row);
            let middle = ends[0] + before;
            let stored = usize::from(own.get(before) == Some(&row));
            all_columns.extend_from_slice(&columns[ends[0]..middle]);
            all_columns.push(row);
            all_columns.extend_from_slice(&columns[middle + stored..ends[1]]);
            all_blocks.extend_from_slice(&blocks[size * ends[0]..size * (middle + stored)]);
            all_blocks.resize(
                size * all_columns.len() - size * (ends[1] - middle - stored),
                0.0,
            );
            all_blocks.extend_from_slice(&blocks[size * (middle + stored)..size * ends[1]]);
            all_starts.push(all_columns.len());
        }
        Self::from_rows(dimension, all_starts, all_columns, all_blocks)
    }

    /// Takes block rows as given (SciPy's BSR format).
    ///
    /// `row_starts` (`n_c + 1`), `columns` (`n_blocks`) ascending in each row, `blocks`
    /// (`n_blocks · d · d`) row-major, 1/kg.
    ///
    /// # Errors
    /// [`ProblemError::OperatorPattern`] naming the first row that is not ascending,
    /// leaves the matrix or lacks its diagonal block;
    /// [`ProblemError::OperatorShape`] when the lengths do not fit together.
    pub fn from_rows(
        dimension: Dimension,
        row_starts: Vec<usize>,
        columns: Vec<usize>,
        blocks: Vec<f64>,
    ) -> Result<Self, ProblemError> {
        let components = dimension.components();
        let n_contacts = row_starts.len().saturating_sub(1);
        let ends_well = row_starts.first() == Some(&0) && row_starts.last() == Some(&columns.len());
        if !ends_well || blocks.len() != columns.len() * components * components {
            return Err(ProblemError::OperatorShape {
                n: components * n_contacts,
                found: blocks.len(),
            });
        }
        let mut diagonal = Vec::with_capacity(n_contacts);
        for row in 0..n_contacts {
            let (first, last) = (row_starts[row], row_starts[row + 1]);
            let list = if first <= last && last <= columns.len() {
                &columns[first..last]
            } else {
                &[]
            };
            let is_sound = list.windows(2).all(|w| w[0] < w[1])
                && list.last().is_some_and(|&column| column < n_contacts);
            match list.binary_search(&row) {
                Ok(at) if is_sound => diagonal.push(first + at),
                _ => return Err(ProblemError::OperatorPattern { row }),
            }
        }
        Ok(Self {
            components,
            row_starts,
            columns,
            diagonal,
            blocks,
            ..Self::default()
        })
    }

    /// Reads a dense matrix of matching shape, reusing the memory.
    pub(crate) fn read_dense(&mut self, dimension: Dimension, n_contacts: usize, W: &[f64]) {
        let d = dimension.components();
        let n = d * n_contacts;
        self.clear(d);
        for i in 0..n_contacts {
            for j in 0..n_contacts {
                let rows = (0..d).map(|r| &W[(d * i + r) * n + d * j..][..d]);
                // Keep a NaN, so that the solver sees it.
                let is_zero = rows.clone().flatten().all(|x| *x == 0.0);
                if is_zero && i != j {
                    continue;
                }
                if i == j {
                    self.diagonal.push(self.columns.len());
                }
                self.columns.push(j);
                for row in rows {
                    self.blocks.extend_from_slice(row);
                }
            }
            self.row_starts.push(self.columns.len());
        }
    }

    /// The rows of contacts that are coupled only with one another; `place[i]` is the new number of
    /// contact `i`. `contacts` ascends.
    pub(crate) fn restricted(&self, contacts: &[usize], place: &[usize]) -> Self {
        let mut part = Self::default();
        part.clear(self.components);
        for &i in contacts {
            let first = part.columns.len();
            part.diagonal
                .push(first + self.diagonal[i] - self.row_starts[i]);
            part.columns
                .extend(self.neighbours(i).iter().map(|&j| place[j]));
            part.blocks.extend_from_slice(self.row(i));
            part.row_starts.push(part.columns.len());
        }
        part
    }

    /// Operator with every entry multiplied by `factor`.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        for x in &mut scaled.blocks {
            *x *= factor;
        }
        scaled
    }

    fn clear(&mut self, components: usize) {
        self.components = components;
        for list in [
            &mut self.row_starts,
            &mut self.columns,
            &mut self.diagonal,
            &mut self.body_starts,
            &mut self.body_contacts,
        ] {
            list.clear();
        }
        self.blocks.clear();
        self.row_starts.push(0);
    }

    /// Assembles `W` from contacts between pairs of bodies, in time proportional to the blocks.
    ///
    /// `inverse_masses` (`n_bodies` of `V`): diagonal of each body's `M⁻¹`, so the Jacobians are in
    /// coordinates in which it is diagonal (rotations about the principal axes).
    ///
    /// # Panics
    /// If `D` is not 2 or 3, a body is out of range, or both bodies of a contact are the same.
    pub fn assemble<const D: usize, const V: usize>(
        &mut self,
        contacts: &[PairContact<D, V>],
        inverse_masses: &[[f64; V]],
    ) {
        let mut weighted = [[[0.0; V]; D]; 2];
        let mut of = usize::MAX;
        self.assemble_with::<D>(
            contacts.len(),
            inverse_masses.len(),
            |i| contacts[i].bodies,
            |block, (i, side), (j, at)| {
                if of != i {
                    // M⁻¹ Jᵀ of both sides.
                    of = i;
                    weighted = contacts[i].jacobians;
                    for (rows, body) in weighted.iter_mut().zip(contacts[i].bodies) {
                        let Some(body) = body else { continue };
                        for row in rows {
                            for (x, m) in row.iter_mut().zip(&inverse_masses[body]) {
                                *x *= m;
                            }
                        }
                    }
                }
                for (out, row) in block.iter_mut().zip(&weighted[side]) {
                    for (x, column) in out.iter_mut().zip(&contacts[j].jacobians[at]) {
                        *x += row.iter().zip(column).map(|(a, b)| a * b).sum::<f64>();
                    }
                }
            },
        );
    }

    /// Assembles `W` row by row from contacts between pairs of bodies of
    /// any number of velocities each.
    ///
    /// `bodies(i)`: the two bodies of contact i, below `n_bodies`, different ones; `None` is the
    /// fixed world. `add(block, (i, s), (j, t))` adds `J_is M⁻¹ J_jtᵀ`, 1/kg, where side s of
    /// contact i is the same body as side t of contact j; i never decreases.
    ///
    /// # Panics
    /// If `D` is not 2 or 3, a body is out of range, or both bodies of a contact are the same.
    pub fn assemble_with<const D: usize>(
        &mut self,
        n_contacts: usize,
        n_bodies: usize,
        bodies: impl Fn(usize) -> [Option<usize>; 2],
        mut add: impl FnMut(&mut [[f64; D]; D], (usize, usize), (usize, usize)),
    ) {
        assert!(D == 2 || D == 3, "a contact has two or three components");
        self.clear(D);
        self.list_contacts_of_bodies(n_contacts, n_bodies, &bodies);
        for i in 0..n_contacts {
            // A merge of the two bodies' lists of contacts.
            let own = bodies(i);
            let mut lists = own.map(|body| {
                body.map_or(0..0, |body| {
                    self.body_starts[body]..self.body_starts[body + 1]
                })
            });
            loop {
                let first = |list: &std::ops::Range<usize>| {
                    (!list.is_empty()).then(|| self.body_contacts[list.start])
                };
                let next = [first(&lists[0]), first(&lists[1])];
                let j = match next {
                    [Some(a), Some(b)] => a.min(b),
                    [Some(a), None] | [None, Some(a)] => a,
                    [None, None] => break,
                };
                let mut block = [[0.0; D]; D];
                for side in 0..2 {
                    if next[side] == Some(j) {
                        lists[side].start += 1;
                        let at = usize::from(bodies(j)[1] == own[side]);
                        add(&mut block, (i, side), (j, at));
                    }
                }
                if i == j {
                    self.diagonal.push(self.columns.len());
                }
                self.columns.push(j);
                self.blocks.extend(block.iter().flatten());
            }
            if self.diagonal.len() == i {
                // Both sides are fixed: no coupling.
                self.diagonal.push(self.columns.len());
                self.columns.push(i);
                self.blocks.extend([[0.0; D]; D].iter().flatten());
            }
            self.row_starts.push(self.columns.len());
        }
    }

    fn list_contacts_of_bodies(
        &mut self,
        n_contacts: usize,
        n_bodies: usize,
        bodies: impl Fn(usize) -> [Option<usize>; 2],
    ) {
        self.body_starts.resize(n_bodies + 1, 0);
        for pair in (0..n_contacts).map(&bodies) {
            assert!(
                pair[0] != pair[1] || pair[0].is_none(),
                "a contact joins two different bodies"
            );
            for body in pair.into_iter().flatten() {
                self.body_starts[body + 1] += 1;
            }
        }
        for body in 0..n_bodies {
            self.body_starts[body + 1] += self.body_starts[body];
        }
        self.body_contacts.resize(self.body_starts[n_bodies], 0);
        for (i, pair) in (0..n_contacts).map(&bodies).enumerate() {
            for body in pair.into_iter().flatten() {
                self.body_contacts[self.body_starts[body]] = i;
                self.body_starts[body] += 1;
            }
        }
        // The fill moved each start to its body's end.
        self.body_starts.rotate_right(1);
        self.body_starts[0] = 0;
    }

    /// Components per contact, 2 or 3.
    #[inline]
    #[must_use]
    pub fn components(&self) -> usize {
        self.components
    }

    /// Number of contacts `n_c`.
    #[inline]
    #[must_use]
    pub fn n_contacts(&self) -> usize {
        self.diagonal.len()
    }

    /// Number of stored blocks.
    #[inline]
    #[must_use]
    pub fn n_blocks(&self) -> usize {
        self.columns.len()
    }

    /// Contacts that contact `i` is coupled with, itself included, ascending.
    #[inline]
    #[must_use]
    pub fn neighbours(&self, i: usize) -> &[usize] {
        &self.columns[self.row_starts[i]..self.row_starts[i + 1]]
    }

    /// Blocks of row `i`, in the order of [`neighbours`](Self::neighbours), row-major, 1/kg.
    #[inline]
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        let size = self.components * self.components;
        &self.blocks[size * self.row_starts[i]..size * self.row_starts[i + 1]]
    }

    /// Diagonal block of contact `i`, row-major, 1/kg.
    #[inline]
    #[must_use]
    pub fn diagonal_block(&self, i: usize) -> &[f64] {
        let size = self.components * self.components;
        &self.blocks[size * self.diagonal[i]..size * (self.diagonal[i] + 1)]
    }

    /// Position of the first block of row `i` among all blocks.
    #[inline]
    pub(crate) fn row_start(&self, i: usize) -> usize {
        self.row_starts[i]
    }

    /// Dense form of the operator, a row-major `n × n` matrix, 1/kg.
    #[must_use]
    pub fn to_dense(&self) -> Vec<f64> {
        let mut W = Vec::new();
        self.write_dense(&mut W);
        W
    }

    pub(crate) fn write_dense(&self, W: &mut Vec<f64>) {
        let d = self.components;
        let n = d * self.n_contacts();
        W.clear();
        W.resize(n * n, 0.0);
        for i in 0..self.n_contacts() {
            let blocks = self.row(i).chunks_exact((d * d).max(1));
            for (&j, block) in self.neighbours(i).iter().zip(blocks) {
                for (r, row) in block.chunks_exact(d).enumerate() {
                    W[(d * i + r) * n + d * j..][..d].copy_from_slice(row);
                }
            }
        }
    }

    /// `out_i = Σ_j W_ij x_j` of row `i`.
    #[inline]
    pub(crate) fn row_times<const D: usize>(&self, i: usize, x: &[f64]) -> [f64; D] {
        let mut out = [0.0; D];
        for (&j, block) in self
            .neighbours(i)
            .iter()
            .zip(self.row(i).chunks_exact(D * D))
        {
            let x = &x[D * j..D * j + D];
            for (out, row) in out.iter_mut().zip(block.chunks_exact(D)) {
                for k in 0..D {
                    *out += row[k] * x[k];
                }
            }
        }
        out
    }

    /// `out = W x + b`.
    pub(crate) fn multiply_add(&self, x: &[f64], b: &[f64], out: &mut [f64]) {
        match self.components {
            2 => self.multiply_add_in::<2>(x, b, out),
            _ => self.multiply_add_in::<3>(x, b, out),
        }
    }

    fn multiply_add_in<const D: usize>(&self, x: &[f64], b: &[f64], out: &mut [f64]) {
        for (i, (out, b)) in out.chunks_exact_mut(D).zip(b.chunks_exact(D)).enumerate() {
            let product = self.row_times::<D>(i, x);
            for k in 0..D {
                out[k] = product[k] + b[k];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_dense_matrix_survives_the_round_trip() {
        let mut W = vec![0.0; 36];
        for k in 0..6 {
            W[7 * k] = 1.0 + k as f64;
        }
        W[1] = 0.5;
        W[4] = -0.25;
        let sparse = BlockSparseDelassus::from_dense(Dimension::Two, 3, &W).expect("square");
        assert_eq!(sparse.n_blocks(), 4);
        assert_eq!(sparse.neighbours(0), [0, 2]);
        assert_eq!(sparse.to_dense(), W);
        let x = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut out = [0.0; 6];
        sparse.multiply_add(&x, &[1.0; 6], &mut out);
        let mut expected = [0.0; 6];
        super::super::dense::multiply_add(&W, &x, &[1.0; 6], &mut expected);
        assert!(
            out.iter()
                .zip(&expected)
                .all(|(a, b)| (a - b).abs() < 1e-15)
        );
    }

    #[test]
    fn bad_patterns_are_named() {
        let build = |starts: &[usize], columns: &[usize], n: usize| {
            BlockSparseDelassus::from_rows(
                Dimension::Two,
                starts.to_vec(),
                columns.to_vec(),
                vec![1.0; n],
            )
            .map(|_| ())
        };
        assert!(build(&[0, 1, 2], &[0, 1], 8).is_ok());
        let pattern = |row| Err(ProblemError::OperatorPattern { row });
        assert_eq!(build(&[0, 1, 2], &[1, 1], 8), pattern(0));
        assert_eq!(build(&[0, 1, 3], &[0, 1, 0], 12), pattern(1));
        assert_eq!(build(&[0, 1, 3], &[0, 1, 2], 12), pattern(1));
        assert_eq!(build(&[0, 2, 1, 2], &[0, 1], 8), pattern(1));
        assert!(matches!(
            build(&[0, 1], &[0], 3),
            Err(ProblemError::OperatorShape { n: 2, found: 3 })
        ));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// Against `Hᵀ M⁻¹ H` with all bodies in one dense Jacobian.
        #[test]
        fn pairs_of_bodies_give_the_dense_operator(
            pairs in prop::collection::vec((0usize..5, 0usize..5, prop::array::uniform12(-1.0..1.0f64)), 1..9),
            masses in prop::collection::vec(prop::array::uniform3(0.1..2.0f64), 4),
        ) {
            let body = |b: usize| (b < 4).then_some(b);
            let contacts: Vec<PairContact<2, 3>> = pairs
                .iter()
                .filter(|(a, b, _)| a != b)
                .map(|(a, b, x)| PairContact {
                    bodies: [body(*a), body(*b)],
                    jacobians: [0, 6].map(|s| [0, 3].map(|r| [x[s + r], x[s + r + 1], x[s + r + 2]])),
                })
                .collect();
            let mut sparse = BlockSparseDelassus::new();
            // Twice: reused memory must not affect the result.
            sparse.assemble(&contacts, &masses);
            sparse.assemble(&contacts, &masses);
            let mut rows = vec![vec![0.0; 12]; 2 * contacts.len()];
            for (i, contact) in contacts.iter().enumerate() {
                for side in 0..2 {
                    let Some(b) = contact.bodies[side] else { continue };
                    for r in 0..2 {
                        rows[2 * i + r][3 * b..3 * b + 3].copy_from_slice(&contact.jacobians[side][r]);
                    }
                }
            }
            let W = sparse.to_dense();
            for (r, a) in rows.iter().enumerate() {
                for (c, b) in rows.iter().enumerate() {
                    let expected: f64 = (0..12).map(|k| a[k] * b[k] * masses[k / 3][k % 3]).sum();
                    prop_assert!((W[r * rows.len() + c] - expected).abs() < 1e-14);
                }
            }
        }
    }
}
