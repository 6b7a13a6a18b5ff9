//! Wheels that stand on a line yield, unless their description says otherwise.
//!
//! Two contacts share the load of a rigid cylinder on rigid ground by micrometres: an axle that
//! tilts by a hair puts all of it on one end, and the path follows. Real wheels yield by more. A
//! cylinder whose stiffness is not stated deflects by [`DEFLECTION`] of its radius under its share
//! of the weight: the same machine at another size deflects in proportion.

use super::{ModelDescription, WheelDescription};

/// Deflection under a wheel's share of the weight, as a fraction of its radius: 0.03 mm for the
/// built-in rover's wheels of 0.1 m.
const DEFLECTION: f64 = 3e-4;

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.81;

impl WheelDescription {
    /// Leaves out what is stated of its tread.
    pub(in crate::multibody) fn forget_tread(&mut self) {
        self.stiffness = None;
        self.damping = None;
        self.tangential_ratio = None;
        self.relaxation_length = None;
    }

    /// Whether it touches a plane along a line: it has a width, and its edges are not rounded to a
    /// torus.
    fn stands_on_a_line(&self) -> bool {
        0.5 * self.width.unwrap_or(0.0) > self.rounding.unwrap_or(0.0)
    }
}

impl ModelDescription {
    /// Writes stiffness and critical damping into wheels that touch along a line and state none,
    /// and a relaxation length into those that yield and state none.
    pub(in crate::multibody) fn state_yielding(&mut self) {
        let mass: f64 = self.solids.iter().map(|solid| solid.mass).sum();
        let n = self.wheels.len();
        let lines = self
            .wheels
            .iter_mut()
            .filter(|wheel| wheel.stands_on_a_line());
        for wheel in lines.filter(|wheel| wheel.stiffness.is_none()) {
            let radius = wheel.contact_radius.unwrap_or(wheel.radius);
            let [stiffness, damping] = yielding(mass, n, radius);
            wheel.stiffness = Some(stiffness);
            wheel.damping = Some(damping);
        }
        let share = mass * GRAVITY / self.wheels.len() as f64;
        for wheel in &mut self.wheels {
            let radius = wheel.contact_radius.unwrap_or(wheel.radius);
            let soft = wheel.stiffness.filter(|stiffness| *stiffness > 0.0);
            if let (Some(stiffness), None) = (soft, wheel.relaxation_length) {
                let length = half_length(radius, share / stiffness);
                wheel.relaxation_length = Some(length.clamp(1e-9 * radius, radius));
            }
        }
    }
}

/// Stiffness (N/m) and critical damping (N s/m) of each of `n` wheels of a radius (m) that carry a
/// mass (kg). They are not rounded, so that they scale with the machine.
pub(super) fn yielding(mass: f64, n: usize, radius: f64) -> [f64; 2] {
    let deflection = DEFLECTION * radius;
    let stiffness = mass * GRAVITY / (n as f64 * deflection);
    let time = 2.0 * (deflection / GRAVITY).sqrt();
    [stiffness.min(1e12), (time * stiffness).min(1e12)]
}

/// Half the length of the contact of a wheel that is pressed onto a plane by a deflection, m: the
/// relaxation length of a tread whose points deflect one by one.
fn half_length(radius: f64, deflection: f64) -> f64 {
    (2.0 * radius * deflection).sqrt()
}

#[cfg(test)]
mod tests {
    use crate::multibody::Model;

    #[test]
    fn cylinders_yield_by_their_share_of_the_weight_and_what_is_stated_stays() {
        let mut wide = Model::rover().description().clone();
        let mass: f64 = wide.solids.iter().map(|solid| solid.mass).sum();
        for (i, wheel) in wide.wheels.iter_mut().enumerate() {
            wheel.width = [Some(0.1), Some(0.1), Some(0.1), None, Some(0.1), Some(0.1)][i];
            wheel.rounding = (i == 1).then_some(0.05);
            wheel.stiffness = [None, None, Some(0.0), None, Some(1e6), None][i];
        }
        let model = Model::from_description(wide).unwrap();
        let own: Vec<_> = (model.wheels().iter())
            .map(|wheel| wheel.tread.map(|own| own.stiffness))
            .collect();
        let share = mass * 9.81 / 6.0 / 3e-5;
        assert!((own[0].unwrap() / share - 1.0).abs() < 1e-12);
        assert_eq!(own[1..], [None, None, None, Some(1e6), own[0]]);
        let heavier = model.with_masses_scaled(1.3).unwrap();
        assert_eq!(heavier.wheels()[0].tread, model.wheels()[0].tread);
        let length = model.wheels()[0].tread.unwrap().relaxation_length;
        let half = (2.0 * model.wheels()[0].radius * 3e-5).sqrt();
        assert!((length / half - 1.0).abs() < 1e-12, "{length}");
    }
}
