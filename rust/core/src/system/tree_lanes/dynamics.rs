//! The dynamics of trees in lanes.

use super::TreeLanes;
use crate::contact::loops::{Projector, each};
use crate::integrator::{Dynamics, StepOptions};
use crate::multibody::LaneConfiguration;
use crate::multibody::energy::energies;
use crate::multibody::loops::Placed;
use crate::scalar::{Lane, LaneMask, Vec3, inlined};
use crate::system::extent::{Turning, displacement, tolerated};

impl<T: Lane> TreeLanes<T> {
    /// Adds the implicit terms of motors, held joints, springs, dampers and sand to M.
    fn add_implicit(&mut self, options: &StepOptions) {
        let (machine, step) = (&*self.mechanism, self.step(options));
        let (drives, mass_matrix) = (&mut self.drives, &mut self.mass_matrix);
        inlined!(T::vectorize, self.token, {
            drives.add_implicit(machine, step, |k, a| {
                mass_matrix.add_to_diagonal(machine, k, a);
            });
        });
        if let Some(sand) = &mut self.sand {
            sand.add_to_mass(machine, mass_matrix);
        }
    }

    fn factorise_once(&mut self, options: &StepOptions) -> T::Mask {
        self.add_implicit(options);
        let (mechanism, mass_matrix) = (&*self.mechanism, &mut self.mass_matrix);
        let is_definite = if self.turns | self.is_thorough {
            mass_matrix.factorise(mechanism, &mut self.factor)
        } else {
            mass_matrix.factorise_in_place(mechanism, &mut self.factor)
        };
        if let Some(loops) = &mut self.loops {
            let placed = Placed {
                mechanism: &self.mechanism,
                poses: &self.poses_middle,
                joints: &self.joints_middle,
            };
            loops.begin(&placed, &self.factor, self.n_places);
        }
        is_definite
    }
}

impl<T: Lane> Dynamics for TreeLanes<T> {
    type T = T;
    type Configuration = LaneConfiguration<T>;

    fn nv(&self) -> usize {
        self.mechanism.nv()
    }

    fn n_clusters(&self) -> usize {
        self.mechanism.n_clusters()
    }

    fn cluster_of_velocity(&self, k: usize) -> usize {
        self.mechanism.cluster_of_velocity(k)
    }

    fn translation_axis(&self, k: usize) -> Option<usize> {
        let mut trees = self.mechanism.trees.iter();
        let tree = trees.find(|tree| tree.velocities.contains(&k))?;
        let axis = k - tree.velocities.start;
        (tree.is_free && axis < 3).then_some(axis)
    }

    fn is_held(&self, cluster: usize) -> bool {
        self.mechanism.is_held(cluster)
    }

    #[inline(always)]
    fn set_moved(
        &self,
        from: &LaneConfiguration<T>,
        v: &[T],
        h: f64,
        to: &mut LaneConfiguration<T>,
    ) {
        to.set_moved(&self.mechanism, from, v, h);
    }

    fn advance(&self, q: &mut LaneConfiguration<T>, v: &[T], h: f64) {
        let from = q.clone();
        self.set_moved(&from, v, h, q);
    }

    #[inline(always)]
    fn take(
        &self,
        lanes: impl Fn(usize) -> T::Mask,
        from: &LaneConfiguration<T>,
        to: &mut LaneConfiguration<T>,
    ) {
        if self.mechanism.n_clusters() == 1 {
            to.select_from(lanes(0), from);
        } else {
            to.select_clusters_from(&self.mechanism, lanes, from);
        }
    }

    #[inline(always)]
    fn is_finite(&self, q: &LaneConfiguration<T>) -> T::Mask {
        q.is_finite()
    }

    #[inline(always)]
    fn normalise(&self, q: &mut LaneConfiguration<T>) {
        q.normalise();
    }

    fn place_middle(&mut self, q: &LaneConfiguration<T>) {
        self.poses_middle.update(&self.mechanism, &self.inertias, q);
        self.joints_middle.copy_from_slice(&q.joints);
        self.bias_before.clear();
        self.apply_wrenches(q);
    }

    fn place_end(&mut self, q: &LaneConfiguration<T>) {
        self.poses_end.update(&self.mechanism, &self.inertias, q);
        self.joints_end.copy_from_slice(&q.joints);
    }

    fn update_mass_matrix(&mut self, options: &StepOptions, going: T::Mask, is_first: bool) {
        self.mass_matrix
            .update(&self.mechanism, &self.inertias, &self.poses_middle);
        if is_first {
            let (machine, step) = (&*self.mechanism, self.step(options));
            let (mass_matrix, drives) = (&self.mass_matrix, &mut self.drives);
            inlined!(
                T::vectorize,
                self.token,
                drives.set_theta(machine, step, |k| mass_matrix.diagonal(machine, k))
            );
            self.sink(options, going);
        }
    }

    fn factorise(&mut self, options: &StepOptions) -> T::Mask {
        let mut is_definite = self.factorise_once(options);
        let all = T::mask(self.token, u32::MAX >> (32 - T::LANES));
        if self.is_thorough && (all & !is_definite).any() && self.drop_tangents() {
            self.update_mass_matrix(options, all, false);
            is_definite = self.factorise_once(options);
        }
        is_definite
    }

    fn multiply_mass(&self, v: &[T], out: &mut [T]) {
        self.mass_matrix.times(&self.mechanism, v, out);
    }

    #[inline(always)]
    fn turning(
        &mut self,
        options: &StepOptions,
        v: &[T],
        is_gyroscopic: &mut [T::Mask],
    ) -> Option<T> {
        let (h, _) = self.step(options);
        let mut most = h.like(0.0);
        self.turns = false;
        for (cluster, own) in is_gyroscopic.iter_mut().enumerate() {
            let turning = Turning::of_cluster(h.like(0.0), &self.mechanism, v, cluster);
            *own = turning.is_gyroscopic(h);
            self.turns |= own.any();
            most = most.max(turning.of_frames());
        }
        Some(most)
    }

    fn conserves_momenta(&self) -> bool {
        let trees = &self.mechanism.trees;
        trees.len() == 1 && trees[0].is_free && self.loops.is_none()
    }

    #[inline(always)]
    fn is_audited(&self) -> bool {
        self.is_audited
    }

    #[inline(always)]
    fn energies(
        &mut self,
        _: &StepOptions,
        q: &LaneConfiguration<T>,
        v: &[T],
        mut each: impl FnMut(usize, [T; 2], Vec3<T>),
    ) {
        let found = energies(
            &self.mechanism,
            &self.inertias,
            q,
            v,
            self.gravity,
            &mut self.energy_scratch,
        );
        for (cluster, own) in found.iter().enumerate() {
            each(cluster, own.energy.kinetic_and_potential(), own.momentum);
        }
    }

    #[inline(always)]
    fn mass(&self, cluster: usize) -> Option<T> {
        Some(self.inertias.mass_of(&self.mechanism, cluster))
    }

    #[inline(always)]
    fn half_solve(&self, y: &mut [T]) {
        self.factor.half_solve(&self.mechanism, y);
    }

    #[inline(always)]
    fn close_velocity(&mut self, options: &StepOptions, v_begin: &[T], v: &[T], y: &mut [T]) {
        if let Some(loops) = &mut self.loops {
            loops.close(options.theta, v_begin, v, y);
        }
    }

    #[inline(always)]
    fn add_loop_impulse(&mut self, out: &mut [T]) {
        if let Some(loops) = &mut self.loops {
            loops.add_generalized_impulse(&std::iter::empty(), out);
        }
    }

    fn close_end(
        &mut self,
        lanes: T::Mask,
        p: &[T],
        q: &mut LaneConfiguration<T>,
        v: &mut [T],
    ) -> Option<T> {
        let loops = self.loops.as_mut()?;
        if self.is_thorough {
            loops.find_impulses(&each(self.token, p));
        }
        let with = Projector {
            mechanism: &self.mechanism,
            inertias: &self.inertias,
            factor: &self.factor,
            lanes,
        };
        let gap = loops.project_position(&with, q);
        inlined!(T::vectorize, self.token, loops.project_velocity(&with, v));
        Some(gap)
    }

    #[inline(always)]
    fn half_solve_back(&self, y: &mut [T]) {
        self.factor.half_solve_back(&self.mechanism, y);
    }

    #[inline(always)]
    fn tolerated(&self, options: &StepOptions, cluster: usize) -> f64 {
        tolerated(options.penetration_tolerance, &self.mechanism, cluster)
    }

    #[inline(always)]
    fn displacement(&self, y: &[T], cluster: usize) -> T {
        displacement(self.number(0.0), &self.mechanism, y, cluster)
    }
}
