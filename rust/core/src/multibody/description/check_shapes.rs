//! Checks of the shapes of a solid.

use super::check_values::{in_range, length, material, not_negative, place, positive};
use super::{Shape, ShapeDescription, SolidDescription};
use crate::multibody::error::{ModelError, ModelFault};

/// Checks each shape of a solid, and that the solid uses only one of the two forms.
pub(super) fn check_shapes(i: usize, solid: &SolidDescription) -> Result<(), ModelError> {
    let at = |what: &str| format!("solids[{i}].{what}");
    if let Some(shape) = &solid.shape {
        if matches!(shape, Shape::Hull { .. }) {
            return Err(ModelFault::HullAlone.at(at("shape")));
        }
        check_lengths(&at("shape"), shape)?;
    }
    let can_collide = solid.shapes.is_empty() && solid.shape.as_ref().is_some_and(collides);
    for (is_given, what) in [
        (solid.shape.is_some(), "shape"),
        (solid.collides, "collides"),
        (solid.material.is_some(), "material"),
    ] {
        if is_given && !solid.shapes.is_empty() {
            return Err(ModelFault::NotWithShapes(what).at(at(what)));
        }
    }
    if solid.collides && !can_collide {
        return Err(ModelFault::CannotCollide.at(at("collides")));
    }
    material(&at("material"), solid.material.as_ref())?;
    for (k, shape) in solid.shapes.iter().enumerate() {
        check_placed_shape(&at(&format!("shapes[{k}]")), shape)?;
    }
    check_drawings(i, solid)?;
    let is_half_given = solid.centre_of_mass.is_some() != solid.inertia.is_some();
    if !solid.shapes.is_empty() && is_half_given {
        let missing = if solid.inertia.is_none() {
            "inertia"
        } else {
            "centre_of_mass"
        };
        return Err(ModelFault::HalfGiven.at(at(missing)));
    }
    Ok(())
}

fn check_drawings(i: usize, solid: &SolidDescription) -> Result<(), ModelError> {
    for (k, drawing) in solid.drawings.iter().enumerate() {
        let at = |what: &str| format!("solids[{i}].drawings[{k}].{what}");
        for x in &drawing.vertices {
            place(&at("vertices"), x)?;
        }
        let count = drawing.vertices.len();
        if let Some(&vertex) = drawing.faces.iter().flatten().find(|&&v| v >= count) {
            let field = at("faces");
            return Err(ModelFault::NoVertex { vertex, count }.at(field));
        }
        colour(&at("colour"), drawing.colour)?;
    }
    Ok(())
}

/// Checks a colour: red, green, blue.
fn colour(field: &str, levels: Option<[f64; 3]>) -> Result<(), ModelError> {
    levels.iter().flatten().try_for_each(|&level| {
        not_negative(field, level)?;
        in_range(field, level, 1.0, "from 0 to 1")
    })
}

fn check_placed_shape(at: &str, shape: &ShapeDescription) -> Result<(), ModelError> {
    check_lengths(at, &shape.shape)?;
    place(
        &format!("{at}.position"),
        &shape.position.unwrap_or_default(),
    )?;
    for angle in shape.rotation.iter().flatten() {
        let field = format!("{at}.rotation");
        in_range(&field, *angle, 1e3, "at most 1e3 rad either way")?;
    }
    if let Some(mass) = shape.mass {
        let field = format!("{at}.mass");
        positive(&field, mass)?;
        in_range(&field, mass, 1e12, "at most 1e12 kg")?;
    }
    material(&format!("{at}.material"), shape.material.as_ref())?;
    colour(&format!("{at}.colour"), shape.colour)?;
    if shape.collides && !collides(&shape.shape) {
        return Err(ModelFault::CannotCollide.at(format!("{at}.collides")));
    }
    Ok(())
}

fn check_lengths(at: &str, shape: &Shape) -> Result<(), ModelError> {
    let field = |what: &str| format!("{at}.{what}");
    let lengths = |what: &str, of: &[f64; 3]| of.iter().try_for_each(|&s| length(&field(what), s));
    match shape {
        Shape::Box { size } => lengths("size", size),
        Shape::Cylinder { radius, height } | Shape::Capsule { radius, height } => {
            length(&field("radius"), *radius)?;
            length(&field("height"), *height)
        }
        Shape::Disc { radius } | Shape::Sphere { radius } => length(&field("radius"), *radius),
        Shape::Ellipsoid { radii } => lengths("radii", radii),
        Shape::Hull { points } => {
            for (k, x) in points.iter().enumerate() {
                place(&format!("{at}.points[{k}]"), x)?;
            }
            shape
                .polytope()
                .map(|_| ())
                .ok_or_else(|| ModelFault::NoHull(points.len()).at(field("points")))
        }
    }
}

/// Whether a shape can collide; a disc does so as a wheel.
fn collides(shape: &Shape) -> bool {
    !matches!(shape, Shape::Disc { .. })
}
