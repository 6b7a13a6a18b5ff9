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

use nalgebra::Vector3;

use super::kinematics::Kinematics;
use super::model::closed_loop::{BodyPose, Closure};
use super::model::{Loop, LoopGap, Model};

/// Pose of a body.
fn pose(kinematics: &Kinematics, b: usize) -> BodyPose {
    BodyPose {
        R: kinematics.R(b),
        r: kinematics.r(b),
        origin: *kinematics.origin(b),
    }
}

impl Loop {
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
                        let [x, _] = end.place(|b| pose(kinematics, b));
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
            closure.write_gaps(|b| pose(kinematics, b), joints, &mut gaps[first..end]);
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
