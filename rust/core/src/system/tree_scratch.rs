//! Scratch of a tree in a step: poses, matrices, forces and contacts.

use nalgebra::Vector3;

use super::command::{Wrench, add_wrench};
use super::drives::Drives;
use super::gyroscopic::Gyroscopic;
use super::loops::Loops;
use super::momentum_balance::MomentumBalance;
use super::sand::SandContact;
use super::sand_patch::{Layers, SandScene};
use super::sand_wheel::PlacedWheel;
use crate::contact::joint_friction::joint_of;
use crate::contact::{Contact, ContactSystem, PairSearch};
use crate::geometry::SoftLayer;
use crate::multibody::bias::BiasScratch;
use crate::multibody::{
    Configuration, EnergyScratch, Factor, Kinematics, LaneConfiguration, MassMatrix, Model,
};
use crate::sand::{RutMap, SandState};
use crate::scalar::{MAX_LANES, Single, Vec3};

/// Poses, matrices and momenta of a tree: scratch, allocated once.
#[derive(Clone, Debug)]
pub struct TreeScratch {
    pub(super) kinematics: Kinematics,
    pub(super) kinematics_end: Kinematics,
    pub(super) mass_matrix: MassMatrix<f64>,
    pub(super) factor: Factor<f64>,
    pub(super) bias_scratch: BiasScratch<f64>,
    pub(super) balance: MomentumBalance,
    pub(super) drives: Drives<f64>,
    pub(super) q: LaneConfiguration<f64>,
    pub(super) energy: EnergyScratch<f64>,
    pub(super) gyroscopic: Gyroscopic<f64>,
    pub(super) force: Vec<f64>,
    /// Generalized force of the wrenches at the midpoint (nv); empty without any.
    pub(super) applied: Vec<f64>,
    /// Work of the sand by cluster, J.
    pub(super) of_sand: Vec<f64>,
    pub(super) pairs: PairSearch,
    /// Found by the last detection, x and z, m.
    pub(super) unknown_ground: Option<[f64; 2]>,
    /// Joint coordinates at the midpoint and at the end of the step (n_joints); empty if no joint
    /// has a stop and there is no loop.
    pub(super) joints_middle: Vec<f64>,
    pub(super) joints_end: Vec<f64>,
    pub(super) system: ContactSystem,
    /// Joints with dry friction, and W's entry of their normals.
    pub(super) friction: Vec<(usize, f64)>,
    /// Sand under the machine; none on firm ground.
    pub(super) sand: Option<Box<SandContact<f64>>>,
    /// Closed loops of the machine; none if it has none.
    pub(super) loops: Option<Box<Loops<f64>>>,
}

impl TreeScratch {
    /// Scratch for a model with n contacts.
    #[must_use]
    pub fn new(model: &Model, n: usize) -> Self {
        let (token, mechanism) = (Single::best(), model.mechanism());
        let limited = if model.limited_joints().is_empty() && model.loops().is_empty() {
            Vec::new()
        } else {
            vec![0.0; model.n_joints()]
        };
        Self {
            kinematics: Kinematics::new(model),
            kinematics_end: Kinematics::new(model),
            mass_matrix: MassMatrix::new(token, mechanism),
            factor: Factor::new(token, mechanism),
            bias_scratch: BiasScratch::new(token, mechanism),
            balance: MomentumBalance::new(model.bodies().len()),
            drives: Drives::new(token, mechanism),
            q: LaneConfiguration::new(token, mechanism),
            energy: EnergyScratch::new(token, mechanism),
            gyroscopic: Gyroscopic::new(token),
            force: vec![0.0; model.nv()],
            applied: Vec::new(),
            of_sand: Vec::new(),
            pairs: PairSearch::new(model),
            unknown_ground: None,
            joints_middle: limited.clone(),
            joints_end: limited,
            system: ContactSystem::with_capacity(model, n),
            friction: Vec::with_capacity(model.rubbing_joints().len()),
            sand: None,
            loops: Loops::of(model),
        }
    }

    /// Resets the impulses of the drives at the start of a step. `work`: of each drive since the
    /// call began (n_joints), J.
    pub fn begin_step(&mut self, work: &[f64]) {
        self.drives.begin_step();
        self.drives.set_work(0, work);
    }

    /// Takes over the sand at the start of a step; none on firm ground.
    pub(crate) fn begin_sand(
        &mut self,
        model: &Model,
        ground: Option<SoftLayer<'_>>,
        state: Option<&SandState>,
    ) {
        let (Some(ground), Some(state)) = (ground, state) else {
            self.sand = None;
            return;
        };
        let sand = self.sand.get_or_insert_with(|| {
            let wheels = model.wheels().iter().map(PlacedWheel::of);
            Box::new(SandContact::new(Single::best(), model.mechanism(), wheels))
        });
        sand.load(0, Some((ground, state)));
    }

    /// Adds the impulse of the sand over a step of h that ends with the velocity `v`; `is_given`:
    /// only if its forces are given, or only if not.
    pub(super) fn add_sand(&self, h: f64, v: &[f64], y: &mut [f64], is_given: bool) {
        if let Some(sand) = self
            .sand
            .as_ref()
            .filter(|sand| sand.is_given() == is_given)
        {
            sand.add_impulse(h, v, y);
        }
    }

    /// Whether the forces of the sand are given.
    pub(super) fn has_given_sand(&self) -> bool {
        self.sand.as_ref().is_some_and(|sand| sand.is_given())
    }

    /// Writes the sand at the end of a step.
    pub(crate) fn end_sand(
        &mut self,
        ground: Option<SoftLayer<'_>>,
        state: Option<&mut SandState>,
    ) {
        if let (Some(sand), Some(ground), Some(state)) = (&mut self.sand, ground, state) {
            let ruts = std::slice::from_mut(&mut state.ruts);
            sand.note(&alone(ground), true, ruts);
            sand.store(0, state);
        }
    }

    /// Impulses and work of the drives, with those of all accepted parts of the step.
    #[must_use]
    pub fn drives(&self) -> &Drives<f64> {
        &self.drives
    }

    /// Makes a step that was taken elsewhere the last one: the world positions of the trees'
    /// origins where contacts were evaluated, m.
    pub(crate) fn show(&mut self, origins: impl Iterator<Item = [f64; 3]>) {
        for (tree, origin) in origins.enumerate() {
            self.kinematics_end.set_origin(tree, origin.into());
        }
    }

    /// Impulses of the rows of the loops in the last step, N s and N m s; empty without loops.
    #[must_use]
    pub fn loop_impulses(&self) -> &[f64] {
        self.loops.as_ref().map_or(&[], |loops| loops.impulses())
    }

    /// Impulses of the rows of the loops, N s and N m s, to be set by a step that was taken
    /// elsewhere; empty without loops.
    pub(crate) fn loop_impulses_mut(&mut self) -> &mut [f64] {
        self.loops
            .as_mut()
            .map_or(&mut [], |loops| loops.impulses_mut())
    }

    /// Delassus operator of the last step, row-major, 1/kg.
    #[must_use]
    pub fn operator(&self) -> &[f64] {
        &self.system.W
    }

    /// World position of the origin of a body's tree at the pose of the last contact evaluation, m.
    #[must_use]
    pub fn origin_of_contacts(&self, body: usize) -> &Vector3<f64> {
        self.kinematics_end.origin(body)
    }

    /// The sand with its ground and poses, and the factor of M̂.
    pub(super) fn sand<'a>(
        &'a mut self,
        model: &'a Model,
        ground: Option<SoftLayer<'a>>,
        ruts: Option<&'a RutMap>,
    ) -> Option<(
        &'a mut SandContact<f64>,
        SandScene<'a, f64>,
        &'a Factor<f64>,
    )> {
        let Self {
            sand,
            kinematics,
            factor,
            ..
        } = self;
        let scene = SandScene {
            mechanism: model.mechanism(),
            poses: kinematics.poses(),
            layers: alone(ground?),
            ruts: std::slice::from_ref(ruts?),
        };
        Some((sand.as_mut()?, scene, factor))
    }

    /// Computes the generalized force of wrenches at the midpoint.
    pub(super) fn apply(&mut self, model: &Model, wrenches: &[Wrench]) {
        self.applied.clear();
        if wrenches.is_empty() {
            return;
        }
        self.applied.resize(model.nv(), 0.0);
        for wrench in wrenches {
            let body = wrench.body(model);
            let R = self.kinematics.spun(model, body).into();
            let own = wrench.on_body(model).map(|[x, y, z]| Vec3::new(x, y, z));
            let placed = (self.kinematics.poses(), &R);
            add_wrench(model.mechanism(), body, own, placed, &mut self.applied);
        }
    }

    /// Keeps W's entries of the joints with dry friction, once W is assembled.
    pub(super) fn note_friction(&mut self, contacts: &[Contact]) {
        self.friction.clear();
        for (c, contact) in contacts.iter().enumerate() {
            if let Some(joint) = joint_of(contact) {
                self.friction.push((joint, self.system.beyond(c)[0]));
            }
        }
    }

    /// W's entry of the normal of a joint's friction.
    pub(super) fn friction_entry(&self, joint: usize) -> f64 {
        let found = self.friction.iter().find(|(own, _)| *own == joint);
        found.map_or(0.0, |(_, entry)| *entry)
    }

    /// Places the bodies at the midpoint of the step.
    #[inline]
    pub(super) fn place_middle(&mut self, model: &Model, q: &Configuration) {
        self.kinematics.update_for_step(model, q);
        keep(&mut self.joints_middle, &q.joints);
    }

    /// Places the bodies at the end of the step.
    #[inline]
    pub(super) fn place_end(&mut self, model: &Model, q: &Configuration) {
        self.kinematics_end.update_for_step(model, q);
        keep(&mut self.joints_end, &q.joints);
    }
}

/// The ground of the only lane.
fn alone(ground: SoftLayer<'_>) -> Layers<'_> {
    let mut layers = [None; MAX_LANES];
    layers[0] = Some(ground);
    layers
}

/// Copies the joint coordinates; `kept` is empty if nothing reads them.
#[inline]
fn keep(kept: &mut [f64], joints: &[f64]) {
    for (kept, q) in kept.iter_mut().zip(joints) {
        *kept = *q;
    }
}
