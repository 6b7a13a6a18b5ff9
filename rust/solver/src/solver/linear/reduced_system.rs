//! The linear system of a Newton step in the unknowns that the predicted modes leave free.
//!
//! - *open*: `p = 0`, no unknown;
//! - *stick*: `û = 0`, the impulse's `d` unknowns;
//! - *slide* along `e`, with `t = e⊥`: `û_N = 0`, `p_e = μ p_N` and
//!   `û_t + γ p_t = 0`, unknowns `(p_N, p_t)` (one in the plane).
//!
//! Written for the increment it reads `(Bᵀ (W + α I) C + γ) y = −Bᵀ û − γ p_t`,
//! symmetric when nothing slides with friction.

use super::block_lu::BlockLu;
use super::dense::{self, Chunk, LANES};
use crate::cone::tangential_norm;
use crate::law::mode::{ContactMode, Mode};
use crate::problem::{BlockSparseDelassus, Operator, Prepared, Proximal};
use crate::solver::local::modes::n_unknowns;
use crate::solver::work::{self, WorkBudget};

/// Stored factors of the reduced system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::solver) enum Factorisation {
    /// None, or outdated.
    None,
    /// Cholesky.
    Symmetric,
    /// LU.
    General,
    /// Block-sparse LU.
    Sparse,
}

/// One Newton step with a factored system.
#[derive(Clone, Copy, Debug)]
pub(in crate::solver) struct NewtonStep {
    /// Regularisation used in the factors, 1/kg.
    pub alpha: f64,
    /// Kind of the factors.
    pub factors: Factorisation,
    /// Whether sliding impulses return radially to the cone after the step.
    pub on_cone: bool,
}

/// The system with its linearisation and its factors, kept from step to step.
#[derive(Clone, Debug, Default)]
pub(in crate::solver) struct ReducedSystem {
    /// Mode of each contact in the current linearisation.
    pub modes: Vec<Mode<f64>>,
    /// First unknown of each contact in the modes that were last factored.
    starts: Vec<usize>,
    /// Number of unknowns of the modes that were last factored.
    pub m: usize,
    /// Whether any contact slides with friction in the modes that were last factored.
    pub slides: bool,
    /// Proximal centre (n), N s.
    pub centre: Vec<f64>,
    /// The Newton point (n), N s, and a velocity (n), m/s.
    pub trial: Vec<f64>,
    pub trial_velocity: Vec<f64>,
    /// What [`factorise_shifted`](Self::factorise_shifted) adds to the diagonal blocks of `W`, row
    /// by row, 1/kg.
    pub blocks: Vec<f64>,
    /// Right-hand side and solution, padded.
    rhs: Vec<Chunk>,
    /// Dense matrix, factored in place, and its row exchanges.
    matrix: Vec<Chunk>,
    pivots: Vec<usize>,
    /// Factors of the block-sparse system, and whether their pattern is that of the current
    /// problem.
    block_lu: BlockLu,
    is_analysed: bool,
}

/// Sets all of `p` to zero; true if that changed it.
#[inline]
fn clear(p: &mut [f64]) -> bool {
    let moved = p.iter().any(|x| x.abs() > 0.0);
    p.fill(0.0);
    moved
}

/// Moves `p` onto the linearised constraints (`p = 0` if open, `p_e = μ p_N` if sliding, `p_T = 0`
/// if sliding without friction); true if that changed it.
#[inline]
fn snap<const D: usize>(mu: &[f64], modes: &[Mode<f64>], p: &mut [f64]) -> bool {
    let mut moved = false;
    for ((mode, &mu), p) in modes.iter().zip(mu).zip(p.chunks_exact_mut(D)) {
        match mode.kind() {
            ContactMode::Stick => {}
            ContactMode::Open => moved |= clear(p),
            ContactMode::Slip if mu <= 0.0 => moved |= clear(&mut p[1..]),
            ContactMode::Slip => {
                let e = mode.direction();
                let wanted = mu * p[0];
                let gap = wanted - (p[1] * e[0] + p[D - 1] * e[1]);
                if gap.abs() > 1e-14 * wanted.abs() {
                    moved = true;
                    for k in 1..D {
                        p[k] += gap * e[k - 1];
                    }
                }
            }
        }
    }
    moved
}

/// Sets the padding of a matrix of `m` unknowns to the unit matrix.
#[inline]
fn pad(A: &mut [Chunk], m: usize) {
    let size = dense::chunks(m);
    if m == LANES * size {
        return;
    }
    for column in A.chunks_exact_mut(size).take(m) {
        column[size - 1][m % LANES..].fill(0.0);
    }
    for k in m..LANES * size {
        let column = &mut A[k * size..(k + 1) * size];
        column.fill([0.0; LANES]);
        column[size - 1][k % LANES] = 1.0;
    }
}

/// `W + α I` for a Cholesky factorisation, which reads the lower triangle
/// of these columns: the rows of a symmetric `W`.
#[inline]
fn assemble_symmetric(W: &[f64], alpha: f64, n: usize, A: &mut [Chunk]) {
    let size = dense::chunks(n);
    pad(A, n);
    for (k, (row, column)) in W.chunks_exact(n).zip(A.chunks_exact_mut(size)).enumerate() {
        let column = column.as_flattened_mut();
        column[..n].copy_from_slice(row);
        column[k] += alpha;
    }
}

/// `Bᵀ (W + α I) C + γ` of the predicted modes, `m × m`, padded.
#[inline]
fn assemble<const D: usize>(
    mu: &[f64],
    W: &[f64],
    alpha: f64,
    modes: &[Mode<f64>],
    m: usize,
    A: &mut [Chunk],
) {
    pad(A, m);
    let n = D * modes.len();
    let height = LANES * dense::chunks(m);
    let A = A.as_flattened_mut();
    let mut start = 0;
    for ((mode, &mu_i), rows) in modes.iter().zip(mu).zip(W.chunks_exact(D * n)) {
        let rows: [&[[f64; D]]; D] =
            std::array::from_fn(|r| rows[r * n..(r + 1) * n].as_chunks::<D>().0);
        let own = &mut A[start..];
        let [e0, e1] = mode.direction();
        let kind = mode.kind();
        let size = n_unknowns::<D>(kind, mu_i);
        match (kind, size) {
            (ContactMode::Open, _) => continue,
            (ContactMode::Stick, _) => assemble_rows(rows, mu, modes, height, own, |w| w),
            (ContactMode::Slip, 2) => {
                let across = |w: [[f64; D]; D]| {
                    let turned = std::array::from_fn(|c| e0 * w[D - 1][c] - e1 * w[1][c]);
                    [w[0], turned]
                };
                assemble_rows(rows, mu, modes, height, own, across);
                own[(start + 1) * height + 1] += mode.gamma;
            }
            (ContactMode::Slip, _) => assemble_rows(rows, mu, modes, height, own, |w| [w[0]]),
        }
        for k in 0..size {
            own[(start + k) * height + k] += alpha;
        }
        start += size;
    }
}

/// The equations of one contact: its blocks of `Bᵀ W C`. `reduce` takes the rows that the contact
/// keeps from a block of `W`; here follow the columns, which the unknowns of every contact act
/// through. `target` begins at the contact's first row; columns have `height` entries.
#[inline]
fn assemble_rows<const D: usize, const R: usize>(
    rows: [&[[f64; D]]; D],
    mu: &[f64],
    modes: &[Mode<f64>],
    height: usize,
    target: &mut [f64],
    reduce: impl Fn([[f64; D]; D]) -> [[f64; D]; R],
) {
    let n = modes.len();
    let (rows, mu) = (rows.map(|row| &row[..n]), &mu[..n]);
    let mut at = 0;
    let mut push = |entries: [f64; R]| {
        target[at..at + R].copy_from_slice(&entries);
        at += height;
    };
    for (j, mode) in modes.iter().enumerate() {
        match mode.kind() {
            ContactMode::Open => {}
            ContactMode::Stick => {
                let w = reduce(rows.map(|row| row[j]));
                for c in 0..D {
                    push(w.map(|row| row[c]));
                }
            }
            ContactMode::Slip => {
                let [e0, e1] = mode.direction();
                let w = reduce(rows.map(|row| row[j]));
                push(w.map(|row| row[0] + mu[j] * (row[1] * e0 + row[D - 1] * e1)));
                if D == 3 && mu[j] > 0.0 {
                    push(w.map(|row| e0 * row[D - 1] - e1 * row[1]));
                }
            }
        }
    }
}

/// Right-hand side: minus the linearised equations at `(p, û)`.
#[inline]
fn right_hand_side<const D: usize>(
    data: &Prepared<'_>,
    prox: Proximal<'_>,
    modes: &[Mode<f64>],
    starts: &[usize],
    p: &[f64],
    u: &[f64],
    rhs: &mut [f64],
) {
    for (i, (mode, &start)) in modes.iter().zip(starts).enumerate() {
        let mut u_hat = [0.0; D];
        for k in 0..D {
            u_hat[k] = u[D * i + k] + prox.alpha * (p[D * i + k] - prox.centre[D * i + k]);
        }
        match mode.kind() {
            ContactMode::Open => {}
            ContactMode::Stick => {
                for k in 0..D {
                    rhs[start + k] = -u_hat[k];
                }
            }
            ContactMode::Slip => {
                rhs[start] = -u_hat[0];
                if D == 3 && data.mu[i] > 0.0 {
                    let [e0, e1] = mode.direction();
                    let p_t = e0 * p[D * i + 2] - e1 * p[D * i + 1];
                    rhs[start + 1] = -(e0 * u_hat[D - 1] - e1 * u_hat[1] + mode.gamma * p_t);
                }
            }
        }
    }
}

/// Adds `C y` to `p`. With `on_cone` a sliding impulse is projected radially onto the cone's
/// surface, a second-order change.
#[inline]
fn apply<const D: usize>(
    mu: &[f64],
    modes: &[Mode<f64>],
    starts: &[usize],
    y: &[f64],
    on_cone: bool,
    p: &mut [f64],
) {
    let contacts = modes.iter().zip(starts).zip(mu);
    for (((mode, &start), &mu), p) in contacts.zip(p.chunks_exact_mut(D)) {
        match mode.kind() {
            ContactMode::Open => {}
            ContactMode::Stick => {
                for (x, y) in p.iter_mut().zip(&y[start..]) {
                    *x += y;
                }
            }
            ContactMode::Slip => {
                let y_N = y[start];
                p[0] += y_N;
                if mu <= 0.0 {
                    continue;
                }
                let [e0, e1] = mode.direction();
                p[1] += mu * y_N * e0;
                if D == 3 {
                    let y_t = y[start + 1];
                    p[1] -= y_t * e1;
                    p[2] += mu * y_N * e1 + y_t * e0;
                }
                if on_cone && p[0] > 0.0 {
                    let norm = tangential_norm::<D>(&std::array::from_fn(|k| p[k]));
                    if norm > 0.0 {
                        let scale = mu * p[0] / norm;
                        for x in &mut p[1..] {
                            *x *= scale;
                        }
                    }
                }
            }
        }
    }
}

impl ReducedSystem {
    /// Makes the memory of the factors fit `W` of `n` unknowns.
    pub fn fit(&mut self, n: usize, W: Operator<'_>) {
        match W {
            Operator::Dense(_) => {
                if self.pivots.len() != LANES * dense::chunks(n) {
                    self.resize_dense(n);
                }
            }
            Operator::BlockSparse(_) => self.is_analysed = false,
        }
    }

    /// Makes room for dense factors of `n` unknowns.
    pub fn resize_dense(&mut self, n: usize) {
        let size = dense::chunks(n);
        self.matrix.resize(LANES * size * size, [0.0; LANES]);
        self.pivots.resize(LANES * size, 0);
    }

    /// Makes room for all but the factors.
    pub fn resize(&mut self, n_contacts: usize, n: usize) {
        self.modes.resize(n_contacts, Mode::new(ContactMode::Open));
        self.starts.resize(n_contacts, 0);
        self.rhs.resize(dense::chunks(n), [0.0; LANES]);
        self.blocks.resize(n * n / n_contacts.max(1), 0.0);
        for buffer in [&mut self.centre, &mut self.trial, &mut self.trial_velocity] {
            buffer.resize(n, 0.0);
        }
    }

    /// The proximal term with the present centre.
    #[inline]
    pub fn prox(&self, alpha: f64) -> Proximal<'_> {
        Proximal {
            alpha,
            centre: &self.centre,
        }
    }

    /// Numbers the unknowns of the modes. In a block-sparse system every contact keeps its place,
    /// and unknowns that its mode eliminates are zero.
    #[inline]
    fn number<const D: usize>(&mut self, data: &Prepared<'_>) {
        (self.m, self.slides) = (0, false);
        let contacts = self.modes.iter().zip(data.mu).zip(&mut self.starts);
        for (i, ((mode, &mu), start)) in contacts.enumerate() {
            *start = match data.W {
                Operator::Dense(_) => self.m,
                Operator::BlockSparse(_) => D * i,
            };
            self.m += n_unknowns::<D>(mode.kind(), mu);
            self.slides |= mode.kind() == ContactMode::Slip && mu > 0.0;
        }
    }

    /// Whether the budget allows another sparse factorisation; the first call analyses the pattern.
    fn affords_sparse(&mut self, W: &BlockSparseDelassus, work: &mut WorkBudget) -> bool {
        if !self.is_analysed {
            self.block_lu.analyse(W);
            self.is_analysed = true;
        }
        work.affords(self.block_lu.work())
    }

    /// Factors the system of the modes; none if it is singular or the budget does not allow it.
    #[inline]
    pub fn factorise<const D: usize>(
        &mut self,
        data: &Prepared<'_>,
        alpha: f64,
        allow_symmetric: bool,
        work: &mut WorkBudget,
    ) -> Factorisation {
        work.factorisations += 1;
        self.number::<D>(data);
        let m = self.m;
        let W = match data.W {
            Operator::Dense(W) => W,
            Operator::BlockSparse(W) => {
                if !self.affords_sparse(W, work) {
                    return Factorisation::None;
                }
                let is_regular =
                    (self.block_lu).factorise::<D>(W, data.mu, alpha, None, &self.modes);
                return if is_regular {
                    Factorisation::Sparse
                } else {
                    Factorisation::None
                };
            }
        };
        let may_be_symmetric = !self.slides && allow_symmetric;
        // A step costs two products and two substitutions in addition to its factors.
        let cost = work::dense(m, may_be_symmetric) + 2 * data.product;
        if !work.affords(cost) {
            return Factorisation::None;
        }
        let size = dense::chunks(m);
        let A = &mut self.matrix[..LANES * size * size];
        if may_be_symmetric {
            if m == data.n {
                assemble_symmetric(W, alpha, m, A);
            } else {
                assemble::<D>(data.mu, W, alpha, &self.modes, m, A);
            }
            if dense::cholesky(A, size) {
                return Factorisation::Symmetric;
            }
        }
        assemble::<D>(data.mu, W, alpha, &self.modes, m, A);
        if dense::lu(A, size, &mut self.pivots) {
            Factorisation::General
        } else {
            Factorisation::None
        }
    }

    /// Factors `W` with the [`blocks`](Self::blocks) added; `false` if that fails or the budget does
    /// not allow it.
    pub fn factorise_shifted<const D: usize>(
        &mut self,
        data: &Prepared<'_>,
        work: &mut WorkBudget,
    ) -> bool {
        self.modes.fill(Mode::new(ContactMode::Stick));
        work.factorisations += 1;
        match data.W {
            Operator::Dense(W) => {
                let (n, size) = (data.n, dense::chunks(data.n));
                if !work.affords(work::dense(n, false)) {
                    return false;
                }
                assemble::<D>(data.mu, W, 0.0, &self.modes, n, &mut self.matrix);
                for (i, block) in self.blocks.chunks_exact(D * D).enumerate() {
                    for (k, entry) in block.iter().enumerate() {
                        let (row, column) = (D * i + k / D, D * i + k % D);
                        self.matrix[column * size + row / LANES][row % LANES] += entry;
                    }
                }
                dense::lu(&mut self.matrix, size, &mut self.pivots)
            }
            Operator::BlockSparse(W) => {
                self.affords_sparse(W, work)
                    && self.block_lu.factorise::<D>(
                        W,
                        data.mu,
                        0.0,
                        Some(&self.blocks),
                        &self.modes,
                    )
            }
        }
    }

    /// Solves the system of [`factorise_shifted`](Self::factorise_shifted) for the right-hand
    /// side that `write` enters; returns the solution (n).
    pub fn solve_shifted<const D: usize>(
        &mut self,
        data: &Prepared<'_>,
        write: impl FnOnce(&mut [f64]),
    ) -> &[f64] {
        let n = data.n;
        let rhs = self.rhs.as_flattened_mut();
        write(&mut rhs[..n]);
        rhs[n..].fill(0.0);
        match data.W {
            Operator::Dense(_) => {
                dense::lu_solve(&self.matrix, dense::chunks(n), &self.pivots, &mut self.rhs);
            }
            Operator::BlockSparse(W) => self.block_lu.solve::<D>(W, &mut rhs[..n]),
        }
        &self.rhs.as_flattened()[..n]
    }

    /// Solves the factored system for the stored right-hand side, in place.
    #[inline]
    fn back_substitute<const D: usize>(&mut self, data: &Prepared<'_>, factors: Factorisation) {
        if let (Factorisation::Sparse, Operator::BlockSparse(W)) = (factors, data.W) {
            self.block_lu
                .solve::<D>(W, &mut self.rhs.as_flattened_mut()[..data.n]);
            return;
        }
        let size = dense::chunks(self.m);
        let rhs = &mut self.rhs[..size];
        let A = &self.matrix[..LANES * size * size];
        rhs.as_flattened_mut()[self.m..].fill(0.0);
        match factors {
            Factorisation::None | Factorisation::Sparse => rhs.fill([0.0; LANES]),
            Factorisation::Symmetric => dense::cholesky_solve(A, size, rhs),
            Factorisation::General => dense::lu_solve(A, size, &self.pivots, rhs),
        }
    }

    /// The Newton point of the regularised problem from `(p, u)`, into `trial`. The slides may have
    /// turned since they were factored.
    pub fn newton_point<const D: usize>(
        &mut self,
        data: &Prepared<'_>,
        step: NewtonStep,
        p: &[f64],
        u: &[f64],
    ) {
        let Self {
            trial,
            trial_velocity,
            modes,
            starts,
            centre,
            rhs,
            ..
        } = self;
        trial.copy_from_slice(p);
        if step.factors == Factorisation::Sparse {
            rhs.fill([0.0; LANES]);
        }
        let mut u = u;
        if snap::<D>(data.mu, modes, trial) {
            data.W.multiply_add(trial, data.q, trial_velocity);
            u = trial_velocity;
        }
        let prox = Proximal {
            alpha: step.alpha,
            centre,
        };
        let rhs = rhs.as_flattened_mut();
        right_hand_side::<D>(data, prox, modes, starts, trial, u, rhs);
        self.back_substitute::<D>(data, step.factors);
        apply::<D>(
            data.mu,
            &self.modes,
            &self.starts,
            self.rhs.as_flattened(),
            step.on_cone,
            &mut self.trial,
        );
    }
}
