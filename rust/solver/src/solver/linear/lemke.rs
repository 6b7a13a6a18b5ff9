//! Lemke's method for a linear complementarity problem (Cottle, Pang and Stone 1992, section 4.4),
//!
//! ```text
//! 0 ≤ w = b + M z  ⊥  z ≥ 0
//! ```
//!
//! It adds `(1…1) z₀`, begins with a `z₀` that makes `w ≥ 0`, and drives it to zero: of each pair
//! one variable is zero, and what left last decides which enters next.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::scalar::{Single, inlined};

/// Pivots of Lemke's method for each unknown; more are a sign of rounding.
const PIVOTS: usize = 4;

/// Least entry of a column that may be a pivot, relative to the problem's scale.
const LEAST_PIVOT: f64 = 1e-11;

/// Ratios that differ by less are equal, relative to the problem's scale.
const EQUAL: f64 = 1e-13;

/// The tableau of Lemke's method for a problem of `n` pairs: basic variables as affine functions of
/// the others, of which all are zero.
#[derive(Clone, Debug, Default)]
pub(in crate::solver) struct Tableau {
    /// Number of pairs.
    n: usize,
    /// Rows of `n + 2` entries: factors of the `n + 1` nonbasic variables, and the constant.
    rows: Vec<f64>,
    /// The row that leaves, as the new basic variable has it.
    leaving: Vec<f64>,
    /// Variables of rows and columns: `w_i` is i, `z_i` is n + i, and `z₀` is 2 n.
    basic: Vec<usize>,
    nonbasic: Vec<usize>,
}

impl Tableau {
    /// Makes a problem of `n` pairs with `M` and `b` of zeros.
    pub fn clear(&mut self, n: usize) {
        self.n = n;
        self.rows.clear();
        self.rows.resize(n * (n + 2), 0.0);
        self.leaving.resize(n + 2, 0.0);
        self.basic.clear();
        self.basic.extend(0..n);
        self.nonbasic.clear();
        self.nonbasic.extend(n..=2 * n);
        for row in self.rows.chunks_exact_mut(n + 2) {
            row[n] = 1.0;
        }
    }

    /// Row i of `M`, then the factor of `z₀`, then `b_i`.
    pub fn row(&mut self, i: usize) -> &mut [f64] {
        &mut self.rows[i * (self.n + 2)..][..self.n + 2]
    }

    /// Exchanges the basic variable of a row with the nonbasic one of a column.
    #[inline(always)]
    fn exchange(&mut self, row: usize, column: usize) {
        let width = self.n + 2;
        let own = &mut self.rows[row * width..][..width];
        let inverse = 1.0 / own[column];
        for x in own.iter_mut() {
            *x *= -inverse;
        }
        own[column] = inverse;
        self.leaving.copy_from_slice(own);
        for (i, other) in self.rows.chunks_exact_mut(width).enumerate() {
            let factor = other[column];
            if i == row || factor == 0.0 {
                continue;
            }
            other[column] = 0.0;
            for (x, pivot) in other.iter_mut().zip(&self.leaving) {
                *x += factor * pivot;
            }
        }
        std::mem::swap(&mut self.basic[row], &mut self.nonbasic[column]);
    }

    /// The row whose variable reaches zero first when that of a column grows; `z₀` before others.
    #[inline(always)]
    fn row_of(&self, column: usize) -> Option<usize> {
        let (n, width) = (self.n, self.n + 2);
        let rows = || self.rows.chunks_exact(width).zip(&self.basic).enumerate();
        let ratio = |row: &[f64]| row[n + 1] / -row[column];
        let may = |row: &[f64]| row[column] < -LEAST_PIVOT;
        let least = rows()
            .filter(|(_, (row, _))| may(row))
            .fold(f64::INFINITY, |least, (_, (row, _))| least.min(ratio(row)));
        let mut found: Option<(usize, f64)> = None;
        for (i, (row, variable)) in rows() {
            if !may(row) || ratio(row) > least + EQUAL * (1.0 + least.abs()) {
                continue;
            }
            if *variable == 2 * n {
                return Some(i);
            }
            if found.is_none_or(|(_, size)| -row[column] > size) {
                found = Some((i, -row[column]));
            }
        }
        found.map(|(i, _)| i)
    }

    /// Whether the method has found an answer, and its pivots.
    pub fn solve(&mut self) -> (bool, usize) {
        inlined!(Single::vectorize, Single::best(), self.pivot())
    }

    /// [`Self::solve`], for the instructions that it is compiled for.
    #[inline(always)]
    fn pivot(&mut self) -> (bool, usize) {
        let (n, width) = (self.n, self.n + 2);
        let constants = self.rows.iter().skip(n + 1).step_by(width);
        let Some((mut row, least)) = (constants.enumerate())
            .min_by(|a, b| a.1.total_cmp(b.1))
            .map(|(i, x)| (i, *x))
        else {
            return (true, 0);
        };
        if least >= 0.0 {
            return (true, 0);
        }
        let mut column = n;
        for pivots in 1..=PIVOTS * n {
            let leaves = self.basic[row];
            self.exchange(row, column);
            if leaves == 2 * n {
                return (true, pivots);
            }
            let enters = if leaves < n { leaves + n } else { leaves - n };
            let Some(next) = self.nonbasic.iter().position(|own| *own == enters) else {
                return (false, pivots);
            };
            column = next;
            match self.row_of(column) {
                Some(next) => row = next,
                None => return (false, pivots),
            }
        }
        (false, PIVOTS * n)
    }

    /// The value of `z_i`, once the problem is solved.
    pub fn value(&self, i: usize) -> f64 {
        let row = self.basic.iter().position(|own| *own == self.n + i);
        row.map_or(0.0, |row| self.rows[row * (self.n + 2) + self.n + 1])
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::Tableau;
    use crate::solver::draws::Draws;

    /// The problem (M, b).
    fn posed(M: &[Vec<f64>], b: &[f64]) -> Tableau {
        let mut tableau = Tableau::default();
        tableau.clear(b.len());
        for (i, (row, b)) in M.iter().zip(b).enumerate() {
            let own = tableau.row(i);
            own[..row.len()].copy_from_slice(row);
            *own.last_mut().unwrap() = *b;
        }
        tableau
    }

    /// Row by row, z = (2, 1, 3).
    #[test]
    fn a_triangular_problem_has_its_answer() {
        let M = [
            vec![1.0, 0.0, 0.0],
            vec![2.0, 1.0, 0.0],
            vec![2.0, 2.0, 1.0],
        ];
        let mut tableau = posed(&M, &[-2.0, -5.0, -9.0]);
        assert!(tableau.solve().0);
        let z = [0, 1, 2].map(|i| tableau.value(i));
        let expected = [2.0, 1.0, 3.0];
        assert!((0..3).all(|i| (z[i] - expected[i]).abs() < 1e-14), "{z:?}");
    }

    #[test]
    fn a_ray_is_no_answer() {
        let mut tableau = posed(&[vec![-1.0]], &[-1.0]);
        assert!(!tableau.solve().0);
    }

    #[test]
    fn a_problem_without_demands_is_solved_by_zero() {
        let mut tableau = posed(&[vec![1.0]], &[0.5]);
        assert_eq!(tableau.solve(), (true, 0));
        assert!(tableau.value(0).abs() < 1e-300);
    }

    /// Positive semidefinite problems of any rank that have an answer.
    #[test]
    fn pairs_of_semidefinite_problems_are_complementary() {
        let mut draws = Draws(3);
        for n in 1..30 {
            let rank = 1 + n / 2;
            let root: Vec<Vec<f64>> = (0..rank)
                .map(|_| (0..n).map(|_| draws.next() - 0.5).collect())
                .collect();
            let entry = |i: usize, j: usize| root.iter().map(|r| r[i] * r[j]).sum::<f64>();
            let M: Vec<Vec<f64>> = (0..n)
                .map(|i| (0..n).map(|j| entry(i, j)).collect())
                .collect();
            // w - M z for some w, z >= 0: then there is an answer.
            let z: Vec<f64> = (0..n).map(|_| (draws.next() - 0.5).max(0.0)).collect();
            let b: Vec<f64> = (0..n)
                .map(|i| {
                    (draws.next() - 0.5).max(0.0) - (0..n).map(|j| M[i][j] * z[j]).sum::<f64>()
                })
                .collect();
            let mut tableau = posed(&M, &b);
            assert!(tableau.solve().0, "{n}");
            let z: Vec<f64> = (0..n).map(|i| tableau.value(i)).collect();
            for i in 0..n {
                let w = b[i] + (0..n).map(|j| M[i][j] * z[j]).sum::<f64>();
                assert!(w > -1e-12 && z[i] > -1e-12, "{n}: {w}, {}", z[i]);
                assert!((w * z[i]).abs() < 1e-10, "{n}: {w} {}", z[i]);
            }
        }
    }
}
