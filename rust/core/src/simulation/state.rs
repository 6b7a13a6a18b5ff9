//! Configuration and velocity at a time.

use serde::{Deserialize, Serialize};

use crate::integrator::StateMut;

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

    /// The view that a step advances.
    #[inline]
    pub(super) fn as_mut(&mut self) -> StateMut<'_, Q> {
        StateMut {
            configuration: &mut self.configuration,
            v: &mut self.v,
            time: &mut self.time,
        }
    }
}
