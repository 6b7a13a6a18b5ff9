//! The ground's checks and grain, without aliasing.
//!
//! A pixel shows a patch of the ground. Edges between checks are as wide as the patch, and grain is
//! read from an image pyramid at the patch's size (Williams 1983).

use nalgebra::Vector3;

use super::{Colour, mix};

/// Finest and coarsest layer of the grain: images a metre, offset, and weight in the brightness.
const LAYERS: [[f64; 3]; 2] = [[0.9, 0.0, 0.30], [0.071, 0.3, 0.26]];

/// Brightness without grain.
const PLAIN: f64 = 0.72;

/// Upward part of the normal below which a surface shows no checks.
const LEVEL: f64 = 0.7;

/// A square image of brightness that repeats, and its pyramid of means over 2 x 2 pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Grain {
    /// Row by row, the finest first; each has half the pixels a side of the one before.
    levels: Vec<Vec<f64>>,
    side: usize,
}

impl Grain {
    /// From n x n values from 0 to 1, n a power of 2; none if it is not one.
    #[must_use]
    pub fn new(values: Vec<f64>, side: usize) -> Option<Self> {
        if !side.is_power_of_two() || values.len() != side * side {
            return None;
        }
        let mut levels = vec![values];
        let mut wide = side;
        while wide > 1 {
            let (fine, half) = (&levels[levels.len() - 1], wide / 2);
            let mean = |k: usize| {
                let first = 2 * (k / half) * wide + 2 * (k % half);
                let corners = [first, first + 1, first + wide, first + wide + 1];
                0.25 * corners.map(|at| fine[at]).iter().sum::<f64>()
            };
            let coarse = (0..half * half).map(mean).collect();
            levels.push(coarse);
            wide = half;
        }
        Some(Self { levels, side })
    }

    /// Value at a place in images, of a patch this wide in images.
    fn at(&self, place: [f64; 2], wide: f64) -> f64 {
        let (mut texels, mut level) = (wide * self.side as f64, 0);
        while texels > 2.0 && level + 1 < self.levels.len() {
            (texels, level) = (0.5 * texels, level + 1);
        }
        let fine = self.between(place, level);
        if texels <= 1.0 || level + 1 == self.levels.len() {
            return fine;
        }
        fine + (texels - 1.0) * (self.between(place, level + 1) - fine)
    }

    /// Value between the four nearest pixels of a level.
    fn between(&self, place: [f64; 2], level: usize) -> f64 {
        let (side, values) = (self.side >> level, &self.levels[level]);
        let [[x, next_x], [y, next_y]] = place.map(|u| {
            let (at, last) = (fraction(u) * side as f64 + 0.5, side - 1); // one more than its pixel
            let low = whole(at) + last;
            [low & last, (low + 1) & last]
        });
        let [a, b] = place.map(|u| fraction(fraction(u) * side as f64 + 0.5));
        let value = |row: usize, column: usize| values[row * side + column];
        let row = |y: usize| value(y, x) + a * (value(y, next_x) - value(y, x));
        let (near, far) = (row(y), row(next_y));
        near + b * (far - near)
    }
}

/// Whole part of a number that is not negative.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // as asked for
fn whole(x: f64) -> usize {
    x as usize
}

/// What a number has beyond the whole number below it.
#[allow(clippy::cast_possible_truncation)] // within the world's limits; without a call of `floor`
fn fraction(x: f64) -> f64 {
    let rest = x - (x as i64) as f64;
    if rest < 0.0 { rest + 1.0 } else { rest }
}

/// The patch of a horizontal plane that a pixel shows: its extents along x and z, and across, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Along x and z, m.
    pub along: [f64; 2],
    /// Geometric mean of its length and its width, m.
    pub mean: f64,
}

impl Patch {
    /// The patch of a pixel that is `wide` across the ray, m, where the ray meets a surface.
    #[must_use]
    pub fn new(direction: &Vector3<f64>, normal: &Vector3<f64>, wide: f64) -> Self {
        let long = wide / direction.dot(normal).abs().max(1e-3);
        let level = direction.xz().try_normalize(1e-12);
        let [x, z] = level.map_or([1.0, 0.0], |d| [d.x.abs(), d.y.abs()]);
        Self {
            along: [wide * z + long * x, wide * x + long * z],
            mean: (wide * long).sqrt(),
        }
    }
}

/// Checkered ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Checks {
    /// Edge of a field, m.
    pub tile: f64,
    /// Brightness of the soil.
    pub grain: Grain,
}

impl Checks {
    /// Colour of the ground at a place (world, m): the one or the other of two tones, with grain.
    #[must_use]
    pub fn colour(
        &self,
        tones: &[Colour; 2],
        place: &Vector3<f64>,
        normal: &Vector3<f64>,
        patch: &Patch,
    ) -> Colour {
        let side = |at: f64, wide: f64| {
            let turn = fraction(0.5 * at / self.tile + 0.25);
            let edge = 2.0 * (turn - 0.5).abs() - 0.5; // changes sign at every line
            2.0 * (edge / (wide / self.tile).max(1e-4)).clamp(-0.5, 0.5)
        };
        let checks = 0.5 + 0.5 * side(place.x, patch.along[0]) * side(place.z, patch.along[1]);
        let is_steep = normal.y < LEVEL;
        let tone = mix(&tones[0], &tones[1], if is_steep { 1.0 } else { checks });
        let of_layer = |[rate, offset, weight]: &[f64; 3]| {
            let at = [place.x, place.z].map(|x| x * rate + offset);
            weight * self.grain.at(at, patch.mean * rate)
        };
        let bright = PLAIN + LAYERS.iter().map(of_layer).sum::<f64>();
        tone.map(|c| c * bright)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checks(value: impl Fn(usize) -> f64) -> Checks {
        Checks {
            tile: 0.5,
            grain: Grain::new((0..64).map(value).collect(), 8).unwrap(),
        }
    }

    const TONES: [Colour; 2] = [[1.0; 3], [0.5; 3]];

    fn seen(checks: &Checks, x: f64, z: f64, wide: f64) -> f64 {
        let patch = Patch {
            along: [wide; 2],
            mean: wide,
        };
        checks.colour(&TONES, &Vector3::new(x, 0.0, z), &Vector3::y(), &patch)[0]
    }

    #[test]
    fn fields_alternate_and_melt_into_their_mean_far_away() {
        let plain = checks(|_| 0.5); // brightness 0.72 + 0.15 + 0.13 everywhere
        assert!((seen(&plain, 0.25, 0.25, 1e-3) - 0.5).abs() < 1e-12);
        assert!((seen(&plain, -0.25, 0.25, 1e-3) - 1.0).abs() < 1e-12);
        assert!((seen(&plain, 0.75, 0.75, 1e-3) - 0.5).abs() < 1e-12);
        assert!((seen(&plain, 0.0, 0.25, 1e-3) - 0.75).abs() < 1e-12);
        for k in 0..20 {
            let far = seen(&plain, 0.13 * f64::from(k), 0.0, 1e3);
            assert!((far - 0.75).abs() < 1e-3);
        }
    }

    #[test]
    fn grain_has_its_values_at_its_pixels_and_its_mean_far_away() {
        let grain = Grain::new((0..64).map(|k| f64::from(k) / 63.0).collect(), 8).unwrap();
        for (row, column) in [(0, 0), (3, 5), (7, 7)] {
            let at = [column, row].map(|k| (f64::from(k) + 0.5) / 8.0);
            let expected = f64::from(8 * row + column) / 63.0;
            assert!((grain.at(at, 0.01) - expected).abs() < 1e-12);
            assert!((grain.at(at.map(|u| u - 3.0), 0.01) - expected).abs() < 1e-12);
        }
        assert!((grain.at([0.3, 0.9], 100.0) - 0.5).abs() < 1e-12);
        assert!(Grain::new(vec![0.0; 36], 6).is_none());
    }
}
