//! One sweep of nonsmooth Gauss–Seidel: solves contact after contact exactly, with all others
//! fixed.
//!
//! It costs no more than one product with `W`. Stages sweep the problem itself, or the regularised
//! one to break a cycle of Newton's method.

use crate::law::coulomb::Coulomb;
use crate::law::friction_law::FrictionLaw;
use crate::problem::{Operator, Prepared, Proximal, dot};

/// One sweep over all contacts of the problem with `W + α I` and `q − α c`, under Coulomb's law.
pub(in crate::solver) fn sweep<const D: usize>(
    data: &Prepared<'_>,
    prox: Proximal<'_>,
    p: &mut [f64],
) {
    sweep_under::<D, _>(data, &|i| Coulomb(data.mu[i]), prox, p);
}

/// [`sweep`] under the law that contact i has.
pub(in crate::solver) fn sweep_under<const D: usize, L: FrictionLaw<D>>(
    data: &Prepared<'_>,
    law: &impl Fn(usize) -> L,
    prox: Proximal<'_>,
    p: &mut [f64],
) {
    let n = data.n;
    for i in 0..data.mu.len() {
        let offset = D * i;
        let u: [f64; D] = match data.W {
            Operator::Dense(W) => std::array::from_fn(|r| {
                dot(&W[(offset + r) * n..(offset + r + 1) * n], p) + data.q[offset + r]
            }),
            Operator::BlockSparse(W) => {
                let mut u = W.row_times::<D>(i, p);
                for r in 0..D {
                    u[r] += data.q[offset + r];
                }
                u
            }
        };
        update::<D>(data.block(i), u, prox, offset, &law(i), p);
    }
}

/// Replaces the impulse of a contact by the exact solution for its current velocity `u`.
#[inline]
fn update<const D: usize>(
    mut block: [[f64; D]; D],
    u: [f64; D],
    prox: Proximal<'_>,
    offset: usize,
    law: &impl FrictionLaw<D>,
    p: &mut [f64],
) {
    let mut q = u;
    for r in 0..D {
        q[r] -= prox.alpha * prox.centre[offset + r];
        for c in 0..D {
            q[r] -= block[r][c] * p[offset + c];
        }
        block[r][r] += prox.alpha;
    }
    let solved = law.answer(&block, &q);
    if solved.iter().all(|x| x.is_finite()) {
        p[offset..offset + D].copy_from_slice(&solved);
    }
}
