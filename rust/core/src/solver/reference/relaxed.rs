//! The convex relaxation of Coulomb's law, `K_μ* ∋ u ⊥ p ∈ K_μ`: a sliding contact separates at the
//! speed `μ|u_T|`.
//!
//! Without De Saxcé's shift the problem is convex, and a different law. Alternating directions
//! provably solve it.

use crate::cone::SecondOrderCone;
use crate::problem::{Prepared, Residual};
use crate::solver::options::SolverOptions;
use crate::solver::report::SolveStatus;
use crate::solver::scratch::Scratch;
use crate::solver::stage::admm::{self, Law};

/// Residual of `(p, u)` under the relaxed law, with the same two numbers as for Coulomb's law.
fn measure<const D: usize>(data: &Prepared<'_>, p: &[f64], u: &[f64]) -> Residual {
    let (mut map, mut velocity) = (0.0, 0.0_f64);
    for (i, (&mu, &rho)) in data.mu.iter().zip(data.masses).enumerate() {
        let z: [f64; D] = std::array::from_fn(|k| p[D * i + k] - rho * u[D * i + k]);
        let projected = SecondOrderCone::new(mu).project(&z);
        let square: f64 = (0..D).map(|k| (p[D * i + k] - projected[k]).powi(2)).sum();
        map += square;
        velocity = velocity.max(square / (rho * rho));
    }
    if map.is_finite() {
        Residual {
            relative: map.sqrt() * data.inverse_data,
            velocity: velocity.sqrt(),
        }
    } else {
        Residual::UNSOLVED
    }
}

/// Iterates from `p`. `u` is `W p + q` on return, and the residual is Coulomb's.
pub(in crate::solver) fn solve<const D: usize>(
    data: &Prepared<'_>,
    options: &SolverOptions,
    p: &mut [f64],
    u: &mut [f64],
    scratch: &mut Scratch,
    iterations: &mut usize,
) -> (SolveStatus, Residual) {
    let law = Law {
        shifts: false,
        measure: |p: &[f64], u: &[f64]| measure::<D>(data, p, u),
        solved: SolveStatus::SolvedRelaxed,
    };
    admm::alternate::<D, _>(data, options, &law, p, u, scratch, iterations)
}
