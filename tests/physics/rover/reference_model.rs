//! Mass matrix, bias, energy, origins, gaps and Jacobians against the
//! reference's 20 random states: 1e-10 relative.

use nalgebra::{DMatrix, DVector, Vector3};
use rover_core::contact::detection::wheel_contacts;
use rover_core::geometry::Plane;
use rover_core::multibody::{Kinematics, Model, ModelDescription, coordinates, momentum};

use super::scenes::{golden, numbers, set_contact_radius};

fn assert_close(what: &str, actual: &[f64], expected: &[f64]) {
    let scale = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    assert_eq!(actual.len(), expected.len(), "{what}");
    for (a, e) in actual.iter().zip(expected) {
        assert!((a - e).abs() <= 1e-10 * scale, "{what}: {a} instead of {e}");
    }
}

fn machine(masses: &[f64]) -> Model {
    let mut description = ModelDescription::rover();
    set_contact_radius(&mut description, 0.30);
    for (solid, mass) in description.solids.iter_mut().zip(masses) {
        solid.mass = *mass;
    }
    Model::from_description(description).unwrap()
}

#[test]
fn dynamics_agree_with_the_reference() {
    let reference = golden("rover_model.json");
    let gravity = Vector3::new(0.0, -0.0981, 0.0);
    for table in ["masses_960", "masses_880"] {
        let model = machine(&numbers(&reference["meta"][table]));
        for case in reference["cases"].as_array().unwrap() {
            let (q, qdot) = (numbers(&case["q"]), numbers(&case["qdot"]));
            let angles = coordinates::report_angles(&model, &q);
            let kinematics = Kinematics::of(&model, &coordinates::from_report(&model, &q).unwrap());
            let M = kinematics.mass_matrix(&model);
            let expected = &case[table];
            let dense: DMatrix<f64> = coordinates::congruence(&M, &angles);
            assert_close("M", dense.transpose().as_slice(), &numbers(&expected["M"]));
            for (rates, name) in [(qdot.clone(), "bias"), (vec![0.0; 21], "gravity")] {
                let v = coordinates::velocity_from_report(&model, &q, &rates).unwrap();
                let out = kinematics.bias(&model, &v, &gravity);
                let full = DVector::from_vec(out) + &M * coordinates::rate_drift(&angles, &rates);
                assert_close(
                    name,
                    coordinates::pull_back(&full, &angles).as_slice(),
                    &numbers(&expected[name]),
                );
                if name == "bias" {
                    let kinetic = kinematics.energy(&model, &v, &gravity).kinetic;
                    assert_close(
                        "kinetic energy",
                        &[kinetic],
                        &numbers(&expected["kinetic_energy"]),
                    );
                }
            }
        }
    }
}

#[test]
fn places_and_contacts_agree_with_the_reference() {
    let reference = golden("rover_model.json");
    let model = machine(&numbers(&reference["meta"]["masses_960"]));
    let n: [f64; 3] = numbers(&reference["meta"]["plane_normal"])
        .try_into()
        .unwrap();
    let plane = Plane::new(n, 0.0).unwrap();
    for case in reference["cases"].as_array().unwrap() {
        let q = numbers(&case["q"]);
        let angles = coordinates::report_angles(&model, &q);
        let kinematics = Kinematics::of(&model, &coordinates::from_report(&model, &q).unwrap());
        let origins = model.frames().iter().flat_map(|f| {
            let x = kinematics.origin(f.body) + kinematics.point(f.body, &f.position);
            [x.x, x.y, x.z]
        });
        assert_close(
            "origins",
            &origins.collect::<Vec<_>>(),
            &numbers(&case["tags"]),
        );
        let centre = momentum::centre_of_mass(&model, &kinematics);
        assert_close(
            "mass centre",
            centre.as_slice(),
            &numbers(&case["centre_of_mass_960"]),
        );
        let contacts = wheel_contacts(&model, &kinematics, &plane);
        let gaps: Vec<f64> = contacts.iter().map(|c| c.gap).collect();
        assert_close("gaps", &gaps, &numbers(&case["plane"]["gap"]));
        let mut points = Vec::new();
        let mut rows = Vec::new();
        for contact in &contacts {
            points.extend_from_slice((kinematics.origin(contact.body) + contact.point).as_slice());
            let path = model.path(contact.body);
            for d in contact.frame.rows() {
                let mut along = vec![0.0; path.len()];
                kinematics.point_jacobian_row(&model, contact.body, &contact.point, &d, &mut along);
                let mut full = DVector::zeros(21);
                for (x, &k) in along.iter().zip(path) {
                    full[k] = *x;
                }
                rows.extend_from_slice(coordinates::pull_back(&full, &angles).as_slice());
            }
        }
        assert_close(
            "contact points",
            &points,
            &numbers(&case["plane"]["contact_point"]),
        );
        assert_close("Jacobians", &rows, &numbers(&case["plane"]["jacobian"]));
    }
}
