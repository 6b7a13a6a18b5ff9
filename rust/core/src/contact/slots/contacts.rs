//! Contacts of a block, in slots: of the wheels with the ground, of other bodies, and of joints
//! with their stops.
//!
//! A wheel with one circle, a thin disc or a torus, has three slots: most touch the plane or a
//! sphere, some both or two spheres. A wheel with two circles has four, of which each circle on the
//! plane has its own and spheres take the free ones. A slot is filled lane by lane; rovers that
//! share it may touch different things there. Detection at the midpoint of the step and relocation
//! to its end follow [`crate::contact`] and [`crate::geometry::query`]. With the unit normal n, the
//! unit axle s and the rolling direction `t = n × s / |n × s|`, the lowest point of a circle over a
//! plane lies along `t × s` from its centre.
//!
//! What is rare is found lane by lane (`lane_detection`): a wheel that nearly lies flat, passes a
//! sphere within the step, touches more things than it has slots, or an edge of a surface, and a
//! body near the ground or another one. A lane with more contacts than a problem has falls back.
//!
//! A rover has a list of contacts for each of its clusters (`clusters`), and the places in it are
//! those in the cluster's problem. Where clusters touch, all their contacts are in the list of the
//! first.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector3;

use super::by_lane::ByLane;
use super::ground::{BlockGround, GroundSphere, turning};
use super::machine::{SharedMachine, Stop};
use super::parts::{BodyTwist, Parts};
use super::pieces::LanePlane;
use crate::contact::detection::touch_of_wheel;
use crate::contact::{Activation, Contact, ContactFrame, ContactKey, Opposite, Part, rollers};
use crate::geometry::query::disc_plane::{FLAT, rolling, to_lowest};
use crate::geometry::query::section::Section;
use crate::geometry::query::sweep::DEEP;
use crate::geometry::query::{CIRCLE, NEAREST};
use crate::geometry::{Disc, Roller, Sphere};
use crate::multibody::{Model, Poses};
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3, inlined};
use crate::solver::batch::problem::{MAX_CONTACTS, MAX_LARGE};

/// Number of the plane in every terrain that has one.
const PLANE: u32 = 0;

/// A contact, of the same wheel or stop in every lane.
#[derive(Clone, Copy, Debug)]
pub struct Slot<T: Lane> {
    /// Lanes where the slot holds a contact. Elsewhere the other fields mean nothing.
    pub active: T::Mask,
    /// Point of the wheel relative to the origin of its tree, m.
    pub point: Vec3<T>,
    /// Normal, from the ground to the wheel.
    pub n: Vec3<T>,
    /// Rolling direction, or the axis of rollers (`crate::contact::rollers`).
    pub t: Vec3<T>,
    /// `t × n`, or zero.
    pub b: Vec3<T>,
    /// m.
    pub gap: T,
    on_sphere: T::Mask,
    sphere: GroundSphere<T>,
    /// The plane that it stands on where the ground is a surface.
    pub(crate) plane: LanePlane<T>,
}

impl<T: Lane> Slot<T> {
    /// Completes the frame of a wheel from its normal and rolling direction.
    #[inline(always)]
    fn finish_frame(&mut self, rollers: Option<[f64; 2]>, across: Option<f64>) {
        self.b = self.t.cross(self.n);
        if let Some(angle) = rollers {
            self.t = rollers::axis_of(self.t, self.b, angle);
            let zero = self.gap.like(0.0);
            self.b = Vec3::new(zero, zero, zero);
        } else if let Some(across) = across {
            self.b = self.b * self.gap.like(across);
        }
    }
}

/// A circle of a wheel over a plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stand<T: Lane> {
    /// m.
    pub gap: T,
    /// Lanes where the circle is a contact.
    pub admitted: T::Mask,
    /// Lanes where the circle lies so flat that more than one point may touch.
    pub lies: T::Mask,
}

/// Heights of a tree's origin over the plane, m.
#[derive(Clone, Copy, Debug)]
struct Heights<T> {
    /// At the midpoint; over the plane that wheels stand on; at the end.
    middle: T,
    for_wheels: T,
    end: T,
}

/// The contacts of a rover's problem in the order of detection.
#[derive(Clone, Copy, Debug)]
pub struct ContactList {
    /// Their number, at most [`MAX_CONTACTS`].
    pub n: usize,
    /// Slot of each.
    pub slots: [u16; MAX_CONTACTS],
    /// What the next step knows each by.
    pub keys: [ContactKey; MAX_CONTACTS],
}

/// The contacts of a block.
#[derive(Clone, Debug)]
pub struct ContactSlots<T: Lane> {
    pub(crate) token: T::Token,
    pub(crate) parts: Parts,
    pub(crate) by_lane: ByLane,
    pub(crate) stops: Vec<Stop>,
    /// End at which the joint of each stop is: 1 the lower, −1 the upper, 0 none.
    pub(crate) ends: Vec<T>,
    /// Joints with dry friction.
    pub(crate) rubbing: Vec<usize>,
    /// The first spare slot, and the first slot of a joint.
    first_spare: usize,
    pub(crate) first_of_joints: usize,
    twists: Vec<BodyTwist<T>>,
    pub(crate) slots: Vec<Slot<T>>,
    /// Part of each slot: a wheel, or, counted on from the wheels, a spare slot or a joint.
    pub(crate) part_of: Vec<usize>,
    heights: Vec<Heights<T>>,
    /// Cluster of each body, and of each slot that is not for contacts between bodies.
    cluster_of_body: Vec<usize>,
    cluster_of: Vec<Option<usize>>,
    pub(crate) used: Vec<usize>,
    /// Number of slots in use that are not of joints.
    n_of_shapes: usize,
    /// Contact data of each cluster.
    clusters: Vec<InCluster>,
    /// Lanes with a problem that has factors.
    factored: u32,
    /// Lanes in which clusters touch each other.
    joined: u32,
    /// Contacts of each problem, at `cluster * T::LANES + lane`.
    lists: Vec<ContactList>,
    /// Whether every slot in use is active in all lanes.
    is_full: bool,
    /// Problem of each slot's contact in each lane, and the contact's place in that problem.
    problem_indices: Vec<[u16; MAX_LANES]>,
    places: Vec<[u8; MAX_LANES]>,
    /// Lanes in which each slot's contact is in a problem with factors.
    near: Vec<u32>,
}

/// What is known of a cluster's contacts.
#[derive(Clone, Debug)]
struct InCluster {
    /// Most contacts of a problem with the whole operator, dry joints among them.
    most_dense: usize,
    n_dry: usize,
    /// Whether wheels are thin and rigid, and whether loops tie several trees.
    has_rigid_discs: bool,
    is_tied: bool,
    /// The cluster whose list has its contacts, in each lane.
    leader: [u16; MAX_LANES],
    /// Number of its velocities, and those of the clusters before it in that list.
    nv: u16,
    first_column: [u16; MAX_LANES],
    /// Lanes with contacts between its bodies, or with another cluster's.
    touches: u32,
    /// Lanes whose list has a problem with factors.
    factored: u32,
    /// Slots of the cluster in use in lanes whose problem has the whole operator.
    dense: Vec<usize>,
}

/// What a detection looks at.
pub struct DetectionInput<'a, T: Lane> {
    /// The machine.
    pub machine: &'a SharedMachine,
    /// Model of each lane.
    pub models: &'a [Option<Arc<Model>>],
    /// Lanes of the step.
    pub going: u32,
    /// Poses at the midpoint of the step, where gaps are measured.
    pub middle: &'a Poses<T>,
    /// Poses at the predicted end of the step.
    pub end: &'a Poses<T>,
    /// Velocity (nv) before the step.
    pub v: &'a [T],
    /// Whether the piece of a surface that a wheel touches matters, since materials may differ.
    pub needs_pieces: bool,
    /// Which candidates are contacts.
    pub activation: &'a Activation<T>,
}

impl<T: Lane> ContactSlots<T> {
    /// Room for a machine.
    #[must_use]
    pub fn new(token: T::Token, machine: &SharedMachine) -> Self {
        let parts = Parts::of(machine);
        let n_wheels = parts.wheels.len();
        let mut part_of: Vec<usize> = (parts.wheels.iter().enumerate())
            .flat_map(|(w, wheel)| std::iter::repeat_n(w, wheel.slots.len()))
            .collect();
        let first_spare = part_of.len();
        part_of.extend(n_wheels..n_wheels + machine.spares.len());
        let first_of_joints = part_of.len();
        let n_shapes = n_wheels + machine.spares.len();
        part_of.extend(n_shapes..n_shapes + machine.joints_with_slots().count());
        let n_slots = part_of.len();
        let cluster_of_body: Vec<usize> = (0..machine.n_bodies())
            .map(|body| machine.cluster_of(body))
            .collect();
        let bodies = machine.slot_bodies().into_iter();
        let zero = T::splat(token, 0.0);
        let nowhere = Vec3::new(zero, zero, zero);
        let slot = Slot {
            active: T::mask(token, 0),
            point: nowhere,
            n: nowhere,
            t: nowhere,
            b: nowhere,
            gap: zero,
            on_sphere: T::mask(token, 0),
            sphere: GroundSphere {
                centre: nowhere,
                radius: zero,
                number: zero,
            },
            plane: LanePlane {
                normal: nowhere,
                offset: zero,
            },
        };
        let twist = BodyTwist {
            angular: nowhere,
            linear: nowhere,
        };
        Self {
            token,
            twists: vec![twist; parts.n_carriers()],
            first_spare,
            first_of_joints,
            parts,
            stops: machine.stops.clone(),
            ends: vec![zero; machine.stops.len()],
            rubbing: machine.rubbing.clone(),
            slots: vec![slot; n_slots],
            by_lane: ByLane::new(machine, first_spare),
            part_of,
            heights: vec![
                Heights {
                    middle: zero,
                    for_wheels: zero,
                    end: zero,
                };
                machine.trees.len()
            ],
            cluster_of: bodies
                .map(|body| body.map(|body| cluster_of_body[body]))
                .collect(),
            cluster_of_body,
            used: Vec::with_capacity(n_slots),
            n_of_shapes: 0,
            clusters: (0..machine.n_problems())
                .map(|cluster| InCluster::new(machine, cluster))
                .collect(),
            factored: 0,
            joined: 0,
            lists: vec![ContactList::NONE; machine.n_problems() * T::LANES],
            is_full: false,
            problem_indices: vec![[0; MAX_LANES]; n_slots],
            places: vec![[0; MAX_LANES]; n_slots],
            near: vec![0; n_slots],
        }
    }

    /// Number of slots.
    #[must_use]
    pub fn n_slots(&self) -> usize {
        self.slots.len()
    }

    /// Slots with a contact in any lane, ascending.
    #[inline(always)]
    #[must_use]
    pub fn used(&self) -> &[usize] {
        &self.used
    }

    /// Slots in use that are not of joints, ascending.
    #[inline(always)]
    pub(crate) fn used_by_shapes(&self) -> &[usize] {
        &self.used[..self.n_of_shapes]
    }

    /// Slots of joints in use, ascending; they follow all others.
    #[inline(always)]
    pub(crate) fn used_by_joints(&self) -> &[usize] {
        &self.used[self.n_of_shapes..]
    }

    /// Slots of a cluster in use in any lane whose problem has the whole operator.
    #[inline(always)]
    pub(crate) fn used_densely(&self, cluster: usize) -> &[usize] {
        if self.factored == 0 && self.clusters.len() == 1 {
            &self.used
        } else {
            &self.clusters[cluster].dense
        }
    }

    /// Lanes with a problem that has the factors of its operator.
    #[inline(always)]
    pub(crate) fn factored(&self) -> u32 {
        self.factored
    }

    /// Lanes in which a slot's contact is in a problem that has the factors of its operator.
    #[inline(always)]
    pub(crate) fn near(&self, slot: usize) -> u32 {
        if self.factored == 0 {
            0
        } else {
            self.near[slot]
        }
    }

    /// Slots in use with a contact in a problem that has the factors of its operator.
    #[inline(always)]
    pub(crate) fn used_nearby(&self) -> impl Iterator<Item = usize> {
        let used = self.used.iter().copied();
        used.filter(
            #[inline(always)]
            |slot| self.near[*slot] != 0,
        )
    }

    /// The cluster of a slot that is not for contacts between bodies.
    #[inline(always)]
    pub(crate) fn cluster_of(&self, slot: usize) -> Option<usize> {
        self.cluster_of[slot]
    }

    /// The first cluster of a cluster's group in a lane.
    #[inline(always)]
    pub(crate) fn leader(&self, cluster: usize, lane: usize) -> usize {
        self.clusters[cluster].leader[lane].into()
    }

    /// The cluster of the body that a slot's contact is on in a lane.
    #[inline(always)]
    pub(crate) fn own_cluster(&self, slot: usize, lane: usize) -> usize {
        self.cluster_of[slot].unwrap_or_else(|| {
            let contact = self.by_lane.contact(slot, lane);
            contact.map_or(0, |contact| self.cluster_of_body[contact.body])
        })
    }

    /// Lanes in which clusters touch each other.
    #[inline(always)]
    pub(crate) fn joined(&self) -> u32 {
        self.joined
    }

    /// Number of the clusters.
    #[inline(always)]
    pub(crate) fn n_clusters(&self) -> usize {
        self.clusters.len()
    }

    /// Number of problems: one of each cluster, and in it one of each lane.
    #[inline(always)]
    #[must_use]
    pub fn n_problems(&self) -> usize {
        self.lists.len()
    }

    /// Whether a problem has the factors of its operator.
    #[inline(always)]
    pub(crate) fn is_factored(&self, problem: usize) -> bool {
        let (cluster, lane) = (problem / T::LANES, problem % T::LANES);
        self.clusters[cluster].factored >> lane & 1 == 1
    }

    /// The clusters whose contacts are in a problem. `None` where no bodies touch each other: its
    /// own.
    #[inline(always)]
    pub(crate) fn members(&self, problem: usize) -> Option<impl Iterator<Item = usize> + '_> {
        let (cluster, lane) = (problem / T::LANES, problem % T::LANES);
        let touches = self.clusters[cluster].touches >> lane & 1 == 1;
        touches.then(|| {
            let all = self.clusters.iter().enumerate();
            all.filter(move |(_, own)| usize::from(own.leader[lane]) == cluster)
                .map(|(own, _)| own)
        })
    }

    /// Where a cluster's velocities begin in a problem that has all velocities, if it has them.
    #[inline(always)]
    pub(crate) fn first_column(&self, cluster: usize, problem: usize) -> Option<usize> {
        let (leader, lane) = (problem / T::LANES, problem % T::LANES);
        let own = &self.clusters[cluster];
        (usize::from(own.leader[lane]) == leader).then(|| own.first_column[lane].into())
    }

    /// Whether a problem with factors is solved with the operator that they give: that of rigid
    /// discs that push or tow each other.
    #[inline(always)]
    pub(crate) fn is_multiplied(&self, problem: usize) -> bool {
        let fits = self.lists[problem].n <= MAX_LARGE;
        let is_of_discs = |own: usize| self.clusters[own].has_rigid_discs;
        let has_lines = |own: usize| self.clusters[own].most_dense == 0;
        match self.members(problem) {
            None => {
                fits && self.clusters[problem / T::LANES].is_tied && is_of_discs(problem / T::LANES)
            }
            Some(mut members) => {
                let mut all = self.members(problem).into_iter().flatten();
                fits && members.any(is_of_discs) && !all.any(has_lines)
            }
        }
    }

    /// Number of dry joints in a problem.
    #[inline(always)]
    pub(crate) fn n_dry(&self, problem: usize) -> usize {
        let n = |cluster: usize| self.clusters[cluster].n_dry;
        match self.members(problem) {
            None => n(problem / T::LANES),
            Some(members) => members.map(n).sum(),
        }
    }

    /// A slot.
    #[inline(always)]
    #[must_use]
    pub fn slot(&self, slot: usize) -> &Slot<T> {
        &self.slots[slot]
    }

    /// Part of a slot: a wheel, or, counted on from the wheels, a spare slot or a joint.
    #[inline(always)]
    #[must_use]
    pub fn part(&self, slot: usize) -> usize {
        self.part_of[slot]
    }

    /// The contacts of a problem.
    #[inline(always)]
    #[must_use]
    pub fn list(&self, problem: usize) -> &ContactList {
        &self.lists[problem]
    }

    /// The problems of a lane.
    #[inline(always)]
    pub fn problems_of(&self, lane: usize) -> impl Iterator<Item = usize> + use<T> {
        (lane..self.lists.len()).step_by(T::LANES)
    }

    /// Whether every slot in use is active in all lanes: a contact's place is then the same in all.
    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.is_full
    }

    /// A contact of a problem by its place in the list, with its slot.
    #[must_use]
    pub fn contact(
        &self,
        machine: &SharedMachine,
        problem: usize,
        place: usize,
    ) -> (usize, Contact) {
        let (list, lane) = (&self.lists[problem], problem % T::LANES);
        let slot = usize::from(list.slots[place]);
        if let Some(contact) = self.by_lane.contact(slot, lane) {
            return (slot, *contact);
        }
        let (own, part) = (&self.slots[slot], self.part(slot));
        let n = Vector3::from(own.n.get(lane));
        let (part, body, frame) = if let Some((joint, row)) = self.joint_row(slot) {
            let (part, _) = row.names(joint, lane);
            let body = machine.joints[joint].body;
            (part, body, ContactFrame::of_normal(&n))
        } else {
            let (t, b) = (own.t.get(lane).into(), own.b.get(lane).into());
            (
                Part::Wheel(part),
                machine.wheels[part].body,
                ContactFrame { n, t, b },
            )
        };
        let contact = Contact {
            key: list.keys[place],
            part,
            body,
            other: None,
            point: own.point.get(lane).into(),
            frame,
            gap: own.gap.get(lane),
            excess: 0.0,
        };
        (slot, contact)
    }

    /// The contacts of a rover with their slots, problem by problem.
    pub(crate) fn all_of<'a>(
        &'a self,
        machine: &'a SharedMachine,
        lane: usize,
    ) -> impl Iterator<Item = (usize, Contact)> + 'a {
        self.problems_of(lane).flat_map(move |problem| {
            let places = 0..self.lists[problem].n;
            places.map(move |place| self.contact(machine, problem, place))
        })
    }

    /// The problem of each lane in which a slot is active.
    #[inline(always)]
    pub(crate) fn problem_indices(&self, slot: usize) -> &[u16; MAX_LANES] {
        &self.problem_indices[slot]
    }

    /// Place of a slot among the contacts of that problem.
    #[inline(always)]
    pub(crate) fn places(&self, slot: usize) -> &[u8; MAX_LANES] {
        &self.places[slot]
    }

    /// Finds the contacts of a step and moves them to its end. Returns the lanes that fall back.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn detect(
        &mut self,
        ground: &mut BlockGround<T>,
        input: &DetectionInput<'_, T>,
    ) -> T::Mask {
        inlined!(T::vectorize, self.token, self.look(ground, input))
    }

    /// Fills all slots with the contacts at the midpoint and evaluates them at the end.
    #[inline(always)]
    fn look(&mut self, ground: &mut BlockGround<T>, input: &DetectionInput<'_, T>) -> T::Mask {
        let DetectionInput { middle, end, v, .. } = *input;
        self.parts.find_twists(middle, v, &mut self.twists);
        self.by_lane.clear();
        for (tree, heights) in self.heights.iter_mut().enumerate() {
            let (middle, end) = (middle.origin_of(tree), end.origin_of(tree));
            *heights = Heights {
                middle: ground.height(middle),
                for_wheels: ground.height_for_wheels(middle),
                end: ground.height(end),
            };
        }
        self.used.clear();
        for w in 0..self.parts.wheels.len() {
            let tree = self.parts.wheels[w].tree;
            let heights = self.heights[tree];
            let mut rest = self.look_at_wheel(w, heights.for_wheels, ground, input);
            rest = rest | ground.beside_firm;
            let slots = self.parts.wheels[w].slots.clone();
            if self.slots[slots.clone()].iter().any(|own| own.active.any()) {
                let pose = &end.bodies[self.parts.wheels[w].body];
                let (s, centre) = (
                    self.parts.wheels[w].axle(pose),
                    self.parts.wheels[w].centre(pose),
                );
                for slot in slots.clone() {
                    if self.slots[slot].active.any() {
                        let own = &self.slots[slot].plane;
                        let plane = if ground.has_surfaces() {
                            (own.normal, own.height(end.origin_of(tree)))
                        } else {
                            (ground.normal, heights.end)
                        };
                        self.used.push(slot);
                        let place = slot - slots.start;
                        rest = rest | self.relocate((slot, place), plane, end, s, centre);
                    }
                }
            }
            if rest.any() {
                for slot in &mut self.slots[slots] {
                    slot.active = slot.active & !rest;
                }
                self.ask(Part::Wheel(w), rest, input);
            }
        }
        for b in 0..self.parts.boxes.len() {
            let height = self.heights[self.parts.boxes[b].tree].middle;
            let near = self.look_at_box(b, height, ground, input);
            self.ask(self.parts.boxes[b].part, near | ground.beside_firm, input);
        }
        let mut fallbacks = T::mask(self.token, 0);
        let meeting = if input.machine.has_pairs {
            self.find_meeting(input)
        } else {
            0
        };
        if self.by_lane.is_asked() || meeting != 0 {
            for slot in &mut self.slots[self.first_spare..self.first_of_joints] {
                slot.active = fallbacks;
            }
            fallbacks = self.find_by_lane(ground, input, meeting);
            let slots = self.slots[..self.first_of_joints].iter().enumerate();
            let used = slots.filter(|(_, own)| own.active.any());
            self.used.clear();
            self.used.extend(used.map(|(slot, _)| slot));
        }
        self.n_of_shapes = self.used.len();
        if input.machine.has_pairs {
            self.find_leaders();
        }
        fallbacks | self.list_contacts(ground)
    }

    /// Finds which clusters touch each other in which lanes.
    #[inline(always)]
    fn find_leaders(&mut self) {
        for (cluster, own) in self.clusters.iter_mut().enumerate() {
            own.leader = [narrow(cluster); MAX_LANES];
            own.first_column = [0; MAX_LANES];
            own.touches = 0;
        }
        self.joined = 0;
        let mut lanes = 0_u32;
        for (lane, bodies) in self.by_lane.pairs() {
            lanes |= 1 << lane;
            let both = bodies.map(|body| {
                let own = &mut self.clusters[self.cluster_of_body[body]];
                own.touches |= 1 << lane;
                own.leader[lane]
            });
            let first = both[0].min(both[1]);
            self.joined |= u32::from(both[0] != both[1]) << lane;
            for own in &mut self.clusters {
                if both.contains(&own.leader[lane]) {
                    own.leader[lane] = first;
                }
            }
        }
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            for cluster in 0..self.clusters.len() {
                let (before, rest) = self.clusters.split_at_mut(cluster);
                let own = &mut rest[0];
                let same = before.iter().rev();
                let mut same = same.filter(|other| other.leader[lane] == own.leader[lane]);
                own.first_column[lane] =
                    (same.next()).map_or(0, |other| other.first_column[lane] + other.nv);
            }
        }
    }

    /// Lanes in which bodies may touch each other: trees whose bounding balls about their origins
    /// meet, or a tree that can touch itself.
    #[inline(always)]
    fn find_meeting(&self, input: &DetectionInput<'_, T>) -> u32 {
        let n = self.heights.len();
        if input.machine.touches_itself || input.activation.lead.abs() > 0.0 {
            return input.going;
        }
        let zero = T::splat(self.token, 0.0);
        let size = |tree: usize| {
            let mut size = zero;
            for wheel in self.parts.wheels.iter().filter(|own| own.tree == tree) {
                let centre = wheel.centre(&input.middle.bodies[wheel.body]);
                size = size.max(centre.norm() + zero.like(wheel.bound));
            }
            for solid in self.parts.boxes.iter().filter(|own| own.tree == tree) {
                let centre = solid.centre(&input.middle.bodies[solid.body]);
                size = size.max(centre.norm() + zero.like(solid.bound));
            }
            size
        };
        let mut meeting = 0;
        for a in 1..n {
            let reach = size(a) + input.activation.hover;
            for b in 0..a {
                let way = input.middle.origin_of(a) - input.middle.origin_of(b);
                meeting |= way.norm().le(reach + size(b)).bits();
            }
        }
        meeting & input.going
    }

    /// Asks for the contacts of a part in the lanes of a mask.
    #[inline(always)]
    fn ask(&mut self, part: Part, lanes: T::Mask, input: &DetectionInput<'_, T>) {
        let lanes = lanes.bits() & input.going;
        if lanes != 0 {
            self.by_lane.ask(part, lanes);
        }
    }

    /// Whether a box may touch the ground.
    #[inline(always)]
    fn look_at_box(
        &mut self,
        number: usize,
        height: T,
        ground: &mut BlockGround<T>,
        input: &DetectionInput<'_, T>,
    ) -> T::Mask {
        let solid = &self.parts.boxes[number];
        let pose = &input.middle.bodies[solid.body];
        let n = ground.normal;
        let (centre, R) = (solid.centre(pose), solid.axes(pose));
        let reach = (input.activation).reach(
            #[inline(always)]
            || solid.speed(&self.twists[solid.carrier], centre),
        );
        let local = R.transpose_times(n);
        let half = Vec3::splat(self.token, solid.half_size);
        let drop = (local.x * half.x).abs() + (local.y * half.y).abs() + (local.z * half.z).abs();
        let near_plane = (height + n.dot(centre) - drop).le(reach);
        if !ground.has_spheres() && !ground.has_surfaces() {
            return near_plane;
        }
        let at_end = &input.end.bodies[solid.body];
        let (from, to) = (
            input.middle.origin_of(solid.tree),
            input.end.origin_of(solid.tree),
        );
        let shift = to - from + (solid.centre(at_end) - centre);
        let bound = T::splat(self.token, solid.bound);
        let motion = shift.norm() + turning(&at_end.R, &pose.R) * bound;
        let world = from + centre;
        let near = ground.is_near_box(number, world, &R, solid.half_size, (reach, motion));
        near_plane | near
    }

    /// Fills the slots of a wheel with its contacts at the midpoint. Returns where they must be
    /// found lane by lane.
    #[inline(always)]
    fn look_at_wheel(
        &mut self,
        w: usize,
        height: T,
        ground: &mut BlockGround<T>,
        input: &DetectionInput<'_, T>,
    ) -> T::Mask {
        let wheel = &self.parts.wheels[w];
        let pose = &input.middle.bodies[wheel.body];
        let (s, centre) = (wheel.axle(pose), wheel.centre(pose));
        // The second and third point of the rim, and all that may come near.
        let reach = (input.activation).reach(
            #[inline(always)]
            || wheel.speed(&self.twists[wheel.carrier], (s, centre)),
        );
        let none = T::mask(self.token, 0);
        let (mut rest, mut on_pieces) = (none, none);
        let (first, n_circles) = (wheel.slots.start, wheel.n_circles());
        let mut plane = (ground.normal, height);
        if ground.has_surfaces() {
            let origin = input.middle.origin_of(wheel.tree);
            rest = ground.find_plane(w, origin + centre, wheel.bound, reach);
            let own = ground.under_wheel(w);
            plane = (own.normal, own.height(origin));
            for slot in &mut self.slots[wheel.slots.clone()] {
                slot.plane = own;
            }
            if input.needs_pieces {
                rest = rest | ground.on_surface();
            } else if n_circles == 1 {
                on_pieces = rest & T::mask(self.token, input.going);
                rest = rest & !on_pieces;
            }
        }
        for slot in &mut self.slots[wheel.slots.clone()] {
            (slot.active, slot.on_sphere) = (none, none);
        }
        for circle in 0..n_circles {
            let stand = self.stands((w, circle), plane, input, (s, centre), reach);
            self.slots[first + circle].active = stand.admitted;
            rest = rest | stand.lies;
            // Which of them count is told there.
            if n_circles > 1 && ground.has_surfaces() {
                rest = rest
                    | (ground.on_surface()
                        & stand.gap.lt(reach.like(-self.parts.wheels[w].shallow)));
            }
        }
        if on_pieces.any() {
            rest = rest | self.look_at_pieces((w, on_pieces), ground, input, (s, centre), reach);
        }
        if ground.has_spheres() {
            rest = rest | self.look_at_spheres(w, ground, input, s, centre, reach);
        }
        rest
    }

    /// Where a circle of a wheel with the axle `s` and the centre `centre` touches a plane of the
    /// normal n at the midpoint, the origin of its tree being at the given height (m) over it.
    #[inline(always)]
    pub(crate) fn stands(
        &self,
        (w, circle): (usize, usize),
        (n, base): (Vec3<T>, T),
        input: &DetectionInput<'_, T>,
        (s, centre): (Vec3<T>, Vec3<T>),
        reach: T,
    ) -> Stand<T> {
        let wheel = &self.parts.wheels[w];
        let radius = T::splat(self.token, wheel.section.radius);
        let (across, along) = (n.cross(s), n.dot(s));
        let length = across.norm();
        let mut from = centre;
        if wheel.is_wide() {
            from += s * radius.like(wheel.along(circle));
        }
        let height = base + n.dot(from);
        let rounding = radius.like(wheel.section.rounding);
        let gap = height - radius * length - rounding;
        let twist = &self.twists[wheel.carrier];
        let admitted = input.activation.admits(
            gap,
            #[inline(always)]
            || {
                let mut share = radius * along / length;
                if wheel.is_wide() {
                    share += radius.like(wheel.along(circle));
                }
                let lever = centre.cross(n) - across * share;
                n.dot(twist.linear) + twist.angular.dot(lever)
            },
        );
        let half = radius.like(0.5);
        Stand {
            gap,
            admitted,
            lies: (height + half * radius * length - rounding).le(reach),
        }
    }

    /// Adds the contacts of a wheel with spheres at the midpoint; it has the axle `s` and the
    /// centre `centre` there.
    #[inline(always)]
    fn look_at_spheres(
        &mut self,
        w: usize,
        ground: &mut BlockGround<T>,
        input: &DetectionInput<'_, T>,
        s: Vec3<T>,
        centre: Vec3<T>,
        reach: T,
    ) -> T::Mask {
        let wheel = &self.parts.wheels[w];
        let origin = input.middle.origin_of(wheel.tree);
        let at_end = wheel.centre(&input.end.bodies[wheel.body]);
        let half_way = input.end.origin_of(wheel.tree) - origin + at_end - centre;
        let motion = half_way.norm();
        let need = reach + motion;
        let mut rest = ground.look_around_wheel(w, origin + centre, wheel.bound, need);
        let twist = self.twists[wheel.carrier];
        let (section, spoke, slots) = (wheel.section, wheel.spoke, wheel.slots.clone());
        let pose = &input.middle.bodies[wheel.body];
        let spoke = || pose.R.times_shared(spoke);
        for sphere in ground.near_wheel(w) {
            let offset = sphere.centre - origin - centre;
            let gap = section.distance(s, offset) - sphere.radius;
            let is_deep = (gap - motion).lt(-(motion.like(DEEP) * sphere.radius));
            if is_deep.any() {
                rest = rest | self.passing(w, is_deep, sphere, input, half_way);
            }
            let admitted = input.activation.admits(
                gap,
                #[inline(always)]
                || {
                    let near = section.nearest(s, offset, spoke);
                    near.n.dot(twist.velocity(centre + near.point))
                },
            );
            if admitted.any() {
                rest = rest | self.enter(slots.clone(), admitted, sphere);
            }
        }
        rest
    }

    /// Enters a contact with a sphere into the first free one of some slots. Returns where none is.
    #[inline(always)]
    fn enter(
        &mut self,
        slots: Range<usize>,
        admitted: T::Mask,
        sphere: &GroundSphere<T>,
    ) -> T::Mask {
        let mut rest = admitted;
        for slot in &mut self.slots[slots] {
            let here = rest & !slot.active;
            rest = rest & slot.active;
            if here.any() {
                slot.active = slot.active | here;
                slot.on_sphere = slot.on_sphere | here;
                let own = &mut slot.sphere;
                own.centre = Vec3::select(here, sphere.centre, own.centre);
                own.radius = T::select(here, sphere.radius, own.radius);
                own.number = T::select(here, sphere.number, own.number);
            }
        }
        rest
    }

    /// Where a wheel passes a sphere within the step, of the lanes asked for.
    #[inline(always)]
    fn passing(
        &self,
        w: usize,
        asked: T::Mask,
        sphere: &GroundSphere<T>,
        input: &DetectionInput<'_, T>,
        half_way: Vec3<T>,
    ) -> T::Mask {
        let wheel = &self.parts.wheels[w];
        let pose = &input.middle.bodies[wheel.body];
        let (s, centre) = (wheel.axle(pose), wheel.centre(pose));
        let spoke = pose.R.times_shared(wheel.spoke);
        let mut lanes = asked.bits();
        let mut passes = 0;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let Section {
                radius,
                half,
                rounding,
            } = wheel.section;
            let own = Roller {
                core: Disc {
                    centre: centre.get(lane).into(),
                    axle: s.get(lane).into(),
                    spoke: spoke.get(lane).into(),
                    radius,
                },
                half,
                rounding,
            };
            let ball = Sphere::new(sphere.centre.get(lane).into(), sphere.radius.get(lane));
            let base = Vector3::from(input.middle.origin_of(wheel.tree).get(lane));
            let touch = touch_of_wheel(&own, &ball, &base, &half_way.get(lane).into());
            if touch.is_some() {
                passes |= 1 << lane;
            }
        }
        T::mask(self.token, passes)
    }

    /// Evaluates a slot at the end of the step, where the wheel has the axle `s` and the centre
    /// `centre`, and the origin of its tree the given height (m) over the plane of the given normal
    /// under the wheel. `place`: number of the slot among the wheel's. Returns where a frame is not
    /// defined.
    #[inline(always)]
    fn relocate(
        &mut self,
        (slot, place): (usize, usize),
        (n, height): (Vec3<T>, T),
        end: &Poses<T>,
        s: Vec3<T>,
        centre: Vec3<T>,
    ) -> T::Mask {
        let wheel = &self.parts.wheels[self.part_of[slot]];
        let slot = &mut self.slots[slot];
        let radius = T::splat(self.token, wheel.section.radius);
        let (one, flat) = (radius.like(1.0), radius.like(FLAT));
        let here = slot.on_sphere;
        let on_plane = slot.active & !here;
        let mut undefined = T::mask(self.token, 0);
        if on_plane.any() {
            let (t, length) = rolling(n, s);
            let mut circle = centre;
            if wheel.is_wide() {
                circle += s * radius.like(wheel.along(place));
            }
            slot.n = n;
            slot.t = t;
            slot.point = circle + to_lowest(t, s, radius);
            slot.gap = height + n.dot(circle) - radius * length;
            if wheel.is_wide() {
                let rounding = radius.like(wheel.section.rounding);
                slot.point -= n * rounding;
                slot.gap -= rounding;
            }
            undefined = on_plane & length.le(flat);
        }
        if here.any() {
            let offset = slot.sphere.centre - end.origin_of(wheel.tree) - centre;
            let spoke = || end.bodies[wheel.body].R.times_shared(wheel.spoke);
            let near = wheel.section.nearest(s, offset, spoke);
            let across = near.n.cross(s);
            let length = across.norm();
            let rolls = length.gt(flat);
            let mut t = across * (one / length);
            if (here & !rolls).any() {
                // A side face touches: along the rim.
                let rim = s.cross(near.outward);
                let rim = rim - near.n * near.n.dot(rim);
                t = Vec3::select(rolls, t, rim * (one / rim.norm()));
            }
            slot.n = Vec3::select(here, near.n, slot.n);
            slot.t = Vec3::select(here, t, slot.t);
            slot.point = Vec3::select(here, centre + near.point, slot.point);
            slot.gap = T::select(here, near.distance - slot.sphere.radius, slot.gap);
        }
        slot.finish_frame(wheel.rollers, wheel.across);
        undefined
    }

    /// Lists the contacts of every lane. Returns the lanes with too many.
    #[inline(always)]
    fn list_contacts(&mut self, ground: &BlockGround<T>) -> T::Mask {
        for list in &mut self.lists {
            list.n = 0;
        }
        self.is_full = true;
        let mut too_many = T::mask(self.token, 0);
        for i in 0..self.used.len() {
            too_many = too_many | self.list_slot(self.used[i], Some(ground));
        }
        self.choose_forms();
        too_many
    }

    /// Chooses the problems that have the factors of their operator: those with many contacts, and
    /// with contacts between bodies.
    #[inline(always)]
    pub(crate) fn choose_forms(&mut self) {
        self.factored = 0;
        for (own, lists) in self
            .clusters
            .iter_mut()
            .zip(self.lists.chunks_exact(T::LANES))
        {
            own.factored = own.touches;
            for (lane, list) in lists.iter().enumerate() {
                own.factored |= u32::from(list.n > own.most_dense) << lane;
            }
            self.factored |= own.factored;
        }
        if self.factored == 0 && self.clusters.len() == 1 {
            return;
        }
        for own in &mut self.clusters {
            own.dense.clear();
        }
        for &slot in &self.used {
            let active = self.slots[slot].active.bits();
            let Some(cluster) = self.cluster_of[slot] else {
                self.near[slot] = active;
                continue;
            };
            let own = &mut self.clusters[cluster];
            let near = active & own.factored;
            self.near[slot] = near;
            if active != near {
                own.dense.push(slot);
            }
        }
    }

    /// Lists the contacts of a slot, of a joint's without ground, after those of the slots before
    /// it. Returns the lanes that have too many.
    #[inline(always)]
    pub(crate) fn list_slot(&mut self, slot: usize, ground: Option<&BlockGround<T>>) -> T::Mask {
        let joint_row = self.joint_row(slot);
        let shown = match joint_row {
            Some(_) => NO_KEY,
            None => match self.parts.wheels.get(self.part_of[slot]) {
                Some(wheel) => {
                    let is_second = wheel.n_circles() > 1 && slot > wheel.slots.start;
                    let feature = if is_second { CIRCLE } else { NEAREST };
                    ContactKey::on_ground(Part::Wheel(self.part_of[slot]), feature, PLANE)
                }
                None => NO_KEY,
            },
        };
        let by_lane = &self.by_lane;
        let given = by_lane.given(slot);
        let cluster = self.cluster_of[slot];
        let own = &mut self.slots[slot];
        let on_sphere = own.on_sphere.bits();
        let mut numbers = [0.0; MAX_LANES];
        if on_sphere != 0 {
            own.sphere.number.store(&mut numbers[..T::LANES]);
        }
        let (problem_indices, places) = (&mut self.problem_indices[slot], &mut self.places[slot]);
        self.is_full &= own.active.all();
        let mut too_many = 0;
        let mut lanes = own.active.bits();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let cluster = match cluster {
                Some(cluster) => cluster,
                None => (by_lane.contact(slot, lane))
                    .map_or(0, |contact| self.cluster_of_body[contact.body]),
            };
            let problem_index = usize::from(self.clusters[cluster].leader[lane]) * T::LANES + lane;
            let list = &mut self.lists[problem_index];
            if list.n == MAX_CONTACTS {
                too_many |= 1 << lane;
                continue;
            }
            problem_indices[lane] = narrow(problem_index);
            places[lane] = small(list.n);
            list.slots[list.n] = narrow(slot);
            let mut key = shown;
            if given >> lane & 1 == 1 {
                if let Some(contact) = by_lane.contact(slot, lane) {
                    key = contact.key.lasting();
                }
            } else if on_sphere >> lane & 1 == 1 {
                key.feature = 0;
                key.opposite = Opposite::Ground(whole(numbers[lane]));
            } else if let Some((joint, row)) = joint_row {
                (_, key) = row.names(joint, lane);
            } else if ground.is_some_and(|ground| ground.is_surface(lane)) {
                // Which piece was found depends on when a search was made.
                key = key.on_surface().lasting();
            }
            list.keys[list.n] = key;
            list.n += 1;
        }
        if too_many != 0 {
            self.is_full = false;
            own.active = own.active & !T::mask(self.token, too_many);
        }
        T::mask(self.token, too_many)
    }
}

impl InCluster {
    fn new(machine: &SharedMachine, cluster: usize) -> Self {
        Self {
            most_dense: machine.most_dense(cluster),
            n_dry: machine.n_dry(cluster),
            has_rigid_discs: machine.has_rigid_discs(cluster),
            is_tied: machine.clusters.n_trees(cluster) > 1,
            leader: [narrow(cluster); MAX_LANES],
            nv: u16::try_from(machine.clusters.nv(cluster)).unwrap_or(u16::MAX),
            first_column: [0; MAX_LANES],
            touches: 0,
            factored: 0,
            dense: Vec::new(),
        }
    }
}

/// The key of no contact.
const NO_KEY: ContactKey = ContactKey {
    part: 0,
    feature: 0,
    opposite: Opposite::Stop,
};

impl ContactList {
    const NONE: Self = Self {
        n: 0,
        slots: [0; MAX_CONTACTS],
        keys: [NO_KEY; MAX_CONTACTS],
    };
}

/// A place, of which there are at most [`MAX_CONTACTS`].
#[inline(always)]
#[allow(clippy::cast_possible_truncation)] // less than 256
fn small(index: usize) -> u8 {
    index as u8
}

/// A slot, a cluster or a problem: a machine has less than 65 536 in all lanes.
#[inline(always)]
#[allow(clippy::cast_possible_truncation)] // a machine with more bodies would not fit in memory
fn narrow(index: usize) -> u16 {
    index as u16
}

/// Number of a primitive, kept in a lane.
#[inline(always)]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // it was a u32
fn whole(number: f64) -> u32 {
    number as u32
}
