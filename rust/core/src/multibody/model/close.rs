//! The loops of a machine, from its description.

use std::collections::HashMap;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::closed_loop::{BodyPose, Closure, JointReading, Loop, LoopEnd};
use super::{Body, Frame, Model, fingerprint};
use crate::multibody::description::check_loops::is_placed;
use crate::multibody::description::{LoopDescription, LoopKind};
use crate::multibody::error::{ModelError, ModelFault};
use crate::multibody::joint::fixed::Lock;
use crate::multibody::joint::{Coupled, Joint, SingleJoint};
use crate::scalar::elementary::atan2;
use crate::spatial::exp_rotation;

/// Largest gap at the zero of all joints, m or rad.
pub(crate) const CLOSED: f64 = 1e-6;

impl Model {
    /// Builds the loops of the description, and writes into it where they close.
    ///
    /// # Errors
    /// A loop within one body, or one between bodies that is open at the zero of all joints.
    pub(super) fn build_loops(&mut self) -> Result<(), ModelError> {
        if self.description.loops.is_empty() {
            return Ok(());
        }
        let names: Vec<String> = self.frames.iter().map(|frame| frame.name.clone()).collect();
        let solids: HashMap<&str, usize> = (names.iter().map(String::as_str)).zip(0..).collect();
        let (poses, joints) = (zero_poses(&self.bodies), vec![0.0; self.joints.len()]);
        for i in 0..self.description.loops.len() {
            let mut described = self.description.loops[i].clone();
            let without = without(&described);
            let closure = match described.kind {
                LoopKind::Joint => self.joint_loop(i, &described, &solids)?,
                LoopKind::Connect | LoopKind::Weld => {
                    Closure::Bodies(self.ends(i, &mut described, &solids, &poses)?)
                }
            };
            let made = Loop {
                name: described.name.clone(),
                kind: described.kind,
                closure,
            };
            let mut gaps = vec![0.0; made.n_rows()];
            made.write_gaps(|b| poses[b].into(), &joints, &mut gaps);
            let gap = made.gap(i, &gaps);
            let has_place =
                made.kind != LoopKind::Joint && is_placed(&self.description, &described, &solids);
            // A gap that is not a number is open, too.
            if has_place && (gap.value.is_nan() || gap.value > CLOSED) {
                return Err(ModelFault::LoopOpen {
                    name: made.name,
                    gap: gap.value,
                    unit: gap.unit,
                    without,
                }
                .at(format!("loops[{i}]")));
            }
            self.description.loops[i] = described;
            self.loops.push(made);
        }
        let text = self.description.to_json().unwrap_or_default();
        self.fingerprint = fingerprint(text.bytes());
        Ok(())
    }

    /// The ends of a loop between bodies. Writes into its description where it closes.
    fn ends(
        &self,
        i: usize,
        described: &mut LoopDescription,
        solids: &HashMap<&str, usize>,
        poses: &[ZeroPose],
    ) -> Result<[LoopEnd; 2], ModelError> {
        let frame = |name: &str| solids.get(name).map(|&k| &self.frames[k]);
        let (first, second) = (
            frame(&described.solid),
            described.other.as_deref().and_then(frame),
        );
        let body = |frame: Option<&Frame>| frame.map(|frame| frame.body);
        if body(first) == body(second) {
            return Err(ModelFault::LoopInOneBody(described.name.clone()).at(format!("loops[{i}]")));
        }
        let (R_a, r_a) = pose(first, poses);
        let (R_b, r_b) = pose(second, poses);
        let position = described.position.unwrap_or_default();
        let here = || (R_b.transpose() * (r_a + R_a * Vector3::from(position) - r_b)).into();
        let other_position = *described.other_position.get_or_insert_with(here);
        let mut turn = Matrix3::identity();
        if described.kind == LoopKind::Weld {
            let now = || rotation_vector(&(R_b.transpose() * R_a)).into();
            let vector = *described.other_rotation.get_or_insert_with(now);
            turn = *exp_rotation(&vector.into()).to_rotation_matrix().matrix();
        }
        described.position = Some(position);
        Ok([
            end(first, &position.into(), &Matrix3::identity()),
            end(second, &other_position.into(), &turn),
        ])
    }

    fn joint_loop(
        &self,
        i: usize,
        described: &LoopDescription,
        solids: &HashMap<&str, usize>,
    ) -> Result<Closure, ModelError> {
        let reading = |what: &str, name: &str| {
            let body = solids.get(name).map(|&k| self.frames[k].body);
            let found = body.and_then(|body| {
                JointReading::of(&self.bodies[body].joint, &self.joint_velocities)
            });
            found.ok_or_else(|| {
                ModelFault::UnknownName(name.to_owned()).at(format!("loops[{i}].{what}"))
            })
        };
        let own = reading("solid", &described.solid)?;
        let other = (described.other.as_deref()).map(|name| reading("other", name));
        let other = other.transpose()?;
        if other.is_some_and(|other| other.joint == own.joint) {
            return Err(ModelFault::LoopInOneBody(described.name.clone()).at(format!("loops[{i}]")));
        }
        let usual: &[f64] = if other.is_some() { &[0.0, 1.0] } else { &[0.0] };
        let polynomial = described.polynomial.as_deref().unwrap_or(usual);
        Ok(Closure::Joints {
            own,
            other,
            polynomial: polynomial.to_vec(),
        })
    }
}

/// The fields whose defaults close a loop at the zero of all joints.
fn without(described: &LoopDescription) -> &'static str {
    let position = described.other_position.is_some();
    match (position, described.other_rotation.is_some()) {
        (true, true) => "other_position and other_rotation",
        (false, true) => "other_rotation",
        (_, false) => "other_position",
    }
}

/// Attitude and origin (world, m) of a body with all joints at zero.
#[derive(Clone, Copy, Debug)]
struct ZeroPose {
    R: Matrix3<f64>,
    r: Vector3<f64>,
}

impl From<ZeroPose> for BodyPose<f64> {
    fn from(pose: ZeroPose) -> Self {
        Self {
            R: pose.R.into(),
            r: pose.r.into(),
            origin: Vector3::zeros().into(),
        }
    }
}

/// Poses of all bodies.
fn zero_poses(bodies: &[Body]) -> Vec<ZeroPose> {
    let mut poses: Vec<ZeroPose> = Vec::with_capacity(bodies.len());
    for body in bodies {
        let carrier = body
            .parent
            .map_or((Matrix3::identity(), Vector3::zeros()), |parent| {
                (poses[parent].R, poses[parent].r)
            });
        let frame = body.rotation.map_or(carrier.0, |R| carrier.0 * R);
        let lock = match &body.joint {
            Joint::Coupled(Coupled { moves, coupling }) => match moves {
                SingleJoint::Revolute(own) => Lock::Turned(own.axis, coupling.offset),
                SingleJoint::Prismatic(own) => Lock::Displaced(own.axis, coupling.offset),
            },
            _ => Lock::AtZero,
        };
        let (displacement, R) = lock.place(&frame);
        poses.push(ZeroPose {
            R,
            r: carrier.1 + carrier.0 * body.position + displacement,
        });
    }
    poses
}

/// Attitude and origin of a solid's frame in the world; the identity for the world itself.
fn pose(frame: Option<&Frame>, poses: &[ZeroPose]) -> (Matrix3<f64>, Vector3<f64>) {
    frame.map_or((Matrix3::identity(), Vector3::zeros()), |frame| {
        let ZeroPose { R, r } = poses[frame.body];
        (R * frame.rotation, r + R * frame.position)
    })
}

/// The rotation vector of a rotation, rad.
fn rotation_vector(R: &Matrix3<f64>) -> Vector3<f64> {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*R));
    let (w, v) = (q.w, q.imag());
    let (w, v) = if w < 0.0 { (-w, -v) } else { (w, v) };
    let size = v.norm();
    if size == 0.0 {
        Vector3::zeros()
    } else {
        v * (2.0 * atan2(size, w) / size)
    }
}

/// A point and axes in the frame of a solid as an end.
fn end(frame: Option<&Frame>, point: &Vector3<f64>, axes: &Matrix3<f64>) -> LoopEnd {
    match frame {
        None => LoopEnd {
            body: None,
            point: (*point).into(),
            axes: (*axes).into(),
        },
        Some(frame) => LoopEnd {
            body: Some(frame.body),
            point: (frame.position + frame.rotation * point).into(),
            axes: (frame.rotation * axes).into(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::multibody::kinematics::Kinematics;
    use crate::multibody::state::Configuration;

    #[test]
    fn a_rotation_comes_back_from_its_vector() {
        for vector in [[0.3, -0.2, 0.5], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0]] {
            let vector = Vector3::from(vector);
            let R = *crate::spatial::exp_rotation(&vector)
                .to_rotation_matrix()
                .matrix();
            assert!((rotation_vector(&R) - vector).norm() < 1e-14);
        }
    }

    #[test]
    fn all_bodies_are_where_the_kinematics_puts_them_at_zero() {
        for name in crate::multibody::ModelDescription::names() {
            let description = crate::multibody::ModelDescription::named(name).unwrap();
            let model = Model::from_description(description).unwrap();
            let kinematics = Kinematics::of(&model, &Configuration::zero(&model));
            for (b, pose) in zero_poses(model.bodies()).iter().enumerate() {
                let place = kinematics.r(b) + kinematics.origin(b);
                assert!(
                    (pose.r - place).norm() < 1e-14 && (pose.R - kinematics.R(b)).norm() < 1e-14
                );
            }
        }
    }
}
