//! Coupled joints.

use rover_core::integrator::Variant;
use rover_core::multibody::{Configuration, JointKind, Kinematics, SolidDescription};

use super::machines::{energy, model, simulation, solid};
use crate::shared::{VARIANTS, follows, near, spring, stepping};

fn rocker(name: &str, z: f64, bob: f64) -> SolidDescription {
    let mut rocker = solid(name, Some("body"), JointKind::Revolute);
    rocker.position = Some([0.0, 0.0, z]);
    rocker.centre_of_mass = Some([bob, -0.3, 0.0]);
    rocker
}

/// The rockers of a differential on a fixed body: one coordinate with the inertia of both, `q̈ = Σ
/// c τ / Σ I`.
#[test]
fn a_differential_is_one_coordinate() {
    let base = solid("body", None, JointKind::Fixed);
    let (left, mut right) = (rocker("left", -0.5, 0.2), rocker("right", 0.5, 0.6));
    right.coupled = Some(follows("left", -1.0, 0.0));
    let model = model(vec![base, left, right]);
    assert_eq!((model.nv(), model.n_joints()), (1, 1));
    let h = 1e-6;
    let mut run = simulation(model, stepping(Variant::Linearised, h));
    run.step(1).unwrap();
    let disc = 0.5 * 0.1 * 0.1;
    let inertia = 2.0 * disc + (0.04 + 0.09) + (0.36 + 0.09);
    // The gravity torque on each about z is −m g x; the right rocker rotates the other way.
    let expected = -9.81 * (0.2 - 0.6) / inertia;
    let found = run.v()[0] / h;
    near(found, expected, 1e-4 * expected);
}

/// On a free body the coupled joint keeps its ratio, and free fall conserves energy and horizontal
/// linear momentum.
#[test]
fn a_follower_on_a_free_body_stays_where_the_ratio_says() {
    let body = solid("body", None, JointKind::Free);
    let (left, mut right) = (rocker("left", -0.5, 0.2), rocker("right", 0.5, 0.6));
    right.coupled = Some(follows("left", -0.5, 0.3));
    for variant in VARIANTS {
        let model = model(vec![body.clone(), left.clone(), right.clone()]);
        assert_eq!((model.nv(), model.n_joints()), (7, 1));
        let mut run = simulation(model, stepping(variant, 1e-3));
        let mut v = vec![0.0; 7];
        v[3..].copy_from_slice(&[0.5, -0.3, 0.2, 2.0]);
        run.set_state(Configuration::zero(run.model()), v);
        let (before, momentum) = (energy(&run), run.momentum());
        run.step(1000).unwrap();
        let q = run.q().joints[0];
        let kinematics: Kinematics = run.kinematics();
        let relative = kinematics.R(0).transpose() * kinematics.R(2);
        let angle = relative[(1, 0)].atan2(relative[(0, 0)]);
        assert!((angle - (0.3 - 0.5 * q)).abs() < 1e-12);
        // The fall releases some 150 J.
        assert!((energy(&run) - before).abs() < 1e-3);
        // Gravity is the only external force: the linear momentum changes by m g t.
        let change = run.momentum().linear - momentum.linear;
        assert!(
            (change.y + 3.0 * 9.81).abs() < 2e-5 && change.xz().norm() < 2e-5,
            "{change}"
        );
    }
}

/// A telescope whose second stage extends as far as the first: the tip moves at twice the speed.
#[test]
fn a_telescope_is_one_mass() {
    let mut first = solid("first", None, JointKind::Prismatic);
    first.axis = Some([0.0, 1.0, 0.0]);
    first.spring = Some(spring(50.0, 0.0));
    let mut second = solid("second", Some("first"), JointKind::Prismatic);
    second.axis = Some([0.0, 1.0, 0.0]);
    second.coupled = Some(follows("first", 1.0, 0.1));
    second.spring = Some(spring(30.0, 0.2));
    second.damping = Some(1.0);
    second.armature = Some(0.5);
    let h = 1e-6;
    let mut run = simulation(model(vec![first, second]), stepping(Variant::Linearised, h));
    let mut start = Configuration::zero(run.model());
    start.joints[0] = 0.4;
    run.set_state(start, vec![0.7]);
    let mass = 1.0 + 4.0 + 0.5;
    let force = -9.81 * 3.0 - 50.0 * 0.4 - 30.0 * (0.4 + 0.1 - 0.2) - 0.7;
    run.step(1).unwrap();
    let found = (run.v()[0] - 0.7) / h;
    near(found, force / mass, 1e-3);
}
