//! Sand of an episode: a soil drawn among several, under ripples as high as the difficulty says.
//!
//! Two trains of waves run within `SPREAD` of one direction:
//!
//! ```text
//! h = A (sin(k₁·x + φ₁) + sin(k₂·x + φ₂) / 2),    A = 0.02 d metres, d the difficulty
//! ```
//!
//! with wavelengths of 1.6 and 1.0 m: slopes of up to 8 degrees at d = 1, on top of that of the
//! plane.

use std::sync::Arc;

use super::pcg64::Pcg64;
use super::start::{Interval, Start};
use rover_core::geometry::terrain::rocks::SplitMix64;
use rover_core::geometry::{HeightField, Plane, SoftGround, Terrain, TerrainError};
use rover_core::scalar::elementary::sin_cos;

/// Amplitude of the longer waves at difficulty 1, m.
const AMPLITUDE: f64 = 0.02;
/// Wavelengths, m, and amplitudes relative to that of the first.
const WAVES: [[f64; 2]; 2] = [[1.6, 1.0], [1.0, 0.5]];
/// Largest angle between a train of waves and the direction of all, rad.
const SPREAD: f64 = 0.4;
/// Distance of the map's heights, m.
const SPACING: f64 = 0.1;
/// The map reaches this far beyond the rectangle that start and goals span, m.
const MARGIN: f64 = 8.0;

/// What sand is drawn from.
#[derive(Clone, Debug)]
pub struct SandDistribution {
    /// Ground of each soil, on any surface. At least one.
    pub soils: Vec<Arc<SoftGround>>,
}

/// The sand of an episode.
#[derive(Clone, Debug)]
pub struct SandDraw {
    /// Ground of the soil, on any surface.
    pub soil: Arc<SoftGround>,
    /// Amplitude of the longer waves, m.
    pub amplitude: f64,
    /// Seed of the waves.
    pub seed: u64,
}

impl SandDistribution {
    /// Draws the sand of an episode. `seed` replaces the draw of the waves, which is made all the
    /// same. One soil takes no random number.
    ///
    /// # Panics
    /// If there is no soil.
    pub fn draw(&self, random: &mut Pcg64, difficulty: f64, seed: Option<u64>) -> SandDraw {
        let drawn = random.below(1 << 63);
        let n = self.soils.len();
        let place = if n > 1 { random.below(1 << 63) } else { 0 };
        let index = usize::try_from(place % n as u64).unwrap_or(0);
        SandDraw {
            soil: self.soils[index].clone(),
            amplitude: AMPLITUDE * difficulty,
            seed: seed.unwrap_or(drawn),
        }
    }
}

impl SandDraw {
    /// The surface around start and goals over a plane; None where there are no waves.
    ///
    /// # Errors
    /// As [`HeightField::new`].
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a grid, small numbers
    pub fn lay_out(
        &self,
        start: &Start,
        plane: &Plane,
    ) -> Result<Option<HeightField>, TerrainError> {
        if self.amplitude <= 0.0 {
            return Ok(None);
        }
        let mut random = SplitMix64::new(self.seed);
        let turn = std::f64::consts::TAU;
        let wind = turn * random.uniform();
        let waves = WAVES.map(|[length, share]| {
            let angle = wind + SPREAD * (2.0 * random.uniform() - 1.0);
            let (sine, cosine) = sin_cos(angle);
            let k = turn / length;
            [
                k * cosine,
                k * sine,
                turn * random.uniform(),
                share * self.amplitude,
            ]
        });
        let ends = |[low, high]: Interval| {
            let first = ((low - MARGIN) / SPACING).floor();
            let last = ((high + MARGIN) / SPACING).ceil();
            (SPACING * first, (last - first) as usize + 1)
        };
        let [x, z] = start.bounds();
        let ((x, columns), (z, rows)) = (ends(x), ends(z));
        let height = |at: usize| {
            let [x, z] = [
                x + SPACING * (at % columns) as f64,
                z + SPACING * (at / columns) as f64,
            ];
            let waves = waves.map(|[a, b, phase, size]| size * sin_cos(a * x + b * z + phase).0);
            plane
                .height(x, z)
                .map_or(f64::NAN, |y| y + waves[0] + waves[1])
        };
        let heights = (0..rows * columns).map(|at| height(at) as f32).collect();
        HeightField::new(heights, [rows, columns], [SPACING; 2], [x, z]).map(Some)
    }
}
