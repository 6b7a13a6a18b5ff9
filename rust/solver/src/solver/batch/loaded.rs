//! How the problems of several rovers become the [systems](System) of their lanes.

use super::problem::ContactProblem;
use crate::law::mode::ContactMode;
use crate::law::one_contact::solve_one_contact;
use crate::scalar::Lane;
use crate::solver::pivoting::{Few, System, Triple};

/// Systems of at most `C` contacts, each of a lane's own problem.
pub(super) trait Loaded<T: Lane, const C: usize>: System<T, Few<C>> + Sized {
    /// Most steps of an attempt. What is unsolved then goes in circles, mostly.
    const MAX_STEPS: usize;

    /// Without problems.
    fn new(token: T::Token) -> Self;

    /// Gives a lane the operator of a problem. Returns the places whose other data change.
    fn load(&mut self, lane: usize, problem: &ContactProblem) -> Self::Places;

    /// Number of a problem's contact at a place, if it has one there.
    fn contact_at(problem: &ContactProblem, place: usize) -> Option<usize>;

    /// The least that is added to the diagonal of a problem's operator, 1/kg.
    #[inline(always)]
    fn least_softness(_problem: &ContactProblem) -> f64 {
        0.0
    }

    /// Smallest pivot of a lane's last factors, 1/kg; 0 if it says nothing about the rank of W.
    #[inline(always)]
    fn least_pivot(&self, _lane: usize) -> f64 {
        0.0
    }

    /// Diagonal block of a problem's contact.
    fn block_of(problem: &ContactProblem, contact: usize) -> &[f64; 9];

    /// Free velocity of a place, m/s.
    fn free_velocity_mut(&mut self, place: usize) -> &mut Triple<T>;
}

/// Mode and impulse of a lane's contact with the diagonal block `W`, see [`System::solve_one`].
#[inline(always)]
pub(super) fn solve_one<T: Lane>(
    W: &[T; 9],
    lane: usize,
    free: &Triple<f64>,
    mu: f64,
) -> (ContactMode, Triple<f64>) {
    let [a, b, c, d, e, f, g, h, k] = W.map(|w| w.get(lane));
    let own = solve_one_contact(&[[a, b, c], [d, e, f], [g, h, k]], free, mu);
    (own.mode, own.impulse)
}
