//! Errors: options out of range, and steps that fail.

use thiserror::Error;

use crate::caught::Fault;

/// An option out of its range.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum OptionsError {
    /// A number outside its interval.
    #[error("{field}: must be {range}, is {value}")]
    OutOfRange {
        /// Name of the option.
        field: &'static str,
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
    /// A coefficient between two materials outside its interval.
    #[error(
        "materials: the {quantity} between {:?} and {:?} must be {range}, is {value}",
        materials[0], materials[1]
    )]
    BetweenMaterials {
        /// `friction` or `restitution`.
        quantity: &'static str,
        /// Names of the materials.
        materials: [String; 2],
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
    /// A pair of materials that is listed twice.
    #[error("materials: {:?} and {:?} are given twice", materials[0], materials[1])]
    MaterialsTwice {
        /// Names of the materials.
        materials: [String; 2],
    },
    /// A text that names no material.
    #[error("materials: a name has 1 to 100 characters, is {name:?}")]
    MaterialName {
        /// What was given.
        name: String,
    },
}

/// A step that failed. The state is unchanged.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum StepError {
    /// A coordinate or velocity overflowed.
    #[error(
        "the step from t = {time} s gave a state that is not finite; the state before it was kept"
    )]
    NonFinite {
        /// Time before the step, s.
        time: f64,
    },
    /// The mass matrix lost its positive definiteness to rounding.
    #[error(
        "the mass matrix at t = {time} s is not positive definite in floating point; the state before the step was kept"
    )]
    SingularMassMatrix {
        /// Time before the step, s.
        time: f64,
    },
    /// The machine came to where its terrain does not say what the ground is.
    #[error(
        "terrain: the ground at x = {x} m, z = {z} m, which the machine reached at t = {time} s, is unknown: the place is outside the map or has no data; the state before the step was kept"
    )]
    NoGround {
        /// Time before the step, s.
        time: f64,
        /// World, m.
        x: f64,
        /// World, m.
        z: f64,
    },
    /// Too many events: an event-driven scheme cannot pass the point where they accumulate.
    #[error(
        "{events} events before t = {time} s in one step: they accumulate, and an event-driven scheme cannot pass; the state before the step was kept"
    )]
    Accumulation {
        /// Time of the last event, s.
        time: f64,
        /// Events in the step.
        events: usize,
    },
    /// This library has a fault: the step panicked.
    #[error(
        "{fault}; this is a fault of rover-gym, please report it with the model and the state; the state before the step, at t = {time} s, was kept"
    )]
    Internal {
        /// Time before the step, s.
        time: f64,
        /// The panic.
        fault: Fault,
    },
}
