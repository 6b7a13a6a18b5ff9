//! Which pieces of a height field a part may touch.
//!
//! Heights decide about most. Of the cells under a part those count that reach up to it, and with a
//! wheel those in a strip along its rim. Of a cell's faces those count whose plane is within reach
//! of the part's lowest point over it, with a wheel only if the lowest point of one of its circles
//! is about over the face; of its edges those that are convex, by four heights, and between two
//! such planes. What is left is built.

use nalgebra::Vector3;

use super::{Half, HeightField, index, narrow, number};
use crate::geometry::shape::{Disc, PlacedShape, Roller, SupportMap};
use crate::geometry::terrain::{Neighbourhood, Primitive};

/// Cosine of the angle to the way from a part to a face from which on the face looks away, as in
/// [`OrientedBox::is_clear_of`](crate::geometry::OrientedBox::is_clear_of).
const AWAY: f64 = 0.5;

/// How deep a wheel may be in the ground, in bounding radii, so that faces as far beside it are all
/// that matter.
const SHALLOW: f64 = 0.1;

/// Most cells of a strip.
const MOST_CELLS: usize = 48;

/// Slope up to which a lowest point is off its face, seen from above, by so many gaps at most. The
/// normals lean by 45 degrees then, and walls by as much from their face's: sin 45° + tan 45°.
const GENTLE: f64 = 1.0;
pub(super) const OFF: f64 = 1.75;

/// How deep a disc must be to touch a piece beside it, in the distance between them: walls that
/// lean move the point by less than [`OFF`] depths, and an edge has points beyond its ends that are
/// less than one depth away.
const SHARE: f64 = 0.5;

/// Sine of the angle up to which an axle is level enough: a vertex that pierces the face of the
/// disc has a slope beside it of more than 1.5.
const STANDS: f64 = 0.4;

/// Square of the length of a normal with a vertical component of 1 up to which an edge cannot be
/// sharp: slopes of up to 0.8.
const UNSHARP: f64 = 1.64;

/// Covers the rounding of places, m.
pub(super) const ROUNDING: f64 = 1e-6;

impl HeightField {
    /// The pieces that a part may touch: [`Terrain::visit_around`](super::super::Terrain).
    pub(super) fn visit_pieces_around(
        &self,
        part: &Neighbourhood<'_>,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        match part.shape {
            PlacedShape::Disc(disc) => self.visit_under_wheel(part, (&disc.axle, 0.0), visit),
            PlacedShape::Roller(roller) => {
                let half = roller.half + roller.rounding;
                self.visit_under_wheel(part, (&roller.core.axle, half), visit);
            }
            PlacedShape::Box(_) | PlacedShape::Sphere(_) => {
                let solid = part.solid();
                let floor = solid.support(&-Vector3::y()).y;
                self.visit_cells_above(&part.centre, part.radius(), floor, |i, j| {
                    if !solid.is_clear_of(&self.corners(i, j), || self.upright_normals(i, j)) {
                        self.visit_reachable([i, j], part, None, visit);
                    }
                });
            }
        }
    }

    /// Under a wheel, whose axle has this half length (m) within it.
    ///
    /// A point of the wheel that is in the ground by no more than a depth has no face further
    /// beside the wheel than this depth in its way. It is no deeper if the ground is outside a
    /// smaller wheel: then the surface lies between the point and the place to which it comes when
    /// the wheel shrinks. So a strip of cells along the wheel suffices, unless one that the wheel
    /// crosses reaches into the smaller wheel.
    fn visit_under_wheel(
        &self,
        part: &Neighbourhood<'_>,
        (axle, half): (&Vector3<f64>, f64),
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        let c = &part.centre;
        let radius = part.shape.bound() + part.reach;
        let depth = SHALLOW * radius;
        let around = |axis: &Vector3<f64>| part.extent(axis) + part.reach + depth;
        let Some([columns, rows]) =
            self.cells_within(c, [around(&Vector3::x()), around(&Vector3::z())])
        else {
            return;
        };
        let beyond = |[a, b]: [usize; 2], n: usize| [a.saturating_sub(1), (b + 1).min(n - 2)];
        let slope = (self.tiles).steepest(beyond(columns, self.columns), beyond(rows, self.rows));
        let lowest = Rims::of(part.shape).filter(|_| slope <= GENTLE * GENTLE);
        let lowest = lowest.as_ref();
        // No face looks away from the wheel that lies beside it.
        let is_even = (slope / (1.0 + slope)).sqrt() + axle.y.abs() <= AWAY;
        let floor = c.y - around(&Vector3::y());
        let [dx, dz] = self.spacing;
        // Half the width of what the wheel crosses, by the cells' middles along the axle, for all
        // heights that it spans; and of the strip.
        let of_cell = 0.5 * (axle.x.abs() * dx + axle.z.abs() * dz);
        let crossed = half + part.reach + axle.y.abs() * radius + of_cell + ROUNDING;
        let wide = crossed + depth;
        let mut cells = [[0; 2]; MOST_CELLS];
        let (mut n, mut is_shallow) = (0, true);
        let middle = (c.x - self.origin[0]) / dx - 0.5;
        let per_column = axle.x * dx;
        for j in rows[0]..=rows[1] {
            let z = self.origin[1] + (j as f64 + 0.5) * dz - c.z;
            let Some([begin, end]) = across(columns, middle, [per_column, axle.z * z], wide) else {
                continue;
            };
            for i in begin..=end {
                let (highest, square) = self.distance_squared([i, j], c);
                // A cell without heights has no highest.
                let is_near = highest >= floor && square <= radius * radius;
                if !is_near {
                    continue;
                }
                let beside = per_column * (i as f64 - middle) + axle.z * z;
                is_shallow &= is_even
                    || beside.abs() > crossed
                    || square > (radius - depth) * (radius - depth)
                    || self.is_under([i, j], c, radius - depth);
                match cells.get_mut(n) {
                    Some(cell) => *cell = [i, j],
                    None => is_shallow = false,
                }
                n += 1;
            }
        }
        if is_shallow {
            for &cell in &cells[..n] {
                self.visit_reachable(cell, part, lowest, visit);
            }
            return;
        }
        self.visit_not_clear(part, [columns, rows], (radius, floor), lowest, visit);
    }

    /// In ranges of columns and rows, above the height `floor` and within `radius` of the part's
    /// centre, m.
    #[cold]
    fn visit_not_clear(
        &self,
        part: &Neighbourhood<'_>,
        [columns, rows]: [[usize; 2]; 2],
        (radius, floor): (f64, f64),
        lowest: Option<&Rims>,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        let solid = part.solid();
        for j in rows[0]..=rows[1] {
            for i in columns[0]..=columns[1] {
                let is_clear =
                    || solid.is_clear_of(&self.corners(i, j), || self.upright_normals(i, j));
                let (highest, square) = self.distance_squared([i, j], &part.centre);
                if highest >= floor && square <= radius * radius && !is_clear() {
                    self.visit_reachable([i, j], part, lowest, visit);
                }
            }
        }
    }

    /// First and last columns and rows of the cells within distances along x and z (m) of a place;
    /// None if there are none.
    #[inline]
    pub(super) fn cells_within(
        &self,
        centre: &Vector3<f64>,
        reach: [f64; 2],
    ) -> Option<[[usize; 2]; 2]> {
        let range = |axis: usize, x: f64, n: usize| {
            let local = (x - self.origin[axis]) / self.spacing[axis];
            let half = reach[axis] / self.spacing[axis];
            let low = (local - half).floor().max(0.0);
            let high = (local + half).floor().min((n - 2) as f64);
            (low <= high).then(|| [index(low), index(high)])
        };
        let columns = range(0, centre.x, self.columns)?;
        Some([columns, range(1, centre.z, self.rows)?])
    }

    /// Highest point of a cell, m, and the square of the distance of a place from all that is at
    /// most as high over the cell, m².
    #[inline]
    fn distance_squared(&self, [i, j]: [usize; 2], place: &Vector3<f64>) -> (f64, f64) {
        let [a, b, c, d] = self.cell_heights([i, j]);
        let highest = f64::from(a.max(b).max(c.max(d)));
        let beyond = |axis: usize, k: usize, x: f64| {
            let low = self.origin[axis] + k as f64 * self.spacing[axis] - x;
            low.max(-low - self.spacing[axis]).max(0.0)
        };
        let (x, z) = (beyond(0, i, place.x), beyond(1, j, place.z));
        let drop = (place.y - highest).max(0.0);
        (highest, x * x + z * z + drop * drop)
    }

    /// Whether a ball is over the planes of both faces of a cell.
    fn is_under(&self, cell: [usize; 2], centre: &Vector3<f64>, radius: f64) -> bool {
        let from = centre - self.point(cell.map(narrow));
        let [a, b, c, d] = self.cell_heights(cell).map(f64::from);
        [[b - a, d - b], [d - c, c - a]].iter().all(|[x, z]| {
            let m = Vector3::new(-x / self.spacing[0], 1.0, -z / self.spacing[1]);
            m.dot(&from) > radius * m.norm()
        })
    }

    fn corners(&self, i: usize, j: usize) -> [Vector3<f64>; 4] {
        let [i, j] = [narrow(i), narrow(j)];
        [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[u, v]| self.point([i + u, j + v]))
    }

    fn upright_normals(&self, i: usize, j: usize) -> [Vector3<f64>; 2] {
        let own = [narrow(i), narrow(j)];
        [Half::Low, Half::High].map(|half| self.normal(own, half).unwrap_or_else(Vector3::y))
    }

    /// Visits the pieces that belong to a corner and are within reach. `lowest`: the circles of the
    /// part, if their lowest points over the faces tell what it may touch.
    #[inline]
    fn visit_reachable(
        &self,
        cell: [usize; 2],
        part: &Neighbourhood<'_>,
        lowest: Option<&Rims>,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        let first = number(cell[1] * self.columns + cell[0]);
        let [i, j] = cell.map(narrow);
        let from = part.centre - self.point([i, j]);
        let heights = Heights {
            own: self.cell_heights(cell).map(f64::from),
            before: self.corner([i, j - 1]),
            left: self.corner([i - 1, j]),
        };
        let is_near = match lowest {
            Some(rims) => self.near_rims(rims, part.reach, &heights, &from),
            None => self.near_part(part, &heights, &from),
        };
        let mut known = None;
        let mut patch = || *known.get_or_insert_with(|| self.patch(cell));
        for (k, is_near, half) in [(0, is_near[0], Half::Low), (1, is_near[1], Half::High)] {
            if let Some(face) = is_near.then(|| patch().face(half)).flatten() {
                visit(first + k, &Primitive::Face(face));
            }
        }
        for (k, edge) in (2..5).zip(&is_near[2..]) {
            if let Some(edge) = edge.then(|| patch().edge(k)).flatten() {
                visit(first + k, &Primitive::Edge(edge));
            }
        }
        let is_near = || match lowest {
            Some(rims) => rims.may_touch_vertex(part, &from),
            None => from.norm() <= part.radius() + ROUNDING,
        };
        if heights.is_high()
            && is_near()
            && let Some(vertex) = patch().vertex()
        {
            visit(first + 5, &Primitive::Vertex(vertex));
        }
    }

    /// Which faces and edges of a cell a part may touch, in the order of their numbers. `from`:
    /// place of the part's centre from the cell's corner, m.
    #[inline]
    fn near_part(
        &self,
        part: &Neighbourhood<'_>,
        heights: &Heights,
        from: &Vector3<f64>,
    ) -> [bool; 5] {
        let sides = self.sides(heights, from, |m, height| {
            part.is_beyond(m, height, part.reach)
        });
        let convex = heights.convex();
        let edge = |k: usize| {
            let [one, two] = sides.at_edge(k).map(|side| side.is_beyond);
            convex[k - 2] && !part.is_beyond_edge([one, two])
        };
        let faces = [&sides.low, &sides.high].map(|side| !side.is_beyond);
        [faces[0], faces[1], edge(2), edge(3), edge(4)]
    }

    /// The same of a wheel that comes as near as `reach`, m.
    #[inline]
    fn near_rims(
        &self,
        rims: &Rims,
        reach: f64,
        heights: &Heights,
        from: &Vector3<f64>,
    ) -> [bool; 5] {
        let reach = reach + rims.rounding;
        let convex = heights.convex();
        let mut is_near = [false; 5];
        let beside = self.beside(&rims.disc, from, heights.rises());
        for along in rims.places() {
            let from = from + rims.disc.axle * along;
            let beside = (beside - along.abs() - rims.rounding).max(0.0);
            let least = reach - SHARE * beside;
            let sides = self.sides(heights, &from, |m, height| {
                circle_is_beyond(&rims.disc, m, height, least)
            });
            let shift = rims.rounding;
            for (k, half) in [(0, Half::Low), (1, Half::High)] {
                let side = sides.face(half);
                is_near[k] = is_near[k]
                    || (!side.is_beyond
                        && self.is_over(side, &rims.disc, [reach, shift], &from, half));
            }
            for k in 2..5 {
                let pair = sides.at_edge(k);
                is_near[k] = is_near[k]
                    || (convex[k - 2]
                        && !pair.iter().any(|side| side.is_beyond)
                        && Side::may_touch_between(
                            pair,
                            &rims.disc,
                            &from,
                            &heights.along(k, self.spacing),
                        ));
            }
        }
        if rims.half > 0.0 {
            let sides = self.sides(heights, from, |_, _| false);
            for k in 2..5 {
                is_near[k] = is_near[k]
                    || (convex[k - 2]
                        && rims.may_cross(
                            sides.at_edge(k),
                            reach,
                            from,
                            &heights.along(k, self.spacing),
                        ));
            }
        }
        is_near
    }

    /// The planes around a cell's corner and a part, or a circle of it, whose centre is `from` (m)
    /// from the corner.
    #[inline]
    fn sides(
        &self,
        heights: &Heights,
        from: &Vector3<f64>,
        is_beyond: impl Fn(&Vector3<f64>, f64) -> bool,
    ) -> Sides {
        let [dx, dz] = self.spacing;
        let Heights {
            own: [a, b, c, d],
            before,
            left,
        } = *heights;
        let side = |x: f64, z: f64| {
            let m = Vector3::new(-x / dx, 1.0, -z / dz);
            let height = m.dot(from);
            Side {
                m,
                height,
                is_beyond: is_beyond(&m, height),
            }
        };
        Sides {
            low: side(b - a, d - b),
            high: side(d - c, c - a),
            before: side(b - a, a - before),
            left: side(a - left, c - a),
        }
    }

    /// Distance of a cell from a disc's plane, m: what lies beside a disc is touched only if the
    /// disc is about as deep in the ground. `rises`: heights of the cell's corners over the first,
    /// m.
    #[inline]
    pub(super) fn beside(&self, disc: &Disc, from: &Vector3<f64>, rises: [f64; 4]) -> f64 {
        let (s, [dx, dz]) = (&disc.axle, self.spacing);
        let (x, z) = (s.x * dx, s.z * dz);
        let (mut nearest, mut furthest) = (f64::INFINITY, f64::NEG_INFINITY);
        for (level, rise) in [0.0, x, z, x + z].into_iter().zip(rises) {
            let place = level + s.y * rise - s.dot(from);
            (nearest, furthest) = (nearest.min(place), furthest.max(place));
        }
        nearest.max(-furthest).max(0.0)
    }

    /// Whether the lowest point of a circle over the plane of a face, moved by up to `shift` (m),
    /// may be over the face, or other points may be near it. `from`: place of the circle's centre
    /// from the cell's corner, m.
    #[inline]
    fn is_over(
        &self,
        side: &Side,
        disc: &Disc,
        [reach, shift]: [f64; 2],
        from: &Vector3<f64>,
        half: Half,
    ) -> bool {
        let (low, length) = side.lowest(disc, from);
        // At least the gap.
        let off = OFF * (side.height - disc.radius * length).abs() + shift + ROUNDING;
        let [dx, dz] = self.spacing;
        let is_beside = low.x < -off || low.x > dx + off || low.z < -off || low.z > dz + off;
        let ahead = low.x / dx - low.z / dz;
        let beyond = off / dx + off / dz;
        let is_in_other = match half {
            Half::Low => ahead < -beyond,
            Half::High => ahead > beyond,
        };
        // The second and third point of the rim are higher by one and a half radii.
        let others = side.height + 0.5 * disc.radius * length;
        let is_upright = others > (reach + ROUNDING) * side.m.norm();
        !((is_beside || is_in_other) && is_upright)
    }
}

/// The circles of a wheel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rims {
    /// A circle in the middle of the wheel.
    disc: Disc,
    /// Distance of the circles from there, 0 if there is one, and what they are swept by, m.
    half: f64,
    rounding: f64,
}

impl Rims {
    /// Those of a shape; none if it is no wheel.
    #[inline]
    fn of(shape: &PlacedShape) -> Option<Self> {
        match shape {
            PlacedShape::Disc(disc) => Some(Self {
                disc: *disc,
                half: 0.0,
                rounding: 0.0,
            }),
            PlacedShape::Roller(Roller {
                core,
                half,
                rounding,
            }) => Some(Self {
                disc: *core,
                half: *half,
                rounding: *rounding,
            }),
            PlacedShape::Box(_) | PlacedShape::Sphere(_) => None,
        }
    }

    /// Places of the circles along the axle, m.
    #[inline]
    fn places(&self) -> impl Iterator<Item = f64> {
        let n = if self.half > 0.0 { 2 } else { 1 };
        [self.half, -self.half].into_iter().take(n)
    }

    /// Whether a vertex may be touched from which the wheel's centre is `from`, m.
    #[inline]
    fn may_touch_vertex(&self, part: &Neighbourhood<'_>, from: &Vector3<f64>) -> bool {
        let along = self.disc.axle.dot(from).abs();
        if self.half + self.rounding > 0.0 {
            let reach = part.reach + self.rounding + ROUNDING;
            let away = from.norm_squared() - along * along;
            let radius = self.disc.radius + reach;
            return along <= self.half + reach && away <= radius * radius;
        }
        // Nothing but a needle pierces a disc that stands.
        if self.disc.axle.y.abs() < STANDS {
            along <= part.reach + ROUNDING
        } else {
            from.norm() <= part.radius() + ROUNDING
        }
    }

    /// Whether the tread between the circles may touch the edge between two planes, at a distance
    /// of up to `reach` from the cylinder of the circles (m): at a normal between theirs that is
    /// perpendicular to the axle and to the edge. `along`: the edge, from the corner from which the
    /// wheel's centre is `from`, m.
    #[inline]
    fn may_cross(
        &self,
        sides: [&Side; 2],
        reach: f64,
        from: &Vector3<f64>,
        along: &Vector3<f64>,
    ) -> bool {
        let s = &self.disc.axle;
        let across = s.cross(along);
        let square = across.norm_squared();
        let length = along.norm_squared();
        // Nearly parallel: the places along the axle are not accurate.
        if square <= ALONGSIDE * ALONGSIDE * length {
            return true;
        }
        let up = (sides[0].m + sides[1].m).dot(&across);
        let n = across * (1.0_f64.copysign(up) / square.sqrt());
        let gap = n.dot(from) - self.disc.radius;
        if gap > reach + ROUNDING {
            return false;
        }
        let [one, two] = sides.map(|side| side.m.cross(along).dot(&n));
        let tolerance = ROUNDING * length.sqrt();
        if one >= tolerance || two <= -tolerance {
            return false;
        }
        // from − n (n · from) + own s = place along
        let rest = from - n * n.dot(from);
        let own = (s.dot(along) * rest.dot(along) - rest.dot(s) * length) / square;
        own.abs() <= self.half + ROUNDING
    }
}

/// Sine of the angle between axle and edge up to which the edge is alongside the wheel.
const ALONGSIDE: f64 = 1e-3;

/// Whether a circle of a disc is further from a plane than `reach`, m; as
/// [`Neighbourhood::is_beyond`].
#[inline]
fn circle_is_beyond(disc: &Disc, m: &Vector3<f64>, height: f64, reach: f64) -> bool {
    let square = m.norm_squared();
    let length = 0.5 * (1.0 + square);
    let reach = reach + ROUNDING;
    let rest = height - reach.max(reach * length);
    let along = m.dot(&disc.axle);
    rest > 0.0 && rest * rest > disc.radius * disc.radius * (square - along * along)
}

/// Heights of a cell's corners, and of those before and left of the first, m.
#[derive(Clone, Copy, Debug)]
struct Heights {
    own: [f64; 4],
    before: f64,
    left: f64,
}

impl Heights {
    /// Of the corners over the first.
    #[inline]
    fn rises(&self) -> [f64; 4] {
        let [a, b, c, d] = self.own;
        [0.0, b - a, c - a, d - a]
    }

    /// Which edges are convex: the middle of the edge is above that of the corners on its sides.
    #[inline]
    fn convex(&self) -> [bool; 3] {
        let [a, b, c, d] = self.own;
        [
            a + b > d + self.before,
            a + c > d + self.left,
            a + d > b + c,
        ]
    }

    /// The edge k = 2, 3, 4 from the first corner, m.
    #[inline]
    fn along(&self, k: usize, [dx, dz]: [f64; 2]) -> Vector3<f64> {
        let [_, b, c, d] = self.rises();
        match k {
            2 => Vector3::new(dx, b, 0.0),
            3 => Vector3::new(0.0, c, dz),
            _ => Vector3::new(dx, d, dz),
        }
    }

    /// Whether the vertex at the first corner may be convex.
    #[inline]
    fn is_high(&self) -> bool {
        let [a, b, c, _] = self.own;
        2.0 * a >= b + self.left && 2.0 * a >= c + self.before
    }
}

/// The planes of a cell's faces, and of those before and left of it.
#[derive(Clone, Copy, Debug)]
struct Sides {
    low: Side,
    high: Side,
    before: Side,
    left: Side,
}

impl Sides {
    #[inline]
    fn face(&self, half: Half) -> &Side {
        match half {
            Half::Low => &self.low,
            Half::High => &self.high,
        }
    }

    /// Those at the edge k = 2, 3, 4.
    #[inline]
    fn at_edge(&self, k: usize) -> [&Side; 2] {
        match k {
            2 => [&self.before, &self.low],
            3 => [&self.high, &self.left],
            _ => [&self.low, &self.high],
        }
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

/// The plane of a face and the part over it.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// Normal with a vertical component of 1.
    m: Vector3<f64>,
    /// Of the part's centre over the plane, in units of this length, m.
    height: f64,
    /// Whether the part is out of reach of the plane.
    is_beyond: bool,
}

impl Side {
    /// The lowest point of a disc over the plane, from where its centre is `from` (m), and the
    /// length of the normal's part in the disc's plane.
    #[inline]
    fn lowest(&self, disc: &Disc, from: &Vector3<f64>) -> (Vector3<f64>, f64) {
        let across = self.m - disc.axle * self.m.dot(&disc.axle);
        let length = across.norm();
        (from - across * (disc.radius / length), length)
    }

    /// Whether a disc may touch the edge between two planes at a normal between theirs: its lowest
    /// points over them lie off the faces, beyond the edge. `along`: the edge, from the corner from
    /// which the disc's centre is `from`, m.
    #[inline]
    fn may_touch_between(
        sides: [&Self; 2],
        disc: &Disc,
        from: &Vector3<f64>,
        along: &Vector3<f64>,
    ) -> bool {
        if sides.iter().any(|side| side.m.norm_squared() > UNSHARP) {
            return true;
        }
        let [one, two] = sides.map(|side| {
            let (low, _) = side.lowest(disc, from);
            side.m.cross(along).dot(&low)
        });
        one < ROUNDING && two > -ROUNDING
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::query::dispatch;
    use crate::geometry::{OrientedBox, Roller, Sphere, Terrain};
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    /// Gap of the point of a shape at a piece that is nearest to zero, m.
    fn shallowest(shape: &PlacedShape, piece: &Primitive, base: &Vector3<f64>, reach: f64) -> f64 {
        let mut gap = f64::NEG_INFINITY;
        match piece {
            Primitive::Face(face) => {
                dispatch::visit_on_face(shape, face, base, reach, |x| gap = gap.max(x.gap));
            }
            Primitive::Edge(edge) => {
                dispatch::visit_at_edge(shape, edge, base, reach, |x| gap = gap.max(x.gap));
            }
            Primitive::Vertex(vertex) => {
                let near = dispatch::point_at_vertex(shape, vertex, base);
                if near.gap <= reach && vertex.admits(&near.n) {
                    gap = near.gap;
                }
            }
            Primitive::Plane(_) | Primitive::Sphere(_) => {}
        }
        gap
    }

    fn shapes(angles: [f64; 3]) -> [PlacedShape; 6] {
        let R = *Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).matrix();
        let centre = Vector3::new(0.02, -0.01, 0.03);
        let disc = |radius: f64| Disc {
            centre,
            axle: R.column(2).into(),
            spoke: R.column(0).into(),
            radius,
        };
        [
            PlacedShape::Disc(disc(0.2)),
            PlacedShape::Disc(disc(0.05)),
            PlacedShape::Roller(Roller::new(disc(0.15), 0.1, 0.03)),
            PlacedShape::Roller(Roller::new(disc(0.2), 0.15, 0.0)),
            PlacedShape::Box(OrientedBox {
                centre,
                R,
                half_size: Vector3::new(0.2, 0.05, 0.1),
            }),
            PlacedShape::Sphere(Sphere {
                centre,
                radius: 0.12,
            }),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        /// A search around a part finds all pieces that it touches, of all that are near.
        #[test]
        fn no_piece_is_left_out_that_a_part_touches(
            heights in prop::collection::vec(-1.0..1.0, 21 * 21),
            steepness in 0.0..1.0_f64,
            spacing in prop::sample::select(vec![0.05, 0.25]),
            turn in [-0.5..0.5, -3.2..3.2, -0.5..0.5_f64],
            (x, z, height) in (-0.1..0.1, -0.1..0.1, -0.02..0.03_f64),
            reach in 0.0..2e-3_f64,
        ) {
            #[allow(clippy::cast_possible_truncation)] // a map is single
            let heights = heights.iter().map(|h: &f64| (h * 0.5 * steepness * spacing) as f32);
            let origin = [-10.0 * spacing; 2];
            let field = HeightField::new(heights.collect(), [21, 21], [spacing; 2], origin).unwrap();
            for shape in shapes(turn) {
                let low = shape.support(&-Vector3::y());
                let under = field.height(x + low.x, z + low.z).unwrap();
                let base = Vector3::new(x, under + height - low.y, z);
                let part = Neighbourhood::new(&shape, &base, reach);
                let mut visited = Vec::new();
                field.visit_around(&part, &mut |id, _| visited.push(id));
                // Of deeper ones those are left out that look away from the part.
                let least = -1e-3 * shape.bound();
                let mut left_out = Vec::new();
                field.visit_near(&part.centre, part.radius(), &mut |id, piece| {
                    let gap = shallowest(&shape, piece, &base, reach);
                    if gap >= least && !visited.contains(&id) {
                        left_out.push((id % 6, gap));
                    }
                });
                prop_assert!(left_out.is_empty(), "{shape:?} {left_out:?}");
            }
        }
    }
}
