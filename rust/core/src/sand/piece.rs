//! A piece of a wheel in a soil, and the stress on it.

use nalgebra::{Matrix3, Vector3};

use super::wheel::Skin;

/// A piece of a wheel in the sand.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// Outward unit normal.
    pub normal: &'a Vector3<f64>,
    /// Displacement relative to the sand, in units of its memory.
    pub x: &'a Vector3<f64>,
    /// Into the sand, against the normal of its surface.
    pub down: &'a Vector3<f64>,
    /// Under the surface, m.
    pub depth: f64,
    /// Along the rim from where it enters the sand, m.
    pub arc: f64,
    /// What it is part of.
    pub skin: Skin,
    /// Part of the rim at which grousers hold sand.
    pub held: f64,
    /// Width of the wheel, m.
    pub width: f64,
    /// m/s², along `down`.
    pub gravity: f64,
}

/// Stress of the sand on a piece, N/m², and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stress {
    /// N/m².
    pub value: Vector3<f64>,
    /// By the displacement.
    pub by_x: Matrix3<f64>,
    /// By the depth, N/m³.
    pub by_depth: Vector3<f64>,
}

impl Stress {
    /// None.
    pub const NONE: Self = Self {
        value: Vector3::new(0.0, 0.0, 0.0),
        by_x: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        by_depth: Vector3::new(0.0, 0.0, 0.0),
    };
}
