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

use super::kinematics::Kinematics;
use super::mechanism::{BASE, Mechanism};
use super::model::closed_loop::{BodyPose, Closure, widths};
use super::model::{Loop, LoopGap, Model};
use super::poses::Poses;
use crate::scalar::{Lane, Vec3};

/// Poses of a mechanism, and the coordinates of its joints there.
#[derive(Clone, Copy)]
pub(crate) struct Placed<'a, T: Lane> {
    pub mechanism: &'a Mechanism,
    pub poses: &'a Poses<T>,
    pub joints: &'a [T],
}

impl<T: Lane> Placed<'_, T> {
    /// Pose of a body.
    #[inline(always)]
    fn pose(&self, b: usize) -> BodyPose<T> {
        let own = &self.poses.bodies[b];
        BodyPose {
            R: own.R,
            r: own.r,
            origin: self.poses.origin_of(self.mechanism.tree_of_body(b)),
        }
    }
}

impl Loop {
    /// Writes the rows of A (n_rows, nv), row-major.
    #[inline(always)]
    fn write_rows<T: Lane>(&self, placed: &Placed<'_, T>, rows: &mut [T]) {
        let zero = rows[0].like(0.0);
        rows.fill(zero);
        match &self.closure {
            Closure::Bodies(ends) => {
                for (end, sign) in ends.iter().zip([1.0, -1.0]) {
                    if let Some(body) = end.body {
                        let [x, _] = end.place(
                            zero.token(),
                            #[inline(always)]
                            |b| placed.pose(b),
                        );
                        add_rows(placed, (body, x), zero.like(sign), rows);
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
                    let x = other.value(placed.joints);
                    let mut slope = zero;
                    for (k, c) in polynomial.iter().enumerate().skip(1).rev() {
                        slope = slope * x + x.like(k as f64 * c);
                    }
                    rows[other.velocity] -= slope * zero.like(other.ratio);
                }
            }
        }
    }
}

/// Adds `sign` times the velocity of a body's material point at `x`, and of a weld the body's
/// angular velocity, per unit of each velocity.
#[inline(always)]
fn add_rows<T: Lane>(placed: &Placed<'_, T>, (body, x): (usize, Vec3<T>), sign: T, rows: &mut [T]) {
    let Placed {
        mechanism, poses, ..
    } = *placed;
    let token = sign.token();
    for (i, row) in rows.chunks_exact_mut(mechanism.nv()).enumerate() {
        let (axis, is_turn) = (i % 3, i >= 3);
        let mut direction = [0.0; 3];
        direction[axis] = 1.0;
        let direction = Vec3::splat(token, direction);
        let moment = x.cross(direction);
        if let Some(first) = mechanism.base_of(body) {
            let base = &mut row[first..first + BASE];
            if is_turn {
                base[3 + axis] += sign;
            } else {
                base[axis] += sign;
                base[3] += sign * moment.x;
                base[4] += sign * moment.y;
                base[5] += sign * moment.z;
            }
        }
        for mover in mechanism.movers(body) {
            let motion = &poses.motions[mover.motion];
            let rate = if is_turn {
                motion.axis.dot(direction)
            } else {
                motion.power(direction, moment)
            };
            row[mover.velocity] += sign * rate;
        }
    }
}

/// Writes the gaps of loops, and the rows of A (n_loop_rows, nv) if there is room for them.
#[inline(always)]
pub(crate) fn write_loops<T: Lane>(
    loops: &[Loop],
    placed: &Placed<'_, T>,
    gaps: &mut [T],
    rows: &mut [T],
) {
    let (mut first, nv) = (0, placed.mechanism.nv());
    for closure in loops {
        let end = first + closure.n_rows();
        closure.write_gaps(
            #[inline(always)]
            |b| placed.pose(b),
            placed.joints,
            &mut gaps[first..end],
        );
        if !rows.is_empty() {
            closure.write_rows(placed, &mut rows[first * nv..end * nv]);
        }
        first = end;
    }
}

/// The widest of the gaps of loops, m or rad; not a number if one is none.
#[inline(always)]
pub(crate) fn widest<T: Lane>(loops: &[Loop], gaps: &[T]) -> T {
    let zero = gaps[0].like(0.0);
    let (mut first, mut widest) = (0, zero);
    for closure in loops {
        let end = first + closure.n_rows();
        for width in widths(&gaps[first..end]) {
            let stays = width.le(widest) | !widest.le(widest);
            widest = T::select(stays, widest, width);
        }
        first = end;
    }
    widest
}

impl Model {
    /// Number of rows of all loops.
    #[must_use]
    pub fn n_loop_rows(&self) -> usize {
        self.loops().iter().map(Loop::n_rows).sum()
    }

    /// The gaps of all loops, and the rows of A (n_loop_rows, nv) if there is room for them.
    pub fn write_loops(
        &self,
        kinematics: &Kinematics,
        joints: &[f64],
        gaps: &mut [f64],
        rows: &mut [f64],
    ) {
        let placed = Placed {
            mechanism: self.mechanism(),
            poses: kinematics.poses(),
            joints,
        };
        write_loops(self.loops(), &placed, gaps, rows);
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
