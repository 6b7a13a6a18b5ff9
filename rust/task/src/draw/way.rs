//! Whether a rover could drive from a start to a goal: a search over a grid of heights.

use std::collections::VecDeque;

/// Steepest rise of a way, rise over run: tan 30°, what friction of 0.6 just holds.
pub const STEEPEST: f64 = 0.577_350_269_189_625_8;

/// Distance of the grid's points, m, and how far it reaches beyond start and goal, m.
const SPACING: f64 = 0.5;
const MARGIN: f64 = 10.0;
/// Most points to a side: the grid of a long way is coarser.
const MOST: f64 = 400.0;

/// Whether a way leads from one place (x, z, m) to another on which the ground rises and falls by
/// at most [`STEEPEST`]. `height`: of the ground, m; None where it is not known.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // indices of the grid
pub fn leads(height: impl Fn(f64, f64) -> Option<f64>, from: [f64; 2], to: [f64; 2]) -> bool {
    let low = [0, 1].map(|k| from[k].min(to[k]) - MARGIN);
    let size = [0, 1].map(|k| (from[k] - to[k]).abs() + 2.0 * MARGIN);
    let spacing = SPACING.max(size[0].max(size[1]) / MOST);
    let n = size.map(|size| (size / spacing).ceil() as usize + 1);
    let at = |x: f64, k: usize| ((x - low[k]) / spacing).round() as usize;
    let place = |[x, z]: [f64; 2]| at(z, 1) * n[0] + at(x, 0);
    let heights: Vec<Option<f64>> = (0..n[0] * n[1])
        .map(|k| {
            let (column, row) = ((k % n[0]) as f64, (k / n[0]) as f64);
            height(low[0] + column * spacing, low[1] + row * spacing)
        })
        .collect();
    let (first, last) = (place(from), place(to));
    let mut seen = vec![false; heights.len()];
    let mut queue = VecDeque::from([first]);
    seen[first] = true;
    while let Some(own) = queue.pop_front() {
        if own == last {
            return true;
        }
        let Some(here) = heights[own] else {
            continue;
        };
        let (column, row) = (own % n[0], own / n[0]);
        for (di, dj) in NEIGHBOURS {
            let (Some(i), Some(j)) = (column.checked_add_signed(di), row.checked_add_signed(dj))
            else {
                continue;
            };
            if i >= n[0] || j >= n[1] || seen[j * n[0] + i] {
                continue;
            }
            let run = spacing * ((di * di + dj * dj) as f64).sqrt();
            let is_gentle =
                heights[j * n[0] + i].is_some_and(|there| (there - here).abs() <= STEEPEST * run);
            if is_gentle {
                seen[j * n[0] + i] = true;
                queue.push_back(j * n[0] + i);
            }
        }
    }
    false
}

const NEIGHBOURS: [(isize, isize); 8] = [
    (1, 0),
    (1, 1),
    (0, 1),
    (-1, 1),
    (-1, 0),
    (-1, -1),
    (0, -1),
    (1, -1),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_is_gone_round_where_it_ends_and_stops_where_it_does_not() {
        let wall = |end: f64| {
            move |x: f64, z: f64| {
                Some(if (4.0..6.0).contains(&x) && z < end {
                    3.0
                } else {
                    0.0
                })
            }
        };
        assert!(leads(wall(5.0), [0.0, 0.0], [10.0, 0.0]));
        assert!(!leads(wall(50.0), [0.0, 0.0], [10.0, 0.0]));
    }

    #[test]
    fn a_slope_is_climbed_up_to_the_steepest() {
        let slope = |rise: f64| move |x: f64, _: f64| Some(rise * x);
        assert!(leads(slope(0.99 * STEEPEST), [0.0, 0.0], [30.0, 10.0]));
        assert!(!leads(slope(1.5 * STEEPEST), [0.0, 0.0], [30.0, 0.0]));
    }

    #[test]
    fn no_way_leads_over_unknown_ground() {
        let hole = |x: f64, _: f64| (!(4.0..6.0).contains(&x)).then_some(0.0);
        assert!(!leads(hole, [0.0, 0.0], [10.0, 0.0]));
    }
}
