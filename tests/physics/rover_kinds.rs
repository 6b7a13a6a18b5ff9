//! Rovers with rollers, dry joints, tracks and a bar differential.

use std::f64::consts::FRAC_PI_2;

use rover_core::multibody::description::{LoopDescription, LoopKind, TrackDescription};
use rover_core::multibody::{JointKind, ModelDescription, SolidDescription};

/// The built-in rover on mecanum and omni wheels.
pub fn mecanum() -> ModelDescription {
    let mut own = ModelDescription::rover();
    for (k, wheel) in own.wheels.iter_mut().enumerate() {
        wheel.rollers = Some([0.8, -0.8, FRAC_PI_2][(k + k / 3) % 3]);
    }
    own
}

/// A rover with dry friction in the bearings of its wheels and of what carries them, N m.
pub fn dry(mut own: ModelDescription, of_wheels: f64, of_rockers: f64) -> ModelDescription {
    for solid in &mut own.solids {
        let carries = ["bogie", "rocker", "front_axle"];
        if solid.name.contains("wheel") {
            solid.friction = Some(of_wheels);
        } else if solid.coupled.is_none() && carries.iter().any(|own| solid.name.ends_with(own)) {
            solid.friction = Some(of_rockers);
        }
    }
    own
}

/// A vehicle on two tracks of `n` wheels.
pub fn tracked(n: usize) -> ModelDescription {
    let mut hull = ModelDescription::rover().solids[0].clone();
    hull.name = "hull".into();
    let track = |name: &str, z: f64| TrackDescription {
        name: name.into(),
        solid: "hull".into(),
        from: [0.6, -0.25, z],
        to: [-0.6, -0.25, z],
        wheels: n,
        radius: 0.15,
        axle: [0.0, 0.0, 1.0],
        mass: 20.0,
        width: None,
        rounding: None,
        stiffness: None,
        damping: None,
        material: None,
        hold: None,
        torque_limit: 400.0,
        drive_sign: -1.0,
        motor: None,
        speed_gain: None,
    };
    ModelDescription {
        name: "tracked".into(),
        solids: vec![hull],
        wheels: Vec::new(),
        tags: Vec::new(),
        tracks: vec![track("left", -0.4), track("right", 0.4)],
        ..ModelDescription::rover()
    }
}

/// Height of the bar over the pivots of the rockers and length of its arms, m.
const HEIGHT: f64 = 0.1;
const ARM: f64 = 0.12;

/// Length of the rods, m.
const ROD: f64 = 0.15;

fn light(name: &str, parent: &str, joint: JointKind, position: [f64; 3]) -> SolidDescription {
    SolidDescription {
        name: name.into(),
        parent: Some(parent.into()),
        joint: Some(joint),
        position: Some(position),
        mass: 1e-3,
        inertia: Some([1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0]),
        ..SolidDescription::default()
    }
}

/// The open-source rover with a bar on the body that turns about the vertical, and a rod from
/// either end of it to the rocker below: forward on the left, backward on the right, so that one
/// side is the other turned by half a turn.
pub fn with_a_bar() -> ModelDescription {
    let mut rover = ModelDescription::named("open-rover").unwrap();
    let rockers = ["left_rocker", "right_rocker"];
    for rocker in rover
        .solids
        .iter_mut()
        .filter(|s| rockers.contains(&s.name.as_str()))
    {
        rocker.coupled = None;
    }
    rover.solids.push(SolidDescription {
        axis: Some([0.0, 1.0, 0.0]),
        ..light(
            "bar",
            "trunk",
            JointKind::Revolute,
            [0.0, -0.03 + HEIGHT, 0.0],
        )
    });
    for (side, rocker, sign) in [("left", rockers[0], -1.0), ("right", rockers[1], 1.0)] {
        rover.solids.push(light(
            &format!("{side}_rod"),
            "bar",
            JointKind::Spherical,
            [0.0, 0.0, sign * ARM],
        ));
        rover.loops.push(LoopDescription {
            name: format!("{side}_joint"),
            kind: LoopKind::Connect,
            solid: format!("{side}_rod"),
            other: Some(rocker.into()),
            position: Some([-sign * ROD, 0.0, 0.0]),
            other_position: Some([-sign * ROD, HEIGHT, 0.0]),
            other_rotation: None,
            polynomial: None,
        });
    }
    rover
}
