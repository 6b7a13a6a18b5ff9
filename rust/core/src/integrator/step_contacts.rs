//! The contacts of a step: forecast, assembly, solve, and the gaps at the end.

use super::contacting::{KeyOf, UnilateralContact};
use super::groups::Group;
use super::island::{Level, left_of, settle};
use super::mechanical_system::MechanicalSystem;
use super::options::StepOptions;
use super::probe::{Phase, Probe};
use super::report::StepReport;
use super::scratch::{Scratch, ScratchOf};
use super::warm_start::WarmStart;
use crate::law::newton_impact::slow_approach;
use crate::solver::{SolveReport, SolverOptions};

/// Change of the contacts' impulses since the last step, as a fraction of the approach that they
/// stop, up to which they are forces.
///
/// A ball that crosses a hollow in 25 steps changes them by up to a fifth in a step. Of the energy
/// that a thousand drops of the rover onto rocks dissipate, 1.3% is lost in impacts that resemble
/// the last step's at ½, 0.4% at a fifth, 0.2% at a tenth.
pub(crate) const STEADY: f64 = 0.25;

/// Finds the contacts in impact, `ws.impact`, for the solved step.
///
/// The normal velocity before the step is measured at its predicted end, so it contains the
/// curvature of the path over ground and rim: `u_N = h a_N` with the normal acceleration `a_N`,
/// which the impulses of persistent contact balance step after step. An impact is a fast approach
/// that the last step's impulses p_k would not have stopped:
///
/// ```text
/// |u_N| > 2 |g| h   and   |(W (p − p_k))_N| > ¼ |u_N|
/// ```
///
/// The first condition saves the product where it changes nothing: an approach of the order of h is
/// harmless. `ws.y` and `ws.p_position` are overwritten.
pub(super) fn find_impacts<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    let d = S::DIMENSION.components();
    let slow = slow_approach(options.gravity.norm(), options.time_step);
    let is_fast = |(u, contact): (&[f64], &S::Contact)| u[0].abs() * system.lever(contact) > slow;
    ws.impact.clear();
    let local = ws.u_before.chunks_exact(d).zip(&ws.contacts);
    ws.impact.extend(local.map(is_fast));
    if !ws.impact.contains(&true) {
        return;
    }
    ws.p_position.resize(ws.p.len(), 0.0);
    warm_start.recall(&ws.contacts, d, &mut ws.p_position);
    for (change, p) in ws.p_position.iter_mut().zip(&ws.p) {
        *change = p - *change;
    }
    ws.y.fill(0.0);
    system.add_impulses(&ws.p_position, &mut ws.y);
    ws.u_position.resize(ws.p.len(), 0.0);
    system.local(&ws.y, &mut ws.u_position);
    let local = (ws.u_position.chunks_exact(d)).zip(ws.u_before.chunks_exact(d));
    for (impact, (change, before)) in ws.impact.iter_mut().zip(local) {
        *impact &= change[0].abs() > STEADY * before[0].abs();
    }
}

/// Work of the contacts over the solved step by their law, J: friction and impacts.
///
/// The normal reaction of persistent contact and friction that sticks do no work. Friction takes
/// `½ (p_k·u_k + p·u⁺)` by the trapezoidal rule, with the last step's impulses p_k and the slip
/// velocities u_k at the start and u⁺ at the end; only their sum `p_k·u_k = v·(H p_k)` is known at
/// the start. A change of p is charged with the velocity before the step. An impact takes `p·(u +
/// u⁺)/2`, by its law of restitution and friction. While a contact is new, in impact or yields, the
/// friction of the others counts with its value at the end. That of one that yields is the work of
/// its slip, and of the deflection that leaves it with the tread.
///
/// Call it after [`find_impacts`]; `ws.p_position` is overwritten. `group`: whose contacts.
pub(super) fn contact_work<S: MechanicalSystem>(
    system: &S,
    v_before: &[f64],
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
    group: usize,
) -> f64 {
    let d = S::DIMENSION.components();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    ws.p_position.resize(ws.p.len(), 0.0);
    let groups = &ws.groups;
    let is_own = |i: &usize| groups.of_contact(*i) == group;
    let own = || (0..ws.contacts.len()).filter(is_own);
    let soft = |i: usize| ws.yielding.get(i).filter(|law| law.is_soft());
    let is_smooth = |i: usize| !ws.impact[i] && soft(i).is_none();
    if groups.group(group).persists && own().all(is_smooth) {
        warm_start.recall(&ws.contacts, d, &mut ws.p_position);
        let friction = own().map(|i| {
            let at = d * i + 1..d * (i + 1);
            let (p, u) = (&ws.p[at.clone()], &ws.u[at.clone()]);
            let (before, last) = (&ws.u_before[at.clone()], &ws.p_position[at]);
            dot(p, u) + dot(p, before) - dot(last, before)
        });
        let friction = friction.sum::<f64>();
        let is_own = |k: &usize| groups.of_cluster(system.cluster_of_velocity(*k)) == group;
        let start = (0..v_before.len()).filter(is_own);
        let start = start.map(|k| v_before[k] * warm_start.persistent[k]);
        0.5 * (friction + start.sum::<f64>())
    } else {
        let works = own().map(|i| {
            let at = d * i..d * (i + 1);
            let (p, u) = (&ws.p[at.clone()], &ws.u[at.clone()]);
            match soft(i) {
                _ if ws.impact[i] => 0.5 * (dot(p, u) + dot(p, &ws.u_before[at])),
                Some(law) => law.slip_work([u[0], u[1], u[d - 1]], [p[0], p[1], p[d - 1]]),
                None => dot(&p[1..], &u[1..]),
            }
        });
        works.sum()
    }
}

/// Contact Jacobian, operator, velocity before the step and the solver's starting point, at the end
/// pose.
///
/// Newton's law refers to `v_before`, the velocity before the step.
pub(super) fn assemble_contacts<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    v_before: &[f64],
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    let d = S::DIMENSION.components();
    let n = ws.contacts.len();
    for local in [&mut ws.u_before, &mut ws.q_free, &mut ws.p, &mut ws.u] {
        local.resize(d * n, 0.0);
    }
    set_friction(system, options, &ws.contacts, &mut ws.mu);
    system.assemble(&ws.contacts, v_before, &mut ws.u_before);
    let yields = system.compliant_mass(0).is_some();
    ws.yielding.clear();
    ws.bounces.clear();
    warm_start.recall(&ws.contacts, d, &mut ws.p);
    if yields {
        yield_under_load(system, options, warm_start, ws);
    }
}

/// Computes the yielding law of every contact and adds its part to W.
///
/// `ws.p` holds the impulses of the last step, and `ws.v` the velocity that led to the end pose.
/// Where a cluster remembers no contact, each of its contacts may bear its weight.
///
/// A contact with restitution is rigid in the step in which it closes, and Newton's law bounces it.
/// Its impulse says nothing of a deflection: `ws.bounces`, it is not remembered.
fn yield_under_load<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    let d = S::DIMENSION.components();
    let step = (options.time_step, options.theta);
    ws.q_free.fill(0.0);
    system.add_local_of_velocity(&ws.contacts, &ws.v, &mut ws.q_free);
    for (i, contact) in ws.contacts.iter().enumerate() {
        let mut before = [0.0; 3];
        before[..d].copy_from_slice(&ws.p[d * i..][..d]);
        let is_new = before[0] == 0.0;
        let shift = |u_N| system.normal_shift(options, contact, u_N);
        let bounces = is_new && shift(1.0) > shift(0.0);
        let compliance = system.compliance(contact, &ws.v);
        ws.bounces.push(bounces && compliance.is_some());
        let law = compliance.filter(|_| !bounces).map(|compliance| {
            let [cluster, _] = system.clusters_of(&contact.key());
            let mut known = warm_start.impulses.iter();
            let is_known = known.any(|(key, _)| system.clusters_of(key).contains(&cluster));
            let mass = system.compliant_mass(cluster).unwrap_or(0.0);
            let unknown = (!is_known, mass * options.gravity.norm() * options.time_step);
            compliance.over(step, contact.gap(), ws.q_free[d * i], before, unknown)
        });
        ws.yielding.push(law.unwrap_or_default());
    }
    system.soften(ws.yielding.iter().map(|law| law.diagonal));
}

/// Shift of a contact's free velocity, m/s: that of its compliance, or of the impact law.
pub(super) fn shift<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &ScratchOf<S>,
    i: usize,
) -> [f64; 3] {
    match ws.yielding.get(i) {
        Some(law) if law.is_soft() => law.shift,
        _ => {
            let before = ws.u_before[S::DIMENSION.components() * i];
            [
                system.normal_shift(options, &ws.contacts[i], before),
                0.0,
                0.0,
            ]
        }
    }
}

/// What a contact yields along n, t, b under an impulse of 1 N s, m/s.
pub(super) fn softness<Q, C>(ws: &Scratch<Q, C>, i: usize) -> [f64; 3] {
    ws.yielding.get(i).map_or([0.0; 3], |law| law.diagonal)
}

/// μ of every contact.
pub(super) fn set_friction<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    contacts: &[S::Contact],
    mu: &mut Vec<f64>,
) {
    mu.clear();
    mu.extend(
        contacts
            .iter()
            .map(|contact| system.friction_coefficient(options, contact)),
    );
}

/// Adds the deferred correction r to `ws.y` in the groups whose contacts are those of the last step
/// and persisted.
///
/// `ws.p` must still hold the last step's impulses.
pub(super) fn add_correction<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    if !ws.groups.any_persists() {
        return;
    }
    let share = 1.0 - options.theta;
    system.generalized_impulse(&ws.contacts, &ws.p, &mut ws.correction);
    for (k, r) in ws.correction.iter_mut().enumerate() {
        let group = ws.groups.of_cluster(system.cluster_of_velocity(k));
        *r = if ws.groups.group(group).persists {
            share * (warm_start.persistent[k] - *r)
        } else {
            0.0
        };
    }
    system.half_solve(&mut ws.correction);
    for (y, r) in ws.y.iter_mut().zip(&ws.correction) {
        *y += r;
    }
}

/// `ws.p_position`: the last step's impulses `ws.p` of the contacts that persist, 0 of the others.
pub(super) fn take_persistent<S: MechanicalSystem>(ws: &mut ScratchOf<S>) {
    let d = S::DIMENSION.components();
    ws.p_position.clone_from(&ws.p);
    for (i, p) in ws.p_position.chunks_exact_mut(d).enumerate() {
        if !ws.groups.group(ws.groups.of_contact(i)).persists {
            p.fill(0.0);
        }
    }
}

/// Solves the assembled contacts for the free change `ws.y` (factor coordinates) from `ws.v`, and
/// adds the total change `ws.dv` to `ws.v`.
///
/// Newton's law of restitution with friction may have no solution: a wheel held by friction between
/// two slopes cannot leave both. If the solver finds none, the impact is taken as inelastic. That
/// problem always has a solution, since rest is admissible on ground at rest.
///
/// Starts from `ws.p`, or without a warm start from zero. `v_begin`: the velocity before the step.
/// `is_from_start`: `ws.v` is still that velocity, whose local velocity is known.
pub(super) fn solve_contacts<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    v_begin: &[f64],
    ws: &mut ScratchOf<S>,
    is_from_start: bool,
    probe: &mut dyn Probe,
) -> StepReport {
    let d = S::DIMENSION.components();
    let n = ws.contacts.len();
    let mut report = StepReport {
        n_contacts: n,
        immovable_contacts: (0..n).filter(|i| system.is_immovable(*i)).count(),
        ..StepReport::default()
    };
    system.close_velocity(options, v_begin, &ws.v, &mut ws.y);
    if !options.warm_start {
        ws.p.fill(0.0);
    }
    if n > 0 {
        system.local(&ws.y, &mut ws.q_free);
        if is_from_start {
            for (q, u) in ws.q_free.iter_mut().zip(&ws.u_before) {
                *q += u;
            }
        } else {
            system.add_local_of_velocity(&ws.contacts, &ws.v, &mut ws.q_free);
        }
        add_shifts(system, (options, 1.0), ws, |_| true);
        ws.island.forget_answers();
        solve_problems(system, options, ws, |_| true);
        let mut law = options;
        let inelastic;
        let is_unsolved = ws.groups.all().any(|own| !own.is_solved);
        if is_unsolved && options.is_elastic() && system.solves_to_the_end() {
            inelastic = StepOptions {
                restitution: 0.0,
                materials: options.materials.inelastic(),
                ..options.clone()
            };
            law = &inelastic;
            for number in 0..ws.groups.n() {
                let own = ws.groups.group_mut(number);
                own.is_inelastic = !own.is_solved;
            }
            add_shifts(system, (options, -1.0), ws, |own| own.is_inelastic);
            add_shifts(system, (law, 1.0), ws, |own| own.is_inelastic);
            for (i, p) in ws.p.chunks_exact_mut(d).enumerate() {
                if ws.groups.group(ws.groups.of_contact(i)).is_inelastic {
                    p.fill(0.0);
                }
            }
            solve_problems(system, options, ws, |own| own.is_inelastic);
            report.retaken = 1;
        }
        // u contains the shift and what the contacts yield: remove both.
        for i in 0..n {
            let is_inelastic = ws.groups.group(ws.groups.of_contact(i)).is_inelastic;
            let shift = shift(system, if is_inelastic { law } else { options }, ws, i);
            let softness = softness(ws, i);
            for (k, (shift, softness)) in (d * i..d * (i + 1)).zip(shift.into_iter().zip(softness))
            {
                ws.u[k] -= shift + softness * ws.p[k];
            }
        }
        ws.island.enter_answers(&mut report);
        system.add_impulses(&ws.p, &mut ws.y);
        system.add_moments(&mut ws.y);
        probe.end(Phase::Solve);
    }
    ws.half_solve_back(|y| system.half_solve_back(y));
    for (v, dv) in ws.v.iter_mut().zip(&ws.dv) {
        *v += dv;
    }
    report
}

/// Adds the impact law's shift, times a sign, to the normal free velocities `ws.q_free` of some
/// groups.
fn add_shifts<S: MechanicalSystem>(
    system: &S,
    (options, sign): (&StepOptions, f64),
    ws: &mut ScratchOf<S>,
    is_meant: impl Fn(&Group) -> bool,
) {
    let d = S::DIMENSION.components();
    for i in 0..ws.contacts.len() {
        if !is_meant(ws.groups.group(ws.groups.of_contact(i))) {
            continue;
        }
        let shift = shift(system, options, ws, i);
        for (q, shift) in ws.q_free[d * i..][..d].iter_mut().zip(shift) {
            *q += sign * shift;
        }
    }
}

/// Solves the assembled problems of some groups from `ws.p` and charges the step's budget.
fn solve_problems<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
    is_meant: impl Fn(&Group) -> bool,
) {
    let are_several = ws.groups.are_several();
    for number in 0..ws.groups.n() {
        let own = ws.groups.group(number);
        if !ws.groups.is_group(number) || own.n_contacts == 0 || !is_meant(own) {
            continue;
        }
        let solved = if are_several {
            solve_group(system, &options.solver, ws, number, Level::Velocity)
        } else {
            None
        };
        let solved = solved.unwrap_or_else(|| solve_problem(system, options, ws));
        ws.groups.group_mut(number).is_solved = solved.is_converged();
        ws.island.keep_answer(number, solved);
    }
}

/// Solves the assembled problem from `ws.p` and charges the step's budget. Impulses that the motion
/// leaves open are those of least norm.
fn solve_problem<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
) -> SolveReport {
    let solver_options = ws.solver_options(&options.solver);
    let mut solved = system.solve_step(
        (&ws.v, &ws.y),
        (&ws.q_free, &ws.mu),
        &solver_options,
        &mut ws.p,
        &mut ws.u,
        &mut ws.solver,
    );
    ws.work_spent += solved.work;
    if solved.is_converged()
        && !ws.leaves_open
        && let Some(problem) = system.open_problem(&ws.q_free, &ws.mu)
    {
        let tolerance = options.solver.tolerance;
        let redundancy = &mut ws.redundancy;
        settle(
            redundancy,
            &problem,
            tolerance,
            &mut solved,
            (&mut ws.p, &mut ws.u),
        );
    }
    solved
}

/// `q⁺ = q_m ⊕ θ h v⁺` for the velocity `ws.v`, and the gaps there.
pub(super) fn place<S: MechanicalSystem>(system: &S, options: &StepOptions, ws: &mut ScratchOf<S>) {
    let share = options.theta * options.time_step;
    system.set_moved(&ws.middle, &ws.v, share, &mut ws.end);
    ws.gap_end.clear();
    let d = S::DIMENSION.components();
    let local = ws.u.chunks_exact(d).zip(ws.u_before.chunks_exact(d));
    let moved = |(contact, (u, before)): (&S::Contact, (&[f64], &[f64]))| {
        contact.gap() + share * (u[0] - before[0])
    };
    ws.gap_end.extend(ws.contacts.iter().zip(local).map(moved));
    excuse_gaps(system, ws);
}

/// Closes the loops at the end of the step, `ws.end` and `ws.v`.
pub(super) fn close_end<S: MechanicalSystem>(
    system: &mut S,
    ws: &mut ScratchOf<S>,
    report: &mut StepReport,
) {
    let gap = system.close_end(&ws.p, &mut ws.end, &mut ws.v);
    report.enter_loops(gap);
}

/// Leaves in `ws.gap_end` only the penetration that can be removed: where contacts yield, what no
/// elastic force explains, and nothing of contacts that cannot move.
pub(super) fn excuse_gaps<S: MechanicalSystem>(system: &S, ws: &mut ScratchOf<S>) {
    for (gap, law) in ws.gap_end.iter_mut().zip(&ws.yielding) {
        if law.is_soft() {
            *gap = law.unexplained;
        }
    }
    for (i, gap) in ws.gap_end.iter_mut().enumerate() {
        if system.is_immovable(i) {
            *gap = 0.0;
        }
    }
}

/// Solves the contacts of a group, as [`super::contacting::Contacting::solve`] does those of all.
///
/// The answer is the same without the other groups. Its options are those of a problem of its size.
pub(super) fn solve_group<S: MechanicalSystem>(
    system: &S,
    options: &SolverOptions,
    ws: &mut ScratchOf<S>,
    group: usize,
    level: Level,
) -> Option<SolveReport> {
    let island = &mut ws.island;
    island.contacts.clear();
    let groups = &ws.groups;
    (island.contacts).extend((0..ws.mu.len()).filter(|&i| groups.of_contact(i) == group));
    let budget = options.budget_of(island.contacts.len());
    let spent = island.spent.get(group).copied().unwrap_or(0);
    let options = SolverOptions {
        budget: Some(left_of(budget, spent)),
        ..*options
    };
    let (p, u) = match level {
        Level::Velocity => (&mut ws.p, &mut ws.u),
        Level::Position(_) => (&mut ws.p_position, &mut ws.u_position),
    };
    let problem = system.problem(&ws.q_free, &ws.mu);
    let compliance = match level {
        Level::Velocity => 0.0,
        Level::Position(compliance) => compliance,
    };
    let is_settled = matches!(level, Level::Velocity)
        && !ws.leaves_open
        && system.open_problem(&ws.q_free, &ws.mu).is_some();
    let redundancy = is_settled.then_some(&mut ws.redundancy);
    let report = island.solve(
        &problem,
        compliance,
        &options,
        [p, u],
        &mut ws.solver,
        redundancy,
    )?;
    if let Some(own) = island.spent.get_mut(group) {
        *own += report.work;
    }
    ws.work_spent += report.work;
    Some(report)
}
