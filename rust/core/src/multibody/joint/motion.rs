//! The screw of a joint velocity.

use std::ops::{Add, Mul};

use nalgebra::Vector3;

/// Motion that a unit of one joint velocity imparts to everything the joint carries: a rotation
/// about an axis, a translation, or both.
///
/// World axes; positions are relative to the reference origin of the tree
/// ([`Kinematics::origin`](crate::multibody::Kinematics::origin)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    kind: Kind,
    /// Angular velocity; for a translation, the linear velocity.
    axis: Vector3<f64>,
    /// For a rotation, a point on its axis; for a screw, the velocity of the material point at the
    /// reference origin.
    place: Vector3<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Turn,
    Slide,
    Screw,
}

impl Default for Motion {
    fn default() -> Self {
        Self::slide(Vector3::zeros())
    }
}

impl Motion {
    /// Rotation about an axis (a unit vector unless the joint follows another) through a point (m).
    #[inline]
    #[must_use]
    pub fn turn(axis: Vector3<f64>, place: Vector3<f64>) -> Self {
        Self {
            kind: Kind::Turn,
            axis,
            place,
        }
    }

    /// Translation along an axis (a unit vector unless the joint follows another).
    #[inline]
    #[must_use]
    pub fn slide(axis: Vector3<f64>) -> Self {
        Self {
            kind: Kind::Slide,
            axis,
            place: Vector3::zeros(),
        }
    }

    /// Axis of a rotation or translation.
    #[inline]
    #[must_use]
    pub fn axis(&self) -> &Vector3<f64> {
        &self.axis
    }

    /// Angular velocity, and linear velocity of the material point at the reference origin, per
    /// unit of the joint velocity.
    #[inline]
    #[must_use]
    pub fn twist(&self) -> (Vector3<f64>, Vector3<f64>) {
        match self.kind {
            Kind::Turn => (self.axis, self.place.cross(&self.axis)),
            Kind::Slide => (Vector3::zeros(), self.axis),
            Kind::Screw => (self.axis, self.place),
        }
    }

    /// Velocity of the material point at `x` per unit of the joint velocity.
    #[inline]
    #[must_use]
    pub fn velocity_at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        match self.kind {
            Kind::Turn => self.axis.cross(&(x - self.place)),
            Kind::Slide => self.axis,
            Kind::Screw => self.place + self.axis.cross(x),
        }
    }

    /// Generalized force on the joint velocity due to a force (N) and its moment about the
    /// reference origin (N m).
    #[inline]
    #[must_use]
    pub fn power(&self, force: &Vector3<f64>, moment: &Vector3<f64>) -> f64 {
        match self.kind {
            // a · ((x − r) × f) = a · (x × f − r × f)
            Kind::Turn => self.axis.dot(&(moment - self.place.cross(force))),
            Kind::Slide => self.axis.dot(force),
            Kind::Screw => self.axis.dot(moment) + self.place.dot(force),
        }
    }
}

impl Mul<f64> for Motion {
    type Output = Self;

    fn mul(mut self, factor: f64) -> Self {
        self.axis *= factor;
        if self.kind == Kind::Screw {
            self.place *= factor;
        }
        self
    }
}

impl Add for Motion {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let ((a, v), (b, w)) = (self.twist(), other.twist());
        Self {
            kind: Kind::Screw,
            axis: a + b,
            place: v + w,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_is_the_force_times_the_velocity_of_its_point() {
        let (axis, place) = (Vector3::new(0.3, -0.8, 0.5), Vector3::new(1.0, 2.0, -0.5));
        let turn = Motion::turn(axis, place);
        let slide = Motion::slide(place);
        let (x, force) = (Vector3::new(-0.7, 0.2, 1.1), Vector3::new(3.0, -1.0, 2.0));
        let moment = x.cross(&force);
        for motion in [turn, slide, turn + slide * 2.0, (turn + slide) * -0.5] {
            let velocity = motion.velocity_at(&x);
            assert!((motion.power(&force, &moment) - velocity.dot(&force)).abs() < 1e-14);
            let (angular, linear) = motion.twist();
            let rigid = linear + angular.cross(&x);
            assert!((velocity - rigid).norm() < 1e-15);
        }
    }
}
