//! Scratch of a tree among balls: the contacts of a step by their kind.

use std::sync::OnceLock;

use super::contact::{CompositeContact, GrainTouch};
use super::touches::NearGrain;
use crate::contact::Contact;
use crate::problem::BlockSparseDelassus;
use crate::system::grains::GrainContact;

/// Scratch of the two together.
#[derive(Clone, Debug, Default)]
pub struct CompositeScratch {
    /// The contacts of a step, sorted by kind.
    pub(super) of_grains: Vec<GrainContact<3>>,
    pub(super) of_tree: Vec<Contact>,
    pub(super) touches: Vec<GrainTouch>,
    /// The touches as contacts of the tree.
    pub(super) contacts: Vec<Contact>,
    /// Grains near a part.
    pub(super) near: Vec<NearGrain>,
    /// W of a step without touches, assembled on request.
    pub(super) operator: OnceLock<BlockSparseDelassus>,
}

impl CompositeScratch {
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
        self.contacts.clear();
        (self.contacts).extend(self.touches.iter().map(|touch| touch.contact));
    }

    pub(super) fn listed(&self) -> impl Iterator<Item = CompositeContact> + '_ {
        let of_grains = self.of_grains.iter().copied().map(CompositeContact::Grains);
        let of_tree = self.of_tree.iter().copied().map(CompositeContact::Tree);
        let touches = self.touches.iter().copied().map(CompositeContact::Touch);
        of_grains.chain(of_tree).chain(touches)
    }

    /// The local components of the grains' contacts, and those of the tree with the touches.
    pub(super) fn split<'v>(&self, local: &'v [f64]) -> [&'v [f64]; 2] {
        local.split_at(3 * self.of_grains.len()).into()
    }

    pub(super) fn split_mut<'v>(&self, local: &'v mut [f64]) -> [&'v mut [f64]; 2] {
        local.split_at_mut(3 * self.of_grains.len()).into()
    }

    /// The local components of the touches, at the end of the tree's.
    pub(super) fn touched<'v>(&self, of_tree: &'v [f64]) -> impl Iterator<Item = &'v [f64; 3]> {
        of_tree.as_chunks().0.iter().skip(self.of_tree.len())
    }

    pub(super) fn touched_mut<'v>(
        &self,
        of_tree: &'v mut [f64],
    ) -> impl Iterator<Item = &'v mut [f64; 3]> {
        (of_tree.as_chunks_mut().0.iter_mut()).skip(self.of_tree.len())
    }
}
