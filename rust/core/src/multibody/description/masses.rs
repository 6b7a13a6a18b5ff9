//! Mass centre and inertia of a solid from its description.

use nalgebra::{Matrix3, Vector3};

use super::{Shape, ShapeDescription, SolidDescription};
use crate::multibody::error::{ModelError, ModelFault};
use crate::spatial::SymmetricMatrix3;

/// Mass centre and inertia of a solid, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Mass centre, m.
    pub centre: Vector3<f64>,
    /// About the mass centre, kg m².
    pub inertia: Matrix3<f64>,
}

/// Relative tolerance on the sum of the shapes' masses against the solid's mass.
const MASS_TOLERANCE: f64 = 1e-9;

impl SolidDescription {
    /// Mass centre (m) and inertia about it (kg m²), in the solid's frame: as specified, otherwise
    /// computed from its shapes.
    ///
    /// # Errors
    /// The field of the solid that leaves the masses of its shapes undetermined.
    pub fn mass_properties(&self) -> Result<MassProperties, ModelError> {
        let centre = Vector3::from(self.centre_of_mass.unwrap_or_default());
        if let Some([xx, yy, zz, xy, xz, yz]) = self.inertia {
            let inertia = SymmetricMatrix3 {
                xx,
                yy,
                zz,
                xy,
                xz,
                yz,
            };
            return Ok(MassProperties {
                centre,
                inertia: inertia.to_matrix(),
            });
        }
        if let Some(shape) = &self.shape {
            let (_, inertia) = shape.mass_properties(self.mass);
            return Ok(MassProperties { centre, inertia });
        }
        if self.shapes.is_empty() {
            return Err(ModelFault::Missing.at("shape"));
        }
        Ok(together(&self.shapes, &shape_masses(self)?))
    }
}

/// Mass of every shape of a solid, kg.
fn shape_masses(solid: &SolidDescription) -> Result<Vec<f64>, ModelError> {
    let shapes = &solid.shapes;
    let rest = mass_left(solid)?;
    let mut others = shapes.iter().filter(|shape| shape.mass.is_none());
    let are_discs = others.all(|shape| shape.shape.volume().is_none());
    let content = |(k, shape): (usize, &ShapeDescription)| match (shape.mass, &shape.shape) {
        (Some(_), _) => Ok(0.0),
        (None, Shape::Disc { radius }) if are_discs => Ok(radius * radius),
        (None, shape) => shape
            .volume()
            .ok_or_else(|| ModelFault::NoVolume.at(format!("shapes[{k}].mass"))),
    };
    let contents: Vec<f64> = (shapes.iter().enumerate())
        .map(content)
        .collect::<Result<_, _>>()?;
    let whole: f64 = contents.iter().sum();
    let masses = shapes.iter().zip(&contents);
    Ok(masses
        .map(|(shape, part)| shape.mass.unwrap_or_else(|| rest * (part / whole)))
        .collect())
}

/// Mass of the solid that remains for the shapes without a specified mass, kg.
pub(super) fn mass_left(solid: &SolidDescription) -> Result<f64, ModelError> {
    let given = || solid.shapes.iter().filter_map(|shape| shape.mass);
    let sum: f64 = given().sum();
    let rest = solid.mass - sum;
    let is_right = if given().count() == solid.shapes.len() {
        solid.shapes.is_empty() || rest.abs() <= MASS_TOLERANCE * solid.mass
    } else {
        rest > MASS_TOLERANCE * solid.mass
    };
    if is_right {
        return Ok(rest);
    }
    Err(ModelFault::MassesContradict {
        value: solid.mass,
        sum,
    }
    .at("mass"))
}

/// Mass centre of the shapes, and their inertia about it by the parallel axis theorem.
fn together(shapes: &[ShapeDescription], masses: &[f64]) -> MassProperties {
    let placed = shapes.iter().zip(masses).map(|(shape, &m)| {
        let (own, about) = shape.shape.mass_properties(m);
        let (own, about) = match shape.turn() {
            Some(R) => (R * own, R * about * R.transpose()),
            None => (own, about),
        };
        (m, shape.centre() + own, about)
    });
    let placed: Vec<_> = placed.collect();
    let mass: f64 = masses.iter().sum();
    let moment: Vector3<f64> = placed.iter().map(|(m, own, _)| own * *m).sum();
    let centre = moment / mass;
    let about_centre = placed.iter().map(|(m, own, about)| {
        about + SymmetricMatrix3::point_mass(*m, &(own - centre)).to_matrix()
    });
    MassProperties {
        centre,
        inertia: about_centre.sum(),
    }
}
