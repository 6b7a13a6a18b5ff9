//! Description of the shapes of a solid.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::spatial::{Polytope, exp_rotation};

/// A shape centred at its own origin; a hull is where its points are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Solid capsule about y: a cylinder between two half balls.
    Capsule {
        /// Radius, m.
        radius: f64,
        /// Height of the cylinder along y, m: the distance of the balls' centres.
        height: f64,
    },
    /// Solid ellipsoid.
    Ellipsoid {
        /// Semi-axes along x, y, z, m.
        radii: [f64; 3],
    },
    /// Solid convex hull of points.
    Hull {
        /// From 4 to 64 points that are not in one plane, m.
        points: Vec<[f64; 3]>,
    },
}

impl Shape {
    /// The polytope of a hull; `None` for other shapes, and for points that have none.
    #[must_use]
    pub fn polytope(&self) -> Option<Polytope> {
        let Self::Hull { points } = self else {
            return None;
        };
        let points: Vec<Vector3<f64>> = points.iter().map(|&x| x.into()).collect();
        Polytope::hull_of(&points)
    }

    /// Mass centre in the shape's own axes (m), and inertia about it for a mass `m` (kg m²); Fig.
    /// 4.5 of the report.
    #[must_use]
    pub fn mass_properties(&self, m: f64) -> (Vector3<f64>, Matrix3<f64>) {
        let about_origin =
            |moments: [f64; 3]| (Vector3::zeros(), Matrix3::from_diagonal(&moments.into()));
        match *self {
            Self::Box { size: [a, b, c] } => about_origin([
                m / 12.0 * (b * b + c * c),
                m / 12.0 * (a * a + c * c),
                m / 12.0 * (a * a + b * b),
            ]),
            Self::Cylinder {
                radius: r,
                height: h,
            } => {
                let across = m / 12.0 * (3.0 * r * r + h * h);
                about_origin([across, m * r * r / 2.0, across])
            }
            Self::Disc { radius: r } => {
                about_origin([m * r * r / 4.0, m * r * r / 4.0, m * r * r / 2.0])
            }
            Self::Sphere { radius: r } => about_origin([0.4 * m * r * r; 3]),
            Self::Capsule {
                radius: r,
                height: h,
            } => {
                // Of the balls and of the cylinder, by volume.
                let balls = m * 4.0 * r / (4.0 * r + 3.0 * h);
                let cylinder = m - balls;
                let of_balls = balls * (0.4 * r * r + h * h / 4.0 + 0.375 * h * r);
                let across = of_balls + cylinder / 12.0 * (3.0 * r * r + h * h);
                let along = 0.4 * balls * r * r + 0.5 * cylinder * r * r;
                about_origin([across, along, across])
            }
            Self::Ellipsoid { radii: [a, b, c] } => about_origin([
                m / 5.0 * (b * b + c * c),
                m / 5.0 * (a * a + c * c),
                m / 5.0 * (a * a + b * b),
            ]),
            Self::Hull { .. } => match self.polytope() {
                Some(polytope) => (polytope.centroid(), polytope.inertia(m)),
                None => about_origin([0.0; 3]),
            },
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
            Self::Capsule { radius, height } => {
                Some(PI * radius * radius * (height + 4.0 / 3.0 * radius))
            }
            Self::Ellipsoid { radii: [a, b, c] } => Some(4.0 / 3.0 * PI * a * b * c),
            Self::Hull { .. } => self.polytope().map(|polytope| polytope.volume()),
        }
    }
}

/// Shape in the list `shapes` of a solid, with its pose.
///
/// Where shapes overlap, the overlap counts twice: in the mass, in the inertia and in the contacts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeDescription {
    /// Type and dimensions of the shape.
    #[serde(flatten)]
    pub shape: Shape,
    /// Centre in the solid's frame, m; the origin by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// Rotation from the shape's axes to the solid's frame as a rotation vector (axis times angle),
    /// rad; the identity by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f64; 3]>,
    /// Whether the shape collides with the ground and with other bodies; a disc cannot.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub collides: bool,
    /// Name of its material; `body` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Colour of the shape: red, green, blue, 0 to 1; by default that of its kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<[f64; 3]>,
    /// Whether the shape is drawn; true by default.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub visible: bool,
    /// Mass of the shape, part of the solid's mass, kg. By default the mass that remains after the
    /// specified ones is divided by volume.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
}

/// A mesh that is drawn, fixed to a solid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawingDescription {
    /// Vertices in the solid's frame, m.
    pub vertices: Vec<[f64; 3]>,
    /// Triangles: indices of vertices, counter-clockwise seen from outside.
    pub faces: Vec<[usize; 3]>,
    /// Red, green, blue, 0 to 1; by default that of the solid's shapes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<[f64; 3]>,
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

    /// Whether the shape is a disc about an axle through the origin, like a wheel fixed to the
    /// solid.
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
        let odd = read(r#"{"kind": "hull", "vertices": []}"#).unwrap_err();
        assert!(odd.to_string().contains("`vertices`"), "{odd}");
        let odd = read(r#"{"kind": "cylinder", "radius": 1}"#).unwrap_err();
        assert!(odd.to_string().contains("`height`"), "{odd}");
    }

    /// Points on a grid that are in a shape, as the mean of their second moments.
    #[test]
    fn mass_centre_inertia_and_volume_are_those_of_a_sum_over_small_cells() {
        type Test<'a> = &'a dyn Fn(Vector3<f64>) -> bool;
        let is_in_capsule = |x: Vector3<f64>| {
            let y = x.y.clamp(-0.3, 0.3);
            (x - Vector3::y() * y).norm() <= 0.2
        };
        let radii = Vector3::new(0.5, 0.3, 0.2);
        let wedge = [
            [0.0, 0.0, 0.0],
            [0.5, 0.0, 0.0],
            [0.0, 0.4, 0.0],
            [0.0, 0.0, -0.3],
        ];
        let is_in_wedge = |x: Vector3<f64>| {
            let share = Vector3::new(x.x / 0.5, x.y / 0.4, x.z / -0.3);
            share.min() >= 0.0 && share.sum() <= 1.0
        };
        let is_in_ellipsoid = |x: Vector3<f64>| x.component_div(&radii).norm() <= 1.0;
        let capsule = Shape::Capsule {
            radius: 0.2,
            height: 0.6,
        };
        let ellipsoid = Shape::Ellipsoid {
            radii: radii.into(),
        };
        let hull = Shape::Hull {
            points: wedge.to_vec(),
        };
        let cases: [(Shape, Test<'_>); 3] = [
            (capsule, &is_in_capsule),
            (ellipsoid, &is_in_ellipsoid),
            (hull, &is_in_wedge),
        ];
        let cell = 0.01;
        let places: Vec<f64> = (0..110)
            .map(|k| -0.55 + cell * (f64::from(k) + 0.5))
            .collect();
        for (shape, is_in) in cases {
            let (mut volume, mut moment, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
            for &x in &places {
                for &y in &places {
                    for &z in &places {
                        let x = Vector3::new(x, y, z);
                        if is_in(x) {
                            volume += cell * cell * cell;
                            moment += x * (cell * cell * cell);
                            second += x * x.transpose() * (cell * cell * cell);
                        }
                    }
                }
            }
            let centre = moment / volume;
            let C = second / volume - centre * centre.transpose();
            let inertia = Matrix3::identity() * C.trace() - C;
            let (own, about) = shape.mass_properties(1.0);
            assert!(
                (shape.volume().unwrap() / volume - 1.0).abs() < 0.02,
                "{shape:?}"
            );
            assert!((own - centre).norm() < 2e-3, "{shape:?} {own} {centre}");
            assert!(
                (about - inertia).norm() < 0.02 * inertia.norm(),
                "{about} {inertia}"
            );
        }
    }
}
