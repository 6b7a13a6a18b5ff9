//! A step of Moreau and Jean, written once for any `Systems`.
//!
//! Forces are evaluated at `q_m = q ⊕ (1−θ) h v` (for θ = ½ the midpoint of Moreau 1988) and
//! `v_m = v + (1−θ) Δv`, where Δv is the change due to the forces at (q_m, v) and the last step's
//! impulses. Contacts are evaluated at the predicted end `q̃ = q ⊕ h v`:
//!
//! ```text
//! M̂ (v⁺ − v) = h (τ − bias(q_m, v_m)) + H(q̃) p + r
//! M̂  = M(q_m) + h θ_j K_d + h² θ_j θ K_p on held joints
//! q⁺ = q_m ⊕ θ h v⁺
//! ```
//!
//! The contact law on `H(q̃)ᵀ v⁺` thus holds at the end of the step, where v⁺ belongs, and not half
//! a step earlier. In persistent contact the term `r = (1−θ) (H(q_k) − H(q̃)) p_k`, with the
//! impulses p_k of the step before, turns the reaction back to its mean direction over the step.
//! This correction is deferred by one step so that W stays symmetric. Without both measures the
//! path of a turning rover lags by h/2 and its speed decays with h ω²/2: the error is five times
//! larger on the flat drive of the tests.
//!
//! The PD controller of a held joint is implicit with an exponentially fitted θ_j
//! ([`crate::system::fitted_theta`]), and stable at any gain and any step. The forecast
//! `gap + γ h u_N ≤ 0`, measured from q_m, activates contacts.
//!
//! A step has three parts, between which others solve its problems: `prepare`, `conclude`,
//! `finish`. The code branches on kinds, never on the state of a lane. A lane whose step cannot
//! be taken in this way leaves the others before its state changes (`Data::fall_back`).
//!
//! Source: Moreau 1988; Jean 1999; Acary and Brogliato 2008, ch. 10.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::audit::judge;
use super::balance::{Energies, select_both};
use super::closing::close_end;
use super::data::{DataOf, Obstacle};
use super::dynamics::Dynamics;
use super::forces::Forces;
use super::grouped::Grouped;
use super::impacts::{find_contact_work, find_impacts};
use super::load::load;
use super::options::Stabilisation;
use super::probe::{Phase, Probe};
use super::projection::{measure, project};
use super::report::StepReport;
use super::systems::Systems;
use super::yielding::{forget_bounces, remove_shifts, yield_under_load};
use crate::scalar::{Lane, LaneMask, MAX_LANES, inlined};

/// What follows `conclude`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// The problems of the lanes that are retaken are solved anew, and the step is concluded again.
    Retake,
    /// Positions must be projected: `set_gaps`, then `finish`.
    Project,
    /// `finish`.
    Finish,
}

/// First part of a step: everything up to the friction-contact problems, which it poses.
pub(crate) fn prepare<S: Systems>(
    s: &mut S,
    d: &mut DataOf<S>,
    problems: &mut S::Problems,
    probe: &mut dyn Probe,
) {
    d.going = d.occupied;
    d.obstacles = [None; MAX_LANES];
    d.n_retaken = [0; MAX_LANES];
    d.shares.clear();
    inlined!(S::run, d.token, predict(s, d));
    s.machine_mut().place_middle(&d.middle);
    s.machine_mut().place_end(&d.end);
    probe.end(Phase::Kinematics);
    detect(s, d, problems);
    probe.end(Phase::Detection);
    set_up(s, d, problems, true, probe);
}

/// Configurations at the midpoint and at the predicted end.
#[inline(always)]
fn predict<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let (h, theta) = (d.options.time_step, d.options.theta);
    d.is_gyroscopic.fill(S::T::mask(d.token, 0));
    let machine = s.machine_mut();
    if let Some(turning) = machine.turning(&d.options, &d.v, &mut d.is_gyroscopic) {
        let is_fast = d.number(d.most_turn).lt(d.number(h) * turning);
        d.fall_back(Obstacle::Turning, is_fast);
    }
    machine.set_moved(&d.start, &d.v, (1.0 - theta) * h, &mut d.middle);
    machine.set_moved(&d.start, &d.v, h, &mut d.end);
}

/// Which contacts there are.
fn detect<S: Systems>(s: &mut S, d: &mut DataOf<S>, problems: &mut S::Problems) {
    let refused = s.detect(&d.options, (&d.middle, &d.end), &d.v, d.going);
    d.fall_back(Obstacle::Contact, refused);
    recall(s, d, problems);
}

/// What is known of the contacts from the last step.
pub(super) fn recall<S: Systems>(s: &mut S, d: &mut DataOf<S>, problems: &mut S::Problems) {
    d.fit_places(s.n_places(), s.yields());
    for (lane, memory) in d.memories.iter().enumerate() {
        s.recall(lane, memory, problems, &mut d.is_same);
    }
    let both = d.is_same.iter().zip(&d.has_persistent);
    for (persists, (is_same, has)) in d.persists.iter_mut().zip(both) {
        *persists = *is_same & *has;
    }
    s.contacts().intersect(&mut d.persists);
    s.contacts().unite(&mut d.is_gyroscopic);
}

/// The friction-contact problems of the contacts found, from the mass matrix on; `is_first`: unless
/// the step is taken again.
pub(crate) fn set_up<S: Systems>(
    s: &mut S,
    d: &mut DataOf<S>,
    problems: &mut S::Problems,
    is_first: bool,
    probe: &mut dyn Probe,
) {
    let machine = s.machine_mut();
    if is_first {
        inlined!(S::run, d.token, machine.choose_branches(&d.v));
    }
    machine.update_mass_matrix(&d.options, d.going, is_first);
    probe.end(Phase::MassMatrix);
    let is_definite = machine.factorise(&d.options);
    d.fall_back(Obstacle::MassMatrix, !is_definite);
    probe.end(Phase::Factor);
    s.assemble(&d.v);
    if is_first || S::RELISTS {
        inlined!(S::run, d.token, {
            s.read_start(problems, &mut d.p_last);
            yield_under_load(s, d, false);
        });
    }
    if s.yields() {
        s.soften(&d.laws);
    }
    s.close_held();
    probe.end(Phase::Delassus);
    load(s, d);
    let asked = d.asked(is_first);
    s.pose(
        &d.options,
        (&d.u, &d.y),
        &d.p_last,
        &d.is_same,
        asked,
        problems,
    );
    probe.end(Phase::Bias);
}

/// Second part of a step: the new velocity and configuration, and their energy.
pub(crate) fn conclude<S: Systems>(
    s: &mut S,
    d: &mut DataOf<S>,
    problems: &mut S::Problems,
    probe: &mut dyn Probe,
) -> Next {
    if take_answers(s, d, problems, probe) {
        return Next::Retake;
    }
    judge(s, d, problems);
    probe.end(Phase::Update);
    let is_deep = d.options.stabilisation == Stabilisation::Projection
        && inlined!(S::run, d.token, measure(s, d));
    if is_deep { Next::Project } else { Next::Finish }
}

/// The new velocity and configuration. True if the step of a lane must be taken again with another
/// branch of a force; its problems are posed then.
pub(super) fn take_answers<S: Systems>(
    s: &mut S,
    d: &mut DataOf<S>,
    problems: &mut S::Problems,
    probe: &mut dyn Probe,
) -> bool {
    let lanes = d.reports.iter_mut().take(S::T::LANES);
    for (report, retaken) in lanes.zip(d.n_retaken) {
        *report = StepReport {
            steps: 1,
            retaken,
            ..StepReport::default()
        };
    }
    let (reports, memories) = (&mut d.reports, &mut d.next_memories);
    let solved = s.take_answers(&d.options, d.going, problems, reports, memories);
    forget_bounces(s, d);
    d.fall_back(Obstacle::Solver, !solved);
    inlined!(S::run, d.token, move_on(s, d, problems));
    close_end(s, d, d.going);
    s.machine().may_revise() && revise(s, d, problems, probe)
}

#[inline(always)]
fn move_on<S: Systems>(s: &mut S, d: &mut DataOf<S>, problems: &S::Problems) {
    s.read(problems, &mut d.p, &mut d.u);
    remove_shifts(s, d);
    s.add_impulses(d.occupied, &d.p, &mut d.y);
    s.add_moments(&mut d.y);
    s.machine().half_solve_back(&mut d.y);
    for ((end, v), change) in d.v_end.iter_mut().zip(&d.v).zip(&d.y) {
        *end = *v + *change;
    }
    let share = d.options.theta * d.options.time_step;
    let machine = s.machine();
    machine.set_moved(&d.middle, &d.v_end, share, &mut d.end);
    machine.normalise(&mut d.end);
    find_impacts(s, d);
    if s.machine().is_audited() {
        find_contact_work(s, d);
    }
}

/// Where a force is on another branch, sets up the step anew; true if there is such a lane. The
/// other lanes keep their answers.
fn revise<S: Systems>(
    s: &mut S,
    d: &mut DataOf<S>,
    problems: &mut S::Problems,
    probe: &mut dyn Probe,
) -> bool {
    let mut may_revise = 0;
    for (lane, n) in d.n_retaken[..S::T::LANES].iter().enumerate() {
        may_revise |= u32::from(*n < s.machine().most_revisions(lane)) << lane;
    }
    let may_revise = S::T::mask(d.token, may_revise);
    let spent = d.going & !may_revise;
    if spent.any() {
        let unsettled = s.machine_mut().unsettled(spent, &d.v_end);
        d.fall_back(Obstacle::Sand, unsettled);
    }
    let lanes = d.going & may_revise;
    d.retaken = if lanes.any() {
        (s.machine_mut()).revise(lanes, &d.v, &d.v_end)
    } else {
        lanes
    };
    if !d.retaken.any() {
        return false;
    }
    retake(s, d, problems, probe);
    true
}

/// Poses the problems of the lanes that are retaken anew.
pub(super) fn retake<S: Systems>(
    s: &mut S,
    d: &mut DataOf<S>,
    problems: &mut S::Problems,
    probe: &mut dyn Probe,
) {
    for lane in (0..S::T::LANES).filter(|&lane| d.retaken.get(lane)) {
        d.n_retaken[lane] += 1;
        if !S::RELISTS {
            s.recall(lane, &d.memories[lane], problems, &mut d.is_same);
        }
    }
    if S::RELISTS {
        detect(s, d, problems);
    }
    set_up(s, d, problems, false, probe);
}

/// Last part of a step: projects, and makes its end the state of the lanes that are still going.
/// `problems`: those of the projection, solved, if there is one.
pub(crate) fn finish<S: Systems>(
    s: &mut S,
    d: &mut DataOf<S>,
    problems: Option<&mut S::Problems>,
    probe: &mut dyn Probe,
) {
    if let Some(problems) = problems.filter(|_| d.any(&d.is_deep).any()) {
        project(s, d, problems);
    }
    probe.end(Phase::Projection);
    inlined!(S::run, d.token, accept(s, d));
    let going = d.going.bits();
    for lane in 0..S::T::LANES {
        if going >> lane & 1 == 1 {
            std::mem::swap(&mut d.memories[lane], &mut d.next_memories[lane]);
        }
    }
}

/// Makes the end of the step the state of the lanes that are still going.
#[inline(always)]
fn accept<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let mut is_finite = s.machine().is_finite(&d.end);
    for v in &d.v_end {
        is_finite = is_finite & v.is_finite();
    }
    d.fall_back(Obstacle::NotFinite, !is_finite);
    let going = d.going;
    remember_persistence(s, d);
    s.machine().take(|_| going, &d.end, &mut d.start);
    for (v, end) in d.v.iter_mut().zip(&d.v_end) {
        *v = S::T::select(going, *end, *v);
    }
    let Energies { before, after, .. } = &mut d.energies;
    for (before, after) in before.iter_mut().zip(after) {
        *before = select_both(going, *after, *before);
    }
    let (h, _) = d.step();
    d.time = S::T::select(going, d.time + h, d.time);
    s.machine_mut().accept(going);
}

/// Keeps the generalized impulse of the contacts, and where they persisted.
#[inline(always)]
fn remember_persistence<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let going = d.going;
    let mut persists = std::mem::take(&mut d.persists);
    s.contacts().find_touch(&mut persists);
    for ((persists, same), impact) in persists.iter_mut().zip(&d.is_same).zip(&d.has_impact) {
        *persists = *persists & *same & !*impact;
    }
    s.generalized_impulse(going, &d.p, &mut d.pushed);
    for (own, pushed) in d.persistent.iter_mut().zip(&d.pushed) {
        *own = S::T::select(going, *pushed, *own);
    }
    let is_one = persists.len() == 1;
    let zero = d.number(0.0);
    for (cluster, (has, persists)) in (d.has_persistent.iter_mut().zip(&mut persists)).enumerate() {
        if !is_one {
            // As a system that leaves its lane and comes back.
            let mut is_any = going & !going;
            for (x, of) in d.persistent.iter().zip(&d.cluster_of) {
                if *of == cluster {
                    is_any = is_any | zero.lt(x.abs());
                }
            }
            *persists = *persists & is_any;
        }
        *has = (*has & !going) | (*persists & going);
    }
    d.persists = persists;
}
