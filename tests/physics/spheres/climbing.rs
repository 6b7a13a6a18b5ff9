//! The step that a single driven wheel climbs from rest: at most `1 − 1/√(1 + μ²)` of its radius.
//!
//! A wheel at rest against an edge of height s carries its weight on the edge alone when
//! it begins to climb. The reaction then passes through the edge and is vertical; the
//! normal points from the edge to the centre, tilted by φ from the vertical with cos φ =
//! 1 − s/R. It is within the friction cone while tan φ ≤ μ: s/R ≤ 1 − 1/√(1 + μ²). The
//! torque that holds the wheel there is m g R sin φ. The edge is the top of a sphere of
//! a tenth of a millimetre on a plane that is one step lower.

use nalgebra::Vector3;
use rover_core::geometry::{Plane, SphereField};
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;

use super::sphere_scenes::placed;
use crate::shared::{model, near_in};

const R: f64 = 0.1;
const EDGE: f64 = 1e-4;

/// A wheel of radius R on a light arm that touches nothing; a weight far ahead takes the torque
/// reaction.
fn driven_wheel() -> Model {
    // The frame has a very large inertia: it takes the reaction of the torque with almost no
    // rotation, and weighs next to nothing.
    let text = r#"
name = "driven wheel"
[[solids]]
name = "frame"
mass = 1e-3
inertia = [1e4, 1e4, 1e4, 0.0, 0.0, 0.0]
shape = { kind = "box", size = [0.01, 0.01, 0.01] }
[[solids]]
name = "wheel"
parent = "frame"
position = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
mass = 30.0
shape = { kind = "disc", radius = 0.1 }
[[wheels]]
name = "W"
solid = "wheel"
axle = [0.0, 0.0, 1.0]
radius = 0.1
torque_limit = 1e3
drive_sign = -1.0
"#;
    model(text)
}

/// Whether the wheel, at rest against an edge of `height`, is on top of it in the end.
fn climbs(height: f64, mu: f64) -> bool {
    // The edge's top is at y = 0, the ground below it; the wheel stands on
    // it and leans on the edge.
    let ground = Plane::new([0.0, 1.0, 0.0], height).unwrap();
    let field = SphereField::new(&[[0.0, -EDGE, 0.0]], &[EDGE], Some(ground)).unwrap();
    let options = StepOptions {
        friction_coefficient: mu,
        time_step: 0.001,
        ..StepOptions::default()
    };
    // centre at R − height above the top, at the distance R + EDGE from the sphere's centre
    let up = R - height + EDGE;
    let back = ((R + EDGE).powi(2) - up * up).sqrt();
    let start = Vector3::new(-back, R - height, 0.0);
    let mut wheel = placed(driven_wheel(), field, options, start);
    // A little more torque than holds the wheel on the edge
    let sine = back / (R + EDGE);
    wheel
        .set_wheel_torques(&[1.002 * 30.001 * 9.81 * R * sine])
        .unwrap();
    for _ in 0..4000 {
        assert!(wheel.step(1).unwrap().is_converged());
        let position = wheel.q().position;
        if position.x > -0.2 * back {
            return position.y > R - 0.1 * height;
        }
    }
    false
}

#[test]
fn a_driven_wheel_climbs_what_the_friction_cone_allows_and_no_more() {
    for mu in [0.4_f64, 0.7, 1.0] {
        let limit = 1.0 - 1.0 / (1.0 + mu * mu).sqrt();
        let (mut low, mut high) = (0.5 * limit, 1.5 * limit);
        assert!(climbs(low * R, mu) && !climbs(high * R, mu), "μ = {mu}");
        while high - low > 1e-4 {
            let middle = 0.5 * (low + high);
            if climbs(middle * R, mu) {
                low = middle;
            } else {
                high = middle;
            }
        }
        // The edge's own radius is a thousandth of the wheel's.
        near_in(&mu, low, limit, 5e-3 * limit);
    }
}
