//! Timing of the parts of a step.

/// Part of a step that has just ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Phase {
    /// Configuration of the evaluation and forward kinematics.
    Kinematics,
    /// Search for contacts.
    Detection,
    /// Composite rigid bodies.
    MassMatrix,
    /// Recursive Newton–Euler, commands.
    Bias,
    /// `Lᵀ D L` and the free velocity.
    Factor,
    /// Contact Jacobians and W.
    Delassus,
    /// Friction-contact problem.
    Solve,
    /// Impulses to velocity, new configuration.
    Update,
    /// Projection of positions.
    Projection,
}

impl Phase {
    /// Name in lower case, with underscores.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Kinematics => "kinematics",
            Self::Detection => "detection",
            Self::MassMatrix => "mass_matrix",
            Self::Bias => "bias",
            Self::Factor => "factor",
            Self::Delassus => "delassus",
            Self::Solve => "solve",
            Self::Update => "update",
            Self::Projection => "projection",
        }
    }
}

/// Receives the end of each part of a step.
pub trait Probe {
    /// `phase` has just ended.
    fn end(&mut self, phase: Phase);
}

/// Ignores all events.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProbe;

impl Probe for NoProbe {
    #[inline]
    fn end(&mut self, _phase: Phase) {}
}
