//! The friction cone, its dual, and the projections that every solver and every residual uses.
//!
//! A contact's impulse `p = (p_N, p_T)` lives in the Coulomb cone `K_μ = { |p_T| ≤ μ p_N }`
//! ([`SecondOrderCone`]); the modified velocity `ũ` of the law lives in its dual
//! `K_μ* = { u_N ≥ μ |u_T| }` ([`DualCone`]). Vectors are arrays `[normal, tangent, (tangent)]`, so
//! that `D = 2` is the planar problem and `D = 3` the spatial one.
//!
//! # One call
//!
//! A solver projects what an iteration proposes for a contact:
//!
//! ```text
//! p − ρ ũ                        [p_N, p_T]
//!    │
//!    ▼
//! SecondOrderCone::project       in K_μ: as it is; in −K_μ*: 0; else: onto the side
//!    │
//!    ▼
//! p⁺ ∈ K_μ                       p = p⁺ at a solution: the natural map of crate::law
//! ```
//!
//! # May use
//!
//! [`crate::space`].

mod disc;
mod dual_cone;
pub(crate) mod lorentz;
mod second_order_cone;

pub use disc::{draw_in, project_on_disc, shortened, split};
pub use dual_cone::DualCone;
pub use second_order_cone::SecondOrderCone;

/// Length of the tangential part `|(v_2, .., v_D)|` of a contact vector
/// `[normal, tangent, (tangent)]`.
#[inline]
#[must_use]
pub fn tangential_norm<const D: usize>(v: &[f64; D]) -> f64 {
    let mut sum = 0.0;
    for k in 1..D {
        sum += v[k] * v[k];
    }
    if D == 2 { v[1].abs() } else { sum.sqrt() }
}
