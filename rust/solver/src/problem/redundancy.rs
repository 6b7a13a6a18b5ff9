//! Redundant contacts: impulses that the motion leaves open, and the least of them.
//!
//! Bodies feel only `H p`. Given the velocities u of an answer, each contact bears nothing where it
//! parts, an impulse against its slip where it slides, and any impulse in its cone where it is at
//! rest. With the columns C of these unknowns, `p = C y`, every y with the same `H C y` is an
//! answer as good. Since `W = Hᵀ M⁻¹ H`, these are the `y + N t` with `Cᵀ W C N = 0`. One of them
//! is taken:
//!
//! ```text
//! minimise  |p|²   subject to   p = C (y + N t),   p in the cones
//! ```
//!
//! It is unique and depends neither on the solver, nor on its start, nor on the order of the
//! contacts. It is the limit of contacts that all yield with the same stiffness k as k grows
//! (Tikhonov's regularisation): four corners of a box share its weight like four equal springs. The
//! impulse of a joint's stop or dry friction counts with the arm that makes it as light to move as
//! the contacts that it is coupled with.
//!
//! - [`Redundancy::settle`] replaces an answer by the least one: an elimination with the largest
//!   pivots finds N, a projection the least y. Only if that leaves a cone, Newton's method on the
//!   dual problem follows (Qi and Sun 1993). An answer that creeps where another one rests gives
//!   way to it.
//! - [`Redundancy::settle_problem`] does so for all groups of contacts of a problem.
//! - [`undetermined_loads`] counts the contacts concerned.
//!
//! Where a contact yields, W has a positive number on its diagonal, and nothing is open.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::friction_contact::FrictionContactProblem;
use super::least_in_cones::{
    AdmissibleImpulse, Cones, ON_THE_CONE, Touching, backward, cholesky, forward, norm,
};
use super::operator::Operator;
use super::residual::{Residual, evaluate_into};

/// Pivot, relative to the largest entry on the diagonal of the contact's block of W, below which an
/// unknown adds nothing.
///
/// Rounding leaves 1e-15 to 1e-14. A wheel that steers about an axis at a distance of a millionth
/// of its radius leaves 1e-12; its force is then determined to a hundredth only, since a converged
/// answer may be off by 1e-12 in the velocities.
const DEPENDENT: f64 = 1e-12;

/// Share of a null vector below which it does not concern a contact.
const CONCERNED: f64 = 1e-6;

/// Most contacts of a group whose impulses are settled. Those of a heap, which takes many
/// factorisations anyway, stay as the solver finds them.
const MOST_SETTLED: usize = 32;

/// A problem and its answer. `D` entries a contact.
pub(crate) struct Answered<'a, B: Fn(usize, usize) -> [f64; 9]> {
    /// Components of a contact, 2 or 3.
    pub d: usize,
    /// Block (i, j), `j <= i`, of the symmetric part of W, row-major in 3 × 3.
    pub block: B,
    pub mu: &'a [f64],
    /// Velocities of the answer, m/s.
    pub u: &'a [f64],
    /// Speed up to which a contact is at rest: what the tolerance leaves, m/s.
    pub still: f64,
}

/// What has become of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Settled {
    /// The answer as it was: the motion determines its impulses.
    Unchanged,
    /// The least impulses of the same motion.
    Least,
    /// The least impulses of another answer: its contacts all have the velocity 0.
    AtRest,
}

/// Finds impulses that the motion leaves open; memory for it.
#[derive(Clone, Debug, Default)]
pub struct Redundancy {
    touching: Vec<Touching>,
    n: usize,
    /// `Cᵀ W C` by rows of [`stride`] numbers; then, in the rows of the pivots, its reduced echelon
    /// form.
    A: Vec<f64>,
    row: Vec<f64>,
    inverse: Vec<f64>,
    /// Unknowns with a pivot in the order of the elimination, and those without.
    pivots: Vec<usize>,
    open: Vec<usize>,
    /// Weight of each unknown in the norm.
    weights: Vec<f64>,
    /// Null vector k is 1 at the unknown `open[k]` and `−Y_k` at the pivots.
    Y: Vec<f64>,
    /// Cholesky's factor of the null vectors' products.
    gram: Vec<f64>,
    /// Impulses by unknown; before and after.
    start: Vec<f64>,
    y: Vec<f64>,
    t: Vec<f64>,
    cones: Cones,
    /// Groups of contacts, and impulses and velocities before.
    groups: Vec<usize>,
    kept: [Vec<f64>; 2],
}

/// Length of the rows of n numbers: full registers.
#[inline(always)]
fn stride(n: usize) -> usize {
    n.next_multiple_of(4)
}

/// `x −= factor y` for rows of full registers.
#[inline(always)]
fn subtract(x: &mut [f64], factor: f64, y: &[f64]) {
    // Six wheels, four, or three: loops of a known length take half of the instructions.
    match x.len() {
        20 => subtract_fixed::<20>(x, factor, y),
        12 => subtract_fixed::<12>(x, factor, y),
        _ => x.iter_mut().zip(y).for_each(|(x, y)| *x -= factor * y),
    }
}

#[inline(always)]
fn subtract_fixed<const N: usize>(x: &mut [f64], factor: f64, y: &[f64]) {
    if let (Some(x), Some(y)) = (x.first_chunk_mut::<N>(), y.first_chunk::<N>()) {
        for k in 0..N {
            x[k] -= factor * y[k];
        }
    }
}

impl Redundancy {
    /// Replaces the impulses `p` by the least ones that cause the same motion. Contacts outside
    /// `contacts` keep theirs.
    ///
    /// Where contacts creep, the problem may have another answer in which all of them rest. That is
    /// taken: a machine at rest stays there whatever the solver and its start.
    #[inline(always)]
    pub(crate) fn settle<B: Fn(usize, usize) -> [f64; 9]>(
        &mut self,
        answered: &Answered<'_, B>,
        contacts: impl Iterator<Item = usize> + Clone,
        p: &mut [f64],
    ) -> Settled {
        if creep(answered, contacts.clone(), p) && self.rest(answered, contacts.clone(), p) {
            return Settled::AtRest;
        }
        self.find(answered, contacts, p, false);
        if self.open.is_empty() {
            return Settled::Unchanged;
        }
        self.read(answered.d, p);
        self.project();
        if !self.is_within(answered.d) {
            self.stay_within(answered.d);
        }
        self.write(answered.d, p);
        Settled::Least
    }

    /// Replaces the impulses `p` by the least ones under which all contacts rest, if these are open
    /// and within the cones.
    #[cold]
    fn rest<B: Fn(usize, usize) -> [f64; 9]>(
        &mut self,
        answered: &Answered<'_, B>,
        contacts: impl Iterator<Item = usize> + Clone,
        p: &mut [f64],
    ) -> bool {
        let (d, still) = (answered.d, answered.still);
        self.find(answered, contacts, p, true);
        if self.open.is_empty()
            || self
                .touching
                .iter()
                .any(|own| own.kind != AdmissibleImpulse::Rests)
        {
            return false;
        }
        self.read(d, p);
        // The impulses by unknowns with a pivot that end the creep: C' W C y = -u.
        self.assemble(answered);
        let (stride, rank) = (stride(self.n), self.pivots.len());
        let (row, t) = (&mut self.row, &mut self.t);
        row.clear();
        t.clear();
        for &i in &self.pivots {
            row.extend(self.pivots.iter().map(|j| self.A[i * stride + j]));
            t.push(-answered.u[d * self.touching[i / d].contact + i % d]);
        }
        cholesky(row, rank);
        forward(row, rank, t);
        backward(row, rank, t);
        for (change, &pivot) in t.iter().zip(&self.pivots) {
            self.start[pivot] += change;
        }
        let is_met = self.open.iter().all(|&i| {
            let change = t.iter().zip(&self.pivots);
            let change: f64 = change.map(|(t, j)| self.A[i * stride + j] * t).sum();
            (answered.u[d * self.touching[i / d].contact + i % d] + change).abs() <= still
        });
        if !is_met {
            return false;
        }
        self.project();
        if !self.is_within(d) {
            self.stay_within(d);
            if !self.is_within(d) {
                return false;
            }
        }
        self.write(d, p);
        true
    }

    /// Number of the contacts whose impulses are open.
    pub(crate) fn count<B: Fn(usize, usize) -> [f64; 9]>(
        &mut self,
        answered: &Answered<'_, B>,
        contacts: impl Iterator<Item = usize> + Clone,
        p: &[f64],
    ) -> usize {
        self.find(answered, contacts, p, false);
        let (n, rank) = (self.n, self.pivots.len());
        let mut is_open = vec![false; n];
        for (f, &open) in self.open.iter().enumerate() {
            is_open[open] = true;
            for (y, pivot) in self.Y[f * rank..].iter().zip(&self.pivots) {
                is_open[*pivot] |= y.abs() > CONCERNED;
            }
        }
        let ends = (self.touching.iter().skip(1).map(|own| own.first)).chain([n]);
        let open = |(own, end): &(&Touching, usize)| is_open[own.first..*end].contains(&true);
        self.touching.iter().zip(ends).filter(open).count()
    }

    /// Finds the null vectors of the contacts that may bear something; `rests`: as if none slid.
    #[inline(always)]
    #[allow(clippy::needless_pass_by_value)] // an iterator that is cloned
    fn find<B: Fn(usize, usize) -> [f64; 9]>(
        &mut self,
        answered: &Answered<'_, B>,
        contacts: impl Iterator<Item = usize> + Clone,
        p: &[f64],
        rests: bool,
    ) {
        let Answered {
            d, mu, u, still, ..
        } = *answered;
        self.touching.clear();
        self.inverse.clear();
        self.n = 0;
        for i in contacts.clone() {
            let (own, pressed) = (&u[d * i..][..d], &p[d * i..][..d]);
            let is_at_rest = own[0] <= still;
            if !is_at_rest {
                continue;
            }
            let block = (answered.block)(i, i);
            let is_joint = d == 3 && is_alone(&block) && {
                let mut others = contacts.clone().filter(|j| *j != i);
                others.all(|j| {
                    let w = (answered.block)(i.max(j), i.min(j));
                    let along = |k: usize| if j < i { w[k] } else { w[3 * k] };
                    let across = |k: usize| if j < i { w[6 + k] } else { w[3 * k + 2] };
                    (0..3).all(|k| across(k) == 0.0 && (mu[i] == 0.0 || along(k) == 0.0))
                })
            };
            let slip = (own[1..].iter().map(|u| u * u).sum::<f64>()).sqrt();
            let kind = if mu[i] == 0.0 {
                AdmissibleImpulse::Slides([1.0, 0.0, 0.0])
            } else if slip > still && (is_joint || !rests) {
                if is_joint {
                    continue;
                }
                slide(mu[i], &block, pressed, own)
            } else if is_joint {
                AdmissibleImpulse::Rubs(mu[i] * pressed[0])
            } else {
                AdmissibleImpulse::Rests
            };
            self.touching.push(Touching {
                contact: i,
                kind,
                first: self.n,
                mu: mu[i],
                is_joint,
            });
            let count = if kind == AdmissibleImpulse::Rests {
                d
            } else {
                1
            };
            let largest = block[0].max(block[4]).max(block[8]);
            let inverse = if largest > 0.0 { 1.0 / largest } else { 0.0 };
            self.inverse.resize(self.n + count, inverse);
            self.n += count;
        }
        self.assemble(answered);
        self.set_weights();
        self.eliminate();
        self.find_null_vectors();
    }

    /// `Cᵀ W C`.
    #[inline(always)]
    fn assemble<B: Fn(usize, usize) -> [f64; 9]>(&mut self, answered: &Answered<'_, B>) {
        let (stride, d) = (stride(self.n), answered.d);
        // What lies behind a row's last number is not read.
        self.A.resize(self.n * stride, 0.0);
        let A = &mut self.A[..];
        let mut set = |i: usize, j: usize, w: f64| {
            A[i * stride + j] = w;
            A[j * stride + i] = w;
        };
        for (k, row) in self.touching.iter().enumerate() {
            for column in &self.touching[..=k] {
                let w = (answered.block)(row.contact, column.contact);
                let (i, j) = (row.first, column.first);
                match (row.kind.direction(), column.kind.direction()) {
                    (None, None) => {
                        for r in 0..d {
                            for c in 0..d {
                                set(i + r, j + c, w[3 * r + c]);
                            }
                        }
                    }
                    (None, Some(c)) => {
                        for r in 0..d {
                            set(i + r, j, dot3([w[3 * r], w[3 * r + 1], w[3 * r + 2]], c));
                        }
                    }
                    (Some(c), None) => {
                        for r in 0..d {
                            set(i, j + r, dot3([w[r], w[3 + r], w[6 + r]], c));
                        }
                    }
                    (Some(a), Some(c)) => {
                        let rows =
                            [0, 1, 2].map(|r| dot3([w[3 * r], w[3 * r + 1], w[3 * r + 2]], c));
                        set(i, j, dot3(rows, a));
                    }
                }
            }
        }
    }

    /// Weights of the unknowns in the norm: 1, and of a joint's the square of an arm, 1/m².
    #[inline(always)]
    fn set_weights(&mut self) {
        let (n, stride) = (self.n, stride(self.n));
        self.weights.clear();
        self.weights.resize(n, 1.0);
        if !self.touching.iter().any(|own| own.is_joint) {
            return;
        }
        for joint in self.touching.iter().filter(|own| own.is_joint) {
            let (mut sum, mut count) = (0.0, 0.0);
            for other in self.touching.iter().filter(|own| !own.is_joint) {
                let n_own = if other.kind == AdmissibleImpulse::Rests {
                    2
                } else {
                    1
                };
                for k in other.first..other.first + n_own {
                    if self.A[joint.first * stride + k] != 0.0 {
                        sum += self.A[k * (stride + 1)];
                        count += 1.0;
                    }
                }
            }
            let own = self.A[joint.first * (stride + 1)];
            if sum > 0.0 && own > 0.0 {
                self.weights[joint.first] = own * count / sum;
            }
        }
    }

    /// Eliminates with the pivots that are largest relative to their contact's block of W, as far
    /// as there are any.
    #[inline(always)]
    fn eliminate(&mut self) {
        let stride = stride(self.n);
        self.pivots.clear();
        self.open.clear();
        self.open.extend(0..self.n);
        self.row.resize(stride, 0.0);
        let (A, open) = (&mut self.A[..], &mut self.open);
        let (row, inverses) = (&mut self.row[..], &self.inverse[..]);
        while !open.is_empty() {
            let (mut at, mut most) = (0, 0.0);
            for (k, &i) in open.iter().enumerate() {
                let own = A[i * (stride + 1)] * inverses[i];
                if own > most {
                    (at, most) = (k, own);
                }
            }
            let is_left = most > DEPENDENT;
            if !is_left {
                break;
            }
            let pivot = open.swap_remove(at);
            self.pivots.push(pivot);
            let own = &mut A[pivot * stride..][..stride];
            let inverse = 1.0 / own[pivot];
            for (x, kept) in own.iter_mut().zip(&mut *row) {
                *x *= inverse;
                *kept = *x;
            }
            for &i in &*open {
                let own = &mut A[i * stride..][..stride];
                let factor = own[pivot];
                subtract(own, factor, row);
            }
        }
    }

    /// Null vectors, and the factor of their products.
    #[inline(always)]
    fn find_null_vectors(&mut self) {
        let (stride, rank, n_open) = (stride(self.n), self.pivots.len(), self.open.len());
        if n_open == 0 {
            return;
        }
        for k in (1..rank).rev() {
            let pivot = self.pivots[k];
            let (A, row) = (&mut self.A[..], &mut self.row[..]);
            row.copy_from_slice(&A[pivot * stride..][..stride]);
            for &above in &self.pivots[..k] {
                let own = &mut A[above * stride..][..stride];
                let factor = own[pivot];
                subtract(own, factor, row);
            }
        }
        self.Y.clear();
        for &open in &self.open {
            let entry = |pivot: &usize| self.A[pivot * stride + open];
            self.Y.extend(self.pivots.iter().map(entry));
        }
        self.gram.resize(n_open * n_open, 0.0);
        for f in 0..n_open {
            for g in 0..=f {
                let mut sum = 0.0;
                if f == g {
                    sum = self.weights[self.open[f]];
                }
                let (a, b) = (&self.Y[f * rank..][..rank], &self.Y[g * rank..][..rank]);
                for ((a, b), pivot) in a.iter().zip(b).zip(&self.pivots) {
                    sum += self.weights[*pivot] * a * b;
                }
                self.gram[f * n_open + g] = sum;
            }
        }
        cholesky(&mut self.gram, n_open);
    }

    /// Impulses by unknown.
    #[inline(always)]
    fn read(&mut self, d: usize, p: &[f64]) {
        self.start.clear();
        for own in &self.touching {
            let p = &p[d * own.contact..][..d];
            match own.kind {
                AdmissibleImpulse::Rests => self.start.extend_from_slice(p),
                AdmissibleImpulse::Slides(c) => {
                    self.start.push(p.iter().zip(c).map(|(p, c)| p * c).sum());
                }
                AdmissibleImpulse::Rubs(_) => self.start.push(p[1]),
            }
        }
    }

    /// The reverse.
    #[inline(always)]
    fn write(&self, d: usize, p: &mut [f64]) {
        for own in &self.touching {
            let p = &mut p[d * own.contact..][..d];
            let y = &self.y[own.first..];
            match own.kind {
                AdmissibleImpulse::Rests => p.copy_from_slice(&y[..d]),
                AdmissibleImpulse::Slides(c) => {
                    p.iter_mut().zip(c).for_each(|(p, c)| *p = c * y[0]);
                }
                AdmissibleImpulse::Rubs(_) => p[1] = y[0],
            }
        }
    }

    /// The least impulses without regard to the cones.
    #[inline(always)]
    fn project(&mut self) {
        let (rank, n_open) = (self.pivots.len(), self.open.len());
        self.t.clear();
        for (f, &open) in self.open.iter().enumerate() {
            let mut sum = self.weights[open] * self.start[open];
            for (y, pivot) in self.Y[f * rank..][..rank].iter().zip(&self.pivots) {
                sum -= self.weights[*pivot] * y * self.start[*pivot];
            }
            self.t.push(sum);
        }
        forward(&self.gram, n_open, &mut self.t);
        backward(&self.gram, n_open, &mut self.t);
        self.y.clear();
        self.y.extend_from_slice(&self.start);
        for (f, (t, &open)) in self.t.iter().zip(&self.open).enumerate() {
            for (y, pivot) in self.Y[f * rank..][..rank].iter().zip(&self.pivots) {
                self.y[*pivot] += t * y;
            }
            self.y[open] -= t;
        }
    }

    /// Largest impulse of the answer.
    #[inline(always)]
    fn size(&self) -> f64 {
        self.start.iter().fold(0.0, |most, x| x.abs().max(most))
    }

    /// Whether the impulses are within the cones.
    #[inline(always)]
    fn is_within(&self, d: usize) -> bool {
        let slack = ON_THE_CONE * self.size();
        (self.touching.iter()).all(|own| own.excess(d, &self.y[own.first..]) <= slack)
    }

    /// The least impulses within the cones, from those without regard to them.
    #[cold]
    fn stay_within(&mut self, d: usize) {
        let (n, rank, n_open) = (self.n, self.pivots.len(), self.open.len());
        let size = self.size();
        let cones = &mut self.cones;
        // Orthonormal null vectors in the metric of the weights, by unknown.
        cones.roots.clear();
        cones.roots.extend(self.weights.iter().map(|w| w.sqrt()));
        cones.Q.clear();
        cones.Q.resize(n_open * n, 0.0);
        for (f, &open) in self.open.iter().enumerate() {
            let (before, own) = cones.Q.split_at_mut(f * n);
            for (y, pivot) in self.Y[f * rank..][..rank].iter().zip(&self.pivots) {
                own[*pivot] = -cones.roots[*pivot] * y;
            }
            own[open] = cones.roots[open];
            for g in 0..f {
                let factor = self.gram[f * n_open + g];
                for (x, y) in own[..n].iter_mut().zip(&before[g * n..]) {
                    *x -= factor * y;
                }
            }
            let inverse = 1.0 / self.gram[f * (n_open + 1)];
            own[..n].iter_mut().for_each(|x| *x *= inverse);
        }
        let found = cones.minimise(&self.touching, (d, n, n_open), size, &mut self.y);
        if !found {
            // The cones leave no room: as far from the answer as they allow.
            self.go_as_far_as_they_allow(d);
        }
    }

    /// Goes from the answer towards the impulses found as far as the cones allow.
    fn go_as_far_as_they_allow(&mut self, d: usize) {
        const HALVINGS: usize = 40;
        let end = &mut self.t;
        end.clear();
        end.extend_from_slice(&self.y);
        let (mut inside, mut outside) = (0.0, 1.0);
        for step in 0..=HALVINGS {
            let share = if step == 0 {
                1.0
            } else {
                0.5 * (inside + outside)
            };
            for ((y, start), end) in self.y.iter_mut().zip(&self.start).zip(&self.t) {
                *y = start + share * (end - start);
            }
            if self.is_within(d) {
                inside = share;
                if step == 0 {
                    return;
                }
            } else {
                outside = share;
            }
        }
        for ((y, start), end) in self.y.iter_mut().zip(&self.start).zip(&self.t) {
            *y = start + inside * (end - start);
        }
    }
}

impl AdmissibleImpulse {
    /// The direction of the impulse if there is one unknown.
    #[inline(always)]
    fn direction(self) -> Option<[f64; 3]> {
        match self {
            Self::Rests => None,
            Self::Slides(c) => Some(c),
            Self::Rubs(_) => Some([0.0, 1.0, 0.0]),
        }
    }
}

impl Touching {
    /// How far impulses are outside what the contact may bear, N s.
    #[inline(always)]
    fn excess(&self, d: usize, y: &[f64]) -> f64 {
        match self.kind {
            AdmissibleImpulse::Rests => {
                let square: f64 = y[1..d].iter().map(|y| y * y).sum();
                (square.sqrt() - self.mu * y[0]).max(-y[0])
            }
            AdmissibleImpulse::Slides(_) => -y[0],
            AdmissibleImpulse::Rubs(most) => y[0].abs() - most,
        }
    }
}

/// Whether contacts slide, but no faster than a tenth of the speed that the largest impulse stops,
/// and none parts.
#[inline(always)]
fn creep<B: Fn(usize, usize) -> [f64; 9]>(
    answered: &Answered<'_, B>,
    contacts: impl Iterator<Item = usize>,
    p: &[f64],
) -> bool {
    const SLOW: f64 = 0.1;
    let Answered { d, u, still, .. } = *answered;
    let (mut fastest, mut parts, mut stopped) = (0.0_f64, false, 0.0_f64);
    for i in contacts {
        let own = &u[d * i..][..d];
        parts |= own[0] > still;
        fastest = fastest.max(own[1..].iter().map(|u| u * u).sum::<f64>().sqrt());
        stopped = stopped.max((answered.block)(i, i)[0] * p[d * i]);
    }
    !parts && fastest > still && fastest < SLOW * stopped
}

/// A slide that the impulse and the slip name: both point the same way.
#[inline(always)]
fn slide(mu: f64, block: &[f64; 9], p: &[f64], u: &[f64]) -> AdmissibleImpulse {
    let rho = 2.0 / (block[4] + block[8]);
    let mut c = [0.0; 3];
    for k in 1..p.len() {
        c[k] = if rho.is_finite() {
            p[k] - rho * u[k]
        } else {
            -u[k]
        };
    }
    let norm = (c[1] * c[1] + c[2] * c[2]).sqrt();
    let length = (1.0 + mu * mu).sqrt();
    if norm == 0.0 {
        return AdmissibleImpulse::Slides([1.0, 0.0, 0.0]);
    }
    let along = mu / (norm * length);
    AdmissibleImpulse::Slides([1.0 / length, c[1] * along, c[2] * along])
}

/// Whether the block of a contact may be that of a joint's stop or dry friction, whose entries on
/// the diagonal are equal and have nothing beside them.
#[inline(always)]
#[allow(clippy::float_cmp)] // a joint's block has equal entries to the bit
fn is_alone(w: &[f64; 9]) -> bool {
    w[0] == w[4] && w[4] == w[8] && [1, 2, 5].iter().all(|k| w[*k] == 0.0)
}

#[inline(always)]
fn dot3(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Blocks of the symmetric part of a dense W (n, n) in dimension d.
fn blocks(W: &[f64], n: usize, d: usize) -> impl Fn(usize, usize) -> [f64; 9] {
    move |i, j| {
        let mut block = [0.0; 9];
        for r in 0..d {
            for c in 0..d {
                let (a, b) = (d * i + r, d * j + c);
                block[3 * r + c] = 0.5 * (W[a * n + b] + W[b * n + a]);
            }
        }
        block
    }
}

/// Groups of contacts that W couples: the group of each, named by its first contact.
fn find_groups(W: &[f64], n: usize, d: usize, groups: &mut Vec<usize>) {
    groups.clear();
    groups.extend(0..n / d);
    for i in 0..n / d {
        for j in 0..i {
            let mut rows = d * i..d * (i + 1);
            let is_coupled = rows.any(|a| W[a * n + d * j..][..d].iter().any(|w| *w != 0.0));
            let (a, b) = (groups[i], groups[j]);
            if is_coupled && a != b {
                let (first, other) = (a.min(b), a.max(b));
                for group in &mut groups[..=i] {
                    if *group == other {
                        *group = first;
                    }
                }
            }
        }
    }
}

impl Redundancy {
    /// Replaces the impulses of a converged answer with velocities `u` and a relative residual by
    /// the least ones, group by group of contacts that W couples, each of at most 32.
    ///
    /// `tolerance`: the residual that is asked for. Returns the residual if something has changed;
    /// `u` is then that of the new impulses. What would violate the law by more stays.
    pub fn settle_problem(
        &mut self,
        problem: &FrictionContactProblem<'_>,
        (tolerance, residual): (f64, f64),
        p: &mut [f64],
        u: &mut [f64],
    ) -> Option<Residual> {
        let Operator::Dense(W) = problem.operator() else {
            return None;
        };
        let (n, d) = (problem.n_unknowns(), problem.dimension().components());
        let mut groups = std::mem::take(&mut self.groups);
        let [mut start, mut velocities] = std::mem::take(&mut self.kept);
        find_groups(W, n, d, &mut groups);
        start.clear();
        start.extend_from_slice(p);
        velocities.clear();
        velocities.extend_from_slice(u);
        let answered = Answered {
            d,
            block: blocks(W, n, d),
            mu: problem.friction_coefficients(),
            u: &velocities,
            still: tolerance * norm(problem.free_velocity()),
        };
        let mut is_changed = false;
        for group in 0..groups.len() {
            let members = (group..groups.len()).filter(|i| groups[*i] == group);
            if (1..=MOST_SETTLED).contains(&members.clone().count()) {
                is_changed |= self.settle(&answered, members, p) != Settled::Unchanged;
            }
        }
        let mut found = None;
        if is_changed {
            let after = evaluate_into(problem, p, u);
            if after.is_finite() && after.relative <= 2.0 * residual.max(tolerance) {
                found = Some(after);
            } else {
                p.copy_from_slice(&start);
                u.copy_from_slice(&velocities);
            }
        }
        (self.groups, self.kept) = (groups, [start, velocities]);
        found
    }
}

/// Number of contacts whose impulses the motion leaves open, friction included: those of which some
/// impulses balance one another. Contacts that part bear none, those that slide bear one along a
/// given direction.
///
/// 0 means that the motion determines all impulses. Otherwise they are those of least norm, see
/// `docs/contact-problems.md`. A rover that drives straight on six rigid wheels has 6, since the
/// wheels may push sideways against each other.
///
/// `p`: the answer to the problem, N s; `tolerance`: its relative residual. Without a dense W the
/// number is 0.
#[must_use]
pub fn undetermined_loads(
    problem: &FrictionContactProblem<'_>,
    tolerance: f64,
    p: &[f64],
) -> usize {
    let Operator::Dense(W) = problem.operator() else {
        return 0;
    };
    let (n, d) = (problem.n_unknowns(), problem.dimension().components());
    let (mut groups, mut u) = (Vec::new(), vec![0.0; n]);
    find_groups(W, n, d, &mut groups);
    (problem.operator()).multiply_add(p, problem.free_velocity(), &mut u);
    let answered = Answered {
        d,
        block: blocks(W, n, d),
        mu: problem.friction_coefficients(),
        u: &u,
        still: tolerance * norm(problem.free_velocity()),
    };
    let mut redundancy = Redundancy::default();
    let mut count = |own: usize| {
        let members = (own..groups.len()).filter(|i| groups[*i] == own);
        redundancy.count(&answered, members, p)
    };
    (0..groups.len()).map(&mut count).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Dimension;

    const MU: f64 = 0.7;

    /// Corners of a box below its centre, and two more places between them.
    const PLACES: [[f64; 3]; 6] = [
        [0.5, -0.3, 0.4],
        [0.5, -0.3, -0.4],
        [-0.5, -0.3, 0.4],
        [-0.5, -0.3, -0.4],
        [0.2, -0.3, 0.1],
        [-0.5, -0.3, 0.0],
    ];

    /// Rows of `Hᵀ M^(-1/2)` of a body with a mass of 2 kg, n upwards.
    fn rows(places: &[[f64; 3]]) -> Vec<[f64; 6]> {
        let inertia = [0.1, 0.2, 0.15];
        let row = |x: &[f64; 3], e: [f64; 3]| {
            let turn = [
                x[1] * e[2] - x[2] * e[1],
                x[2] * e[0] - x[0] * e[2],
                x[0] * e[1] - x[1] * e[0],
            ];
            let scaled = |k: usize| turn[k] / f64::sqrt(inertia[k]);
            let push = e.map(|e| e / 2.0_f64.sqrt());
            [push[0], push[1], push[2], scaled(0), scaled(1), scaled(2)]
        };
        let frame = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        (places.iter())
            .flat_map(|x| frame.map(|e| row(x, e)))
            .collect()
    }

    fn product(rows: &[[f64; 6]]) -> Vec<f64> {
        let dot = |a: &[f64; 6], b: &[f64; 6]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        rows.iter()
            .flat_map(|a| rows.iter().map(move |b| dot(a, b)))
            .collect()
    }

    /// Settled impulses of the body at rest on a slope of `share`, from impulses with a squeeze.
    fn settled(places: &[[f64; 3]], share: f64, squeeze: f64) -> Vec<f64> {
        let rows = rows(places);
        let W = product(&rows);
        let n = rows.len();
        // Weights of the corners by hand: the first four carry all of it.
        let mut p = vec![0.0; n];
        for k in 0..4 {
            let along = share * 0.025;
            p[3 * k] = 0.025 + 0.5 * 0.3 * share * 0.1 * places[k][0].signum();
            p[3 * k + 1] = -along;
        }
        p[2] += squeeze;
        p[5] -= squeeze;
        let mut q = vec![0.0; n];
        for i in 0..n {
            q[i] = -(0..n).map(|j| W[i * n + j] * p[j]).sum::<f64>();
        }
        let mu = vec![MU; n / 3];
        let problem = FrictionContactProblem::from_assembled(Dimension::Three, &W, &q, &mu);
        let mut u = vec![0.0; n];
        problem.operator().multiply_add(&p, &q, &mut u);
        assert_eq!(undetermined_loads(&problem, 1e-12, &p), n / 3);
        let mut redundancy = Redundancy::default();
        let found = redundancy.settle_problem(&problem, (1e-12, 0.0), &mut p, &mut u);
        assert!(found.is_some() && norm(&u) < 1e-14, "{u:?}");
        p
    }

    #[test]
    fn corners_share_the_weight_of_a_box_like_equal_springs() {
        for squeeze in [0.0, 0.01, -0.005] {
            let p = settled(&PLACES[..4], 0.0, squeeze);
            for own in p.chunks_exact(3) {
                assert!((own[0] - 0.025).abs() < 1e-15, "{p:?}");
                assert!(own[1].abs().max(own[2].abs()) < 1e-15, "{p:?}");
            }
        }
    }

    #[test]
    fn the_least_impulses_stay_within_the_cones_and_do_not_depend_on_the_start_or_the_order() {
        for share in [0.3, 0.55, 0.6, 0.69, 0.6999] {
            let p = settled(&PLACES, share, 0.0);
            let largest = p.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let mut tightest = f64::INFINITY;
            for own in p.chunks_exact(3) {
                let room = MU * own[0] - own[1].hypot(own[2]);
                tightest = tightest.min(room);
                assert!(room > -1e-12 * largest, "{share}: {p:?}");
            }
            assert_eq!(
                tightest < 1e-12 * largest,
                share > 0.5,
                "{share}: {tightest}"
            );
            let again = settled(&PLACES, share, 1e-3);
            let mut order = PLACES;
            order.swap(0, 1);
            order.swap(2, 3);
            let mirrored = settled(&order, share, 0.0);
            for i in 0..6 {
                let other = [1, 0, 3, 2, 4, 5][i];
                for k in 0..3 {
                    let own = p[3 * i + k];
                    assert!((again[3 * i + k] - own).abs() < 1e-12 * largest, "{share}");
                    assert!(
                        (mirrored[3 * other + k] - own).abs() < 1e-12 * largest,
                        "{share}"
                    );
                }
            }
        }
    }

    #[test]
    fn no_impulses_in_the_cones_with_the_same_motion_are_less() {
        let p = settled(&PLACES, 0.65, 0.0);
        // A minimum over a convex set: no other point of it lies nearer to zero than its plane.
        for squeeze in [1e-3, -1e-3] {
            let mut other = p.clone();
            let scale = 1e-4;
            other[2] += scale * squeeze;
            other[5] -= scale * squeeze;
            let inside =
                |p: &[f64]| (p.chunks_exact(3)).all(|own| MU * own[0] >= own[1].hypot(own[2]));
            assert!(!inside(&other) || norm(&other) >= norm(&p) - 1e-15);
        }
    }

    #[test]
    fn supports_that_yield_are_determined() {
        let rows = rows(&PLACES[..4]);
        let mut W = product(&rows);
        for i in 0..12 {
            W[13 * i] += 1e-3;
        }
        let p = [[0.025, 0.0, 0.0]; 4].as_flattened().to_vec();
        let q: Vec<f64> = (W.chunks_exact(12))
            .map(|row| -row.iter().zip(&p).map(|(w, p)| w * p).sum::<f64>())
            .collect();
        let problem = FrictionContactProblem::from_assembled(Dimension::Three, &W, &q, &[MU; 4]);
        assert_eq!(undetermined_loads(&problem, 1e-12, &p), 0);
    }

    #[test]
    fn a_sliding_box_has_only_its_loads_open() {
        let rows = rows(&PLACES[..4]);
        let W = product(&rows);
        let p = [[0.03, -MU * 0.03, 0.0], [0.02, -MU * 0.02, 0.0]];
        let p = [p[0], p[1], p[1], p[0]].as_flattened().to_vec();
        let mut q: Vec<f64> = (W.chunks_exact(12))
            .map(|row| -row.iter().zip(&p).map(|(w, p)| w * p).sum::<f64>())
            .collect();
        for q in q.chunks_exact_mut(3) {
            q[1] += 0.5;
        }
        let problem = FrictionContactProblem::from_assembled(Dimension::Three, &W, &q, &[MU; 4]);
        assert_eq!(undetermined_loads(&problem, 1e-12, &p), 4);
        let (mut own, mut u) = (p.clone(), vec![0.0; 12]);
        problem.operator().multiply_add(&p, &q, &mut u);
        let found = Redundancy::default().settle_problem(&problem, (1e-12, 0.0), &mut own, &mut u);
        assert!(found.is_some());
        for own in own.chunks_exact(3) {
            assert!((own[0] - 0.025).abs() < 1e-15, "{own:?}");
            assert!((own[1] + MU * own[0]).abs() < 1e-15, "{own:?}");
        }
    }

    #[test]
    fn nothing_that_bears_no_load_is_open() {
        let problem = FrictionContactProblem::from_assembled(Dimension::Three, &[], &[], &[]);
        assert_eq!(undetermined_loads(&problem, 1e-12, &[]), 0);
    }
}
