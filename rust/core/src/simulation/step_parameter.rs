//! What a step depends on besides state and command, and can be differentiated by.

use crate::multibody::Model;
use crate::system::tangent::Direction;

/// A parameter of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepParameter {
    /// The coefficient of friction of all contacts whose pair of materials has none of its own.
    Friction,
    /// Mass and moments of inertia of a body, by its index, as a factor of those that it has.
    Mass(usize),
    /// The same for all bodies together.
    AllMasses,
    /// Damping of a joint, by its index, N m s/rad or N s/m.
    Damping(usize),
    /// Stiffness of the contacts that yield, as a factor of the one that they have.
    ContactStiffness,
    /// Their damping, as a factor.
    ContactDamping,
}

impl StepParameter {
    /// The parameter of a name; `None` if it is not among [`Self::names`].
    #[must_use]
    pub fn named(model: &Model, name: &str) -> Option<Self> {
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
            Some(_) => None,
        }
    }

    /// Names of all parameters of a model.
    #[must_use]
    pub fn names(model: &Model) -> Vec<String> {
        let bodies = model.bodies();
        let common = ["friction", "mass", "contact_stiffness", "contact_damping"];
        let masses = bodies.iter().map(|body| format!("mass:{}", body.name));
        let joints = model.joints().iter();
        let dampings = joints.map(|joint| format!("damping:{}", bodies[joint.body].name));
        let common = common.into_iter().map(str::to_owned);
        common.chain(masses).chain(dampings).collect()
    }

    pub(super) fn direction(self) -> Direction {
        match self {
            Self::Friction => Direction::Friction,
            Self::Mass(body) => Direction::Mass(body),
            Self::AllMasses => Direction::AllMasses,
            Self::Damping(joint) => Direction::Damping(joint),
            Self::ContactStiffness => Direction::Stiffness,
            Self::ContactDamping => Direction::ContactDamping,
        }
    }
}
