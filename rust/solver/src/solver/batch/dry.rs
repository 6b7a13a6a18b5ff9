//! The linear system of a Newton step on contacts and joints with dry friction.
//!
//! A dry joint has one unknown, the tangential impulse x of a joint that sticks; its normal impulse
//! follows from its normal row alone, and one that slides has the friction that belongs to it
//! (one row along t). With the contacts' system A of [`super::blocks`], the
//! columns U and rows V of the joints, and `S = W_tt + α 1`
//!
//! ```text
//! ( A  U ) ( y )   ( r )         A = L R:   (S − V R⁻¹ L⁻¹ U) x = s − V R⁻¹ L⁻¹ r
//! ( V  S ) ( x ) = ( s )                    R y = L⁻¹ r − L⁻¹ U x
//! ```
//!
//! The contacts have the first places, the joints those behind.

use super::blocks::{
    BlockFactors, ContactBlock, backward, backward_row, factorise, forward, velocities,
};
use super::loaded::{Loaded, solve_one};
use super::problem::{ContactProblem, DENSE_BLOCKS, MAX_DENSE, MAX_DRY, block};
use crate::law::mode::{ContactMode, Mode};
use crate::scalar::Lane;
use crate::solver::pivoting::{Few, System, Triple};

/// Number of places.
pub(super) const PLACES: usize = MAX_DENSE + MAX_DRY;

/// Operators of contacts and dry joints.
#[derive(Clone, Debug)]
pub(super) struct DrySystem<T: Lane> {
    /// Lower triangle of the contacts' `W` by 3 x 3 blocks, row-major, 1/kg: [`block`].
    W: [ContactBlock<T>; DENSE_BLOCKS],
    q: [Triple<T>; PLACES],
    /// The row t of W of each joint and the contacts, and the joints, 1/kg.
    coupling: [[Triple<T>; MAX_DENSE]; MAX_DRY],
    own: [[T; MAX_DRY]; MAX_DRY],
    /// W's entry of each joint's normal, 1/kg.
    normal: [T; MAX_DRY],
    factors: BlockFactors<T, MAX_DENSE>,
    /// `L⁻¹ U` and `V R⁻¹` by joint, where it sticks; zero elsewhere.
    columns: [[Triple<T>; MAX_DENSE]; MAX_DRY],
    rows: [[Triple<T>; MAX_DENSE]; MAX_DRY],
    /// Factors of `S − V A⁻¹ U`, with the inverse of the diagonal.
    schur: [[T; MAX_DRY]; MAX_DRY],
    /// Inverse of each normal's diagonal.
    inverse: [T; MAX_DRY],
    zero: T,
}

/// Entries at the places of the contacts, and of the joints.
#[inline(always)]
fn split<X>(all: &[X; PLACES]) -> (&[X; MAX_DENSE], &[X]) {
    match all.split_first_chunk() {
        Some(parts) => parts,
        None => unreachable!("invariant: there are places for contacts"),
    }
}

/// Mutable entries at the places of the contacts, and of the joints.
#[inline(always)]
fn split_mut<X>(all: &mut [X; PLACES]) -> (&mut [X; MAX_DENSE], &mut [X]) {
    match all.split_first_chunk_mut() {
        Some(parts) => parts,
        None => unreachable!("invariant: there are places for contacts"),
    }
}

#[inline(always)]
fn dot<T: Lane>(a: &Triple<T>, b: &Triple<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Product of two vectors over the contacts.
#[inline(always)]
fn product<T: Lane>(a: &[Triple<T>; MAX_DENSE], b: &[Triple<T>; MAX_DENSE]) -> T {
    let mut sum = dot(&a[0], &b[0]);
    for c in 1..MAX_DENSE {
        sum += dot(&a[c], &b[c]);
    }
    sum
}

impl<T: Lane> DrySystem<T> {
    /// Factors `S − V A⁻¹ U`. `stick`: where each joint sticks.
    #[inline(always)]
    fn factorise_joints(&mut self, alpha: T, stick: &[T::Mask; MAX_DRY]) {
        let (zero, one) = (self.zero, self.zero.like(1.0));
        for j in 0..MAX_DRY {
            for i in 0..MAX_DRY {
                let mut entry = self.own[j][i] - product(&self.rows[j], &self.columns[i]);
                if i == j {
                    entry += alpha;
                }
                let other = if i == j { one } else { zero };
                self.schur[j][i] = T::select(stick[i] & stick[j], entry, other);
            }
        }
        let S = &mut self.schur;
        for k in 0..MAX_DRY {
            let inverse = one / S[k][k];
            S[k][k] = inverse;
            for i in k + 1..MAX_DRY {
                let factor = S[i][k] * inverse;
                S[i][k] = factor;
                for m in k + 1..MAX_DRY {
                    let taken = factor * S[k][m];
                    S[i][m] -= taken;
                }
            }
        }
    }

    /// Solves with these factors.
    #[inline(always)]
    fn solve_joints(&self, x: &mut [T; MAX_DRY]) {
        let S = &self.schur;
        for i in 1..MAX_DRY {
            for k in 0..i {
                let taken = S[i][k] * x[k];
                x[i] -= taken;
            }
        }
        for i in (0..MAX_DRY).rev() {
            for k in i + 1..MAX_DRY {
                let taken = S[i][k] * x[k];
                x[i] -= taken;
            }
            x[i] *= S[i][i];
        }
    }
}

impl<T: Lane> System<T, Few<PLACES>> for DrySystem<T> {
    type Places = std::ops::Range<usize>;

    #[inline(always)]
    fn places(&self) -> Self::Places {
        0..PLACES
    }

    #[inline(always)]
    fn free_velocity(&self, place: usize) -> Triple<T> {
        self.q[place]
    }

    #[inline(always)]
    fn velocities(&mut self, p: &[Triple<T>; PLACES], u: &mut [Triple<T>; PLACES]) {
        let ((q, q_joints), (p, p_joints)) = (split(&self.q), split(p));
        let (u, u_joints) = split_mut(u);
        velocities(&self.W, MAX_DENSE, q, p, u);
        for j in 0..MAX_DRY {
            let (coupling, own) = (&self.coupling[j], p_joints[j]);
            let mut rate = q_joints[j][1] + product(coupling, p);
            for i in 0..MAX_DRY {
                rate += self.own[j][i] * p_joints[i][1];
            }
            u_joints[j] = [q_joints[j][0] + self.normal[j] * own[0], rate, self.zero];
            for c in 0..MAX_DENSE {
                for k in 0..3 {
                    u[c][k] += coupling[c][k] * own[1];
                }
            }
        }
    }

    #[inline(always)]
    fn factorise(&mut self, alpha: T, modes: &[Mode<T>; PLACES]) -> bool {
        let (modes, of_joints) = split(modes);
        let (zero, one) = (self.zero, self.zero.like(1.0));
        factorise(&self.W, MAX_DENSE, alpha, modes, &mut self.factors);
        let mut stick = [zero.lt(zero); MAX_DRY];
        for j in 0..MAX_DRY {
            stick[j] = of_joints[j].stick;
            self.inverse[j] = one / (self.normal[j] + alpha);
            for c in 0..MAX_DENSE {
                let (w, mode) = (self.coupling[j][c], &modes[c]);
                let along = mode.b[0] * w[1] + mode.b[1] * w[2];
                let row = [w[0] + (mode.a[0] * w[1] + mode.a[1] * w[2]), along, w[2]];
                let column = mode.across(w);
                for k in 0..3 {
                    self.rows[j][c][k] = T::select(stick[j], row[k], zero);
                    self.columns[j][c][k] = T::select(stick[j], column[k], zero);
                }
            }
            forward(&self.factors, MAX_DENSE, &mut self.columns[j]);
            backward_row(&self.factors, &mut self.rows[j]);
        }
        self.factorise_joints(alpha, &stick);
        true
    }

    #[inline(always)]
    fn solve(&mut self, modes: &[Mode<T>; PLACES], r: &mut [Triple<T>; PLACES]) {
        let ((modes, of_joints), (r, r_joints)) = (split(modes), split_mut(r));
        let zero = self.zero;
        let mut x = [zero; MAX_DRY];
        // The friction of joints that slide.
        for j in 0..MAX_DRY {
            let normal = T::select(of_joints[j].closed, r_joints[j][0] * self.inverse[j], zero);
            x[j] = r_joints[j][1];
            r_joints[j] = [normal, of_joints[j].a[0] * normal, zero];
        }
        for j in 0..MAX_DRY {
            let friction = r_joints[j][1];
            for c in 0..MAX_DENSE {
                for k in 0..3 {
                    r[c][k] -= self.coupling[j][c][k] * friction;
                }
            }
            for (i, x) in x.iter_mut().enumerate() {
                *x -= self.own[i][j] * friction;
            }
        }
        for c in 0..MAX_DENSE {
            r[c] = modes[c].across(r[c]);
        }
        forward(&self.factors, MAX_DENSE, r);
        for j in 0..MAX_DRY {
            let rest = x[j] - product(&self.rows[j], r);
            x[j] = T::select(of_joints[j].stick, rest, zero);
        }
        self.solve_joints(&mut x);
        for j in 0..MAX_DRY {
            for c in 0..MAX_DENSE {
                for k in 0..3 {
                    r[c][k] -= self.columns[j][c][k] * x[j];
                }
            }
            r_joints[j][1] += x[j];
        }
        backward(&self.factors, MAX_DENSE, r);
        for c in 0..MAX_DENSE {
            r[c] = modes[c].impulse(r[c]);
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
        let own = match place.checked_sub(MAX_DENSE) {
            None => self.W[block(place, place)],
            Some(j) => {
                let (zero, own) = (self.zero, self.own[j][j]);
                [self.normal[j], zero, zero, zero, own, zero, zero, zero, own]
            }
        };
        solve_one(&own, lane, free, mu)
    }
}

impl<T: Lane> Loaded<T, PLACES> for DrySystem<T> {
    const MAX_STEPS: usize = 80;

    #[inline(always)]
    fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            W: [[zero; 9]; DENSE_BLOCKS],
            q: [[zero; 3]; PLACES],
            coupling: [[[zero; 3]; MAX_DENSE]; MAX_DRY],
            own: [[zero; MAX_DRY]; MAX_DRY],
            normal: [zero; MAX_DRY],
            factors: [[[zero; 9]; MAX_DENSE]; MAX_DENSE],
            columns: [[[zero; 3]; MAX_DENSE]; MAX_DRY],
            rows: [[[zero; 3]; MAX_DENSE]; MAX_DRY],
            schur: [[zero; MAX_DRY]; MAX_DRY],
            inverse: [zero; MAX_DRY],
            zero,
        }
    }

    #[inline(always)]
    fn load(&mut self, lane: usize, problem: &ContactProblem) -> Self::Places {
        let n = problem.n_contacts - problem.n_dry;
        for (b, (own, w)) in self.W.iter_mut().zip(&problem.W).enumerate() {
            let is_used = b < block(n, 0);
            for k in 0..9 {
                own[k].set(lane, if is_used { w[k] } else { 0.0 });
            }
        }
        for j in 0..MAX_DRY {
            let is_used = j < problem.n_dry;
            let with = |other: usize, entry: usize| {
                if is_used {
                    problem.W[block(n + j, other)][entry]
                } else {
                    0.0
                }
            };
            for c in 0..MAX_DENSE {
                for k in 0..3 {
                    let w = if c < n { with(c, 3 + k) } else { 0.0 };
                    self.coupling[j][c][k].set(lane, w);
                }
            }
            for i in 0..=j {
                let w = with(n + i, 4);
                self.own[j][i].set(lane, w);
                self.own[i][j].set(lane, w);
            }
            self.normal[j].set(lane, with(n + j, 0));
        }
        0..PLACES
    }

    #[inline(always)]
    fn contact_at(problem: &ContactProblem, place: usize) -> Option<usize> {
        let n = problem.n_contacts - problem.n_dry;
        match place.checked_sub(MAX_DENSE) {
            None => (place < n).then_some(place),
            Some(j) => (j < problem.n_dry).then_some(n + j),
        }
    }

    #[inline(always)]
    fn block_of(problem: &ContactProblem, contact: usize) -> &[f64; 9] {
        &problem.W[block(contact, contact)]
    }

    #[inline(always)]
    fn free_velocity_mut(&mut self, place: usize) -> &mut Triple<T> {
        &mut self.q[place]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Single;
    use crate::solver::batch::blocks::DenseSystem;
    use proptest::prelude::*;

    const CONTACTS: usize = 5;
    const JOINTS: usize = 3;
    const ALL: usize = CONTACTS + JOINTS;

    /// A problem `Zᵀ Z` whose last contacts are dry joints, with rows t alone.
    fn problem(numbers: &mut impl Iterator<Item = f64>) -> ContactProblem {
        let mut problem = ContactProblem {
            n_contacts: ALL,
            n_dry: JOINTS,
            ..ContactProblem::default()
        };
        let mut Z = vec![[[0.0; 3]; 12]; ALL];
        for (i, z) in Z.iter_mut().enumerate() {
            for z in z {
                for k in 0..3 {
                    if i < CONTACTS || k == 1 {
                        z[k] = numbers.next().unwrap();
                    }
                }
            }
        }
        for i in 0..ALL {
            for j in 0..=i {
                let own = &mut problem.W[block(i, j)];
                for k in 0..9 {
                    own[k] = (Z[i].iter().zip(&Z[j]))
                        .map(|(x, y)| x[k / 3] * y[k % 3])
                        .sum();
                }
                if i == j && i >= CONTACTS {
                    // Regular, though its only entry is that of t.
                    (own[0], own[8]) = (own[4], own[4]);
                }
            }
        }
        problem
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn a_system_with_one_unknown_a_dry_joint_has_the_answers_of_the_whole_one(
            numbers in prop::collection::vec(-1.0..1.0_f64, 400), modes in prop::collection::vec(0..3, ALL),
        ) {
            let token = Single::best();
            let mut numbers = numbers.iter().copied().cycle();
            let problem = problem(&mut numbers);
            let mut dense = DenseSystem::<f64, MAX_DENSE, DENSE_BLOCKS>::new(token);
            let mut own = DrySystem::<f64>::new(token);
            dense.load(0, &problem);
            own.load(0, &problem);
            let mut few = [[[0.0; 3]; MAX_DENSE]; 2];
            let mut many = [[[0.0; 3]; PLACES]; 2];
            let mut of_few = [Mode::open(0.0); MAX_DENSE];
            let mut of_many = [Mode::open(0.0); PLACES];
            let place = |i: usize| if i < CONTACTS { i } else { MAX_DENSE + i - CONTACTS };
            for i in 0..ALL {
                let has_b = i < CONTACTS;
                let mut draw = || [0, 1, 2].map(|k| {
                    if k == 2 && !has_b { 0.0 } else { numbers.next().unwrap() }
                });
                let (p, q) = (draw(), draw());
                (few[0][i], many[0][place(i)]) = (p, p);
                (dense.q[i], own.q[place(i)]) = (q, q);
                // Friction that opposes the slip, so that its direction turns.
                of_few[i] = Mode::of(0.3, modes[i] > 0, modes[i] == 1, &p, &[0.0, -p[1], -p[2]]);
                of_many[place(i)] = of_few[i];
            }
            let close = |few: &[Triple<f64>; MAX_DENSE], many: &[Triple<f64>; PLACES]| {
                let scale = few.iter().flatten().fold(1.0, |most: f64, x| most.max(x.abs()));
                (0..ALL).all(|i| (0..3).all(|k| (few[i][k] - many[place(i)][k]).abs() < 1e-8 * scale))
            };
            let (p, p_many) = (few[0], many[0]);
            dense.velocities(&p, &mut few[1]);
            own.velocities(&p_many, &mut many[1]);
            prop_assert!(close(&few[1], &many[1]), "{:?} {:?}", few[1], many[1]);
            dense.factorise(0.1, &of_few);
            own.factorise(0.1, &of_many);
            (few[1], many[1]) = (p, p_many);
            dense.solve(&of_few, &mut few[1]);
            own.solve(&of_many, &mut many[1]);
            prop_assume!(few[1].iter().flatten().all(|x| x.abs() < 1e3));
            prop_assert!(close(&few[1], &many[1]), "{:?} {:?}", few[1], many[1]);
        }
    }
}
