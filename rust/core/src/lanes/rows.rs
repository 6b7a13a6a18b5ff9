//! Contact Jacobian and Delassus operator `W = Hᵀ M̂⁻¹ H` of a block.
//!
//! As in [`crate::contact::delassus`]: with `M̂ = Lᵀ D L` and `Z = D^(-1/2) L^(-T) H` the operator
//! is `W = Zᵀ Z`. A column of Z is nonzero along the path of its wheel, and a block of W is a
//! product over the part of the path that two wheels share. Rows belong to slots
//! ([`super::contacts`]). A stop has one row, ±1 at its joint's velocity; the tangential diagonal
//! of W is that of the normal, as in [`crate::contact::limit`]. A slot that is active in some lanes
//! only never changes what the others accumulate.

use std::sync::Arc;

use super::contacts::Contacts;
use super::machine::Machine;
use super::pattern::Pattern;
use super::problem::{ContactProblem, Triple, block};
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
    /// Bodies of the parts, wheels and then joints with stops.
    bodies: Vec<usize>,
    /// Velocities of the joints that move each part, from the trunk outwards.
    pub(super) movers: Vec<Vec<Mover>>,
    /// Velocities that two parts share: `common[a * n_parts + b]`.
    common: Vec<usize>,
    /// Length of the longest path.
    pub(super) stride: usize,
    /// Z along the path of each slot's wheel: `Z[slot * stride + k]`.
    pub(super) Z: Vec<Triple<T>>,
    /// Blocks of W for the slots in use, row-major: [`block`] of their positions among them. Of a
    /// machine with a pattern: the diagonal blocks by slot.
    pub(super) W: Vec<[T; 9]>,
    /// Where W is used by its factors.
    pattern: Option<Arc<Pattern>>,
    /// What [`Self::soften`] added to the diagonal of W by slot, with a pattern, 1/kg.
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
        let wheels = machine.wheels.iter().map(|wheel| wheel.body);
        let stops = machine
            .stops
            .iter()
            .map(|stop| machine.joints[stop.joint].body);
        let bodies: Vec<usize> = wheels.chain(stops).collect();
        let paths: Vec<&[usize]> = bodies.iter().map(|&body| machine.path(body)).collect();
        let mut common = Vec::with_capacity(paths.len() * paths.len());
        for a in &paths {
            for b in &paths {
                common.push(a.iter().zip(*b).take_while(|(i, j)| i == j).count());
            }
        }
        let movers = bodies.iter().map(|&body| machine.movers(body).to_vec());
        let movers = movers.collect();
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
            softness: vec![zero; n_slots],
            swept: vec![zero; machine.nv()],
            u_before: vec![[zero; 3]; n_slots],
        }
    }

    /// Whether W is used by its factors.
    #[inline(always)]
    #[must_use]
    pub fn is_factored(&self) -> bool {
        self.pattern.is_some()
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
                for &slot in contacts.used_by_wheels() {
                    self.build(machine, end, factor, contacts, v, slot);
                }
                for &slot in contacts.used_by_stops() {
                    self.build_stop(machine, factor, contacts, v, slot);
                }
                if self.pattern.is_some() {
                    self.multiply_diagonal(contacts);
                } else {
                    self.multiply(contacts);
                }
                let n_wheels = contacts.used_by_wheels().len();
                for (i, &slot) in contacts.used_by_stops().iter().enumerate() {
                    let i = n_wheels + i;
                    let at = if self.pattern.is_some() {
                        slot
                    } else {
                        block(i, i)
                    };
                    let own = &mut self.W[at];
                    (own[4], own[8]) = (own[0], own[0]);
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
        self.u_before[slot] = u;
        factor.half_solve_path(machine, self.bodies[part], rows);
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
        let (Some((_, side)), Some(mover)) = (contacts.stop(slot), self.movers[part].last()) else {
            return;
        };
        let zero = T::splat(self.token, 0.0);
        let sign = zero.like(side.sign());
        let rows = &mut self.Z[slot * self.stride..][..BASE + self.movers[part].len()];
        rows.fill([zero; 3]);
        let last = rows.len() - 1;
        rows[last][0] = sign;
        self.u_before[slot] = [sign * v[mover.velocity], zero, zero];
        factor.half_solve_path(machine, self.bodies[part], rows);
    }

    /// Diagonal blocks of W from Z.
    #[inline(always)]
    fn multiply_diagonal(&mut self, contacts: &Contacts<T>) {
        for &slot in contacts.used() {
            let movers = &self.movers[contacts.part(slot)];
            let z = &self.Z[slot * self.stride..][..BASE + movers.len()];
            self.W[slot] = square(z);
        }
    }

    /// W from Z.
    #[inline(always)]
    fn multiply(&mut self, contacts: &Contacts<T>) {
        let used = contacts.used();
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
        for (i, &slot) in contacts.used().iter().enumerate() {
            let own = if self.pattern.is_some() {
                self.softness[slot] = diagonal[slot];
                &mut self.W[slot]
            } else {
                &mut self.W[block(i, i)]
            };
            for k in [0, 4, 8] {
                own[k] += diagonal[slot];
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
        for &slot in contacts.used_by_wheels() {
            let own = contacts.slot(slot);
            let here = own.active & lanes;
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
            if let (Some((_, side)), Some(mover)) = (contacts.stop(slot), mover) {
                add(
                    here,
                    &mut out[mover.velocity],
                    zero.like(side.sign()) * p[slot][0],
                );
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
        mu: T,
        problems: &mut [ContactProblem],
    ) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                let problems = &mut problems[..T::LANES];
                if let Some(pattern) = &self.pattern {
                    for problem in &mut *problems {
                        problem.factored.adopt(pattern);
                        problem.factored.slots = 0;
                    }
                }
                let mut friction = [0.0; MAX_LANES];
                mu.store(&mut friction[..T::LANES]);
                for (lane, problem) in problems.iter_mut().enumerate() {
                    problem.n_contacts = contacts.list(lane).n;
                    problem.mu[..problem.n_contacts].fill(friction[lane]);
                }
                for &slot in contacts.used_by_stops() {
                    let places = contacts.places(slot);
                    each::<T>(
                        contacts.slot(slot).active,
                        #[inline(always)]
                        |lane| problems[lane].mu[usize::from(places[lane])] = 0.0,
                    );
                }
                let mut at = 0;
                for (i, &row) in contacts.used().iter().enumerate() {
                    let of_row = contacts.places(row);
                    let values = store_all(&q[row]);
                    each::<T>(
                        contacts.slot(row).active,
                        #[inline(always)]
                        |lane| {
                            let place = usize::from(of_row[lane]);
                            let q = &mut problems[lane].q[3 * place..][..3];
                            for i in 0..3 {
                                q[i] = values[i][lane];
                            }
                        },
                    );
                    if self.pattern.is_some() {
                        self.write_factors(contacts, row, problems);
                        continue;
                    }
                    for &column in &contacts.used()[..=i] {
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
        let both = contacts.slot(row).active & contacts.slot(column).active;
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
        let (places, active) = (contacts.places(slot), contacts.slot(slot).active);
        let n = BASE + self.movers[contacts.part(slot)].len();
        let softness = store_all(&[self.softness[slot]]);
        let diagonal = store_all(&self.W[slot]);
        each::<T>(
            active,
            #[inline(always)]
            |lane| {
                let (contact, out) = (usize::from(places[lane]), &mut problems[lane].factored);
                out.slots |= 1 << slot;
                out.softness[contact] = softness[0][lane];
                let out = &mut out.diagonal[contact];
                for k in 0..9 {
                    out[k] = diagonal[k][lane];
                }
            },
        );
        let Z = &self.Z[slot * self.stride..][..n];
        for k in 0..n {
            let values = store_all(&Z[k]);
            each::<T>(
                active,
                #[inline(always)]
                |lane| {
                    let at = usize::from(places[lane]) * self.stride + k;
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
