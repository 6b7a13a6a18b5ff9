//! Description of a track.

use serde::{Deserialize, Serialize};

use super::Hold;
use crate::multibody::motor::Motor;

/// A track: a belt that is driven around a row of equal wheels on a solid.
///
/// Its wheels stand at equal distances on a line, and all turn as the first one, so that where they
/// touch, their rims have the velocity of the belt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackDescription {
    /// Name of the track, of its first wheel and of the joint that drives it. The further wheels
    /// have this name and their number, such as `left_2`.
    pub name: String,
    /// The solid that carries it.
    pub solid: String,
    /// Centre of the first wheel in the frame of that solid, m.
    pub from: [f64; 3],
    /// Centre of the last wheel, m.
    pub to: [f64; 3],
    /// Number of wheels, from 2 to `MOST_TRACK_WHEELS`.
    pub wheels: usize,
    /// Radius of the wheels with the belt, m.
    pub radius: f64,
    /// Direction of the axles in the frame of the solid; z by default.
    #[serde(default = "to_the_right")]
    pub axle: [f64; 3],
    /// Mass of belt and wheels, kg, which moves with the belt.
    pub mass: f64,
    /// Width of the belt, m, as a wheel's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<f64>,
    /// Rounding of its edges, m, as a wheel's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rounding: Option<f64>,
    /// Normal stiffness of an inner wheel, N/m; the first and the last one have half of it. By
    /// default they yield by 3e-4 of their radius under their share of the weight; 0: rigid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Normal damping beside the stiffness, N s/m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<f64>,
    /// Name of its material; `wheel` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Gains that brake it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold: Option<Hold>,
    /// Largest driving torque of the track, N m; each wheel has an equal share.
    pub torque_limit: f64,
    /// 1 or −1: joint torque of a positive (forward) command.
    pub drive_sign: f64,
    /// Torque–speed line of its motor, which drives all of its wheels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<Motor>,
    /// Gain of its speed servo, N m s/rad, as a wheel's; each wheel has an equal share.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_gain: Option<f64>,
}

/// Most wheels of a track.
pub const MOST_TRACK_WHEELS: usize = 100;

fn to_the_right() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
