//! State of the sand under a machine: what it remembers of every wheel, and the ruts.

use serde::{Deserialize, Serialize};

use super::memory::Memory;
use super::ruts::RutMap;

/// The sand at one wheel, with its action in the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WheelInSand {
    /// What the sand remembers.
    pub memory: Memory,
    /// Energy that the sand may give back, J.
    pub stored: f64,
    /// Energy that the sand has taken from the wheel since the start, J.
    pub absorbed: f64,
    /// Force on the wheel, world, N.
    pub force: [f64; 3],
    /// Moment about its centre, world, N m.
    pub moment: [f64; 3],
    /// Velocity of its centre, world, m/s.
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Depth of its lowest point under the undisturbed surface, m; negative where it is clear.
    pub sinkage: f64,
    /// Centre, m, and axle of the wheel when its rut was last noted, world; zeros before that.
    #[serde(default)]
    pub noted: [f64; 6],
}

/// The sand under a machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SandState {
    /// Sand at each wheel, with its action in the last step (n_wheels).
    pub wheels: Vec<WheelInSand>,
    /// Where wheels have been.
    pub ruts: RutMap,
}

impl SandState {
    /// Untouched sand under a number of wheels.
    #[must_use]
    pub fn new(wheels: usize) -> Self {
        Self {
            wheels: vec![WheelInSand::default(); wheels],
            ruts: RutMap::new(wheels),
        }
    }

    /// Whether the state has the size of a machine with this many wheels, and only sound numbers.
    #[must_use]
    pub fn is_of(&self, wheels: usize) -> bool {
        self.wheels.len() == wheels
            && self.ruts.n_wheels() == wheels
            && self.ruts.is_sound()
            && self.wheels.iter().all(WheelInSand::is_finite)
    }
}

impl WheelInSand {
    fn is_finite(&self) -> bool {
        let numbers = [self.stored, self.absorbed, self.sinkage];
        let forces = (self.force.iter().chain(&self.moment))
            .chain(&self.velocity)
            .chain(&self.noted);
        self.memory.is_finite() && numbers.iter().chain(forces).all(|x| x.is_finite())
    }
}
