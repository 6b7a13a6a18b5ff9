//! Forward kinematics: attitude, origin, joint axis and mass centre of every body.
//!
//! World axes. Positions in a tree are relative to the tree's origin: that of its root if the root
//! is free, otherwise the world's.

use nalgebra::{Matrix3, Vector3};

use super::joint::{Coordinate, Coupling, Joint, Motion, Prismatic, Revolute, Spherical};
use super::model::{Body, Model};
use super::state::Configuration;

/// Poses of all bodies in one configuration. Scratch: allocated once for a model, then reused.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// World position of every tree's reference origin, m.
    origins: Vec<Vector3<f64>>,
    tree_of: Vec<usize>,
    /// `R_WB` of each body.
    pub R: Vec<Matrix3<f64>>,
    /// Origin of each body's frame relative to its tree's origin, world axes, m.
    pub r: Vec<Vector3<f64>>,
    /// Screw of each joint velocity, indexed like [`Model::motions`].
    pub motions: Vec<Motion>,
    /// Mass centre of each body relative to its tree's origin, world axes, m.
    pub c: Vec<Vector3<f64>>,
}

impl Kinematics {
    /// Scratch for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let n = model.bodies().len();
        Self {
            origins: vec![Vector3::zeros(); model.trees().len()],
            tree_of: model.bodies().iter().map(|body| body.tree).collect(),
            R: vec![Matrix3::identity(); n],
            r: vec![Vector3::zeros(); n],
            motions: vec![Motion::default(); model.n_motions()],
            c: vec![Vector3::zeros(); n],
        }
    }

    /// Poses of one configuration, newly allocated.
    #[must_use]
    pub fn of(model: &Model, configuration: &Configuration) -> Self {
        let mut kinematics = Self::new(model);
        kinematics.update(model, configuration);
        kinematics
    }

    /// Whether it is scratch of a model with these bodies.
    #[must_use]
    pub fn is_of(&self, model: &Model) -> bool {
        let trees = model.bodies().iter().map(|body| body.tree);
        self.motions.len() == model.n_motions()
            && self.origins.len() == model.trees().len()
            && trees.eq(self.tree_of.iter().copied())
    }

    /// Recomputes all poses.
    pub fn update(&mut self, model: &Model, configuration: &Configuration) {
        self.update_poses(model, configuration, true);
    }

    /// Recomputes the poses that a step needs. Spinners ([`super::Body::is_spinner`]) are not
    /// rotated about their own axis.
    pub fn update_for_step(&mut self, model: &Model, configuration: &Configuration) {
        self.update_poses(model, configuration, false);
    }

    /// `spins`: whether spinners are rotated, too.
    fn update_poses(&mut self, model: &Model, configuration: &Configuration, spins: bool) {
        let (world, nowhere) = (Matrix3::identity(), Vector3::zeros());
        let joints = &configuration.joints;
        for (b, body) in model.bodies().iter().enumerate() {
            let (before, own) = self.R.split_at_mut(b);
            let own = &mut own[0];
            if let Joint::Free(free) = body.joint {
                let pose = configuration.pose(free);
                self.origins[body.tree] = pose.position;
                *own = *pose.attitude.to_rotation_matrix().matrix();
                self.r[b] = nowhere;
                self.c[b] = *own * body.centre_of_mass;
                continue;
            }
            let (carrier, r_carrier) = match body.parent {
                Some(parent) => (&before[parent], self.r[parent]),
                None => (&world, nowhere),
            };
            let mut r = r_carrier + carrier * body.position;
            let fixed = body.rotation.as_ref().map(|fixed| carrier * fixed);
            let frame = fixed.as_ref().unwrap_or(carrier);
            match &body.joint {
                Joint::Revolute(Revolute { axis, coordinate }) => {
                    let turned;
                    (*own, turned) = if spins || !body.is_spinner {
                        axis.rotate(frame, coordinate.of(joints))
                    } else {
                        (*frame, axis.turned(frame))
                    };
                    let motion = Motion::turn(turned, r);
                    set_motion(&mut self.motions, body.motion, coordinate, motion);
                }
                Joint::Prismatic(Prismatic { axis, coordinate }) => {
                    let axis = axis.turned(frame);
                    *own = *frame;
                    r += axis * coordinate.of(joints);
                    set_motion(
                        &mut self.motions,
                        body.motion,
                        coordinate,
                        Motion::slide(axis),
                    );
                }
                Joint::Spherical(Spherical { rotation }) => {
                    let rotation = configuration.rotations[*rotation].to_rotation_matrix();
                    *own = frame * rotation.matrix();
                    let motions = Spherical::motions(frame, &r);
                    self.motions[body.motions()].copy_from_slice(&motions);
                }
                Joint::Free(_) | Joint::Fixed => *own = *frame,
            }
            self.r[b] = r;
            self.c[b] = if body.is_centred() {
                r
            } else {
                r + *own * body.centre_of_mass
            };
        }
    }

    /// World position of the reference origin of body `b`'s tree, m: the origin of a free root,
    /// otherwise the world's.
    #[inline]
    #[must_use]
    pub fn origin(&self, b: usize) -> &Vector3<f64> {
        &self.origins[self.tree_of[b]]
    }

    /// Sets the reference origin of a tree, m.
    pub(crate) fn set_origin(&mut self, tree: usize, origin: Vector3<f64>) {
        self.origins[tree] = origin;
    }

    /// A point given in the frame of body `b`, relative to its tree's origin, world axes.
    #[inline]
    #[must_use]
    pub fn point(&self, b: usize, p: &Vector3<f64>) -> Vector3<f64> {
        self.r[b] + self.R[b] * p
    }

    /// Velocity (m/s, world) of the material point of body `b` at `x` (relative to its tree's
    /// origin).
    #[must_use]
    pub fn point_velocity(
        &self,
        model: &Model,
        b: usize,
        x: &Vector3<f64>,
        v: &[f64],
    ) -> Vector3<f64> {
        let (lead, rest) = model.split_path(b);
        let mut velocity = match v[lead].first_chunk() {
            Some(&[x_dot, y_dot, z_dot, w_x, w_y, w_z]) => {
                Vector3::new(x_dot, y_dot, z_dot) + Vector3::new(w_x, w_y, w_z).cross(x)
            }
            None => Vector3::zeros(),
        };
        for (&k, &m) in rest.iter().zip(model.motions(b)) {
            velocity += self.motions[m].velocity_at(x) * v[k];
        }
        velocity
    }

    /// Row of the point Jacobian along body `b`'s path: `d · (velocity of the point at x)` per unit
    /// of each velocity.
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
        let (lead, rest) = row.split_at_mut(model.lead(b));
        if let Some((linear, angular)) = lead.split_at_mut_checked(3) {
            linear.copy_from_slice(d.as_slice());
            angular.copy_from_slice(moment.as_slice());
        }
        for (entry, &m) in rest.iter_mut().zip(model.motions(b)) {
            *entry = self.motions[m].power(d, &moment);
        }
    }
}

/// Stores the motion of a joint velocity and, for a coupled joint, the combined motion of the
/// bodies that it carries.
#[inline]
fn set_motion(motions: &mut [Motion], m: usize, coordinate: &Coordinate, of_rate: Motion) {
    motions[m] = of_rate;
    if let Some(coupling) = &coordinate.coupling {
        couple(motions, m, coupling);
    }
}

#[cold]
fn couple(motions: &mut [Motion], m: usize, coupling: &Coupling) {
    motions[m] = motions[m] * coupling.ratio;
    if let Some((before, combined)) = coupling.combined {
        motions[combined] = motions[before] + motions[m];
    }
}

/// Velocity of a body relative to its carrier, world axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointRate {
    /// rad/s.
    pub spin: Vector3<f64>,
    /// m/s.
    pub slide: Vector3<f64>,
}

/// Relative velocity across a joint that is not free, at the velocity `v` (nv).
#[cold]
pub(super) fn joint_rate(body: &Body, kinematics: &Kinematics, v: &[f64]) -> JointRate {
    let none = Vector3::zeros();
    let axis = || kinematics.motions[body.motion].axis() * v[body.velocity];
    let (spin, slide) = match body.joint {
        Joint::Revolute(_) => (axis(), none),
        Joint::Prismatic(_) => (none, axis()),
        Joint::Spherical(_) => (spherical_spin(body, kinematics, v), none),
        Joint::Free(_) | Joint::Fixed => (none, none),
    };
    JointRate { spin, slide }
}

fn spherical_spin(body: &Body, kinematics: &Kinematics, v: &[f64]) -> Vector3<f64> {
    let motions = kinematics.motions[body.motions()].iter();
    (motions.zip(&v[body.velocity..]))
        .map(|(motion, v)| motion.axis() * *v)
        .sum()
}
