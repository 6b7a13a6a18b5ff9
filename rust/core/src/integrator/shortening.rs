//! The energy audit of one system where no other way to take the step is left: its displacement is
//! shortened.
//!
//! A step that ends at rest and still gained energy was stopped before its end: the machine jammed
//! while the actuators' work was counted to the end, or a contact closed on its way up.

use super::audit::{audit, correct, find_energies, find_energies_and_work, find_work};
use super::balance::AuditLimits;
use super::closing::close_end;
use super::dynamics::Dynamics;
use super::forces::{Forces, StepStart};
use super::listed::{Listed, ListedData, PosedOf};
use super::local::Local;
use super::mechanical_system::{LocalOf, MechanicalSystem};
use super::systems::Systems;
use super::work::Work;

/// Fraction of the kinetic energy after a step that may be removed by scaling the velocity alone.
const SHORT: f64 = 0.5;

/// Fraction of the displacement that is kept where the energy allows all of it.
const SAFE: f64 = 0.999;

/// Fraction of the displacement below which none is kept.
const LEAST_WAY: f64 = 1e-3;

/// Most times that a velocity is shortened together with its displacement.
const MOST_SHORTENINGS: usize = 8;

/// Judges the step group by group; true if it stands. Of groups with implicit gyroscopic terms it
/// does whatever their energies, if there is no other way to take it.
pub(super) fn judge_at_last<S: MechanicalSystem>(
    s: &mut Listed<'_, S>,
    d: &mut ListedData<S>,
    problems: &PosedOf<S>,
    limits: AuditLimits,
) -> bool {
    if !s.machine().is_audited() {
        find_work(s, d);
        return true;
    }
    find_energies_and_work(s, d);
    let mut last = std::mem::take(&mut s.list.is_last);
    last.clear();
    last.extend(d.is_gyroscopic.iter().map(|own| *own && d.is_last));
    let stands = judge_by(s, d, problems, limits, &last);
    s.list.is_last = last;
    stands
}

/// [`judge_at_last`], with the leaders of the groups that have no other way.
fn judge_by<S: MechanicalSystem>(
    s: &mut Listed<'_, S>,
    d: &mut ListedData<S>,
    problems: &PosedOf<S>,
    limits: AuditLimits,
    last: &[bool],
) -> bool {
    let is_last = |leader: usize| last[leader];
    let (mut is_lost, mut is_corrected) = audit(s, d, limits, is_last);
    for _ in 0..MOST_SHORTENINGS {
        if !shorten_both(s, d, last) {
            break;
        }
        find_energies_and_work(s, d);
        (is_lost, is_corrected) = audit(s, d, limits, is_last);
    }
    if is_lost {
        return false;
    }
    if is_corrected {
        correct(s, d, problems);
        for leader in 0..last.len() {
            let balance = &d.balances[leader];
            let excess = balance.excess.filter(|_| balance.is_corrected);
            if excess.is_some_and(|excess| excess.is_gain() && excess.is_left(limits.gain)) {
                hold_back(s, d, leader);
            }
        }
        find_energies(s, d);
    }
    for balance in &d.balances {
        balance.report(&mut d.reports);
    }
    true
}

/// Shortens velocity and displacement of the groups in `last` whose velocity is far off, and so is
/// the displacement that it caused; whether there is one.
fn shorten_both<S: MechanicalSystem>(
    s: &Listed<'_, S>,
    d: &mut ListedData<S>,
    last: &[bool],
) -> bool {
    if !last.contains(&true) {
        return false;
    }
    let mut shares = vec![1.0; last.len()];
    for (leader, share) in shares.iter_mut().enumerate() {
        let balance = &d.balances[leader];
        let (before, after) = (balance.before[0], balance.after[0]);
        let excess = balance
            .excess
            .filter(|_| last[leader] && s.list.leader_of(leader) == leader);
        if excess.is_some_and(|excess| excess.value > SHORT * after) {
            *share = (before / after).min(SHORT).sqrt();
        }
    }
    if shares.iter().all(|share| *share >= 1.0) {
        return false;
    }
    for (v, cluster) in d.v_end.iter_mut().zip(&d.cluster_of) {
        *v *= shares[s.list.leader_of(*cluster)];
    }
    for (i, u) in d.u.iter_mut().enumerate() {
        for k in 0..LocalOf::<S>::N {
            u[k] *= shares[s.list.group_leader_of(i)];
        }
    }
    let way = s.options.theta * s.options.time_step;
    d.y.copy_from_slice(&d.v_end);
    let mut end = d.middle.clone();
    s.machine().set_moved(&d.middle, &d.y, way, &mut end);
    s.machine().normalise(&mut end);
    s.machine().take(
        |cluster| shares[s.list.leader_of(cluster)] < 1.0,
        &end,
        &mut d.end,
    );
    true
}

/// Shortens the displacement of a group in a step that ends at rest and still gained energy.
///
/// The largest fraction σ of the displacement that the energy allows is kept; σ = 0 is always
/// allowed. The work and what contacts that yield give off are those over it.
fn hold_back<S: MechanicalSystem>(s: &mut Listed<'_, S>, d: &mut ListedData<S>, leader: usize) {
    let options = s.options;
    let (h, theta) = (options.time_step, options.theta);
    let clusters = 0..d.n_clusters();
    let is_own: Vec<bool> = clusters
        .map(|own| s.list.leader_of(own) == leader)
        .collect();
    let before: f64 = d.balances[leader].before.iter().sum();
    let at_rest = d.balances[leader].before[0];
    for ((mean, end), begin) in d.v_mean.iter_mut().zip(&d.v_end).zip(&d.v) {
        *mean = theta * end + (1.0 - theta) * begin;
    }
    let mut works = vec![Work::default(); is_own.len()];
    let start = StepStart::at(&d.start, &d.v[..]);
    s.machine_mut().work(options, start, &d.v_end, &mut works);
    let own = works
        .into_iter()
        .zip(&is_own)
        .filter(|(_, is_own)| **is_own);
    let work = own
        .map(|(work, _)| work)
        .reduce(|a, b| a + b)
        .unwrap_or_default();
    let supplied = work.total() + d.balances[leader].released;
    let mut share = 1.0;
    let (q_kept, v_kept) = (d.end.clone(), d.v_end.clone());
    for k in 0..MOST_SHORTENINGS {
        let mut after = 0.0;
        s.machine_mut()
            .energies(options, &d.end, &d.v_end, |cluster, energy, _| {
                if is_own[cluster] {
                    after += energy[0] + energy[1];
                }
            });
        let excess = after - before - share * supplied;
        if excess <= 0.0 {
            break;
        }
        // With no displacement the excess is minus the kinetic energy; in between it is nearly
        // linear.
        let shorter = SAFE * share * at_rest / (excess + at_rest);
        let is_last = k + 1 == MOST_SHORTENINGS;
        share = if shorter > LEAST_WAY && !is_last {
            shorter
        } else {
            0.0
        };
        s.machine()
            .set_moved(&d.start, &d.v_mean, share * h, &mut d.end);
        close_end(s, d, true);
        s.machine().normalise(&mut d.end);
        s.machine()
            .take(|cluster| !is_own[cluster], &q_kept, &mut d.end);
        for (v, (kept, cluster)) in d.v_end.iter_mut().zip(v_kept.iter().zip(&d.cluster_of)) {
            if !is_own[*cluster] {
                *v = *kept;
            }
        }
    }
    d.shares.resize(is_own.len(), 1.0);
    for (own, _) in d
        .shares
        .iter_mut()
        .zip(&is_own)
        .filter(|(_, is_own)| **is_own)
    {
        *own = share;
    }
    let [start, end] = &mut d.energies.stored;
    end.fill(0.0);
    s.machine().stored(&d.end, end);
    let stored = (start.iter().zip(&*end).zip(&is_own)).filter(|(_, is_own)| **is_own);
    let balance = &mut d.balances[leader];
    balance.stored = stored.map(|((start, end), _)| end - start).sum();
    balance.work = work.times(share);
    balance.released *= share;
    relax(s, d, (leader, &is_own), share);
}

/// Lowers the impulses of a group's contacts that yield until the deflections which they say are
/// those of the energy stored. More would push the machine again in the next step, and it would be
/// held back for ever.
fn relax<S: MechanicalSystem>(
    s: &Listed<'_, S>,
    d: &mut ListedData<S>,
    (leader, is_own): (usize, &[bool]),
    share: f64,
) {
    let step = (s.options.time_step, s.options.theta);
    let own =
        (0..d.laws.len()).filter(|i| s.list.group_leader_of(*i) == leader && d.laws[*i].is_soft());
    let own: Vec<usize> = own.collect();
    if own.is_empty() {
        return;
    }
    let start = d.energies.elastic[0][leader];
    let said: f64 = (own.iter())
        .map(|&i| {
            let both = [s.list.u_before[i].triple(0.0), d.u[i].triple(0.0)];
            d.laws[i].held(step, both, d.p[i].triple(0.0)).before
        })
        .sum();
    let lower = (start / said).sqrt().min(1.0);
    for i in own {
        let relaxed = d.laws[i].relaxed(step.0, lower, d.p[i].triple(0.0));
        for k in 0..LocalOf::<S>::N {
            d.p[i][k] = relaxed[k];
        }
        d.next_memories[0].impulses[i].1 = relaxed;
    }
    let known = &d.memories[0].stored;
    for (cluster, stored) in d.next_memories[0].stored.iter_mut().enumerate() {
        if is_own[cluster] {
            let before = if cluster == leader { start } else { 0.0 };
            let before = known.get(cluster).copied().unwrap_or(before);
            *stored = share * *stored + (1.0 - share) * before;
        }
    }
}
