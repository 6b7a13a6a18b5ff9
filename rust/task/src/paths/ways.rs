//! The way to a goal from every cell of a map of heights (Dijkstra 1959).
//!
//! A rover goes from a cell to one of its eight neighbours, headed for it. That costs the distance
//! and, by [`PathRisk`], what the ground under the rover costs. Where none of it is known, the
//! distance is all.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "rows and columns of a grid of some thousand cells"
)]

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::{GroundGrid, Outline, PathCosts, PathRisk, PlanarPose};
use rover_core::scalar::elementary::atan2;

/// Rows and columns from a cell to its neighbours.
const NEIGHBOURS: [(i32, i32); 8] = [
    (-1, 0),
    (-1, 1),
    (0, 1),
    (1, 1),
    (1, 0),
    (1, -1),
    (0, -1),
    (-1, -1),
];

/// What ways are asked for.
#[derive(Clone, Copy, Debug)]
pub struct MapTask<'a> {
    /// Heights of the cells, row by row, m; nan where they are not known.
    pub heights: &'a [f64],
    /// Further price of a metre in each cell.
    pub extra: &'a [f64],
    /// Row and column of the goal, within the map or not.
    pub goal: [f64; 2],
    /// Factor on the costs of belly, climb and lean.
    pub boldness: f64,
}

/// A map whose rows lie across, the first farthest ahead; columns lead to the right.
#[derive(Clone, Debug)]
pub struct WayMap {
    shape: [usize; 2],
    spacing: f64,
    risk: PathRisk,
    grid: Vec<f32>,
}

impl WayMap {
    /// A map of at least 3 rows and columns, `spacing` m apart.
    #[must_use]
    pub fn new(shape: [usize; 2], spacing: f64, outline: &Outline, costs: &PathCosts) -> Self {
        let grid = GroundGrid::by_cells(shape, spacing, &outline.points());
        Self {
            shape,
            spacing,
            risk: PathRisk::new(grid, outline, costs, 1.0),
            grid: Vec::new(),
        }
    }

    /// Number of rows and columns of the map, and their spacing, m.
    #[must_use]
    pub fn shape(&self) -> ([usize; 2], f64) {
        (self.shape, self.spacing)
    }

    /// The way to the goal from each cell, in metres of level ground. A goal beyond the map is
    /// reached by the straight way from its border.
    ///
    /// # Panics
    ///
    /// The heights or the prices are not as many as the map has cells.
    pub fn ways(&mut self, task: &MapTask<'_>) -> Vec<f64> {
        let [rows, columns] = self.shape;
        let n = rows * columns;
        assert!(
            task.heights.len() == n && task.extra.len() == n,
            "a height and a price a cell"
        );
        self.risk.grid().lay(task.heights, &mut self.grid);
        let mut ways = vec![f64::INFINITY; n];
        let mut open = BinaryHeap::new();
        for (cell, way) in self.ends(task.goal) {
            ways[cell] = way;
            open.push(Reverse((way.to_bits(), cell)));
        }
        let mut seen = vec![0.0; self.risk.grid().n_points()];
        let mut before = vec![0.0; self.risk.n_wheels()];
        while let Some(Reverse((bits, cell))) = open.pop() {
            let way = f64::from_bits(bits);
            if way > ways[cell] {
                continue;
            }
            let at = [(cell / columns) as i32, (cell % columns) as i32];
            for (down, across) in NEIGHBOURS {
                // From the neighbour to this cell.
                let from = [at[0] - down, at[1] - across];
                if from[0] < 0 || from[1] < 0 || from[0] >= rows as i32 || from[1] >= columns as i32
                {
                    continue;
                }
                let neighbour = from[0] as usize * columns + from[1] as usize;
                let length = self.spacing * f64::from(down * down + across * across).sqrt();
                let least = way + length * (1.0 + task.extra[cell]);
                if least >= ways[neighbour] {
                    continue;
                }
                let heading = atan2(-f64::from(across), -f64::from(down));
                let risk = self.risk_of(from, at, heading, length, &mut before, &mut seen);
                let longer = least + task.boldness * risk;
                if longer < ways[neighbour] {
                    ways[neighbour] = longer;
                    open.push(Reverse((longer.to_bits(), neighbour)));
                }
            }
        }
        ways
    }

    /// Where ways end, and what is left from there, m.
    fn ends(&self, goal: [f64; 2]) -> Vec<(usize, f64)> {
        let [rows, columns] = self.shape;
        let left = |row: usize, column: usize| {
            let (down, across) = (row as f64 - goal[0], column as f64 - goal[1]);
            (
                row * columns + column,
                self.spacing * (down * down + across * across).sqrt(),
            )
        };
        let within = |at: f64, n: usize| at >= 0.0 && at <= (n - 1) as f64;
        if within(goal[0], rows) && within(goal[1], columns) {
            return vec![left(
                goal[0].round_ties_even() as usize,
                goal[1].round_ties_even() as usize,
            )];
        }
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let border = cells.filter(|(row, column)| {
            *row == 0 || *column == 0 || row + 1 == rows || column + 1 == columns
        });
        border.map(|(row, column)| left(row, column)).collect()
    }

    /// What the ground costs from a cell to the next. A wheel over ground that is not known stands
    /// as high as the others do.
    fn risk_of(
        &self,
        from: [i32; 2],
        to: [i32; 2],
        heading: f64,
        length: f64,
        before: &mut [f32],
        seen: &mut [f32],
    ) -> f64 {
        let (grid, n) = (self.risk.grid(), self.risk.n_wheels());
        let pose = |[row, column]: [i32; 2]| PlanarPose {
            ahead: -f64::from(row) * self.spacing,
            right: f64::from(column) * self.spacing,
            heading,
        };
        grid.under(&self.grid, pose(to), &mut seen[..n]);
        let known = seen[..n].iter().filter(|height| !height.is_nan());
        let (count, sum) = known.fold((0.0_f32, 0.0_f32), |(count, sum), height| {
            (count + 1.0, sum + height)
        });
        if count == 0.0 {
            return 0.0;
        }
        grid.under(&self.grid, pose(from), before);
        grid.under(&self.grid, pose(to), seen);
        for (height, from) in seen.iter_mut().zip(before.iter_mut()) {
            if height.is_nan() {
                *height = sum / count;
                *from = *height;
            } else if from.is_nan() {
                *from = *height;
            }
        }
        let climb = f64::from(self.risk.of_rise(&seen[..n], before));
        length * f64::from(self.risk.of_fit(&self.risk.stand_on(seen))) + climb
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rover of four wheels with a low trunk between them.
    fn outline() -> Outline {
        Outline {
            wheels: vec![[0.3, -0.3], [0.3, 0.3], [-0.3, -0.3], [-0.3, 0.3]],
            underside: vec![[0.0, 0.0]],
            clearance: vec![0.1],
            plane_fit: [
                vec![0.25; 4],
                vec![0.833, 0.833, -0.833, -0.833],
                vec![-0.833, 0.833, -0.833, 0.833],
            ],
            x_c: 0.0,
            radius: 0.1,
        }
    }

    fn costs() -> PathCosts {
        PathCosts {
            belly: 15.0,
            margin: 0.5,
            climb: 0.12,
            step: 0.2,
            lean: 3.0,
            facing: 0.2,
            swerve: 0.08,
            switch: 0.25,
            reverse: 2.5,
            memory: 0.8,
            later: 0.8,
            depth: 4,
            width: 16,
            length: 0.6,
        }
    }

    fn ways(heights: &[f64], goal: [f64; 2]) -> Vec<f64> {
        let mut map = WayMap::new([21, 31], 0.1, &outline(), &costs());
        map.ways(&MapTask {
            heights,
            extra: &vec![0.0; heights.len()],
            goal,
            boldness: 1.0,
        })
    }

    #[test]
    fn on_level_or_unknown_ground_the_way_is_the_distance_over_the_neighbours() {
        for height in [0.3, f64::NAN] {
            let found = ways(&[height; 21 * 31], [10.0, 2.0]);
            assert!(found[10 * 31 + 2].abs() < 1e-12);
            assert!((found[10 * 31 + 22] - 2.0).abs() < 1e-6);
            let slanting = 0.1 * (4.0 + 6.0 * 2.0_f64.sqrt());
            assert!(
                (found[4 * 31 + 12] - slanting).abs() < 1e-6,
                "{}",
                found[4 * 31 + 12]
            );
        }
    }

    #[test]
    fn a_wall_with_a_gap_is_gone_round() {
        let mut heights = vec![0.0; 21 * 31];
        for row in 0..14 {
            heights[row * 31 + 15] = 0.5;
            heights[row * 31 + 16] = 0.5;
        }
        let found = ways(&heights, [3.0, 4.0]);
        let straight = 0.1 * 22.0;
        assert!(
            found[3 * 31 + 26] > straight + 1.0,
            "{}",
            found[3 * 31 + 26]
        );
        assert!((found[3 * 31 + 9] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_goal_beyond_the_map_is_reached_from_its_border() {
        let found = ways(&[0.0; 21 * 31], [10.0, 50.0]);
        assert!((found[10 * 31 + 10] - 4.0).abs() < 1e-6);
    }
}
