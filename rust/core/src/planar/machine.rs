//! The interface of planar machines with few coordinates, and the discs that touch the ground.
//!
//! [`crate::system::planar`] turns a machine on a ground into a mechanical system. Frames follow
//! the rover's: n points out of the ground, and t = n × e_z points forward on level ground. Angles
//! are positive to the left, so the angle of a disc that rolls forward decreases.

use nalgebra::{SMatrix, SVector, Vector2};

use crate::multibody::Motor;

/// A disc of a machine in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// m.
    pub centre: Vector2<f64>,
    /// m.
    pub radius: f64,
}

/// The motors of one torque: equal, and with a common angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarMotor {
    /// Torque–speed line of each.
    pub motor: Motor,
    /// The coordinate that they drive, relative to their carrier.
    pub coordinate: usize,
    /// Torque about that coordinate of a unit forward: their number and their sign.
    pub gain: f64,
}

/// A machine with `NV` coordinates whose velocities are their rates.
///
/// The first two coordinates are a place in the world, m; the others
/// angles, rad, positive to the left.
pub trait PlanarMachine<const NV: usize>: std::fmt::Debug + Send + Sync {
    /// `M(q)`, kg, kg m, kg m².
    fn mass_matrix(&self, q: &SVector<f64, NV>) -> SMatrix<f64, NV, NV>;

    /// `F(q, v)`, N and N m: gravity (m/s²), torques (`torques`, N m, positive forward) and terms
    /// quadratic in v, so that `M v̇ = F` without contacts.
    fn force(
        &self,
        q: &SVector<f64, NV>,
        v: &SVector<f64, NV>,
        gravity: &Vector2<f64>,
        torques: &[f64],
    ) -> SVector<f64, NV>;

    /// Potential energy `−Σ m g · x`, J.
    fn potential(&self, q: &SVector<f64, NV>, gravity: &Vector2<f64>) -> f64;

    /// Number of torques that can be set.
    fn n_inputs(&self) -> usize;

    /// Largest torque i, either way, N m. By default there is no limit.
    fn torque_limit(&self, _i: usize) -> f64 {
        f64::INFINITY
    }

    /// Motors of torque i; by default none, and the torque is the command at any speed.
    fn motor(&self, _i: usize) -> Option<PlanarMotor> {
        None
    }

    /// Largest angular speed of a frame whose pose matters, rad/s.
    fn turning(&self, v: &SVector<f64, NV>) -> f64;

    /// Number of discs.
    fn n_discs(&self) -> usize;

    /// Disc i.
    fn disc(&self, i: usize, q: &SVector<f64, NV>) -> Disc;

    /// Velocity of the material point of disc i at `point` (world, m) per
    /// unit of each coordinate's rate.
    fn point_jacobian(
        &self,
        i: usize,
        q: &SVector<f64, NV>,
        point: &Vector2<f64>,
    ) -> SMatrix<f64, 2, NV>;

    /// Lengths that convert the change of a coordinate into a displacement, m: 1 for places, an arm
    /// for angles.
    fn arms(&self) -> SVector<f64, NV>;

    /// A number that is equal for two machines only if they are of the same kind, with the same
    /// masses, inertias and lengths.
    fn fingerprint(&self) -> u64;
}

/// Fingerprint of a kind of machine with the numbers that describe it.
pub(super) fn fingerprint(kind: &str, numbers: impl IntoIterator<Item = f64>) -> u64 {
    let numbers = numbers.into_iter().flat_map(|x| x.to_bits().to_le_bytes());
    crate::multibody::fingerprint(kind.bytes().chain(numbers))
}
