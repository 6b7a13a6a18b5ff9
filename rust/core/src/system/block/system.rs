//! The rovers of a block as the systems of the scheme: where their contacts are.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use std::sync::Arc;

use super::by_method::ByMethod;
use crate::contact::ContactKey;
use crate::contact::slots::contacts::ContactSlots;
use crate::contact::slots::ground::BlockGround;
use crate::contact::slots::joint_slots::JointRow;
use crate::contact::slots::machine::SharedMachine;
use crate::contact::slots::rows::{ContactMatrices, ContactQuantity, in_slots};
use crate::contact::slots::yielding::spring;
use crate::integrator::grouped::Grouped;
use crate::integrator::systems::{MemoryOf, Systems};
use crate::integrator::{StepOptions, StepReport};
use crate::law::compliance::{Compliance, Yielding};
use crate::law::newton_impact::rebound;
use crate::multibody::LaneConfiguration;
use crate::scalar::{Lane, Vec3, inlined};
use crate::solver::batch::problem::{ContactProblem, Triple};
use crate::system::tree_lanes::TreeLanes;

/// Rovers of one machine, with their contacts.
pub(super) struct LaneSystem<T: Lane> {
    pub token: T::Token,
    pub machine: Arc<SharedMachine>,
    pub tree: TreeLanes<T>,
    /// Friction coefficient of contacts without a law of their materials, and of each slot.
    pub friction: T,
    pub mu: Vec<T>,
    /// Coefficient of restitution of each slot.
    pub restitution: Vec<T>,
    /// Most dry friction of each joint that has it, N m or N.
    pub dry_friction: Vec<T>,
    pub ground: BlockGround<T>,
    pub by_method: Option<Box<ByMethod>>,
    pub contacts: ContactSlots<T>,
    pub rows: ContactMatrices<T>,
    /// Impulses that the sweeps start from and end with, by slot, N s.
    pub swept: Vec<Triple<T>>,
}

impl<T: Lane> LaneSystem<T> {
    /// Without rovers.
    pub fn new(token: T::Token, machine: &Arc<SharedMachine>) -> Self {
        let zero = T::splat(token, 0.0);
        let contacts = ContactSlots::new(token, machine);
        let n = contacts.n_slots();
        let (mechanism, in_sand) = (machine.mechanism(), machine.in_sand.clone());
        Self {
            token,
            tree: TreeLanes::new(token, mechanism, &machine.loops, in_sand, n),
            friction: zero,
            mu: vec![zero; n],
            restitution: vec![zero; n],
            dry_friction: vec![zero; machine.rubbing.len()],
            ground: BlockGround::new(token, machine.wheels.len(), machine.boxes.len()),
            by_method: None,
            rows: ContactMatrices::new(token, machine, n),
            swept: vec![[zero; 3]; n],
            contacts,
            machine: Arc::clone(machine),
        }
    }

    #[inline(always)]
    pub fn number(&self, x: f64) -> T {
        T::splat(self.token, x)
    }

    /// What a unit of a slot's gap counts as, see [`Systems::lever`].
    pub fn lever_of(&self, slot: usize) -> f64 {
        match self.contacts.joint_row(slot) {
            Some((joint, JointRow::Stop(_))) => self.machine.joints[joint].arm,
            _ => 1.0,
        }
    }

    /// Finds the impulses of the loops with those of the contacts by slot, N s, in some lanes.
    pub fn find_loop_impulses(&mut self, lanes: T::Mask, p: &[Triple<T>]) {
        if let Some(loops) = &mut self.tree.loops {
            let impulses = in_slots(&self.contacts, lanes, p);
            inlined!(T::vectorize, self.token, loops.find_impulses(&impulses));
        }
    }

    /// Adds the most friction that a joint has in `duration` to its normal velocity, as
    /// [`crate::contact::joint_friction`] says.
    #[inline(always)]
    fn hold_joints(&self, duration: T, u: &mut [Triple<T>]) {
        let slots = self.contacts.slots_of_friction();
        for (slot, most) in slots.zip(&self.dry_friction) {
            u[slot][0] += duration * *most * self.rows.normal[slot];
        }
    }

    /// Adds `e u_N⁻`, times a sign, to the normal velocities of the rigid contacts.
    #[inline(always)]
    fn rebound(&self, sign: T, laws: &[Yielding<T>], u: &mut [Triple<T>]) {
        let zero = sign.like(0.0);
        for &slot in self.contacts.used() {
            let before = self.rows.u_before[slot][0];
            let mut shift = sign * rebound(self.restitution[slot], before);
            if !laws.is_empty() {
                shift = T::select(laws[slot].is_soft(), zero, shift);
            }
            u[slot][0] += shift;
        }
    }
}

impl<T: Lane> Systems for LaneSystem<T> {
    type T = T;
    type Configuration = LaneConfiguration<T>;
    type Machine = TreeLanes<T>;
    type Local = Triple<T>;
    type Key = ContactKey;
    type Contacts = ContactSlots<T>;
    type Problems = [ContactProblem];

    #[inline(always)]
    fn run<R>(token: T::Token, f: impl FnOnce() -> R) -> R {
        T::vectorize(token, f)
    }

    #[inline(always)]
    fn machine(&self) -> &TreeLanes<T> {
        &self.tree
    }

    #[inline(always)]
    fn machine_mut(&mut self) -> &mut TreeLanes<T> {
        &mut self.tree
    }

    #[inline(always)]
    fn gravity(&self) -> Vec3<T> {
        self.tree.gravity
    }

    #[inline(always)]
    fn contacts(&self) -> &ContactSlots<T> {
        &self.contacts
    }

    #[inline(always)]
    fn n_places(&self) -> usize {
        self.restitution.len()
    }

    fn detect(
        &mut self,
        options: &StepOptions,
        q: (&LaneConfiguration<T>, &LaneConfiguration<T>),
        v: &[T],
        going: T::Mask,
    ) -> T::Mask {
        self.find_contacts(options, q, v, going)
    }

    #[inline(always)]
    fn recall(
        &mut self,
        lane: usize,
        memory: &MemoryOf<Self>,
        problems: &mut [ContactProblem],
        is_same: &mut [T::Mask],
    ) {
        self.recall_impulses(lane, memory, problems, is_same);
    }

    #[inline(always)]
    fn read_start(&self, problems: &[ContactProblem], p: &mut [Triple<T>]) {
        self.rows
            .read(&self.contacts, problems, ContactQuantity::Impulses, p);
    }

    fn assemble(&mut self, v: &[T]) {
        let TreeLanes {
            loops,
            factor,
            poses_end,
            ..
        } = &mut self.tree;
        let (of, loops) = ((&*self.machine, &*factor), loops.as_deref_mut());
        self.rows.assemble(of, poses_end, &self.contacts, v, loops);
    }

    #[inline(always)]
    fn u_before(&self) -> &[Triple<T>] {
        &self.rows.u_before
    }

    #[inline(always)]
    fn lever(&self, slot: usize) -> Option<T> {
        match self.contacts.joint_row(slot) {
            Some((joint, JointRow::Stop(_))) => Some(self.number(self.machine.joints[joint].arm)),
            _ => None,
        }
    }

    #[inline(always)]
    fn yields(&self) -> bool {
        self.machine.yields()
    }

    #[inline(always)]
    fn compliance(&self, slot: usize, v: &[T]) -> (Option<Compliance<T>>, T::Mask) {
        let motion = (&self.tree.poses_middle, v);
        spring((&self.machine, &self.contacts), motion, slot)
    }

    fn remembers(&self, lane: usize, memory: &MemoryOf<Self>, cluster: usize) -> bool {
        self.knows(lane, memory, cluster)
    }

    #[inline(always)]
    fn own_cluster(&self, slot: usize, lane: usize) -> usize {
        self.contacts.own_cluster(slot, lane)
    }

    #[inline(always)]
    fn restitution(&self, _: &StepOptions, slot: usize) -> T {
        self.restitution[slot]
    }

    fn soften(&mut self, laws: &[Yielding<T>]) {
        self.rows.soften(&self.contacts, |slot| laws[slot].diagonal);
    }

    fn close_held(&mut self) {
        self.rows.close_held(&self.contacts);
    }

    #[inline(always)]
    fn immovable(&self, slot: usize) -> T::Mask {
        self.rows.immovable(slot)
    }

    #[inline(always)]
    fn local(&self, y: &[T], u: &mut [Triple<T>]) {
        self.rows.local(&self.contacts, y, u);
    }

    #[inline(always)]
    fn add_impulses(&self, lanes: T::Mask, p: &[Triple<T>], y: &mut [T]) {
        let loops = self.tree.loops.as_deref();
        (self.rows).add_impulses(&self.contacts, lanes, p, y, loops);
    }

    #[inline(always)]
    fn generalized_impulse(&self, lanes: T::Mask, p: &[Triple<T>], out: &mut [T]) {
        let (machine, end) = (&*self.machine, &self.tree.poses_end);
        self.rows
            .generalized_impulse(machine, &self.contacts, end, lanes, p, out);
    }

    #[inline(always)]
    fn add_shifts(
        &self,
        options: &StepOptions,
        sign: f64,
        laws: &[Yielding<T>],
        u: &mut [Triple<T>],
    ) {
        let (sign, h) = (self.number(sign), self.number(options.time_step));
        if options.is_elastic() {
            self.rebound(sign, laws, u);
        }
        self.hold_joints(-(sign * h), u);
    }

    fn pose(
        &mut self,
        options: &StepOptions,
        (q, _): (&[Triple<T>], &[T]),
        start: &[Triple<T>],
        is_same: &[T::Mask],
        lanes: T::Mask,
        problems: &mut [ContactProblem],
    ) {
        self.write_problems(options, q, start, is_same, lanes, problems);
    }

    fn take_answers(
        &mut self,
        options: &StepOptions,
        going: T::Mask,
        problems: &mut [ContactProblem],
        reports: &mut [StepReport],
        memories: &mut [MemoryOf<Self>],
    ) -> T::Mask {
        self.read_answers(options, going, problems, reports, memories)
    }

    #[inline(always)]
    fn read(&self, problems: &[ContactProblem], p: &mut [Triple<T>], u: &mut [Triple<T>]) {
        let contacts = &self.contacts;
        self.rows
            .read(contacts, problems, ContactQuantity::Impulses, p);
        self.rows
            .read(contacts, problems, ContactQuantity::Velocities, u);
    }

    fn place_in_memory(&self, slot: usize, lane: usize) -> usize {
        // Pieces of a surface share a key, so the contact is found by its place.
        let problem_index = usize::from(self.contacts.problem_indices(slot)[lane]);
        let lists = self
            .contacts
            .problems_of(lane)
            .take_while(|own| *own < problem_index);
        let before: usize = lists.map(|own| self.contacts.list(own).n).sum();
        before + usize::from(self.contacts.places(slot)[lane])
    }

    fn norms(
        &self,
        problems: &[ContactProblem],
        (leader, lane): (usize, usize),
        u: &[Triple<T>],
    ) -> Option<[f64; 2]> {
        let index = leader * T::LANES + lane;
        let (list, problem) = (self.contacts.list(index), &problems[index]);
        if list.n == 0 {
            return None;
        }
        let mut lost = 0.0;
        for (place, slot) in list.slots[..list.n].iter().enumerate() {
            if problem.p[3 * place] > 0.0 {
                let u_N = u[usize::from(*slot)][0].get(lane);
                lost += u_N * u_N;
            }
        }
        let free: f64 = problem.q[..3 * list.n].iter().map(|q| q * q).sum();
        Some([lost, free])
    }

    #[inline(always)]
    fn pose_gaps(
        &mut self,
        gaps: &[Triple<T>],
        is_deep: &[T::Mask],
        pushes: &mut [Triple<T>],
        problems: &mut [ContactProblem],
    ) {
        self.write_gaps(gaps, is_deep, pushes, problems);
    }

    fn take_displacements(
        &mut self,
        options: &StepOptions,
        going: T::Mask,
        problems: &mut [ContactProblem],
        is_deep: &[T::Mask],
        reports: &mut [StepReport],
        farthest: &mut [T],
    ) -> T::Mask {
        self.read_displacements(options, going, problems, is_deep, reports, farthest)
    }

    #[inline(always)]
    fn read_pushes(&self, problems: &[ContactProblem], pushes: &mut [Triple<T>]) {
        self.rows
            .read(&self.contacts, problems, ContactQuantity::Impulses, pushes);
    }
}

impl<T: Lane> Grouped<T> for ContactSlots<T> {
    #[inline(always)]
    fn token(&self) -> T::Token {
        self.token
    }

    #[inline(always)]
    fn used(&self) -> impl Iterator<Item = usize> {
        self.used.iter().copied()
    }

    #[inline(always)]
    fn active(&self, slot: usize) -> T::Mask {
        self.slot(slot).active
    }

    #[inline(always)]
    fn gap(&self, slot: usize) -> T {
        self.slot(slot).gap
    }

    #[inline(always)]
    fn is_with_world(&self, slot: usize) -> bool {
        slot < self.first_of_joints && self.cluster_of(slot).is_some()
    }

    #[inline(always)]
    fn n_clusters(&self) -> usize {
        self.n_clusters()
    }

    #[inline(always)]
    fn joined(&self) -> u32 {
        self.joined()
    }

    #[inline(always)]
    fn leader(&self, cluster: usize, lane: usize) -> usize {
        self.leader(cluster, lane)
    }

    #[inline(always)]
    fn cluster_of(&self, slot: usize) -> Option<usize> {
        self.cluster_of(slot)
    }

    #[inline(always)]
    fn group_leader(&self, slot: usize, lane: usize) -> usize {
        usize::from(self.problem_indices(slot)[lane]) / T::LANES
    }
}
