//! No place and no attitude is without a contact, and none has a false one.

use std::f64::consts::TAU;
use std::sync::Arc;

use proptest::prelude::*;
use rover_core::contact::detection::{deepest_overlap, disc_gap};
use rover_core::geometry::{Disc, HeightField, Terrain, TriangleMesh};
use rover_core::multibody::{Configuration, Kinematics, Model};
use rover_core::nalgebra::{UnitQuaternion, Vector3};

use super::surface_scenes::{disc, map, rough};

const RADIUS: f64 = 0.15;

/// By how much a disc must be lifted to be free of the ground: as [`lift`], and from the points of
/// its flat at the places of the map's vertices.
fn lift_flat(disc: &Disc, field: &HeightField) -> f64 {
    let ([nx, nz], [dx, dz], [x0, z0]) = (field.shape(), field.spacing(), field.origin());
    let mut most = lift(disc, field);
    for k in 0..nx * nz {
        let (i, j) = (k % nx, k / nx);
        let (x, z) = (x0 + dx * i as f64, z0 + dz * j as f64);
        // The point of the disc's plane over or under the vertex.
        let s = &disc.axle;
        let y = disc.centre.y - (s.x * (x - disc.centre.x) + s.z * (z - disc.centre.z)) / s.y;
        if (Vector3::new(x, y, z) - disc.centre).norm() < disc.radius {
            most = most.max(f64::from(field.heights()[k]) - y);
        }
    }
    most
}

/// By how much a disc must be lifted to be free of the ground, from many points of its rim.
fn lift(disc: &Disc, field: &HeightField) -> f64 {
    let side = disc.axle.cross(&disc.spoke);
    let over = |phi: f64| {
        let x = disc.centre + (disc.spoke * phi.cos() + side * phi.sin()) * disc.radius;
        field
            .height(x.x, x.z)
            .map_or(f64::NEG_INFINITY, |y| y - x.y)
    };
    let n = 20_000;
    (0..n)
        .map(|k| over(TAU * f64::from(k) / f64::from(n)))
        .fold(f64::NEG_INFINITY, f64::max)
}

fn wheel(field: &HeightField, [x, z, heading, lean]: [f64; 4]) -> Disc {
    let [dx, dz] = field.spacing();
    let turn = UnitQuaternion::from_euler_angles(lean, 0.0, 0.0);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading) * turn;
    Disc {
        centre: Vector3::new(2.0 * x * dx, 0.0, 2.0 * z * dz),
        axle: turn * Vector3::z(),
        spoke: turn * Vector3::x(),
        radius: RADIUS.min(2.5 * dx),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// The lowest point of all, wherever it is, is found: lifted free the gap is zero, and
    /// sunk in there is a contact that is about as deep.
    #[test]
    fn a_wheel_always_has_the_contact_that_holds_it(
        field in rough(0.01..0.12),
        x in -1.0..1.0, z in -1.0..1.0, heading in 0.0..TAU, lean in -0.5..0.5,
        depth in prop_oneof![Just(0.0), 1e-6..1e-3, 1e-3..1e-2],
    ) {
        let mut disc = wheel(&field, [x, z, heading, lean]);
        disc.centre.y += lift(&disc, &field) - depth;
        let gap = disc_gap(&disc, &Vector3::zeros(), &field);
        // The rim was sampled: the lift is too small by the rim's arc or the slope's rise there.
        let coarse = 2e-4;
        prop_assert!(gap < coarse, "{gap}");
        // A wheel sunk deeper than the bumps are high has points under several faces, and one may
        // push by more than the lift that frees them all.
        let most = if depth < 1e-3 { depth } else { 1.5 * depth };
        prop_assert!(gap > -most - coarse, "{gap} {depth}");
        if depth > 1e-3 {
            // A slope of at most about 80 degrees takes this share of the depth.
            prop_assert!(gap < -0.05 * depth + coarse, "{gap} {depth}");
        }
    }

    /// Slopes of up to 80 degrees: the flat of a wheel that leans may be all that touches.
    #[test]
    fn a_wheel_on_needles_has_a_contact(
        field in rough(0.5..2.5),
        x in -1.0..1.0, z in -1.0..1.0, heading in 0.0..TAU, lean in -0.5..0.5,
        depth in 1e-6..5e-5,
    ) {
        let mut disc = wheel(&field, [x, z, heading, lean]);
        disc.centre.y += lift_flat(&disc, &field) - depth;
        let gap = disc_gap(&disc, &Vector3::zeros(), &field);
        prop_assert!(gap < 0.0, "{gap} {depth}");
    }

    /// Of two descriptions of a place far from the origin and near it the second is exact.
    #[test]
    fn a_wheel_that_is_clear_has_no_contact(
        field in rough(0.01..0.12),
        x in -1.0..1.0, z in -1.0..1.0, heading in 0.0..TAU, lean in -0.5..0.5, clear in 1e-3..0.2,
    ) {
        let mut disc = wheel(&field, [x, z, heading, lean]);
        disc.centre.y += lift(&disc, &field) + clear;
        prop_assert!(disc_gap(&disc, &Vector3::zeros(), &field) > 0.0);
    }
}

/// One free body.
fn body(shape: &str) -> Model {
    crate::shared::body(3.0, &format!("collides = true\n{shape}"))
}

fn overlap(model: &Model, field: &HeightField, q: &Configuration) -> f64 {
    deepest_overlap(model, &Kinematics::of(model, q), field)
}

/// Lowest height of the body at which it is free of the ground, from points on its surface.
fn free_height(points: &[Vector3<f64>], q: &Configuration, field: &HeightField) -> f64 {
    let over = |x: &Vector3<f64>| {
        let x = q.position + q.attitude * x;
        field
            .height(x.x, x.z)
            .map_or(f64::NEG_INFINITY, |y| y - x.y)
    };
    q.position.y + points.iter().map(over).fold(f64::NEG_INFINITY, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn a_ball_and_a_box_always_have_the_contact_that_holds_them(
        field in rough(0.01..0.12), x in -1.0..1.0, z in -1.0..1.0, turn in prop::array::uniform3(-3.0..3.0),
    ) {
        let [dx, dz] = field.spacing();
        let size = 2.0 * dx.min(0.1);
        let n = 60;
        let grid = move |k: u32| -1.0 + 2.0 * f64::from(k) / f64::from(n);
        let mut faces = Vec::new();
        for i in 0..=n {
            for j in 0..=n {
                for side in [-1.0, 1.0] {
                    let (a, b) = (grid(i), grid(j));
                    faces.extend([[a, b, side], [a, side, b], [side, a, b]].map(Vector3::from));
                }
            }
        }
        let ball: Vec<_> = faces.iter().map(|x| x.normalize() * (0.5 * size)).collect();
        let block: Vec<_> = faces.iter().map(|x| x * (0.5 * size)).collect();
        let shapes = [
            (format!("shape = {{ kind = \"sphere\", radius = {} }}", 0.5 * size), ball),
            (format!("shape = {{ kind = \"box\", size = [{size}, {size}, {size}] }}"), block),
        ];
        for (shape, points) in shapes {
            let model = body(&shape);
            let mut q = Configuration::zero(&model);
            q.position = Vector3::new(2.0 * x * dx, 0.0, 2.0 * z * dz);
            q.attitude = UnitQuaternion::from_euler_angles(turn[0], turn[1], turn[2]);
            let free = free_height(&points, &q, &field);
            let coarse = 0.1 * size;
            q.position.y = free + coarse;
            prop_assert!(overlap(&model, &field, &q) >= 0.0, "{shape}");
            q.position.y = free - 1e-3;
            let depth = -overlap(&model, &field, &q);
            prop_assert!(depth > 1e-5 && depth < 1e-3 + coarse, "{shape} {depth}");
        }
    }
}

#[test]
fn the_far_side_of_a_ridge_does_not_push() {
    // A ridge along z; the wheel stands beside it and touches nothing.
    let field = map(40, 0.1, |x, _| if x.abs() < 0.05 { 1.0 } else { 0.0 });
    for side in [-1.0, 1.0] {
        let disc = disc(Vector3::new(side * 0.5, 0.3, 0.02), Vector3::z(), 0.25);
        let terrain: Arc<dyn Terrain> = Arc::new(field.clone());
        let gap = disc_gap(&disc, &Vector3::zeros(), &*terrain);
        assert!((gap - 0.05).abs() < 1e-12, "{gap}");
    }
}

/// A long prism along z with its sharp crest at the origin, a slope of 1:4 towards negative x and a
/// wall that leans over the far side.
fn prism() -> TriangleMesh {
    let corners = [[0.0, 0.0], [-4.0, -1.0], [-0.3, -1.0]];
    let vertices: Vec<[f64; 3]> = [-3.0, 3.0]
        .iter()
        .flat_map(|&z| corners.map(|[x, y]| [x, y, z]))
        .collect();
    let mut triangles = vec![[0, 2, 1], [3, 4, 5]];
    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
        triangles.extend([[a, b, a + 3], [b, b + 3, a + 3]]);
    }
    TriangleMesh::new(&vertices, &triangles).unwrap()
}

#[test]
fn a_sharp_crest_pushes_wherever_it_is_touched() {
    let prism = prism();
    assert!(prism.is_closed());
    let stone = body("shape = { kind = \"sphere\", radius = 0.2 }");
    // From the normal of the slope, at 104 degrees, to that of the wall, at -17 degrees.
    for k in 0..=10 {
        let phi = 1.75 - 0.198 * f64::from(k);
        let n = Vector3::new(phi.cos(), phi.sin(), 0.0);
        for depth in [1e-6, 1e-4, 1e-2] {
            let mut q = Configuration::zero(&stone);
            q.position = n * (0.2 - depth);
            let gap = deepest_overlap(&stone, &Kinematics::of(&stone, &q), &prism);
            assert!((gap + depth).abs() < 1e-12, "ball {phi} {depth} {gap}");
            let disc = disc(q.position, Vector3::z(), 0.2);
            let gap = disc_gap(&disc, &Vector3::zeros(), &prism);
            assert!((gap + depth).abs() < 1e-12, "wheel {phi} {depth} {gap}");
        }
    }
}
