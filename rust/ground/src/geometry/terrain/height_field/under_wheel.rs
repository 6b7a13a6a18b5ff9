//! Which pieces of a height field a wheel may touch, several cells at once.
//!
//! A point of the wheel that is in the ground by no more than a depth has no face further beside
//! the wheel than this depth in its way. It is no deeper if the ground is outside a smaller wheel:
//! then the surface lies between the point and the place to which it comes when the wheel shrinks.
//! So a strip of cells along the wheel suffices, unless one that the wheel crosses reaches into the
//! smaller wheel.
//!
//! The cells of a register are compared with the wheel at once ([`super::wheel`]), in the same way
//! however many those are.

use nalgebra::Vector3;

use super::cells::{CELLS, Cells};
use super::neighbourhood::{AWAY, ROUNDING};
use super::wheel::{KINDS, STEEP, SweptWheel};
use super::{HeightField, index, narrow};
use crate::geometry::shape::{Disc, Roller, SupportMap};
use crate::geometry::terrain::{Neighbourhood, Primitive};
#[cfg(target_arch = "x86_64")]
use friction_contact::scalar::{Eights, Fours, inlined};
use friction_contact::scalar::{Instructions, Lane, LaneMask, Single};

/// How deep a wheel may be in the ground, in bounding radii, so that faces as far beside it are all
/// that matter.
const SHALLOW: f64 = 0.1;

/// Most cells of a strip with something to touch.
const MOST_CELLS: usize = 48;

/// Which cells matter.
struct Region {
    columns: [usize; 2],
    rows: [usize; 2],
    /// Lowest height, and distance from the wheel's centre, m.
    floor: f64,
    radius: f64,
}

/// Cosine of the angle between the axle and the level up to which cells are compared with the
/// cylinder around the wheel.
const LEVEL: f64 = 0.5;

/// The infinite cylinder about the axle with all that the wheel may touch.
struct Tube {
    /// Square of its radius, m².
    square: f64,
    /// Level direction across the axle, along x and z.
    across: [f64; 2],
    /// Height over the axle that its tilt gives a place, a metre along x and along z.
    rise: [f64; 2],
    /// Half of what a cell spans across the axle, and of these heights in it, m.
    halves: [f64; 2],
    /// Cosine of the axle's tilt.
    cosine: f64,
}

impl Tube {
    /// None if the axle is not level enough.
    fn about(wheel: &SweptWheel<'_>, [dx, dz]: [f64; 2]) -> Option<Self> {
        let s = &wheel.disc.axle;
        let cosine = (s.x * s.x + s.z * s.z).sqrt();
        if cosine < LEVEL {
            return None;
        }
        let radius = wheel.disc.radius + wheel.reach() + ROUNDING;
        let across = [s.z / cosine, -s.x / cosine];
        let rise = [s.y * s.x / cosine, s.y * s.z / cosine];
        let half = |[x, z]: [f64; 2]| 0.5 * (x.abs() * dx + z.abs() * dz);
        Some(Self {
            square: radius * radius,
            across,
            rise,
            halves: [half(across), half(rise)],
            cosine,
        })
    }

    /// Cells that it may meet, from the places of their middles and the depths of their highest
    /// points below the wheel's centre, m.
    #[inline(always)]
    fn meets<T: Lane>(&self, [x, z]: [T; 2], drop: T) -> T::Mask {
        let zero = x.like(0.0);
        let ([a, b], [c, d], [span, tilt]) = (self.across, self.rise, self.halves);
        let aside = (x * x.like(a) + z * x.like(b)).abs() - x.like(span);
        let down = drop * x.like(self.cosine) + x * x.like(c) + z * x.like(d) - x.like(tilt);
        let (aside, down) = (aside.max(zero), down.max(zero));
        (aside * aside + down * down).le(x.like(self.square))
    }
}

/// Cells with pieces that may be touched, each kind a bit.
struct Found {
    n: usize,
    cells: [([usize; 2], u32); MOST_CELLS],
}

impl HeightField {
    /// Visits what a disc may touch.
    pub(super) fn visit_under_disc(
        &self,
        part: &Neighbourhood<'_>,
        disc: &Disc,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        let wheel = SweptWheel {
            part,
            disc,
            half: 0.0,
            rounding: 0.0,
        };
        self.visit_under(&wheel, visit);
    }

    /// Visits what a wheel with a width may touch.
    pub(super) fn visit_under_roller(
        &self,
        part: &Neighbourhood<'_>,
        roller: &Roller,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        let wheel = SweptWheel {
            part,
            disc: &roller.core,
            half: roller.half,
            rounding: roller.rounding,
        };
        self.visit_under(&wheel, visit);
    }

    fn visit_under(&self, wheel: &SweptWheel<'_>, visit: &mut dyn FnMut(u32, &Primitive)) {
        let part = wheel.part;
        let radius = part.shape.bound() + part.reach;
        let around = |axis: &Vector3<f64>| part.extent(axis) + part.reach + SHALLOW * radius;
        let ends = [around(&Vector3::x()), around(&Vector3::z())];
        let Some([columns, rows]) = self.cells_within(&part.centre, ends) else {
            return;
        };
        let region = Region {
            columns,
            rows,
            floor: part.centre.y - around(&Vector3::y()),
            radius,
        };
        if self.tiles.highest_of(columns, rows) < region.floor {
            return;
        }
        let mut found = Found {
            n: 0,
            cells: [([0; 2], 0); MOST_CELLS],
        };
        if self.search_strip(wheel, &region, &mut found) {
            for (cell, kinds) in &found.cells[..found.n] {
                self.visit_kinds(*cell, *kinds, visit);
            }
            return;
        }
        self.visit_not_clear(wheel, &region, visit);
    }

    /// Searches the strip along the wheel. Whether it suffices.
    fn search_strip(&self, wheel: &SweptWheel<'_>, region: &Region, found: &mut Found) -> bool {
        let (c, axle, radius) = (&wheel.part.centre, &wheel.disc.axle, region.radius);
        let [dx, dz] = self.spacing;
        // Half the width of what the wheel crosses, by the cells' middles along the axle, for all
        // heights that it spans; and of the strip.
        let of_cell = 0.5 * (axle.x.abs() * dx + axle.z.abs() * dz);
        let tread = wheel.half + wheel.reach();
        let crossed = tread + axle.y.abs() * radius + of_cell + ROUNDING;
        let depth = SHALLOW * radius;
        let wide = crossed + depth;
        let smaller = (radius - depth) * (radius - depth);
        let middle = (c.x - self.origin[0]) / dx - 0.5;
        let per_column = axle.x * dx;
        let tube = Tube::about(wheel, self.spacing);
        let (mut cells, mut has_room, mut may_be_deep) = (Cells::new(), true, false);
        for j in region.rows[0]..=region.rows[1] {
            let z = self.origin[1] + (j as f64 + 0.5) * dz - c.z;
            let range = across(region.columns, middle, [per_column, axle.z * z], wide);
            let Some(range) = range else {
                continue;
            };
            self.visit_row((j, range), region, (c, tube.as_ref()), |i, square| {
                let beside = per_column * (i as f64 - middle) + axle.z * z;
                may_be_deep |= square <= smaller
                    && beside.abs() <= crossed
                    && !self.is_under([i, j], wheel, depth);
                cells.add(self, [i, j], c);
                if cells.n == CELLS {
                    has_room &= self.take(wheel, &mut cells, |cell| found.add(cell));
                }
            });
        }
        has_room &= self.take(wheel, &mut cells, |cell| found.add(cell));
        has_room && !(may_be_deep && self.may_look_away(wheel, region))
    }

    /// Whether a face may look away from the wheel that lies beside it.
    #[cold]
    fn may_look_away(&self, wheel: &SweptWheel<'_>, region: &Region) -> bool {
        let beyond = |[a, b]: [usize; 2], n: usize| [a.saturating_sub(1), (b + 1).min(n - 2)];
        let columns = beyond(region.columns, self.columns);
        let slope = (self.tiles).steepest(columns, beyond(region.rows, self.rows));
        (slope / (1.0 + slope)).sqrt() + wheel.disc.axle.y.abs() > AWAY
    }

    /// In the whole region.
    #[cold]
    fn visit_not_clear(
        &self,
        wheel: &SweptWheel<'_>,
        region: &Region,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        let c = &wheel.part.centre;
        let mut cells = Cells::new();
        let mut visit = |(cell, kinds): ([usize; 2], u32)| {
            self.visit_kinds(cell, kinds, visit);
            true
        };
        for j in region.rows[0]..=region.rows[1] {
            self.visit_row((j, region.columns), region, (c, None), |i, _| {
                cells.add(self, [i, j], c);
                if cells.n == CELLS {
                    self.take(wheel, &mut cells, &mut visit);
                }
            });
        }
        self.take(wheel, &mut cells, &mut visit);
    }

    /// Visits the columns of a row's cells in a region and a tube, and the square of the distance
    /// of a place from all that is over the cell and at most as high as its highest point, m².
    #[inline(always)]
    fn visit_row(
        &self,
        (j, [begin, end]): (usize, [usize; 2]),
        region: &Region,
        (place, tube): (&Vector3<f64>, Option<&Tube>),
        mut visit: impl FnMut(usize, f64),
    ) {
        let [dx, dz] = self.spacing;
        let low = self.origin[1] + j as f64 * dz - place.z;
        let z = low.max(-low - dz).max(0.0);
        if z > region.radius {
            return;
        }
        for i in (begin..=end).step_by(CELLS) {
            let n = (end + 1 - i).min(CELLS);
            let row = |j: usize| &self.heights[j * self.columns + i..][..=n];
            let (near, far) = (row(j), row(j + 1));
            // A cell without heights has no highest.
            let mut part = RowPart {
                highest: [f64::NAN; CELLS],
                lows: [0.0; CELLS],
                squares: [z * z; CELLS],
                middle: low + 0.5 * dz,
                width: dx,
                place_height: place.y,
            };
            for k in 0..n {
                let two = [near, far].map(|row| row[k].max(row[k + 1]));
                part.highest[k] = f64::from(two[0].max(two[1]));
                part.lows[k] = self.origin[0] + (i + k) as f64 * dx - place.x;
            }
            let mut bits = part.find(region, tube);
            while bits != 0 {
                let k = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                visit(i + k, part.squares[k]);
            }
        }
    }

    /// Whether the wheel, smaller by a depth (m), is over the planes of both faces of a cell.
    fn is_under(&self, cell: [usize; 2], wheel: &SweptWheel<'_>, depth: f64) -> bool {
        let from = wheel.part.centre - self.point(cell.map(narrow));
        let radius = wheel.disc.radius + wheel.reach() - depth;
        let half = wheel.half + wheel.reach();
        let [a, b, c, d] = self.cell_heights(cell).map(f64::from);
        [[b - a, d - b], [d - c, c - a]].iter().all(|[x, z]| {
            let m = Vector3::new(-x / self.spacing[0], 1.0, -z / self.spacing[1]);
            let along = m.dot(&wheel.disc.axle);
            let across = (m.norm_squared() - along * along).max(0.0).sqrt();
            m.dot(&from) > radius * across + half * along.abs()
        })
    }

    /// Empties `cells` and takes those with pieces that the wheel may touch, in order. Whether it
    /// took all of them.
    fn take(
        &self,
        wheel: &SweptWheel<'_>,
        cells: &mut Cells,
        mut take: impl FnMut(([usize; 2], u32)) -> bool,
    ) -> bool {
        let near = self.compare(wheel, cells);
        let n = std::mem::take(&mut cells.n);
        let mut any = near.iter().fold(0, |any, near| any | near) & ((1 << n) - 1);
        let mut all = true;
        while any != 0 {
            let k = any.trailing_zeros() as usize;
            any &= any - 1;
            let mut kinds = 0;
            for (kind, near) in near[..STEEP].iter().enumerate() {
                kinds |= (near >> k & 1) << kind;
            }
            if near[STEEP] >> k & 1 == 1 {
                kinds = self.near_part(cells.places[k], wheel.part);
            }
            if kinds != 0 {
                all &= take((cells.places[k], kinds));
            }
        }
        all
    }

    /// Which pieces of cells a wheel may touch: for each kind a bit for each cell.
    fn compare(&self, wheel: &SweptWheel<'_>, cells: &Cells) -> [u32; KINDS] {
        match Instructions::of_this_machine() {
            Instructions::Baseline => self.compare_with::<f64>(Single::Baseline, wheel, cells),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(token) => self.compare_with::<Fours>(token, wheel, cells),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(token) => self.compare_with::<Eights>(token, wheel, cells),
        }
    }

    fn compare_with<T: Lane>(
        &self,
        token: T::Token,
        wheel: &SweptWheel<'_>,
        cells: &Cells,
    ) -> [u32; KINDS] {
        inlined!(T::vectorize, token, {
            let mut near = [0; KINDS];
            let mut at = 0;
            while at < cells.n {
                let own = wheel.compare::<T>(token, self.spacing, (cells, at));
                for kind in 0..KINDS {
                    near[kind] |= own[kind].bits() << at;
                }
                at += T::LANES;
            }
            near
        })
    }
}

/// Cells of a row beside each other.
struct RowPart {
    /// Highest point of each, m; no number where there is none.
    highest: [f64; CELLS],
    /// Where each begins along x, from a place, m.
    lows: [f64; CELLS],
    /// Square of the distance of the place from all that is over each cell and no higher than its
    /// highest point, m²; along z alone, before they are found.
    squares: [f64; CELLS],
    /// Place of their middles along z, and their width, m.
    middle: f64,
    width: f64,
    /// Height of the place, m.
    place_height: f64,
}

impl RowPart {
    /// Cells in a region about the place, and in a tube; finds their squares.
    fn find(&mut self, region: &Region, tube: Option<&Tube>) -> u32 {
        match Instructions::of_this_machine() {
            Instructions::Baseline => self.find_with::<f64>(Single::Baseline, region, tube),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(token) => self.find_with::<Fours>(token, region, tube),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(token) => self.find_with::<Eights>(token, region, tube),
        }
    }

    fn find_with<T: Lane>(&mut self, token: T::Token, region: &Region, tube: Option<&Tube>) -> u32 {
        inlined!(T::vectorize, token, {
            let (zero, half) = (T::splat(token, 0.0), T::splat(token, 0.5));
            let (width, middle) = (T::splat(token, self.width), T::splat(token, self.middle));
            let height = T::splat(token, self.place_height);
            let floor = T::splat(token, region.floor);
            let most = T::splat(token, region.radius * region.radius);
            let mut bits = 0;
            for at in (0..CELLS).step_by(T::LANES) {
                let own = at..at + T::LANES;
                let highest = T::load(token, &self.highest[own.clone()]);
                let low = T::load(token, &self.lows[own.clone()]);
                let x = low.max(-low - width).max(zero);
                let drop = (height - highest).max(zero);
                let square = T::load(token, &self.squares[own.clone()]) + x * x + drop * drop;
                let mut near = floor.le(highest) & square.le(most);
                if let Some(tube) = tube {
                    near = near & tube.meets([low + width * half, middle], drop);
                }
                square.store(&mut self.squares[own]);
                bits |= near.bits() << at;
            }
            bits
        })
    }
}

impl Found {
    /// Adds a cell. False if there is no room.
    #[inline]
    fn add(&mut self, cell: ([usize; 2], u32)) -> bool {
        let place = self.cells.get_mut(self.n);
        let has_room = place.is_some();
        if let Some(place) = place {
            *place = cell;
            self.n += 1;
        }
        has_room
    }
}

/// First and last of the columns in which `|per_column (i − middle) + rest|` is at most `wide`;
/// None if there are none.
#[inline]
fn across(
    columns: [usize; 2],
    middle: f64,
    [per_column, rest]: [f64; 2],
    wide: f64,
) -> Option<[usize; 2]> {
    if per_column.abs() * 1e6 <= wide {
        let first = columns[0] as f64 - middle;
        return ((per_column * first + rest).abs() <= 2.0 * wide).then_some(columns);
    }
    let [first, last] = columns.map(|k| k as f64);
    let (place, beside) = (middle - rest / per_column, (wide / per_column).abs());
    let (low, high) = ((place - beside).ceil(), (place + beside).floor());
    (low <= last && high >= first).then(|| [index(low.max(first)), index(high.min(last))])
}
