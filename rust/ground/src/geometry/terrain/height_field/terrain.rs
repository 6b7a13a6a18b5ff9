//! The height field as a terrain.

use nalgebra::Vector3;

use super::{Half, HeightField, PIECES, index, narrow, number};
use crate::geometry::ray::{self, Hit, Ray};
use crate::geometry::shape::{Disc, Sphere};
use crate::geometry::terrain::surface::Vertex;
use crate::geometry::terrain::{
    Area, BorderEdge, Coverage, GROUND, Neighbourhood, Plane, Primitive, Terrain,
};

impl Terrain for HeightField {
    fn visit_spheres(&self, _: &Vector3<f64>, _: f64, _: &mut dyn FnMut(u32, &Sphere)) {}

    fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        self.visit_cells(centre, reach, |i, j| self.visit_pieces([i, j], visit));
    }

    fn visit_around(&self, part: &Neighbourhood<'_>, visit: &mut dyn FnMut(u32, &Primitive)) {
        self.visit_pieces_around(part, visit);
    }

    fn visit_ahead(
        &self,
        disc: (&Disc, f64),
        reach: [f64; 2],
        visit: &mut dyn FnMut(&Primitive),
    ) -> Option<f64> {
        self.visit_pieces_ahead(disc, reach, visit)
    }

    fn level_near(&self, centre: &Vector3<f64>, radius: f64) -> Option<Plane> {
        let [columns, rows] = self.span(centre, radius);
        let first = self.heights[rows[0] * self.columns + columns[0]];
        for j in rows[0]..=rows[1] + 1 {
            let row = &self.heights[j * self.columns..][columns[0]..=columns[1] + 1];
            if row.iter().any(|h| h.to_bits() != first.to_bits()) {
                return None;
            }
        }
        let normal = self.normal([columns[0], rows[0]].map(narrow), Half::Low)?;
        let place = self.point([columns[0], rows[0]].map(narrow));
        Some(Plane::through(&place, normal))
    }

    fn can_be_passed(&self) -> bool {
        false
    }

    fn has_surface(&self) -> bool {
        true
    }

    fn primitive(&self, id: u32) -> Primitive {
        let corner = (id / PIECES) as usize;
        let patch = self.patch([corner % self.columns, corner / self.columns]);
        let piece = patch.piece(id % PIECES);
        piece.unwrap_or_else(|| unreachable!("invariant: piece {id} was visited"))
    }

    fn material(&self, _id: u32) -> &str {
        self.material.as_deref().unwrap_or(GROUND)
    }

    fn n_primitives(&self) -> u32 {
        number(self.heights.len())
    }

    fn is_inside(&self, _id: u32, point: &Vector3<f64>) -> bool {
        let surface = self.height(point.x, point.z);
        surface.is_some_and(|y| point.y <= y + SURFACE)
    }

    fn furthest(&self, n: &Vector3<f64>, centre: &Vector3<f64>, radius: f64) -> f64 {
        const SIDE_BY_SIDE: usize = 8;
        let [columns, rows] = self.span(centre, radius);
        let [along, across] = [n.x * self.spacing[0], n.z * self.spacing[1]];
        let mut furthest = [f64::NEG_INFINITY; SIDE_BY_SIDE];
        for j in rows[0]..=rows[1] + 1 {
            let row = &self.heights[j * self.columns..][columns[0]..=columns[1] + 1];
            let start = n.x * self.origin[0] + n.z * self.origin[1] + across * j as f64;
            for (k, heights) in row.chunks(SIDE_BY_SIDE).enumerate() {
                let first = start + along * (columns[0] + k * SIDE_BY_SIDE) as f64;
                let places = furthest.iter_mut().zip(heights).enumerate();
                for (i, (furthest, height)) in places {
                    let own = first + along * i as f64 + n.y * f64::from(*height);
                    *furthest = if own > *furthest { own } else { *furthest };
                }
            }
        }
        furthest.into_iter().fold(f64::NEG_INFINITY, f64::max)
    }

    fn coverage(&self, centre: &Vector3<f64>, radius: f64) -> Coverage {
        let [x, z] = [centre.x, centre.z];
        let mut range = [[0; 2]; 2];
        for (axis, (x, n)) in [(x, self.columns), (z, self.rows)].into_iter().enumerate() {
            let local = (x - self.origin[axis]) / self.spacing[axis];
            let half = radius / self.spacing[axis];
            let last = (n - 1) as f64;
            let (low, high) = (local - half, local + half);
            if !(low >= 0.0 && high <= last) {
                return Coverage::Unknown([centre.x, centre.z]);
            }
            range[axis] = [index(low.floor()), index(high.floor().min(last - 1.0))];
        }
        self.coverage_of_cells(range)
    }

    fn covers(&self, area: &Area, _: &dyn Fn(u32) -> bool) -> Coverage {
        let mut range = [[0; 2]; 2];
        for (axis, n) in [self.columns, self.rows].into_iter().enumerate() {
            let along = |x: f64| (x - self.origin[axis]) / self.spacing[axis];
            let [low, high] = area.0[axis].map(along);
            let last = (n - 1) as f64;
            if !(low >= -BORDER && high <= last + BORDER) {
                return Coverage::Unknown(area.middle());
            }
            let first = (low + BORDER).floor().clamp(0.0, last - 1.0);
            let end = ((high - BORDER).ceil() - 1.0).clamp(first, last - 1.0);
            range[axis] = [index(first), index(end)];
        }
        self.coverage_of_cells(range)
    }

    fn known_within(&self) -> Option<Area> {
        let along = |axis: usize, n: usize| {
            let size = (n - 1) as f64 * self.spacing[axis];
            [self.origin[axis], self.origin[axis] + size]
        };
        Some(Area([along(0, self.columns), along(1, self.rows)]))
    }

    fn may_end_near(&self, place: &Vector3<f64>, radius: f64) -> bool {
        self.coverage(place, radius + self.spacing[0].max(self.spacing[1])) != Coverage::Known
    }

    fn visit_rims(&self, visit: &mut dyn FnMut(&BorderEdge)) {
        let last = [self.columns - 2, self.rows - 2];
        for j in 0..=last[1] {
            let is_outer = j == 0 || j == last[1] || self.tiles.has_hole();
            let columns = if is_outer { 1 } else { last[0].max(1) };
            for i in (0..=last[0]).step_by(columns) {
                self.visit_rims_of([i, j], visit);
            }
        }
    }

    fn rim_corner(&self, id: u32) -> Vertex {
        let corner = (id / PIECES) as usize;
        let patch = self.patch([corner % self.columns, corner / self.columns]);
        patch.neighbours()
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        ray::height_field::hit(ray, self, reach)
    }

    fn smooth_normal(&self, place: &Vector3<f64>) -> Option<Vector3<f64>> {
        self.smooth_normal_at(place)
    }

    fn height(&self, x: f64, z: f64) -> Option<f64> {
        let ([i, j], [u, v]) = self.cell_at(x, z)?;
        let [i, j] = [narrow(i), narrow(j)];
        let (a, d) = (self.corner([i, j]), self.corner([i + 1, j + 1]));
        let y = if u >= v {
            let b = self.corner([i + 1, j]);
            a + u * (b - a) + v * (d - b)
        } else {
            let c = self.corner([i, j + 1]);
            a + u * (d - c) + v * (c - a)
        };
        y.is_finite().then_some(y)
    }

    fn ground(&self) -> Option<&Plane> {
        None
    }
}

impl HeightField {
    /// Whether all corners of ranges of columns and rows of cells (first and last) are known.
    fn coverage_of_cells(&self, range: [[usize; 2]; 2]) -> Coverage {
        if !self.tiles.has_hole() {
            return Coverage::Known;
        }
        let mut hole = None;
        self.tiles.visit(
            range[0],
            range[1],
            |tile| tile.has_hole,
            |[i, j]| {
                for corner in [[i, j], [i + 1, j], [i, j + 1], [i + 1, j + 1]] {
                    let place = corner.map(narrow);
                    if self.height_at(place).is_nan() {
                        let [i, j] = corner.map(|k| k as f64);
                        hole = Some([
                            self.origin[0] + i * self.spacing[0],
                            self.origin[1] + j * self.spacing[1],
                        ]);
                    }
                }
            },
        );
        hole.map_or(Coverage::Known, Coverage::Unknown)
    }
}

/// How far a rectangle may reach over the border of the map, in cells.
const BORDER: f64 = 1e-6;

/// How far above the surface a point that is in the ground may seem to be by rounding, m.
const SURFACE: f64 = 1e-9;
