//! The rover's terrains under balls.

use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;

use super::{Facing, Support};
use crate::geometry::query::{sphere_sphere, sphere_triangle};
use crate::geometry::{Primitive, Sphere, Terrain};

/// A terrain as a ground of balls.
///
/// Planes and spheres carry a ball each on its own, at any depth within the terrain's search. Of a
/// surface, faces, convex edges and convex vertices carry it from the free side; from inside, only
/// the nearest face does. Where a terrain knows no ground a ball falls.
#[derive(Clone)]
pub struct TerrainSupport(Arc<dyn Terrain>);

impl TerrainSupport {
    /// The ground that `terrain` is.
    #[must_use]
    pub fn new(terrain: Arc<dyn Terrain>) -> Self {
        Self(terrain)
    }

    /// The terrain.
    #[must_use]
    pub fn terrain(&self) -> &Arc<dyn Terrain> {
        &self.0
    }
}

impl fmt::Debug for TerrainSupport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n = self.0.n_primitives();
        write!(f, "TerrainSupport({n} primitives)")
    }
}

impl Support<3> for TerrainSupport {
    fn facing(&self, centre: &Vector3<f64>, reach: f64, out: &mut Vec<Facing<3>>) {
        let at = |n: &Vector3<f64>, distance: f64| Facing {
            foot: centre - n * distance,
            n: *n,
            distance,
        };
        let here = Sphere::new(*centre, 0.0);
        let base = Vector3::zeros();
        let terrain = &*self.0;
        let mut within: Option<Facing<3>> = None;
        terrain.visit_near(centre, reach, &mut |id, primitive| {
            let found = match primitive {
                Primitive::Plane(plane) => Some(at(plane.normal(), plane.distance(centre))),
                Primitive::Sphere(sphere) => {
                    let near = sphere_sphere::nearest_point(&here, sphere, &base);
                    Some(at(&near.n, near.gap))
                }
                Primitive::Face(face) => {
                    let facing = at(face.plane.normal(), face.plane.distance(centre));
                    let is_over = face.admits(&facing.foot);
                    if is_over && facing.distance < 0.0 && terrain.is_inside(id, centre) {
                        let is_nearest = within.is_none_or(|w| facing.distance > w.distance);
                        within = if is_nearest { Some(facing) } else { within };
                    }
                    (is_over && facing.distance >= 0.0).then_some(facing)
                }
                Primitive::Edge(edge) => sphere_triangle::point_at_edge(&here, edge, &base)
                    .map(|near| at(&near.n, near.gap))
                    .filter(|facing| facing.distance > 0.0),
                Primitive::Vertex(vertex) => {
                    let near = sphere_triangle::nearest_at_vertex(&here, vertex, &base);
                    vertex.admits(&near.n).then(|| at(&near.n, near.gap))
                }
            };
            out.extend(found.filter(|facing| facing.distance <= reach));
        });
        out.extend(within);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{HeightField, Plane, SphereField, TriangleMesh};

    fn facing(terrain: impl Terrain + 'static, centre: [f64; 3], reach: f64) -> Vec<Facing<3>> {
        let mut out = Vec::new();
        let support = TerrainSupport::new(Arc::new(terrain));
        support.facing(&centre.into(), reach, &mut out);
        out
    }

    /// Heights of a valley or ridge along z with slopes of 45 degrees, its bottom or top at x = 0.
    fn folded(sign: f32) -> HeightField {
        let heights = [1.0, 0.0, 1.0].repeat(3).iter().map(|h| sign * h).collect();
        HeightField::new(heights, [3, 3], [1.0, 1.0], [-1.0, -1.0]).expect("a map")
    }

    #[test]
    fn a_plane_and_a_rock_on_it_carry_a_ball_together() {
        let field = SphereField::new(&[[0.0, 0.0, 0.0]], &[0.5], Some(Plane::ground())).unwrap();
        let found = facing(field, [0.6, 0.1, 0.0], 0.2);
        assert_eq!(found.len(), 2);
        let rock = Vector3::new(0.6, 0.1, 0.0);
        for (facing, n, distance) in [
            (found[0], Vector3::y(), 0.1),
            (found[1], rock.normalize(), rock.norm() - 0.5),
        ] {
            assert!((facing.n - n).norm() < 1e-12 && (facing.distance - distance).abs() < 1e-12);
            let back = facing.foot + facing.n * facing.distance;
            assert!((back - rock).norm() < 1e-12);
        }
    }

    #[test]
    fn both_slopes_of_a_valley_carry_a_ball_and_the_edge_of_a_ridge_alone() {
        let down = std::f64::consts::FRAC_1_SQRT_2;
        let found = facing(folded(1.0), [0.0, 0.3, 0.25], 0.3);
        assert_eq!(found.len(), 2, "{found:?}");
        for side in &found {
            assert!((side.distance - 0.3 * down).abs() < 1e-12);
            assert!((side.n.x.abs() - down).abs() < 1e-12 && (side.n.y - down).abs() < 1e-12);
        }
        let found = facing(folded(-1.0), [0.0, 0.3, 0.25], 0.4);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].n - Vector3::y()).norm() < 1e-12);
        assert!((found[0].distance - 0.3).abs() < 1e-12);
    }

    #[test]
    fn the_corner_of_a_mesh_carries_a_ball_and_from_inside_its_nearest_face_does() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let mesh = TriangleMesh::new(&vertices, &triangles).expect("a mesh");
        let found = facing(mesh.clone(), [0.05, 1.1, 0.05], 0.3);
        assert_eq!(found.len(), 1, "{found:?}");
        let away = Vector3::new(0.05, 0.1, 0.05);
        assert!((found[0].n - away.normalize()).norm() < 1e-12);
        assert!((found[0].foot - Vector3::y()).norm() < 1e-12);
        let found = facing(mesh, [0.1, 0.2, 0.3], 0.3);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0].n + Vector3::x()).norm() < 1e-12);
        assert!((found[0].distance + 0.1).abs() < 1e-12);
    }

    #[test]
    fn nothing_carries_a_ball_beyond_the_map() {
        assert!(facing(folded(1.0), [5.0, 0.1, 0.0], 0.3).is_empty());
    }
}
