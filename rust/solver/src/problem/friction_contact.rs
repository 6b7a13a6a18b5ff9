//! The data of one friction-contact problem: `(W, q, μ)`.

use super::{BlockSparseDelassus, Dimension, Operator, ProblemError};

/// Find `p` with `u = W p + q`, `ũ = u + μ|u_T| n`, `K_μ* ∋ ũ ⊥ p ∈ K_μ` at every contact.
///
/// Components run contact by contact, `normal, tangent, (tangent)`; with `n_c` contacts of `d`
/// components, `n = d n_c`. `W` is used as given: it need not be symmetric and may be
/// rank-deficient. Source: Acary, Brémond and Huber 2018.
#[derive(Clone, Copy, Debug)]
pub struct FrictionContactProblem<'a> {
    dimension: Dimension,
    W: Operator<'a>,
    q: &'a [f64],
    mu: &'a [f64],
}

impl<'a> FrictionContactProblem<'a> {
    /// Checks every entry and states the problem.
    ///
    /// `W`: Delassus operator, row-major `n × n`, 1/kg. `q`: free local velocity (n), m/s, with
    /// `e u_N⁻` already added to the normal components. `mu`: friction coefficients (`n_c`).
    ///
    /// # Errors
    /// [`ProblemError`], naming the first entry that is of the wrong shape,
    /// not finite or of the wrong sign.
    pub fn new(
        dimension: Dimension,
        W: &'a [f64],
        q: &'a [f64],
        mu: &'a [f64],
    ) -> Result<Self, ProblemError> {
        let d = dimension.components();
        let n = d * mu.len();
        if q.len() != n {
            return Err(ProblemError::VelocityShape {
                n_contacts: mu.len(),
                components: d,
                found: q.len(),
            });
        }
        if W.len() != n * n {
            return Err(ProblemError::OperatorShape { n, found: W.len() });
        }
        Self::checked(dimension, Operator::Dense(W), q, mu)
    }

    /// Checks every entry and states a problem of many contacts, with only the nonzero blocks of
    /// `W`.
    ///
    /// # Errors
    /// As [`new`](Self::new), and where the components of `W` are not the dimension's.
    pub fn new_sparse(
        dimension: Dimension,
        W: &'a BlockSparseDelassus,
        q: &'a [f64],
        mu: &'a [f64],
    ) -> Result<Self, ProblemError> {
        let d = dimension.components();
        if W.components() != d {
            return Err(ProblemError::OperatorComponents {
                expected: d,
                found: W.components(),
            });
        }
        if q.len() != d * mu.len() {
            return Err(ProblemError::VelocityShape {
                n_contacts: mu.len(),
                components: d,
                found: q.len(),
            });
        }
        if W.n_contacts() != mu.len() {
            return Err(ProblemError::OperatorShape {
                n: q.len(),
                found: d * d * W.n_blocks(),
            });
        }
        Self::checked(dimension, Operator::BlockSparse(W), q, mu)
    }

    /// Checks the entries of data whose shapes fit.
    fn checked(
        dimension: Dimension,
        W: Operator<'a>,
        q: &'a [f64],
        mu: &'a [f64],
    ) -> Result<Self, ProblemError> {
        let (d, n) = (dimension.components(), q.len());
        if let Some((row, column, value)) = W.first_non_finite(n) {
            return Err(ProblemError::NonFiniteOperator { row, column, value });
        }
        if let Some(index) = q.iter().position(|x| !x.is_finite()) {
            return Err(ProblemError::NonFiniteVelocity {
                index,
                value: q[index],
            });
        }
        for (contact, &value) in mu.iter().enumerate() {
            if !(value.is_finite() && value >= 0.0) {
                return Err(ProblemError::InvalidFrictionCoefficient { contact, value });
            }
            for k in 0..d {
                let value = W.diagonal(dimension, n, contact, k);
                if k == 0 && value <= 0.0 {
                    return Err(ProblemError::NonPositiveNormal { contact, value });
                }
                if value < 0.0 {
                    return Err(ProblemError::NegativeTangential { contact, value });
                }
            }
        }
        Ok(Self {
            dimension,
            W,
            q,
            mu,
        })
    }

    /// States a sparse problem from data that the caller assembled itself; only the shapes are
    /// checked, see [`from_assembled`](Self::from_assembled).
    ///
    /// # Panics
    /// If the lengths of `W`, `q` and `mu` do not fit together.
    #[must_use]
    pub fn from_assembled_sparse(W: &'a BlockSparseDelassus, q: &'a [f64], mu: &'a [f64]) -> Self {
        let dimension = if W.components() == 2 {
            Dimension::Two
        } else {
            Dimension::Three
        };
        assert!(
            W.n_contacts() == mu.len() && q.len() == dimension.components() * mu.len(),
            "W, q and mu must be of the same contacts"
        );
        Self {
            dimension,
            W: Operator::BlockSparse(W),
            q,
            mu,
        }
    }

    /// States the problem from data that the caller assembled itself; only the shapes are checked.
    ///
    /// Meant for the time stepper. Entries that are not finite make a solve end with
    /// [`SolveStatus::NonFinite`](crate::solver::SolveStatus::NonFinite),
    /// never with a NaN in the answer.
    ///
    /// # Panics
    /// If the lengths of `W`, `q` and `mu` do not fit together.
    #[must_use]
    pub fn from_assembled(dimension: Dimension, W: &'a [f64], q: &'a [f64], mu: &'a [f64]) -> Self {
        let n = dimension.components() * mu.len();
        assert!(q.len() == n, "q must have components * n_contacts entries");
        assert!(W.len() == n * n, "W must have n * n entries");
        Self {
            dimension,
            W: Operator::Dense(W),
            q,
            mu,
        }
    }

    /// One tangent per contact or two.
    #[inline]
    #[must_use]
    pub const fn dimension(&self) -> Dimension {
        self.dimension
    }

    /// Delassus operator `W`, 1/kg.
    #[inline]
    #[must_use]
    pub const fn operator(&self) -> Operator<'a> {
        self.W
    }

    /// Free local velocity `q` (n), m/s, restitution included.
    #[inline]
    #[must_use]
    pub const fn free_velocity(&self) -> &'a [f64] {
        self.q
    }

    /// Friction coefficients `μ` (`n_c`).
    #[inline]
    #[must_use]
    pub const fn friction_coefficients(&self) -> &'a [f64] {
        self.mu
    }

    /// Number of contacts `n_c`.
    #[inline]
    #[must_use]
    pub const fn n_contacts(&self) -> usize {
        self.mu.len()
    }

    /// Number of unknowns `n = d n_c`.
    #[inline]
    #[must_use]
    pub const fn n_unknowns(&self) -> usize {
        self.q.len()
    }
}
