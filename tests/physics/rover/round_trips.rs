//! Descriptions through files, to the bit; what a snapshot belongs to; one wheel of one radius.

use std::sync::Arc;

use proptest::prelude::*;
use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{
    MAX_SOLIDS, Model, ModelDescription, ModelError, Shape, SolidDescription,
};
use rover_core::nalgebra::{Quaternion, UnitQuaternion};
use rover_core::simulation::{RoverSimulation, SnapshotError};

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

fn standing(model: Model) -> RoverSimulation {
    let ground = Arc::new(Plane::ground());
    RoverSimulation::new(Arc::new(model), ground, StepOptions::default()).unwrap()
}

/// Every number of a description distinguishes a machine: a snapshot of one does not fit another.
#[test]
fn a_snapshot_of_other_masses_is_refused() {
    type Change = fn(&mut ModelDescription);
    let changes: [Change; 6] = [
        |d| d.solids[3].mass *= 1.0 + f64::EPSILON,
        |d| d.solids[0].inertia = Some([40.0, 60.0, 50.0, 0.0, 0.0, 0.0]),
        |d| d.solids[2].centre_of_mass = Some([0.0, 1e-9, 0.0]),
        |d| d.solids[6].position = Some([-0.4, -0.1, -0.54]),
        |d| d.wheels[1].contact_radius = Some(0.11),
        |d| d.solids[1].locked = Some(0.0),
    ];
    let mut simulation = standing(Model::rover());
    let before = simulation.snapshot();
    for change in changes {
        let mut description = ModelDescription::rover();
        change(&mut description);
        let other = standing(Model::from_description(description).unwrap());
        let refused = simulation.restore(&other.snapshot());
        assert_eq!(refused, Err(SnapshotError::OtherModel));
        assert_eq!(simulation.snapshot(), before);
    }
}

/// A quaternion that was not of unit length rotated and stretched the rover, and steps continued.
#[test]
fn a_quaternion_that_is_no_rotation_is_refused() {
    let mut simulation = standing(Model::rover());
    let before = simulation.snapshot();
    for length in [0.0, 0.5, 1.0 + 1e-9, 2.0, f64::NAN] {
        let mut damaged = before.clone();
        let long = Quaternion::new(length, 0.0, 0.0, 0.0);
        damaged.state.configuration.attitude = UnitQuaternion::new_unchecked(long);
        let refused = simulation.restore(&damaged);
        assert_eq!(refused, Err(SnapshotError::Damaged), "{length}");
        assert_eq!(simulation.snapshot(), before);
    }
}

/// `wheel_radius` changed the radius of the contact and kept the inertia of a disc of 0.10 m.
#[test]
fn a_wheel_of_another_radius_is_another_disc() {
    let rover = Model::rover();
    let index = |m: &Model| m.bodies().iter().position(|b| b.name == "wheel_FL");
    let wheel = |m: &Model| m.bodies()[index(m).unwrap()].principal_inertia;
    let larger = rover.with_wheel_radius(0.25).unwrap();
    assert!((wheel(&larger) / 6.25 - wheel(&rover)).norm() < 1e-12);
    assert!((larger.wheels()[0].radius - 0.25).abs() < 1e-15);
    let touching = rover.with_contact_radius(0.25).unwrap();
    assert_eq!(wheel(&touching), wheel(&rover));
    assert!((touching.wheels()[0].radius - 0.25).abs() < 1e-15);
    // One radius throughout, and a stated inertia scales with it.
    assert_eq!(
        touching
            .with_wheel_radius(0.25)
            .unwrap()
            .description()
            .wheels[0]
            .contact_radius,
        None
    );
    let mut stated = ModelDescription::rover();
    for solid in &mut stated.solids {
        if solid.name == "wheel_FL" {
            solid.inertia = Some([0.08, 0.08, 0.16, 0.0, 0.0, 0.0]);
        }
    }
    let stated = Model::from_description(stated).unwrap();
    let larger = stated.with_wheel_radius(0.2).unwrap();
    assert!((wheel(&larger) - 4.0 * wheel(&stated)).norm() < 1e-12);
}

#[test]
fn a_radius_that_contradicts_the_shape_is_refused() {
    let mut description = ModelDescription::rover();
    description.wheels[4].radius = 0.3;
    let refused = Model::from_description(description).unwrap_err();
    assert_eq!(refused.field(), "wheels[4].radius");
    assert!(refused.to_string().contains("contact_radius"), "{refused}");
    let mut description = ModelDescription::rover();
    let solid = description.solids.iter_mut().find(|s| s.name == "wheel_ML");
    solid.unwrap().shape = Some(Shape::Box { size: [0.2; 3] });
    let model = Model::from_description(description).unwrap();
    assert!(matches!(
        model.with_wheel_radius(0.2),
        Err(ModelError::NotADisc { .. })
    ));
    assert!(model.with_contact_radius(0.2).is_ok());
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

#[test]
fn more_solids_than_a_model_may_have_are_refused() {
    let mut description = ModelDescription::rover();
    let last = description.solids[15].clone();
    for i in 16..=MAX_SOLIDS {
        description.solids.push(SolidDescription {
            name: format!("solid {i}"),
            ..last.clone()
        });
    }
    let refused = Model::from_description(description).unwrap_err();
    assert_eq!(refused.field(), "solids");
    assert!(refused.to_string().contains("1000 solids, are 1001"));
}
