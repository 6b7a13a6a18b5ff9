//! The machines of a model: which solids, coordinates, joints and wheels are whose.

use std::ops::Range;

use super::properties::JointProperties;
use super::tree::Tree;
use crate::multibody::description::ModelDescription;

/// What belongs to one of the machines of a model, in the order of its arrays.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MachineSpan {
    /// Name of the machine.
    pub name: String,
    /// Indices of the machine's solids.
    pub solids: Range<usize>,
    /// Indices of the machine's velocities, and of its coordinates in public arrays.
    pub velocities: Range<usize>,
    /// Indices of the machine's joints.
    pub joints: Range<usize>,
    /// Indices of the machine's wheels.
    pub wheels: Range<usize>,
}

/// The machines of a description. Notes in each tree whether its parts collide.
pub(super) fn machines_of(
    description: &ModelDescription,
    solid_of_body: &[usize],
    trees: &mut [Tree],
    joints: &[JointProperties],
) -> Vec<MachineSpan> {
    let of_solid = description.machine_of_solids();
    let of_tree: Vec<usize> = (trees.iter())
        .map(|tree| of_solid[solid_of_body[tree.bodies.start]])
        .collect();
    for (tree, &machine) in trees.iter_mut().zip(&of_tree) {
        let machine = description.machines.get(machine);
        tree.self_contact = machine.map_or(description.self_contact, |own| own.self_contact);
    }
    let of_wheel = |name: &str| {
        let solid = description.solids.iter().position(|own| own.name == name);
        solid.map_or(0, |solid| of_solid[solid])
    };
    let of_wheels: Vec<usize> = (description.wheels.iter())
        .map(|wheel| of_wheel(&wheel.solid))
        .collect();
    let of_joints: Vec<usize> = (joints.iter())
        .map(|joint| of_solid[solid_of_body[joint.body]])
        .collect();
    let of_velocities: Vec<usize> = (trees.iter().zip(&of_tree))
        .flat_map(|(tree, &machine)| tree.velocities.clone().map(move |_| machine))
        .collect();
    let span = |machine: usize, owners: &[usize]| {
        let start = owners.partition_point(|&own| own < machine);
        start..owners.partition_point(|&own| own <= machine)
    };
    let names: Vec<&str> = match description.machines.as_slice() {
        [] => vec![&description.name],
        machines => machines.iter().map(|own| own.name.as_str()).collect(),
    };
    let made = names.iter().enumerate().map(|(machine, name)| MachineSpan {
        name: (*name).to_owned(),
        solids: span(machine, &of_solid),
        velocities: span(machine, &of_velocities),
        joints: span(machine, &of_joints),
        wheels: span(machine, &of_wheels),
    });
    made.collect()
}
