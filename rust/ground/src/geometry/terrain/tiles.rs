//! Bounds of the tiles of a height field, level by level: height and slope.
//!
//! A tile of the first level has 16 x 16 cells, one of each further level 4 x 4 tiles of that
//! before, up to a single one. A search descends from the top, so it costs the tiles that it finds
//! and the logarithm of the map's size.

/// Cells along the side of a tile of the first level.
const FIRST: usize = 16;

/// Tiles of one level along the side of a tile of the next.
const FACTOR: usize = 4;

/// Highest point of a tile, the square of its faces' steepest slope, and whether a height is
/// missing.
#[derive(Clone, Copy, Debug)]
struct Bound {
    highest: f32,
    steepest: f32,
    has_hole: bool,
}

#[derive(Clone, Debug)]
struct Level {
    /// Cells along the side of a tile.
    side: usize,
    columns: usize,
    rows: usize,
    bounds: Vec<Bound>,
}

/// A tile or a part of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tile {
    /// Column and row of its first cell.
    pub first: [usize; 2],
    /// Columns and rows of cells.
    pub size: [usize; 2],
    /// m; −∞ without data.
    pub highest: f32,
    pub has_hole: bool,
}

/// Bounds of all tiles.
#[derive(Clone, Debug)]
pub(in crate::geometry) struct Tiles {
    levels: Vec<Level>,
}

impl Tiles {
    /// Bounds of the tiles of a map of `columns` x `rows` heights (m) at a spacing (dx, dz, m).
    pub(super) fn new(heights: &[f32], [columns, rows]: [usize; 2], spacing: [f64; 2]) -> Self {
        let cells = [columns - 1, rows - 1];
        let [wide, high] = cells.map(|n| n.div_ceil(FIRST));
        let mut bounds = Vec::with_capacity(wide * high);
        for row in 0..high {
            for column in 0..wide {
                let mut bound = Bound::NOTHING;
                let (begin, end) = (column * FIRST, (column * FIRST + FIRST + 1).min(columns));
                let (top, bottom) = (row * FIRST, (row * FIRST + FIRST + 1).min(rows));
                let of = |j: usize| &heights[j * columns + begin..j * columns + end];
                for j in top..bottom {
                    for &h in of(j) {
                        bound.highest = bound.highest.max(h);
                        bound.has_hole |= h.is_nan();
                    }
                }
                for j in top..bottom - 1 {
                    bound.climb(of(j), of(j + 1), spacing);
                }
                bounds.push(bound);
            }
        }
        let mut levels = vec![Level {
            side: FIRST,
            columns: wide,
            rows: high,
            bounds,
        }];
        while let Some(last) = levels.last().filter(|level| level.bounds.len() > 1) {
            let next = last.coarser();
            levels.push(next);
        }
        Self { levels }
    }

    /// Whether any height is missing.
    pub(super) fn has_hole(&self) -> bool {
        let top = self.levels.last();
        top.is_some_and(|level| level.bounds.iter().any(|bound| bound.has_hole))
    }

    /// Highest point, m; −∞ without data.
    pub(in crate::geometry) fn highest(&self) -> f32 {
        let top = self.levels.last().map(|level| level.bounds[0].highest);
        top.unwrap_or(f32::NEG_INFINITY)
    }

    /// Cells along the side of a tile of the first level.
    pub(in crate::geometry) fn finest(&self) -> usize {
        self.levels.first().map_or(FIRST, |level| level.side)
    }

    /// First cell and size of the widest tile about a cell that is wanted; `wants` gets these and
    /// the tile's highest point, m. `cells`: columns and rows of cells of the map.
    #[inline]
    pub(in crate::geometry) fn widest(
        &self,
        cell: [usize; 2],
        cells: [usize; 2],
        wants: impl Fn([usize; 2], [usize; 2], f32) -> bool,
    ) -> Option<([usize; 2], [usize; 2])> {
        self.levels.iter().rev().find_map(|level| {
            let [column, row] = cell.map(|k| k / level.side);
            let first = [column * level.side, row * level.side];
            let size = [0, 1].map(|k| level.side.min(cells[k] - first[k]));
            let highest = level.bounds[row * level.columns + column].highest;
            wants(first, size, highest).then_some((first, size))
        })
    }

    /// Bound on the square of the slope (dy/dx, dy/dz) of all faces in ranges of columns and rows
    /// of cells (first and last).
    #[inline]
    pub(super) fn steepest(&self, columns: [usize; 2], rows: [usize; 2]) -> f64 {
        self.most(columns, rows, |bound| bound.steepest)
    }

    /// Height that no face in ranges of columns and rows of cells (first and last) exceeds, m.
    #[inline]
    pub(super) fn highest_of(&self, columns: [usize; 2], rows: [usize; 2]) -> f64 {
        self.most(columns, rows, |bound| bound.highest)
    }

    /// Largest number of a few tiles that have all cells in ranges of columns and rows.
    #[inline]
    fn most(&self, columns: [usize; 2], rows: [usize; 2], number: impl Fn(&Bound) -> f32) -> f64 {
        let few = |level: &&Level| {
            let [w, h] = [columns, rows].map(|[a, b]| b / level.side - a / level.side + 1);
            w * h <= FACTOR
        };
        let Some(level) = self.levels.iter().find(few).or(self.levels.last()) else {
            return f64::INFINITY;
        };
        let mut most = f32::NEG_INFINITY;
        for row in rows[0] / level.side..=rows[1] / level.side {
            let first = row * level.columns;
            let tiles = first + columns[0] / level.side..=first + columns[1] / level.side;
            most = level.bounds[tiles]
                .iter()
                .fold(most, |most, own| most.max(number(own)));
        }
        f64::from(most)
    }

    /// Bytes.
    pub(super) fn size(&self) -> usize {
        self.levels
            .iter()
            .map(|level| size_of_val(&level.bounds[..]))
            .sum()
    }

    /// Visits the cells in ranges of columns and rows (first and last) whose tiles are all wanted.
    #[inline]
    pub(super) fn visit(
        &self,
        columns: [usize; 2],
        rows: [usize; 2],
        wants: impl Fn(&Tile) -> bool,
        mut visit: impl FnMut([usize; 2]),
    ) {
        // Few tiles need no descent.
        let spans = |side: usize| {
            let [w, h] = [columns, rows].map(|[a, b]| b / side - a / side + 1);
            w * h
        };
        let few = |level: &Level| spans(level.side) <= FACTOR * FACTOR;
        let depth = self
            .levels
            .iter()
            .position(few)
            .unwrap_or(self.levels.len() - 1);
        self.descend(depth, columns, rows, &wants, &mut visit);
    }

    fn descend(
        &self,
        depth: usize,
        columns: [usize; 2],
        rows: [usize; 2],
        wants: &impl Fn(&Tile) -> bool,
        visit: &mut impl FnMut([usize; 2]),
    ) {
        let level = &self.levels[depth];
        let side = level.side;
        for row in rows[0] / side..=rows[1] / side {
            for column in columns[0] / side..=columns[1] / side {
                let within =
                    |k: usize, [a, b]: [usize; 2]| [a.max(k * side), b.min(k * side + side - 1)];
                let (own_columns, own_rows) = (within(column, columns), within(row, rows));
                let bound = &level.bounds[row * level.columns + column];
                let tile = Tile {
                    first: [own_columns[0], own_rows[0]],
                    size: [own_columns, own_rows].map(|[a, b]| b - a + 1),
                    highest: bound.highest,
                    has_hole: bound.has_hole,
                };
                if !wants(&tile) {
                    continue;
                }
                if depth > 0 {
                    self.descend(depth - 1, own_columns, own_rows, wants, visit);
                    continue;
                }
                for j in own_rows[0]..=own_rows[1] {
                    for i in own_columns[0]..=own_columns[1] {
                        visit([i, j]);
                    }
                }
            }
        }
    }
}

impl Level {
    fn coarser(&self) -> Self {
        let [columns, rows] = [self.columns, self.rows].map(|n| n.div_ceil(FACTOR));
        let mut bounds = vec![Bound::NOTHING; columns * rows];
        for (at, bound) in self.bounds.iter().enumerate() {
            let (row, column) = (at / self.columns / FACTOR, at % self.columns / FACTOR);
            let own = &mut bounds[row * columns + column];
            own.highest = own.highest.max(bound.highest);
            own.steepest = own.steepest.max(bound.steepest);
            own.has_hole |= bound.has_hole;
        }
        Self {
            side: self.side * FACTOR,
            columns,
            rows,
            bounds,
        }
    }
}

impl Bound {
    const NOTHING: Self = Self {
        highest: f32::NEG_INFINITY,
        steepest: 0.0,
        has_hole: false,
    };

    /// Takes in the slopes of the faces between two rows of heights.
    fn climb(&mut self, near: &[f32], far: &[f32], spacing: [f64; 2]) {
        #[allow(clippy::cast_possible_truncation)] // slopes are bounded as heights are kept: single
        let [along, across] = spacing.map(|d| (1.0 / d) as f32);
        for (near, far) in near.windows(2).zip(far.windows(2)) {
            let slope = |rise: f32, run: f32| (rise * run) * (rise * run);
            let low = slope(near[1] - near[0], along) + slope(far[1] - near[1], across);
            let high = slope(far[1] - far[0], along) + slope(far[0] - near[0], across);
            // Of a face without data it is not a number, which no maximum is.
            self.steepest = self.steepest.max(low * ROUND_UP).max(high * ROUND_UP);
        }
    }
}

/// More than the rounding of a slope.
const ROUND_UP: f32 = 1.0 + 1e-5;
