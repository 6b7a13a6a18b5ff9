//! What pivoting needs of its problems.

use super::store::{Store, Triple};
use crate::law::mode::{ContactMode, Mode};
use crate::scalar::Lane;

/// Problems `u = W p + q`, one a lane, and the linear systems of their modes.
pub(crate) trait System<T: Lane, B: Store> {
    /// Places of contacts, ascending.
    type Places: Iterator<Item = usize>;

    /// First `α` of the proximal term `α (p − c)`, relative to the mean diagonal of `W`. A step's
    /// error is `α` times the change of the impulse, and the rounding of `W p + q`, divided by `α`,
    /// drifts into the null space of `W`. The ratio test bounds that where wheels slide. A parked
    /// rover, whose impulses hardly change, collects it step by step: its `α` may be larger.
    const ALPHA: f64 = 1e-8;

    /// First `α` for a parked rover, relative to the mean diagonal of `W`: see [`Self::ALPHA`].
    const PARKED_ALPHA: f64 = 1e-6;

    /// Smallest `α`, relative to the mean diagonal of `W`, for which the systems are accurate.
    /// Wheels squeezed to the limit of friction slip at 1e-11 m/s, and the turning stiffness of
    /// such a slide is as small as `α`. Of 749 recorded steps over rocks at 1 ms none was solved
    /// with `α` above 1e-10, and nearly all within some ten systems with smaller ones.
    const SMALLEST_ALPHA: f64 = 1e-14;

    /// Smallest `α` of further attempts. Below [`Self::SMALLEST_ALPHA`] a Newton point is corrected
    /// once with the factors of its system.
    const SMALLEST_ALPHA_AGAIN: f64 = Self::SMALLEST_ALPHA;

    /// Whether a solve's first full step stays near the impulses of the last step, rather than near
    /// those from which it starts.
    const RETURNS: bool = false;

    /// Squared relative residual after a full step below which the same factors may correct the
    /// rest: a rover that sticks is solved then. Where the slides still turn, a fresh step gains
    /// more.
    const NEAR: f64 = 1e-6;

    /// Most such corrections after a step.
    const CORRECTIONS: usize = 1;

    /// Places of contacts of any lane.
    fn places(&self) -> Self::Places;

    /// Free velocity `q` of a place, m/s.
    fn free_velocity(&self, place: usize) -> Triple<T>;

    /// `u = W p + q`.
    fn velocities(&mut self, p: &B::Of<Triple<T>>, u: &mut B::Of<Triple<T>>);

    /// Factors the systems of the modes; false if one is singular or costs too much.
    fn factorise(&mut self, alpha: T, modes: &B::Of<Mode<T>>) -> bool;

    /// Solves `Bᵀ (W + α I) C y + γ y = Bᵀ r` with the last factors, which may be those of modes at
    /// nearby impulses. The velocities `r` become the impulses `C y`.
    fn solve(&mut self, modes: &B::Of<Mode<T>>, r: &mut B::Of<Triple<T>>);

    /// Mode and impulse of the contact at a place of a lane, all others fixed, from its velocity
    /// `free` without this impulse.
    fn solve_one(
        &self,
        place: usize,
        lane: usize,
        free: &Triple<f64>,
        mu: f64,
    ) -> (ContactMode, Triple<f64>);
}
