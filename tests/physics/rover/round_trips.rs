//! Descriptions through files, to the bit; what a snapshot belongs to; one wheel of one radius.

use proptest::prelude::*;
use rover_core::multibody::{Model, ModelDescription, SolidDescription};

/// Any double that a description may hold as a place, the shortest and the
/// longest to write among them.
fn place() -> impl Strategy<Value = f64> {
    prop_oneof![
        -1e6..1e6_f64,
        -1.0..1.0_f64,
        Just(-0.0),
        Just(f64::MIN_POSITIVE),
        Just(5e-324)
    ]
}

proptest! {
    #[test]
    fn a_description_is_the_same_to_the_bit_after_a_file(
        masses in prop::collection::vec(1e-9..1e9_f64, 16),
        positions in prop::collection::vec(prop::array::uniform3(place()), 15),
        locked in prop::collection::vec(prop::option::of(-1e3..1e3_f64), 15),
        contact_radius in prop::option::of(1e-3..1e3_f64),
    ) {
        let mut description = ModelDescription::rover();
        for (solid, mass) in description.solids.iter_mut().zip(&masses) {
            solid.mass = *mass;
        }
        for (i, solid) in description.solids.iter_mut().skip(1).enumerate() {
            solid.position = Some(positions[i]);
            solid.locked = locked[i];
        }
        description.wheels[2].contact_radius = contact_radius;
        let model = Model::from_description(description.clone()).unwrap();
        let free = locked.iter().filter(|angle| angle.is_none()).count();
        prop_assert_eq!(model.n_joints(), free);
        let toml = ModelDescription::from_toml(&description.to_toml().unwrap()).unwrap();
        let json = ModelDescription::from_json(&description.to_json().unwrap()).unwrap();
        for again in [toml, json] {
            for (solid, before) in again.solids.iter().zip(&description.solids) {
                prop_assert_eq!(solid.mass.to_bits(), before.mass.to_bits());
                prop_assert_eq!(solid.position.map(|x| x.map(f64::to_bits)), before.position.map(|x| x.map(f64::to_bits)));
            }
            prop_assert_eq!(&again, &description);
            let again = Model::from_description(again).unwrap();
            prop_assert_eq!(again.fingerprint(), model.fingerprint());
        }
    }
}

/// Common path entries of two bodies were found by comparing all with all: a chain of 3000 solids
/// never finished.
#[test]
fn shared_paths_are_those_that_a_comparison_finds() {
    let rover = ModelDescription::rover();
    let mut tree = rover.clone();
    tree.wheels.clear();
    // A random tree: the parent of solid i is one before it.
    for i in 16..60_usize {
        let parent = (i * i * 7919 + 13 * i) % i;
        tree.solids.push(SolidDescription {
            name: format!("solid {i}"),
            parent: Some(tree.solids[parent].name.clone()),
            locked: i.is_multiple_of(5).then_some(0.1),
            ..tree.solids[5].clone()
        });
    }
    for description in [rover, tree] {
        let model = Model::from_description(description).unwrap();
        for a in 0..model.bodies().len() {
            for b in 0..model.bodies().len() {
                let pairs = model.path(a).iter().zip(model.path(b));
                let shared = pairs.take_while(|(i, j)| i == j).count();
                assert_eq!(model.common_path(a, b), shared, "{a} {b}");
            }
        }
    }
}
