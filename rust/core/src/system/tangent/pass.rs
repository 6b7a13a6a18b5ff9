//! One pass over a step, with as many directions as lanes.

use super::direction::Direction;
use super::held_tree::TangentScene;
use super::scratch::{Correction, Tangent};
use super::varying_sand::VaryingSand;
use crate::contact::clusters_of;
use crate::integrator::UnilateralContact;
use crate::integrator::carried_velocity::{Carried, Moving};
use crate::integrator::forces::MOST_REVISIONS;
use crate::integrator::held_step::SAME;
use crate::integrator::work::Work;
use crate::multibody::Configuration;
use crate::multibody::bias::bias;
use crate::multibody::energy::energies;
use crate::scalar::{Dual, Lane, Vec3};
use crate::system::command::add_wrench;

/// Positions at the end of a step: before and after the projection.
#[derive(Clone, Copy, Debug)]
enum Place {
    End,
    Reached,
}

/// Relative difference of velocities that is rounding.
const ROUNDING: f64 = 1e-13;

impl<T: Lane> Tangent<T> {
    /// Calls `take` with the number of each direction and its derivatives of the configuration's
    /// motion and of the velocity at the end (nv each), and of the state of the sand (7 n). False
    /// if the step is not the one that the held equations describe; `end` then is of no use.
    pub(crate) fn differentiate(
        &mut self,
        scene: &TangentScene<'_>,
        directions: &[Direction],
        end: &mut Configuration,
        mut take: impl FnMut(usize, &[f64], &[f64]),
    ) -> bool {
        let nv = scene.model.nv();
        self.load(scene);
        self.factor.spread(self.token, &scene.held.factor);
        let mut columns = vec![vec![0.0; 2 * nv + Self::n_of_sand(scene)]; T::LANES];
        let (mut motion, mut numbers) = (vec![T::splat(self.token, 0.0); nv], [0.0; 8]);
        for (group, directions) in directions.chunks(T::LANES).enumerate() {
            self.seed(scene, directions);
            self.run(scene);
            if group == 0 {
                if !self.choose_correction(scene) {
                    return false;
                }
            } else {
                self.conclude(scene);
            }
            self.reached.slope(scene.model.mechanism(), &mut motion);
            let slopes = self.v_end.iter().map(|v| v.slope);
            let of_sand = self.sand.iter().flat_map(VaryingSand::ends);
            let all = motion.iter().copied().chain(slopes).chain(of_sand);
            for (k, slope) in all.enumerate() {
                slope.store(&mut numbers[..T::LANES]);
                for (column, x) in columns.iter_mut().zip(numbers) {
                    column[k] = x;
                }
            }
            for (lane, column) in columns[..directions.len()].iter().enumerate() {
                let (motion, velocity) = column.split_at(nv);
                take(group * T::LANES + lane, motion, velocity);
            }
        }
        self.reached.to_lane(0, end);
        true
    }

    /// From the start to the velocity before the energy audit.
    fn run(&mut self, scene: &TangentScene<'_>) {
        let (token, mechanism) = (self.token, scene.model.mechanism());
        T::vectorize(
            token,
            #[inline(always)]
            || self.predict(scene),
        );
        (self.poses_middle).update(mechanism, &self.inertias, &self.middle);
        (self.poses_end).update(mechanism, &self.inertias, &self.end);
        (self.mass_matrix).update(mechanism, &self.inertias, &self.poses_middle);
        T::vectorize(
            token,
            #[inline(always)]
            || self.drive(scene),
        );
        self.begin_loops(scene);
        self.weigh(scene, true);
        T::vectorize(
            token,
            #[inline(always)]
            || self.find_mean(scene),
        );
        self.weigh(scene, false);
        T::vectorize(
            token,
            #[inline(always)]
            || self.find_velocity(scene),
        );
    }

    #[inline(always)]
    fn step(&self, scene: &TangentScene<'_>) -> (Dual<T>, Dual<T>) {
        let number = |x: f64| Dual::splat(self.token, x);
        (number(scene.options.time_step), number(scene.options.theta))
    }

    #[inline(always)]
    fn predict(&mut self, scene: &TangentScene<'_>) {
        let (h, theta) = (scene.options.time_step, scene.options.theta);
        let mechanism = scene.model.mechanism();
        (self.middle).set_moved(mechanism, &self.start, &self.v, (1.0 - theta) * h);
        self.end.set_moved(mechanism, &self.start, &self.v, h);
    }

    /// Implicit terms, branches and torques of the drives, and the wrenches.
    #[inline(always)]
    fn drive(&mut self, scene: &TangentScene<'_>) {
        let step = self.step(scene);
        let mechanism = scene.model.mechanism();
        let (drives, mass_matrix) = (&mut self.drives, &mut self.mass_matrix);
        drives.set_theta(mechanism, step, |k| mass_matrix.diagonal(mechanism, k));
        drives.choose_branches(mechanism, &self.v);
        if drives.has_motors() {
            for (own, v) in self.v_end.iter_mut().zip(scene.v_end) {
                *own = Dual::splat(self.token, *v);
            }
            let all = T::mask(self.token, u32::MAX >> (32 - T::LANES));
            for _ in 0..MOST_REVISIONS {
                drives.revise(mechanism, all, &self.v, &self.v_end);
            }
        }
        drives.add_implicit(mechanism, step, |k, a| {
            mass_matrix.add_to_diagonal(mechanism, k, a);
        });
        self.torque.fill(Dual::splat(self.token, 0.0));
        let places = &self.start.joints;
        drives.add_impulse(
            mechanism,
            step,
            places,
            [&self.v, &self.v],
            &mut self.torque,
        );
        self.applied.fill(Dual::splat(self.token, 0.0));
        for wrench in &scene.command.wrenches {
            let (poses, body) = (&self.poses_middle, wrench.body(scene.model));
            let R = poses.spun(mechanism, &self.middle, body);
            let own = wrench.on_body(scene.model);
            let own = own.map(|x| Vec3::splat(self.token, x));
            add_wrench(mechanism, body, own, (poses, &R), &mut self.applied);
        }
        for (torque, force) in self.torque.iter_mut().zip(&self.applied) {
            *torque += step.0 * *force;
        }
    }

    /// `y` = the bias at the velocity v, or at the mean velocity.
    fn weigh(&mut self, scene: &TangentScene<'_>, at_start: bool) {
        let v = if at_start { &self.v } else { &self.v_mean };
        let [x, y, z] = scene.options.gravity.into();
        bias(
            scene.model.mechanism(),
            &self.inertias,
            &self.poses_middle,
            v,
            Vec3::splat(self.token, [x, y, z]),
            &mut self.bias_scratch,
            &mut self.y,
        );
    }

    /// `y ← M̂⁻¹ y`, with the derivative by the residual. Closed loops restrict it; `closes`: to a
    /// change of `v` after which the mean velocity obeys them.
    #[inline(always)]
    fn solve(&mut self, scene: &TangentScene<'_>, closes: bool) {
        let mechanism = scene.model.mechanism();
        if self.loops.is_some() {
            self.solve_with_loops(scene, closes);
            return;
        }
        let [value, slope] = &mut self.solved;
        for (value, y) in value.iter_mut().zip(&self.y) {
            *value = y.value;
        }
        self.factor.half_solve(mechanism, value);
        self.factor.half_solve_back(mechanism, value);
        let solution = &mut self.moved;
        for (own, value) in solution.iter_mut().zip(&*value) {
            *own = Dual::constant(*value);
        }
        (self.mass_matrix).times(mechanism, solution, &mut self.product);
        for ((slope, y), product) in slope.iter_mut().zip(&self.y).zip(&self.product) {
            *slope = y.slope - product.slope;
        }
        self.factor.half_solve(mechanism, slope);
        self.factor.half_solve_back(mechanism, slope);
        for (y, (value, slope)) in self.y.iter_mut().zip(value.iter().zip(&*slope)) {
            *y = Dual::new(*value, *slope);
        }
    }

    /// `y = h (τ − bias)`.
    #[inline(always)]
    fn load_forces(&mut self, h: Dual<T>) {
        for (y, torque) in self.y.iter_mut().zip(&self.torque) {
            *y = *torque - h * *y;
        }
    }

    #[inline(always)]
    fn find_mean(&mut self, scene: &TangentScene<'_>) {
        let (h, theta) = self.step(scene);
        let share = h.like(1.0) - theta;
        self.load_forces(h);
        self.solve(scene, true);
        for ((mean, v), change) in self.v_mean.iter_mut().zip(&self.v).zip(&self.y) {
            *mean = *v + share * *change;
        }
    }

    /// The velocity at the end with the impulses' answer, and the projection's displacement.
    #[inline(always)]
    fn find_velocity(&mut self, scene: &TangentScene<'_>) {
        let (h, _) = self.step(scene);
        let step = &scene.held.step;
        self.load_forces(h);
        self.place_contacts(scene);
        for (i, p) in step.law.p.chunks_exact(3).enumerate() {
            self.push(scene, i, [p[0], p[1], p[2]]);
        }
        self.push_sand(scene);
        self.solve(scene, true);
        self.answer(scene);
        if self.yield_sand(scene) {
            self.answer(scene);
        }
        self.displace(scene);
        self.recall_sand(scene);
    }

    /// The velocity at the end, from its change `y` at held impulses.
    #[inline(always)]
    fn answer(&mut self, scene: &TangentScene<'_>) {
        let step = &scene.held.step;
        for ((end, v), change) in self.v_end.iter_mut().zip(&self.v).zip(&self.y) {
            *end = *v + *change;
        }
        let size = step.law.p.len();
        self.du.clear();
        for i in 0..step.contacts.len() {
            let du = self.velocity_of(scene, i);
            self.du.extend_from_slice(&du);
        }
        self.dp.clear();
        for (row, of_mu) in step.answer.rows() {
            let sum = self.d_mu * self.d_mu.like(of_mu);
            self.dp.push(along(row, &self.du, sum));
        }
        if size > 0 {
            for (end, row) in self.v_end.iter_mut().zip(step.response.chunks_exact(size)) {
                end.slope = along(row, &self.dp, end.slope);
            }
        }
    }

    /// Derivative of a contact's shifted velocity at held impulses.
    #[inline(always)]
    fn velocity_of(&self, scene: &TangentScene<'_>, i: usize) -> [T; 3] {
        let mut u = self.local(scene, i, &self.v_end);
        let p = &scene.held.step.law.p[3 * i..];
        if let Some(law) = self.yielding(scene, i) {
            let more = law.yielded([0, 1, 2].map(|k| u[k].like(p[k])));
            for k in 0..3 {
                u[k] += more[k];
            }
        } else {
            let restitution = scene.held.contacts[i].restitution;
            if restitution > 0.0 {
                let before = self.local(scene, i, &self.v)[0];
                u[0] += before.like(restitution) * before;
            }
        }
        u.map(|u| u.slope)
    }

    /// The projection's displacement with its derivative. `y` is the change of the velocity at held
    /// impulses.
    #[inline(always)]
    fn displace(&mut self, scene: &TangentScene<'_>) {
        let zero = Dual::splat(self.token, 0.0);
        let step = &scene.held.step;
        let Some(projection) = &step.projection else {
            return;
        };
        let size = step.law.p.len();
        let share = self
            .d_mu
            .like(scene.options.theta * scene.options.time_step);
        self.du.clear();
        for (i, counts) in projection.counts.iter().enumerate() {
            let mut gap = zero.slope;
            if *counts {
                gap = if let Some(law) = self.yielding(scene, i) {
                    law.unexplained.slope
                } else {
                    let moved = self.local(scene, i, &self.y)[0].slope;
                    let row = &step.W[3 * i * size..][..size];
                    self.contacts[i].gap.slope + share * along(row, &self.dp, moved)
                };
            }
            self.du.extend_from_slice(&[gap, zero.slope, zero.slope]);
        }
        self.y.fill(zero);
        for (i, p) in projection.law.p.chunks_exact(3).enumerate() {
            self.push(scene, i, [p[0], p[1], p[2]]);
        }
        self.solve(scene, false);
        for i in 0..step.contacts.len() {
            let mut local = self.local(scene, i, &self.y);
            if let Some(law) = self.yielding(scene, i) {
                let p = projection.law.p[3 * i..].iter();
                for ((local, p), softness) in local.iter_mut().zip(p).zip(law.diagonal) {
                    *local += softness * softness.like(*p);
                }
            }
            for (du, local) in self.du[3 * i..].iter_mut().zip(local) {
                *du += local.slope;
            }
        }
        self.dp.clear();
        for (row, of_mu) in projection.answer.rows() {
            let sum = self.d_mu * self.d_mu.like(of_mu);
            self.dp.push(along(row, &self.du, sum));
        }
        let rows = step.response.chunks_exact(size);
        for ((own, y), row) in self.displacement.iter_mut().zip(&self.y).zip(rows) {
            *own = Dual::new(y.value, along(row, &self.dp, y.slope));
        }
    }

    /// Chooses how the audit corrected the velocity, and concludes. False if no correction leads to
    /// the velocity at the end of the step.
    fn choose_correction(&mut self, scene: &TangentScene<'_>) -> bool {
        let fastest = scene.v_end.iter().fold(1e-3_f64, |m, v| m.max(v.abs()));
        let kept = self.v_end.clone();
        self.find_groups(scene);
        let n = self.group_of.len();
        let mechanism = scene.model.mechanism();
        let mut best = vec![(f64::INFINITY, Correction::None); n];
        for correction in [Correction::None, Correction::Relative, Correction::Whole] {
            self.corrections.clear();
            self.corrections.resize(n, correction);
            self.v_end.copy_from_slice(&kept);
            self.conclude(scene);
            let mut off = vec![0.0_f64; n];
            for (k, (a, b)) in self.v_end.iter().zip(scene.v_end).enumerate() {
                let own = &mut off[self.group_of[mechanism.cluster_of_velocity(k)]];
                *own = own.max((a.get(0) - b).abs());
            }
            for (best, off) in best.iter_mut().zip(off) {
                // The same to rounding: the simpler one.
                if off < 0.5 * best.0 {
                    *best = (off, correction);
                }
            }
            if best.iter().all(|own| own.0 <= ROUNDING * fastest) {
                break;
            }
        }
        let chosen: Vec<Correction> = best.iter().map(|own| own.1).collect();
        if chosen != self.corrections {
            self.corrections = chosen;
            self.v_end.copy_from_slice(&kept);
            self.conclude(scene);
        }
        best.iter().all(|own| own.0 <= SAME * fastest)
    }

    /// The groups of clusters that touch each other in the step.
    fn find_groups(&mut self, scene: &TangentScene<'_>) {
        let mechanism = scene.model.mechanism();
        self.group_of.clear();
        self.group_of.extend(0..mechanism.n_clusters());
        for contact in &scene.held.step.contacts {
            let both = clusters_of(scene.model, &contact.key).map(|own| self.group_of[own]);
            let first = both[0].min(both[1]);
            for own in self.group_of.iter_mut().filter(|own| both.contains(own)) {
                *own = first;
            }
        }
    }

    /// The state at the end, from the velocity before the audit.
    fn conclude(&mut self, scene: &TangentScene<'_>) {
        let token = self.token;
        T::vectorize(
            token,
            #[inline(always)]
            || {
                let (h, theta) = (scene.options.time_step, scene.options.theta);
                let mechanism = scene.model.mechanism();
                self.end
                    .set_moved(mechanism, &self.middle, &self.v_end, theta * h);
            },
        );
        self.close_end(scene, false);
        self.end.normalise();
        if self.corrections.iter().any(|own| *own != Correction::None) {
            self.correct(scene);
        }
        if scene.held.step.projection.is_none() {
            self.reached.clone_from(&self.end);
            return;
        }
        let before = self.moving(scene, Place::End);
        T::vectorize(
            token,
            #[inline(always)]
            || {
                let mechanism = scene.model.mechanism();
                (self.reached).set_moved(mechanism, &self.end, &self.displacement, 1.0);
            },
        );
        self.close_end(scene, true);
        self.reached.normalise();
        self.carry_velocity(scene, &before);
    }

    /// Kinetic energy and momentum of each group with the velocity at the end, before or after the
    /// projection.
    fn moving(&mut self, scene: &TangentScene<'_>, place: Place) -> Vec<Moving<Dual<T>>> {
        let q = match place {
            Place::End => &self.end,
            Place::Reached => &self.reached,
        };
        let (mechanism, scratch) = (scene.model.mechanism(), &mut self.energy_scratch);
        let gravity = Vec3::splat(self.token, scene.options.gravity.into());
        let found = energies(mechanism, &self.inertias, q, &self.v_end, gravity, scratch);
        let zero = Dual::splat(self.token, 0.0);
        let none = Moving {
            kinetic: zero,
            momentum: Vec3::new(zero, zero, zero),
        };
        let mut all = vec![none; found.len()];
        for (own, group) in found.iter().zip(&self.group_of) {
            all[*group].kinetic += own.energy.kinetic;
            all[*group].momentum += own.momentum;
        }
        for (cluster, group) in self.group_of.iter().enumerate() {
            if mechanism.is_held(cluster) {
                all[*group].momentum = none.momentum;
            }
        }
        all
    }

    /// The velocities of the groups that were moved at their projected positions, see
    /// [`crate::integrator::carried_velocity`]. `before`: at those before it.
    fn carry_velocity(&mut self, scene: &TangentScene<'_>, before: &[Moving<Dual<T>>]) {
        let step = &scene.held.step;
        let Some(projection) = &step.projection else {
            return;
        };
        let after = self.moving(scene, Place::Reached);
        let mechanism = scene.model.mechanism();
        for (group, (before, after)) in before.iter().zip(after).enumerate() {
            let of_contact = |key| self.group_of[clusters_of(scene.model, key)[0]];
            let contacts = step.contacts.iter().zip(&projection.moved);
            let mut own = contacts.filter(|(contact, _)| of_contact(&contact.key) == group);
            if !own.clone().any(|(_, is_moved)| *is_moved) {
                continue;
            }
            let is_alone = own.all(|(contact, _)| contact.is_internal());
            let lanes = if is_alone {
                u32::MAX >> (32 - T::LANES)
            } else {
                0
            };
            let is_alone = T::mask(self.token, lanes);
            let clusters = (0..self.group_of.len()).filter(|own| self.group_of[*own] == group);
            let masses = clusters.map(|own| self.inertias.mass_of(mechanism, own));
            let mass = masses.reduce(|a, b| a + b).unwrap_or(self.inertias.mass);
            let carried = Carried::new(*before, after, mass, is_alone);
            let Vec3 { x, y, z } = carried.common;
            let trees = mechanism.trees.iter();
            for tree in trees.filter(|tree| self.group_of[tree.cluster] == group) {
                let own = &mut self.v_end[tree.velocities.clone()];
                for v in &mut *own {
                    *v *= carried.share;
                }
                if tree.is_free {
                    for (v, common) in own.iter_mut().zip([x, y, z]) {
                        *v += common;
                    }
                }
            }
        }
    }

    /// What the audit leaves of the velocity, see [`crate::integrator::audit`].
    fn correct(&mut self, scene: &TangentScene<'_>) {
        let step = self.step(scene);
        let mechanism = scene.model.mechanism();
        let gravity = Vec3::splat(self.token, scene.options.gravity.into());
        let (inertias, scratch) = (&self.inertias, &mut self.energy_scratch);
        let before = energies(mechanism, inertias, &self.start, &self.v, gravity, scratch).to_vec();
        let (end, v_end) = (&self.end, &self.v_end);
        let after = energies(mechanism, inertias, end, v_end, gravity, scratch).to_vec();
        let (h, theta) = step;
        let (zero, one) = (h.like(0.0), h.like(1.0));
        let (places, velocities) = (&self.start.joints, [&self.v[..], &self.v_end]);
        let mut of_drives = vec![Work::none(zero); mechanism.n_clusters()];
        (self.drives).work(mechanism, step, places, velocities, &mut of_drives);
        let mut works: Vec<Dual<T>> = of_drives.iter().map(Work::total).collect();
        let speeds = self.v.iter().zip(&self.v_end).enumerate();
        for (force, (k, (v, end))) in self.applied.iter().zip(speeds) {
            works[mechanism.cluster_of_velocity(k)] +=
                h * *force * (theta * *end + (one - theta) * *v);
        }
        for (group, correction) in self.corrections.iter().enumerate() {
            let own = || (0..works.len()).filter(|own| self.group_of[*own] == group);
            if *correction == Correction::None || self.group_of[group] != group {
                continue;
            }
            let is_relative =
                *correction == Correction::Relative && !own().any(|own| mechanism.is_held(own));
            let (mut excess, mut kinetic, mut mass) = (zero, zero, zero);
            let mut momentum = Vec3::new(zero, zero, zero);
            let momenta = |own: usize| after[own].momentum;
            for own in own() {
                let (before, after) = (&before[own].energy, &after[own].energy);
                let change =
                    (after.kinetic - before.kinetic) + (after.potential - before.potential);
                excess += change - works[own];
                kinetic += after.kinetic;
                mass += self.inertias.mass_of(mechanism, own);
                momentum += momenta(own);
            }
            let whole = if is_relative {
                momentum.dot(momentum) / (mass + mass)
            } else {
                zero
            };
            let share = (one - excess / (kinetic - whole)).max(zero).sqrt();
            let common = momentum * (one / mass);
            let common = [common.x, common.y, common.z];
            let trees = mechanism.trees.iter();
            for tree in trees.filter(|tree| self.group_of[tree.cluster] == group) {
                let own = &mut self.v_end[tree.velocities.clone()];
                for v in &mut *own {
                    *v *= share;
                }
                if is_relative {
                    for (v, common) in own.iter_mut().zip(common) {
                        *v += (one - share) * common;
                    }
                }
            }
        }
    }
}

/// `sum + row · x`.
#[inline(always)]
pub(super) fn along<T: Lane>(row: &[f64], x: &[T], mut sum: T) -> T {
    for (a, x) in row.iter().zip(x) {
        sum += x.like(*a) * *x;
    }
    sum
}
