//! Maps that are large, and maps that are refused.

use std::sync::Mutex;
use std::time::Instant;

use rover_core::contact::{Activation, detect};
use rover_core::geometry::{
    HeightField, Hit, Neighbourhood, OrientedBox, PlacedShape, Plane, Primitive, Ray, Terrain,
    TriangleMesh,
};
use rover_core::multibody::{Configuration, Kinematics};
use rover_core::nalgebra::{Matrix3, Vector3};

use super::surface_scenes::map;
use crate::spheres::sphere_scenes::lone_wheel;

fn visited(field: &HeightField, reach: f64) -> (usize, usize) {
    let (mut cells, mut pieces) = (0, 0);
    let centre = Vector3::new(0.213, 0.15, -0.307);
    field.visit_cells(&centre, reach, |_, _| cells += 1);
    field.visit_near(&centre, reach, &mut |_, _| pieces += 1);
    (cells, pieces)
}

#[test]
fn a_large_map_loads_quickly_and_a_step_visits_no_more_of_it() {
    let heights = |n: usize| {
        #[allow(clippy::cast_precision_loss)] // some wave
        let wave = move |k: usize| (((k % n) as f32 - (n / 2) as f32) * 0.05).sin() * 0.1;
        (0..n * n).map(wave).collect::<Vec<f32>>()
    };
    let place = |n: usize| [-0.05 * (n / 2) as f64; 2];
    let counts = [64, 512, 4096].map(|n: usize| {
        let heights = heights(n);
        let start = Instant::now();
        let field = HeightField::new(heights, [n, n], [0.05; 2], place(n)).unwrap();
        // A test profile is several times slower than a release.
        assert!(start.elapsed().as_secs_f64() < 10.0);
        assert!(field.size() < 2 * 4 * n * n);
        visited(&field, 0.2)
    });
    assert!(counts[0].0 < 80, "{counts:?}");
    assert_eq!(counts[0], counts[2]);
    assert_eq!(counts[1], counts[2]);
}

#[test]
fn a_wide_search_finds_the_cells_that_looking_at_all_finds() {
    let heights: Vec<f32> = (0..300_u16 * 200)
        .map(|k| f32::from(k % 97) * 0.05)
        .collect();
    let field = HeightField::new(heights, [200, 300], [0.1, 0.2], [-3.0, 5.0]).unwrap();
    for (centre, reach) in [
        (Vector3::new(10.0, 5.5, 20.0), 2.0),
        (Vector3::new(-4.0, 6.0, 4.0), 9.0),
        (Vector3::new(5.0, 0.0, 9.0), 0.3),
        (Vector3::new(5.0, 9.0, 9.0), 3.0),
    ] {
        let mut found = Vec::new();
        field.visit_cells(&centre, reach, |i, j| found.push([j, i]));
        let count = found.len();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), count);
        for j in 0..199 {
            for i in 0..299 {
                let corner =
                    |axis: usize, k: usize| field.origin()[axis] + k as f64 * field.spacing()[axis];
                let beyond = |axis: usize, k: usize, x: f64| {
                    (corner(axis, k) - x).max(x - corner(axis, k + 1)).max(0.0)
                };
                let (x, z) = (beyond(0, i, centre.x), beyond(1, j, centre.z));
                if (reach * reach - x * x - z * z).abs() < 1e-6 {
                    continue;
                }
                let bottom = centre.y - (reach * reach - x * x - z * z).sqrt();
                let at = |i: usize, j: usize| f64::from(field.heights()[j * 300 + i]);
                let highest = at(i, j)
                    .max(at(i + 1, j))
                    .max(at(i, j + 1))
                    .max(at(i + 1, j + 1));
                // Within rounding of the ball's rim either answer is right.
                if (highest - bottom).abs() < 1e-6 {
                    continue;
                }
                let is_near = highest >= bottom;
                assert_eq!(found.binary_search(&[j, i]).is_ok(), is_near, "{i} {j}");
            }
        }
    }
}

/// A step of a box without any contact took 100 ms over a fine mesh: every piece within its
/// bounding ball was examined.
#[test]
fn a_box_above_a_fine_surface_examines_only_what_is_near_its_sides() {
    let (n, spacing) = (101, 0.02);
    let place = |k: usize| -1.0 + spacing * k as f64;
    let field = HeightField::new(vec![0.0; n * n], [n, n], [spacing; 2], [-1.0; 2]).unwrap();
    let vertices: Vec<_> = (0..n * n)
        .map(|k| [place(k % n), 0.0, place(k / n)])
        .collect();
    let corners = (0..n - 1).flat_map(|j| (0..n - 1).map(move |i| j * n + i));
    let cells = corners.flat_map(|a| [[a, a + n + 1, a + 1], [a, a + n, a + n + 1]]);
    let mesh = TriangleMesh::new(&vertices, &cells.collect::<Vec<_>>()).unwrap();
    let grounds: [&dyn Terrain; 2] = [&field, &mesh];
    for ground in grounds {
        let count = |height: f64| {
            let solid = OrientedBox {
                centre: Vector3::new(0.1, 0.15 + height, -0.2),
                R: Matrix3::identity(),
                half_size: Vector3::new(0.5, 0.15, 0.3),
            };
            let (mut around, mut near) = (0, 0);
            let reach = solid.half_size.norm();
            let (shape, base) = (PlacedShape::Box(solid), Vector3::zeros());
            ground.visit_around(&Neighbourhood::new(&shape, &base, 1e-3), &mut |_, _| {
                around += 1;
            });
            ground.visit_near(&solid.centre, reach, &mut |_, _| near += 1);
            (around, near)
        };
        let (around, near) = count(0.1);
        assert!(around == 0 && near > 3000, "{around} {near}");
        // One that stands there has the pieces of the cells under it, and of a row around them.
        let (around, _) = count(-1e-6);
        assert!((3000..5600).contains(&around), "{around}");
    }
}

/// A map that notes how far the last search around a part reached.
struct Watched {
    map: HeightField,
    reach: Mutex<f64>,
}

impl Terrain for Watched {
    fn visit_near(&self, at: &Vector3<f64>, reach: f64, visit: &mut dyn FnMut(u32, &Primitive)) {
        self.map.visit_near(at, reach, visit);
    }

    fn visit_around(&self, part: &Neighbourhood<'_>, visit: &mut dyn FnMut(u32, &Primitive)) {
        *self.reach.lock().unwrap() = part.reach;
        self.map.visit_around(part, visit);
    }

    fn can_be_passed(&self) -> bool {
        self.map.can_be_passed()
    }

    fn has_surface(&self) -> bool {
        true
    }

    fn primitive(&self, id: u32) -> Primitive {
        self.map.primitive(id)
    }

    fn n_primitives(&self) -> u32 {
        self.map.n_primitives()
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        self.map.first_hit(ray, reach)
    }

    fn height(&self, x: f64, z: f64) -> Option<f64> {
        self.map.height(x, z)
    }

    fn ground(&self) -> Option<&Plane> {
        None
    }
}

/// A step with wheels that span at 100 rad/s three metres above a map took 15 to 60 ms: each was
/// searched for ground as far away as a fixed arm of that spin would have come.
#[test]
fn a_wheel_that_spins_reaches_no_farther_than_one_that_does_not() {
    let watched = Watched {
        map: map(40, 0.2, |x, z| 0.1 * (3.0 * x).sin() * z.cos()),
        reach: Mutex::new(f64::NAN),
    };
    let model = lone_wheel();
    let mut q = Configuration::zero(&model);
    q.position.y = 3.0;
    let kinematics = Kinematics::of(&model, &q);
    let activation = Activation {
        lead: 0.01,
        hover: 1e-3,
        slow: 0.1,
    };
    let reach = |v: [f64; 6]| {
        let mut out = Vec::new();
        detect(
            &model,
            &kinematics,
            &kinematics,
            &watched,
            &v,
            &activation,
            &mut out,
        );
        *watched.reach.lock().unwrap()
    };
    let falling = reach([0.0, -1.0, 0.0, 0.0, 0.0, 0.0]);
    let spinning = reach([0.0, -1.0, 0.0, 0.0, 0.0, 250.0]);
    let tumbling = reach([0.0, -1.0, 0.0, 250.0, 0.0, 0.0]);
    assert!((falling - 0.01).abs() < 1e-12, "{falling}");
    assert!((spinning - falling).abs() < 1e-12, "{spinning}");
    assert!((tumbling - falling - 0.25).abs() < 1e-12, "{tumbling}");
}
