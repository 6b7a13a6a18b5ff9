//! Height field: a grid of heights with two triangles a cell.
//!
//! Height (j, i), row j and column i, stands at `x = x₀ + i dx`, `z = z₀ + j dz`. Each cell is cut
//! along the diagonal from its corner (j, i) to (j + 1, i + 1). The ground fills everything below
//! the surface. A height that is nan is no data: triangles that need it do not exist, and the
//! ground there is unknown, as it is beyond the map.
//!
//! The piece `6 (j n_x + i) + k` belongs to the corner (j, i): k = 0 is the face with
//! `u ≥ v` (u, v: shares of the cell along x and z), 1 the other face, 2 the edge along x, 3 that
//! along z, 4 the diagonal, 5 the vertex. Faces are computed when they are needed, so the map costs
//! four bytes a height, and a hundredth of that for the bounds of tiles.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

mod ahead;
mod cells;
mod neighbourhood;
mod pieces;
mod planes;
mod smooth_normal;
mod terrain;
mod under_wheel;
mod wheel;

use std::sync::Arc;

use nalgebra::Vector3;

use super::Primitive;
use super::error::TerrainError;
use super::limits::MAX_SIZE;
use super::tiles::{Tile, Tiles};

/// Pieces that belong to one corner.
const PIECES: u32 = 6;

/// Most heights: their pieces are numbered with 32 bits.
pub const MAX_HEIGHTS: usize = (u32::MAX / PIECES) as usize;

/// A map of heights. Immutable.
#[derive(Clone, Debug)]
pub struct HeightField {
    /// Row by row, m.
    heights: Vec<f32>,
    columns: usize,
    rows: usize,
    /// dx, dz, m.
    spacing: [f64; 2],
    /// x₀, z₀, m.
    origin: [f64; 2],
    tiles: Tiles,
    /// Name of the surface's material, if it is not the default.
    material: Option<Arc<str>>,
}

/// Face of a cell: the part on one side of its diagonal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::geometry) enum Half {
    /// u ≥ v.
    Low,
    /// u < v.
    High,
}

impl Half {
    /// Unit normal, from the heights of its corners: of the cell's, the one that is its own, and
    /// the last; None without them. `spacing`: dx, dz, m.
    #[inline]
    fn normal(self, [a, other, d]: [f64; 3], [dx, dz]: [f64; 2]) -> Option<Vector3<f64>> {
        let (x, z) = match self {
            Self::Low => ((other - a) / dx, (d - other) / dz),
            Self::High => ((d - other) / dx, (other - a) / dz),
        };
        let square = 1.0 + x * x + z * z;
        square
            .is_finite()
            .then(|| Vector3::new(-x, 1.0, -z) / square.sqrt())
    }
}

/// A cell or corner: column and row, which may be off the map.
type Place = [isize; 2];

impl HeightField {
    /// Gives the surface the material `name`; see [`is_name`](friction_contact::law::materials::is_name).
    #[must_use]
    pub fn with_material(mut self, name: &str) -> Self {
        self.material = Some(name.into());
        self
    }

    /// From heights (rows x columns, row by row, m), the spacing of columns and rows (dx, dz, m)
    /// and the place of the first height (x₀, z₀, m).
    ///
    /// # Errors
    /// `WrongCount`, `MapSize`, `BadHeight`, `NoData`; `OutOfRange` for a spacing that is not
    /// positive or a map that reaches beyond 1e6 m.
    pub fn new(
        heights: Vec<f32>,
        [rows, columns]: [usize; 2],
        spacing: [f64; 2],
        origin: [f64; 2],
    ) -> Result<Self, TerrainError> {
        let count = heights.len();
        if rows < 2 || columns < 2 || count > MAX_HEIGHTS {
            let limit = MAX_HEIGHTS;
            return Err(TerrainError::MapSize {
                rows,
                columns,
                limit,
            });
        }
        if rows.checked_mul(columns) != Some(count) {
            return Err(TerrainError::WrongCount {
                rows,
                columns,
                count,
            });
        }
        for (axis, n) in [columns, rows].into_iter().enumerate() {
            let (step, begin) = (spacing[axis], origin[axis]);
            if !(MIN_SPACING..=MAX_SIZE).contains(&step) {
                return Err(TerrainError::OutOfRange {
                    field: "spacing",
                    range: "from 1e-4 to 1e6 m",
                    value: step,
                });
            }
            let end = begin + (n - 1) as f64 * step;
            for value in [begin, end] {
                if !(-MAX_SIZE..=MAX_SIZE).contains(&value) {
                    return Err(TerrainError::OutOfRange {
                        field: "origin",
                        range: "such that the map lies within 1e6 m of the world's origin",
                        value,
                    });
                }
            }
        }
        let wrong = |h: &f32| f64::from(h.abs()) > MAX_SIZE;
        if let Some(at) = heights.iter().position(wrong) {
            return Err(TerrainError::BadHeight {
                row: at / columns,
                column: at % columns,
                value: f64::from(heights[at]),
                limit: MAX_SIZE,
            });
        }
        let tiles = Tiles::new(&heights, [columns, rows], spacing);
        let field = Self {
            material: None,
            heights,
            columns,
            rows,
            spacing,
            origin,
            tiles,
        };
        if field.tiles.has_hole() && !field.has_a_face() {
            return Err(TerrainError::NoData);
        }
        Ok(field)
    }

    fn has_a_face(&self) -> bool {
        (0..self.rows - 1).any(|j| {
            (0..self.columns - 1).any(|i| {
                [Half::Low, Half::High]
                    .iter()
                    .any(|&half| self.normal([narrow(i), narrow(j)], half).is_some())
            })
        })
    }

    /// Heights, row by row, m; nan for no data.
    #[must_use]
    pub fn heights(&self) -> &[f32] {
        &self.heights
    }

    /// Rows and columns.
    #[must_use]
    pub fn shape(&self) -> [usize; 2] {
        [self.rows, self.columns]
    }

    /// dx, dz, m.
    #[must_use]
    pub fn spacing(&self) -> [f64; 2] {
        self.spacing
    }

    /// x₀, z₀, m.
    #[must_use]
    pub fn origin(&self) -> [f64; 2] {
        self.origin
    }

    /// Bounds of its tiles.
    #[inline]
    pub(in crate::geometry) fn tiles(&self) -> &Tiles {
        &self.tiles
    }

    /// Heights of a cell's corners (m): of (column, row), the next column, the next row, and both.
    #[inline]
    pub(in crate::geometry) fn cell_heights(&self, [i, j]: [usize; 2]) -> [f32; 4] {
        let at = j * self.columns + i;
        let (near, far) = (
            &self.heights[at..at + 2],
            &self.heights[at + self.columns..][..2],
        );
        [near[0], near[1], far[0], far[1]]
    }

    /// Unit normal of a face of a cell; None where there is none.
    #[inline]
    pub(in crate::geometry) fn face_normal(
        &self,
        cell: [usize; 2],
        half: Half,
    ) -> Option<Vector3<f64>> {
        self.normal(cell.map(narrow), half)
    }

    /// Memory, bytes.
    #[must_use]
    pub fn size(&self) -> usize {
        size_of_val(&self.heights[..]) + self.tiles.size()
    }

    /// Visits the corners (column, row) of the cells that a ball of radius `reach` (m) about
    /// `centre` (world, m) may touch, from above or from within the ground.
    #[inline]
    pub fn visit_cells(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        mut visit: impl FnMut(usize, usize),
    ) {
        let Some([columns, rows]) = self.cells_within(centre, [reach; 2]) else {
            return;
        };
        let along = |axis: usize, x: f64| (x - self.origin[axis]) / self.spacing[axis];
        let local = [along(0, centre.x), along(1, centre.z)];
        // Lowest height of the ball over a rectangle of cells.
        let bottom = |[i, j]: [usize; 2], [w, h]: [usize; 2]| {
            let beyond = |axis: usize, first: usize, n: usize| {
                let low = first as f64 - local[axis];
                let high = local[axis] - (first + n) as f64;
                low.max(high).max(0.0) * self.spacing[axis]
            };
            let (x, z) = (beyond(0, i, w), beyond(1, j, h));
            let rest = reach * reach - x * x - z * z;
            if rest < 0.0 {
                f64::INFINITY
            } else {
                centre.y - rest.sqrt()
            }
        };
        self.tiles.visit(
            columns,
            rows,
            |tile: &Tile| f64::from(tile.highest) >= bottom(tile.first, tile.size),
            |[i, j]| {
                let at = j * self.columns + i;
                let (near, far) = (
                    &self.heights[at..at + 2],
                    &self.heights[at + self.columns..][..2],
                );
                let highest = near[0].max(near[1]).max(far[0]).max(far[1]);
                if f64::from(highest) >= bottom([i, j], [1, 1]) {
                    visit(i, j);
                }
            },
        );
    }

    /// First and last columns and rows of the cells within `radius` of `centre`; of a place off the
    /// map those at its border.
    fn span(&self, centre: &Vector3<f64>, radius: f64) -> [[usize; 2]; 2] {
        let along = |axis: usize, x: f64, n: usize| {
            let local = (x - self.origin[axis]) / self.spacing[axis];
            let half = radius / self.spacing[axis];
            let last = (n - 2) as f64;
            let within = |x: f64| index(x.floor().clamp(0.0, last));
            [within(local - half), within(local + half)]
        };
        [
            along(0, centre.x, self.columns),
            along(1, centre.z, self.rows),
        ]
    }

    /// Height of a corner, m; nan where there is none.
    #[inline]
    fn corner(&self, place: Place) -> f64 {
        f64::from(self.height_at(place))
    }

    #[inline]
    fn height_at(&self, [i, j]: Place) -> f32 {
        let at = |k: isize, n: usize| usize::try_from(k).ok().filter(|&k| k < n);
        match (at(i, self.columns), at(j, self.rows)) {
            (Some(i), Some(j)) => self.heights[j * self.columns + i],
            _ => f32::NAN,
        }
    }

    /// A corner, world, m.
    #[inline]
    fn point(&self, place: Place) -> Vector3<f64> {
        let [i, j] = place;
        Vector3::new(
            self.origin[0] + i as f64 * self.spacing[0],
            self.corner(place),
            self.origin[1] + j as f64 * self.spacing[1],
        )
    }

    /// Unit normal of a face; None where there is none.
    #[inline]
    fn normal(&self, [i, j]: Place, half: Half) -> Option<Vector3<f64>> {
        let (a, d) = (self.corner([i, j]), self.corner([i + 1, j + 1]));
        let other = match half {
            Half::Low => self.corner([i + 1, j]),
            Half::High => self.corner([i, j + 1]),
        };
        half.normal([a, other, d], self.spacing)
    }

    /// Visits the pieces that belong to a corner.
    fn visit_pieces(&self, [i, j]: [usize; 2], visit: &mut dyn FnMut(u32, &Primitive)) {
        let first = number(j * self.columns + i);
        let patch = self.patch([i, j]);
        for k in 0..PIECES {
            if let Some(piece) = patch.piece(k) {
                visit(first + k, &piece);
            }
        }
    }

    /// Visits the borders of a cell's faces.
    fn visit_rims_of(&self, [i, j]: [usize; 2], visit: &mut dyn FnMut(&super::BorderEdge)) {
        let first = number(j * self.columns + i);
        self.patch([i, j]).visit_borders(first, visit);
    }

    /// The cell under a place, and u and v within it; None off the map.
    #[inline]
    fn cell_at(&self, x: f64, z: f64) -> Option<([usize; 2], [f64; 2])> {
        let cell = |axis: usize, x: f64, n: usize| {
            let local = (x - self.origin[axis]) / self.spacing[axis];
            let last = (n - 1) as f64;
            (local >= 0.0 && local <= last).then(|| {
                let whole = local.floor().min(last - 1.0);
                (index(whole), local - whole)
            })
        };
        let ((i, u), (j, v)) = (cell(0, x, self.columns)?, cell(1, z, self.rows)?);
        Some(([i, j], [u, v]))
    }
}

/// Smallest spacing, m.
const MIN_SPACING: f64 = 1e-4;

#[allow(clippy::cast_possible_wrap)] // at most the number of heights
fn narrow(index: usize) -> isize {
    index as isize
}

#[inline]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole and within the map
fn index(x: f64) -> usize {
    x as usize
}

/// Number of the first piece of a corner.
#[inline]
fn number(corner: usize) -> u32 {
    let corner = u32::try_from(corner).unwrap_or_else(|_| unreachable!("invariant: few corners"));
    PIECES * corner
}
