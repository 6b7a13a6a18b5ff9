//! The residual of an impulse: its violation of Signorini's and Coulomb's laws, relative and in
//! m/s.
//!
//! Each contact is judged by [`violation`](crate::law::coulomb::violation), a velocity `v_i` in m/s that vanishes exactly where
//! both laws hold; its scales are the contact's own, `ρ_N = 1/W_NN` and `ρ_T` the inverse mean of
//! the tangential diagonal, so that no other contact's mass and no friction coefficient enters.
//! With the contact's mass `ρ_i = d / tr W_ii` the residual has two numbers (none of the three
//! scales depends on the choice of tangents):
//!
//! - `relative`, the error relative to the free velocity: the larger of `|(ρ_i v_i)| / |(ρ_i q_i)|`
//!   (impulses, which show the error of heavy contacts) and `|(v_i)| / |(q_i)|` (velocities, which
//!   show that of light ones);
//! - `velocity = max_i |v_i|` in m/s.

use super::scales::{contact_scales, power_of_two};
use super::{Dimension, FrictionContactProblem};
use crate::law::coulomb::Coulomb;
use crate::law::friction_law::FrictionLaw;

/// Distance of an impulse from the law, see the page above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Violation relative to the data, dimensionless; `|(ρ_i v_i)|` in N s when `q = 0`.
    pub relative: f64,
    /// Largest violation at one contact, m/s.
    pub velocity: f64,
}

impl Residual {
    /// Both numbers infinite: the residual before any answer.
    pub const UNSOLVED: Self = Self {
        relative: f64::INFINITY,
        velocity: f64::INFINITY,
    };

    /// Whether both numbers are finite.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.relative.is_finite() && self.velocity.is_finite()
    }
}

/// Local velocity `u = W p + q` (n), m/s, of the impulses `p` (n), N s.
///
/// # Panics
/// If `p` or `u` has not the problem's number of unknowns.
fn local_velocity(problem: &FrictionContactProblem<'_>, p: &[f64], u: &mut [f64]) {
    assert!(
        p.len() == problem.n_unknowns(),
        "p must have one entry per unknown"
    );
    assert!(
        u.len() == problem.n_unknowns(),
        "u must have one entry per unknown"
    );
    problem
        .operator()
        .multiply_add(p, problem.free_velocity(), u);
}

/// Violation of the contact that starts at `offset`: square in (m/s)².
#[inline]
pub(crate) fn evaluate_contact<const D: usize>(
    p: &[f64],
    u: &[f64],
    offset: usize,
    law: &impl FrictionLaw<D>,
    scales: [f64; 2],
) -> f64 {
    let mut p_i = [0.0; D];
    let mut u_i = [0.0; D];
    p_i.copy_from_slice(&p[offset..offset + D]);
    u_i.copy_from_slice(&u[offset..offset + D]);
    law.violation(&p_i, &u_i, scales)
        .iter()
        .map(|x| x * x)
        .sum()
}

/// Sums over the contacts from which the two numbers follow.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ViolationSums {
    /// `Σ |v_i|²`, (m/s)².
    pub squares: f64,
    /// `Σ |ρ_i v_i|²`, (N s)².
    pub weighted: f64,
    /// `max |v_i|²`, (m/s)².
    pub largest: f64,
}

impl ViolationSums {
    /// Adds a contact of mass `mass` (kg) with a violation of `square` (m²/s²).
    #[inline]
    pub fn add(&mut self, square: f64, mass: f64) {
        self.squares += square;
        self.weighted += (mass * mass) * square;
        self.largest = self.largest.max(square);
    }

    /// Adds those of other contacts.
    pub fn join(&mut self, other: &Self) {
        self.squares += other.squares;
        self.weighted += other.weighted;
        self.largest = self.largest.max(other.largest);
    }

    /// The residual; `inverse_speed` is `1/|q|` and `inverse_data` is `1/|(ρ_i q_i)|`.
    #[inline]
    pub fn residual(&self, inverse_speed: f64, inverse_data: f64) -> Residual {
        // A NaN appears in both sums.
        if !(self.squares.is_finite() && self.weighted.is_finite()) {
            return Residual::UNSOLVED;
        }
        let (velocity, impulse) = (
            self.squares.sqrt() * inverse_speed,
            self.weighted.sqrt() * inverse_data,
        );
        Residual {
            relative: velocity.max(impulse),
            velocity: self.largest.sqrt(),
        }
    }
}

/// Sums of the data that [`ViolationSums`] are measured against.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Magnitudes {
    squares: f64,
    weighted: f64,
}

impl Magnitudes {
    /// Adds the free velocity of a contact of mass `mass` (kg).
    #[inline]
    pub fn add(&mut self, q: &[f64], mass: f64) {
        let square: f64 = q.iter().map(|x| x * x).sum();
        self.squares += square;
        self.weighted += (mass * mass) * square;
    }

    /// `1/|q|` and `1/|(ρ_i q_i)|`; 0 and 1 if `q = 0`.
    #[inline]
    pub fn inverses(&self) -> [f64; 2] {
        if self.squares > 0.0 {
            [1.0 / self.squares.sqrt(), 1.0 / self.weighted.sqrt()]
        } else {
            [0.0, 1.0]
        }
    }
}

/// In units of the largest free velocity and the largest mass, so that no
/// square overflows or vanishes.
fn evaluate_in<const D: usize>(
    problem: &FrictionContactProblem<'_>,
    p: &[f64],
    u: &[f64],
) -> Residual {
    let q = problem.free_velocity();
    let speed = power_of_two(q.iter().fold(0.0, |m, x| m.max(x.abs())));
    let masses = (0..problem.n_contacts()).map(|i| contact_scales(problem, i).mass);
    let mass = power_of_two(masses.fold(0.0, f64::max));
    let (mut violations, mut data) = (ViolationSums::default(), Magnitudes::default());
    for (contact, &mu) in problem.friction_coefficients().iter().enumerate() {
        let scales = contact_scales(problem, contact);
        let at = |k: usize| D * contact + k;
        let p_i: [f64; D] = std::array::from_fn(|k| p[at(k)] / mass / speed);
        let u_i: [f64; D] = std::array::from_fn(|k| u[at(k)] / speed);
        let q_i: [f64; D] = std::array::from_fn(|k| q[at(k)] / speed);
        let square = evaluate_contact::<D>(
            &p_i,
            &u_i,
            0,
            &Coulomb(mu),
            scales.modes.map(|rho| rho / mass),
        );
        violations.add(square, scales.mass / mass);
        data.add(&q_i, scales.mass / mass);
    }
    let [inverse_speed, inverse_data] = data.inverses();
    let Residual { relative, velocity } = violations.residual(inverse_speed, inverse_data);
    Residual {
        relative: if inverse_speed > 0.0 {
            relative
        } else {
            relative * mass * speed
        },
        velocity: velocity * speed,
    }
}

/// Residual of `p`; also computes `u = W p + q`.
///
/// `p`: impulses (n), N s. `u`: local velocities (n), m/s, output.
///
/// # Panics
/// If `p` or `u` has not the problem's number of unknowns.
#[must_use]
pub fn evaluate_into(problem: &FrictionContactProblem<'_>, p: &[f64], u: &mut [f64]) -> Residual {
    local_velocity(problem, p, u);
    match problem.dimension() {
        Dimension::Two => evaluate_in::<2>(problem, p, u),
        Dimension::Three => evaluate_in::<3>(problem, p, u),
    }
}

/// Residual of `p` (n), N s; allocates the velocities it needs.
///
/// # Panics
/// If `p` has not the problem's number of unknowns.
#[must_use]
pub fn evaluate(problem: &FrictionContactProblem<'_>, p: &[f64]) -> Residual {
    evaluate_into(problem, p, &mut vec![0.0; problem.n_unknowns()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resting_block_has_no_residual_and_a_floating_one_its_velocity() {
        let W = [0.5, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5];
        let q = [-0.1, 0.02, 0.0];
        let problem = FrictionContactProblem::new(Dimension::Three, &W, &q, &[0.7]).expect("sound");
        // m = 2 kg sticks: p = −m q.
        let solved = evaluate(&problem, &[0.2, -0.04, 0.0]);
        assert!(solved.relative < 1e-15 && solved.velocity < 1e-15);
        let open = evaluate(&problem, &[0.0; 3]);
        assert!(open.relative > 0.5 && open.velocity > 0.08, "{open:?}");
    }

    #[test]
    fn an_approach_is_seen_at_every_scale() {
        for scale in [1e-300, 1e-12, 1.0, 1e12, 1e300] {
            for stiffness in [1e-300, 1e-12, 1.0, 1e12, 1e300] {
                let W = [stiffness, 0.0, 0.0, stiffness];
                let q = [-scale, scale];
                let problem =
                    FrictionContactProblem::new(Dimension::Two, &W, &q, &[1e12]).expect("sound");
                let found = evaluate(&problem, &[0.0; 2]);
                assert!((found.relative - 0.5_f64.sqrt()).abs() < 1e-14, "{found:?}");
                assert!((found.velocity / scale - 1.0).abs() < 1e-14, "{found:?}");
            }
        }
    }

    #[test]
    fn neither_a_heavy_nor_a_light_contact_hides_the_other() {
        // Two uncoupled contacts, 1 kg and 1e12 kg; one of them keeps its approach velocity.
        let mut W = vec![0.0; 16];
        for (k, w) in [1.0, 1.0, 1e-12, 1e-12].into_iter().enumerate() {
            W[5 * k] = w;
        }
        let q = [-1.0, 0.0, -1.0, 0.0];
        let problem =
            FrictionContactProblem::new(Dimension::Two, &W, &q, &[0.5; 2]).expect("sound");
        assert!(evaluate(&problem, &[1.0, 0.0, 0.0, 0.0]).relative > 0.5);
        assert!(evaluate(&problem, &[0.0, 0.0, 1e12, 0.0]).relative > 0.5);
        assert!(evaluate(&problem, &[1.0, 0.0, 1e12, 0.0]).relative < 1e-15);
    }

    #[test]
    fn a_nan_is_unsolved() {
        let W = [f64::NAN, 0.0, 0.0, 1.0];
        let problem = FrictionContactProblem::from_assembled(Dimension::Two, &W, &[0.0; 2], &[0.5]);
        assert!(!evaluate(&problem, &[0.0; 2]).is_finite());
    }
}
