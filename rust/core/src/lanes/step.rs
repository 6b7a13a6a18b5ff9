//! The fast step of a block of rovers.
//!
//! The formulas are those of [`crate::integrator::moreau_jean`] with explicit gyroscopic terms and
//! inelastic contact. A step has three parts, between which its contact problems are solved with
//! those of other blocks ([`super::queue`]):
//!
//! 1. [`Block::prepare`] — poses, contacts, forces, the friction-contact problem;
//! 2. [`Block::conclude`] — the new velocity and configuration, energy audit, and where contacts
//!    penetrate, the problem of the position projection; where a motor has left the branch of its
//!    line, the friction-contact problem anew;
//! 3. [`Block::finish`] — the projected configuration, and what the next step remembers.
//!
//! A lane whose step cannot be taken falls back to the general one: its state stays as it was.

use std::sync::Arc;

use nalgebra::Vector3;

use super::contacts::{Contacts, Sight};
use super::forecast::Forecast;
use super::ground::Ground;
use super::lane_rover::LaneRover;
use super::machine::Machine;
use super::problem::{ContactProblem, MAX_CONTACTS, Triple};
use super::rows::{Answer, Rows};
use super::sweeps::write_start;
use super::yielding::Yields;
use crate::contact::Contact;
use crate::integrator::energy_audit::{COARSE, GAIN, RAISE, ROUNDINGS};
use crate::integrator::mechanical_system::MOST_REVISIONS;
use crate::integrator::position_projection::FARTHEST;
use crate::integrator::step_contacts::STEADY;
use crate::integrator::{Phase, Probe, Stabilisation, StepOptions, StepReport, WarmStart};
use crate::multibody::bias::{BiasScratch, bias};
use crate::multibody::energy::energy;
use crate::multibody::mechanism::BASE;
use crate::multibody::{
    Energy, EnergyScratch, Factor, Inertias, LaneConfiguration, MassMatrix, Model, Poses,
};
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3};
use crate::system::drives::Drives;
use crate::system::tree::{JOINT_ARM, MOST_JOINT_TURN, MOST_SPIN, MOST_TURN};

/// Sweeps before pivoting, of machines with many contacts. Measured on six cylinders with torques
/// of up to 60 N m, drawn anew every ten steps: 5.2 systems a problem after one, 4.8 after two, 4.7
/// after four; a sweep costs about a third of a system.
const SWEEPS: usize = 2;

/// Why a lane was declined in its last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decline {
    /// It turns too fast for explicit gyroscopic terms.
    Turning,
    /// It has more contacts than a problem, or its ground is unknown.
    Contact,
    /// The mass matrix has no factor.
    MassMatrix,
    /// The contact problem was not solved.
    Solver,
    /// The energy audit asks for a safer step.
    Energy,
    /// The position projection was not solved, or moves too far.
    Projection,
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
    ground: Ground<T>,
    drives: Drives<T>,
    /// Impulses of each lane's last step, and their generalized impulse (nv) where the contacts
    /// persisted.
    memories: [WarmStart; MAX_LANES],
    /// Impulses of each lane's present step.
    next_memories: [WarmStart; MAX_LANES],
    persistent: Vec<T>,
    has_persistent: T::Mask,
    /// Lanes whose contacts are those of the last step, which persisted.
    persists: T::Mask,
    /// Lanes whose contacts are those of the last step.
    is_same: T::Mask,
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
    energy_scratch: EnergyScratch<T>,
    contacts: Contacts<T>,
    rows: Rows<T>,
    yields: Yields<T>,
    /// By slot: impulses of the step and of the projection, N s; velocities, m/s.
    p: Vec<Triple<T>>,
    pushes: Vec<Triple<T>>,
    u: Vec<Triple<T>>,
    /// Impulses of the last step by slot, N s.
    p_last: Vec<Triple<T>>,
    /// Lanes whose contact is in impact, by slot, and lanes with an impact.
    impact: Vec<T::Mask>,
    has_impact: T::Mask,
    /// An impulse (nv), or its factor coordinates, or a change of the velocity.
    y: Vec<T>,
    /// Torques' impulse over the step (nv).
    torque: Vec<T>,
    /// Generalized impulse of the contacts (nv).
    pushed: Vec<T>,
    /// Kinetic and potential energy at the start and at the end of the step, J.
    before: [T; 2],
    after: [T; 2],
    /// Work of the actuators, of the contacts by their law, and energy removed by the audit, J.
    work: T,
    contact_work: T,
    removed: T,
    released: T,
    /// Gain that is left, as a fraction of the kinetic energy.
    gain: T,
    /// Linear momentum at the end of the step, kg m/s.
    momentum: Vec3<T>,
    /// Lanes whose velocity the energy audit corrected in this step.
    is_corrected: T::Mask,
    /// Lanes whose energy at the start is not known yet.
    is_new: T::Mask,
    /// Lanes whose position must be projected, and their deepest gap, m.
    is_deep: T::Mask,
    deepest: T,
    /// Lanes that hold a rover.
    occupied: T::Mask,
    /// Lanes that take part in the present step and have not been declined.
    going: T::Mask,
    reasons: [Option<Decline>; MAX_LANES],
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
        Self {
            token,
            options: StepOptions::default(),
            models: [const { None }; MAX_LANES],
            inertias: Inertias::new(token, machine),
            gravity: Vec3::splat(token, [0.0; 3]),
            friction: zero,
            ground: Ground::new(token, machine.wheels.len(), machine.boxes.len()),
            drives: Drives::new(token, machine),
            memories: std::array::from_fn(|_| WarmStart::with_capacity(MAX_CONTACTS, machine.nv())),
            next_memories: std::array::from_fn(|_| WarmStart::with_capacity(MAX_CONTACTS, 0)),
            persistent: vector(),
            has_persistent: nobody,
            persists: nobody,
            is_same: nobody,
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
            energy_scratch: EnergyScratch::new(token, machine),
            rows: Rows::new(token, machine, contacts.n_slots()),
            yields: Yields::new(token, machine, contacts.n_slots()),
            contacts,
            p: slots.clone(),
            pushes: slots.clone(),
            p_last: slots.clone(),
            impact: vec![nobody; slots.len()],
            has_impact: nobody,
            mu: vec![zero; slots.len()],
            u: slots,
            y: vector(),
            torque: vector(),
            pushed: vector(),
            before: [zero; 2],
            after: [zero; 2],
            work: zero,
            contact_work: zero,
            removed: zero,
            released: zero,
            gain: zero,
            momentum: Vec3::splat(token, [0.0; 3]),
            is_corrected: nobody,
            is_new: nobody,
            is_deep: nobody,
            deepest: zero,
            occupied: nobody,
            going: nobody,
            reasons: [None; MAX_LANES],
            reports: [StepReport::default(); MAX_LANES],
            retaken: nobody,
            n_retaken: [0; MAX_LANES],
            machine: Arc::clone(machine),
        }
    }

    /// Gives a lane to a rover of this machine, with options alike those of the others.
    /// [`Self::begin`] follows.
    pub fn load_rover(&mut self, lane: usize, rover: &LaneRover<'_>) {
        let own = T::mask(self.token, 1 << lane);
        self.occupied = self.occupied | own;
        if !self.holds(lane, rover) {
            self.is_new = self.is_new | own;
            self.fill(lane, rover);
        }
        self.options.clone_from(rover.options);
        self.friction.set(lane, rover.options.friction_coefficient);
        self.ground.set_lane(lane, rover.terrain);
        let joints = rover.model.joints();
        self.drives.set_lane(lane, joints, rover.command);
        self.drives.set_work(lane, rover.drive_work);
        self.time.set(lane, *rover.time);
        let memory = &mut self.memories[lane].impulses;
        memory.clone_from(&rover.warm_start.impulses);
        let persistent = &rover.warm_start.persistent;
        for (own, x) in self.persistent.iter_mut().zip(persistent) {
            own.set(lane, *x);
        }
        self.has_persistent = self.has_persistent & !own;
        if !persistent.is_empty() {
            self.has_persistent = self.has_persistent | own;
        }
    }

    /// Whether a lane has the inertia and the state of a rover, so that its energy is known.
    fn holds(&self, lane: usize, rover: &LaneRover<'_>) -> bool {
        let is_own = |own: &T, x: &f64| own.get(lane).to_bits() == x.to_bits();
        (self.models[lane].as_ref()).is_some_and(|own| Arc::ptr_eq(own, rover.model))
            && self.gravity.get(lane).map(f64::to_bits)
                == <[f64; 3]>::from(rover.options.gravity).map(f64::to_bits)
            && self.v.iter().zip(&*rover.v).all(|(own, x)| is_own(own, x))
            && self.start.is_lane(lane, rover.configuration)
    }

    /// Gives a lane the inertia and the state of a rover.
    fn fill(&mut self, lane: usize, rover: &LaneRover<'_>) {
        if !(self.models[lane].as_ref()).is_some_and(|own| Arc::ptr_eq(own, rover.model)) {
            self.inertias.set_lane(lane, rover.model.inertias());
            self.models[lane] = Some(Arc::clone(rover.model));
        }
        self.gravity.set(lane, rover.options.gravity.into());
        self.start.set_lane(lane, rover.configuration);
        for (own, x) in self.v.iter_mut().zip(&*rover.v) {
            own.set(lane, *x);
        }
    }

    /// Writes a lane's state back, without its contacts.
    pub fn store_rover(&self, lane: usize, rover: &mut LaneRover<'_>) {
        self.start.to_lane(lane, rover.configuration);
        for (x, own) in rover.v.iter_mut().zip(&self.v) {
            *x = own.get(lane);
        }
        *rover.time = self.time.get(lane);
        rover
            .warm_start
            .impulses
            .clone_from(&self.memories[lane].impulses);
        rover.warm_start.persistent.clear();
        if self.has_persistent.get(lane) {
            let persistent = self.persistent.iter().map(|x| x.get(lane));
            rover.warm_start.persistent.extend(persistent);
        }
        let h = self.options.time_step;
        self.drives.to_lane(lane, rover.drive_work);
        for (torque, wheel) in rover.wheel_torque.iter_mut().zip(rover.model.wheels()) {
            let impulse = wheel.joint.map_or(0.0, |j| self.drives.impulse(lane, j));
            *torque = wheel.drive_sign * impulse / h;
        }
    }

    /// Empties a lane; its numbers stay, unused.
    pub fn clear(&mut self, lane: usize) {
        self.occupied = self.occupied & !T::mask(self.token, 1 << lane);
    }

    /// Follows after rovers were loaded.
    pub fn begin(&mut self) {
        self.drives.finish_loading();
        if self.is_new.any() {
            let (energy, _) = self.energy(State::Start);
            self.before = select_both(self.is_new, energy.kinetic_and_potential(), self.before);
            self.is_new = T::mask(self.token, 0);
        }
    }

    /// Energy of the start or of the end of the step.
    fn energy(&mut self, state: State) -> (Energy<T>, Vec3<T>) {
        let (place, v) = match state {
            State::Start => (&self.start, &self.v),
            State::End => (&self.end, &self.v_end),
        };
        energy(
            &self.machine,
            &self.inertias,
            place,
            v,
            self.gravity,
            &mut self.energy_scratch,
        )
    }

    /// Options of the rovers; gravity and friction are those of the last that was loaded.
    #[must_use]
    pub fn options(&self) -> &StepOptions {
        &self.options
    }

    /// Why a lane's last step was not taken, if it was not.
    #[must_use]
    pub fn declined(&self, lane: usize) -> Option<Decline> {
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

    /// World position of a lane's trunk where the contacts of the last step were evaluated, m.
    #[must_use]
    pub fn origin(&self, lane: usize) -> [f64; 3] {
        self.poses_end.origin.get(lane)
    }

    /// Visits the contacts of a lane's last step, in order: contact, position (world, m), impulse
    /// (N s) and local velocity (m/s).
    pub fn visit_contacts(
        &self,
        lane: usize,
        mut visit: impl FnMut(Contact, [f64; 3], [f64; 3], [f64; 3]),
    ) {
        let origin = Vector3::from(self.origin(lane));
        for place in 0..self.contacts.list(lane).n {
            let (slot, contact) = self.contacts.contact(&self.machine, lane, place);
            let at = |x: &[Triple<T>]| x[slot].map(|x| x.get(lane));
            let position = (origin + contact.point).into();
            visit(contact, position, at(&self.p), at(&self.u));
        }
    }

    #[inline(always)]
    fn number(&self, x: f64) -> T {
        T::splat(self.token, x)
    }

    /// Takes lanes out of the present step.
    #[inline(always)]
    fn decline(&mut self, reason: Decline, lanes: T::Mask) {
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

    /// First part of a step: everything up to the friction-contact problems, which it writes.
    ///
    /// # Panics
    /// If there are fewer problems than lanes.
    pub fn prepare(&mut self, problems: &mut [ContactProblem], probe: &mut dyn Probe) {
        let token = self.token;
        self.going = self.occupied;
        self.reasons = [None; MAX_LANES];
        self.n_retaken = [0; MAX_LANES];
        T::vectorize(
            token,
            #[inline(always)]
            || self.predict(),
        );
        self.poses_middle
            .update(&self.machine, &self.inertias, &self.middle);
        self.poses_end
            .update(&self.machine, &self.inertias, &self.end);
        probe.end(Phase::Kinematics);
        self.detect(problems);
        probe.end(Phase::Detection);
        self.set_up(problems, true, probe);
    }

    /// The friction-contact problems of the contacts found, from the mass matrix on; `is_first`:
    /// unless the step is taken again.
    fn set_up(&mut self, problems: &mut [ContactProblem], is_first: bool, probe: &mut dyn Probe) {
        let token = self.token;
        self.mass_matrix
            .update(&self.machine, &self.inertias, &self.poses_middle);
        T::vectorize(
            token,
            #[inline(always)]
            || self.add_implicit(is_first),
        );
        probe.end(Phase::MassMatrix);
        let is_definite = self
            .mass_matrix
            .factorise_in_place(&self.machine, &mut self.factor);
        self.decline(Decline::MassMatrix, !is_definite);
        probe.end(Phase::Factor);
        let (machine, end) = (&*self.machine, &self.poses_end);
        self.rows
            .assemble(machine, end, &self.factor, &self.contacts, &self.v);
        if !self.yields.is_empty() {
            if is_first {
                self.find_laws(problems);
            }
            self.rows.soften(&self.contacts, &self.yields.diagonal);
        }
        probe.end(Phase::Delassus);
        self.load(is_first.then_some(&*problems));
        self.rows
            .to_problems(&self.contacts, &self.u, &self.mu, problems);
        probe.end(Phase::Bias);
        if self.contacts.factored() != 0 {
            T::vectorize(
                token,
                #[inline(always)]
                || self.begin_near(problems, is_first),
            );
        }
    }

    /// Improves the impulses that the problems start from, those of lanes that are retaken unless
    /// `is_first`: the others have their answers.
    #[inline(always)]
    fn begin_near(&mut self, problems: &mut [ContactProblem], is_first: bool) {
        let lanes = if is_first {
            self.occupied
        } else {
            self.retaken
        };
        let lanes = lanes & T::mask(self.token, self.contacts.factored());
        self.p.copy_from_slice(&self.p_last);
        let data = (&self.u[..], &self.mu[..]);
        self.rows.sweep(&self.contacts, SWEEPS, data, &mut self.p);
        write_start(&self.contacts, lanes, &self.p, problems);
    }

    /// The laws of contacts that yield.
    fn find_laws(&mut self, problems: &[ContactProblem]) {
        let (memories, h) = (&self.memories, self.options.time_step);
        let weight = self.inertias.mass * self.gravity.norm();
        self.yields.update(
            &self.machine,
            &self.contacts,
            &self.rows.u_before,
            (h, self.options.theta),
            problems,
            |lane| {
                let is_unknown = memories[lane].impulses.is_empty();
                is_unknown.then(|| weight.get(lane) * h)
            },
        );
    }

    /// Configurations at the midpoint and at the predicted end.
    #[inline(always)]
    fn predict(&mut self) {
        let (h, theta) = (self.options.time_step, self.options.theta);
        let (base, joints, spin) = fastest(&self.machine, &self.v);
        let step = self.number(h);
        let is_fast = self.number(MOST_TURN).lt(step * base)
            | self.number(MOST_JOINT_TURN).lt(step * (base + joints))
            | self.number(MOST_SPIN).lt(step * spin);
        self.decline(Decline::Turning, is_fast);
        let machine = &*self.machine;
        self.middle
            .set_moved(machine, &self.start, &self.v, (1.0 - theta) * h);
        self.end.set_moved(machine, &self.start, &self.v, h);
    }

    fn detect(&mut self, problems: &mut [ContactProblem]) {
        let (h, theta) = (self.options.time_step, self.options.theta);
        let forecast = Forecast::new(self.gravity, h, self.options.forecast, (1.0 - theta) * h);
        let sight = Sight {
            machine: &self.machine,
            models: &self.models,
            going: self.going.bits(),
            middle: &self.poses_middle,
            end: &self.poses_end,
            v: &self.v,
            needs_pieces: !self.options.materials.is_empty(),
            forecast: &forecast,
        };
        let declined = self.contacts.detect(&mut self.ground, &sight);
        self.decline(Decline::Contact, declined);
        if !self.machine.stops.is_empty() {
            let (machine, places) = (&*self.machine, (&self.middle, &self.end));
            let end = &self.poses_end;
            let too_many = self
                .contacts
                .detect_stops(machine, places, end, &self.v, &forecast);
            self.decline(Decline::Contact, too_many);
        }
        for &slot in self.contacts.used() {
            let is_stop = self.contacts.stop(slot).is_some();
            self.mu[slot] = if is_stop {
                self.number(0.0)
            } else {
                self.friction
            };
        }
        if !self.options.materials.is_empty() {
            self.mix_materials();
        }
        let mut is_same = 0;
        for (lane, problem) in problems[..T::LANES].iter_mut().enumerate() {
            let is_own = self
                .contacts
                .recall(lane, &self.memories[lane], &mut problem.p);
            is_same |= u32::from(is_own) << lane;
        }
        self.is_same = T::mask(self.token, is_same);
        self.persists = self.is_same & self.has_persistent;
    }

    /// Friction of contacts whose two materials have a law of their own.
    #[cold]
    fn mix_materials(&mut self) {
        for lane in (0..T::LANES).filter(|&lane| self.going.get(lane)) {
            let (Some(model), Some(terrain)) = (&self.models[lane], self.ground.terrain(lane))
            else {
                continue;
            };
            for place in 0..self.contacts.list(lane).n {
                let (slot, contact) = self.contacts.contact(&self.machine, lane, place);
                let law = contact.between_materials(model, &**terrain, &self.options.materials);
                if let Some([mu, _]) = law {
                    self.mu[slot].set(lane, mu);
                }
            }
        }
    }

    /// The implicit terms of motors, held joints, springs and dampers; `is_first`: their branches
    /// and weights, too.
    #[inline(always)]
    fn add_implicit(&mut self, is_first: bool) {
        let machine = &*self.machine;
        let (h, theta) = self.time_step();
        let mass_matrix = &mut self.mass_matrix;
        if is_first {
            self.drives.choose_branches(machine, &self.v);
            let inertia = |k| mass_matrix.diagonal(machine, k);
            self.drives.set_theta(machine, (h, theta), inertia);
        }
        self.drives.add_implicit(machine, (h, theta), |k, a| {
            mass_matrix.add_to_diagonal(machine, k, a);
        });
    }

    /// h and θ.
    #[inline(always)]
    fn time_step(&self) -> (T, T) {
        (
            self.number(self.options.time_step),
            self.number(self.options.theta),
        )
    }

    /// The free change of the velocity, `y` in factor coordinates, and the contacts' free velocity
    /// `u`: first with the forces at v, then with those at the mean velocity that follows from them
    /// and from the last step's impulses.
    ///
    /// `problems`: those that hold the last step's impulses; none if they are known.
    fn load(&mut self, problems: Option<&[ContactProblem]>) {
        let token = self.token;
        let is_any = (self.persists & self.going).any();
        T::vectorize(
            token,
            #[inline(always)]
            || self.push_and_drive(is_any, problems),
        );
        self.weigh(true);
        T::vectorize(
            token,
            #[inline(always)]
            || self.add_torque_and_pushed(is_any),
        );
        self.weigh(false);
        T::vectorize(
            token,
            #[inline(always)]
            || self.add_torque_and_correction(is_any),
        );
    }

    #[inline(always)]
    fn push_and_drive(&mut self, is_any: bool, problems: Option<&[ContactProblem]>) {
        let zero = self.number(0.0);
        let step = self.time_step();
        if let Some(problems) = problems {
            self.rows
                .read(&self.contacts, problems, Answer::Impulses, &mut self.p_last);
        }
        if is_any {
            let (contacts, end) = (&self.contacts, &self.poses_end);
            self.rows.generalized_impulse(
                &self.machine,
                contacts,
                end,
                self.persists,
                &self.p_last,
                &mut self.pushed,
            );
        }
        self.torque.fill(zero);
        self.drives.add_impulse(
            &self.machine,
            step,
            &self.start.joints,
            [&self.v, &self.v],
            &mut self.torque,
        );
    }

    /// `y` = the bias at the velocity v, or at the mean velocity.
    fn weigh(&mut self, at_start: bool) {
        let v = if at_start { &self.v } else { &self.v_mean };
        bias(
            &self.machine,
            &self.inertias,
            &self.poses_middle,
            v,
            self.gravity,
            &mut self.bias_scratch,
            &mut self.y,
        );
    }

    #[inline(always)]
    fn add_torque_and_pushed(&mut self, is_any: bool) {
        let (h, theta) = self.time_step();
        let share = h.like(1.0) - theta;
        let persists = self.persists;
        for ((y, torque), pushed) in self.y.iter_mut().zip(&self.torque).zip(&self.pushed) {
            *y = *torque - h * *y;
            if is_any {
                *y = T::select(persists, *y + *pushed, *y);
            }
        }
        self.factor.half_solve(&self.machine, &mut self.y);
        self.factor.half_solve_back(&self.machine, &mut self.y);
        for ((mean, v), change) in self.v_mean.iter_mut().zip(&self.v).zip(&self.y) {
            *mean = *v + share * *change;
        }
    }

    #[inline(always)]
    fn add_torque_and_correction(&mut self, is_any: bool) {
        let (h, theta) = self.time_step();
        let share = h.like(1.0) - theta;
        let persists = self.persists;
        let pushed = self.pushed.iter().zip(&self.persistent);
        for ((y, torque), (pushed, before)) in self.y.iter_mut().zip(&self.torque).zip(pushed) {
            *y = *torque - h * *y;
            if is_any {
                *y = T::select(persists, *y + share * (*before - *pushed), *y);
            }
        }
        self.factor.half_solve(&self.machine, &mut self.y);
        self.rows.local(&self.contacts, &self.y, &mut self.u);
        self.yields.shift(&self.contacts, &mut self.u);
    }

    /// Second part of a step: the new velocity and configuration, and their energy.
    ///
    /// `problems`: those of [`Self::prepare`], solved.
    ///
    /// # Panics
    /// If there are fewer problems than lanes.
    pub fn conclude(&mut self, problems: &mut [ContactProblem], probe: &mut dyn Probe) -> Next {
        let token = self.token;
        let mut solved = 0;
        for (lane, problem) in problems[..T::LANES].iter().enumerate() {
            let has_answer = problem.n_contacts == 0 || problem.is_solved;
            solved |= u32::from(has_answer) << lane;
            self.reports[lane] = StepReport {
                steps: 1,
                retaken: self.n_retaken[lane],
                n_contacts: problem.n_contacts,
                iterations: problem.iterations,
                factorisations: problem.iterations,
                residual: problem.residual.relative,
                ..StepReport::default()
            };
            self.contacts
                .remember(lane, &problem.p, &mut self.next_memories[lane]);
            if problem.n_contacts == 0 {
                self.reports[lane] = StepReport {
                    steps: 1,
                    retaken: self.n_retaken[lane],
                    ..StepReport::default()
                };
            }
        }
        self.decline(Decline::Solver, !T::mask(token, solved));
        T::vectorize(
            token,
            #[inline(always)]
            || self.move_on(problems),
        );
        if self.drives.has_motors() && self.revise(problems, probe) {
            return Next::Retake;
        }
        let (after, momentum) = self.energy(State::End);
        self.after = after.kinetic_and_potential();
        self.momentum = momentum;
        T::vectorize(
            token,
            #[inline(always)]
            || self.audit(),
        );
        if self.is_corrected.any() {
            self.weigh_again();
        }
        T::vectorize(
            token,
            #[inline(always)]
            || self.report_balance(),
        );
        probe.end(Phase::Update);
        let is_deep = self.tolerated().is_some_and(|tolerated| {
            T::vectorize(
                token,
                #[inline(always)]
                || self.measure(tolerated),
            )
        });
        if is_deep { Next::Project } else { Next::Finish }
    }

    /// Where a motor has left its branch, sets up the step with the next branch; true if any has.
    /// The other lanes keep their answers.
    fn revise(&mut self, problems: &mut [ContactProblem], probe: &mut dyn Probe) -> bool {
        let mut may_revise = 0;
        for (lane, n) in self.n_retaken[..T::LANES].iter().enumerate() {
            may_revise |= u32::from(*n < MOST_REVISIONS) << lane;
        }
        let lanes = self.going & T::mask(self.token, may_revise);
        let (drives, machine) = (&mut self.drives, &*self.machine);
        let (v, v_end) = (&self.v, &self.v_end);
        self.retaken = T::vectorize(
            self.token,
            #[inline(always)]
            || drives.revise(machine, lanes, v, v_end),
        );
        if !self.retaken.any() {
            return false;
        }
        for lane in (0..T::LANES).filter(|&lane| self.retaken.get(lane)) {
            self.n_retaken[lane] += 1;
            (self.contacts).recall(lane, &self.memories[lane], &mut problems[lane].p);
        }
        self.set_up(problems, false, probe);
        true
    }

    #[inline(always)]
    fn move_on(&mut self, problems: &[ContactProblem]) {
        self.rows
            .read(&self.contacts, problems, Answer::Impulses, &mut self.p);
        self.rows
            .read(&self.contacts, problems, Answer::Velocities, &mut self.u);
        self.yields.unshift(&self.contacts, &self.p, &mut self.u);
        self.rows
            .add_impulses(&self.contacts, self.occupied, &self.p, &mut self.y);
        self.factor.half_solve_back(&self.machine, &mut self.y);
        for ((end, v), change) in self.v_end.iter_mut().zip(&self.v).zip(&self.y) {
            *end = *v + *change;
        }
        let share = self.options.theta * self.options.time_step;
        self.end
            .set_moved(&self.machine, &self.middle, &self.v_end, share);
        self.end.normalise();
        self.find_impacts();
        self.contact_work = self.contact_work();
    }

    /// Finds the contacts in impact, as [`crate::integrator::step_contacts`] does.
    #[inline(always)]
    fn find_impacts(&mut self) {
        let (h, _) = self.time_step();
        let slow = (h.like(2.0) * self.gravity.norm() * h).max(h.like(1e-9));
        self.has_impact = T::mask(self.token, 0);
        for &slot in self.contacts.used() {
            let active = self.contacts.slot(slot).active;
            let is_fast = active & !self.rows.u_before[slot][0].abs().le(slow);
            self.impact[slot] = is_fast;
            self.has_impact = self.has_impact | is_fast;
        }
        if (self.has_impact & self.going).any() {
            self.compare_impulses();
        }
    }

    /// Leaves those in impact whose approach the last step's impulses would not have stopped.
    #[inline(always)]
    fn compare_impulses(&mut self) {
        let zero = self.number(0.0);
        for &slot in self.contacts.used() {
            for ((change, p), last) in
                (self.pushes[slot].iter_mut().zip(&self.p[slot])).zip(&self.p_last[slot])
            {
                *change = *p - *last;
            }
        }
        self.y.fill(zero);
        self.rows
            .add_impulses(&self.contacts, self.occupied, &self.pushes, &mut self.y);
        self.rows.local(&self.contacts, &self.y, &mut self.pushes);
        self.has_impact = T::mask(self.token, 0);
        for &slot in self.contacts.used() {
            let before = self.rows.u_before[slot][0];
            let change = self.pushes[slot][0] - before;
            let is_steady = change.abs().le(zero.like(STEADY) * before.abs());
            self.impact[slot] = self.impact[slot] & !is_steady;
            self.has_impact = self.has_impact | self.impact[slot];
        }
    }

    /// Work of the contacts by their law, J, as [`crate::integrator::step_contacts`] counts it.
    #[inline(always)]
    fn contact_work(&self) -> T {
        let (zero, half) = (self.number(0.0), self.number(0.5));
        let persists = self.persists & !self.has_impact;
        let (mut ends, mut changes, mut struck) = (zero, zero, zero);
        for &slot in self.contacts.used() {
            let ([p_n, p_t, p_b], [u_n, u_t, u_b]) = (self.p[slot], self.u[slot]);
            let ([_, last_t, last_b], before) = (self.p_last[slot], self.rows.u_before[slot]);
            let active = self.contacts.slot(slot).active;
            let end = p_t * u_t + p_b * u_b;
            let change = (p_t - last_t) * before[1] + (p_b - last_b) * before[2];
            ends += T::select(active, end, zero);
            changes += T::select(active, change, zero);
            if self.impact[slot].any() {
                let both = p_n * (u_n + before[0]) + p_t * before[1] + p_b * before[2];
                struck += T::select(self.impact[slot], half * (both - end), zero);
            }
        }
        if !persists.any() {
            return ends + struck;
        }
        let mut start = zero;
        for (v, push) in self.v.iter().zip(&self.persistent) {
            start += *v * *push;
        }
        T::select(persists, half * (ends + changes + start), ends + struck)
    }

    /// Declines the lanes whose step does not balance.
    #[inline(always)]
    fn audit(&mut self) {
        let (h, theta) = self.time_step();
        let places = &self.start.joints;
        let work = self
            .drives
            .work(&self.machine, (h, theta), places, [&self.v, &self.v_end]);
        let ([kinetic, potential], [end_kinetic, end_potential]) = (self.before, self.after);
        self.released = h.like(0.0);
        if !self.yields.is_empty() {
            let (contacts, before) = (&self.contacts, &self.rows.u_before);
            let h = self.options.time_step;
            self.released = self.yields.supplied(contacts, h, &self.p, &self.u, before);
        }
        let supplied = work + self.released;
        self.work = supplied;
        let excess = (end_kinetic - kinetic) + (end_potential - potential) - supplied;
        let fall = self.gravity.norm() * h;
        let least = h.like(0.5) * self.inertias.mass * fall * fall;
        let size = kinetic.max(end_kinetic).max(least);
        let sum =
            kinetic.abs() + end_kinetic.abs() + potential.abs() + end_potential.abs() + work.abs();
        let rounding = h.like(ROUNDINGS * f64::EPSILON) * sum;
        let mut in_touch = T::mask(self.token, 0);
        for &slot in self.contacts.used() {
            in_touch = in_touch | self.contacts.slot(slot).active;
        }
        let is_free = if self.options.theta <= 0.5 {
            !in_touch
        } else {
            T::mask(self.token, 0)
        };
        let zero = h.like(0.0);
        let allowed = rounding + T::select(is_free, zero, h.like(GAIN) * size);
        let measured = T::select(is_free, excess.abs(), excess);
        let is_balanced = measured.le(allowed);
        let left = excess - end_kinetic;
        let is_left = !left.le(rounding + h.like(GAIN) * size);
        // What is not finite is not within the bounds either.
        let is_coarse = !measured.le(h.like(COARSE) * size) | is_left;
        self.decline(Decline::Energy, is_coarse & !is_balanced);
        self.is_corrected = !is_balanced & self.going;
        if self.is_corrected.any() {
            self.correct(excess, !in_touch, is_free);
        }
        let gain = (excess - rounding).max(zero) / size.max(h.like(f64::MIN_POSITIVE));
        let gain = T::select(self.is_corrected, zero, gain);
        let removed = T::select(self.is_corrected, excess.max(zero), zero);
        self.removed = removed;
        self.gain = gain;
    }

    /// Removes an excess of energy from the velocity at the end of the step, as
    /// [`crate::integrator::energy_audit`] does.
    #[inline(always)]
    fn correct(&mut self, excess: T, untouched: T::Mask, is_free: T::Mask) {
        let zero = excess.like(0.0);
        let one = excess.like(1.0);
        let [kinetic, _] = self.after;
        let (lanes, mass) = (self.is_corrected, self.inertias.mass);
        let momentum = self.momentum;
        let whole = momentum.dot(momentum) / (mass.like(2.0) * mass);
        let relative = kinetic - whole;
        let is_relative = untouched & (is_free | zero.lt(excess)) & excess.lt(relative);
        let all = (one - excess / kinetic).max(zero).sqrt();
        let of_relative = (one - excess / relative).min(one.like(1.0 + RAISE)).sqrt();
        let share = T::select(is_relative, of_relative, all);
        // Free flight that loses more than its relative energy is left as it is.
        let lanes = lanes & (is_relative | zero.lt(excess));
        let translation = momentum * (one / mass);
        let common = [translation.x, translation.y, translation.z];
        for (k, v) in self.v_end.iter_mut().enumerate() {
            let common = if k < 3 {
                T::select(is_relative, common[k], zero)
            } else {
                zero
            };
            *v = T::select(lanes, common + share * (*v - common), *v);
        }
        let shortened = lanes & !is_relative;
        for &slot in self.contacts.used() {
            for u in &mut self.u[slot] {
                *u = T::select(shortened, *u * share, *u);
            }
        }
    }

    /// Energy of the lanes whose velocity was corrected.
    fn weigh_again(&mut self) {
        let after = self.energy(State::End).0.kinetic_and_potential();
        self.after = select_both(self.is_corrected, after, self.after);
    }

    /// Enters the balance of the energy into the reports.
    #[inline(always)]
    fn report_balance(&mut self) {
        let [kinetic, potential] = self.before;
        let change = (self.after[0] - kinetic) + (self.after[1] - potential);
        let lost = self.contact_work - (change - self.work) - self.removed;
        let mut entries = [[0.0; MAX_LANES]; 5];
        let balance = [
            self.gain,
            self.removed,
            self.contact_work,
            lost,
            self.released,
        ];
        for (entry, x) in entries.iter_mut().zip(balance) {
            x.store(&mut entry[..T::LANES]);
        }
        for (lane, report) in self.reports[..T::LANES].iter_mut().enumerate() {
            report.energy_gain = entries[0][lane];
            report.energy_removed = entries[1][lane];
            report.energy_dissipated = -entries[2][lane];
            report.energy_lost = entries[3][lane];
            report.energy_released = entries[4][lane];
        }
    }

    /// Penetration that is tolerated, m, if positions are projected.
    fn tolerated(&self) -> Option<f64> {
        (self.options.stabilisation == Stabilisation::Projection)
            .then_some(self.options.penetration_tolerance)
    }

    /// Predicts the gaps at the end of the step; true if a lane's position must be projected.
    #[inline(always)]
    fn measure(&mut self, tolerated: f64) -> bool {
        let (h, theta) = self.time_step();
        let zero = h.like(0.0);
        let mut deepest = zero;
        for &slot in self.contacts.used() {
            deepest = deepest.min(self.gap_at_end(slot, h, theta));
        }
        self.deepest = deepest;
        self.is_deep = deepest.lt(zero.like(-tolerated)) & self.going;
        self.is_deep.any()
    }

    /// Gap of a slot after the step, m; 0 where it is negative and opening.
    #[inline(always)]
    fn gap_at_end(&self, slot: usize, h: T, theta: T) -> T {
        let zero = h.like(0.0);
        let own = self.contacts.slot(slot);
        let (u, before) = (self.u[slot][0], self.rows.u_before[slot][0]);
        let mut gap = own.gap + theta * h * (u - before);
        if !self.yields.is_empty() {
            let is_soft = zero.lt(self.yields.diagonal[slot]);
            gap = T::select(is_soft, self.yields.unexplained[slot], gap);
        }
        let parts = gap.lt(zero) & !(gap + h * u).lt(zero);
        let gap = T::select(parts, zero, gap);
        T::select(own.active, gap, zero)
    }

    /// Turns the problems into those of the position projection; none where nothing penetrates.
    ///
    /// # Panics
    /// If there are fewer problems than lanes.
    pub fn set_gaps(&mut self, problems: &mut [ContactProblem]) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                let (h, theta) = self.time_step();
                for (lane, problem) in problems[..T::LANES].iter_mut().enumerate() {
                    if !self.is_deep.get(lane) {
                        problem.n_contacts = 0;
                    }
                    let n = problem.n_unknowns();
                    problem.q[..n].fill(0.0);
                    problem.p[..n].fill(0.0);
                    problem.factored.last.fill([0.0; 3]);
                }
                for &slot in self.contacts.used() {
                    let gap = self.gap_at_end(slot, h, theta);
                    let places = self.contacts.places(slot);
                    let active = self.contacts.slot(slot).active & self.is_deep;
                    for (lane, problem) in problems[..T::LANES].iter_mut().enumerate() {
                        if active.get(lane) {
                            problem.q[3 * usize::from(places[lane])] = gap.get(lane);
                        }
                    }
                }
            },
        );
    }

    /// Last part of a step. `problems`: those of [`Self::set_gaps`], solved, if a lane's position
    /// must be projected.
    ///
    /// # Panics
    /// If there are fewer problems than lanes.
    pub fn finish(&mut self, problems: Option<&[ContactProblem]>, probe: &mut dyn Probe) {
        let token = self.token;
        if let Some(problems) = problems.filter(|_| self.is_deep.any()) {
            self.project(&problems[..T::LANES]);
        }
        probe.end(Phase::Projection);
        T::vectorize(
            token,
            #[inline(always)]
            || self.accept(),
        );
        let going = self.going.bits();
        for lane in 0..T::LANES {
            if going >> lane & 1 == 1 {
                std::mem::swap(&mut self.memories[lane], &mut self.next_memories[lane]);
            }
        }
    }

    /// Moves the penetrating lanes by the displacement that the problems found.
    fn project(&mut self, problems: &[ContactProblem]) {
        let token = self.token;
        let mut unsolved = 0;
        for (lane, problem) in problems.iter().enumerate() {
            if self.is_deep.get(lane) {
                unsolved |= u32::from(!problem.is_solved) << lane;
                let report = &mut self.reports[lane];
                report.iterations += problem.iterations;
                report.factorisations += problem.iterations;
                report.residual = report.residual.max(problem.residual.relative);
            }
        }
        self.decline(Decline::Projection, T::mask(token, unsolved));
        T::vectorize(
            token,
            #[inline(always)]
            || self.displace(problems),
        );
        let lifted = self.energy(State::End).0.kinetic_and_potential();
        let is_moved = self.is_deep & self.going;
        let [kinetic, potential] = self.after;
        let work = self.drives.work_of_displacement(
            &self.machine,
            self.time_step(),
            &self.start.joints,
            [&self.v, &self.v_end, &self.y],
        );
        let gained = (lifted[0] - kinetic) + (lifted[1] - potential) - work;
        for (lane, report) in self.reports.iter_mut().enumerate().take(T::LANES) {
            if is_moved.get(lane) {
                report.energy_lifted = gained.get(lane).max(0.0);
                report.energy_lost += (-gained.get(lane)).max(0.0);
            }
        }
        self.after = select_both(is_moved, lifted, self.after);
    }

    #[inline(always)]
    fn displace(&mut self, problems: &[ContactProblem]) {
        let zero = self.number(0.0);
        let mut farthest = [0.0_f64; MAX_LANES];
        for (lane, problem) in problems.iter().enumerate() {
            let n = problem.n_unknowns();
            for (u, q) in problem.u[..n].iter().zip(&problem.q[..n]) {
                farthest[lane] = farthest[lane].max((u - q).abs());
            }
        }
        let farthest = T::load(self.token, &farthest[..T::LANES]);
        let mut pushes = std::mem::take(&mut self.pushes);
        self.rows
            .read(&self.contacts, problems, Answer::Impulses, &mut pushes);
        self.y.fill(zero);
        self.rows
            .add_impulses(&self.contacts, self.is_deep, &pushes, &mut self.y);
        self.pushes = pushes;
        self.factor.half_solve_back(&self.machine, &mut self.y);
        let size = displacement(&self.y).max(farthest);
        let limit = zero.like(-FARTHEST) * self.deepest;
        self.decline(Decline::Projection, !size.le(limit) & self.is_deep);
        let is_moved = self.is_deep & self.going;
        self.middle
            .set_moved(&self.machine, &self.end, &self.y, 1.0);
        self.middle.normalise();
        self.end.select_from(is_moved, &self.middle);
    }

    /// Makes the end of the step the state of the lanes that are still going.
    #[inline(always)]
    fn accept(&mut self) {
        let mut is_finite = self.end.is_finite();
        for v in &self.v_end {
            is_finite = is_finite & v.is_finite();
        }
        self.decline(Decline::NotFinite, !is_finite);
        let going = self.going;
        let (h, _) = self.time_step();
        let mut in_touch = T::mask(self.token, 0);
        for &slot in self.contacts.used() {
            in_touch = in_touch | self.contacts.slot(slot).active;
        }
        let persists = self.is_same & in_touch & !self.has_impact;
        let (contacts, end) = (&self.contacts, &self.poses_end);
        self.rows.generalized_impulse(
            &self.machine,
            contacts,
            end,
            going,
            &self.p,
            &mut self.pushed,
        );
        for (own, pushed) in self.persistent.iter_mut().zip(&self.pushed) {
            *own = T::select(going, *pushed, *own);
        }
        self.has_persistent = (self.has_persistent & !going) | (persists & going);
        self.start.select_from(going, &self.end);
        for (v, end) in self.v.iter_mut().zip(&self.v_end) {
            *v = T::select(going, *end, *v);
        }
        for (before, after) in self.before.iter_mut().zip(self.after) {
            *before = T::select(going, after, *before);
        }
        self.time = T::select(going, self.time + h, self.time);
        self.drives.accept(going);
    }
}

/// A state of a block.
#[derive(Clone, Copy, Debug)]
enum State {
    Start,
    End,
}

/// `yes` in the lanes of a mask, `no` elsewhere.
#[inline(always)]
fn select_both<T: Lane>(lanes: T::Mask, yes: [T; 2], no: [T; 2]) -> [T; 2] {
    [0, 1].map(|k| T::select(lanes, yes[k], no[k]))
}

/// Angular speeds of the trunk, of the fastest joint that turns a frame, and of the fastest spinner
/// about its axle, rad/s.
#[inline(always)]
fn fastest<T: Lane>(machine: &Machine, v: &[T]) -> (T, T, T) {
    let [x, y, z] = [v[3], v[4], v[5]];
    let zero = x.like(0.0);
    let (mut joints, mut spin) = (zero, zero);
    for &(k, ratio) in &machine.turning {
        joints = (v[k].abs() * v[k].like(ratio)).max(joints);
    }
    for &k in &machine.spinning {
        spin = v[k].abs().max(spin);
    }
    ((x * x + y * y + z * z).sqrt(), joints, spin)
}

/// Largest displacement: of the base, and of the joints at their arm, m.
#[inline(always)]
fn displacement<T: Lane>(y: &[T]) -> T {
    let mut largest = y[0].like(0.0);
    for (k, y) in y.iter().enumerate() {
        let arm = if k < BASE { 1.0 } else { JOINT_ARM };
        largest = (y.abs() * y.like(arm)).max(largest);
    }
    largest
}
