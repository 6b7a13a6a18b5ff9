//! Ruts: how far wheels have pressed the sand down, on a sparse grid.
//!
//! A cell that no wheel has been on takes no memory and no time. While a wheel is over a cell the
//! greatest depth of its rim there is noted; when it has left, the depth becomes the rut. A wheel
//! therefore never loses the support of its own sinkage. Between the centres of cells the depth is
//! interpolated.
//!
//! Depths are kept in tiles of 16 by 16 cells. A step reads those near a wheel once, into a
//! [`Window`].

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use friction_contact::scalar::Lane;

/// Cells along the side of a tile.
const SIDE: usize = 16;
const WIDE: i32 = 16;

/// Depths of a tile's cells, m, row by row.
type Tile = Box<[f64]>;

/// Depths of ruts under the undisturbed surface, m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Listed", into = "Listed")]
pub struct RutMap {
    tiles: BTreeMap<(i32, i32), Tile>,
    /// Cells under each wheel, with the depth that they will keep.
    under: Vec<Window>,
}

/// Depths on a rectangle of cells, m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Window {
    /// First column and row.
    first: [i32; 2],
    /// Columns and rows.
    size: [usize; 2],
    /// Row by row.
    depths: Vec<f64>,
}

/// Rectangle of cells: columns along x and rows along z.
type Rectangle = [RangeInclusive<i32>; 2];

/// The map as lists: column, row, depth.
#[derive(Serialize, Deserialize)]
struct Listed {
    depths: Vec<(i32, i32, f64)>,
    under: Vec<Vec<(i32, i32, f64)>>,
}

impl From<RutMap> for Listed {
    fn from(ruts: RutMap) -> Self {
        Self {
            depths: ruts.cells(),
            under: ruts.under.iter().map(Window::cells).collect(),
        }
    }
}

impl From<Listed> for RutMap {
    fn from(listed: Listed) -> Self {
        let mut ruts = Self::new(0);
        for (i, k, depth) in listed.depths {
            ruts.deepen([i, k], depth);
        }
        ruts.under = listed.under.iter().map(|cells| Window::of(cells)).collect();
        ruts
    }
}

impl Window {
    /// The smallest that has all cells of a list: column, row, depth.
    fn of(cells: &[(i32, i32, f64)]) -> Self {
        let span = |of: fn(&(i32, i32, f64)) -> i32| {
            let (least, most) = (cells.iter().map(of).min(), cells.iter().map(of).max());
            least.unwrap_or(0)..=most.unwrap_or(-1)
        };
        let mut window = Self::default();
        window.clear([span(|cell| cell.0), span(|cell| cell.1)]);
        for &(i, k, depth) in cells {
            if let Some(at) = window.index(i, k) {
                window.depths[at] = depth;
            }
        }
        window
    }

    /// Cells that are deeper than the surface.
    fn cells(&self) -> Vec<(i32, i32, f64)> {
        self.visit().filter(|(.., depth)| *depth > 0.0).collect()
    }

    /// Column, row and depth of all cells.
    fn visit(&self) -> impl Iterator<Item = (i32, i32, f64)> {
        let ([i, k], columns) = (self.first, self.size[0].max(1));
        let cells = self.depths.iter().enumerate();
        cells.map(move |(at, depth)| {
            let [column, row] = [at % columns, at / columns].map(|n| i32::try_from(n).unwrap_or(0));
            (i + column, k + row, *depth)
        })
    }

    /// Becomes an empty rectangle.
    fn clear(&mut self, [columns, rows]: Rectangle) {
        let length = |range: &RangeInclusive<i32>| {
            usize::try_from(range.end().saturating_sub(*range.start()).saturating_add(1))
                .unwrap_or(0)
        };
        self.first = [*columns.start(), *rows.start()];
        self.size = [length(&columns), length(&rows)];
        self.depths.clear();
        self.depths.resize(self.size[0] * self.size[1], 0.0);
    }

    /// Without the rows and columns at its edges in which nothing is deeper than the surface.
    fn trimmed(mut self) -> Self {
        let width = self.size[0].max(1);
        let is_deep = |row: &[f64]| row.iter().any(|depth| *depth > 0.0);
        let mut deep = (0..self.size[1]).filter(|k| is_deep(&self.depths[k * width..][..width]));
        let Some(top) = deep.next() else {
            return Self::default();
        };
        let rows = top..deep.next_back().unwrap_or(top) + 1;
        let is_deep = |i: &usize| rows.clone().any(|k| self.depths[k * width + i] > 0.0);
        let mut deep = (0..width).filter(is_deep);
        let left = deep.next().unwrap_or(0);
        let columns = left..deep.next_back().unwrap_or(left) + 1;
        let n = columns.len();
        for (to, k) in rows.clone().enumerate() {
            let from = k * width;
            let row = from + columns.start..from + columns.end;
            self.depths.copy_within(row, to * n);
        }
        self.depths.truncate(n * rows.len());
        let start = |first: i32, by: usize| first.saturating_add(i32::try_from(by).unwrap_or(0));
        self.first = [
            start(self.first[0], columns.start),
            start(self.first[1], rows.start),
        ];
        self.size = [n, rows.len()];
        self
    }

    /// Copies the cells of a tile that it covers; whether any has a depth.
    fn copy_tile(&mut self, tile: &Tile, place: [i32; 2]) -> bool {
        // Of the tile's cells along each axis: the first in the window, where it stands there, and
        // how many follow.
        let [(left, to, n), (top, down, rows)] = std::array::from_fn(|d| {
            let start = place[d].saturating_mul(WIDE);
            let before = usize::try_from(self.first[d].saturating_sub(start)).unwrap_or(0);
            let after = usize::try_from(start.saturating_sub(self.first[d])).unwrap_or(0);
            let n = SIDE.saturating_sub(before);
            (before, after, n.min(self.size[d].saturating_sub(after)))
        });
        let (width, mut sum) = (self.size[0], 0.0);
        for k in 0..rows {
            let from = &tile[(top + k) * SIDE + left..][..n];
            let row = &mut self.depths[(down + k) * width + to..][..n];
            for (own, depth) in row.iter_mut().zip(from) {
                *own = *depth;
                sum += *depth;
            }
        }
        sum > 0.0
    }

    #[inline]
    fn index(&self, i: i32, k: i32) -> Option<usize> {
        let column = usize::try_from(i.wrapping_sub(self.first[0])).ok()?;
        let row = usize::try_from(k.wrapping_sub(self.first[1])).ok()?;
        (column < self.size[0] && row < self.size[1]).then(|| row * self.size[0] + column)
    }

    /// The rectangle that it covers.
    fn covered(&self) -> Rectangle {
        std::array::from_fn(|d| {
            let size = i32::try_from(self.size[d]).unwrap_or(0);
            self.first[d]..=self.first[d] + size - 1
        })
    }

    /// Depths at the four centres around a place, of the nearer row first, m; none where it does
    /// not reach.
    #[inline]
    fn corners(&self, (i, k): (i32, i32)) -> Option<[f64; 4]> {
        let (near, last) = (self.index(i, k)?, self.index(i + 1, k + 1)?);
        let z = &self.depths;
        Some([z[near], z[near + 1], z[last - 1], z[last]])
    }
}

/// Depths of ruts at places, m, and their derivatives along x and z.
#[derive(Clone, Copy, Debug)]
pub struct Rut<T> {
    /// m.
    pub depth: T,
    /// Along x and along z.
    pub slope: [T; 2],
}

/// The ruts near a wheel, with a window read before.
#[derive(Clone, Copy, Debug)]
pub struct RutsNear<'a> {
    /// All ruts.
    pub map: &'a RutMap,
    /// Depths of the ruts near the wheel, m, read in advance.
    pub window: &'a Window,
    /// Size of a cell, m.
    pub cell: f64,
}

impl RutsNear<'_> {
    /// The ruts at places, between the centres of four cells.
    #[inline(always)]
    #[must_use]
    pub fn at<T: Lane>(&self, [x, z]: [T; 2]) -> Rut<T> {
        let (cell, half) = (x.like(self.cell), x.like(0.5));
        let (x, z) = (x / cell - half, z / cell - half);
        let (i, k) = (floor(x), floor(z));
        let mut corners = [x; 4];
        for lane in 0..T::LANES {
            let at = (index(i.get(lane)), index(k.get(lane)));
            let own = self.window.corners(at);
            let own = own.unwrap_or_else(|| self.map.corners(at));
            for (corner, own) in corners.iter_mut().zip(own) {
                corner.set(lane, own);
            }
        }
        let (a, b, [near, near_next, far, far_next]) = (x - i, z - k, corners);
        let (on_near, on_far) = (near_next - near, far_next - far);
        let (near, far) = (near + a * on_near, far + a * on_far);
        let along_x = on_near + b * (on_far - on_near);
        Rut {
            depth: near + b * (far - near),
            slope: [along_x / cell, (far - near) / cell],
        }
    }
}

/// The largest whole number that is not larger.
#[inline(always)]
fn floor<T: Lane>(x: T) -> T {
    let whole = x.nearest_whole();
    T::select(x.lt(whole), whole - x.like(1.0), whole)
}

/// Indices of a cell's tile, and of the cell in it.
fn tile_of([i, k]: [i32; 2]) -> ((i32, i32), usize) {
    let place = |n: i32| usize::try_from(n.rem_euclid(WIDE)).unwrap_or(0);
    (
        (i.div_euclid(WIDE), k.div_euclid(WIDE)),
        place(k) * SIDE + place(i),
    )
}

/// Cells of which a centre is within a rectangle around a place, with a margin.
fn around([x, z]: [f64; 2], [dx, dz]: [f64; 2], cell: f64) -> Rectangle {
    [
        index((x - dx) / cell - 0.5)..=index((x + dx) / cell + 0.5),
        index((z - dz) / cell - 0.5)..=index((z + dz) / cell + 0.5),
    ]
}

impl RutMap {
    /// Without ruts, for a number of wheels.
    #[must_use]
    pub fn new(wheels: usize) -> Self {
        Self {
            tiles: BTreeMap::new(),
            under: vec![Window::default(); wheels],
        }
    }

    /// Whether nothing was driven on.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// Number of wheels.
    #[must_use]
    pub fn n_wheels(&self) -> usize {
        self.under.len()
    }

    /// Cells with a rut: column along x, row along z, and depth, m.
    #[must_use]
    pub fn cells(&self) -> Vec<(i32, i32, f64)> {
        let cells = self.tiles.iter().flat_map(|(&(column, row), tile)| {
            let cells = tile.iter().enumerate();
            cells.map(move |(at, depth)| {
                let [i, k] = [at % SIDE, at / SIDE].map(|n| i32::try_from(n).unwrap_or(0));
                (column * WIDE + i, row * WIDE + k, *depth)
            })
        });
        let mut cells: Vec<_> = cells.filter(|(.., depth)| *depth > 0.0).collect();
        cells.sort_by_key(|&(i, k, _)| (i, k));
        cells
    }

    /// Whether all depths are finite and not negative.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let ruts = self.tiles.values().flat_map(|tile| tile.iter());
        let under = self.under.iter().flat_map(|window| window.depths.iter());
        let mut depths = ruts.chain(under);
        depths.all(|depth| depth.is_finite() && *depth >= 0.0)
    }

    fn at(&self, cell: [i32; 2]) -> f64 {
        let (tile, place) = tile_of(cell);
        self.tiles.get(&tile).map_or(0.0, |tile| tile[place])
    }

    fn deepen(&mut self, cell: [i32; 2], depth: f64) {
        let (tile, place) = tile_of(cell);
        let tile = self.tiles.entry(tile);
        let tile = tile.or_insert_with(|| vec![0.0; SIDE * SIDE].into_boxed_slice());
        tile[place] = tile[place].max(depth);
    }

    /// Depth at a place, m, on a grid with cells of this size, m.
    #[must_use]
    pub fn depth(&self, place: [f64; 2], cell: f64) -> f64 {
        let near = RutsNear {
            map: self,
            window: &Window::default(),
            cell,
        };
        near.at(place).depth
    }

    fn corners(&self, (i, k): (i32, i32)) -> [f64; 4] {
        [[i, k], [i + 1, k], [i, k + 1], [i + 1, k + 1]].map(|cell| self.at(cell))
    }

    /// Reads the depths within `reach` (m, along x and z) of a place into a window; whether there
    /// is a rut.
    pub fn read(&self, place: [f64; 2], reach: [f64; 2], cell: f64, window: &mut Window) -> bool {
        if self.tiles.is_empty() {
            return false;
        }
        window.clear(around(place, reach, cell));
        let ([first, below], [width, height]) = (window.first, window.size);
        let along = |start: i32, n: usize| {
            let end = start.saturating_add(i32::try_from(n).unwrap_or(0));
            start.div_euclid(WIDE)..=end.saturating_sub(1).div_euclid(WIDE)
        };
        let mut is_rutted = false;
        if window.depths.is_empty() {
            return false;
        }
        for row in along(below, height) {
            for column in along(first, width) {
                if let Some(tile) = self.tiles.get(&(column, row)) {
                    is_rutted |= window.copy_tile(tile, [column, row]);
                }
            }
        }
        is_rutted
    }

    /// Notes where a wheel is: `depth_at` gives the depth of its rim under the undisturbed surface
    /// at a place, m; none where the wheel is not over the place. Cells that it has left become
    /// ruts. `reach`: how far from its centre the wheel may be in the sand, m, along x and z.
    pub fn pass(
        &mut self,
        wheel: usize,
        place: [f64; 2],
        (reach, cell): ([f64; 2], f64),
        depth_at: impl Fn([f64; 2]) -> Option<f64>,
    ) {
        let before = std::mem::take(&mut self.under[wheel]);
        let known = before.covered();
        let wanted = around(place, reach, cell);
        let all = std::array::from_fn(|d| {
            let is_new = known[d].is_empty();
            if is_new {
                return wanted[d].clone();
            }
            let (a, b) = (&known[d], &wanted[d]);
            *a.start().min(b.start())..=*a.end().max(b.end())
        });
        let [columns, rows] = all;
        let mut now = Window::default();
        now.clear([columns.clone(), rows.clone()]);
        let (width, mut left) = (now.size[0].max(1), Vec::new());
        for (k, row) in rows.zip(now.depths.chunks_exact_mut(width)) {
            let z = (f64::from(k) + 0.5) * cell;
            for (i, now) in columns.clone().zip(row) {
                let kept = before.index(i, k).map_or(0.0, |at| before.depths[at]);
                match depth_at([(f64::from(i) + 0.5) * cell, z]) {
                    Some(depth) => *now = depth.max(kept),
                    None if kept > 0.0 => left.push(([i, k], kept)),
                    None => {}
                }
            }
        }
        for (place, depth) in left {
            self.deepen(place, depth);
        }
        self.under[wheel] = now.trimmed();
    }
}

#[inline]
#[allow(clippy::cast_possible_truncation)] // saturates far beyond any terrain
fn index(x: f64) -> i32 {
    let whole = x as i32;
    if f64::from(whole) > x {
        whole.saturating_sub(1)
    } else {
        whole
    }
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
            ruts.pass(0, [x, 0.0], ([0.1; 2], 0.01), disc(x));
            x += 0.005;
        }
        assert!((ruts.depth([0.5, 0.0], 0.01) - 0.02).abs() < 1e-3);
        assert!(ruts.depth([x - 0.02, 0.0], 0.01) < 1e-12);
        assert!(ruts.depth([0.5, 0.1], 0.01) < 1e-12);
        let mut window = Window::default();
        assert!(ruts.read([0.5, 0.05], [0.03; 2], 0.01, &mut window));
        for place in [
            [0.5, 0.05],
            [0.48, 0.031],
            [0.519, 0.07],
            [0.5, 0.0],
            [0.7, 0.01],
        ] {
            let near = RutsNear {
                map: &ruts,
                window: &window,
                cell: 0.01,
            };
            let found = near.at(place);
            assert!((found.depth - ruts.depth(place, 0.01)).abs() < 1e-15);
            for (d, slope) in found.slope.into_iter().enumerate() {
                let depth_at = |step: f64| {
                    let mut at = place;
                    at[d] += step;
                    ruts.depth(at, 0.01)
                };
                assert!((slope - (depth_at(1e-6) - depth_at(-1e-6)) / 2e-6).abs() < 1e-6);
            }
        }
        assert!(!ruts.read([0.5, 0.2], [0.03; 2], 0.01, &mut window));
    }

    #[test]
    fn a_map_is_the_same_after_it_was_written_and_read() {
        let mut ruts = RutMap::new(2);
        for x in [-0.33, -0.1, 0.0, 0.2] {
            ruts.pass(1, [x, -x], ([0.05; 2], 0.01), |[a, b]| {
                let t = (a - x).hypot(b + x);
                (t < 0.04).then_some(0.05 - t)
            });
        }
        let text = serde_json::to_string(&ruts).unwrap();
        let read: RutMap = serde_json::from_str(&text).unwrap();
        assert_eq!(read, ruts);
        assert!(ruts.cells().len() > 20);
    }
}
