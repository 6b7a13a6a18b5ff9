//! Few contacts: Lemke's pivoting on friction pyramids, each followed by pivoting on the cones.
//!
//! With a pyramid of edges `D = (e₁, e₂, …)` in the place of each cone, `p_T = D β`, the problem is
//! a linear complementarity problem:
//!
//! ```text
//! 0 ≤ u_N               ⊥  p_N ≥ 0
//! 0 ≤ Dᵀ u_T + λ (1…1)  ⊥  β ≥ 0
//! 0 ≤ μ p_N − Σ β       ⊥  λ ≥ 0
//! ```
//!
//! Lemke's method follows one path to its answer and cannot go in circles, except by rounding. For
//! a positive semidefinite `W` it finds one if there is one (Stewart and Trinkle 1996; Anitescu and
//! Potra 1997). Then the first edge of each pyramid turns against the slip of the answer, and those
//! beside it come nearer to the first if the slip stayed between them, so that the answers of
//! further rounds tend to the law of the cones. Without coming nearer, edges that turn go in
//! circles: of 866 problems of wedged rovers 93 stay unsolved, with it 5.
//!
//! Wedged rovers, whose contacts press against each other without moving, have many modes that are
//! right to 1e-6; what leads from one to the next is not descent.

use super::pivoting;
use crate::problem::{Operator, Residual};
use crate::scalar::elementary::sin_cos;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, Fan, PyramidScratch, StageEnd};
use crate::solver::work::tableau_pivot;

/// Rounds, and the edges of their pyramids in turn, in space. Where a round's modes lead nowhere,
/// those of another number of edges often do.
const ROUNDS: usize = 12;
const EDGES: [usize; 4] = [4, 6, 5, 7];

/// Factors of the angle between the first edge and those beside it: if the slip stayed between
/// them, and if it did not.
const NEARER: f64 = 0.5;
const FARTHER: f64 = 2.0;

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

/// Angle between the edges of a regular pyramid, rad.
fn regular(n_edges: usize) -> f64 {
    std::f64::consts::TAU / n_edges as f64
}

/// Normal and edges of a pyramid; in the plane there are two edges.
fn push_edges<const D: usize>(n_edges: usize, fan: Fan, edges: &mut Vec<[f64; 3]>) {
    edges.push([1.0, 0.0, 0.0]);
    if D == 2 {
        edges.extend([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]);
        return;
    }
    let [cos, sin] = fan.first;
    let beside = fan.angle.min(regular(n_edges));
    let others = (std::f64::consts::TAU - 2.0 * beside) / (n_edges - 2) as f64;
    for k in 0..n_edges {
        let angle = match k {
            0 => 0.0,
            k => beside + (k - 1) as f64 * others,
        };
        let (s, c) = sin_cos(angle);
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
        fans,
        edges,
        W,
    } = &mut attempt.scratch.pyramids;
    edges.clear();
    for fan in fans {
        push_edges::<D>(n_edges, *fan, edges);
    }
    let columns = edges.len() / n_contacts;
    let per = columns + 1;
    tableau.clear(per * n_contacts);
    let scale = 1.0 / data.mean_diagonal;
    let constants = per * n_contacts + 1;
    for (i, own) in edges.chunks_exact(columns).enumerate() {
        for (a, edge) in own.iter().enumerate() {
            let row = tableau.row(per * i + a);
            for (j, others) in edges.chunks_exact(columns).enumerate() {
                let image: [f64; D] = std::array::from_fn(|b| {
                    let entries = (0..D).map(|k| edge[k] * W[(D * i + k) * n + D * j + b]);
                    scale * entries.sum::<f64>()
                });
                for (entry, other) in row[per * j..].iter_mut().zip(others) {
                    *entry = (0..D).map(|k| image[k] * other[k]).sum();
                }
            }
            let q = (0..D).map(|k| edge[k] * data.q[D * i + k]).sum::<f64>();
            row[constants] = q * data.inverse_speed;
            if a > 0 {
                row[per * i + columns] = 1.0;
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
/// none, and moves those beside it.
fn align<const D: usize>(attempt: &mut Attempt<'_, D>, n_edges: usize) {
    if D == 2 {
        return;
    }
    let still = STILL / attempt.data.inverse_speed;
    let states = attempt.p.chunks_exact(D).zip(attempt.u.chunks_exact(D));
    for (fan, (p, u)) in attempt.scratch.pyramids.fans.iter_mut().zip(states) {
        let slip = [-u[1], -u[D - 1]];
        let is_still = slip.iter().all(|x| x.abs() <= still);
        let first = direction(if is_still { [p[1], p[D - 1]] } else { slip });
        let beside = fan.angle.min(regular(n_edges));
        let turned = first[0] * fan.first[0] + first[1] * fan.first[1];
        let is_between = turned >= sin_cos(beside).1 * (1.0 - ALIKE);
        *fan = Fan {
            first,
            angle: beside * if is_between { NEARER } else { FARTHER },
        };
    }
}

/// Angles that differ by less are equal: slip along an edge is between those beside the first.
const ALIKE: f64 = 1e-9;

/// Slip below which a contact is at rest, relative to `|q|`.
const STILL: f64 = 1e-9;

/// Solves with pyramids, and pivots from each of their answers. `u` is `W p + q` on return.
pub(in crate::solver) fn solve<const D: usize>(attempt: &mut Attempt<'_, D>) -> StageEnd {
    let data = attempt.data;
    let PyramidScratch { fans, W, .. } = &mut attempt.scratch.pyramids;
    match data.W {
        Operator::Dense(dense) => {
            W.clear();
            W.extend_from_slice(dense);
        }
        Operator::BlockSparse(blocks) => blocks.write_dense(W),
    }
    fans.clear();
    fans.extend((attempt.scratch.start.chunks_exact(D)).map(|p| Fan {
        first: direction([p[1], p[D - 1]]),
        angle: std::f64::consts::TAU,
    }));
    attempt.p.copy_from_slice(&attempt.scratch.start);
    attempt.find_velocity();
    let mut best = Residual::UNSOLVED;
    let residual = attempt.residual();
    keep(attempt, residual, &mut best);
    let mut found = None;
    let rounds = if D == 2 { 1 } else { ROUNDS }; // in the plane the pyramid is the cone
    for round in 0..rounds {
        let n_edges = EDGES[round % EDGES.len()];
        let per = pose(attempt, n_edges);
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
        align(attempt, n_edges);
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
