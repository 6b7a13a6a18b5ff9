//! Scenes of episodes, drawn at random.
//!
//! - [`pcg64`]: the generator of NumPy's `default_rng`, number for number; [`seed_sequence`]: its
//!   state for a seed; [`normal`]: standard normal numbers;
//! - [`start`]: slope, pose and goal; [`rocks`]: rocks by difficulty; [`hills`]: fractal ground;
//!   [`sand`]: soils and ripples; [`ground`]: the ground of all of them; [`way`]: whether a way
//!   leads to the goal; [`domain`]: properties of rover and world;
//! - [`scene`]: all of these, and the rover in them; [`many`]: the next scenes of many rovers, on
//!   several threads.
//!
//! # One call
//!
//! SceneDistribution::draw(random)          at most `attempts` times:
//!
//! ```text
//!    │
//!    ├─ rocks, start, domain               every number is drawn, whatever is fixed
//!    ├─ ground                             plane, hills or sand under them
//!    ├─ placement::resting_on               the rover brought down onto the ground
//!    ├─ way::leads                         on uneven ground: whether the goals can be reached
//!    └─ deepest_overlap                    too deep → again
//!    │
//!    ▼
//! DrawnScene                               a RoverScene, its options, start and goal
//! ```
//!
//! # May use
//!
//! [`rover_core::scalar`], [`rover_core::multibody`], [`rover_core::geometry`],
//! [`rover_core::contact`], [`rover_core::integrator`], [`rover_core::simulation`].

pub mod domain;
pub mod error;
pub mod ground;
pub mod hills;
pub mod many;
pub mod normal;
mod normal_layers;
pub mod pcg64;
pub mod rocks;
pub mod sand;
pub mod scene;
pub mod seed_sequence;
pub mod start;
pub mod way;

pub use domain::{Domain, DomainDistribution};
pub use error::{DrawError, Unsuitable};
pub use ground::{DrawnGround, GroundDistribution};
pub use hills::{HillDistribution, HillDraw};
pub use many::{Drawn, Order, draw_many};
pub use pcg64::{Pcg64, Pcg64State};
pub use rocks::{RockDistribution, RockDraw};
pub use sand::{SandDistribution, SandDraw};
pub use scene::{DrawnScene, FixedDraws, SceneDistribution};
pub use start::{FixedStart, Interval, Start, StartDistribution};
