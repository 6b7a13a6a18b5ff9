//! The planar systems of the report's chapter 3: a ball, a two-wheel rover,
//! and the ground they run on.
//!
//! - [`ground`], [`curve`], [`polyline`]: the ground below a curve, and where a disc touches it;
//! - [`tree`]: kinematics and dynamics of a machine, a tree of bodies with wheels;
//! - [`ball`], [`two_wheel_rover`]: the numbers of two such trees; [`mirrored_rover`]: that of the
//!   six-wheel rover driven straight; [`rig`]: one wheel at a given slip, for the drawbar pull on a
//!   [bed of disks](crate::system::grains).
//!
//! Time stepping, contact law and solver live elsewhere: [`crate::system::planar`] turns a machine
//! on a ground into a mechanical system, and [`crate::simulation`] steps it like the rover. x
//! points forward, y up, and angles are positive to the left.
//!
//! # One call
//!
//! ```text
//! numbers of a machine ──► ball, two_wheel_rover, mirrored_rover ──► PlanarTree
//!                                                                       │
//! q ──► PlanarTree::place ──► PlanarPoses                               │
//!           ├──► mass_matrix, force         M, F(q, v)  ◄───────────────┘
//!           ├──► disc                       the wheels in the world
//!           │       └──► PlanarGround::facing  points of the curve that face a disc
//!           └──► push_rows                  rows of Hᵀ of a wheel's point
//! ```
//!
//! [`crate::system::planar`] makes a mechanical system of them.
//!
//! # May use
//!
//! [`crate::quantity`], [`crate::scalar`], [`crate::multibody`], [`crate::geometry`],
//! [`crate::integrator`].
//!
//! From [`crate::multibody`] the model that a mirrored rover is made from, and motors.

pub mod ball;
pub mod curve;
pub mod error;
pub mod ground;
pub mod mirrored_rover;
pub mod polyline;
pub mod rig;
pub mod tree;
pub mod two_wheel_rover;

pub use ball::PlanarBall;
pub use curve::{Curve, Line, Sine, Spline};
pub use error::PlanarError;
pub use ground::{ContactRule, MAX_FACING, PlanarFacing, PlanarGround};
pub use mirrored_rover::MirroredRover;
pub use polyline::Polyline;
pub use rig::WheelRig;
pub use tree::{PlanarDisc, PlanarMotor, PlanarPoses, PlanarTree};
pub use two_wheel_rover::{PlanarWheel, TwoWheelRover};
