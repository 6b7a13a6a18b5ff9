//! Energy audit: a step may gain no more energy than gravity and the actuators supply.
//!
//! ```text
//! excess = (K + V)(q⁺, v⁺) − (K + V)(q, v) − W
//! ```
//!
//! W is the work of torques, motors, held joints, springs and dampers. Inelastic contact with
//! friction only dissipates, so a positive excess is an error of the scheme. Its sources are the
//! linearisation (third order in the step), a solver that stopped early, and Newton's law of
//! restitution, which creates energy in some impacts with friction (Kane's paradox).
//!
//! - After a coarse excess the step is repeated, with implicit gyroscopic terms and then in halves.
//! - The remaining excess is removed by scaling the velocity, `v⁺ ← s v⁺`. Signorini's condition at
//!   e = 0 and Coulomb's law are homogeneous in the velocity, so both still hold. With restitution
//!   the rebounds are slower than Newton's law says, which the report's residual contains.
//! - Clusters that touch each other are judged together, and apart from all others
//!   ([`super::grouped`]): neither energies nor corrections of other groups count.
//! - Where nothing outside touches a group only the motion relative to its mass centre is scaled,
//!   so the linear momentum is kept. Contacts among its own parts feel relative velocities alone.
//!   Free flight conserves energy too: without any contact s may be above 1.
//! - If even v⁺ = 0 leaves an excess, the displacement is shortened too: a contact ended the motion
//!   within the step ([`super::shortening`]).
//!
//! The correction is of the order of the excess, so the scheme keeps its order. Position projection
//! follows the audit; it keeps the kinetic energy (`carried_velocity`), and its work is counted
//! separately.
//!
//! What the scheme itself takes from the motion or adds to it is the rest of the balance
//! ([`super::work`]), with the work of friction and impacts by their law ([`super::impacts`]) and
//! what contacts that yield release ([`super::yielding`]).
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::balance::{AuditLimits, Balance, Conditions, Correction, Energies, select_both};
use super::data::{DataOf, Obstacle};
use super::dynamics::Dynamics;
use super::forces::{Forces, StepStart};
use super::grouped::Grouped;
use super::local::Local;
use super::systems::Systems;
use super::work::Work;
use super::yielding::find_tread_energies;
use crate::scalar::{Lane, LaneMask, Vec3, inlined};

/// Finds the energies at the start of a step where they are not known.
pub(crate) fn note_energies<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let is_new = d.is_new;
    if is_new.any() && s.machine().is_audited() {
        let before = &mut d.energies.before;
        let machine = s.machine_mut();
        machine.energies(&d.options, &d.start, &d.v, |cluster, energy, _| {
            before[cluster] = select_both(is_new, energy, before[cluster]);
        });
    }
    d.is_new = S::T::mask(d.token, 0);
}

/// Judges `d.v_end` and `d.end`, group by group: lanes of which a group does not balance fall back,
/// groups with a little too much energy are corrected.
pub(super) fn judge<S: Systems>(s: &mut S, d: &mut DataOf<S>, problems: &S::Problems) {
    if !s.machine().is_audited() {
        find_work(s, d);
        return;
    }
    find_energies_and_work(s, d);
    let token = d.token;
    let is_corrected = inlined!(S::run, token, {
        let (is_lost, is_corrected) = audit(s, d, AuditLimits::USUAL, |_| S::T::mask(token, 0));
        if is_corrected.any() {
            correct(s, d, problems);
        }
        d.fall_back(Obstacle::Energy, is_lost);
        is_corrected
    });
    if is_corrected.any() {
        find_energies(s, d);
    }
    inlined!(S::run, token, {
        for balance in &d.balances {
            balance.report(&mut d.reports);
        }
    });
}

/// Energies at the end of the step, and the work of the systems' own forces.
pub(super) fn find_energies_and_work<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    find_energies(s, d);
    find_work(s, d);
}

/// The work of the systems' own forces.
pub(super) fn find_work<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let start = StepStart::at(&d.start, &d.v[..]);
    let work = &mut d.energies.of_drives;
    work.fill(Work::none(S::T::splat(d.token, 0.0)));
    s.machine_mut().work(&d.options, start, &d.v_end, work);
}

/// Energies and momenta at the end of the step, of clusters and of groups.
pub(super) fn find_energies<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let mut own = std::mem::take(&mut d.energies);
    let none = Vec3::splat(d.token, [0.0; 3]);
    let (balances, is_held) = (&mut d.balances, &d.is_held);
    let machine = s.machine_mut();
    machine.energies(&d.options, &d.end, &d.v_end, |cluster, energy, momentum| {
        own.after[cluster] = energy;
        balances[cluster].momentum = if is_held[cluster] { none } else { momentum };
    });
    for (balance, (before, after)) in balances.iter_mut().zip(own.before.iter().zip(&own.after)) {
        (balance.before, balance.after) = (*before, *after);
    }
    if s.contacts().joined() != 0 {
        let number = &mut own.number;
        gather(s, balances, number, |own| &mut own.before[0]);
        gather(s, balances, number, |own| &mut own.before[1]);
        gather(s, balances, number, |own| &mut own.after[0]);
        gather(s, balances, number, |own| &mut own.after[1]);
        gather(s, balances, number, |own| &mut own.momentum.x);
        gather(s, balances, number, |own| &mut own.momentum.y);
        gather(s, balances, number, |own| &mut own.momentum.z);
        each_held(s, is_held, |leader, lane| {
            balances[leader].momentum.set(lane, [0.0; 3]);
        });
    }
    d.energies = own;
}

/// Calls `each(leader, lane)` for the groups of touching clusters of which one passes its momentum
/// on to the world.
pub(super) fn each_held<S: Systems>(s: &S, is_held: &[bool], mut each: impl FnMut(usize, usize)) {
    let contacts = s.contacts();
    for cluster in (0..is_held.len()).filter(|own| is_held[*own]) {
        for lane in (0..S::T::LANES).filter(|lane| contacts.joined() >> lane & 1 == 1) {
            each(contacts.leader(cluster, lane), lane);
        }
    }
}

/// Sums a number over each group.
fn gather<S: Systems>(
    s: &S,
    balances: &mut [Balance<S::T>],
    numbers: &mut [S::T],
    of: impl Fn(&mut Balance<S::T>) -> &mut S::T,
) {
    for (number, balance) in numbers.iter_mut().zip(&mut *balances) {
        *number = *of(balance);
    }
    s.contacts().gather(numbers);
    for (number, balance) in numbers.iter().zip(balances) {
        *of(balance) = *number;
    }
}

/// Balances the energies that were found. Returns the lanes of which a group must take its step
/// otherwise, and those of which one is to be corrected. `last`: by leader, lanes with no other way
/// to take it.
#[inline(always)]
pub(super) fn audit<S: Systems>(
    s: &mut S,
    d: &mut DataOf<S>,
    limits: AuditLimits,
    last: impl Fn(usize) -> <S::T as Lane>::Mask,
) -> (<S::T as Lane>::Mask, <S::T as Lane>::Mask) {
    let mut own = std::mem::take(&mut d.energies);
    let [before, after] = &mut own.stored;
    for (q, stored) in [(&d.start, before), (&d.end, after)] {
        stored.fill(S::T::splat(d.token, 0.0));
        s.machine().stored(q, stored);
    }
    for (c, balance) in d.balances.iter_mut().enumerate() {
        balance.work = own.of_drives[c];
        balance.stored = own.stored[1][c] - own.stored[0][c];
    }
    if s.contacts().joined() != 0 {
        let (number, balances) = (&mut own.number, &mut d.balances[..]);
        gather(s, balances, number, |own| &mut own.work.supplied);
        gather(s, balances, number, |own| &mut own.work.damped);
        gather(s, balances, number, |own| &mut own.work.of_springs);
        gather(s, balances, number, |own| &mut own.stored);
    }
    find_tread_energies(s, d, &mut own);
    for (cluster, mass) in own.mass.iter_mut().enumerate() {
        *mass = s.machine().mass(cluster).unwrap_or(d.number(0.0));
    }
    s.contacts().find_touch(&mut own.in_touch);
    s.contacts().find_ground(&mut own.on_ground);
    s.contacts().gather(&mut own.mass);
    let nobody = S::T::mask(d.token, 0);
    let (mut is_lost, mut is_corrected) = (nobody, nobody);
    for c in 0..d.balances.len() {
        let conditions = conditions(s, d, &own, c);
        let going = d.going & s.contacts().leads(c);
        let balance = &mut d.balances[c];
        balance.audit(own.released[c], &conditions, limits, [going, last(c)]);
        is_lost = is_lost | balance.is_lost;
        is_corrected = is_corrected | balance.is_corrected;
    }
    d.energies = own;
    (is_lost, is_corrected)
}

/// What a group is judged by.
#[inline(always)]
fn conditions<S: Systems>(
    s: &S,
    d: &DataOf<S>,
    own: &Energies<S::T>,
    c: usize,
) -> Conditions<S::T> {
    let conserves = d.options.theta <= 0.5;
    Conditions {
        mass: own.mass[c],
        fall: s.gravity().norm() * d.step().0,
        untouched: !own.on_ground[c],
        is_free: if conserves {
            !own.in_touch[c]
        } else {
            S::T::mask(d.token, 0)
        },
    }
}

/// Corrects the velocities of groups, and the local ones.
pub(super) fn correct<S: Systems>(s: &mut S, d: &mut DataOf<S>, problems: &S::Problems) {
    let found = d.balances.iter().enumerate();
    let mut all: Vec<Correction<S::T>> = found
        .map(|(c, balance)| balance.correction(&conditions(s, d, &d.energies, c)))
        .collect();
    for lane in 0..S::T::LANES {
        for cluster in 0..all.len() {
            let leader = s.contacts().leader(cluster, lane);
            if leader != cluster {
                let other = all[leader];
                all[cluster].take(d.token, lane, &other);
            }
        }
    }
    for (v, (cluster, axis)) in (d.v_end.iter_mut()).zip(d.cluster_of.iter().zip(&d.axis_of)) {
        *v = all[*cluster].apply(*axis, *v);
    }
    note_violations(s, d, problems, &all);
    let lanes: Vec<_> = all.iter().map(|own| own.lanes).collect();
    let shares: Vec<S::T> = all.iter().map(|own| own.share).collect();
    for place in s.contacts().used() {
        let shortened = s.contacts().mask_of(place, &lanes);
        let share = s.contacts().number_of(place, &shares);
        for k in 0..S::Local::N {
            let u = &mut d.u[place][k];
            *u = S::T::select(shortened, *u * share, *u);
        }
    }
}

/// Enters in the reports how far the corrections of the velocity violate the law of restitution: a
/// closed contact that is to rebound at u_N separates at a share of it. At e = 0 a rigid contact
/// has u_N = 0, and the law holds.
fn note_violations<S: Systems>(
    s: &S,
    d: &mut DataOf<S>,
    problems: &S::Problems,
    corrections: &[Correction<S::T>],
) {
    if !d.options.is_elastic() {
        return;
    }
    for (cluster, own) in corrections.iter().enumerate() {
        for lane in (0..S::T::LANES).filter(|lane| own.lanes.get(*lane)) {
            let Some([lost, free]) = s.norms(problems, (cluster, lane), &d.u) else {
                continue;
            };
            let violation = (1.0 - own.share.get(lane)) * f64::sqrt(lost);
            if violation > 0.0 {
                let size = f64::sqrt(free).max(f64::MIN_POSITIVE);
                let report = &mut d.reports[lane];
                report.residual = report.residual.max(violation / size);
            }
        }
    }
}
