//! Random packings without overlap: a perturbed loose array, which settles under gravity.

use super::bodies::{COORDINATES, Grains, check_count, noun};
use super::error::GrainError;
use crate::geometry::terrain::rocks::SplitMix64;
use crate::quantity::{LENGTHS, MASSES, PLACES, within};

/// Grains with radii drawn uniformly from a range, row upon row over a width; in space, layer upon
/// layer over a rectangle.
///
/// Equal descriptions give equal packings. Rows are filled from the left, in space from the back,
/// the lowest first; each grain is moved at random in the room that its place in the array leaves,
/// so no two overlap. The mass is `mass` for the mean radius, and goes with r^D.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packing<const D: usize> {
    /// How many grains.
    pub count: usize,
    /// Smallest radius, m.
    pub radius_min: f64,
    /// Largest radius, m.
    pub radius_max: f64,
    /// Mass of a grain of the mean radius, kg.
    pub mass: f64,
    /// Corner that all grains stay to the right of and above, in space also in front of, m.
    pub corner: [f64; D],
    /// Sides of the box that they are filled into, m; it is open above, so
    /// that of y does not count.
    pub sides: [f64; D],
    /// Seed of the random radii and places.
    pub seed: u64,
}

impl Default for Packing<2> {
    /// The original's bed: 222 disks of 1.60 to 1.65 cm and 0.7 kg, three layers of 74.
    fn default() -> Self {
        Self {
            count: 222,
            radius_min: 0.016,
            radius_max: 0.0165,
            mass: 0.7,
            corner: [0.0, 0.0],
            sides: [74.0 * 0.0331, f64::INFINITY],
            seed: 0,
        }
    }
}

/// Distance between the largest grains of the array, as a fraction of their diameter.
const ROOM: f64 = 0.003;

/// Names of the corner's and of the sides' entries.
const CORNER: [&str; 3] = ["left", "bottom", "back"];
const SIDES: [&str; 3] = ["width", "height", "depth"];

/// Sides and corner of an array of grains, and its places along each axis.
struct Array<const D: usize> {
    corner: [f64; D],
    places: [usize; D],
    /// Length of a place along each axis, m.
    across: [f64; D],
}

impl<const D: usize> Array<D> {
    /// For grains up to the radius `largest` (m).
    fn new(corner: [f64; D], sides: [f64; D], largest: f64) -> Result<Self, GrainError> {
        for k in (0..D).filter(|k| *k != 1) {
            within(|| SIDES[k].to_owned(), sides[k], LENGTHS)?;
        }
        for k in 0..D {
            within(|| CORNER[k].to_owned(), corner[k], PLACES)?;
        }
        let pitch = 2.0 * largest * (1.0 + ROOM);
        // Places along each axis and their length; the array is spread over
        // the whole sides, and upwards without end.
        let (mut places, mut across) = ([usize::MAX; D], [pitch; D]);
        for k in (0..D).filter(|k| *k != 1) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive
            let along = (sides[k] / pitch).floor() as usize;
            if along == 0 {
                return Err(GrainError::TooNarrow {
                    field: SIDES[k],
                    noun: noun(D),
                    value: sides[k],
                    needed: pitch,
                });
            }
            (places[k], across[k]) = (along, sides[k] / along as f64);
        }
        Ok(Self {
            corner,
            places,
            across,
        })
    }

    /// Coordinates of grain i of radius r, moved at random within its place.
    fn put(&self, i: usize, r: f64, random: &mut SplitMix64) -> [f64; COORDINATES] {
        let mut place = [0; COORDINATES];
        let mut rest = i;
        for k in (0..D).filter(|k| *k != 1).chain([1]) {
            (place[k], rest) = (rest % self.places[k], rest / self.places[k]);
        }
        let mut x = [0.0; COORDINATES];
        for k in 0..D {
            let free = 0.5 * self.across[k] - r;
            let middle = self.corner[k] + self.across[k] * (place[k] as f64 + 0.5);
            x[k] = middle + free * (2.0 * random.uniform() - 1.0);
        }
        x
    }
}

/// Coordinates ([`COORDINATES`] n) of grains of these radii (m) in an array that is filled as
/// [`Packing`] says, in the order given.
///
/// # Errors
/// No radius, or too many; a number that is not finite or out of its range; sides without room for
/// the largest grain.
pub fn arranged<const D: usize>(
    radius: &[f64],
    corner: [f64; D],
    sides: [f64; D],
    seed: u64,
) -> Result<Vec<f64>, GrainError> {
    check_count::<D>(radius.len())?;
    for (i, r) in radius.iter().enumerate() {
        within(|| format!("radius[{i}]"), *r, LENGTHS)?;
    }
    let largest = radius.iter().copied().fold(0.0, f64::max);
    if radius.is_empty() {
        return Err(GrainError::Empty);
    }
    let array = Array::new(corner, sides, largest)?;
    let mut random = SplitMix64::new(seed);
    let put = |(i, r): (usize, &f64)| array.put(i, *r, &mut random);
    Ok(radius.iter().enumerate().flat_map(put).collect())
}

impl<const D: usize> Packing<D> {
    /// The grains, and the coordinates of each ([`COORDINATES`] n), m and rad.
    ///
    /// # Errors
    /// No grain, or more than [`MAX_GRAINS`](super::bodies::MAX_GRAINS); a
    /// number that is not finite, of the wrong sign or out of its range; radii
    /// the wrong way round; sides without room for one grain.
    pub fn build(&self) -> Result<(Grains<D>, Vec<f64>), GrainError> {
        within(|| "radius_min".to_owned(), self.radius_min, LENGTHS)?;
        within(|| "radius_max".to_owned(), self.radius_max, LENGTHS)?;
        within(|| "mass".to_owned(), self.mass, MASSES)?;
        check_count::<D>(self.count)?;
        if self.radius_max < self.radius_min {
            return Err(GrainError::Range {
                value: self.radius_max,
            });
        }
        let array = Array::new(self.corner, self.sides, self.radius_max)?;
        if self.count == 0 {
            return Err(GrainError::Empty);
        }
        let mut random = SplitMix64::new(self.seed);
        let mean = 0.5 * (self.radius_min + self.radius_max);
        let (mut radius, mut mass, mut q) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..self.count {
            let r = self.radius_min + (self.radius_max - self.radius_min) * random.uniform();
            q.extend(array.put(i, r, &mut random));
            radius.push(r);
            mass.push(self.mass * (r / mean).powi(if D == 2 { 2 } else { 3 }));
        }
        Ok((Grains::new(radius, mass)?, q))
    }
}
