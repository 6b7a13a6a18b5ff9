//! Neighbour search: a grid of cells, refilled at each step in time proportional to the number of
//! grains.
//!
//! Cells are numbered row by row and layer by layer, and folded into a table of a few entries per
//! grain. A grain that flies off thus costs no memory: its cell shares an entry with another one,
//! and the distance test separates them.

use super::bodies::COORDINATES;

/// A grain in the order of the cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item<const D: usize> {
    /// Centre, m.
    pub centre: [f64; D],
    /// m.
    pub radius: f64,
    /// Number of the grain.
    pub index: u32,
}

/// The cells of a step: scratch.
#[derive(Clone, Debug)]
pub struct Grid<const D: usize> {
    inverse: f64,
    origin: [f64; D],
    /// From a cell to the next along each axis.
    strides: [i64; D],
    size: i64,
    starts: Vec<u32>,
    places: Vec<u32>,
    items: Vec<Item<D>>,
}

impl<const D: usize> Default for Grid<D> {
    fn default() -> Self {
        Self {
            inverse: 0.0,
            origin: [0.0; D],
            strides: [0; D],
            size: 0,
            starts: Vec::new(),
            places: Vec::new(),
            items: Vec::new(),
        }
    }
}

/// Centre of a grain of the coordinates q.
#[inline]
fn centre<const D: usize>(q: &[f64]) -> [f64; D] {
    let mut centre = [0.0; D];
    centre.copy_from_slice(&q[..D]);
    centre
}

impl<const D: usize> Grid<D> {
    /// Puts grains into cells of the side `cell` (m). `q`: the coordinates
    /// of each grain, at least; all finite.
    pub fn fill(&mut self, q: &[f64], radius: &[f64], cell: f64) {
        let n = radius.len();
        let grains = || q.chunks_exact(COORDINATES).take(n);
        let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        for grain in grains() {
            for k in 0..D {
                low[k] = low[k].min(grain[k]);
                high[k] = high[k].max(grain[k]);
            }
        }
        self.inverse = 1.0 / cell;
        self.origin = low;
        let size = (4 * n).next_power_of_two().max(64);
        self.size = i64::try_from(size).unwrap_or(i64::MAX);
        // One empty column on either side separates a row from the next. Neighbours never share an
        // entry: three cells along the last axis always fit.
        let mut stride = 1;
        for k in 0..D {
            self.strides[k] = stride;
            let cells = (high[k] - low[k]) * self.inverse + 3.0;
            // Three cells along each later axis must fit; the last is folded.
            let later = if k + 2 < D { 3 } else { 1 };
            let most = (self.size / 4 / stride / later).max(3);
            // A non-finite coordinate gives no number of cells.
            #[allow(clippy::cast_possible_truncation)] // clamped
            let cells = cells.min(most as f64) as i64;
            stride *= cells.max(3);
        }
        self.starts.clear();
        self.starts.resize(size + 1, 0);
        self.places.clear();
        for grain in grains() {
            let place = self.place(self.cell(&centre(grain)));
            self.places.push(place);
            self.starts[place as usize + 1] += 1;
        }
        for k in 0..size {
            self.starts[k + 1] += self.starts[k];
        }
        let none = Item {
            centre: [0.0; D],
            radius: 0.0,
            index: 0,
        };
        self.items.resize(n, none);
        for (i, grain) in grains().enumerate() {
            let start = &mut self.starts[self.places[i] as usize];
            self.items[*start as usize] = Item {
                centre: centre(grain),
                radius: radius[i],
                #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
                index: i as u32,
            };
            *start += 1;
        }
        // The fill moved each start to its cell's end.
        self.starts.rotate_right(1);
        self.starts[0] = 0;
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation)] // saturates, and folds
    fn cell(&self, x: &[f64; D]) -> [i64; D] {
        let mut cell = [0; D];
        for k in 0..D {
            cell[k] = ((x[k] - self.origin[k]) * self.inverse).floor() as i64;
        }
        cell
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // masked
    fn place(&self, cell: [i64; D]) -> u32 {
        let mut number = cell[0];
        for k in 1..D {
            number = number.wrapping_add(cell[k].wrapping_mul(self.strides[k]));
        }
        (number & (self.size - 1)) as u32
    }

    /// Calls `visit` for every grain in the cells that a cube of half side `reach` (m) around `x`
    /// touches, and perhaps for others; for each once.
    #[inline]
    pub fn near(&self, x: &[f64; D], reach: f64, mut visit: impl FnMut(&Item<D>)) {
        let low = self.cell(&x.map(|x| x - reach));
        let high = self.cell(&x.map(|x| x + reach));
        // Numbers of the cells differ by less than the table's size, and no
        // row runs into the next: no entry is met twice.
        let mut span = 1_i64;
        let mut is_apart = true;
        for k in 0..D {
            let cells = high[k].saturating_sub(low[k]).saturating_add(1);
            is_apart &= k + 1 == D || cells.saturating_mul(self.strides[k]) <= self.strides[k + 1];
            span = span.saturating_add((cells - 1).saturating_mul(self.strides[k]));
        }
        if !is_apart || span > self.size {
            self.items.iter().for_each(visit);
            return;
        }
        let layers = if D == 3 {
            low[D - 1]..=high[D - 1]
        } else {
            0..=0
        };
        for layer in layers {
            for row in low[1]..=high[1] {
                for column in low[0]..=high[0] {
                    let mut cell = [0; D];
                    cell[D - 1] = layer;
                    (cell[0], cell[1]) = (column, row);
                    let place = self.place(cell) as usize;
                    let range = self.starts[place] as usize..self.starts[place + 1] as usize;
                    self.items[range].iter().for_each(&mut visit);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::terrain::rocks::SplitMix64;
    use crate::spatial::space::length;

    fn finds_every_neighbour_once<const D: usize>(reach: f64) {
        let mut random = SplitMix64::new(3);
        for (n, spread) in [(1, 1.0), (40, 1.0), (100, 1.0), (500, 3.0)] {
            let count = COORDINATES * n;
            let mut q: Vec<f64> = (0..count).map(|_| spread * random.uniform()).collect();
            q[0] = 1e6;
            if n > 1 {
                q[COORDINATES + 1] = -1e9;
            }
            let radius = vec![0.05; n];
            let mut grid = Grid::<D>::default();
            grid.fill(&q, &radius, 0.11);
            for own in q.chunks_exact(COORDINATES) {
                let x: [f64; D] = centre(own);
                let mut seen = vec![0; n];
                grid.near(&x, reach, |item| seen[item.index as usize] += 1);
                for (other, seen) in q.chunks_exact(COORDINATES).zip(seen) {
                    let between: [f64; D] = std::array::from_fn(|k| other[k] - x[k]);
                    let apart = length(&between);
                    assert!(seen == 1 || (apart > reach && seen == 0), "{seen} {apart}");
                }
            }
        }
    }

    #[test]
    fn finds_every_neighbour_once_also_with_grains_far_away() {
        finds_every_neighbour_once::<2>(0.1);
        finds_every_neighbour_once::<3>(0.1);
    }

    #[test]
    fn coordinates_that_are_not_finite_do_no_harm() {
        for bad in [f64::INFINITY, f64::NAN] {
            let mut grid = Grid::<3>::default();
            grid.fill(&[bad; 6], &[0.1; 2], 0.2);
            let mut seen = 0;
            grid.near(&[0.0; 3], 0.2, |_| seen += 1);
            assert!(seen <= 2);
        }
    }

    /// A wheel of twelve cells over a bed that one grain had left: the cells of its upper rows had
    /// the same entries as those of the lower ones, and it met grains several times.
    #[test]
    fn a_wide_look_finds_none_twice() {
        finds_every_neighbour_once::<2>(0.7);
        finds_every_neighbour_once::<3>(0.7);
    }
}
