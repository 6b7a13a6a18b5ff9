//! Forward kinematics: attitude, origin, joint axis and mass centre of every body.
//!
//! World axes, positions relative to the trunk origin.

use nalgebra::{Matrix3, Vector3};

use super::model::Model;
use super::state::Configuration;

/// What one joint velocity does per unit: a turn about an axis.
#[derive(Clone, Copy, Debug, Default)]
pub struct Motion {
    /// Unit vector of the axis, world axes.
    pub axis: Vector3<f64>,
    /// A point of the axis, relative to the origin of the tree's places, m.
    pub place: Vector3<f64>,
}

impl Motion {
    /// Velocity of the material point at `x` per unit of the joint's velocity.
    #[inline]
    #[must_use]
    pub fn velocity_at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.axis.cross(&(x - self.place))
    }

    /// Generalized force on the joint's velocity of a force (N) and its moment about the origin of the tree's places (N m).
    #[inline]
    #[must_use]
    pub fn power(&self, force: &Vector3<f64>, moment: &Vector3<f64>) -> f64 {
        // a · ((x − r) × f) = a · (x × f − r × f)
        self.axis.dot(&(moment - self.place.cross(force)))
    }
}

/// Poses of all bodies in one configuration. Scratch: sized once for a model, then reused.
#[derive(Clone, Debug)]
pub struct Kinematics {
    origin: Vector3<f64>,
    /// `R_WB` of each body.
    pub R: Vec<Matrix3<f64>>,
    /// Origin of each body's frame relative to the trunk origin, world axes, m.
    pub r: Vec<Vector3<f64>>,
    /// What each joint velocity does, by the numbers of [`Model::motions`].
    pub motions: Vec<Motion>,
    /// Mass centre of each body relative to the trunk origin, world axes, m.
    pub c: Vec<Vector3<f64>>,
}

impl Kinematics {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let n = model.bodies().len();
        Self {
            origin: Vector3::zeros(),
            R: vec![Matrix3::identity(); n],
            r: vec![Vector3::zeros(); n],
            motions: vec![Motion::default(); model.n_joints()],
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
        self.origin = configuration.position;
        self.R[0] = *configuration.attitude.to_rotation_matrix().matrix();
        self.r[0] = Vector3::zeros();
        self.c[0] = self.R[0] * bodies[0].centre_of_mass;
        for (b, body) in bodies.iter().enumerate().skip(1) {
            let (before, own) = self.R.split_at_mut(b);
            let parent = &before[body.parent];
            let r = self.r[body.parent] + parent * body.position;
            let fixed = body.rotation.as_ref().map(|fixed| parent * fixed);
            let frame = fixed.as_ref().unwrap_or(parent);
            let axis;
            (own[0], axis) = if SPIN || !body.is_spinner {
                body.axis.rotate(frame, configuration.joints[b - 1])
            } else {
                (*frame, body.axis.turned(frame))
            };
            self.motions[b - 1] = Motion { axis, place: r };
            self.r[b] = r;
            self.c[b] = if body.is_centred() {
                r
            } else {
                r + own[0] * body.centre_of_mass
            };
        }
    }

    /// World position of the point to which all places of body `b` are relative, m: the origin of its tree's base.
    #[inline]
    #[must_use]
    pub fn origin(&self, _b: usize) -> &Vector3<f64> {
        &self.origin
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
        for (&k, &m) in model.path(b)[model.lead(b)..].iter().zip(model.motions(b)) {
            velocity += self.motions[m].velocity_at(x) * v[k];
        }
        velocity
    }

    /// Row of the point Jacobian along body `b`'s path: `d · (velocity of the point at x)` per unit of each velocity.
    ///
    /// `row` has the length of the path.
    #[inline]
    pub fn point_jacobian_row(
        &self,
        model: &Model,
        b: usize,
        x: &Vector3<f64>,
        d: &Vector3<f64>,
        row: &mut [f64],
    ) {
        let moment = x.cross(d);
        row[..3].copy_from_slice(d.as_slice());
        row[3..6].copy_from_slice(moment.as_slice());
        for (entry, &m) in row[model.lead(b)..].iter_mut().zip(model.motions(b)) {
            *entry = self.motions[m].power(d, &moment);
        }
    }
}
