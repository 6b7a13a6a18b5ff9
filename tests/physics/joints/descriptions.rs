//! Descriptions of joints: round trips, and errors that name the field.

use rover_core::multibody::{JointKind, Model, ModelDescription};

use super::machines::{ROOTS, machine, menagerie, solid};

#[test]
fn a_description_of_every_joint_survives_both_formats() {
    for root in ROOTS {
        let model = menagerie(root);
        let description = model.description();
        let toml = ModelDescription::from_toml(&description.to_toml().unwrap()).unwrap();
        let json = ModelDescription::from_json(&description.to_json().unwrap()).unwrap();
        assert_eq!(&toml, description);
        assert_eq!(&json, description);
        let again = Model::from_description(toml).unwrap();
        assert_eq!(again.fingerprint(), model.fingerprint());
    }
}

/// A joint locked at a value has the pose of the free joint at that value.
#[test]
fn a_locked_slide_stands_where_the_free_one_is() {
    let mut slide = solid("slide", Some("body"), JointKind::Prismatic);
    slide.axis = Some([0.6, 0.0, 0.8]);
    slide.rotation = Some([0.3, -0.2, 0.5]);
    let free = Model::from_description(machine(vec![solid("body", None, JointKind::Free), slide]))
        .unwrap();
    let locked = free.with_locked_joints(&[("slide".into(), 0.7)]).unwrap();
    assert_eq!((free.nv(), locked.nv()), (7, 6));
    let q = rover_core::multibody::Configuration::zero(&free);
    let mut moved = q;
    moved.joints[0] = 0.7;
    let kinematics = rover_core::multibody::Kinematics::of(&free, &moved);
    let frame = &locked.frames()[1];
    assert!((frame.position - kinematics.r(1)).norm() < 1e-15);
    assert!((frame.rotation - kinematics.R(1)).norm() < 1e-15);
}
