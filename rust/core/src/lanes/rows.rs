//! Contact Jacobian and Delassus operator `W = Hᵀ M̂⁻¹ H` of a block.
//!
//! As in [`crate::contact::delassus`]: with `M̂ = Lᵀ D L` and `Z = D^(-1/2) L^(-T) H` the operator
//! is `W = Zᵀ Z`. A column of Z is nonzero along the path of its wheel, and a block of W is a
//! product over the part of the path that two wheels share. Rows belong to slots
//! ([`super::contacts`]). A stop has one row, ±1 at its joint's velocity; the tangential diagonal
//! of W is that of the normal, as in [`crate::contact::limit`]. A slot that is active in some lanes
//! only never changes what the others accumulate.

use std::sync::Arc;

use nalgebra::Vector3;

use super::by_lane::{add_impulse, write_rows};
use super::contacts::Contacts;
use super::machine::Machine;
use super::pattern::Pattern;
use super::problem::{ContactProblem, Triple, block};
use crate::contact::Contact;
use crate::multibody::mechanism::{BASE, Mover};
use crate::multibody::{Factor, Poses};
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3};

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
    /// Bodies of the parts: wheels, spare slots, and joints with stops; none of a spare slot with
    /// all velocities.
    bodies: Vec<Option<usize>>,
    /// Velocities of the joints that move each part, from the trunk outwards.
    pub(super) movers: Vec<Vec<Mover>>,
    /// Velocities that two parts share: `common[a * n_parts + b]`.
    common: Vec<usize>,
    /// Length of the longest path.
    pub(super) stride: usize,
    /// Z along the path of each slot's wheel: `Z[slot * stride + k]`.
    pub(super) Z: Vec<Triple<T>>,
    /// Blocks of W for the slots in use by lanes without factors, row-major: [`block`] of their
    /// positions among them.
    pub(super) W: Vec<[T; 9]>,
    /// Pattern of the problems with factors.
    pattern: Option<Arc<Pattern>>,
    /// Diagonal blocks of W by slot, and what [`Self::soften`] added to them, 1/kg.
    pub(super) diagonal: Vec<[T; 9]>,
    pub(super) softness: Vec<T>,
    /// The motion in [`Self::sweep`] (nv, factor coordinates).
    pub(super) swept: Vec<T>,
    /// Local velocity `Hᵀ v` before the step by slot, m/s.
    pub u_before: Vec<Triple<T>>,
}

impl<T: Lane> Rows<T> {
    /// Room for a machine with `n_slots` slots.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine, n_slots: usize) -> Self {
        let wheels = machine.wheels.iter().map(|wheel| Some(wheel.body));
        let spares = machine.spares.iter().copied();
        let stops = machine.stops.iter();
        let stops = stops.map(|stop| Some(machine.joints[stop.joint].body));
        let bodies: Vec<Option<usize>> = wheels.chain(spares).chain(stops).collect();
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
        Self {
            token,
            bodies,
            movers,
            common,
            stride,
            Z: vec![[zero; 3]; n_slots * stride],
            W: vec![[zero; 9]; n_slots * (n_slots + 1) / 2],
            pattern: machine.pattern.clone(),
            diagonal: vec![[zero; 9]; n_slots],
            softness: vec![zero; n_slots],
            swept: vec![zero; machine.nv()],
            u_before: vec![[zero; 3]; n_slots],
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
                for &slot in contacts.used_by_shapes() {
                    self.build(machine, end, factor, contacts, v, slot);
                }
                for &slot in contacts.used_by_stops() {
                    self.build_stop(machine, factor, contacts, v, slot);
                }
                self.multiply(contacts);
                for (i, &slot) in contacts.used_densely().iter().enumerate() {
                    if contacts.stop(slot).is_some() {
                        let own = &mut self.W[block(i, i)];
                        (own[4], own[8]) = (own[0], own[0]);
                    }
                }
                if contacts.factored() != 0 {
                    self.multiply_diagonal(contacts);
                } else {
                    for (i, &slot) in contacts.used().iter().enumerate() {
                        self.diagonal[slot] = self.W[block(i, i)];
                    }
                }
            },
        );
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
        let movers = &self.movers[part][..];
        let rows = &mut self.Z[slot * self.stride..][..BASE + movers.len()];
        let own = contacts.slot(slot);
        let (base, joints) = rows.split_at_mut(BASE);
        let (x, n, t, b) = (own.point, own.n, own.t, own.b);
        let (xn, xt, xb) = (x.cross(n), x.cross(t), x.cross(b));
        base[0] = [n.x, t.x, b.x];
        base[1] = [n.y, t.y, b.y];
        base[2] = [n.z, t.z, b.z];
        base[3] = [xn.x, xt.x, xb.x];
        base[4] = [xn.y, xt.y, xb.y];
        base[5] = [xn.z, xt.z, xb.z];
        let mut u = scaled(&base[0], v[0]);
        for k in 1..BASE {
            add_scaled(&mut u, &base[k], v[k]);
        }
        let joints = &mut joints[..movers.len()];
        for k in 0..movers.len() {
            let moved = end.motions[movers[k].motion].velocity_at(x);
            let row = [moved.dot(n), moved.dot(t), moved.dot(b)];
            joints[k] = row;
            add_scaled(&mut u, &row, v[movers[k].velocity]);
        }
        for guest in contacts.by_lane.guests(slot) {
            let lane = guest.0;
            write_rows(machine, end, guest, movers, rows);
            let mut own = [0.0; 3];
            let velocities = (0..BASE).chain(movers.iter().map(|mover| mover.velocity));
            for (row, k) in rows.iter().zip(velocities) {
                for (own, row) in own.iter_mut().zip(row) {
                    *own += row.get(lane) * v[k].get(lane);
                }
            }
            for (u, own) in u.iter_mut().zip(own) {
                u.set(lane, own);
            }
        }
        self.u_before[slot] = u;
        match self.bodies[part] {
            Some(body) => factor.half_solve_path(machine, body, rows),
            None => half_solve_whole(machine, factor, rows),
        }
    }

    /// Z and `Hᵀ v` of a stop's slot.
    #[inline(always)]
    fn build_stop(
        &mut self,
        machine: &Machine,
        factor: &Factor<T>,
        contacts: &Contacts<T>,
        v: &[T],
        slot: usize,
    ) {
        let part = contacts.part(slot);
        let (Some((_, sign)), Some(mover)) = (contacts.stop(slot), self.movers[part].last()) else {
            return;
        };
        let zero = T::splat(self.token, 0.0);
        let rows = &mut self.Z[slot * self.stride..][..BASE + self.movers[part].len()];
        rows.fill([zero; 3]);
        let last = rows.len() - 1;
        rows[last][0] = sign;
        self.u_before[slot] = [sign * v[mover.velocity], zero, zero];
        if let Some(body) = self.bodies[part] {
            factor.half_solve_path(machine, body, rows);
        }
    }

    /// Diagonal blocks of W from Z.
    #[inline(always)]
    fn multiply_diagonal(&mut self, contacts: &Contacts<T>) {
        for &slot in contacts.used() {
            let movers = &self.movers[contacts.part(slot)];
            let z = &self.Z[slot * self.stride..][..BASE + movers.len()];
            let own = &mut self.diagonal[slot];
            *own = square(z);
            if contacts.stop(slot).is_some() {
                (own[4], own[8]) = (own[0], own[0]);
            }
        }
    }

    /// W from Z.
    #[inline(always)]
    fn multiply(&mut self, contacts: &Contacts<T>) {
        let used = contacts.used_densely();
        let n_parts = self.movers.len();
        let mut at = 0;
        for (i, &row) in used.iter().enumerate() {
            let a = contacts.part(row);
            for &column in &used[..i] {
                let b = contacts.part(column);
                let shared = self.common[a * n_parts + b];
                let x = &self.Z[row * self.stride..][..shared];
                let y = &self.Z[column * self.stride..][..shared];
                self.W[at] = product(x, y);
                at += 1;
            }
            let x = &self.Z[row * self.stride..][..BASE + self.movers[a].len()];
            self.W[at] = square(x);
            at += 1;
        }
    }

    /// Adds a number by slot, 1/kg, to the three entries on W's diagonal.
    pub fn soften(&mut self, contacts: &Contacts<T>, diagonal: &[T]) {
        let soften = |own: &mut [T; 9], slot: usize| {
            for k in [0, 4, 8] {
                own[k] += diagonal[slot];
            }
        };
        for (i, &slot) in contacts.used_densely().iter().enumerate() {
            soften(&mut self.W[block(i, i)], slot);
        }
        for &slot in contacts.used() {
            self.softness[slot] = diagonal[slot];
            soften(&mut self.diagonal[slot], slot);
        }
    }

    /// `q = Zᵀ y + Hᵀ v` by slot: local velocities after a change `y` (nv, factor coordinates) of
    /// the velocity before the step.
    ///
    /// # Panics
    /// If an argument is of another machine.
    #[inline(always)]
    pub fn local(&self, contacts: &Contacts<T>, y: &[T], q: &mut [Triple<T>]) {
        for &slot in contacts.used() {
            let movers = &self.movers[contacts.part(slot)][..];
            let rows = &self.Z[slot * self.stride..][..BASE + movers.len()];
            let (base, joints) = rows.split_at(BASE);
            let mut sum = scaled(&base[0], y[0]);
            for k in 1..BASE {
                add_scaled(&mut sum, &base[k], y[k]);
            }
            let joints = &joints[..movers.len()];
            for k in 0..movers.len() {
                add_scaled(&mut sum, &joints[k], y[movers[k].velocity]);
            }
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
            let movers = &self.movers[contacts.part(slot)][..];
            let rows = &self.Z[slot * self.stride..][..BASE + movers.len()];
            let (base, joints) = rows.split_at(BASE);
            let here = contacts.slot(slot).active & lanes;
            let p = &p[slot];
            let joints = &joints[..movers.len()];
            for k in 0..BASE {
                add(here, &mut y[k], along(&base[k], p));
            }
            for k in 0..movers.len() {
                add(here, &mut y[movers[k].velocity], along(&joints[k], p));
            }
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
        let mut total = Vec3::new(zero, zero, zero);
        let mut couple = total;
        for &slot in contacts.used_by_shapes() {
            let own = contacts.slot(slot);
            let mut here = own.active & lanes;
            for guest in contacts.by_lane.guests(slot) {
                if here.get(guest.0) {
                    here = here & !T::mask(self.token, 1 << guest.0);
                    let p = p[slot].map(|p| p.get(guest.0));
                    add_impulse(machine, end, guest, p, out);
                    if guest.1.other.is_none() {
                        add_to_base(guest, p, &mut total, &mut couple);
                    }
                }
            }
            let [p_n, p_t, p_b] = p[slot];
            let force = own.n * p_n + own.t * p_t + own.b * p_b;
            let moment = own.point.cross(force);
            add_vector(here, &mut total, force);
            add_vector(here, &mut couple, moment);
            for mover in &self.movers[contacts.part(slot)] {
                let power = end.motions[mover.motion].power(force, moment);
                add(here, &mut out[mover.velocity], power);
            }
        }
        for &slot in contacts.used_by_stops() {
            let here = contacts.slot(slot).active & lanes;
            let mover = self.movers[contacts.part(slot)].last();
            if let (Some((_, sign)), Some(mover)) = (contacts.stop(slot), mover) {
                add(here, &mut out[mover.velocity], sign * p[slot][0]);
            }
        }
        out[..BASE].copy_from_slice(&[total.x, total.y, total.z, couple.x, couple.y, couple.z]);
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
                    problem.has_start = false;
                    match &self.pattern {
                        Some(pattern) if factored >> lane & 1 == 1 => {
                            problem.factored.adopt(pattern);
                            problem.factored.slots = 0;
                        }
                        _ => problem.factored.pattern = None,
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
        let Some(pattern) = &self.pattern else {
            return;
        };
        let places = contacts.places(slot);
        let active = contacts.slot(slot).active & T::mask(self.token, contacts.factored());
        let movers = &self.movers[contacts.part(slot)];
        let n = BASE + movers.len();
        let (stride, length) = (pattern.stride(), BASE + pattern.joints(slot).len());
        let softness = store_all(&[self.softness[slot]]);
        let diagonal = store_all(&self.diagonal[slot]);
        each::<T>(
            active,
            #[inline(always)]
            |lane| {
                let (contact, out) = (usize::from(places[lane]), &mut problems[lane].factored);
                out.slots |= 1 << slot;
                out.softness[contact] = softness[0][lane];
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

/// `Z` of rows of all velocities, in their place.
#[cold]
fn half_solve_whole<T: Lane>(machine: &Machine, factor: &Factor<T>, rows: &mut [Triple<T>]) {
    for j in 0..3 {
        let mut column: Vec<T> = rows.iter().map(|row| row[j]).collect();
        factor.half_solve(machine, &mut column);
        for (row, x) in rows.iter_mut().zip(column) {
            row[j] = x;
        }
    }
}

/// Adds the impulse of a contact with the ground, N s, and its moment about the trunk's origin.
fn add_to_base<T: Lane>(
    (lane, contact): (usize, &Contact),
    p: [f64; 3],
    total: &mut Vec3<T>,
    couple: &mut Vec3<T>,
) {
    let [n, t, b] = contact.frame.rows();
    let force = n * p[0] + t * p[1] + b * p[2];
    let moment = contact.point.cross(&force);
    let add = |sum: &mut Vec3<T>, x: Vector3<f64>| {
        let own = Vector3::from(sum.get(lane));
        sum.set(lane, (own + x).into());
    };
    add(total, force);
    add(couple, moment);
}

/// `x += y` where the mask is true.
#[inline(always)]
pub(super) fn add<T: Lane>(mask: T::Mask, x: &mut T, y: T) {
    *x = T::select(mask, *x + y, *x);
}

#[inline(always)]
fn add_vector<T: Lane>(mask: T::Mask, x: &mut Vec3<T>, y: Vec3<T>) {
    *x = Vec3::select(mask, *x + y, *x);
}

/// A row of Z times an impulse.
#[inline(always)]
pub(super) fn along<T: Lane>(z: &Triple<T>, p: &Triple<T>) -> T {
    z[0] * p[0] + z[1] * p[1] + z[2] * p[2]
}

/// `a x`.
#[inline(always)]
fn scaled<T: Lane>(x: &Triple<T>, a: T) -> Triple<T> {
    [a * x[0], a * x[1], a * x[2]]
}

/// `sums += a x`.
#[inline(always)]
pub(super) fn add_scaled<T: Lane>(sums: &mut Triple<T>, x: &Triple<T>, a: T) {
    for i in 0..3 {
        sums[i] += a * x[i];
    }
}

/// `Xᵀ Y`, row-major.
#[inline(always)]
fn product<T: Lane>(x: &[Triple<T>], y: &[Triple<T>]) -> [T; 9] {
    let ([a, b, c], [d, e, f]) = (x[0], y[0]);
    let mut sums = [
        a * d,
        a * e,
        a * f,
        b * d,
        b * e,
        b * f,
        c * d,
        c * e,
        c * f,
    ];
    let y = &y[..x.len()];
    for k in 1..x.len() {
        for i in 0..3 {
            for j in 0..3 {
                sums[3 * i + j] += x[k][i] * y[k][j];
            }
        }
    }
    sums
}

/// `Xᵀ X`, row-major.
#[inline(always)]
fn square<T: Lane>(x: &[Triple<T>]) -> [T; 9] {
    let [a, b, c] = x[0];
    let mut sums = [a * a, b * a, b * b, c * a, c * b, c * c];
    for [a, b, c] in &x[1..] {
        sums[0] += *a * *a;
        sums[1] += *b * *a;
        sums[2] += *b * *b;
        sums[3] += *c * *a;
        sums[4] += *c * *b;
        sums[5] += *c * *c;
    }
    let [nn, tn, tt, bn, bt, bb] = sums;
    [nn, tn, bn, tn, tt, bt, bn, bt, bb]
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
