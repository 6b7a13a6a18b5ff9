//! The stone over a sphere of the ground: its shade, and its bumps as normals.
//!
//! Frames draw a stone with dents over each sphere, of one of a few kinds, turned at random by its
//! place. A picture shows the sphere, lit as that stone: the surface `r (1 + a b(u)) u` over the
//! unit sphere of directions u has the normal `(h u − a (∇b − (∇b · u) u))`, h = 1 + a b(u).

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use friction_contact::scalar::elementary::sin_cos;

/// Kinds of stones.
const KINDS: f64 = 3.0;

/// Mean radius over the sphere's, and height of the bumps over it.
const MEAN: f64 = 0.98;
const HEIGHT: f64 = 0.1;

/// A stone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stone {
    /// Brightness of its colour.
    pub shade: f64,
    seed: f64,
    turn: UnitQuaternion<f64>,
}

/// A number from 0 to 1 that looks random.
fn scatter(key: f64) -> f64 {
    let scattered = sin_cos(12.9898 * key + 78.233).0 * 43_758.545_3;
    scattered - scattered.floor()
}

impl Stone {
    /// Over a sphere with this centre, m.
    #[must_use]
    pub fn over(centre: &Vector3<f64>) -> Self {
        #[allow(clippy::cast_possible_truncation)] // as frames take the place
        let [x, y, z] = [centre.x, centre.y, centre.z].map(|x| f64::from(x as f32));
        let key = 1.7 * x + 0.3 * y + 2.9 * z;
        let [w, i, j, k] = [0.7, 0.1, 0.3, 0.5].map(|part| scatter(key + part) - 0.5);
        Self {
            shade: 0.82 + 0.3 * scatter(key + 0.9),
            seed: (KINDS * scatter(key)).floor() + 1.0,
            turn: UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)),
        }
    }

    /// Unit normal of the stone in a unit direction from its centre.
    #[must_use]
    pub fn normal(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let u = self.turn.inverse_transform_vector(direction);
        let (bump, slope) = self.bump(&u);
        let across = slope - u * slope.dot(&u);
        let normal = u * (MEAN + HEIGHT * bump) - across * HEIGHT;
        self.turn.transform_vector(&normal.normalize())
    }

    /// Height of the bumps at a place of the unit sphere, from -1 to 1, and its gradient.
    fn bump(&self, u: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let ([x, y, z], s) = ([u.x, u.y, u.z], self.seed);
        let (sin_a, cos_a) = sin_cos(2.3 * x + 1.7 * y + s);
        let (sin_b, cos_b) = sin_cos(1.9 * y - 2.1 * z + 2.0 * s);
        let (sin_c, cos_c) = sin_cos(4.1 * z + 3.3 * x + 3.0 * s);
        let (sin_d, cos_d) = sin_cos(6.7 * y - 5.2 * x + 5.0 * s);
        let slope = Vector3::new(
            0.5 * 2.3 * cos_a * cos_b + 0.3 * 3.3 * cos_c - 0.2 * 5.2 * cos_d,
            0.5 * (1.7 * cos_a * cos_b - 1.9 * sin_a * sin_b) + 0.2 * 6.7 * cos_d,
            0.5 * 2.1 * sin_a * sin_b + 0.3 * 4.1 * cos_c,
        );
        (0.5 * sin_a * cos_b + 0.3 * sin_c + 0.2 * sin_d, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_is_across_the_surface_with_its_bumps() {
        for place in [[0.3, 0.1, -2.0], [5.0, 0.0, 1.0], [-4.0, 0.2, 7.5]] {
            let stone = Stone::over(&Vector3::from(place));
            assert!((0.82..=1.12).contains(&stone.shade));
            for direction in [[1.0, 0.2, 0.1], [-0.3, 1.0, 0.4], [0.1, -0.2, -1.0]] {
                let u = Vector3::from(direction).normalize();
                let at = |u: Vector3<f64>| {
                    let u = u.normalize();
                    let bump = stone.bump(&stone.turn.inverse_transform_vector(&u)).0;
                    u * (MEAN + HEIGHT * bump)
                };
                let side = u.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
                let normal = stone.normal(&u);
                for along in [side, u.cross(&side)] {
                    let tangent = (at(u + along * 1e-5) - at(u - along * 1e-5)).normalize();
                    assert!(tangent.dot(&normal).abs() < 1e-6);
                }
                assert!(normal.dot(&u) > 0.5);
            }
        }
    }
}
