//! The start of an episode: slope of the ground, pose of the rover and goal.
//!
//! A direction on the map, like the heading, is an angle about +y from +x, positive to the left
//! (towards −z): the direction `a` points along `(cos a, −sin a)` in (x, z).

use super::pcg64::Pcg64;
use rover_core::scalar::elementary::{atan2, sin_cos};

/// Bounds of a uniform draw, low and high.
pub type Interval = [f64; 2];

/// What a start is drawn from, uniformly; rad and m.
#[derive(Clone, Debug, PartialEq)]
pub struct StartDistribution {
    /// Slope of the ground.
    pub slope: Interval,
    /// Direction of steepest ascent.
    pub uphill: Interval,
    /// Heading of the rover.
    pub heading: Interval,
    /// Distance of the goal.
    pub goal_distance: Interval,
    /// Direction of the goal relative to the heading.
    pub goal_bearing: Interval,
    /// Goals after the first; each lies at a distance from `goal_distance` from the one before it.
    pub further: usize,
    /// Direction of each further goal relative to the leg before it.
    pub turn: Interval,
}

/// Values that replace draws.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FixedStart {
    /// rad.
    pub slope: Option<f64>,
    /// rad.
    pub uphill: Option<f64>,
    /// x and z, m; the origin by default.
    pub position: Option<[f64; 2]>,
    /// rad.
    pub heading: Option<f64>,
    /// x and z, m.
    pub goal: Option<[f64; 2]>,
    /// The first of the further goals, x and z, m.
    pub further: Vec<[f64; 2]>,
}

/// A start.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Slope of the ground, rad.
    pub slope: f64,
    /// Direction of steepest ascent, rad.
    pub uphill: f64,
    /// x and z of the trunk's origin, m.
    pub position: [f64; 2],
    /// rad.
    pub heading: f64,
    /// x and z, m.
    pub goal: [f64; 2],
    /// Goals that follow it, in order, x and z, m.
    pub further: Vec<[f64; 2]>,
}

impl Start {
    /// Slope, direction of steepest ascent, x and z of the start, heading, x and z of each goal.
    #[must_use]
    pub fn row(&self) -> Vec<f64> {
        let [x, z] = self.position;
        let pose = [self.slope, self.uphill, x, z, self.heading];
        pose.into_iter().chain(self.goals().flatten()).collect()
    }

    /// What [`Self::row`] tells; None of a row of another length.
    #[must_use]
    pub fn from_row(row: &[f64]) -> Option<Self> {
        let (&[slope, uphill, x, z, heading, goal_x, goal_z], rest) = row.split_first_chunk()?;
        let (further, []) = rest.as_chunks() else {
            return None;
        };
        let (position, goal, further) = ([x, z], [goal_x, goal_z], further.to_vec());
        Some(Self {
            slope,
            uphill,
            position,
            heading,
            goal,
            further,
        })
    }

    /// All goals in order, x and z, m.
    pub fn goals(&self) -> impl Iterator<Item = [f64; 2]> {
        std::iter::once(self.goal).chain(self.further.iter().copied())
    }

    /// Bounds of start and goals along x and z, low and high, m.
    #[must_use]
    pub fn bounds(&self) -> [Interval; 2] {
        [0, 1].map(|k| {
            let place = self.position[k];
            let low = self.goals().fold(place, |low, goal| low.min(goal[k]));
            [
                low,
                self.goals().fold(place, |high, goal| high.max(goal[k])),
            ]
        })
    }
}

impl StartDistribution {
    /// Draws a start. A fixed value replaces its draw, which is made all the same, so that the
    /// other draws do not shift.
    pub fn draw(&self, random: &mut Pcg64, fixed: &FixedStart) -> Start {
        let [slope, uphill, heading, distance, bearing] = [
            self.slope,
            self.uphill,
            self.heading,
            self.goal_distance,
            self.goal_bearing,
        ]
        .map(|range| random.uniform(range));
        let heading = fixed.heading.unwrap_or(heading);
        let position = fixed.position.unwrap_or_default();
        let (sine, cosine) = sin_cos(heading + bearing);
        let goal = [
            position[0] + distance * cosine,
            position[1] - distance * sine,
        ];
        let goal = fixed.goal.unwrap_or(goal);
        Start {
            slope: fixed.slope.unwrap_or(slope),
            uphill: fixed.uphill.unwrap_or(uphill),
            position,
            heading,
            goal,
            further: self.draw_further(random, [position, goal], &fixed.further),
        }
    }

    /// The goals after the first leg.
    fn draw_further(
        &self,
        random: &mut Pcg64,
        [mut from, mut to]: [[f64; 2]; 2],
        fixed: &[[f64; 2]],
    ) -> Vec<[f64; 2]> {
        let next = |k: usize| {
            let [distance, turn] = [self.goal_distance, self.turn].map(|r| random.uniform(r));
            let direction = atan2(from[1] - to[1], to[0] - from[0]);
            let (sine, cosine) = sin_cos(direction + turn);
            let drawn = [to[0] + distance * cosine, to[1] - distance * sine];
            (from, to) = (to, fixed.get(k).copied().unwrap_or(drawn));
            to
        };
        (0..self.further).map(next).collect()
    }
}
