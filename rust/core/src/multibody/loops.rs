//! Closed kinematic loops: constraints `φ(q) = 0` between two bodies or two joints of a machine.
//!
//! ```text
//! connect  φ = x_a − x_b                                  3 rows, m
//! weld     φ = (x_a − x_b, ½ Σ_i f_i × e_i)               6 rows, m and rad
//! joint    φ = q_a − (c_0 + c_1 q_b + ... + c_4 q_b⁴)     1 row, rad or m
//! ```
//!
//! with a common point x and common axes, e_i carried by the first body and f_i by the second. The
//! rows of `A = ∂φ/∂v` are those of the relative velocity, `v_a − v_b` and `ω_a − ω_b` in world
//! axes. For a weld that is open by an angle this differs from the derivative of φ in the second
//! order of the angle.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 8.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::description::LoopKind;
use super::joint::JointModel;
use super::kinematics::Kinematics;
use super::model::Model;
use crate::scalar::elementary::atan2;

/// A constraint of a machine.
#[derive(Clone, Debug)]
pub struct Loop {
    /// Its name.
    pub name: String,
    /// What it holds together.
    pub kind: LoopKind,
    pub(super) closure: Closure,
}

/// What a loop compares.
#[derive(Clone, Debug)]
pub(super) enum Closure {
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
pub(super) struct End {
    /// `None` for the world.
    pub body: Option<usize>,
    /// The common point in the body's frame, m.
    pub point: Vector3<f64>,
    /// The common axes in the body's frame, as columns.
    pub axes: Matrix3<f64>,
}

/// The coordinate of a joint, also of one that follows another: `ratio q + offset`.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointReading {
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
    /// Of the joint that carries a body; none if it has no coordinate.
    pub(super) fn of(model: &Model, body: usize) -> Option<Self> {
        let joint = &model.bodies()[body].joint;
        let index = joint.coordinate()?;
        let coupling = joint.coupling();
        Some(Self {
            joint: index,
            velocity: model.joint_velocity(index),
            ratio: coupling.map_or(1.0, |coupling| coupling.ratio),
            offset: coupling.map_or(0.0, |coupling| coupling.offset),
            turns: joint.turning().is_some(),
        })
    }

    fn value(&self, joints: &[f64]) -> f64 {
        self.ratio * joints[self.joint] + self.offset
    }
}

impl End {
    /// Point (world, m) relative to the origin of its tree, and that origin.
    fn place(&self, kinematics: &Kinematics) -> [Vector3<f64>; 2] {
        match self.body {
            None => [self.point, Vector3::zeros()],
            Some(b) => [kinematics.point(b, &self.point), *kinematics.origin(b)],
        }
    }

    /// The common axes in world axes, as columns.
    fn axes(&self, kinematics: &Kinematics) -> Matrix3<f64> {
        match self.body {
            None => self.axes,
            Some(b) => kinematics.R(b) * self.axes,
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

    /// Writes φ (n_rows). `joints`: coordinates of the joints, at the poses of `kinematics`.
    pub fn write_gaps(&self, kinematics: &Kinematics, joints: &[f64], out: &mut [f64]) {
        match &self.closure {
            Closure::Bodies(ends) => {
                let [[x_a, o_a], [x_b, o_b]] = ends.each_ref().map(|end| end.place(kinematics));
                out[..3].copy_from_slice(((x_a - x_b) + (o_a - o_b)).as_slice());
                if let Some(turn) = out.get_mut(3..6) {
                    let [e, f] = ends.each_ref().map(|end| end.axes(kinematics));
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

    /// Writes the rows of A (n_rows, nv), row-major.
    pub fn write_rows(
        &self,
        model: &Model,
        kinematics: &Kinematics,
        joints: &[f64],
        rows: &mut [f64],
    ) {
        rows.fill(0.0);
        match &self.closure {
            Closure::Bodies(ends) => {
                for (end, sign) in ends.iter().zip([1.0, -1.0]) {
                    if let Some(body) = end.body {
                        let [x, _] = end.place(kinematics);
                        add_rows(model, kinematics, (body, &x), sign, rows);
                    }
                }
            }
            Closure::Joints {
                own,
                other,
                polynomial,
            } => {
                rows[own.velocity] += own.ratio;
                if let Some(other) = other {
                    let x = other.value(joints);
                    let terms = polynomial.iter().enumerate().skip(1).rev();
                    let slope = terms.fold(0.0, |p, (k, c)| p * x + k as f64 * c);
                    rows[other.velocity] -= slope * other.ratio;
                }
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

/// Adds `sign` times the velocity of a body's material point at `x`, and of a weld the body's
/// angular velocity, per unit of each velocity.
fn add_rows(
    model: &Model,
    kinematics: &Kinematics,
    (body, x): (usize, &Vector3<f64>),
    sign: f64,
    rows: &mut [f64],
) {
    let nv = model.nv();
    let (path, lead) = (model.path(body), model.lead(body));
    for (i, row) in rows.chunks_exact_mut(nv).enumerate() {
        let direction = Vector3::ith(i % 3, 1.0);
        let is_turn = i >= 3;
        let moment = x.cross(&direction);
        for (k, &velocity) in path[..lead].iter().enumerate() {
            row[velocity] += sign
                * match (is_turn, k < 3) {
                    (false, true) => direction[k],
                    (false, false) => moment[k - 3],
                    (true, true) => 0.0,
                    (true, false) => direction[k - 3],
                };
        }
        for mover in model.movers(body) {
            let motion = &kinematics.motions()[mover.motion];
            row[mover.velocity] += sign
                * if is_turn {
                    motion.axis.dot(direction.into())
                } else {
                    motion.power(direction.into(), moment.into())
                };
        }
    }
}

/// The rotation vector of a rotation, rad.
pub(super) fn rotation_vector(R: &Matrix3<f64>) -> Vector3<f64> {
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

impl Model {
    /// Number of rows of all loops.
    #[must_use]
    pub fn n_loop_rows(&self) -> usize {
        self.loops().iter().map(Loop::n_rows).sum()
    }

    /// Writes the gaps of all loops, and the rows of A (n_loop_rows, nv) if there is room for them.
    pub fn write_loops(
        &self,
        kinematics: &Kinematics,
        joints: &[f64],
        gaps: &mut [f64],
        rows: &mut [f64],
    ) {
        let mut first = 0;
        for closure in self.loops() {
            let end = first + closure.n_rows();
            closure.write_gaps(kinematics, joints, &mut gaps[first..end]);
            if !rows.is_empty() {
                let rows = &mut rows[first * self.nv()..end * self.nv()];
                closure.write_rows(self, kinematics, joints, rows);
            }
            first = end;
        }
    }

    /// The loop that is open farthest with these gaps; none of a tree.
    #[must_use]
    pub fn widest_gap(&self, gaps: &[f64]) -> Option<LoopGap> {
        let mut first = 0;
        let of_loops = self.loops().iter().enumerate().map(|(index, closure)| {
            let own = &gaps[first..first + closure.n_rows()];
            first += closure.n_rows();
            closure.gap(index, own)
        });
        // What is not a number is the widest.
        of_loops.reduce(|a, b| if b.value <= a.value { a } else { b })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_comes_back_from_its_vector() {
        for vector in [[0.3, -0.2, 0.5], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0]] {
            let vector = Vector3::from(vector);
            let R = *crate::spatial::exp_rotation(&vector).to_rotation_matrix().matrix();
            assert!((rotation_vector(&R) - vector).norm() < 1e-14);
        }
    }
}
