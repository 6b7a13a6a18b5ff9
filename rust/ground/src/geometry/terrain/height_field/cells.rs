//! Cells of a height field side by side, to be compared with a wheel.

use nalgebra::Vector3;

use super::{HeightField, Place, narrow};
use friction_contact::scalar::MAX_LANES;

/// Cells that are compared together: a register of them, or several.
pub(super) const CELLS: usize = MAX_LANES;

/// Corners whose heights decide about a cell, by column and row from its first: those of the cell,
/// before and left of it, and the furthest ones of the faces at its other two edges.
const CORNERS: [Place; 8] = [
    [0, 0],
    [1, 0],
    [0, 1],
    [1, 1],
    [0, -1],
    [-1, 0],
    [2, 1],
    [1, 2],
];

/// Cells to compare.
pub(super) struct Cells {
    pub n: usize,
    pub places: [[usize; 2]; CELLS],
    /// Place of the wheel's centre from each along x and z, m.
    pub from: [[f64; CELLS]; 2],
    /// Heights of the [`CORNERS`] of each cell, m.
    pub heights: [[f64; CELLS]; CORNERS.len()],
}

impl Cells {
    pub const fn new() -> Self {
        Self {
            n: 0,
            places: [[0; 2]; CELLS],
            from: [[0.0; CELLS]; 2],
            heights: [[0.0; CELLS]; CORNERS.len()],
        }
    }

    /// Adds a cell; `centre`: of the wheel, world, m.
    #[inline]
    pub fn add(&mut self, field: &HeightField, cell @ [i, j]: [usize; 2], centre: &Vector3<f64>) {
        let k = self.n;
        self.n += 1;
        self.places[k] = cell;
        self.from[0][k] = centre.x - (field.origin[0] + i as f64 * field.spacing[0]);
        self.from[1][k] = centre.z - (field.origin[1] + j as f64 * field.spacing[1]);
        let is_inside = i > 0 && j > 0 && i + 2 < field.columns && j + 2 < field.rows;
        let heights = if is_inside {
            let first = (j - 1) * field.columns + i - 1;
            let row = |v: usize| {
                let row = &field.heights[first + v * field.columns..][..4];
                [row[0], row[1], row[2], row[3]]
            };
            let [before, near, far, next] = [row(0), row(1), row(2), row(3)];
            [
                near[1], near[2], far[1], far[2], before[1], near[0], far[3], next[2],
            ]
        } else {
            let [i, j] = cell.map(narrow);
            CORNERS.map(|[u, v]| field.height_at([i + u, j + v]))
        };
        for (own, height) in self.heights.iter_mut().zip(heights) {
            own[k] = f64::from(height);
        }
    }
}
