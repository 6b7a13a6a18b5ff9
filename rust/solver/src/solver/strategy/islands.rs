//! Islands: groups of contacts that share no body with the rest are solved one by one.
//!
//! A heap that has fallen apart consists of many small problems. Solving them one after the other
//! costs less than solving them together, since the cost of a Newton step grows faster than the
//! number of contacts and a hard island no longer delays the others. Measured on 296 contacts in 33
//! islands, without a warm start, to 1e-8: less than half the time.

use crate::law::coulomb::Coulomb;
use crate::problem::{
    BlockSparseDelassus, Dimension, FrictionContactProblem, Operator, Residual, ViolationSums,
    evaluate_contact,
};
use crate::solver::options::{Method, SolverOptions};
use crate::solver::report::{SolveReport, SolveStatus};
use crate::solver::scratch::{Attempt, StageEnd};

/// Most contacts of an island whose `W` is copied as a dense matrix.
const DENSE_ISLAND: usize = 64;

/// Memory of one island's problem.
#[derive(Clone, Debug, Default)]
pub(in crate::solver) struct Islands {
    /// Island of each contact, then contacts sorted by island with the first of each.
    label: Vec<usize>,
    starts: Vec<usize>,
    contacts: Vec<usize>,
    /// Place of each contact within its island.
    place: Vec<usize>,
    /// The island's problem.
    dense: Vec<f64>,
    q: Vec<f64>,
    mu: Vec<f64>,
    p: Vec<f64>,
    u: Vec<f64>,
}

/// The solver of an island.
pub(in crate::solver) struct IslandSolver<'a> {
    /// Memory.
    pub islands: &'a mut Islands,
    /// Solves a problem as [`solve`](crate::solver::solve) does. An island is a problem like any
    /// other and may escalate. Only here a strategy needs the whole solver, which lies above it.
    pub solve: &'a mut SolvePart<'a>,
}

/// Solves one island from `p` (n), N s; `u` (n), m/s, on return.
pub(in crate::solver) type SolvePart<'a> = dyn FnMut(&FrictionContactProblem<'_>, &SolverOptions, &mut [f64], &mut [f64]) -> SolveReport
    + 'a;

impl Islands {
    /// Finds the islands of `W` and returns their number. They are ordered by their first contacts.
    fn find(&mut self, W: &BlockSparseDelassus) -> usize {
        let n = W.n_contacts();
        // Roots of a union–find forest; the root is the lowest contact.
        self.label.clear();
        self.label.extend(0..n);
        for i in 0..n {
            for &j in W.neighbours(i) {
                let (a, b) = (root(&mut self.label, i), root(&mut self.label, j));
                self.label[a.max(b)] = a.min(b);
            }
        }
        let mut n_islands = 0;
        for i in 0..n {
            let parent = self.label[i];
            // A root precedes its contacts, and by then holds the island's number.
            self.label[i] = if parent == i {
                n_islands += 1;
                n_islands - 1
            } else {
                self.label[parent]
            };
        }
        self.starts.clear();
        self.starts.resize(n_islands + 1, 0);
        for &island in &self.label {
            self.starts[island + 1] += 1;
        }
        for island in 0..n_islands {
            self.starts[island + 1] += self.starts[island];
        }
        self.contacts.resize(n, 0);
        self.place.resize(n, 0);
        let mut next = self.starts.clone();
        for (i, &island) in self.label.iter().enumerate() {
            self.contacts[next[island]] = i;
            self.place[i] = next[island] - self.starts[island];
            next[island] += 1;
        }
        n_islands
    }
}

fn root(parents: &mut [usize], mut i: usize) -> usize {
    while parents[i] != i {
        parents[i] = parents[parents[i]];
        i = parents[i];
    }
    i
}

/// Solves every unsolved island from `p` and returns the method that the hardest one needed; `None`
/// if all contacts form one island or `W` is dense. `u = W p + q` on return.
pub(in crate::solver) fn solve<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    solver: IslandSolver<'_>,
) -> Option<(Method, StageEnd)> {
    let Operator::BlockSparse(W) = attempt.data.W else {
        return None;
    };
    let IslandSolver { islands, solve } = solver;
    let n_islands = islands.find(W);
    if n_islands <= 1 {
        return None;
    }
    let mut hardest = Method::GaussSeidel;
    // Small islands first, and half of the budget at most: a large one may use it up.
    let mut order: Vec<usize> = (0..n_islands).collect();
    order.sort_by_key(|&island| islands.starts[island + 1] - islands.starts[island]);
    for island in order {
        let range = islands.starts[island]..islands.starts[island + 1];
        if is_solved(attempt, &islands.contacts[range]) {
            continue;
        }
        let report = solve_island(attempt, W, island, islands, solve);
        attempt.iterations += report.iterations;
        attempt.scratch.work.spent += report.work;
        if rank(report.method) > rank(hardest) {
            hardest = report.method;
        }
    }
    attempt.find_velocity();
    let residual = attempt.residual();
    let status = if attempt.options.accepts(residual)
        || (residual.relative < 1e-7 && attempt.is_within_rounding())
    {
        SolveStatus::Converged
    } else {
        SolveStatus::Stalled
    };
    Some((hardest, (status, residual)))
}

/// Rank of the method in the escalation.
fn rank(method: Method) -> usize {
    match method {
        Method::ProximalPoint => 2,
        Method::Newton => 1,
        _ => 0,
    }
}

/// Whether the island's share of the residual, and each of its velocities, meet the tolerances.
fn is_solved<const D: usize>(attempt: &Attempt<'_, D>, contacts: &[usize]) -> bool {
    let (data, options) = (attempt.data, attempt.options);
    let share = contacts.len() as f64 / data.mu.len() as f64;
    let mut violations = ViolationSums::default();
    for &i in contacts {
        let law = Coulomb(data.mu[i]);
        let square = evaluate_contact::<D>(attempt.p, attempt.u, D * i, &law, data.modes[i]);
        violations.add(square, data.masses[i]);
    }
    let Residual { relative, velocity } =
        violations.residual(data.inverse_speed, data.inverse_data);
    velocity <= options.velocity_tolerance && relative <= options.tolerance * share.sqrt()
}

fn solve_island<const D: usize>(
    attempt: &mut Attempt<'_, D>,
    W: &BlockSparseDelassus,
    island: usize,
    islands: &mut Islands,
    solve: &mut SolvePart<'_>,
) -> SolveReport {
    let Attempt {
        data, p, scratch, ..
    } = attempt;
    let work = &scratch.work;
    let options = &SolverOptions {
        budget: Some(work.budget.saturating_sub(work.spent) / 2),
        keeps_history: false,
        ..*attempt.options
    };
    let Islands {
        starts,
        contacts,
        place,
        dense,
        q,
        mu,
        p: own_p,
        u: own_u,
        ..
    } = islands;
    let contacts = &contacts[starts[island]..starts[island + 1]];
    let n = D * contacts.len();
    q.clear();
    mu.clear();
    own_p.clear();
    for &i in contacts {
        q.extend_from_slice(&data.q[D * i..D * (i + 1)]);
        own_p.extend_from_slice(&p[D * i..D * (i + 1)]);
        mu.push(data.mu[i]);
    }
    own_u.clear();
    own_u.resize(n, 0.0);
    let dimension = if D == 2 {
        Dimension::Two
    } else {
        Dimension::Three
    };
    let report = if contacts.len() <= DENSE_ISLAND {
        dense.clear();
        dense.resize(n * n, 0.0);
        for (k, &i) in contacts.iter().enumerate() {
            let blocks = W.row(i).chunks_exact(D * D);
            for (&j, block) in W.neighbours(i).iter().zip(blocks) {
                for (r, row) in block.chunks_exact(D).enumerate() {
                    dense[(D * k + r) * n + D * place[j]..][..D].copy_from_slice(row);
                }
            }
        }
        let problem = FrictionContactProblem::from_assembled(dimension, dense, q, mu);
        solve(&problem, options, own_p, own_u)
    } else {
        let sparse = W.restricted(contacts, place);
        let problem = FrictionContactProblem::from_assembled_sparse(&sparse, q, mu);
        solve(&problem, options, own_p, own_u)
    };
    if report.status != SolveStatus::NonFinite {
        for (k, &i) in contacts.iter().enumerate() {
            p[D * i..D * (i + 1)].copy_from_slice(&own_p[D * k..D * (k + 1)]);
        }
    }
    report
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn islands_are_the_connected_contacts() {
        // Couplings 0-3, 3-5, 1-4; contact 2 alone.
        let n = 6;
        let mut W = vec![0.0; 4 * n * n];
        let mut couple = |i: usize, j: usize| {
            W[2 * i * 2 * n + 2 * j] = 1.0;
            W[2 * j * 2 * n + 2 * i] = 1.0;
        };
        for i in 0..n {
            couple(i, i);
        }
        for (i, j) in [(0, 3), (3, 5), (1, 4)] {
            couple(i, j);
        }
        let W = BlockSparseDelassus::from_dense(Dimension::Two, n, &W).expect("square");
        let mut islands = Islands::default();
        assert_eq!(islands.find(&W), 3);
        assert_eq!(islands.contacts, [0, 3, 5, 1, 4, 2]);
        assert_eq!(islands.starts, [0, 3, 5, 6]);
        assert_eq!(islands.place, [0, 0, 0, 1, 1, 2]);
    }
}
