//! How the coordinate of a joint follows from another's: `q = ratio q_other + offset`.

use crate::scalar::Lane;

/// How a joint follows another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Rate of the joint per unit rate of the joint that it follows; dimensionless, rad/m or m/rad.
    pub ratio: f64,
    /// Coordinate of the joint at the zero of the joint that it follows, rad or m.
    pub offset: f64,
    /// For a joint further along the path of the joint that it follows: the index of the motion
    /// that the velocity imparts to its carrier, and of the motion that it imparts to everything
    /// the coupled joint carries. `None` if both are mounted on one body.
    pub combined: Option<(usize, usize)>,
}

impl Coupling {
    /// Coordinate of the joint, rad or m, where the joint that it follows has the coordinate `q`.
    #[inline(always)]
    #[must_use]
    pub fn value<T: Lane>(&self, q: T) -> T {
        q.like(self.ratio) * q + q.like(self.offset)
    }
}
