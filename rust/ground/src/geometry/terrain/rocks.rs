//! Rocks of Mars: their size–frequency distribution.
//!
//! Rocks of diameter D or more cover the fraction
//!
//! ```text
//! F_k(D) = k exp(−q D),    q = 1.79 + 0.152/k    (D in m)
//! ```
//!
//! of the ground, k being the fraction that all rocks cover. A rock covers π D²/4, so there are
//! `n(D) = 4 k q exp(−q D) / (π D²)` rocks per m² of ground and m of diameter. In `y = 1/D` the
//! density `4 k q exp(−q/y)/π` is bounded and smooth: its integral is tabulated and inverted.
//!
//! Source: Golombek and Rapp 1997, *Size–frequency distributions of rocks
//! on Mars and Earth analog sites*, JGR 102 (E2), 4117–4129.

use std::f64::consts::PI;

use nalgebra::Vector3;

use super::error::TerrainError;
use super::limits::{MAX_SIZE, check_count};
use super::plane::Plane;
use crate::geometry::shape::Sphere;
use friction_contact::scalar::elementary::{exp, hypot};

/// A circle that no rock reaches into, seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearing {
    /// World, m.
    pub x: f64,
    /// World, m.
    pub z: f64,
    /// m.
    pub radius: f64,
}

/// Description of a rock field. Equal descriptions give equal rocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Rocks {
    /// k: fraction of the area that rocks of all sizes cover, in [0, 0.5].
    /// Landing sites on Mars: 0.03 to 0.2.
    pub abundance: f64,
    /// Extent along x and z, m.
    pub area: [f64; 2],
    /// Middle of the area (x, z), world, m.
    pub middle: [f64; 2],
    /// Seed of the random sizes and places.
    pub seed: u64,
    /// Largest diameter, m.
    pub max_diameter: f64,
    /// Smallest diameter, m: without it the law has no bound on the number of rocks.
    pub min_diameter: f64,
    /// Range, from and to, of the fraction of its diameter that a rock is sunk into the ground,
    /// each in [0, ½], so that a rock covers what the law says. Drawn for each rock.
    pub burial: [f64; 2],
    /// Where no rock lies.
    pub clearings: Vec<Clearing>,
    /// The ground; must not be vertical.
    pub ground: Plane,
}

impl Default for Rocks {
    /// A tenth of 20 m by 20 m of flat ground covered by half-buried rocks of 5 cm to 50 cm.
    fn default() -> Self {
        Self {
            abundance: 0.1,
            area: [20.0, 20.0],
            middle: [0.0, 0.0],
            seed: 0,
            max_diameter: 0.5,
            min_diameter: 0.05,
            burial: [0.5; 2],
            clearings: Vec::new(),
            ground: Plane::ground(),
        }
    }
}

/// Cells of the table of the sizes. The density within one is taken as
/// constant; 2048 cells put its error below that of one rock.
const CELLS: usize = 2048;

/// How often a rock that fell into a clearing is redrawn before it is dropped.
const THROWS: usize = 100;

/// Most clearings of a field: each draw of a place checks all of them.
const MAX_CLEARINGS: usize = 1000;

impl Rocks {
    /// F_k(D): fraction of the ground that rocks of diameter `diameter` (m)
    /// or more cover, without upper limit.
    #[must_use]
    pub fn covered_fraction(&self, diameter: f64) -> f64 {
        if self.abundance > 0.0 {
            self.abundance * exp(-self.decay() * diameter)
        } else {
            0.0
        }
    }

    /// q(k), 1/m.
    fn decay(&self) -> f64 {
        1.79 + 0.152 / self.abundance
    }

    /// Rocks per m² from 1/max_diameter up to each node of a uniform grid in 1/D.
    fn table(&self) -> Vec<f64> {
        let (low, step) = self.grid();
        let mut sum = 0.0;
        let mut table = vec![0.0];
        let (k, q) = (self.abundance, self.decay());
        // With so few rocks that the law underflows there are none.
        if k <= 0.0 || !q.is_finite() {
            return table;
        }
        for i in 0..CELLS {
            let y = low + (i as f64 + 0.5) * step;
            sum += 4.0 * k * q / PI * exp(-q / y) * step;
            table.push(sum);
        }
        table
    }

    fn grid(&self) -> (f64, f64) {
        let (low, high) = (1.0 / self.max_diameter, 1.0 / self.min_diameter);
        (low, (high - low) / CELLS as f64)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first number out of its range.
    pub fn check(&self) -> Result<(), TerrainError> {
        let demand = |field, value: f64, is_in: bool, range| {
            if value.is_finite() && is_in {
                Ok(())
            } else {
                Err(TerrainError::OutOfRange {
                    field,
                    range,
                    value,
                })
            }
        };
        let k = self.abundance;
        demand("abundance", k, (0.0..=0.5).contains(&k), "in [0, 0.5]")?;
        for value in self.area {
            demand(
                "area",
                value,
                value > 0.0 && value <= MAX_SIZE,
                "positive and at most 1e6 m",
            )?;
        }
        for (middle, side) in self.middle.iter().zip(self.area) {
            let end = middle.abs() + 0.5 * side;
            demand("area", end, end <= MAX_SIZE, "within 1e6 m of the origin")?;
        }
        let (largest, smallest) = (self.max_diameter, self.min_diameter);
        demand(
            "max_diameter",
            largest,
            largest > 0.0 && largest <= MAX_SIZE,
            "positive and at most 1e6 m",
        )?;
        demand(
            "min_diameter",
            smallest,
            smallest >= 1e-4 && smallest <= largest,
            "from 1e-4 m to max_diameter",
        )?;
        let [burial, deepest] = self.burial;
        demand(
            "burial",
            burial,
            (0.0..=0.5).contains(&burial),
            "in [0, 0.5]",
        )?;
        demand(
            "burial",
            deepest,
            (burial..=0.5).contains(&deepest),
            "in [0, 0.5], and not below where the range begins",
        )?;
        let count = self.clearings.len() as f64;
        let few = MAX_CLEARINGS as f64;
        demand("clear", count, count <= few, "at most 1000 circles")?;
        for clearing in &self.clearings {
            for value in [clearing.x, clearing.z] {
                let is_near = value.abs() <= MAX_SIZE;
                demand("clear", value, is_near, "within 1e6 m of the origin")?;
            }
            let radius = clearing.radius;
            demand(
                "clear",
                radius,
                radius >= 0.0,
                "of a radius that is not negative",
            )?;
        }
        let up = self.ground.normal().y;
        demand("ground", up, up > 1e-3, "a plane whose normal points up")
    }

    /// Draws the rocks.
    ///
    /// Sizes are drawn one from each of N equal slices of the distribution, so that a field
    /// follows the law to about one rock at every diameter; places are independent and
    /// rocks may overlap. A rock in a clearing is thrown again.
    ///
    /// # Errors
    /// As [`Self::check`]; `TooMany`.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0 and the limit
    pub fn sample(&self) -> Result<Vec<Sphere>, TerrainError> {
        self.check()?;
        let table = self.table();
        let per_area = table.last().copied().unwrap_or_default();
        let expected = per_area * self.area[0] * self.area[1];
        check_count(expected.min(1e15).ceil() as usize)?;
        let mut random = SplitMix64::new(self.seed);
        let count = (expected + random.uniform()) as usize;
        let mut spheres = Vec::with_capacity(count);
        for i in 0..count {
            let share = (i as f64 + random.uniform()) / count as f64;
            let radius = 0.5 * self.diameter(&table, share);
            let place = (0..THROWS).find_map(|_| {
                let x = self.middle[0] + self.area[0] * (random.uniform() - 0.5);
                let z = self.middle[1] + self.area[1] * (random.uniform() - 0.5);
                let is_clear = self
                    .clearings
                    .iter()
                    .all(|c| hypot(x - c.x, z - c.z) >= c.radius + radius);
                is_clear.then_some((x, z))
            });
            if let Some((x, z)) = place {
                let [least, most] = self.burial;
                let burial = if most > least {
                    least + (most - least) * random.uniform()
                } else {
                    least
                };
                spheres.push(self.rest(x, z, radius, burial));
            }
        }
        Ok(spheres)
    }

    /// The diameter below which the fraction `1 − share` of the rocks lies.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an index into the table
    fn diameter(&self, table: &[f64], share: f64) -> f64 {
        let (low, step) = self.grid();
        let target = share * table[table.len() - 1];
        let after = table.partition_point(|&sum| sum <= target);
        let cell = after.clamp(1, table.len() - 1) - 1;
        let width = table[cell + 1] - table[cell];
        let within = if width > 0.0 {
            (target - table[cell]) / width
        } else {
            0.0
        };
        1.0 / (low + (cell as f64 + within) * step)
    }

    /// A rock on the ground, sunk in by `burial`.
    fn rest(&self, x: f64, z: f64, radius: f64, burial: f64) -> Sphere {
        let n = self.ground.normal();
        let y = -(n.x * x + n.z * z + self.ground.offset()) / n.y;
        Sphere::new(
            Vector3::new(x, y, z) + n * (radius * (1.0 - 2.0 * burial)),
            radius,
        )
    }
}

/// SplitMix64 (Steele, Lea and Flood 2014), written out so that no update of a library changes the
/// rocks of a seed.
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// Starts from a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 * 2.0_f64.powi(-53)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sampled_field_covers_what_golombek_and_rapp_say() {
        for (seed, abundance) in [(1, 0.03), (2, 0.08), (3, 0.2)] {
            let rocks = Rocks {
                abundance,
                area: [100.0, 80.0],
                seed,
                max_diameter: 1.5,
                min_diameter: 0.08,
                ..Rocks::default()
            };
            let field = rocks.sample().unwrap();
            let area = rocks.area[0] * rocks.area[1];
            let beyond = rocks.covered_fraction(rocks.max_diameter);
            for D in [0.08, 0.1, 0.2, 0.4, 0.7, 1.0] {
                let covered: f64 = field
                    .iter()
                    .filter(|s| 2.0 * s.radius >= D)
                    .map(|s| PI * s.radius * s.radius / area)
                    .sum();
                let law = rocks.covered_fraction(D) - beyond;
                // One rock of diameter D more or less, and half a percent for the table.
                let tolerance = 0.005 * law + 2.0 * PI * D * D / 4.0 / area;
                assert!(
                    (covered - law).abs() < tolerance,
                    "k = {abundance}, D = {D}: {covered} for {law}"
                );
            }
        }
    }

    #[test]
    fn equal_seeds_give_equal_rocks_in_every_version() {
        let sample = |seed| {
            Rocks {
                seed,
                ..Rocks::default()
            }
            .sample()
            .unwrap()
        };
        assert_eq!(sample(7), sample(7));
        assert_ne!(sample(7), sample(8));
        // SplitMix64 from seed 0 begins with 0xE220A8397B1DCDAF.
        let first = SplitMix64::new(0).uniform();
        assert!((first - 0xE220_A839_7B1D_CDAF_u64 as f64 * 2.0_f64.powi(-64)).abs() < 1e-15);
    }
}
