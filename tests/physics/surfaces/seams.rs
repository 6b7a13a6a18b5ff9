//! Grounds in parts: where these meet, lie in each other, or end.

use std::sync::Arc;

use rover_core::geometry::{Coverage, HeightField, Plane, Terrain, TriangleMesh, Union};
use rover_core::integrator::StepOptions;
use rover_core::law::materials::{MaterialPair, Materials};
use rover_core::multibody::{Configuration, Model};
use rover_core::nalgebra::{Rotation3, UnitQuaternion, Vector3};
use rover_core::simulation::RoverSimulation;

use super::surface_scenes::{map, rover_on};
use crate::shared::{body, moving, near_in, resting};

const GRAVITY: f64 = 9.81;
const FRICTION: f64 = 0.3;

/// A rectangle of two triangles, turned about z.
fn sheet(from: f64, to: f64, turn: f64) -> TriangleMesh {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
    let corner = |x: f64, z: f64| (turn * Vector3::new(x, 0.0, z)).into();
    let corners = [
        corner(from, -5.0),
        corner(to, -5.0),
        corner(to, 5.0),
        corner(from, 5.0),
    ];
    TriangleMesh::new(&corners, &[[0, 2, 1], [0, 3, 2]]).unwrap()
}

/// A box with its top at height 0 in a range of x and z.
fn block([from, to]: [f64; 2], [front, back]: [f64; 2]) -> TriangleMesh {
    let mut corners = Vec::new();
    for x in [from, to] {
        for y in [-1.0, 0.0] {
            corners.extend([front, back].map(|z| [x, y, z]));
        }
    }
    let faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ];
    TriangleMesh::new(&corners, &faces).unwrap()
}

/// A level map in a range of x, in cells of 0.25 m.
fn tile(from: f64, to: f64) -> HeightField {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few dozen
    let columns = ((to - from) / 0.25).round() as usize + 1;
    HeightField::new(
        vec![0.0; 41 * columns],
        [41, columns],
        [0.25; 2],
        [from, -5.0],
    )
    .unwrap()
}

fn union(parts: Vec<Arc<dyn Terrain>>) -> Arc<dyn Terrain> {
    Arc::new(Union::new(parts).unwrap())
}

fn two(a: impl Terrain + 'static, b: impl Terrain + 'static) -> Arc<dyn Terrain> {
    union(vec![Arc::new(a), Arc::new(b)])
}

const SHAPES: [&str; 3] = [
    "kind = 'box', size = [0.1, 0.02, 0.1]",
    "kind = 'cylinder', radius = 0.05, height = 0.02",
    "kind = 'hull', points = [[-0.05, -0.01, -0.05], [-0.05, -0.01, 0.05], [-0.05, 0.01, -0.05], \
     [-0.05, 0.01, 0.05], [0.05, -0.01, -0.05], [0.05, -0.01, 0.05], [0.05, 0.01, -0.05], \
     [0.05, 0.01, 0.05]]",
];

fn slider(shape: &str) -> Model {
    body(
        2.0,
        &format!("shapes = [{{ {shape}, collides = true, material = 'steel' }}]"),
    )
}

/// A shape that slides off at 2 m/s from x = −0.5 m on a slope about z, once it has stopped.
fn slide(
    shape: &str,
    ground: &Arc<dyn Terrain>,
    turn: f64,
    options: StepOptions,
) -> RoverSimulation {
    let model = slider(shape);
    let attitude = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
    let mut start = Configuration::zero(&model);
    start.position = attitude * Vector3::new(-0.5, 0.01, 0.0);
    start.attitude = attitude;
    let mut v = vec![0.0; model.nv()];
    v[..3].copy_from_slice((attitude * Vector3::new(2.0, 0.0, 0.0)).as_slice());
    let options = StepOptions {
        gravity: attitude * Vector3::new(0.0, -GRAVITY, 0.0),
        friction_coefficient: FRICTION,
        time_step: 0.01,
        ..options
    };
    let mut sim = moving(model, ground.clone(), options, start, v);
    assert!(sim.step(80).unwrap().is_converged());
    sim
}

/// Place along the slope, and how far its axes have turned from it.
fn end(sim: &RoverSimulation, turn: f64) -> [f64; 2] {
    let attitude = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
    let own = sim.q();
    let place = attitude.inverse() * own.position;
    [place.x, (attitude.inverse() * own.attitude).angle()]
}

/// A box that slid over the joint of two coplanar meshes stopped at 0.05 m, at the border of the
/// second, instead of 0.18 m.
#[test]
fn what_slides_over_a_joint_stops_where_it_stops_on_one_sheet() {
    let whole: Arc<dyn Terrain> = Arc::new(sheet(-5.0, 5.0, 0.0));
    let right_sheet = || sheet(0.0, 5.0, 0.0);
    let left_block = || block([-5.0, 0.0], [-5.0, 5.0]);
    let right_block = || block([0.0, 5.0], [-5.0, 5.0]);
    for shape in SHAPES {
        let [expected, _] = end(&slide(shape, &whole, 0.0, StepOptions::default()), 0.0);
        let ideal = -0.5 + 4.0 / (2.0 * FRICTION * GRAVITY);
        near_in(&shape, expected, ideal, 0.02);
        let grounds = [
            ("sheets", two(sheet(-5.0, 0.0, 0.0), sheet(0.0, 5.0, 0.0))),
            ("overlap", two(sheet(-5.0, 0.1, 0.0), sheet(-0.2, 5.0, 0.0))),
            ("slit", two(sheet(-5.0, -1e-7, 0.0), sheet(0.0, 5.0, 0.0))),
            ("blocks", two(left_block(), right_block())),
            (
                "bricks",
                two(
                    block([-5.0, 0.0], [-3.0, 5.0]),
                    block([0.0, 5.0], [-5.0, 4.0]),
                ),
            ),
            ("maps", two(tile(-5.0, 0.0), tile(0.0, 5.0))),
            ("map and sheet", two(tile(-5.0, 0.0), right_sheet())),
            ("block and map", two(left_block(), tile(0.0, 5.0))),
            ("sheet and block", two(sheet(-5.0, 0.0, 0.0), right_block())),
            ("plane and sheet", two(Plane::ground(), right_sheet())),
        ];
        // The box meets them all, the others sheets and blocks.
        let n = if shape == SHAPES[0] { 10 } else { 4 };
        for (name, ground) in grounds.into_iter().take(n) {
            let [x, turned] = end(&slide(shape, &ground, 0.0, StepOptions::default()), 0.0);
            near_in(&(name, shape), x, expected, 1e-6);
            assert!(turned < 1e-6, "{name}, {shape}: {turned}");
        }
    }
}

#[test]
fn a_joint_on_a_slope_and_on_a_wall_is_none() {
    for turn in [0.6, -1.0, 1.5] {
        let whole: Arc<dyn Terrain> = Arc::new(sheet(-5.0, 5.0, turn));
        let halves = two(sheet(-5.0, 0.0, turn), sheet(0.0, 5.0, turn));
        let [expected, ground] = [&whole, &halves].map(|ground| {
            let slid = slide(SHAPES[0], ground, turn, StepOptions::default());
            end(&slid, turn)
        });
        near_in(&turn, ground[0], expected[0], 1e-6);
        assert!(ground[1] < 1e-6, "{turn}: {ground:?}");
    }
}

/// Each contact has the friction of the part that it lies on: on the slippery one a box goes on.
#[test]
fn a_box_slides_on_where_the_second_part_is_slippery() {
    let pair = MaterialPair {
        materials: ["steel".into(), "ice".into()],
        friction_coefficient: 0.0,
        restitution: 0.0,
    };
    let materials = Materials::new(vec![pair]);
    let options = || StepOptions {
        materials: materials.clone(),
        ..StepOptions::default()
    };
    let ground = two(
        sheet(-5.0, 0.0, 0.0),
        sheet(0.0, 5.0, 0.0).with_material("ice"),
    );
    let [x, turned] = end(&slide(SHAPES[0], &ground, 0.0, options()), 0.0);
    assert!(x > 0.3 && turned < 1e-6, "{x} {turned}");
}

/// Two maps that share a column refused the ground 0.6 m before their seam, and an overlap too.
#[test]
fn maps_in_tiles_are_known_where_any_of_them_is() {
    let tiles = two(tile(-5.0, 0.0), tile(0.0, 5.0));
    let overlapping = two(tile(-5.0, 0.5), tile(-0.5, 5.0));
    let mut holed = tile(-5.0, 5.0).heights().to_vec();
    for row in 18..=22 {
        holed[row * 41 + 18..=row * 41 + 22].fill(f32::NAN);
    }
    let holed = HeightField::new(holed, [41, 41], [0.25; 2], [-5.0; 2]).unwrap();
    let patch = HeightField::new(vec![0.0; 64], [8, 8], [0.25; 2], [-0.875; 2]).unwrap();
    let mended = union(vec![Arc::new(holed), Arc::new(patch)]);
    let beside: [Arc<dyn Terrain>; 2] = [Arc::new(tile(-5.0, 0.0)), Arc::new(sheet(0.0, 5.0, 0.0))];
    for ground in [&tiles, &overlapping, &mended, &union(beside.to_vec())] {
        for x in [-1.0, -0.3, 0.0, 0.1, 0.7] {
            let place = Vector3::new(x, 0.0, 0.03);
            assert_eq!(ground.coverage(&place, 0.6), Coverage::Known, "{x}");
        }
    }
    let apart = two(tile(-5.0, 0.0), tile(0.25, 5.0));
    for (ground, x) in [(&tiles, 4.9), (&tiles, -4.9), (&apart, 0.0), (&mended, 4.9)] {
        let coverage = ground.coverage(&Vector3::new(x, 0.0, 0.0), 0.6);
        assert!(matches!(coverage, Coverage::Unknown(_)), "{x}");
    }
    assert!(matches!(
        union(beside.to_vec()).coverage(&Vector3::new(4.9, 0.0, 0.0), 0.6),
        Coverage::Unknown(_)
    ));
}

/// A map of hills, cut in two at a column: with ridges and valleys at the seam.
fn hills(columns: std::ops::RangeInclusive<usize>) -> HeightField {
    let whole = map(60, 0.25, |x, z| {
        0.08 * (3.0 * x + z).sin() * (2.0 * z - x).cos()
    });
    let heights = (0..61).flat_map(|row| {
        let whole = &whole;
        columns
            .clone()
            .map(move |column| whole.heights()[row * 61 + column])
    });
    let n = columns.end() - columns.start() + 1;
    let [x, z] = whole.origin();
    let origin = [x + 0.25 * *columns.start() as f64, z];
    HeightField::new(heights.collect(), [61, n], [0.25; 2], origin).unwrap()
}

#[test]
fn a_rover_drives_over_hills_in_tiles_as_over_the_whole_map() {
    let grounds: [Arc<dyn Terrain>; 3] = [
        Arc::new(hills(0..=60)),
        two(hills(0..=30), hills(30..=60)),
        two(hills(0..=33), hills(28..=60)),
    ];
    let ends = grounds.map(|ground| {
        let model = Model::rover();
        let mut sim = resting(model, ground, StepOptions::default(), |q| {
            (q.position.x, q.position.y) = (-0.8, 0.5);
        });
        sim.step(60).unwrap();
        sim.set_wheel_torques(&[60.0; 6]).unwrap();
        sim.step(340).unwrap();
        sim.q().position
    });
    assert!(ends[0].x > 0.3, "{}", ends[0]);
    for end in &ends[1..] {
        assert!((end - ends[0]).norm() < 1e-4, "{end} {}", ends[0]);
    }
}

/// Grounds that coincide counted twice: a wheel had two contacts where it has one.
#[test]
fn grounds_that_coincide_bear_once() {
    let flat = || -> Arc<dyn Terrain> { Arc::new(tile(-5.0, 5.0)) };
    let sheet = || -> Arc<dyn Terrain> { Arc::new(sheet(-5.0, 5.0, 0.0)) };
    let plane = || -> Arc<dyn Terrain> { Arc::new(Plane::ground()) };
    let grounds = [
        vec![flat(), flat()],
        vec![plane(), flat()],
        vec![sheet(), sheet()],
        vec![flat(), sheet()],
    ];
    for (k, parts) in grounds.into_iter().enumerate() {
        let [once, twice] = [parts[..1].to_vec(), parts].map(|parts| {
            let mut sim = rover_on(union(parts), 0.36);
            sim.step(100).unwrap();
            sim.contacts().len()
        });
        assert_eq!(once, twice, "{k}");
    }
}

/// A box on the ridge where two sheets meet lies on the ridge alone.
#[test]
fn a_ridge_of_two_parts_is_one_edge() {
    let half = |turn: f64, from: f64, to: f64| Arc::new(sheet(from, to, turn)) as Arc<dyn Terrain>;
    let ridge = union(vec![half(0.2, -5.0, 0.0), half(-0.2, 0.0, 5.0)]);
    let mut edges = Vec::new();
    ridge.visit_near(&Vector3::new(0.0, 0.0, 0.3), 0.2, &mut |_, piece| {
        if let rover_core::geometry::Primitive::Edge(edge) = piece {
            let is_ridge = edge.along.z.abs() > 0.9 && edge.start.x.abs() < 1e-9;
            edges.extend(is_ridge.then_some(*edge));
        }
    });
    assert!(!edges.is_empty());
    for edge in edges {
        assert!(edge.normals.iter().all(|n| n.y > 0.9), "{edge:?}");
    }
}

/// Free space under a bridge without an underside is none of its ground.
#[test]
fn a_rover_stands_on_a_map_below_a_bridge() {
    let bridge: Vec<[f64; 3]> = sheet(-2.0, 2.0, 0.0)
        .vertices()
        .iter()
        .map(|x| [x.x, 3.0, x.z])
        .collect();
    let bridge = TriangleMesh::new(&bridge, &[[0, 2, 1], [0, 3, 2]]).unwrap();
    let mut sim = rover_on(two(tile(-5.0, 5.0), bridge), 0.36);
    sim.step(100).unwrap();
    assert!(sim.contacts().len() >= 6);
}
