//! Removal of penetration: projection of the position onto gap ≥ 0 (combined scheme).
//!
//! The displacement solves a friction-contact problem at position level with the operator of the
//! step: `d = W λ + (gap, 0, 0)`, `0 ≤ d_N ⊥ λ_N ≥ 0`, and Coulomb's law on the tangential
//! displacement. Friction prevents the correction from shifting a parked rover down its slope. The
//! projection runs only if penetration exceeds `penetration_tolerance`, and it skips a contact that
//! is bouncing off and will have separated after the next step. The velocity is scaled to the
//! kinetic energy before the projection (`carried_velocity`).
//!
//! Source: Acary 2013, *Projected event-capturing time-stepping schemes for nonsmooth mechanical
//! systems with unilateral contact and Coulomb's friction*, CMAME 256, 224–250.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::audit::each_held;
use super::balance::select_both;
use super::carried_velocity::{Carried, EnergyMomentum};
use super::closing::close_end;
use super::data::{DataOf, Obstacle};
use super::dynamics::Dynamics;
use super::forces::{Forces, StepStart};
use super::grouped::Grouped;
use super::local::Local;
use super::systems::{MaskOf, Systems};
use crate::scalar::{Lane, LaneMask, Vec3, inlined};

/// Largest displacement, as a multiple of the deepest penetration; the rest is left to the next
/// steps.
///
/// Friction locks a wheel that an impact left wedged between a stone and the ground. The solution
/// of the linearised problem may then lie a metre away: without this limit a penetration of 2 cm
/// threw a rover up by that much.
pub(super) const FARTHEST: f64 = 4.0;

/// Predicts the gaps at the end of the step; true if the position of a group must be projected.
#[inline(always)]
pub(super) fn measure<S: Systems>(s: &S, d: &mut DataOf<S>) -> bool {
    let zero = d.number(0.0);
    let mut deepest = std::mem::take(&mut d.deepest);
    deepest.fill(zero);
    for place in s.contacts().used() {
        let mut gap = gap_at_end(s, d, place);
        if let Some(lever) = s.lever(place) {
            gap *= lever;
        }
        s.contacts().lower(place, gap, &mut deepest);
    }
    s.contacts().spread_least(&mut deepest);
    d.deepest = deepest;
    let mut least = std::mem::take(&mut d.energies.number);
    for (cluster, least) in least.iter_mut().enumerate() {
        *least = zero.like(s.machine().tolerated(&d.options, cluster));
    }
    s.contacts().spread_least(&mut least);
    let mut is_any = false;
    let limits = d.deepest.iter().zip(&least);
    for (is_deep, (deepest, tolerated)) in d.is_deep.iter_mut().zip(limits) {
        *is_deep = deepest.lt(-*tolerated) & d.going;
        is_any |= is_deep.any();
    }
    d.energies.number = least;
    is_any
}

/// Gap of a place after the step, m; 0 where it is negative and opening, or nothing can open it.
#[inline(always)]
fn gap_at_end<S: Systems>(s: &S, d: &DataOf<S>, place: usize) -> S::T {
    let (h, theta) = d.step();
    let zero = h.like(0.0);
    let (u, before) = (d.u[place][0], s.u_before()[place][0]);
    let mut gap = s.contacts().gap(place);
    if !d.is_at_end {
        gap += theta * h * (u - before);
    }
    if !d.shares.is_empty() {
        let left = zero.like(1.0) - s.contacts().number_of(place, &d.shares);
        gap -= left * h * (theta * u + (zero.like(1.0) - theta) * before);
    }
    if !d.laws.is_empty() {
        let law = &d.laws[place];
        gap = S::T::select(law.is_soft(), law.unexplained, gap);
    }
    let parts = gap.lt(zero) & !(gap + h * u).lt(zero);
    let gap = S::T::select(parts | s.immovable(place), zero, gap);
    S::T::select(s.contacts().active(place), gap, zero)
}

/// Turns the problems into those of the position projection; none where nothing penetrates.
pub(crate) fn set_gaps<S: Systems>(s: &mut S, d: &mut DataOf<S>, problems: &mut S::Problems) {
    inlined!(S::run, d.token, {
        let zero = d.number(0.0);
        for place in s.contacts().used() {
            let mut gap = S::Local::splat(zero);
            gap[0] = gap_at_end(s, d, place);
            d.gaps[place] = gap;
            d.pushes[place] = S::Local::splat(zero);
        }
        s.pose_gaps(&d.gaps, &d.is_deep, &mut d.pushes, problems);
    });
}

/// Moves the penetrating lanes by the displacement that the problems found.
pub(super) fn project<S: Systems>(s: &mut S, d: &mut DataOf<S>, problems: &mut S::Problems) {
    let mut farthest = std::mem::take(&mut d.energies.number);
    farthest.fill(d.number(0.0));
    let (reports, is_deep) = (&mut d.reports, &d.is_deep);
    let unsolved = s.take_displacements(
        &d.options,
        d.going,
        problems,
        is_deep,
        reports,
        &mut farthest,
    );
    d.energies.number = farthest;
    d.fall_back(Obstacle::Projection, unsolved);
    let stored = &mut d.energies.stored[0];
    stored.fill(S::T::splat(d.token, 0.0));
    s.machine().stored(&d.end, stored);
    inlined!(S::run, d.token, displace(s, d, problems));
    close_moved(s, d, d.any(&d.is_deep) & d.going);
    carry_velocity(s, d);
}

#[inline(always)]
fn displace<S: Systems>(s: &mut S, d: &mut DataOf<S>, problems: &S::Problems) {
    let zero = d.number(0.0);
    let mut farthest = std::mem::take(&mut d.energies.number);
    s.contacts().spread(&mut farthest);
    s.read_pushes(problems, &mut d.pushes);
    if d.n_clusters() > 1 {
        for place in s.contacts().used() {
            let is_deep = s.contacts().mask_of(place, &d.is_deep);
            for k in 0..S::Local::N {
                let push = &mut d.pushes[place][k];
                *push = S::T::select(is_deep, *push, zero);
            }
        }
    }
    d.y.fill(zero);
    s.add_impulses(d.any(&d.is_deep), &d.pushes, &mut d.y);
    s.machine().half_solve_back(&mut d.y);
    for (cluster, farthest) in farthest.iter_mut().enumerate() {
        *farthest = s.machine().displacement(&d.y, cluster).max(*farthest);
    }
    if d.is_last {
        shorten(s, d, &mut farthest);
    } else {
        let mut is_far = S::T::mask(d.token, 0);
        for (cluster, (size, deepest)) in farthest.iter().zip(&d.deepest).enumerate() {
            let limit = zero.like(-FARTHEST) * *deepest;
            is_far = is_far | (!size.le(limit) & d.is_deep[cluster]);
        }
        d.fall_back(Obstacle::Projection, is_far);
    }
    d.energies.number = farthest;
    let machine = s.machine();
    machine.set_moved(&d.end, &d.y, 1.0, &mut d.middle);
    machine.normalise(&mut d.middle);
    let (is_deep, going) = (&d.is_deep, d.going);
    machine.take(|cluster| is_deep[cluster] & going, &d.middle, &mut d.end);
}

/// Leaves of the displacements `d.y` of the groups, of these sizes by cluster, what is not too far.
#[cold]
fn shorten<S: Systems>(s: &S, d: &mut DataOf<S>, sizes: &mut [S::T]) {
    let one = d.number(1.0);
    for (size, deepest) in sizes.iter_mut().zip(&d.deepest) {
        let limit = one.like(-FARTHEST) * *deepest;
        *size = (limit / *size).min(one);
    }
    s.contacts().spread_least(sizes);
    for (y, cluster) in d.y.iter_mut().zip(&d.cluster_of) {
        let moved = S::T::select(d.is_deep[*cluster], *y * sizes[*cluster], one.like(0.0));
        *y = moved;
    }
}

/// Closes the loops of the groups that were moved.
fn close_moved<S: Systems>(s: &mut S, d: &mut DataOf<S>, is_moved: MaskOf<S>) {
    if d.n_clusters() == 1 {
        close_end(s, d, is_moved);
        return;
    }
    d.middle.clone_from(&d.end);
    d.v_mean.copy_from_slice(&d.v_end);
    close_end(s, d, is_moved);
    let is_deep = &d.is_deep;
    (s.machine()).take(|cluster| !is_deep[cluster], &d.middle, &mut d.end);
    let kept = d.v_mean.iter().zip(&d.cluster_of);
    for (v, (kept, cluster)) in d.v_end.iter_mut().zip(kept) {
        *v = S::T::select(!d.is_deep[*cluster], *kept, *v);
    }
}

/// Carries the velocities of the groups that were moved to the projected position, see
/// [`super::carried_velocity`], and counts the energy that this added beyond the actuators' work on
/// the way. `energies.stored[0]`: in springs before it, J.
pub(super) fn carry_velocity<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let is_moved = d.any(&d.is_deep) & d.going;
    if !is_moved.any() || !s.machine().is_audited() {
        return;
    }
    let start = StepStart::at(&d.start, &d.v[..]);
    let work = (s.machine_mut()).work_of_displacement(&d.options, start, &d.v_end, &d.y);
    let work = work.unwrap_or(d.number(0.0));
    find_projected_energies(s, d);
    inlined!(S::run, d.token, scale_carried(s, d));
    let zero = d.number(0.0);
    let own = &mut d.energies;
    let lifted = &mut own.lifted;
    let machine = s.machine_mut();
    machine.energies(&d.options, &d.end, &d.v_end, |cluster, energy, _| {
        lifted[cluster] = energy;
    });
    let [before, after] = &mut own.stored;
    after.fill(zero);
    s.machine().stored(&d.end, after);
    let mut gained = zero;
    for (cluster, lifted) in own.lifted.iter().enumerate() {
        let lanes = d.is_deep[cluster] & d.going;
        let [kinetic, potential] = own.after[cluster];
        let stored = after[cluster] - before[cluster];
        let change = (lifted[0] - kinetic) + (lifted[1] - potential) + stored;
        gained += S::T::select(lanes, change, zero);
        own.after[cluster] = select_both(lanes, *lifted, own.after[cluster]);
    }
    let gained = gained - work;
    for (lane, report) in d.reports.iter_mut().enumerate().take(S::T::LANES) {
        if is_moved.get(lane) {
            report.energy_supplied += work.get(lane);
            report.energy_lifted += gained.get(lane).max(0.0);
            report.energy_lost += (-gained.get(lane)).max(0.0);
        }
    }
}

/// `energies.kinetic` and `energies.momentum`: kinetic energies and momenta of the groups at the
/// projected position, with the velocity before it.
fn find_projected_energies<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let mut own = std::mem::take(&mut d.energies);
    let zero = d.number(0.0);
    let is_held = &d.is_held;
    let machine = s.machine_mut();
    machine.energies(
        &d.options,
        &d.end,
        &d.v_end,
        |cluster, [kinetic, _], Vec3 { x, y, z }| {
            own.kinetic[cluster] = kinetic;
            for (sum, x) in own.momentum.iter_mut().zip([x, y, z]) {
                sum[cluster] = if is_held[cluster] { zero } else { x };
            }
        },
    );
    s.contacts().gather(&mut own.kinetic);
    for momentum in &mut own.momentum {
        s.contacts().gather(momentum);
        each_held(s, is_held, |leader, lane| momentum[leader].set(lane, 0.0));
    }
    d.energies = own;
}

#[inline(always)]
fn scale_carried<S: Systems>(s: &S, d: &mut DataOf<S>) {
    let mut own = std::mem::take(&mut d.energies);
    for (cluster, balance) in d.balances.iter().enumerate() {
        let before = EnergyMomentum {
            kinetic: balance.after[0],
            momentum: balance.momentum,
        };
        let [x, y, z] = own.momentum.each_ref().map(|all| all[cluster]);
        let after = EnergyMomentum {
            kinetic: own.kinetic[cluster],
            momentum: Vec3::new(x, y, z),
        };
        let is_alone = !own.on_ground[cluster];
        let carried = Carried::new(before, after, own.mass[cluster], is_alone);
        own.kinetic[cluster] = carried.share;
        let Vec3 { x, y, z } = carried.common;
        for (all, common) in own.momentum.iter_mut().zip([x, y, z]) {
            all[cluster] = common;
        }
    }
    s.contacts().spread(&mut own.kinetic);
    for common in &mut own.momentum {
        s.contacts().spread(common);
    }
    let (shares, commons) = (&own.kinetic, &own.momentum);
    for (v, (cluster, axis)) in (d.v_end.iter_mut()).zip(d.cluster_of.iter().zip(&d.axis_of)) {
        let lanes = d.is_deep[*cluster] & d.going;
        let mut own = shares[*cluster] * *v;
        if let Some(axis) = *axis {
            own = commons[axis][*cluster] + own;
        }
        *v = S::T::select(lanes, own, *v);
    }
    for place in s.contacts().used() {
        let lanes = s.contacts().mask_of(place, &d.is_deep) & d.going;
        let share = s.contacts().number_of(place, shares);
        for k in 0..S::Local::N {
            let u = &mut d.u[place][k];
            *u = S::T::select(lanes, *u * share, *u);
        }
    }
    d.energies = own;
}
