//! What a step depends on besides state and command, and can be differentiated by.

use crate::multibody::Model;
use crate::sand::Soil;
use crate::system::tangent::Direction;

/// A parameter of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepParameter {
    /// The coefficient of friction of all contacts whose pair of materials has none of its own.
    Friction,
    /// Mass and moments of inertia of a body, by its index, as a factor of those that it has.
    Mass(usize),
    /// Masses and moments of inertia of all bodies together, as a factor of those that they have.
    AllMasses,
    /// Damping of a joint, by its index, N m s/rad or N s/m.
    Damping(usize),
    /// Stiffness of the contacts that yield, as a factor of the one that they have.
    ContactStiffness,
    /// Their damping, as a factor.
    ContactDamping,
    /// A number of the soil, by its index among [`Soil::numbers_mut`], in its own unit.
    Soil(usize),
}

impl StepParameter {
    /// The parameter of a name; `None` if it is not among [`Self::names`]. `soil`: that of the
    /// ground.
    #[must_use]
    pub fn named(model: &Model, soil: Option<&Soil>, name: &str) -> Option<Self> {
        let body = |name: &str| model.bodies().iter().position(|body| body.name == name);
        match name.split_once(':') {
            None => match name {
                "friction" => Some(Self::Friction),
                "mass" => Some(Self::AllMasses),
                "contact_stiffness" => Some(Self::ContactStiffness),
                "contact_damping" => Some(Self::ContactDamping),
                _ => None,
            },
            Some(("mass", name)) => body(name).map(Self::Mass),
            Some(("damping", name)) => {
                let body = body(name)?;
                let joint = model.joints().iter().position(|joint| joint.body == body);
                joint.map(Self::Damping)
            }
            Some(("soil", name)) => {
                let numbers = numbers_of(soil);
                (numbers.iter().position(|own| *own == name)).map(Self::Soil)
            }
            Some(_) => None,
        }
    }

    /// Names of all parameters of a model on a ground.
    #[must_use]
    pub fn names(model: &Model, soil: Option<&Soil>) -> Vec<String> {
        let bodies = model.bodies();
        let common = ["friction", "mass", "contact_stiffness", "contact_damping"];
        let masses = bodies.iter().map(|body| format!("mass:{}", body.name));
        let joints = model.joints().iter();
        let dampings = joints.map(|joint| format!("damping:{}", bodies[joint.body].name));
        let common = common.into_iter().map(str::to_owned);
        let numbers = numbers_of(soil).into_iter();
        let of_soil = numbers.map(|name| format!("soil:{name}"));
        common
            .chain(masses)
            .chain(dampings)
            .chain(of_soil)
            .collect()
    }

    /// The direction of a parameter; `numbers`: those of the soil that steps are held with.
    pub(super) fn direction(self, soil: Option<&Soil>, numbers: &[usize]) -> Direction {
        match self {
            Self::Soil(number) => Direction::Soil {
                index: numbers.iter().position(|own| *own == number).unwrap_or(0),
                is_memory: numbers_of(soil).get(number) == Some(&"memory"),
            },
            Self::Friction => Direction::Friction,
            Self::Mass(body) => Direction::Mass(body),
            Self::AllMasses => Direction::AllMasses,
            Self::Damping(joint) => Direction::Damping(joint),
            Self::ContactStiffness => Direction::Stiffness,
            Self::ContactDamping => Direction::ContactDamping,
        }
    }
}

/// Names of the numbers of a soil.
fn numbers_of(soil: Option<&Soil>) -> Vec<&'static str> {
    let Some(mut soil) = soil.cloned() else {
        return Vec::new();
    };
    let numbers = soil.numbers_mut();
    numbers.into_iter().map(|(name, _)| name).collect()
}
