//! The contact laws, one contact at a time: what must hold between the
//! local velocity `u` and the impulse `p`.
//!
//! - [`signorini`]: no penetration velocity, no adhesion, `0 ≤ u_N ⊥ p_N ≥ 0`;
//! - [`newton_impact`]: restitution enters as a shift of the free normal velocity;
//! - [`coulomb`]: friction, as De Saxcé's cone complementarity `K_μ* ∋ u + μ|u_T| n ⊥ p ∈ K_μ`;
//! - [`rolling`]: moments that resist rolling and drilling, bounded by the normal impulse;
//! - [`compliance`]: a spring and a damper along the normal, implicit in the same problem;
//! - [`materials`]: the coefficients of friction and restitution by pair of materials.
//!
//! Vectors are `[normal, tangent, (tangent)]`, velocities in m/s and
//! impulses in N s. A law never sees a solver.

pub mod compliance;
pub mod coulomb;
pub mod materials;
pub mod newton_impact;
pub mod rolling;
pub mod signorini;
