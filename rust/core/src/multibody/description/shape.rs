//! Description of the shapes of a solid.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::spatial::exp_rotation;

/// A shape centred at its own origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// Box of edge lengths `size` along x, y, z (m).
    Box {
        /// Edge lengths, m.
        size: [f64; 3],
    },
    /// Solid cylinder about y.
    Cylinder {
        /// Radius, m.
        radius: f64,
        /// Height along y, m.
        height: f64,
    },
    /// Thin disc about z.
    Disc {
        /// Radius, m.
        radius: f64,
    },
    /// Solid ball.
    Sphere {
        /// Radius, m.
        radius: f64,
    },
}

impl Shape {
    /// Principal moments of inertia about the centre for a mass `m` (kg m²), Fig. 4.5 of the
    /// report.
    #[must_use]
    pub fn inertia(&self, m: f64) -> [f64; 3] {
        match *self {
            Self::Box { size: [a, b, c] } => [
                m / 12.0 * (b * b + c * c),
                m / 12.0 * (a * a + c * c),
                m / 12.0 * (a * a + b * b),
            ],
            Self::Cylinder {
                radius: r,
                height: h,
            } => {
                let across = m / 12.0 * (3.0 * r * r + h * h);
                [across, m * r * r / 2.0, across]
            }
            Self::Disc { radius: r } => [m * r * r / 4.0, m * r * r / 4.0, m * r * r / 2.0],
            Self::Sphere { radius: r } => [0.4 * m * r * r; 3],
        }
    }

    /// Volume, m³; `None` for a disc, which is thin.
    #[must_use]
    pub fn volume(&self) -> Option<f64> {
        match *self {
            Self::Box { size: [a, b, c] } => Some(a * b * c),
            Self::Cylinder { radius, height } => Some(PI * radius * radius * height),
            Self::Disc { .. } => None,
            Self::Sphere { radius } => Some(4.0 / 3.0 * PI * radius.powi(3)),
        }
    }
}

/// One of several shapes of a solid.
///
/// Where shapes overlap, the overlap counts twice: in the mass, in the inertia and in the contacts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeDescription {
    /// Its type and dimensions.
    #[serde(flatten)]
    pub shape: Shape,
    /// Centre in the solid's frame, m; the origin by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// Rotation from the shape's axes to the solid's frame as a rotation vector (axis times angle),
    /// rad; the identity by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f64; 3]>,
    /// Whether it collides with the ground and with other bodies; only boxes and spheres can.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub collides: bool,
    /// Name of its material; `body` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Whether it is drawn.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub visible: bool,
    /// Its share of the solid's mass, kg. By default the mass that remains after the specified ones
    /// is divided by volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
}

fn yes() -> bool {
    true
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde passes a reference
fn is_yes(flag: &bool) -> bool {
    *flag
}

impl ShapeDescription {
    /// Centre in the solid's frame, m.
    #[must_use]
    pub fn centre(&self) -> Vector3<f64> {
        self.position.unwrap_or_default().into()
    }

    /// Rotation from its axes to the solid's frame; `None` for the identity.
    #[must_use]
    pub fn turn(&self) -> Option<Matrix3<f64>> {
        (self.rotation).map(|turn| *exp_rotation(&turn.into()).to_rotation_matrix().matrix())
    }

    /// Whether it is a disc about an axle through the origin, like a wheel fixed to the solid.
    #[must_use]
    pub fn is_disc_about(&self, axle: &[f64; 3]) -> bool {
        let Shape::Disc { radius } = self.shape else {
            return false;
        };
        let normal = self
            .turn()
            .map_or_else(Vector3::z, |turn| turn * Vector3::z());
        let across = normal.cross(&Vector3::from(*axle).normalize()).norm();
        across < 1e-9 && self.centre().norm() < 1e-9 * radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_and_missing_fields_of_a_shape_are_refused_by_name() {
        let read = |text: &str| serde_json::from_str::<ShapeDescription>(text);
        let odd = read(r#"{"kind": "box", "size": [1, 1, 1], "radius": 1}"#).unwrap_err();
        assert!(odd.to_string().contains("`radius`"), "{odd}");
        let odd = read(r#"{"kind": "sphere", "radius": 1, "visble": true}"#).unwrap_err();
        assert!(odd.to_string().contains("`visble`"), "{odd}");
        let odd = read(r#"{"kind": "cylinder", "radius": 1}"#).unwrap_err();
        assert!(odd.to_string().contains("`height`"), "{odd}");
    }
}
