//! A row of touching spheres whose masses alternate between 1 and 1e6 kg, struck at its end.

use crate::solving::cold;
use friction_contact::nalgebra::Vector3;
use friction_contact::problem::{
    BlockSparseDelassus, Dimension, FrictionContactProblem, PairContact,
};
use friction_contact::solver::SolverOptions;

const RADIUS: f64 = 0.1;
/// Gravity times the step, m/s.
const FALL: f64 = 9.81e-3;

/// The row lies along x on level ground; the first sphere moves at 1 m/s towards the others.
fn contacts(count: usize) -> Vec<PairContact<3, 6>> {
    let (along, up) = (Vector3::x(), Vector3::y());
    let touch = |bodies: [Option<usize>; 2], normal: Vector3<f64>| {
        let tangents = [Vector3::z(), normal.cross(&Vector3::z())];
        let side = |sign: f64| {
            [normal, tangents[0], tangents[1]].map(|direction| {
                // The contact is a radius along the normal from the first body's centre, and a
                // radius against it from the second's.
                let arm = -sign * RADIUS * normal;
                let spin = arm.cross(&direction);
                let (d, s) = (sign * direction, sign * spin);
                [d.x, d.y, d.z, s.x, s.y, s.z]
            })
        };
        PairContact {
            bodies,
            jacobians: [side(-1.0), side(1.0)],
        }
    };
    let on_ground = (0..count).map(|k| touch([None, Some(k)], up));
    let in_row = (1..count).map(|k| touch([Some(k - 1), Some(k)], along));
    on_ground.chain(in_row).collect()
}

/// The story: `auto` began its last stages from an answer that was worse than none, and the row of
/// 300 was not solved in 0.5 s.
#[test]
fn a_row_of_300_spheres_of_alternating_mass_is_solved_with_the_usual_budget() {
    let count = 300;
    let contacts = contacts(count);
    let masses: Vec<[f64; 6]> = (0..count)
        .map(|k| {
            let mass = if k % 2 == 0 { 1.0 } else { 1e6 };
            let (linear, turning) = (1.0 / mass, 2.5 / (mass * RADIUS * RADIUS));
            [linear, linear, linear, turning, turning, turning]
        })
        .collect();
    let free = |k: usize| [if k == 0 { 1.0 } else { 0.0 }, -FALL, 0.0, 0.0, 0.0, 0.0];
    let mut q = Vec::new();
    for contact in &contacts {
        for r in 0..3 {
            let sides = contact.bodies.iter().zip(&contact.jacobians);
            q.push(
                sides
                    .filter_map(|(body, rows)| body.map(|k| (free(k), rows[r])))
                    .map(|(v, row)| v.iter().zip(row).map(|(v, x)| v * x).sum::<f64>())
                    .sum::<f64>(),
            );
        }
    }
    let mut W = BlockSparseDelassus::new();
    W.assemble(&contacts, &masses);
    let mu = vec![0.5; contacts.len()];
    let problem = FrictionContactProblem::new_sparse(Dimension::Three, &W, &q, &mu).unwrap();
    let options = SolverOptions {
        tolerance: 1e-8,
        velocity_tolerance: 1e-8,
        ..SolverOptions::default()
    };
    let (p, _, report) = cold(&problem, &options);
    assert!(report.is_converged(), "{report:?}");
    // The ground carries the weight, 150 spheres of each mass.
    let carried: f64 = p.chunks_exact(3).take(count).map(|p| p[0]).sum();
    let weight = FALL * 150.0 * (1.0 + 1e6);
    let share = carried / weight;
    assert!((share - 1.0).abs() < 1e-6, "{share}");
}
