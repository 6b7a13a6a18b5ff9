//! Colour pictures of ground, rocks and a machine in the light of Sun and sky, ray by ray.
//!
//! - [`scene`]: what can be seen, and what lies in whose shadow;
//! - [`drawing`]: the coloured triangles of a solid; [`stone`]: rocks; [`relief`]: ruts;
//! - [`light`]: Sun, sky and haze; [`texture`]: the checkered, grainy ground;
//! - [`mod@take`]: the pixels.
//!
//! Colours are red, green and blue, 1 for white. A matt surface of colour c and unit normal n shows
//! `c ⊙ (sky(n) + [sunlit] max(0, n · s) sun)` (Lambert 1760), faded into haze with its distance.

pub mod drawing;
pub mod light;
pub mod relief;
pub mod scene;
pub mod stone;
pub mod take;
pub mod texture;

pub use drawing::{Drawing, PlacedDrawing};
pub use light::Light;
pub use relief::RutRelief;
pub use scene::PictureScene;
pub use stone::Stone;
pub use take::{Look, Pixel, PixelKind, Shot, take};
pub use texture::{Checks, Grain};

/// Red, green and blue, 1 for white.
pub type Colour = [f64; 3];

/// The colour between two, at a share of the way.
#[inline]
fn mix(from: &Colour, to: &Colour, share: f64) -> Colour {
    std::array::from_fn(|k| from[k] + share * (to[k] - from[k]))
}

/// Rises smoothly from 0 to 1 between two values.
#[inline]
fn smooth_step([begin, end]: [f64; 2], x: f64) -> f64 {
    let share = ((x - begin) / (end - begin)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
