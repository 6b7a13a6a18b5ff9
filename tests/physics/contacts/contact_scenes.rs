//! Machines whose parts touch each other.

use rover_core::contact::{Activation, Contact, PairSearch, detect_pairs};
use rover_core::integrator::Variant;
use rover_core::multibody::{Kinematics, Model};
use rover_core::simulation::RoverSimulation;

use crate::shared::{flat, model, resting, stepping};

/// A chassis with a two-link arm; the second link, a box, a ball or a wheel, folds down onto the
/// chassis.
pub fn folding(last: &str) -> Model {
    let text = format!(
        r#"
name = "folding"
self_contact = true

[[solids]]
name = "chassis"
mass = 20.0
shape = {{ kind = "box", size = [1.0, 0.2, 0.6] }}
collides = true

[[solids]]
name = "shoulder"
parent = "chassis"
position = [-0.4, 0.3, 0.0]
axis = [0.0, 1.0, 0.0]
mass = 1.0
shape = {{ kind = "box", size = [0.1, 0.1, 0.1] }}

[[solids]]
name = "arm"
parent = "shoulder"
position = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
mass = 2.0
centre_of_mass = [0.3, 0.0, 0.0]
inertia = [0.01, 0.1, 0.1, 0.0, 0.0, 0.0]
shape = {{ kind = "box", size = [0.1, 0.1, 0.1] }}

[[solids]]
name = "tip"
parent = "arm"
position = [0.6, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
mass = 3.0
{last}
"#
    );
    model(&text)
}

/// The tips that an arm may have.
///
/// Cylinder, capsule and ellipsoid lie across the arm.
pub fn tips() -> Vec<(&'static str, f64)> {
    vec![
        (
            "shape = { kind = \"box\", size = [0.2, 0.1, 0.3] }\ncollides = true",
            0.05,
        ),
        (
            "shape = { kind = \"sphere\", radius = 0.1 }\ncollides = true",
            0.1,
        ),
        (
            "shape = { kind = \"disc\", radius = 0.15 }\n[[wheels]]\nname = \"W\"\nsolid = \"tip\"\naxle = [0.0, 0.0, 1.0]\nradius = 0.15\ntorque_limit = 1.0\ndrive_sign = 1.0",
            0.15,
        ),
        (
            "shapes = [{ kind = \"cylinder\", radius = 0.1, height = 0.3, rotation = [1.5707963267948966, 0.0, 0.0], collides = true }]",
            0.1,
        ),
        (
            "shapes = [{ kind = \"capsule\", radius = 0.1, height = 0.2, rotation = [1.5707963267948966, 0.0, 0.0], collides = true }]",
            0.1,
        ),
        (
            "shape = { kind = \"ellipsoid\", radii = [0.1, 0.1, 0.2] }\ncollides = true",
            0.1,
        ),
        (
            "shapes = [{ kind = \"hull\", collides = true, points = [[-0.1, -0.05, -0.15], [0.1, -0.05, -0.15], [-0.1, -0.05, 0.15], [0.1, -0.05, 0.15], [-0.05, 0.05, -0.1], [0.05, 0.05, -0.1], [-0.05, 0.05, 0.1], [0.05, 0.05, 0.1]] }]",
            0.05,
        ),
    ]
}

/// Contacts between a machine's bodies with a gap of at most 20 cm.
pub fn nearby(model: &Model, kinematics: &Kinematics) -> Vec<Contact> {
    let activation = Activation {
        lead: 0.0,
        hover: 0.2,
        slow: f64::INFINITY,
    };
    touching(model, kinematics, &activation)
}

fn touching(model: &Model, kinematics: &Kinematics, activation: &Activation) -> Vec<Contact> {
    let (at_rest, mut found) = (vec![0.0; model.nv()], Vec::new());
    let mut search = PairSearch::new(model);
    detect_pairs(
        model,
        kinematics,
        &at_rest,
        activation,
        &mut search,
        &mut found,
    );
    found
}

/// Current deepest gap between two bodies, m: 0 if none overlap.
pub fn overlap(simulation: &RoverSimulation) -> f64 {
    let found = touching(
        simulation.model(),
        &simulation.kinematics(),
        &Activation::default(),
    );
    found
        .iter()
        .fold(0.0, |deepest, contact| deepest.min(contact.gap))
}

/// A simulation on flat ground that starts at rest, with its base centre at the given height.
pub fn at_rest(model: Model, height: f64, joints: &[f64], variant: Variant) -> RoverSimulation {
    resting(model, flat(), stepping(variant, 0.005), |q| {
        q.position.y = height;
        q.joints.copy_from_slice(joints);
    })
}
