//! A closed loop: what it compares, and how far it is open.

use nalgebra::{Matrix3, Vector3};

use crate::multibody::description::LoopKind;
use crate::multibody::joint::{Joint, JointModel};

/// Attitude of a body, its origin relative to that of its tree, m, and the latter in the world, m.
#[derive(Clone, Copy, Debug)]
pub struct BodyPose {
    /// `R_WB`.
    pub R: Matrix3<f64>,
    /// World axes, m.
    pub r: Vector3<f64>,
    /// m.
    pub origin: Vector3<f64>,
}

/// A constraint of a machine.
#[derive(Clone, Debug)]
pub struct Loop {
    /// Its name.
    pub name: String,
    /// What it holds together.
    pub kind: LoopKind,
    pub(in crate::multibody) closure: Closure,
}

/// What a loop compares.
#[derive(Clone, Debug)]
pub(in crate::multibody) enum Closure {
    /// The common point, and of a weld the common axes, as each end carries them.
    Bodies([End; 2]),
    /// A joint and the one it follows.
    Joints {
        own: JointReading,
        other: Option<JointReading>,
        /// The constant first.
        polynomial: Vec<f64>,
    },
}

/// One end of a loop between bodies.
#[derive(Clone, Debug)]
pub(in crate::multibody) struct End {
    /// `None` for the world.
    pub body: Option<usize>,
    /// The common point in the body's frame, m.
    pub point: Vector3<f64>,
    /// The common axes in the body's frame, as columns.
    pub axes: Matrix3<f64>,
}

/// The coordinate of a joint, also of one that follows another: `ratio q + offset`.
#[derive(Clone, Copy, Debug)]
pub(in crate::multibody) struct JointReading {
    /// Index among the coordinates of joints, and of its velocity.
    pub joint: usize,
    pub velocity: usize,
    pub ratio: f64,
    pub offset: f64,
    /// Whether it is an angle.
    pub turns: bool,
}

/// How far a loop is open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopGap {
    /// Index of the loop.
    pub index: usize,
    /// m or rad.
    pub value: f64,
    /// "m" or "rad".
    pub unit: &'static str,
}

impl JointReading {
    /// Of the joint of a body; none if it has no coordinate.
    pub(super) fn of(joint: &Joint, joint_velocities: &[usize]) -> Option<Self> {
        let index = joint.coordinate()?;
        let coupling = joint.coupling();
        Some(Self {
            joint: index,
            velocity: joint_velocities[index],
            ratio: coupling.map_or(1.0, |coupling| coupling.ratio),
            offset: coupling.map_or(0.0, |coupling| coupling.offset),
            turns: joint.turning().is_some(),
        })
    }

    pub(in crate::multibody) fn value(&self, joints: &[f64]) -> f64 {
        self.ratio * joints[self.joint] + self.offset
    }
}

impl End {
    /// Point (world, m) relative to the origin of its tree, and that origin.
    pub(in crate::multibody) fn place(
        &self,
        pose: impl Fn(usize) -> BodyPose,
    ) -> [Vector3<f64>; 2] {
        let pose = self.body.map(pose);
        pose.map_or([self.point, Vector3::zeros()], |pose| {
            [pose.r + pose.R * self.point, pose.origin]
        })
    }

    /// The common axes in world axes, as columns.
    fn axes(&self, pose: impl Fn(usize) -> BodyPose) -> Matrix3<f64> {
        let pose = self.body.map(pose);
        pose.map_or(self.axes, |pose| pose.R * self.axes)
    }
}

impl Loop {
    /// Number of its rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        match self.kind {
            LoopKind::Connect => 3,
            LoopKind::Weld => 6,
            LoopKind::Joint => 1,
        }
    }

    /// Whether one of its ends is the world.
    #[must_use]
    pub fn holds_the_world(&self) -> bool {
        match &self.closure {
            Closure::Bodies(ends) => ends.iter().any(|end| end.body.is_none()),
            Closure::Joints { .. } => false,
        }
    }

    /// Writes φ (n_rows). `pose`: of each body; `joints`: coordinates of the joints there.
    pub fn write_gaps(&self, pose: impl Fn(usize) -> BodyPose, joints: &[f64], out: &mut [f64]) {
        match &self.closure {
            Closure::Bodies(ends) => {
                let [[x_a, o_a], [x_b, o_b]] = ends.each_ref().map(|end| end.place(&pose));
                out[..3].copy_from_slice(((x_a - x_b) + (o_a - o_b)).as_slice());
                if let Some(turn) = out.get_mut(3..6) {
                    let [e, f] = ends.each_ref().map(|end| end.axes(&pose));
                    let sum: Vector3<f64> = (0..3).map(|i| f.column(i).cross(&e.column(i))).sum();
                    turn.copy_from_slice((sum * 0.5).as_slice());
                }
            }
            Closure::Joints {
                own,
                other,
                polynomial,
            } => {
                let x = other.map_or(0.0, |other| other.value(joints));
                out[0] = own.value(joints) - polynomial.iter().rev().fold(0.0, |p, c| p * x + c);
            }
        }
    }

    /// How far it is open with these φ (n_rows). `index`: its place among the loops.
    #[must_use]
    pub fn gap(&self, index: usize, gaps: &[f64]) -> LoopGap {
        let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (way, turn) = gaps.split_at(gaps.len().min(3));
        let (way, turn) = (norm(way), norm(turn));
        let is_angle = match &self.closure {
            Closure::Joints { own, .. } => own.turns,
            Closure::Bodies(_) => turn > way,
        };
        LoopGap {
            index,
            value: way.max(turn),
            unit: if is_angle { "rad" } else { "m" },
        }
    }
}
