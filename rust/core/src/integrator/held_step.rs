//! The solution of a Moreau–Jean step, with everything held that changes in jumps: the contacts and
//! their modes, and whether the position is projected.
//!
//! Without memory of earlier impulses the free velocity, H and the gaps are explicit functions of
//! state x and command. With p and the projection's λ as arguments
//!
//! ```text
//! v(x, p) = v + M̂⁻¹ (h F + H p),    u(x, p) = Hᵀ v(x, p),    d(x, λ) = M̂⁻¹ H λ
//! ```
//!
//! are smooth. By the implicit function theorem their derivatives at held p and λ give those of the
//! step: dp follows from du, then dλ from the gaps at the end ([`super::contact_modes`]). This page
//! has what that needs of a step that was taken; `crate::system::tangent` differentiates.

use super::contact_modes::{HeldLaw, ImpulseDerivative};
use super::dynamics::Dynamics;
use super::local::Local;
use super::mechanical_system::{MechanicalSystem, UnilateralContact};
use super::options::{Stabilisation, StepOptions};
use super::scratch::ScratchOf;
use crate::law::compliance::Yielding;
use crate::problem::Operator;

/// A step of contacts `C` with its modes.
#[derive(Clone, Debug)]
pub(crate) struct HeldStep<C> {
    /// Contacts where the step evaluated them.
    pub contacts: Vec<C>,
    pub law: HeldLaw,
    pub answer: ImpulseDerivative,
    pub projection: Option<Projection>,
    /// `W` (d n_c, d n_c), row-major.
    pub W: Vec<f64>,
    /// `M̂⁻¹ H` (nv, d n_c), row-major.
    pub response: Vec<f64>,
    /// Whether each contact yields (n_c); empty if all are rigid.
    pub yields: Vec<bool>,
    /// Whether nothing moves each contact along its normal (n_c).
    pub immovable: Vec<bool>,
}

/// A projection of the position.
#[derive(Clone, Debug)]
pub(crate) struct Projection {
    pub law: HeldLaw,
    pub answer: ImpulseDerivative,
}

/// Relative violation of the modes' equations up to which they count as those of the step.
pub(crate) const SAME: f64 = 1e-7;

impl<C: Clone + UnilateralContact> HeldStep<C> {
    /// Takes contacts, modes and matrices from the step that was just taken with the scratch `ws`,
    /// without memory, by a system that still holds its matrices. `is_common`: contacts with the
    /// common coefficient of friction. None if the step was not solved, or not projected by the
    /// law.
    pub(crate) fn of<S: MechanicalSystem<Contact = C>>(
        system: &S,
        options: &StepOptions,
        ws: &ScratchOf<S>,
        is_common: impl Fn(&C) -> bool,
    ) -> Option<Self> {
        let law = law_of_last(system, ws).filter(|law| law.residual() <= SAME)?;
        let (n, size) = (ws.list.contacts.len(), law.p.len());
        let problem = system.problem(&ws.free_velocity()[..size], &ws.list.mu[..n]);
        let Operator::Dense(W) = problem.operator() else {
            return None;
        };
        let is_common: Vec<bool> = ws.list.contacts.iter().map(is_common).collect();
        let projection = if is_projected::<S>(options, ws) {
            Some(Projection::of(system, options, ws, &law, (W, &is_common))?)
        } else {
            None
        };
        Some(Self {
            contacts: ws.list.contacts.clone(),
            answer: law.answer(W, &is_common),
            law,
            projection,
            W: W.to_vec(),
            response: response(system, size),
            yields: ws.data.laws.iter().map(Yielding::is_soft).collect(),
            immovable: (0..n).map(|i| system.is_immovable(i)).collect(),
        })
    }
}

impl Projection {
    /// None if it is not one by the law.
    fn of<S: MechanicalSystem>(
        system: &S,
        options: &StepOptions,
        ws: &ScratchOf<S>,
        solved: &HeldLaw,
        (W, is_common): (&[f64], &[bool]),
    ) -> Option<Self> {
        let (h, d) = (options.time_step, S::DIMENSION.components());
        let (n, size) = (ws.list.contacts.len(), solved.p.len());
        let lambda = Local::flat(&ws.gaps.p)[..size].to_vec();
        let mut displacement: Vec<f64> = (W.chunks_exact(size.max(1)))
            .map(|row| row.iter().zip(&lambda).map(|(w, p)| w * p).sum())
            .collect();
        for (i, contact) in ws.list.contacts.iter().enumerate() {
            let (p, before) = (ws.problems.p[i][0], ws.list.u_before[i][0]);
            let (u, gap) = match ws.data.laws.get(i) {
                Some(law) if law.is_soft() => {
                    let given = law.shift[0] + law.diagonal[0] * p;
                    (solved.u[d * i] - given, law.unexplained)
                }
                _ => {
                    let u = solved.u[d * i] - system.normal_shift(options, contact, before);
                    (u, contact.gap() + options.theta * h * (u - before))
                }
            };
            let is_moved = ws.data.is_deep[ws.list.group_leader_of(i)];
            let may_move = is_moved && !system.is_immovable(i);
            let is_counted = may_move && (gap >= 0.0 || gap + h * u < 0.0);
            displacement[d * i] += if is_counted { gap } else { 0.0 };
        }
        let weight: Vec<f64> = (0..n).map(|i| W[d * i * (size + 1)]).collect();
        let with =
            |mu: Vec<f64>| HeldLaw::new(lambda.clone(), displacement.clone(), mu, weight.clone());
        // A displacement that friction locked was found without it.
        let laws = [ws.list.mu[..n].to_vec(), vec![0.0; n]]
            .into_iter()
            .map(with);
        let law = laws.into_iter().find(|law| law.residual() <= SAME)?;
        let answer = law.answer(W, is_common);
        Some(Self { law, answer })
    }
}

/// `M̂⁻¹ H` (nv, size), row-major.
fn response<S: MechanicalSystem>(system: &S, size: usize) -> Vec<f64> {
    let nv = system.machine().nv();
    let mut response = vec![0.0; nv * size];
    let (mut p, mut y) = (vec![0.0; size], vec![0.0; nv]);
    for i in 0..size {
        p[i] = 1.0;
        y.fill(0.0);
        system.add_impulses(&p, &mut y);
        system.machine().half_solve_back(&mut y);
        for (row, y) in response.chunks_exact_mut(size).zip(&y) {
            row[i] = *y;
        }
        p[i] = 0.0;
    }
    response
}

/// Whether the step that was just taken with `ws` projected the position.
pub(crate) fn is_projected<S: MechanicalSystem>(options: &StepOptions, ws: &ScratchOf<S>) -> bool {
    options.stabilisation == Stabilisation::Projection && ws.data.is_deep.contains(&true)
}

/// The law of the step that was just taken with `ws`, whose matrices the system still holds; none
/// if its problem has no dense operator.
///
/// The velocities are those before the energy audit.
pub(crate) fn law_of_last<S: MechanicalSystem>(system: &S, ws: &ScratchOf<S>) -> Option<HeldLaw> {
    let (n, d) = (ws.list.contacts.len(), S::DIMENSION.components());
    let (size, mu) = (d * n, &ws.list.mu[..n]);
    let Operator::Dense(W) = system.problem(&ws.free_velocity()[..size], mu).operator() else {
        return None;
    };
    let rows = (0..size).map(|i| &W[i * size..][..size]);
    let sums = rows.zip(ws.free_velocity()).map(|(row, q)| {
        let pushed = row.iter().zip(ws.impulses_of_problem()).map(|(w, p)| w * p);
        q + pushed.sum::<f64>()
    });
    let weight = (0..n).map(|i| W[d * i * (size + 1)]);
    let p = ws.impulses_of_problem()[..size].to_vec();
    Some(HeldLaw::new(
        p,
        sums.collect(),
        mu.to_vec(),
        weight.collect(),
    ))
}
