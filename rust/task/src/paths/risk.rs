//! What the ground under a path costs.
#![expect(
    clippy::cast_possible_truncation,
    reason = "heights and costs are compared in single precision"
)]

use super::{GroundGrid, PathCosts, PlanarPose};

/// A rover from above, in the trunk's frame.
#[derive(Clone, Debug)]
pub struct Outline {
    /// x and z of the wheels' centres, m.
    pub wheels: Vec<[f64; 2]>,
    /// x and z of the cells of its underside, m.
    pub underside: Vec<[f64; 2]>,
    /// Height of its lowest point in each cell over the ground that the wheels stand on, m.
    pub clearance: Vec<f64>,
    /// Level, slope ahead and slope to the right of the plane through the ground under the wheels,
    /// by the heights under each.
    pub plane_fit: [Vec<f64>; 3],
    /// x of the point that follows the path, m.
    pub x_c: f64,
    /// Radius of the wheels, m.
    pub radius: f64,
}

impl Outline {
    /// The points whose heights count, wheels first, from the point that follows the path, m.
    #[must_use]
    pub fn points(&self) -> Vec<[f64; 2]> {
        let points = self.wheels.iter().chain(&self.underside);
        points.map(|[x, z]| [x - self.x_c, *z]).collect()
    }
}

/// How the ground fits a rover in a pose: slopes, and the gap under it.
#[derive(Clone, Copy, Debug)]
pub struct GroundFit {
    /// Slope ahead of the plane through the ground under the wheels, rise over run.
    pub ahead: f32,
    /// Slope to the right.
    pub right: f32,
    /// Least gap under the rover, over the wheels' radius; infinite if nothing collides.
    pub gap: f32,
}

/// Costs of poses by the heights under the rover's points.
#[derive(Clone, Debug)]
pub struct PathRisk {
    grid: GroundGrid,
    n_wheels: usize,
    fit: [Vec<f32>; 3],
    x: Vec<f32>,
    z: Vec<f32>,
    clearance: Vec<f32>,
    radius: f32,
    margin: f32,
    belly: f32,
    climb: f32,
    step: f32,
    lean: f32,
}

impl PathRisk {
    /// The risk on paths whose poses are `step` m apart.
    #[must_use]
    pub fn new(grid: GroundGrid, outline: &Outline, costs: &PathCosts, step: f64) -> Self {
        let single = |values: &[f64]| values.iter().map(|value| *value as f32).collect();
        let column = |i: usize| {
            let cells = outline.underside.iter();
            cells.map(|cell| cell[i] as f32).collect()
        };
        Self {
            n_wheels: outline.wheels.len(),
            fit: [0, 1, 2].map(|i| single(&outline.plane_fit[i])),
            x: column(0),
            z: column(1),
            clearance: single(&outline.clearance),
            radius: outline.radius as f32,
            margin: costs.margin as f32,
            belly: (step * costs.belly) as f32,
            climb: costs.climb as f32,
            step: costs.step as f32,
            lean: (step * costs.lean) as f32,
            grid,
        }
    }

    /// The grid of the heights.
    #[must_use]
    pub fn grid(&self) -> &GroundGrid {
        &self.grid
    }

    /// Radius of the wheels, m.
    #[must_use]
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Wheels of the rover.
    #[must_use]
    pub fn n_wheels(&self) -> usize {
        self.n_wheels
    }

    /// The heights under the rover's points in a pose, and how the rover would stand there.
    pub fn stand(&self, heights: &[f32], pose: PlanarPose, seen: &mut [f32]) -> GroundFit {
        self.grid.under(heights, pose, seen);
        self.stand_on(seen)
    }

    /// How the rover would stand with these heights under its points. Those under the underside may
    /// be unknown (nan).
    #[must_use]
    pub fn stand_on(&self, seen: &[f32]) -> GroundFit {
        let (wheels, under) = seen.split_at(self.n_wheels);
        let [level, ahead, right] = [0, 1, 2].map(|i| {
            let products = wheels.iter().zip(&self.fit[i]);
            products.fold(0.0_f32, |sum, (height, weight)| sum + height * weight)
        });
        let gap = if under.is_empty() {
            f32::INFINITY
        } else {
            (self.smallest_gap(under, ahead, right) + level) / self.radius
        };
        GroundFit { ahead, right, gap }
    }

    /// Cost of a pose, and writes the heights under the rover's points to `seen`; `before` are
    /// those under its wheels at the pose before.
    pub fn of(&self, heights: &[f32], pose: PlanarPose, before: &[f32], seen: &mut [f32]) -> f32 {
        let stand = self.stand(heights, pose, seen);
        self.of_fit(&stand) + self.of_rise(&seen[..self.n_wheels], before)
    }

    /// Cost of standing so, without the climb.
    #[must_use]
    pub fn of_fit(&self, stand: &GroundFit) -> f32 {
        let GroundFit { ahead, right, gap } = *stand;
        let low = (self.margin - gap).max(0.0);
        self.lean * (ahead * ahead + right * right) + self.belly * low * (1.0 + low)
    }

    /// Cost of the climb of the wheels to these heights from those before.
    #[must_use]
    pub fn of_rise(&self, wheels: &[f32], before: &[f32]) -> f32 {
        let rises = wheels.iter().zip(before).map(|(height, before)| {
            let rise = (height - before).max(0.0) / self.radius;
            let steep = (rise - 0.5).max(0.0);
            self.climb * rise + self.step * steep * steep
        });
        rises.fold(0.0, |sum, cost| sum + cost)
    }

    /// The smallest gap between the underside, carried by a plane of given slopes through 0, and
    /// the heights under it.
    fn smallest_gap(&self, under: &[f32], ahead: f32, right: f32) -> f32 {
        const WIDTH: usize = 16;
        let gap = |x: f32, z: f32, clearance: f32, height: f32| {
            ahead * x + right * z + clearance - height
        };
        let mut smallest = [f32::INFINITY; WIDTH];
        let chunks = (self.x.chunks_exact(WIDTH).zip(self.z.chunks_exact(WIDTH))).zip(
            self.clearance
                .chunks_exact(WIDTH)
                .zip(under.chunks_exact(WIDTH)),
        );
        for ((x, z), (clearance, height)) in chunks {
            for k in 0..WIDTH {
                let gap = gap(x[k], z[k], clearance[k], height[k]);
                smallest[k] = if gap < smallest[k] { gap } else { smallest[k] };
            }
        }
        let done = self.x.len() / WIDTH * WIDTH;
        let rest =
            (done..self.x.len()).map(|k| gap(self.x[k], self.z[k], self.clearance[k], under[k]));
        smallest
            .into_iter()
            .chain(rest)
            .fold(f32::INFINITY, f32::min)
    }
}
