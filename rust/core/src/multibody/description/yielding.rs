//! Wheels that yield: how a description states it, and what that is in newtons and metres.
//!
//! A `deflection` has no unit. It is a share of the radius, under the wheel's share of the weight,
//! so that the same machine at another size deflects in proportion.
//!
//! Two contacts share the load of a rigid cylinder on rigid ground by micrometres: an axle that
//! tilts by a hair puts all of it on one end, and the path follows. Real wheels yield by more. A
//! cylinder that states nothing has a deflection of [`DEFLECTION`].

use super::{ModelDescription, WheelDescription};
use crate::law::compliance::Tread;

/// Deflection of a cylinder: 0.03 mm for the built-in rover's wheels of 0.1 m.
const DEFLECTION: f64 = 3e-4;

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.81;

/// The machine on a wheel.
#[derive(Clone, Copy)]
pub(super) struct Share {
    /// Mass of the machine, kg.
    pub mass: f64,
    /// Number of its wheels.
    pub n: usize,
}

impl WheelDescription {
    /// Leaves out what is stated of its tread.
    pub(in crate::multibody) fn forget_tread(&mut self) {
        self.deflection = None;
        self.stiffness = None;
        self.damping = None;
        self.tangential_ratio = None;
        self.relaxation_length = None;
    }

    /// Whether the wheel touches a plane along a line: it has a width, and its edges are not
    /// rounded to a torus.
    fn stands_on_a_line(&self) -> bool {
        0.5 * self.width.unwrap_or(0.0) > self.rounding.unwrap_or(0.0)
    }

    /// Tread of the wheel; `None` for a rigid wheel.
    fn tread(&self, share: Share) -> Option<Tread> {
        let radius = self.contact_radius.unwrap_or(self.radius);
        let stated = self
            .deflection
            .map(|deflection| share.yielding(deflection, radius));
        let [stiffness, damping] = match (self.stiffness, stated) {
            (Some(stiffness), _) => [stiffness, self.damping.unwrap_or(0.0)],
            (None, Some([stiffness, critical])) => [stiffness, self.damping.unwrap_or(critical)],
            (None, None) => return None,
        };
        if stiffness <= 0.0 {
            return None;
        }
        let relaxation_length = self.relaxation_length.unwrap_or_else(|| {
            let length = half_length(radius, share.weight() / stiffness);
            length.clamp(1e-9 * radius, radius)
        });
        Some(Tread {
            stiffness,
            damping,
            tangential_ratio: self.tangential_ratio.unwrap_or(1.0),
            relaxation_length,
            radius,
        })
    }
}

impl ModelDescription {
    /// Writes a deflection into wheels that touch along a line and do not say how they yield.
    pub(in crate::multibody) fn state_deflections(&mut self) {
        for wheel in &mut self.wheels {
            if wheel.stands_on_a_line() && wheel.stiffness.is_none() {
                wheel.deflection = wheel.deflection.or(Some(DEFLECTION));
            }
        }
    }

    /// The treads of all wheels; `None` for rigid ones.
    pub(in crate::multibody) fn treads(&self) -> Vec<Option<Tread>> {
        let share = Share {
            mass: self.solids.iter().map(|solid| solid.mass).sum(),
            n: self.wheels.len(),
        };
        let wheels = self.wheels.iter();
        wheels.map(|wheel| wheel.tread(share)).collect()
    }

    /// Writes stiffness, damping and relaxation length of all wheels that yield in place of their
    /// deflections. They then stay when the masses change or the machine becomes a part of another.
    pub(in crate::multibody) fn state_treads(&mut self) {
        let treads = self.treads();
        for (wheel, tread) in self.wheels.iter_mut().zip(treads) {
            let Some(tread) = tread else { continue };
            wheel.deflection = None;
            wheel.stiffness = Some(tread.stiffness);
            wheel.damping = Some(tread.damping);
            wheel.relaxation_length = Some(tread.relaxation_length);
        }
    }
}

impl Share {
    /// Weight on a wheel, N.
    fn weight(self) -> f64 {
        self.mass * GRAVITY / self.n as f64
    }

    /// Stiffness (N/m) and critical damping (N s/m) of a wheel of a radius (m). They are not
    /// rounded, so that they scale with the machine.
    fn yielding(self, deflection: f64, radius: f64) -> [f64; 2] {
        let deflection = deflection * radius;
        let stiffness = self.mass * GRAVITY / (self.n as f64 * deflection);
        let time = 2.0 * (deflection / GRAVITY).sqrt();
        [stiffness.min(1e12), (time * stiffness).min(1e12)]
    }

    /// Stiffness (N/m) and critical damping (N s/m) of a cylinder of a radius (m) with the default
    /// deflection.
    pub fn of_cylinder(self, radius: f64) -> [f64; 2] {
        self.yielding(DEFLECTION, radius)
    }
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
            wheel.deflection = (i == 5).then_some(6e-4);
        }
        let model = Model::from_description(wide).unwrap();
        let own: Vec<_> = (model.wheels().iter())
            .map(|wheel| wheel.tread.map(|own| own.stiffness))
            .collect();
        let share = mass * 9.81 / 6.0 / 3e-5;
        assert!((own[0].unwrap() / share - 1.0).abs() < 1e-12);
        assert!((own[5].unwrap() / share - 0.5).abs() < 1e-12);
        assert_eq!(own[1..5], [None, None, None, Some(1e6)]);
        let heavier = model.with_masses_scaled(1.3).unwrap();
        assert_eq!(heavier.wheels()[0].tread, model.wheels()[0].tread);
        let tread = model.wheels()[0].tread.unwrap();
        let half = (2.0 * model.wheels()[0].radius * 3e-5).sqrt();
        assert!(
            (tread.relaxation_length / half - 1.0).abs() < 1e-12,
            "{tread:?}"
        );
        let critical = 2.0 * (tread.stiffness * mass / 6.0).sqrt();
        assert!((tread.damping / critical - 1.0).abs() < 1e-12, "{tread:?}");
    }

    #[test]
    fn a_machine_states_its_deflections_and_a_part_of_another_its_stiffness() {
        let model = Model::gallery_rover();
        let parts = ["a", "b"].map(|name| (name.to_owned(), model.description().clone()));
        let joined = Model::joined("two", parts.to_vec(), Vec::new()).unwrap();
        assert_eq!(model.description().wheels[0].stiffness, None);
        for wheel in joined.wheels() {
            assert_eq!(wheel.tread, model.wheels()[0].tread);
        }
    }
}
