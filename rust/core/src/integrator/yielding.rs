//! Contacts that yield, and contacts that bounce, in a step: [`crate::law`].
//!
//! A contact with restitution is rigid in the step in which it closes, and Newton's law bounces it,
//! also where it yields. Its impulse says nothing of a deflection, so it is not remembered.
//!
//! The energy that contacts which yield store is remembered from step to step
//! ([`super::WarmStart::stored`]), so what they give off over any time is no more than they took
//! and had at its start.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::balance::Energies;
use super::data::DataOf;
use super::dynamics::Dynamics;
use super::grouped::Grouped;
use super::local::Local;
use super::systems::Systems;
use crate::law::compliance::{SpringEnergy, Yielding};
use crate::scalar::{Lane, LaneMask};

/// The laws of contacts that yield. Where a cluster remembers no contact, each of its contacts may
/// bear its weight. `is_at_end`: for the velocity at the end of the step, with the local velocities
/// `d.pushes`, and not for that before it.
#[inline(always)]
pub(super) fn yield_under_load<S: Systems>(s: &mut S, d: &mut DataOf<S>, is_at_end: bool) {
    if d.laws.is_empty() {
        return;
    }
    find_unknown(s, d);
    let zero = d.number(0.0);
    let step = d.step();
    let fall = s.gravity().norm() * step.0;
    let may_bounce = d.options.is_elastic();
    for place in s.contacts().used() {
        let v = if is_at_end { &d.v_end } else { &d.v };
        let (spring, is_soft) = s.compliance(place, v);
        let last = d.p_last[place].triple(zero);
        d.laws[place] = match spring {
            Some(spring) if is_soft.any() => {
                let u = if is_at_end { &d.pushes } else { s.u_before() };
                let (gap, u_N) = (s.contacts().gap(place), u[place][0]);
                let unknown = weight(s, d, place, fall);
                spring.over(step, gap, u_N, last, unknown).only(is_soft)
            }
            _ => Yielding::none(zero),
        };
        if may_bounce {
            let law = &mut d.laws[place];
            let is_new = last[0].abs().le(zero);
            let bounces = law.is_soft() & is_new & zero.lt(s.restitution(&d.options, place));
            d.bounces[place] = bounces;
            *law = law.only(!bounces);
        }
    }
}

/// Lanes of which a place's cluster remembers no contact, and the impulse of its weight, N s.
#[inline(always)]
fn weight<S: Systems>(
    s: &S,
    d: &DataOf<S>,
    place: usize,
    fall: S::T,
) -> (<S::T as Lane>::Mask, S::T) {
    let (unknown, masses) = (&d.energies.in_touch, &d.energies.mass);
    if let ([unknown], [mass]) = (&unknown[..], &masses[..]) {
        return (*unknown, *mass * fall);
    }
    let (mut lanes, mut weight) = (0, fall);
    for lane in 0..S::T::LANES {
        let cluster = s.own_cluster(place, lane);
        lanes |= unknown[cluster].bits() & 1 << lane;
        weight.set(lane, masses[cluster].get(lane) * fall.get(lane));
    }
    (S::T::mask(d.token, lanes), weight)
}

/// `energies.in_touch`: by cluster, lanes that remember no contact; and the clusters' masses.
fn find_unknown<S: Systems>(s: &S, d: &mut DataOf<S>) {
    let (n, zero) = (d.n_clusters(), d.number(0.0));
    let energies = &mut d.energies;
    energies.in_touch.fill(S::T::mask(d.token, 0));
    for (lane, memory) in d.memories.iter().enumerate() {
        let own = S::T::mask(d.token, 1 << lane);
        for (cluster, unknown) in energies.in_touch.iter_mut().enumerate() {
            let is_known = if n > 1 {
                s.remembers(lane, memory, cluster)
            } else {
                !memory.impulses.is_empty()
            };
            if !is_known {
                *unknown = *unknown | own;
            }
        }
    }
    for (cluster, mass) in energies.mass.iter_mut().enumerate() {
        *mass = s.machine().mass(cluster).unwrap_or(zero);
    }
}

/// Adds the contacts' laws to their free velocities `d.u`.
#[inline(always)]
pub(super) fn add_shifts<S: Systems>(s: &S, d: &mut DataOf<S>) {
    if !d.laws.is_empty() {
        for place in s.contacts().used() {
            let shift = d.laws[place].shift;
            for k in 0..S::Local::N {
                d.u[place][k] += shift[k];
            }
        }
    }
    s.add_shifts(&d.options, 1.0, &d.laws, &mut d.u);
}

/// Takes them, and what the contacts yield under the impulses `d.p`, out of the answer `d.u`.
#[inline(always)]
pub(super) fn remove_shifts<S: Systems>(s: &S, d: &mut DataOf<S>) {
    if !d.laws.is_empty() {
        let zero = d.number(0.0);
        for place in s.contacts().used() {
            let more = d.laws[place].yielded(d.p[place].triple(zero));
            for k in 0..S::Local::N {
                d.u[place][k] -= more[k];
            }
        }
    }
    s.add_shifts(&d.options, -1.0, &d.laws, &mut d.u);
}

/// Forgets the impulses of contacts that bounced although they yield.
pub(super) fn forget_bounces<S: Systems>(s: &S, d: &mut DataOf<S>) {
    if d.laws.is_empty() || !d.options.is_elastic() {
        return;
    }
    for place in s.contacts().used() {
        let bounced = d.bounces[place] & s.contacts().active(place);
        for lane in (0..S::T::LANES).filter(|&lane| bounced.get(lane)) {
            let known = s.place_in_memory(place, lane);
            d.next_memories[lane].impulses[known].1 = [0.0; 3];
        }
    }
}

/// `own.released`: what the contacts that yield give off, by group, J; `own.elastic`: what they
/// hold before and after the step.
pub(super) fn find_tread_energies<S: Systems>(s: &S, d: &mut DataOf<S>, own: &mut Energies<S::T>) {
    own.released.fill(d.number(0.0));
    if !s.yields() {
        return;
    }
    hold(s, d, own);
    for (cluster, known) in own.number.iter_mut().enumerate() {
        *known = d.number(f64::INFINITY);
        for (lane, memory) in d.memories.iter().enumerate() {
            if memory.stored.len() == own.released.len() {
                known.set(lane, memory.stored[cluster]);
            }
        }
    }
    // At the start it is what the last step left, or if that is not known what deflections say.
    let [before, after, given] = &mut own.elastic;
    for (cluster, before) in before.iter_mut().enumerate() {
        let known = own.number[cluster];
        *before = S::T::select(known.is_finite(), known, *before);
        let own = SpringEnergy {
            before: *before,
            most: after[cluster],
            given: given[cluster],
        };
        after[cluster] = own.after(*before);
    }
    for (lane, memory) in d.next_memories.iter_mut().enumerate() {
        memory.stored.clear();
        (memory.stored).extend(after.iter().map(|after| after.get(lane)));
    }
    for sums in [&mut *before, &mut *after] {
        s.contacts().gather(sums);
    }
    for (released, (before, after)) in own.released.iter_mut().zip(before.iter().zip(&*after)) {
        *released = *before - *after;
    }
}

/// `own.elastic`: what the contacts of each cluster hold over the step, J.
fn hold<S: Systems>(s: &S, d: &DataOf<S>, own: &mut Energies<S::T>) {
    let zero = d.number(0.0);
    let step = d.step();
    for sums in &mut own.elastic {
        sums.fill(zero);
    }
    let [before, most, given] = &mut own.elastic;
    for place in s.contacts().used() {
        let law = &d.laws[place];
        let both = [s.u_before()[place].triple(zero), d.u[place].triple(zero)];
        let held = law.held(step, both, d.p[place].triple(zero));
        let only = |x: S::T| S::T::select(law.is_soft(), x, zero);
        s.contacts().add(place, only(held.before), before);
        s.contacts().add(place, only(held.most), most);
        s.contacts().add(place, only(held.given), given);
    }
}
