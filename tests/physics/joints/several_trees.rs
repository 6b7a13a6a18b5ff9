//! Several trees in one model.

use rover_core::integrator::Variant;
use rover_core::multibody::{
    Configuration, JointKind, Model, ModelDescription, ModelError, SolidDescription, coordinates,
};

use super::machines::{machine, menagerie, model, options, simulation, solid, somewhere};

/// The solids of a description under other names.
fn renamed(description: &ModelDescription, prefix: &str) -> Vec<SolidDescription> {
    let name = |name: &String| format!("{prefix}{name}");
    let rename = |solid: &SolidDescription| {
        let mut solid = solid.clone();
        solid.name = name(&solid.name);
        solid.parent = solid.parent.as_ref().map(name);
        if let Some(coupled) = &mut solid.coupled {
            coupled.joint = name(&coupled.joint);
        }
        solid
    };
    description.solids.iter().map(rename).collect()
}

/// Without contact two trees move as each does alone, except for the audit of their total energy.
#[test]
fn two_trees_move_as_each_alone() {
    for (first, second) in [
        (JointKind::Free, JointKind::Spherical),
        (JointKind::Fixed, JointKind::Free),
        (JointKind::Free, JointKind::Free),
    ] {
        let alone = [menagerie(first), menagerie(second)];
        let mut solids = renamed(alone[0].description(), "a_");
        solids.extend(renamed(alone[1].description(), "b_"));
        let both = model(solids);
        assert_eq!(both.nv(), alone[0].nv() + alone[1].nv());
        assert_eq!(both.trees().len(), 2);
        let mut q = Vec::new();
        let mut v = Vec::new();
        let mut ends = Vec::new();
        for (model, seed) in alone.into_iter().zip([0.4, 1.7]) {
            let (start, mut rates) = somewhere(&model, seed);
            for rate in &mut rates {
                *rate *= 0.2;
            }
            q.extend(coordinates::to_public(&model, &start));
            v.extend_from_slice(&rates);
            let mut run = simulation(model, options(1e-3, Variant::Newton));
            run.set_state(start, rates);
            run.step(200).unwrap();
            ends.extend_from_slice(&run.state().v);
        }
        let start = coordinates::from_public(&both, &q).unwrap();
        let mut run = simulation(both, options(1e-3, Variant::Newton));
        run.set_state(start, v);
        run.step(200).unwrap();
        for (k, (together, alone)) in run.state().v.iter().zip(&ends).enumerate() {
            assert!(
                (together - alone).abs() < 1e-6,
                "{first:?} {second:?} {k}: {together} {alone}"
            );
        }
    }
}

/// A stone beside a rover does not affect the rover's fall and drive, and both rest on the ground.
#[test]
fn a_stone_lies_beside_a_rover() {
    use rover_core::geometry::Plane;
    use std::sync::Arc;
    let mut description = ModelDescription::rover();
    let mut stone = solid("stone", None, JointKind::Free);
    stone.shape = Some(rover_core::multibody::Shape::Box {
        size: [0.4, 0.2, 0.3],
    });
    stone.collides = true;
    stone.mass = 20.0;
    description.solids.push(stone);
    let model = Arc::new(Model::from_description(description).unwrap());
    assert_eq!(model.nv(), 27);
    let ground = Arc::new(Plane::ground());
    let mut run = rover_core::simulation::RoverSimulation::new(
        model.clone(),
        ground,
        options(5e-3, Variant::Linearised),
    )
    .unwrap();
    let mut q = vec![0.0; 27];
    q[1] = 0.4;
    q[21..24].copy_from_slice(&[0.0, 0.3, 3.0]);
    run.set_state(coordinates::from_public(&model, &q).unwrap(), vec![0.0; 27]);
    run.set_wheel_torques(&[40.0; 6]).unwrap();
    run.step(600).unwrap();
    let end = coordinates::to_public(&model, &run.state().configuration);
    assert!(end[0] > 1.0 && (end[1] - 0.35).abs() < 0.01, "{end:?}");
    let expected = [0.0, 0.1, 3.0];
    for (x, y) in end[21..24].iter().zip(expected) {
        assert!((x - y).abs() < 1e-3, "{end:?}");
    }
    let on_stone = run
        .contacts()
        .iter()
        .filter(|a| a.contact.body == 16)
        .count();
    assert_eq!(on_stone, 4);
}

#[test]
fn trees_are_listed_one_after_the_other() {
    let solids = vec![
        solid("a", None, JointKind::Free),
        solid("b", None, JointKind::Free),
        solid("c", Some("a"), JointKind::Revolute),
    ];
    let error = Model::from_description(machine(solids)).unwrap_err();
    assert_eq!(error.field(), "solids[2].parent");
    assert!(matches!(error, ModelError::OtherTree { .. }), "{error}");
}

#[test]
fn a_machine_without_any_velocity_is_a_machine() {
    let mut run = simulation(
        model(vec![solid("post", None, JointKind::Fixed)]),
        options(1e-2, Variant::Linearised),
    );
    assert_eq!(run.model().nv(), 0);
    run.step(3).unwrap();
    assert_eq!(run.state().configuration, Configuration::zero(run.model()));
}
