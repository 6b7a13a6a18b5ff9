//! Steps in sand whose forces are those at their end to rounding, for derivatives.
//!
//! A step of a simulation accepts forces that differ by some percent from those at its end
//! ([`crate::system`]). Here it is repeated with given forces, which Newton's method brings to
//! those at its end. The first are those of the simulation's own step. What wheels do to the ruts
//! is left out.

use std::sync::Arc;

use nalgebra::Vector6;

use super::differentiator::Differentiator;
use super::error::LinearisationError;
use super::scene::Scene;
use crate::integrator::{NoProbe, Variant};
use crate::sand::{Memory, WheelInSand};
use crate::system::tangent::{OF_WHEEL, SandError};

/// Error of the forces, relative to the largest, at which they are not improved any more; and at
/// which they count as those at the end where rounding allows no better.
const TIGHT: f64 = 3e-14;
const LOOSE: f64 = 1e-10;

/// Part of the error that a step of Newton's method may leave before its matrix is computed anew.
const POOR: f64 = 0.1;

/// Error from which on the matrix is computed anew in every step of Newton's method.
const NEAR: f64 = 1e-3;

/// Least part of a step of Newton's method that is tried before the whole step is taken anyway.
const LEAST_SHARE: f64 = 0.02;

/// Most repetitions of a step.
const MOST: usize = 100;

/// Iterate of Newton's method: the forces on the wheels, none on those that do not touch the sand.
type Forces = Vec<Option<Vector6<f64>>>;

/// Largest error of forces, relative to the largest force. Wheels that touch against what was given
/// count as all of it.
fn largest(errors: &[SandError], forces: &Forces) -> f64 {
    let most = errors
        .iter()
        .fold(0.0_f64, |most, error| most.max(error.size));
    let off = errors.iter().zip(forces).map(|(error, given)| {
        if error.is_touching == given.is_some() {
            error.residual.norm()
        } else {
            error.residual.norm().max(LOOSE * most * 2.0)
        }
    });
    off.fold(0.0_f64, f64::max) / most.max(f64::MIN_POSITIVE)
}

impl Differentiator {
    /// Entries of the state for the sand at the wheels.
    pub(super) fn sand_entries(wheel: &WheelInSand) -> impl Iterator<Item = f64> + use<> {
        let Memory { shift, turn } = wheel.memory;
        shift.into_iter().chain(turn).chain([wheel.stored])
    }

    /// Puts the sand into the state that these entries describe; the ruts stay.
    pub(super) fn set_sand(&mut self, entries: &[f64]) {
        let Some(sand) = &mut self.sim.memory.sand else {
            return;
        };
        for (wheel, own) in sand.wheels.iter_mut().zip(entries.chunks_exact(OF_WHEEL)) {
            *wheel = WheelInSand {
                memory: Memory::of(&Vector6::from_column_slice(&own[..OF_WHEEL - 1])),
                stored: own[OF_WHEEL - 1],
                ..WheelInSand::default()
            };
        }
    }

    /// Takes the step from a state (nx) with the command of the copy, and returns the state after
    /// it. The copy has the sand as it was before the step.
    pub(super) fn step_in_sand(&mut self, state: &[f64]) -> Result<Vec<f64>, LinearisationError> {
        let entries = &state[2 * self.sim.model().nv()..];
        let command = self.sim.command.clone();
        let mut forces = self.guess_forces()?;
        let (mut best, mut change) = (forces.clone(), Vec::new());
        let (mut least, mut share, mut is_own) = (f64::INFINITY, 1.0, false);
        let mut last = f64::INFINITY;
        for _ in 0..MOST {
            let mut found = self.sim.warm_start.clone();
            found.persistent.clear();
            self.set(state)?;
            self.sim.command.clone_from(&command);
            self.sim.warm_start = found;
            self.sim.parts.tree.give_sand(Some(&forces));
            self.report = (self.sim).step_with_all_effort(&Variant::Linearised, &mut NoProbe)?;
            let end = self.state_of(&self.sim);
            self.set_sand(entries);
            let sim = &mut self.sim;
            let (command, memory) = (&sim.command, &mut sim.memory);
            let system = (sim.scene).system(&sim.options, command, memory, &mut sim.parts);
            let errors = system.sand_errors();
            let error = largest(&errors, &forces);
            last = error;
            if error <= TIGHT || (error <= LOOSE && error >= POOR * least) {
                return Ok(end);
            }
            if error < least {
                let is_poor = least.is_finite() && error > POOR * least;
                if is_poor || error > NEAR || self.sand.is_none() {
                    let step = system.hold_step(&sim.options, &sim.scratch);
                    let held = step.and_then(|step| system.hold_sand(&sim.options, &step, &[]));
                    self.sand = held.map(Arc::new);
                    is_own = true;
                } else {
                    is_own = false;
                }
                let corrections = self
                    .sand
                    .as_ref()
                    .and_then(|sand| sand.corrections(&errors));
                let corrections = corrections.ok_or(LinearisationError::NotHeld)?;
                let touching = errors.iter().map(|error| error.is_touching);
                change = corrections.into_iter().zip(touching).collect();
                best.clone_from(&forces);
                (least, share) = (error, 1.0);
            } else if is_own && share > LEAST_SHARE {
                share *= 0.5;
            } else if is_own {
                // At a corner of a force the way on may lead through larger errors.
                (least, share) = (f64::INFINITY, 1.0);
            } else {
                // The matrix of another point leads away: its own is computed.
                self.sand = None;
                forces.clone_from(&best);
                least = f64::INFINITY;
                continue;
            }
            for ((own, best), (change, touching)) in forces.iter_mut().zip(&best).zip(&change) {
                *own = touching.then(|| best.unwrap_or_default() + *change * share);
            }
        }
        Err(LinearisationError::SandNotSolved { error: last })
    }

    /// The forces of the sand in the step of a simulation.
    fn guess_forces(&mut self) -> Result<Forces, LinearisationError> {
        let sim = &mut self.sim;
        // The scratch has sand from its first step on.
        let (command, memory) = (&sim.command, &mut sim.memory);
        drop((sim.scene).system(&sim.options, command, memory, &mut sim.parts));
        sim.parts.tree.give_sand(None);
        sim.step_with_all_effort(&Variant::Linearised, &mut NoProbe)?;
        let modes = sim.parts.tree.modes_of_sand();
        let wheels = sim.memory.sand.iter().flat_map(|sand| &sand.wheels);
        let forces = wheels.zip(modes).map(|(wheel, [is_touching, _])| {
            let ([a, b, c], [d, e, f]) = (wheel.force, wheel.moment);
            is_touching.then(|| Vector6::new(a, b, c, d, e, f))
        });
        Ok(forces.collect())
    }
}
