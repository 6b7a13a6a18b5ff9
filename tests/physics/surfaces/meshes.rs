//! Rocks as triangle meshes.

use std::sync::Arc;

use rover_core::contact::detection::disc_gap;
use rover_core::geometry::{HeightField, Plane, Terrain, TriangleMesh, Union};
use rover_core::integrator::Variant;
use rover_core::nalgebra::Vector3;

use super::surface_scenes::{disc, map};
use crate::shared::stepping;
use crate::spheres::sphere_scenes::{deepest, lone_wheel, placed};

/// An octahedron's faces, cut n times and blown up to a ball.
pub fn ball(radius: f64, cuts: usize, centre: Vector3<f64>) -> TriangleMesh {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let mut vertices: Vec<Vector3<f64>> = [axes, axes.map(|axis| -axis)].concat();
    let mut triangles: Vec<[usize; 3]> = vec![
        [0, 1, 2],
        [1, 3, 2],
        [3, 4, 2],
        [4, 0, 2],
        [1, 0, 5],
        [3, 1, 5],
        [4, 3, 5],
        [0, 4, 5],
    ];
    for _ in 0..cuts {
        let mut middle = std::collections::HashMap::new();
        let mut cut = Vec::new();
        for [a, b, c] in triangles {
            let mut half = |i: usize, j: usize| {
                *middle.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    vertices.push((vertices[i] + vertices[j]).normalize());
                    vertices.len() - 1
                })
            };
            let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
            cut.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = cut;
    }
    let vertices: Vec<[f64; 3]> = vertices
        .iter()
        .map(|v| (centre + v * radius).into())
        .collect();
    TriangleMesh::new(&vertices, &triangles).unwrap()
}

#[test]
fn a_fine_mesh_of_a_ball_is_met_as_the_ball() {
    let mesh = ball(0.4, 4, Vector3::new(0.1, 0.2, -0.1));
    assert!(mesh.is_closed());
    for k in 0..200 {
        let s = f64::from(k);
        let axle = Vector3::new(s.sin(), 0.4 * (2.0 * s).sin(), s.cos()).normalize();
        let out = Vector3::new((3.0 * s).cos(), (0.7 * s).sin(), (5.0 * s).sin()).normalize();
        let disc = disc(Vector3::new(0.1, 0.2, -0.1) + out * 0.65, axle, 0.2);
        let stone = rover_core::geometry::SphereField::new(&[[0.1, 0.2, -0.1]], &[0.4], None);
        let expected = disc_gap(&disc, &Vector3::zeros(), &stone.unwrap());
        let gap = disc_gap(&disc, &Vector3::zeros(), &mesh);
        // The mesh lies inside the ball by up to 2 mm.
        assert!(
            (-1e-6..2.5e-3).contains(&(gap - expected)),
            "{k}: {gap} {expected}"
        );
    }
    assert!((mesh.height(0.1, -0.1).unwrap() - 0.6).abs() < 2e-3);
    assert!(mesh.height(0.6, -0.1).is_none());
}

#[test]
fn a_mesh_of_a_map_is_the_map() {
    let wave = |x: f64, z: f64| 0.05 * (4.0 * x).sin() + 0.03 * (5.0 * z + x).cos();
    let field = map(20, 0.1, wave);
    let at = |i: usize, j: usize| {
        let [x, z] = [i, j].map(|k| -1.0 + 0.1 * k as f64);
        [x, f64::from(field.heights()[j * 21 + i]), z]
    };
    let vertices: Vec<[f64; 3]> = (0..441).map(|k| at(k % 21, k / 21)).collect();
    let mut triangles = Vec::new();
    for j in 0..20 {
        for i in 0..20 {
            let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(u, v)| (j + v) * 21 + i + u);
            triangles.extend([[a, d, b], [a, c, d]]);
        }
    }
    let mesh = TriangleMesh::new(&vertices, &triangles).unwrap();
    assert!(!mesh.is_closed());
    for k in 0..300 {
        let s = f64::from(k);
        let (x, z) = (0.6 * (1.3 * s).sin(), 0.6 * (0.9 * s).cos());
        let axle = Vector3::new(s.sin(), 0.2 * (2.0 * s).sin(), s.cos()).normalize();
        let height = wave(x, z) + 0.15 + 0.05 * s.sin();
        let disc = disc(Vector3::new(x, height, z), axle, 0.15);
        let [a, b] = [&field as &dyn Terrain, &mesh].map(|t| disc_gap(&disc, &Vector3::zeros(), t));
        assert!((a - b).abs() < 1e-12, "{k}: {a} {b}");
        let [a, b] = [field.height(x, z).unwrap(), mesh.height(x, z).unwrap()];
        assert!((a - b).abs() < 1e-12);
    }
}

#[test]
fn a_wheel_lands_on_a_rock_that_lies_on_a_map() {
    for phase in 0..8 {
        let flat: Arc<HeightField> = Arc::new(map(40, 0.2, |_, _| 0.0));
        let rock: Arc<TriangleMesh> = Arc::new(ball(0.15, 2, Vector3::new(0.0, 0.05, 0.0)));
        let both = Union::new(vec![flat, rock]).unwrap();
        let options = stepping(Variant::default(), 0.02);
        let phase = f64::from(phase);
        let start = Vector3::new(0.01 * phase, 2.0 + 0.013 * phase, 0.003);
        let mut wheel = placed(lone_wheel(), both, options, start);
        wheel.step(33).unwrap();
        let y = wheel.q().position.y;
        assert!(
            y > 0.2 && deepest(&wheel) > -0.02,
            "{phase}: {y} {}",
            deepest(&wheel)
        );
    }
}

#[test]
fn unions_number_their_pieces_and_take_one_plane() {
    let plane = || Arc::new(Plane::ground()) as Arc<dyn Terrain>;
    let rock = || Arc::new(ball(0.3, 1, Vector3::new(0.2, 0.0, 0.0))) as Arc<dyn Terrain>;
    let union = Union::new(vec![rock(), plane(), rock()]).unwrap();
    assert!(union.ground().is_some());
    let mut seen = Vec::new();
    union.visit_near(&Vector3::new(0.3, 0.4, 0.0), 0.3, &mut |id, primitive| {
        assert_eq!(*primitive, union.primitive(id));
        seen.push(id);
    });
    assert_eq!(seen[0], 0);
    let count = seen.len();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), count);
    assert!(seen.iter().all(|&id| id < union.n_primitives()));
    let error = Union::new(vec![plane(), plane()]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "parts[1]: is a second plane; a union can have only one"
    );
    assert_eq!(Union::new(vec![]).unwrap_err().field(), "parts");
}
