//! Contact Jacobian and Delassus operator `W = Hᵀ M̂⁻¹ H` of a block.
//!
//! The rows are those of `crate::contact::rows`, along the path of each slot's part
//! ([`super::contacts`]). A slot that is active in some lanes only never changes what the others
//! accumulate.

use std::sync::Arc;

use super::by_lane::OneLane;
use super::contacts::{Contacts, Slot};
use super::joint_slots::JointRow;
use super::machine::Machine;
use super::pattern::Pattern;
use super::problem::{ContactProblem, Triple, block};
use crate::contact::jacobian::{add_impulse, for_each_row};
use crate::contact::rows::{Path, Place, add, add_scaled, product, square};
use crate::contact::{Contact, rollers};
use crate::multibody::loops::Placed;
use crate::multibody::mechanism::{BASE, Mover};
use crate::multibody::{Factor, Poses};
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3};
use crate::system::loops::Loops;

/// What is read of a problem.
#[derive(Clone, Copy, Debug)]
pub enum Answer {
    /// Impulses, N s.
    Impulses,
    /// Velocities, m/s.
    Velocities,
}

/// The contacts of a block in matrix form.
#[derive(Clone, Debug)]
pub struct Rows<T: Lane> {
    token: T::Token,
    /// Bodies of the parts: wheels, spare slots, and joints; none of a spare slot with all
    /// velocities.
    bodies: Vec<Option<usize>>,
    /// Velocities of the joints that move each part, from the trunk outwards.
    movers: Vec<Vec<Mover>>,
    /// Velocities that two parts share: `common[a * n_parts + b]`.
    common: Vec<usize>,
    /// Whether wheels have rollers.
    has_rollers: bool,
    /// Length of the longest path.
    stride: usize,
    /// Z along the path of each slot's wheel: `Z[slot * stride + k]`.
    Z: Vec<Triple<T>>,
    /// Blocks of W for the slots in use by lanes without factors, row-major: [`block`] of their
    /// positions among them.
    pub(super) W: Vec<[T; 9]>,
    /// Pattern of the problems with factors.
    pattern: Arc<Pattern>,
    /// Diagonal blocks of W by slot, and what [`Self::soften`] added to them, 1/kg.
    pub(super) diagonal: Vec<[T; 9]>,
    pub(super) softness: Vec<T>,
    /// W's entry of the normal of a joint's dry friction by slot, 1/kg; 0 of others.
    pub(super) normal: Vec<T>,
    /// The motion in [`Self::sweep`] (nv, factor coordinates), and the products of the loops with
    /// it.
    pub(super) swept: Vec<T>,
    pub(super) swept_loops: Vec<T>,
    /// The closed loops of the machine, which number the contacts by their slots.
    pub(super) loops: Option<Box<Loops<T>>>,
    n_slots: usize,
    /// Local velocity `Hᵀ v` before the step by slot, m/s.
    pub u_before: Vec<Triple<T>>,
}

impl<T: Lane> Rows<T> {
    /// Room for a machine with `n_slots` slots.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine, n_slots: usize) -> Self {
        let wheels = machine.wheels.iter().map(|wheel| Some(wheel.body));
        let spares = machine.spares.iter().copied();
        let joints = machine.joints_with_slots();
        let joints = joints.map(|joint| Some(machine.joints[joint].body));
        let bodies: Vec<Option<usize>> = wheels.chain(spares).chain(joints).collect();
        let whole: Vec<usize> = (0..machine.nv()).collect();
        let paths: Vec<&[usize]> = (bodies.iter())
            .map(|body| body.map_or(&whole[..], |body| machine.path(body)))
            .collect();
        let mut common = Vec::with_capacity(paths.len() * paths.len());
        for a in &paths {
            for b in &paths {
                common.push(a.iter().zip(*b).take_while(|(i, j)| i == j).count());
            }
        }
        let all = (BASE..machine.nv()).map(|velocity| Mover {
            velocity,
            motion: 0, // not read
        });
        let movers = (bodies.iter())
            .map(|body| match body {
                Some(body) => machine.movers(*body).to_vec(),
                None => all.clone().collect(),
            })
            .collect();
        let stride = paths.iter().map(|path| path.len()).max().unwrap_or(0);
        let zero = T::splat(token, 0.0);
        let loops = Loops::new(token, machine, &machine.loops, 0);
        Self {
            token,
            bodies,
            movers,
            common,
            has_rollers: (machine.wheels.iter()).any(|wheel| wheel.rollers.is_some()),
            stride,
            Z: vec![[zero; 3]; n_slots * stride],
            W: vec![[zero; 9]; n_slots * (n_slots + 1) / 2],
            pattern: Arc::clone(machine.pattern()),
            diagonal: vec![[zero; 9]; n_slots],
            softness: vec![zero; n_slots],
            normal: vec![zero; n_slots],
            swept: vec![zero; machine.nv()],
            swept_loops: vec![zero; loops.as_ref().map_or(0, |loops| loops.m())],
            loops,
            n_slots,
            u_before: vec![[zero; 3]; n_slots],
        }
    }

    /// The loops at the midpoint of the step, where the joints have the coordinates `joints`.
    /// [`Self::assemble`] follows.
    pub fn begin_loops(
        &mut self,
        machine: &Machine,
        middle: &Poses<T>,
        joints: &[T],
        factor: &Factor<T>,
    ) {
        if let Some(loops) = &mut self.loops {
            let placed = Placed {
                mechanism: machine,
                poses: middle,
                joints,
            };
            loops.begin(&placed, factor, self.n_slots);
        }
    }

    /// Builds Z, W and `u_before = Hᵀ v` at the end of the step.
    ///
    /// `v`: velocity (nv) before the step.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn assemble(
        &mut self,
        machine: &Machine,
        end: &Poses<T>,
        factor: &Factor<T>,
        contacts: &Contacts<T>,
        v: &[T],
    ) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                for &slot in contacts.used() {
                    self.build(machine, end, factor, contacts, v, slot);
                }
                self.multiply_loops(contacts);
                for &slot in contacts.used_by_joints() {
                    if let Some((_, JointRow::Friction)) = contacts.joint_row(slot) {
                        let (_, rows) = self.of(contacts, slot);
                        self.normal[slot] = square(self.normal[slot].like(0.0), rows)[4];
                    }
                }
                self.multiply(contacts);
                if contacts.factored() != 0 {
                    self.multiply_diagonal(contacts);
                }
            },
        );
    }

    /// Path of a slot, and its rows of Z.
    #[inline(always)]
    pub(super) fn of(&self, contacts: &Contacts<T>, slot: usize) -> (Path<'_>, &[Triple<T>]) {
        let path = Path::from_trunk(&self.movers[contacts.part(slot)]);
        (path, &self.Z[slot * self.stride..][..path.len()])
    }

    /// Z and `Hᵀ v` of a slot.
    #[inline(always)]
    fn build(
        &mut self,
        machine: &Machine,
        end: &Poses<T>,
        factor: &Factor<T>,
        contacts: &Contacts<T>,
        v: &[T],
        slot: usize,
    ) {
        let part = contacts.part(slot);
        let path = Path::from_trunk(&self.movers[part]);
        let rows = &mut self.Z[slot * self.stride..][..path.len()];
        let u = &mut self.u_before[slot];
        if let Some((_, row)) = contacts.joint_row(slot) {
            let (which, entry) = row.entry(v[0]);
            *u = path.write_joint(which, entry, v, rows);
        } else {
            let place = place_of(contacts.slot(slot));
            *u = path.write(|m| end.motions[m], &place, v, rows);
            for (lane, contact) in contacts.by_lane.guests(slot) {
                let one = OneLane {
                    machine,
                    poses: end,
                    v,
                    lane,
                };
                write_guest(&one, contact, path.movers, rows, u);
            }
        }
        match self.bodies[part] {
            Some(body) => factor.half_solve_path(machine, body, rows),
            None => factor.half_solve_columns(machine, 0..v.len(), rows),
        }
    }

    /// Products of the loops with the contacts from Z.
    #[inline(always)]
    fn multiply_loops(&mut self, contacts: &Contacts<T>) {
        let Some(mut loops) = self.loops.take() else {
            return;
        };
        let none = [T::splat(self.token, 0.0); 3];
        for row in 0..loops.m() {
            for &slot in contacts.used() {
                let (path, rows) = self.of(contacts, slot);
                *loops.product_mut(row, slot) = path.add_local(rows, loops.q(row), none);
            }
        }
        self.loops = Some(loops);
    }

    /// Diagonal blocks of W from Z.
    #[inline(always)]
    fn multiply_diagonal(&mut self, contacts: &Contacts<T>) {
        for &slot in contacts.used() {
            self.diagonal[slot] = self.own_block(contacts, slot);
        }
    }

    /// W from Z.
    #[inline(always)]
    fn multiply(&mut self, contacts: &Contacts<T>) {
        let used = contacts.used_densely();
        let (n_parts, zero) = (self.movers.len(), T::splat(self.token, 0.0));
        let mut at = 0;
        for (i, &row) in used.iter().enumerate() {
            let a = contacts.part(row);
            for &column in &used[..i] {
                let b = contacts.part(column);
                let shared = self.common[a * n_parts + b];
                let x = &self.Z[row * self.stride..][..shared];
                let y = &self.Z[column * self.stride..][..shared];
                self.W[at] = product(zero, x, y);
                if let Some(loops) = &self.loops {
                    loops.project_block([row, column], &mut self.W[at]);
                }
                at += 1;
            }
            self.W[at] = self.own_block(contacts, row);
            at += 1;
        }
    }

    /// Block of W of a slot with itself.
    #[inline(always)]
    fn own_block(&self, contacts: &Contacts<T>, slot: usize) -> [T; 9] {
        let (_, rows) = self.of(contacts, slot);
        let mut own = square(T::splat(self.token, 0.0), rows);
        if let Some((_, row)) = contacts.joint_row(slot) {
            row.close(&mut own);
        } else if self.has_rollers {
            rollers::close(&mut own);
        }
        if let Some(loops) = &self.loops {
            loops.project_block([slot, slot], &mut own);
        }
        own
    }

    /// Adds a number by slot, 1/kg, to the three entries on W's diagonal.
    pub fn soften(&mut self, contacts: &Contacts<T>, diagonal: impl Fn(usize) -> T) {
        let soften = |own: &mut [T; 9], slot: usize| {
            for k in [0, 4, 8] {
                own[k] += diagonal(slot);
            }
        };
        for (i, &slot) in contacts.used_densely().iter().enumerate() {
            soften(&mut self.W[block(i, i)], slot);
        }
        if contacts.factored() != 0 {
            for &slot in contacts.used() {
                self.softness[slot] = diagonal(slot);
                soften(&mut self.diagonal[slot], slot);
            }
        }
    }

    /// `q = Zᵀ y + Hᵀ v` by slot: local velocities after a change `y` (nv, factor coordinates) of
    /// the velocity before the step.
    ///
    /// # Panics
    /// If an argument is of another machine.
    #[inline(always)]
    pub fn local(&self, contacts: &Contacts<T>, y: &[T], q: &mut [Triple<T>]) {
        let zero = T::splat(self.token, 0.0);
        for &slot in contacts.used() {
            let (path, rows) = self.of(contacts, slot);
            let sum = path.add_local(rows, y, [zero; 3]);
            let [n, t, b] = self.u_before[slot];
            q[slot] = [sum[0] + n, sum[1] + t, sum[2] + b];
        }
    }

    /// `y += Z p`: change of the velocity in factor coordinates (nv) due to impulses by slot, N s,
    /// in the lanes of a mask.
    ///
    /// # Panics
    /// If an argument is of another machine.
    #[inline(always)]
    pub fn add_impulses(
        &self,
        contacts: &Contacts<T>,
        lanes: T::Mask,
        p: &[Triple<T>],
        y: &mut [T],
    ) {
        for &slot in contacts.used() {
            let (path, rows) = self.of(contacts, slot);
            path.push(contacts.slot(slot).active & lanes, rows, &p[slot], y);
        }
        if let Some(loops) = &self.loops {
            loops.answer(&in_slots(contacts, lanes, p), y);
        }
    }

    /// Finds the impulses of the loops with those of the contacts by slot, N s, in the lanes of a
    /// mask.
    #[inline(always)]
    pub fn find_loop_impulses(&mut self, contacts: &Contacts<T>, lanes: T::Mask, p: &[Triple<T>]) {
        if let Some(loops) = &mut self.loops {
            loops.find_impulses(&in_slots(contacts, lanes, p));
        }
    }

    /// `out = H p` (nv): generalized impulse, N s and N m s, of impulses by slot, N s, in the lanes
    /// of a mask; zero elsewhere.
    ///
    /// # Panics
    /// If an argument is of another machine.
    #[inline(always)]
    pub fn generalized_impulse(
        &self,
        machine: &Machine,
        contacts: &Contacts<T>,
        end: &Poses<T>,
        lanes: T::Mask,
        p: &[Triple<T>],
        out: &mut [T],
    ) {
        let zero = T::splat(self.token, 0.0);
        out.fill(zero);
        let mut sums = [Vec3::new(zero, zero, zero); 2];
        let mut guests = 0;
        for &slot in contacts.used_by_shapes() {
            let own = contacts.slot(slot);
            let own_guests = contacts.by_lane.guests(slot);
            let of_guests = own_guests.fold(0, |all, (lane, _)| all | 1 << lane);
            guests |= of_guests;
            let here = own.active & lanes & !T::mask(self.token, of_guests);
            let wrench = place_of(own).wrench(p[slot]);
            for (sum, x) in sums.iter_mut().zip(wrench) {
                *sum = Vec3::select(here, *sum + x, *sum);
            }
            let [force, moment] = wrench;
            for mover in &self.movers[contacts.part(slot)] {
                let power = end.motions[mover.motion].power(force, moment);
                add(here, &mut out[mover.velocity], power);
            }
        }
        let [total, couple] = sums;
        out[..BASE].copy_from_slice(&[total.x, total.y, total.z, couple.x, couple.y, couple.z]);
        if (lanes & T::mask(self.token, guests)).any() {
            add_impulses_of_guests(machine, contacts, end, lanes, p, out);
        }
        for &slot in contacts.used_by_joints() {
            let here = contacts.slot(slot).active & lanes;
            let mover = self.movers[contacts.part(slot)].last();
            if let (Some((_, row)), Some(mover)) = (contacts.joint_row(slot), mover) {
                let (which, entry) = row.entry(zero);
                add(here, &mut out[mover.velocity], entry * p[slot][which]);
            }
        }
    }

    /// Writes each lane's problem: W or its factors, q, μ. Starting impulses stay as they are.
    ///
    /// `q`: free velocity by slot, m/s; `mu`: friction coefficient. `problems`: one a lane.
    ///
    /// # Panics
    /// If there are fewer problems than lanes.
    pub fn to_problems(
        &self,
        contacts: &Contacts<T>,
        q: &[Triple<T>],
        mu: &[T],
        problems: &mut [ContactProblem],
    ) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                let problems = &mut problems[..T::LANES];
                let factored = contacts.factored();
                for (lane, problem) in problems.iter_mut().enumerate() {
                    problem.n_contacts = contacts.list(lane).n;
                    problem.n_dry = contacts.slots_of_friction().len();
                    problem.make_room();
                    problem.has_start = false;
                    if factored >> lane & 1 == 1 {
                        problem.factored.adopt(&self.pattern);
                        problem.factored.slots = 0;
                    } else {
                        problem.factored.pattern = None;
                    }
                }
                for &slot in contacts.used() {
                    let places = contacts.places(slot);
                    let [n, t, b] = q[slot];
                    let values = store_all(&[n, t, b, mu[slot]]);
                    each::<T>(
                        contacts.slot(slot).active,
                        #[inline(always)]
                        |lane| {
                            let place = usize::from(places[lane]);
                            let q = &mut problems[lane].q[3 * place..][..3];
                            for i in 0..3 {
                                q[i] = values[i][lane];
                            }
                            problems[lane].mu[place] = values[3][lane];
                        },
                    );
                    if factored != 0 {
                        self.write_factors(contacts, slot, problems);
                    }
                }
                let mut at = 0;
                let dense = contacts.used_densely();
                for (i, &row) in dense.iter().enumerate() {
                    for &column in &dense[..=i] {
                        self.write_block(contacts, [row, column], at, problems);
                        at += 1;
                    }
                }
            },
        );
    }

    /// Writes the block of W of two slots, which is at `at`.
    #[inline(always)]
    fn write_block(
        &self,
        contacts: &Contacts<T>,
        [row, column]: [usize; 2],
        at: usize,
        problems: &mut [ContactProblem],
    ) {
        let (of_row, of_column) = (contacts.places(row), contacts.places(column));
        let [first @ .., last] = &self.W[at];
        let (mut rows, mut ends) = ([[0.0; 8]; MAX_LANES], [0.0; MAX_LANES]);
        T::transpose(first, &mut rows);
        last.store(&mut ends[..T::LANES]);
        if contacts.is_full() {
            for (lane, problem) in problems.iter_mut().enumerate() {
                let out = &mut problem.W[at];
                out[..8].copy_from_slice(&rows[lane]);
                out[8] = ends[lane];
            }
            return;
        }
        let dense = T::mask(self.token, !contacts.factored());
        let both = contacts.slot(row).active & contacts.slot(column).active & dense;
        each::<T>(
            both,
            #[inline(always)]
            |lane| {
                let (c, d) = (of_row[lane], of_column[lane]);
                let out = &mut problems[lane].W[block(c.into(), d.into())];
                out[..8].copy_from_slice(&rows[lane]);
                out[8] = ends[lane];
            },
        );
    }

    /// Writes a slot's part of the factors.
    #[inline(always)]
    fn write_factors(&self, contacts: &Contacts<T>, slot: usize, problems: &mut [ContactProblem]) {
        let pattern = &*self.pattern;
        let places = contacts.places(slot);
        let active = contacts.slot(slot).active & T::mask(self.token, contacts.factored());
        let movers = &self.movers[contacts.part(slot)];
        let n = BASE + movers.len();
        let (stride, length) = (pattern.stride(), BASE + pattern.joints(slot).len());
        let softness = store_all(&[self.softness[slot], self.normal[slot]]);
        let diagonal = store_all(&self.diagonal[slot]);
        each::<T>(
            active,
            #[inline(always)]
            |lane| {
                let (contact, out) = (usize::from(places[lane]), &mut problems[lane].factored);
                out.slots |= 1 << slot;
                out.softness[contact] = softness[0][lane];
                out.normal[contact] = softness[1][lane];
                let own = &mut out.diagonal[contact];
                for k in 0..9 {
                    own[k] = diagonal[k][lane];
                }
                if length > n {
                    out.Z[contact * stride..][..length].fill([0.0; 3]);
                }
            },
        );
        let Z = &self.Z[slot * self.stride..][..n];
        for k in 0..n {
            let values = store_all(&Z[k]);
            // Its place on a path of all velocities is the velocity.
            let k = match k.checked_sub(BASE) {
                Some(k) if length > n => movers[k].velocity,
                _ => k,
            };
            each::<T>(
                active,
                #[inline(always)]
                |lane| {
                    let at = usize::from(places[lane]) * stride + k;
                    let out = &mut problems[lane].factored.Z[at];
                    for i in 0..3 {
                        out[i] = values[i][lane];
                    }
                },
            );
        }
        if self.loops.is_some() {
            self.project_factors(contacts, active, slot, problems);
        }
    }

    /// `Z − Qᵀ B` in place of a slot's Z, which the problems have along all velocities.
    #[inline(always)]
    fn project_factors(
        &self,
        contacts: &Contacts<T>,
        active: T::Mask,
        slot: usize,
        problems: &mut [ContactProblem],
    ) {
        let Some(loops) = &self.loops else {
            return;
        };
        let (zero, stride) = (T::splat(self.token, 0.0), self.pattern.stride());
        let places = contacts.places(slot);
        for k in 0..stride {
            let mut taken = [zero; 3];
            for row in 0..loops.m() {
                add_scaled(&mut taken, loops.product(row, slot), loops.q(row)[k]);
            }
            let taken = store_all(&taken);
            each::<T>(
                active,
                #[inline(always)]
                |lane| {
                    let at = usize::from(places[lane]) * stride + k;
                    let out = &mut problems[lane].factored.Z[at];
                    for i in 0..3 {
                        out[i] -= taken[i][lane];
                    }
                },
            );
        }
    }

    /// Reads an answer of the problems by slot. Slots that a lane does not use are left as they
    /// are.
    ///
    /// # Panics
    /// If there are fewer problems than lanes.
    #[inline(always)]
    pub fn read(
        &self,
        contacts: &Contacts<T>,
        problems: &[ContactProblem],
        answer: Answer,
        out: &mut [Triple<T>],
    ) {
        let problems = &problems[..T::LANES];
        for &slot in contacts.used() {
            let mut values = store_all(&out[slot]);
            let places = contacts.places(slot);
            each::<T>(
                contacts.slot(slot).active,
                #[inline(always)]
                |lane| {
                    let problem = &problems[lane];
                    let all = match answer {
                        Answer::Impulses => &problem.p,
                        Answer::Velocities => &problem.u,
                    };
                    let own = &all[3 * usize::from(places[lane])..][..3];
                    for i in 0..3 {
                        values[i][lane] = own[i];
                    }
                },
            );
            for k in 0..3 {
                out[slot][k] = T::load(self.token, &values[k][..T::LANES]);
            }
        }
    }
}

/// Point and frame of a slot.
#[inline(always)]
fn place_of<T: Lane>(own: &Slot<T>) -> Place<T> {
    let Slot { point, n, t, b, .. } = *own;
    Place { x: point, n, t, b }
}

/// Adds the generalized impulses, in the lanes of a mask, of contacts whose path is not that of
/// their slots.
#[cold]
fn add_impulses_of_guests<T: Lane>(
    machine: &Machine,
    contacts: &Contacts<T>,
    end: &Poses<T>,
    lanes: T::Mask,
    p: &[Triple<T>],
    out: &mut [T],
) {
    for &slot in contacts.used_by_shapes() {
        let guests = contacts.by_lane.guests(slot);
        for (lane, contact) in guests.filter(|(lane, _)| lanes.get(*lane)) {
            let one = OneLane {
                machine,
                poses: end,
                v: &[],
                lane,
            };
            let p = p[slot].map(|p| p.get(lane));
            add_impulse(&one, contact, p, |k, x| {
                out[k].set(lane, out[k].get(lane) + x);
            });
        }
    }
}

/// Writes the rows of Hᵀ and `Hᵀ v` of a lane's contact along the path of a slot that is not its
/// own.
fn write_guest<T: Lane>(
    one: &OneLane<'_, T>,
    contact: &Contact,
    movers: &[Mover],
    rows: &mut [Triple<T>],
    u: &mut Triple<T>,
) {
    let lane = one.lane;
    for own in rows.iter_mut().flatten().chain(&mut *u) {
        own.set(lane, 0.0);
    }
    for_each_row(one, contact, |velocity, row| {
        let is_own = |mover: &Mover| mover.velocity == velocity;
        let own = match movers.iter().position(is_own) {
            Some(k) => &mut rows[BASE + k],
            None => &mut rows[velocity],
        };
        let v = one.v[velocity].get(lane);
        for (i, x) in row.iter().enumerate() {
            own[i].set(lane, own[i].get(lane) + x);
            u[i].set(lane, u[i].get(lane) + x * v);
        }
    });
}

/// Impulses of the slots in use, and where they have one among the lanes of a mask.
#[inline(always)]
fn in_slots<'a, T: Lane>(
    contacts: &'a Contacts<T>,
    lanes: T::Mask,
    p: &'a [Triple<T>],
) -> impl Iterator<Item = (usize, T::Mask, Triple<T>)> + Clone + 'a {
    let slots = contacts.used().iter();
    slots.map(
        #[inline(always)]
        move |&slot| (slot, contacts.slot(slot).active & lanes, p[slot]),
    )
}

/// The numbers of all lanes.
#[inline(always)]
fn store_all<T: Lane, const N: usize>(x: &[T; N]) -> [[f64; MAX_LANES]; N] {
    let mut out = [[0.0; MAX_LANES]; N];
    for k in 0..N {
        x[k].store(&mut out[k][..T::LANES]);
    }
    out
}

/// Calls `act` for each lane of a mask.
#[inline(always)]
fn each<T: Lane>(mask: T::Mask, mut act: impl FnMut(usize)) {
    let mut lanes = mask.bits();
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        act(lane);
    }
}
