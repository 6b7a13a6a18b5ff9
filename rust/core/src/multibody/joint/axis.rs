//! Direction of a joint's axis.

use nalgebra::{Unit, Vector3};

use crate::scalar::{Lane, Mat3, Vec3};

/// Direction of a revolute or prismatic joint. The coordinate axes are separate variants because a
/// rotation about one of them changes only two columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointAxis {
    /// About x.
    X,
    /// About y.
    Y,
    /// About z.
    Z,
    /// About an arbitrary unit vector.
    General(Unit<Vector3<f64>>),
}

impl JointAxis {
    /// The axis along a direction of any length; `None` if the direction is degenerate.
    #[must_use]
    pub fn from_direction(direction: &Vector3<f64>) -> Option<Self> {
        let unit = Unit::try_new(*direction, 1e-9)?;
        let is = |e: Vector3<f64>| (unit.into_inner() - e).norm() == 0.0;
        Some(if is(Vector3::x()) {
            Self::X
        } else if is(Vector3::y()) {
            Self::Y
        } else if is(Vector3::z()) {
            Self::Z
        } else {
            Self::General(unit)
        })
    }

    /// Unit vector of the axis, in the joint's frame.
    #[must_use]
    pub fn direction(&self) -> Vector3<f64> {
        match self {
            Self::X => Vector3::x(),
            Self::Y => Vector3::y(),
            Self::Z => Vector3::z(),
            Self::General(u) => u.into_inner(),
        }
    }

    /// The axis in the frame that `R` maps to.
    #[inline(always)]
    #[must_use]
    pub fn turned<T: Lane>(&self, R: &Mat3<T>) -> Vec3<T> {
        match self {
            Self::X => R.x,
            Self::Y => R.y,
            Self::Z => R.z,
            Self::General(u) => R.times_shared(u.into_inner().into()),
        }
    }

    /// `R · Rot(axis, angle)` for the sine and cosine of the angle; `turned` is the axis in the
    /// frame that `R` maps to.
    #[inline(always)]
    #[must_use]
    pub fn rotate<T: Lane>(&self, R: &Mat3<T>, turned: Vec3<T>, sin_cos: (T, T)) -> Mat3<T> {
        let (s, c) = sin_cos;
        let Mat3 { x, y, z } = *R;
        match self {
            Self::X => {
                let (y, z) = (y * c + z * s, z * c - y * s);
                Mat3 { x, y, z }
            }
            Self::Y => {
                let (z, x) = (z * c + x * s, x * c - z * s);
                Mat3 { x, y, z }
            }
            Self::Z => {
                let (x, y) = (x * c + y * s, y * c - x * s);
                Mat3 { x, y, z }
            }
            Self::General(u) => {
                // Rodrigues: e ↦ c e + s (u × e) + (1 − c) (u · e) u, with R (u × e) = R u × R e.
                let rest = c.like(1.0) - c;
                let column = |e: Vec3<T>, along: f64| {
                    e * c + turned.cross(e) * s + turned * (rest * c.like(along))
                };
                Mat3 {
                    x: column(x, u[0]),
                    y: column(y, u[1]),
                    z: column(z, u[2]),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::elementary::sin_cos;
    use nalgebra::{Matrix3, Rotation3};

    #[test]
    fn coordinate_axes_agree_with_the_general_one() {
        let R = Rotation3::from_euler_angles(0.2, -0.5, 1.1);
        let frame = Mat3::from(*R.matrix());
        let rotate = |axis: &JointAxis| {
            let turned = axis.turned(&frame);
            let own = axis.rotate(&frame, turned, sin_cos(0.7));
            (Matrix3::from(own), Vector3::from(turned))
        };
        for (axis, e) in [
            (JointAxis::X, Vector3::x()),
            (JointAxis::Y, Vector3::y()),
            (JointAxis::Z, Vector3::z()),
        ] {
            assert_eq!(JointAxis::from_direction(&(e * 2.0)), Some(axis));
            let unit = Unit::new_normalize(e);
            let (special, a) = rotate(&axis);
            let (general, b) = rotate(&JointAxis::General(unit));
            assert!((special - general).norm() < 1e-15 && (a - b).norm() < 1e-15);
            let expected = R * Rotation3::from_axis_angle(&unit, 0.7);
            assert!((special - expected.matrix()).norm() < 1e-15);
        }
        assert_eq!(JointAxis::from_direction(&Vector3::zeros()), None);
    }
}
