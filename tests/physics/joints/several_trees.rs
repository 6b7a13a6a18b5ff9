//! Several trees in one model.

use std::fmt::Write;
use std::sync::Arc;

use rover_core::integrator::{StepOptions, Variant};
use rover_core::multibody::{
    Configuration, JointKind, Model, ModelDescription, SolidDescription, coordinates,
};

use super::machines::{menagerie, model, simulation, solid, somewhere};
use crate::shared::{VARIANTS, apart, flat, moving, stepping};
use crate::spheres::sphere_scenes::Random;

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
            let mut run = simulation(model, stepping(Variant::Newton, 1e-3));
            run.set_state(start, rates);
            run.step(200).unwrap();
            ends.extend_from_slice(run.v());
        }
        let start = coordinates::from_public(&both, &q).unwrap();
        let mut run = simulation(both, stepping(Variant::Newton, 1e-3));
        run.set_state(start, v);
        run.step(200).unwrap();
        let off = apart(run.v(), &ends);
        assert!(off < 1e-6, "{first:?} {second:?}: {off}");
    }
}

/// A stone beside a rover does not affect the rover's fall and drive, and both rest on the ground.
#[test]
fn a_stone_lies_beside_a_rover() {
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
    let mut q = vec![0.0; 27];
    q[1] = 0.4;
    q[21..24].copy_from_slice(&[0.0, 0.3, 3.0]);
    let start = coordinates::from_public(&model, &q).unwrap();
    let options = stepping(Variant::Linearised, 5e-3);
    let mut run = moving(model.clone(), flat(), options, start, vec![0.0; 27]);
    run.set_wheel_torques(&[40.0; 6]).unwrap();
    run.step(600).unwrap();
    let end = coordinates::to_public(&model, run.q());
    assert!(end[0] > 1.0 && (end[1] - 0.35).abs() < 0.01, "{end:?}");
    assert!(apart(&end[21..24], &[0.0, 0.1, 3.0]) < 1e-3, "{end:?}");
    let on_stone = run
        .contacts()
        .iter()
        .filter(|a| a.contact.body == 16)
        .count();
    assert_eq!(on_stone, 4);
}

#[test]
fn a_machine_without_any_velocity_is_a_machine() {
    let mut run = simulation(
        model(vec![solid("post", None, JointKind::Fixed)]),
        stepping(Variant::Linearised, 1e-2),
    );
    assert_eq!(run.model().nv(), 0);
    run.step(3).unwrap();
    assert_eq!(*run.q(), Configuration::zero(run.model()));
}

/// Boxes with arms between stops, pushed by constant torques, fell in a heap. An audit from outside
/// found that steps gained up to a tenth of the energy at hand: the projection that moved an arm
/// out of its stop also moved it against its torque, and that work was not counted.
#[test]
fn what_the_audit_counts_is_what_an_audit_from_outside_finds() {
    let mut numbers = Random(3);
    for (scene, variant) in VARIANTS.into_iter().enumerate() {
        let mut text = String::from("name = \"heap\"\n");
        for k in 0..6 {
            let joint = ["revolute", "prismatic"][(scene + k) % 2];
            let (size, stop) = (numbers.between(0.2, 0.4), numbers.between(0.02, 0.2));
            write!(
                text,
                "[[solids]]\nname = \"b{k}\"\njoint = \"free\"\nmass = 3.0\ncollides = true\n\
                 shape = {{ kind = \"box\", size = [{size}, 0.2, 0.3] }}\n\
                 [[solids]]\nname = \"a{k}\"\nparent = \"b{k}\"\njoint = \"{joint}\"\n\
                 axis = [0.0, 0.0, 1.0]\nposition = [0.25, 0.0, 0.0]\nmass = 0.8\n\
                 collides = true\nshape = {{ kind = \"box\", size = [0.2, 0.08, 0.1] }}\n\
                 limits = {{ lower = -{stop}, upper = {stop} }}\n"
            )
            .unwrap();
        }
        let model = crate::shared::model(&text);
        let mut q = coordinates::to_public(&model, &Configuration::zero(&model));
        for (k, own) in q.chunks_exact_mut(7).enumerate() {
            let mut turn = || numbers.between(-0.5, 0.5);
            own[..6].copy_from_slice(&[turn(), 0.3, turn(), turn(), turn(), turn()]);
            own[1] += 0.35 * k as f64;
        }
        let start = coordinates::from_public(&model, &q).unwrap();
        let torques: Vec<f64> = (0..6).map(|_| numbers.between(-20.0, 20.0)).collect();
        let options = StepOptions {
            friction_coefficient: 0.0,
            ..stepping(variant, 0.01)
        };
        let v = vec![0.0; model.nv()];
        let mut heap = moving(model, flat(), options, start, v);
        heap.set_joint_torques(&torques).unwrap();
        let (mut most, mut lifted) = (0, 0.0);
        for step in 0..150 {
            let (before, places) = (heap.energy(), heap.q().joints.clone());
            let report = heap.step(1).unwrap();
            let (after, now) = (heap.energy(), &heap.q().joints);
            let turned = now.iter().zip(&places).map(|(now, then)| now - then);
            let work: f64 = torques
                .iter()
                .zip(turned)
                .map(|(t, turned)| t * turned)
                .sum();
            let gained = (after.kinetic - before.kinetic) + (after.potential - before.potential)
                - work
                - report.energy_lifted;
            let at_hand = before.kinetic.max(after.kinetic) + work.abs() + 1.0;
            assert!(
                gained < 1e-8 * at_hand,
                "{variant:?} {step}: {gained} {report:?}"
            );
            most = most.max(report.n_contacts);
            lifted += report.energy_lifted;
        }
        assert!(most >= 12 && lifted > 0.0, "{most} {lifted}");
    }
}
