//! Contacts of the wheels with the ground, in slots.
//!
//! Each wheel has two slots: most wheels touch the plane or a sphere, some both or two spheres. A
//! slot is filled lane by lane; rovers that share it may touch different things there. Detection
//! at the midpoint of the step and relocation to its end follow [`crate::contact`] and
//! [`crate::geometry::query`]. With the unit normal n, the unit axle s and the rolling direction
//! `t = n × s / |n × s|`, a wheel's lowest point over a plane lies along `t × s` from its centre.
//! The spin of a wheel moves that point along the ground alone, so the normal velocity comes from
//! the carrier.
//!
//! What is rare is declined: a wheel that nearly lies flat, passes a sphere within the step or
//! touches more than two things, a box near the ground, more than [`MAX_CONTACTS`] contacts.

use nalgebra::Vector3;

use super::ground::{Ground, GroundSphere, turning};
use super::machine::{Axis, Machine, velocity};
use super::poses::{Pose, Poses};
use super::problem::MAX_CONTACTS;
use crate::contact::detection::touch_of_disc;
use crate::contact::{Contact, ContactFrame, ContactKey, Part};
use crate::geometry::query::NEAREST;
use crate::geometry::query::sweep::DEEP;
use crate::geometry::{Disc, Sphere};
use crate::integrator::WarmStart;
use crate::scalar::{Lane, LaneMask, MAX_LANES, Mat3, Vec3};

/// Number of the plane in every terrain that has one.
const PLANE: u32 = 0;

/// Slots of a wheel.
pub const SLOTS: usize = 2;

/// Sine of the angle between axle and normal below which a wheel has no rolling direction.
const PARALLEL: f64 = 1e-9;

/// Lengths below which a direction is not taken from a difference, m.
const NO_DIRECTION: f64 = 1e-12;

/// Which candidates are contacts: [`crate::contact::Activation`] of each rover.
#[derive(Clone, Copy, Debug)]
pub struct Forecast<T> {
    /// The part of γ h that remains after the configuration in which gaps are measured, s.
    pub lead: f64,
    /// m.
    pub hover: T,
    /// m/s.
    pub slow: T,
}

impl<T: Lane> Forecast<T> {
    /// The forecast of a step of h seconds under gravity (m/s²), for gaps that are measured
    /// `measured` seconds after its start.
    #[inline(always)]
    pub fn new(gravity: Vec3<T>, h: f64, forecast: f64, measured: f64) -> Self {
        let g = gravity.norm();
        let least = g.like(1e-9);
        Self {
            lead: forecast * h - measured,
            hover: (g.like(0.5) * g * g.like(h) * g.like(h)).max(least),
            slow: (g.like(2.0) * g * g.like(h)).max(least),
        }
    }

    /// Whether the normal velocity decides for any rover with this gap, m.
    #[inline(always)]
    fn needs_velocity(&self, gap: T) -> bool {
        self.lead.abs() > 0.0 || (gap.gt(gap.like(0.0)) & gap.le(self.hover)).any()
    }

    /// Whether candidates with this gap (m) are contacts; `u_N`: normal velocity, m/s, which may be
    /// anything unless [`Self::needs_velocity`].
    #[inline(always)]
    fn admits(&self, gap: T, u_N: T) -> T::Mask {
        let zero = gap.like(0.0);
        let hovers = gap.le(self.hover) & u_N.abs().le(self.slow);
        if self.lead.abs() > 0.0 {
            !(gap + gap.like(self.lead) * u_N).gt(zero) | hovers
        } else {
            !gap.gt(zero) | hovers
        }
    }

    /// Distance from the surface within which a part no point of which is faster than `speed` (m/s)
    /// can be in contact, m.
    #[inline(always)]
    fn reach(&self, speed: impl FnOnce() -> T) -> T {
        if self.lead.abs() > 0.0 {
            let margin = speed();
            (margin * margin.like(self.lead.abs())).max(self.hover)
        } else {
            self.hover
        }
    }
}

/// A contact, of the same wheel in every lane.
#[derive(Clone, Copy, Debug)]
pub struct Slot<T: Lane> {
    /// Where it is a contact. Elsewhere the other fields mean nothing.
    pub active: T::Mask,
    /// Point of the wheel relative to the trunk's origin, m.
    pub point: Vec3<T>,
    /// Normal, from the ground to the wheel.
    pub n: Vec3<T>,
    /// Rolling direction.
    pub t: Vec3<T>,
    /// `t × n`.
    pub b: Vec3<T>,
    /// m.
    pub gap: T,
    on_sphere: T::Mask,
    sphere: GroundSphere<T>,
}

/// The contacts of one rover in the order of detection.
#[derive(Clone, Copy, Debug)]
pub struct Listed {
    /// Their number, at most [`MAX_CONTACTS`].
    pub n: usize,
    /// Slot of each.
    pub slots: [u8; MAX_CONTACTS],
    /// Number of the ground's primitive of each.
    pub primitives: [u32; MAX_CONTACTS],
}

/// A wheel, as contacts need it.
#[derive(Clone, Debug)]
struct Wheel {
    body: usize,
    centre: Option<[f64; 3]>,
    axle: Axle,
    spoke: [f64; 3],
    radius: f64,
    /// Twist of the body that moves its centre.
    carrier: usize,
    /// Velocity of the spin about its own axle that the carrier's twist lacks.
    spin: Option<usize>,
}

/// Where a wheel's axle comes from.
#[derive(Clone, Copy, Debug)]
enum Axle {
    /// Along the joint's axis, or against it.
    Joint(bool),
    /// A direction in the body's frame.
    Fixed([f64; 3]),
}

/// A box, as contacts need it.
#[derive(Clone, Debug)]
struct Solid {
    body: usize,
    centre: Option<[f64; 3]>,
    rotation: Option<[[f64; 3]; 3]>,
    half_size: [f64; 3],
    bound: f64,
    /// Twist of its body.
    carrier: usize,
}

/// A body whose twist is needed.
#[derive(Clone, Copy, Debug)]
struct Carrier {
    body: usize,
    /// Twist of the body that carries it.
    parent: usize,
}

/// Velocity of a body: angular, and of its material point at the trunk's origin.
#[derive(Clone, Copy, Debug)]
struct Twist<T> {
    angular: Vec3<T>,
    linear: Vec3<T>,
}

/// The contacts of a block.
#[derive(Clone, Debug)]
pub struct Contacts<T: Lane> {
    token: T::Token,
    wheels: Vec<Wheel>,
    boxes: Vec<Solid>,
    /// The trunk, then those that it carries.
    carriers: Vec<Carrier>,
    twists: Vec<Twist<T>>,
    slots: Vec<Slot<T>>,
    used: Vec<usize>,
    lists: [Listed; MAX_LANES],
    /// Place of each slot among the contacts of each lane.
    places: Vec<[u8; MAX_LANES]>,
}

/// What one detection looks at.
struct Sight<'a, T: Lane> {
    middle: &'a Poses<T>,
    end: &'a Poses<T>,
    v: &'a [T],
    forecast: &'a Forecast<T>,
    /// Height of the trunk's origin over the plane at the midpoint, m.
    height: T,
}

impl<T: Lane> Contacts<T> {
    /// Room for a machine.
    ///
    /// # Panics
    /// If it has more than 128 wheels.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        assert!(
            machine.wheels.len() <= 128,
            "invariant: slots are numbered by 8 bits"
        );
        let mut carriers = vec![Carrier { body: 0, parent: 0 }];
        let some = |x: [f64; 3]| (x != [0.0; 3]).then_some(x);
        let wheels: Vec<Wheel> = (machine.wheels.iter())
            .map(|wheel| {
                let link = &machine.links[wheel.body];
                let axle = if wheel.body > 0 {
                    axle_of(&link.axis, wheel.axle)
                } else {
                    Axle::Fixed(wheel.axle)
                };
                let spins = link.is_spinner && matches!(axle, Axle::Joint(_));
                let mover = if spins { link.parent } else { wheel.body };
                Wheel {
                    body: wheel.body,
                    centre: some(wheel.centre),
                    axle,
                    spoke: wheel.spoke,
                    radius: wheel.radius,
                    carrier: carrier_of(machine, mover, &mut carriers),
                    spin: spins.then(|| velocity(wheel.body)),
                }
            })
            .collect();
        let boxes = (machine.boxes.iter())
            .map(|solid| {
                let is_plain =
                    solid.rotation == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                Solid {
                    body: solid.body,
                    centre: some(solid.centre),
                    rotation: (!is_plain).then_some(solid.rotation),
                    half_size: solid.half_size,
                    bound: Vector3::from(solid.half_size).norm(),
                    carrier: carrier_of(machine, solid.body, &mut carriers),
                }
            })
            .collect();
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
        };
        let twist = Twist {
            angular: nowhere,
            linear: nowhere,
        };
        Self {
            token,
            twists: vec![twist; carriers.len()],
            carriers,
            slots: vec![slot; SLOTS * wheels.len()],
            used: Vec::with_capacity(SLOTS * wheels.len()),
            wheels,
            boxes,
            lists: [Listed::NONE; MAX_LANES],
            places: vec![[0; MAX_LANES]; SLOTS * machine.wheels.len()],
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

    /// A slot.
    #[inline(always)]
    #[must_use]
    pub fn slot(&self, slot: usize) -> &Slot<T> {
        &self.slots[slot]
    }

    /// Wheel of a slot.
    #[inline(always)]
    #[must_use]
    pub fn wheel(slot: usize) -> usize {
        slot / SLOTS
    }

    /// The contacts of a rover.
    #[inline(always)]
    #[must_use]
    pub fn list(&self, lane: usize) -> &Listed {
        &self.lists[lane]
    }

    /// A contact of a rover by its place in the list, with its slot.
    #[must_use]
    pub fn contact(&self, machine: &Machine, lane: usize, place: usize) -> (usize, Contact) {
        let list = &self.lists[lane];
        let slot = usize::from(list.slots[place]);
        let (own, wheel) = (&self.slots[slot], Self::wheel(slot));
        let frame = ContactFrame {
            n: own.n.get(lane).into(),
            t: own.t.get(lane).into(),
            b: own.b.get(lane).into(),
        };
        let contact = Contact {
            key: Self::key(list, place),
            part: Part::Wheel(wheel),
            body: machine.wheels[wheel].body,
            other: None,
            point: own.point.get(lane).into(),
            frame,
            gap: own.gap.get(lane),
        };
        (slot, contact)
    }

    /// Place of a slot among the contacts of each lane in which it is active.
    #[inline(always)]
    pub(super) fn places(&self, slot: usize) -> &[u8; MAX_LANES] {
        &self.places[slot]
    }

    /// Key of a rover's contact, by its place in the list.
    #[inline(always)]
    fn key(list: &Listed, place: usize) -> ContactKey {
        let wheel = Part::Wheel(Self::wheel(usize::from(list.slots[place])));
        ContactKey::on_ground(wheel, NEAREST, list.primitives[place])
    }

    /// Fills `p` (3 n_c) with the impulses that a rover remembers of its contacts, N s, zero for new
    /// ones. Returns whether the last step had exactly these contacts.
    #[inline(always)]
    pub fn recall(&self, lane: usize, memory: &WarmStart, p: &mut [f64]) -> bool {
        let list = &self.lists[lane];
        let mut is_same = memory.impulses.len() == list.n;
        for (place, out) in p.chunks_exact_mut(3).enumerate().take(list.n) {
            let wanted = Self::key(list, place);
            let same = memory.impulses.get(place);
            let known = if let Some((_, known)) = same.filter(|(key, _)| *key == wanted) {
                *known
            } else {
                is_same = false;
                let found = memory.impulses.iter().find(|(key, _)| *key == wanted);
                found.map_or([0.0; 3], |(_, known)| *known)
            };
            out.copy_from_slice(&known);
        }
        is_same
    }

    /// Makes a rover remember the impulses of its contacts, `p` (3 n_c), N s.
    #[inline(always)]
    pub fn remember(&self, lane: usize, p: &[f64], memory: &mut WarmStart) {
        let list = &self.lists[lane];
        memory.impulses.clear();
        for (place, p) in p.chunks_exact(3).enumerate().take(list.n) {
            let known = (Self::key(list, place), [p[0], p[1], p[2]]);
            memory.impulses.push(known);
        }
    }

    /// Finds the contacts of a step and moves them to its end.
    ///
    /// `middle` and `end`: poses at the midpoint of the step, where gaps are measured, and at its
    /// predicted end. `v`: velocity (nv) before the step. Returns the lanes that are declined.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn detect(
        &mut self,
        ground: &mut Ground<T>,
        middle: &Poses<T>,
        end: &Poses<T>,
        v: &[T],
        forecast: &Forecast<T>,
    ) -> T::Mask {
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.detect_here(ground, middle, end, v, forecast),
        )
    }

    #[inline(always)]
    fn detect_here(
        &mut self,
        ground: &mut Ground<T>,
        middle: &Poses<T>,
        end: &Poses<T>,
        v: &[T],
        forecast: &Forecast<T>,
    ) -> T::Mask {
        let sight = Sight {
            middle,
            end,
            v,
            forecast,
            height: ground.height(middle.origin),
        };
        self.find_twists(middle, v);
        let mut declined = T::mask(self.token, 0);
        for b in 0..self.boxes.len() {
            declined = declined | self.look_at_box(b, ground, &sight);
        }
        self.used.clear();
        let height_at_end = ground.height(end.origin);
        for w in 0..self.wheels.len() {
            declined = declined | self.look_at_wheel(w, ground, &sight);
            let first = SLOTS * w;
            if !self.slots[first].active.any() {
                continue;
            }
            let pose = &end.bodies[self.wheels[w].body];
            let (s, centre) = (self.wheels[w].axle(pose), self.wheels[w].centre(pose));
            for slot in first..first + SLOTS {
                if self.slots[slot].active.any() {
                    self.used.push(slot);
                    let flat = self.relocate(slot, ground, end, height_at_end, s, centre);
                    declined = declined | flat;
                }
            }
        }
        declined | self.list_contacts()
    }

    /// Whether a box is near the ground.
    #[inline(always)]
    fn look_at_box(
        &mut self,
        number: usize,
        ground: &mut Ground<T>,
        sight: &Sight<'_, T>,
    ) -> T::Mask {
        let solid = &self.boxes[number];
        let pose = &sight.middle.bodies[solid.body];
        let n = ground.normal;
        let centre = place(pose, solid.centre.as_ref());
        let reach = (sight.forecast).reach(
            #[inline(always)]
            || self.speed_of_box(solid, centre),
        );
        let local = pose.R.transpose_times(n);
        let local = match &solid.rotation {
            None => local,
            Some([x, y, z]) => Vec3::new(
                local.dot(Vec3::splat(self.token, *x)),
                local.dot(Vec3::splat(self.token, *y)),
                local.dot(Vec3::splat(self.token, *z)),
            ),
        };
        let half = Vec3::splat(self.token, solid.half_size);
        let drop = (local.x * half.x).abs() + (local.y * half.y).abs() + (local.z * half.z).abs();
        let near_plane = (sight.height + n.dot(centre) - drop).le(reach);
        if !ground.has_spheres() {
            return near_plane;
        }
        let at_end = &sight.end.bodies[solid.body];
        let shift = sight.end.origin - sight.middle.origin
            + (place(at_end, solid.centre.as_ref()) - centre);
        let bound = T::splat(self.token, solid.bound);
        let motion = shift.norm() + turning(&at_end.R, &pose.R) * bound;
        let R = match &solid.rotation {
            None => pose.R,
            Some([x, y, z]) => Mat3 {
                x: pose.R.times_shared(*x),
                y: pose.R.times_shared(*y),
                z: pose.R.times_shared(*z),
            },
        };
        let world = sight.middle.origin + centre;
        near_plane | ground.is_near_box(number, world, &R, solid.half_size, reach + motion)
    }

    /// Fills the slots of a wheel with its contacts at the midpoint.
    #[inline(always)]
    fn look_at_wheel(&mut self, w: usize, ground: &mut Ground<T>, sight: &Sight<'_, T>) -> T::Mask {
        let wheel = &self.wheels[w];
        let pose = &sight.middle.bodies[wheel.body];
        let (n, s, centre) = (ground.normal, wheel.axle(pose), wheel.centre(pose));
        let radius = T::splat(self.token, wheel.radius);
        let (across, along) = (n.cross(s), n.dot(s));
        let length = across.norm();
        let height = sight.height + n.dot(centre);
        let gap = height - radius * length;
        let twist = &self.twists[wheel.carrier];
        let u_N = if sight.forecast.needs_velocity(gap) {
            let lever = centre.cross(n) - across * (radius * along / length);
            n.dot(twist.linear) + twist.angular.dot(lever)
        } else {
            radius
        };
        let on_plane = sight.forecast.admits(gap, u_N);
        // The second and third point of the rim.
        let reach = (sight.forecast).reach(
            #[inline(always)]
            || self.speed_of_wheel(wheel, sight, centre),
        );
        let half = radius.like(0.5);
        let mut declined = (height + half * radius * length).le(reach);
        let none = T::mask(self.token, 0);
        let first = SLOTS * w;
        self.slots[first].active = on_plane;
        self.slots[first].on_sphere = none;
        self.slots[first + 1].active = none;
        self.slots[first + 1].on_sphere = none;
        if ground.has_spheres() {
            declined = declined | self.look_at_spheres(w, ground, sight, s, centre, reach);
        }
        declined
    }

    /// Adds the contacts of a wheel with spheres at the midpoint; it has the axle `s` and the centre
    /// `centre` there.
    #[inline(always)]
    fn look_at_spheres(
        &mut self,
        w: usize,
        ground: &mut Ground<T>,
        sight: &Sight<'_, T>,
        s: Vec3<T>,
        centre: Vec3<T>,
        reach: T,
    ) -> T::Mask {
        let wheel = &self.wheels[w];
        let origin = sight.middle.origin;
        let at_end = wheel.centre(&sight.end.bodies[wheel.body]);
        let half_way = sight.end.origin - origin + at_end - centre;
        let motion = half_way.norm();
        let need = reach + motion;
        let mut declined = ground.look_around_wheel(w, origin + centre, wheel.radius, need);
        let radius = T::splat(self.token, wheel.radius);
        let zero = radius.like(0.0);
        let twist = self.twists[wheel.carrier];
        for sphere in ground.near_wheel(w) {
            let offset = sphere.centre - origin - centre;
            let along = offset.dot(s);
            let in_plane = offset - s * along;
            let in_plane_length = in_plane.norm();
            let beyond = (in_plane_length - radius).max(zero);
            let distance = (along * along + beyond * beyond).sqrt();
            let gap = distance - sphere.radius;
            let is_deep = (gap - motion).lt(-(radius.like(DEEP) * sphere.radius));
            if is_deep.any() {
                let passes = self.passing(w, is_deep, sphere, sight, half_way);
                declined = declined | passes;
            }
            let u_N = if sight.forecast.needs_velocity(gap) {
                let to_point = in_plane * (in_plane_length.min(radius) / in_plane_length);
                let n = (to_point - offset) * (radius.like(1.0) / distance);
                n.dot(twist.linear + twist.angular.cross(centre + to_point))
            } else {
                radius
            };
            let admitted = sight.forecast.admits(gap, u_N);
            if admitted.any() {
                // Normal or rolling direction are not defined by differences.
                let least = radius.like(NO_DIRECTION);
                declined = declined | (admitted & (in_plane_length.le(least) | distance.le(least)));
                declined = declined | self.enter(SLOTS * w, admitted, sphere);
            }
        }
        declined
    }

    /// Enters a contact with a sphere into the first free slot of a wheel. Returns where none is.
    #[inline(always)]
    fn enter(&mut self, first: usize, admitted: T::Mask, sphere: &GroundSphere<T>) -> T::Mask {
        let mut rest = admitted;
        for slot in &mut self.slots[first..first + SLOTS] {
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
        sight: &Sight<'_, T>,
        half_way: Vec3<T>,
    ) -> T::Mask {
        let wheel = &self.wheels[w];
        let pose = &sight.middle.bodies[wheel.body];
        let (s, centre) = (wheel.axle(pose), wheel.centre(pose));
        let spoke = pose.R.times_shared(wheel.spoke);
        let mut lanes = asked.bits();
        let mut passes = 0;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let disc = Disc {
                centre: centre.get(lane).into(),
                axle: s.get(lane).into(),
                spoke: spoke.get(lane).into(),
                radius: wheel.radius,
            };
            let ball = Sphere {
                centre: sphere.centre.get(lane).into(),
                radius: sphere.radius.get(lane),
            };
            let base = Vector3::from(sight.middle.origin.get(lane));
            let half_way = Vector3::from(half_way.get(lane));
            if touch_of_disc(&disc, &ball, &base, &half_way).is_some() {
                passes |= 1 << lane;
            }
        }
        T::mask(self.token, passes)
    }

    /// Evaluates a slot at the end of the step, where the wheel has the axle `s` and the centre
    /// `centre`. Returns where a frame is not defined.
    #[inline(always)]
    fn relocate(
        &mut self,
        slot: usize,
        ground: &Ground<T>,
        end: &Poses<T>,
        height: T,
        s: Vec3<T>,
        centre: Vec3<T>,
    ) -> T::Mask {
        let wheel = &self.wheels[slot / SLOTS];
        let slot = &mut self.slots[slot];
        let radius = T::splat(self.token, wheel.radius);
        let parallel = radius.like(PARALLEL);
        let mut undefined = T::mask(self.token, 0);
        if (slot.active & !slot.on_sphere).any() {
            let n = ground.normal;
            let across = n.cross(s);
            let length = across.norm();
            let t = across * (radius.like(1.0) / length);
            slot.n = n;
            slot.t = t;
            slot.point = centre + t.cross(s) * radius;
            slot.gap = height + n.dot(centre) - radius * length;
            undefined = slot.active & !slot.on_sphere & length.le(parallel);
        }
        if slot.on_sphere.any() {
            let sphere = &slot.sphere;
            let offset = sphere.centre - end.origin - centre;
            let in_plane = offset - s * offset.dot(s);
            let length = in_plane.norm();
            let outward = in_plane * (radius.like(1.0) / length);
            let to_point = outward * length.min(radius);
            let from_sphere = to_point - offset;
            let distance = from_sphere.norm();
            let n = from_sphere * (radius.like(1.0) / distance);
            let across = n.cross(s);
            let across_length = across.norm();
            let rolls = across_length.gt(parallel);
            let mut t = across * (radius.like(1.0) / across_length);
            if (slot.on_sphere & !rolls).any() {
                // The face touches: along the rim.
                let rim = s.cross(outward);
                let rim = rim - n * n.dot(rim);
                t = Vec3::select(rolls, t, rim * (radius.like(1.0) / rim.norm()));
            }
            let here = slot.on_sphere;
            let least = radius.like(NO_DIRECTION);
            undefined = undefined | (here & (length.le(least) | distance.le(least)));
            slot.n = Vec3::select(here, n, slot.n);
            slot.t = Vec3::select(here, t, slot.t);
            slot.point = Vec3::select(here, centre + to_point, slot.point);
            slot.gap = T::select(here, distance - sphere.radius, slot.gap);
        }
        slot.b = slot.t.cross(slot.n);
        undefined
    }

    /// Lists the contacts of every lane. Returns the lanes with too many.
    #[inline(always)]
    fn list_contacts(&mut self) -> T::Mask {
        for list in &mut self.lists[..T::LANES] {
            list.n = 0;
        }
        let mut too_many = 0;
        for &slot in &self.used {
            let own = &mut self.slots[slot];
            let on_sphere = own.on_sphere.bits();
            let mut numbers = [0.0; MAX_LANES];
            if on_sphere != 0 {
                own.sphere.number.store(&mut numbers[..T::LANES]);
            }
            let places = &mut self.places[slot];
            let mut lanes = own.active.bits();
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                let list = &mut self.lists[lane];
                if list.n == MAX_CONTACTS {
                    too_many |= 1 << lane;
                    continue;
                }
                places[lane] = list.n as u8;
                list.slots[list.n] = slot as u8;
                list.primitives[list.n] = if on_sphere >> lane & 1 == 1 {
                    numbers[lane] as u32
                } else {
                    PLANE
                };
                list.n += 1;
            }
            if too_many != 0 {
                own.active = own.active & !T::mask(self.token, too_many);
            }
        }
        T::mask(self.token, too_many)
    }

    /// Twists of the carriers at the poses of the midpoint.
    #[inline(always)]
    fn find_twists(&mut self, middle: &Poses<T>, v: &[T]) {
        let n = self.carriers.len();
        let twists = &mut self.twists[..n];
        twists[0] = Twist {
            linear: Vec3::new(v[0], v[1], v[2]),
            angular: Vec3::new(v[3], v[4], v[5]),
        };
        for i in 1..n {
            let Carrier { body, parent } = self.carriers[i];
            let (pose, rate, before) = (&middle.bodies[body], v[velocity(body)], twists[parent]);
            twists[i] = Twist {
                angular: before.angular + pose.axis * rate,
                linear: before.linear + pose.swing * rate,
            };
        }
    }

    /// Upper bound on the normal velocity of all points of a wheel, m/s.
    #[inline(always)]
    fn speed_of_wheel(&self, wheel: &Wheel, sight: &Sight<'_, T>, centre: Vec3<T>) -> T {
        let twist = &self.twists[wheel.carrier];
        let spin = match wheel.spin {
            Some(k) => sight.v[k].abs(),
            None => sight.height.like(0.0),
        };
        let radius = spin.like(wheel.radius);
        twist.velocity(centre).norm() + (twist.angular.norm() + spin) * radius
    }

    /// Upper bound on the velocity of all points of a box, m/s.
    #[inline(always)]
    fn speed_of_box(&self, solid: &Solid, centre: Vec3<T>) -> T {
        let twist = &self.twists[solid.carrier];
        let bound = centre.x.like(solid.bound);
        twist.velocity(centre).norm() + twist.angular.norm() * bound
    }
}

impl<T: Lane> Twist<T> {
    /// Velocity of a material point, m/s.
    #[inline(always)]
    fn velocity(&self, x: Vec3<T>) -> Vec3<T> {
        self.linear + self.angular.cross(x)
    }
}

impl Listed {
    const NONE: Self = Self {
        n: 0,
        slots: [0; MAX_CONTACTS],
        primitives: [0; MAX_CONTACTS],
    };
}

impl Wheel {
    /// Centre relative to the trunk's origin, m.
    #[inline(always)]
    fn centre<T: Lane>(&self, pose: &Pose<T>) -> Vec3<T> {
        place(pose, self.centre.as_ref())
    }

    /// Unit axle.
    #[inline(always)]
    fn axle<T: Lane>(&self, pose: &Pose<T>) -> Vec3<T> {
        match self.axle {
            Axle::Joint(is_reversed) => {
                if is_reversed {
                    -pose.axis
                } else {
                    pose.axis
                }
            }
            Axle::Fixed(s) => pose.R.times_shared(s),
        }
    }
}

/// A point of a body, `None` for its origin, relative to the trunk's origin, m.
#[inline(always)]
fn place<T: Lane>(pose: &Pose<T>, x: Option<&[f64; 3]>) -> Vec3<T> {
    match x {
        None => pose.r,
        Some(x) => pose.r + pose.R.times_shared(*x),
    }
}

/// The axle of a wheel whose body has a joint with this axis.
fn axle_of(axis: &Axis, axle: [f64; 3]) -> Axle {
    let axis = match axis {
        Axis::X => [1.0, 0.0, 0.0],
        Axis::Y => [0.0, 1.0, 0.0],
        Axis::Z => [0.0, 0.0, 1.0],
        Axis::General(u) => *u,
    };
    if axle == axis {
        Axle::Joint(false)
    } else if axle == axis.map(|x| -x) {
        Axle::Joint(true)
    } else {
        Axle::Fixed(axle)
    }
}

/// Index of a body among the carriers; adds it with all that carry it.
fn carrier_of(machine: &Machine, body: usize, carriers: &mut Vec<Carrier>) -> usize {
    if let Some(i) = carriers.iter().position(|carrier| carrier.body == body) {
        return i;
    }
    let parent = carrier_of(machine, machine.links[body].parent, carriers);
    carriers.push(Carrier { body, parent });
    carriers.len() - 1
}
