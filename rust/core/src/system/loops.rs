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
//! Rows that follow from earlier ones, such as those across the plane of a planar linkage, are left
//! out: their part outside the span is below `DEPENDENT` of the loop's longest row. Their
//! reactions count as zero.
//!
//! Source: Gear et al. 1985, for constraints on both levels; Featherstone 2008, ch. 8, for loops
//! closed on a tree.

use crate::contact::ContactSystem;
use crate::integrator::report::MOST_OPEN;
use crate::multibody::error::StateError;
use crate::multibody::{Configuration, Factor, Kinematics, LoopGap, MassMatrix, Mechanism, Model};
use crate::scalar::Single;

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
#[derive(Clone, Debug, Default)]
struct Basis {
    /// φ of all rows (m).
    gaps: Vec<f64>,
    /// A (m, nv), row-major.
    rows: Vec<f64>,
    /// The rows of A that do not follow from earlier ones (r).
    kept: Vec<usize>,
    /// Orthonormal rows (r, nv).
    Q: Vec<f64>,
    /// Lower triangle of R in `G = R Q` of the kept rows (r (r + 1) / 2), by rows.
    R: Vec<f64>,
}

impl Basis {
    fn new(model: &Model) -> Self {
        let (m, nv) = (model.n_loop_rows(), model.nv());
        Self {
            gaps: vec![0.0; m],
            rows: vec![0.0; m * nv],
            kept: Vec::with_capacity(m),
            Q: Vec::with_capacity(m * nv),
            R: Vec::with_capacity(m * (m + 1) / 2),
        }
    }

    /// Gaps, rows and their basis at a configuration, with the factor of M̂.
    fn update(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        joints: &[f64],
        factor: &Factor<f64>,
    ) {
        model.write_loops(kinematics, joints, &mut self.gaps, &mut self.rows);
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
                longest = longest.max(norm(row));
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
    fn orthogonalise(&mut self, nv: usize, longest: f64) -> bool {
        let r = self.kept.len();
        let begin = self.R.len();
        self.R.resize(begin + r + 1, 0.0);
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
        if length.is_nan() || length <= DEPENDENT * longest {
            self.R.truncate(begin);
            return false;
        }
        for x in own {
            *x /= length;
        }
        self.R[begin + r] = length;
        true
    }

    fn r(&self) -> usize {
        self.kept.len()
    }

    /// `z = R⁻¹ z`, in place.
    fn solve(&self, z: &mut [f64]) {
        let mut row = 0;
        for i in 0..z.len() {
            let known = dot(&self.R[row..row + i], &z[..i]);
            z[i] = (z[i] - known) / self.R[row + i];
            row += i + 1;
        }
    }

    /// `z = R⁻ᵀ z`, in place.
    fn solve_transposed(&self, z: &mut [f64]) {
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

    /// `A v` of the kept rows, as an iterator.
    fn rates<'a>(&'a self, v: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let nv = v.len();
        self.kept
            .iter()
            .map(move |&i| dot(&self.rows[i * nv..(i + 1) * nv], v))
    }

    /// `y += Qᵀ z`.
    fn add_transposed(&self, z: &[f64], y: &mut [f64]) {
        for (q, z) in self.Q.chunks_exact(y.len()).zip(z) {
            add(y, q, *z);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// `y += a x`.
fn add(y: &mut [f64], x: &[f64], a: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// The loops of a machine in a step.
#[derive(Clone, Debug)]
pub(crate) struct Loops {
    /// At the midpoint of the step.
    middle: Basis,
    /// At its end.
    end: Basis,
    kinematics: Kinematics,
    /// `B = Q Z` of the contacts (r, 3 n_c).
    B: Vec<f64>,
    /// Change of Q y by the last [`Self::close`] (r).
    change: Vec<f64>,
    /// Impulses of all rows in the last step (m), N s or N m s.
    impulses: Vec<f64>,
    /// Scratch (r) and (nv).
    z: Vec<f64>,
    y: Vec<f64>,
}

impl Loops {
    /// None for a machine that has none.
    pub(crate) fn of(model: &Model) -> Option<Box<Self>> {
        (!model.loops().is_empty()).then(|| {
            Box::new(Self {
                middle: Basis::new(model),
                end: Basis::new(model),
                kinematics: Kinematics::new(model),
                B: Vec::new(),
                change: Vec::new(),
                impulses: vec![0.0; model.n_loop_rows()],
                z: Vec::new(),
                y: vec![0.0; model.nv()],
            })
        })
    }

    /// The basis at the midpoint, once M̂ is factored.
    pub(super) fn begin(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        joints: &[f64],
        factor: &Factor<f64>,
    ) {
        self.middle.update(model, kinematics, joints, factor);
        self.B.clear();
    }

    /// Computes B, and subtracts `Bᵀ B` from W.
    pub(super) fn project_operator(&mut self, model: &Model, system: &mut ContactSystem) {
        let size = 3 * system.n_contacts();
        self.B.resize(self.middle.r() * size, 0.0);
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

    /// `y −= Qᵀ B p`: what the loops make of the impulses p (3 n_c).
    pub(super) fn answer(&self, p: &[f64], y: &mut [f64]) {
        if p.is_empty() {
            return;
        }
        for (q, b) in (self.middle.Q.chunks_exact(y.len())).zip(self.B.chunks_exact(p.len())) {
            add(y, q, -dot(b, p));
        }
    }

    /// Changes y so that after the change of `v` by `F⁻¹ y` the mean with `v_begin` obeys the
    /// loops.
    pub(super) fn close(&mut self, theta: f64, v_begin: &[f64], v: &[f64], y: &mut [f64]) {
        let (basis, z) = (&self.middle, &mut self.z);
        z.clear();
        let share = (1.0 - theta) / theta;
        let rates = basis.rates(v).zip(basis.rates(v_begin));
        z.extend(rates.map(|(rate, begin)| -(rate + share * begin)));
        basis.solve(z);
        for (z, q) in z.iter_mut().zip(basis.Q.chunks_exact(y.len())) {
            *z -= dot(q, y);
        }
        basis.add_transposed(z, y);
        self.change.clone_from(z);
    }

    /// The impulses λ of the last [`Self::close`] with the contacts' p (3 n_c), from
    /// `Rᵀ λ = Δ(Q y)`.
    fn find_impulses(&mut self, p: &[f64]) {
        let z = &mut self.z;
        z.clone_from(&self.change);
        if !p.is_empty() {
            for (z, b) in z.iter_mut().zip(self.B.chunks_exact(p.len())) {
                *z -= dot(b, p);
            }
        }
        self.middle.solve_transposed(z);
        self.impulses.fill(0.0);
        for (&row, z) in self.middle.kept.iter().zip(&*z) {
            self.impulses[row] = *z;
        }
    }

    /// `out += Aᵀ λ` (nv) with these impulses.
    pub(super) fn add_generalized_impulse(&mut self, p: &[f64], out: &mut [f64]) {
        self.find_impulses(p);
        let rows = self.middle.rows.chunks_exact(out.len());
        for (row, impulse) in rows.zip(&self.impulses) {
            add(out, row, *impulse);
        }
    }

    /// Projects the configuration onto the loops and the velocity onto their rates, and keeps the
    /// impulses of a step with the contacts' p. Returns the widest gap that is left.
    pub(super) fn end(
        &mut self,
        model: &Model,
        factor: &Factor<f64>,
        p: &[f64],
        q: &mut Configuration,
        v: &mut [f64],
    ) -> f64 {
        self.find_impulses(p);
        let gap = self.project_position(model, factor, MOST_IN_STEP, q);
        self.project_velocity(model, factor, v);
        gap
    }

    /// Newton's iteration on `φ(q) = 0` along `M̂⁻¹ Aᵀ`, and the basis at its end.
    fn project_position(
        &mut self,
        model: &Model,
        factor: &Factor<f64>,
        most: usize,
        q: &mut Configuration,
    ) -> f64 {
        let mut last = f64::INFINITY;
        let mut iteration = 0;
        loop {
            self.kinematics.update_for_step(model, q);
            (self.end).update(model, &self.kinematics, &q.joints, factor);
            let gap = model
                .widest_gap(&self.end.gaps)
                .map_or(0.0, |gap| gap.value);
            let is_stuck = gap >= 0.5 * last && gap < MOST_OPEN;
            if gap <= TIGHT || is_stuck || iteration == most || gap.is_nan() {
                return gap;
            }
            last = gap;
            iteration += 1;
            let (basis, z) = (&self.end, &mut self.z);
            z.clear();
            z.extend(basis.kept.iter().map(|&row| -basis.gaps[row]));
            self.move_along(model, factor);
            let farthest = self.y.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let share = (LONGEST / farthest).min(1.0);
            q.advance(model, &self.y, share);
            q.normalise();
        }
    }

    /// Removes from a velocity what would open the loops at the end of the step.
    fn project_velocity(&mut self, model: &Model, factor: &Factor<f64>, v: &mut [f64]) {
        let (basis, z) = (&self.end, &mut self.z);
        z.clear();
        z.extend(basis.rates(v).map(|rate| -rate));
        self.move_along(model, factor);
        add(v, &self.y, 1.0);
    }

    /// The change `self.y` of the velocity along `M̂⁻¹ Aᵀ` that changes the rates of the kept rows
    /// at the end by `self.z`.
    fn move_along(&mut self, model: &Model, factor: &Factor<f64>) {
        let (basis, z) = (&self.end, &mut self.z);
        basis.solve(z);
        self.y.fill(0.0);
        basis.add_transposed(z, &mut self.y);
        factor.half_solve_back(model.mechanism(), &mut self.y);
    }

    /// Impulses of all rows in the last step (m): along x, y and z in N s, about them in N m s, and
    /// of a joint its own. They act on the first end, and their opposites on the second.
    pub(crate) fn impulses(&self) -> &[f64] {
        &self.impulses
    }
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
        loops.project_position(model, &factor, MOST_ELSEWHERE, &mut q);
        loops.project_velocity(model, &factor, v);
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
    let mut basis = Basis::new(model);
    if let Some(factor) = factor_of(model, &kinematics) {
        basis.update(model, &kinematics, &q.joints, &factor);
    }
    let mut first = 0;
    let redundant = model.loops().iter().map(|closure| {
        let rows = first..first + closure.n_rows();
        first = rows.end;
        rows.filter(|row| !basis.kept.contains(row)).count()
    });
    redundant.collect()
}
