//! The start of an episode: slope of the ground, pose of the rover and goal.
//!
//! A direction on the map, like the heading, is an angle about +y from +x, positive to the left
//! (towards −z): the direction `a` points along `(cos a, −sin a)` in (x, z).

use std::f64::consts::TAU;

use super::pcg64::Pcg64;
use crate::contact::detection::wheel_contacts;
use crate::geometry::{Plane, Terrain, TerrainError};
use crate::multibody::{Kinematics, Model, StateError, coordinates};
use crate::scalar::elementary::{asin, atan2, sin_cos};
use nalgebra::Vector3;

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
}

/// A start.
#[derive(Clone, Copy, Debug, PartialEq)]
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
        Start {
            slope: fixed.slope.unwrap_or(slope),
            uphill: fixed.uphill.unwrap_or(uphill),
            position,
            heading,
            goal: fixed.goal.unwrap_or(goal),
        }
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
/// along the normal with its origin over `position` (x, z, m), the lowest wheel at gap zero.
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
