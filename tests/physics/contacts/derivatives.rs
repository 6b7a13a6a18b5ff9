//! The Jacobian of a contact between two bodies is the derivative of the gap, and its impulse is
//! internal.

use proptest::prelude::*;
use rover_core::contact::{Contact, generalized_impulse, relocate};
use rover_core::geometry::Plane;
use rover_core::multibody::{Configuration, Kinematics, Model};

use super::contact_scenes::{folding, nearby, tips};

/// The configuration of the machine, and its self-contacts with a gap of at most 20 cm.
fn contacts(model: &Model, joints: [f64; 3], turn: [f64; 3]) -> (Configuration, Vec<Contact>) {
    let mut q = Configuration::zero(model);
    q.joints.copy_from_slice(&joints);
    let v: Vec<f64> = [0.3, 0.2, -0.1]
        .into_iter()
        .chain(turn)
        .chain([0.0; 3])
        .collect();
    q.advance(model, &v, 1.0);
    let found = nearby(model, &Kinematics::of(model, &q));
    (q, found)
}

proptest! {
    #[test]
    fn the_jacobian_is_the_gaps_derivative_and_moves_nothing_as_a_whole(
        tip in 0..tips().len(), yaw in -0.3..0.3, lift in -0.45..-0.1, wrist in -0.6..0.6, turn in prop::array::uniform3(-1.0..1.0),
    ) {
        let model = folding(tips()[tip].0);
        let (q, found) = contacts(&model, [yaw, lift, wrist], turn);
        // Excluded are the rim points beside a wheel's lowest, which support it only when it lies
        // flat, the ends of its chord over an edge, which slide along it, and crossings of two
        // edges: their modules state the error.
        let is_exact = |c: &&Contact| match (tip, c.key.feature) {
            (2, feature) if feature & (1 << 15) != 0 => false,
            (0, feature) if feature & (1 << 13) != 0 => feature & 31 < 8,
            (2, feature) if feature & (1 << 13) != 0 => feature % 4 == 0,
            (3, feature) if feature & (1 << 20) != 0 => feature % 16 == 0,
            _ => true,
        };
        for contact in found.iter().filter(is_exact) {
            prop_assert!(contact.other.is_some());
            let kinematics = Kinematics::of(&model, &q);
            let mut row = vec![0.0; model.nv()];
            generalized_impulse(&model, kinematics.poses(), std::slice::from_ref(contact), &[1.0, 0.3, -0.2], &mut row);
            // An internal impulse does not change the base's momentum at all.
            prop_assert!(row[..6].iter().all(|x| x.abs() < 1e-15), "{row:?}");
            generalized_impulse(&model, kinematics.poses(), std::slice::from_ref(contact), &[1.0, 0.0, 0.0], &mut row);
            for k in 0..model.nv() {
                let gap_at = |h: f64| {
                    let mut v = vec![0.0; model.nv()];
                    v[k] = 1.0;
                    let mut moved = q.clone();
                    moved.advance(&model, &v, h);
                    let mut contact = *contact;
                    relocate(&model, &Kinematics::of(&model, &moved), &Plane::ground(), &mut contact);
                    contact.gap
                };
                let h = 1e-6;
                let slope = (gap_at(h) - gap_at(-h)) / (2.0 * h);
                prop_assert!((slope - row[k]).abs() < 1e-5, "{k}: {slope} {} {contact:?}", row[k]);
            }
        }
    }
}

#[test]
fn parts_that_a_joint_connects_do_not_touch_and_a_machine_touches_itself_only_where_it_says_so() {
    let model = folding(tips()[0].0);
    let (_, found) = contacts(&model, [0.0, -0.3, 0.3], [0.0; 3]);
    assert!(!found.is_empty());
    let mut description = model.description().clone();
    description.self_contact = false;
    let model = Model::from_description(description).unwrap();
    assert!(contacts(&model, [0.0, -0.3, 0.3], [0.0; 3]).1.is_empty());
}
