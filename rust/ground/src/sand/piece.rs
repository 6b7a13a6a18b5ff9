//! Pieces of a wheel in a soil, side by side in lanes, and the stress on each.

use friction_contact::scalar::{Lane, Vec3};

use super::sliding::Slid;
use super::wheel::Skin;

/// A piece of a wheel in the sand. All vectors have the same axes.
#[derive(Clone, Copy, Debug)]
pub struct Piece<T: Lane> {
    /// Outward unit normal.
    pub normal: Vec3<T>,
    /// Displacement relative to the sand, in units of its memory.
    pub x: Vec3<T>,
    /// Into the sand, against the normal of its surface.
    pub down: Vec3<T>,
    /// Under the surface, m.
    pub depth: T,
    /// Way of the piece over the sand since it entered. Only Bekker's law needs it.
    pub slid: Slid<T>,
    /// Surface of the wheel that the piece belongs to.
    pub skin: Skin,
}

/// What all pieces of a wheel share.
#[derive(Clone, Copy, Debug)]
pub struct WheelConditions {
    /// Part of the rim at which grousers hold sand.
    pub held: f64,
    /// Width of the wheel, m.
    pub width: f64,
    /// m/s², into the sand.
    pub gravity: f64,
    /// Slip of a driven wheel, from 0 to 1.
    pub slip: f64,
}

/// Stress of the sand on a piece, N/m², and its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Stress<T> {
    /// N/m².
    pub value: Vec3<T>,
    /// By each component of the displacement; what it was before if it was not wanted.
    pub by_x: [Vec3<T>; 3],
    /// By the depth, N/m³.
    pub by_depth: Vec3<T>,
    /// By the way of the piece along the rim and across it, N/m³.
    pub by_way: [Vec3<T>; 2],
}

impl<T: Lane> Stress<T> {
    /// None.
    #[inline(always)]
    #[must_use]
    pub fn none(token: T::Token) -> Self {
        let zero = Vec3::splat(token, [0.0; 3]);
        Self {
            value: zero,
            by_x: [zero; 3],
            by_depth: zero,
            by_way: [zero; 2],
        }
    }
}
