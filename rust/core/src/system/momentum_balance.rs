//! Momentum balance of a tree over a step, exact at both ends; see
//! [`crate::integrator::moreau_jean_newton`].

use nalgebra::Vector3;

use crate::integrator::StepStart;
use crate::multibody::joint::joint_model::JointCoordinates;
use crate::multibody::momentum::body_momenta;
use crate::multibody::{Joint, LaneConfiguration, Model, Momentum, Poses, Tree};

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
    pub(super) poses: [&'a Poses<f64>; 2],
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

    /// Notes the start of a step; `poses` there.
    pub(super) fn begin(&mut self, model: &Model, poses: &Poses<f64>, v: &[f64]) {
        for (c, pose) in self.c_start.iter_mut().zip(&poses.bodies) {
            *c = pose.c.into();
        }
        let about = |_| Vector3::zeros();
        body_momenta(model, poses, v, about, &mut self.start);
    }

    /// `y = −(left-hand side)` at the iterate `v_end`, without the forces of joints, sand and
    /// contacts.
    pub(super) fn residual(
        &mut self,
        scene: &BalanceScene<'_>,
        start: StepStart<'_, LaneConfiguration<f64>>,
        v_end: &[f64],
        y: &mut [f64],
    ) {
        let BalanceScene {
            model,
            poses: [middle, end],
            gravity,
            h,
            theta,
        } = *scene;
        let origin_of = |tree: &Tree| match model.bodies()[tree.bodies.start].joint {
            Joint::Free(free) => (start.configuration.pose_at(free.pose).0).into(),
            _ => Vector3::zeros(),
        };
        let from_start = |poses: &Poses<f64>, tree: &Tree| {
            let number = model.bodies()[tree.bodies.start].tree;
            Vector3::from(poses.origin_of(number)) - origin_of(tree)
        };
        let end_of = |tree: &Tree| from_start(end, tree);
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
                let centre = (Vector3::from(end.bodies[b].c) + end_origin) * theta
                    + self.c_start[b] * (1.0 - theta);
                sum.linear -= begin.linear + weight;
                sum.angular -= begin.angular + centre.cross(&weight);
            }
        }
        self.project(model, middle, |tree| from_start(middle, tree), y);
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
        middle: &Poses<f64>,
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
                        *y -= middle.motions[m].power(P.into(), about_middle.into());
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
