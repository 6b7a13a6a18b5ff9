//! A Moreau–Jean step about a step that was taken, with everything held that changes in jumps: the
//! contacts and their modes, the branches of the motors, whether the position is projected, and how
//! the energy audit corrected the velocity.
//!
//! Without memory of earlier impulses the free velocity, H and the gaps are explicit functions of
//! state x and command. With p and the projection's λ as arguments
//!
//! ```text
//! v(x, p) = v + M̂⁻¹ (h F + H p),    u(x, p) = Hᵀ v(x, p),    d(x, λ) = M̂⁻¹ H λ
//! ```
//!
//! are smooth ([`HeldStep::trial`]). By the implicit function theorem their derivatives at held
//! p and λ give those of the step ([`HeldStep::respond`]): dp follows from du, then dλ from the
//! gaps at the end ([`super::contact_modes`]). [`HeldStep::finish`] is the explicit rest of the
//! step, from (v⁺, d) to the state at its end.

use nalgebra::{DMatrix, DVectorView};

use super::contact_modes::{HeldLaw, product};
use super::mechanical_system::{MOST_REVISIONS, MechanicalSystem, Start, UnilateralContact};
use super::moreau_jean::{load_explicitly, load_implicitly};
use super::options::{Stabilisation, StepOptions};
use super::scratch::ScratchOf;
use super::step_contacts::{assemble_contacts, shift, yielded};
use super::warm_start::WarmStart;

/// What the energy audit did to the velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Correction {
    None,
    /// The motion relative to the mass centre was scaled.
    Relative,
    /// All of the velocity was scaled.
    Whole,
}

/// A step of contacts `C` with its modes.
#[derive(Clone, Debug)]
pub(crate) struct HeldStep<C> {
    options: StepOptions,
    contacts: Vec<C>,
    is_gyroscopic: bool,
    correction: Correction,
    pub(crate) law: HeldLaw,
    projection: Option<Projection>,
    /// λ (d n_c); zero without a projection.
    lambda: Vec<f64>,
    /// The trial of the step itself.
    base: Vec<f64>,
    nv: usize,
    /// The velocity at the end of the step (nv), by which piecewise forces choose their branches.
    v_end: Vec<f64>,
    /// `M̂⁻¹ H` (nv, d n_c).
    response: DMatrix<f64>,
    /// `W` (d n_c, d n_c).
    W: DMatrix<f64>,
}

#[derive(Clone, Debug)]
struct Projection {
    law: HeldLaw,
    /// Whether each contact's gap counts as it is, or as 0 since it is separating (n_c).
    counts: Vec<bool>,
}

/// Derivatives of the velocity before the audit, and of the projection's displacement (nv, m each).
pub(crate) struct Response {
    pub v: DMatrix<f64>,
    pub displacement: DMatrix<f64>,
}

/// Relative difference up to which a step counts as the one that was taken.
const SAME: f64 = 1e-7;

impl<C: Clone + UnilateralContact> HeldStep<C> {
    /// About the step from `start` that was just taken with the scratch `ws` and without memory,
    /// to the velocity `v_end`. None if it was split, not solved, or not projected by the law.
    pub(crate) fn of<S: MechanicalSystem<Contact = C>>(
        system: &mut S,
        options: &StepOptions,
        start: Start<'_, S::Configuration>,
        v_end: &[f64],
        ws: &mut ScratchOf<S>,
    ) -> Option<Self> {
        let (nv, d) = (system.nv(), S::DIMENSION.components());
        let contacts = ws.contacts.clone();
        let mu = ws.mu[..contacts.len()].to_vec();
        let p = ws.p[..d * contacts.len()].to_vec();
        let is_projected = options.stabilisation == Stabilisation::Projection
            && (ws.gap_end.iter()).any(|gap| *gap < -options.penetration_tolerance);
        let lambda = if is_projected {
            ws.p_position.clone()
        } else {
            vec![0.0; p.len()]
        };
        let empty = HeldLaw::new(Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut held = Self {
            options: options.clone(),
            contacts,
            is_gyroscopic: false,
            correction: Correction::None,
            law: empty,
            projection: None,
            lambda,
            base: Vec::new(),
            nv,
            v_end: v_end.to_vec(),
            response: DMatrix::zeros(0, 0),
            W: DMatrix::zeros(0, 0),
        };
        let mut best = f64::INFINITY;
        let mut chosen = (false, Correction::None);
        for is_gyroscopic in [false, true] {
            held.is_gyroscopic = is_gyroscopic;
            let base = held.trial_with(system, start, &p, ws)?;
            for correction in [Correction::None, Correction::Relative, Correction::Whole] {
                held.correction = correction;
                let end = held.finish(system, start, &base[..nv], &base[nv..2 * nv], ws);
                let pairs = end.1.iter().zip(v_end);
                let off = pairs.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
                // The same to rounding: the simpler one.
                if off < 0.5 * best {
                    (best, chosen) = (off, (is_gyroscopic, correction));
                }
            }
        }
        (held.is_gyroscopic, held.correction) = chosen;
        let fastest = v_end.iter().fold(1e-3_f64, |m, v| m.max(v.abs()));
        held.base = held.trial_with(system, start, &p, ws)?;
        (held.response, held.W) = operators(system, ws, p.len());
        let weight: Vec<f64> = (0..mu.len()).map(|i| held.W[(d * i, d * i)]).collect();
        held.law = HeldLaw::new(p, held.u(&held.base).to_vec(), mu.clone(), weight.clone());
        if is_projected {
            held.project(system, (mu, weight), ws);
        }
        let is_same = best <= SAME * fastest
            && held.law.residual() <= SAME
            && held
                .projection
                .as_ref()
                .is_none_or(|p| p.law.residual() <= SAME);
        is_same.then_some(held)
    }

    /// Completes `self.projection`.
    fn project<S: MechanicalSystem<Contact = C>>(
        &mut self,
        system: &S,
        (mu, weight): (Vec<f64>, Vec<f64>),
        ws: &ScratchOf<S>,
    ) {
        let (h, d) = (self.options.time_step, S::DIMENSION.components());
        let mut displacement = self.local_displacement(&self.base).to_vec();
        let mut counts = Vec::with_capacity(mu.len());
        for (i, gap) in self.gaps(&self.base).iter().enumerate() {
            let given = shift(system, &self.options, ws, i)[0] + yielded(ws, i, self.law.p[d * i]);
            let u_N = self.u(&self.base)[d * i] - given;
            let is_counted = *gap >= 0.0 || gap + h * u_N < 0.0;
            displacement[d * i] += if is_counted { *gap } else { 0.0 };
            counts.push(is_counted);
        }
        let law = |mu: Vec<f64>| {
            HeldLaw::new(
                self.lambda.clone(),
                displacement.clone(),
                mu,
                weight.clone(),
            )
        };
        let rough = law(mu.clone());
        // A displacement that friction locked was found without it.
        let law = if rough.residual() <= SAME {
            rough
        } else {
            law(vec![0.0; mu.len()])
        };
        self.projection = Some(Projection { law, counts });
    }

    fn u<'a>(&self, trial: &'a [f64]) -> &'a [f64] {
        &trial[2 * self.nv..][..self.lambda.len()]
    }

    fn local_displacement<'a>(&self, trial: &'a [f64]) -> &'a [f64] {
        &trial[2 * self.nv + self.lambda.len()..][..self.lambda.len()]
    }

    fn gaps<'a>(&self, trial: &'a [f64]) -> &'a [f64] {
        &trial[2 * (self.nv + self.lambda.len())..]
    }

    /// The smooth functions at a start near that of the step, one after another: v (nv), d (nv), u
    /// shifted (d n_c), the local part of d (d n_c), gaps before the projection (n_c). None if the
    /// mass matrix cannot be factored.
    pub(crate) fn trial<S: MechanicalSystem<Contact = C>>(
        &self,
        system: &mut S,
        start: Start<'_, S::Configuration>,
        ws: &mut ScratchOf<S>,
    ) -> Option<Vec<f64>> {
        self.trial_with(system, start, &self.law.p, ws)
    }

    fn trial_with<S: MechanicalSystem<Contact = C>>(
        &self,
        system: &mut S,
        start: Start<'_, S::Configuration>,
        p: &[f64],
        ws: &mut ScratchOf<S>,
    ) -> Option<Vec<f64>> {
        let options = &self.options;
        let (h, theta, d) = (options.time_step, options.theta, S::DIMENSION.components());
        let no_memory = WarmStart::default();
        self.choose_branches(system, start);
        let (q, v) = (start.configuration, start.v);
        system.set_moved(q, v, (1.0 - theta) * h, &mut ws.middle);
        system.place_middle(&ws.middle);
        system.set_moved(q, v, h, &mut ws.end);
        system.place_end(&ws.end);
        ws.contacts.clone_from(&self.contacts);
        system.relocate(&mut ws.contacts);
        system.update_mass_matrix(options);
        if !system.factorise(options) {
            return None;
        }
        ws.v.copy_from_slice(v);
        assemble_contacts(system, options, v, &no_memory, ws);
        if self.is_gyroscopic {
            load_implicitly(system, options, start, &no_memory, ws);
        } else {
            load_explicitly(system, options, start, &no_memory, ws);
        }
        system.add_impulses(p, &mut ws.y);
        let mut u = vec![0.0; p.len()];
        system.local(&ws.y, &mut u);
        ws.half_solve_back(|y| system.half_solve_back(y));
        let mut out: Vec<f64> = v.iter().zip(&ws.dv).map(|(v, dv)| v + dv).collect();
        let mut gaps = Vec::with_capacity(ws.contacts.len());
        for (i, contact) in ws.contacts.iter().enumerate() {
            gaps.push(match ws.yielding.get(i) {
                Some(law) if law.diagonal > 0.0 => law.unexplained,
                _ => contact.gap() + theta * h * u[d * i],
            });
        }
        shift_velocities(system, options, ws, p, &mut u);
        for (u, before) in u.iter_mut().zip(&ws.u_before) {
            *u += before;
        }
        let mut local = vec![0.0; p.len()];
        ws.y.fill(0.0);
        system.add_impulses(&self.lambda, &mut ws.y);
        system.local(&ws.y, &mut local);
        ws.half_solve_back(|y| system.half_solve_back(y));
        out.extend_from_slice(&ws.dv);
        for part in [u, local, gaps] {
            out.extend(part);
        }
        Some(out)
    }

    /// Derivatives of the step from those of the trial (as long, m).
    pub(crate) fn respond(&self, trial: &DMatrix<f64>) -> Response {
        let (nv, size, m) = (self.nv, self.lambda.len(), trial.ncols());
        let d = size.checked_div(self.law.modes.len()).unwrap_or(1);
        let du = trial.rows(2 * nv, size).into_owned();
        let dp = self.law.respond(&self.W, &du);
        let v = trial.rows(0, nv) + product(&self.response, &dp);
        let mut displacement = trial.rows(nv, nv).into_owned();
        if let Some(projection) = &self.projection {
            let share = self.options.theta * self.options.time_step;
            let answered = product(&self.W, &dp);
            let mut change = trial.rows(2 * nv + size, size).into_owned();
            let gaps = trial.rows(2 * (nv + size), self.law.modes.len());
            for (i, _) in projection.counts.iter().enumerate().filter(|(_, c)| **c) {
                for k in 0..m {
                    change[(d * i, k)] += gaps[(i, k)] + share * answered[(d * i, k)];
                }
            }
            displacement += product(&self.response, &projection.law.respond(&self.W, &change));
        }
        Response { v, displacement }
    }

    /// The state at the end, from the velocity before the audit and the projection's displacement
    /// (nv each).
    pub(crate) fn finish<S: MechanicalSystem<Contact = C>>(
        &self,
        system: &mut S,
        start: Start<'_, S::Configuration>,
        v_end: &[f64],
        displacement: &[f64],
        ws: &mut ScratchOf<S>,
    ) -> (S::Configuration, Vec<f64>) {
        let (h, theta) = (self.options.time_step, self.options.theta);
        let (q, v) = (start.configuration, start.v);
        system.set_moved(q, v, (1.0 - theta) * h, &mut ws.middle);
        system.set_moved(&ws.middle, v_end, theta * h, &mut ws.end);
        system.normalise(&mut ws.end);
        self.choose_branches(system, start);
        let v = self.corrected(system, start, v_end, &ws.end);
        system.advance(&mut ws.end, displacement, 1.0);
        system.normalise(&mut ws.end);
        (ws.end.clone(), v)
    }

    /// Sets the branches of the piecewise forces as the step has them, for this command.
    fn choose_branches<S: MechanicalSystem<Contact = C>>(
        &self,
        system: &mut S,
        start: Start<'_, S::Configuration>,
    ) {
        system.choose_branches(start);
        for _ in 0..MOST_REVISIONS {
            if !system.revise(start, &self.v_end) {
                break;
            }
        }
    }

    /// What the audit leaves of a velocity, see [`super::energy_audit`].
    fn corrected<S: MechanicalSystem<Contact = C>>(
        &self,
        system: &mut S,
        start: Start<'_, S::Configuration>,
        v_end: &[f64],
        q_end: &S::Configuration,
    ) -> Vec<f64> {
        let kept = || v_end.to_vec();
        let options = &self.options;
        if self.correction == Correction::None {
            return kept();
        }
        let Some(before) = system.energy(options, start.configuration, start.v) else {
            return kept();
        };
        let work = system.work(options, start, v_end);
        let Some(after) = system.energy(options, q_end, v_end) else {
            return kept();
        };
        let excess = (after.kinetic - before.kinetic) + (after.potential - before.potential) - work;
        let common = after.momentum / after.mass;
        let is_relative = self.correction == Correction::Relative;
        let whole = if is_relative {
            after.momentum.norm_squared() / (2.0 * after.mass)
        } else {
            0.0
        };
        let share = (1.0 - excess / (after.kinetic - whole)).max(0.0).sqrt();
        let scaled = |(k, v): (usize, &f64)| {
            let common = if is_relative && k < S::DIMENSION.components() {
                common[k]
            } else {
                0.0
            };
            common + share * (v - common)
        };
        v_end.iter().enumerate().map(scaled).collect()
    }

    /// The velocity before the audit and the projection's displacement of the step itself (nv
    /// each).
    pub(crate) fn solution(&self) -> (DVectorView<'_, f64>, DVectorView<'_, f64>) {
        let part = |from: usize| DVectorView::from_slice(&self.base[from..], self.nv);
        (part(0), part(self.nv))
    }

    /// Whether the step's position was projected.
    pub(crate) fn is_projected(&self) -> bool {
        self.projection.is_some()
    }
}

/// Adds what the contacts' laws add to the local velocities `u` (d n_c) under impulses `p`.
fn shift_velocities<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &ScratchOf<S>,
    p: &[f64],
    u: &mut [f64],
) {
    let d = S::DIMENSION.components();
    for (i, u) in u.chunks_exact_mut(d).enumerate() {
        let shift = shift(system, options, ws, i);
        for ((u, p), shift) in u.iter_mut().zip(&p[d * i..]).zip(shift) {
            *u += shift + yielded(ws, i, *p);
        }
    }
}

/// `M̂⁻¹ H` and W of the assembled contacts, with so many components in all.
fn operators<S: MechanicalSystem>(
    system: &S,
    ws: &ScratchOf<S>,
    size: usize,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (nv, d) = (system.nv(), S::DIMENSION.components());
    let mut response = DMatrix::zeros(nv, size);
    let mut W = DMatrix::zeros(size, size);
    let (mut p, mut y, mut u) = (vec![0.0; size], vec![0.0; nv], vec![0.0; size]);
    for i in 0..size {
        p[i] = 1.0;
        y.fill(0.0);
        system.add_impulses(&p, &mut y);
        system.local(&y, &mut u);
        W.column_mut(i).copy_from_slice(&u);
        system.half_solve_back(&mut y);
        response.column_mut(i).copy_from_slice(&y);
        p[i] = 0.0;
    }
    for (i, law) in ws.yielding.iter().enumerate() {
        for k in d * i..d * (i + 1) {
            W[(k, k)] += law.diagonal;
        }
    }
    (response, W)
}

/// The law of the step that was just taken with `ws`, whose matrices the system still holds, and
/// whether it projected the position.
pub(crate) fn law_of_last<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &ScratchOf<S>,
) -> (HeldLaw, bool) {
    let (n, d) = (ws.contacts.len(), S::DIMENSION.components());
    let (_, W) = operators(system, ws, d * n);
    let mut u = ws.u[..d * n].to_vec();
    shift_velocities(system, options, ws, &ws.p, &mut u);
    let weight = (0..n).map(|i| W[(d * i, d * i)]).collect();
    let law = HeldLaw::new(ws.p[..d * n].to_vec(), u, ws.mu[..n].to_vec(), weight);
    let is_projected = options.stabilisation == Stabilisation::Projection
        && (ws.gap_end.iter()).any(|gap| *gap < -options.penetration_tolerance);
    (law, is_projected)
}
