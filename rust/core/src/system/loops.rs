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
//! The sources run over any scalar whose lanes hold the numbers of one machine: plain numbers, or
//! dual ones with a direction a lane ([`super::tangent`]). What is decided, such as the rows that
//! are left out, is decided by the first lane.
//!
//! Rows that follow from earlier ones, such as those across the plane of a planar linkage, are left
//! out: their part outside the span is below `DEPENDENT` of the loop's longest row. Their
//! reactions count as zero.
//!
//! Source: Gear et al. 1985, for constraints on both levels; Featherstone 2008, ch. 8, for loops
//! closed on a tree.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::contact::ContactSystem;
use crate::integrator::report::MOST_OPEN;
use crate::multibody::error::StateError;
use crate::multibody::{
    Configuration, Factor, Inertias, Kinematics, LaneConfiguration, LoopGap, MassMatrix, Mechanism,
    Model, Poses,
};
use crate::scalar::{Lane, Single};

/// Part of a row outside the span of earlier rows, relative to the longest of its loop, below which
/// it follows from them.
///
/// Loops that close to a micrometre make redundant rows differ by 1e-6 of their length.
const DEPENDENT: f64 = 1e-5;

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
    token: T::Token,
    /// φ of all rows (m).
    gaps: Vec<T>,
    /// A (m, nv), row-major.
    rows: Vec<T>,
    /// The rows of A that do not follow from earlier ones (r).
    kept: Vec<usize>,
    /// Orthonormal rows (r, nv).
    Q: Vec<T>,
    /// Lower triangle of R in `G = R Q` of the kept rows (r (r + 1) / 2), by rows.
    R: Vec<T>,
}

impl<T: Lane> Basis<T> {
    fn new(token: T::Token, model: &Model) -> Self {
        let (m, nv) = (model.n_loop_rows(), model.nv());
        let zero = T::splat(token, 0.0);
        Self {
            token,
            gaps: vec![zero; m],
            rows: vec![zero; m * nv],
            kept: Vec::with_capacity(m),
            Q: Vec::with_capacity(m * nv),
            R: Vec::with_capacity(m * (m + 1) / 2),
        }
    }

    /// Gaps, rows and their basis at a configuration, with the factor of M̂.
    fn update(&mut self, model: &Model, poses: &Poses<T>, joints: &[T], factor: &Factor<T>) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.update_here(model, poses, joints, factor),
        );
    }

    #[inline(always)]
    fn update_here(&mut self, model: &Model, poses: &Poses<T>, joints: &[T], factor: &Factor<T>) {
        model.write_loops(poses, joints, &mut self.gaps, &mut self.rows);
        let nv = model.nv();
        self.kept.clear();
        self.Q.clear();
        self.R.clear();
        let mut first = 0;
        for closure in model.loops() {
            let rows = first..first + closure.n_rows();
            let begin = self.Q.len();
            // The rows of the loop first: their length is the measure of each.
            self.Q
                .extend_from_slice(&self.rows[rows.start * nv..rows.end * nv]);
            let mut longest = 0.0_f64;
            for row in self.Q[begin..].chunks_exact_mut(nv) {
                factor.half_solve(model.mechanism(), row);
                longest = longest.max(norm(row).get(0));
            }
            for (i, row) in rows.clone().enumerate() {
                let from = begin + i * nv;
                let to = self.kept.len() * nv;
                self.Q.copy_within(from..from + nv, to);
                if self.orthogonalise(nv, longest) {
                    self.kept.push(row);
                }
            }
            self.Q.truncate(self.kept.len() * nv);
            first = rows.end;
        }
    }

    /// Makes the next row of Q orthogonal to those before it and of unit length; false if nothing
    /// of it is left.
    #[inline(always)]
    fn orthogonalise(&mut self, nv: usize, longest: f64) -> bool {
        let r = self.kept.len();
        let begin = self.R.len();
        self.R.resize(begin + r + 1, T::splat(self.token, 0.0));
        let (before, own) = self.Q.split_at_mut(r * nv);
        let own = &mut own[..nv];
        // Twice is enough.
        for _ in 0..2 {
            for (q, coefficient) in before.chunks_exact(nv).zip(&mut self.R[begin..]) {
                let share = dot(q, own);
                add(own, q, -share);
                *coefficient += share;
            }
        }
        let length = norm(own);
        let size = length.get(0);
        if size.is_nan() || size <= DEPENDENT * longest {
            self.R.truncate(begin);
            return false;
        }
        for x in own {
            *x /= length;
        }
        self.R[begin + r] = length;
        true
    }

    /// `z = R⁻¹ z`, in place.
    #[inline(always)]
    fn solve(&self, z: &mut [T]) {
        let mut row = 0;
        for i in 0..z.len() {
            if i > 0 {
                let known = dot(&self.R[row..row + i], &z[..i]);
                z[i] -= known;
            }
            z[i] /= self.R[row + i];
            row += i + 1;
        }
    }

    /// `z = R⁻ᵀ z`, in place.
    #[inline(always)]
    fn solve_transposed(&self, z: &mut [T]) {
        let r = z.len();
        for i in (0..r).rev() {
            let row = i * (i + 1) / 2;
            z[i] /= self.R[row + i];
            let value = z[i];
            for (j, x) in z[..i].iter_mut().enumerate() {
                *x -= self.R[row + j] * value;
            }
        }
    }

    /// `A v` of a kept row.
    #[inline(always)]
    fn rate(&self, row: usize, v: &[T]) -> T {
        dot(&self.rows[row * v.len()..][..v.len()], v)
    }

    /// `y += Qᵀ z`.
    #[inline(always)]
    fn add_transposed(&self, z: &[T], y: &mut [T]) {
        for (q, z) in self.Q.chunks_exact(y.len()).zip(z) {
            add(y, q, *z);
        }
    }
}

/// `a · b` of at least one number each.
#[inline(always)]
fn dot<T: Lane>(a: &[T], b: &[T]) -> T {
    let mut sum = a[0].like(0.0);
    for (a, b) in a.iter().zip(b) {
        sum += *a * *b;
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
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * *x;
    }
}

/// A machine whose loops are closed: its inertias, and the factor of M̂.
#[derive(Clone, Copy, Debug)]
pub(super) struct Closing<'a, T: Lane> {
    pub model: &'a Model,
    pub inertias: &'a Inertias<T>,
    pub factor: &'a Factor<T>,
}

/// The loops of a machine in a step.
#[derive(Clone, Debug)]
pub(crate) struct Loops<T: Lane> {
    token: T::Token,
    /// At the midpoint of the step.
    middle: Basis<T>,
    /// At its end.
    end: Basis<T>,
    poses: Poses<T>,
    q: LaneConfiguration<T>,
    /// Least number of Newton steps of a projection: one for a derivative, which changes with a
    /// position that is closed.
    least: usize,
    /// `B = Q Z` of the contacts (r, 3 n_c).
    B: Vec<T>,
    /// Change of Q y by the last [`Self::close`] (r).
    change: Vec<T>,
    /// Impulses of all rows in the last step (m), N s or N m s.
    impulses: Vec<T>,
    /// Scratch (r), (nv) and (m).
    z: Vec<T>,
    y: Vec<T>,
    values: Vec<f64>,
}

impl<T: Lane> Loops<T> {
    /// None for a machine that has none. `least`: number of Newton steps of a projection.
    pub(super) fn of(token: T::Token, model: &Model, least: usize) -> Option<Box<Self>> {
        let zero = T::splat(token, 0.0);
        (!model.loops().is_empty()).then(|| {
            Box::new(Self {
                token,
                middle: Basis::new(token, model),
                end: Basis::new(token, model),
                poses: Poses::new(token, model.mechanism()),
                q: LaneConfiguration::new(token, model.mechanism()),
                least,
                B: Vec::new(),
                change: Vec::new(),
                impulses: vec![zero; model.n_loop_rows()],
                z: Vec::new(),
                y: vec![zero; model.nv()],
                values: vec![0.0; model.n_loop_rows()],
            })
        })
    }

    /// The basis at the midpoint, once M̂ is factored.
    pub(super) fn begin(
        &mut self,
        model: &Model,
        poses: &Poses<T>,
        joints: &[T],
        factor: &Factor<T>,
    ) {
        self.middle.update(model, poses, joints, factor);
        self.B.clear();
    }

    /// `y −= Qᵀ B p`: what the loops make of the impulses p (3 n_c).
    pub(super) fn answer(&self, p: &[T], y: &mut [T]) {
        if p.is_empty() {
            return;
        }
        for (q, b) in (self.middle.Q.chunks_exact(y.len())).zip(self.B.chunks_exact(p.len())) {
            add(y, q, -dot(b, p));
        }
    }

    /// `y −= Qᵀ Q y`: what the loops leave of any change of the velocity.
    #[inline(always)]
    pub(super) fn restrict(&self, y: &mut [T]) {
        for q in self.middle.Q.chunks_exact(y.len()) {
            let share = dot(q, y);
            add(y, q, -share);
        }
    }

    /// Changes y so that after the change of `v` by `F⁻¹ y` the mean with `v_begin` obeys the
    /// loops.
    #[inline(always)]
    pub(super) fn close(&mut self, theta: f64, v_begin: &[T], v: &[T], y: &mut [T]) {
        let (basis, z) = (&self.middle, &mut self.z);
        z.clear();
        let share = T::splat(self.token, (1.0 - theta) / theta);
        for &row in &basis.kept {
            z.push(-(basis.rate(row, v) + share * basis.rate(row, v_begin)));
        }
        basis.solve(z);
        for (z, q) in z.iter_mut().zip(basis.Q.chunks_exact(y.len())) {
            *z -= dot(q, y);
        }
        basis.add_transposed(z, y);
        self.change.clone_from(z);
    }

    /// The impulses λ of the last [`Self::close`] with the contacts' p (3 n_c), from
    /// `Rᵀ λ = Δ(Q y)`.
    fn find_impulses(&mut self, p: &[T]) {
        let z = &mut self.z;
        z.clone_from(&self.change);
        if !p.is_empty() {
            for (z, b) in z.iter_mut().zip(self.B.chunks_exact(p.len())) {
                *z -= dot(b, p);
            }
        }
        self.middle.solve_transposed(z);
        self.impulses.fill(T::splat(self.token, 0.0));
        for (&row, z) in self.middle.kept.iter().zip(&*z) {
            self.impulses[row] = *z;
        }
    }

    /// `out += Aᵀ λ` (nv) with these impulses.
    pub(super) fn add_generalized_impulse(&mut self, p: &[T], out: &mut [T]) {
        self.find_impulses(p);
        let rows = self.middle.rows.chunks_exact(out.len());
        for (row, impulse) in rows.zip(&self.impulses) {
            add(out, row, *impulse);
        }
    }

    /// Projects a configuration from elsewhere onto the loops, and the velocity onto their rates.
    /// Returns the widest gap that is left.
    pub(super) fn project(
        &mut self,
        machine: Closing<'_, T>,
        q: &mut LaneConfiguration<T>,
        v: &mut [T],
    ) -> f64 {
        self.project_within(MOST_ELSEWHERE, machine, q, v)
    }

    /// The same at the end of a step.
    pub(super) fn project_end(
        &mut self,
        machine: Closing<'_, T>,
        q: &mut LaneConfiguration<T>,
        v: &mut [T],
    ) -> f64 {
        self.project_within(MOST_IN_STEP, machine, q, v)
    }

    fn project_within(
        &mut self,
        most: usize,
        machine: Closing<'_, T>,
        q: &mut LaneConfiguration<T>,
        v: &mut [T],
    ) -> f64 {
        let gap = self.project_position(most, machine, q);
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.project_velocity(machine, v),
        );
        gap
    }

    /// Newton's iteration on `φ(q) = 0` along `M̂⁻¹ Aᵀ`, and the basis at its end.
    fn project_position(
        &mut self,
        most: usize,
        machine: Closing<'_, T>,
        q: &mut LaneConfiguration<T>,
    ) -> f64 {
        let mut last = f64::INFINITY;
        let mut iteration = 0;
        loop {
            let (model, mechanism) = (machine.model, machine.model.mechanism());
            self.poses.update(mechanism, machine.inertias, q);
            (self.end).update(model, &self.poses, &q.joints, machine.factor);
            let values = self.values.iter_mut().zip(&self.end.gaps);
            values.for_each(|(value, gap)| *value = gap.get(0));
            let gap = model.widest_gap(&self.values).map_or(0.0, |gap| gap.value);
            let is_stuck = gap >= 0.5 * last && gap < MOST_OPEN;
            let is_closed = (gap <= TIGHT || is_stuck) && iteration >= self.least;
            if is_closed || iteration == most || gap.is_nan() {
                return gap;
            }
            last = gap;
            iteration += 1;
            T::vectorize(
                self.token,
                #[inline(always)]
                || {
                    let (basis, z) = (&self.end, &mut self.z);
                    z.clear();
                    for &row in &basis.kept {
                        z.push(-basis.gaps[row]);
                    }
                    self.move_along(machine);
                    let sizes = self.y.iter().map(|x| x.get(0).abs());
                    let share = (LONGEST / sizes.fold(0.0, f64::max)).min(1.0);
                    self.q.clone_from(q);
                    q.set_moved(mechanism, &self.q, &self.y, share);
                    q.normalise();
                },
            );
        }
    }

    /// Removes from a velocity what would open the loops at the end of the step.
    #[inline(always)]
    fn project_velocity(&mut self, machine: Closing<'_, T>, v: &mut [T]) {
        let (basis, z) = (&self.end, &mut self.z);
        z.clear();
        for &row in &basis.kept {
            z.push(-basis.rate(row, v));
        }
        self.move_along(machine);
        add(v, &self.y, T::splat(self.token, 1.0));
    }

    /// The change `self.y` of the velocity along `M̂⁻¹ Aᵀ` that changes the rates of the kept rows
    /// at the end by `self.z`.
    #[inline(always)]
    fn move_along(&mut self, machine: Closing<'_, T>) {
        let (basis, z) = (&self.end, &mut self.z);
        basis.solve(z);
        self.y.fill(T::splat(self.token, 0.0));
        basis.add_transposed(z, &mut self.y);
        let mechanism = machine.model.mechanism();
        machine.factor.half_solve_back(mechanism, &mut self.y);
    }

    /// Impulses of all rows in the last step (m): along x, y and z in N s, about them in N m s, and
    /// of a joint its own. They act on the first end, and their opposites on the second.
    pub(crate) fn impulses(&self) -> &[T] {
        &self.impulses
    }
}

impl Loops<f64> {
    /// Computes B, and subtracts `Bᵀ B` from W.
    pub(super) fn project_operator(&mut self, model: &Model, system: &mut ContactSystem) {
        let size = 3 * system.n_contacts();
        self.B.resize(self.middle.kept.len() * size, 0.0);
        if size == 0 {
            return;
        }
        let nv = model.nv();
        for (q, b) in (self.middle.Q.chunks_exact(nv)).zip(self.B.chunks_exact_mut(size)) {
            system.local(model, q, b);
        }
        for b in self.B.chunks_exact(size) {
            for (row, x) in system.W.chunks_exact_mut(size).zip(b) {
                add(row, b, -x);
            }
        }
    }

    /// Projects the end of a step, and keeps the impulses of a step with the contacts' p. Returns
    /// the widest gap that is left.
    pub(super) fn end(
        &mut self,
        machine: Closing<'_, f64>,
        p: &[f64],
        q: &mut LaneConfiguration<f64>,
        v: &mut [f64],
    ) -> f64 {
        self.find_impulses(p);
        self.project_end(machine, q, v)
    }
}

/// The factor of a machine's mass matrix M.
fn factor_of(model: &Model, poses: &Poses<f64>) -> Option<Factor<f64>> {
    let (token, mechanism): (_, &Mechanism) = (Single::best(), model.mechanism());
    let mut mass_matrix = MassMatrix::new(token, mechanism);
    mass_matrix.update(mechanism, model.inertias(), poses);
    let mut factor = Factor::new(token, mechanism);
    mass_matrix
        .factorise(mechanism, &mut factor)
        .then_some(factor)
}

/// The loop that is open farthest in a configuration; none of a tree.
#[must_use]
pub fn widest_gap(model: &Model, q: &Configuration) -> Option<LoopGap> {
    let mut gaps = vec![0.0; model.n_loop_rows()];
    let kinematics = Kinematics::of(model, q);
    model.write_loops(kinematics.poses(), &q.joints, &mut gaps, &mut []);
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
    let token = Single::best();
    let Some(mut loops) = Loops::of(token, model, 0) else {
        return Ok(q);
    };
    let kinematics = Kinematics::of(model, &q);
    if let Some(factor) = &factor_of(model, kinematics.poses()) {
        let inertias = model.inertias();
        let machine = Closing {
            model,
            inertias,
            factor,
        };
        let mut lane = LaneConfiguration::new(token, model.mechanism());
        lane.set_lane(0, &q);
        loops.project(machine, &mut lane, v);
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

/// Of each loop, the number of its rows that follow from other rows in a configuration.
#[must_use]
pub fn redundant_rows(model: &Model, q: &Configuration) -> Vec<usize> {
    let kinematics = Kinematics::of(model, q);
    let mut basis = Basis::new(Single::best(), model);
    if let Some(factor) = factor_of(model, kinematics.poses()) {
        basis.update(model, kinematics.poses(), &q.joints, &factor);
    }
    let mut first = 0;
    let redundant = model.loops().iter().map(|closure| {
        let rows = first..first + closure.n_rows();
        first = rows.end;
        rows.filter(|row| !basis.kept.contains(row)).count()
    });
    redundant.collect()
}
