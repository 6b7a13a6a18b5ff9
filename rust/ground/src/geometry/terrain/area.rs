//! Rectangles of the map.

/// A rectangle along the axes, seen from above: low and high x, and low and high z, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area(pub [[f64; 2]; 2]);

impl Area {
    /// A square about a place (x, z).
    #[must_use]
    pub fn around([x, z]: [f64; 2], radius: f64) -> Self {
        Self([x, z].map(|x| [x - radius, x + radius]))
    }

    /// x and z of its middle, m.
    #[must_use]
    pub fn middle(&self) -> [f64; 2] {
        self.0.map(|[low, high]| 0.5 * (low + high))
    }

    /// Half its longer side, m.
    #[must_use]
    pub fn radius(&self) -> f64 {
        let [x, z] = self.0.map(|[low, high]| 0.5 * (high - low));
        x.max(z)
    }

    /// Whether a segment (x, z, m) has more than a point within it.
    #[must_use]
    pub fn is_crossed(&self, [a, b]: &[[f64; 2]; 2]) -> bool {
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let ([low, high], way) = (self.0[axis], b[axis] - a[axis]);
            // The rim of the rectangle is not within it.
            let slack = EDGE * (high - low);
            let (low, high) = (low + slack - a[axis], high - slack - a[axis]);
            if way.abs() <= 0.0 {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
                continue;
            }
            let [p, q] = [low / way, high / way];
            (from, to) = (from.max(p.min(q)), to.min(p.max(q)));
        }
        from < to
    }

    /// Cells into which the borders of other rectangles cut this one.
    #[allow(clippy::needless_pass_by_value)] // an iterator that is cloned
    pub fn cut(&self, others: impl Iterator<Item = Self> + Clone) -> impl Iterator<Item = Self> {
        let borders = [0, 1].map(|axis| {
            let [low, high] = self.0[axis];
            let inner = others.clone().flat_map(|other| other.0[axis]);
            let mut borders: Vec<f64> = inner.filter(|x| *x > low && *x < high).collect();
            borders.extend([low, high]);
            borders.sort_by(f64::total_cmp);
            borders
        });
        let [x, z] = borders.map(|all| {
            let pairs = all.windows(2).map(|pair| [pair[0], pair[1]]);
            pairs.collect::<Vec<_>>()
        });
        x.into_iter()
            .flat_map(move |x| z.clone().into_iter().map(move |z| Self([x, z])))
    }
}

/// Share of a rectangle's side that is not within it.
const EDGE: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_along_the_rim_does_not_cross_and_one_through_a_corner_does() {
        let area = Area([[0.0, 1.0], [0.0, 2.0]]);
        for (segment, crosses) in [
            ([[0.0, -1.0], [0.0, 3.0]], false),
            ([[0.5, -1.0], [0.5, 3.0]], true),
            ([[-0.5, 0.1], [0.1, -0.5]], false),
            ([[-0.1, 0.2], [0.3, -0.1]], true),
            ([[0.4, 0.4], [0.5, 0.5]], true),
            ([[2.0, 0.4], [3.0, 0.5]], false),
        ] {
            assert_eq!(area.is_crossed(&segment), crosses, "{segment:?}");
        }
    }

    #[test]
    fn the_parts_of_a_cut_rectangle_fill_it() {
        let others = [
            Area([[0.3, 5.0], [-1.0, 0.5]]),
            Area([[-1.0, 0.3], [0.5, 9.0]]),
        ];
        let area = Area([[0.0, 1.0], [0.0, 2.0]]);
        let parts: Vec<Area> = area.cut(others.into_iter()).collect();
        let size = |area: &Area| area.0.iter().map(|[low, high]| high - low).product::<f64>();
        let sum: f64 = parts.iter().map(size).sum();
        assert!(parts.len() >= 4 && (sum - 2.0).abs() < 1e-12, "{parts:?}");
    }
}
