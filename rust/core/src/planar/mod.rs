//! The planar systems of the report's chapter 3: a ball, a two-wheel rover,
//! and the ground they run on.
//!
//! - [`ground`], [`curve`], [`polyline`]: what lies below a curve, and where a disc touches it;
//! - [`machine`]: what a machine with few coordinates says of itself;
//! - [`ball`], [`two_wheel_rover`]: two of them; [`mirrored_rover`]: the
//!   six-wheel rover driven straight;
//! - [`rig`]: one wheel at a given slip, for the drawbar pull on a [soil](crate::system::soil).
//!
//! Nothing of time stepping, contact law or solver is here: [`crate::system::planar`] makes a
//! mechanical system of a machine on a ground, and [`crate::simulation`] steps it as it steps the
//! rover. x points forward, y up, angles turn to the left.

pub mod ball;
pub mod curve;
pub mod error;
pub mod ground;
pub mod machine;
pub mod mirrored_rover;
pub mod polyline;
pub mod rig;
pub mod two_wheel_rover;

pub use ball::Ball;
pub use curve::{Curve, Line, Sine, Spline};
pub use error::PlanarError;
pub use ground::{ContactRule, Facing, Ground, MAX_FACING};
pub use machine::{Disc, PlanarMachine, PlanarMotor};
pub use mirrored_rover::MirroredRover;
pub use polyline::Polyline;
pub use rig::WheelRig;
pub use two_wheel_rover::{PlanarWheel, TwoWheelRover};
