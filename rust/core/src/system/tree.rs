//! A multibody tree on a terrain as a mechanical system: a rover whose step is taken with all
//! effort, or among grains.
//!
//! What moves is [`super::tree_lanes`], in the only lane of `f64`; its contacts are a list.

use std::sync::Arc;

use super::command::Command;
use super::momentum_balance::BalanceScene;
use super::tree_scratch::TreeScratch;
use crate::contact::body_motion::Still;
use crate::contact::detection::{Moving, detect_parts};
use crate::contact::loops::each;
use crate::contact::pair_detection::detect_pairs_of;
use crate::contact::relocation::relocate_to;
use crate::contact::rollers::turn_to_rollers;
use crate::contact::{
    Activation, Contact, ContactKey, Opposite, Part, clusters_of, detect_limits,
    generalized_impulse, joint_friction, list_friction, relocate_limit,
};
use crate::geometry::Terrain;
use crate::integrator::{
    Contacting, Dynamics, Forces, Start, StepOptions, UnilateralContact, Work,
};
use crate::law::compliance::Compliance;
use crate::law::newton_impact::rebound;
use crate::multibody::{LaneConfiguration, Model};
use crate::problem::{Dimension, FrictionContactProblem};
use crate::sand::SandState;
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

/// A model on a terrain under a command, in a step.
pub struct TreeSystem<'a> {
    /// The machine.
    pub model: &'a Arc<Model>,
    /// The ground.
    pub terrain: &'a Arc<dyn Terrain>,
    /// What the sand under the machine remembers, but for its ruts: they are with the system.
    sand: Option<&'a mut SandState>,
    /// Scratch of the system.
    pub parts: &'a mut TreeScratch,
}

/// What a [`TreeSystem`] is made of.
pub(crate) struct TreeScene<'a> {
    pub model: &'a Arc<Model>,
    pub terrain: &'a Arc<dyn Terrain>,
    pub command: &'a Command,
    /// m/s².
    pub gravity: [f64; 3],
    /// Work of each drive since the call began (n_joints), J.
    pub drive_work: &'a [f64],
    pub sand: Option<&'a mut SandState>,
}

impl Drop for TreeSystem<'_> {
    /// Gives the ruts back.
    fn drop(&mut self) {
        self.parts.tree.return_ruts(0, self.sand.as_deref_mut());
    }
}

impl<'a> TreeSystem<'a> {
    /// The system at the start of a step.
    pub(crate) fn new(scene: TreeScene<'a>, parts: &'a mut TreeScratch) -> Self {
        let TreeScene { model, terrain, .. } = scene;
        let mut sand = scene.sand;
        let tree = &mut parts.tree;
        tree.load_tree(
            0,
            (model, terrain),
            scene.gravity,
            scene.command,
            scene.drive_work,
            sand.as_deref_mut(),
        );
        tree.drives.finish_loading();
        tree.drives.begin_step();
        tree.is_audited = !tree
            .sand()
            .is_some_and(|sand| sand.lanes() && sand.is_given());
        Self {
            model,
            terrain,
            sand,
            parts,
        }
    }

    /// The machine at the middle of the step, with a velocity (nv).
    pub(super) fn middle<'v>(&'v self, v: &'v [f64]) -> Still<'v> {
        Still::new(self.model.mechanism(), &self.parts.tree.poses_middle, v)
    }

    /// The machine at the predicted end of the step, with a velocity (nv).
    pub(super) fn end<'v>(&'v self, v: &'v [f64]) -> Still<'v> {
        Still::new(self.model.mechanism(), &self.parts.tree.poses_end, v)
    }

    /// μ and e of a contact whose two materials have a law of their own.
    #[inline]
    fn between_materials(&self, options: &StepOptions, contact: &Contact) -> Option<[f64; 2]> {
        if options.materials.is_empty() {
            return None;
        }
        contact.between_materials(self.model, &**self.terrain, &options.materials)
    }

    /// Rows of contacts at the end of the step, and of touches at its middle, as
    /// [`Contacting::assemble`] builds them. W stays what it was.
    pub(super) fn assemble_rows(&mut self, contacts: &[Contact], touches: &[Contact], v: &[f64]) {
        let mechanism = self.model.mechanism();
        let TreeScratch { tree, system, .. } = &mut *self.parts;
        let placed = [
            (Still::new(mechanism, &tree.poses_end, v), contacts),
            (Still::new(mechanism, &tree.poses_middle, v), touches),
        ];
        system.assemble(self.model, &tree.factor, &placed);
        if let Some(loops) = &mut tree.loops {
            loops.project_contacts(system);
        }
        self.parts.note_friction(contacts);
    }
}

impl Dynamics for TreeSystem<'_> {
    type T = f64;
    type Configuration = LaneConfiguration<f64>;

    fn nv(&self) -> usize {
        self.model.nv()
    }

    fn n_clusters(&self) -> usize {
        self.parts.tree.n_clusters()
    }

    fn cluster_of_velocity(&self, k: usize) -> usize {
        self.parts.tree.cluster_of_velocity(k)
    }

    fn is_held(&self, cluster: usize) -> bool {
        self.parts.tree.is_held(cluster)
    }

    fn take(
        &self,
        lanes: impl Fn(usize) -> bool,
        from: &LaneConfiguration<f64>,
        to: &mut LaneConfiguration<f64>,
    ) {
        self.parts.tree.take(lanes, from, to);
    }

    fn set_moved(
        &self,
        from: &LaneConfiguration<f64>,
        v: &[f64],
        h: f64,
        to: &mut LaneConfiguration<f64>,
    ) {
        self.parts.tree.set_moved(from, v, h, to);
    }

    fn advance(&self, q: &mut LaneConfiguration<f64>, v: &[f64], h: f64) {
        self.parts.tree.advance(q, v, h);
    }

    fn is_finite(&self, q: &LaneConfiguration<f64>) -> bool {
        q.is_finite()
    }

    fn normalise(&self, q: &mut LaneConfiguration<f64>) {
        q.normalise();
    }

    fn place_middle(&mut self, q: &LaneConfiguration<f64>) {
        self.parts.tree.place_middle(q);
    }

    fn place_end(&mut self, q: &LaneConfiguration<f64>) {
        self.parts.tree.place_end(q);
        self.parts.joints_end.clone_from(&q.joints);
    }

    fn update_mass_matrix(&mut self, options: &StepOptions, going: bool, is_first: bool) {
        self.parts.tree.update_mass_matrix(options, going, is_first);
    }

    fn factorise(&mut self, options: &StepOptions) -> bool {
        let tree = &mut self.parts.tree;
        tree.factorise(options)
            || tree.drop_tangents() && {
                tree.update_mass_matrix(options, true, false);
                tree.factorise(options)
            }
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        self.parts.tree.multiply_mass(v, out);
    }

    fn turning(
        &mut self,
        options: &StepOptions,
        v: &[f64],
        is_gyroscopic: &mut [bool],
    ) -> Option<f64> {
        self.parts.tree.turning(options, v, is_gyroscopic)
    }

    fn translation_axis(&self, velocity: usize) -> Option<usize> {
        self.parts.tree.translation_axis(velocity)
    }

    fn conserves_momenta(&self) -> bool {
        self.model.is_free_tree() && self.model.loops().is_empty()
    }

    fn is_audited(&self) -> bool {
        self.parts.tree.is_audited
    }

    fn energies(
        &mut self,
        options: &StepOptions,
        q: &LaneConfiguration<f64>,
        v: &[f64],
        each: impl FnMut(usize, [f64; 2], Vec3<f64>),
    ) {
        self.parts.tree.energies(options, q, v, each);
    }

    fn mass(&self, cluster: usize) -> Option<f64> {
        self.parts.tree.mass(cluster)
    }

    fn half_solve(&self, y: &mut [f64]) {
        self.parts.tree.half_solve(y);
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        self.parts.tree.half_solve_back(y);
    }

    fn close_velocity(&mut self, options: &StepOptions, v_begin: &[f64], v: &[f64], y: &mut [f64]) {
        self.parts.tree.close_velocity(options, v_begin, v, y);
    }

    fn add_loop_impulse(&mut self, out: &mut [f64]) {
        self.parts.tree.add_loop_impulse(out);
    }

    fn close_end(
        &mut self,
        lanes: bool,
        p: &[f64],
        q: &mut LaneConfiguration<f64>,
        v: &mut [f64],
    ) -> Option<f64> {
        if let Some(loops) = &mut self.parts.tree.loops {
            loops.find_impulses(&each(p));
        }
        self.parts.tree.close_end(lanes, p, q, v)
    }

    fn tolerated(&self, options: &StepOptions, cluster: usize) -> f64 {
        self.parts.tree.tolerated(options, cluster)
    }

    fn displacement(&self, y: &[f64], cluster: usize) -> f64 {
        self.parts.tree.displacement(y, cluster)
    }
}

/// A start of a step.
type At<'a> = Start<'a, LaneConfiguration<f64>>;

impl Forces for TreeSystem<'_> {
    fn begin_load(&mut self, options: &StepOptions, start: At<'_>) {
        self.parts.tree.begin_load(options, start);
    }

    fn load(&mut self, options: &StepOptions, start: At<'_>, v_mean: &[f64], y: &mut [f64]) {
        self.parts.tree.load(options, start, v_mean, y);
    }

    fn add_given(&self, options: &StepOptions, impulse: &mut [f64]) {
        self.parts.tree.add_given(options, impulse);
    }

    fn begin_gyroscopic(&mut self, options: &StepOptions, scratch: &mut [f64]) {
        self.parts.tree.begin_gyroscopic(options, scratch);
    }

    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: At<'_>,
        v_mean: &[f64],
        impulse: &[f64],
        y: &mut [f64],
    ) {
        let tree = &mut self.parts.tree;
        tree.load_gyroscopic(options, start, v_mean, impulse, y);
    }

    fn choose_branches(&mut self, v: &[f64]) {
        self.parts.tree.choose_branches(v);
    }

    fn may_revise(&self) -> bool {
        self.parts.tree.may_revise()
    }

    fn most_revisions(&self, lane: usize) -> usize {
        self.parts.tree.most_revisions(lane)
    }

    fn unsettled(&mut self, lanes: bool, v_end: &[f64]) -> bool {
        self.parts.tree.unsettled(lanes, v_end)
    }

    fn revise(&mut self, lanes: bool, v: &[f64], v_end: &[f64]) -> bool {
        self.parts.tree.revise(lanes, v, v_end)
    }

    fn work(&mut self, options: &StepOptions, start: At<'_>, v_end: &[f64], out: &mut [Work]) {
        self.parts.tree.work(options, start, v_end, out);
    }

    fn stored(&self, q: &LaneConfiguration<f64>, out: &mut [f64]) {
        self.parts.tree.stored(q, out);
    }

    fn work_of_displacement(
        &mut self,
        options: &StepOptions,
        start: At<'_>,
        v_end: &[f64],
        displacement: &[f64],
    ) -> Option<f64> {
        let tree = &mut self.parts.tree;
        tree.work_of_displacement(options, start, v_end, displacement)
    }

    fn accept(&mut self, lanes: bool) {
        if lanes {
            self.parts.tree.accept_part();
        }
    }

    fn begin_balance(&mut self, start: At<'_>) {
        let TreeScratch { tree, balance, .. } = &mut *self.parts;
        tree.place_middle(start.configuration);
        balance.begin(self.model, &tree.poses_middle, start.v);
    }

    /// In momentum form, exact at both ends; see [`crate::integrator::moreau_jean_newton`].
    fn balance(
        &mut self,
        options: &StepOptions,
        start: At<'_>,
        v_end: &[f64],
        _v_mean: &[f64],
        _scratch: &mut [f64],
        y: &mut [f64],
    ) {
        let TreeScratch { tree, balance, .. } = &mut *self.parts;
        let scene = BalanceScene {
            model: self.model,
            poses: [&tree.poses_middle, &tree.poses_end],
            gravity: &options.gravity,
            h: options.time_step,
            theta: options.theta,
        };
        balance.residual(&scene, start, v_end, y);
        tree.actuate(options, start, v_end, y);
    }
}

impl Contacting for TreeSystem<'_> {
    const DIMENSION: Dimension = Dimension::Three;

    type Contact = Contact;

    fn clusters_of(&self, key: &ContactKey) -> [usize; 2] {
        clusters_of(self.model, key)
    }

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<Contact>) {
        let model = &**self.model;
        let TreeScratch {
            tree,
            pairs,
            unknown_ground,
            ..
        } = &mut *self.parts;
        let at = |poses| Still::new(model.mechanism(), poses, v);
        let (middle, end) = (at(&tree.poses_middle), at(&tree.poses_end));
        let machine = Moving {
            model,
            middle: &middle,
            end: &end,
        };
        out.clear();
        let parts = Part::all(model);
        *unknown_ground = detect_parts(parts, &machine, &**self.terrain, &activation, out);
        for contact in out.iter_mut() {
            turn_to_rollers(model, contact);
        }
        detect_pairs_of(model, &middle, &activation, pairs, out);
        detect_limits(model, &middle, &tree.joints_middle, &activation, out);
        list_friction(model, &middle, out);
    }

    fn unknown_ground(&self) -> Option<[f64; 2]> {
        self.parts.unknown_ground
    }

    fn relocate(&mut self, contacts: &mut [Contact]) {
        let (model, end) = (&**self.model, self.end(&[]));
        for contact in contacts {
            if contact.key.opposite == Opposite::Stop {
                relocate_limit(model, &end, &self.parts.joints_end, contact);
            } else {
                relocate_to(model, &end, &**self.terrain, contact);
            }
        }
    }

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

    fn normal_shift(&self, options: &StepOptions, contact: &Contact, u_N_before: f64) -> f64 {
        if let Some(joint) = joint_friction::joint_of(contact) {
            let most = options.time_step * self.model.joints()[joint].passive.friction;
            return -most * self.parts.friction_entry(joint);
        }
        let of_pair = self.between_materials(options, contact);
        rebound(of_pair.map_or(options.restitution, |[_, e]| e), u_N_before)
    }

    fn yields(&self) -> bool {
        self.model.has_compliance()
    }

    fn compliance(&self, contact: &Contact, v: &[f64]) -> Option<Compliance> {
        let (model, poses) = (&**self.model, &self.parts.tree.poses_middle);
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

    fn assemble(&mut self, contacts: &[Contact], v: &[f64], u: &mut [f64]) {
        self.assemble_rows(contacts, &[], v);
        self.parts.system.multiply(self.model);
        u.copy_from_slice(&self.parts.system.u);
    }

    fn is_immovable(&self, contact: usize) -> bool {
        self.parts.system.is_immovable(contact)
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        self.parts.system.local(self.model, y, out);
    }

    fn add_local_of_velocity(&self, contacts: &[Contact], v: &[f64], out: &mut [f64]) {
        let (system, end) = (&self.parts.system, self.end(v));
        system.add_local_of_velocity(self.model, &end, (0, contacts), out);
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        self.parts.system.add_impulses(self.model, p, y);
        if let Some(loops) = &self.parts.tree.loops {
            loops.answer(&each(p), y);
        }
    }

    fn generalized_impulse(&self, contacts: &[Contact], p: &[f64], out: &mut [f64]) {
        generalized_impulse(self.model, &self.parts.tree.poses_end, contacts, p, out);
    }

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
