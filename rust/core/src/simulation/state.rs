//! Configuration and velocity at a time.

use serde::{Deserialize, Serialize};

use crate::multibody::{Configuration, LaneConfiguration};

/// State of a scene: small, cloneable, without scratch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State<Q> {
    /// A point of the configuration space.
    pub configuration: Q,
    /// Velocity (nv), in the scene's order.
    pub v: Vec<f64>,
    /// s.
    pub time: f64,
}

impl<Q> State<Q> {
    /// At rest at time 0.
    #[must_use]
    pub fn at_rest(configuration: Q, nv: usize) -> Self {
        Self {
            configuration,
            v: vec![0.0; nv],
            time: 0.0,
        }
    }
}

/// A configuration in the form that steps move.
pub trait Moved<Q> {
    /// Takes over a configuration.
    fn read(&mut self, q: &Q);

    /// Writes it back.
    fn write(&self, q: &mut Q);
}

impl<Q: Clone> Moved<Q> for Q {
    fn read(&mut self, q: &Q) {
        self.clone_from(q);
    }

    fn write(&self, q: &mut Q) {
        q.clone_from(self);
    }
}

impl Moved<Configuration> for LaneConfiguration<f64> {
    fn read(&mut self, q: &Configuration) {
        self.set_lane(0, q);
    }

    fn write(&self, q: &mut Configuration) {
        self.to_lane(0, q);
    }
}
