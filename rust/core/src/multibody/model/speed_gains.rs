//! Gains of the wheels' speed servos.
//!
//! A wheel that rolls accelerates its spin inertia I and its share m/n of the machine. The default
//! gain brings both to the set speed within a time constant T:
//!
//! ```text
//! k = (I + (m/n) r²) / T
//! ```
//!
//! The speed that such a servo lacks is T times the acceleration that its load amounts to, whatever
//! the size of the machine: on a slope of 10 degrees 0.9 mm/s, at the friction limit 3.4 mm/s.
//!
//! T is a tenth of the default time step. On fields of rocks the rovers of the gallery repeat 0.6
//! to 12% of their steps, as many as with 0.1 ms. With 5 ms they repeat 0.2 to 13%, and a rover
//! that skids turns by a fifth less than its wheels ask.

use nalgebra::Vector3;

use super::Body;
use super::parts::Wheel;
use super::properties::JointProperties;
use crate::multibody::description::ModelDescription;

/// T, s.
const TIME: f64 = 5e-4;

/// Sets the gain of every wheel: as stated, or the default.
pub(super) fn set_speed_gains(
    wheels: &mut [Wheel],
    description: &ModelDescription,
    bodies: &[Body],
    joints: &[JointProperties],
) {
    let machines = description.machine_of_solids();
    let machine_of = |name: &str| {
        let mut solids = description.solids.iter().zip(&machines);
        solids.find_map(|(solid, &own)| (solid.name == name).then_some(own))
    };
    let of_wheels: Vec<_> = (description.wheels.iter())
        .map(|wheel| machine_of(&wheel.solid))
        .collect();
    for (i, (wheel, stated)) in wheels.iter_mut().zip(&description.wheels).enumerate() {
        let solids = description.solids.iter().zip(&machines);
        let own = solids.filter(|(_, own)| of_wheels[i] == Some(**own));
        let mass: f64 = own.map(|(solid, _)| solid.mass).sum();
        let n = of_wheels.iter().filter(|own| **own == of_wheels[i]).count();
        let rotor = wheel.joint.map_or(0.0, |j| joints[j].passive.armature);
        let spin = spin_inertia(&bodies[wheel.body], &wheel.axle) + rotor * wheel.share;
        let rolling = spin + mass / n as f64 * wheel.radius * wheel.radius;
        wheel.speed_gain = stated.speed_gain.unwrap_or(rolling / TIME);
    }
}

/// Inertia of a body about an axle through its mass centre, kg m².
fn spin_inertia(body: &Body, axle: &Vector3<f64>) -> f64 {
    let along = body.principal_axes.map_or(*axle, |P| P.transpose() * axle);
    along.component_mul(&along).dot(&body.principal_inertia)
}
