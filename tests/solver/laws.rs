//! Laws of friction that are not in the core, as the recipe "Add a contact law" has them, and
//! Poisson's impact law beside Newton's.

use crate::solving::cold;
use friction_contact::law::coulomb::Coulomb;
use friction_contact::law::friction_law::FrictionLaw;
use friction_contact::law::frictionless::Frictionless;
use friction_contact::law::mode::ContactMode;
use friction_contact::law::newton_impact::rebound;
use friction_contact::problem::{Dimension, FrictionContactProblem};
use friction_contact::solver::{
    SolveReport, SolverOptions, SolverWorkspace, solve_poisson_impact, solve_with_laws,
};

/// Friction that depends on the direction, as on a brushed surface: the section is an ellipse,
/// `(p_t/μ_t)² + (p_b/μ_b)² ≤ p_N²`.
#[derive(Clone, Copy)]
struct Anisotropic([f64; 2]);

impl FrictionLaw<3> for Anisotropic {
    fn project(&self, p_N: f64, z: &[f64; 3]) -> [f64; 3] {
        let [a, b] = self.0.map(|mu| mu * p_N.max(0.0));
        let [_, x, y] = *z;
        if a == 0.0 || b == 0.0 {
            return [z[0], 0.0, 0.0];
        }
        let scaled = |t: f64| [a * a * x / (a * a + t), b * b * y / (b * b + t)];
        let outside = |t: f64| {
            let [px, py] = scaled(t);
            (px / a).powi(2) + (py / b).powi(2) - 1.0
        };
        if outside(0.0) <= 0.0 {
            return *z;
        }
        // The point of the ellipse whose normal leads to z, at the root of a falling function.
        let (mut low, mut high) = (0.0, a.max(b) * x.hypot(y));
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if outside(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let [px, py] = scaled(high);
        [z[0], px, py]
    }
}

/// Friction of a lubricant that shears at a constant force, whatever the load (Tresca).
#[derive(Clone, Copy)]
struct Sheared(f64);

impl<const D: usize> FrictionLaw<D> for Sheared {
    fn project(&self, p_N: f64, z: &[f64; D]) -> [f64; D] {
        let limit = if p_N > 0.0 { self.0 } else { 0.0 };
        Coulomb(limit).project(1.0, z)
    }
}

fn tight() -> SolverOptions {
    SolverOptions {
        tolerance: 1e-11,
        velocity_tolerance: 1e-11,
        max_sweeps: 100_000,
        ..SolverOptions::default()
    }
}

/// W of a pile of cubes: block k stands on block k − 1, all of 1 kg, with their mass centres in
/// line, so that moments play no part; a force acts on each along x and z.
fn pile(n: usize, force: [f64; 2]) -> (Vec<f64>, Vec<f64>) {
    let size = 3 * n;
    let mut W = vec![0.0; size * size];
    for i in 0..n {
        for k in 0..3 {
            let at = 3 * i + k;
            W[at * size + at] = if i == 0 { 1.0 } else { 2.0 };
            if i > 0 {
                W[at * size + at - 3] = -1.0;
                W[(at - 3) * size + at] = -1.0;
            }
        }
    }
    let mut q = vec![0.0; size];
    q[..3].copy_from_slice(&[-1.0, force[0], force[1]]);
    (W, q)
}

fn solved<L: FrictionLaw<3> + Copy>(
    (W, q): &(Vec<f64>, Vec<f64>),
    law: L,
) -> (SolveReport, Vec<[f64; 3]>, Vec<[f64; 3]>) {
    let n = q.len() / 3;
    let mu = vec![0.0; n];
    let problem = FrictionContactProblem::new(Dimension::Three, W, q, &mu).expect("sound");
    let (mut p, mut u) = (vec![0.0; 3 * n], vec![0.0; 3 * n]);
    let mut workspace = SolverWorkspace::new();
    let laws = vec![law; n];
    let options = tight();
    let report = solve_with_laws(&problem, &laws, &options, &mut p, &mut u, &mut workspace);
    let rows = |x: &[f64]| x.as_chunks::<3>().0.to_vec();
    (report, rows(&p), rows(&u))
}

/// A block on a brushed table: it sticks inside the ellipse and slides out of it, where the slip is
/// normal to the ellipse at the impulse.
#[test]
fn a_block_slides_on_a_brushed_table_along_the_normal_of_the_ellipse() {
    let law = Anisotropic([0.6, 0.2]);
    let (report, p, u) = solved(&pile(1, [0.5, 0.05]), law);
    assert!(report.is_converged());
    assert!(
        (p[0][1] + 0.5).abs() < 1e-9 && u[0].iter().all(|u| u.abs() < 1e-9),
        "sticks"
    );
    let (report, p, u) = solved(&pile(1, [0.5, 0.4]), law);
    assert!(report.is_converged());
    let ([p_N, x, y], [_, v, w]) = (p[0], u[0]);
    assert!((p_N - 1.0).abs() < 1e-9);
    assert!(
        ((x / 0.6).powi(2) + (y / 0.2).powi(2) - 1.0).abs() < 1e-9,
        "on the ellipse"
    );
    let normal = [x / 0.36, y / 0.04];
    assert!(
        (normal[0] * w - normal[1] * v).abs() < 1e-9,
        "along the normal"
    );
    assert!(normal[0] * v + normal[1] * w < 0.0, "against the slip");
    let mode = law.linearise(&p[0], &u[0], [1.0, 1.0]);
    assert_eq!(mode.kind(), ContactMode::Slip);
    let e = mode.direction();
    assert!((e[0] * y - e[1] * x).abs() < 1e-9);
    let size = x.hypot(y);
    assert!((mode.gamma - v.hypot(w) / size).abs() < 1e-6, "{mode:?}");
}

/// With equal coefficients the ellipse is Coulomb's disc, and all methods agree.
#[test]
fn a_round_ellipse_is_coulombs_law() {
    let data = pile(4, [0.7, 0.3]);
    let (report, _, u) = solved(&data, Anisotropic([0.4, 0.4]));
    let (by_sweeps, _, same) = solved(&data, Coulomb(0.4));
    assert!(report.is_converged() && by_sweeps.is_converged());
    let mu = [0.4; 4];
    let problem = FrictionContactProblem::new(Dimension::Three, &data.0, &data.1, &mu).unwrap();
    let (_, exact, report) = cold(&problem, &tight());
    assert!(report.is_converged());
    for ((a, b), c) in u.iter().zip(&same).zip(exact.as_chunks::<3>().0) {
        for k in 0..3 {
            assert!(
                (a[k] - c[k]).abs() < 1e-8 && (b[k] - c[k]).abs() < 1e-8,
                "{a:?} {c:?}"
            );
        }
    }
}

/// A sheared film holds a block below its limit and takes the same force from a light and from a
/// heavy load beyond it; without a film nothing holds.
#[test]
fn a_sheared_film_takes_its_force_whatever_the_load() {
    for load in [1.0, 10.0] {
        let (W, mut q) = pile(1, [0.8, 0.0]);
        q[0] = -load;
        let (report, p, u) = solved(&(W, q), Sheared(0.3));
        assert!(report.is_converged());
        assert!(
            (p[0][0] - load).abs() < 1e-9 && (u[0][1] - 0.5).abs() < 1e-9,
            "{u:?}"
        );
    }
    let (_, _, held) = solved(&pile(1, [0.2, 0.0]), Sheared(0.3));
    assert!(held[0][1].abs() < 1e-9);
    let (report, p, free) = solved(&pile(3, [0.2, 0.0]), Frictionless);
    assert!(report.is_converged());
    assert!(p.iter().all(|p| p[1] == 0.0) && (free[0][1] - 0.2).abs() < 1e-12);
}

fn poisson(W: &[f64], q: &[f64], mu: &[f64], e: f64) -> (SolveReport, Vec<f64>, Vec<f64>) {
    let problem = FrictionContactProblem::new(Dimension::Two, W, q, mu).expect("sound");
    let (mut p, mut u) = (vec![0.0; q.len()], vec![0.0; q.len()]);
    let mut workspace = SolverWorkspace::new();
    let restitution = vec![e; mu.len()];
    let report = solve_poisson_impact::<2>(
        &problem,
        &restitution,
        &tight(),
        &mut p,
        &mut u,
        &mut workspace,
    );
    (report, p, u)
}

/// Change of the energy by an impact, `½ pᵀ(u⁻ + u⁺)`.
fn gain(p: &[f64], before: &[f64], after: &[f64]) -> f64 {
    let rows = p.iter().zip(before.iter().zip(after));
    0.5 * rows.map(|(p, (a, b))| p * (a + b)).sum::<f64>()
}

/// Three equal balls in a row, the first of which strikes: without friction and with no contact
/// lost in the compression Poisson's law is Newton's.
#[test]
fn poisson_agrees_with_newton_on_a_row_of_balls() {
    let mut W = vec![0.0; 16];
    (W[0], W[10], W[2], W[8]) = (2.0, 2.0, -1.0, -1.0);
    (W[5], W[15]) = (1.0, 1.0);
    let q = [-1.0, 0.0, 0.0, 0.0];
    for e in [0.0, 0.4, 1.0] {
        let (report, p, u) = poisson(&W, &q, &[0.0; 2], e);
        assert!(report.is_converged());
        assert!((u[0] - e).abs() < 1e-9 && u[2].abs() < 1e-9, "{u:?}");
        assert!((p[0] - (1.0 + e) * 2.0 / 3.0).abs() < 1e-9, "{p:?}");
        let expected = -(1.0 - e * e) / 3.0;
        assert!((gain(&p, &q, &u) - expected).abs() < 1e-9);
    }
}

/// Rods that strike the ground at all angles and velocities. Newton's law lets some of them gain
/// energy by friction; Poisson's never does.
#[test]
fn poisson_gains_no_energy_where_newton_does() {
    let (mut most_newton, mut most_poisson) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for step in 0..40 {
        let angle = 0.04 * f64::from(step);
        // A rod of 1 kg and half length 1 m, J = 1/3: contact at one end.
        let (x, y) = (angle.cos(), angle.sin());
        let W = [
            1.0 + 3.0 * x * x,
            -3.0 * x * y,
            -3.0 * x * y,
            1.0 + 3.0 * y * y,
        ];
        for slip in [-3.0, -1.0, -0.5, -0.1, 0.1, 0.5, 1.0, 3.0] {
            for mu in [0.1, 0.5, 1.0] {
                let q = [-1.0, slip];
                let (report, p, u) = poisson(&W, &q, &[mu], 1.0);
                assert!(report.is_converged(), "{angle} {slip} {mu}");
                assert!(p[1].abs() <= mu * p[0] + 1e-9, "in the cone");
                assert!(u[0] >= -1e-9, "apart");
                most_poisson = most_poisson.max(gain(&p, &q, &u));
                let shifted = [q[0] + rebound(1.0, q[0]), slip];
                let mu = [mu];
                let problem = FrictionContactProblem::new(Dimension::Two, &W, &shifted, &mu);
                let (p, mut u, report) = cold(&problem.unwrap(), &tight());
                assert!(report.is_converged());
                u[0] -= rebound(1.0, q[0]);
                most_newton = most_newton.max(gain(&p, &q, &u));
            }
        }
    }
    assert!(most_poisson < 1e-9, "{most_poisson} J");
    assert!(most_newton > 0.01, "{most_newton} J");
}
