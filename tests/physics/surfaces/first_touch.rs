//! Parts that have just touched a surface overlap it by no more than they have moved since.

use std::sync::Arc;

use rover_core::contact::detection::{deepest_overlap, detect, wheel_contact};
use rover_core::contact::{Activation, Contact, Part};
use rover_core::geometry::query::convex;
use rover_core::geometry::{HeightField, PlacedShape, SupportMap, Terrain, TriangleMesh, Union};
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Configuration, Kinematics, Model, coordinates};
use rover_core::nalgebra::{Unit, UnitQuaternion, Vector3};

use super::meshes::ball;
use super::surface_scenes::map;
use crate::shared::moving;
use crate::spheres::sphere_scenes::Random;

/// A triangle of a surface as a convex body.
struct Triangle([Vector3<f64>; 3]);

impl SupportMap for Triangle {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let along = |x: &&Vector3<f64>| direction.dot(x);
        let furthest = |a: &&Vector3<f64>, b: &&Vector3<f64>| along(a).total_cmp(&along(b));
        *self.0.iter().max_by(furthest).unwrap()
    }

    fn centre(&self) -> Vector3<f64> {
        self.0.iter().sum::<Vector3<f64>>() / 3.0
    }

    fn bound(&self) -> f64 {
        let centre = self.centre();
        let distances = self.0.iter().map(|x| (x - centre).norm());
        distances.fold(0.0, f64::max)
    }
}

/// A ground and its triangles. Places beyond the radius, seen from above, are near its border.
struct Ground {
    terrain: Arc<dyn Terrain>,
    triangles: Vec<Triangle>,
    radius: f64,
}

fn of_mesh(mesh: &TriangleMesh) -> Vec<Triangle> {
    let corners = |triangle: &[u32; 3]| Triangle(triangle.map(|v| mesh.vertices()[v as usize]));
    mesh.triangles().iter().map(corners).collect()
}

fn of_map(field: &HeightField) -> Vec<Triangle> {
    let ([rows, columns], [dx, dz], [x0, z0]) = (field.shape(), field.spacing(), field.origin());
    let corner = |i: usize, j: usize| {
        let y = f64::from(field.heights()[j * columns + i]);
        Vector3::new(x0 + dx * i as f64, y, z0 + dz * j as f64)
    };
    let cells = (0..rows - 1).flat_map(|j| (0..columns - 1).map(move |i| (i, j)));
    cells
        .flat_map(|(i, j)| {
            let far = corner(i + 1, j + 1);
            [corner(i + 1, j), corner(i, j + 1)].map(|side| Triangle([corner(i, j), far, side]))
        })
        .collect()
}

fn on_map(field: HeightField) -> Ground {
    Ground {
        triangles: of_map(&field),
        radius: -field.origin()[0] - 2.0 * field.spacing()[0],
        terrain: Arc::new(field),
    }
}

fn boulder(centre: Vector3<f64>, cuts: usize) -> Ground {
    let mesh = ball(0.15, cuts, centre);
    Ground {
        triangles: of_mesh(&mesh),
        terrain: Arc::new(mesh),
        radius: f64::INFINITY,
    }
}

/// A flat map with one spike.
fn spike(random: &mut Random) -> HeightField {
    let (height, spacing) = (random.between(0.1, 0.5), random.between(0.1, 0.15));
    one_spike(height, spacing)
}

fn one_spike(height: f64, spacing: f64) -> HeightField {
    let is_tip = |x: f64, z: f64| x.abs() + z.abs() < 0.5 * spacing;
    map(14, spacing, |x, z| if is_tip(x, z) { height } else { 0.0 })
}

/// Two spikes, rough maps, boulders, and a boulder on a rough map.
fn grounds(random: &mut Random) -> Vec<Ground> {
    let mut rough = |cells: u32, roughness: f64| {
        let spacing = random.between(0.08, 0.2);
        let mut numbers = Random(random.0);
        map(cells, spacing, |_, _| {
            roughness * spacing * numbers.between(-1.0, 1.0)
        })
    };
    let fields = [rough(12, 0.1), rough(12, 0.4), rough(12, 1.0)];
    let stony = rough(10, 0.15);
    let stone = ball(0.15, 1, Vector3::new(0.05, 0.03, -0.1));
    let mut triangles = of_map(&stony);
    triangles.extend(of_mesh(&stone));
    let mut all: Vec<Ground> = fields.into_iter().map(on_map).collect();
    let radius = -stony.origin()[0] - 2.0 * stony.spacing()[0];
    let parts: Vec<Arc<dyn Terrain>> = vec![Arc::new(stony), Arc::new(stone)];
    all.push(Ground {
        terrain: Arc::new(Union::new(parts).unwrap()),
        triangles,
        radius,
    });
    all.extend([spike(random), spike(random)].map(on_map));
    all.extend([0, 1, 2].map(|cuts| boulder(Vector3::new(0.0, 0.1, 0.0), cuts)));
    all
}

/// A body that is a part of this shape and nothing else, or a wheel.
fn body(shape: &str) -> (Model, Part) {
    let (text, part) = if let Some(width) = shape.strip_prefix("wheel") {
        let rest = "shape = { kind = \"sphere\", radius = 0.1 }\n[[wheels]]\nname = \"W\"\n\
                    solid = \"body\"\naxle = [0.0, 0.0, 1.0]\nradius = 0.15\ntorque_limit = 1.0\n\
                    drive_sign = -1.0\n";
        (format!("{rest}{width}"), Part::Wheel(0))
    } else {
        let part = match shape {
            shape if shape.contains("box") => Part::Box(0),
            shape if shape.contains("sphere") => Part::Sphere(0),
            _ => Part::Collider(0),
        };
        let text = format!("shapes = [{{ collides = true, {shape} }}]");
        (text, part)
    };
    (crate::shared::body(3.0, &text), part)
}

/// Boxes, a thin wheel, wheels with a width (one of them a torus, one a cylinder) and a ball.
fn bodies() -> Vec<(Model, Part)> {
    [
        "kind = \"box\", size = [0.6, 0.2, 0.4]",
        "kind = \"box\", size = [1.0, 0.06, 0.5]",
        "kind = \"box\", size = [0.1, 0.1, 0.1]",
        "wheel",
        "wheel\nwidth = 0.1\nrounding = 0.02",
        "wheel\nwidth = 0.1\nrounding = 0.05",
        "wheel\nwidth = 0.12\nrounding = 0.0",
        "kind = \"sphere\", radius = 0.1",
    ]
    .map(body)
    .into()
}

/// A drum, a rod, a capsule, ellipsoids, a wedge and a rock.
fn colliders() -> Vec<(Model, Part)> {
    [
        "kind = \"cylinder\", radius = 0.15, height = 0.2",
        "kind = \"cylinder\", radius = 0.03, height = 0.6",
        "kind = \"capsule\", radius = 0.08, height = 0.3",
        "kind = \"ellipsoid\", radii = [0.25, 0.1, 0.15]",
        "kind = \"ellipsoid\", radii = [0.1, 0.1, 0.1]",
        "kind = \"hull\", points = [[-0.3, -0.1, -0.2], [0.3, -0.1, -0.2], [-0.3, -0.1, 0.2], [0.3, -0.1, 0.2], [-0.2, 0.1, -0.2], [-0.2, 0.1, 0.2]]",
        "kind = \"hull\", points = [[0.1, 0.0, 0.02], [-0.08, 0.05, 0.03], [-0.05, -0.02, -0.09], [0.01, -0.1, 0.0], [0.02, 0.09, -0.03], [0.05, -0.03, 0.1], [-0.1, -0.05, 0.06]]",
    ]
    .map(body)
    .into()
}

/// A body that moves along a line and turns.
struct Path<'a> {
    model: &'a Model,
    part: Part,
    start: Vector3<f64>,
    direction: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
    axis: Unit<Vector3<f64>>,
    /// rad/m.
    turning: f64,
}

impl<'a> Path<'a> {
    /// From a place above towards one near the middle.
    fn random((model, part): &'a (Model, Part), random: &mut Random) -> Self {
        let mut any = || {
            let mut x = || random.between(-1.0, 1.0);
            Vector3::new(x(), x(), x())
        };
        let (target, from, turn, axis) = (0.25 * any(), any(), 3.0 * any(), any());
        let from = Vector3::new(from.x, 0.15 + from.y.abs(), from.z).normalize();
        Self {
            model,
            part: *part,
            start: Vector3::new(target.x, 0.0, target.z) + 2.0 * from,
            direction: -from,
            attitude: UnitQuaternion::from_euler_angles(turn.x, turn.y, turn.z),
            axis: Unit::new_normalize(axis),
            turning: random.between(-2.0, 2.0).max(0.0),
        }
    }

    fn at(&self, way: f64) -> Configuration {
        let mut q = Configuration::zero(self.model);
        q.position = self.start + self.direction * way;
        q.attitude =
            UnitQuaternion::from_axis_angle(&self.axis, self.turning * way) * self.attitude;
        q
    }

    fn shape(&self, way: f64) -> PlacedShape<'a> {
        let q = self.at(way);
        let shape = self.part.place(self.model, &Kinematics::of(self.model, &q));
        shape.moved(&q.position)
    }

    /// Largest speed of a point of the body, per way.
    fn speed(&self) -> f64 {
        1.0 + self.turning.abs() * self.part.bound(self.model)
    }

    /// Distance from the nearest triangle, m, and the place there.
    fn nearest(&self, ground: &Ground, way: f64) -> (f64, Vector3<f64>) {
        let shape = self.shape(way);
        let mut nearest = (f64::INFINITY, Vector3::zeros());
        for triangle in &ground.triangles {
            let apart = (triangle.centre() - shape.centre()).norm() - triangle.bound();
            if apart - shape.bound() < nearest.0.max(1e-3) {
                let near = convex::nearest_points(&shape, triangle);
                if near.gap < nearest.0 {
                    nearest = (near.gap, near.point);
                }
            }
        }
        nearest
    }

    /// The way to the first touch, away from the ground's border.
    fn first_touch(&self, ground: &Ground) -> Option<f64> {
        let mut way = 0.0;
        while way < 4.0 {
            let (distance, place) = self.nearest(ground, way);
            if distance < 1e-9 {
                return (place.x.abs().max(place.z.abs()) < ground.radius).then_some(way);
            }
            way += distance / self.speed();
        }
        None
    }

    fn contacts(&self, terrain: &dyn Terrain, way: f64) -> Vec<Contact> {
        let q = self.at(way);
        let poses = Kinematics::of(self.model, &q);
        let (rest, touching) = (vec![0.0; self.model.nv()], Activation::default());
        let mut contacts = Vec::new();
        let model = self.model;
        detect(
            model,
            &poses,
            &poses,
            terrain,
            &rest,
            &touching,
            &mut contacts,
        );
        contacts
    }

    /// The deepest overlap, m.
    fn depth(&self, terrain: &dyn Terrain, way: f64) -> f64 {
        let gaps = self.contacts(terrain, way).into_iter().map(|c| c.gap);
        -gaps.fold(0.0, f64::min)
    }
}

/// Of every shape on every ground the deepest overlap was up to the thickness of the rock, because
/// the face beyond it pushed too.
#[test]
fn an_overlap_grows_from_zero_along_random_paths_through_first_touch() {
    for (bodies, least) in [(bodies(), 150), (colliders(), 130)] {
        overlaps_grow_from_zero(&bodies, least);
    }
}

fn overlaps_grow_from_zero(bodies: &[(Model, Part)], least: usize) {
    let mut random = Random(7);
    let mut tried = 0;
    for round in 0..4 {
        for ground in grounds(&mut random) {
            for body in bodies {
                let path = Path::random(body, &mut random);
                let Some(touch) = path.first_touch(&ground) else {
                    continue;
                };
                tried += 1;
                let terrain = &*ground.terrain;
                // Up to a thousandth of its size a part may be in ground that is thinner.
                let shallow = 1.001e-3 * path.part.bound(path.model);
                for step in [1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3] {
                    let depth = path.depth(terrain, touch + step);
                    let moved = step * path.speed() + 2e-9;
                    let place = || format!("{round} {:?} {step}", path.shape(touch));
                    assert!(depth <= moved.max(shallow), "{}: {depth}", place());
                    let (distance, _) = path.nearest(&ground, touch + step);
                    let has_contact = depth > 0.0 || distance > -1e-7;
                    assert!(has_contact, "{}: nothing at {distance}", place());
                    if let Part::Wheel(i) = path.part {
                        let poses = Kinematics::of(path.model, &path.at(touch + step));
                        let gap = wheel_contact(path.model, &poses, terrain, i).gap;
                        assert!(gap >= -moved.max(shallow), "{}: gap {gap}", place());
                    }
                }
            }
        }
    }
    assert!(tried > least, "{tried}");
}

/// Wheels in a map of 0.1 m of noise in cells of 0.25 m were said to overlap it by up to 0.44 m
/// where they had to rise by 0.03 m: the face of another ridge, far behind them, counted. One in
/// 2000 was said to be free of it, since its lowest point was beyond the far side of the ridge that
/// pierced it, or a tip was beyond its middle.
#[test]
fn a_part_that_is_lowered_into_a_spiky_map_overlaps_it_by_no_more_than_it_was_lowered() {
    overlaps_are_as_deep_as_lowered([1, 5, 33]);
}

/// Ignored because it takes a minute: `make test-all` runs it, and the test above, which runs
/// always, has three of its seeds, two of which or more failed before the search was mended.
#[test]
#[ignore = "tests/physics/surfaces/first_touch.rs::a_part_that_is_lowered_into_a_spiky_map_overlaps_it_by_no_more_than_it_was_lowered"]
fn parts_that_are_lowered_into_many_spiky_maps_overlap_them_by_no_more_than_they_were_lowered() {
    overlaps_are_as_deep_as_lowered(0..60);
}

fn overlaps_are_as_deep_as_lowered(numbers: impl IntoIterator<Item = u64>) {
    let (bodies, colliders) = (bodies(), colliders());
    let mut wrong = Vec::new();
    for number in numbers {
        for bodies in [&bodies, &colliders] {
            let tried = lower_into_a_spiky_map(bodies, 23 + 977 * number, &mut wrong);
            assert!(tried > 1400, "{tried}");
        }
    }
    assert!(wrong.is_empty(), "{} {wrong:#?}", wrong.len());
}

/// Adds what overlaps more than it should, or not at all. Returns how many were tried.
fn lower_into_a_spiky_map(bodies: &[(Model, Part)], seed: u64, wrong: &mut Vec<String>) -> usize {
    let mut random = Random(seed);
    let mut tried = 0;
    for round in 0..40 {
        let mut numbers = Random(random.0 ^ round);
        let field = map(14, 0.25, |_, _| 0.2 * numbers.between(-1.0, 1.0));
        let ground = Ground {
            triangles: of_map(&field),
            radius: 1.0,
            terrain: Arc::new(field),
        };
        for (k, body) in bodies.iter().enumerate() {
            let mut path = Path::random(body, &mut random);
            let mut beside = || random.between(-0.6, 0.6);
            path.start = Vector3::new(beside(), 2.0, beside());
            (path.direction, path.turning) = (-Vector3::y(), 0.0);
            let Some(touch) = path.first_touch(&ground) else {
                continue;
            };
            // At the first touch the gap is positive, and smaller than rounding can tell.
            for lowered in [0.0, 1e-9, 0.003, 0.01, 0.03, 0.06] {
                tried += 1;
                let mut fails = |what: &str, value: f64| {
                    let shape = path.shape(touch);
                    wrong.push(format!(
                        "{seed} {round} {k} {lowered} {what} {value} {shape:?}"
                    ));
                };
                let shallow = 1.001e-3 * path.part.bound(path.model);
                let most = lowered + shallow;
                let depth = path.depth(&*ground.terrain, touch + lowered);
                // A polytope 3 cm deep may have no edge or vertex that the ridge pushes: 3 of all.
                let is_hull = matches!(path.shape(touch), PlacedShape::Hull(_));
                let may_miss = lowered < 1e-6 || is_hull && lowered > 0.02;
                if depth > most || depth <= 0.0 && !may_miss {
                    fails("depth", depth);
                }
                if let Part::Wheel(i) = path.part {
                    let poses = Kinematics::of(path.model, &path.at(touch + lowered));
                    let gap = wheel_contact(path.model, &poses, &*ground.terrain, i).gap;
                    if !(-most..1e-8).contains(&gap) {
                        fails("gap", gap);
                    }
                }
            }
        }
    }
    tried
}

/// A rock that lay on a rough map almost at rest was thrown 3 cm aside: of a steep ridge that it
/// did not touch an edge counted, 13 cm deep, as the way behind the edge led through the ridge,
/// across the valley with the rock and into the next hill.
#[test]
fn a_rock_in_a_valley_is_not_in_the_ground_behind_the_next_ridge() {
    let heights: [[f32; 7]; 7] = [
        [0.0372, -0.0596, -0.0386, 0.0198, 0.1606, 0.2244, 0.0149],
        [-0.0367, -0.0652, 0.244, -0.0066, -0.0259, -0.0266, 0.1818],
        [-0.2162, -0.1299, 0.1064, -0.1514, 0.0689, 0.3135, -0.0364],
        [0.1007, -0.1115, -0.0761, -0.0211, 0.0306, -0.0347, 0.0604],
        [-0.0258, 0.216, -0.1967, -0.194, 0.1374, -0.104, 0.0177],
        [-0.1808, -0.1613, -0.0993, 0.1513, -0.1331, 0.1406, 0.0461],
        [0.0683, -0.1191, 0.0415, 0.1042, 0.0509, -0.0239, -0.2077],
    ];
    let points = "[0.2127, 0.0461, -0.0265], [0.0089, -0.0372, 0.1592], [0.0778, 0.3331, -0.1545], [0.193, 0.045, -0.0642], [-0.1675, -0.1546, 0.11], [-0.0892, 0.0994, -0.008], [0.0442, 0.0023, 0.1557], [-0.1227, 0.2536, -0.0326], [0.0488, 0.0546, -0.0891], [0.0084, 0.0079, -0.0719], [0.0549, 0.045, 0.0518], [0.0413, 0.0884, -0.2028]";
    let field = HeightField::new(heights.concat(), [7, 7], [0.2; 2], [-0.6; 2]).unwrap();
    let (model, _) = body(&format!("kind = \"hull\", points = [{points}]"));
    let q = [0.0004, 0.079, 0.0232, -1.2691, 2.0855, 0.0679];
    let mut place = coordinates::from_public(&model, &q).unwrap();
    for _ in 0..10 {
        place.position.y += 1e-3;
        let overlap = deepest_overlap(&model, &Kinematics::of(&model, &place), &field);
        assert!(overlap >= 0.0, "{} {overlap}", place.position.y);
    }
}

/// Near the ground an overlap changes by no more than a part moves, and than ground may be thin.
#[test]
fn an_overlap_is_continuous_along_short_ways_near_the_ground() {
    for (bodies, seed) in [(bodies(), 41), (colliders(), 43)] {
        let mut random = Random(seed);
        let (mut tried, mut jumps) = (0, Vec::new());
        for round in 0..1 {
            for (number, ground) in grounds(&mut random).iter().enumerate() {
                for body in &bodies {
                    let path = Path::random(body, &mut random);
                    let mut any = || random.between(-1.0, 1.0);
                    let aside = Vector3::new(any(), 0.5 * any(), any()).normalize();
                    let Some(touch) = path.first_touch(ground) else {
                        continue;
                    };
                    tried += 1;
                    let mut short = Path {
                        start: path.at(touch).position,
                        ..path
                    };
                    short.attitude = path.at(touch).attitude;
                    (short.direction, short.turning) = (aside, 0.0);
                    let shallow = 1e-3 * path.part.bound(path.model);
                    let mut before = short.depth(&*ground.terrain, 0.0);
                    for k in 1..=20 {
                        let depth = short.depth(&*ground.terrain, STRIDE * f64::from(k));
                        let jump = (depth - before).abs() - 1.5 * STRIDE - shallow;
                        if jump > 0.0 {
                            let scene = format!("{round} {number} {k} {before} {depth}");
                            jumps.push((jump, format!("{scene} {:?}", short.shape(0.0))));
                        }
                        before = depth;
                    }
                }
            }
        }
        jumps.sort_by(|a, b| b.0.total_cmp(&a.0));
        assert!(tried > 40, "{tried}");
        assert!(
            jumps.is_empty(),
            "{} of {tried}: {:#?}",
            jumps.len(),
            &jumps[..jumps.len().min(12)]
        );
    }
}

/// Way between the places at which overlaps are compared, m.
const STRIDE: f64 = 2e-4;

/// A lying wheel counted as free of a tip that had passed its middle, and a box as free of one
/// that came through its far side.
#[test]
fn a_tip_beyond_the_middle_of_a_part_pushes_it_back() {
    let field = one_spike(0.5, 0.1);
    let (x, y) = (Vector3::x_axis(), Vector3::y_axis());
    for (shape, half, axis) in [
        ("wheel\nwidth = 0.1\nrounding = 0.02", 0.05, x),
        ("wheel\nwidth = 0.1\nrounding = 0.05", 0.05, x),
        ("wheel\nwidth = 0.12\nrounding = 0.0", 0.06, x),
        ("kind = \"box\", size = [0.6, 0.06, 0.4]", 0.03, y),
    ] {
        let body = body(shape);
        let mut path = Path::random(&body, &mut Random(1));
        (path.start, path.direction) = (Vector3::new(0.01, 1.0, 0.02), -Vector3::y());
        path.attitude = UnitQuaternion::from_axis_angle(&axis, std::f64::consts::FRAC_PI_2);
        path.turning = 0.0;
        let touch = path.start.y - 0.5 - half;
        for depth in [0.5, 0.9, 1.1, 1.5].map(|share| share * half) {
            let deepest = path.depth(&field, touch + depth);
            assert!((deepest - depth).abs() < 1e-6, "{shape} {depth} {deepest}");
        }
    }
}

/// A rover that stranded on a spike or a boulder was thrown sideways: one step after its chassis
/// had been lowered by 0.1 mm past touching it stood up to 0.75 m away.
#[test]
fn a_box_that_rests_on_a_spike_or_a_boulder_is_not_thrown_sideways() {
    let mut random = Random(11);
    let (model, part) = body("kind = \"box\", size = [0.6, 0.2, 0.4]");
    let model = Arc::new(model);
    let mut tried = 0;
    for case in 0..60 {
        let ground = if case % 2 == 0 {
            on_map(spike(&mut random))
        } else {
            boulder(Vector3::new(0.0, 0.1, 0.0), case / 2 % 3)
        };
        let own = (Model::clone(&model), part);
        let mut path = Path::random(&own, &mut random);
        let mut beside = || random.between(-0.15, 0.15);
        path.start = Vector3::new(beside(), 2.0, beside());
        (path.direction, path.turning) = (-Vector3::y(), 0.0);
        let Some(touch) = path.first_touch(&ground) else {
            continue;
        };
        tried += 1;
        let lowered = path.at(touch + 1e-4);
        let depth = path.depth(&*ground.terrain, touch + 1e-4);
        assert!(depth < 1.1e-4 + 4e-4, "{case}: {depth}");
        let (terrain, options) = (ground.terrain.clone(), StepOptions::default());
        let v = vec![0.0; 6];
        let mut stone = moving(model.clone(), terrain, options, lowered.clone(), v);
        stone.step(1).unwrap();
        let now = stone.q();
        let moved = (now.position - lowered.position).norm();
        assert!(moved < 3e-3, "{case}: {moved}");
        let turned = now.attitude.angle_to(&lowered.attitude);
        assert!(turned < 0.02, "{case}: {turned}");
    }
    assert!(tried > 40, "{tried}");
}
