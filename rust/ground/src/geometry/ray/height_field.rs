//! A ray and a height field: a walk from cell to cell.
//!
//! Along the ray its height over the surface is linear between the lines of the grid and the
//! diagonals of the cells. It is computed at each of them; where its sign changes, the ray crosses
//! the surface. The value with which a cell ends is the one with which the next begins, so no ray
//! slips through between two. Cells below the ray are passed by the greatest of their heights,
//! tiles of them by their bounds.
//!
//! Sources: Amanatides and Woo 1987, *A fast voxel traversal algorithm for ray tracing*; Musgrave
//! 1988, *Grid tracing*; Tevs, Ihrke and Seidel 2008, *Maximum mipmaps* (the tiles).

use super::{Hit, Ray};
use crate::geometry::terrain::HeightField;
use crate::geometry::terrain::height_field::Half;

/// No ray is followed farther, m: maps lie within 1e6 m of the origin, and so do rays begin.
const FARTHEST: f64 = 1e7;

/// A ray over a map in units of its cells.
struct Walk<'a> {
    field: &'a HeightField,
    ray: &'a Ray,
    /// Columns and rows of its origin.
    from: [f64; 2],
    /// Columns and rows a metre.
    rate: [f64; 2],
    /// Metres a column and a row.
    pace: [f64; 2],
    /// Cells along x and z.
    cells: [usize; 2],
    reach: f64,
}

/// Where a ray crosses the surface within `reach` (m), from above or from below.
#[must_use]
pub fn hit(ray: &Ray, field: &HeightField, reach: f64) -> Option<Hit> {
    let ([dx, dz], [x, z]) = (field.spacing(), field.origin());
    let [rows, columns] = field.shape();
    let rate = [ray.direction.x / dx, ray.direction.z / dz];
    let walk = Walk {
        field,
        ray,
        from: [(ray.origin.x - x) / dx, (ray.origin.z - z) / dz],
        rate,
        pace: rate.map(f64::recip),
        cells: [columns - 1, rows - 1],
        reach: reach.min(FARTHEST),
    };
    walk.run()
}

impl Walk<'_> {
    /// Where the ray is over the map and not above its highest point, m.
    fn range(&self) -> Option<[f64; 2]> {
        let (mut begin, mut end) = (0.0_f64, self.reach);
        for k in 0..2 {
            let last = self.cells[k] as f64;
            if self.rate[k].abs() > 0.0 {
                let first = -self.from[k] / self.rate[k];
                let second = (last - self.from[k]) / self.rate[k];
                begin = begin.max(first.min(second));
                end = end.min(first.max(second));
            } else if !(0.0..=last).contains(&self.from[k]) {
                return None;
            }
        }
        let over = self.ray.origin.y - f64::from(self.field.tiles().highest());
        let fall = -self.ray.direction.y;
        if over > 0.0 && fall > 0.0 {
            // A little earlier, where the ray is surely above.
            begin = begin.max(over / fall - self.slack(over / fall));
        } else if over > 0.0 {
            return None;
        }
        (begin <= end).then_some([begin, end])
    }

    /// More than rounding moves a distance, m.
    fn slack(&self, distance: f64) -> f64 {
        1e-9 + 1e-12 * (distance + self.ray.origin.amax())
    }

    fn run(&self) -> Option<Hit> {
        let [mut t, end] = self.range()?;
        let mut cell = [0, 1].map(|k| self.cell_at(k, t));
        let mut over = None;
        let mut tile = None;
        loop {
            let here = cell.map(|k| k / self.field.tiles().finest());
            if tile != Some(here) {
                tile = Some(here);
                let clears = |first: [usize; 2], size: [usize; 2], highest: f32| {
                    let leaves = self.leaves(first, size).0.min(end);
                    self.lowest(t, leaves) > f64::from(highest)
                };
                if let Some((first, size)) = self.field.tiles().widest(cell, self.cells, clears) {
                    let (leaves, axis) = self.leaves(first, size);
                    if leaves >= end {
                        return None;
                    }
                    for k in 0..2 {
                        let within = self.cell_at(k, leaves);
                        cell[k] = within.clamp(first[k], first[k] + size[k] - 1);
                    }
                    cell[axis] = if self.rate[axis] > 0.0 {
                        first[axis] + size[axis] - 1
                    } else {
                        first[axis]
                    };
                    if !self.advance(&mut cell, axis) {
                        return None;
                    }
                    (t, over) = (leaves.max(t), Some(1.0));
                    continue;
                }
            }
            let (leaves, axis) = self.leaves(cell, [1, 1]);
            let leaves = leaves.clamp(t, end.max(t));
            let [a, b, c, d] = self.field.cell_heights(cell);
            let highest = a.max(b).max(c).max(d);
            if self.lowest(t, leaves) > f64::from(highest) {
                over = Some(1.0);
            } else if let Some(hit) = self.cross(cell, t, leaves, &mut over) {
                return (hit.distance <= self.reach).then_some(hit);
            }
            if leaves >= end || !self.advance(&mut cell, axis) {
                return None;
            }
            t = leaves;
        }
    }

    /// Column or row at a distance, on the map.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole and within the map
    fn cell_at(&self, k: usize, t: f64) -> usize {
        let local = (self.from[k] + self.rate[k] * t).floor();
        local.clamp(0.0, (self.cells[k] - 1) as f64) as usize
    }

    /// Distance at which the ray leaves a rectangle of cells, and along which axis.
    #[inline]
    fn leaves(&self, first: [usize; 2], size: [usize; 2]) -> (f64, usize) {
        let side = |k: usize| {
            if self.rate[k] > 0.0 {
                ((first[k] + size[k]) as f64 - self.from[k]) * self.pace[k]
            } else if self.rate[k] < 0.0 {
                (first[k] as f64 - self.from[k]) * self.pace[k]
            } else {
                f64::INFINITY
            }
        };
        let (x, z) = (side(0), side(1));
        if x < z { (x, 0) } else { (z, 1) }
    }

    /// To the next cell along an axis; false at the end of the map.
    #[inline]
    fn advance(&self, cell: &mut [usize; 2], axis: usize) -> bool {
        if self.rate[axis] > 0.0 {
            cell[axis] += 1;
            cell[axis] < self.cells[axis]
        } else if cell[axis] > 0 {
            cell[axis] -= 1;
            true
        } else {
            false
        }
    }

    /// Lowest height of the ray between two distances, m.
    #[inline]
    fn lowest(&self, from: f64, to: f64) -> f64 {
        let at = if self.ray.direction.y < 0.0 { to } else { from };
        self.ray.origin.y + self.ray.direction.y * at - self.slack(at)
    }

    /// The crossing of the faces of a cell between two distances. `over`: height of the ray over
    /// the surface at the first, m, if it is known; at the end that at the last.
    fn cross(&self, cell: [usize; 2], t: f64, leaves: f64, over: &mut Option<f64>) -> Option<Hit> {
        let [u, v] = [0, 1].map(|k| self.from[k] - cell[k] as f64);
        let [du, dv] = self.rate;
        let diagonal = (v - u) / (du - dv);
        let turns = diagonal > t && diagonal < leaves;
        let between = if turns { diagonal } else { leaves };
        if let Some(hit) = self.cross_face(cell, t, between, over) {
            return Some(hit);
        }
        if turns {
            self.cross_face(cell, diagonal, leaves, over)
        } else {
            None
        }
    }

    /// The crossing of the face that is under the ray between the distances `t` and `until`, m.
    /// `over`: height of the ray over the surface at `t`, m, if it is known; on return that at
    /// `until`.
    fn cross_face(
        &self,
        cell: [usize; 2],
        t: f64,
        until: f64,
        over: &mut Option<f64>,
    ) -> Option<Hit> {
        let [a, b, c, d] = self.field.cell_heights(cell).map(f64::from);
        let along = |t: f64| [0, 1].map(|k| self.from[k] - cell[k] as f64 + self.rate[k] * t);
        let [u, v] = along(0.5 * (t + until));
        let (half, slope_u, slope_v) = if u >= v {
            (Half::Low, b - a, d - b)
        } else {
            (Half::High, d - c, c - a)
        };
        let height_over = |t: f64| {
            let [u, v] = along(t);
            self.ray.origin.y + self.ray.direction.y * t - (a + u * slope_u + v * slope_v)
        };
        let (begin, end) = (height_over(t), height_over(until));
        if end.is_nan() {
            *over = None;
            return None;
        }
        let was_over = over.unwrap_or(begin) >= 0.0;
        *over = Some(end);
        if was_over == (end >= 0.0) {
            return None;
        }
        let share = begin / (begin - end);
        // Outside where rounding alone has changed the sign.
        let share = if share.is_nan() {
            0.0
        } else {
            share.clamp(0.0, 1.0)
        };
        Some(Hit {
            distance: t + (until - t) * share,
            normal: self.field.face_normal(cell, half)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ray::triangle::Sheared;
    use crate::geometry::terrain::Terrain;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    const ROWS: usize = 23;
    const COLUMNS: usize = 41;
    const SPACING: [f64; 2] = [0.25, 0.5];
    const ORIGIN: [f64; 2] = [-5.0, 1.0];

    /// Distance to the nearest of all triangles.
    fn brute_force(ray: &Ray, field: &HeightField, reach: f64) -> Option<f64> {
        let sheared = Sheared::new(ray);
        let mut nearest: Option<f64> = None;
        for j in 0..ROWS - 1 {
            for i in 0..COLUMNS - 1 {
                let heights = field.cell_heights([i, j]);
                let corner = |k: usize| {
                    let (x, z) = ((i + k % 2) as f64, (j + k / 2) as f64);
                    let y = f64::from(heights[k]);
                    Vector3::new(ORIGIN[0] + x * SPACING[0], y, ORIGIN[1] + z * SPACING[1])
                };
                for corners in [[0, 1, 3], [0, 2, 3]] {
                    let corners = corners.map(corner);
                    if corners.iter().all(|x| x.y.is_finite()) {
                        let found = sheared.distance(&corners, nearest.unwrap_or(reach));
                        nearest = found.or(nearest);
                    }
                }
            }
        }
        nearest
    }

    fn field() -> impl Strategy<Value = HeightField> {
        let height = prop_oneof![10 => -1.0_f32..1.0, 5 => Just(0.25), 1 => Just(f32::NAN)];
        let mix = (
            prop_oneof![Just(0.0_f32), Just(0.1), Just(1.0)],
            -0.1_f32..0.1,
        );
        (prop::collection::vec(height, ROWS * COLUMNS), mix).prop_map(
            |(heights, (rough, slope))| {
                let tilted = |(k, h): (usize, &f32)| h * rough + slope * (k % COLUMNS) as f32;
                let heights = heights.iter().enumerate().map(tilted).collect();
                HeightField::new(heights, [ROWS, COLUMNS], SPACING, ORIGIN).unwrap()
            },
        )
    }

    /// A coordinate, often on a line of the grid.
    fn place() -> impl Strategy<Value = f64> {
        prop_oneof![4 => -7.0..14.0, 1 => (-28_i32..56).prop_map(|k| 0.25 * f64::from(k))]
    }

    fn direction() -> impl Strategy<Value = [f64; 3]> {
        let entry = || prop_oneof![4 => -1.0..1.0, 1 => Just(0.0), 1 => Just(1.0)];
        let steep = prop_oneof![1 => Just(1.0), 1 => 0.0..0.2];
        ([entry(), entry(), entry()], steep).prop_map(|([x, y, z], rise)| [x, y * rise, z])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(600))]
        #[test]
        fn finds_what_looking_at_all_triangles_finds(
            field in field(), x in place(), y in -2.0..4.0, z in place(), direction in direction(),
            reach in prop_oneof![1 => 0.1..20.0, 2 => Just(f64::INFINITY)],
        ) {
            let Some(ray) = Ray::new(Vector3::new(x, y, z), direction.into()) else { return Ok(()) };
            let (found, expected) = (field.first_hit(&ray, reach), brute_force(&ray, &field, reach));
            match (found, expected) {
                (Some(hit), Some(distance)) if (hit.distance - distance).abs() < 1e-9 * (1.0 + distance) => {
                    prop_assert!((hit.normal.norm() - 1.0).abs() < 1e-12 && hit.normal.y > 0.0);
                }
                (None, None) => {}
                // One of the two may miss where the ray grazes a face or begins on it.
                (found, expected) => {
                    let first = found.map_or(f64::INFINITY, |hit| hit.distance);
                    let first = first.min(expected.unwrap_or(f64::INFINITY));
                    let shifted = |by: f64| {
                        let moved = Ray { origin: ray.origin + Vector3::new(by, 1.7 * by, -0.6 * by), ..ray };
                        brute_force(&moved, &field, reach).unwrap_or(f64::INFINITY)
                    };
                    let nearby = [-1e-6, -1e-7, 1e-7, 1e-6].map(shifted);
                    let differs = |t: &f64| {
                        let apart = (t - nearby[0]).abs();
                        apart >= 1e-4 || apart.is_nan()
                    };
                    let is_grazing = first < 1e-6 || nearby.iter().any(differs);
                    prop_assert!(is_grazing, "{found:?} {expected:?} {nearby:?}");
                }
            }
        }

        #[test]
        fn no_ray_from_above_slips_through_between_two_cells(
            heights in prop::collection::vec(-1.0_f32..1.0, ROWS * COLUMNS),
            u in 0..=40_i32, v in 0..=22_i32, from in prop::array::uniform2(0.01..0.99), is_vertical in any::<bool>(),
        ) {
            let field = HeightField::new(heights, [ROWS, COLUMNS], SPACING, ORIGIN).unwrap();
            let corner = Vector3::new(-5.0 + 0.25 * f64::from(u), -1.5, 1.0 + 0.5 * f64::from(v));
            let [x, z] = from;
            let from = if is_vertical {
                Vector3::new(corner.x, 3.0, corner.z)
            } else {
                Vector3::new(-5.0 + 10.0 * x, 3.0, 1.0 + 11.0 * z)
            };
            // Down to a place below a corner: on the way it may cross many lines at once.
            let ray = Ray::new(from, corner - from).unwrap();
            let hit = field.first_hit(&ray, f64::INFINITY);
            let place = hit.map(|hit| ray.at(hit.distance)).unwrap();
            let height = field.height(place.x.clamp(-5.0, 5.0), place.z.clamp(1.0, 12.0)).unwrap();
            prop_assert!((height - place.y).abs() < 1e-9);
        }
    }

    #[test]
    fn a_ray_over_a_hole_goes_through_it() {
        let mut heights = vec![0.0; ROWS * COLUMNS];
        heights[10 * COLUMNS + 20] = f32::NAN;
        let field = HeightField::new(heights, [ROWS, COLUMNS], SPACING, ORIGIN).unwrap();
        let down = |x: f64, z: f64| {
            let ray = Ray::new(Vector3::new(x, 2.0, z), -Vector3::y()).unwrap();
            field.first_hit(&ray, 5.0).map(|hit| hit.distance)
        };
        assert_eq!(down(0.05, 6.1), None);
        assert_eq!(down(1.05, 6.1), Some(2.0));
        // Over the hole and on to the ground behind it.
        let slanted = Ray::new(Vector3::new(-1.0, 0.3, 6.0), Vector3::new(1.0, -0.2, 0.0)).unwrap();
        let hit = field.first_hit(&slanted, 5.0).unwrap();
        assert!((slanted.at(hit.distance).x - 0.5).abs() < 1e-9);
    }
}
