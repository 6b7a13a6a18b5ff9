//! Passive and active elements of a joint: spring, damper, rotor, stops, drive, and the gains of
//! its position control.

use crate::multibody::description::{DriveDescription, Hold, JointLimits, SolidDescription};
use crate::multibody::joint::Coupling;

/// A joint with one coordinate of its own.
#[derive(Clone, Debug)]
pub struct JointProperties {
    /// The body that it moves.
    pub body: usize,
    /// Index of its velocity.
    pub velocity: usize,
    /// PD gains of its position control.
    pub hold: Hold,
    /// Spring, damper, rotor and dry friction of the joint, including those of all joints that
    /// follow it.
    pub passive: Passive,
    /// Stops of the joint, if any.
    pub limits: Option<JointLimits>,
    /// Drive of the joint, if any; a wheel's joint has none.
    pub drive: Option<DriveDescription>,
    /// Whether the joint has a spring or a damper.
    pub is_passive: bool,
}

/// Spring, damper, rotor and dry friction.
///
/// `τ = −stiffness (q − rest) − damping q̇ − armature q̈ − f`; in motion `f = friction sign q̇`, at
/// rest `|f| ≤ friction`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passive {
    /// N m/rad or N/m.
    pub stiffness: f64,
    /// rad or m.
    pub rest: f64,
    /// N m s/rad or N s/m.
    pub damping: f64,
    /// kg m² or kg.
    pub armature: f64,
    /// N m or N.
    pub friction: f64,
}

impl JointProperties {
    /// The passive elements of the joint that carries a solid.
    pub(super) fn of(body: usize, solid: &SolidDescription) -> Self {
        Self {
            body,
            velocity: 0,
            hold: solid.hold.unwrap_or(Hold {
                stiffness: 0.0,
                damping: 0.0,
            }),
            passive: Passive::of(solid),
            limits: solid.limits,
            drive: solid.drive,
            is_passive: false,
        }
    }
}

impl Passive {
    pub(super) fn of(solid: &SolidDescription) -> Self {
        Self {
            stiffness: solid.spring.map_or(0.0, |spring| spring.stiffness),
            rest: solid.spring.map_or(0.0, |spring| spring.rest),
            damping: solid.damping.unwrap_or(0.0),
            armature: solid.armature.unwrap_or(0.0),
            friction: solid.friction.unwrap_or(0.0),
        }
    }

    /// Passive elements of a coupled joint, as felt by the joint that it follows.
    pub(super) fn seen_through(&self, coupling: &Coupling) -> Self {
        let Coupling { ratio, offset, .. } = *coupling;
        let square = ratio * ratio;
        let is_spring = self.stiffness > 0.0 && square > 0.0;
        Self {
            stiffness: if is_spring {
                square * self.stiffness
            } else {
                0.0
            },
            rest: if is_spring {
                (self.rest - offset) / ratio
            } else {
                0.0
            },
            damping: square * self.damping,
            armature: square * self.armature,
            friction: ratio.abs() * self.friction,
        }
    }

    /// Both in parallel at one joint. Two springs act as one, with a rest position between theirs.
    pub(crate) fn with(&self, other: &Self) -> Self {
        let stiffness = self.stiffness + other.stiffness;
        let moment = self.stiffness * self.rest + other.stiffness * other.rest;
        Self {
            stiffness,
            rest: if stiffness > 0.0 {
                moment / stiffness
            } else {
                0.0
            },
            damping: self.damping + other.damping,
            armature: self.armature + other.armature,
            friction: self.friction + other.friction,
        }
    }

    /// Energy stored in the spring at a coordinate, J.
    #[must_use]
    pub fn potential(&self, coordinate: f64) -> f64 {
        let stretch = coordinate - self.rest;
        0.5 * self.stiffness * stretch * stretch
    }
}
