//! The linear system of a Newton step in the velocities of a machine.
//!
//! Where a machine has more contacts than its velocities can tell apart, `W = Zᵀ Z + D` is a large
//! matrix of small rank: six cylinders on a plane have twelve contacts, 36 impulses and 21
//! velocities. With the modes' columns `C_i` and rows `B_i` ([`super::modes`]) the equations
//!
//! ```text
//! Bᵀ (Zᵀ Z + D + α I) C y + γ y = r
//! ```
//!
//! are those of [`super::equations`]. `Bᵀ (D + α I) C + γ` is diagonal; with its inverse G (zero
//! for unknowns that a mode eliminates) and the machine's change of velocity `w = Z C y`
//!
//! ```text
//! (1 + Σ_i Z_i K_i Z_iᵀ) w = Z C G r,   K_i = C_i G_i B_iᵀ,   y = G (r − Bᵀ Zᵀ w)
//! ```
//!
//! The matrix has the [pattern](super::pattern) of the machine's tree, so that its factors have no
//! more entries than itself. Its condition is that of `1/α`, and the answer's error a few times
//! `ε/α`, about as large as what α leaves; a [correction](System::correction) with the same factors
//! removes both.

use std::sync::Arc;

use super::equations::{Block, across, impulse};
use super::modes::Mode;
use super::pattern::Pattern;
use super::problem::{ContactProblem, Triple};
use super::system::System;
use crate::scalar::{Lane, MAX_LANES};

/// Factored operators of several problems of one machine; a contact's place is its slot.
#[derive(Clone, Debug)]
pub(super) struct VelocitySystem<T: Lane, const C: usize> {
    zero: T,
    pattern: Option<Arc<Pattern>>,
    /// Slots of each lane, and of any.
    slots: [u32; MAX_LANES],
    used: u32,
    /// `Z[slot * stride + k]` along the path of a slot; zero in lanes without a contact there.
    Z: Vec<Triple<T>>,
    /// Diagonal blocks of W, and the diagonal of D, 1/kg.
    diagonal: [Block<T>; C],
    softness: [T; C],
    /// `G_i`.
    inverse: [Triple<T>; C],
    /// `K_i Z_iᵀ` of a contact.
    turned: Vec<Triple<T>>,
    /// Entries left of the diagonal, above it, and the diagonal; once factored, rows divided by
    /// the pivots, columns, and the inverse pivots.
    rows: Vec<T>,
    columns: Vec<T>,
    pivots: Vec<T>,
    w: Vec<T>,
}

/// The bits of a number, ascending.
#[derive(Clone, Debug)]
pub(super) struct Bits(u32);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let k = self.0.trailing_zeros() as usize;
        self.0 &= self.0 - 1;
        Some(k)
    }
}

impl<T: Lane, const C: usize> VelocitySystem<T, C> {
    /// Makes room for the problems of a machine.
    #[cold]
    fn adopt(&mut self, pattern: &Arc<Pattern>) {
        let zero = self.zero;
        (self.slots, self.used) = ([0; MAX_LANES], 0);
        let room = |own: &mut Vec<T>, n: usize| {
            own.clear();
            own.resize(n, zero);
        };
        room(&mut self.rows, pattern.n_entries());
        room(&mut self.columns, pattern.n_entries());
        room(&mut self.pivots, pattern.nv());
        room(&mut self.w, pattern.nv());
        self.Z.clear();
        self.Z.resize(C * pattern.stride(), [zero; 3]);
        self.turned.resize(pattern.stride(), [zero; 3]);
        self.pattern = Some(Arc::clone(pattern));
    }

    /// The pattern of the problems, and all that is laid out by it.
    #[inline(always)]
    fn split(&mut self) -> (&Pattern, Parts<'_, T>) {
        let Some(pattern) = self.pattern.as_deref() else {
            unreachable!("invariant: a system with contacts has a pattern")
        };
        let parts = Parts {
            Z: &self.Z,
            turned: &mut self.turned,
            rows: &mut self.rows,
            columns: &mut self.columns,
            pivots: &mut self.pivots,
            w: &mut self.w,
        };
        (pattern, parts)
    }
}

/// What is laid out by a pattern.
struct Parts<'a, T> {
    Z: &'a [Triple<T>],
    turned: &'a mut [Triple<T>],
    rows: &'a mut [T],
    columns: &'a mut [T],
    pivots: &'a mut [T],
    w: &'a mut [T],
}

impl<T: Lane> Parts<'_, T> {
    /// `Z` of a slot.
    #[inline(always)]
    fn of(&self, pattern: &Pattern, slot: usize) -> &[Triple<T>] {
        &self.Z[slot * pattern.stride()..][..pattern.path(slot).len()]
    }

    /// `w += Z_i p`.
    #[inline(always)]
    fn push(&mut self, pattern: &Pattern, slot: usize, p: &Triple<T>) {
        let Z = &self.Z[slot * pattern.stride()..];
        for (&k, z) in pattern.path(slot).iter().zip(Z) {
            self.w[k] += dot(z, p);
        }
    }

    /// `Z_iᵀ w`.
    #[inline(always)]
    fn local(&self, pattern: &Pattern, slot: usize) -> Triple<T> {
        let mut sum = [self.w[0].like(0.0); 3];
        for (&k, z) in pattern.path(slot).iter().zip(self.of(pattern, slot)) {
            for i in 0..3 {
                sum[i] += z[i] * self.w[k];
            }
        }
        sum
    }

    /// The matrix without contacts.
    #[inline(always)]
    fn clear(&mut self, zero: T) {
        self.rows.fill(zero);
        self.columns.fill(zero);
        self.pivots.fill(zero.like(1.0));
    }

    /// Adds `Z K Zᵀ` of a contact.
    #[inline(always)]
    fn add(&mut self, pattern: &Pattern, slot: usize, mode: &Mode<T>, inverse: &Triple<T>) {
        let path = pattern.path(slot);
        let Z = &self.Z[slot * pattern.stride()..][..path.len()];
        let turned = &mut self.turned[..path.len()];
        let ([a0, a1], [b0, b1], [g0, g1, g2]) = (mode.a, mode.b, *inverse);
        let (k00, k01, k11) = (b0 * b0 * g1, b0 * b1 * g1, b1 * b1 * g1 + g2);
        for (y, z) in turned.iter_mut().zip(Z) {
            let normal = g0 * z[0];
            *y = [
                normal,
                a0 * normal + k00 * z[1] + k01 * z[2],
                a1 * normal + k01 * z[1] + k11 * z[2],
            ];
        }
        for (i, (&k, z)) in path.iter().zip(Z).enumerate() {
            let y = turned[i];
            let row = pattern.row(k);
            let rows = &mut self.rows[row.clone()][..i];
            let columns = &mut self.columns[row][..i];
            for (j, (row, column)) in rows.iter_mut().zip(columns).enumerate() {
                *row += dot(z, &turned[j]);
                *column += dot(&Z[j], &y);
            }
            self.pivots[k] += dot(z, &y);
        }
    }

    /// Factors the matrix from the leaves to the root.
    #[inline(always)]
    fn factorise(&mut self, pattern: &Pattern) {
        for k in (0..pattern.nv()).rev() {
            let inverse = self.pivots[k].like(1.0) / self.pivots[k];
            self.pivots[k] = inverse;
            let (ancestors, first) = (pattern.ancestors(k), pattern.row(k).start);
            for (i, &a) in ancestors.iter().enumerate() {
                // Those of an ancestor come before its descendants'.
                let own = pattern.row(a);
                let (before, here) = self.rows.split_at_mut(first);
                let (columns_before, columns) = self.columns.split_at_mut(first);
                let row = here[i] * inverse;
                let column = columns[i];
                here[i] = row;
                let rows_of = &mut before[own.clone()][..i];
                let columns_of = &mut columns_before[own][..i];
                for (j, (entry, other)) in rows_of.iter_mut().zip(columns_of).enumerate() {
                    *entry -= column * here[j];
                    *other -= columns[j] * row;
                }
                self.pivots[a] -= column * row;
            }
        }
    }

    /// Solves the factored system, in place of its right-hand side `w`.
    #[inline(always)]
    fn solve(&mut self, pattern: &Pattern) {
        let n = pattern.nv();
        for k in (0..n).rev() {
            let own = self.w[k] * self.pivots[k];
            self.w[k] = own;
            let columns = &self.columns[pattern.row(k)];
            for (&a, column) in pattern.ancestors(k).iter().zip(columns) {
                self.w[a] -= *column * own;
            }
        }
        for k in 0..n {
            let mut own = self.w[k];
            let rows = &self.rows[pattern.row(k)];
            for (&a, row) in pattern.ancestors(k).iter().zip(rows) {
                own -= *row * self.w[a];
            }
            self.w[k] = own;
        }
    }
}

#[inline(always)]
fn dot<T: Lane>(a: &Triple<T>, b: &Triple<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `G y` of a contact.
#[inline(always)]
fn scaled<T: Lane>(g: &Triple<T>, y: &Triple<T>) -> Triple<T> {
    [g[0] * y[0], g[1] * y[1], g[2] * y[2]]
}

impl<T: Lane, const C: usize> VelocitySystem<T, C> {
    /// The impulses, in place of the right-hand sides `r` of the contacts.
    #[inline(always)]
    fn solve(&mut self, modes: &[Mode<T>; C], r: &mut [Triple<T>; C]) {
        let (used, zero, inverse) = (self.used, self.zero, self.inverse);
        let (pattern, mut parts) = self.split();
        parts.w.fill(zero);
        for i in Bits(used) {
            let p = impulse(&modes[i], scaled(&inverse[i], &r[i]));
            parts.push(pattern, i, &p);
        }
        parts.solve(pattern);
        for i in Bits(used) {
            let taken = across(&modes[i], parts.local(pattern, i));
            let [r0, r1, r2] = r[i];
            let rest = [r0 - taken[0], r1 - taken[1], r2 - taken[2]];
            r[i] = impulse(&modes[i], scaled(&inverse[i], &rest));
        }
    }
}

impl<T: Lane, const C: usize> System<T, C> for VelocitySystem<T, C> {
    type Places = Bits;

    const ALPHA: f64 = 1e-4;
    const PARKED_ALPHA: f64 = 1e-4;
    const SMALLEST_ALPHA: f64 = 1e-6;
    const RETURNS: bool = true;
    const CORRECTIONS: usize = 3;

    fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            zero,
            pattern: None,
            slots: [0; MAX_LANES],
            used: 0,
            Z: Vec::new(),
            diagonal: [[zero; 9]; C],
            softness: [zero; C],
            inverse: [[zero; 3]; C],
            turned: Vec::new(),
            rows: Vec::new(),
            columns: Vec::new(),
            pivots: Vec::new(),
            w: Vec::new(),
        }
    }

    #[inline(always)]
    fn load(&mut self, lane: usize, problem: &ContactProblem) -> Bits {
        let factored = &problem.factored;
        let Some(pattern) = &factored.pattern else {
            unreachable!("invariant: a factored problem has a pattern")
        };
        if !(self.pattern.as_ref()).is_some_and(|own| Arc::ptr_eq(own, pattern)) {
            self.adopt(pattern);
        }
        let changed = self.slots[lane] | factored.slots;
        self.slots[lane] = factored.slots;
        self.used = self.slots.iter().fold(0, |all, own| all | own);
        let stride = pattern.stride();
        for slot in Bits(changed) {
            let own = &mut self.Z[slot * stride..][..pattern.path(slot).len()];
            if let Some(contact) = Self::contact_at(problem, slot) {
                for (own, z) in own.iter_mut().zip(&factored.Z[contact * stride..]) {
                    for k in 0..3 {
                        own[k].set(lane, z[k]);
                    }
                }
                for (own, w) in (self.diagonal[slot].iter_mut()).zip(factored.diagonal[contact]) {
                    own.set(lane, w);
                }
                self.softness[slot].set(lane, factored.softness[contact]);
            } else {
                for own in own.iter_mut().flatten() {
                    own.set(lane, 0.0);
                }
                for own in &mut self.diagonal[slot] {
                    own.set(lane, 0.0);
                }
                self.softness[slot].set(lane, 0.0);
            }
        }
        Bits(changed)
    }

    #[inline(always)]
    fn contact_at(problem: &ContactProblem, place: usize) -> Option<usize> {
        problem.factored.contact_at(place)
    }

    #[inline(always)]
    fn last_of(problem: &ContactProblem, contact: usize) -> Triple<f64> {
        problem.factored.last[contact]
    }

    #[inline(always)]
    fn block_of(problem: &ContactProblem, contact: usize) -> &[f64; 9] {
        &problem.factored.diagonal[contact]
    }

    #[inline(always)]
    fn places(&self) -> Bits {
        Bits(self.used)
    }

    #[inline(always)]
    fn diagonal(&self, place: usize) -> &Block<T> {
        &self.diagonal[place]
    }

    #[inline(always)]
    fn velocities(&mut self, q: &[Triple<T>; C], p: &[Triple<T>; C], u: &mut [Triple<T>; C]) {
        let (used, zero, softness) = (self.used, self.zero, self.softness);
        let (pattern, mut parts) = self.split();
        parts.w.fill(zero);
        for i in Bits(used) {
            parts.push(pattern, i, &p[i]);
        }
        for i in Bits(used) {
            let local = parts.local(pattern, i);
            for k in 0..3 {
                u[i][k] = local[k] + softness[i] * p[i][k] + q[i][k];
            }
        }
    }

    #[inline(always)]
    fn factorise(&mut self, alpha: T, modes: &[Mode<T>; C]) {
        let (used, zero) = (self.used, self.zero);
        let one = zero.like(1.0);
        for i in Bits(used) {
            let Mode {
                b,
                closed,
                stick,
                gamma,
                ..
            } = &modes[i];
            let own = alpha + self.softness[i];
            let inverse = one / own;
            self.inverse[i] = [
                T::select(*closed, inverse, zero),
                one / ((b[0] * b[0] + b[1] * b[1]) * own + *gamma),
                T::select(*stick, inverse, zero),
            ];
        }
        let inverse = self.inverse;
        let (pattern, mut parts) = self.split();
        parts.clear(zero);
        for i in Bits(used) {
            parts.add(pattern, i, &modes[i], &inverse[i]);
        }
        parts.factorise(pattern);
    }

    #[inline(always)]
    fn newton_point(
        &mut self,
        q: &[Triple<T>; C],
        centre: &[Triple<T>; C],
        alpha: T,
        modes: &[Mode<T>; C],
        y: &mut [Triple<T>; C],
    ) {
        for i in Bits(self.used) {
            let (c, q) = (&centre[i], &q[i]);
            let rest = [
                alpha * c[0] - q[0],
                alpha * c[1] - q[1],
                alpha * c[2] - q[2],
            ];
            y[i] = across(&modes[i], rest);
        }
        self.solve(modes, y);
    }

    #[inline(always)]
    fn correction(&mut self, u: &[Triple<T>; C], modes: &[Mode<T>; C], y: &mut [Triple<T>; C]) {
        for i in Bits(self.used) {
            let [u0, u1, u2] = u[i];
            y[i] = across(&modes[i], [-u0, -u1, -u2]);
        }
        self.solve(modes, y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::equations::DenseSystem;
    use crate::lanes::machine::Machine;
    use crate::lanes::problem::{MAX_CONTACTS, MAX_DENSE, block};
    use crate::multibody::{Model, ModelDescription};
    use crate::scalar::Single;
    use proptest::prelude::*;

    fn pattern() -> Arc<Pattern> {
        let mut description = ModelDescription::rover();
        for wheel in &mut description.wheels {
            wheel.width = Some(0.1);
        }
        let model = Model::from_description(description).unwrap();
        Machine::of(&model).unwrap().pattern.unwrap()
    }

    /// A problem of the first slots of the rover with both forms of its operator.
    fn problem(pattern: &Arc<Pattern>, numbers: &mut impl Iterator<Item = f64>) -> ContactProblem {
        let mut problem = ContactProblem {
            n_contacts: MAX_DENSE,
            ..ContactProblem::default()
        };
        problem.factored.adopt(pattern);
        problem.factored.slots = (1 << MAX_DENSE) - 1;
        for (z, x) in problem.factored.Z.iter_mut().flatten().zip(numbers) {
            *z = x;
        }
        let row = |Z: &[Triple<f64>], i: usize| -> Vec<Triple<f64>> {
            Z[i * pattern.stride()..][..pattern.stride()].to_vec()
        };
        for i in 0..MAX_DENSE {
            problem.factored.softness[i] = 0.01 * i as f64;
            for j in 0..=i {
                let shared = pattern.shared(i, j);
                let (a, b) = (row(&problem.factored.Z, i), row(&problem.factored.Z, j));
                for k in 0..9 {
                    let products = a.iter().zip(&b).take(shared);
                    let mut w: f64 = products.map(|(x, y)| x[k / 3] * y[k % 3]).sum();
                    if i == j && k % 4 == 0 {
                        w += problem.factored.softness[i];
                    }
                    problem.W[block(i, j)][k] = w;
                    if i == j {
                        problem.factored.diagonal[i][k] = w;
                    }
                }
            }
        }
        problem
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn systems_in_velocities_have_the_answers_of_those_in_impulses(
            numbers in prop::collection::vec(-1.0..1.0_f64, 600), modes in prop::collection::vec(0..3, MAX_DENSE),
        ) {
            let token = Single::best();
            let pattern = pattern();
            let problem = problem(&pattern, &mut numbers.iter().copied());
            let mut dense = DenseSystem::<f64, MAX_DENSE>::new(token);
            let mut own = VelocitySystem::<f64, MAX_CONTACTS>::new(token);
            dense.load(0, &problem);
            prop_assert_eq!(own.load(0, &problem).count(), MAX_DENSE);
            let mut few = [[[0.0; 3]; MAX_DENSE]; 4];
            let mut many = [[[0.0; 3]; MAX_CONTACTS]; 4];
            let mut of_few = [Mode::open(0.0); MAX_DENSE];
            let mut of_many = [Mode::open(0.0); MAX_CONTACTS];
            let mut more = numbers.iter().rev();
            for i in 0..MAX_DENSE {
                for (few, many) in few.iter_mut().zip(&mut many) {
                    for k in 0..3 {
                        few[i][k] = *more.next().unwrap();
                        many[i][k] = few[i][k];
                    }
                }
                // Friction that opposes the slip, so that its direction turns.
                let (p, u) = (&few[0][i], [0.0, -few[0][i][1], -few[0][i][2]]);
                of_few[i] = Mode::of(0.3, modes[i] > 0, modes[i] == 1, p, &u);
                of_many[i] = of_few[i];
            }
            let close = |few: &[Triple<f64>; MAX_DENSE], many: &[Triple<f64>; MAX_CONTACTS]| {
                let scale = few.iter().flatten().fold(1.0, |most: f64, x| most.max(x.abs()));
                few.iter().flatten().zip(many.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-7 * scale)
            };
            let [p, q, centre, _] = few;
            let [p_many, q_many, centre_many, _] = many;
            dense.velocities(&q, &p, &mut few[3]);
            own.velocities(&q_many, &p_many, &mut many[3]);
            prop_assert!(close(&few[3], &many[3]));
            dense.factorise(0.1, &of_few);
            own.factorise(0.1, &of_many);
            dense.newton_point(&q, &centre, 0.1, &of_few, &mut few[3]);
            own.newton_point(&q_many, &centre_many, 0.1, &of_many, &mut many[3]);
            prop_assume!(few[3].iter().flatten().all(|x| x.abs() < 1e3));
            prop_assert!(close(&few[3], &many[3]), "{:?} {:?}", few[3], &many[3][..MAX_DENSE]);
            dense.correction(&q, &of_few, &mut few[3]);
            own.correction(&q_many, &of_many, &mut many[3]);
            prop_assume!(few[3].iter().flatten().all(|x| x.abs() < 1e3));
            prop_assert!(close(&few[3], &many[3]));
        }
    }
}
