//! Scratch of a tree in a step: the tree with its matrices, and its contacts.

use std::fmt;

use super::drives::Drives;
use super::momentum_balance::MomentumBalance;
use super::tree_lanes::TreeLanes;
use crate::contact::joint_friction::joint_of;
use crate::contact::placed_wheel::PlacedWheel;
use crate::contact::{Contact, ContactSystem, PairSearch};
use crate::multibody::Model;
use crate::sand::SandState;
use crate::scalar::Single;

/// Matrices and contacts of a tree: scratch, allocated once.
#[derive(Clone)]
pub struct TreeScratch {
    pub(super) tree: TreeLanes<f64>,
    pub(super) balance: MomentumBalance,
    pub(super) pairs: PairSearch,
    /// Found by the last detection, x and z, m.
    pub(super) unknown_ground: Option<[f64; 2]>,
    pub(super) system: ContactSystem,
    /// Joints with dry friction, and W's entry of their normals.
    friction: Vec<(usize, f64)>,
}

impl fmt::Debug for TreeScratch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TreeScratch").finish_non_exhaustive()
    }
}

impl TreeScratch {
    /// Scratch for a model with n contacts.
    #[must_use]
    pub fn new(model: &Model, n: usize) -> Self {
        let wheels = model.wheels().iter().map(PlacedWheel::of).collect();
        let (mechanism, loops) = (model.mechanism(), model.loops());
        let mut tree = TreeLanes::new(Single::best(), mechanism, loops, wheels, 0);
        tree.is_thorough = true;
        Self {
            tree,
            balance: MomentumBalance::new(model.bodies().len()),
            pairs: PairSearch::new(model),
            unknown_ground: None,
            system: ContactSystem::with_capacity(model.nv(), n),
            friction: Vec::with_capacity(model.rubbing_joints().len()),
        }
    }

    /// Writes what the sand remembers at the end of a step, and where the wheels were.
    pub(crate) fn end_sand(&mut self, state: Option<&mut SandState>) {
        if let Some(state) = state {
            self.tree.swap_ruts(0, state);
            self.tree.note_ruts(true);
            self.tree.store_sand(0, Some(state));
        }
    }

    /// Impulses and work of the drives, with those of all accepted parts of the step.
    #[must_use]
    pub fn drives(&self) -> &Drives<f64> {
        &self.tree.drives
    }

    /// Impulses of the rows of the loops in the last step, N s and N m s; empty without loops.
    #[must_use]
    pub fn loop_impulses(&self) -> &[f64] {
        let loops = self.tree.loops.as_ref();
        loops.map_or(&[], |loops| loops.impulses())
    }

    /// Impulses of the rows of the loops, N s and N m s, to be set by a step that was taken
    /// elsewhere; empty without loops.
    pub(crate) fn loop_impulses_mut(&mut self) -> &mut [f64] {
        let loops = self.tree.loops.as_mut();
        loops.map_or(&mut [], |loops| loops.impulses_mut())
    }

    /// Delassus operator of the last step, row-major, 1/kg.
    #[must_use]
    pub fn operator(&self) -> &[f64] {
        &self.system.W
    }

    /// World position of a tree's origin where contacts were evaluated last, m.
    #[must_use]
    pub fn origin(&self, tree: usize) -> [f64; 3] {
        self.tree.poses_end.origin_of(tree).get(0)
    }

    /// Keeps W's entries of the joints with dry friction, once the contacts are assembled.
    pub(super) fn note_friction(&mut self, contacts: &[Contact]) {
        self.friction.clear();
        for (c, contact) in contacts.iter().enumerate() {
            if let Some(joint) = joint_of(contact) {
                self.friction.push((joint, self.system.beyond(c)[0]));
            }
        }
    }

    /// W's entry of the normal of a joint's friction.
    pub(super) fn friction_entry(&self, joint: usize) -> f64 {
        let found = self.friction.iter().find(|(own, _)| *own == joint);
        found.map_or(0.0, |(_, entry)| *entry)
    }
}
