//! Descriptions of joints: round trips, and errors that name the field.

use rover_core::multibody::{JointKind, Model, ModelDescription, Spring};

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

#[test]
fn bad_joints_are_refused_by_field() {
    type Spoil = fn(&mut ModelDescription);
    let cases: [(&str, Spoil); 14] = [
        ("solids[0].position", |d| {
            d.solids[0].position = Some([0.0; 3]);
        }),
        ("solids[0].rotation", |d| {
            d.solids[0].rotation = Some([0.0; 3]);
        }),
        ("solids[0].damping", |d| d.solids[0].damping = Some(1.0)),
        ("solids[1].parent", |d| {
            d.solids[1].parent = Some("nothing".into());
        }),
        ("solids[1].position", |d| d.solids[1].position = None),
        ("solids[1].rotation", |d| {
            d.solids[1].rotation = Some([f64::NAN, 0.0, 0.0]);
        }),
        ("solids[1].spring.stiffness", |d| {
            d.solids[1].spring = Some(Spring {
                stiffness: -1.0,
                rest: 0.0,
            });
        }),
        ("solids[1].spring.rest", |d| {
            d.solids[1].spring = Some(Spring {
                stiffness: 1.0,
                rest: f64::INFINITY,
            });
        }),
        ("solids[1].damping", |d| d.solids[1].damping = Some(-1.0)),
        ("solids[1].armature", |d| {
            d.solids[1].armature = Some(f64::NAN);
        }),
        ("solids[2].axis", |d| {
            d.solids[2].axis = Some([1.0, 0.0, 0.0]);
        }),
        ("solids[2].armature", |d| d.solids[2].armature = Some(1.0)),
        ("solids[3].axis", |d| d.solids[3].axis = None),
        ("solids[4].locked", |d| d.solids[4].locked = Some(0.0)),
    ];
    let sound = machine(vec![
        solid("body", None, JointKind::Free),
        solid("arm", Some("body"), JointKind::Revolute),
        solid("ball", Some("arm"), JointKind::Spherical),
        solid("slide", Some("ball"), JointKind::Prismatic),
        solid("tool", Some("slide"), JointKind::Fixed),
    ]);
    Model::from_description(sound.clone()).unwrap();
    for (field, spoil) in cases {
        let mut description = sound.clone();
        spoil(&mut description);
        let error = Model::from_description(description).unwrap_err();
        assert_eq!(error.field(), field, "{error}");
    }
    // A free joint has no parent.
    let solids = vec![
        solid("body", None, JointKind::Free),
        solid("other", Some("body"), JointKind::Free),
    ];
    let error = Model::from_description(machine(solids)).unwrap_err();
    assert_eq!(error.field(), "solids[1].parent", "{error}");
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
