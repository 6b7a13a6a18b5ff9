//! Poses and velocities of a machine's bodies, however they are kept.

use nalgebra::{Matrix3, Vector3};

use crate::multibody::mechanism::Mechanism;
use crate::multibody::{Motion, Poses};
use crate::scalar::{Lane, Vec3};

/// A machine at one instant, as its contacts need it.
pub(crate) trait BodyMotion {
    /// The machine.
    fn mechanism(&self) -> &Mechanism;

    /// Origin of a body's tree, world, m.
    fn origin(&self, body: usize) -> Vector3<f64>;

    /// Attitude of a body, and its origin relative to that of its tree, m.
    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>);

    /// A joint velocity's motion, by its index.
    fn motion(&self, motion: usize) -> Motion<f64>;

    /// A velocity, m/s or rad/s.
    fn velocity(&self, k: usize) -> f64;

    /// Velocity (m/s) of a body's material point at `x`, relative to the origin of its tree.
    #[inline]
    fn point_velocity(&self, body: usize, x: &Vector3<f64>) -> Vector3<f64> {
        let v = |k| self.velocity(k);
        let velocity = (self.mechanism()).point_velocity(body, (*x).into(), |m| self.motion(m), v);
        velocity.into()
    }
}

/// A machine in a lane, by the poses and the velocity (nv) of all lanes.
#[derive(Clone, Copy)]
pub(crate) struct Still<'a, T: Lane = f64> {
    pub mechanism: &'a Mechanism,
    pub poses: &'a Poses<T>,
    pub v: &'a [T],
    pub lane: usize,
}

impl<'a> Still<'a> {
    /// The machine of the only lane.
    pub(crate) fn new(mechanism: &'a Mechanism, poses: &'a Poses<f64>, v: &'a [f64]) -> Self {
        Self {
            mechanism,
            poses,
            v,
            lane: 0,
        }
    }
}

impl<T: Lane> BodyMotion for Still<'_, T> {
    #[inline]
    fn mechanism(&self) -> &Mechanism {
        self.mechanism
    }

    #[inline]
    fn origin(&self, body: usize) -> Vector3<f64> {
        let tree = self.mechanism.tree_of_body(body);
        self.poses.origin_of(tree).get(self.lane).into()
    }

    #[inline]
    fn pose(&self, body: usize) -> (Matrix3<f64>, Vector3<f64>) {
        let own = &self.poses.bodies[body];
        let columns = own.R.columns().map(|x| Vector3::from(x.get(self.lane)));
        (Matrix3::from_columns(&columns), own.r.get(self.lane).into())
    }

    #[inline]
    fn motion(&self, motion: usize) -> Motion<f64> {
        let own = &self.poses.motions[motion];
        let vector = |x: Vec3<T>| Vec3::from(Vector3::from(x.get(self.lane)));
        Motion {
            axis: vector(own.axis),
            swing: vector(own.swing),
        }
    }

    #[inline]
    fn velocity(&self, k: usize) -> f64 {
        self.v[k].get(self.lane)
    }
}
