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
//!   (`super::groups`): neither energies nor corrections of other groups count.
//! - Where nothing outside touches a group only the motion relative to its mass centre is scaled,
//!   so the linear momentum is kept. Contacts among its own parts feel relative velocities alone.
//!   Free flight conserves energy too: without any contact s may be above 1.
//! - If even v⁺ = 0 leaves an excess, the displacement is shortened too: a contact ended the motion
//!   within the step.
//!
//! The correction is of the order of the excess, so the scheme keeps its order. Position projection
//! follows the audit; it keeps the kinetic energy (`carried_velocity`), and its work is
//! counted separately.
//!
//! What the scheme itself takes from the motion or adds to it is the rest of the balance
//! ([`super::work`]), with the work of friction and impacts by their law
//! (`step_contacts::contact_work`) and what contacts that yield release (`law::compliance`).
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::carried_velocity::Carried;
use super::contacting::KeyOf;
use super::dynamics::MechanicalEnergy;
use super::elastic_energy::{find_stored, find_stored_after, held};
use super::excess::{Balance, Excess};
use super::forces::Start;
use super::groups::Group;
use super::mechanical_system::MechanicalSystem;
use super::options::StepOptions;
use super::report::StepReport;
use super::scratch::ScratchOf;
use super::step_contacts::{contact_work, place};
use super::warm_start::WarmStart;
use super::work::Ledger;
use crate::scalar::Vec3;

/// Largest gain in a step that is tolerated, as a fraction of the kinetic energy.
pub const GAIN: f64 = 5e-10;

/// Fraction of the kinetic energy after a step that may be removed by scaling the velocity alone.
const SHORT: f64 = 0.5;

/// Fraction of the displacement that is kept where the energy allows all of it.
const SAFE: f64 = 0.999;

/// Fraction of the displacement below which none is kept.
const LEAST_WAY: f64 = 1e-3;

/// Most times that a velocity is shortened together with its displacement.
const MOST_SHORTENINGS: usize = 8;

/// `ws.before`: the clusters' energies at the start of a step, remembered from the end of the last
/// one if the state is the same.
pub(super) fn note_energy_before<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
) {
    let known = &ws.audited;
    if !known.energies.is_empty()
        && known.v == *start.v
        && known.configuration == *start.configuration
    {
        ws.before.clone_from(&known.energies);
    } else {
        system.energies(options, start.configuration, start.v, &mut ws.before);
    }
}

/// Result of an audit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The step is accepted; its velocity may have been corrected.
    Sound,
    /// The step should be repeated.
    Coarse,
}

/// Limits of an audit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Audit<F> {
    /// Whether no safer way to take the step of a group is left.
    pub is_last: F,
    /// Fraction of the kinetic energy that may be gained, see [`GAIN`].
    pub gain: f64,
    /// Fraction of the kinetic energy that free flight may gain or lose: an error of the scheme's
    /// order that does not accumulate.
    pub drift: f64,
}

impl<F: Fn(&Group) -> bool> Audit<F> {
    /// Judges `ws.v` and `ws.end` before projection, group by group, and corrects `ws.v` where no
    /// safer way is left. It is coarse if the step of any group is.
    pub(super) fn judge<S: MechanicalSystem>(
        &self,
        system: &mut S,
        options: &StepOptions,
        start: Start<'_, S::Configuration>,
        warm_start: &WarmStart<KeyOf<S>>,
        ws: &mut ScratchOf<S>,
        report: &mut StepReport,
    ) -> Verdict {
        system.normalise(&mut ws.end);
        ws.elastic.iter_mut().for_each(Vec::clear);
        if ws.before.is_empty() {
            system.work(options, start, &ws.v, &mut ws.work);
            return Verdict::Sound;
        }
        ws.audited.energies.clear();
        find_stored(system, options, warm_start, ws);
        weigh(system, options, start, ws);
        let mut verdict = Verdict::Sound;
        let mut judged = std::mem::take(&mut ws.judged);
        let mut is_corrected = false;
        for number in 0..ws.groups.n() {
            if !ws.groups.is_group(number) {
                continue;
            }
            let by_contacts = contact_work(system, start.v, warm_start, ws, number);
            let mut found = if (self.is_last)(ws.groups.group(number)) {
                shortened_balance(system, options, start, ws, number)
            } else {
                balance::<S>(options, ws, number)
            };
            found.contact_work = by_contacts;
            match self.judge_group(system, options, start, ws, (number, &mut found), report) {
                GroupVerdict::Sound => judged.push((number, found)),
                GroupVerdict::Corrected => {
                    found.removed = found.excess.value.max(0.0);
                    judged.push((number, found));
                    is_corrected = true;
                }
                GroupVerdict::NotFinite => {}
                GroupVerdict::Coarse => {
                    verdict = Verdict::Coarse;
                    ws.groups.group_mut(number).is_coarse = true;
                }
            }
        }
        if is_corrected {
            system.energies(options, &ws.end, &ws.v, &mut ws.after);
        }
        system.stored(start.configuration, &mut ws.stored[0]);
        system.stored(&ws.end, &mut ws.stored[1]);
        for (number, found) in judged.drain(..) {
            let after = ws.groups.energy(&ws.after, number);
            let stored = ws.stored.each_ref().map(|own| ws.groups.sum(own, number));
            let ledger = Ledger {
                work: found.work,
                stored: stored[1] - stored[0],
                contact_work: found.contact_work,
                released: found.released,
                removed: found.removed,
                change: after.above(&ws.groups.energy(&ws.before, number)),
            };
            report.enter_energies(ledger.entries());
        }
        ws.judged = judged;
        ws.audited.is(&ws.end, &ws.v, &ws.after);
        verdict
    }

    /// Judges a group, and corrects its velocity if no safer way is left.
    fn judge_group<S: MechanicalSystem>(
        &self,
        system: &mut S,
        options: &StepOptions,
        start: Start<'_, S::Configuration>,
        ws: &mut ScratchOf<S>,
        (number, found): (usize, &mut Balance),
        report: &mut StepReport,
    ) -> GroupVerdict {
        let Balance { after, excess, .. } = *found;
        let own = *ws.groups.group(number);
        let is_last = (self.is_last)(&own);
        let gained = excess.value;
        if !gained.is_finite() {
            return if is_last {
                GroupVerdict::NotFinite // refused when the step ends
            } else {
                GroupVerdict::Coarse
            };
        }
        // With θ > ½ the scheme itself dissipates.
        let is_free = own.n_contacts == 0 && options.theta <= 0.5;
        if excess.is_balanced(is_free, [self.gain, self.drift]) {
            report.energy_gain = report.energy_gain.max(excess.relative());
            return GroupVerdict::Sound;
        }
        if excess.is_coarse(is_free, self.gain) && !is_last {
            return GroupVerdict::Coarse;
        }
        let nothing_outside = is_free || own.is_untouched;
        let (share, is_enough) = excess.share_of_relative_motion(after.momentum.into(), after.mass);
        let is_relative = is_enough && nothing_outside && (is_free || gained > 0.0);
        if is_relative || gained > 0.0 {
            let share = if is_relative { share } else { excess.share() };
            if options.is_elastic() && !is_free {
                report.residual = report.residual.max(violation_by::<S>(share, ws, number));
            }
            if is_relative {
                scale_relative_motion(system, ws, share, (number, &after));
            } else {
                shorten(system, ws, share, number);
            }
            if excess.is_left(self.gain) {
                hold_back(system, options, start, ws, (number, &mut *found));
            }
        }
        GroupVerdict::Corrected
    }
}

/// Result of the audit of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GroupVerdict {
    /// The step is accepted as it is.
    Sound,
    /// The step is accepted; its velocity may have been corrected.
    Corrected,
    /// The step is to be refused.
    NotFinite,
    /// The step should be repeated.
    Coarse,
}

/// Shortens the displacement of a group in a step that ends at rest and still gained energy.
///
/// Something stopped such a step before its end: the machine jammed while the actuators' work was
/// counted to the end, or a contact closed on its way up. The largest fraction σ of the
/// displacement that the energy allows is kept; σ = 0 is always allowed. The work and what contacts
/// that yield give off are those over it.
fn hold_back<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
    (number, found): (usize, &mut Balance),
) {
    let before = ws.groups.energy(&ws.before, number);
    let (h, theta) = (options.time_step, options.theta);
    let d = S::DIMENSION.components();
    ws.keep_ends(system);
    for ((mean, end), begin) in ws.v_mean.iter_mut().zip(&ws.v).zip(start.v) {
        *mean = theta * end + (1.0 - theta) * begin;
    }
    system.work(options, start, &ws.v, &mut ws.work);
    let work = ws.groups.sum(&ws.work, number);
    let mut share = 1.0;
    for k in 0..MOST_SHORTENINGS {
        system.energies(options, &ws.end, &ws.v, &mut ws.after);
        let after = ws.groups.energy(&ws.after, number);
        let excess = after.above(&before) - share * (work.total() + found.released);
        if excess <= 0.0 {
            break;
        }
        // With no displacement the excess is minus the kinetic energy; in between it is nearly
        // linear.
        let shorter = SAFE * share * before.kinetic / (excess + before.kinetic);
        let back = h * (share - shorter);
        let is_last = k + 1 == MOST_SHORTENINGS;
        share = if shorter > LEAST_WAY && !is_last {
            shorter
        } else {
            0.0
        };
        let local = ws.u.chunks_exact(d).zip(ws.u_before.chunks_exact(d));
        for (i, (gap, (u, before))) in ws.gap_end.iter_mut().zip(local).enumerate() {
            if ws.groups.of_contact(i) == number {
                *gap -= back * (theta * u[0] + (1.0 - theta) * before[0]);
            }
        }
        system.set_moved(start.configuration, &ws.v_mean, share * h, &mut ws.end);
        system.close_end(&ws.p, &mut ws.end, &mut ws.v);
        system.normalise(&mut ws.end);
        ws.return_ends(system, |own, _| own != number);
    }
    found.work = work.times(share);
    found.released *= share;
    let [before, after] = &mut ws.elastic;
    for (cluster, (before, after)) in before.iter().zip(after).enumerate() {
        if ws.groups.of_cluster(cluster) == number {
            *after = share * *after + (1.0 - share) * before;
        }
    }
    relax::<S>(options, ws, number);
}

/// Lowers the impulses of a group's contacts that yield until the deflections which they say are
/// those of the energy stored. More would push the machine again in the next step, and it would be
/// held back for ever.
fn relax<S: MechanicalSystem>(options: &StepOptions, ws: &mut ScratchOf<S>, number: usize) {
    let d = S::DIMENSION.components();
    let is_own =
        |ws: &ScratchOf<S>, i: usize| ws.groups.of_contact(i) == number && ws.yielding[i].is_soft();
    let own = (0..ws.yielding.len()).filter(|i| is_own(ws, *i));
    let said: f64 = own.map(|i| held::<S>(options, ws, i).before).sum();
    let share = (ws.groups.sum(&ws.elastic[0], number) / said)
        .sqrt()
        .min(1.0);
    for i in 0..ws.yielding.len() {
        if is_own(ws, i) {
            let mut p = [0.0; 3];
            p[..d].copy_from_slice(&ws.p[d * i..][..d]);
            p = ws.yielding[i].relaxed(options.time_step, share, p);
            ws.p[d * i..][..d].copy_from_slice(&p[..d]);
        }
    }
}

/// Carries the velocity `ws.v` of each group that a projection displaced, by its part of `ws.dv`,
/// to its position in `ws.end`, see [`super::carried_velocity`]. Counts the energy that this added
/// beyond the actuators' work on the way. `ws.stored[1]`: in springs before it, J.
pub(super) fn carry_velocity<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
    report: &mut StepReport,
) {
    if ws.audited.energies.is_empty() {
        return;
    }
    let work = system.work_of_displacement(options, start, &ws.v, &ws.dv);
    system.energies(options, &ws.end, &ws.v, &mut ws.after);
    let is_moved = |ws: &ScratchOf<S>, number: usize| {
        ws.groups.is_group(number) && ws.groups.group(number).is_moved
    };
    for number in 0..ws.groups.n() {
        if !is_moved(ws, number) {
            continue;
        }
        let before = ws.groups.energy(&ws.audited.energies, number);
        let moved = ws.groups.energy(&ws.after, number);
        let is_alone = ws.groups.group(number).is_untouched;
        let carried = Carried::new(before.moving(), moved.moving(), moved.mass, is_alone);
        let Vec3 { x, y, z } = carried.common;
        rescale(system, ws, carried.share, number, |k, v| {
            let axis = system.translation_axis(k);
            axis.map_or(0.0, |axis| [x, y, z][axis]) + carried.share * v
        });
    }
    system.energies(options, &ws.end, &ws.v, &mut ws.after);
    ws.stored.swap(0, 1);
    system.stored(&ws.end, &mut ws.stored[1]);
    let changes = (0..ws.groups.n()).filter(|own| is_moved(ws, *own));
    let changes = changes.map(|own| {
        let after = ws.groups.energy(&ws.after, own);
        let stored = ws.stored.each_ref().map(|all| ws.groups.sum(all, own));
        let before = ws.groups.energy(&ws.audited.energies, own);
        after.above(&before) + (stored[1] - stored[0])
    });
    let lifted = changes.reduce(|a, b| a + b).unwrap_or_default() - work;
    report.energy_supplied += work;
    report.energy_lifted += lifted.max(0.0);
    report.energy_lost += (-lifted).max(0.0);
    ws.audited.is(&ws.end, &ws.v, &ws.after);
}

/// `ws.after` and `ws.work`: energies of the clusters at `ws.end` and `ws.v`, and the work of their
/// actuators.
fn weigh<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
) {
    system.work(options, start, &ws.v, &mut ws.work);
    system.energies(options, &ws.end, &ws.v, &mut ws.after);
}

/// The balance of a group, from what was weighed.
fn balance<S: MechanicalSystem>(
    options: &StepOptions,
    ws: &ScratchOf<S>,
    number: usize,
) -> Balance {
    let before = ws.groups.energy(&ws.before, number);
    let after = ws.groups.energy(&ws.after, number);
    let work = ws.groups.sum(&ws.work, number);
    let [start, end] = (ws.elastic.each_ref()).map(|all| ws.groups.sum(all, number));
    let released = start - end;
    let both = |energy: &MechanicalEnergy| [energy.kinetic, energy.potential];
    let fall = options.gravity.norm() * options.time_step;
    let ends = [both(&before), both(&after)];
    Balance {
        after,
        excess: Excess::new(
            ends[0],
            ends[1],
            [work.total(), released],
            (after.mass, fall),
        ),
        work,
        contact_work: 0.0,
        released,
        removed: 0.0,
    }
}

/// The balance, after the velocity of the group and its displacement are shortened while the excess
/// is a large part of the kinetic energy.
fn shortened_balance<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
    number: usize,
) -> Balance {
    let mut found = balance::<S>(options, ws, number);
    for _ in 0..MOST_SHORTENINGS {
        let Balance { after, excess, .. } = found;
        if excess.value.is_nan() || excess.value <= SHORT * after.kinetic {
            break;
        }
        // The velocity is far off, and so is the displacement that it caused. Shorten both
        // together.
        let before = ws.groups.energy(&ws.before, number);
        let share = (before.kinetic / after.kinetic).min(SHORT).sqrt();
        ws.keep_ends(system);
        let gaps = (system.n_clusters() > 1).then(|| ws.gap_end.clone());
        shorten(system, ws, share, number);
        place(system, options, ws);
        system.normalise(&mut ws.end);
        ws.return_ends(system, |own, _| own != number);
        for (i, gap) in gaps.into_iter().flatten().enumerate() {
            if ws.groups.of_contact(i) != number {
                ws.gap_end[i] = gap;
            }
        }
        weigh(system, options, start, ws);
        find_stored_after(system, options, ws, number);
        found = balance::<S>(options, ws, number);
    }
    found
}

/// Scales the motion of a group relative to its mass centre, in the local velocities too.
fn scale_relative_motion<S: MechanicalSystem>(
    system: &S,
    ws: &mut ScratchOf<S>,
    share: f64,
    (number, after): (usize, &MechanicalEnergy),
) {
    let translation = after.momentum / after.mass;
    scale::<S>(system, ws, share, number, |k| {
        let axis = system.translation_axis(k);
        Some(axis.map_or(0.0, |axis| translation[axis]))
    });
}

/// Scales the velocity of a group relative to a common one, in the local velocities too.
fn scale<S: MechanicalSystem>(
    system: &S,
    ws: &mut ScratchOf<S>,
    share: f64,
    number: usize,
    common: impl Fn(usize) -> Option<f64>,
) {
    rescale(system, ws, share, number, |k, v| match common(k) {
        Some(common) => common + share * (v - common),
        None => share * v,
    });
}

/// Gives each velocity of a group a new value, and scales the local ones.
fn rescale<S: MechanicalSystem>(
    system: &S,
    ws: &mut ScratchOf<S>,
    share: f64,
    number: usize,
    new: impl Fn(usize, f64) -> f64,
) {
    for (k, v) in ws.v.iter_mut().enumerate() {
        if ws.groups.of_cluster(system.cluster_of_velocity(k)) == number {
            *v = new(k, *v);
        }
    }
    let d = S::DIMENSION.components();
    for (i, u) in ws.u.chunks_exact_mut(d).enumerate() {
        if ws.groups.of_contact(i) == number {
            for u in u {
                *u *= share;
            }
        }
    }
}

/// Violation of the law of a group's contacts by `v⁺ ← share v⁺`, relative to the free velocity.
///
/// A closed contact that is to rebound at u_N separates at `share u_N`. At e = 0 a rigid contact
/// has u_N = 0, and the law holds.
fn violation_by<S: MechanicalSystem>(share: f64, ws: &ScratchOf<S>, number: usize) -> f64 {
    let d = S::DIMENSION.components();
    let own = (0..ws.contacts.len()).filter(|i| ws.groups.of_contact(*i) == number);
    let (mut lost, mut free) = (0.0, 0.0);
    for i in own {
        if ws.p[d * i] > 0.0 {
            lost += ws.u[d * i] * ws.u[d * i];
        }
        for q in &ws.q_free[d * i..][..d] {
            free += q * q;
        }
    }
    relative((1.0 - share) * f64::sqrt(lost), f64::sqrt(free))
}

/// `v⁺ ← share v⁺` of a group, in the local velocities too.
fn shorten<S: MechanicalSystem>(system: &S, ws: &mut ScratchOf<S>, share: f64, number: usize) {
    scale(system, ws, share, number, |_| None);
}

fn relative(excess: f64, size: f64) -> f64 {
    if excess > 0.0 {
        excess / size.max(f64::MIN_POSITIVE)
    } else {
        0.0
    }
}
