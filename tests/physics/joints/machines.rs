//! Machines and simulations of these tests.

use std::sync::Arc;

use nalgebra::Vector3;
use rover_core::contact::placement::resting_pose;
use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{
    Configuration, FORMAT, JointKind, Model, ModelDescription, SolidDescription, coordinates,
};
use rover_core::simulation::RoverSimulation;

use crate::shared::{follows, nothing};

/// A solid of 1 kg with a joint; all other fields have their defaults.
pub fn solid(name: &str, parent: Option<&str>, joint: JointKind) -> SolidDescription {
    let text = "mass = 1.0\nname = ''\nshape = { kind = 'disc', radius = 0.1 }";
    let plain: ModelDescription =
        ModelDescription::from_toml(&format!("name = ''\n[[solids]]\n{text}")).unwrap();
    let has_axis = matches!(joint, JointKind::Revolute | JointKind::Prismatic);
    SolidDescription {
        name: name.into(),
        parent: parent.map(Into::into),
        joint: Some(joint),
        position: (joint != JointKind::Free).then_some([0.0; 3]),
        axis: has_axis.then_some([0.0, 0.0, 1.0]),
        ..plain.solids[0].clone()
    }
}

pub fn machine(solids: Vec<SolidDescription>) -> ModelDescription {
    ModelDescription {
        self_contact: false,
        format: FORMAT,
        name: "machine".into(),
        solids,
        wheels: Vec::new(),
        tracks: Vec::new(),
        tags: Vec::new(),
        loops: Vec::new(),
        materials: Vec::new(),
        machines: Vec::new(),
    }
}

pub fn model(solids: Vec<SolidDescription>) -> Model {
    Model::from_description(machine(solids)).unwrap()
}

pub fn simulation(model: Model, options: StepOptions) -> RoverSimulation {
    RoverSimulation::new(Arc::new(model), nothing(), options).unwrap()
}

/// Where a machine rests on level ground.
pub fn standing(model: &Model) -> Configuration {
    let q = resting_pose(model, &Plane::ground(), [0.0, 0.0], 0.0).unwrap();
    coordinates::from_public(model, &q).unwrap()
}

/// Coordinate of a joint, rad or m.
pub fn joint(run: &RoverSimulation, name: &str) -> f64 {
    run.q().joints[run.model().joint_index(name).unwrap()]
}

/// A generic configuration and velocity: smooth functions of the seed.
pub fn somewhere(model: &Model, seed: f64) -> (Configuration, Vec<f64>) {
    let mut q = Configuration::zero(model);
    let way: Vec<f64> = (0..model.nv())
        .map(|k| (seed + 1.3 * k as f64).cos())
        .collect();
    let v = (0..model.nv())
        .map(|k| (2.0 * seed + 1.7 * k as f64).sin())
        .collect();
    q.advance(model, &way, 1.0);
    (q, v)
}

/// A tree with every joint type, on a root of the given type.
pub fn menagerie(root: JointKind) -> Model {
    let mut solids = vec![
        solid("root", None, root),
        solid("arm", Some("root"), JointKind::Revolute),
        solid("slider", Some("arm"), JointKind::Prismatic),
        solid("ball", Some("slider"), JointKind::Spherical),
        solid("bracket", Some("ball"), JointKind::Fixed),
        solid("tip", Some("bracket"), JointKind::Revolute),
        solid("left", Some("root"), JointKind::Revolute),
        solid("right", Some("root"), JointKind::Revolute),
        solid("foot", Some("right"), JointKind::Prismatic),
        solid("finger", Some("tip"), JointKind::Prismatic),
    ];
    for (i, solid) in solids.iter_mut().enumerate().skip(1) {
        let x = i as f64;
        solid.position = Some([0.3 * x.sin(), 0.4 * x.cos(), 0.2 * (2.0 * x).sin()]);
        solid.rotation = Some([0.5 * (3.0 * x).sin(), -0.4, 0.2 * x.cos()]);
        solid.axis = solid.axis.map(|_| [x.cos(), 0.3, x.sin()]);
        solid.mass = 0.5 + 0.2 * x;
        solid.inertia = Some([0.05 + 0.004 * x, 0.06, 0.07, 0.01, -0.005, 0.002]);
        solid.centre_of_mass = Some([0.05, -0.1 * x.sin(), 0.08]);
    }
    for (follower, leader, ratio) in [("right", "left", -1.0), ("finger", "arm", 0.4)] {
        let coupled = follows(leader, ratio, 0.2);
        let solid = solids.iter_mut().find(|s| s.name == follower).unwrap();
        solid.coupled = Some(coupled);
    }
    solids[2].armature = Some(0.3);
    if root != JointKind::Free {
        solids[0].position = Some([0.5, 1.0, -0.3]);
        solids[0].rotation = Some([0.3, 0.2, -0.5]);
    }
    model(solids)
}

pub const ROOTS: [JointKind; 5] = [
    JointKind::Free,
    JointKind::Fixed,
    JointKind::Revolute,
    JointKind::Prismatic,
    JointKind::Spherical,
];

/// Total energy including gravity, J.
pub fn energy(simulation: &RoverSimulation) -> f64 {
    simulation.energy().total()
}

pub const GRAVITY: Vector3<f64> = Vector3::new(0.0, -9.81, 0.0);
