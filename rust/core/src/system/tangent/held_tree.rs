//! What a step of a tree held, and how its contacts change with the poses.

use std::sync::Arc;

use super::held_sand::HeldSand;
use crate::contact::contact_slope::ContactSlope;
use crate::contact::{Contact, Opposite, Part};
use crate::integrator::held_step::HeldStep;
use crate::integrator::{Dynamics, MechanicalSystem, ScratchOf, StepOptions, StepStart};
use crate::multibody::{Configuration, LaneConfiguration, Model};
use crate::scalar::Single;
use crate::system::TreeSystem;
use crate::system::command::Command;

/// A step that was taken, as its derivatives need it.
#[derive(Clone, Debug)]
pub(crate) struct HeldTree {
    pub(crate) step: HeldStep<Contact>,
    /// One a contact.
    pub(super) contacts: Vec<HeldContact>,
    /// On soft ground.
    pub(crate) sand: Option<Arc<HeldSand>>,
}

/// What a contact is besides its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldContact {
    pub slope: ContactSlope,
    pub restitution: f64,
    /// Whether the contact yields.
    pub is_soft: bool,
    /// Index of the joint, of a stop or of dry friction.
    pub joint: Option<usize>,
}

/// A step with its machine, from its start to the velocity at its end.
#[derive(Clone, Copy)]
pub(crate) struct TangentScene<'a> {
    pub model: &'a Arc<Model>,
    pub command: &'a Command,
    pub options: &'a StepOptions,
    pub start: StepStart<'a, Configuration>,
    pub v_end: &'a [f64],
    pub held: &'a HeldTree,
}

impl TreeSystem<'_> {
    /// What the step from `start` held that was just taken with the scratch `ws`, without memory.
    /// None if it has no derivative: it was not solved, or not projected by the law. `numbers`:
    /// indices of numbers of the soil.
    pub(crate) fn hold(
        &mut self,
        options: &StepOptions,
        start: StepStart<'_, Configuration>,
        ws: &ScratchOf<Self>,
        numbers: &[usize],
    ) -> Option<HeldTree> {
        let step = self.hold_step(options, ws)?;
        let is_soft = self.terrain.soft().is_some();
        let sand = self.hold_sand(options, &step, numbers);
        if sand.is_none() && is_soft {
            return None;
        }
        let mut q = LaneConfiguration::new(Single::best(), self.model.mechanism());
        q.set_lane(0, start.configuration);
        self.machine().advance(&mut q, start.v, options.time_step);
        self.machine_mut().place_end(&q);
        let end = self.end(&[]);
        let contacts = step.contacts.iter().enumerate().map(|(i, contact)| {
            let joint = match contact.part {
                Part::Limit(joint, _) | Part::Friction(joint) => Some(joint),
                _ => None,
            };
            HeldContact {
                slope: ContactSlope::of(self.model, end, &**self.terrain, contact),
                restitution: self.restitution(options, contact),
                is_soft: step.yields.get(i).is_some_and(|yields| *yields),
                joint,
            }
        });
        Some(HeldTree {
            contacts: contacts.collect(),
            step,
            sand: sand.map(Arc::new),
        })
    }

    /// The contacts of that step.
    pub(crate) fn hold_step(
        &self,
        options: &StepOptions,
        ws: &ScratchOf<Self>,
    ) -> Option<HeldStep<Contact>> {
        let is_common = |contact: &Contact| {
            let pairs = &options.materials;
            contact.key.opposite != Opposite::Stop
                && (pairs.is_empty()
                    || (contact.between_materials(self.model, &**self.terrain, pairs)).is_none())
        };
        HeldStep::of(self, options, ws, is_common)
    }
}
