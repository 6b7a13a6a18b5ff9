//! Mass centre and inertia of solids with several shapes.

use rover_core::multibody::{MassProperties, Shape, SolidDescription};
use rover_core::nalgebra::{Matrix3, Rotation3, Vector3};

use crate::shared::{body, described};

fn properties(mass: f64, rest: &str) -> MassProperties {
    described(mass, rest).solids[0].mass_properties().unwrap()
}

fn assert_same(a: &MassProperties, b: &MassProperties, tolerance: f64) {
    assert!((a.centre - b.centre).norm() < tolerance, "{a:?} {b:?}");
    let off = (a.inertia - b.inertia).norm();
    assert!(off < tolerance * b.inertia.norm(), "{a:?} {b:?}");
}

#[test]
fn two_boxes_are_the_box_that_they_make_together() {
    let half = "{ kind = 'box', size = [0.5, 0.2, 0.3], position";
    let halves = properties(
        7.0,
        &format!("shapes = [{half} = [-0.15, 0.1, 0.0] }}, {half} = [0.35, 0.1, 0.0] }}]"),
    );
    let whole = properties(
        7.0,
        "shape = { kind = 'box', size = [1.0, 0.2, 0.3] }\ncentre_of_mass = [0.1, 0.1, 0.0]",
    );
    assert_same(&halves, &whole, 1e-15);
}

/// A square tube of outer width a, inner width b and length l: the outer bar minus the inner one.
#[test]
fn four_walls_are_a_bar_without_its_inside() {
    let (a, b, l, mass) = (0.4, 0.3, 1.2, 11.0);
    let (wall, at) = (0.5 * (a - b), 0.25 * (a + b));
    let tube = properties(
        mass,
        &format!(
            "shapes = [
            {{ kind = 'box', size = [{a}, {wall}, {l}], position = [0.0, {at}, 0.0] }},
            {{ kind = 'box', size = [{a}, {wall}, {l}], position = [0.0, -{at}, 0.0] }},
            {{ kind = 'box', size = [{wall}, {b}, {l}], position = [{at}, 0.0, 0.0] }},
            {{ kind = 'box', size = [{wall}, {b}, {l}], position = [-{at}, 0.0, 0.0] }}]"
        ),
    );
    let density = mass / (a * a - b * b);
    let bar = |a: f64| {
        let bar = Shape::Box { size: [a, a, l] };
        bar.mass_properties(density * a * a).1
    };
    let expected = MassProperties {
        centre: Vector3::zeros(),
        inertia: bar(a) - bar(b),
    };
    assert_same(&tube, &expected, 1e-14);
}

/// Root mean square of the coordinates of a shape's points, in its axes, m.
fn spread(shape: &Shape) -> Vector3<f64> {
    match *shape {
        Shape::Box { size } => Vector3::from(size) / 12_f64.sqrt(),
        Shape::Cylinder { radius, height } => {
            Vector3::new(radius / 2.0, height / 12_f64.sqrt(), radius / 2.0)
        }
        Shape::Disc { radius } => Vector3::new(radius / 2.0, radius / 2.0, 0.0),
        Shape::Sphere { radius } => Vector3::repeat(radius / 5_f64.sqrt()),
        Shape::Ellipsoid { radii } => Vector3::from(radii) / 5_f64.sqrt(),
        Shape::Capsule { .. } | Shape::Hull { .. } => panic!("a test of their own has these"),
    }
}

/// The same from eight point masses per shape with its mass, centre and second moments.
fn of_points(solid: &SolidDescription, masses: &[f64]) -> MassProperties {
    let mut points = Vec::new();
    for (placed, mass) in solid.shapes.iter().zip(masses) {
        let turn = Rotation3::from_scaled_axis(placed.rotation.unwrap_or_default().into());
        let centre = Vector3::from(placed.position.unwrap_or_default());
        let spread = spread(&placed.shape);
        for corner in 0..8 {
            let sign = |k: i32| if corner >> k & 1 == 1 { 1.0 } else { -1.0 };
            let x = spread.component_mul(&Vector3::new(sign(0), sign(1), sign(2)));
            points.push((mass / 8.0, centre + turn * x));
        }
    }
    let mass: f64 = masses.iter().sum();
    let centre = points.iter().map(|(m, x)| *m * x).sum::<Vector3<f64>>() / mass;
    let moment = |(m, x): &(f64, Vector3<f64>)| {
        let r = x - centre;
        (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * *m
    };
    let inertia = points.iter().map(moment).sum();
    MassProperties { centre, inertia }
}

#[test]
fn turned_shapes_of_every_kind_are_the_points_that_they_are_made_of() {
    let solid = &described(
        10.0,
        "[[solids.shapes]]
        kind = 'box'
        size = [0.5, 0.2, 0.3]
        position = [0.1, 0.4, -0.2]
        rotation = [0.4, -0.9, 0.3]
        [[solids.shapes]]
        kind = 'cylinder'
        radius = 0.2
        height = 0.7
        position = [-0.3, 0.0, 0.1]
        rotation = [1.4, 0.0, 0.8]
        [[solids.shapes]]
        kind = 'disc'
        radius = 0.3
        rotation = [0.0, 1.1, -0.2]
        mass = 1.5
        [[solids.shapes]]
        kind = 'sphere'
        radius = 0.15
        position = [0.0, -0.6, 0.5]
        mass = 2.5",
    )
    .solids[0];
    // 6 kg remain for box and cylinder, divided by volume.
    let (cuboid, cylinder) = (0.03, std::f64::consts::PI * 0.04 * 0.7);
    let share = 6.0 / (cuboid + cylinder);
    let expected = of_points(solid, &[share * cuboid, share * cylinder, 1.5, 2.5]);
    assert_same(&solid.mass_properties().unwrap(), &expected, 1e-14);
}

#[test]
fn discs_share_a_mass_by_their_areas() {
    let solid = &described(
        5.0,
        "shapes = [{ kind = 'disc', radius = 0.1 }, { kind = 'disc', radius = 0.2, position = [0.5, 0.0, 0.0] }]",
    )
    .solids[0];
    let own = solid.mass_properties().unwrap();
    assert_same(&own, &of_points(solid, &[1.0, 4.0]), 1e-14);
}

#[test]
fn a_given_inertia_is_taken_whatever_the_shapes() {
    let given = "inertia = [1.0, 1.2, 1.5, 0.1, 0.0, 0.0]\ncentre_of_mass = [0.1, 0.0, 0.0]";
    let shapes = "shapes = [{ kind = 'disc', radius = 0.1 }, { kind = 'box', size = [1, 1, 1] }]";
    let with = body(3.0, &format!("{given}\n{shapes}"));
    let without = body(3.0, given);
    for model in [with, without] {
        let (own, body) = (
            model.description().solids[0].mass_properties().unwrap(),
            &model.bodies()[0],
        );
        assert!((own.inertia[(0, 1)] - 0.1).abs() < 1e-15);
        assert!((body.centre_of_mass - Vector3::new(0.1, 0.0, 0.0)).norm() < 1e-15);
        assert!((body.principal_inertia.sum() - 3.7).abs() < 1e-12);
    }
}

/// Another mass makes a solid denser without changing its shape.
#[test]
fn masses_of_shapes_scale_with_the_solids() {
    let text = "shapes = [{ kind = 'sphere', radius = 0.1, mass = 1.0 },
        { kind = 'box', size = [1, 1, 1], position = [1, 0, 0] }]";
    let mut solid = described(4.0, text).solids[0].clone();
    let before = solid.mass_properties().unwrap();
    solid.set_mass(8.0);
    assert_eq!(solid.shapes[0].mass, Some(2.0));
    let after = solid.mass_properties().unwrap();
    assert!((after.centre - before.centre).norm() < 1e-15);
    assert!((after.inertia - 2.0 * before.inertia).norm() < 1e-14);
}
