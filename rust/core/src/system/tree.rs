//! A multibody tree on a terrain as a mechanical system: a rover whose step is taken with all
//! effort, or among grains.
//!
//! What moves is `super::tree_lanes`, in the only lane of `f64`; its contacts are a list.

use std::sync::Arc;

use super::command::Command;
use super::momentum_balance::BalanceScene;
use super::tree_lanes::TreeLanes;
use super::tree_scratch::TreeScratch;
use crate::contact::body_motion::Still;
use crate::contact::detection::{MovingMachine, detect_parts};
use crate::contact::loops::each;
use crate::contact::pair_detection::detect_pairs_of;
use crate::contact::relocation::relocate_to;
use crate::contact::rollers::turn_to_rollers;
use crate::contact::{
    Activation, Contact, ContactKey, Opposite, Part, clusters_of, detect_limits,
    generalized_impulse, joint_friction, list_friction, relocate_limit,
};
use crate::geometry::Terrain;
use crate::integrator::{Dynamics, MechanicalSystem, StepOptions, StepStart, UnilateralContact};
use crate::law::compliance::Compliance;
use crate::law::newton_impact::rebound;
use crate::multibody::{LaneConfiguration, Model};
use crate::problem::{Dimension, FrictionContactProblem};
use crate::sand::SandState;
use crate::scalar::Single;

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

    /// Newton's e of a contact, 0 of dry friction.
    pub(super) fn restitution(&self, options: &StepOptions, contact: &Contact) -> f64 {
        if joint_friction::joint_of(contact).is_some() {
            return 0.0;
        }
        let of_pair = self.between_materials(options, contact);
        of_pair.map_or(options.restitution, |[_, e]| e)
    }

    /// Rows of contacts at the end of the step, and of touches at its middle, as
    /// [`MechanicalSystem::assemble`] builds them. W stays what it was.
    pub(super) fn assemble_rows(&mut self, contacts: &[Contact], touches: &[Contact], v: &[f64]) {
        let mechanism = self.model.mechanism();
        let TreeScratch { tree, system, .. } = &mut *self.parts;
        let placed = [
            (Still::new(mechanism, &tree.poses_end, v), contacts),
            (Still::new(mechanism, &tree.poses_middle, v), touches),
        ];
        system.assemble(self.model, &tree.factor, &placed);
        if let Some(loops) = &mut tree.loops {
            loops.project_contacts(self.model, system);
        }
        self.parts.note_friction(contacts);
    }
}

/// A start of a step.
type At<'a> = StepStart<'a, LaneConfiguration<f64>>;

impl MechanicalSystem for TreeSystem<'_> {
    type Machine = TreeLanes<f64>;

    fn machine(&self) -> &TreeLanes<f64> {
        &self.parts.tree
    }

    fn machine_mut(&mut self) -> &mut TreeLanes<f64> {
        &mut self.parts.tree
    }

    const DIMENSION: Dimension = Dimension::Three;

    const SETTLES: bool = true;

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
        let machine = MovingMachine {
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
                relocate_limit(model, &end, &self.parts.tree.joints_end, contact);
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
        rebound(self.restitution(options, contact), u_N_before)
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
            loops.answer(&each(Single::best(), p), y);
        }
    }

    fn generalized_impulse(&self, contacts: &[Contact], p: &[f64], out: &mut [f64]) {
        generalized_impulse(self.model, &self.parts.tree.poses_end, contacts, p, out);
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled(Dimension::Three, &self.parts.system.W, q, mu)
    }

    fn begin_residual(&mut self, start: At<'_>) {
        let TreeScratch { tree, balance, .. } = &mut *self.parts;
        tree.place_middle(start.configuration);
        balance.begin(self.model, &tree.poses_middle, start.v);
    }

    /// In momentum form, exact at both ends; see [`crate::integrator::moreau_jean_newton`].
    fn residual(
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

    fn lever(&self, contact: &Contact) -> f64 {
        match contact.part {
            Part::Limit(joint, _) => self.model.mechanism().joints[joint].arm,
            _ => 1.0,
        }
    }
}
