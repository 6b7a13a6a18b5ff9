//! Trees of solids: from their description to mass matrix, bias, energy and momentum.
//!
//! A machine is one or several kinematic trees, built from the joints of a catalogue ([`joint`]).
//! The root of a tree is free, or a joint connects it to the world. All spatial quantities of a
//! tree are expressed in **world axes about one origin**: the origin of its root if the root is
//! free, otherwise the world's. Composite inertias then add without a transformation, and a rover
//! far from the world's origin loses no precision.
//!
//! The dynamics are written once, over the scalar ([`crate::scalar`]) that is one machine or
//! several to a register: [`mechanism`], what machines in one register share; [`inertias`], what
//! they need not; [`lane_configuration`], their configurations; [`poses`], [`mass_matrix`],
//! [`factor`], [`bias`] and [`energy`]. They know joints by one interface, [`JointModel`].
//!
//! # One call
//!
//! Forward dynamics of a tree; every arrow is one sweep over the bodies:
//!
//! ```text
//! description ──► Model                      checked, merged, numbered: once
//!                   │  Mechanism, Inertias   what the sweeps read
//!                   ▼
//! Configuration ──► LaneConfiguration        q in lanes
//!                   │
//!                   ▼
//!                 Poses::update              attitude, origin, mass centre; motion S a velocity
//!                   │
//!                   ├──► MassMatrix::update ──► factorise ──► Factor     M = Lᵀ D L
//!                   ├──► bias                                            N v + G
//!                   └──► energy                                          kinetic, potential
//!                   │
//!                   ▼
//! v̇ = M⁻¹ (τ − bias)   ──►   set_moved       q ⊕ h v, joint by joint
//! ```
//!
//! A joint is one page of `joint`: where it puts its body, its screws, how its coordinates advance.
//!
//! # May use
//!
//! [`crate::scalar`], [`crate::spatial`], [`crate::law`].
//!
//! From [`crate::law`] only the numbers of materials and of yielding wheels.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

pub mod bias;
pub mod chart;
mod composite;
pub mod coordinates;
pub(crate) mod coriolis;
pub mod description;
pub mod energy;
pub mod error;
pub mod factor;
pub mod inertias;
pub mod joint;
pub mod kinematics;
pub mod landmarks;
pub mod lane_configuration;
pub mod loops;
pub mod mass_matrix;
pub mod mechanism;
pub mod model;
pub mod momentum;
pub mod motor;
pub(crate) mod path_matrix;
pub mod poses;
pub mod state;

pub use chart::Chart;
pub use description::{
    CouplingDescription, DrawingDescription, DriveDescription, FORMAT, Hold, JointKind,
    JointLimits, LoopDescription, LoopKind, MAX_SHAPES, MAX_SOLIDS, MachineDescription,
    MassProperties, MaterialDescription, ModelDescription, Shape, ShapeDescription,
    SolidDescription, Spring, TagDescription, TrackDescription, WheelDescription,
};
pub use energy::{Energy, EnergyScratch};
pub use error::{ModelError, ModelFault, StateError};
pub use factor::Factor;
pub use inertias::Inertias;
pub use joint::{FreePose, Joint, JointAxis, JointModel, Motion};
pub use kinematics::Kinematics;
pub use lane_configuration::LaneConfiguration;
pub use mass_matrix::MassMatrix;
pub use mechanism::Mechanism;
pub(crate) use model::fingerprint;
pub use model::{
    BASE, Body, Changes, Collider, ColliderForm, CollisionBox, CollisionSphere, Frame,
    JointProperties, Loop, LoopGap, MachineSpan, Model, Passive, Tree, Wheel,
};
pub use momentum::Momentum;
pub use motor::{Motor, MotorLine, Servo};
pub use poses::Poses;
pub use state::Configuration;
