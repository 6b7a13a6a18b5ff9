//! Pairs of close points by a grid of cubic cells, hashed: work and memory grow with the number of points.

use rover_core::nalgebra::Vector3;

/// Half of the 26 neighbours of a cell, so that each pair of cells is looked at once.
const HALF: [[i64; 3]; 13] = [
    [1, 0, 0],
    [-1, 1, 0],
    [0, 1, 0],
    [1, 1, 0],
    [-1, -1, 1],
    [0, -1, 1],
    [1, -1, 1],
    [-1, 0, 1],
    [0, 0, 1],
    [1, 0, 1],
    [-1, 1, 1],
    [0, 1, 1],
    [1, 1, 1],
];

/// The grid's memory, kept from one search to the next.
#[derive(Clone, Debug, Default)]
pub struct CellGrid {
    cells: Vec<[i64; 3]>,
    /// First entry of each bucket in `members`, one more than buckets.
    starts: Vec<usize>,
    members: Vec<usize>,
}

impl CellGrid {
    /// Calls `visit(i, j)` once for each pair that can be nearer than `size` (m, positive), in no particular order.
    pub fn visit_pairs(
        &mut self,
        points: &[Vector3<f64>],
        size: f64,
        mut visit: impl FnMut(usize, usize),
    ) {
        // Casts of floats saturate, so a point that has left for infinity shares the outermost cell.
        #[allow(clippy::cast_possible_truncation)]
        let cell = |x: &Vector3<f64>| [x.x, x.y, x.z].map(|x| (x / size).floor() as i64);
        self.cells.clear();
        self.cells.extend(points.iter().map(cell));
        let n_buckets = (2 * points.len()).next_power_of_two();
        self.starts.clear();
        self.starts.resize(n_buckets + 1, 0);
        for cell in &self.cells {
            self.starts[bucket(*cell, n_buckets) + 1] += 1;
        }
        for k in 0..n_buckets {
            self.starts[k + 1] += self.starts[k];
        }
        self.members.clear();
        self.members.resize(points.len(), 0);
        for (i, cell) in self.cells.iter().enumerate() {
            let start = &mut self.starts[bucket(*cell, n_buckets)];
            self.members[*start] = i;
            *start += 1;
        }
        // The fill moved each start to its bucket's end.
        self.starts.rotate_right(1);
        self.starts[0] = 0;
        for (i, &cell) in self.cells.iter().enumerate() {
            for j in self.members_of(cell).filter(|&j| j > i) {
                visit(i, j);
            }
            for offset in HALF {
                let next = [0, 1, 2].map(|k| cell[k].saturating_add(offset[k]));
                for j in self.members_of(next).filter(|&j| j != i) {
                    visit(i, j);
                }
            }
        }
    }

    fn members_of(&self, cell: [i64; 3]) -> impl Iterator<Item = usize> {
        let k = bucket(cell, self.starts.len() - 1);
        let found = &self.members[self.starts[k]..self.starts[k + 1]];
        found
            .iter()
            .copied()
            .filter(move |&j| self.cells[j] == cell)
    }
}

fn bucket(cell: [i64; 3], n_buckets: usize) -> usize {
    const PRIMES: [i64; 3] = [73_856_093, 19_349_663, 83_492_791];
    let mixed = (0..3).fold(0, |hash, k| hash ^ cell[k].wrapping_mul(PRIMES[k]));
    // The low bits are what is wanted of it.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let mixed = mixed as usize;
    mixed & (n_buckets - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_close_pair_is_visited_once() {
        // A crowd on both sides of the origin, from a generator with a fixed seed.
        let mut random = crate::sphere_scenes::Random::new(3);
        let mut next = || random.in_unit() - 0.5;
        let points: Vec<_> = (0..200)
            .map(|_| Vector3::new(next(), next(), next()))
            .collect();
        let size = 0.13;
        let mut found = Vec::new();
        CellGrid::default().visit_pairs(&points, size, |i, j| {
            if (points[i] - points[j]).norm() < size {
                found.push((i.min(j), i.max(j)));
            }
        });
        found.sort_unstable();
        let expected: Vec<_> = (0..200)
            .flat_map(|i| (i + 1..200).map(move |j| (i, j)))
            .filter(|&(i, j)| (points[i] - points[j]).norm() < size)
            .collect();
        assert!(expected.len() > 100);
        assert_eq!(found, expected);
    }
}
