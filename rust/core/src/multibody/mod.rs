//! Trees of solids: from their description to mass matrix, bias, energy and momentum.
//!
//! A machine is one or several kinematic trees, built from the joints of a catalogue ([`joint`]).
//! The root of a tree is free, or a joint connects it to the world. All spatial quantities of a
//! tree are expressed in **world axes about one origin**: the origin of its root if the root is
//! free, otherwise the world's. Composite inertias then add without a transformation, and a rover
//! far from the world's origin loses no precision.

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
    CouplingDescription, DriveDescription, FORMAT, Hold, JointKind, Limits, MAX_SHAPES, MAX_SOLIDS,
    MassProperties, ModelDescription, Shape, ShapeDescription, SolidDescription, Spring,
    TagDescription, WheelDescription,
};
pub use error::{ModelError, StateError};
pub use joint::{Joint, JointAxis, Motion, Pose};
pub use kinematics::Kinematics;
pub use mass_matrix::{FactoredMassMatrix, MassMatrix};
pub(crate) use model::fingerprint;
pub use model::{
    BASE, Body, CollisionBox, CollisionSphere, Frame, JointProperties, Model, Passive, Tree, Wheel,
};
pub use momentum::{Energy, EnergyScratch, Momentum};
pub use motor::{DriveTrial, Motor, MotorRegime};
pub use state::Configuration;
