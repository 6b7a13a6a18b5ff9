//! A height scan as a finer grid with a margin, and the points of a rover on it by pose.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "rows and columns of a grid of some thousand cells"
)]

use std::f64::consts::TAU;

use super::PlanarPose;
use rover_core::scalar::elementary::sin_cos;

/// Cells of the grid per spacing of the scan.
const FINER: usize = 2;

/// Headings at which the points are tabulated.
const HEADINGS: i32 = 144;

/// Rows, columns and spacing of a height scan.
///
/// Its rows lie across, the first farthest ahead; columns lead to the right. The middle of the
/// scan is the trunk's origin.
#[derive(Clone, Copy, Debug)]
pub struct ScanShape {
    /// Rows, at least 2.
    pub rows: usize,
    /// Columns, at least 2.
    pub columns: usize,
    /// Distance between two rows or columns, m.
    pub spacing: f64,
}

/// Heights at the points of a rover, in any pose, from a height scan.
///
/// Beyond the scan the ground has the median height of its points.
#[derive(Clone, Debug)]
pub struct GroundGrid {
    scan: ScanShape,
    cell: f64,
    margin: usize,
    rows: usize,
    columns: usize,
    width: usize,
    /// Row and column of the point that follows the path.
    origin: [f64; 2],
    /// Where the points lie from the point that follows the path, by heading.
    offsets: Vec<i32>,
    n_points: usize,
}

impl GroundGrid {
    /// The grid for points at x and z from the point that follows the path, which lies `x_c` ahead
    /// of the trunk's origin, m.
    #[must_use]
    pub fn new(scan: ScanShape, points: &[[f64; 2]], x_c: f64) -> Self {
        let cell = scan.spacing / FINER as f64;
        let reach = points
            .iter()
            .map(|[x, z]| (x * x + z * z).sqrt())
            .fold(0.0, f64::max);
        let margin = (reach / cell).ceil() as usize + 2;
        let (rows, columns) = (FINER * (scan.rows - 1) + 1, FINER * (scan.columns - 1) + 1);
        let width = columns + 2 * margin;
        Self {
            scan,
            cell,
            margin,
            rows,
            columns,
            width,
            origin: [
                0.5 * (rows - 1) as f64 - x_c / cell,
                0.5 * (columns - 1) as f64,
            ],
            offsets: offsets(points, cell, width),
            n_points: points.len(),
        }
    }

    /// The grid of a map of at least 3 rows and columns of cells, `cell` m apart, for points at x
    /// and z from the point that follows the path. Its first cell lies where poses begin.
    #[must_use]
    pub fn by_cells([rows, columns]: [usize; 2], cell: f64, points: &[[f64; 2]]) -> Self {
        let scan = ScanShape {
            rows: rows.div_ceil(FINER),
            columns: columns.div_ceil(FINER),
            spacing: cell * FINER as f64,
        };
        let mut grid = Self::new(scan, points, 0.0);
        grid.width = grid.width - grid.columns + columns;
        (grid.rows, grid.columns, grid.origin) = (rows, columns, [0.0; 2]);
        grid.offsets = offsets(points, cell, grid.width);
        grid
    }

    /// Points of the scan.
    #[must_use]
    pub fn n_heights(&self) -> usize {
        self.scan.rows * self.scan.columns
    }

    /// Points of the rover.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.n_points
    }

    /// Fills `grid` from heights in the order of the scan, by linear interpolation.
    ///
    /// # Panics
    ///
    /// The heights are not as many as the scan has points.
    pub fn spread(&self, heights: &[f64], grid: &mut Vec<f32>) {
        assert_eq!(heights.len(), self.n_heights(), "heights of the scan");
        let far = median(heights) as f32;
        grid.clear();
        grid.resize((self.rows + 2 * self.margin) * self.width, far);
        let coarse = |row: usize, column: usize| heights[row * self.scan.columns + column];
        for row in 0..self.rows {
            let (above, below) = (row / FINER, row.div_ceil(FINER));
            let between = |column: usize| {
                if above == below {
                    coarse(above, column)
                } else {
                    0.5 * (coarse(above, column) + coarse(below, column))
                }
            };
            let start = (row + self.margin) * self.width + self.margin;
            let out = &mut grid[start..start + self.columns];
            for (column, height) in out.iter_mut().enumerate() {
                let (left, right) = (column / FINER, column.div_ceil(FINER));
                *height = if left == right {
                    between(left) as f32
                } else {
                    (0.5 * (between(left) + between(right))) as f32
                };
            }
        }
    }

    /// Fills `grid` with a height for each cell; the margin is not known.
    pub fn lay(&self, heights: &[f64], grid: &mut Vec<f32>) {
        grid.clear();
        grid.resize((self.rows + 2 * self.margin) * self.width, f32::NAN);
        for (row, values) in heights.chunks_exact(self.columns).enumerate() {
            let start = (row + self.margin) * self.width + self.margin;
            for (out, height) in grid[start..start + self.columns].iter_mut().zip(values) {
                *out = *height as f32;
            }
        }
    }

    /// The heights of a grid under the points of the rover in a pose, or under the first of them.
    pub fn under(&self, grid: &[f32], pose: PlanarPose, heights: &mut [f32]) {
        let middle = self.place(pose);
        let turn = (pose.heading * (f64::from(HEADINGS) / TAU)).round_ties_even() as i64;
        let heading = turn.rem_euclid(i64::from(HEADINGS)) as usize;
        let offsets = &self.offsets[heading * self.n_points..][..self.n_points];
        for (height, offset) in heights.iter_mut().zip(offsets) {
            *height = grid[(middle + offset) as usize];
        }
    }

    /// The way to the goal from the place of a pose, and its direction, ahead and to the right, by
    /// linear interpolation of the ways from the scan's points, m; beyond the scan, by the straight
    /// way to its border.
    #[must_use]
    pub fn way(&self, ways: &[f64], pose: PlanarPose) -> (f64, f64, f64) {
        let along = |at: f64, n: usize| {
            let within = at.clamp(0.0, (n - 1) as f64);
            let first = (within as usize).min(n - 2);
            (first, within - first as f64, at - within)
        };
        let finer = FINER as f64;
        let (row, u, before) = along(
            (self.origin[0] - pose.ahead / self.cell) / finer,
            self.scan.rows,
        );
        let (column, w, beside) = along(
            (self.origin[1] + pose.right / self.cell) / finer,
            self.scan.columns,
        );
        let at = |i: usize, j: usize| ways[(row + i) * self.scan.columns + column + j];
        let (left, right) = (
            at(0, 0) + u * (at(1, 0) - at(0, 0)),
            at(0, 1) + u * (at(1, 1) - at(0, 1)),
        );
        let back = at(1, 0) - at(0, 0) + w * (at(1, 1) - at(1, 0) - at(0, 1) + at(0, 0));
        let beyond = (before * before + beside * beside).sqrt() * self.scan.spacing;
        (left + w * (right - left) + beyond, back, left - right)
    }

    /// Where the point that follows the path lies in the grid; just outside the scan if beyond it.
    fn place(&self, pose: PlanarPose) -> i32 {
        let within = |at: f64, n: usize| at.round_ties_even().clamp(-1.0, n as f64) as i32;
        let row = within(self.origin[0] - pose.ahead / self.cell, self.rows);
        let column = within(self.origin[1] + pose.right / self.cell, self.columns);
        let margin = self.margin as i32;
        (row + margin) * self.width as i32 + column + margin
    }
}

/// Where points lie from another in a grid of a width, by heading.
fn offsets(points: &[[f64; 2]], cell: f64, width: usize) -> Vec<i32> {
    let by_heading = (0..HEADINGS).flat_map(|k| {
        let (sine, cosine) = sin_cos(f64::from(k) * TAU / f64::from(HEADINGS));
        points.iter().map(move |[x, z]| {
            let (ahead, right) = (cosine * x + sine * z, cosine * z - sine * x);
            let row = (-ahead / cell).round_ties_even() as i32;
            row * width as i32 + (right / cell).round_ties_even() as i32
        })
    });
    by_heading.collect()
}

/// The median of numbers, of which there is at least one.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    let middle = sorted.len() / 2;
    let (below, upper, _) = sorted.select_nth_unstable_by(middle, f64::total_cmp);
    let upper = *upper;
    if values.len() % 2 == 1 {
        return upper;
    }
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    0.5 * (lower + upper)
}
