//! Slabs across a bed: each holds about as many grains as the others, and is thick enough that
//! touching grains are in the same one or in neighbours.

use super::bodies::COORDINATES;

/// Grains whose places decide where slabs end.
const SAMPLE: usize = 1024;

/// Grains in a slab, at least.
const FEWEST: usize = 150;

/// Most slabs.
const MOST: usize = 64;

/// Ends of the slabs of a step: scratch.
#[derive(Clone, Debug, Default)]
pub struct Slabs {
    sample: Vec<f64>,
    ends: Vec<f64>,
}

impl Slabs {
    /// The slab of each of `n` balls with the coordinates `q`. Slabs are at least `width` (m)
    /// thick, and lie across the axis along which the bed is longest.
    pub fn assign(&mut self, q: &[f64], n: usize, width: f64, out: &mut Vec<u32>) {
        let most = (n / FEWEST).min(MOST);
        out.clear();
        if most < 2 {
            return;
        }
        let mut longest = (0, 0.0);
        for axis in 0..COORDINATES {
            self.draw(q, n, axis);
            // Without the outermost twentieths: grains that fly off count for nothing.
            let count = self.sample.len();
            let length = self.sample[count - 1 - count / 20] - self.sample[count / 20];
            if length > longest.1 {
                longest = (axis, length);
            }
        }
        let axis = longest.0;
        self.draw(q, n, axis);
        self.ends.clear();
        for k in 1..most {
            let end = self.sample[k * self.sample.len() / most];
            let is_thick = self.ends.last().is_none_or(|last| end - last >= width);
            if is_thick {
                self.ends.push(end);
            }
        }
        let grains = q.chunks_exact(COORDINATES).take(n);
        out.extend(grains.map(|x| {
            #[allow(clippy::cast_possible_truncation)] // few
            {
                self.ends.partition_point(|end| *end <= x[axis]) as u32
            }
        }));
    }

    /// Sorted coordinates of some grains.
    fn draw(&mut self, q: &[f64], n: usize, axis: usize) {
        self.sample.clear();
        let each = n.div_ceil(SAMPLE);
        let grains = q.chunks_exact(COORDINATES).take(n).step_by(each);
        self.sample.extend(grains.map(|x| x[axis]));
        self.sample.sort_unstable_by(f64::total_cmp);
    }
}
