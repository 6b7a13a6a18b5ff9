//! The contacts of a held step with their derivatives, at places that all lanes share.

use crate::contact::rows::Place;
use crate::contact::{Contact, clusters_of};
use crate::integrator::UnilateralContact;
use crate::integrator::grouped::Grouped;
use crate::multibody::Model;
use crate::scalar::{Dual, Lane};

/// A contact with its derivatives: its place relative to its body's tree, and its gap.
#[derive(Clone, Copy, Debug)]
pub(super) struct Varying<T> {
    pub place: Place<Dual<T>>,
    pub gap: Dual<T>,
}

/// The contacts of a step, and the groups of clusters that they join.
#[derive(Clone, Debug)]
pub(super) struct HeldPlaces<T: Lane> {
    pub token: T::Token,
    pub varying: Vec<Varying<T>>,
    is_with_world: Vec<bool>,
    /// Cluster of each contact that touches no other.
    clusters: Vec<Option<usize>>,
    group_leaders: Vec<usize>,
    leaders: Vec<usize>,
    is_joined: bool,
}

impl<T: Lane> HeldPlaces<T> {
    /// Without contacts.
    pub fn new(token: T::Token) -> Self {
        Self {
            token,
            varying: Vec::new(),
            is_with_world: Vec::new(),
            clusters: Vec::new(),
            group_leaders: Vec::new(),
            leaders: Vec::new(),
            is_joined: false,
        }
    }

    /// Takes over the contacts of a step; they are not placed yet.
    pub fn load(&mut self, model: &Model, contacts: &[Contact]) {
        self.varying.clear();
        self.leaders = (0..model.mechanism().n_clusters()).collect();
        self.is_joined = false;
        let both = |contact: &Contact| clusters_of(model, &contact.key);
        for contact in contacts {
            let [a, b] = both(contact).map(|own| self.leaders[own]);
            self.is_joined |= a != b;
            for own in self.leaders.iter_mut().filter(|own| [a, b].contains(own)) {
                *own = a.min(b);
            }
        }
        let is_with_world = contacts.iter().map(|contact| !contact.is_internal());
        self.is_with_world = is_with_world.collect();
        let own = contacts.iter().zip(&self.is_with_world);
        let own = own.map(|(contact, is_with_world)| is_with_world.then_some(both(contact)[0]));
        self.clusters = own.collect();
        let group_leaders = contacts
            .iter()
            .map(|contact| self.leaders[both(contact)[0]]);
        self.group_leaders = group_leaders.collect();
    }
}

impl<T: Lane> Grouped<Dual<T>> for HeldPlaces<T> {
    fn token(&self) -> T::Token {
        self.token
    }

    #[inline(always)]
    fn used(&self) -> impl Iterator<Item = usize> {
        0..self.varying.len()
    }

    #[inline(always)]
    fn active(&self, _: usize) -> T::Mask {
        T::mask(self.token, u32::MAX >> (32 - T::LANES))
    }

    #[inline(always)]
    fn gap(&self, i: usize) -> Dual<T> {
        self.varying[i].gap
    }

    fn is_with_world(&self, i: usize) -> bool {
        self.is_with_world[i]
    }

    fn n_clusters(&self) -> usize {
        self.leaders.len()
    }

    fn joined(&self) -> u32 {
        if self.is_joined {
            u32::MAX >> (32 - T::LANES)
        } else {
            0
        }
    }

    fn leader(&self, cluster: usize, _: usize) -> usize {
        self.leaders[cluster]
    }

    fn cluster_of(&self, i: usize) -> Option<usize> {
        self.clusters[i]
    }

    fn group_leader(&self, i: usize, _: usize) -> usize {
        self.group_leaders[i]
    }
}
