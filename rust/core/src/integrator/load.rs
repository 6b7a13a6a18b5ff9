//! The velocity without contact impulses.
//!
//! If the spin or the energy audit ([`super::audit`]) requires it, the gyroscopic terms are
//! implicit: `bias = G + C(q_m, v_m) (v + (1−θ) Δv)`, where Δv includes the impulses of persistent
//! contact. C is frozen at the mean velocity v_m of explicit terms. The scheme is of second order
//! and stable at any spin and any step.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::data::DataOf;
use super::dynamics::Dynamics;
use super::forces::{Forces, StepStart};
use super::systems::Systems;
use super::yielding::add_shifts;
use crate::scalar::{Lane, LaneMask, inlined};

/// The free change of the velocity, `d.y` in factor coordinates, and the contacts' free velocity
/// `d.u`: first with the forces at v, then with those at the mean velocity that follows from them
/// and from the last step's impulses.
pub(super) fn load<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    let persists = d.any(&d.persists);
    let is_any = (persists & d.going).any();
    if is_any {
        inlined!(
            S::run,
            d.token,
            s.generalized_impulse(persists, &d.p_last, &mut d.pushed)
        );
    }
    let start = StepStart::at(&d.start, &d.v[..]);
    (s.machine_mut()).begin_load(&d.options, start, &mut d.y);
    inlined!(S::run, d.token, find_mean(s, d, is_any));
    if d.is_any_implicit() {
        let start = StepStart::at(&d.start, &d.v[..]);
        let (v_mean, foreseen) = (&d.v_mean, &d.foreseen);
        (s.machine_mut()).load_gyroscopic(&d.options, start, v_mean, foreseen, &mut d.y);
        correct(s, d, is_any);
        d.y_implicit.copy_from_slice(&d.y);
    }
    if d.is_any_explicit() {
        let start = StepStart::at(&d.start, &d.v[..]);
        (s.machine_mut()).load(&d.options, start, &d.v_mean, &mut d.y);
        correct(s, d, is_any);
    }
    inlined!(S::run, d.token, finish_load(s, d));
}

/// What the impulse `d.y` has besides the forces at the mean velocity.
#[inline(always)]
fn correct<S: Systems>(s: &mut S, d: &mut DataOf<S>, is_any: bool) {
    s.machine().add_given(&d.options, &mut d.y);
    inlined!(S::run, d.token, correct_impulse(s, d, is_any));
}

/// The mean velocity that follows from the forces at v and the impulses that persist. With implicit
/// terms, `d.foreseen` has the latter and those of the loops.
#[inline(always)]
fn find_mean<S: Systems>(s: &mut S, d: &mut DataOf<S>, is_any: bool) {
    if is_any {
        let n = d.cluster_of.len();
        let (y, pushed) = (&mut d.y[..n], &d.pushed[..n]);
        for_each_velocity(
            &d.cluster_of,
            &d.persists,
            #[inline(always)]
            |k, persists| {
                y[k] = S::T::select(persists, y[k] + pushed[k], y[k]);
            },
        );
    }
    s.machine().half_solve(&mut d.y);
    (s.machine_mut()).close_velocity(&d.options, &d.v, &d.v, &mut d.y);
    if d.is_any_implicit() {
        foresee(s, d, is_any);
    }
    let share = d.number(1.0 - d.options.theta);
    s.machine().half_solve_back(&mut d.y);
    for ((mean, v), change) in d.v_mean.iter_mut().zip(&d.v).zip(&d.y) {
        *mean = *v + share * *change;
    }
}

/// The impulses of contacts that persist, and of the loops, with which implicit terms reckon.
#[inline(always)]
fn foresee<S: Systems>(s: &mut S, d: &mut DataOf<S>, is_any: bool) {
    let zero = d.number(0.0);
    d.foreseen.fill(zero);
    if is_any {
        let n = d.cluster_of.len();
        let (foreseen, pushed) = (&mut d.foreseen[..n], &d.pushed[..n]);
        for_each_velocity(
            &d.cluster_of,
            &d.persists,
            #[inline(always)]
            |k, persists| {
                foreseen[k] = S::T::select(persists, pushed[k], zero);
            },
        );
    }
    s.machine_mut().add_loop_impulse(&mut d.foreseen);
}

/// Adds the deferred correction r to the impulse `d.y`, and turns it into factor coordinates.
#[inline(always)]
pub(super) fn correct_impulse<S: Systems>(s: &mut S, d: &mut DataOf<S>, is_any: bool) {
    if is_any {
        let (share, n) = (d.number(1.0 - d.options.theta), d.cluster_of.len());
        let (y, pushed, before) = (&mut d.y[..n], &d.pushed[..n], &d.persistent[..n]);
        for_each_velocity(
            &d.cluster_of,
            &d.persists,
            #[inline(always)]
            |k, persists| {
                let corrected = y[k] + share * (before[k] - pushed[k]);
                y[k] = S::T::select(persists, corrected, y[k]);
            },
        );
    }
    s.machine().half_solve(&mut d.y);
}

/// The contacts' free velocity from the free change of the velocity.
#[inline(always)]
fn finish_load<S: Systems>(s: &mut S, d: &mut DataOf<S>) {
    if d.is_any_implicit() {
        let implicit = d.y_implicit.iter().zip(&d.cluster_of);
        for (y, (implicit, cluster)) in d.y.iter_mut().zip(implicit) {
            *y = S::T::select(d.is_gyroscopic[*cluster], *implicit, *y);
        }
    }
    (s.machine_mut()).close_velocity(&d.options, &d.v, &d.v, &mut d.y);
    s.local(&d.y, &mut d.u);
    add_shifts(s, d);
}

/// Calls `act` with each velocity and the lanes of its cluster.
#[inline(always)]
fn for_each_velocity<M: Copy>(cluster_of: &[usize], lanes: &[M], mut act: impl FnMut(usize, M)) {
    if let [only] = *lanes {
        for k in 0..cluster_of.len() {
            act(k, only);
        }
    } else {
        for (k, cluster) in cluster_of.iter().enumerate() {
            act(k, lanes[*cluster]);
        }
    }
}
