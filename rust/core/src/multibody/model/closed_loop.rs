//! A closed loop: what it compares, and how far it is open.

use crate::multibody::description::LoopKind;
use crate::multibody::joint::{Joint, JointModel};
use crate::multibody::mechanism::Mechanism;
use crate::scalar::{Lane, Mat3, Vec3};

/// Attitude of a body, its origin relative to that of its tree, m, and the latter in the world, m.
#[derive(Clone, Copy, Debug)]
pub(in crate::multibody) struct BodyPose<T> {
    /// `R_WB`.
    pub R: Mat3<T>,
    /// World axes, m.
    pub r: Vec3<T>,
    /// m.
    pub origin: Vec3<T>,
}

/// A constraint of a machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Loop {
    /// Name of the loop.
    pub name: String,
    /// Kind of the loop: what it holds together.
    pub kind: LoopKind,
    pub(in crate::multibody) closure: Closure,
}

/// What a loop compares.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::multibody) enum Closure {
    /// The common point, and of a weld the common axes, as each end carries them.
    Bodies([LoopEnd; 2]),
    /// A joint and the one it follows.
    Joints {
        own: JointReading,
        other: Option<JointReading>,
        /// The constant first.
        polynomial: Vec<f64>,
    },
}

/// One end of a loop between bodies.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::multibody) struct LoopEnd {
    /// `None` for the world.
    pub body: Option<usize>,
    /// The common point in the body's frame, m.
    pub point: [f64; 3],
    /// The common axes in the body's frame, as columns.
    pub axes: [[f64; 3]; 3],
}

/// The coordinate of a joint, also of one that follows another: `ratio q + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::multibody) struct JointReading {
    /// Index among the coordinates of joints, and of its velocity.
    pub joint: usize,
    pub velocity: usize,
    pub ratio: f64,
    pub offset: f64,
    /// Whether the coordinate is an angle.
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
    /// Reading of a joint's coordinate; `None` if the joint has no coordinate.
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
        let q = joints[self.joint];
        q.like(self.ratio) * q + q.like(self.offset)
    }
}

impl LoopEnd {
    /// Point (world, m) relative to the origin of its tree, and that origin.
    #[inline(always)]
    pub(in crate::multibody) fn place<T: Lane>(
        &self,
        token: T::Token,
        pose: impl Fn(usize) -> BodyPose<T>,
    ) -> [Vec3<T>; 2] {
        match self.body.map(pose) {
            None => [self.point, [0.0; 3]].map(|x| Vec3::splat(token, x)),
            Some(pose) => [pose.r + pose.R.times_shared(self.point), pose.origin],
        }
    }

    /// The common axes in world axes, as columns.
    #[inline(always)]
    fn axes<T: Lane>(&self, token: T::Token, pose: impl Fn(usize) -> BodyPose<T>) -> [Vec3<T>; 3] {
        match self.body.map(pose) {
            None => self.axes.map(|axis| Vec3::splat(token, axis)),
            Some(pose) => pose.R.times_columns(&self.axes).columns(),
        }
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

    /// The trees of its ends.
    pub(crate) fn trees<'a>(&'a self, mechanism: &'a Mechanism) -> impl Iterator<Item = usize> {
        let (bodies, joints) = match &self.closure {
            Closure::Bodies(ends) => (Some(ends.iter().filter_map(|end| end.body)), None),
            Closure::Joints { own, other, .. } => (None, Some(std::iter::once(own).chain(other))),
        };
        let of_bodies = (bodies.into_iter().flatten()).map(|body| mechanism.tree_of_body(body));
        let of_joints = joints.into_iter().flatten();
        of_bodies.chain(of_joints.map(|own| mechanism.tree_of_velocity(own.velocity)))
    }

    /// Writes φ (n_rows). `pose`: of each body; `joints`: coordinates of the joints there.
    #[inline(always)]
    pub(in crate::multibody) fn write_gaps<T: Lane>(
        &self,
        pose: impl Fn(usize) -> BodyPose<T>,
        joints: &[T],
        out: &mut [T],
    ) {
        let token = out[0].token();
        match &self.closure {
            Closure::Bodies([a, b]) => {
                let ([x_a, o_a], [x_b, o_b]) = (a.place(token, &pose), b.place(token, &pose));
                let gap = (x_a - x_b) + (o_a - o_b);
                out[..3].copy_from_slice(&[gap.x, gap.y, gap.z]);
                if let Some(turn) = out.get_mut(3..6) {
                    let (e, f) = (a.axes(token, &pose), b.axes(token, &pose));
                    let mut sum = Vec3::splat(token, [0.0; 3]);
                    for i in 0..3 {
                        sum += f[i].cross(e[i]);
                    }
                    let turned = sum * gap.x.like(0.5);
                    turn.copy_from_slice(&[turned.x, turned.y, turned.z]);
                }
            }
            Closure::Joints {
                own,
                other,
                polynomial,
            } => {
                let mut sum = out[0].like(0.0);
                let x = match other {
                    Some(other) => other.value(joints),
                    None => sum,
                };
                for c in polynomial.iter().rev() {
                    sum = sum * x + x.like(*c);
                }
                out[0] = own.value(joints) - sum;
            }
        }
    }

    /// How far it is open with these φ (n_rows). `index`: its place among the loops.
    #[must_use]
    pub fn gap(&self, index: usize, gaps: &[f64]) -> LoopGap {
        let [way, turn] = widths(gaps);
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

/// How far a loop is open with these φ (n_rows): m, or of a joint its own; and rad.
#[inline(always)]
pub(in crate::multibody) fn widths<T: Lane>(gaps: &[T]) -> [T; 2] {
    let mut squares = [gaps[0].like(0.0); 2];
    for (k, gap) in gaps.iter().enumerate() {
        squares[k / 3] += *gap * *gap;
    }
    [squares[0].sqrt(), squares[1].sqrt()]
}
