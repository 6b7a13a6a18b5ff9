//! The linear system of a Newton step on many contacts of rigid discs: that of [`super::equations`]
//! with the whole operator, which the factors of the problem give.
//!
//! Where machines with thin rigid wheels push or tow each other, their contacts are more than the
//! velocities can tell apart, and the law decides by slips of 1e-12 m/s. The systems in the
//! velocities ([`super::velocity_equations`]) resolve no more than their large `α` leaves.

use super::equations::{Block, Factors, backward, factorise, forward, velocities};
use super::problem::{ContactProblem, MAX_LARGE, block};
use super::system::{Loaded, solve_one};
use crate::law::coulomb::ContactMode;
use crate::scalar::{Lane, MAX_LANES};
use crate::solver::pivoting::{Few, Mode, System, Triple};

/// Blocks of the lower triangle of `W`.
const BLOCKS: usize = block(MAX_LARGE, 0);

/// Operators with all their blocks; a contact's place is its number.
#[derive(Clone, Debug)]
pub(super) struct LargeSystem<T: Lane> {
    W: Box<[Block<T>; BLOCKS]>,
    q: [Triple<T>; MAX_LARGE],
    factors: Box<Factors<T, MAX_LARGE>>,
    /// Number of each lane's contacts, and the largest of these.
    counts: [usize; MAX_LANES],
    n: usize,
}

/// Many of something, made without a copy on the stack.
fn boxed<X: Clone, const N: usize>(x: X) -> Box<[X; N]> {
    let Ok(all) = vec![x; N].into_boxed_slice().try_into() else {
        unreachable!("invariant: it has this length")
    };
    all
}

impl<T: Lane> System<T, Few<MAX_LARGE>> for LargeSystem<T> {
    type Places = std::ops::Range<usize>;

    #[inline(always)]
    fn places(&self) -> Self::Places {
        0..self.n
    }

    #[inline(always)]
    fn free_velocity(&self, place: usize) -> Triple<T> {
        self.q[place]
    }

    #[inline(always)]
    fn velocities(&mut self, p: &[Triple<T>; MAX_LARGE], u: &mut [Triple<T>; MAX_LARGE]) {
        velocities(&self.W, self.n, &self.q, p, u);
    }

    #[inline(always)]
    fn factorise(&mut self, alpha: T, modes: &[Mode<T>; MAX_LARGE]) -> bool {
        factorise(&self.W, self.n, alpha, modes, &mut self.factors);
        true
    }

    #[inline(always)]
    fn solve(&mut self, modes: &[Mode<T>; MAX_LARGE], r: &mut [Triple<T>; MAX_LARGE]) {
        for k in 0..self.n {
            r[k] = modes[k].across(r[k]);
        }
        forward(&self.factors, self.n, r);
        backward(&self.factors, self.n, r);
        for k in 0..self.n {
            r[k] = modes[k].impulse(r[k]);
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
        solve_one(&self.W[block(place, place)], lane, free, mu)
    }
}

impl<T: Lane> Loaded<T, MAX_LARGE> for LargeSystem<T> {
    const MAX_STEPS: usize = 80;

    fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            W: boxed([zero; 9]),
            q: [[zero; 3]; MAX_LARGE],
            factors: boxed([[zero; 9]; MAX_LARGE]),
            counts: [0; MAX_LANES],
            n: 0,
        }
    }

    #[inline(always)]
    fn load(&mut self, lane: usize, problem: &ContactProblem) -> Self::Places {
        let n = problem.n_contacts;
        let before = std::mem::replace(&mut self.counts[lane], n);
        self.n = self.counts.iter().fold(0, |most, own| most.max(*own));
        let stride = problem.factored.shape().0;
        let row = |contact: usize| &problem.factored.Z[contact * stride..][..stride];
        for i in 0..n.max(before) {
            for j in 0..=i {
                let mut w = [0.0; 9];
                if i < n && j == i {
                    w = problem.factored.diagonal[i];
                } else if i < n {
                    for (x, y) in row(i).iter().zip(row(j)) {
                        for k in 0..9 {
                            w[k] += x[k / 3] * y[k % 3];
                        }
                    }
                }
                let own = &mut self.W[block(i, j)];
                for k in 0..9 {
                    own[k].set(lane, w[k]);
                }
            }
        }
        0..n.max(before)
    }

    #[inline(always)]
    fn contact_at(problem: &ContactProblem, place: usize) -> Option<usize> {
        (place < problem.n_contacts).then_some(place)
    }

    #[inline(always)]
    fn least_softness(_: &ContactProblem) -> f64 {
        0.0
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
mod tests {
    use super::*;
    use crate::lanes::equations::DenseSystem;
    use crate::lanes::pattern::Pattern;
    use crate::lanes::problem::{MAX_CONTACTS, MAX_DENSE};
    use crate::lanes::velocity_equations::tests::problem;
    use crate::scalar::Single;
    use std::sync::Arc;

    #[test]
    fn the_operator_of_the_factors_is_that_of_the_problem() {
        let mut numbers = (1..).map(|k: u32| (f64::from(k) * 0.618).fract() - 0.5);
        let pattern = Arc::new(Pattern::whole(12, MAX_CONTACTS));
        let problem = problem(&pattern, &mut numbers);
        let token = Single::best();
        let mut dense = DenseSystem::<f64, MAX_DENSE>::new(token);
        let mut large = LargeSystem::<f64>::new(token);
        dense.load(0, &problem);
        assert_eq!(large.load(0, &problem), 0..MAX_DENSE);
        let mut p = [[0.0; 3]; MAX_LARGE];
        for x in p.iter_mut().take(MAX_DENSE).flatten() {
            *x = numbers.next().unwrap();
        }
        let (few, _) = p.split_first_chunk().unwrap();
        let mut u = ([[0.0; 3]; MAX_DENSE], [[0.0; 3]; MAX_LARGE]);
        dense.velocities(few, &mut u.0);
        large.velocities(&p, &mut u.1);
        for (a, b) in u.0.iter().flatten().zip(u.1.iter().flatten()) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}
