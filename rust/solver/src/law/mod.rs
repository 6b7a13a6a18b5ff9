//! The contact laws, one contact at a time: what must hold between the
//! local velocity `u` and the impulse `p`.
//!
//! Along the normal:
//!
//! - [`signorini`]: no penetration velocity, no adhesion, `0 ≤ u_N ⊥ p_N ≥ 0`;
//! - [`newton_impact`]: restitution enters as a shift of the free normal velocity;
//! - [`poisson_impact`]: the expansion gives back e times the impulse of the compression;
//! - [`cohesion`]: a constant attraction, a load on both bodies;
//! - [`compliance`]: a spring and a damper, implicit in the same problem.
//!
//! Across it, each a projection ([`friction_law::FrictionLaw`]):
//!
//! - [`coulomb`]: friction, as De Saxcé's cone complementarity `K_μ* ∋ u + μ|u_T| n ⊥ p ∈ K_μ`;
//!   [`one_contact`] answers a single contact exactly;
//! - [`frictionless`]: no tangential impulse;
//! - [`associated`]: the convex relaxation of Coulomb's law;
//! - [`rolling`]: moments that resist rolling and drilling, bounded by the normal impulse.
//!
//! [`mode`] names the states open, stick and slide, and linearises the law in them.
//! [`materials`] has the coefficients by pair of materials.
//!
//! # One call
//!
//! ```text
//! stages (sweeps, Newton, pivoting) → answer, linearise    one contact with all others fixed
//! residual                          → violation            every answer of every solver
//! ADMM, interior point              → cone                 Coulomb's law as a cone
//! systems (tree, grains)            → normal_shift         rebound, gap, compliance
//! ```
//!
//! Vectors are `[normal, tangent, (tangent)]`, velocities in m/s and impulses in N s.
//!
//! # May use
//!
//! [`crate::cone`], [`crate::quantity`], [`crate::scalar`], [`crate::space`].
//!
//! A law sees one contact; it knows no solver and no body.

pub mod associated;
pub mod cohesion;
pub mod compliance;
pub mod coulomb;
pub mod friction_law;
pub mod frictionless;
pub mod materials;
pub mod mode;
pub mod newton_impact;
pub mod one_contact;
pub mod poisson_impact;
pub mod rolling;
pub mod signorini;
