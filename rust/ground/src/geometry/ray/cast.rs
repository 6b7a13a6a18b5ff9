//! Many rays at once.

use nalgebra::Vector3;

use super::error::RayError;
use super::{Hit, Ray};
use crate::geometry::terrain::Terrain;
use crate::geometry::terrain::limits::MAX_SIZE;

/// Rays from origins (n, 3), m, along directions (n, 3) of any length, for distances up to `range`
/// (m, may be infinite).
///
/// # Errors
/// `MismatchedLengths`, `NotFinite`, `TooFar`, `NoDirection`, `BadRange`.
pub fn check_rays(
    origins: &[[f64; 3]],
    directions: &[[f64; 3]],
    range: f64,
) -> Result<Vec<Ray>, RayError> {
    if origins.len() != directions.len() {
        return Err(RayError::MismatchedLengths {
            origins: origins.len(),
            directions: directions.len(),
        });
    }
    let is_range = range > 0.0;
    if !is_range {
        return Err(RayError::BadRange { value: range });
    }
    let finite = |field, index, row: &[f64; 3]| match row.iter().find(|x| !x.is_finite()) {
        Some(&value) => Err(RayError::NotFinite {
            field,
            index,
            value,
        }),
        None => Ok(Vector3::from(*row)),
    };
    let pairs = origins.iter().zip(directions).enumerate();
    pairs
        .map(|(index, (origin, direction))| {
            let origin = finite("origins", index, origin)?;
            if origin.amax() > MAX_SIZE {
                return Err(RayError::TooFar {
                    index,
                    value: origin.amax(),
                    limit: MAX_SIZE,
                });
            }
            let direction = finite("directions", index, direction)?;
            Ray::new(origin, direction).ok_or(RayError::NoDirection { index })
        })
        .collect()
}

/// What each ray meets first within `range` (m).
#[must_use]
pub fn cast(terrain: &dyn Terrain, rays: &[Ray], range: f64) -> Vec<Option<Hit>> {
    rays.iter()
        .map(|ray| terrain.first_hit(ray, range))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ray::triangle::Sheared;
    use crate::geometry::terrain::{Plane, SphereField, TriangleMesh, Union};
    use proptest::prelude::*;
    use std::sync::Arc;

    /// A closed mesh: a ball of triangles, every corner moved in or out.
    fn stone(radii: &[f64]) -> TriangleMesh {
        let (around, down) = (12_u32, 7_u32);
        let mut corners = vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
        for j in 1..down {
            for i in 0..around {
                let (polar, azimuth) = (
                    std::f64::consts::PI * f64::from(j) / f64::from(down),
                    std::f64::consts::TAU * f64::from(i) / f64::from(around),
                );
                let (x, z) = (polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin());
                corners.push([x, polar.cos(), z]);
            }
        }
        for (corner, radius) in corners.iter_mut().zip(radii) {
            *corner = corner.map(|x| x * radius);
        }
        let (around, down) = (around as usize, down as usize);
        let at = |j: usize, i: usize| 2 + (j - 1) * around + i % around;
        let mut triangles = Vec::new();
        for i in 0..around {
            triangles.push([0, at(1, i + 1), at(1, i)]);
            triangles.push([1, at(down - 1, i), at(down - 1, i + 1)]);
            for j in 1..down - 1 {
                triangles.push([at(j, i), at(j, i + 1), at(j + 1, i)]);
                triangles.push([at(j, i + 1), at(j + 1, i + 1), at(j + 1, i)]);
            }
        }
        TriangleMesh::new(&corners, &triangles).unwrap()
    }

    proptest! {
        #[test]
        fn of_a_mesh_the_nearest_triangle_is_met_and_none_leaves_it_unseen(
            radii in prop::collection::vec(0.5..1.5, 74), inside in prop::array::uniform3(-0.2..0.2),
            outside in prop::array::uniform3(-4.0..4.0), to_corner in 0_usize..74,
        ) {
            let mesh = stone(&radii);
            let corners = |t: &[u32; 3]| t.map(|v| mesh.vertices()[v as usize]);
            let inside = Vector3::from(inside);
            // Straight through a corner of six triangles, and past or through the stone.
            let exit = Ray::new(inside, mesh.vertices()[to_corner] - inside).unwrap();
            let past = Ray::new(outside.into(), inside - Vector3::from(outside)).unwrap();
            prop_assert!(mesh.first_hit(&exit, 5.0).is_some());
            for ray in [exit, past, Ray { direction: -past.direction, ..past }] {
                let sheared = Sheared::new(&ray);
                let all = mesh.triangles().iter().filter_map(|t| sheared.distance(&corners(t), 9.0));
                let found = mesh.first_hit(&ray, 9.0).map(|hit| hit.distance);
                // Of triangles that meet in one place any may answer, each with its own rounding.
                match (found, all.reduce(f64::min)) {
                    (Some(found), Some(nearest)) => prop_assert!((found - nearest).abs() < 1e-12),
                    (found, nearest) => prop_assert_eq!(found, nearest),
                }
            }
        }

        #[test]
        fn of_several_grounds_the_nearest_is_met(
            origin in prop::array::uniform3(-3.0..3.0), direction in prop::array::uniform3(-1.0..1.0),
        ) {
            let plane = Arc::new(Plane::new([0.1, 1.0, 0.0], 0.5).unwrap());
            let field = Arc::new(SphereField::new(&[[1.5, 0.0, 0.0], [0.0, 0.0, 2.0]], &[0.5, 1.0], None).unwrap());
            let mesh = Arc::new(stone(&[0.8; 74]));
            let parts: [Arc<dyn Terrain>; 3] = [mesh, field, plane];
            let union = Union::new(parts.to_vec()).unwrap();
            let Some(ray) = Ray::new(origin.into(), direction.into()) else { return Ok(()) };
            let each = parts.iter().filter_map(|part| part.first_hit(&ray, 10.0));
            let nearest = each.map(|hit| hit.distance).reduce(f64::min);
            prop_assert_eq!(union.first_hit(&ray, 10.0).map(|hit| hit.distance), nearest);
        }
    }

    #[test]
    fn directions_of_any_length_measure_metres() {
        let places = [[0.0, 2.0, 0.0]; 4];
        let directions = [
            [0.0, -1e-300, 0.0],
            [0.0, -1e300, 0.0],
            [1e-200, -3.0, 0.0],
            [0.0, 1.0, 0.0],
        ];
        let rays = check_rays(&places, &directions, f64::INFINITY).unwrap();
        let hits = cast(&Plane::ground(), &rays, f64::INFINITY);
        for hit in &hits[..3] {
            assert!((hit.unwrap().distance - 2.0).abs() < 1e-15);
        }
        assert!(hits[3].is_none());
        let short = cast(&Plane::ground(), &rays, 1.9);
        assert!(short.iter().all(Option::is_none));
    }
}
