//! Forward kinematics: attitude, origin, joint axis and mass centre of every body.
//!
//! World axes, positions relative to the trunk origin.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use super::state::Configuration;

/// Poses of all bodies in one configuration. Scratch: sized once for a model, then reused.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// Trunk origin, world, m.
    pub base: Vector3<f64>,
    /// `R_WB` of each body.
    pub R: Vec<Matrix3<f64>>,
    /// Origin of each body's frame relative to the trunk origin, world axes, m.
    pub r: Vec<Vector3<f64>>,
    /// Joint axis of each body, world axes (the base's is unused).
    pub axis: Vec<Vector3<f64>>,
    /// Mass centre of each body relative to the trunk origin, world axes, m.
    pub c: Vec<Vector3<f64>>,
}

impl Kinematics {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let n = model.bodies().len();
        Self {
            base: Vector3::zeros(),
            R: vec![Matrix3::identity(); n],
            r: vec![Vector3::zeros(); n],
            axis: vec![Vector3::zeros(); n],
            c: vec![Vector3::zeros(); n],
        }
    }

    /// Poses of one configuration, in a room of its own.
    #[must_use]
    pub fn of(model: &Model, configuration: &Configuration) -> Self {
        let mut kinematics = Self::new(model);
        kinematics.update(model, configuration);
        kinematics
    }

    /// Recomputes all poses.
    pub fn update(&mut self, model: &Model, configuration: &Configuration) {
        self.update_poses::<true>(model, configuration);
    }

    /// Recomputes all that a step needs: spinners ([`super::Body::is_spinner`]) are left unturned about their own axis.
    pub fn update_for_step(&mut self, model: &Model, configuration: &Configuration) {
        self.update_poses::<false>(model, configuration);
    }

    fn update_poses<const SPIN: bool>(&mut self, model: &Model, configuration: &Configuration) {
        let bodies = model.bodies();
        self.base = configuration.position;
        self.R[0] = *configuration.attitude.to_rotation_matrix().matrix();
        self.r[0] = Vector3::zeros();
        self.c[0] = self.R[0] * bodies[0].centre_of_mass;
        for (b, body) in bodies.iter().enumerate().skip(1) {
            let (before, own) = self.R.split_at_mut(b);
            let parent = &before[body.parent];
            let r = self.r[body.parent] + parent * body.position;
            let fixed = body.rotation.as_ref().map(|fixed| parent * fixed);
            let frame = fixed.as_ref().unwrap_or(parent);
            (own[0], self.axis[b]) = if SPIN || !body.is_spinner {
                body.axis.rotate(frame, configuration.joints[b - 1])
            } else {
                (*frame, body.axis.turned(frame))
            };
            self.r[b] = r;
            self.c[b] = if body.is_centred() {
                r
            } else {
                r + own[0] * body.centre_of_mass
            };
        }
    }

    /// A point of body `b` given in its frame, relative to the trunk origin, world axes.
    #[inline]
    #[must_use]
    pub fn point(&self, b: usize, p: &Vector3<f64>) -> Vector3<f64> {
        self.r[b] + self.R[b] * p
    }

    /// Velocity (m/s, world) of the material point of body `b` that is at `x` (relative to the trunk origin).
    #[must_use]
    pub fn point_velocity(
        &self,
        model: &Model,
        b: usize,
        x: &Vector3<f64>,
        v: &[f64],
    ) -> Vector3<f64> {
        let mut velocity = Vector3::new(v[0], v[1], v[2]) + Vector3::new(v[3], v[4], v[5]).cross(x);
        for &k in &model.path(b)[6..] {
            velocity += self.axis[k - 5].cross(&(x - self.r[k - 5])) * v[k];
        }
        velocity
    }

    /// Row of the point Jacobian along body `b`'s path: `d · (velocity of the point at x)` per unit of each velocity.
    ///
    /// `row` has the length of the path.
    #[inline]
    pub fn point_jacobian_row(
        &self,
        path: &[usize],
        x: &Vector3<f64>,
        d: &Vector3<f64>,
        row: &mut [f64],
    ) {
        let moment = x.cross(d);
        row[..3].copy_from_slice(d.as_slice());
        row[3..6].copy_from_slice(moment.as_slice());
        for (entry, &k) in row.iter_mut().zip(path).skip(6) {
            // a · ((x − r) × d) = a · (x × d − r × d)
            *entry = self.axis[k - 5].dot(&(moment - self.r[k - 5].cross(d)));
        }
    }
}
