//! Descriptions of shapes: round trips, models, and errors that name the field.

use rover_core::multibody::{
    Model, ModelDescription, ModelError, ModelFault, Shape, ShapeDescription,
};
use rover_core::nalgebra::{Rotation3, Vector3};

use crate::shared::body;

const TWO: &str = "shapes = [
    { kind = 'box', size = [0.5, 0.2, 0.3], position = [0.1, 0.0, 0.0], rotation = [0.3, 0.1, -0.2], collides = true },
    { kind = 'sphere', radius = 0.1, mass = 0.5, visible = false, collides = true }]";

#[test]
fn a_single_shape_is_written_as_before() {
    let text = ModelDescription::rover().to_json().unwrap();
    assert!(!text.contains("shapes") && !text.contains("visible"));
}

/// Positions of parts on a solid fixed to another one.
#[test]
fn parts_are_placed_by_all_poses_on_the_way() {
    let text = format!(
        "shape = {{ kind = 'sphere', radius = 0.1 }}
        [[solids]]
        name = 'fixed'
        parent = 'body'
        joint = 'fixed'
        position = [1.0, 2.0, 3.0]
        rotation = [0.0, 0.7, 0.4]
        mass = 2.0
        {TWO}"
    );
    let model = body(1.0, &text);
    let turn = Rotation3::from_scaled_axis(Vector3::new(0.0, 0.7, 0.4));
    let own = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.1, -0.2));
    let origin = Vector3::new(1.0, 2.0, 3.0);
    let ([cuboid], [ball]) = (model.boxes(), model.spheres()) else {
        panic!("a box and a ball");
    };
    let centre = origin + turn * Vector3::new(0.1, 0.0, 0.0);
    assert!((cuboid.centre - centre).norm() < 1e-15);
    assert!((cuboid.rotation - (turn * own).matrix()).norm() < 1e-15);
    assert_eq!(cuboid.half_size, Vector3::new(0.25, 0.1, 0.15));
    assert!((ball.centre - origin).norm() < 1e-15);
    assert_eq!((ball.radius, ball.name.as_str()), (0.1, "fixed"));
}

/// A wheel with a hub, a rim inside the tyre, and a disc that does not belong to the wheel.
fn hubbed() -> ModelDescription {
    let mut description = ModelDescription::rover();
    let solid = description.solids.iter_mut().find(|s| s.name == "wheel_ML");
    let solid = solid.unwrap();
    let disc = |radius, position| ShapeDescription {
        shape: Shape::Disc { radius },
        position,
        rotation: None,
        collides: false,
        material: None,
        colour: None,
        visible: true,
        mass: Some(solid.mass / 4.0),
    };
    let Some(Shape::Disc { radius }) = solid.shape else {
        panic!("a wheel");
    };
    let aside = Some([0.0, 0.0, 0.05]);
    let hub = ShapeDescription {
        shape: Shape::Sphere { radius: 0.05 },
        ..disc(radius, None)
    };
    let shapes = vec![
        disc(0.5 * radius, None),
        disc(radius, None),
        disc(radius, aside),
        hub,
    ];
    (solid.shape, solid.shapes) = (None, shapes);
    description
}

#[test]
fn of_several_shapes_the_wheels_disc_takes_another_radius() {
    let model = Model::from_description(hubbed()).unwrap();
    let larger = model.with_wheel_radius(0.4).unwrap();
    let solids = &larger.description().solids;
    let solid = solids.iter().find(|s| s.name == "wheel_ML").unwrap();
    let before = model.wheels()[4].radius;
    let radii: Vec<f64> = (solid.shapes.iter())
        .map(|placed| match placed.shape {
            Shape::Disc { radius } | Shape::Sphere { radius } => radius,
            _ => f64::NAN,
        })
        .collect();
    assert_eq!(radii, [0.5 * before, 0.4, before, 0.05]);
    assert!(
        larger
            .wheels()
            .iter()
            .all(|wheel| (wheel.radius - 0.4).abs() < 1e-15)
    );

    let mut contrary = hubbed();
    contrary.wheels[4].radius = 0.3;
    let refused = Model::from_description(contrary).unwrap_err();
    assert_eq!(refused.field(), "wheels[4].radius");
    let mut without = hubbed();
    let solid = without.solids.iter_mut().find(|s| s.name == "wheel_ML");
    for shape in &mut solid.unwrap().shapes {
        shape.rotation = Some([0.3, 0.0, 0.0]);
    }
    let tilted = Model::from_description(without).unwrap();
    let refused = tilted.with_wheel_radius(0.4).unwrap_err();
    let ModelError::Invalid { fault, .. } = &refused else {
        panic!("{refused}");
    };
    assert!(matches!(fault, ModelFault::NotADisc(_)), "{refused}");
}
