//! Errors in the data of a friction-contact problem.

use thiserror::Error;

/// Errors in the data of a friction-contact problem.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ProblemError {
    /// The free velocity's length is not `components · n_contacts`.
    #[error("q has {found} entries, but {n_contacts} contacts of {components} components need {}", n_contacts * components)]
    VelocityShape {
        /// Number of contacts, the length of `mu`.
        n_contacts: usize,
        /// Components per contact.
        components: usize,
        /// Length of the given `q`.
        found: usize,
    },
    /// `W` is not an `n × n` matrix with `n` the length of `q`.
    #[error("W has {found} entries, but {n} x {n} are needed")]
    OperatorShape {
        /// Number of rows needed.
        n: usize,
        /// Number of entries given.
        found: usize,
    },
    /// A block row whose columns do not ascend, leave the matrix or lack the diagonal block.
    #[error(
        "block row {row} of W must have ascending columns within the matrix and its diagonal block"
    )]
    OperatorPattern {
        /// Contact of the row.
        row: usize,
    },
    /// `W` has another number of components per contact than the problem.
    #[error("W has blocks of {found} components, but {expected} are needed")]
    OperatorComponents {
        /// Components of the problem.
        expected: usize,
        /// Components of the blocks.
        found: usize,
    },
    /// An entry of `W` is infinite or not a number.
    #[error("W[{row}, {column}] = {value} is not finite")]
    NonFiniteOperator {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// An entry of `q` is infinite or not a number.
    #[error("q[{index}] = {value} m/s is not finite")]
    NonFiniteVelocity {
        /// Position in `q`.
        index: usize,
        /// The entry, m/s.
        value: f64,
    },
    /// A friction coefficient is negative, infinite or not a number.
    #[error("friction coefficient mu[{contact}] = {value} is not a finite number >= 0")]
    InvalidFrictionCoefficient {
        /// Contact index.
        contact: usize,
        /// The coefficient.
        value: f64,
    },
    /// A contact that no normal impulse can move: `W_NN ≤ 0`.
    #[error(
        "contact {contact} has W_NN = {value} 1/kg; a normal impulse must change the normal velocity"
    )]
    NonPositiveNormal {
        /// Contact index.
        contact: usize,
        /// The diagonal entry, 1/kg.
        value: f64,
    },
    /// A negative tangential diagonal entry: `W` is not positive semidefinite.
    #[error("contact {contact} has the negative tangential diagonal entry {value} 1/kg")]
    NegativeTangential {
        /// Contact index.
        contact: usize,
        /// The diagonal entry, 1/kg.
        value: f64,
    },
}

impl ProblemError {
    /// The offending datum: `q`, `mu[2]`, `W[0, 3]`.
    #[must_use]
    pub fn field(&self) -> String {
        match self {
            Self::VelocityShape { .. } => "q".to_owned(),
            Self::OperatorShape { .. }
            | Self::OperatorPattern { .. }
            | Self::OperatorComponents { .. }
            | Self::NonPositiveNormal { .. }
            | Self::NegativeTangential { .. } => "W".to_owned(),
            Self::NonFiniteOperator { row, column, .. } => format!("W[{row}, {column}]"),
            Self::NonFiniteVelocity { index, .. } => format!("q[{index}]"),
            Self::InvalidFrictionCoefficient { contact, .. } => format!("mu[{contact}]"),
        }
    }
}
