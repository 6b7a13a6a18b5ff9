//! Scratch of steps with implicit gyroscopic terms.

use crate::lanes::machine::Machine;
use crate::multibody::MassMatrix;
use crate::scalar::Lane;
use crate::system::gyroscopic::Gyroscopic;

/// What steps with implicit gyroscopic terms need beside the others.
pub(super) struct Implicit<T: Lane> {
    pub solver: Gyroscopic<T>,
    /// M̂.
    pub mass_matrix: MassMatrix<T>,
    /// Impulse of the forces but the gyroscopic ones, and of the contacts and loops as far as it is
    /// foreseen (nv).
    pub given: Vec<T>,
    pub foreseen: Vec<T>,
    /// The free change of velocity in factor coordinates (nv).
    pub y: Vec<T>,
}

impl<T: Lane> Implicit<T> {
    /// Room for a machine.
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        let nothing = || vec![T::splat(token, 0.0); machine.nv()];
        Self {
            solver: Gyroscopic::new(token),
            mass_matrix: MassMatrix::new(token, machine),
            given: nothing(),
            foreseen: nothing(),
            y: nothing(),
        }
    }
}
