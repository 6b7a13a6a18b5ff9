//! Time stepping of measure differential inclusions: `M dv + (N v + G) dt = T u dt + H dp`.
//!
//! | scheme | file | order in smooth phases | through impacts |
//! |---|---|---|---|
//! | Moreau–Jean, one linearised step | [`scheme`] | 2, gyroscopic terms explicit or implicit by the spin | 1 |
//! | Moreau–Jean, Newton on the end-of-step forces | [`moreau_jean_newton`] | 2 | 1 |
//!
//! Both schemes treat impacts and persistent contact by the same law at velocity level and locate
//! no events. The linearised step is written once, for systems in the lanes of any scalar
//! (`systems`): several rovers in a register, or one of anything. Its parts are `load`, `impacts`,
//! `yielding`, `closing`, `audit` with `balance`, and `projection`, which removes the penetration
//! that the velocity law leaves and keeps the kinetic energy (`carried_velocity`). Clusters that do
//! not touch each other decide for themselves (`grouped`). All that changes in a step is in `data`.
//!
//! There are two efforts. The usual one takes lanes as far as they are alike; a lane that needs
//! more leaves the others before its state changes. All effort, for one system, is
//! [`moreau_jean`]: it repeats a step with implicit terms and in halves, solves its problems by
//! every means (`solving`), those of a group for themselves (`island`), and shortens what still
//! gains energy (`shortening`). A [`MechanicalSystem`] has its contacts in a list (`listed`).
//! `held_step` differentiates a step while the modes of its contacts ([`contact_modes`]) hold.
//!
//! Each scheme is an [`Integrator`] for any [`MechanicalSystem`], and `variant` chooses one of them
//! by the options.
//!
//! # One call
//!
//! A Moreau–Jean step, in [`scheme`]; every line but the last two is a call of the systems:
//!
//! ```text
//! q, v ──► place                            q + (1−θ) h v and q + h v
//!      ──► detect, recall                   the contacts of the step, and the last impulses
//!      ──► update_mass, factorise           M̂ = Fᵀ F
//!      ──► assemble                         Z = F⁻ᵀ H, W = Zᵀ Z
//!      ──► load                             free change of velocity; twice, for the bias at v_m
//!      ──► pose                             W, q, μ: solved elsewhere
//!      ──► read, add_impulses               p, v⁺ and q⁺ = q ⊕ h (θ v⁺ + (1−θ) v)
//!      ──► revise                           another branch of a force: again
//!      ──► audit::judge                     too much energy: corrected, or the lane leaves
//!      ──► projection                       what penetrates is moved out
//! ```
//!
//! # May use
//!
//! [`crate::caught`], [`crate::scalar`], [`crate::spatial`], [`crate::law`], [`crate::contact`],
//! [`crate::problem`], [`crate::solver`].
//!
//! No machine: a scheme knows a [`MechanicalSystem`], or systems in lanes.

pub mod accuracy;
pub(crate) mod audit;
pub(crate) mod balance;
pub(crate) mod carried_velocity;
mod closing;
pub mod contact_modes;
pub(crate) mod data;
pub mod dynamics;
pub mod error;
pub(crate) mod excess;
pub mod forces;
pub(crate) mod grouped;
pub(crate) mod held_step;
mod impacts;
mod island;
mod listed;
mod load;
pub mod local;
pub mod mechanical_system;
pub mod moreau_jean;
pub mod moreau_jean_newton;
pub mod options;
pub mod probe;
pub(crate) mod projection;
pub mod report;
pub mod scheme;
pub mod scratch;
mod shortening;
mod solving;
mod stepping;
pub(crate) mod systems;
mod variant;
pub mod warm_start;
pub mod work;
mod yielding;

pub use accuracy::Accuracy;
pub use data::Obstacle;
pub use dynamics::{Dynamics, DynamicsMask};
pub use error::{OptionsError, StepError};
pub(crate) use forces::MOST_REVISIONS;
pub use forces::{Forces, StartOf, StepStart};
pub use local::Local;
pub use mechanical_system::{ConfigurationOf, KeyOf, MechanicalSystem, UnilateralContact};
pub use options::{Stabilisation, StepOptions, Variant};
pub use probe::{NoProbe, Phase, Probe};
pub use report::{StepReport, StepStatus};
pub use scratch::{ScratchOf, StateMut, StepScratch};
pub use stepping::Integrator;
pub use warm_start::WarmStart;
pub use work::Work;
