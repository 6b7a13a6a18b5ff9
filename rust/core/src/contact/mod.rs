//! Unilateral contacts of bodies near the ground or near each other: points, frames, gaps and their
//! Jacobians.
//!
//! A contact ([`pair`]) connects a part of a body to the ground or to a part of another body.
//! [`detection`] finds contacts with the ground, [`pair_detection`] contacts between bodies, and
//! [`limit`] joints at their stops; [`joint_friction`] is the dry friction of joints. The broad
//! phase selects candidates, [`crate::geometry::query`] computes gaps and normals of a machine with
//! its `body_motion`, and [`activation`] decides which contacts enter the step.
//! [`wheel_gaps`] measures how far the wheels are from the ground and nothing else,
//! `rollers` frees wheels across their rollers,
//! `box_clearance` how far a box is from a surface at least.
//! [`placement`] puts a rover on its wheels.
//! [`relocation`] re-evaluates them in another configuration; `contact_slope` has their
//! derivatives by the poses. `rows` has the rows of the contact
//! Jacobian and the products with them, [`jacobian`] and [`delassus`] assemble the matrices, and
//! [`loops`] restricts them to what the closed loops of a machine let move.
//!
//! These are the contacts of one machine, in a list. [`slots`] has those of machines in lanes, and
//! asks this page for what is rare. `placed_wheel` is a wheel as sand meets it.
//!
//! # One call
//!
//! Contacts of a step, as [`crate::system::tree`] asks for them:
//!
//! ```text
//! poses at the middle ──► detect            candidates near each part → query → Activation::admits
//!                         detect_pairs      parts of two bodies
//!                         detect_limits     joints at their stops
//!                               │
//!                               ▼  Vec<Contact>: key, point, frame, gap
//! poses at the end ─────► relocate, relocate_limit
//!                               │
//! factor of M̂ ──────────► ContactSystem::assemble       H, Z = L⁻ᵀ H, W = Zᵀ Z, u = Hᵀ v
//!                               │
//!                               ▼
//!                   local, add_impulses, generalized_impulse      what a step needs of H and Z
//! ```
//!
//! # May use
//!
//! [`crate::scalar`], [`crate::spatial`], [`crate::law`], [`crate::solver`], [`crate::multibody`],
//! [`crate::sand`], [`crate::geometry`].

pub mod activation;
pub(crate) mod body_motion;
pub(crate) mod box_clearance;
pub(crate) mod contact_slope;
pub mod delassus;
pub mod detection;
pub mod frame;
pub mod jacobian;
pub mod joint_friction;
pub mod limit;
pub mod loops;
pub mod pair;
pub mod pair_detection;
pub mod part;
pub(crate) mod placed_wheel;
pub mod placement;
pub mod relocation;
pub(crate) mod rollers;
pub(crate) mod rows;
pub mod slots;
pub(crate) mod ways_out;
pub mod wheel_gaps;

pub use activation::Activation;
pub use delassus::ContactSystem;
pub use detection::detect;
pub use frame::ContactFrame;
pub use jacobian::generalized_impulse;
pub(crate) use joint_friction::list_friction;
pub(crate) use limit::{detect_limits, relocate_limit};
pub(crate) use pair::clusters_of;
pub use pair::{Contact, ContactKey, Opposite, OtherSide};
pub use pair_detection::{PairSearch, detect_pairs};
pub use part::{Part, Side};
pub use relocation::relocate;
pub use wheel_gaps::WheelGaps;
