//! The stages: iterative methods that improve an impulse. Each can solve a problem on its own.
//!
//! A stage takes an [`Attempt`](super::scratch::Attempt): the prepared problem, the start `p` (n),
//! N s, and the shared scratch. It returns `p`, `u = W p + q` and the reason for its end. No stage
//! knows which one came before or comes next; the strategy decides that.

mod accelerated;
pub(super) mod admm;
mod ball_extrapolation;
mod ball_rows;
mod ball_sweeps;
pub(super) mod body_sweeps;
mod disk_rows;
mod disk_sweeps;
pub(super) mod gauss_seidel;
pub(super) mod guided;
mod helpers;
pub(super) mod interior_point;
pub(super) mod newton;
pub(super) mod pivoting;
pub(super) mod proximal;
pub(super) mod pyramids;
pub(super) mod restarts;
