//! Closed loops of a tree in a step: M̂⁻¹ without the motions that would open a loop.
//!
//! With the loops' rows A and `M̂ = Fᵀ F`, factor coordinates `y = F Δv` change the rate of the
//! gaps by `G y`, `G = A F⁻¹`. An orthonormal basis Q of the rows of G turns M̂⁻¹ into its
//! projection
//!
//! ```text
//! M̂⁻¹ − M̂⁻¹ Aᵀ (A M̂⁻¹ Aᵀ)⁻¹ A M̂⁻¹ = F⁻¹ (1 − Qᵀ Q) F⁻ᵀ,     W = Zᵀ Z − Bᵀ B,   B = Q Z
//! ```
//!
//! Contacts, stops and motors thus see a machine that obeys its loops. Over the step the loops hold
//! for the mean velocity at the midpoint, `A(q_m) (θ v⁺ + (1−θ) v) = 0`, where their reactions do
//! no work for θ = ½. At its end the position is projected onto `φ(q) = 0` and the velocity onto
//! `A(q⁺) v = 0`, both along `M̂⁻¹ Aᵀ`. The second changes v by O(h²) and takes energy of O(h⁴),
//! which the energy audit gives back to free motion.
//!
//! Where the loops let nothing move a contact along one of its directions, that entry on W's
//! diagonal is the rounding of a difference. Such a row of H counts as zero: no impulse along it
//! changes any velocity, and the least that obeys the law is zero.
//!
//! Rows that follow from earlier ones, such as those across the plane of a planar linkage, are left
//! out: their part outside the span is below `DEPENDENT` of the loop's longest row. Their
//! reactions count as zero.
//!
//! Source: Gear et al. 1985, for constraints on both levels; Featherstone 2008, ch. 8, for loops
//! closed on a tree.
//!
//! Written over the scalar: one rover, those of a block, or dual numbers of one rover with a
//! direction a lane. A row that some lanes leave out is zero there, so that no lane depends on its
//! neighbours.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::ContactSystem;
use super::rows::{Triple, add_scaled, along};
use crate::multibody::error::StateError;
use crate::multibody::loops::{Placed, widest, write_loops};
use crate::multibody::model::Loop;
use crate::multibody::{
    Configuration, Factor, Inertias, Kinematics, LaneConfiguration, LoopGap, MassMatrix, Mechanism,
    Model, Poses,
};
use crate::scalar::{Lane, LaneMask, Single, inlined};

/// Gap of a closed loop at the end of a step above which the step has not converged, m or rad.
pub(crate) const MOST_OPEN: f64 = 1e-6;

/// Part of a row outside the span of earlier rows, relative to the longest of its loop, below which
/// it follows from them.
///
/// Loops that close to a micrometre make redundant rows differ by 1e-6 of their length.
const DEPENDENT: f64 = 1e-5;

/// Part of an entry on W's diagonal that the loops leave, relative to what it is without them,
/// below which it is rounding: of a difference `Z² − B²`, and of the square of a projected row.
///
/// A sum over a hundred velocities rounds to about 1e-14 of itself. A projected row rounds to 1e-15
/// of its length, and to 1e-11 where rows of the loops nearly depend on each other
/// ([`DEPENDENT`]). A contact that does move has more: a foot of a gram that is welded to a
/// machine of a hundred tonnes keeps 1e-8.
pub(crate) const ROUNDED: f64 = 1e-13;
pub(crate) const ROUNDED_SQUARE: f64 = 1e-20;

/// Gap below which a loop is closed, m or rad.
const TIGHT: f64 = 1e-13;

/// Most projections of the position in a step, and for a configuration from elsewhere.
const MOST_IN_STEP: usize = 8;
const MOST_ELSEWHERE: usize = 100;

/// Longest way of one projection of a configuration from elsewhere, rad or m in any coordinate.
const LONGEST: f64 = 0.3;

/// The rows of the loops at one configuration, and a basis of them in factor coordinates.
#[derive(Clone, Debug)]
struct Basis<T: Lane> {
    /// φ of all rows (m).
    gaps: Vec<T>,
    /// A (m, nv), row-major.
    rows: Vec<T>,
    /// Where each row does not follow from earlier ones (m).
    kept: Vec<T::Mask>,
    /// Orthonormal rows (m, nv), zero where a row is not kept.
    Q: Vec<T>,
    /// Lower triangle of R in `G = R Q` (m (m + 1) / 2), by rows; that of the unit matrix where a
    /// row is not kept.
    R: Vec<T>,
}

impl<T: Lane> Basis<T> {
    fn new(token: T::Token, mechanism: &Mechanism, loops: &[Loop]) -> Self {
        let m = loops.iter().map(Loop::n_rows).sum::<usize>();
        let zeros = |n: usize| vec![T::splat(token, 0.0); n];
        Self {
            gaps: zeros(m),
            rows: zeros(m * mechanism.nv()),
            kept: vec![T::mask(token, 0); m],
            Q: zeros(m * mechanism.nv()),
            R: zeros(m * (m + 1) / 2),
        }
    }

    /// Gaps, rows and their basis at a configuration, with the factor of M̂.
    #[inline(always)]
    fn update(&mut self, loops: &[Loop], placed: &Placed<'_, T>, factor: &Factor<T>) {
        write_loops(loops, placed, &mut self.gaps, &mut self.rows);
        let nv = placed.mechanism.nv();
        self.Q.copy_from_slice(&self.rows);
        let mut first = 0;
        for closure in loops {
            let end = first + closure.n_rows();
            // The rows of the loop first: their length is the measure of each.
            let mut longest = self.Q[0].like(0.0);
            for row in self.Q[first * nv..end * nv].chunks_exact_mut(nv) {
                factor.half_solve(placed.mechanism, row);
                longest = longest.max(norm(row));
            }
            for row in first..end {
                self.orthogonalise(row, nv, longest);
            }
            first = end;
        }
    }

    /// Makes a row of Q orthogonal to those before it and of unit length, or zero if nothing of it
    /// is left.
    #[inline(always)]
    fn orthogonalise(&mut self, row: usize, nv: usize, longest: T) {
        let (zero, one) = (longest.like(0.0), longest.like(1.0));
        let coefficients = &mut self.R[row * (row + 1) / 2..][..=row];
        coefficients.fill(zero);
        let (before, own) = self.Q.split_at_mut(row * nv);
        let own = &mut own[..nv];
        // Twice is enough.
        for _ in 0..2 {
            for (q, coefficient) in before.chunks_exact(nv).zip(&mut *coefficients) {
                let share = dot(q, own);
                add(own, q, -share);
                *coefficient += share;
            }
        }
        let length = norm(own);
        let kept = (longest.like(DEPENDENT) * longest).lt(length);
        self.kept[row] = kept;
        coefficients[row] = length;
        let length = T::select(kept, length, one);
        for x in own {
            *x = T::select(kept, *x / length, zero);
        }
        for (k, coefficient) in coefficients.iter_mut().enumerate() {
            let unit = if k == row { one } else { zero };
            *coefficient = T::select(kept, *coefficient, unit);
        }
    }

    /// Number of rows.
    #[inline(always)]
    fn m(&self) -> usize {
        self.kept.len()
    }

    /// `z = R⁻¹ z`, in place.
    #[inline(always)]
    fn solve(&self, z: &mut [T]) {
        let mut row = 0;
        for i in 0..z.len() {
            let (known, own) = z.split_at_mut(i);
            for (r, z) in self.R[row..row + i].iter().zip(known) {
                own[0] -= *r * *z;
            }
            own[0] /= self.R[row + i];
            row += i + 1;
        }
    }

    /// `z = R⁻ᵀ z`, in place.
    #[inline(always)]
    fn solve_transposed(&self, z: &mut [T]) {
        for i in (0..z.len()).rev() {
            let row = i * (i + 1) / 2;
            z[i] /= self.R[row + i];
            let value = z[i];
            for (j, x) in z[..i].iter_mut().enumerate() {
                *x -= self.R[row + j] * value;
            }
        }
    }

    /// `A v` of a row, zero where it is not kept.
    #[inline(always)]
    fn rate(&self, row: usize, v: &[T]) -> T {
        let rate = dot(&self.rows[row * v.len()..][..v.len()], v);
        T::select(self.kept[row], rate, rate.like(0.0))
    }

    /// A row of Q.
    #[inline(always)]
    fn q(&self, row: usize, nv: usize) -> &[T] {
        &self.Q[row * nv..][..nv]
    }

    /// `y += Qᵀ z`.
    #[inline(always)]
    fn add_transposed(&self, z: &[T], y: &mut [T]) {
        for (row, z) in z.iter().enumerate() {
            let nv = y.len();
            add(y, self.q(row, nv), *z);
        }
    }
}

#[inline(always)]
fn dot<T: Lane>(a: &[T], b: &[T]) -> T {
    let (Some((first, a)), Some((other, b))) = (a.split_first(), b.split_first()) else {
        unreachable!("invariant: a machine with loops has velocities")
    };
    let mut sum = *first * *other;
    let b = &b[..a.len()];
    for k in 0..a.len() {
        sum += a[k] * b[k];
    }
    sum
}

#[inline(always)]
fn norm<T: Lane>(a: &[T]) -> T {
    dot(a, a).sqrt()
}

/// `y += a x`.
#[inline(always)]
fn add<T: Lane>(y: &mut [T], x: &[T], a: T) {
    let x = &x[..y.len()];
    for k in 0..y.len() {
        y[k] += a * x[k];
    }
}

/// The loops of a machine in a step.
#[derive(Clone, Debug)]
pub struct Loops<T: Lane> {
    token: T::Token,
    closures: Vec<Loop>,
    /// At the midpoint of the step.
    middle: Basis<T>,
    /// At its end.
    end: Basis<T>,
    /// Poses at the end, and a configuration on the way to it.
    poses: Poses<T>,
    moved: LaneConfiguration<T>,
    /// Least number of Newton steps of a projection: one for a derivative, which changes with a
    /// position that is closed.
    least: usize,
    /// `B = Q Z` of the contacts (m, n), by the numbers that they have there.
    B: Vec<Triple<T>>,
    n: usize,
    /// Change of Q y by the last [`Self::close`] (m).
    change: Vec<T>,
    /// Impulses of all rows in the last step (m), N s or N m s.
    impulses: Vec<T>,
    /// Scratch (m) and (nv).
    z: Vec<T>,
    y: Vec<T>,
}

/// What the end of a step is projected with.
#[derive(Clone, Copy)]
pub(crate) struct Projector<'a, T: Lane> {
    pub mechanism: &'a Mechanism,
    pub inertias: &'a Inertias<T>,
    pub factor: &'a Factor<T>,
    /// Lanes whose configuration and velocity are projected.
    pub lanes: T::Mask,
}

impl<T: Lane> Loops<T> {
    /// None for a machine that has none. `least`: number of Newton steps of a projection.
    pub(crate) fn new(
        token: T::Token,
        mechanism: &Mechanism,
        loops: &[Loop],
        least: usize,
    ) -> Option<Box<Self>> {
        let middle = Basis::new(token, mechanism, loops);
        let zeros = |n: usize| vec![T::splat(token, 0.0); n];
        (!loops.is_empty()).then(|| {
            Box::new(Self {
                token,
                closures: loops.to_vec(),
                end: middle.clone(),
                poses: Poses::new(token, mechanism),
                moved: LaneConfiguration::new(token, mechanism),
                least,
                B: Vec::new(),
                n: 0,
                change: zeros(middle.m()),
                impulses: zeros(middle.m()),
                z: zeros(middle.m()),
                y: zeros(mechanism.nv()),
                middle,
            })
        })
    }

    /// The basis at the midpoint, once M̂ is factored, for `n` contacts.
    pub(crate) fn begin(&mut self, placed: &Placed<'_, T>, factor: &Factor<T>, n: usize) {
        inlined!(
            T::vectorize,
            self.token,
            self.middle.update(&self.closures, placed, factor)
        );
        self.set_size(n);
    }

    /// Makes room for the products of `n` contacts.
    fn set_size(&mut self, n: usize) {
        let none = [T::splat(self.token, 0.0); 3];
        self.n = n;
        self.B.resize(self.middle.m() * n, none);
    }

    /// Number of rows.
    #[inline(always)]
    pub(crate) fn m(&self) -> usize {
        self.middle.m()
    }

    /// A row of Q (nv).
    #[inline(always)]
    pub(crate) fn q(&self, row: usize) -> &[T] {
        self.middle.q(row, self.y.len())
    }

    /// The product `Q Z` of a row with a contact.
    #[inline(always)]
    pub(crate) fn product(&self, row: usize, contact: usize) -> &Triple<T> {
        &self.B[row * self.n + contact]
    }

    /// The product `Q Z` of a row with a contact, to be set.
    #[inline(always)]
    pub(crate) fn product_mut(&mut self, row: usize, contact: usize) -> &mut Triple<T> {
        &mut self.B[row * self.n + contact]
    }

    /// `W − Bᵀ B` of two contacts, whose block of W without loops is given.
    #[inline(always)]
    pub(crate) fn project_block(&self, [c, d]: [usize; 2], block: &mut [T; 9]) {
        for row in 0..self.m() {
            let (x, y) = (self.product(row, c), self.product(row, d));
            for i in 0..3 {
                for j in 0..3 {
                    block[3 * i + j] -= x[i] * y[j];
                }
            }
        }
    }

    /// Sets the products of a contact to zero in the lanes and along the directions of masks.
    #[inline(always)]
    pub(crate) fn hold(&mut self, contact: usize, held: [T::Mask; 3]) {
        let (zero, n) = (T::splat(self.token, 0.0), self.n);
        for b in self.B.iter_mut().skip(contact).step_by(n) {
            for k in 0..3 {
                b[k] = T::select(held[k], zero, b[k]);
            }
        }
    }

    /// `Z − Qᵀ B` in place of a contact's Z over all velocities (nv).
    #[inline(always)]
    pub(crate) fn project_rows(&self, contact: usize, rows: &mut [Triple<T>]) {
        for row in 0..self.m() {
            let b = self.product(row, contact);
            for (z, q) in rows.iter_mut().zip(self.q(row)) {
                add_scaled(z, b, -*q);
            }
        }
    }

    /// Along which directions the loops let nothing move a contact: `free` and `left` are its part
    /// of W's diagonal without them and with them, 1/kg.
    #[inline(always)]
    pub(crate) fn holds(free: &Triple<T>, left: &Triple<T>, rounded: f64) -> [T::Mask; 3] {
        [0, 1, 2].map(
            #[inline(always)]
            |k| {
                let zero = free[k].like(0.0);
                zero.lt(free[k]) & !(zero.like(rounded) * free[k]).lt(left[k])
            },
        )
    }

    /// `y −= Qᵀ B p` in the lanes of a mask: what the loops make of impulses, given by contact and
    /// the lanes in which there is one.
    #[inline(always)]
    pub(crate) fn answer(
        &self,
        impulses: &(impl Iterator<Item = (usize, T::Mask, Triple<T>)> + Clone),
        y: &mut [T],
    ) {
        for row in 0..self.m() {
            let z = self.reaction(row, impulses.clone());
            add(y, self.q(row), -z);
        }
    }

    /// `B p` of a row.
    #[inline(always)]
    fn reaction(
        &self,
        row: usize,
        impulses: impl Iterator<Item = (usize, T::Mask, Triple<T>)>,
    ) -> T {
        let zero = T::splat(self.token, 0.0);
        let mut sum = zero;
        for (contact, here, p) in impulses {
            let own = along(self.product(row, contact), &p);
            sum += T::select(here, own, zero);
        }
        sum
    }

    /// `y −= Qᵀ Q y`: what the loops leave of any change of the velocity.
    #[inline(always)]
    pub(crate) fn restrict(&self, y: &mut [T]) {
        for row in 0..self.m() {
            let q = self.q(row);
            let share = dot(q, y);
            add(y, q, -share);
        }
    }

    /// Changes y so that after the change of `v` by `F⁻¹ y` the mean with `v_begin` obeys the
    /// loops.
    #[inline(always)]
    pub(crate) fn close(&mut self, theta: f64, v_begin: &[T], v: &[T], y: &mut [T]) {
        let (basis, z) = (&self.middle, &mut self.change);
        for (row, z) in z.iter_mut().enumerate() {
            let rate = basis.rate(row, v);
            let share = rate.like((1.0 - theta) / theta);
            *z = -(rate + share * basis.rate(row, v_begin));
        }
        basis.solve(z);
        for (row, z) in z.iter_mut().enumerate() {
            *z -= dot(basis.q(row, y.len()), y);
        }
        basis.add_transposed(z, y);
    }

    /// The impulses λ of the last [`Self::close`] with those of the contacts, from
    /// `Rᵀ λ = Δ(Q y)`.
    #[inline(always)]
    pub(crate) fn find_impulses(
        &mut self,
        impulses: &(impl Iterator<Item = (usize, T::Mask, Triple<T>)> + Clone),
    ) {
        for row in 0..self.m() {
            self.impulses[row] = self.change[row] - self.reaction(row, impulses.clone());
        }
        self.middle.solve_transposed(&mut self.impulses);
    }

    /// `out += Aᵀ λ` (nv) with the [impulses](Self::find_impulses) of the last [`Self::close`] and
    /// those of the contacts.
    #[inline(always)]
    pub(crate) fn add_generalized_impulse(
        &mut self,
        impulses: &(impl Iterator<Item = (usize, T::Mask, Triple<T>)> + Clone),
        out: &mut [T],
    ) {
        self.find_impulses(impulses);
        let rows = self.middle.rows.chunks_exact(out.len());
        for (row, impulse) in rows.zip(&self.impulses) {
            add(out, row, *impulse);
        }
    }

    /// Newton's iteration on `φ(q) = 0` along `M̂⁻¹ Aᵀ`, and the basis at its end. Returns the
    /// widest gap that is left, m or rad.
    pub(crate) fn project_position(
        &mut self,
        with: &Projector<'_, T>,
        q: &mut LaneConfiguration<T>,
    ) -> T {
        self.project_in(with, MOST_IN_STEP, q)
    }

    /// Projects a configuration from elsewhere onto the loops, and the velocity onto their rates.
    /// Returns the widest gap that is left.
    pub(crate) fn project(
        &mut self,
        with: &Projector<'_, T>,
        q: &mut LaneConfiguration<T>,
        v: &mut [T],
    ) -> T {
        let gap = self.project_in(with, MOST_ELSEWHERE, q);
        self.project_velocity(with, v);
        gap
    }

    fn project_in(
        &mut self,
        with: &Projector<'_, T>,
        most: usize,
        q: &mut LaneConfiguration<T>,
    ) -> T {
        let token = self.token;
        let mut last = T::splat(token, f64::INFINITY);
        let mut left = T::splat(token, 0.0);
        let mut moving = with.lanes;
        for iteration in 0..=most {
            self.poses.update(with.mechanism, with.inertias, q);
            let gap = inlined!(T::vectorize, token, self.look(with, q));
            let is_stuck = (gap.like(0.5) * last).le(gap) & gap.lt(gap.like(MOST_OPEN));
            let is_closed = gap.le(gap.like(TIGHT)) | is_stuck;
            let may_stop = if iteration < self.least {
                T::mask(token, 0)
            } else {
                is_closed
            };
            let is_done = may_stop | !gap.is_finite();
            left = T::select(moving, gap, left);
            moving = moving & !is_done;
            if !moving.any() || iteration == most {
                break;
            }
            last = gap;
            inlined!(T::vectorize, token, self.approach(with, moving, q));
        }
        left
    }

    /// The basis at a configuration, and its widest gap.
    #[inline(always)]
    fn look(&mut self, with: &Projector<'_, T>, q: &LaneConfiguration<T>) -> T {
        let placed = Placed {
            mechanism: with.mechanism,
            poses: &self.poses,
            joints: &q.joints,
        };
        self.end.update(&self.closures, &placed, with.factor);
        widest(&self.closures, &self.end.gaps)
    }

    /// Moves a configuration along `M̂⁻¹ Aᵀ` by what closes the loops at the rates there.
    #[inline(always)]
    fn approach(&mut self, with: &Projector<'_, T>, moving: T::Mask, q: &mut LaneConfiguration<T>) {
        let zero = T::splat(self.token, 0.0);
        for (row, z) in self.z.iter_mut().enumerate() {
            *z = T::select(self.end.kept[row], -self.end.gaps[row], zero);
        }
        self.move_along(with);
        let mut farthest = zero;
        for y in &self.y {
            farthest = farthest.max(y.abs());
        }
        let share = (zero.like(LONGEST) / farthest).min(zero.like(1.0));
        for y in &mut self.y {
            *y *= share;
        }
        self.moved.set_moved(with.mechanism, q, &self.y, 1.0);
        self.moved.normalise();
        q.select_from(moving, &self.moved);
    }

    /// Removes from a velocity what would open the loops at the end of the step.
    #[inline(always)]
    pub(crate) fn project_velocity(&mut self, with: &Projector<'_, T>, v: &mut [T]) {
        for (row, z) in self.z.iter_mut().enumerate() {
            *z = -self.end.rate(row, v);
        }
        self.move_along(with);
        for (v, y) in v.iter_mut().zip(&self.y) {
            *v = T::select(with.lanes, *v + *y, *v);
        }
    }

    /// The change `self.y` of the velocity along `M̂⁻¹ Aᵀ` that changes the rates of the kept rows
    /// at the end by `self.z`.
    #[inline(always)]
    fn move_along(&mut self, with: &Projector<'_, T>) {
        self.end.solve(&mut self.z);
        self.y.fill(T::splat(self.token, 0.0));
        self.end.add_transposed(&self.z, &mut self.y);
        with.factor.half_solve_back(with.mechanism, &mut self.y);
    }

    /// Impulses of all rows in the last step (m): along x, y and z in N s, about them in N m s, and
    /// of a joint its own. They act on the first end, and their opposites on the second.
    pub(crate) fn impulses(&self) -> &[T] {
        &self.impulses
    }

    /// Impulses of all rows in the last step (m), N s or N m s, to be set.
    pub(crate) fn impulses_mut(&mut self) -> &mut [T] {
        &mut self.impulses
    }
}

impl Loops<f64> {
    /// None for a machine that has none.
    pub(crate) fn of(model: &Model) -> Option<Box<Self>> {
        Self::new(Single::best(), model.mechanism(), model.loops(), 0)
    }

    /// Computes B, and projects the rows of contacts; those that the loops hold are then zero.
    pub(crate) fn project_contacts(&mut self, model: &Model, system: &mut ContactSystem) {
        let n = system.n_contacts();
        self.set_size(n);
        system.begin_restriction(model);
        for c in 0..n {
            let rows = system.restricted_mut(c);
            for row in 0..self.m() {
                let mut b = [0.0; 3];
                for (z, q) in rows.iter().zip(self.q(row)) {
                    add_scaled(&mut b, z, *q);
                }
                *self.product_mut(row, c) = b;
            }
            let free = squares(rows);
            self.project_rows(c, rows);
            let held = Self::holds(&free, &squares(rows), ROUNDED_SQUARE);
            self.hold(c, held);
            system.hold(c, &free, held);
        }
    }
}

/// Squares of the lengths of a contact's rows, 1/kg.
fn squares(rows: &[Triple<f64>]) -> Triple<f64> {
    [0, 1, 2].map(|k| rows.iter().map(|z| z[k] * z[k]).sum())
}

/// What a single machine is projected with.
fn projector<'a>(model: &'a Model, factor: &'a Factor<f64>) -> Projector<'a, f64> {
    Projector {
        mechanism: model.mechanism(),
        inertias: model.inertias(),
        factor,
        lanes: true,
    }
}

/// The impulses p (3 n_c) in all lanes, by contact.
pub(crate) fn each<T: Lane>(
    token: T::Token,
    p: &[T],
) -> impl Iterator<Item = (usize, T::Mask, Triple<T>)> + Clone {
    let here = T::mask(token, u32::MAX >> (32 - T::LANES));
    let all = p.chunks_exact(3).map(|p| [p[0], p[1], p[2]]);
    all.enumerate().map(move |(contact, p)| (contact, here, p))
}

/// The factor of a machine's mass matrix M.
fn factor_of(model: &Model, kinematics: &Kinematics) -> Option<Factor<f64>> {
    let (token, mechanism): (_, &Mechanism) = (Single::best(), model.mechanism());
    let mut mass_matrix = MassMatrix::new(token, mechanism);
    mass_matrix.update(mechanism, model.inertias(), kinematics.poses());
    let mut factor = Factor::new(token, mechanism);
    mass_matrix
        .factorise(mechanism, &mut factor)
        .then_some(factor)
}

/// The poses of a single machine.
pub(crate) fn placed<'a>(
    model: &'a Model,
    kinematics: &'a Kinematics,
    joints: &'a [f64],
) -> Placed<'a, f64> {
    Placed {
        mechanism: model.mechanism(),
        poses: kinematics.poses(),
        joints,
    }
}

/// The loop that is open farthest in a configuration; none of a tree.
#[must_use]
pub fn widest_gap(model: &Model, q: &Configuration) -> Option<LoopGap> {
    let mut gaps = vec![0.0; model.n_loop_rows()];
    let kinematics = Kinematics::of(model, q);
    model.write_loops(&kinematics, &q.joints, &mut gaps, &mut []);
    model.widest_gap(&gaps)
}

/// Checks that a configuration closes all loops, to a micrometre or a microradian.
///
/// # Errors
/// `LoopOpen` names the loop that is open farthest.
pub fn check_closed(model: &Model, q: &Configuration) -> Result<(), StateError> {
    match widest_gap(model, q) {
        Some(gap) if gap.value.is_nan() || gap.value > MOST_OPEN => Err(StateError::LoopOpen {
            name: model.loops()[gap.index].name.clone(),
            gap: gap.value,
            unit: gap.unit,
        }),
        _ => Ok(()),
    }
}

/// A configuration that closes all loops, reached from `q` along `M⁻¹ Aᵀ`: heavy parts move less
/// than light ones. Also projects a velocity (nv).
///
/// # Errors
/// `LoopStaysOpen` if there is none nearby.
pub fn closed(
    model: &Model,
    q: &Configuration,
    v: &mut [f64],
) -> Result<Configuration, StateError> {
    let mut q = q.clone();
    let Some(mut loops) = Loops::of(model) else {
        return Ok(q);
    };
    let kinematics = Kinematics::of(model, &q);
    if let Some(factor) = factor_of(model, &kinematics) {
        let mut lane = LaneConfiguration::new(Single::best(), model.mechanism());
        lane.set_lane(0, &q);
        loops.project(&projector(model, &factor), &mut lane, v);
        lane.to_lane(0, &mut q);
    }
    match widest_gap(model, &q) {
        Some(gap) if gap.value.is_nan() || gap.value > MOST_OPEN => {
            Err(StateError::LoopStaysOpen {
                name: model.loops()[gap.index].name.clone(),
                gap: gap.value,
                unit: gap.unit,
            })
        }
        _ => Ok(q),
    }
}

/// Number of rows of each loop that follow from other rows in a configuration.
#[must_use]
pub fn redundant_rows(model: &Model, q: &Configuration) -> Vec<usize> {
    let kinematics = Kinematics::of(model, q);
    let mut basis = Basis::new(Single::best(), model.mechanism(), model.loops());
    if let Some(factor) = factor_of(model, &kinematics) {
        let placed = placed(model, &kinematics, &q.joints);
        basis.update(model.loops(), &placed, &factor);
    }
    let mut first = 0;
    let redundant = model.loops().iter().map(|closure| {
        let rows = first..first + closure.n_rows();
        first = rows.end;
        rows.filter(|row| !basis.kept[*row]).count()
    });
    redundant.collect()
}
