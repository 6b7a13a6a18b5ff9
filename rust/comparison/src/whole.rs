//! Systems that are their own machine, as planar ones and free bodies are.

use rover_core::integrator::{Forces, MechanicalSystem};

/// A system that moves, with its contacts.
pub trait Whole:
    MechanicalSystem<Machine = Self> + Forces<T = f64, Configuration: PartialEq>
{
}

impl<S> Whole for S where
    S: MechanicalSystem<Machine = Self> + Forces<T = f64, Configuration: PartialEq>
{
}
