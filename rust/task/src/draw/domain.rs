//! Domain randomisation: properties of rover and world that change from episode to episode.

use serde::{Deserialize, Serialize};

use super::pcg64::Pcg64;
use super::start::Interval;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Model, ModelError};

/// What the properties are drawn from, uniformly. A range whose ends are equal takes no random
/// number, so that it does not shift the other draws.
#[derive(Clone, Debug, PartialEq)]
pub struct DomainDistribution {
    /// Factor of the model's masses and inertias.
    pub mass_scale: Interval,
    /// Coulomb's μ.
    pub friction: Interval,
    /// Torque that a motor gives over the one that was asked.
    pub actuator_gain: Interval,
    /// Factor of gravity.
    pub gravity_scale: Interval,
}

/// The properties of one episode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Domain {
    /// Factor of the model's masses and inertias.
    pub mass_scale: f64,
    /// Coulomb's μ.
    pub friction: f64,
    /// Torque that a motor gives over the one that was asked.
    pub actuator_gain: f64,
    /// Factor of gravity.
    pub gravity_scale: f64,
}

impl Domain {
    /// Factor of the masses, friction, gain of the motors, factor of gravity.
    #[must_use]
    pub fn row(&self) -> [f64; 4] {
        let (mass, gravity) = (self.mass_scale, self.gravity_scale);
        [mass, self.friction, self.actuator_gain, gravity]
    }
}

impl From<[f64; 4]> for Domain {
    /// What [`Domain::row`] tells.
    fn from([mass_scale, friction, actuator_gain, gravity_scale]: [f64; 4]) -> Self {
        Self {
            mass_scale,
            friction,
            actuator_gain,
            gravity_scale,
        }
    }
}

impl DomainDistribution {
    /// Draws the properties of an episode.
    pub fn draw(&self, random: &mut Pcg64) -> Domain {
        #[allow(clippy::float_cmp)] // a fixed property has both ends from one number
        let mut draw = |range: Interval| {
            if range[0] == range[1] {
                range[0]
            } else {
                random.uniform(range)
            }
        };
        Domain {
            mass_scale: draw(self.mass_scale),
            friction: draw(self.friction),
            actuator_gain: draw(self.actuator_gain),
            gravity_scale: draw(self.gravity_scale),
        }
    }
}

impl Domain {
    /// The model with its masses scaled; None where the factor is 1.
    ///
    /// # Errors
    /// A mass or inertia that the factor takes out of its range.
    pub fn scaled(&self, model: &Model) -> Result<Option<Model>, ModelError> {
        #[allow(clippy::float_cmp)] // exactly one
        let is_same = self.mass_scale == 1.0;
        (!is_same)
            .then(|| model.with_masses_scaled(self.mass_scale))
            .transpose()
    }

    /// The options with friction and gravity of this episode.
    #[must_use]
    pub fn options(&self, options: &StepOptions) -> StepOptions {
        StepOptions {
            friction_coefficient: self.friction,
            gravity: options.gravity.map(|g| self.gravity_scale * g),
            ..options.clone()
        }
    }
}
