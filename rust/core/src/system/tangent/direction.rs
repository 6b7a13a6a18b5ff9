//! What varies in a lane.

use super::held_tree::TangentScene;
use super::scratch::TangentPass;
use crate::contact::loops::Projector;
use crate::scalar::{Dual, Lane};

/// A direction in which a step is differentiated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Direction {
    /// The configuration moves along these velocities, each with its rate.
    Configuration([(usize, f64); 3]),
    /// A velocity.
    Velocity(usize),
    /// The command of a joint's drive, or the speed of its servo, times a factor.
    Command(usize, f64),
    /// The set-point of a held joint.
    SetPoint(usize),
    /// The common coefficient of friction.
    Friction,
    /// Mass and moments of a body, relative.
    Mass(usize),
    /// Mass and moments of all bodies, relative.
    AllMasses,
    /// The damping of a joint.
    Damping(usize),
    /// The stiffness of all contacts that yield, relative.
    Stiffness,
    /// Their damping, relative.
    ContactDamping,
    /// An entry of the state of the sand at a wheel: of its memory, or its energy.
    Sand(usize, usize),
    /// A number of the soil, of those that the step was held with; `is_memory`: the length over
    /// which the sand forgets.
    Soil { index: usize, is_memory: bool },
}

impl Direction {
    fn is_of_inertias(self) -> bool {
        matches!(self, Self::Mass(_) | Self::AllMasses)
    }
}

/// 1 in one lane, times a rate.
#[inline(always)]
pub(super) fn unit<T: Lane>(token: T::Token, lane: usize, rate: f64) -> T {
    let mut unit = T::splat(token, 0.0);
    unit.set(lane, rate);
    unit
}

impl<T: Lane> TangentPass<T> {
    /// Sets what varies, one direction a lane.
    pub(super) fn seed(&mut self, scene: &TangentScene<'_>, directions: &[Direction]) {
        let mechanism = scene.model.mechanism();
        let token = self.data.token;
        let zero = T::splat(token, 0.0);
        for ((own, moved), v) in self
            .data
            .v
            .iter_mut()
            .zip(&mut self.moved)
            .zip(scene.start.v)
        {
            *own = Dual::splat(token, *v);
            *moved = Dual::constant(zero);
        }
        if std::mem::take(&mut self.varies_inertias) {
            self.reset_inertias(scene);
        }
        self.parts.tree.drives.clone_from(&self.own_drives);
        (
            self.parts.d_mu,
            self.parts.d_stiffness,
            self.parts.d_damping,
        ) = (zero, zero, zero);
        if let (Some(sand), Some(held)) = (&mut self.parts.sand, &scene.held.sand) {
            sand.reset(held);
        }
        for (lane, direction) in directions.iter().enumerate() {
            let one = unit::<T>(token, lane, 1.0);
            let varying = Dual::new(zero, one);
            match *direction {
                Direction::Configuration(rates) => {
                    for (k, rate) in rates {
                        self.moved[k].slope += unit::<T>(token, lane, rate);
                    }
                }
                Direction::Velocity(k) => self.data.v[k].slope += one,
                Direction::Command(joint, sign) => {
                    let change = Dual::new(zero, unit(token, lane, sign));
                    self.parts.tree.drives.add_command(joint, change);
                }
                Direction::SetPoint(joint) => {
                    if let Some(held) = &scene.command.held[joint]
                        && held.stiffness > 0.0
                    {
                        let whole = self.parts.tree.drives.stiffness(joint);
                        let share = Dual::splat(token, held.stiffness) / whole;
                        self.parts.tree.drives.add_set_point(joint, share, varying);
                    }
                }
                Direction::Friction => self.parts.d_mu += one,
                Direction::Mass(body) => {
                    let factor = Dual::new(T::splat(token, 1.0), one);
                    self.parts.tree.inertias.scale(mechanism, body, factor);
                }
                Direction::AllMasses => {
                    let factor = Dual::new(T::splat(token, 1.0), one);
                    for body in 0..scene.model.bodies().len() {
                        self.parts.tree.inertias.scale(mechanism, body, factor);
                    }
                }
                Direction::Damping(joint) => self.parts.tree.drives.add_damping(joint, varying),
                Direction::Stiffness => self.parts.d_stiffness += one,
                Direction::ContactDamping => self.parts.d_damping += one,
                Direction::Sand(wheel, entry) => {
                    if let Some(sand) = &mut self.parts.sand {
                        let wheel = &mut sand.wheels[wheel];
                        let own = wheel.memory.get_mut(entry).unwrap_or(&mut wheel.stored);
                        own.slope += one;
                    }
                }
                Direction::Soil { index, is_memory } => {
                    self.vary_soil(scene, (index, is_memory), one);
                }
            }
            self.varies_inertias |= direction.is_of_inertias();
        }
        (self.data.start).set_moved(mechanism, &self.base, &self.moved, 1.0);
        self.close_start(scene);
    }

    fn vary_soil(&mut self, scene: &TangentScene<'_>, (index, is_memory): (usize, bool), one: T) {
        let (Some(sand), Some(held)) = (&mut self.parts.sand, &scene.held.sand) else {
            return;
        };
        for (wheel, held) in sand.wheels.iter_mut().zip(&held.wheels) {
            for (own, x) in wheel.by_soil.iter_mut().zip(held.by_soil[index]) {
                *own += one * one.like(x);
            }
        }
        if is_memory {
            sand.length.slope += one;
        }
    }

    /// The inertias of the machine in all lanes.
    pub(super) fn reset_inertias(&mut self, scene: &TangentScene<'_>) {
        for lane in 0..T::LANES {
            self.parts
                .tree
                .inertias
                .set_lane(lane, scene.model.inertias());
        }
    }

    /// Closes the loops at the start of the step, where what varies would open them.
    fn close_start(&mut self, scene: &TangentScene<'_>) {
        let tree = &mut self.parts.tree;
        let Some(loops) = &mut tree.loops else {
            return;
        };
        let (mechanism, inertias) = (scene.model.mechanism(), &tree.inertias);
        (tree.poses_middle).update(mechanism, inertias, &self.data.start);
        (tree.mass_matrix).update(mechanism, inertias, &tree.poses_middle);
        tree.mass_matrix.factorise(mechanism, &mut tree.factor);
        let with = Projector {
            mechanism,
            inertias,
            factor: &tree.factor,
            lanes: !Dual::<T>::mask(self.data.token, 0),
        };
        loops.project(&with, &mut self.data.start, &mut self.data.v);
    }
}
