//! One rover's friction-contact problem, handed from a block to the solver and back.

use crate::problem::Residual;

/// Most contacts of a problem.
pub const MAX_CONTACTS: usize = 8;

/// Most unknowns.
pub const MAX_UNKNOWNS: usize = 3 * MAX_CONTACTS;

/// Blocks of the lower triangle of `W`.
pub const MAX_BLOCKS: usize = MAX_CONTACTS * (MAX_CONTACTS + 1) / 2;

/// Entries of a contact along n, t, b.
pub type Triple<T> = [T; 3];

/// Index of block (i, j), `j <= i`, in [`ContactProblem::W`].
#[inline(always)]
#[must_use]
pub const fn block(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// The problem `K_μ* ∋ ũ ⊥ p ∈ K_μ`, `u = W p + q`, of one rover's active contacts, and its answer.
///
/// Contacts are numbered without gaps; entries beyond the last are not read. A contact's three
/// unknowns are its normal and two tangents.
#[derive(Clone, Debug)]
pub struct ContactProblem {
    /// Number of contacts, at most [`MAX_CONTACTS`].
    pub n_contacts: usize,
    /// Lower triangle of the symmetric Delassus operator by 3 x 3 blocks, each row-major, 1/kg:
    /// block (i, j), `j <= i`, is at [`block`]. Diagonal blocks are read whole.
    pub W: [[f64; 9]; MAX_BLOCKS],
    /// Free velocity, m/s.
    pub q: [f64; MAX_UNKNOWNS],
    /// Friction coefficients.
    pub mu: [f64; MAX_CONTACTS],
    /// Impulses, N s: the warm start, and the answer.
    pub p: [f64; MAX_UNKNOWNS],
    /// Velocities `W p + q` of the answer, m/s.
    pub u: [f64; MAX_UNKNOWNS],
    /// Residual of the answer.
    pub residual: Residual,
    /// Linear systems solved.
    pub iterations: usize,
    /// Whether the answer is within the tolerances. If not, `p` and `u` are unspecified.
    pub is_solved: bool,
}

impl Default for ContactProblem {
    fn default() -> Self {
        Self {
            n_contacts: 0,
            W: [[0.0; 9]; MAX_BLOCKS],
            q: [0.0; MAX_UNKNOWNS],
            mu: [0.0; MAX_CONTACTS],
            p: [0.0; MAX_UNKNOWNS],
            u: [0.0; MAX_UNKNOWNS],
            residual: Residual::UNSOLVED,
            iterations: 0,
            is_solved: false,
        }
    }
}

impl ContactProblem {
    /// Number of unknowns.
    #[inline(always)]
    #[must_use]
    pub fn n_unknowns(&self) -> usize {
        3 * self.n_contacts
    }

    /// Entry of W, 1/kg.
    #[must_use]
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        self.W[block(i / 3, j / 3)][3 * (i % 3) + j % 3]
    }
}
