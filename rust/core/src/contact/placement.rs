//! Where a rover stands: the pose in which its wheels are on a plane or on ground of any shape.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector, Vector3};
use thiserror::Error;

use super::detection::wheel_contacts;
use crate::geometry::{Coverage, Plane, Terrain};
use crate::multibody::{Kinematics, Model, StateError, coordinates};
use crate::scalar::elementary::{asin, atan2, hypot, sin_cos};

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
            let plane = Plane::tilted(slope, uphill).unwrap();
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
