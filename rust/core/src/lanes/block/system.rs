//! The rovers of a block as systems of the scheme.

use std::sync::Arc;

use super::by_method::ByMethod;
use crate::contact::ContactKey;
use crate::integrator::grouped::Grouped;
use crate::integrator::systems::{MemoryOf, Systems};
use crate::integrator::{StepOptions, StepReport};
use crate::lanes::contacts::Contacts;
use crate::lanes::ground::Ground;
use crate::lanes::joint_slots::JointRow;
use crate::lanes::machine::Machine;
use crate::lanes::rows::{Answer, Rows};
use crate::lanes::yielding::spring;
use crate::law::compliance::{Compliance, Yielding};
use crate::multibody::bias::BiasScratch;
use crate::multibody::{
    EnergyScratch, Factor, Inertias, LaneConfiguration, MassMatrix, Model, Poses,
};
use crate::sand::RutMap;
use crate::scalar::{Lane, MAX_LANES, Vec3};
use crate::solver::batch::problem::{ContactProblem, Triple};
use crate::system::command::Wrench;
use crate::system::drives::Drives;
use crate::system::gyroscopic::Gyroscopic;
use crate::system::sand::SandContact;

/// Rovers of one machine: their descriptions, commands, and the matrices of a step.
pub(super) struct LaneSystem<T: Lane> {
    pub token: T::Token,
    pub machine: Arc<Machine>,
    pub models: [Option<Arc<Model>>; MAX_LANES],
    pub inertias: Inertias<T>,
    pub gravity: Vec3<T>,
    /// Friction coefficient of contacts without a law of their materials, and of each slot.
    pub friction: T,
    pub mu: Vec<T>,
    /// Coefficient of restitution of each slot.
    pub restitution: Vec<T>,
    /// Most dry friction of each joint that has it, N m or N.
    pub dry_friction: Vec<T>,
    pub ground: Ground<T>,
    pub drives: Drives<T>,
    /// The sand under the wheels, once a rover stands on soft ground, and the ruts of each lane's
    /// rover.
    pub sand: Option<Box<SandContact<T>>>,
    pub ruts: Vec<RutMap>,
    /// Work of the sand on each cluster, J.
    pub of_sand: Vec<T>,
    /// What pushes the rover of each lane, and its generalized force at the midpoint (nv).
    pub wrenches: [Vec<Wrench>; MAX_LANES],
    pub applied: Vec<T>,
    pub poses_middle: Poses<T>,
    pub poses_end: Poses<T>,
    /// Coordinates of the joints at the midpoint.
    pub joints_middle: Vec<T>,
    pub mass_matrix: MassMatrix<T>,
    pub factor: Factor<T>,
    pub bias_scratch: BiasScratch<T>,
    pub implicit: Option<Box<Implicit<T>>>,
    /// Whether a rover may need them in the present step.
    pub turns: bool,
    pub by_method: Option<Box<ByMethod>>,
    pub energy_scratch: EnergyScratch<T>,
    pub contacts: Contacts<T>,
    pub rows: Rows<T>,
    /// Torques' impulse over the step (nv).
    pub torque: Vec<T>,
    /// Impulses that the sweeps start from and end with, by slot, N s.
    pub swept: Vec<Triple<T>>,
}

/// What steps with implicit gyroscopic terms need beside the others.
pub(super) struct Implicit<T: Lane> {
    pub solver: Gyroscopic<T>,
    /// M̂.
    pub mass_matrix: MassMatrix<T>,
    /// Impulse of the forces but the gyroscopic ones (nv).
    pub given: Vec<T>,
}

impl<T: Lane> LaneSystem<T> {
    /// Without rovers.
    pub fn new(token: T::Token, machine: &Arc<Machine>) -> Self {
        let zero = T::splat(token, 0.0);
        let vector = || vec![zero; machine.nv()];
        let contacts = Contacts::new(token, machine);
        let n = contacts.n_slots();
        Self {
            token,
            models: [const { None }; MAX_LANES],
            inertias: Inertias::new(token, machine),
            gravity: Vec3::splat(token, [0.0; 3]),
            friction: zero,
            mu: vec![zero; n],
            restitution: vec![zero; n],
            dry_friction: vec![zero; machine.rubbing.len()],
            ground: Ground::new(token, machine.wheels.len(), machine.boxes.len()),
            drives: Drives::new(token, machine),
            sand: None,
            ruts: vec![RutMap::default(); T::LANES],
            of_sand: vec![zero; machine.n_clusters()],
            wrenches: [const { Vec::new() }; MAX_LANES],
            applied: vector(),
            poses_middle: Poses::new(token, machine),
            poses_end: Poses::new(token, machine),
            joints_middle: vec![zero; machine.joints.len()],
            mass_matrix: MassMatrix::new(token, machine),
            factor: Factor::new(token, machine),
            bias_scratch: BiasScratch::new(token, machine),
            implicit: None,
            turns: false,
            by_method: None,
            energy_scratch: EnergyScratch::new(token, machine),
            rows: Rows::new(token, machine, n),
            torque: vector(),
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
            let mut shift = sign * (self.restitution[slot] * self.rows.u_before[slot][0]);
            if !laws.is_empty() {
                shift = T::select(laws[slot].is_soft(), zero, shift);
            }
            u[slot][0] += shift;
        }
    }
}

/// h and θ.
#[inline(always)]
pub(super) fn time_step<T: Lane>(token: T::Token, options: &StepOptions) -> (T, T) {
    (
        T::splat(token, options.time_step),
        T::splat(token, options.theta),
    )
}

impl<T: Lane> Systems for LaneSystem<T> {
    type T = T;
    type Configuration = LaneConfiguration<T>;
    type Machine = Self;
    type Local = Triple<T>;
    type Key = ContactKey;
    type Contacts = Contacts<T>;
    type Problems = [ContactProblem];

    #[inline(always)]
    fn run<R>(token: T::Token, f: impl FnOnce() -> R) -> R {
        T::vectorize(token, f)
    }

    #[inline(always)]
    fn machine(&self) -> &Self {
        self
    }

    #[inline(always)]
    fn machine_mut(&mut self) -> &mut Self {
        self
    }

    #[inline(always)]
    fn gravity(&self) -> Vec3<T> {
        self.gravity
    }

    #[inline(always)]
    fn contacts(&self) -> &Contacts<T> {
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
        let own = (lane, self.models[lane].as_ref());
        self.contacts.recall(own, memory, problems, is_same);
    }

    #[inline(always)]
    fn read_start(&self, problems: &[ContactProblem], p: &mut [Triple<T>]) {
        self.rows
            .read(&self.contacts, problems, Answer::Impulses, p);
    }

    fn assemble(&mut self, v: &[T]) {
        let (machine, end) = (&*self.machine, &self.poses_end);
        self.rows
            .assemble(machine, end, &self.factor, &self.contacts, v);
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
        let motion = (&self.poses_middle, v);
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
        self.rows.add_impulses(&self.contacts, lanes, p, y);
    }

    #[inline(always)]
    fn generalized_impulse(&self, lanes: T::Mask, p: &[Triple<T>], out: &mut [T]) {
        let (machine, end) = (&*self.machine, &self.poses_end);
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
        q: &[Triple<T>],
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
        self.rows.read(contacts, problems, Answer::Impulses, p);
        self.rows.read(contacts, problems, Answer::Velocities, u);
    }

    fn place_in_memory(&self, slot: usize, lane: usize) -> usize {
        // Pieces of a surface share a key, so the contact is found by its place.
        let home = usize::from(self.contacts.homes(slot)[lane]);
        let lists = self
            .contacts
            .problems_of(lane)
            .take_while(|own| *own < home);
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
            .read(&self.contacts, problems, Answer::Impulses, pushes);
    }
}

impl<T: Lane> Grouped<T> for Contacts<T> {
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
    fn home(&self, slot: usize, lane: usize) -> usize {
        usize::from(self.homes(slot)[lane]) / T::LANES
    }
}
