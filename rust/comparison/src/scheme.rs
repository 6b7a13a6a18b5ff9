//! The list of schemes that are compared.

use crate::whole::Whole;
use rover_core::integrator::{
    Integrator, KeyOf, Probe, ScratchOf, Stabilisation, StateMut, StepError, StepOptions,
    StepReport, Variant, WarmStart,
};

use crate::{EventDriven, GeneralisedAlpha, Penalty, ProjectedToConvergence, SchatzmanPaoli};

/// Which family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SchemeFamily {
    /// The rover's own.
    MoreauJean {
        /// Linearised or Newton.
        variant: Variant,
        /// θ.
        theta: f64,
        /// Position projection.
        stabilisation: Stabilisation,
    },
    /// [`GeneralisedAlpha`] with ρ∞.
    GeneralisedAlpha(f64),
    /// [`SchatzmanPaoli`].
    SchatzmanPaoli,
    /// [`EventDriven`].
    EventDriven,
    /// [`Penalty`] with a stiffness, N/m, and a slip speed, m/s.
    Penalty(f64, f64),
}

/// A scheme with its name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scheme {
    /// For tables.
    pub name: &'static str,
    /// What steps.
    pub kind: SchemeFamily,
}

/// All that are compared.
pub const SCHEMES: [Scheme; 8] = [
    Scheme {
        name: "Moreau–Jean, linearised",
        kind: moreau_jean(Variant::Linearised, 0.5, Stabilisation::Projection),
    },
    Scheme {
        name: "Moreau–Jean, linearised, no projection",
        kind: moreau_jean(Variant::Linearised, 0.5, Stabilisation::None),
    },
    Scheme {
        name: "Moreau–Jean, linearised, θ = 1",
        kind: moreau_jean(Variant::Linearised, 1.0, Stabilisation::Projection),
    },
    Scheme {
        name: "Moreau–Jean, Newton",
        kind: moreau_jean(Variant::Newton, 0.5, Stabilisation::Projection),
    },
    Scheme {
        name: "Generalised-α, ρ = 0.8",
        kind: SchemeFamily::GeneralisedAlpha(0.8),
    },
    Scheme {
        name: "Schatzman–Paoli",
        kind: SchemeFamily::SchatzmanPaoli,
    },
    Scheme {
        name: "Event-driven, Runge–Kutta 4",
        kind: SchemeFamily::EventDriven,
    },
    Scheme {
        name: "Penalty, 1e5 N/m",
        kind: SchemeFamily::Penalty(1e5, 1e-2),
    },
];

const fn moreau_jean(variant: Variant, theta: f64, stabilisation: Stabilisation) -> SchemeFamily {
    SchemeFamily::MoreauJean {
        variant,
        theta,
        stabilisation,
    }
}

impl Scheme {
    /// The step's options for this scheme.
    #[must_use]
    pub fn options(&self, base: &StepOptions) -> StepOptions {
        let mut options = base.clone();
        if let SchemeFamily::MoreauJean {
            variant,
            theta,
            stabilisation,
        } = self.kind
        {
            options.variant = variant;
            options.theta = theta;
            options.stabilisation = stabilisation;
        }
        options
    }

    /// A fresh stepper for one run. `mass`: what a contact carries, kg, by
    /// which the penalty scheme chooses its damping.
    #[must_use]
    pub fn stepper(&self, mass: f64, restitution: f64) -> Stepper {
        match self.kind {
            SchemeFamily::MoreauJean { variant, .. } => Stepper::MoreauJean(variant),
            SchemeFamily::GeneralisedAlpha(rho) => {
                Stepper::GeneralisedAlpha(GeneralisedAlpha::new(rho))
            }
            SchemeFamily::SchatzmanPaoli => Stepper::SchatzmanPaoli(SchatzmanPaoli::default()),
            SchemeFamily::EventDriven => Stepper::EventDriven(EventDriven::default()),
            SchemeFamily::Penalty(stiffness, slip) => Stepper::Penalty(Penalty::with_restitution(
                stiffness,
                mass,
                restitution,
                slip,
            )),
        }
    }
}

/// A scheme in one run: some carry accelerations from step to step.
#[derive(Debug)]
pub enum Stepper {
    /// The rover's own.
    MoreauJean(Variant),
    /// See [`ProjectedToConvergence`].
    ProjectedToConvergence(ProjectedToConvergence),
    /// See [`GeneralisedAlpha`].
    GeneralisedAlpha(GeneralisedAlpha),
    /// See [`SchatzmanPaoli`].
    SchatzmanPaoli(SchatzmanPaoli),
    /// See [`EventDriven`].
    EventDriven(EventDriven),
    /// See [`Penalty`].
    Penalty(Penalty),
}

impl<S: Whole> Integrator<S> for Stepper {
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        match self {
            Self::MoreauJean(s) => s.step(system, options, state, warm_start, scratch, probe),
            Self::ProjectedToConvergence(s) => {
                s.step(system, options, state, warm_start, scratch, probe)
            }
            Self::GeneralisedAlpha(s) => s.step(system, options, state, warm_start, scratch, probe),
            Self::SchatzmanPaoli(s) => s.step(system, options, state, warm_start, scratch, probe),
            Self::EventDriven(s) => s.step(system, options, state, warm_start, scratch, probe),
            Self::Penalty(s) => s.step(system, options, state, warm_start, scratch, probe),
        }
    }
}
