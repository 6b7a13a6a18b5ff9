//! Energy that contacts which yield store, by cluster.
//!
//! It is remembered from step to step ([`WarmStart::stored`]), so what they give off over any time
//! is no more than they took and had at its start.

use super::contacting::{KeyOf, UnilateralContact};
use super::mechanical_system::MechanicalSystem;
use super::options::StepOptions;
use super::scratch::ScratchOf;
use super::warm_start::WarmStart;
use crate::law::compliance::Held;

/// `ws.elastic`: energy in the contacts of each cluster that yield at the start and at the end of
/// the step, J. Nothing where all are rigid.
///
/// At the start it is what the last step left, or if that is not known what the deflections say.
pub(super) fn find_stored<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    warm_start: &WarmStart<KeyOf<S>>,
    ws: &mut ScratchOf<S>,
) {
    if system.compliant_mass(0).is_none() {
        return;
    }
    let n = system.n_clusters();
    let mut elastic = std::mem::take(&mut ws.elastic);
    for all in &mut elastic {
        all.resize(n, 0.0);
    }
    let [before, after] = &mut elastic;
    if warm_start.stored.len() == n {
        before.clone_from(&warm_start.stored);
    } else {
        for (cluster, before) in before.iter_mut().enumerate() {
            *before = held_by(system, options, ws, cluster).before;
        }
    }
    for (cluster, (before, after)) in before.iter().zip(after).enumerate() {
        *after = held_by(system, options, ws, cluster).after(*before);
    }
    ws.elastic = elastic;
}

/// Finds the energy at the end of the step anew for the clusters of a group.
pub(super) fn find_stored_after<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
    number: usize,
) {
    for cluster in 0..ws.elastic[1].len() {
        if ws.groups.of_cluster(cluster) == number {
            let before = ws.elastic[0][cluster];
            ws.elastic[1][cluster] = held_by(system, options, ws, cluster).after(before);
        }
    }
}

/// Where the energy of a contact is entered.
fn cluster_of<S: MechanicalSystem>(system: &S, ws: &ScratchOf<S>, i: usize) -> usize {
    let [own, other] = system.clusters_of(&ws.contacts[i].key());
    if own == other {
        own
    } else {
        ws.groups.of_contact(i)
    }
}

/// What the contacts of a cluster hold.
fn held_by<S: MechanicalSystem>(
    system: &S,
    options: &StepOptions,
    ws: &ScratchOf<S>,
    cluster: usize,
) -> Held {
    let mut sum = Held::default();
    for (i, law) in ws.yielding.iter().enumerate() {
        if law.is_soft() && cluster_of(system, ws, i) == cluster {
            let own = held::<S>(options, ws, i);
            sum.before += own.before;
            sum.most += own.most;
            sum.given += own.given;
        }
    }
    sum
}

/// What a contact that yields holds.
pub(super) fn held<S: MechanicalSystem>(
    options: &StepOptions,
    ws: &ScratchOf<S>,
    i: usize,
) -> Held {
    let d = S::DIMENSION.components();
    let local = |all: &[f64]| {
        let mut own = [0.0; 3];
        own[..d].copy_from_slice(&all[d * i..][..d]);
        own
    };
    let step = (options.time_step, options.theta);
    ws.yielding[i].held(step, [local(&ws.u_before), local(&ws.u)], local(&ws.p))
}
