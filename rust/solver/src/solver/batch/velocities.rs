//! The linear system of a Newton step in the velocities of a machine.
//!
//! Where a machine has more contacts than its velocities can tell apart, `W = Zᵀ Z + D` is a large
//! matrix of small rank: six cylinders on a plane have twelve contacts, 36 impulses and 21
//! velocities. With the modes' columns `C_i` and rows `B_i` ([`Mode`]) the equations
//!
//! ```text
//! Bᵀ (Zᵀ Z + D + α I) C y + γ y = r
//! ```
//!
//! are those of [`super::blocks`]. `Bᵀ (D + α I) C + γ` is diagonal; with its inverse G (zero
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

use super::blocks::ContactBlock;
use super::loaded::{Loaded, solve_one};
use super::pattern::BASE;
use super::pattern::Pattern;
use super::problem::ContactProblem;
use super::tree_matrix::{Base, JacobianColumns, TreeMatrix, product};
use crate::law::mode::{ContactMode, Mode};
use crate::scalar::{Lane, LaneMask, MAX_LANES};
use crate::solver::pivoting::{Few, System, Triple};

/// Factored operators of several problems with the same pattern, that of the first; a contact's
/// place is its slot.
#[derive(Clone, Debug)]
pub(super) struct VelocitySystem<T: Lane, const C: usize> {
    zero: T,
    pattern: Option<Arc<Pattern>>,
    /// Slots of each lane, and of any.
    slots: [u32; MAX_LANES],
    used: u32,
    /// `Z` by slot; zero in lanes without a contact there.
    Z: Vec<JacobianColumns<T>>,
    q: [Triple<T>; C],
    /// Diagonal blocks of W, the diagonal of D, and what it has more along the normal, 1/kg.
    diagonal: [ContactBlock<T>; C],
    softness: [Triple<T>; C],
    normal: [T; C],
    /// `G_i`.
    inverse: [Triple<T>; C],
    /// Factors of `Z K Zᵀ` of a contact.
    left: JacobianColumns<T>,
    right: JacobianColumns<T>,
    matrix: TreeMatrix<T>,
    /// A motion of the machine.
    base: Base<T>,
    joints: Vec<T>,
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
    /// Makes room for the problems of a pattern.
    #[cold]
    fn adopt(&mut self, pattern: &Arc<Pattern>) {
        let zero = self.zero;
        let columns = JacobianColumns::new(zero, pattern.stride() - BASE);
        (self.left, self.right) = (columns.clone(), columns.clone());
        self.Z.resize(C, columns);
        self.joints.resize(pattern.n_joints(), zero);
        self.matrix.adopt(pattern, zero);
        self.pattern = Some(Arc::clone(pattern));
    }

    /// The pattern of the problems.
    #[inline(always)]
    fn pattern(pattern: Option<&Arc<Pattern>>) -> &Pattern {
        let Some(pattern) = pattern else {
            unreachable!("invariant: a system with contacts has a pattern")
        };
        pattern
    }

    /// No motion.
    #[inline(always)]
    fn rest(&mut self) {
        self.base = [self.zero; BASE];
        for k in 0..self.joints.len() {
            self.joints[k] = self.zero;
        }
    }

    /// Adds `Z_i p` to the motion.
    #[inline(always)]
    fn push(&mut self, i: usize, p: &Triple<T>) {
        let Z = &self.Z[i];
        let [n, t, b] = &Z.base;
        for k in 0..BASE {
            self.base[k] += n[k] * p[0] + t[k] * p[1] + b[k] * p[2];
        }
        let path = Self::pattern(self.pattern.as_ref()).joints(i);
        let Z = &Z.joints[..path.len()];
        for k in 0..path.len() {
            self.joints[path[k]] += dot(&Z[k], p);
        }
    }

    /// `Z_iᵀ w` of the motion w.
    #[inline(always)]
    fn local(&self, i: usize) -> Triple<T> {
        let Z = &self.Z[i];
        let [n, t, b] = &Z.base;
        let w = &self.base;
        let mut sum = [product(n, w), product(t, w), product(b, w)];
        let path = Self::pattern(self.pattern.as_ref()).joints(i);
        let Z = &Z.joints[..path.len()];
        for k in 0..path.len() {
            let w = self.joints[path[k]];
            for c in 0..3 {
                sum[c] += Z[k][c] * w;
            }
        }
        sum
    }

    /// Adds `Z K Zᵀ` of a contact to the matrix.
    #[inline(always)]
    fn add(&mut self, i: usize, mode: &Mode<T>) {
        if !mode.closed.any() {
            return;
        }
        let ([a0, a1], [b0, b1], [g0, g1, g2]) = (mode.a, mode.b, self.inverse[i]);
        let pattern = Self::pattern(self.pattern.as_ref());
        let (Z, left, right) = (&self.Z[i], &mut self.left, &mut self.right);
        let ([n, t, b], [y0, y1, y2], [x0, x1, x2]) = (&Z.base, &mut left.base, &mut right.base);
        for k in 0..BASE {
            y0[k] = n[k] + (a0 * t[k] + a1 * b[k]);
            x0[k] = g0 * n[k];
            y1[k] = b0 * t[k] + b1 * b[k];
            x1[k] = g1 * y1[k];
            y2[k] = b[k];
            x2[k] = g2 * b[k];
        }
        let m = pattern.joints(i).len();
        let Z = &Z.joints[..m];
        let (ys, xs) = (&mut left.joints[..m], &mut right.joints[..m]);
        for k in 0..m {
            let [n, t, b] = Z[k];
            let along = b0 * t + b1 * b;
            ys[k] = [n + (a0 * t + a1 * b), along, b];
            xs[k] = [g0 * n, g1 * along, g2 * b];
        }
        if mode.stick.any() {
            self.matrix.add::<true>(pattern, i, left, right);
        } else {
            self.matrix.add::<false>(pattern, i, left, right);
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

impl<T: Lane, const C: usize> System<T, Few<C>> for VelocitySystem<T, C> {
    type Places = Bits;

    const ALPHA: f64 = 1e-4;
    const PARKED_ALPHA: f64 = 1e-4;
    const SMALLEST_ALPHA: f64 = 1e-6;
    // Of 531 problems among rocks, where axles tilt by 1e-5, 117 resist with 1e-6, 70 with 1e-8, 63
    // with 1e-9 and 73 with 1e-11.
    const SMALLEST_ALPHA_AGAIN: f64 = 1e-9;
    const RETURNS: bool = true;
    // Six cylinders with torques of up to 60 N m: three corrections from 1e-6 on save a twentieth
    // of the systems and cost a sixth more instructions.
    const NEAR: f64 = 1e-14;
    const CORRECTIONS: usize = 2;

    #[inline(always)]
    fn places(&self) -> Bits {
        Bits(self.used)
    }

    #[inline(always)]
    fn free_velocity(&self, place: usize) -> Triple<T> {
        self.q[place]
    }

    #[inline(always)]
    fn velocities(&mut self, p: &[Triple<T>; C], u: &mut [Triple<T>; C]) {
        self.rest();
        for i in Bits(self.used) {
            self.push(i, &p[i]);
        }
        for i in Bits(self.used) {
            let local = self.local(i);
            let [n, t, b] = self.softness[i];
            let softness = [n + self.normal[i], t, b];
            for k in 0..3 {
                u[i][k] = local[k] + softness[k] * p[i][k] + self.q[i][k];
            }
        }
    }

    #[inline(always)]
    fn factorise(&mut self, alpha: T, modes: &[Mode<T>; C]) -> bool {
        let zero = self.zero;
        let one = zero.like(1.0);
        self.matrix.clear(zero);
        for i in Bits(self.used) {
            let Mode {
                b,
                closed,
                stick,
                gamma,
                ..
            } = &modes[i];
            let [along_n, along_t, _] = self.softness[i];
            let own = alpha + along_t;
            self.inverse[i] = [
                T::select(*closed, one / (alpha + along_n + self.normal[i]), zero),
                one / ((b[0] * b[0] + b[1] * b[1]) * own + *gamma),
                T::select(*stick, one / own, zero),
            ];
            self.add(i, &modes[i]);
        }
        let pattern = Self::pattern(self.pattern.as_ref());
        self.matrix.factorise(pattern);
        true
    }

    #[inline(always)]
    fn solve(&mut self, modes: &[Mode<T>; C], r: &mut [Triple<T>; C]) {
        for i in Bits(self.used) {
            r[i] = modes[i].across(r[i]);
        }
        self.rest();
        for i in Bits(self.used) {
            let p = modes[i].impulse(scaled(&self.inverse[i], &r[i]));
            self.push(i, &p);
        }
        let pattern = Self::pattern(self.pattern.as_ref());
        self.matrix.solve(pattern, &mut self.base, &mut self.joints);
        for i in Bits(self.used) {
            let taken = modes[i].across(self.local(i));
            let [r0, r1, r2] = r[i];
            let rest = [r0 - taken[0], r1 - taken[1], r2 - taken[2]];
            r[i] = modes[i].impulse(scaled(&self.inverse[i], &rest));
        }
    }

    #[inline(always)]
    fn solve_one(
        &self,
        place: usize,
        lane: usize,
        free: &Triple<f64>,
        mu: f64,
    ) -> (ContactMode, Triple<f64>) {
        solve_one(&self.diagonal[place], lane, free, mu)
    }
}

impl<T: Lane, const C: usize> Loaded<T, C> for VelocitySystem<T, C> {
    const MAX_STEPS: usize = 40;

    fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            zero,
            pattern: None,
            slots: [0; MAX_LANES],
            used: 0,
            Z: Vec::new(),
            q: [[zero; 3]; C],
            diagonal: [[zero; 9]; C],
            softness: [[zero; 3]; C],
            normal: [zero; C],
            inverse: [[zero; 3]; C],
            left: JacobianColumns::new(zero, 0),
            right: JacobianColumns::new(zero, 0),
            matrix: TreeMatrix::new(zero),
            base: [zero; BASE],
            joints: Vec::new(),
        }
    }

    #[inline(always)]
    fn load(&mut self, lane: usize, problem: &ContactProblem) -> Bits {
        let factored = &problem.factored;
        let pattern = Self::pattern(factored.pattern.as_ref());
        if let (None, Some(pattern)) = (&self.pattern, &factored.pattern) {
            self.adopt(pattern);
        }
        let changed = self.slots[lane] | factored.slots;
        self.slots[lane] = factored.slots;
        self.used = self.slots.iter().fold(0, |all, own| all | own);
        for slot in Bits(changed) {
            let own = &mut self.Z[slot];
            let Some(contact) = Self::contact_at(problem, slot) else {
                for c in 0..3 {
                    for k in 0..BASE {
                        own.base[c][k].set(lane, 0.0);
                    }
                }
                for own in own.joints.iter_mut().flatten() {
                    own.set(lane, 0.0);
                }
                for own in &mut self.diagonal[slot] {
                    own.set(lane, 0.0);
                }
                for own in &mut self.softness[slot] {
                    own.set(lane, 0.0);
                }
                self.normal[slot].set(lane, 0.0);
                continue;
            };
            let m = pattern.joints(slot).len();
            let z = &factored.Z[contact * pattern.stride()..][..BASE + m];
            for k in 0..BASE {
                for c in 0..3 {
                    own.base[c][k].set(lane, z[k][c]);
                }
            }
            let (z, joints) = (&z[BASE..][..m], &mut own.joints[..m]);
            for k in 0..m {
                for c in 0..3 {
                    joints[k][c].set(lane, z[k][c]);
                }
            }
            let w = &factored.diagonal[contact];
            for k in 0..9 {
                self.diagonal[slot][k].set(lane, w[k]);
            }
            for (own, more) in self.softness[slot]
                .iter_mut()
                .zip(factored.softness[contact])
            {
                own.set(lane, more);
            }
            self.normal[slot].set(lane, factored.normal[contact]);
        }
        Bits(changed)
    }

    #[inline(always)]
    fn contact_at(problem: &ContactProblem, place: usize) -> Option<usize> {
        problem.factored.contact_at(place)
    }

    #[inline(always)]
    fn least_softness(problem: &ContactProblem) -> f64 {
        let softness = problem.factored.softness.iter().take(problem.n_contacts);
        softness.fold(f64::INFINITY, |least, [n, t, _]| least.min(*n).min(*t))
    }

    #[inline(always)]
    fn block_of(problem: &ContactProblem, contact: usize) -> &[f64; 9] {
        &problem.factored.diagonal[contact]
    }

    #[inline(always)]
    fn free_velocity_mut(&mut self, place: usize) -> &mut Triple<T> {
        &mut self.q[place]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::scalar::Single;
    use crate::solver::batch::blocks::DenseSystem;
    use crate::solver::batch::problem::{DENSE_BLOCKS, MAX_CONTACTS, MAX_DENSE, block};
    use crate::solver::pivoting::rests;
    use proptest::prelude::*;

    /// Pattern of a rover with six wheels of two slots each, four of them steered, on rockers and
    /// bogies.
    fn pattern() -> Arc<Pattern> {
        let wheels: [&[usize]; 6] = [
            &[6, 7, 8],
            &[6, 9, 10],
            &[6, 9, 11, 12],
            &[13, 14, 15],
            &[13, 16, 17],
            &[13, 16, 18, 19],
        ];
        let path = |wheel: &[usize]| (0..BASE).chain(wheel.iter().copied()).collect();
        let paths: Vec<Vec<usize>> = wheels
            .iter()
            .flat_map(|own| [path(own), path(own)])
            .collect();
        Arc::new(Pattern::new(20, &paths).unwrap())
    }

    /// A problem of the first slots of the rover with both forms of its operator.
    pub(in crate::solver::batch) fn problem(
        pattern: &Arc<Pattern>,
        numbers: &mut impl Iterator<Item = f64>,
    ) -> ContactProblem {
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
            let along = 0.02 * i as f64;
            problem.factored.softness[i] = [0.01 * i as f64, along, along];
            for j in 0..=i {
                let shared = pattern.shared(i, j);
                let (a, b) = (row(&problem.factored.Z, i), row(&problem.factored.Z, j));
                for k in 0..9 {
                    let products = a.iter().zip(&b).take(shared);
                    let mut w: f64 = products.map(|(x, y)| x[k / 3] * y[k % 3]).sum();
                    if i == j && k % 4 == 0 {
                        w += problem.factored.softness[i][k / 4];
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
            let mut dense = DenseSystem::<f64, MAX_DENSE, DENSE_BLOCKS>::new(token);
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
            (dense.q, own.q) = (q, q_many);
            dense.velocities(&p, &mut few[3]);
            own.velocities(&p_many, &mut many[3]);
            prop_assert!(close(&few[3], &many[3]));
            dense.factorise(0.1, &of_few);
            own.factorise(0.1, &of_many);
            few[3] = centre;
            many[3] = centre_many;
            dense.solve(&of_few, &mut few[3]);
            own.solve(&of_many, &mut many[3]);
            prop_assume!(few[3].iter().flatten().all(|x| x.abs() < 1e3));
            prop_assert!(close(&few[3], &many[3]), "{:?} {:?}", few[3], &many[3][..MAX_DENSE]);
        }

        #[test]
        fn the_newton_point_of_a_small_alpha_is_as_accurate_as_that_of_a_large_one(
            numbers in prop::collection::vec(-1.0..1.0_f64, 600), modes in prop::collection::vec(0..3, MAX_DENSE),
        ) {
            let pattern = pattern();
            let problem = problem(&pattern, &mut numbers.iter().copied());
            let mut own = VelocitySystem::<f64, MAX_CONTACTS>::new(Single::best());
            prop_assert_eq!(own.load(0, &problem).count(), MAX_DENSE);
            let mut centre = [[0.0; 3]; MAX_CONTACTS];
            let mut of_many = [Mode::open(0.0); MAX_CONTACTS];
            let mut more = numbers.iter().rev().copied();
            for i in 0..MAX_DENSE {
                for x in own.q[i].iter_mut().chain(&mut centre[i]) {
                    *x = more.next().unwrap();
                }
                // Friction that opposes the slip, so that its direction turns.
                let p = centre[i];
                of_many[i] = Mode::of(0.3, modes[i] > 0, modes[i] == 1, &p, &[0.0, -p[1], -p[2]]);
            }
            let rests = rests(&mut own, 1e-8, of_many, centre);
            prop_assume!(rests.is_some());
            let [before, after] = rests.unwrap();
            prop_assert!(before < 1e-4, "{before:e}");
            prop_assert!(after < 1e-12, "{before:e} {after:e}");
        }
    }
}
