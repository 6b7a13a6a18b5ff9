//! The stages: iterations that take an impulse and leave a better one, each
//! able to answer by itself.
//!
//! A stage takes the prepared problem, the start `p` (n), N s, and the shared
//! [scratch](super::scratch); it leaves `p`, `u = W p + q` and why it ended. None knows which stage
//! came before or comes next: that is the strategy's.

pub(super) mod admm;
mod body_rows;
pub(super) mod body_sweeps;
pub(super) mod gauss_seidel;
pub(super) mod guided;
pub(super) mod newton;
pub(super) mod pivoting;
pub(super) mod proximal;
pub(super) mod restarts;
