//! From bodies near the ground to unilateral contacts: points, frames, gaps and their Jacobians.

pub mod activation;
pub mod box_plane;
pub mod box_sphere;
pub mod contact_frame;
pub mod contact_point;
pub mod delassus;
pub mod detection;
mod sweep;
pub mod wheel_plane;
pub mod wheel_sphere;

pub use activation::Activation;
pub use contact_frame::ContactFrame;
pub use contact_point::{Contact, ContactKey, Part};
pub use delassus::{ContactSystem, generalized_impulse};
pub use detection::{detect, relocate};
