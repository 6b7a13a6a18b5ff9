//! The convex relaxation of Coulomb's law, [`crate::law::associated`]: a different law, whose
//! problem is convex. Alternating directions provably solve it.

use crate::law::associated::natural_map;
use crate::problem::{Prepared, Residual};
use crate::solver::report::SolveStatus;
use crate::solver::scratch::{Attempt, StageEnd};
use crate::solver::stage::admm::{self, AdmmLaw};

/// Residual of `(p, u)` under the relaxed law, with the same two numbers as for Coulomb's law.
fn measure<const D: usize>(data: &Prepared<'_>, p: &[f64], u: &[f64]) -> Residual {
    let (mut map, mut velocity) = (0.0, 0.0_f64);
    for (i, (&mu, &rho)) in data.mu.iter().zip(data.masses).enumerate() {
        let [p, u]: [[f64; D]; 2] = [p, u].map(|x| std::array::from_fn(|k| x[D * i + k]));
        let square: f64 = natural_map(&p, &u, mu, rho).iter().map(|x| x.powi(2)).sum();
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
pub(in crate::solver) fn solve<const D: usize>(attempt: &mut Attempt<'_, D>) -> StageEnd {
    let data = attempt.data;
    let law = AdmmLaw {
        shifts: false,
        measure: |p: &[f64], u: &[f64]| measure::<D>(data, p, u),
        solved: SolveStatus::SolvedRelaxed,
    };
    admm::alternate(attempt, &law)
}
