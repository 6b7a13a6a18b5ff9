//! Momentum balance of a tree over a step, exact at both ends; see
//! [`crate::integrator::moreau_jean_newton`].

use nalgebra::Vector3;

use crate::integrator::Start;
use crate::multibody::momentum::body_momenta;
use crate::multibody::{Configuration, Joint, Kinematics, Model, Momentum, Tree};

/// Momenta of all bodies at both ends of a step: scratch.
#[derive(Clone, Debug)]
pub(super) struct MomentumBalance {
    start: Vec<Momentum>,
    end: Vec<Momentum>,
    sums: Vec<Momentum>,
    /// Mass centres at the start.
    c_start: Vec<Vector3<f64>>,
}

/// What the balance is measured at.
pub(super) struct BalanceScene<'a> {
    pub(super) model: &'a Model,
    /// At the midpoint of the step, and at its end.
    pub(super) kinematics: [&'a Kinematics; 2],
    /// m/s².
    pub(super) gravity: &'a Vector3<f64>,
    /// Time step and weight of its end.
    pub(super) h: f64,
    pub(super) theta: f64,
}

impl MomentumBalance {
    /// For n bodies.
    pub(super) fn new(n: usize) -> Self {
        let momenta = vec![Momentum::default(); n];
        Self {
            start: momenta.clone(),
            end: momenta.clone(),
            sums: momenta,
            c_start: vec![Vector3::zeros(); n],
        }
    }

    /// Notes the start of a step; `kinematics` there.
    pub(super) fn begin(&mut self, model: &Model, kinematics: &Kinematics, v: &[f64]) {
        for (b, c) in self.c_start.iter_mut().enumerate() {
            *c = kinematics.c(b);
        }
        let about = |_| Vector3::zeros();
        body_momenta(model, kinematics, v, about, &mut self.start);
    }

    /// `y = −(left-hand side)` at the iterate `v_end`, without the forces of joints, sand and
    /// contacts.
    pub(super) fn residual(
        &mut self,
        scene: &BalanceScene<'_>,
        start: Start<'_, Configuration>,
        v_end: &[f64],
        y: &mut [f64],
    ) {
        let BalanceScene {
            model,
            kinematics: [middle, end],
            gravity,
            h,
            theta,
        } = *scene;
        let origin_of = |tree: &Tree| match model.bodies()[tree.bodies.start].joint {
            Joint::Free(free) => start.configuration.pose(free).position,
            _ => Vector3::zeros(),
        };
        let end_of = |tree: &Tree| end.origin(tree.bodies.start) - origin_of(tree);
        let about = |tree: usize| end_of(&model.trees()[tree]);
        body_momenta(model, end, v_end, about, &mut self.end);
        self.sums.copy_from_slice(&self.end);
        for tree in model.trees() {
            let end_origin = end_of(tree);
            for b in tree.bodies.clone() {
                let (sum, begin) = (&mut self.sums[b], &self.start[b]);
                let weight = gravity * (model.bodies()[b].mass * h);
                // Both mass centres relative to the reference point: the tree's origin at the start
                // of the step.
                let centre = (end.c(b) + end_origin) * theta + self.c_start[b] * (1.0 - theta);
                sum.linear -= begin.linear + weight;
                sum.angular -= begin.angular + centre.cross(&weight);
            }
        }
        let middle_of = |tree: &Tree| middle.origin(tree.bodies.start) - origin_of(tree);
        self.project(model, middle, middle_of, y);
        for &(k, inertia) in model.armatures() {
            y[k] -= inertia * (v_end[k] - start.v[k]);
        }
    }

    /// `y = −Sᵀ` of the sums of everything that each joint carries, with the screws at the
    /// midpoint. `middle_of`: from a tree's origin at the start to the one at the midpoint, the
    /// reference of the screws.
    fn project(
        &mut self,
        model: &Model,
        middle: &Kinematics,
        middle_of: impl Fn(&Tree) -> Vector3<f64>,
        y: &mut [f64],
    ) {
        y.fill(0.0);
        for tree in model.trees() {
            let from = middle_of(tree);
            for b in tree.bodies.clone().rev() {
                let body = &model.bodies()[b];
                let (P, L) = (self.sums[b].linear, self.sums[b].angular);
                let about_middle = L - from.cross(&P);
                if let Joint::Free(_) = body.joint {
                    for k in 0..3 {
                        y[body.velocity + k] = -P[k];
                        y[body.velocity + 3 + k] = -about_middle[k];
                    }
                } else {
                    for (y, m) in y[body.velocity..].iter_mut().zip(body.motions()) {
                        *y -= middle.power(m, &P, &about_middle);
                    }
                }
                if let Some(parent) = body.parent {
                    self.sums[parent].linear += P;
                    self.sums[parent].angular += L;
                }
            }
        }
    }
}
