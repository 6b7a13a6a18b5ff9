//! Granular soil: free disks with friction, walls, a floor, and a machine that drives over them.
//!
//! - [`disks`], [`wall`], [`scene`]: what there is; [`packing`]: where disks start, without overlap, from a seed;
//! - [`grid`]: which disks are near which; [`contact`]: a contact and its name; contacts come and go with the disks;
//! - [`system`]: the soil as a mechanical system, stepped by [`crate::integrator`] as everything else;
//! - [`sleep`]: disks that rest far from anything that moves are left out; [`crate::simulation::grains`]: a bed through time, from which disks can be
//!   taken;
//! - [`rig`]: one wheel at a given slip, for the drawbar pull.
//!
//! A soil steps with θ = 1: contacts are measured where the step begins and a contact may close as far as its gap goes,
//! `0 ≤ u_N + gap⁺/h ⊥ p_N ≥ 0`. To first order no disk ends a step inside another, and neither gravity (which loses m g²h²/2 a step) nor contact
//! adds energy. What rounding and the solver's tolerance leave of penetration grows by their error in velocity; where it passes a
//! tolerance the common projection removes it.
//!
//! Source: Moreau 1999; Staron and Hinch 2005 (contact dynamics of disks); Anitescu and Potra 1997 (the gap in the velocity's law).

pub mod contact;
pub mod disks;
pub mod error;
pub mod grid;
pub mod packing;
pub(crate) mod removal;
pub mod rig;
pub mod scene;
pub mod sleep;
pub mod system;
pub mod wall;

pub use contact::{SoilContact, SoilKey};
pub use disks::Disks;
pub use error::SoilError;
pub use packing::Packing;
pub use rig::WheelRig;
pub use scene::{Machine, SoilFriction, SoilScene};
pub use sleep::SleepOptions;
pub use system::{SoilParts, SoilSystem};
pub use wall::Wall;
