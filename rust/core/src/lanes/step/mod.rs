//! The fast step of a block of rovers.
//!
//! The formulas are those of [`crate::integrator::moreau_jean`]. A step has three parts, between
//! which its contact problems are solved with those of other blocks
//! ([`crate::solver::batch::queue`]):
//!
//! 1. [`Block::prepare`] — poses, contacts, forces, the friction-contact problem;
//! 2. [`Block::conclude`] — the new velocity and configuration, energy audit, and where contacts
//!    penetrate, the problem of the position projection; where a motor has left the branch of its
//!    line, the friction-contact problem anew;
//! 3. [`Block::finish`] — the projected configuration, and what the next step remembers.
//!
//! A lane whose step cannot be taken falls back to the general one: its state stays as it was.
//!
//! `loading`: rovers come and go; `phases`: the three parts, and what they are made of:
//! `contact_list`, `forces`, `turning`, `implicit`, `pushing`, `sinking`, `rebound`, `methods`,
//! `by_method`, `impacts`, `balance`, `projection`, `closing`.

mod balance;
mod by_method;
mod closing;
mod contact_list;
mod forces;
mod impacts;
mod implicit;
mod loading;
mod methods;
mod phases;
mod projection;
mod pushing;
mod rebound;
mod sinking;
mod turning;

use std::sync::Arc;

use self::balance::{Balance, Energies};
use self::by_method::ByMethod;
use self::implicit::Implicit;
use super::contacts::Contacts;
use super::ground::Ground;
use super::joint_slots::JointRow;
use super::machine::Machine;
use super::rows::Rows;
use super::yielding::Yields;
use crate::integrator::{StepOptions, StepReport, WarmStart};
use crate::multibody::bias::BiasScratch;
use crate::multibody::energy::{EnergyOfCluster, energies};
use crate::multibody::{
    EnergyScratch, Factor, Inertias, LaneConfiguration, MassMatrix, Model, Poses,
};
use crate::sand::RutMap;
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3};
use crate::solver::batch::problem::{MAX_CONTACTS, Triple};
use crate::system::command::Wrench;
use crate::system::drives::Drives;
use crate::system::sand::SandContact;

/// Why a lane fell back in its last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fallback {
    /// The rover turns too fast for one step.
    Turning,
    /// The rover has more contacts than slots or a problem hold, a joint may reach both of its
    /// stops, or the ground is unknown.
    Contact,
    /// The mass matrix has no factor.
    MassMatrix,
    /// The contact problem was not solved.
    Solver,
    /// The force of the sand is still another one after all repetitions.
    Sand,
    /// The energy audit asks for a safer step.
    Energy,
    /// The position projection was not solved, or moves too far.
    Projection,
    /// A loop stays open.
    Loop,
    /// Something is not finite.
    NotFinite,
}

/// What follows [`Block::conclude`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// The problems of the lanes that are [retaken](Block::is_retaken) are solved anew, and the
    /// step is concluded again.
    Retake,
    /// Positions must be projected: [`Block::set_gaps`], then [`Block::finish`].
    Project,
    /// [`Block::finish`].
    Finish,
}

/// Whether two rovers may share a block: gravity and friction may differ.
#[must_use]
pub fn are_alike(a: &StepOptions, b: &StepOptions) -> bool {
    let own = StepOptions {
        gravity: a.gravity,
        friction_coefficient: a.friction_coefficient,
        ..b.clone()
    };
    *a == own
}

/// Rovers in the lanes of a register, one fast step at a time.
pub struct Block<T: Lane> {
    token: T::Token,
    machine: Arc<Machine>,
    options: StepOptions,
    models: [Option<Arc<Model>>; MAX_LANES],
    inertias: Inertias<T>,
    gravity: Vec3<T>,
    /// Friction coefficient of contacts without a law of their materials, and of each slot.
    friction: T,
    mu: Vec<T>,
    /// Coefficient of restitution of each slot, and the lanes whose contact bounces there although
    /// its wheel yields.
    restitution: Vec<T>,
    bounces: Vec<T::Mask>,
    /// Most dry friction of each joint that has it, N m or N.
    dry_friction: Vec<T>,
    ground: Ground<T>,
    drives: Drives<T>,
    /// The sand under the wheels, once a rover stands on soft ground, and the ruts of each lane's
    /// rover.
    sand: Option<Box<SandContact<T>>>,
    ruts: Vec<RutMap>,
    /// What pushes the rover of each lane, and its generalized force at the midpoint (nv).
    wrenches: [Vec<Wrench>; MAX_LANES],
    applied: Vec<T>,
    /// Impulses of each lane's last step, and their generalized impulse (nv) where the contacts
    /// persisted.
    memories: [WarmStart; MAX_LANES],
    /// Impulses of each lane's present step.
    next_memories: [WarmStart; MAX_LANES],
    persistent: Vec<T>,
    /// By cluster: lanes of which it is known.
    has_persistent: Vec<T::Mask>,
    /// By cluster: lanes in which the contacts of its group are those of the last step, which
    /// persisted.
    persists: Vec<T::Mask>,
    /// By cluster: lanes in which the contacts of its group are those of the last step.
    is_same: Vec<T::Mask>,
    /// Cluster of each velocity.
    cluster_of: Vec<usize>,
    start: LaneConfiguration<T>,
    v: Vec<T>,
    time: T,
    middle: LaneConfiguration<T>,
    end: LaneConfiguration<T>,
    v_end: Vec<T>,
    v_mean: Vec<T>,
    poses_middle: Poses<T>,
    poses_end: Poses<T>,
    mass_matrix: MassMatrix<T>,
    factor: Factor<T>,
    bias_scratch: BiasScratch<T>,
    /// By cluster: lanes in which the gyroscopic terms of its group are implicit, and how.
    is_gyroscopic: Vec<T::Mask>,
    implicit: Option<Box<Implicit<T>>>,
    by_method: Option<Box<ByMethod>>,
    energy_scratch: EnergyScratch<T>,
    contacts: Contacts<T>,
    rows: Rows<T>,
    yields: Yields<T>,
    /// By slot: impulses of the step and of the projection, N s; velocities, m/s.
    p: Vec<Triple<T>>,
    pushes: Vec<Triple<T>>,
    /// Gaps that the projection removes by slot, along the normal, m.
    gaps: Vec<Triple<T>>,
    u: Vec<Triple<T>>,
    /// Impulses of the last step by slot, N s.
    p_last: Vec<Triple<T>>,
    /// Lanes whose contact is in impact, by slot, and with an impact in its group, by cluster.
    impact: Vec<T::Mask>,
    has_impact: Vec<T::Mask>,
    /// An impulse (nv), or its factor coordinates, or a change of the velocity.
    y: Vec<T>,
    /// Torques' impulse over the step (nv).
    torque: Vec<T>,
    /// Generalized impulse of the contacts (nv).
    pushed: Vec<T>,
    /// Energies of the clusters, and their balances: that of a group is its first cluster's.
    energies: Energies<T>,
    balances: Vec<Balance<T>>,
    /// Lanes whose energy at the start is not known yet.
    is_new: T::Mask,
    /// By cluster: lanes in which the position of its group must be projected, and its deepest gap,
    /// m.
    is_deep: Vec<T::Mask>,
    deepest: Vec<T>,
    /// Lanes that hold a rover.
    occupied: T::Mask,
    /// Lanes that take part in the present step and have not fallen back.
    going: T::Mask,
    reasons: [Option<Fallback>; MAX_LANES],
    reports: [StepReport; MAX_LANES],
    /// Lanes whose step is taken again, and how often each lane's was.
    retaken: T::Mask,
    n_retaken: [usize; MAX_LANES],
}

impl<T: Lane> Block<T> {
    /// Lanes without rovers.
    #[must_use]
    pub fn new(token: T::Token, machine: &Arc<Machine>) -> Self {
        let zero = T::splat(token, 0.0);
        let nobody = T::mask(token, 0);
        let vector = || vec![zero; machine.nv()];
        let place = || LaneConfiguration::new(token, machine);
        let contacts = Contacts::new(token, machine);
        let slots = vec![[zero; 3]; contacts.n_slots()];
        let n = machine.n_clusters();
        let masks = || vec![nobody; n];
        Self {
            token,
            options: StepOptions::default(),
            models: [const { None }; MAX_LANES],
            inertias: Inertias::new(token, machine),
            gravity: Vec3::splat(token, [0.0; 3]),
            friction: zero,
            dry_friction: vec![zero; machine.rubbing.len()],
            ground: Ground::new(token, machine.wheels.len(), machine.boxes.len()),
            drives: Drives::new(token, machine),
            sand: None,
            ruts: vec![RutMap::default(); T::LANES],
            wrenches: [const { Vec::new() }; MAX_LANES],
            applied: vector(),
            memories: std::array::from_fn(|_| WarmStart::with_capacity(MAX_CONTACTS, machine.nv())),
            next_memories: std::array::from_fn(|_| WarmStart::with_capacity(MAX_CONTACTS, 0)),
            persistent: vector(),
            has_persistent: masks(),
            persists: masks(),
            is_same: masks(),
            cluster_of: (0..machine.nv())
                .map(|k| machine.cluster_of_velocity(k))
                .collect(),
            start: place(),
            v: vector(),
            time: zero,
            middle: place(),
            end: place(),
            v_end: vector(),
            v_mean: vector(),
            poses_middle: Poses::new(token, machine),
            poses_end: Poses::new(token, machine),
            mass_matrix: MassMatrix::new(token, machine),
            factor: Factor::new(token, machine),
            bias_scratch: BiasScratch::new(token, machine),
            is_gyroscopic: masks(),
            implicit: None,
            by_method: None,
            energy_scratch: EnergyScratch::new(token, machine),
            rows: Rows::new(token, machine, contacts.n_slots()),
            yields: Yields::new(token, machine, contacts.n_slots()),
            contacts,
            p: slots.clone(),
            pushes: slots.clone(),
            gaps: slots.clone(),
            p_last: slots.clone(),
            impact: vec![nobody; slots.len()],
            has_impact: masks(),
            mu: vec![zero; slots.len()],
            restitution: vec![zero; slots.len()],
            bounces: vec![nobody; slots.len()],
            u: slots,
            y: vector(),
            torque: vector(),
            pushed: vector(),
            energies: Energies::new(token, n),
            balances: vec![Balance::new(token); n],
            is_new: nobody,
            is_deep: masks(),
            deepest: vec![zero; n],
            occupied: nobody,
            going: nobody,
            reasons: [None; MAX_LANES],
            reports: [StepReport::default(); MAX_LANES],
            retaken: nobody,
            n_retaken: [0; MAX_LANES],
            machine: Arc::clone(machine),
        }
    }

    /// Options of the rovers; gravity and friction are those of the last that was loaded.
    #[must_use]
    pub fn options(&self) -> &StepOptions {
        &self.options
    }

    /// Why a lane's last step was not taken, if it was not.
    #[must_use]
    pub fn fallback(&self, lane: usize) -> Option<Fallback> {
        self.reasons[lane]
    }

    /// Whether a lane takes part in the present step.
    #[must_use]
    pub fn is_going(&self, lane: usize) -> bool {
        self.going.get(lane)
    }

    /// Whether a lane's problem must be solved anew, see [`Next::Retake`].
    #[must_use]
    pub fn is_retaken(&self, lane: usize) -> bool {
        (self.retaken & self.going).get(lane)
    }

    /// Report of a lane's last step.
    #[must_use]
    pub fn report(&self, lane: usize) -> &StepReport {
        &self.reports[lane]
    }

    /// World positions of a lane's roots where the contacts of the last step were evaluated, m.
    pub fn origins(&self, lane: usize) -> impl Iterator<Item = [f64; 3]> + '_ {
        let trees = 0..self.machine.trees.len();
        trees.map(move |tree| self.poses_end.origin_of(tree).get(lane))
    }

    #[inline(always)]
    fn number(&self, x: f64) -> T {
        T::splat(self.token, x)
    }

    /// h and θ.
    #[inline(always)]
    fn time_step(&self) -> (T, T) {
        (
            self.number(self.options.time_step),
            self.number(self.options.theta),
        )
    }

    /// Takes lanes out of the present step.
    #[inline(always)]
    fn fall_back(&mut self, reason: Fallback, lanes: T::Mask) {
        let mut lost = (self.going & lanes).bits();
        if lost == 0 {
            return;
        }
        self.going = self.going & !lanes;
        while lost != 0 {
            self.reasons[lost.trailing_zeros() as usize] = Some(reason);
            lost &= lost - 1;
        }
    }

    /// Energies of the clusters at the start or at the end of the step.
    fn energy(&mut self, state: State) -> &[EnergyOfCluster<T>] {
        let (place, v) = match state {
            State::Start => (&self.start, &self.v),
            State::End => (&self.end, &self.v_end),
        };
        energies(
            &self.machine,
            &self.inertias,
            place,
            v,
            self.gravity,
            &mut self.energy_scratch,
        )
    }

    /// What a unit of a slot's gap counts as where it is compared with lengths, m: of a stop the
    /// arm of its joint.
    #[inline(always)]
    fn lever(&self, slot: usize) -> Option<T> {
        match self.contacts.joint_row(slot) {
            Some((joint, JointRow::Stop(_))) => Some(self.number(self.machine.joints[joint].arm)),
            _ => None,
        }
    }

    /// Number of clusters.
    #[inline(always)]
    fn n_clusters(&self) -> usize {
        self.balances.len()
    }

    /// Lanes in which any cluster is marked.
    #[inline(always)]
    fn any(&self, masks: &[T::Mask]) -> T::Mask {
        let nobody = T::mask(self.token, 0);
        masks.iter().fold(nobody, |all, own| all | *own)
    }

    /// Calls `each(leader, lane)` for the groups of touching clusters of which one passes its
    /// momentum on to the world.
    fn each_held(&self, mut each: impl FnMut(usize, usize)) {
        let held = (0..self.contacts.n_clusters()).filter(|own| self.machine.is_held(*own));
        for cluster in held {
            for lane in (0..T::LANES).filter(|lane| self.contacts.joined() >> lane & 1 == 1) {
                each(self.contacts.leader(cluster, lane), lane);
            }
        }
    }

    /// `masks`: by cluster, lanes in which its group has a contact.
    #[inline(always)]
    fn find_touch(&self, masks: &mut [T::Mask]) {
        masks.fill(T::mask(self.token, 0));
        for &slot in self.contacts.used() {
            let active = self.contacts.slot(slot).active;
            self.contacts.mark(slot, active, masks);
        }
        self.contacts.unite(masks);
    }

    /// `masks`: by cluster, lanes in which its group has a contact with the ground.
    #[inline(always)]
    fn find_ground(&self, masks: &mut [T::Mask]) {
        masks.fill(T::mask(self.token, 0));
        for &slot in self.contacts.used_by_shapes() {
            if self.contacts.cluster_of(slot).is_some() {
                let active = self.contacts.slot(slot).active;
                self.contacts.mark(slot, active, masks);
            }
        }
        self.contacts.unite(masks);
    }

    /// Number of the friction-contact problems of all lanes: one of each cluster in each lane.
    #[must_use]
    pub fn n_problems(&self) -> usize {
        self.contacts.n_problems()
    }

    /// The lane of a problem.
    #[must_use]
    pub fn lane_of(problem: usize) -> usize {
        problem % T::LANES
    }
}

/// A state of a block.
#[derive(Clone, Copy, Debug)]
enum State {
    Start,
    End,
}

/// The linear momentum of a cluster that only contacts with the ground change; 0 of one that is
/// tied to the world.
#[inline(always)]
fn own_momentum<T: Lane>(
    token: T::Token,
    machine: &Machine,
    cluster: usize,
    momentum: Vec3<T>,
) -> Vec3<T> {
    if machine.is_held(cluster) {
        Vec3::splat(token, [0.0; 3])
    } else {
        momentum
    }
}
