//! Forward kinematics of one machine: the poses of [`super::poses`] in the types of its users.
//!
//! World axes. Positions in a tree are relative to the tree's origin: that of its root if the root
//! is free, otherwise the world's.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::bias::{BiasScratch, bias};
use super::coriolis::{CoriolisScratch, coriolis_matrix};
use super::energy::{Energy, EnergyScratch, energy};
use super::joint::Motion;
use super::lane_configuration::LaneConfiguration;
use super::mass_matrix::MassMatrix;
use super::model::Model;
use super::path_matrix::PathMatrix;
use super::poses::Poses;
use super::state::Configuration;
use crate::scalar::Single;

/// Poses of all bodies in one configuration. Scratch: allocated once for a model, then reused.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// World position of every tree's reference origin, m.
    origins: Vec<Vector3<f64>>,
    poses: Poses<f64>,
    q: LaneConfiguration<f64>,
    tree_of: Vec<usize>,
}

impl Kinematics {
    /// Scratch for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            origins: vec![Vector3::zeros(); model.trees().len()],
            poses: Poses::new(Single::best(), model.mechanism()),
            q: LaneConfiguration::new(Single::best(), model.mechanism()),
            tree_of: model.bodies().iter().map(|body| body.tree).collect(),
        }
    }

    /// Poses of one configuration, newly allocated.
    #[must_use]
    pub fn of(model: &Model, configuration: &Configuration) -> Self {
        let mut kinematics = Self::new(model);
        kinematics.update(model, configuration);
        kinematics
    }

    /// Whether the scratch fits a model: the number of motions and the tree of every body agree.
    #[must_use]
    pub fn is_of(&self, model: &Model) -> bool {
        let trees = model.bodies().iter().map(|body| body.tree);
        self.poses.motions.len() == model.n_motions() && trees.eq(self.tree_of.iter().copied())
    }

    /// Recomputes all poses.
    pub fn update(&mut self, model: &Model, configuration: &Configuration) {
        self.update_for_step(model, configuration);
        self.poses.spin(model.mechanism(), &self.q);
    }

    /// Recomputes the poses that a step needs. Spinners ([`super::Body::is_spinner`]) are not
    /// rotated about their own axis.
    pub fn update_for_step(&mut self, model: &Model, configuration: &Configuration) {
        self.q.set_lane(0, configuration);
        (self.poses).update(model.mechanism(), model.inertias(), &self.q);
        let others = self.poses.other_origins.iter();
        let origins = std::iter::once(&self.poses.origin).chain(others);
        for (own, origin) in self.origins.iter_mut().zip(origins) {
            *own = (*origin).into();
        }
    }

    /// The poses as the sources of the dynamics read them.
    #[inline]
    #[must_use]
    pub fn poses(&self) -> &Poses<f64> {
        &self.poses
    }

    /// `R_WB` of body `b`.
    #[inline]
    #[must_use]
    pub fn R(&self, b: usize) -> Matrix3<f64> {
        self.poses.bodies[b].R.into()
    }

    /// Origin of body `b`'s frame relative to its tree's origin, world axes, m.
    #[inline]
    #[must_use]
    pub fn r(&self, b: usize) -> Vector3<f64> {
        self.poses.bodies[b].r.into()
    }

    /// Mass centre of body `b` relative to its tree's origin, world axes, m.
    #[inline]
    #[must_use]
    pub fn c(&self, b: usize) -> Vector3<f64> {
        self.poses.bodies[b].c.into()
    }

    /// Motion of each joint velocity, in the order of the bodies.
    #[inline]
    #[must_use]
    pub fn motions(&self) -> &[Motion<f64>] {
        &self.poses.motions
    }

    /// World position of the reference origin of body `b`'s tree, m: the origin of a free root,
    /// otherwise the world's.
    #[inline]
    #[must_use]
    pub fn origin(&self, b: usize) -> &Vector3<f64> {
        &self.origins[self.tree_of[b]]
    }

    /// A point given in the frame of body `b`, relative to its tree's origin, world axes.
    #[inline]
    #[must_use]
    pub fn point(&self, b: usize, p: &Vector3<f64>) -> Vector3<f64> {
        let pose = &self.poses.bodies[b];
        (pose.r + pose.R.times((*p).into())).into()
    }

    /// Velocity (m/s, world) of the material point of body `b` at `x` (relative to its tree's
    /// origin).
    #[must_use]
    pub fn point_velocity(
        &self,
        model: &Model,
        b: usize,
        x: &Vector3<f64>,
        v: &[f64],
    ) -> Vector3<f64> {
        let motion = |m: usize| self.poses.motions[m];
        let mechanism = model.mechanism();
        (mechanism.point_velocity(b, (*x).into(), motion, |k| v[k])).into()
    }

    /// Velocity of the material point at `x` per unit of the joint velocity of motion `m`.
    #[inline]
    #[must_use]
    pub fn velocity_at(&self, m: usize, x: &Vector3<f64>) -> Vector3<f64> {
        self.poses.motions[m].velocity_at((*x).into()).into()
    }

    /// Generalized force on the joint velocity of motion `m` due to a force (N) and its moment
    /// about the tree's origin (N m).
    #[inline]
    #[must_use]
    pub fn power(&self, m: usize, force: &Vector3<f64>, moment: &Vector3<f64>) -> f64 {
        self.poses.motions[m].power((*force).into(), (*moment).into())
    }

    /// Row of the point Jacobian along body `b`'s path: `d · (velocity of the point at x)` per unit
    /// of each velocity.
    ///
    /// `row` has the length of the path.
    #[inline]
    pub fn point_jacobian_row(
        &self,
        model: &Model,
        b: usize,
        x: &Vector3<f64>,
        d: &Vector3<f64>,
        row: &mut [f64],
    ) {
        let moment = x.cross(d);
        let (lead, rest) = row.split_at_mut(model.lead(b));
        if let Some((linear, angular)) = lead.split_at_mut_checked(3) {
            linear.copy_from_slice(d.as_slice());
            angular.copy_from_slice(moment.as_slice());
        }
        for (entry, mover) in rest.iter_mut().zip(model.movers(b)) {
            *entry = self.power(mover.motion, d, &moment);
        }
    }

    /// The mass matrix (nv, nv), newly allocated; kg, kg m, kg m².
    #[must_use]
    pub fn mass_matrix(&self, model: &Model) -> DMatrix<f64> {
        let mut M = MassMatrix::new(Single::best(), model.mechanism());
        M.update(model.mechanism(), model.inertias(), &self.poses);
        M.to_dense(model.mechanism(), 0)
    }

    /// The bias `b` in `M v̇ + b = τ` (nv), newly allocated. `gravity`: m/s², world.
    #[must_use]
    pub fn bias(&self, model: &Model, v: &[f64], gravity: &Vector3<f64>) -> Vec<f64> {
        let mechanism = model.mechanism();
        let mut scratch = BiasScratch::new(Single::best(), mechanism);
        let mut out = vec![0.0; model.nv()];
        bias(
            mechanism,
            model.inertias(),
            &self.poses,
            v,
            (*gravity).into(),
            &mut scratch,
            &mut out,
        );
        out
    }

    /// The Coriolis matrix `C(q, v)` (nv, nv), with `C v` the bias without gravity and `C + Cᵀ` the
    /// rate of the mass matrix, and the bias of gravity (nv), both newly allocated. `gravity`:
    /// m/s², world.
    #[must_use]
    pub fn coriolis(
        &self,
        model: &Model,
        v: &[f64],
        gravity: &Vector3<f64>,
    ) -> (DMatrix<f64>, Vec<f64>) {
        let (mechanism, token) = (model.mechanism(), Single::best());
        let mut C = PathMatrix::new(token, mechanism);
        let mut weight = vec![0.0; model.nv()];
        coriolis_matrix(
            mechanism,
            (model.inertias(), &self.poses),
            v,
            (*gravity).into(),
            &mut CoriolisScratch::new(token, mechanism),
            (&mut C, &mut weight),
        );
        let mut dense = DMatrix::identity(model.nv(), model.nv());
        for mut column in dense.column_iter_mut() {
            let unit: Vec<f64> = column.iter().copied().collect();
            C.times(mechanism, &unit, column.as_mut_slice());
        }
        (dense, weight)
    }

    /// Energy at the velocity `v` (nv). `gravity`: m/s², world.
    #[must_use]
    pub fn energy(&self, model: &Model, v: &[f64], gravity: &Vector3<f64>) -> Energy {
        let mechanism = model.mechanism();
        let mut scratch = EnergyScratch::new(Single::best(), mechanism);
        let (inertias, gravity) = (model.inertias(), (*gravity).into());
        energy(mechanism, inertias, &self.q, v, gravity, &mut scratch).0
    }
}
