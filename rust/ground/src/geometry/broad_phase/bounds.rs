//! A box along the axes that bounds something.

use nalgebra::Vector3;

/// By how much, of itself, the distance at which a ray leaves a box is raised, so that rounding
/// never misses what touches its face (Ize 2013, *Robust BVH ray traversal*).
const LEAVES: f64 = 1.0 + 8.0 * f64::EPSILON;

/// What lies between two corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// m.
    pub low: Vector3<f64>,
    /// m.
    pub high: Vector3<f64>,
}

impl Bounds {
    /// Around nothing.
    pub const NOTHING: Self = Self {
        low: Vector3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        high: Vector3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// Around both.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        Self {
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }

    /// Distances (m) at which a ray from `origin` enters and leaves, within 0 and `reach`.
    /// `inverse`: of the components of its direction.
    #[inline]
    #[must_use]
    pub fn crossing(
        &self,
        origin: &Vector3<f64>,
        inverse: &Vector3<f64>,
        reach: f64,
    ) -> Option<[f64; 2]> {
        // Comparisons, not `f64::max`: nothing here is nan, and each is one instruction.
        let (mut enter, mut leave) = (0.0_f64, reach);
        for k in 0..3 {
            let first = (self.low[k] - origin[k]) * inverse[k];
            let second = (self.high[k] - origin[k]) * inverse[k];
            let (near, far) = if first < second {
                (first, second)
            } else {
                (second, first)
            };
            let far = far * LEAVES;
            enter = if near > enter { near } else { enter };
            leave = if far < leave { far } else { leave };
        }
        (enter <= leave).then_some([enter, leave])
    }
}
