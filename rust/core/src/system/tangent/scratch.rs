//! Scratch of passes over a step.

use super::varying_sand::VaryingSand;
use crate::contact::rows::Place;
use crate::multibody::bias::BiasScratch;
use crate::multibody::{
    EnergyScratch, Factor, Inertias, LaneConfiguration, MassMatrix, Model, Poses,
};
use crate::scalar::{Dual, Lane};
use crate::system::drives::Drives;
use crate::system::loops::Loops;

/// What the energy audit did to the velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Correction {
    None,
    /// The motion relative to the mass centre was scaled.
    Relative,
    /// All of the velocity was scaled.
    Whole,
}

/// A contact with its derivatives: its place relative to its body's tree, and its gap.
#[derive(Clone, Copy, Debug)]
pub(super) struct Varying<T> {
    pub place: Place<Dual<T>>,
    pub gap: Dual<T>,
}

/// Scratch of passes with the lanes of `T`.
pub(crate) struct Tangent<T: Lane> {
    pub(super) token: T::Token,
    pub(super) inertias: Inertias<Dual<T>>,
    pub(super) varies_inertias: bool,
    /// Drives and configuration of the machine, and with what varies.
    pub(super) own_drives: Drives<Dual<T>>,
    pub(super) drives: Drives<Dual<T>>,
    pub(super) base: LaneConfiguration<Dual<T>>,
    pub(super) start: LaneConfiguration<Dual<T>>,
    pub(super) middle: LaneConfiguration<Dual<T>>,
    pub(super) end: LaneConfiguration<Dual<T>>,
    pub(super) reached: LaneConfiguration<Dual<T>>,
    /// Displacement that the configuration begins with, velocity at the start (nv).
    pub(super) moved: Vec<Dual<T>>,
    pub(super) v: Vec<Dual<T>>,
    pub(super) v_mean: Vec<Dual<T>>,
    pub(super) v_end: Vec<Dual<T>>,
    pub(super) displacement: Vec<Dual<T>>,
    pub(super) torque: Vec<Dual<T>>,
    /// Generalized force of the wrenches (nv).
    pub(super) applied: Vec<Dual<T>>,
    pub(super) y: Vec<Dual<T>>,
    pub(super) product: Vec<Dual<T>>,
    pub(super) solved: [Vec<T>; 2],
    pub(super) poses_middle: Poses<Dual<T>>,
    pub(super) poses_end: Poses<Dual<T>>,
    pub(super) mass_matrix: MassMatrix<Dual<T>>,
    pub(super) factor: Factor<T>,
    pub(super) bias_scratch: BiasScratch<Dual<T>>,
    pub(super) energy_scratch: EnergyScratch<Dual<T>>,
    pub(super) contacts: Vec<Varying<T>>,
    pub(super) du: Vec<T>,
    pub(super) dp: Vec<T>,
    pub(super) d_mu: T,
    pub(super) d_stiffness: T,
    pub(super) d_damping: T,
    /// Correction of each group of clusters, at the index of its first one; and the group of each
    /// cluster.
    pub(super) corrections: Vec<Correction>,
    pub(super) group_of: Vec<usize>,
    /// Closed loops of the machine; none if it has none.
    pub(super) loops: Option<VaryingLoops<T>>,
    /// Wheels of the machine in sand; none before the first step on soft ground.
    pub(super) sand: Option<VaryingSand<T>>,
}

/// Closed loops with their derivatives, and the factor of M̂ with its own.
pub(super) struct VaryingLoops<T: Lane> {
    pub loops: Box<Loops<Dual<T>>>,
    pub factor: Factor<Dual<T>>,
}

impl<T: Lane> Tangent<T> {
    /// Room for a machine.
    pub(crate) fn new(token: T::Token, model: &Model) -> Self {
        let mechanism = model.mechanism();
        let place = || LaneConfiguration::new(token, mechanism);
        let zero = T::splat(token, 0.0);
        let vector = || vec![Dual::constant(zero); model.nv()];
        let drives = Drives::new(token, mechanism);
        Self {
            token,
            inertias: Inertias::new(token, mechanism),
            varies_inertias: false,
            own_drives: drives.clone(),
            drives,
            base: place(),
            start: place(),
            middle: place(),
            end: place(),
            reached: place(),
            moved: vector(),
            v: vector(),
            v_mean: vector(),
            v_end: vector(),
            displacement: vector(),
            torque: vector(),
            applied: vector(),
            y: vector(),
            product: vector(),
            solved: [vec![zero; model.nv()], vec![zero; model.nv()]],
            poses_middle: Poses::new(token, mechanism),
            poses_end: Poses::new(token, mechanism),
            mass_matrix: MassMatrix::new(token, mechanism),
            factor: Factor::new(token, mechanism),
            bias_scratch: BiasScratch::new(token, mechanism),
            energy_scratch: EnergyScratch::new(token, mechanism),
            contacts: Vec::new(),
            du: Vec::new(),
            dp: Vec::new(),
            d_mu: zero,
            d_stiffness: zero,
            d_damping: zero,
            corrections: Vec::new(),
            group_of: Vec::new(),
            loops: Loops::new(token, mechanism, model.loops(), 1).map(|loops| VaryingLoops {
                loops,
                factor: Factor::new(token, mechanism),
            }),
            sand: None,
        }
    }
}
