//! Scratch of a tree among balls: the contacts of a step by their kind.

use std::sync::OnceLock;

use super::contact::{CompositeContact, GrainTouch};
use super::touches::NearGrain;
use crate::contact::{Contact, ContactSystem};
use crate::multibody::Model;
use crate::problem::BlockSparseDelassus;
use crate::system::grains::GrainContact;

/// Scratch of the two together.
#[derive(Clone, Debug)]
pub struct CompositeScratch {
    /// The contacts of a step, sorted by kind.
    pub(super) of_grains: Vec<GrainContact<3>>,
    pub(super) of_tree: Vec<Contact>,
    pub(super) touches: Vec<GrainTouch>,
    /// The touches as contacts of the tree, and their rows.
    pub(super) contacts: Vec<Contact>,
    pub(super) rows: ContactSystem,
    /// Grains near a part.
    pub(super) near: Vec<NearGrain>,
    /// W of a step without touches, assembled on request.
    pub(super) operator: OnceLock<BlockSparseDelassus>,
}

impl CompositeScratch {
    /// Scratch for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            of_grains: Vec::new(),
            of_tree: Vec::new(),
            touches: Vec::new(),
            contacts: Vec::new(),
            rows: ContactSystem::with_capacity(model, 0),
            near: Vec::new(),
            operator: OnceLock::new(),
        }
    }

    pub(super) fn sort(&mut self, contacts: &[CompositeContact]) {
        self.of_grains.clear();
        self.of_tree.clear();
        self.touches.clear();
        for contact in contacts {
            match *contact {
                CompositeContact::Grains(contact) => self.of_grains.push(contact),
                CompositeContact::Tree(contact) => self.of_tree.push(contact),
                CompositeContact::Touch(touch) => self.touches.push(touch),
            }
        }
    }

    pub(super) fn listed(&self) -> impl Iterator<Item = CompositeContact> + '_ {
        let of_grains = self.of_grains.iter().copied().map(CompositeContact::Grains);
        let of_tree = self.of_tree.iter().copied().map(CompositeContact::Tree);
        let touches = self.touches.iter().copied().map(CompositeContact::Touch);
        of_grains.chain(of_tree).chain(touches)
    }

    /// Where the local components of each kind end and the next begin.
    fn ends(&self) -> [usize; 2] {
        let n = 3 * self.of_grains.len();
        [n, n + 3 * self.of_tree.len()]
    }

    /// The local components of each kind.
    pub(super) fn split<'v>(&self, local: &'v [f64]) -> [&'v [f64]; 3] {
        let [a, b] = self.ends();
        [&local[..a], &local[a..b], &local[b..]]
    }

    pub(super) fn split_mut<'v>(&self, local: &'v mut [f64]) -> [&'v mut [f64]; 3] {
        let [a, b] = self.ends();
        let (local, touches) = local.split_at_mut(b);
        let (of_grains, of_tree) = local.split_at_mut(a);
        [of_grains, of_tree, touches]
    }
}
