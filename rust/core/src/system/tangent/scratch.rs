//! What passes over steps need.

use std::sync::Arc;

use super::held_system::{HeldAnswer, HeldParts, HeldSystem};
use crate::contact::loops::Loops;
use crate::integrator::data::{Data, DataOf};
use crate::multibody::{LaneConfiguration, Model};
use crate::scalar::{Dual, Lane};
use crate::system::drives::Drives;
use crate::system::tree_lanes::TreeLanes;

/// Passes with the lanes of `T`.
pub(crate) struct TangentPass<T: Lane> {
    pub(super) parts: HeldParts<T>,
    pub(super) data: DataOf<HeldSystem<'static, T>>,
    pub(super) varies_inertias: bool,
    /// Drives and configuration of the machine, without what varies.
    pub(super) own_drives: Drives<Dual<T>>,
    pub(super) base: LaneConfiguration<Dual<T>>,
    /// Displacement that the configuration begins with (nv).
    pub(super) moved: Vec<Dual<T>>,
    pub(super) answers: [HeldAnswer<T>; 2],
}

impl<T: Lane> TangentPass<T> {
    /// Room for a machine.
    pub(crate) fn new(token: T::Token, model: &Model) -> Self {
        let mechanism = Arc::clone(model.mechanism());
        let mut tree = TreeLanes::new(token, &mechanism, &[], Vec::new(), 0);
        tree.loops = Loops::new(token, &mechanism, model.loops(), 1);
        let base = LaneConfiguration::new(token, &mechanism);
        Self {
            own_drives: tree.drives.clone(),
            moved: vec![Dual::splat(token, 0.0); model.nv()],
            data: Data::new(token, &base, &tree),
            parts: HeldParts::new(tree),
            varies_inertias: false,
            base,
            answers: [const { HeldAnswer::NONE }; 2],
        }
    }
}
