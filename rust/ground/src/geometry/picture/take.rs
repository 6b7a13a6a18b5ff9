//! The pixels of a picture.

use nalgebra::Vector3;

use super::scene::{PictureScene, Seen, Surface};
use super::texture::Patch;
use super::{Checks, Colour, Light, RutRelief, Stone};
use crate::geometry::ray::Ray;

/// The golden ratio, which spreads the shades of grains evenly.
const GOLDEN: f64 = 0.618_033_988_7;

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum PixelKind {
    /// Nothing within range: the sky.
    Sky = 0,
    /// Ground, or grains.
    Ground = 1,
    /// A rock.
    Rock = 2,
    /// A part of the machine that carries the camera.
    Machine = 3,
}

/// A pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// Light in the pixel; black in a picture without light.
    pub colour: Colour,
    /// The kind of thing in the pixel.
    pub kind: PixelKind,
    /// Along the ray, m; infinite for the sky.
    pub distance: f64,
}

/// Colours of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Light of the scene.
    pub light: Light,
    /// The ground's checks.
    pub checks: Checks,
    /// The two tones of firm ground.
    pub firm: [Colour; 2],
    /// The two tones of sand.
    pub sand: [Colour; 2],
    /// Rocks, each with its own shade.
    pub rock: Colour,
    /// Grains, each with its own shade.
    pub ball: Colour,
}

/// How a picture is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// How far it shows things, m.
    pub range: f64,
    /// Angle between neighbouring pixels, rad.
    pub pixel: f64,
    /// Unit vector to the Sun; none for a picture without light.
    pub sun: Option<Vector3<f64>>,
}

/// The pixels of rays in a scene.
#[must_use]
pub fn take(scene: &PictureScene<'_>, look: &Look, rays: &[Ray], shot: &Shot) -> Vec<Pixel> {
    rays.iter()
        .map(|ray| pixel(scene, look, ray, shot))
        .collect()
}

fn pixel(scene: &PictureScene<'_>, look: &Look, ray: &Ray, shot: &Shot) -> Pixel {
    let seen = scene.first(ray, shot.range);
    let kind = seen.map_or(PixelKind::Sky, |seen| match seen.surface {
        Surface::Ground { .. } | Surface::Ball(_) => PixelKind::Ground,
        Surface::Rock(_) => PixelKind::Rock,
        Surface::Machine(_) => PixelKind::Machine,
    });
    let colour = match (seen, shot.sun) {
        (_, None) => [0.0; 3],
        (None, Some(_)) => look.light.sky(&ray.direction),
        (Some(seen), Some(sun)) => {
            let is_sunlit = scene.is_sunlit(&seen, &sun, look.light.haze[1]);
            let light = look.light.on(&seen.shading, is_sunlit.then_some(&sun));
            let own = own_colour(scene, look, &seen, (ray, shot));
            let lit = std::array::from_fn(|k| own[k] * light[k]);
            look.light.hazed(&lit, seen.distance)
        }
    };
    Pixel {
        colour,
        kind,
        distance: seen.map_or(f64::INFINITY, |seen| seen.distance),
    }
}

/// The colour of a surface in white light.
fn own_colour(
    scene: &PictureScene<'_>,
    look: &Look,
    seen: &Seen,
    (ray, shot): (&Ray, &Shot),
) -> Colour {
    match seen.surface {
        Surface::Ground { depth } => {
            let tones = if scene.is_sand() {
                &look.sand
            } else {
                &look.firm
            };
            let patch = Patch::new(&ray.direction, &seen.normal, shot.pixel * seen.distance);
            let colour = look.checks.colour(tones, &seen.place, &seen.normal, &patch);
            colour.map(|c| c * RutRelief::brightness(depth))
        }
        Surface::Rock(sphere) => {
            let shade = Stone::over(&sphere.centre).shade;
            look.rock.map(|c| c * shade)
        }
        Surface::Ball(index) => {
            let turn = f64::from(index) * GOLDEN;
            let shade = 0.84 + 0.3 * (turn - turn.floor());
            look.ball.map(|c| (c * shade).min(1.0))
        }
        Surface::Machine(colour) => colour,
    }
}
