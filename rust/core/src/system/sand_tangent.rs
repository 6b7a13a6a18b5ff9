//! The force of sand on a wheel along its tangent, over lanes.
//!
//! ```text
//! F(x) = F* − C (x − x*)
//! ```
//!
//! x is the twist of the wheel.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use nalgebra::{Matrix6, Vector6};

use super::sand_wheel::LanePose;
use super::six::{self, SIX, Six, Square, dot, minus, plus, scaled, times};
use crate::contact::placed_wheel::PlacedWheel;
use crate::multibody::{MassMatrix, Mechanism, Poses};
use crate::scalar::{Lane, LaneMask, Vec3};

/// Twist, m/s, below which two points are the same: a secant between them would be noise.
const TINY: f64 = 1e-6;

/// Pivot, relative to the largest, below which it is dropped.
const DROPPED: f64 = 1e-9;

/// The force at a twist and its derivative by the twist.
#[derive(Clone, Copy)]
pub(super) struct Evaluated {
    pub(super) at: Vector6<f64>,
    pub(super) force: Vector6<f64>,
    pub(super) slope: Matrix6<f64>,
    pub(super) is_touching: bool,
}

/// [`Evaluated`] over lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneEvaluated<T: Lane> {
    pub(super) at: Six<T>,
    force: Six<T>,
    slope: Square<T>,
    is_touching: T::Mask,
}

impl<T: Lane> LaneEvaluated<T> {
    /// Nothing.
    #[inline(always)]
    pub(super) fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            at: [zero; SIX],
            force: [zero; SIX],
            slope: [[zero; SIX]; SIX],
            is_touching: T::mask(token, 0),
        }
    }

    /// Enters what was found for a lane.
    #[inline(always)]
    pub(super) fn enter(&mut self, lane: usize, found: &Evaluated) {
        six::set(&mut self.at, lane, &found.at);
        six::set(&mut self.force, lane, &found.force);
        for (own, column) in self.slope.iter_mut().zip(found.slope.column_iter()) {
            six::set(own, lane, &column.into_owned());
        }
        let own = T::mask(self.at[0].token(), 1 << lane);
        self.is_touching = self.is_touching & !own;
        if found.is_touching {
            self.is_touching = self.is_touching | own;
        }
    }
}

/// A wheel's force along its tangent.
#[derive(Clone, Copy, Debug)]
pub(super) struct TangentForce<T: Lane> {
    /// Twist at which the force was evaluated.
    pub(super) at: Six<T>,
    pub(super) force: Six<T>,
    /// C, symmetric.
    pub(super) tangent: Square<T>,
    /// Twist and force of the last linearisation in this step, where there is one.
    last: [Six<T>; 2],
    has_last: T::Mask,
    pub(super) is_touching: T::Mask,
}

impl<T: Lane> TangentForce<T> {
    /// None.
    pub(super) fn new(token: T::Token) -> Self {
        let zero = [T::splat(token, 0.0); SIX];
        Self {
            at: zero,
            force: zero,
            tangent: [zero; SIX],
            last: [zero; 2],
            has_last: T::mask(token, 0),
            is_touching: T::mask(token, 0),
        }
    }

    /// No force on a lane.
    pub(super) fn clear(&mut self, lane: usize) {
        let own = T::mask(self.at[0].token(), 1 << lane);
        self.is_touching = self.is_touching & !own;
        self.has_last = self.has_last & !own;
        for column in [&mut self.at, &mut self.force]
            .into_iter()
            .chain(&mut self.tangent)
        {
            six::set(column, lane, &Vector6::zeros());
        }
    }

    /// A force that does not depend on the twist; none where the sand is not touched.
    pub(super) fn give(&mut self, lane: usize, wrench: Option<&Vector6<f64>>) {
        self.clear(lane);
        if let Some(wrench) = wrench {
            six::set(&mut self.force, lane, wrench);
            self.is_touching = self.is_touching | T::mask(self.at[0].token(), 1 << lane);
        }
    }

    /// Nothing was linearised in this step yet.
    pub(super) fn begin(&mut self) {
        self.has_last = self.has_last & !self.has_last;
    }

    /// Takes a force with its tangent in some lanes. The tangent is at least the secant from the
    /// last point: where the sand yields its own tangent is nearly zero, and a step that reverses
    /// would leave the point where it stops far behind. `arms`: the wheel's radius and that of its
    /// drum, m.
    #[inline(always)]
    pub(super) fn take(&mut self, lanes: T::Mask, found: &LaneEvaluated<T>, arms: [f64; 2]) {
        let mut tangent = dissipative(&found.slope, arms[0]);
        let known = lanes & found.is_touching & self.has_last;
        if known.any() {
            self.add_secant(known, found, arms[1], &mut tangent);
        }
        self.at = six::select(lanes, &found.at, &self.at);
        self.force = six::select(lanes, &found.force, &self.force);
        for (own, column) in self.tangent.iter_mut().zip(&tangent) {
            *own = six::select(lanes, column, own);
        }
        self.is_touching = (self.is_touching & !lanes) | (found.is_touching & lanes);
        let is_known = lanes & found.is_touching;
        self.last[0] = six::select(is_known, &found.at, &self.last[0]);
        self.last[1] = six::select(is_known, &found.force, &self.last[1]);
        self.has_last = self.has_last | is_known;
    }

    #[inline(always)]
    fn add_secant(
        &self,
        lanes: T::Mask,
        found: &LaneEvaluated<T>,
        arm: f64,
        tangent: &mut Square<T>,
    ) {
        let zero = found.at[0].like(0.0);
        let step = minus(&found.at, &self.last[0]);
        let way = scaled(&step, arm);
        let square = dot(&way, &way);
        let is_moved = lanes & square.gt(zero.like(TINY * TINY));
        let change = scaled(&minus(&found.force, &self.last[1]), 1.0 / arm);
        let secant = -(dot(&change, &way) / square);
        let own = dot(&step, &times(tangent, &step)) / square;
        let more = (secant - own).max(zero) / square;
        // LLVM 22.1 vectorises `w wᵀ more` beside the square of w with w₁² in the place of w₀ w₁
        // (docs/decisions/0019-same-bits.md).
        let root = T::select(is_moved, more.sqrt(), zero);
        let stiff = scaled(&way, arm).map(|x| x * root);
        for (column, x) in tangent.iter_mut().zip(stiff) {
            let sum = plus(column, x, &stiff);
            *column = six::select(is_moved, &sum, column);
        }
    }

    /// Takes the force as it is, without its tangent.
    pub(super) fn drop_tangent(&mut self) {
        let zero = self.at[0].like(0.0);
        self.tangent = [[zero; SIX]; SIX];
    }

    /// The force at a twist.
    #[inline(always)]
    pub(super) fn applied(&self, twist: &Six<T>) -> Six<T> {
        let way = minus(twist, &self.at);
        minus(&self.force, &times(&self.tangent, &way))
    }
}

/// The symmetric part of minus a matrix without its negative pivots: `Σ d_k l_k l_kᵀ` over the
/// positive pivots d_k of its factor `L D Lᵀ`, with entries of l_k that leave no diagonal negative.
/// Angles are scaled to lengths by `arm`, m.
#[inline(always)]
fn dissipative<T: Lane>(slope: &Square<T>, arm: f64) -> Square<T> {
    let zero = slope[0][0].like(0.0);
    let one = zero.like(1.0);
    let scale = [1.0, 1.0, 1.0, arm, arm, arm];
    // Lower triangles by rows.
    let (mut rest, mut sum) = ([[zero; SIX]; SIX], [[zero; SIX]; SIX]);
    let mut largest = zero;
    for i in 0..SIX {
        for j in 0..=i {
            let half = zero.like(-0.5 / (scale[i] * scale[j]));
            rest[i][j] = (slope[j][i] + slope[i][j]) * half;
        }
        largest = largest.max(rest[i][i]);
    }
    let least = largest * zero.like(DROPPED);
    for k in 0..SIX {
        let counts = rest[k][k].gt(least);
        let pivot = T::select(counts, rest[k][k], zero);
        let per_pivot = T::select(counts, one / rest[k][k], zero);
        // Of a positive matrix no entry is larger; of another one, a small pivot would give an
        // arbitrarily large part.
        let mut column = [zero; SIX];
        column[k] = one;
        for i in k + 1..SIX {
            let most = (pivot * rest[i][i].max(zero)).sqrt();
            column[i] = rest[i][k].min(most).max(-most) * per_pivot;
        }
        for i in k..SIX {
            let part = column[i] * pivot;
            for j in k..=i {
                let product = part * column[j];
                sum[i][j] += product;
                rest[i][j] -= product;
            }
        }
    }
    for i in 0..SIX {
        for j in 0..=i {
            sum[i][j] *= zero.like(scale[i] * scale[j]);
            sum[j][i] = sum[i][j];
        }
    }
    sum
}

/// How the twist of a wheel follows from the velocities that move it, outwards: those of a free
/// base, if there is one, and then of joints.
#[derive(Clone, Debug)]
pub(super) struct TwistMap<T: Lane> {
    /// The velocities.
    pub(super) path: Vec<usize>,
    /// The tree of the wheel, and the motions of the joints that move it.
    tree: usize,
    motions: Vec<usize>,
    /// Number of those of the base: 6 or 0.
    lead: usize,
    /// From the origin of the tree to the wheel's centre, m.
    pub(super) arm: Vec3<T>,
    /// Twists per unit of the joints' velocities.
    pub(super) columns: Vec<Six<T>>,
    /// Products of the tangent with the columns, and the same as wrenches on the base.
    stiff: Vec<Six<T>>,
    on_base: Vec<Six<T>>,
}

impl<T: Lane> TwistMap<T> {
    /// Map for a wheel on a body; arm and columns are zero until [`Self::place`].
    pub(super) fn new(token: T::Token, mechanism: &Mechanism, body: usize) -> Self {
        let zero = T::splat(token, 0.0);
        let path = mechanism.path(body).to_vec();
        let movers = mechanism.movers(body);
        let lead = path.len() - movers.len();
        Self {
            lead,
            tree: mechanism.tree_of_body(body),
            motions: movers.iter().map(|mover| mover.motion).collect(),
            arm: Vec3::new(zero, zero, zero),
            columns: vec![[zero; SIX]; path.len() - lead],
            stiff: vec![[zero; SIX]; path.len()],
            on_base: vec![[zero; SIX]; path.len()],
            path,
        }
    }

    /// Takes over the poses of the bodies, and returns that of the wheel.
    #[inline(always)]
    pub(super) fn place(&mut self, wheel: &PlacedWheel, poses: &Poses<T>) -> LanePose<T> {
        let pose = &poses.bodies[wheel.body];
        let arm = pose.r + pose.R.times_shared(wheel.centre);
        self.arm = arm;
        for (column, &motion) in self.columns.iter_mut().zip(&self.motions) {
            let motion = &poses.motions[motion];
            *column = six::join(motion.velocity_at(arm), motion.axis);
        }
        LanePose {
            centre: poses.origin_of(self.tree) + arm,
            axle: pose.R.times_shared(wheel.axle),
        }
    }

    /// The twist at velocities (nv).
    #[inline(always)]
    pub(super) fn twist(&self, v: &[T]) -> Six<T> {
        let zero = self.arm.x.like(0.0);
        let mut twist = [zero; SIX];
        if self.lead > 0 {
            let base = &v[self.path[0]..][..SIX];
            let spin = Vec3::new(base[3], base[4], base[5]);
            let speed = Vec3::new(base[0], base[1], base[2]) + spin.cross(self.arm);
            twist = six::join(speed, spin);
        }
        for (&k, column) in self.path[self.lead..].iter().zip(&self.columns) {
            twist = plus(&twist, v[k], column);
        }
        twist
    }

    /// Adds the generalized impulse of a wrench over a time, s.
    #[inline(always)]
    pub(super) fn add_impulse(&self, wrench: &Six<T>, time: f64, y: &mut [T]) {
        let time = self.arm.x.like(time);
        if self.lead > 0 {
            let base = &mut y[self.path[0]..][..SIX];
            for (y, x) in base.iter_mut().zip(self.on_base(wrench)) {
                *y += time * x;
            }
        }
        for (&k, column) in self.path[self.lead..].iter().zip(&self.columns) {
            y[k] += time * dot(column, wrench);
        }
    }

    /// A wrench on the wheel as one on the base.
    #[inline(always)]
    fn on_base(&self, wrench: &Six<T>) -> Six<T> {
        let force = six::linear(wrench);
        six::join(force, self.arm.cross(force) + six::angular(wrench))
    }

    /// The columns of all velocities.
    pub(super) fn write_columns(&self, rows: &mut [Six<T>]) {
        let (zero, one) = (self.arm.x.like(0.0), self.arm.x.like(1.0));
        let (base, joints) = rows.split_at_mut(self.lead);
        let x = [self.arm.x, self.arm.y, self.arm.z];
        for (k, row) in base.iter_mut().enumerate() {
            *row = [zero; SIX];
            row[k] = one;
            if k >= 3 {
                // e × x
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                row[i] = -x[j];
                row[j] = x[i];
            }
        }
        joints.copy_from_slice(&self.columns);
    }

    /// `M += h Jᵀ C J`.
    ///
    /// The columns of a free base are those of a rigid body, `(e, 0)` and `(e × x, e)`, so products
    /// with them are sums of a few terms.
    #[inline(always)]
    pub(super) fn add_to_mass(
        &mut self,
        tangent: &Square<T>,
        h: f64,
        mechanism: &Mechanism,
        mass: &mut MassMatrix<T>,
    ) {
        let h = self.arm.x.like(h);
        let C = tangent.map(|column| column.map(|x| x * h));
        let (lead, x) = (self.lead, [self.arm.x, self.arm.y, self.arm.z]);
        for k in 0..lead {
            self.stiff[k] = C[k];
            if k >= 3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                self.stiff[k] = plus(&plus(&C[k], -x[j], &C[i]), x[i], &C[j]);
            }
        }
        for (k, column) in (lead..).zip(&self.columns) {
            self.stiff[k] = times(&C, column);
        }
        if lead > 0 {
            for k in 0..self.stiff.len() {
                self.on_base[k] = self.on_base(&self.stiff[k]);
            }
        }
        mass.add_quadratic(
            mechanism,
            &self.path,
            #[inline(always)]
            |i, j| {
                if j < lead {
                    self.on_base[i][j]
                } else {
                    dot(&self.columns[j - lead], &self.stiff[i])
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns_of(matrix: &Matrix6<f64>) -> Square<f64> {
        std::array::from_fn(|j| std::array::from_fn(|i| matrix[(i, j)]))
    }

    fn kept_of(matrix: &Matrix6<f64>) -> Matrix6<f64> {
        six::matrix_of(&dissipative(&columns_of(&-matrix), 0.1), 0)
    }

    #[test]
    fn a_dissipative_matrix_is_kept_and_a_negative_one_dropped() {
        let a = Matrix6::from_fn(|i, j| ((i * 7 + j * 3) % 5) as f64 * 0.2);
        let positive = a * a.transpose() + Matrix6::identity();
        assert!((kept_of(&positive) - positive).norm() < 1e-9);
        assert_eq!(kept_of(&-positive), Matrix6::zeros());
    }

    /// A wheel that hardly touches had a tangent of 5e19 N s/m, and the mass matrix no factor.
    #[test]
    fn a_matrix_that_is_not_positive_gives_no_part_beyond_its_diagonal() {
        let mut saddle = Matrix6::from_diagonal_element(1e-22);
        (saddle[(0, 1)], saddle[(1, 0)]) = (0.1, 0.1);
        saddle[(2, 2)] = 1e-23;
        let found = kept_of(&saddle);
        assert!(
            (0..6).all(|k| found[(k, k)] <= 2.0 * saddle[(k, k)]),
            "{found}"
        );
    }
}
