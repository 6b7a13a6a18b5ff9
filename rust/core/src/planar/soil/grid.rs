//! Which disks are near which: a grid of cells, filled anew each step in time proportional to the disks.
//!
//! Cells are numbered row after row and folded into a table of a few entries per disk, so a disk that flies off costs no memory; it merely
//! shares its entry with another cell, and the distance tells them apart.

/// A disk in the order of the cells.
#[derive(Clone, Copy, Debug, Default)]
pub struct Item {
    /// Centre, m.
    pub x: f64,
    /// Centre, m.
    pub y: f64,
    /// m.
    pub radius: f64,
    /// Its number.
    pub index: u32,
}

/// The cells of a step: scratch.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    inverse: f64,
    x0: f64,
    y0: f64,
    stride: i64,
    mask: i64,
    starts: Vec<u32>,
    places: Vec<u32>,
    items: Vec<Item>,
}

impl Grid {
    /// Puts disks into cells of the side `cell` (m). `q`: (x, y, θ) of each disk, at least; all finite.
    pub fn fill(&mut self, q: &[f64], radius: &[f64], cell: f64) {
        let n = radius.len();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for disk in q.chunks_exact(3).take(n) {
            for k in 0..2 {
                low[k] = low[k].min(disk[k]);
                high[k] = high[k].max(disk[k]);
            }
        }
        self.inverse = 1.0 / cell;
        (self.x0, self.y0) = (low[0], low[1]);
        let size = (4 * n).next_power_of_two().max(64);
        // One empty column on either side, so that the next row's cells are no neighbours; neighbours never share an entry.
        let columns = (high[0] - low[0]) * self.inverse + 3.0;
        #[allow(clippy::cast_possible_truncation)] // clamped
        let columns = columns.clamp(3.0, (size / 4) as f64) as i64;
        self.stride = columns;
        self.mask = i64::try_from(size).unwrap_or(i64::MAX) - 1;
        self.starts.clear();
        self.starts.resize(size + 1, 0);
        self.places.clear();
        for disk in q.chunks_exact(3).take(n) {
            let (column, row) = self.cell(disk[0], disk[1]);
            let place = self.place(column, row);
            self.places.push(place);
            self.starts[place as usize + 1] += 1;
        }
        for k in 0..size {
            self.starts[k + 1] += self.starts[k];
        }
        self.items.resize(n, Item::default());
        for (i, disk) in q.chunks_exact(3).take(n).enumerate() {
            let start = &mut self.starts[self.places[i] as usize];
            self.items[*start as usize] = Item {
                x: disk[0],
                y: disk[1],
                radius: radius[i],
                #[allow(clippy::cast_possible_truncation)] // disks are numbered by u32
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
    fn cell(&self, x: f64, y: f64) -> (i64, i64) {
        (
            ((x - self.x0) * self.inverse).floor() as i64,
            ((y - self.y0) * self.inverse).floor() as i64,
        )
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // masked
    fn place(&self, column: i64, row: i64) -> u32 {
        (row.wrapping_mul(self.stride).wrapping_add(column) & self.mask) as u32
    }

    /// Calls `visit` for every disk in the cells that a square of half side `reach` (m) around (x, y) touches, and perhaps for others; for each once.
    #[inline]
    pub fn near(&self, x: f64, y: f64, reach: f64, mut visit: impl FnMut(&Item)) {
        let (column_0, row_0) = self.cell(x - reach, y - reach);
        let (column_1, row_1) = self.cell(x + reach, y + reach);
        let columns = column_1.saturating_sub(column_0).saturating_add(1);
        let rows = row_1.saturating_sub(row_0).saturating_add(1);
        if columns > self.stride || columns.saturating_mul(rows) > self.mask {
            // So far that cells would repeat: all disks, each once.
            self.items.iter().for_each(visit);
            return;
        }
        for row in row_0..=row_1 {
            for column in column_0..=column_1 {
                let place = self.place(column, row) as usize;
                let range = self.starts[place] as usize..self.starts[place + 1] as usize;
                self.items[range].iter().for_each(&mut visit);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::terrain::rocks::Random;

    #[test]
    fn finds_every_neighbour_once_also_with_disks_far_away() {
        let mut random = Random::new(3);
        for (n, spread) in [(1, 1.0), (40, 1.0), (500, 3.0)] {
            let mut q: Vec<f64> = (0..3 * n).map(|_| spread * random.uniform()).collect();
            q[0] = 1e6;
            if n > 1 {
                q[4] = -1e9;
            }
            let radius = vec![0.05; n];
            let mut grid = Grid::default();
            grid.fill(&q, &radius, 0.11);
            for i in 0..n {
                let (x, y) = (q[3 * i], q[3 * i + 1]);
                let mut seen = vec![0; n];
                grid.near(x, y, 0.1, |item| seen[item.index as usize] += 1);
                for j in 0..n {
                    let apart = (q[3 * j] - x).hypot(q[3 * j + 1] - y);
                    assert!(seen[j] == 1 || (apart > 0.1 && seen[j] == 0), "{i} {j}");
                }
            }
        }
    }
}
