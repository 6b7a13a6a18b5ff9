//! Which pieces of a height field a part may touch.
//!
//! Heights decide about most. Of the cells under a part those count that reach up to it. Of a
//! cell's faces those count whose plane is within reach of the part's lowest point over it; of its
//! edges those that are convex, by four heights, and between two such planes. What is left is
//! built. [`super::under_wheel`] says more of wheels.

use nalgebra::Vector3;

use super::planes::{AT_EDGE, Heights, upright};
use super::{HeightField, PIECES, index, narrow, number};
use crate::geometry::shape::{OrientedBox, PlacedShape};
use crate::geometry::terrain::{Neighbourhood, Primitive};
#[cfg(target_arch = "x86_64")]
use friction_contact::scalar::{Eights, Fours, inlined};
use friction_contact::scalar::{Instructions, Lane, LaneMask, MAX_LANES, Single, Vec3};

/// Cosine of the angle to the way from a part to a face from which on the face looks away, as in
/// [`OrientedBox::is_clear_of`].
pub(super) const AWAY: f64 = 0.5;

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
            PlacedShape::Disc(disc) => self.visit_under_disc(part, disc, visit),
            PlacedShape::Roller(roller) => self.visit_under_roller(part, roller, visit),
            _ => match Instructions::of_this_machine() {
                Instructions::Baseline => {
                    self.visit_around_solid::<f64>(Single::Baseline, part, visit);
                }
                #[cfg(target_arch = "x86_64")]
                Instructions::Avx2(token) => {
                    self.visit_around_solid::<Fours>(token, part, visit);
                }
                #[cfg(target_arch = "x86_64")]
                Instructions::Avx512(token) => {
                    self.visit_around_solid::<Eights>(token, part, visit);
                }
            },
        }
    }

    /// Around a part of any shape: what is not clear of a box about it.
    fn visit_around_solid<T: Lane>(
        &self,
        token: T::Token,
        part: &Neighbourhood<'_>,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        let solid = part.solid();
        let around = |axis: &Vector3<f64>| part.extent(axis) + part.reach + ROUNDING;
        let ends = [around(&Vector3::x()), around(&Vector3::z())];
        let Some([columns, rows]) = self.cells_within(&part.centre, ends) else {
            return;
        };
        let floor = part.centre.y - around(&Vector3::y());
        if self.tiles.highest_of(columns, rows) < floor {
            return;
        }
        inlined!(T::vectorize, token, {
            for j in rows[0]..=rows[1] {
                for i in (columns[0]..=columns[1]).step_by(T::LANES) {
                    let mut rest = (!self.are_clear_of::<T>(token, &solid, [i, j])).bits();
                    while rest != 0 {
                        let cell = [i + rest.trailing_zeros() as usize, j];
                        rest &= rest - 1;
                        if cell[0] <= columns[1] {
                            self.visit_kinds(cell, self.near_part(cell, part), visit);
                        }
                    }
                }
            }
        });
    }

    /// Which cells of a row, from one on, are clear of a box: beyond a plane along one of its sides
    /// and with faces that look back or along it, as [`OrientedBox::is_clear_of`] tells of one.
    #[inline(always)]
    fn are_clear_of<T: Lane>(
        &self,
        token: T::Token,
        solid: &OrientedBox,
        [i, j]: [usize; 2],
    ) -> T::Mask {
        let [dx, dz] = self.spacing;
        let number = |x: f64| T::splat(token, x);
        let near = &self.heights[j * self.columns + i..];
        let n = (self.columns - i).min(T::LANES + 1);
        let far = &near[self.columns..];
        let mut own = [[f64::NAN; MAX_LANES + 1]; 2];
        for k in 0..n {
            (own[0][k], own[1][k]) = (f64::from(near[k]), f64::from(far[k]));
        }
        let height = |u: usize, v: usize| T::load(token, &own[v][u..u + T::LANES]);
        let heights = [height(0, 0), height(1, 0), height(0, 1), height(1, 1)];
        let [a, b, c, d] = heights;
        let mut places = [0.0; MAX_LANES];
        for (k, x) in places.iter_mut().enumerate() {
            *x = self.origin[0] + (i + k) as f64 * dx - solid.centre.x;
        }
        let x = T::load(token, &places[..T::LANES]);
        let z = self.origin[1] + j as f64 * dz - solid.centre.z;
        let per = [1.0 / dx, 1.0 / dz];
        let normals = [upright(b - a, d - b, per), upright(d - c, c - a, per)];
        let mut are_clear = T::mask(token, 0);
        for k in 0..3 {
            let axis = solid.axis(k);
            let along = x * number(axis.x) + number(z * axis.z - solid.centre.y * axis.y);
            let (mut low, mut high) = (number(f64::INFINITY), number(f64::NEG_INFINITY));
            let shifts = [0.0, axis.x * dx, axis.z * dz, axis.x * dx + axis.z * dz];
            for corner in 0..4 {
                let place = along + number(shifts[corner]) + heights[corner] * number(axis.y);
                // What is no number is left out.
                (low, high) = (place.min(low), place.max(high));
            }
            let half = number(solid.half_size[k]);
            let (over, under) = (half.lt(low), high.lt(-half));
            let (mut back, mut forth) = (over | !over, over | !over);
            for m in normals {
                let away = (m.dot(m)).sqrt() * number(AWAY);
                let leans = m.dot(Vec3::splat(token, axis.into()));
                // Where there is no face, nothing looks away.
                back = back & !away.lt(leans);
                forth = forth & !away.lt(-leans);
            }
            are_clear = are_clear | (over & back) | (under & forth);
        }
        are_clear
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

    /// Visits the pieces of a corner whose kinds are among the bits of `kinds`.
    pub(super) fn visit_kinds(
        &self,
        cell: [usize; 2],
        kinds: u32,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        if kinds == 0 {
            return;
        }
        let first = number(cell[1] * self.columns + cell[0]);
        let patch = self.patch(cell);
        for k in (0..PIECES).filter(|k| kinds >> k & 1 == 1) {
            if let Some(piece) = patch.piece(k) {
                visit(first + k, &piece);
            }
        }
    }

    /// Which pieces of a cell a part may touch: for each kind a bit.
    pub(super) fn near_part(&self, cell: [usize; 2], part: &Neighbourhood<'_>) -> u32 {
        let [i, j] = cell.map(narrow);
        let from = part.centre - self.point([i, j]);
        let heights = Heights {
            own: self.cell_heights(cell).map(f64::from),
            before: self.corner([i, j - 1]),
            left: self.corner([i - 1, j]),
        };
        let per = self.spacing.map(|spacing| 1.0 / spacing);
        let is_beyond = heights.normals(per).map(|m| {
            let m = Vector3::from(m);
            part.is_beyond(&m, m.dot(&from), part.reach)
        });
        let convex = heights.convex();
        let edge = |k: usize| convex[k] && !part.is_beyond_edge(AT_EDGE[k].map(|k| is_beyond[k]));
        let is_near = heights.is_high() && from.norm() <= part.radius() + ROUNDING;
        let kinds = [
            !is_beyond[0],
            !is_beyond[1],
            edge(0),
            edge(1),
            edge(2),
            is_near,
        ];
        let bits = kinds.iter().enumerate();
        bits.fold(0, |bits, (k, own)| bits | u32::from(*own) << k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::query::dispatch;
    use crate::geometry::{Disc, Ellipsoid, Hull, Roller, Sphere, SupportMap, Terrain};
    use crate::spatial::Polytope;
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
                if near.gap <= reach && dispatch::pushes(vertex, shape, &near.n) {
                    gap = near.gap;
                }
            }
            Primitive::Plane(_) | Primitive::Sphere(_) => {}
        }
        gap
    }

    fn shapes(angles: [f64; 3], polytope: &Polytope) -> [PlacedShape<'_>; 10] {
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
            PlacedShape::Sphere(Sphere::new(centre, 0.12)),
            PlacedShape::Cylinder(Roller::new(disc(0.15), 0.2, 0.0)),
            PlacedShape::Cylinder(Roller::new(disc(0.06), 0.3, 0.06)),
            PlacedShape::Ellipsoid(Ellipsoid {
                centre,
                R,
                radii: Vector3::new(0.2, 0.06, 0.12),
            }),
            PlacedShape::Hull(Hull {
                centre,
                R,
                polytope,
            }),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        /// A search around a part finds all pieces that it touches, of all that are near.
        #[test]
        fn no_piece_is_left_out_that_a_part_touches(
            heights in prop::collection::vec(-1.0..1.0, 21 * 21),
            steepness in 0.0..1.0_f64,
            spacing in prop::sample::select(vec![0.05, 0.25]),
            turn in [-0.5..0.5, -3.2..3.2, -0.5..0.5_f64],
            lean in prop::sample::select(vec![1.0, 1.0, 6.0]),
            (x, z, height) in (-0.1..0.1, -0.1..0.1, -0.02..0.03_f64),
            // Within a step, and in a search for the nearest ground.
            reach in prop_oneof![0.0..2e-3_f64, 0.0..0.4_f64],
        ) {
            #[allow(clippy::cast_possible_truncation)] // a map is single
            let heights = heights.iter().map(|h: &f64| (h * 0.5 * steepness * spacing) as f32);
            let origin = [-10.0 * spacing; 2];
            let field = HeightField::new(heights.collect(), [21, 21], [spacing; 2], origin).unwrap();
            let points = [
                [0.2, 0.0, 0.0], [-0.15, 0.05, 0.1], [-0.1, 0.05, -0.1],
                [0.0, -0.1, 0.05], [0.0, 0.15, 0.0], [0.1, -0.08, -0.1],
            ];
            let polytope = Polytope::hull_of(&points.map(Vector3::from)).unwrap();
            for shape in shapes([turn[0] * lean, turn[1], turn[2] * lean], &polytope) {
                let low = shape.support(&-Vector3::y());
                let under = field.height(x + low.x, z + low.z).unwrap();
                let above = under + height + 0.8 * reach;
                let base = Vector3::new(x, above - low.y, z);
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
