//! Rows of the contact Jacobian H, and products with them, over lanes.
//!
//! A row is nonzero for the velocities that move the contact: along a [`VelocityPath`]. With
//! `M̂ = Lᵀ D L` and `Z = D^(-1/2) L^(-T) H`, a column of Z is nonzero along the same path, and the
//! Delassus operator is `W = Hᵀ M̂⁻¹ H = Zᵀ Z`. A block of W is a product over the velocities that
//! two contacts share; no dense product is formed.
//!
//! Rows are stored by velocity: three numbers, along n, t and b. [`super::delassus`] keeps them of
//! one contact after another, [`super::slots`] of one slot after another.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::multibody::Motion;
use crate::multibody::mechanism::{BASE, Mechanism, PathVelocity};
use crate::scalar::{Lane, Vec3};
pub(crate) use crate::solver::batch::problem::Triple;

/// Rate, m/rad, up to which a joint does not move the ends of a rigid wheel's tread along the
/// normal.
///
/// A steering axis that is normal to the ground but for rounding tells the two ends of a tread
/// apart by as little, and the solver would search for the end that bears the load. On a plane any
/// value from 1e-9 to 1e-5 serves; among rocks the axes are tilted, and 1e-7, 1e-6, 1e-5 and 1e-4
/// leave 34, 28, 16 and 16 systems a step of 56. A tilt of 1e-4 rad lifts an end by 1e-5 m while
/// its wheel steers by a radian.
const LEVEL: f64 = 1e-5;

/// A joint's entry of the normal row of an end of a rigid wheel's tread: 0 up to [`LEVEL`].
#[inline(always)]
pub(crate) fn levelled<T: Lane>(entry: T) -> T {
    let zero = entry.like(0.0);
    T::select(entry.abs().le(entry.like(LEVEL)), zero, entry)
}

/// A contact point relative to the origin of a tree, m, and the contact's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<T> {
    pub x: Vec3<T>,
    pub n: Vec3<T>,
    pub t: Vec3<T>,
    pub b: Vec3<T>,
}

impl<T: Lane> Place<T> {
    /// Rows of Hᵀ for a free base: the velocity of the point along n, t, b per unit of each of its
    /// velocities.
    #[inline(always)]
    fn rows_of_base(&self) -> [Triple<T>; BASE] {
        let Self { x, n, t, b } = *self;
        let (xn, xt, xb) = (x.cross(n), x.cross(t), x.cross(b));
        [
            [n.x, t.x, b.x],
            [n.y, t.y, b.y],
            [n.z, t.z, b.z],
            [xn.x, xt.x, xb.x],
            [xn.y, xt.y, xb.y],
            [xn.z, xt.z, xb.z],
        ]
    }

    /// The row of a joint velocity.
    #[inline(always)]
    fn row_of(&self, motion: &Motion<T>) -> Triple<T> {
        let moved = motion.velocity_at(self.x);
        [moved.dot(self.n), moved.dot(self.t), moved.dot(self.b)]
    }

    /// The force of an impulse `p`, and its moment about the tree's origin.
    #[inline(always)]
    pub(crate) fn wrench(&self, [p_n, p_t, p_b]: Triple<T>) -> [Vec3<T>; 2] {
        let force = self.n * p_n + self.t * p_t + self.b * p_b;
        [force, self.x.cross(force)]
    }
}

/// The velocities that move a contact: of a free base, which are consecutive, then of joints,
/// outwards.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VelocityPath<'a> {
    /// First velocity of the base.
    pub base: Option<usize>,
    pub movers: &'a [PathVelocity],
}

impl<'a> VelocityPath<'a> {
    /// Path of a contact on a body.
    #[inline(always)]
    pub(crate) fn of(mechanism: &'a Mechanism, body: usize) -> Self {
        Self {
            base: mechanism.base_of(body),
            movers: mechanism.movers(body),
        }
    }

    /// The velocities.
    #[inline(always)]
    pub(crate) fn velocities(&self) -> impl Iterator<Item = usize> + use<'a> {
        let first = self.base.unwrap_or(0);
        let joints = self.movers.iter().map(|mover| mover.velocity);
        (first..first + self.lead()).chain(joints)
    }

    /// Number of velocities.
    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.lead() + self.movers.len()
    }

    /// Number of velocities of the base.
    #[inline(always)]
    pub(crate) fn lead(&self) -> usize {
        if self.base.is_some() { BASE } else { 0 }
    }

    /// Calls `act` with each velocity and its entries of the rows of Hᵀ. `motion`: of each joint
    /// velocity, by its index.
    #[inline(always)]
    pub(crate) fn for_each_row<T: Lane>(
        &self,
        motion: impl Fn(usize) -> Motion<T>,
        place: &Place<T>,
        mut act: impl FnMut(usize, Triple<T>),
    ) {
        if let Some(first) = self.base {
            for (k, row) in (first..).zip(place.rows_of_base()) {
                act(k, row);
            }
        }
        for mover in self.movers {
            act(mover.velocity, place.row_of(&motion(mover.motion)));
        }
    }

    /// Writes the rows of Hᵀ, and returns `Hᵀ v`.
    #[inline(always)]
    pub(crate) fn write<T: Lane>(
        &self,
        motion: impl Fn(usize) -> Motion<T>,
        place: &Place<T>,
        v: &[T],
        rows: &mut [Triple<T>],
    ) -> Triple<T> {
        let mut u = [place.x.x.like(0.0); 3];
        let (base, joints) = rows.split_at_mut(self.lead());
        if let (Some(first), Some(base)) = (self.base, base.first_chunk_mut::<BASE>()) {
            *base = place.rows_of_base();
            let v = &v[first..][..BASE];
            for k in 0..BASE {
                add_scaled(&mut u, &base[k], v[k]);
            }
        }
        for (row, mover) in joints.iter_mut().zip(self.movers) {
            *row = place.row_of(&motion(mover.motion));
            add_scaled(&mut u, row, v[mover.velocity]);
        }
        u
    }

    /// Levels the joints' entries of the normal row of Hᵀ, and of `u = Hᵀ v`: see [`levelled`].
    #[inline(always)]
    pub(crate) fn level<T: Lane>(&self, v: &[T], rows: &mut [Triple<T>], u: &mut Triple<T>) {
        for (row, mover) in rows[self.lead()..].iter_mut().zip(self.movers) {
            let entry = levelled(row[0]);
            u[0] -= (row[0] - entry) * v[mover.velocity];
            row[0] = entry;
        }
    }

    /// Writes the rows of Hᵀ for a stop or the dry friction of the path's last joint, and returns
    /// `Hᵀ v`. The only entry that is not zero is `sign`, at the joint's velocity along n, t or b
    /// (`which`: 0, 1 or 2).
    #[inline(always)]
    pub(crate) fn write_joint<T: Lane>(
        &self,
        which: usize,
        sign: T,
        v: &[T],
        rows: &mut [Triple<T>],
    ) -> Triple<T> {
        let zero = sign.like(0.0);
        rows.fill([zero; 3]);
        let (Some(row), Some(mover)) = (rows.last_mut(), self.movers.last()) else {
            unreachable!("invariant: a joint with stops moves its body")
        };
        row[which] = sign;
        let mut u = [zero; 3];
        u[which] = sign * v[mover.velocity];
        u
    }

    /// `sum + Zᵀ y`, or with rows of Hᵀ in place of Z.
    #[inline(always)]
    pub(crate) fn add_local<T: Lane>(
        &self,
        rows: &[Triple<T>],
        y: &[T],
        mut sum: Triple<T>,
    ) -> Triple<T> {
        let (base, joints) = rows.split_at(self.lead());
        if let (Some(first), Some(base)) = (self.base, base.first_chunk::<BASE>()) {
            let y = &y[first..][..BASE];
            for k in 0..BASE {
                add_scaled(&mut sum, &base[k], y[k]);
            }
        }
        let joints = &joints[..self.movers.len()];
        for k in 0..self.movers.len() {
            add_scaled(&mut sum, &joints[k], y[self.movers[k].velocity]);
        }
        sum
    }

    /// `y += Z p` where the mask is true.
    #[inline(always)]
    pub(crate) fn push<T: Lane>(
        &self,
        here: T::Mask,
        rows: &[Triple<T>],
        p: &Triple<T>,
        y: &mut [T],
    ) {
        let (base, joints) = rows.split_at(self.lead());
        if let (Some(first), Some(base)) = (self.base, base.first_chunk::<BASE>()) {
            let y = &mut y[first..][..BASE];
            for k in 0..BASE {
                add(here, &mut y[k], along(&base[k], p));
            }
        }
        let joints = &joints[..self.movers.len()];
        for k in 0..self.movers.len() {
            add(here, &mut y[self.movers[k].velocity], along(&joints[k], p));
        }
    }
}

/// `x += y` where the mask is true.
#[inline(always)]
pub(crate) fn add<T: Lane>(here: T::Mask, x: &mut T, y: T) {
    *x = T::select(here, *x + y, *x);
}

/// `a · b`.
#[inline(always)]
pub(crate) fn along<T: Lane>(a: &Triple<T>, b: &Triple<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `sums += a x`.
#[inline(always)]
pub(crate) fn add_scaled<T: Lane>(sums: &mut Triple<T>, x: &Triple<T>, a: T) {
    for i in 0..3 {
        sums[i] += a * x[i];
    }
}

/// `Xᵀ Y`, a block of W, row-major; `zero` where there are no rows.
#[inline(always)]
pub(crate) fn product<T: Lane>(zero: T, x: &[Triple<T>], y: &[Triple<T>]) -> [T; 9] {
    let (Some(([a, b, c], x)), Some((first, y))) = (x.split_first(), y.split_first()) else {
        return [zero; 9];
    };
    let [d, e, f] = *first;
    let mut sums = [
        *a * d,
        *a * e,
        *a * f,
        *b * d,
        *b * e,
        *b * f,
        *c * d,
        *c * e,
        *c * f,
    ];
    let y = &y[..x.len()];
    for k in 0..x.len() {
        add_product(&mut sums, &x[k], &y[k]);
    }
    sums
}

/// `block += x yᵀ`.
#[inline(always)]
pub(crate) fn add_product<T: Lane>(block: &mut [T; 9], x: &Triple<T>, y: &Triple<T>) {
    for i in 0..3 {
        for j in 0..3 {
            block[3 * i + j] += x[i] * y[j];
        }
    }
}

/// `Xᵀ X`, a diagonal block of W, row-major.
#[inline(always)]
pub(crate) fn square<T: Lane>(zero: T, x: &[Triple<T>]) -> [T; 9] {
    let Some(([a, b, c], x)) = x.split_first() else {
        return [zero; 9];
    };
    let mut sums = [*a * *a, *b * *a, *b * *b, *c * *a, *c * *b, *c * *c];
    for [a, b, c] in x {
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

/// Sets the tangential diagonal of a stop's own block, whose tangential rows are zero, to that of
/// the normal.
#[inline(always)]
pub(crate) fn close_stop<T: Lane>(own: &mut [T; 9]) {
    (own[4], own[8]) = (own[0], own[0]);
}
