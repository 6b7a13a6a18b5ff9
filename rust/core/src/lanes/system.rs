//! What pivoting needs of the operator of its problems.

use super::modes::Mode;
use super::problem::{ContactProblem, Triple};
use crate::scalar::Lane;

/// Operators `W` of several problems side by side, of at most `C` contacts each, and the linear
/// systems of their modes.
pub(super) trait System<T: Lane, const C: usize>: Sized {
    /// Places of contacts, ascending.
    type Places: Iterator<Item = usize>;

    /// First `α` of the proximal term `α (p − c)`, relative to the mean diagonal of `W`. A step's
    /// error is `α` times the change of the impulse, and the rounding of `W p + q`, divided by `α`,
    /// drifts into the null space of `W`. The ratio test bounds that where wheels slide. A parked
    /// rover, whose impulses hardly change, collects it step by step: its `α` may be larger.
    const ALPHA: f64;

    /// The same for a parked rover.
    const PARKED_ALPHA: f64;

    /// Smallest `α`, relative to the mean diagonal of `W`, for which the systems are accurate.
    const SMALLEST_ALPHA: f64;

    /// Smallest `α` of further attempts. Below [`Self::SMALLEST_ALPHA`] a Newton point is corrected
    /// once with the factors of its system.
    const SMALLEST_ALPHA_AGAIN: f64;

    /// Whether a solve's first full step stays near the impulses of the last step, rather than near
    /// those from which it starts.
    const RETURNS: bool;

    /// Squared relative residual after a full step below which the same factors may correct the
    /// rest, and most such corrections. Where the slides still turn, a fresh step gains more.
    const NEAR: f64;
    const CORRECTIONS: usize;

    /// Most steps of an attempt. What is unsolved then goes in circles, mostly.
    const MAX_STEPS: usize;

    /// Without problems.
    fn new(token: T::Token) -> Self;

    /// Gives a lane the operator of a problem. Returns the places whose other data change.
    fn load(&mut self, lane: usize, problem: &ContactProblem) -> Self::Places;

    /// Number of a problem's contact at a place, if it has one there.
    fn contact_at(problem: &ContactProblem, place: usize) -> Option<usize>;

    /// Impulse of a problem's contact in the last step, N s.
    fn last_of(problem: &ContactProblem, contact: usize) -> Triple<f64>;

    /// Diagonal block of a problem's contact.
    fn block_of(problem: &ContactProblem, contact: usize) -> &[f64; 9];

    /// Places of contacts of any lane.
    fn places(&self) -> Self::Places;

    /// Diagonal block of a place.
    fn diagonal(&self, place: usize) -> &[T; 9];

    /// `u = W p + q`.
    fn velocities(&mut self, q: &[Triple<T>; C], p: &[Triple<T>; C], u: &mut [Triple<T>; C]);

    /// Factors the system of the modes.
    fn factorise(&mut self, alpha: T, modes: &[Mode<T>; C]);

    /// The impulses of the Newton step about the impulses `centre`, into `y`.
    fn newton_point(
        &mut self,
        q: &[Triple<T>; C],
        centre: &[Triple<T>; C],
        alpha: T,
        modes: &[Mode<T>; C],
        y: &mut [Triple<T>; C],
    );

    /// The change of the impulses, into `y`, that removes the velocities `u` as far as the modes
    /// allow; the factors may be those of modes at nearby impulses.
    fn correction(&mut self, u: &[Triple<T>; C], modes: &[Mode<T>; C], y: &mut [Triple<T>; C]);
}
