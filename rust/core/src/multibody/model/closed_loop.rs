//! A closed loop: what it compares, and how far it is open.

use nalgebra::{Matrix3, Vector3};

use crate::multibody::description::LoopKind;
use crate::multibody::joint::{Joint, JointModel};
use crate::scalar::{Lane, Mat3, Vec3};

/// Attitude of a body, its origin relative to that of its tree, m, and the latter in the world, m.
#[derive(Clone, Copy, Debug)]
pub struct BodyPose<T> {
    /// `R_WB`.
    pub R: Mat3<T>,
    /// World axes, m.
    pub r: Vec3<T>,
    /// m.
    pub origin: Vec3<T>,
}

impl<T: Lane> BodyPose<T> {
    /// That of the world's frame.
    fn of_world(token: T::Token) -> Self {
        let nowhere = Vec3::splat(token, [0.0; 3]);
        Self {
            R: Mat3::identity(token),
            r: nowhere,
            origin: nowhere,
        }
    }
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

    #[inline(always)]
    pub(in crate::multibody) fn value<T: Lane>(&self, joints: &[T]) -> T {
        let x = joints[self.joint];
        x.like(self.ratio) * x + x.like(self.offset)
    }
}

impl End {
    /// Pose of its body.
    #[inline(always)]
    fn pose<T: Lane>(&self, token: T::Token, pose: impl Fn(usize) -> BodyPose<T>) -> BodyPose<T> {
        (self.body).map_or_else(|| BodyPose::of_world(token), pose)
    }

    /// Point (world, m) relative to the origin of its tree.
    #[inline(always)]
    pub(in crate::multibody) fn place<T: Lane>(&self, pose: &BodyPose<T>) -> Vec3<T> {
        pose.r + pose.R.times_shared(self.point.into())
    }

    /// The common axes in world axes.
    #[inline(always)]
    fn axes<T: Lane>(&self, pose: &BodyPose<T>) -> Mat3<T> {
        pose.R.times_columns(&self.axes.into())
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
    #[inline(always)]
    pub fn write_gaps<T: Lane>(
        &self,
        pose: impl Fn(usize) -> BodyPose<T>,
        joints: &[T],
        out: &mut [T],
    ) {
        let number = |x: f64| out[0].like(x);
        match &self.closure {
            Closure::Bodies(ends) => {
                let token = out[0].token();
                let [a, b] = ends.each_ref().map(|end| end.pose(token, &pose));
                let apart = ends[0].place(&a) - ends[1].place(&b) + (a.origin - b.origin);
                out[..3].copy_from_slice(&[apart.x, apart.y, apart.z]);
                if let Some(turn) = out.get_mut(3..6) {
                    let [e, f] = [ends[0].axes(&a), ends[1].axes(&b)];
                    let sum = f.x.cross(e.x) + f.y.cross(e.y) + f.z.cross(e.z);
                    let sum = sum * sum.x.like(0.5);
                    turn.copy_from_slice(&[sum.x, sum.y, sum.z]);
                }
            }
            Closure::Joints {
                own,
                other,
                polynomial,
            } => {
                let x = other.map_or(number(0.0), |other| other.value(joints));
                let terms = polynomial.iter().rev();
                let followed = terms.fold(number(0.0), |p, c| p * x + x.like(*c));
                out[0] = own.value(joints) - followed;
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
