//! Commands of a step: torques, joints held at set-points, and wrenches from outside.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::multibody::{Mechanism, Model, Motor, Poses, Servo};
use crate::scalar::{Lane, Mat3, Vec3};

/// A joint held at a set-point by a PD controller that is implicit in the step:
/// `τ = −stiffness (q − set_point) − damping q̇`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldJoint {
    /// rad.
    pub set_point: f64,
    /// N m/rad.
    pub stiffness: f64,
    /// N m s/rad.
    pub damping: f64,
}

/// A driven joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drive {
    /// Commanded torque about the joint's axis, N m.
    pub torque: f64,
    /// Torque–speed line; without one the torque is the command at any speed.
    pub motor: Option<Motor>,
    /// Servo that sets the torque in place of `torque`.
    pub servo: Option<Servo>,
}

/// A force and a moment from outside on a body, constant in world axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Index of the frame of a solid, [`Model::frames`].
    pub solid: usize,
    /// Where the force acts, in the solid's frame, m.
    pub point: [f64; 3],
    /// N.
    pub force: [f64; 3],
    /// N m.
    pub moment: [f64; 3],
}

impl Wrench {
    /// Whether the wrench acts on a solid of the model, and all of its numbers are finite.
    #[must_use]
    pub fn is_of(&self, model: &Model) -> bool {
        let numbers = [self.point, self.force, self.moment];
        self.solid < model.frames().len() && numbers.as_flattened().iter().all(|x| x.is_finite())
    }

    /// The body that it acts on.
    pub(crate) fn body(&self, model: &Model) -> usize {
        model.frames()[self.solid].body
    }

    /// Numbers of the wrench on its body: point in the body's frame, m; force, N; moment, N m.
    pub(crate) fn on_body(&self, model: &Model) -> [[f64; 3]; 3] {
        let frame = &model.frames()[self.solid];
        let point = frame.position + frame.rotation * Vector3::from(self.point);
        [point.into(), self.force, self.moment]
    }
}

/// Adds the generalized force (nv), N and N m, of a wrench with the numbers of [`Wrench::on_body`]
/// at the poses of a step. `R`: attitude of the body, also of a spinner.
#[allow(clippy::inline_always)] // a call leaves the instructions that its caller is for
#[inline(always)]
pub(crate) fn add_wrench<T: Lane>(
    mechanism: &Mechanism,
    body: usize,
    [point, force, moment]: [Vec3<T>; 3],
    (poses, R): (&Poses<T>, &Mat3<T>),
    out: &mut [T],
) {
    let x = poses.bodies[body].r + R.times(point);
    let moment = x.cross(force) + moment;
    if let Some(first) = mechanism.base_of(body) {
        let both = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        for (out, x) in out[first..].iter_mut().zip(both) {
            *out += x;
        }
    }
    for mover in mechanism.movers(body) {
        out[mover.velocity] += poses.motions[mover.motion].power(force, moment);
    }
}

/// Torques, motors and held joints; every joint can be free, driven, held, or all of these.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Torque about each joint's axis (n_joints), N m.
    pub torque: Vec<f64>,
    /// Joints with a drive (n_joints), whose torque adds to `torque`.
    pub drives: Vec<Option<Drive>>,
    /// Which joints are held (n_joints).
    pub held: Vec<Option<HeldJoint>>,
    /// From outside, at most one a solid.
    pub wrenches: Vec<Wrench>,
}

impl HeldJoint {
    /// Energy that the stiffness stores at a coordinate, J.
    #[must_use]
    pub fn potential(&self, coordinate: f64) -> f64 {
        let stretch = coordinate - self.set_point;
        0.5 * self.stiffness * stretch * stretch
    }
}

impl Command {
    /// Energy that the held joints store at joint coordinates (n_joints), J.
    #[must_use]
    pub fn stored(&self, coordinates: &[f64]) -> f64 {
        let held = self.held.iter().zip(coordinates);
        let stored = held.filter_map(|(held, q)| held.as_ref().map(|held| held.potential(*q)));
        stored.sum()
    }

    /// No torque, nothing held.
    #[must_use]
    pub fn idle(model: &Model) -> Self {
        Self {
            torque: vec![0.0; model.n_joints()],
            drives: vec![None; model.n_joints()],
            held: vec![None; model.n_joints()],
            wrenches: Vec::new(),
        }
    }
}
