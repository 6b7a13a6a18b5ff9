//! Several machines in one description.

use std::collections::{HashMap, HashSet};

use super::{LoopDescription, MachineDescription, ModelDescription, SolidDescription};
use crate::multibody::error::{ModelError, ModelFault};

impl ModelDescription {
    /// Machines side by side, with loops between them. Names of solids, wheels, tags and loops get
    /// the name of their machine and a slash in front; those in `loops` have it already.
    #[must_use]
    pub fn joined(name: &str, parts: Vec<(String, Self)>, loops: Vec<LoopDescription>) -> Self {
        let mut joined = Self {
            name: name.to_owned(),
            ..Self::empty()
        };
        for (machine, mut part) in parts {
            part.state_treads();
            joined.add(&machine, part);
        }
        joined.loops.extend(loops);
        joined
    }

    fn add(&mut self, machine: &str, part: Self) {
        let named = |name: &str| format!("{machine}/{name}");
        let rename = |name: &mut String| *name = named(name);
        let first = (part.solids.first()).map_or_else(String::new, |solid| named(&solid.name));
        if part.machines.is_empty() {
            self.machines.push(MachineDescription {
                name: machine.to_owned(),
                first,
                self_contact: part.self_contact,
            });
        }
        for mut own in part.machines {
            [&mut own.name, &mut own.first].into_iter().for_each(rename);
            self.machines.push(own);
        }
        for mut solid in part.solids {
            solid.joint = Some(solid.joint_kind());
            rename(&mut solid.name);
            solid.parent.iter_mut().for_each(rename);
            (solid.coupled.iter_mut()).for_each(|own| rename(&mut own.joint));
            self.solids.push(solid);
        }
        for mut wheel in part.wheels {
            [&mut wheel.name, &mut wheel.solid]
                .into_iter()
                .for_each(rename);
            wheel.steering.iter_mut().for_each(rename);
            self.wheels.push(wheel);
        }
        for mut tag in part.tags {
            [&mut tag.name, &mut tag.solid].into_iter().for_each(rename);
            self.tags.push(tag);
        }
        for own in part.materials {
            if !self.materials.contains(&own) {
                self.materials.push(own);
            }
        }
        for mut own in part.loops {
            [&mut own.name, &mut own.solid].into_iter().for_each(rename);
            own.other.iter_mut().for_each(rename);
            self.loops.push(own);
        }
    }

    /// Index of the machine of every solid; 0 without machines.
    pub(in crate::multibody) fn machine_of_solids(&self) -> Vec<usize> {
        let mut next = 0;
        let machine_of = |solid: &SolidDescription| {
            let begins = self.machines.get(next);
            next += usize::from(begins.is_some_and(|machine| machine.first == solid.name));
            next.saturating_sub(1)
        };
        self.solids.iter().map(machine_of).collect()
    }
}

/// Checks that machines begin at roots, in the order of the solids, and that their wheels have the
/// same order.
pub(super) fn check_machines(
    description: &ModelDescription,
    solids: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    if description.machines.is_empty() {
        return Ok(());
    }
    if description.self_contact {
        return Err(ModelFault::OfAMachine.at("self_contact"));
    }
    let (mut names, mut least) = (HashSet::new(), 0);
    for (i, machine) in description.machines.iter().enumerate() {
        let at = |what: &str| format!("machines[{i}].{what}");
        if !names.insert(machine.name.as_str()) {
            return Err(ModelFault::DuplicateName(machine.name.clone()).at(at("name")));
        }
        let first = solids.get(machine.first.as_str()).copied();
        let is_first = first.is_some_and(|first| {
            description.solids[first].parent.is_none()
                && if i == 0 { first == 0 } else { first >= least }
        });
        if !is_first {
            return Err(ModelFault::NotAFirstSolid(machine.first.clone()).at(at("first")));
        }
        least = first.map_or(0, |first| first + 1);
    }
    let machines = description.machine_of_solids();
    let mut last = 0;
    for (i, wheel) in description.wheels.iter().enumerate() {
        let machine = solids.get(wheel.solid.as_str()).map_or(0, |&k| machines[k]);
        if machine < last {
            return Err(
                ModelFault::OtherMachine(description.machines[machine].name.clone())
                    .at(format!("wheels[{i}].solid")),
            );
        }
        last = machine;
    }
    Ok(())
}
