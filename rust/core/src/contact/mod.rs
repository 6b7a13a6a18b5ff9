//! From bodies near the ground, or near each other, to unilateral contacts: points, frames, gaps
//! and their Jacobians.
//!
//! A contact ([`pair`]) lies between a part of a body and either the ground or a part of another
//! body. [`detection`] finds those with the ground, [`pair_detection`] those between bodies, and
//! [`limit`] the joints at their stops: the broad phase says what is near,
//! [`crate::geometry::query`] measures, and [`activation`] decides which take part in the step.
//! [`relocation`] measures them again in another configuration. [`jacobian`] and [`delassus`] put
//! them into matrices.

pub mod activation;
pub mod delassus;
pub mod detection;
pub mod frame;
pub mod jacobian;
pub mod limit;
pub mod pair;
pub mod pair_detection;
pub mod part;
pub mod relocation;

pub use activation::Activation;
pub use delassus::ContactSystem;
pub use detection::detect;
pub use frame::ContactFrame;
pub use jacobian::generalized_impulse;
pub use limit::{detect_limits, relocate_limit};
pub use pair::{Contact, ContactKey, Opposite, OtherSide};
pub use pair_detection::{PairSearch, detect_pairs};
pub use part::{Part, Side};
pub use relocation::relocate;
