//! The tree of solids: from its description to mass matrix, bias, energy and momentum.
//!
//! All spatial quantities of a step are taken in **world axes about the trunk origin**: composite
//! inertias then add without any transformation, and a rover far from the world's origin loses no digit.

pub mod bias;
pub mod coordinates;
pub mod coriolis;
pub mod description;
pub mod error;
pub mod joint;
pub mod kinematics;
pub mod mass_matrix;
pub mod model;
pub mod momentum;
pub mod motor;
pub mod state;

pub use bias::bias;
pub use description::{
    Hold, ModelDescription, Shape, SolidDescription, TagDescription, WheelDescription,
};
pub use error::{ModelError, StateError};
pub use joint::JointAxis;
pub use kinematics::{Kinematics, Motion};
pub use mass_matrix::{FactoredMassMatrix, MassMatrix};
pub(crate) use model::fingerprint;
pub use model::{BASE, Body, Frame, MAX_SOLIDS, Model, Wheel};
pub use momentum::{Energy, EnergyScratch, Momentum};
pub use motor::{DriveTrial, Motor, MotorRegime};
pub use state::Configuration;
