//! Whole behaviour of the friction-contact solvers on small mechanisms with known answers.

use crate::scenes::{Problem, ROVER_NV, Scene, falling, pile, rover, table};
use crate::solving::{by, cold, dimension, distance, lone, size};
use friction_contact::problem::{
    BlockSparseDelassus, BodyPairs, Dimension, FrictionContactProblem, PairContact, RoundPair,
    evaluate,
};
use friction_contact::solver::{
    ContactSolution, ManyBodies, Method, SolveReport, SolveStatus, SolverOptions, SolverWorkspace,
    Stage, solve, solve_many_bodies,
};
use proptest::prelude::*;

const METHODS: [Method; 5] = [
    Method::Auto,
    Method::GaussSeidel,
    Method::Newton,
    Method::ProximalPoint,
    Method::Admm,
];

/// Solves from the impulses `p`: velocities and report.
fn solve_with(
    problem: &Problem,
    options: &SolverOptions,
    p: &mut [f64],
) -> (Vec<f64>, SolveReport) {
    let (mut u, mut workspace) = (vec![0.0; p.len()], SolverWorkspace::new());
    let report = solve(&problem.view(), options, p, &mut u, &mut workspace);
    (u, report)
}

/// Cold start with the default options, which must converge.
fn solved(problem: &Problem) -> (Vec<f64>, Vec<f64>, SolveReport) {
    let (p, u, report) = cold(&problem.view(), &SolverOptions::default());
    assert!(report.is_converged(), "{report:?}");
    (p, u, report)
}

/// Coulomb's and Signorini's laws, written out case by case and without the code under test:
/// largest violation in m/s, impulses weighed with the contact's own `W_NN`.
fn coulomb_violation(problem: &Problem, p: &[f64]) -> f64 {
    let n = problem.q.len();
    let d = problem.dimension.components();
    let u: Vec<f64> = (0..n)
        .map(|r| problem.q[r] + (0..n).map(|c| problem.W[r * n + c] * p[c]).sum::<f64>())
        .collect();
    let mut worst = 0.0_f64;
    for (i, &mu) in problem.mu.iter().enumerate() {
        let (p, u) = (&p[d * i..d * (i + 1)], &u[d * i..d * (i + 1)]);
        let weight = problem.W[d * i * (n + 1)];
        let (p_T, u_T) = (size(&p[1..]), size(&u[1..]));
        worst = worst.max(-u[0]).max(-p[0] * weight);
        worst = worst.max(u[0].abs().min(p[0].abs() * weight));
        worst = worst.max((p_T - mu * p[0]) * weight);
        // Moving sideways under load: friction at its limit and opposed.
        let limit = mu * p[0].max(0.0);
        let mismatch: f64 = p[1..]
            .iter()
            .zip(&u[1..])
            .map(|(p_k, u_k)| {
                if u_T > 0.0 {
                    (p_k + limit * u_k / u_T).powi(2)
                } else {
                    0.0
                }
            })
            .sum::<f64>()
            .sqrt();
        // A solver's residual sees a slip in the wrong direction as the speed across the friction,
        // so that the direction of a slow slip is known no better than the slip itself.
        worst = worst.max(mismatch * weight.min(u_T / limit.max(f64::MIN_POSITIVE)));
    }
    worst
}

#[test]
fn one_contact_opens_sticks_and_slides_with_every_method() {
    // m = 2 kg, mu = 0.5.
    let cases: [(&[f64], &[f64]); 6] = [
        (&[0.1, 3.0, -1.0], &[0.0, 0.0, 0.0]),
        (&[-0.1, 0.03, -0.04], &[0.2, -0.06, 0.08]),
        // p_N = 0.2, p_T = -0.1 (0.6, 0.8).
        (&[-0.1, 0.6, 0.8], &[0.2, -0.06, -0.08]),
        (&[0.1, 3.0], &[0.0, 0.0]),
        (&[-0.1, 0.05], &[0.2, -0.1]),
        (&[-0.1, -0.9], &[0.2, 0.1]),
    ];
    for (q, expected) in cases {
        let problem = lone(0.5, q, 0.5);
        for method in METHODS {
            let (p, _, report) = cold(&problem.view(), &by(method));
            assert!(report.is_converged(), "{method:?} {report:?}");
            assert!(
                distance(&p, expected) < 1e-12,
                "{method:?}: {p:?} instead of {expected:?}"
            );
        }
    }
}

/// A cube of side 1 m on a slope of angle `alpha`, four feet, one step of gravity from rest.
fn cube_on_slope(alpha: f64, mu: f64, gh: f64) -> Problem {
    let mut v = falling(1, gh);
    v[0] = gh * alpha.sin();
    v[1] = -gh * alpha.cos();
    pile(&[3.0], mu).problem(&v)
}

#[test]
fn a_block_on_a_slope_sticks_iff_tan_alpha_is_below_mu() {
    // Beyond the friction angle: a = g (sin - mu cos).
    let gh = 9.81e-3;
    for mu in [0.3_f64, 0.5, 0.7] {
        let (_, u, _) = solved(&cube_on_slope(mu.atan() * 0.999_999, mu, gh));
        assert!(size(&u) < 1e-13, "creeps at mu {mu}: {u:?}");
        let alpha = mu.atan() * 1.001;
        let (_, u, _) = solved(&cube_on_slope(alpha, mu, gh));
        let expected = gh * (alpha.sin() - mu * alpha.cos());
        for foot in u.chunks_exact(3) {
            assert!(
                (foot[1] - expected).abs() < 1e-13
                    && foot[0].abs() < 1e-14
                    && foot[2].abs() < 1e-14
            );
        }
    }
}

#[test]
fn piles_rest_and_carry_their_weight_at_any_mass_ratio() {
    let gh = 9.81e-3;
    let mut iterations = Vec::new();
    for masses in [
        vec![1.0, 1.0],
        vec![1.0, 1e2],
        vec![1.0, 1e4],
        vec![1.0, 1e6],
        vec![1e6, 1.0],
        vec![1.0; 5],
        vec![1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0],
        vec![1.0, 1.0, 1.0, 1.0, 1e4],
    ] {
        let problem = pile(&masses, 0.9).problem(&falling(masses.len(), gh));
        let (p, u, report) = solved(&problem);
        assert!(
            u.iter().all(|x| x.abs() < 1e-9),
            "{masses:?} moves: {report:?}"
        );
        for level in 0..masses.len() {
            let carried: f64 = (0..4).map(|k| p[12 * level + 3 * k]).sum();
            let weight = gh * masses[level..].iter().sum::<f64>();
            assert!(
                (carried - weight).abs() < 1e-9 * weight,
                "{masses:?}, level {level}: {carried} of {weight}"
            );
        }
        iterations.push(report.iterations);
    }
    for (found, bound) in iterations.iter().zip(PILE_ITERATIONS) {
        assert!(*found <= bound, "slower than the snapshot: {iterations:?}");
    }
}

/// Snapshot of the test above.
const PILE_ITERATIONS: [usize; 8] = [8, 10, 20, 20, 20, 22, 38, 24];

/// Rover at rest after one step of gravity: `v = -g h` on the heave.
fn parked_rover() -> Problem {
    let mut v = vec![0.0; ROVER_NV];
    v[1] = -9.81 * 2e-3;
    straight().problem(&v)
}

/// Rank of a symmetric matrix by elimination with full diagonal pivoting.
fn rank(W: &[f64], n: usize) -> usize {
    let mut A = W.to_vec();
    let scale = (0..n).map(|k| A[k * (n + 1)]).fold(0.0, f64::max);
    for rank in 0..n {
        let Some(k) = (0..n).max_by(|&a, &b| A[a * (n + 1)].total_cmp(&A[b * (n + 1)])) else {
            return rank;
        };
        if A[k * (n + 1)] < 1e-12 * scale {
            return rank;
        }
        let row: Vec<f64> = (0..n).map(|c| A[k * n + c]).collect();
        for r in 0..n {
            for c in 0..n {
                A[r * n + c] -= row[r] * row[c] / row[k];
            }
        }
    }
    n
}

/// Part of `x` in the null space of a symmetric `W`, up to `1e-9` of the rest: `(I + W/alpha)^-1 x`
/// by elimination.
fn invisible(W: &[f64], x: &[f64]) -> f64 {
    let n = x.len();
    let alpha = 1e-10 * (0..n).map(|k| W[k * (n + 1)]).sum::<f64>();
    let mut A: Vec<f64> = W.iter().map(|w| w / alpha).collect();
    let mut b = x.to_vec();
    for k in 0..n {
        A[k * (n + 1)] += 1.0;
    }
    for k in 0..n {
        for r in k + 1..n {
            let factor = A[r * n + k] / A[k * (n + 1)];
            for c in k..n {
                A[r * n + c] -= factor * A[k * n + c];
            }
            b[r] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        for c in k + 1..n {
            b[k] -= A[k * n + c] * b[c];
        }
        b[k] /= A[k * (n + 1)];
    }
    size(&b)
}

#[test]
fn six_straight_wheels_have_rank_fourteen_and_newton_does_not_mind() {
    let problem = parked_rover();
    assert_eq!(rank(&problem.W, 18), 14);
    let (p, u, report) = solved(&problem);
    assert_eq!(report.method, Method::Newton);
    assert!(report.iterations <= 16, "{report:?}");
    assert!(u.iter().all(|x| x.abs() < 1e-14), "creeps");
    let weight: f64 = p.iter().step_by(3).sum();
    assert!((weight - 960.0 * 9.81 * 2e-3).abs() < 1e-11);
    assert!(
        invisible(&problem.W, &p) < 1e-6 * size(&p),
        "lateral squeeze"
    );
}

/// The rover with all wheels straight.
fn straight() -> Scene {
    rover([0.0; 6], 0.7)
}

/// Cases whose answer must be canonical: name, problem.
fn canonical_cases() -> Vec<(&'static str, Problem)> {
    let free = |change: &[(usize, f64)]| {
        let mut v = vec![0.0; ROVER_NV];
        v[1] = -9.81 * 2e-3;
        for &(k, x) in change {
            v[k] += x;
        }
        v
    };
    let spinning: Vec<(usize, f64)> = (9..15).map(|k| (k, 0.05 * (k - 8) as f64)).collect();
    let skidding: Vec<(usize, f64)> = (9..15).map(|k| (k, 30.0)).collect();
    vec![
        ("parked", parked_rover()),
        ("driving", straight().problem(&free(&spinning))),
        ("spinning wheels", straight().problem(&free(&skidding))),
        (
            "sliding sideways",
            straight().problem(&free(&[(2, 0.4), (4, 0.2)])),
        ),
        (
            "steered",
            rover([0.3, 0.25, 0.0, -0.2, 0.0, -0.15], 0.7).problem(&free(&[(0, 0.3)])),
        ),
        (
            "landing on one side",
            straight().problem(&free(&[(1, -0.5), (3, 1.2)])),
        ),
        (
            "six-legged table",
            table(6, 0.5).problem(&[0.002, -0.0196, 0.001, 0.0, 0.003, 0.0]),
        ),
    ]
}

/// All orders of six things (Heap's algorithm).
fn permutations() -> Vec<[usize; 6]> {
    fn heap(k: usize, order: &mut [usize; 6], out: &mut Vec<[usize; 6]>) {
        if k == 1 {
            out.push(*order);
            return;
        }
        for i in 0..k {
            heap(k - 1, order, out);
            order.swap(if k.is_multiple_of(2) { i } else { 0 }, k - 1);
        }
    }
    let mut out = Vec::new();
    heap(6, &mut [0, 1, 2, 3, 4, 5], &mut out);
    out
}

#[test]
fn the_answer_does_not_depend_on_the_order_of_the_contacts() {
    let orders = permutations();
    assert_eq!(orders.len(), 720);
    for (name, problem) in canonical_cases() {
        let (reference, _, _) = solved(&problem);
        let mut worst = 0.0_f64;
        for order in &orders {
            let (p, _, _) = solved(&problem.permuted(order));
            let expected: Vec<f64> = order
                .iter()
                .flat_map(|&i| reference[3 * i..3 * i + 3].to_vec())
                .collect();
            worst = worst.max(distance(&p, &expected) / size(&reference));
        }
        assert!(worst < 1e-9, "{name}: {worst:e}");
    }
}

#[test]
fn a_mirror_symmetric_problem_has_a_mirror_symmetric_answer() {
    let mirror = |p: &[f64]| -> Vec<f64> {
        [1, 0, 4, 5, 2, 3]
            .iter()
            .flat_map(|&i: &usize| [p[3 * i], p[3 * i + 1], -p[3 * i + 2]])
            .collect()
    };
    for spin in [0.0, 0.3, 30.0] {
        for drop in [0.0196, 0.7] {
            for (front, back) in [(0.0, 0.0), (0.3, -0.2)] {
                // Toe-in is mirror symmetric, steering is not.
                let scene = rover([front, -front, 0.0, back, 0.0, -back], 0.7);
                let mut v = vec![0.0; ROVER_NV];
                v[0] = 0.4;
                v[1] = -drop;
                v[9..].fill(4.0 + spin);
                let problem = scene.problem(&v);
                let (p, _, _) = solved(&problem);
                let error = distance(&p, &mirror(&p)) / size(&p);
                assert!(
                    error < 1e-9,
                    "spin {spin}, drop {drop}, toe {front}: {error:e}"
                );
            }
        }
    }
}

#[test]
fn a_warm_start_is_kept_where_the_law_leaves_freedom() {
    let problem = parked_rover();
    let (cold, _, _) = solved(&problem);
    // Squeeze the middle wheels against the back ones: no velocity changes.
    let mut warm = cold.clone();
    for (component, sign) in [(8, 1.0), (14, -1.0)] {
        warm[component] += 0.2 * sign;
    }
    let before = warm.clone();
    let (_, report) = solve_with(&problem, &SolverOptions::default(), &mut warm);
    assert!(
        report.is_converged() && report.iterations <= 1,
        "{report:?}"
    );
    assert!(distance(&warm, &before) < 1e-9);
}

#[test]
fn driving_in_steady_motion_takes_two_steps() {
    let scene = rover([0.3, 0.3, 0.0, -0.2, 0.0, -0.2], 0.7);
    let mut v = vec![0.0; ROVER_NV];
    let (mut p, mut u) = (vec![0.0; 18], vec![0.0; 18]);
    let mut workspace = SolverWorkspace::with_capacity(6, 3);
    let mut worst = 0;
    for step in 0..200 {
        v[1] -= 9.81 * 2e-3;
        for wheel in 9..15 {
            v[wheel] += 2e-3 * 12.0 / 0.15;
        }
        v[0] *= 0.999;
        let problem = scene.problem(&v);
        let report = solve(
            &problem.view(),
            &SolverOptions::default(),
            &mut p,
            &mut u,
            &mut workspace,
        );
        assert!(report.is_converged(), "{report:?}");
        if step >= 20 {
            worst = worst.max(report.iterations);
        }
        scene.push(&mut v, &p);
    }
    assert!(worst <= 3, "{worst} steps");
}

#[test]
fn a_table_of_a_hundred_legs_is_cheap() {
    let problem = table(100, 0.5).problem(&[0.001, -0.0196, 0.0, 0.0, 0.002, 0.0]);
    let (_, u, report) = solved(&problem);
    assert!(u.iter().all(|x| x.abs() < 1e-10));
    assert!(report.iterations <= 45, "{report:?}");
}

#[test]
fn bad_numbers_go_in_and_never_come_out() {
    let sound = parked_rover();
    for value in [f64::NAN, f64::INFINITY, -1e300, 1e300] {
        for place in 0..4 {
            for method in METHODS {
                let mut problem = sound.clone();
                let mut p = vec![0.1; 18];
                match place {
                    0 => problem.W[20] = value,
                    1 => problem.q[3] = value,
                    2 => problem.mu[2] = value,
                    _ => p[7] = value,
                }
                let view = FrictionContactProblem::from_assembled(
                    problem.dimension,
                    &problem.W,
                    &problem.q,
                    &problem.mu,
                );
                let mut u = vec![0.0; 18];
                let options = SolverOptions {
                    method,
                    max_sweeps: 50,
                    max_newton_steps: 50,
                    ..SolverOptions::default()
                };
                let report = solve(&view, &options, &mut p, &mut u, &mut SolverWorkspace::new());
                assert!(
                    p.iter().chain(&u).all(|x| x.is_finite()),
                    "{value} at {place}: {report:?}"
                );
                if place == 3 && method == Method::Auto {
                    assert!(
                        value.abs() > 1e299 && value.is_finite() || report.is_converged(),
                        "{value}: {report:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_workspace_leaves_no_trace() {
    let mut workspace = SolverWorkspace::new();
    let answer = |problem: &Problem, workspace: &mut SolverWorkspace| {
        let n = problem.q.len();
        let (mut p, mut u) = (vec![0.0; n], vec![0.0; n]);
        let options = SolverOptions::default();
        solve(&problem.view(), &options, &mut p, &mut u, workspace);
        p.into_iter().map(f64::to_bits).collect::<Vec<_>>()
    };
    for (name, problem) in canonical_cases() {
        let fresh = answer(&problem, &mut SolverWorkspace::new());
        let other = pile(&[1.0, 1e2], 0.9).problem(&falling(2, 0.01));
        answer(&other, &mut workspace);
        assert_eq!(fresh, answer(&problem, &mut workspace), "{name}");
    }
}

/// Random mechanism: `n_c` contacts over `nv` velocities, so that `W` may have any rank.
fn random_problem() -> impl Strategy<Value = Problem> {
    (1usize..6, 1usize..14, prop::bool::ANY).prop_flat_map(|(n_c, nv, planar)| {
        let d = if planar { 2 } else { 3 };
        (
            prop::collection::vec(-1.0..1.0f64, d * n_c * nv),
            prop::collection::vec(0.1..2.0f64, nv),
            prop::collection::vec(-1.0..1.0f64, nv),
            prop::collection::vec(prop_oneof![1 => Just(0.0), 4 => 0.0..0.9f64], n_c),
        )
            .prop_map(move |(entries, inverse_mass, v, mu)| {
                let scene = Scene {
                    dimension: dimension(planar),
                    rows: entries.chunks_exact(nv).map(<[f64]>::to_vec).collect(),
                    inverse_mass,
                    mu,
                };
                scene.problem(&v)
            })
    })
}

proptest! {
    // A failing case is printed; this test has no source folder to store it in.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn converged_means_coulombs_law(problem in random_problem()) {
        let d = problem.dimension.components();
        let n = problem.q.len();
        prop_assume!((0..n).step_by(d).all(|k| problem.W[k * (n + 1)] > 1e-3));
        let (p, u, report) = cold(&problem.view(), &SolverOptions::default());
        prop_assert!(p.iter().chain(&u).all(|x| x.is_finite()));
        let judged = evaluate(&problem.view(), &p);
        prop_assert!((judged.relative - report.residual).abs() <= 1e-12 + 1e-6 * report.residual);
        if report.is_converged() {
            let violation = coulomb_violation(&problem, &p);
            prop_assert!(violation < 1e-10, "{violation:e} with {report:?}");
        }
    }
}

/// Sum with negligible rounding (Neumaier), so that a cancellation in `W p + q` is due to the
/// answer and not to the test.
fn exact_sum(terms: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (mut sum, mut lost) = (0.0_f64, 0.0_f64);
    for (a, b) in terms {
        let product = a * b;
        lost += a.mul_add(b, -product);
        let next = sum + product;
        lost += if sum.abs() >= product.abs() {
            (sum - next) + product
        } else {
            (product - next) + sum
        };
        sum = next;
    }
    sum + lost
}

/// The laws that an answer breaks by more than a millionth of the largest free velocity: approach
/// and slip in m/s, adhesion and friction beyond the cone in N s of the contact's own mass.
fn broken_laws(problem: &Problem, p: &[f64]) -> Vec<String> {
    let (n, d) = (problem.q.len(), problem.dimension.components());
    let speed = 1e-6 * problem.q.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let row = |r: usize| {
        let terms = (0..n).map(|c| (problem.W[r * n + c], p[c]));
        exact_sum(terms.chain([(problem.q[r], 1.0)]))
    };
    let mut broken = Vec::new();
    for (i, &mu) in problem.mu.iter().enumerate() {
        let u: Vec<f64> = (d * i..d * (i + 1)).map(row).collect();
        let p = &p[d * i..d * (i + 1)];
        let diagonal = |k: usize| problem.W[(d * i + k) * (n + 1)];
        let normal = speed / diagonal(0);
        let tangential = speed * (d - 1) as f64 / (1..d).map(diagonal).sum::<f64>();
        let (push, slip) = (size(&p[1..]), size(&u[1..]));
        let limit = mu * p[0].max(0.0);
        let opposed: Vec<f64> = (1..d).map(|k| p[k] + limit * u[k] / slip).collect();
        for (law, is_broken) in [
            ("approach", u[0] < -speed),
            ("adhesion", p[0] < -normal),
            ("force at a distance", u[0] > speed && p[0] > normal),
            (
                "friction beyond the cone",
                push > limit * (1.0 + 1e-12) + tangential,
            ),
            (
                "slip without friction against it",
                // The direction of a slip is known to `speed / slip`.
                slip > speed && size(&opposed) > limit * (1e-6 + speed / slip) + tangential,
            ),
        ] {
            if is_broken {
                broken.push(format!("contact {i}, {law}: p {p:?}, u {u:?}, mu {mu:e}"));
            }
        }
    }
    broken
}

/// A random mechanism in other units: W, q and μ times powers of ten, and
/// bodies of very different masses.
fn scaled_problem() -> impl Strategy<Value = Problem> {
    let exponent = || prop_oneof![Just(0.0), -12.0..12.0f64];
    let scales = (exponent(), exponent(), exponent());
    let masses = prop::collection::vec(prop_oneof![Just(0.0), -6.0..6.0f64], 14);
    let parts = (1usize..5, 2usize..14, prop::bool::ANY);
    (parts, scales, masses, 0u64..u64::MAX).prop_map(
        |((n_c, nv, planar), (w, q, mu), masses, seed)| {
            let mut state = seed;
            let mut uniform = move || {
                state = state
                    .wrapping_mul(0x5851_f42d_4c95_7f2d)
                    .wrapping_add(0x1405_7b7e_f767_814f);
                (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
            };
            let dimension = dimension(planar);
            let d = dimension.components();
            let scene = Scene {
                dimension,
                rows: (0..d * n_c)
                    .map(|_| (0..nv).map(|_| uniform()).collect())
                    .collect(),
                inverse_mass: (0..nv).map(|k| 10.0_f64.powf(w + masses[k])).collect(),
                mu: (0..n_c)
                    .map(|_| 10.0_f64.powf(mu) * uniform().abs())
                    .collect(),
            };
            let v: Vec<f64> = (0..nv).map(|_| 10.0_f64.powf(q) * uniform()).collect();
            scene.problem(&v)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1500) })]

    #[test]
    fn converged_means_signorini_and_coulomb_at_every_scale(problem in scaled_problem()) {
        for method in METHODS {
            let options = SolverOptions { method, max_sweeps: 300, ..SolverOptions::default() };
            let (p, u, report) = cold(&problem.view(), &options);
            prop_assert!(p.iter().chain(&u).all(|x| x.is_finite()));
            if report.is_converged() {
                let broken = broken_laws(&problem, &p);
                prop_assert!(broken.is_empty(), "{method:?}: {broken:#?} with {report:?}");
            }
        }
    }
}

/// The story: `W = I`, `q = (-1, 1, 1)` and `mu = 1e12` were answered by `p = 0` and "converged",
/// with the contact approaching at 1 m/s; single methods did so from `mu = 1e8`, since De Saxcé's
/// `u_N + mu |u_T|` leaves no digit for `u_N`.
#[test]
fn no_friction_coefficient_lets_a_contact_approach() {
    for exponent in -300..=300 {
        let mu = 10.0_f64.powi(exponent);
        let problem = lone(1.0, &[-1.0, 1.0, 1.0], mu);
        for method in METHODS {
            let options = SolverOptions {
                max_sweeps: 100,
                ..by(method)
            };
            let (p, _, report) = cold(&problem.view(), &options);
            assert!(
                report.is_converged() || method == Method::Admm,
                "{method:?}, mu {mu:e}: {report:?}"
            );
            if report.is_converged() {
                let push = mu.min(2.0_f64.sqrt()) * 0.5_f64.sqrt();
                assert!(
                    distance(&p, &[1.0, -push, -push]) < 1e-9,
                    "{method:?}, mu {mu:e}: {p:?}"
                );
            }
        }
    }
}

/// Mass and velocity may be in any unit: from 1e-300 to 1e300 the answer is the same up to its own
/// unit.
#[test]
fn the_answer_does_not_depend_on_the_units() {
    let sound = parked_rover();
    let (reference, _, _) = solved(&sound);
    for stiffness in [-900, -40, 40, 900].map(|k| 2.0_f64.powi(k)) {
        for speed in [-100, 0, 100].map(|k| 2.0_f64.powi(k)) {
            let problem = Problem {
                W: sound.W.iter().map(|w| w * stiffness).collect(),
                q: sound.q.iter().map(|q| q * speed).collect(),
                ..sound.clone()
            };
            let options = SolverOptions {
                velocity_tolerance: 1e-9 * speed,
                ..SolverOptions::default()
            };
            let (p, _, report) = cold(&problem.view(), &options);
            assert!(
                report.is_converged(),
                "{stiffness:e}, {speed:e}: {report:?}"
            );
            let unit = speed / stiffness;
            let p: Vec<f64> = p.iter().map(|p| p / unit).collect();
            assert!(
                distance(&p, &reference) < 1e-12 * size(&reference),
                "{stiffness:e}, {speed:e}"
            );
        }
    }
}

/// The story: ADMM and the relaxation panicked on a problem without contacts.
#[test]
fn a_problem_without_contacts_is_solved_by_every_method() {
    for dimension in [Dimension::Two, Dimension::Three] {
        let problem = Problem {
            dimension,
            W: vec![],
            q: vec![],
            mu: vec![],
        };
        for method in Method::ALL {
            let (_, _, report) = cold(&problem.view(), &by(method));
            let expected = if method == Method::Relaxed {
                SolveStatus::SolvedRelaxed
            } else {
                SolveStatus::Converged
            };
            assert_eq!((report.status, report.stage), (expected, Stage::AtRest));
        }
    }
}

/// The story: `report.solver` said "newton" for four different ladders.
#[test]
fn the_report_names_the_stage_that_answered_and_those_before_it() {
    let stages = |report: &SolveReport| -> Vec<(Stage, SolveStatus)> {
        let rungs = report.rungs.as_slice();
        let total: usize = rungs.iter().map(|rung| rung.iterations as usize).sum();
        assert_eq!(total, report.iterations);
        rungs.iter().map(|rung| (rung.stage, rung.status)).collect()
    };
    let problem = parked_rover();
    let (mut p, _, first) = solved(&problem);
    // At rest some mode is ambiguous, which the guess leaves to Newton.
    assert_eq!(
        stages(&first),
        [
            (Stage::GuidedNewton, SolveStatus::Stalled),
            (Stage::Newton, SolveStatus::Converged)
        ]
    );
    assert_eq!(first.stage, Stage::Newton);
    let (_, warm) = solve_with(&problem, &SolverOptions::default(), &mut p);
    assert_eq!(stages(&warm), [(Stage::Pivoting, SolveStatus::Converged)]);
    let column = pile(&[1.0; 12], 0.9).problem(&falling(12, 9.81e-3));
    let (_, _, many) = solved(&column);
    assert_eq!(many.rungs.as_slice()[0].stage, Stage::Sweeps);
    assert_eq!(many.rungs.as_slice()[0].status, SolveStatus::Stalled);
    assert_eq!(
        many.rungs.as_slice().last().map(|rung| rung.stage),
        Some(many.stage)
    );
    for method in &METHODS[1..] {
        let (_, _, report) = cold(&problem.view(), &by(*method));
        assert_eq!(report.rungs.as_slice().len(), 1, "{method:?}");
        assert_eq!(report.rungs.as_slice()[0].stage, report.stage);
    }
}

/// A problem with nothing to do lists that, and one in other units the same stages.
#[test]
fn every_solve_lists_its_stages() {
    let rest = lone(1.0, &[0.0; 2], 0.5);
    let (_, _, report) = cold(&rest.view(), &SolverOptions::default());
    let rungs = report.rungs.as_slice();
    assert_eq!(rungs.len(), 1);
    assert_eq!(
        (rungs[0].stage, rungs[0].status, rungs[0].iterations),
        (Stage::AtRest, SolveStatus::Converged, 0)
    );
    // In other units the same stages, with the same ends.
    let problem = parked_rover();
    let tiny = Problem {
        q: problem.q.iter().map(|q| q * 1e-100).collect(),
        ..problem.clone()
    };
    let (_, _, usual) = solved(&problem);
    let (_, _, scaled) = solved(&tiny);
    assert_eq!(scaled.rungs, usual.rungs);
}

/// A column of discs, given by its contacts instead of W: if the sweeps are cut short the proximal
/// point method continues, and both are listed.
#[test]
fn free_bodies_list_their_sweeps_and_what_came_after_them() {
    let (n, mass, radius) = (20, 1.0_f64, 0.1);
    let inertia = 0.5 * mass * radius * radius;
    let (c, s) = (1.0 / mass.sqrt(), radius / inertia.sqrt());
    let side = |linear: f64, angular: f64, sign: f64| {
        let c = sign * linear;
        [[0.0, c, 0.0], [c, 0.0, angular]]
    };
    let mut pairs = BodyPairs {
        n_coordinates: 3 * n,
        machine_at: 3 * n,
        ..BodyPairs::<2>::default()
    };
    let mut contacts = Vec::new();
    for i in 0..n {
        let below = (i > 0).then(|| i - 1);
        let (c_b, s_b) = below.map_or((0.0, 0.0), |_| (c, s));
        pairs.round.push(RoundPair {
            bodies: [3 * i, 3 * below.unwrap_or(0)].map(|k| u32::try_from(k).expect("few")),
            frame: [[0.0, 1.0], [1.0, 0.0]],
            linear: [c, c_b],
            angular: [s, s_b],
            is_turned: false,
        });
        contacts.push(PairContact::<2, 3> {
            bodies: [Some(i), below],
            jacobians: [side(c, s, 1.0), side(c_b, s_b, -1.0)],
        });
    }
    let mut W = BlockSparseDelassus::new();
    W.assemble(&contacts, &vec![[1.0; 3]; n]);
    // All fall at 1 cm/s: only the lowest approaches what it touches.
    let mut q = vec![0.0; 2 * n];
    q[0] = -0.01;
    let mu = vec![0.5; n];
    let bodies = ManyBodies {
        pairs: &pairs,
        q: &q,
        mu: &mu,
        operator: &|| &W,
    };
    let options = SolverOptions {
        max_sweeps: 3,
        ..SolverOptions::default()
    };
    let (mut p, mut u) = (vec![0.0; 2 * n], vec![0.0; 2 * n]);
    let mut workspace = SolverWorkspace::new();
    let answer = ContactSolution {
        p: &mut p,
        u: &mut u,
        rolling: &mut [],
    };
    let report = solve_many_bodies(&bodies, &options, answer, &mut workspace);
    let rungs = report.rungs.as_slice();
    let ends: Vec<_> = rungs.iter().map(|rung| (rung.stage, rung.status)).collect();
    assert_eq!(
        ends,
        [
            (Stage::BodySweeps, SolveStatus::MaxIterations),
            (Stage::ProximalPoint, SolveStatus::Converged)
        ]
    );
    assert_eq!(report.stage, Stage::ProximalPoint);
    let total: usize = rungs.iter().map(|rung| rung.iterations as usize).sum();
    assert_eq!(total, report.iterations);
    // m v of the whole column stops at the floor, that of all above the k-th at the k-th.
    for (k, p) in p.chunks_exact(2).enumerate() {
        assert!(
            (p[0] - 0.01 * mass * (n - k) as f64).abs() < 1e-9,
            "{k}: {p:?}"
        );
    }
}

/// Twelve cubes on each other, of masses from 1 to 1000, pushed every way.
fn hard_problem() -> Problem {
    let masses: Vec<f64> = (0..12).map(|k| 10.0_f64.powi(k % 4)).collect();
    let mut v = falling(12, 9.81e-3);
    for (k, v) in v.iter_mut().enumerate() {
        *v += 1e-2 * (1.3 * (k * k) as f64).sin();
    }
    pile(&masses, 0.3).problem(&v)
}

/// The story: a step with 131 contacts took 3.5 s, one with 500 a minute. Work
/// is counted, so that the end is the same on every machine.
#[test]
fn a_budget_ends_every_method_with_the_nearest_answer_known() {
    let problem = hard_problem();
    let n = problem.q.len();
    for method in METHODS {
        let start = evaluate(&problem.view(), &vec![0.0; n]).relative;
        let mut last = start;
        let mut ends = 0;
        for budget in [0, 1 << 16, 1 << 18, 1 << 20, 1 << 22, 1 << 24] {
            let options = SolverOptions {
                budget: Some(budget),
                tolerance: 1e-14,
                velocity_tolerance: 1e-14,
                ..by(method)
            };
            let (p, u, report) = cold(&problem.view(), &options);
            assert!(report.work <= budget, "{method:?}: {report:?}");
            assert!(p.iter().chain(&u).all(|x| x.is_finite()));
            let judged = evaluate(&problem.view(), &p);
            assert!((judged.relative - report.residual).abs() <= 1e-9 * report.residual + 1e-13);
            assert!(
                report.residual <= start,
                "{method:?}: {report:?}, from {start:e}"
            );
            last = report.residual;
            ends += usize::from(report.status == SolveStatus::BudgetExhausted);
            assert_eq!(cold(&problem.view(), &options), (p, u, report));
        }
        assert!(ends >= 2, "{method:?}: the budget never mattered");
        // Full Newton steps alone get nowhere here.
        assert!(
            last < 0.9 * start || method == Method::Newton,
            "{method:?}: {last:e} is the best"
        );
    }
}

/// Numbers in [0, 1) by SplitMix64.
fn uniform(mut state: u64) -> impl FnMut() -> f64 {
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A mechanism of `n_contacts` and `nv` velocities, and its problem.
fn random_mechanism(n_contacts: usize, nv: usize, mut next: impl FnMut() -> f64) -> Problem {
    let scene = Scene {
        dimension: Dimension::Three,
        rows: (0..3 * n_contacts)
            .map(|_| (0..nv).map(|_| 2.0 * next() - 1.0).collect())
            .collect(),
        inverse_mass: (0..nv).map(|_| 10.0_f64.powf(2.0 * next() - 1.0)).collect(),
        mu: (0..n_contacts).map(|_| next()).collect(),
    };
    let v: Vec<f64> = (0..nv).map(|_| 2.0 * next() - 1.0).collect();
    scene.problem(&v)
}

/// Number of random problems that converge; deterministic, so that a less robust solver shows.
#[test]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // sizes from 0 to 15
fn most_random_mechanisms_are_solved() {
    let mut next = uniform(1);
    let (mut converged, mut iterations, total) = (0, 0, 2000);
    for _ in 0..total {
        let (n_c, nv) = (1 + (8.0 * next()) as usize, 1 + (16.0 * next()) as usize);
        let problem = random_mechanism(n_c, nv, &mut next);
        let (_, _, report) = cold(&problem.view(), &SolverOptions::default());
        converged += usize::from(report.is_converged());
        iterations += report.iterations;
    }
    assert!(converged >= RANDOM_CONVERGED, "{converged} of {total}");
    assert!(iterations <= RANDOM_ITERATIONS, "{iterations}");
}

/// Wedged machines took a thousand iterations each, and some stayed unsolved: friction at eight
/// contacts on all sides holds what moves in a few ways only.
#[test]
fn wedged_mechanisms_are_answered_by_pyramids() {
    let mut next = uniform(2);
    let (mut pyramids, mut unsolved, mut most) = (0, 0, 0);
    for _ in 0..2000 {
        let problem = random_mechanism(8, 6, &mut next);
        let options = SolverOptions {
            acceptable: 1e-8,
            ..SolverOptions::default()
        };
        let (p, u, report) = cold(&problem.view(), &options);
        if report.is_converged() {
            let residual = evaluate(&problem.view(), &p);
            assert!(residual.velocity <= 1e-8, "{residual:?}, {u:?}");
        }
        assert_eq!(
            report.status == SolveStatus::Acceptable,
            report.residual > 1e-12 && report.is_converged()
        );
        pyramids += usize::from(report.stage == Stage::Pyramids);
        unsolved += usize::from(!report.is_converged());
        most = most.max(report.iterations);
    }
    assert!(
        pyramids > 1000 && unsolved == 0 && most <= 1200,
        "{pyramids} {unsolved} {most}"
    );
}

/// Snapshot of the test above. Random mechanisms may have no solution at
/// all (frictional jamming), unlike real ones.
const RANDOM_CONVERGED: usize = 1995;
const RANDOM_ITERATIONS: usize = 41_000;
