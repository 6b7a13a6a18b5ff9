//! The start of an episode: slope of the ground, pose of the rover and goal.
//!
//! A direction on the map, like the heading, is an angle about +y from +x, positive to the left
//! (towards −z): the direction `a` points along `(cos a, −sin a)` in (x, z).

use std::f64::consts::TAU;

use super::pcg64::Pcg64;
use crate::contact::detection::wheel_contacts;
use crate::geometry::{Coverage, Plane, Terrain, TerrainError};
use crate::multibody::{Kinematics, Model, StateError, coordinates};
use crate::scalar::elementary::{asin, atan2, hypot, sin_cos};
use nalgebra::{DMatrix, DVector, Vector3};
use thiserror::Error;

/// Bounds of a uniform draw, low and high.
pub type Range = [f64; 2];

/// What a start is drawn from, uniformly; rad and m.
#[derive(Clone, Debug, PartialEq)]
pub struct StartDistribution {
    /// Slope of the ground.
    pub slope: Range,
    /// Direction of steepest ascent.
    pub uphill: Range,
    /// Heading of the rover.
    pub heading: Range,
    /// Distance of the goal.
    pub goal_distance: Range,
    /// Direction of the goal relative to the heading.
    pub goal_bearing: Range,
    /// Goals after the first; each lies at a distance from `goal_distance` from the one before it.
    pub further: usize,
    /// Direction of each further goal relative to the leg before it.
    pub turn: Range,
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
    pub fn bounds(&self) -> [Range; 2] {
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

/// The plane through the origin that rises by `slope` in the direction `uphill`, both rad.
///
/// # Errors
/// `NotFinite` for an angle that is not finite.
pub fn tilted_plane(slope: f64, uphill: f64) -> Result<Plane, TerrainError> {
    let (across, up) = sin_cos(slope);
    let (sine, cosine) = sin_cos(uphill);
    Plane::new([-across * cosine, up, across * sine], 0.0)
}

/// Public coordinates (nv) of a rover that rests on a plane: joints at zero, the trunk upright
/// along the normal with its origin over `position` (x, z, m), the lowest wheel at gap zero. If
/// other wheels are then in the air, and pitch, roll and free joints can put more of them on the
/// ground, they do, as in [`resting_on`].
///
/// # Errors
/// `NotFinite` if the plane is vertical or a number is not finite.
///
/// # Panics
/// If the model has fewer than six velocities.
pub fn resting_pose(
    model: &Model,
    plane: &Plane,
    position: [f64; 2],
    heading: f64,
) -> Result<Vec<f64>, StateError> {
    let q = upright_on(model, plane, position, heading)?;
    match with_more_wheels_down(model, plane, &q) {
        Ok(lowered) => Ok(lowered.unwrap_or(q)),
        Err(PlacementError::State(error)) => Err(error),
        Err(PlacementError::NoGround { .. }) => Ok(q), // a plane has ground everywhere
    }
}

/// The coordinates of [`brought_down`], if more wheels stand there.
fn with_more_wheels_down(
    model: &Model,
    plane: &Plane,
    q: &[f64],
) -> Result<Option<Vec<f64>>, PlacementError> {
    let gaps = wheel_gaps(model, plane, q)?;
    if gaps.amax() <= TOUCHING {
        return Ok(None);
    }
    let lowered = brought_down(model, plane, q.to_vec())?;
    let standing = |gaps: &DVector<f64>| gaps.iter().filter(|gap| gap.abs() <= STANDING).count();
    let more = standing(&wheel_gaps(model, plane, &lowered)?) > standing(&gaps);
    Ok(more.then_some(lowered))
}

/// Public coordinates (nv) as for [`resting_pose`], with all joints at zero even if wheels stay in
/// the air.
fn upright_on(
    model: &Model,
    plane: &Plane,
    position: [f64; 2],
    heading: f64,
) -> Result<Vec<f64>, StateError> {
    let n = plane.normal();
    let (sine, cosine) = sin_cos(heading);
    // The trunk's x axis lies in the plane, its horizontal part along the heading.
    let forward = Vector3::new(cosine, -(n.x * cosine - n.z * sine) / n.y, -sine);
    let length = (forward.x * forward.x + forward.y * forward.y + forward.z * forward.z).sqrt();
    let forward = forward / length;
    let right = forward.cross(n);

    // The middle row of R = Ry(heading) Rz(pitch) Rx(roll) is (sin p, cos p cos r, −cos p sin r).
    let mut q = vec![0.0; model.nv()];
    let [x, z] = position;
    q[0] = x;
    q[1] = plane.height(x, z).unwrap_or(f64::NAN);
    q[2] = z;
    q[3] = atan2(-right.y, n.y);
    q[4] = wrapped(heading);
    q[5] = asin(forward.y);
    // Raising the trunk by dy opens every gap by dy n_y.
    let configuration = coordinates::from_public(model, &q)?;
    let wheels = wheel_contacts(model, &Kinematics::of(model, &configuration), plane);
    let lowest = wheels.iter().map(|wheel| wheel.gap);
    q[1] -= lowest.fold(f64::INFINITY, f64::min) / n.y;
    Ok(q)
}

/// Why a rover cannot be put on a terrain.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PlacementError {
    /// A number that is no coordinate.
    #[error(transparent)]
    State(#[from] StateError),
    /// Nothing is known of the ground there.
    #[error(
        "position: the ground at x = {x} m, z = {z} m is unknown: the place is outside the map or has no data"
    )]
    NoGround {
        /// World, m.
        x: f64,
        /// World, m.
        z: f64,
    },
}

/// Public coordinates (nv) of a rover that stands on a terrain of any shape: the trunk's origin
/// over `position` (x, z, m), no wheel in the ground.
///
/// Height, pitch, roll and the free joints bring the wheels down to the ground together: Gauss and
/// Newton's iteration on the gaps, with the smallest change of all. The rover may still roll off.
///
/// # Errors
/// `NoGround` where the ground under the trunk or a wheel is not known; `State` for a number that
/// is not finite.
///
/// # Panics
/// If the model has fewer than six velocities.
pub fn resting_on(
    model: &Model,
    terrain: &dyn Terrain,
    position: [f64; 2],
    heading: f64,
) -> Result<Vec<f64>, PlacementError> {
    let plane = plane_under(model, terrain, position)?;
    brought_down(
        model,
        terrain,
        upright_on(model, &plane, position, heading)?,
    )
}

/// The coordinates at which all wheels are on the ground, or as close to it as the joints allow.
fn brought_down(
    model: &Model,
    terrain: &dyn Terrain,
    q: Vec<f64>,
) -> Result<Vec<f64>, PlacementError> {
    let mut best = lowered(model, terrain, q)?;
    let moved: Vec<usize> = [1, 3, 5].into_iter().chain(free_joints(model)).collect();
    let mut q = best.clone();
    let spread = |gaps: &DVector<f64>| gaps.norm();
    let mut least = spread(&wheel_gaps(model, terrain, &best)?);
    for _ in 0..ITERATIONS {
        let now = wheel_gaps(model, terrain, &q)?;
        let mut slopes = DMatrix::zeros(now.len(), moved.len());
        for (mut column, &k) in slopes.column_iter_mut().zip(&moved) {
            let mut beside = q.clone();
            beside[k] += DIFFERENCE;
            column.copy_from(&((wheel_gaps(model, terrain, &beside)? - &now) / DIFFERENCE));
        }
        let Some(step) = smallest_step(&slopes, &now) else {
            break;
        };
        let shorten = (LONGEST / step.amax().max(LONGEST)).min(1.0);
        for (&k, change) in moved.iter().zip(step.iter()) {
            q[k] -= shorten * change;
        }
        if !is_within_stops(model, &q) {
            break;
        }
        let lifted = lowered(model, terrain, q.clone())?;
        let own = spread(&wheel_gaps(model, terrain, &lifted)?);
        if own < least {
            (best, least) = (lifted, own);
        }
        if least < TOUCHING {
            break;
        }
    }
    Ok(best)
}

/// The plane through the ground at a position, with the slope between the ends of a cross as wide
/// as the rover stands.
fn plane_under(
    model: &Model,
    terrain: &dyn Terrain,
    [x, z]: [f64; 2],
) -> Result<Plane, PlacementError> {
    let y = terrain
        .height(x, z)
        .ok_or(PlacementError::NoGround { x, z })?;
    let zero = Kinematics::of(
        model,
        &coordinates::from_public(model, &vec![0.0; model.nv()])?,
    );
    let wheels = model
        .wheels()
        .iter()
        .map(|wheel| zero.point(wheel.body, &wheel.centre));
    let half = wheels.map(|x| hypot(x.x, x.z)).fold(0.1, f64::max) * 0.7;
    let slope = |dx: f64, dz: f64| {
        let (ahead, behind) = (
            terrain.height(x + dx, z + dz),
            terrain.height(x - dx, z - dz),
        );
        ahead
            .zip(behind)
            .map_or(0.0, |(a, b)| (a - b) / (2.0 * half))
    };
    let normal = Vector3::new(-slope(half, 0.0), 1.0, -slope(0.0, half)).normalize();
    Ok(Plane::through(&Vector3::new(x, y, z), normal))
}

/// Gaps of all wheels to the ground, m.
fn wheel_gaps(
    model: &Model,
    terrain: &dyn Terrain,
    q: &[f64],
) -> Result<DVector<f64>, PlacementError> {
    let configuration = coordinates::from_public(model, q)?;
    let kinematics = Kinematics::of(model, &configuration);
    for wheel in model.wheels() {
        let centre = configuration.position + kinematics.point(wheel.body, &wheel.centre);
        if let Coverage::Unknown([x, z]) = terrain.coverage(&centre, wheel.bound()) {
            return Err(PlacementError::NoGround { x, z });
        }
    }
    let contacts = wheel_contacts(model, &kinematics, terrain);
    let gaps = contacts.iter().map(|contact| contact.gap);
    Ok(DVector::from_iterator(contacts.len(), gaps))
}

/// The coordinates at the height at which the lowest wheel touches the ground.
fn lowered(
    model: &Model,
    terrain: &dyn Terrain,
    mut q: Vec<f64>,
) -> Result<Vec<f64>, PlacementError> {
    for _ in 0..LIFTS {
        let lowest = wheel_gaps(model, terrain, &q)?.min();
        if lowest.abs() <= TOUCHING || !lowest.is_finite() {
            break;
        }
        q[1] -= lowest;
    }
    Ok(q)
}

/// Most iterations, and most that bring the lowest wheel to the ground.
const ITERATIONS: usize = 20;
const LIFTS: usize = 60;

/// Gap of a wheel that stands, m.
const TOUCHING: f64 = 1e-9;

/// Largest gap of a wheel that counts as standing, m.
const STANDING: f64 = 1e-7;

/// Change of a coordinate for a difference quotient, rad or m.
const DIFFERENCE: f64 = 1e-6;

/// Share of the mean slope below which a direction does not move the wheels.
const RANK: f64 = 1e-3;

/// Longest change of a coordinate in an iteration, rad or m.
const LONGEST: f64 = 0.2;

/// The smallest change with `S x = gaps` but for damping: `Sᵀ (S Sᵀ + ε 1)⁻¹ gaps`.
fn smallest_step(slopes: &DMatrix<f64>, gaps: &DVector<f64>) -> Option<DVector<f64>> {
    let n = gaps.len();
    // Sums written out: nalgebra's product of large matrices has other bits on other processors.
    let sum = |terms: &mut dyn Iterator<Item = f64>| terms.fold(0.0, |sum, term| sum + term);
    let mut square = DMatrix::from_fn(n, n, |i, j| {
        let columns = slopes.column_iter();
        sum(&mut columns.map(|column| column[i] * column[j]))
    });
    let mean = square.trace() / n as f64;
    for k in 0..n {
        square[(k, k)] += RANK * RANK * mean;
    }
    let loads = square.cholesky()?.solve(gaps);
    let step = (slopes.column_iter()).map(|column| {
        sum(&mut column
            .iter()
            .zip(loads.iter())
            .map(|(slope, load)| slope * load))
    });
    Some(DVector::from_iterator(slopes.ncols(), step))
}

/// Public coordinates of joints that neither turn a wheel nor steer it and have no drive.
fn free_joints(model: &Model) -> Vec<usize> {
    let is_wheels = |j: usize| {
        let mut wheels = model.wheels().iter();
        wheels.any(|wheel| wheel.joint == Some(j) || wheel.steering == Some(j))
    };
    let is_free = |j: &usize| model.joints()[*j].drive.is_none() && !is_wheels(*j);
    (0..model.n_joints())
        .filter(is_free)
        .map(|j| FIRST_JOINT + j)
        .collect()
}

/// Public coordinate of the first joint of a machine on a free base.
const FIRST_JOINT: usize = 6;

fn is_within_stops(model: &Model, q: &[f64]) -> bool {
    let joints = model.joints().iter().zip(&q[FIRST_JOINT..]);
    joints.into_iter().all(|(joint, x)| {
        let stops = joint.limits;
        stops.is_none_or(|stops| (stops.lower..=stops.upper).contains(x))
    })
}

/// The angle in [−π, π] that differs by whole turns, without rounding.
fn wrapped(angle: f64) -> f64 {
    let rest = angle % TAU;
    let half = 0.5 * TAU;
    // Halfway the number of turns is even, as IEEE 754 has it.
    let is_beyond = rest.abs() > half || (rest.abs() >= half && (angle % (2.0 * TAU)).abs() > TAU);
    if is_beyond {
        rest - TAU.copysign(rest)
    } else {
        rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::float_cmp)] // exact by IEEE 754
    fn angles_wrap_to_half_a_turn_as_python_remainder_does() {
        use std::f64::consts::PI;
        for (angle, expected) in [
            (0.5, 0.5),
            (PI, PI),
            (-PI, -PI),
            (4.0, 4.0 - TAU),
            (-4.0, TAU - 4.0),
            (7.0, 7.0 - TAU),
            (1e300, -0.723_426_700_527_021_2),
        ] {
            assert_eq!(wrapped(angle), expected, "{angle}");
        }
    }

    #[test]
    fn a_resting_rover_stands_upright_on_its_plane() {
        let model = Model::rover();
        for (slope, uphill, heading) in [(0.0, 0.0, 0.0), (0.3, 1.0, -2.0), (0.1, -3.0, 9.0)] {
            let plane = tilted_plane(slope, uphill).unwrap();
            let q = resting_pose(&model, &plane, [3.0, -2.0], heading).unwrap();
            let configuration = coordinates::from_public(&model, &q).unwrap();
            let kinematics = Kinematics::of(&model, &configuration);
            let gaps = wheel_contacts(&model, &kinematics, &plane);
            let lowest = gaps.iter().map(|c| c.gap).fold(f64::INFINITY, f64::min);
            assert!(lowest.abs() < 1e-12, "{lowest}");
            let up = configuration.attitude.to_rotation_matrix() * Vector3::y();
            assert!((up - plane.normal()).norm() < 1e-12);
        }
    }
}
