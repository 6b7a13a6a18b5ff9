//! Direction of a joint's axis.

use nalgebra::{Matrix3, Unit, Vector3};

use crate::scalar::elementary::sin_cos;
use crate::spatial::rotation_about;

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
    #[inline]
    #[must_use]
    pub fn turned(&self, R: &Matrix3<f64>) -> Vector3<f64> {
        match self {
            Self::X => R.column(0).into(),
            Self::Y => R.column(1).into(),
            Self::Z => R.column(2).into(),
            Self::General(u) => R * u.into_inner(),
        }
    }

    /// `R · Rot(axis, angle)` and the axis in the frame that `R` maps to.
    #[inline]
    #[must_use]
    pub fn rotate(&self, R: &Matrix3<f64>, angle: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let columns = |fixed: usize| {
            let (s, c) = sin_cos(angle);
            let (i, j) = ((fixed + 1) % 3, (fixed + 2) % 3);
            let (a, b): (Vector3<f64>, Vector3<f64>) = (R.column(i).into(), R.column(j).into());
            let mut out = *R;
            out.set_column(i, &(a * c + b * s));
            out.set_column(j, &(b * c - a * s));
            out
        };
        let turned = match self {
            Self::X => columns(0),
            Self::Y => columns(1),
            Self::Z => columns(2),
            Self::General(u) => R * rotation_about(u, angle),
        };
        (turned, self.turned(R))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    #[test]
    fn coordinate_axes_agree_with_the_general_one() {
        let R = *Rotation3::from_euler_angles(0.2, -0.5, 1.1).matrix();
        for (axis, e) in [
            (JointAxis::X, Vector3::x()),
            (JointAxis::Y, Vector3::y()),
            (JointAxis::Z, Vector3::z()),
        ] {
            assert_eq!(JointAxis::from_direction(&(e * 2.0)), Some(axis));
            let (special, a) = axis.rotate(&R, 0.7);
            let (general, b) = JointAxis::General(Unit::new_normalize(e)).rotate(&R, 0.7);
            assert!((special - general).norm() < 1e-15 && (a - b).norm() < 1e-15);
        }
        assert_eq!(JointAxis::from_direction(&Vector3::zeros()), None);
    }
}
