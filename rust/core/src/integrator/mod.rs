//! Time stepping of measure differential inclusions: `M dv + (N v + G) dt = T u dt + H dp`.
//!
//! | scheme | file | order in smooth phases | through impacts |
//! |---|---|---|---|
//! | Moreau–Jean, one linearised step | [`moreau_jean`] | 2, gyroscopic terms explicit or implicit by the spin | 1 |
//! | Moreau–Jean, Newton on the end-of-step forces | [`moreau_jean_newton`] | 2 | 1 |
//!
//! Both schemes treat impacts and persistent contact by the same law at velocity level and locate
//! no events. [`position_projection`] removes the penetration that the velocity law leaves, and
//! keeps the kinetic energy (`carried_velocity`). [`energy_audit`] checks the energy of every step.
//! `held_step` differentiates a step while the modes of its contacts ([`contact_modes`]) hold.
//!
//! Each scheme is an [`Integrator`], written once, for any [`MechanicalSystem`]: the multibody tree
//! and the planar systems ([`crate::system`], [`crate::planar`]) step through the same code. The
//! schemes share the treatment of contacts (`step_contacts`), and `variant` chooses one of them by
//! the options. Clusters that do not touch each other decide for themselves (`groups`), and have
//! their contacts solved for themselves (`island`).
//!
//! # One call
//!
//! A Moreau–Jean step, `attempt` in moreau_jean; every line but the last is a call of the system:
//!
//! ```text
//! q, v ──► place_middle, place_end          q + (1−θ) h v and q + h v
//!      ──► detect, relocate                 the contacts of the step
//!      ──► update_mass_matrix, factorise    M̂ = Fᵀ F
//!      ──► assemble                         Z = F⁻ᵀ H, W = Zᵀ Z
//!      ──► load, half_solve                 free change of velocity; twice, for the bias at v_m
//!      ──► solve                            p, by crate::solver
//!      ──► add_impulses, half_solve_back    v⁺ and q⁺ = q ⊕ h (θ v⁺ + (1−θ) v)
//!      ──► revise, energy_audit             another branch or too much energy: again, or halved
//!      ──► position_projection              what penetrates is moved out
//!      ──► StepReport
//! ```
//!
//! # May use
//!
//! [`crate::caught`], [`crate::scalar`], [`crate::spatial`], [`crate::law`], [`crate::contact`],
//! [`crate::problem`], [`crate::solver`].
//!
//! No machine: a scheme knows a [`MechanicalSystem`].

pub mod accuracy;
pub(crate) mod carried_velocity;
pub mod contact_modes;
pub mod contacting;
pub mod dynamics;
mod elastic_energy;
pub mod energy_audit;
pub mod error;
pub(crate) mod excess;
pub mod forces;
mod groups;
pub(crate) mod held_step;
mod island;
pub mod mechanical_system;
pub mod moreau_jean;
pub mod moreau_jean_newton;
pub mod options;
pub mod position_projection;
pub mod probe;
pub mod report;
mod scheme;
pub mod scratch;
pub(crate) mod step_contacts;
mod variant;
pub mod warm_start;
pub mod work;

pub use accuracy::Accuracy;
pub use contacting::{Contacting, KeyOf, UnilateralContact};
pub use dynamics::{Dynamics, MechanicalEnergy};
pub use error::{OptionsError, StepError};
pub use forces::{Forces, Start};
pub use mechanical_system::MechanicalSystem;
pub use options::{Stabilisation, StepOptions, Variant};
pub use probe::{NoProbe, Phase, Probe};
pub use report::{StepReport, StepStatus};
pub use scheme::{Integrator, StateMut};
pub use scratch::{Scratch, ScratchOf};
pub use warm_start::WarmStart;
pub use work::Work;
