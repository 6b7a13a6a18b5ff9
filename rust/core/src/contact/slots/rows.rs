//! Contact Jacobian and Delassus operator `W = Hᵀ M̂⁻¹ H` of a block.
//!
//! The rows are those of `crate::contact::rows`, along the path of each slot's part
//! ([`super::contacts`]). A slot that is active in some lanes only never changes what the others
//! accumulate. Contacts of different clusters have no block of W: the operator of each cluster's
//! problem is its own.

use std::sync::Arc;

use super::clusters::WidePatterns;
use super::contacts::{ContactSlots, Slot};
use super::joint_slots::JointRow;
use super::machine::{SharedMachine, WheelDisc};
use crate::contact::body_motion::Still;
use crate::contact::jacobian::{add_impulse, for_each_row};
use crate::contact::loops::{Loops, ROUNDED, ROUNDED_SQUARE};
use crate::contact::rows::{Place, VelocityPath, add, add_scaled, product, square};
use crate::contact::{Contact, rollers};
use crate::multibody::mechanism::{BASE, PathVelocity};
use crate::multibody::model::Loop;
use crate::multibody::{Factor, Poses};
use crate::scalar::{Lane, LaneMask, MAX_LANES, inlined};
use crate::solver::batch::pattern::Pattern;
use crate::solver::batch::problem::{ContactProblem, Triple, block};

/// What is read of a problem.
#[derive(Clone, Copy, Debug)]
pub enum ContactQuantity {
    /// Impulses, N s.
    Impulses,
    /// Velocities, m/s.
    Velocities,
}

/// The contacts of a block in matrix form.
#[derive(Clone, Debug)]
pub struct ContactMatrices<T: Lane> {
    token: T::Token,
    /// Bodies of the parts: wheels, spare slots, and joints; none of a spare slot with all
    /// velocities.
    bodies: Vec<Option<usize>>,
    /// First velocity of the free root that carries each part; none where no free root does.
    bases: Vec<Option<usize>>,
    /// Velocities of the joints that move each part, from the root outwards.
    movers: Vec<Vec<PathVelocity>>,
    /// Velocities that two parts share: `common[a * n_parts + b]`.
    common: Vec<usize>,
    /// Whether wheels have rollers or no friction across.
    has_rollers: bool,
    /// Z along the path of each slot's part: `Z[starts[slot] + k]`.
    Z: Vec<Triple<T>>,
    starts: Vec<usize>,
    /// Blocks of W for the slots of each cluster in use by lanes without factors, row-major:
    /// [`block`] of their positions among them, from the cluster's first.
    pub(crate) W: Vec<[T; 9]>,
    first_blocks: Vec<usize>,
    /// Patterns of the problems with factors: of each cluster, and of those whose bodies touch each
    /// other.
    patterns: Vec<Arc<Pattern>>,
    wide: WidePatterns,
    /// Number of each slot in its cluster's pattern.
    numbers: Vec<usize>,
    /// Cluster of each velocity, and its place among the cluster's velocities.
    velocities: Vec<[usize; 2]>,
    /// Number of velocities of each cluster.
    sizes: Vec<usize>,
    /// Diagonal blocks of W by slot, and what [`Self::soften`] added to them, 1/kg.
    pub(crate) diagonal: Vec<[T; 9]>,
    pub(crate) softness: Vec<Triple<T>>,
    /// W's entry of the normal of a joint's dry friction by slot, 1/kg; 0 of others.
    pub(crate) normal: Vec<T>,
    /// The motion in [`Self::sweep`] (nv, factor coordinates), and the products of the loops with
    /// it.
    pub(crate) swept: Vec<T>,
    pub(crate) swept_loops: Vec<T>,
    /// Z of each slot over all velocities without the motions that would open a loop
    /// (n_slots, nv), of a machine that loops tie to the world. Several contacts of one body on a
    /// stand are then dependent to the square of rounding, as W's entries are to rounding.
    spread: Vec<Triple<T>>,
    /// Slots that they hold along any direction, and of each slot where they hold its normal.
    held: Vec<usize>,
    immovable: Vec<T::Mask>,
    /// Largest entry on W's diagonal without the loops by slot, 1/kg; zero where nothing is held.
    closing: Vec<T>,
    /// Local velocity `Hᵀ v` before the step by slot, m/s.
    pub u_before: Vec<Triple<T>>,
}

impl<T: Lane> ContactMatrices<T> {
    /// Room for a machine with `n_slots` slots.
    #[must_use]
    pub fn new(token: T::Token, machine: &SharedMachine, n_slots: usize) -> Self {
        let wheels = machine.wheels.iter().map(|wheel| Some(wheel.body));
        let spares = machine.spares.iter().copied();
        let joints = machine.joints_with_slots();
        let joints = joints.map(|joint| Some(machine.joints[joint].body));
        let bodies: Vec<Option<usize>> = wheels.chain(spares).chain(joints).collect();
        let whole: Vec<usize> = (0..machine.nv()).collect();
        let path_of = |body: Option<usize>| body.map_or(&whole[..], |body| machine.path(body));
        let paths: Vec<&[usize]> = bodies.iter().map(|body| path_of(*body)).collect();
        let shared = |a: &[usize], b: &[usize]| a.iter().zip(b).take_while(|(i, j)| i == j).count();
        let common = paths
            .iter()
            .flat_map(|a| paths.iter().map(|b| shared(a, b)));
        let (first, all) = whole_path(machine);
        let movers = (bodies.iter())
            .map(|body| match body {
                Some(body) => machine.movers(*body).to_vec(),
                None => all.clone(),
            })
            .collect();
        let n_clusters = machine.n_problems();
        let mut counts = vec![0; n_clusters];
        let (mut starts, mut n_rows, mut numbers) = (Vec::new(), 0, Vec::new());
        for body in machine.slot_bodies() {
            starts.push(n_rows);
            n_rows += path_of(body).len();
            let cluster = body.map(|body| machine.cluster_of(body));
            numbers.push(cluster.map_or(0, |cluster| counts[cluster]));
            if let Some(cluster) = cluster {
                counts[cluster] += 1;
            }
        }
        let (mut first_blocks, mut n_blocks) = (Vec::new(), 0);
        for n in &counts {
            first_blocks.push(n_blocks);
            n_blocks += block(*n, 0);
        }
        let zero = T::splat(token, 0.0);
        let n_of_loops = machine.loops.iter().map(Loop::n_rows).sum();
        Self {
            token,
            bases: (bodies.iter())
                .map(|body| body.map_or(first, |body| machine.base_of(body)))
                .collect(),
            bodies,
            movers,
            common: common.collect(),
            has_rollers: (machine.wheels.iter())
                .any(|wheel| wheel.rollers.is_some() || wheel.across.is_some()),
            Z: vec![[zero; 3]; n_rows],
            starts,
            W: vec![[zero; 9]; n_blocks],
            first_blocks,
            patterns: (0..n_clusters)
                .map(|cluster| Arc::clone(machine.pattern(cluster)))
                .collect(),
            wide: machine.clusters.wide().clone(),
            numbers,
            velocities: machine.clusters.places(machine.nv()),
            sizes: (0..n_clusters)
                .map(|cluster| machine.clusters.nv(cluster))
                .collect(),
            diagonal: vec![[zero; 9]; n_slots],
            softness: vec![[zero; 3]; n_slots],
            normal: vec![zero; n_slots],
            swept: vec![zero; machine.nv()],
            swept_loops: vec![zero; n_of_loops],
            spread: {
                let is_held = machine.loops.iter().any(Loop::holds_the_world);
                vec![[zero; 3]; usize::from(is_held) * n_slots * machine.nv()]
            },
            held: Vec::new(),
            immovable: vec![T::mask(token, 0); n_slots],
            closing: vec![zero; n_slots],
            u_before: vec![[zero; 3]; n_slots],
        }
    }

    /// Builds Z, W and `u_before = Hᵀ v` at the end of the step.
    ///
    /// `v`: velocity (nv) before the step. `loops`: those of the machine at the midpoint, which
    /// number the contacts by their slots.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn assemble(
        &mut self,
        (machine, factor): (&SharedMachine, &Factor<T>),
        end: &Poses<T>,
        contacts: &ContactSlots<T>,
        v: &[T],
        mut loops: Option<&mut Loops<T>>,
    ) {
        inlined!(T::vectorize, self.token, {
            for &slot in contacts.used() {
                self.build(machine, end, factor, contacts, v, slot);
            }
            for &slot in contacts.used_by_joints() {
                if is_friction(contacts, slot) {
                    let (_, rows) = self.of(contacts, slot);
                    self.normal[slot] = square(self.normal[slot].like(0.0), rows)[4];
                }
            }
            if let Some(loops) = loops.as_deref_mut() {
                self.multiply_loops(contacts, loops);
            }
            let loops = loops.as_deref();
            self.multiply(contacts, loops);
            if contacts.factored() != 0 {
                self.multiply_diagonal(contacts, loops);
            }
        });
    }

    /// Path of a slot, and its rows of Z.
    #[inline(always)]
    pub(crate) fn of(
        &self,
        contacts: &ContactSlots<T>,
        slot: usize,
    ) -> (VelocityPath<'_>, &[Triple<T>]) {
        let path = self.path(contacts.part(slot));
        (path, &self.Z[self.starts[slot]..][..path.len()])
    }

    /// Path of a part; of a spare slot with all velocities, they follow each other.
    #[inline(always)]
    fn path(&self, part: usize) -> VelocityPath<'_> {
        VelocityPath {
            base: self.bases[part],
            movers: &self.movers[part],
        }
    }

    /// Z and `Hᵀ v` of a slot.
    #[inline(always)]
    fn build(
        &mut self,
        machine: &SharedMachine,
        end: &Poses<T>,
        factor: &Factor<T>,
        contacts: &ContactSlots<T>,
        v: &[T],
        slot: usize,
    ) {
        let part = contacts.part(slot);
        let path = VelocityPath {
            base: self.bases[part],
            movers: &self.movers[part],
        };
        let rows = &mut self.Z[self.starts[slot]..][..path.len()];
        let u = &mut self.u_before[slot];
        if let Some((_, row)) = contacts.joint_row(slot) {
            let (which, entry) = row.entry(v[0]);
            *u = path.write_joint(which, entry, v, rows);
        } else {
            if self.bodies[part].is_some() {
                let place = place_of(contacts.slot(slot));
                *u = path.write(|m| end.motions[m], &place, v, rows);
                if (machine.wheels.get(part)).is_some_and(WheelDisc::has_rigid_ends) {
                    path.level(v, rows, u);
                }
            } else {
                let zero = [T::splat(self.token, 0.0); 3];
                rows.fill(zero);
                *u = zero;
            }
            for (lane, contact) in contacts.by_lane.off_path(slot) {
                let one = Still {
                    mechanism: machine.mechanism(),
                    poses: end,
                    v,
                    lane,
                };
                write_off_path(&one, contact, path, rows, u);
            }
        }
        match self.bodies[part] {
            Some(body) => factor.half_solve_path(machine, body, rows),
            None => factor.half_solve_columns(machine, 0..v.len(), rows),
        }
    }

    /// Products of the loops with the contacts from Z.
    #[inline(always)]
    fn multiply_loops(&mut self, contacts: &ContactSlots<T>, loops: &mut Loops<T>) {
        let none = [T::splat(self.token, 0.0); 3];
        for row in 0..loops.m() {
            for &slot in contacts.used() {
                let (path, rows) = self.of(contacts, slot);
                *loops.product_mut(row, slot) = path.add_local(rows, loops.q(row), none);
            }
        }
        self.held.clear();
        for &slot in contacts.used() {
            self.hold(loops, contacts, slot);
        }
    }

    /// Makes the rows of a slot zero where the loops let nothing move it. [`Self::close_held`]
    /// follows.
    #[inline(always)]
    fn hold(&mut self, loops: &mut Loops<T>, contacts: &ContactSlots<T>, slot: usize) {
        let zero = T::splat(self.token, 0.0);
        let mut free = [zero; 3];
        for z in self.of(contacts, slot).1 {
            for k in 0..3 {
                free[k] += z[k] * z[k];
            }
        }
        if !is_friction(contacts, slot) {
            self.normal[slot] = zero;
        }
        let held = self.find_held(loops, contacts, slot, &free);
        self.immovable[slot] = held[0];
        self.closing[slot] = zero;
        let any = (held[0] | held[1] | held[2]) & contacts.slot(slot).active;
        if !any.any() {
            return;
        }
        self.held.push(slot);
        loops.hold(slot, held);
        self.closing[slot] = T::select(any, free[0].max(free[1]).max(free[2]), zero);
        let n = self.of(contacts, slot).1.len();
        let nv = if self.spread.is_empty() {
            0
        } else {
            self.velocities.len()
        };
        let rows = self.Z[self.starts[slot]..][..n].iter_mut();
        for z in rows.chain(&mut self.spread[slot * nv..][..nv]) {
            for k in 0..3 {
                z[k] = T::select(held[k], zero, z[k]);
            }
        }
        for k in 0..3 {
            let u = &mut self.u_before[slot][k];
            *u = T::select(held[k], zero, *u);
        }
    }

    /// Where the loops let nothing move a slot; `free`: squares of its rows, 1/kg.
    #[inline(always)]
    fn find_held(
        &mut self,
        loops: &Loops<T>,
        contacts: &ContactSlots<T>,
        slot: usize,
        free: &Triple<T>,
    ) -> [T::Mask; 3] {
        let zero = T::splat(self.token, 0.0);
        if self.spread.is_empty() {
            let mut left = *free;
            for row in 0..loops.m() {
                let b = loops.product(row, slot);
                for k in 0..3 {
                    left[k] -= b[k] * b[k];
                }
            }
            return Loops::holds(free, &left, ROUNDED);
        }
        let nv = self.velocities.len();
        let mut spread = std::mem::take(&mut self.spread);
        let own = &mut spread[slot * nv..][..nv];
        own.fill([zero; 3]);
        let (path, rows) = self.of(contacts, slot);
        for (k, z) in path.velocities().zip(rows) {
            own[k] = *z;
        }
        loops.project_rows(slot, own);
        let mut left = [zero; 3];
        for z in &*own {
            for k in 0..3 {
                left[k] += z[k] * z[k];
            }
        }
        self.spread = spread;
        Loops::holds(free, &left, ROUNDED_SQUARE)
    }

    /// Rows of two slots over all velocities, where they are kept.
    #[inline(always)]
    fn spread_of(&self, slots: [usize; 2]) -> Option<[&[Triple<T>]; 2]> {
        let nv = self.velocities.len();
        (!self.spread.is_empty()).then(|| slots.map(|slot| &self.spread[slot * nv..][..nv]))
    }

    /// Makes W regular where its diagonal is zero, since loops let nothing move a contact: the
    /// impulses there are zero. After [`Self::soften`], as what yields has a load.
    pub fn close_held(&mut self, contacts: &ContactSlots<T>) {
        if self.held.is_empty() {
            return;
        }
        let zero = T::splat(self.token, 0.0);
        let close = |own: &mut T, closing: T| {
            *own = T::select(own.le(zero) & zero.lt(closing), closing, *own);
        };
        for cluster in 0..contacts.n_clusters() {
            let blocks = &mut self.W[self.first_blocks[cluster]..];
            for (i, &slot) in contacts.used_densely(cluster).iter().enumerate() {
                for k in [0, 4, 8] {
                    close(&mut blocks[block(i, i)][k], self.closing[slot]);
                }
            }
        }
        if contacts.factored() != 0 {
            for slot in contacts.used_nearby() {
                let own = &mut self.diagonal[slot];
                if !is_friction(contacts, slot) {
                    let is_held = own[0].le(zero);
                    self.normal[slot] = T::select(is_held, self.closing[slot], zero);
                }
                for k in [0, 4, 8] {
                    close(&mut own[k], self.closing[slot]);
                }
            }
        }
    }

    /// Lanes in which nothing moves a slot's contact along its normal.
    #[inline(always)]
    pub(crate) fn immovable(&self, slot: usize) -> T::Mask {
        self.immovable[slot]
    }

    /// Number of contacts of a lane that nothing moves along their normals.
    pub(crate) fn n_immovable(&self, contacts: &ContactSlots<T>, lane: usize) -> usize {
        let here =
            |slot: &&usize| (self.immovable[**slot] & contacts.slot(**slot).active).get(lane);
        self.held.iter().filter(here).count()
    }

    /// Diagonal blocks of W from Z.
    #[inline(always)]
    fn multiply_diagonal(&mut self, contacts: &ContactSlots<T>, loops: Option<&Loops<T>>) {
        for slot in contacts.used_nearby() {
            self.diagonal[slot] = self.own_block(contacts, slot, loops);
        }
    }

    /// W from Z.
    #[inline(always)]
    fn multiply(&mut self, contacts: &ContactSlots<T>, loops: Option<&Loops<T>>) {
        let (n_parts, zero) = (self.movers.len(), T::splat(self.token, 0.0));
        for cluster in 0..contacts.n_clusters() {
            let used = contacts.used_densely(cluster);
            let mut at = self.first_blocks[cluster];
            for (i, &row) in used.iter().enumerate() {
                let a = contacts.part(row);
                for &column in &used[..i] {
                    if let Some([x, y]) = self.spread_of([row, column]) {
                        self.W[at] = product(zero, x, y);
                        at += 1;
                        continue;
                    }
                    let b = contacts.part(column);
                    let shared = self.common[a * n_parts + b];
                    let x = &self.Z[self.starts[row]..][..shared];
                    let y = &self.Z[self.starts[column]..][..shared];
                    self.W[at] = product(zero, x, y);
                    if let Some(loops) = loops {
                        loops.project_block([row, column], &mut self.W[at]);
                    }
                    at += 1;
                }
                self.W[at] = self.own_block(contacts, row, loops);
                at += 1;
            }
        }
    }

    /// Block of W of a slot with itself.
    #[inline(always)]
    fn own_block(
        &self,
        contacts: &ContactSlots<T>,
        slot: usize,
        loops: Option<&Loops<T>>,
    ) -> [T; 9] {
        let zero = T::splat(self.token, 0.0);
        let spread = self.spread_of([slot, slot]);
        let mut own = match spread {
            Some([rows, _]) => square(zero, rows),
            None => square(zero, self.of(contacts, slot).1),
        };
        if is_friction(contacts, slot) {
            (own[0], own[8]) = (self.normal[slot], self.normal[slot]);
        } else if let Some((_, row)) = contacts.joint_row(slot) {
            row.close(&mut own);
        } else if self.has_rollers {
            rollers::close(&mut own);
        }
        if let (Some(loops), None) = (loops, spread) {
            loops.project_block([slot, slot], &mut own);
        }
        own
    }

    /// Adds numbers by slot, along n, t, b, 1/kg, to W's diagonal.
    pub fn soften(&mut self, contacts: &ContactSlots<T>, diagonal: impl Fn(usize) -> Triple<T>) {
        let soften = |own: &mut [T; 9], slot: usize| {
            for (k, more) in diagonal(slot).into_iter().enumerate() {
                own[4 * k] += more;
            }
        };
        for cluster in 0..contacts.n_clusters() {
            let blocks = &mut self.W[self.first_blocks[cluster]..];
            for (i, &slot) in contacts.used_densely(cluster).iter().enumerate() {
                soften(&mut blocks[block(i, i)], slot);
            }
        }
        if contacts.factored() != 0 {
            for slot in contacts.used_nearby() {
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
    pub fn local(&self, contacts: &ContactSlots<T>, y: &[T], q: &mut [Triple<T>]) {
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
        contacts: &ContactSlots<T>,
        lanes: T::Mask,
        p: &[Triple<T>],
        y: &mut [T],
        loops: Option<&Loops<T>>,
    ) {
        for &slot in contacts.used() {
            let (path, rows) = self.of(contacts, slot);
            path.push(contacts.slot(slot).active & lanes, rows, &p[slot], y);
        }
        if let Some(loops) = loops {
            loops.answer(&in_slots(contacts, lanes, p), y);
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
        machine: &SharedMachine,
        contacts: &ContactSlots<T>,
        end: &Poses<T>,
        lanes: T::Mask,
        p: &[Triple<T>],
        out: &mut [T],
    ) {
        let zero = T::splat(self.token, 0.0);
        out.fill(zero);
        // Force and moment on a root; the slots of a tree follow each other, mostly.
        let mut tree = None;
        let mut sums = [zero; BASE];
        let mut off_path = 0;
        for &slot in contacts.used_by_shapes() {
            let own = contacts.slot(slot);
            let own_off_path = contacts.by_lane.off_path(slot);
            let in_slot = own_off_path.fold(0, |all, (lane, _)| all | 1 << lane);
            off_path |= in_slot;
            if self.bodies[contacts.part(slot)].is_none() {
                continue;
            }
            let here = own.active & lanes & !T::mask(self.token, in_slot);
            let [force, moment] = place_of(own).wrench(p[slot]);
            let VelocityPath { base, movers } = self.path(contacts.part(slot));
            if let Some(first) = base {
                let both = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
                if base != tree {
                    if let Some(last) = tree {
                        out[last..][..BASE].copy_from_slice(&sums);
                    }
                    sums.copy_from_slice(&out[first..][..BASE]);
                    tree = base;
                }
                for k in 0..BASE {
                    add(here, &mut sums[k], both[k]);
                }
            }
            for mover in movers {
                let power = end.motions[mover.motion].power(force, moment);
                add(here, &mut out[mover.velocity], power);
            }
        }
        if let Some(last) = tree {
            out[last..][..BASE].copy_from_slice(&sums);
        }
        if (lanes & T::mask(self.token, off_path)).any() {
            add_off_path_impulses(machine, contacts, end, lanes, p, out);
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
        contacts: &ContactSlots<T>,
        (q, mu): (&[Triple<T>], &[T]),
        problems: &mut [ContactProblem],
        loops: Option<&Loops<T>>,
    ) {
        inlined!(T::vectorize, self.token, {
            let problems = &mut problems[..contacts.n_problems()];
            let factored = contacts.factored();
            for (index, problem) in problems.iter_mut().enumerate() {
                problem.n_contacts = contacts.list(index).n;
                problem.n_dry = contacts.n_dry(index);
                problem.make_room();
                problem.has_start = false;
                problem.asks_least = true;
                if problem.n_contacts > 0 && contacts.is_factored(index) {
                    problem.factored.adopt(self.pattern_of(contacts, index));
                    problem.factored.slots = 0;
                    problem.factored.is_multiplied = contacts.is_multiplied(index);
                } else {
                    problem.factored.pattern = None;
                }
            }
            for &slot in contacts.used() {
                let (problem_indices, places) =
                    (contacts.problem_indices(slot), contacts.places(slot));
                let [n, t, b] = q[slot];
                let values = store_all(&[n, t, b, mu[slot]]);
                each::<T>(
                    contacts.slot(slot).active,
                    #[inline(always)]
                    |lane| {
                        let place = usize::from(places[lane]);
                        let problem = &mut problems[usize::from(problem_indices[lane])];
                        let q = &mut problem.q[3 * place..][..3];
                        for i in 0..3 {
                            q[i] = values[i][lane];
                        }
                        problem.mu[place] = values[3][lane];
                    },
                );
                if factored != 0 && contacts.near(slot) != 0 {
                    self.write_factors(contacts, slot, problems, loops);
                }
            }
            for cluster in 0..contacts.n_clusters() {
                let problems = &mut problems[cluster * T::LANES..][..T::LANES];
                let mut at = 0;
                let dense = contacts.used_densely(cluster);
                for (i, &row) in dense.iter().enumerate() {
                    for &column in &dense[..=i] {
                        let w = &self.W[self.first_blocks[cluster] + at];
                        self.write_block(contacts, [row, column], (at, w), problems);
                        at += 1;
                    }
                }
            }
        });
    }

    /// Pattern of a problem with factors.
    #[inline(always)]
    fn pattern_of(&self, contacts: &ContactSlots<T>, problem: usize) -> &Arc<Pattern> {
        match contacts.members(problem) {
            None => &self.patterns[problem / T::LANES],
            Some(members) => self.wide.of(members.map(|own| self.sizes[own]).sum()),
        }
    }

    /// Writes the block `w` of W of two slots of a cluster to its problems; `at`: their position in
    /// problems that have all slots in use.
    #[inline(always)]
    fn write_block(
        &self,
        contacts: &ContactSlots<T>,
        [row, column]: [usize; 2],
        (at, w): (usize, &[T; 9]),
        problems: &mut [ContactProblem],
    ) {
        let (of_row, of_column) = (contacts.places(row), contacts.places(column));
        let [first @ .., last] = w;
        let (mut rows, mut ends) = ([[0.0; 8]; MAX_LANES], [0.0; MAX_LANES]);
        T::transpose(first, &mut rows);
        last.store(&mut ends[..T::LANES]);
        if contacts.is_full() && contacts.factored() == 0 {
            for (lane, problem) in problems.iter_mut().enumerate() {
                let out = &mut problem.W[at];
                out[..8].copy_from_slice(&rows[lane]);
                out[8] = ends[lane];
            }
            return;
        }
        let dense = T::mask(self.token, !contacts.near(row));
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
    fn write_factors(
        &self,
        contacts: &ContactSlots<T>,
        slot: usize,
        problems: &mut [ContactProblem],
        loops: Option<&Loops<T>>,
    ) {
        let (problem_indices, places) = (contacts.problem_indices(slot), contacts.places(slot));
        let near = T::mask(self.token, contacts.near(slot));
        let (path, rows) = self.of(contacts, slot);
        let [n, t, b] = self.softness[slot];
        let softness = store_all(&[n, t, b, self.normal[slot]]);
        let diagonal = store_all(&self.diagonal[slot]);
        let still = BASE - path.lead();
        // Lanes whose problem has all velocities.
        let mut whole = 0;
        each::<T>(
            near,
            #[inline(always)]
            |lane| {
                let out = &mut problems[usize::from(problem_indices[lane])].factored;
                let contact = usize::from(places[lane]);
                out.softness[contact] = [0, 1, 2].map(|k| softness[k][lane]);
                out.normal[contact] = softness[3][lane];
                let own = &mut out.diagonal[contact];
                for k in 0..9 {
                    own[k] = diagonal[k][lane];
                }
                let (stride, is_whole) = out.shape();
                if is_whole {
                    whole |= 1 << lane;
                    out.slots |= 1 << contact;
                    out.Z[contact * stride..][..stride].fill([0.0; 3]);
                } else {
                    out.slots |= 1 << self.numbers[slot];
                    if still > 0 {
                        out.Z[contact * stride..][..still].fill([0.0; 3]);
                    }
                }
            },
        );
        if whole == 0 {
            self.write_along_path(contacts, slot, (still, rows), problems);
            return;
        }
        for (k, (velocity, z)) in path.velocities().zip(rows).enumerate() {
            let values = store_all(z);
            let [cluster, place] = self.velocities[velocity];
            each::<T>(
                near,
                #[inline(always)]
                |lane| {
                    let problem_index = usize::from(problem_indices[lane]);
                    let column = if whole >> lane & 1 == 1 {
                        contacts
                            .first_column(cluster, problem_index)
                            .map(|k| k + place)
                    } else {
                        Some(still + k)
                    };
                    let out = &mut problems[problem_index].factored;
                    if let Some(column) = column {
                        let at = usize::from(places[lane]) * out.shape().0 + column;
                        let out = &mut out.Z[at];
                        for i in 0..3 {
                            out[i] = values[i][lane];
                        }
                    }
                },
            );
        }
        if let Some(loops) = loops {
            let whole = T::mask(self.token, whole);
            self.project_factors(contacts, (slot, loops), whole, problems);
        }
    }

    /// Writes the rows of a slot to problems with the pattern of its cluster, after those of a free
    /// root that it does not have.
    #[inline(always)]
    fn write_along_path(
        &self,
        contacts: &ContactSlots<T>,
        slot: usize,
        (still, rows): (usize, &[Triple<T>]),
        problems: &mut [ContactProblem],
    ) {
        let (problem_indices, places) = (contacts.problem_indices(slot), contacts.places(slot));
        let near = T::mask(self.token, contacts.near(slot));
        let Some(cluster) = contacts.cluster_of(slot) else {
            return;
        };
        let stride = self.patterns[cluster].stride();
        for (k, z) in (still..).zip(rows) {
            let values = store_all(z);
            each::<T>(
                near,
                #[inline(always)]
                |lane| {
                    let at = usize::from(places[lane]) * stride + k;
                    let out = &mut problems[usize::from(problem_indices[lane])].factored.Z[at];
                    for i in 0..3 {
                        out[i] = values[i][lane];
                    }
                },
            );
        }
    }

    /// `Z − Qᵀ B` in place of a slot's Z, in lanes whose problems have it along all velocities.
    #[inline(always)]
    fn project_factors(
        &self,
        contacts: &ContactSlots<T>,
        (slot, loops): (usize, &Loops<T>),
        whole: T::Mask,
        problems: &mut [ContactProblem],
    ) {
        let zero = T::splat(self.token, 0.0);
        let (problem_indices, places) = (contacts.problem_indices(slot), contacts.places(slot));
        for (k, &[cluster, place]) in self.velocities.iter().enumerate() {
            let mut taken = [zero; 3];
            for row in 0..loops.m() {
                add_scaled(&mut taken, loops.product(row, slot), loops.q(row)[k]);
            }
            let taken = store_all(&taken);
            each::<T>(
                whole,
                #[inline(always)]
                |lane| {
                    let problem_index = usize::from(problem_indices[lane]);
                    let Some(first) = contacts.first_column(cluster, problem_index) else {
                        return;
                    };
                    let out = &mut problems[problem_index].factored;
                    let at = usize::from(places[lane]) * out.shape().0 + first + place;
                    let out = &mut out.Z[at];
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
        contacts: &ContactSlots<T>,
        problems: &[ContactProblem],
        answer: ContactQuantity,
        out: &mut [Triple<T>],
    ) {
        let problems = &problems[..contacts.n_problems()];
        for &slot in contacts.used() {
            let mut values = store_all(&out[slot]);
            let (problem_indices, places) = (contacts.problem_indices(slot), contacts.places(slot));
            each::<T>(
                contacts.slot(slot).active,
                #[inline(always)]
                |lane| {
                    let problem = &problems[usize::from(problem_indices[lane])];
                    let all = match answer {
                        ContactQuantity::Impulses => &problem.p,
                        ContactQuantity::Velocities => &problem.u,
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

/// First velocity of the base, if the first root is free, and the others of a path with all
/// velocities.
fn whole_path(machine: &SharedMachine) -> (Option<usize>, Vec<PathVelocity>) {
    let is_free = machine.trees.first().is_some_and(|tree| tree.is_free);
    let (first, lead) = if is_free { (Some(0), BASE) } else { (None, 0) };
    let others = (lead..machine.nv()).map(|velocity| PathVelocity {
        velocity,
        motion: 0, // not read
    });
    (first, others.collect())
}

/// Whether a slot is for the dry friction of a joint.
#[inline(always)]
fn is_friction<T: Lane>(contacts: &ContactSlots<T>, slot: usize) -> bool {
    matches!(contacts.joint_row(slot), Some((_, JointRow::Friction)))
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
fn add_off_path_impulses<T: Lane>(
    machine: &SharedMachine,
    contacts: &ContactSlots<T>,
    end: &Poses<T>,
    lanes: T::Mask,
    p: &[Triple<T>],
    out: &mut [T],
) {
    for &slot in contacts.used_by_shapes() {
        let off_path = contacts.by_lane.off_path(slot);
        for (lane, contact) in off_path.filter(|(lane, _)| lanes.get(*lane)) {
            let one = Still {
                mechanism: machine.mechanism(),
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
fn write_off_path<T: Lane>(
    one: &Still<'_, T>,
    contact: &Contact,
    path: VelocityPath<'_>,
    rows: &mut [Triple<T>],
    u: &mut Triple<T>,
) {
    let lane = one.lane;
    for own in rows.iter_mut().flatten().chain(&mut *u) {
        own.set(lane, 0.0);
    }
    for_each_row(one, contact, |velocity, row| {
        let is_own = |mover: &PathVelocity| mover.velocity == velocity;
        let own = match path.movers.iter().position(is_own) {
            Some(k) => &mut rows[path.lead() + k],
            None => &mut rows[velocity - path.base.unwrap_or(0)],
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
pub(crate) fn in_slots<'a, T: Lane>(
    contacts: &'a ContactSlots<T>,
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
