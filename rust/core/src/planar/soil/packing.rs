//! Seeded packings without overlap: a loose square array, shaken; gravity does the rest.

use super::super::error::{LENGTHS, MASSES, PLACES, within};
use super::disks::{Disks, check_count};
use super::error::SoilError;
use crate::geometry::terrain::rocks::Random;

/// Disks of radii drawn evenly from a range, row upon row over a width.
///
/// Equal descriptions give equal packings. Rows are filled from the left, the lowest first; each disk is moved at random in the room that
/// its place in the array leaves, so no two overlap. The mass is `mass` for the mean radius, and goes with r².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packing {
    /// How many disks.
    pub count: usize,
    /// Smallest radius, m.
    pub radius_min: f64,
    /// Largest radius, m.
    pub radius_max: f64,
    /// Mass of a disk of the mean radius, kg.
    pub mass: f64,
    /// Left end of the rows, m.
    pub left: f64,
    /// Length of the rows, m.
    pub width: f64,
    /// Height that the lowest disks stay above, m.
    pub bottom: f64,
    /// Of radii and places.
    pub seed: u64,
}

impl Default for Packing {
    /// The original's soil: 222 disks of 1.60 to 1.65 cm and 0.7 kg, three layers of 74.
    fn default() -> Self {
        Self {
            count: 222,
            radius_min: 0.016,
            radius_max: 0.0165,
            mass: 0.7,
            left: 0.0,
            width: 74.0 * 0.0331,
            bottom: 0.0,
            seed: 0,
        }
    }
}

/// Room between the largest disks of the array, as a share of their diameter.
const ROOM: f64 = 0.003;

impl Packing {
    /// The disks, and (x, y, θ) of each (3n), m and rad.
    ///
    /// # Errors
    /// No disk, or more than [`MAX_DISKS`](super::disks::MAX_DISKS); a number that is not finite, of the wrong sign or out of its range; radii the wrong
    /// way round; a width without room for one disk.
    pub fn build(&self) -> Result<(Disks, Vec<f64>), SoilError> {
        within(|| "radius_min".to_owned(), self.radius_min, LENGTHS)?;
        within(|| "radius_max".to_owned(), self.radius_max, LENGTHS)?;
        within(|| "mass".to_owned(), self.mass, MASSES)?;
        within(|| "width".to_owned(), self.width, LENGTHS)?;
        within(|| "left".to_owned(), self.left, PLACES)?;
        within(|| "bottom".to_owned(), self.bottom, PLACES)?;
        check_count(self.count)?;
        if self.radius_max < self.radius_min {
            return Err(SoilError::Range {
                value: self.radius_max,
            });
        }
        let pitch = 2.0 * self.radius_max * (1.0 + ROOM);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive
        let columns = (self.width / pitch).floor() as usize;
        if columns == 0 {
            return Err(SoilError::TooNarrow {
                value: self.width,
                needed: pitch,
            });
        }
        let mut random = Random::new(self.seed);
        let mean = 0.5 * (self.radius_min + self.radius_max);
        // The array is spread over the whole width.
        let across = self.width / columns as f64;
        let (mut radius, mut mass, mut q) = (Vec::new(), Vec::new(), Vec::new());
        if self.count == 0 {
            return Err(SoilError::Empty);
        }
        for i in 0..self.count {
            let r = self.radius_min + (self.radius_max - self.radius_min) * random.uniform();
            let (column, row) = ((i % columns) as f64, (i / columns) as f64);
            let (free_x, free_y) = (0.5 * across - r, 0.5 * pitch - r);
            let x = self.left + across * (column + 0.5) + free_x * (2.0 * random.uniform() - 1.0);
            let y = self.bottom + pitch * (row + 0.5) + free_y * (2.0 * random.uniform() - 1.0);
            q.extend([x, y, 0.0]);
            radius.push(r);
            mass.push(self.mass * (r / mean).powi(2));
        }
        Ok((Disks::new(radius, mass)?, q))
    }
}
