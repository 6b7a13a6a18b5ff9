//! A box of 1 kg on a slope of 25 degrees with friction 0.3: one time step of 10 ms from rest.
#![allow(clippy::print_stdout)] // its purpose
use friction_contact::nalgebra::{SMatrix, SVector, Vector3};
use friction_contact::problem::{Dimension, FrictionContactProblem};
use friction_contact::solver::{SolverOptions, SolverWorkspace, solve};

fn main() {
    let (half, mu, h) = ([0.2, 0.1, 0.15], [0.3; 4], 0.01); // m, friction, s
    let slope = 25.0_f64.to_radians();
    // Velocity and rate of turning of the box; x down the slope, y out of it.
    let inverse_mass =
        SMatrix::<f64, 6, 6>::from_diagonal(&SVector::from([1.0, 1.0, 1.0, 92.3, 48.0, 60.0]));
    let gravity = SVector::<f64, 6>::from([slope.sin(), -slope.cos(), 0.0, 0.0, 0.0, 0.0]) * 9.81;
    // Columns of H: normal y, tangents x and z at each of the four lower corners.
    let mut H = SMatrix::<f64, 6, 12>::zeros();
    for (i, [x, z]) in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]
        .into_iter()
        .enumerate()
    {
        let arm = Vector3::new(x * half[0], -half[1], z * half[2]);
        for (k, axis) in [Vector3::y(), Vector3::x(), Vector3::z()]
            .into_iter()
            .enumerate()
        {
            H.fixed_view_mut::<3, 1>(0, 3 * i + k).copy_from(&axis);
            H.fixed_view_mut::<3, 1>(3, 3 * i + k)
                .copy_from(&arm.cross(&axis));
        }
    }
    let W = H.transpose() * inverse_mass * H; // symmetric, so columns may stand for rows
    let q = H.transpose() * gravity * h;
    let problem =
        FrictionContactProblem::new(Dimension::Three, W.as_slice(), q.as_slice(), &mu).unwrap();
    let (mut p, mut u) = ([0.0; 12], [0.0; 12]);
    let report = solve(
        &problem,
        &SolverOptions::default(),
        &mut p,
        &mut u,
        &mut SolverWorkspace::new(),
    );
    let expected = 9.81 * (slope.sin() - mu[0] * slope.cos()) * h;
    println!(
        "{}: slips at {:.6} m/s, by hand {expected:.6} m/s",
        report.status.name(),
        u[1]
    );
}
