//! Every method: manufactured answers, unsymmetric operators, the relaxed law, many contacts.

use crate::scenes::{Problem, falling, pile};
use crate::solving::{by, cold, dimension, distance, lone, size, within};
use friction_contact::problem::{
    BlockSparseDelassus, Dimension, FrictionContactProblem, PairContact,
};
use friction_contact::solver::{
    ContactLaw, Method, SolveStatus, SolverOptions, SolverWorkspace, Stage, solve,
};
use proptest::prelude::*;

/// The methods of Coulomb's law.
fn coulomb_methods() -> impl Iterator<Item = Method> {
    Method::ALL
        .into_iter()
        .filter(|method| method.law() == ContactLaw::Coulomb)
}

#[test]
fn names_lead_to_their_methods() {
    for method in Method::ALL {
        assert_eq!(Method::from_name(method.name()), Some(method));
    }
    assert_eq!(Method::from_name("lemke"), None);
    assert_eq!(coulomb_methods().count(), Method::ALL.len() - 1);
}

/// A problem made from its answer: `q = u − W p` with `(p, u)` open, sticking
/// or sliding at each contact. `skew` makes `W` unsymmetric.
fn manufactured(
    dimension: Dimension,
    numbers: &[f64],
    modes: &[u8],
    mu: f64,
    skew: f64,
) -> (Problem, Vec<f64>, Vec<f64>) {
    let d = dimension.components();
    let n = d * modes.len();
    let mut W = vec![0.0; n * n];
    for r in 0..n {
        for c in 0..n {
            let gram: f64 = (0..n)
                .map(|k| numbers[(r * n + k) % 97] * numbers[(c * n + k) % 97])
                .sum();
            // A dominant diagonal makes the answer unique; a skew part leaves W positive definite.
            W[r * n + c] = 0.3 * gram / n as f64
                + if r == c { 1.0 } else { 0.0 }
                + skew * (f64::from(r < c) - f64::from(r > c));
        }
    }
    let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
    for (i, mode) in modes.iter().enumerate() {
        let at = d * i;
        let load = 1.0 + numbers[(at + 3) % 97].abs();
        let (sin, cos) = (3.0 * numbers[(at + 11) % 97]).sin_cos();
        let direction = if d == 2 {
            [cos.signum(), 0.0]
        } else {
            [cos, sin]
        };
        match mode % 3 {
            0 => {
                u[at] = load;
                u[at + 1] = numbers[at % 97];
            }
            1 => {
                p[at] = load;
                for k in 1..d {
                    p[at + k] = 0.5 * mu * load * direction[k - 1];
                }
            }
            _ => {
                p[at] = load;
                for k in 1..d {
                    p[at + k] = mu * load * direction[k - 1];
                    u[at + k] = -(0.2 + load) * direction[k - 1];
                }
            }
        }
    }
    let q = (0..n)
        .map(|r| u[r] - (0..n).map(|c| W[r * n + c] * p[c]).sum::<f64>())
        .collect();
    let problem = Problem {
        dimension,
        W,
        q,
        mu: vec![mu; modes.len()],
    };
    (problem, p, u)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(150) })]

    #[test]
    fn every_method_finds_the_answer_that_the_problem_was_made_from(
        numbers in prop::collection::vec(-1.0..1.0f64, 97),
        modes in prop::collection::vec(0u8..3, 1..7),
        mu in 0.1..0.6f64,
        // The diagonal of at most 18 entries dominates its row: otherwise sweeps may diverge.
        skew in prop_oneof![Just(0.0), -0.05..0.05f64],
        planar in prop::bool::ANY,
    ) {
        let dimension = dimension(planar);
        let (problem, p, u) = manufactured(dimension, &numbers, &modes, mu, skew);
        for method in coulomb_methods() {
            let (found_p, found_u, report) = cold(&problem.view(), &within(1e-10, method));
            prop_assert!(report.is_converged(), "{}: {report:?}", method.name());
            prop_assert!(distance(&found_p, &p) < 1e-7, "{}: {report:?}", method.name());
            prop_assert!(distance(&found_u, &u) < 1e-7, "{}: {report:?}", method.name());
        }
    }
}

/// A skew coupling of 10% changes the answer by 10%: a solver that symmetrises W would fail.
#[test]
fn an_unsymmetric_operator_is_not_symmetrised() {
    let numbers: Vec<f64> = (0..97).map(|k| (1.7 * f64::from(k)).sin()).collect();
    let (problem, p, _) = manufactured(Dimension::Three, &numbers, &[1, 2, 1], 0.4, 0.1);
    let n = problem.q.len();
    let mut symmetrised = problem.clone();
    for r in 0..n {
        for c in 0..n {
            symmetrised.W[r * n + c] = 0.5 * (problem.W[r * n + c] + problem.W[c * n + r]);
        }
    }
    for method in coulomb_methods() {
        let options = within(1e-10, method);
        let (found, _, _) = cold(&problem.view(), &options);
        let (other, _, _) = cold(&symmetrised.view(), &options);
        assert!(distance(&found, &p) < 1e-8, "{}", method.name());
        assert!(distance(&other, &p) > 1e-2, "{}", method.name());
    }
}

/// A contact without impulse that approaches counts as sticking at first. Newton's method kept the
/// tangential impulse of that stick although the contact has no friction, and found no answer.
#[test]
fn newton_takes_the_friction_of_a_first_guess_from_a_contact_without_any() {
    let mut W = [0.0; 36];
    (0..6).for_each(|k| W[7 * k] = 1.0);
    let q = [-1.0, 0.5, 0.2, -1.0, 0.3, 0.0];
    let problem = FrictionContactProblem::new(Dimension::Three, &W, &q, &[0.0, 0.5]).unwrap();
    let mut p = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    let (mut u, mut workspace) = ([0.0; 6], SolverWorkspace::new());
    let options = by(Method::Newton);
    let report = solve(&problem, &options, &mut p, &mut u, &mut workspace);
    assert!(report.is_converged(), "{report:?}");
    assert!(
        distance(&p, &[1.0, 0.0, 0.0, 1.0, -0.3, 0.0]) < 1e-9,
        "{p:?}"
    );
}

/// With `W = I/m` the relaxed answer is closed: `p = m Π_K(−q)`, and a
/// sliding contact parts with `μ|u_T|`.
#[test]
fn the_relaxed_law_lifts_what_slides() {
    let (mu, m) = (0.5, 2.0);
    for q in [vec![-1.0, 1.2, 1.6], vec![-1.0, -2.0]] {
        let problem = lone(1.0 / m, &q, mu);
        let (p, u, report) = cold(&problem.view(), &by(Method::Relaxed));
        // |q_T| = 2: p_N = m (1 + 2 mu)/(1 + mu²) = 3.2, p_T = mu p_N against q_T.
        assert!((p[0] - 3.2).abs() < 1e-10, "{p:?}");
        let slip = size(&u[1..]);
        assert!(
            (slip - 1.2).abs() < 1e-10 && (u[0] - mu * slip).abs() < 1e-10,
            "{u:?}"
        );
        // Its status says so, and its residuals are Coulomb's: a good fraction of a metre per
        // second.
        assert_eq!(report.status, SolveStatus::SolvedRelaxed);
        assert_eq!(report.method.law(), ContactLaw::Relaxed);
        assert!(
            !report.is_converged() && report.velocity_error > 0.1,
            "{report:?}"
        );
        let (p, u, report) = cold(&problem.view(), &by(Method::Auto));
        assert!(report.is_converged() && u[0].abs() < 1e-12);
        assert!((p[0] - m).abs() < 1e-11);
    }
}

/// Where nothing slides the two laws agree.
#[test]
fn the_relaxed_law_is_coulombs_where_nothing_slides() {
    let problem = pile(&[1.0, 2.0], 0.9).problem(&falling(2, 0.01));
    let (_, u, report) = cold(&problem.view(), &within(1e-10, Method::Relaxed));
    assert_eq!(report.status, SolveStatus::SolvedRelaxed);
    assert!(
        report.residual < 1e-9 && u.iter().all(|x| x.abs() < 1e-9),
        "{report:?}"
    );
}

/// A cube of 1e6 kg on one of 1 kg: no answer with a velocity of more than
/// 1e-9 m/s is accepted, and the default finds one.
#[test]
fn a_wrong_velocity_is_not_accepted_at_a_large_mass_ratio() {
    let problem = pile(&[1.0, 1e6], 0.9).problem(&falling(2, 9.81e-3));
    for method in coulomb_methods() {
        let options = SolverOptions {
            max_sweeps: 500,
            ..within(1e-4, method)
        };
        let (_, u, report) = cold(&problem.view(), &options);
        let moves = u.iter().any(|x| x.abs() > 3e-9);
        assert!(
            !(moves && report.is_converged()),
            "{}: {report:?}",
            method.name()
        );
        // An answer that is rejected in the end is listed as rejected.
        let last = report.rungs.as_slice().last().map(|rung| rung.status);
        assert_eq!(last, Some(report.status), "{}", method.name());
    }
    let (_, u, report) = cold(&problem.view(), &by(Method::Auto));
    assert!(report.is_converged() && u.iter().all(|x| x.abs() < 1e-9));
}

const RADIUS: f64 = 0.05;
const MASS: f64 = 0.7;
const STEP: f64 = 9.81e-3;

/// Columns of disks side by side, on the floor or on one plank whose ends lie on the floor.
/// Contacts, inverse masses and free velocities after a step of gravity. On the floor every column
/// is an island; the plank joins them all into one.
fn columns(
    n_columns: usize,
    height: usize,
    plank: bool,
) -> (Vec<PairContact<2, 3>>, Vec<[f64; 3]>, Vec<f64>) {
    let mut contacts = Vec::new();
    // `arms`: from each body's centre to the contact; the normal points up,
    // from the first body to the second.
    let mut touch = |bodies: [Option<usize>; 2], arms: [[f64; 2]; 2]| {
        let side = |sign: f64, r: [f64; 2]| {
            [[0.0, 1.0], [-1.0, 0.0]].map(|e| {
                let lever = r[0] * e[1] - r[1] * e[0];
                [sign * e[0], sign * e[1], sign * lever]
            })
        };
        contacts.push(PairContact {
            bodies,
            jacobians: [side(-1.0, arms[0]), side(1.0, arms[1])],
        });
    };
    let n_disks = n_columns * height;
    let half = 1.2 * RADIUS * n_columns as f64;
    for column in 0..n_columns {
        let x = 2.4 * RADIUS * (column as f64 + 0.5) - half;
        for level in 0..height {
            let disk = column * height + level;
            let (below, arm) = match (level, plank) {
                (0, false) => (None, [0.0, 0.0]),
                (0, true) => (Some(n_disks), [x, 0.01]),
                _ => (Some(disk - 1), [0.0, RADIUS]),
            };
            touch([below, Some(disk)], [arm, [0.0, -RADIUS]]);
        }
    }
    if plank {
        for x in [-half, half] {
            touch([None, Some(n_disks)], [[0.0; 2], [x, -0.01]]);
        }
    }
    let inverse = [1.0 / MASS, 1.0 / MASS, 2.0 / (MASS * RADIUS * RADIUS)];
    let mut masses = vec![inverse; n_disks];
    if plank {
        masses.push([1.0 / MASS, 1.0 / MASS, 3.0 / (MASS * half * half)]);
    }
    let mut q = Vec::new();
    for contact in &contacts {
        for r in 0..2 {
            let fall = |side: usize| match contact.bodies[side] {
                Some(_) => -STEP * contact.jacobians[side][r][1],
                None => 0.0,
            };
            q.push(fall(0) + fall(1));
        }
    }
    (contacts, masses, q)
}

#[test]
fn columns_of_disks_rest_whatever_the_storage() {
    for plank in [false, true] {
        let (contacts, masses, q) = columns(12, 4, plank);
        let mut W = BlockSparseDelassus::new();
        W.assemble(&contacts, &masses);
        let mu = vec![0.5; contacts.len()];
        let dense = W.to_dense();
        let sparse =
            FrictionContactProblem::new_sparse(Dimension::Two, &W, &q, &mu).expect("sound");
        let full = FrictionContactProblem::new(Dimension::Two, &dense, &q, &mu).expect("sound");
        for method in coulomb_methods() {
            for problem in [&sparse, &full] {
                let (p, u, report) = cold(problem, &within(1e-9, method));
                assert!(report.is_converged(), "{}: {report:?}", method.name());
                assert!(
                    u.iter().all(|x| x.abs() < 3e-9),
                    "{} moves, {report:?}",
                    method.name()
                );
                let carried: f64 = (0..contacts.len())
                    .filter(|&i| contacts[i].bodies[0].is_none())
                    .map(|i| p[2 * i])
                    .sum();
                let weight = STEP * MASS * masses.len() as f64;
                assert!((carried / weight - 1.0).abs() < 1e-6, "{}", method.name());
            }
        }
    }
}

/// The story: 31 boxes, each on its own contact, took a dense Newton step of 93 unknowns, and five
/// times as long as one sweep.
#[test]
fn contacts_that_share_no_body_take_one_sweep() {
    let (contacts, masses, q) = columns(12, 1, false);
    let mut W = BlockSparseDelassus::new();
    W.assemble(&contacts, &masses);
    let (dense, mu) = (W.to_dense(), vec![0.5; contacts.len()]);
    let problem = FrictionContactProblem::from_assembled(Dimension::Two, &dense, &q, &mu);
    let (p, _, report) = cold(&problem, &SolverOptions::default());
    assert!(report.is_converged(), "{report:?}");
    assert_eq!((report.stage, report.iterations), (Stage::Sweeps, 1));
    for p in p.chunks_exact(2) {
        assert!((p[0] / (STEP * MASS) - 1.0).abs() < 1e-14);
    }
}

/// Snapshot of the work: sweeps and linear solves of the default, cold, to
/// 1e-12; one island and many.
#[test]
fn many_contacts_take_few_iterations() {
    for (n_columns, plank, bound) in [(100, true, 80), (200, false, 700)] {
        let (contacts, masses, q) = columns(n_columns, 4, plank);
        let mut W = BlockSparseDelassus::new();
        W.assemble(&contacts, &masses);
        let mu = vec![0.5; contacts.len()];
        let problem = FrictionContactProblem::from_assembled_sparse(&W, &q, &mu);
        let (_, u, report) = cold(&problem, &by(Method::Auto));
        assert!(report.is_converged(), "{report:?}");
        assert!(report.iterations <= bound, "{n_columns}: {report:?}");
        assert!(u.iter().all(|x| x.abs() < 1e-9));
    }
}

#[test]
fn no_method_allocates_in_a_sized_workspace() {
    // The larger problem sizes the workspace, the smaller one alternates with it.
    let large = pile(&[1.0, 1e2, 1.0], 0.9).problem(&falling(3, 0.01));
    let small = pile(&[1.0], 0.5).problem(&[0.3, -0.01, 0.0, 0.0, 0.1, 0.0]);
    let mut workspace = SolverWorkspace::with_capacity(large.mu.len(), 3);
    for method in Method::ALL {
        let options = SolverOptions {
            max_sweeps: 100,
            ..by(method)
        };
        for problem in [&large, &small, &large] {
            let n = problem.q.len();
            let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
            let view = problem.view();
            let counted = allocation_counter::measure(|| {
                solve(&view, &options, &mut p, &mut u, &mut workspace);
            });
            assert_eq!(counted.count_total, 0, "{method:?} allocates");
        }
    }
}
