//! Coupling: a joint that follows another, `q = ratio q_other + offset`, as the two sides of a
//! rover's differential do.
//!
//! The joint has neither coordinate nor velocity of its own. It is eliminated exactly: a unit of
//! the other joint's velocity gives to all that the coupled joint carries `ratio` times its own
//! screw,
//!
//! ```text
//! M = Gᵀ M_all G,        v_all = G v
//! ```
//!
//! with `M_all` the mass matrix of the tree without the coupling. `M` keeps the sparsity of a tree
//! where both joints lie on one path, or hang on the same body; other couplings are refused.

/// How a joint follows another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Its rate per unit of the other's: 1, rad/m or m/rad.
    pub ratio: f64,
    /// Its coordinate where the other's is zero, rad or m.
    pub offset: f64,
    /// Where it hangs on the joint that it follows: number of the motion that the velocity has
    /// given to its carrier, and of the motion that it gives to all that the coupled joint carries.
    /// None where both hang on one body.
    pub combined: Option<(usize, usize)>,
}

impl Coupling {
    /// Its coordinate, rad or m.
    #[inline]
    #[must_use]
    pub fn value(&self, other: f64) -> f64 {
        self.ratio * other + self.offset
    }
}
