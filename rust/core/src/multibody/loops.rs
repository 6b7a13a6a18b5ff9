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

#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::mechanism::Mechanism;
use super::model::closed_loop::{BodyPose, Closure};
use super::model::{Loop, LoopGap, Model};
use super::poses::Poses;
use crate::scalar::{Lane, Vec3};

/// Pose of a body.
#[inline(always)]
fn pose<T: Lane>(mechanism: &Mechanism, poses: &Poses<T>, b: usize) -> BodyPose<T> {
    BodyPose {
        R: poses.bodies[b].R,
        r: poses.bodies[b].r,
        origin: poses.origin_of(mechanism.tree_of_body(b)),
    }
}

impl Loop {
    /// Writes the rows of A (n_rows, nv), row-major.
    #[inline(always)]
    pub fn write_rows<T: Lane>(
        &self,
        mechanism: &Mechanism,
        poses: &Poses<T>,
        joints: &[T],
        rows: &mut [T],
    ) {
        let zero = rows[0].like(0.0);
        rows.fill(zero);
        match &self.closure {
            Closure::Bodies(ends) => {
                for (end, sign) in ends.iter().zip([1.0, -1.0]) {
                    if let Some(body) = end.body {
                        let x = end.place(&pose(mechanism, poses, body));
                        add_rows(mechanism, poses, (body, x), zero.like(sign), rows);
                    }
                }
            }
            Closure::Joints {
                own,
                other,
                polynomial,
            } => {
                rows[own.velocity] += zero.like(own.ratio);
                if let Some(other) = other {
                    let x = other.value(joints);
                    let terms = polynomial.iter().enumerate().skip(1).rev();
                    let slope = terms.fold(zero, |p, (k, c)| p * x + zero.like(k as f64 * c));
                    rows[other.velocity] -= slope * zero.like(other.ratio);
                }
            }
        }
    }
}

/// Adds `sign` times the velocity of a body's material point at `x`, and of a weld the body's
/// angular velocity, per unit of each velocity.
#[inline(always)]
fn add_rows<T: Lane>(
    mechanism: &Mechanism,
    poses: &Poses<T>,
    (body, x): (usize, Vec3<T>),
    sign: T,
    rows: &mut [T],
) {
    let zero = sign.like(0.0);
    for (i, row) in rows.chunks_exact_mut(mechanism.nv()).enumerate() {
        let mut unit = [0.0; 3];
        unit[i % 3] = 1.0;
        let direction = Vec3::splat(zero.token(), unit);
        let is_turn = i >= 3;
        let moment = x.cross(direction);
        if let Some(first) = mechanism.base_of(body) {
            let numbers = |v: Vec3<T>| [v.x, v.y, v.z];
            let (moves, turns) = if is_turn {
                ([zero; 3], numbers(direction))
            } else {
                (numbers(direction), numbers(moment))
            };
            for (own, x) in row[first..].iter_mut().zip(moves.into_iter().chain(turns)) {
                *own += sign * x;
            }
        }
        for mover in mechanism.movers(body) {
            let motion = &poses.motions[mover.motion];
            row[mover.velocity] += sign
                * if is_turn {
                    motion.axis.dot(direction)
                } else {
                    motion.power(direction, moment)
                };
        }
    }
}

impl Model {
    /// Number of rows of all loops.
    #[must_use]
    pub fn n_loop_rows(&self) -> usize {
        self.loops().iter().map(Loop::n_rows).sum()
    }

    /// Writes the gaps of all loops, and the rows of A (n_loop_rows, nv) if there is room for them.
    #[inline(always)]
    pub fn write_loops<T: Lane>(
        &self,
        poses: &Poses<T>,
        joints: &[T],
        gaps: &mut [T],
        rows: &mut [T],
    ) {
        let (mechanism, nv) = (self.mechanism(), self.nv());
        let mut first = 0;
        for closure in self.loops() {
            let end = first + closure.n_rows();
            let own = &mut gaps[first..end];
            closure.write_gaps(|b| pose(mechanism, poses, b), joints, own);
            if !rows.is_empty() {
                closure.write_rows(mechanism, poses, joints, &mut rows[first * nv..end * nv]);
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
