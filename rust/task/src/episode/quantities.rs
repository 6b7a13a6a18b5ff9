//! The quantities of a reading that the episode uses.

use rover_core::scalar::elementary::acos;
use serde::{Deserialize, Serialize};

/// Number of the quantities.
pub const N_QUANTITIES: usize = 12;

/// Quantities of a reading that rewards, ends and reports are made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quantities {
    /// Horizontal distance to the goal, m.
    pub distance: f64,
    /// Cosine of the trunk's tilt from the vertical.
    pub cos_tilt: f64,
    /// Horizontal speed of the trunk's origin, m/s.
    pub speed: f64,
    /// Mean normal force of the last step on all that is no wheel, N.
    pub trunk_force: f64,
    /// Mean slip ratio of the wheels in contact.
    pub slip_ratio: f64,
    /// Work of the motors in the period, driving or braking, J.
    pub work: f64,
    /// Driving part of the motors' work in the period, J.
    pub positive_work: f64,
    /// s.
    pub time: f64,
    /// 1 if the contact solver did not converge in one of the steps, else 0.
    pub not_converged: f64,
    /// Iterations of the contact solver, all steps together.
    pub iterations: f64,
    /// Largest residual of the contact solver.
    pub residual: f64,
    /// Most contacts in a step.
    pub n_contacts: f64,
}

impl Quantities {
    /// From the scalars of a reading.
    ///
    /// # Panics
    /// If they are not [`N_QUANTITIES`].
    #[must_use]
    pub fn of(scalars: &[f64]) -> Self {
        let Ok(s) = <[f64; N_QUANTITIES]>::try_from(scalars) else {
            unreachable!("invariant: the scalars of a reading are as many as the quantities")
        };
        Self::from_row(s)
    }

    /// From a list in the order of the fields.
    #[must_use]
    pub fn from_row(s: [f64; N_QUANTITIES]) -> Self {
        Self {
            distance: s[0],
            cos_tilt: s[1],
            speed: s[2],
            trunk_force: s[3],
            slip_ratio: s[4],
            work: s[5],
            positive_work: s[6],
            time: s[7],
            not_converged: s[8],
            iterations: s[9],
            residual: s[10],
            n_contacts: s[11],
        }
    }

    /// Quantities as a list, in the order of the fields.
    #[must_use]
    pub fn row(&self) -> [f64; N_QUANTITIES] {
        [
            self.distance,
            self.cos_tilt,
            self.speed,
            self.trunk_force,
            self.slip_ratio,
            self.work,
            self.positive_work,
            self.time,
            self.not_converged,
            self.iterations,
            self.residual,
            self.n_contacts,
        ]
    }

    /// Tilt of the trunk from the vertical, rad.
    #[must_use]
    pub fn tilt(&self) -> f64 {
        acos(self.cos_tilt.clamp(-1.0, 1.0))
    }
}
