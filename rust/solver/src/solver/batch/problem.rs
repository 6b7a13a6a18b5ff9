//! One rover's friction-contact problem, handed from a block to the solver and back.

use std::sync::Arc;

use super::pattern::Pattern;
use crate::problem::Residual;
pub use crate::solver::pivoting::Triple;

/// Most contacts of a problem.
pub const MAX_CONTACTS: usize = 32;

/// Most contacts of a problem with `W` itself, besides its dry joints.
pub const MAX_DENSE: usize = 8;

/// Most dry joints of a problem with `W` itself.
pub const MAX_DRY: usize = 10;

/// Most contacts of a problem with factors that is solved with the operator that they give.
pub const MAX_LARGE: usize = 24;

/// Most unknowns.
pub const MAX_UNKNOWNS: usize = 3 * MAX_CONTACTS;

/// Blocks of the lower triangle of `W` without dry joints.
pub const DENSE_BLOCKS: usize = block(MAX_DENSE, 0);

/// Blocks of the lower triangle of the operator of most contacts that factors give.
pub(super) const LARGE_BLOCKS: usize = block(MAX_LARGE, 0);

/// Index of block (i, j), `j <= i`, in [`ContactProblem::W`].
#[inline(always)]
#[must_use]
pub const fn block(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// The problem `K_μ* ∋ ũ ⊥ p ∈ K_μ`, `u = W p + q`, of one rover's active contacts, and its answer.
///
/// Contacts are numbered without gaps; entries beyond the last are not read. A contact's three
/// unknowns are its normal and two tangents. A problem has either `W` or its factors.
#[derive(Debug)]
#[allow(clippy::struct_excessive_bools)] // facts that do not depend on each other
pub struct ContactProblem {
    /// Number of contacts, at most [`MAX_DENSE`], or [`MAX_CONTACTS`] with factors; dry joints are
    /// counted, too.
    pub n_contacts: usize,
    /// Number of dry joints, which come last: at most [`MAX_DRY`], any number with factors.
    pub n_dry: usize,
    /// Factors of the operator; without a pattern there are none.
    pub factored: Factored,
    /// Lower triangle of the symmetric Delassus operator by 3 x 3 blocks, each row-major, 1/kg:
    /// block (i, j), `j <= i`, is at [`block`]. Diagonal blocks are read whole. At least
    /// [`DENSE_BLOCKS`]; [`Self::make_room`] for more.
    pub W: Vec<[f64; 9]>,
    /// Free velocity, m/s.
    pub q: [f64; MAX_UNKNOWNS],
    /// Friction coefficients.
    pub mu: [f64; MAX_CONTACTS],
    /// Impulses, N s: those of the last step, and the answer. Of answers that the machine cannot
    /// tell apart one near them is found, or the least one: [`Self::asks_least`].
    pub p: [f64; MAX_UNKNOWNS],
    /// Impulses, N s, from which a solve starts if `has_start`.
    pub start: [f64; MAX_UNKNOWNS],
    /// Whether a solve starts from `start` rather than from the impulses of the last step.
    pub has_start: bool,
    /// Whether of the answers with the same motion that of least norm is taken.
    pub asks_least: bool,
    /// Whether `p` was the least answer of the last step, of the same contacts. Where it still
    /// solves the problem without any step of the solver, it stays.
    pub begins_least: bool,
    /// Velocities `W p + q` of the answer, m/s.
    pub u: [f64; MAX_UNKNOWNS],
    /// Residual of the answer.
    pub residual: Residual,
    /// Iterations of the solver; in lanes each solves a linear system.
    pub iterations: usize,
    /// Matrices that it factored.
    pub factorisations: usize,
    /// Iterations that pivoted, of a solver that counts them apart.
    pub pivots: usize,
    /// Whether the answer took more than a batch does.
    pub is_escalated: bool,
    /// Whether the answer is acceptable and no more.
    pub is_acceptable: bool,
    /// Whether the answer is within the tolerances, or acceptable. If not, `p` and `u` are
    /// unspecified.
    pub is_solved: bool,
}

/// An operator `W = Zᵀ Z + D` of a machine with many contacts.
#[derive(Debug, Default)]
pub struct Factored {
    /// The machine's.
    pub pattern: Option<Arc<Pattern>>,
    /// Slots with a contact, in the order of the contacts. Where the pattern is whole, the contacts
    /// have the first ones.
    pub slots: u32,
    /// Z along the path of each contact: `Z[contact * stride + k]`, kg^(-1/2).
    pub Z: Vec<Triple<f64>>,
    /// Diagonal blocks of W, 1/kg.
    pub diagonal: Vec<[f64; 9]>,
    /// Diagonal of D by contact, along n, t, b, 1/kg; the latter two are equal.
    pub softness: Vec<Triple<f64>>,
    /// Whether the problem is solved with the operator itself: at most [`MAX_LARGE`] contacts, of a
    /// pattern that has all entries.
    pub is_multiplied: bool,
    /// Addition to `Zᵀ Z + D` along the normal of each contact, 1/kg: where nothing moves the
    /// normal, as with a joint's dry friction; 0 elsewhere.
    pub normal: Vec<f64>,
}

impl Factored {
    /// Number of the contact in a slot, if there is one.
    #[inline(always)]
    #[must_use]
    pub fn contact_at(&self, slot: usize) -> Option<usize> {
        let is_used = self.slots >> slot & 1 == 1;
        is_used.then(|| (self.slots & ((1 << slot) - 1)).count_ones() as usize)
    }

    /// Numbers of a contact's Z, and whether they are those of all velocities.
    #[inline(always)]
    #[must_use]
    pub fn shape(&self) -> (usize, bool) {
        (self.pattern.as_deref()).map_or((0, false), |own| (own.stride(), own.is_whole()))
    }

    /// Block (i, j) of W, of a pattern that has all entries, 1/kg.
    #[inline(always)]
    pub(super) fn block(&self, i: usize, j: usize) -> [f64; 9] {
        if i == j {
            return self.diagonal[i];
        }
        let stride = self.shape().0;
        let row = |contact: usize| &self.Z[contact * stride..][..stride];
        let mut w = [0.0; 9];
        for (x, y) in row(i).iter().zip(row(j)) {
            for k in 0..9 {
                w[k] += x[k / 3] * y[k % 3];
            }
        }
        w
    }

    /// Entry of W, 1/kg.
    fn entry(&self, pattern: &Pattern, i: usize, j: usize) -> f64 {
        let [a, b] = [i / 3, j / 3];
        if a == b {
            return self.diagonal[a][3 * (i % 3) + j % 3];
        }
        let shared = pattern.shared(self.slot_of(a), self.slot_of(b));
        let row = |contact: usize| self.Z[contact * pattern.stride()..].iter().take(shared);
        row(a).zip(row(b)).map(|(x, y)| x[i % 3] * y[j % 3]).sum()
    }

    /// Block of W, 1/kg.
    #[inline(never)]
    fn block_at(&self, pattern: &Pattern, i: usize, j: usize) -> [f64; 9] {
        if i == j {
            return self.diagonal[i];
        }
        let shared = pattern.shared(self.slot_of(i), self.slot_of(j));
        let row = |contact: usize| &self.Z[contact * pattern.stride()..][..shared];
        let mut block = [0.0; 9];
        for (x, y) in row(i).iter().zip(row(j)) {
            for k in 0..9 {
                block[k] += x[k / 3] * y[k % 3];
            }
        }
        block
    }

    /// Slot of a contact.
    fn slot_of(&self, contact: usize) -> usize {
        let mut slots = self.slots;
        for _ in 0..contact {
            slots &= slots - 1;
        }
        slots.trailing_zeros() as usize
    }

    /// Makes room for the contacts of a machine.
    pub fn adopt(&mut self, pattern: &Arc<Pattern>) {
        if !(self.pattern.as_ref()).is_some_and(|own| Arc::ptr_eq(own, pattern)) {
            self.pattern = Some(Arc::clone(pattern));
            self.Z.resize(MAX_CONTACTS * pattern.stride(), [0.0; 3]);
            self.diagonal.resize(MAX_CONTACTS, [0.0; 9]);
            self.softness.resize(MAX_CONTACTS, [0.0; 3]);
            self.normal.resize(MAX_CONTACTS, 0.0);
        }
    }

    fn copy_from(&mut self, other: &Self) {
        self.pattern.clone_from(&other.pattern);
        self.slots = other.slots;
        self.is_multiplied = other.is_multiplied;
        self.Z.clone_from(&other.Z);
        self.diagonal.clone_from(&other.diagonal);
        self.softness.clone_from(&other.softness);
        self.normal.clone_from(&other.normal);
    }
}

impl Clone for ContactProblem {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        copy
    }

    /// Copies without allocating where there is room.
    fn clone_from(&mut self, other: &Self) {
        self.n_contacts = other.n_contacts;
        self.n_dry = other.n_dry;
        self.factored.copy_from(&other.factored);
        if !other.is_factored() {
            let used = block(other.n_contacts, 0);
            self.make_room();
            self.W[..used].copy_from_slice(&other.W[..used]);
        }
        (self.q, self.mu) = (other.q, other.mu);
        (self.p, self.u) = (other.p, other.u);
        (self.start, self.has_start) = (other.start, other.has_start);
        (self.asks_least, self.begins_least) = (other.asks_least, other.begins_least);
        self.residual = other.residual;
        self.iterations = other.iterations;
        (self.factorisations, self.pivots) = (other.factorisations, other.pivots);
        (self.is_escalated, self.is_acceptable) = (other.is_escalated, other.is_acceptable);
        self.is_solved = other.is_solved;
    }
}

impl Default for ContactProblem {
    fn default() -> Self {
        Self {
            n_contacts: 0,
            n_dry: 0,
            factored: Factored::default(),
            W: vec![[0.0; 9]; DENSE_BLOCKS],
            q: [0.0; MAX_UNKNOWNS],
            mu: [0.0; MAX_CONTACTS],
            p: [0.0; MAX_UNKNOWNS],
            start: [0.0; MAX_UNKNOWNS],
            has_start: false,
            asks_least: false,
            begins_least: false,
            u: [0.0; MAX_UNKNOWNS],
            residual: Residual::UNSOLVED,
            iterations: 0,
            factorisations: 0,
            pivots: 0,
            is_escalated: false,
            is_acceptable: false,
            is_solved: false,
        }
    }
}

impl ContactProblem {
    /// Makes room for W of all contacts and dry joints.
    #[inline(always)]
    pub fn make_room(&mut self) {
        let n = block(self.n_contacts.min(MAX_DENSE + MAX_DRY), 0);
        if n > self.W.len() {
            self.W.resize(n, [0.0; 9]);
        }
    }

    /// Whether the problem has the factors of its operator.
    #[inline(always)]
    #[must_use]
    pub fn is_factored(&self) -> bool {
        self.factored.pattern.is_some()
    }

    /// Number of unknowns.
    #[inline(always)]
    #[must_use]
    pub fn n_unknowns(&self) -> usize {
        3 * self.n_contacts
    }

    /// W, row-major, 1/kg.
    #[must_use]
    pub fn operator(&self) -> Vec<f64> {
        let n = self.n_unknowns();
        let rows = (0..n).flat_map(|i| (0..n).map(move |j| self.entry(i, j)));
        rows.collect()
    }

    /// Block (i, j) of W, `j <= i`, row-major, 1/kg.
    #[inline(always)]
    pub(super) fn block_at(&self, i: usize, j: usize) -> [f64; 9] {
        match &self.factored.pattern {
            None => self.W[block(i, j)],
            Some(pattern) => self.factored.block_at(pattern, i, j),
        }
    }

    /// Entry of W, 1/kg.
    #[must_use]
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        if let Some(pattern) = &self.factored.pattern {
            return self.factored.entry(pattern, i, j);
        }
        self.W[block(i / 3, j / 3)][3 * (i % 3) + j % 3]
    }
}
