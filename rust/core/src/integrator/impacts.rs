//! Contacts in impact, and the work of all by their law.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::data::DataOf;
use super::grouped::Grouped;
use super::local::Local;
use super::systems::Systems;
use crate::law::newton_impact::slow_approach;
use crate::scalar::{Lane, LaneMask};

/// Change of the contacts' impulses since the last step, as a fraction of the approach that they
/// stop, up to which they are forces.
///
/// A ball that crosses a hollow in 25 steps changes them by up to a fifth in a step. Of the energy
/// that a thousand drops of the rover onto rocks dissipate, 1.3% is lost in impacts that resemble
/// the last step's at ½, 0.4% at a fifth, 0.2% at a tenth.
const STEADY: f64 = 0.25;

/// Finds the contacts in impact, `d.impact`, for the solved step.
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
/// harmless. `d.y` and `d.pushes` are overwritten.
#[inline(always)]
pub(super) fn find_impacts<S: Systems>(s: &S, d: &mut DataOf<S>) {
    let slow = slow_approach(s.gravity().norm(), d.step().0);
    d.has_impact.fill(S::T::mask(d.token, 0));
    for place in s.contacts().used() {
        let mut speed = s.u_before()[place][0].abs();
        if let Some(lever) = s.lever(place) {
            speed *= lever;
        }
        let is_fast = s.contacts().active(place) & !speed.le(slow);
        d.impact[place] = is_fast;
        s.contacts().mark(place, is_fast, &mut d.has_impact);
    }
    if (d.any(&d.has_impact) & d.going).any() {
        compare_impulses(s, d);
    }
    s.contacts().unite(&mut d.has_impact);
}

/// Leaves those in impact whose approach the last step's impulses would not have stopped.
#[inline(always)]
fn compare_impulses<S: Systems>(s: &S, d: &mut DataOf<S>) {
    let zero = d.number(0.0);
    for place in s.contacts().used() {
        for k in 0..S::Local::N {
            d.pushes[place][k] = d.p[place][k] - d.p_last[place][k];
        }
    }
    d.y.fill(zero);
    s.add_impulses(d.occupied, &d.pushes, &mut d.y);
    s.local(&d.y, &mut d.pushes);
    d.has_impact.fill(S::T::mask(d.token, 0));
    for place in s.contacts().used() {
        let before = s.u_before()[place][0];
        let change = d.pushes[place][0] - before;
        let is_steady = change.abs().le(zero.like(STEADY) * before.abs());
        d.impact[place] = d.impact[place] & !is_steady;
        s.contacts().mark(place, d.impact[place], &mut d.has_impact);
    }
}

/// Work of the contacts of each group over the solved step by their law, J: friction and impacts.
///
/// The normal reaction of persistent contact and friction that sticks do no work. Friction takes
/// `½ (p_k·u_k + p·u⁺)` by the trapezoidal rule, with the last step's impulses p_k and the slip
/// velocities u_k at the start and u⁺ at the end; only their sum `p_k·u_k = v·(H p_k)` is known at
/// the start. A change of p is charged with the velocity before the step. An impact takes `p·(u +
/// u⁺)/2`, by its law of restitution and friction. While a contact is new, in impact or yields, the
/// friction of the others counts with its value at the end. That of one that yields is the work of
/// its slip, and of the deflection that leaves it with the tread.
#[inline(always)]
pub(super) fn find_contact_work<S: Systems>(s: &S, d: &mut DataOf<S>) {
    let half = d.number(0.5);
    let zero = half.like(0.0);
    let mut sums = std::mem::take(&mut d.energies.of_contacts);
    for sum in &mut sums {
        sum.fill(zero);
    }
    let mut is_rough = std::mem::take(&mut d.energies.in_touch);
    is_rough.fill(S::T::mask(d.token, 0));
    let [ends, changes, struck, start] = &mut sums;
    let contacts = s.contacts();
    for place in contacts.used() {
        let (p, u) = (&d.p[place], &d.u[place]);
        let (last, before) = (&d.p_last[place], &s.u_before()[place]);
        let active = contacts.active(place);
        let mut end = along(p, u);
        if !d.laws.is_empty() {
            let law = &d.laws[place];
            let yields = law.is_soft() & active;
            let of_soft = law.slip_work(u.triple(zero), p.triple(zero));
            end = S::T::select(yields & !d.impact[place], of_soft, end);
            contacts.mark(place, yields, &mut is_rough);
        }
        let mut change = (p[1] - last[1]) * before[1];
        for k in 2..S::Local::N {
            change += (p[k] - last[k]) * before[k];
        }
        contacts.add(place, S::T::select(active, end, zero), ends);
        contacts.add(place, S::T::select(active, change, zero), changes);
        if d.impact[place].any() {
            let mut both = p[0] * (u[0] + before[0]);
            for k in 1..S::Local::N {
                both += p[k] * before[k];
            }
            let work = S::T::select(d.impact[place], half * (both - end), zero);
            contacts.add(place, work, struck);
        }
    }
    for (own, has_impact) in is_rough.iter_mut().zip(&d.has_impact) {
        *own = *own | *has_impact;
    }
    contacts.unite(&mut is_rough);
    let persists = d.persists.iter().zip(&is_rough);
    let is_any = persists.fold(false, |any, (own, rough)| any | (*own & !*rough).any());
    if is_any {
        let pushes = d.persistent.iter().zip(&d.cluster_of);
        for (v, (push, cluster)) in d.v.iter().zip(pushes) {
            start[*cluster] += *v * *push;
        }
        contacts.gather(start);
    }
    for sum in [&mut *ends, &mut *changes, &mut *struck] {
        contacts.gather(sum);
    }
    for (c, balance) in d.balances.iter_mut().enumerate() {
        balance.contact_work = ends[c] + struck[c];
        if is_any {
            let persists = d.persists[c] & !is_rough[c];
            let work = half * (ends[c] + changes[c] + start[c]);
            balance.contact_work = S::T::select(persists, work, balance.contact_work);
        }
    }
    (d.energies.of_contacts, d.energies.in_touch) = (sums, is_rough);
}

/// Product of the tangential components.
#[inline(always)]
fn along<T: Lane, L: Local<T>>(p: &L, u: &L) -> T {
    let mut sum = p[1] * u[1];
    for k in 2..L::N {
        sum += p[k] * u[k];
    }
    sum
}
