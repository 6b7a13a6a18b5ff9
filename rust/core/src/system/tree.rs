//! A multibody tree on a terrain as a mechanical system: the rover.
//!
//! The forces of its joints are implicit ([`super::drives`]). `M̂ = Lᵀ D L` along the tree; the
//! contact system stores `Z` along each contact's path.

use super::command::Command;
use super::extent::{Turning, displacement, tolerated};
use super::gyroscopic::Turned;
use super::loops::{each, placed};
use super::momentum_balance::BalanceScene;
use super::sand::{MOST_REVISIONS_IN_SAND, SandContact};
use super::sand_patch::SandScene;
use super::tree_scratch::TreeScratch;
use crate::contact::rollers::turn_to_rollers;
use crate::contact::{
    Activation, Contact, ContactKey, Opposite, Part, clusters_of, detect, detect_limits,
    detect_pairs, generalized_impulse, joint_friction, list_friction, relocate, relocate_limit,
};
use crate::geometry::Terrain;
use crate::integrator::forces::MOST_REVISIONS;
use crate::integrator::{
    Contacting, Dynamics, Forces, Start, StepOptions, UnilateralContact, Work,
};
use crate::law::compliance::Compliance;
use crate::law::newton_impact::rebound;
use crate::multibody::bias::bias;
use crate::multibody::energy::energies;
use crate::multibody::{Configuration, Factor, Model};
use crate::problem::{Dimension, FrictionContactProblem};
use crate::sand::RutMap;
use crate::scalar::Vec3;

impl UnilateralContact for Contact {
    type Key = ContactKey;
    type Local = [f64; 3];

    #[inline]
    fn key(&self) -> ContactKey {
        self.key.lasting()
    }

    #[inline]
    fn gap(&self) -> f64 {
        self.gap
    }

    fn is_internal(&self) -> bool {
        self.other.is_some() || self.key.opposite == Opposite::Stop
    }
}

/// A model on a terrain, with its actuator command.
pub struct TreeSystem<'a> {
    /// The machine.
    pub model: &'a Model,
    /// The ground.
    pub terrain: &'a dyn Terrain,
    /// Actuator torques and held joints.
    pub command: &'a Command,
    /// Where wheels have been in soft ground.
    pub ruts: Option<&'a RutMap>,
    /// Scratch of the system.
    pub parts: &'a mut TreeScratch,
}

impl TreeSystem<'_> {
    /// μ and e of a contact whose two materials have a law of their own.
    #[inline]
    fn between_materials(&self, options: &StepOptions, contact: &Contact) -> Option<[f64; 2]> {
        if options.materials.is_empty() {
            return None;
        }
        contact.between_materials(self.model, self.terrain, &options.materials)
    }
}

impl TreeSystem<'_> {
    /// The sand with its ground and poses, and the factor of M̂.
    pub(super) fn sand(
        &mut self,
    ) -> Option<(&mut SandContact<f64>, SandScene<'_, f64>, &Factor<f64>)> {
        (self.parts).sand(self.model, self.terrain.soft(), self.ruts)
    }

    /// Rows of contacts at the end pose, and of touches at that of the middle, as
    /// [`Contacting::assemble`] builds them. W stays what it was.
    pub(super) fn assemble_rows(&mut self, contacts: &[Contact], touches: &[Contact], v: &[f64]) {
        let parts = &mut *self.parts;
        let placed = [
            (&parts.kinematics_end, contacts),
            (&parts.kinematics, touches),
        ];
        (parts.system).assemble_rows(self.model, &parts.factor, &placed, v);
        parts.note_friction(contacts);
        if let Some(loops) = &mut parts.loops {
            loops.project_contacts(self.model, &mut parts.system);
        }
    }

    /// Adds what is implicit to the mass matrix and factors it; whether it is positive.
    fn factor_implicit(&mut self, options: &StepOptions) -> bool {
        let (mechanism, parts) = (self.model.mechanism(), &mut *self.parts);
        let mass_matrix = &mut parts.mass_matrix;
        let add = |k, a| mass_matrix.add_to_diagonal(mechanism, k, a);
        (parts.drives).add_implicit(mechanism, step(options), add);
        if let Some(sand) = &mut parts.sand {
            sand.add_to_mass(mechanism, mass_matrix);
        }
        mass_matrix.factorise(mechanism, &mut parts.factor)
    }

    /// Begins the loops of the step, with the factor of M̂.
    fn begin_loops(&mut self) {
        let TreeScratch {
            loops,
            kinematics,
            joints_middle,
            factor,
            ..
        } = &mut *self.parts;
        if let Some(loops) = loops {
            let placed = placed(self.model, kinematics, joints_middle);
            loops.begin(&placed, factor, 0);
        }
    }

    /// Adds the impulse of the drives and of the sand to `y`, for a step that ends with the iterate
    /// `v_end`.
    #[inline]
    fn add_actuation(
        &self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_end: &[f64],
        y: &mut [f64],
    ) {
        let (mechanism, places) = (self.model.mechanism(), &start.configuration.joints);
        let velocities = [start.v, v_end];
        (self.parts.drives).add_impulse(mechanism, step(options), places, velocities, y);
        self.parts.add_sand(options.time_step, v_end, y, false);
        for (y, force) in y.iter_mut().zip(&self.parts.applied) {
            *y += options.time_step * force;
        }
    }

    /// `y = h (τ − b)` with the bias b at a velocity, and the forces of joints and sand at the
    /// start of the step. `v_bias`: `None` for the bias at rest, gravity's.
    #[inline]
    fn load_with_bias(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_bias: Option<&[f64]>,
        y: &mut [f64],
    ) {
        let parts = &mut *self.parts;
        let v_bias = v_bias.unwrap_or_else(|| {
            y.fill(0.0);
            y
        });
        bias(
            self.model.mechanism(),
            self.model.inertias(),
            parts.kinematics.poses(),
            v_bias,
            options.gravity.into(),
            &mut parts.bias_scratch,
            &mut parts.force,
        );
        for (y, f) in y.iter_mut().zip(&parts.force) {
            *y = -options.time_step * f;
        }
        self.add_actuation(options, start, start.v, y);
    }
}

impl Dynamics for TreeSystem<'_> {
    type T = f64;
    type Configuration = Configuration;

    #[inline]
    fn nv(&self) -> usize {
        self.model.nv()
    }

    #[inline]
    fn n_clusters(&self) -> usize {
        self.model.mechanism().n_clusters()
    }

    #[inline]
    fn cluster_of_velocity(&self, k: usize) -> usize {
        self.model.mechanism().cluster_of_velocity(k)
    }

    #[inline]
    fn is_held(&self, cluster: usize) -> bool {
        self.model.mechanism().is_held(cluster)
    }

    fn take(&self, lanes: impl Fn(usize) -> bool, from: &Configuration, to: &mut Configuration) {
        if self.n_clusters() > 1 {
            to.take_clusters(self.model, from, &lanes);
        } else if lanes(0) {
            to.clone_from(from);
        }
    }

    #[inline]
    fn advance(&self, q: &mut Configuration, v: &[f64], h: f64) {
        q.advance(self.model, v, h);
    }

    #[inline]
    fn is_finite(&self, q: &Configuration) -> bool {
        q.is_finite()
    }

    #[inline]
    fn normalise(&self, q: &mut Configuration) {
        q.normalise();
    }

    #[inline]
    fn place_middle(&mut self, q: &Configuration) {
        self.parts.place_middle(self.model, q);
    }

    #[inline]
    fn place_end(&mut self, q: &Configuration) {
        self.parts.place_end(self.model, q);
    }

    #[inline]
    fn update_mass_matrix(&mut self, options: &StepOptions, _: bool, _: bool) {
        self.parts.apply(self.model, &self.command.wrenches);
        if let Some((sand, scene, _)) = self.sand() {
            sand.linearise(&scene, true, step(options), options.gravity.into());
        }
        let (mechanism, parts) = (self.model.mechanism(), &mut *self.parts);
        let mass_matrix = &mut parts.mass_matrix;
        mass_matrix.update(mechanism, self.model.inertias(), parts.kinematics.poses());
        let inertia = |k| mass_matrix.diagonal(mechanism, k);
        (parts.drives).set_theta(mechanism, step(options), inertia);
    }

    #[inline]
    fn factorise(&mut self, options: &StepOptions) -> bool {
        if self.factor_implicit(options) {
            self.begin_loops();
            return true;
        }
        // Tangents of sand whose sizes differ too much leave no factor.
        let parts = &mut *self.parts;
        let Some(sand) = &mut parts.sand else {
            return false;
        };
        sand.drop_tangents();
        let (mechanism, inertias) = (self.model.mechanism(), self.model.inertias());
        (parts.mass_matrix).update(mechanism, inertias, parts.kinematics.poses());
        let is_positive = self.factor_implicit(options);
        self.begin_loops();
        is_positive
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        (self.parts.mass_matrix).times(self.model.mechanism(), v, out);
    }

    #[inline]
    fn turning(
        &mut self,
        options: &StepOptions,
        v: &[f64],
        is_gyroscopic: &mut [bool],
    ) -> Option<f64> {
        let mut most = 0.0_f64;
        for (cluster, own) in is_gyroscopic.iter_mut().enumerate() {
            let turning = Turning::of_cluster(0.0, self.model.mechanism(), v, cluster);
            *own = turning.is_gyroscopic(options.time_step);
            most = most.max(turning.of_frames());
        }
        Some(most)
    }

    fn translation_axis(&self, velocity: usize) -> Option<usize> {
        let mut trees = self.model.trees().iter();
        let tree = trees.find(|tree| tree.velocities.contains(&velocity))?;
        let axis = velocity - tree.velocities.start;
        (tree.is_free && axis < 3).then_some(axis)
    }

    fn conserves_momenta(&self) -> bool {
        self.model.is_free_tree() && self.model.loops().is_empty()
    }

    fn is_audited(&self) -> bool {
        !self.parts.has_given_sand()
    }

    fn energies(
        &mut self,
        options: &StepOptions,
        q: &Configuration,
        v: &[f64],
        mut each: impl FnMut(usize, [f64; 2], Vec3<f64>),
    ) {
        let TreeScratch {
            q: lane,
            energy: scratch,
            ..
        } = &mut *self.parts;
        lane.set_lane(0, q);
        let (mechanism, inertias) = (self.model.mechanism(), self.model.inertias());
        let gravity = options.gravity.into();
        let found = energies(mechanism, inertias, lane, v, gravity, scratch);
        for (cluster, own) in found.iter().enumerate() {
            each(cluster, own.energy.kinetic_and_potential(), own.momentum);
        }
    }

    #[inline]
    fn mass(&self, cluster: usize) -> Option<f64> {
        let model = self.model;
        Some(model.inertias().mass_of(model.mechanism(), cluster))
    }

    #[inline]
    fn half_solve(&self, y: &mut [f64]) {
        self.parts.factor.half_solve(self.model.mechanism(), y);
    }

    #[inline]
    fn half_solve_back(&self, y: &mut [f64]) {
        (self.parts.factor).half_solve_back(self.model.mechanism(), y);
    }

    #[inline]
    fn close_velocity(&mut self, options: &StepOptions, v_begin: &[f64], v: &[f64], y: &mut [f64]) {
        if let Some(loops) = &mut self.parts.loops {
            loops.close(options.theta, v_begin, v, y);
        }
    }

    fn add_loop_impulse(&mut self, out: &mut [f64]) {
        if let Some(loops) = &mut self.parts.loops {
            loops.add_generalized_impulse(&std::iter::empty(), out);
        }
    }

    #[inline]
    fn close_end(
        &mut self,
        lanes: bool,
        p: &[f64],
        q: &mut Configuration,
        v: &mut [f64],
    ) -> Option<f64> {
        let TreeScratch {
            loops,
            factor,
            q: lane,
            ..
        } = &mut *self.parts;
        let loops = loops.as_mut().filter(|_| lanes)?;
        lane.set_lane(0, q);
        let gap = loops.end(self.model, factor, p, lane, v);
        lane.to_lane(0, q);
        Some(gap)
    }

    fn tolerated(&self, options: &StepOptions, cluster: usize) -> f64 {
        let stated = options.penetration_tolerance;
        tolerated(stated, self.model.mechanism(), cluster)
    }

    fn displacement(&self, y: &[f64], cluster: usize) -> f64 {
        displacement(0.0, self.model.mechanism(), y, cluster)
    }
}

impl Forces for TreeSystem<'_> {
    #[inline]
    fn load(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        self.load_with_bias(options, start, Some(v_mean), y);
    }

    fn add_given(&self, options: &StepOptions, impulse: &mut [f64]) {
        // Given forces are the same at any velocity.
        (self.parts).add_sand(options.time_step, &self.parts.force, impulse, true);
    }

    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_mean: &[f64],
        impulse: &[f64],
        y: &mut [f64],
    ) {
        self.load_with_bias(options, start, None, y);
        let (parts, model) = (&mut *self.parts, self.model);
        let of = Turned {
            mechanism: model.mechanism(),
            inertias: model.inertias(),
            poses: parts.kinematics.poses(),
            mass_matrix: &parts.mass_matrix,
        };
        let velocities = [start.v, v_mean];
        (parts.gyroscopic).solve(&of, step(options), velocities, impulse, y);
    }

    #[inline]
    fn choose_branches(&mut self, v: &[f64]) {
        let drives = &mut self.parts.drives;
        drives.set_lane(0, self.model.joints(), self.command);
        drives.finish_loading();
        drives.choose_branches(self.model.mechanism(), v);
        if let Some(sand) = &mut self.parts.sand {
            sand.start_from(v);
        }
    }

    fn most_revisions(&self, _: usize) -> usize {
        if self.parts.sand.is_some() {
            MOST_REVISIONS_IN_SAND
        } else {
            MOST_REVISIONS
        }
    }

    fn unsettled(&mut self, lanes: bool, v_end: &[f64]) -> bool {
        let tried = self.parts.sand.clone();
        let is_new = (self.sand())
            .is_some_and(|(sand, scene, factor)| sand.revise(&scene, true, factor, v_end));
        self.parts.sand = tried;
        is_new && lanes
    }

    fn revise(&mut self, _: bool, v: &[f64], v_end: &[f64]) -> bool {
        let mechanism = self.model.mechanism();
        let is_new = (self.parts.drives).revise(mechanism, true, v, v_end);
        let is_new_in_sand = (self.sand())
            .is_some_and(|(sand, scene, factor)| sand.revise(&scene, true, factor, v_end));
        is_new | is_new_in_sand
    }

    fn work(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_end: &[f64],
        out: &mut [Work],
    ) {
        let (mechanism, places) = (self.model.mechanism(), &start.configuration.joints);
        let velocities = [start.v, v_end];
        (self.parts.drives).work(mechanism, step(options), places, velocities, out);
        let mut of_sand = std::mem::take(&mut self.parts.of_sand);
        of_sand.clear();
        of_sand.resize(out.len(), 0.0);
        if let Some((sand, scene, _)) = self.sand() {
            sand.work(mechanism, &scene.layers, velocities, &mut of_sand);
        }
        for (cluster, (work, of_sand)) in out.iter_mut().zip(&of_sand).enumerate() {
            let own = 0..self.parts.applied.len();
            let own = own.filter(|&k| mechanism.cluster_of_velocity(k) == cluster);
            let power = own.map(|k| {
                let mean = options.theta * v_end[k] + (1.0 - options.theta) * start.v[k];
                self.parts.applied[k] * mean
            });
            work.supplied += options.time_step * power.sum::<f64>();
            work.damped -= *of_sand;
        }
        self.parts.of_sand = of_sand;
    }

    fn stored(&self, q: &Configuration, out: &mut [f64]) {
        let mechanism = self.model.mechanism();
        (self.parts.drives).stored(mechanism, 0.0, &q.joints, out);
    }

    fn work_of_displacement(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_end: &[f64],
        displacement: &[f64],
    ) -> Option<f64> {
        let (mechanism, places) = (self.model.mechanism(), &start.configuration.joints);
        let motion = [start.v, v_end, displacement];
        let applied = self.parts.applied.iter().zip(displacement);
        let of_wrenches = applied.map(|(force, way)| force * way).sum::<f64>();
        let drives = &self.parts.drives;
        let of_drives = drives.work_of_displacement(mechanism, step(options), places, motion);
        Some(of_wrenches + of_drives)
    }

    #[inline]
    fn accept(&mut self, lanes: bool) {
        if !lanes {
            return;
        }
        let parts = &mut *self.parts;
        parts.drives.accept_part();
        if let Some(sand) = &mut parts.sand {
            sand.accept(true);
        }
    }

    fn begin_balance(&mut self, start: Start<'_, Configuration>) {
        let parts = &mut *self.parts;
        (parts.kinematics).update_for_step(self.model, start.configuration);
        (parts.balance).begin(self.model, &parts.kinematics, start.v);
    }

    /// In momentum form, exact at both ends; see [`crate::integrator::moreau_jean_newton`].
    fn balance(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_end: &[f64],
        _v_mean: &[f64],
        _scratch: &mut [f64],
        y: &mut [f64],
    ) {
        let parts = &mut *self.parts;
        let scene = BalanceScene {
            model: self.model,
            kinematics: [&parts.kinematics, &parts.kinematics_end],
            gravity: &options.gravity,
            h: options.time_step,
            theta: options.theta,
        };
        parts.balance.residual(&scene, start, v_end, y);
        self.add_actuation(options, start, v_end, y);
    }
}

impl Contacting for TreeSystem<'_> {
    const DIMENSION: Dimension = Dimension::Three;

    type Contact = Contact;

    fn clusters_of(&self, key: &ContactKey) -> [usize; 2] {
        clusters_of(self.model, key)
    }

    #[inline]
    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<Contact>) {
        self.parts.unknown_ground = detect(
            self.model,
            &self.parts.kinematics,
            &self.parts.kinematics_end,
            self.terrain,
            v,
            &activation,
            out,
        );
        for contact in out.iter_mut() {
            turn_to_rollers(self.model, contact);
        }
        let TreeScratch {
            kinematics,
            pairs,
            joints_middle,
            ..
        } = &mut *self.parts;
        detect_pairs(self.model, kinematics, v, &activation, pairs, out);
        detect_limits(self.model, kinematics, joints_middle, v, &activation, out);
        list_friction(self.model, kinematics, out);
    }

    fn unknown_ground(&self) -> Option<[f64; 2]> {
        self.parts.unknown_ground
    }

    #[inline]
    fn relocate(&mut self, contacts: &mut [Contact]) {
        let parts = &*self.parts;
        for contact in contacts {
            if contact.key.opposite == Opposite::Stop {
                relocate_limit(
                    self.model,
                    &parts.kinematics_end,
                    &parts.joints_end,
                    contact,
                );
            } else {
                relocate(self.model, &parts.kinematics_end, self.terrain, contact);
            }
        }
    }

    #[inline]
    fn friction_coefficient(&self, options: &StepOptions, contact: &Contact) -> f64 {
        match contact.key.opposite {
            Opposite::Stop if joint_friction::joint_of(contact).is_some() => 1.0,
            Opposite::Stop => 0.0,
            Opposite::Ground(_) | Opposite::Part(_) | Opposite::Grain(_) => {
                let of_pair = self.between_materials(options, contact);
                of_pair.map_or(options.friction_coefficient, |[mu, _]| mu)
            }
        }
    }

    #[inline]
    fn normal_shift(&self, options: &StepOptions, contact: &Contact, u_N_before: f64) -> f64 {
        if let Some(joint) = joint_friction::joint_of(contact) {
            let most = options.time_step * self.model.joints()[joint].passive.friction;
            return -most * self.parts.friction_entry(joint);
        }
        let of_pair = self.between_materials(options, contact);
        rebound(of_pair.map_or(options.restitution, |[_, e]| e), u_N_before)
    }

    #[inline]
    fn yields(&self) -> bool {
        self.model.has_compliance()
    }

    fn compliance(&self, contact: &Contact, v: &[f64]) -> Option<Compliance> {
        let (model, poses) = (self.model, self.parts.kinematics.poses());
        let of = |part: Part| {
            let (tread, wheel) = part.tread(model)?;
            let n = contact.frame.n.into();
            Some(tread.rolling(poses.rolling(model.mechanism(), wheel, n, |k| v[k])))
        };
        Compliance::in_series(of(contact.part), contact.other.and_then(|own| of(own.part)))
    }

    fn soften(&mut self, diagonal: impl Iterator<Item = [f64; 3]>) {
        self.parts.system.soften(diagonal);
    }

    #[inline]
    fn assemble(&mut self, contacts: &[Contact], v: &[f64], u: &mut [f64]) {
        self.assemble_rows(contacts, &[], v);
        self.parts.system.multiply(self.model);
        u.copy_from_slice(&self.parts.system.u);
    }

    #[inline]
    fn is_immovable(&self, contact: usize) -> bool {
        self.parts.system.is_immovable(contact)
    }

    #[inline]
    fn local(&self, y: &[f64], out: &mut [f64]) {
        self.parts.system.local(self.model, y, out);
    }

    #[inline]
    fn add_local_of_velocity(&self, contacts: &[Contact], v: &[f64], out: &mut [f64]) {
        self.parts.system.add_local_of_velocity(
            self.model,
            &self.parts.kinematics_end,
            (0, contacts),
            v,
            out,
        );
    }

    #[inline]
    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        self.parts.system.add_impulses(self.model, p, y);
        if let Some(loops) = &self.parts.loops {
            loops.answer(&each(p), y);
        }
    }

    #[inline]
    fn generalized_impulse(&self, contacts: &[Contact], p: &[f64], out: &mut [f64]) {
        generalized_impulse(self.model, &self.parts.kinematics_end, contacts, p, out);
    }

    #[inline]
    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled(Dimension::Three, &self.parts.system.W, q, mu)
    }

    fn open_problem<'a>(
        &'a self,
        q: &'a [f64],
        mu: &'a [f64],
    ) -> Option<FrictionContactProblem<'a>> {
        Some(self.problem(q, mu))
    }

    fn lever(&self, contact: &Contact) -> f64 {
        match contact.part {
            Part::Limit(joint, _) => self.model.mechanism().joints[joint].arm,
            _ => 1.0,
        }
    }
}

/// h and θ.
#[inline]
fn step(options: &StepOptions) -> (f64, f64) {
    (options.time_step, options.theta)
}
