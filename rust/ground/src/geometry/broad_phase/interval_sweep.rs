//! Pairs of moving balls that come near each other: sort and sweep along one axis.
//!
//! Balls are sorted by the start of their intervals along x, and each is compared with those that
//! start before it ends. For a scene spread over the ground the cost is `n log n` plus the pairs
//! that overlap along x. A search remembers nothing of the last one, so equal scenes give equal
//! pairs.
//!
//! Source: Baraff 1992; Cohen et al. 1995.

use crate::geometry::shape::Sphere;

/// Scratch of a search. It grows to the largest size needed and is reused.
#[derive(Clone, Debug, Default)]
pub struct IntervalSweep {
    order: Vec<u32>,
    pairs: Vec<(u32, u32)>,
}

impl IntervalSweep {
    /// Room for n balls that have about as many pairs.
    #[must_use]
    pub fn with_capacity(n: usize) -> Self {
        Self {
            order: Vec::with_capacity(n),
            pairs: Vec::with_capacity(4 * n),
        }
    }

    /// All pairs (i, j), i < j, whose balls overlap or come closer than
    /// `reach` (m), sorted; of those that `is_wanted`.
    ///
    /// # Panics
    /// If there are 2^32 balls or more.
    pub fn pairs(
        &mut self,
        balls: &[Sphere],
        reach: f64,
        is_wanted: impl Fn(usize, usize) -> bool,
    ) -> &[(u32, u32)] {
        let narrow = |x: usize| {
            u32::try_from(x).unwrap_or_else(|_| panic!("invariant: {x} balls fit 32 bits"))
        };
        let begin = |i: u32| {
            let ball = &balls[i as usize];
            ball.centre.x - ball.radius
        };
        self.pairs.clear();
        self.order.clear();
        self.order.extend(0..narrow(balls.len()));
        self.order
            .sort_unstable_by(|&i, &j| begin(i).total_cmp(&begin(j)).then(i.cmp(&j)));
        for (place, &i) in self.order.iter().enumerate() {
            let a = &balls[i as usize];
            let end = a.centre.x + a.radius + reach;
            for &j in &self.order[place + 1..] {
                if begin(j) > end {
                    break;
                }
                let b = &balls[j as usize];
                let within = a.radius + b.radius + reach;
                let (low, high) = (i.min(j), i.max(j));
                if (a.centre - b.centre).norm_squared() <= within * within
                    && is_wanted(low as usize, high as usize)
                {
                    self.pairs.push((low, high));
                }
            }
        }
        self.pairs.sort_unstable();
        &self.pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn finds_what_comparing_all_finds(
            places in prop::collection::vec((prop::array::uniform3(-2.0..2.0), 0.01..0.6), 0..40), reach in 0.0..0.5,
        ) {
            let balls: Vec<Sphere> = (places.iter())
                .map(|(centre, radius)| Sphere { centre: (*centre).into(), radius: *radius })
                .collect();
            let is_wanted = |i: usize, j: usize| !(i + j).is_multiple_of(3);
            let mut sweep = IntervalSweep::default();
            let found: Vec<(usize, usize)> = (sweep.pairs(&balls, reach, is_wanted).iter())
                .map(|&(i, j)| (i as usize, j as usize))
                .collect();
            let mut expected = Vec::new();
            for i in 0..balls.len() {
                for j in i + 1..balls.len() {
                    if is_wanted(i, j) && balls[i].distance(&balls[j].centre) <= balls[j].radius + reach {
                        expected.push((i, j));
                    }
                }
            }
            prop_assert_eq!(found, expected);
        }
    }
}
