//! Other time-stepping schemes over the rover's mechanical systems, with the cost and accuracy of
//! each.
//!
//! Every scheme implements [`rover_core::integrator::Integrator`] over
//! [`rover_core::integrator::MechanicalSystem`], as the rover's own do, with the same contacts,
//! laws and solver, so that two curves differ by the scheme alone. They are written for reading and
//! comparison, and allocate in a step.
//!
//! - [`generalised_alpha`], [`schatzman_paoli`], [`event_driven`],
//!   [`penalty`]: one scheme each; [`scheme`]: the list;
//! - [`scenes`]: motions with closed forms or a converged reference;
//!   [`measure`]: orders, drift, energy, cost; [`error`]: what can go wrong.
//! - [`free_spheres`] in space with a block-sparse W, found by the core's grid of cells, and a
//!   [`slab`] among them; [`sphere_simulation`]; [`sphere_scenes`]: heaps, bounces and rolling;
//!   [`projected_to_convergence`]: no penetration at the end of any step.
//!
//! `make orders` writes the figures of `docs/integrators.md`. The programs in `examples/` measure
//! steps of the rover and solves of its contact problems; `make instructions` and `make bench` run
//! some of them.
#![forbid(unsafe_code)]

mod acceleration;
pub mod error;
pub mod event_driven;
pub mod free_spheres;
pub mod generalised_alpha;
pub mod measure;
pub mod penalty;
pub mod projected_to_convergence;
pub mod scenes;
pub mod schatzman_paoli;
pub mod scheme;
pub mod slab;
pub mod sphere_scenes;
pub mod sphere_simulation;
mod whole;

pub use error::MeasureError;
pub use event_driven::EventDriven;
pub use generalised_alpha::GeneralisedAlpha;
pub use penalty::Penalty;
pub use projected_to_convergence::ProjectedToConvergence;
pub use schatzman_paoli::SchatzmanPaoli;
pub use scheme::{SCHEMES, Scheme, SchemeFamily, Stepper};
