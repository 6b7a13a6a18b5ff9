//! Gaps of all wheels, without the points and frames that only a step needs.

use nalgebra::Vector3;

use super::detection::wheel_gap;
use super::part::{place_wheel, wheel_shape};
use crate::geometry::{Plane, Terrain};
use crate::multibody::{Configuration, Kinematics, Model};

/// Gaps of wheels: scratch.
#[derive(Debug, Default)]
pub struct WheelGaps {
    kinematics: Option<Kinematics>,
}

impl WheelGaps {
    /// Writes the gap of every wheel (m) over a terrain: that of
    /// [`wheel_contact`](super::detection::wheel_contact).
    ///
    /// # Panics
    /// If there are not as many gaps as wheels.
    pub fn write(
        &mut self,
        model: &Model,
        configuration: &Configuration,
        terrain: &dyn Terrain,
        gaps: &mut [f64],
    ) {
        assert_eq!(gaps.len(), model.wheels().len(), "one gap a wheel");
        if !(self.kinematics.as_ref()).is_some_and(|own| own.is_of(model)) {
            self.kinematics = None;
        }
        let kinematics = (self.kinematics).get_or_insert_with(|| Kinematics::new(model));
        kinematics.update_for_step(model, configuration);
        if let Some(plane) = terrain.ground().filter(|_| terrain.is_plane()) {
            write_over_plane(model, kinematics, plane, gaps);
            return;
        }
        for (gap, wheel) in gaps.iter_mut().zip(model.wheels()) {
            let shape = wheel_shape(wheel, kinematics);
            let base = kinematics.origin(wheel.body);
            *gap = wheel_gap(&shape, wheel.tread.as_ref(), base, terrain);
        }
    }
}

/// The gap of the lowest point of every wheel over a plane: see
/// [`crate::geometry::query::disc_plane`] and [`crate::geometry::query::roller_plane`].
fn write_over_plane(model: &Model, kinematics: &Kinematics, plane: &Plane, gaps: &mut [f64]) {
    let n: Vector3<f64> = *plane.normal();
    for (gap, wheel) in gaps.iter_mut().zip(model.wheels()) {
        let disc = place_wheel(wheel, kinematics);
        let base = n.dot(kinematics.origin(wheel.body)) + plane.offset();
        let lean = n.dot(&disc.axle);
        let across = (n - disc.axle * lean).norm();
        let height = base + n.dot(&disc.centre);
        *gap = if wheel.is_wide() {
            let half = 0.5 * wheel.width - wheel.rounding;
            height - (wheel.radius - wheel.rounding) * across - half * lean.abs() - wheel.rounding
        } else {
            height - wheel.radius * across
        };
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::contact::detection::wheel_contacts;
    use crate::geometry::SphereField;
    use crate::multibody::{JointKind, ModelDescription, SolidDescription, coordinates};
    use proptest::prelude::*;

    /// The rover; the same with wide wheels, with a joint about no coordinate axis, and with one
    /// that slides.
    fn machines() -> [Model; 4] {
        let changed = |change: fn(&mut SolidDescription)| {
            let mut rover = ModelDescription::rover();
            let carried = rover.solids.iter_mut().find(|s| s.parent.is_some());
            change(carried.unwrap());
            Model::from_description(rover).unwrap()
        };
        let mut wide = ModelDescription::rover();
        for wheel in &mut wide.wheels {
            (wheel.width, wheel.rounding) = (Some(0.1), Some(0.02));
        }
        [
            Model::rover(),
            Model::from_description(wide).unwrap(),
            changed(|solid| solid.axis = Some([0.1, 0.2, 0.9])),
            changed(|solid| solid.joint = Some(JointKind::Prismatic)),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn gaps_are_those_of_the_contacts(q in prop::collection::vec(-1.0..1.0, 21)) {
            let plane = Plane::new([0.2, 1.0, -0.1], 0.3).unwrap();
            let (centres, radii) = ([[0.5, -0.2, 0.3], [-0.6, 0.0, 0.1]], [0.4, 0.2]);
            let field = SphereField::new(&centres, &radii, Some(plane)).unwrap();
            let grounds: [Arc<dyn Terrain>; 2] = [Arc::new(plane), Arc::new(field)];
            let mut scratch = WheelGaps::default();
            for model in machines() {
                let place = coordinates::from_public(&model, &q).unwrap();
                let poses = Kinematics::of(&model, &place);
                for ground in &grounds {
                    let mut gaps = vec![0.0; model.wheels().len()];
                    scratch.write(&model, &place, &**ground, &mut gaps);
                    let contacts = wheel_contacts(&model, &poses, &**ground);
                    for (gap, contact) in gaps.iter().zip(contacts) {
                        prop_assert!((gap - contact.gap).abs() < 1e-13, "{gap} {}", contact.gap);
                    }
                }
            }
        }
    }
}
