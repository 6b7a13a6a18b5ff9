//! The gap's gradient is n·J: along any motion the gap changes by the
//! normal velocity of the material point.

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use rover_core::contact::{Contact, ContactFrame, ContactKey, Part, relocate};
use rover_core::geometry::SphereField;
use rover_core::multibody::{Configuration, Kinematics, Model};

use super::sphere_scenes::field;

/// Contact of a part with the only sphere of a field.
fn contact_at(
    model: &Model,
    field: &SphereField,
    configuration: &Configuration,
    part: Part,
) -> Contact {
    let mut contact = Contact {
        key: ContactKey::on_ground(part, 0, 1),
        part,
        body: part.body(model),
        other: None,
        point: Vector3::zeros(),
        frame: ContactFrame::of_normal(&Vector3::y()),
        gap: 0.0,
        excess: 0.0,
    };
    relocate(
        model,
        &Kinematics::of(model, configuration),
        field,
        &mut contact,
    );
    contact
}

proptest! {
    #[test]
    fn the_gap_changes_by_the_normal_velocity(
        part in 0..9_usize,
        place in prop::array::uniform3(-0.7..0.7),
        turn in prop::array::uniform3(-2.0..2.0),
        joints in prop::collection::vec(-0.5..0.5, 15),
        v in prop::collection::vec(-1.0..1.0, 21),
        radius in 0.02..0.5,
    ) {
        let model = Model::rover();
        let part = if part < 6 { Part::Wheel(part) } else { Part::Box(part - 6) };
        let start = Configuration {
            position: Vector3::new(3.0, 2.0, -1.0),
            attitude: UnitQuaternion::from_scaled_axis(Vector3::from(turn)),
            joints,
            ..Configuration::zero(&model)
        };
        let field = field(&[[place[0] + 3.0, place[1] + 1.8, place[2] - 1.0, radius]]);
        let contact = contact_at(&model, &field, &start, part);
        let n = contact.frame.n;
        // Where the nearest point jumps (medial axis) the gap has a kink: keep off it.
        let step = 1e-6;
        let moved = |h: f64| {
            let mut moved = start.clone();
            moved.set_moved(&model, &start, &v, h);
            contact_at(&model, &field, &moved, part)
        };
        let (before, after) = (moved(-step), moved(step));
        prop_assume!((before.frame.n - after.frame.n).norm() < 1e-3 && contact.gap + radius > 1e-3);
        let rate = (after.gap - before.gap) / (2.0 * step);
        let kinematics = Kinematics::of(&model, &start);
        let expected = n.dot(&kinematics.point_velocity(&model, contact.body, &contact.point, &v));
        prop_assert!((rate - expected).abs() < 1e-6, "{part:?}: {rate} for {expected}");
        // and the normal is the direction in which the gap grows fastest
        let away = Configuration { position: start.position + n * step, ..start.clone() };
        let back = Configuration { position: start.position - n * step, ..start.clone() };
        let slope = (contact_at(&model, &field, &away, part).gap - contact_at(&model, &field, &back, part).gap) / (2.0 * step);
        prop_assert!((slope - 1.0).abs() < 1e-6, "{part:?}: {slope}");
        // n, t, b along the Jacobian rows
        for d in contact.frame.rows() {
            let path = model.path(contact.body);
            let mut row = vec![0.0; path.len()];
            kinematics.point_jacobian_row(&model, contact.body, &contact.point, &d, &mut row);
            let product: f64 = row.iter().zip(path).map(|(x, &k)| x * v[k]).sum();
            let velocity = kinematics.point_velocity(&model, contact.body, &contact.point, &v);
            prop_assert!((product - d.dot(&velocity)).abs() < 1e-12);
        }
    }
}
