//! Ruts: how far wheels have pressed the sand down, on a sparse grid.
//!
//! A cell that no wheel has been on takes no memory and no time. While a wheel is over a cell the
//! greatest depth of its rim there is noted; when it has left, the depth becomes the rut. A wheel
//! therefore never loses the support of its own sinkage. Between the centres of cells the depth is
//! interpolated.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

type Cells = BTreeMap<(i32, i32), f64>;

/// Depths of ruts under the undisturbed surface, m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Listed", into = "Listed")]
pub struct RutMap {
    depths: Cells,
    /// Cells under each wheel, with the depth that they will keep.
    under: Vec<Cells>,
}

/// The map as lists: column, row, depth.
#[derive(Serialize, Deserialize)]
struct Listed {
    depths: Vec<(i32, i32, f64)>,
    under: Vec<Vec<(i32, i32, f64)>>,
}

fn list(cells: &Cells) -> Vec<(i32, i32, f64)> {
    cells.iter().map(|(&(i, k), &d)| (i, k, d)).collect()
}

fn map(list: Vec<(i32, i32, f64)>) -> Cells {
    list.into_iter().map(|(i, k, d)| ((i, k), d)).collect()
}

impl From<RutMap> for Listed {
    fn from(ruts: RutMap) -> Self {
        Self {
            depths: list(&ruts.depths),
            under: ruts.under.iter().map(list).collect(),
        }
    }
}

impl From<Listed> for RutMap {
    fn from(listed: Listed) -> Self {
        Self {
            depths: map(listed.depths),
            under: listed.under.into_iter().map(map).collect(),
        }
    }
}

impl RutMap {
    /// Without ruts, for a number of wheels.
    #[must_use]
    pub fn new(wheels: usize) -> Self {
        Self {
            depths: Cells::new(),
            under: vec![Cells::new(); wheels],
        }
    }

    /// Whether nothing was driven on.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.depths.is_empty()
    }

    /// Number of wheels.
    #[must_use]
    pub fn n_wheels(&self) -> usize {
        self.under.len()
    }

    /// Cells with a rut: column along x, row along z, and depth, m.
    #[must_use]
    pub fn cells(&self) -> Vec<(i32, i32, f64)> {
        list(&self.depths)
    }

    /// Whether all depths are finite and not negative.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let maps = std::iter::once(&self.depths).chain(&self.under);
        let mut depths = maps.flat_map(BTreeMap::values);
        depths.all(|depth| depth.is_finite() && *depth >= 0.0)
    }

    /// Depth at a place, m, on a grid with cells of this size, m.
    #[must_use]
    pub fn depth(&self, [x, z]: [f64; 2], cell: f64) -> f64 {
        if self.depths.is_empty() {
            return 0.0;
        }
        let (x, z) = (x / cell - 0.5, z / cell - 0.5);
        let (i, k) = (x.floor(), z.floor());
        let (a, b) = (x - i, z - k);
        let (i, k) = (index(i), index(k));
        let at = |i, k| self.depths.get(&(i, k)).copied().unwrap_or(0.0);
        let near = at(i, k) * (1.0 - a) + at(i + 1, k) * a;
        let far = at(i, k + 1) * (1.0 - a) + at(i + 1, k + 1) * a;
        near * (1.0 - b) + far * b
    }

    /// Whether there is a rut within `radius` (m) of a place.
    #[must_use]
    pub fn is_near(&self, [x, z]: [f64; 2], radius: f64, cell: f64) -> bool {
        let columns = index((x - radius) / cell - 1.0)..=index((x + radius) / cell + 1.0);
        let rows = [
            index((z - radius) / cell - 1.0),
            index((z + radius) / cell + 1.0),
        ];
        !self.depths.is_empty()
            && columns.into_iter().any(|i| {
                self.depths
                    .range((i, rows[0])..=(i, rows[1]))
                    .next()
                    .is_some()
            })
    }

    /// Notes where a wheel is: `depth_at` gives the depth of its rim under the undisturbed surface
    /// at a place, m; none where the wheel is not over the place. Cells that it has left become
    /// ruts. `reach`: how far from its centre the wheel may be, m.
    pub fn pass(
        &mut self,
        wheel: usize,
        [x, z]: [f64; 2],
        (reach, cell): (f64, f64),
        depth_at: impl Fn([f64; 2]) -> Option<f64>,
    ) {
        let mut now = Cells::new();
        for i in index((x - reach) / cell)..=index((x + reach) / cell) {
            for k in index((z - reach) / cell)..=index((z + reach) / cell) {
                let centre = [(f64::from(i) + 0.5) * cell, (f64::from(k) + 0.5) * cell];
                if let Some(depth) = depth_at(centre) {
                    let before = self.under[wheel].get(&(i, k)).copied();
                    let depth = depth.max(before.unwrap_or(0.0));
                    if depth > 0.0 {
                        now.insert((i, k), depth);
                    }
                }
            }
        }
        for (at, depth) in std::mem::replace(&mut self.under[wheel], now) {
            if !self.under[wheel].contains_key(&at) {
                let rut = self.depths.entry(at).or_insert(0.0);
                *rut = rut.max(depth);
            }
        }
    }
}

#[allow(clippy::cast_possible_truncation)] // saturates far beyond any terrain
fn index(x: f64) -> i32 {
    x.floor() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wheel_leaves_a_rut_behind_it_and_none_under_it() {
        let mut ruts = RutMap::new(1);
        let disc = |x: f64| {
            move |at: [f64; 2]| {
                let t = at[0] - x;
                (t.abs() < 0.05 && at[1].abs() < 0.03).then_some(0.02 - 5.0 * t * t)
            }
        };
        let mut x = 0.0;
        while x < 1.0 {
            ruts.pass(0, [x, 0.0], (0.1, 0.01), disc(x));
            x += 0.005;
        }
        assert!((ruts.depth([0.5, 0.0], 0.01) - 0.02).abs() < 1e-3);
        assert!(ruts.depth([x - 0.02, 0.0], 0.01) < 1e-12);
        assert!(ruts.depth([0.5, 0.1], 0.01) < 1e-12);
        assert!(ruts.is_near([0.5, 0.05], 0.03, 0.01));
        assert!(!ruts.is_near([0.5, 0.2], 0.03, 0.01));
    }
}
