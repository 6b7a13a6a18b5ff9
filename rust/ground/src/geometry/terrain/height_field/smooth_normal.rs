//! Normals that change smoothly over a height field, for its shading (Gouraud 1971).

use nalgebra::Vector3;

use super::{HeightField, Place, narrow};
use crate::geometry::terrain::Terrain;

/// How far above the surface a place on it may seem to be by rounding, m.
const SURFACE: f64 = 1e-6;

impl HeightField {
    /// Unit normal at a place on the surface (world, m), interpolated between the corners of its
    /// cell; none elsewhere, and where a height is missing.
    pub(super) fn smooth_normal_at(&self, place: &Vector3<f64>) -> Option<Vector3<f64>> {
        let height = self.height(place.x, place.z)?;
        if (height - place.y).abs() > SURFACE * (1.0 + place.amax()) {
            return None;
        }
        let ([i, j], [u, v]) = self.cell_at(place.x, place.z)?;
        let mut slope = [0.0; 2];
        for (di, of_column) in [(0, 1.0 - u), (1, u)] {
            for (dj, of_row) in [(0, 1.0 - v), (1, v)] {
                let corner = self.slope_at([narrow(i) + di, narrow(j) + dj])?;
                slope = std::array::from_fn(|k| slope[k] + of_column * of_row * corner[k]);
            }
        }
        Some(Vector3::new(-slope[0], 1.0, -slope[1]).normalize())
    }

    /// Slope of the surface along x and z at a corner, from the corners beside it.
    fn slope_at(&self, [i, j]: Place) -> Option<[f64; 2]> {
        let here = self.corner([i, j]);
        let between = |before: f64, after: f64, spacing: f64| {
            let steps = [here - before, after - here].map(|step| step / spacing);
            let known = steps.iter().filter(|step| step.is_finite());
            let (n, sum) = known.fold((0.0, 0.0), |(n, sum), step| (n + 1.0, sum + step));
            (n > 0.0).then(|| sum / n)
        };
        let [dx, dz] = self.spacing;
        Some([
            between(self.corner([i - 1, j]), self.corner([i + 1, j]), dx)?,
            between(self.corner([i, j - 1]), self.corner([i, j + 1]), dz)?,
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(height: impl Fn(f32, f32) -> f32) -> HeightField {
        let heights = (0..25).map(|k| height((k % 5) as f32, (k / 5) as f32));
        HeightField::new(heights.collect(), [5, 5], [1.0, 1.0], [0.0, 0.0]).unwrap()
    }

    fn normal(field: &HeightField, x: f64, z: f64) -> Option<Vector3<f64>> {
        let y = field.height(x, z)?;
        field.smooth_normal(&Vector3::new(x, y, z))
    }

    #[test]
    fn a_tilted_map_has_the_normal_of_its_plane_to_its_border() {
        let tilted = field(|x, z| 0.5 * x - 0.25 * z);
        let expected = Vector3::new(-0.5, 1.0, 0.25).normalize();
        for (x, z) in [(0.1, 0.2), (2.3, 1.7), (3.9, 3.95)] {
            assert!((normal(&tilted, x, z).unwrap() - expected).norm() < 1e-6);
        }
        assert!(tilted.smooth_normal(&Vector3::new(1.0, 9.0, 1.0)).is_none());
    }

    #[test]
    fn it_is_the_same_on_both_sides_of_a_line_of_the_grid() {
        let ridge = field(|x, _| if (1.5..2.5).contains(&x) { 1.0 } else { 0.0 });
        let [left, right] = [2.0 - 1e-9, 2.0 + 1e-9].map(|x| normal(&ridge, x, 1.5).unwrap());
        assert!((left - right).norm() < 1e-6 && (left - Vector3::y()).norm() < 1e-6);
        let hole = field(|x, z| if x > 2.5 && z > 2.5 { f32::NAN } else { 0.0 });
        assert!((normal(&hole, 2.1, 1.9).unwrap() - Vector3::y()).norm() < 1e-12);
    }
}
