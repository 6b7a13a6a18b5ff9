//! Few contacts: Lemke's pivoting on friction pyramids, each followed by pivoting on the cones.
//!
//! With a pyramid of edges `D = (e₁, e₂, −e₁, −e₂)` in the place of each cone, `p_T = D β`, the
//! problem is a linear complementarity problem:
//!
//! ```text
//! 0 ≤ u_N               ⊥  p_N ≥ 0
//! 0 ≤ Dᵀ u_T + λ (1…1)  ⊥  β ≥ 0
//! 0 ≤ μ p_N − Σ β       ⊥  λ ≥ 0
//! ```
//!
//! Lemke's method follows one path to its answer and cannot go in circles, except by rounding. For
//! a positive semidefinite `W` it finds one if there is one (Stewart and Trinkle 1996; Anitescu and
//! Potra 1997). The first edge of each pyramid then turns against the slip of the answer, and the
//! next round begins, with other pyramids.
//!
//! Wedged rovers, whose contacts press against each other without moving, have many modes that are
//! right to 1e-6; what leads from one to the next is not descent.

use super::pivoting;
use crate::problem::{Operator, Residual};
use crate::scalar::elementary::sin_cos;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, PyramidScratch, StageEnd};
use crate::solver::work::tableau_pivot;

/// Edges of the pyramids of each round, in space. Where a round's modes lead nowhere, those of
/// another number of edges often do: of 460 problems of wedged rovers that pivoting and Newton do
/// not solve, the first four rounds answer 331, all twelve 402.
const EDGES: [usize; 12] = [6, 6, 8, 4, 5, 7, 6, 8, 10, 6, 8, 12];

/// Rounds after which an acceptable answer ends the stage.
const ENOUGH: usize = 4;

/// Most systems while pivoting on the cones after a round. What succeeds mostly takes fewer than
/// ten.
const MOST_PIVOTS: usize = 12;

/// Unit vector along `x`, or the first axis.
fn direction(x: [f64; 2]) -> [f64; 2] {
    let size = (x[0] * x[0] + x[1] * x[1]).sqrt();
    if size > 0.0 && size.is_finite() {
        [x[0] / size, x[1] / size]
    } else {
        [1.0, 0.0]
    }
}

/// Normal and edges of a pyramid whose first edge has a direction; in the plane there are two.
fn push_edges<const D: usize>(n_edges: usize, [cos, sin]: [f64; 2], edges: &mut Vec<[f64; 3]>) {
    edges.push([1.0, 0.0, 0.0]);
    if D == 2 {
        edges.extend([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]);
        return;
    }
    for k in 0..n_edges {
        let (s, c) = sin_cos(std::f64::consts::TAU * k as f64 / n_edges as f64);
        edges.push([0.0, cos * c - sin * s, sin * c + cos * s]);
    }
}

/// Writes the problem with pyramids of `n_edges` edges into the tableau, in units of the mean
/// diagonal of `W` and of `|q|`. Returns the number of pairs of a contact.
fn pose<const D: usize>(attempt: &mut Attempt<'_, D>, n_edges: usize) -> usize {
    let data = attempt.data;
    let (n_contacts, n) = (data.mu.len(), data.n);
    let PyramidScratch {
        tableau,
        first,
        edges,
        W,
    } = &mut attempt.scratch.pyramids;
    edges.clear();
    for first in first {
        push_edges::<D>(n_edges, *first, edges);
    }
    let columns = edges.len() / n_contacts;
    let per = columns + 1;
    tableau.clear(per * n_contacts);
    let scale = 1.0 / data.mean_diagonal;
    for (k, other) in edges.iter().enumerate() {
        let (j, b) = (k / columns, k % columns);
        for i in 0..n_contacts {
            let image: [f64; 3] = std::array::from_fn(|a| {
                let entries = W.get((D * i + a) * n + D * j..).unwrap_or(&[]);
                scale
                    * entries
                        .iter()
                        .zip(other)
                        .take(D)
                        .map(|(w, e)| w * e)
                        .sum::<f64>()
            });
            for (a, own) in edges[columns * i..][..columns].iter().enumerate() {
                let entry = (0..D).map(|k| own[k] * image[k]).sum();
                tableau.row(per * i + a)[per * j + b] = entry;
            }
        }
    }
    let constants = per * n_contacts + 1;
    for (i, own) in edges.chunks_exact(columns).enumerate() {
        for (a, edge) in own.iter().enumerate() {
            let q = (0..D).map(|k| edge[k] * data.q[D * i + k]).sum::<f64>();
            tableau.row(per * i + a)[constants] = q * data.inverse_speed;
            if a > 0 {
                tableau.row(per * i + a)[per * i + columns] = 1.0;
                tableau.row(per * i + columns)[per * i + a] = -1.0;
            }
        }
        tableau.row(per * i + columns)[per * i] = data.mu[i];
    }
    per
}

/// Takes the impulses from the tableau.
fn take<const D: usize>(attempt: &mut Attempt<'_, D>, per: usize) {
    let scale = 1.0 / (attempt.data.mean_diagonal * attempt.data.inverse_speed);
    let PyramidScratch { tableau, edges, .. } = &attempt.scratch.pyramids;
    let edges = edges.chunks_exact(per - 1);
    for (i, (p, edges)) in attempt.p.chunks_exact_mut(D).zip(edges).enumerate() {
        p.fill(0.0);
        for (a, edge) in edges.iter().enumerate() {
            let size = scale * tableau.value(per * i + a);
            for (p, e) in p.iter_mut().zip(edge) {
                *p += size * e;
            }
        }
    }
    attempt.find_velocity();
}

/// Turns the first edge of each pyramid against the slip, or along the friction where there is
/// none.
fn align<const D: usize>(attempt: &mut Attempt<'_, D>) {
    if D == 2 {
        return;
    }
    let still = STILL / attempt.data.inverse_speed;
    let states = attempt.p.chunks_exact(D).zip(attempt.u.chunks_exact(D));
    for (edge, (p, u)) in attempt.scratch.pyramids.first.iter_mut().zip(states) {
        let slip = [-u[1], -u[D - 1]];
        let is_still = slip.iter().all(|x| x.abs() <= still);
        *edge = direction(if is_still { [p[1], p[D - 1]] } else { slip });
    }
}

/// Slip below which a contact is at rest, relative to `|q|`.
const STILL: f64 = 1e-9;

/// Solves with pyramids, and pivots from each of their answers. `u` is `W p + q` on return.
pub(in crate::solver) fn solve<const D: usize>(attempt: &mut Attempt<'_, D>) -> StageEnd {
    let data = attempt.data;
    let PyramidScratch { first, W, .. } = &mut attempt.scratch.pyramids;
    match data.W {
        Operator::Dense(dense) => {
            W.clear();
            W.extend_from_slice(dense);
        }
        Operator::BlockSparse(blocks) => blocks.write_dense(W),
    }
    first.clear();
    first.resize(data.mu.len(), [1.0, 0.0]);
    let mut best = Residual::UNSOLVED;
    let mut found = None;
    let rounds = if D == 2 { 1 } else { EDGES.len() }; // in the plane the pyramid is the cone
    for (round, n_edges) in EDGES[..rounds].iter().enumerate() {
        let per = pose(attempt, *n_edges);
        let (is_answer, pivots) = attempt.scratch.pyramids.tableau.solve();
        let work = pivots as u64 * tableau_pivot(per * data.mu.len());
        if !attempt.scratch.work.affords(work) {
            break;
        }
        attempt.iterations += pivots;
        if !is_answer {
            continue;
        }
        take(attempt, per);
        let residual = attempt.measure();
        keep(attempt, residual, &mut best);
        align(attempt);
        let end = pivoting::few_pivots(attempt, None, MOST_PIVOTS);
        keep(attempt, end.1, &mut best);
        if end.0 == SolveStatus::Converged {
            found = Some(end);
            break;
        }
        let is_enough = round + 1 >= ENOUGH && attempt.options.is_acceptable(best);
        if is_enough || attempt.scratch.work.is_exhausted {
            break;
        }
    }
    if let Some(found) = found {
        return found;
    }
    if !best.is_finite() {
        return (SolveStatus::Stalled, Residual::UNSOLVED);
    }
    attempt.p.copy_from_slice(&attempt.scratch.accepted);
    attempt.find_velocity();
    (SolveStatus::Stalled, attempt.residual())
}

/// Keeps the impulse if it is better than the best so far.
fn keep<const D: usize>(attempt: &mut Attempt<'_, D>, residual: Residual, best: &mut Residual) {
    if residual.velocity < best.velocity {
        *best = residual;
        attempt.scratch.accepted.copy_from_slice(attempt.p);
    }
}
