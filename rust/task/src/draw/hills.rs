//! Hills of an episode: a piece of one map of fractal ground, as steep as the difficulty says.
//!
//! The map is a sum of gradient noise (Perlin 1985) over octaves, whose amplitudes fall with the
//! wavelength as `λ^H`: a surface of Hurst exponent H = 0.8 between the shortest and the longest
//! wavelength, as natural ground has it. It repeats after [`PERIOD`], so that a piece may begin
//! anywhere, and is scaled to the root mean square of its slope:
//!
//! ```text
//! rms slope s = 0.2 d            rise over run, d the difficulty
//! ```

use std::sync::OnceLock;

use super::pcg64::Pcg64;
use super::start::{Interval, Start};
use rover_core::geometry::terrain::rocks::SplitMix64;
use rover_core::geometry::{HeightField, TerrainError};
use rover_core::scalar::elementary::sin_cos;

/// Distance of the map's heights, m.
pub const SPACING: f64 = 0.25;
/// Length after which the map repeats, m.
pub const PERIOD: f64 = N as f64 * SPACING;
/// Heights in a period.
const N: usize = 512;

/// Wavelengths, m: each divides the period.
const WAVELENGTHS: [f64; 6] = [32.0, 16.0, 8.0, 4.0, 2.0, 1.0];
/// Root mean square of the slope at difficulty 1, rise over run.
const HARDEST_SLOPE: f64 = 0.2;

/// The map reaches this far beyond the rectangle that start and goals span, m.
pub const MARGIN: f64 = 25.0;

/// What hills are drawn from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HillDistribution {
    /// Root mean square of the slope, rise over run; overrides that of the difficulty.
    pub rms_slope: Option<f64>,
}

/// The hills of an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HillDraw {
    /// Root mean square of the slope, rise over run.
    pub rms_slope: f64,
    /// Where the piece begins on the map, columns and rows.
    pub offset: [u64; 2],
}

impl HillDistribution {
    /// Draws the hills of an episode. `seed` replaces the draw of the place, which is made all the
    /// same.
    pub fn draw(&self, random: &mut Pcg64, difficulty: f64, seed: Option<u64>) -> HillDraw {
        let (n, drawn) = (N as u64, random.below(1 << 63));
        let drawn = seed.unwrap_or(drawn);
        HillDraw {
            rms_slope: self.rms_slope.unwrap_or(HARDEST_SLOPE * difficulty),
            offset: [drawn % n, drawn / n % n],
        }
    }
}

impl HillDraw {
    /// The ground around start and goals; at the start it has the height zero.
    ///
    /// # Errors
    /// As [`HeightField::new`].
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_possible_wrap
    )]
    // Indices of a grid, small numbers.
    pub fn lay_out(&self, start: &Start) -> Result<HeightField, TerrainError> {
        let map = map();
        let ends = |[low, high]: Interval| {
            let first = ((low - MARGIN) / SPACING).floor();
            let last = ((high + MARGIN) / SPACING).ceil();
            (first, (last - first) as usize + 1)
        };
        let [(x, columns), (z, rows)] = start.bounds().map(ends);
        let begin = |first: f64, offset: u64| (first as i64 + offset as i64).rem_euclid(N as i64);
        let (i, j) = (begin(x, self.offset[0]), begin(z, self.offset[1]));
        let at = |row: usize, column: usize| {
            let (row, column) = ((j as usize + row) % N, (i as usize + column) % N);
            map[row * N + column] * self.rms_slope
        };
        let nearest = |k: usize, first: f64| (start.position[k] / SPACING - first).round() as usize;
        let level = at(nearest(1, z), nearest(0, x));
        let mut heights = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            heights.extend((0..columns).map(|column| (at(row, column) - level) as f32));
        }
        let origin = [x * SPACING, z * SPACING];
        HeightField::new(heights, [rows, columns], [SPACING; 2], origin)
    }
}

/// Heights of one period of the map with a root mean square slope of 1, row by row, m.
fn map() -> &'static [f64] {
    static MAP: OnceLock<Vec<f64>> = OnceLock::new();
    MAP.get_or_init(|| {
        let mut heights = vec![0.0; N * N];
        for (octave, wavelength) in WAVELENGTHS.into_iter().enumerate() {
            add_noise(octave as u64, wavelength, &mut heights);
        }
        let mut squares = 0.0;
        for row in 0..N {
            for column in 0..N {
                let own = heights[row * N + column];
                let [ahead, beside] = [
                    heights[row * N + (column + 1) % N] - own,
                    heights[(row + 1) % N * N + column] - own,
                ];
                squares += (ahead * ahead + beside * beside) / (SPACING * SPACING);
            }
        }
        let scale = 1.0 / (squares / (N * N) as f64).sqrt();
        for height in &mut heights {
            *height *= scale;
        }
        heights
    })
}

/// Adds gradient noise of a wavelength (m), with the amplitude of a surface of exponent H.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // indices, small numbers
fn add_noise(octave: u64, wavelength: f64, heights: &mut [f64]) {
    let points = (PERIOD / wavelength) as usize;
    let step = N / points;
    // The wavelengths halve: their amplitudes are powers of a constant.
    let amplitude = (0..octave).fold(1.0, |product: f64, _| product * HALF_TO_THE_HURST);
    let mut random = SplitMix64::new(octave);
    let gradients: Vec<[f64; 2]> = (0..points * points)
        .map(|_| {
            let (sine, cosine) = sin_cos(std::f64::consts::TAU * random.uniform());
            [cosine, sine]
        })
        .collect();
    for row in 0..N {
        for column in 0..N {
            let (i, j) = (column / step, row / step);
            let place = |k: usize| (k % step) as f64 / step as f64;
            let (u, v) = (place(column), place(row));
            let ramp = |di: usize, dj: usize| {
                let corner = (j + dj) % points * points + (i + di) % points;
                let [a, b] = gradients[corner];
                a * (u - di as f64) + b * (v - dj as f64)
            };
            let (s, t) = (fade(u), fade(v));
            let low = ramp(0, 0) + s * (ramp(1, 0) - ramp(0, 0));
            let high = ramp(0, 1) + s * (ramp(1, 1) - ramp(0, 1));
            heights[row * N + column] += amplitude * (low + t * (high - low));
        }
    }
}

/// `0.5^H` for the exponent of Hurst, H = 0.8.
const HALF_TO_THE_HURST: f64 = 0.574_349_177_498_517_5;

/// `6 t⁵ − 15 t⁴ + 10 t³`, whose first two derivatives vanish at 0 and 1.
fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rover_core::geometry::Terrain;

    fn start(position: [f64; 2], goal: [f64; 2]) -> Start {
        Start {
            slope: 0.0,
            uphill: 0.0,
            position,
            heading: 0.0,
            goal,
            further: Vec::new(),
        }
    }

    #[test]
    fn the_amplitudes_fall_with_the_exponent_of_hurst() {
        assert!((HALF_TO_THE_HURST - 0.5_f64.powf(0.8)).abs() < 1e-15);
    }

    #[test]
    fn the_slope_is_that_of_the_difficulty_and_the_start_lies_at_zero() {
        let mut random = Pcg64::seeded(&[1]);
        let mut squares = [0.0, 0.0];
        for _ in 0..20 {
            let hills = HillDistribution::default().draw(&mut random, 0.5, None);
            let field = hills.lay_out(&start([3.0, -7.0], [12.0, 5.0])).unwrap();
            assert!(field.height(3.0, -7.0).unwrap().abs() < 1e-6);
            let [rows, columns] = field.shape();
            for row in 0..rows - 1 {
                for column in 0..columns - 1 {
                    let at = |j: usize, i: usize| f64::from(field.heights()[j * columns + i]);
                    let rise = at(row, column + 1) - at(row, column);
                    squares[0] += rise * rise / (SPACING * SPACING);
                    squares[1] += 0.5;
                }
            }
        }
        let rms = (squares[0] / squares[1]).sqrt();
        assert!((rms - 0.1).abs() < 0.02, "{rms}");
    }

    #[test]
    fn a_piece_is_the_same_wherever_it_is_cut_from() {
        let hills = HillDraw {
            rms_slope: 0.1,
            offset: [500, 7],
        };
        let near = hills.lay_out(&start([0.0, 0.0], [5.0, 0.0])).unwrap();
        let far = hills
            .lay_out(&start([PERIOD, -PERIOD], [PERIOD + 5.0, -PERIOD]))
            .unwrap();
        for (x, z) in [(1.3, 0.4), (-20.0, 11.0), (4.9, -24.0)] {
            let (a, b) = (near.height(x, z), far.height(x + PERIOD, z - PERIOD));
            assert!((a.unwrap() - b.unwrap()).abs() < 1e-6);
        }
    }
}
