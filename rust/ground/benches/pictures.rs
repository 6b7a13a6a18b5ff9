//! Pictures a second on each kind of ground, on one thread.
//!
//! Run: `cargo bench -p rover-ground --bench pictures`. It only reports. A camera of 320 x 240
//! pixels looks 20 degrees down from 1 m above the ground, with a view of 87 by 71 degrees. Every
//! ray casts another towards the Sun from what it meets. The figures are means over pictures for at
//! least half a second, in CPU time where Linux tells it.

#![allow(clippy::print_stdout)] // a bench prints
#![allow(clippy::unwrap_used)] // and stops where its own scenes are wrong

use std::hint::black_box;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use nalgebra::Vector3;
use rover_ground::geometry::picture::{Checks, Grain, Light, Look, PictureScene, Shot, take};
use rover_ground::geometry::ray::{Ray, cast};
use rover_ground::geometry::{HeightField, Plane, Rocks, SphereField, Terrain, Union};

/// Least time spent on a measurement, s.
const ENOUGH: f64 = 0.5;

const COLUMNS: i32 = 320;
const ROWS: i32 = 240;

fn look() -> Look {
    Look {
        light: Light {
            sun: [0.68, 0.64, 0.58],
            sky: [0.52, 0.53, 0.57],
            bounce: [0.26, 0.21, 0.18],
            horizon: [0.89, 0.77, 0.65],
            zenith: [0.5, 0.58, 0.68],
            bands: vec![[0.0, 0.0], [10.0, 0.52], [90.0, 1.0]],
            haze: [27.0, 90.0],
        },
        checks: Checks {
            tile: 0.5,
            grain: Grain::new(
                (0..128 * 128).map(|k| f64::from(k % 97) / 96.0).collect(),
                128,
            )
            .unwrap(),
        },
        firm: [[0.72, 0.45, 0.3], [0.65, 0.39, 0.26]],
        sand: [[0.8, 0.67, 0.46], [0.76, 0.63, 0.43]],
        rock: [0.5, 0.33, 0.25],
        ball: [0.8, 0.62, 0.42],
    }
}

/// About 6900 rocks of 5 to 50 cm on an area of 30 m by 30 m.
fn rocks(ground: &dyn Terrain) -> SphereField {
    let rocks = Rocks {
        abundance: 0.17,
        area: [30.0, 30.0],
        middle: [0.0, 0.0],
        seed: 1,
        max_diameter: 0.5,
        min_diameter: 0.05,
        burial: [0.5, 0.5],
        clearings: Vec::new(),
        ground: Plane::ground(),
    };
    if ground.is_plane() {
        SphereField::rocks(&rocks).unwrap()
    } else {
        SphereField::rocks_on(&rocks, ground).unwrap()
    }
}

/// Waves of 0.1 m cells about the origin.
fn hills() -> HeightField {
    let wave = |k: i32| {
        let (x, z) = (f64::from(k % 501) * 0.1, f64::from(k / 501) * 0.1);
        #[allow(clippy::cast_possible_truncation)] // as maps are kept
        let height = (0.4 * (0.7 * x).sin() + 0.3 * (1.3 * z + 0.4 * x).sin()) as f32;
        height
    };
    let heights = (0..501 * 501).map(wave).collect();
    HeightField::new(heights, [501, 501], [0.1, 0.1], [-25.0, -25.0]).unwrap()
}

/// CPU time of this thread, or wall time where the system does not provide it, s.
fn seconds() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let statistics = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = statistics.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    let start = START.get_or_init(Instant::now);
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |time| time * 1e-9)
}

/// Mean time of a call, s.
fn time(mut call: impl FnMut()) -> f64 {
    let (start, mut calls) = (seconds(), 0.0);
    while calls < 3.0 || seconds() - start < ENOUGH {
        call();
        calls += 1.0;
    }
    (seconds() - start) / calls
}

fn camera(eye: Vector3<f64>) -> Vec<Ray> {
    let wide = (0.5 * 87.0_f64.to_radians()).tan();
    let (sine, cosine) = 20.0_f64.to_radians().sin_cos();
    let pixels = (0..ROWS).flat_map(|j| (0..COLUMNS).map(move |i| (i, j)));
    let ray = |(i, j): (i32, i32)| {
        let right = wide * (2.0 * (f64::from(i) + 0.5) / f64::from(COLUMNS) - 1.0);
        let up = wide / f64::from(COLUMNS) * f64::from(ROWS - 2 * j - 1);
        let direction = Vector3::new(cosine + sine * up, cosine * up - sine, right);
        Ray::new(eye, direction).unwrap()
    };
    pixels.map(ray).collect()
}

fn main() {
    let (plane, hills) = (Arc::new(Plane::ground()), Arc::new(hills()));
    let field = Arc::new(rocks(&*plane));
    println!("{} rocks", field.spheres().len());
    let on_hills = Union::new(vec![hills.clone(), Arc::new(rocks(&*hills))]).unwrap();
    let grounds: [(&str, Arc<dyn Terrain>); 4] = [
        ("plane", plane),
        ("rocks on a plane", field),
        ("height field, 501 x 501, 0.1 m", hills),
        ("rocks on the height field", Arc::new(on_hills)),
    ];
    println!(
        "{:<32} {:>10} {:>10} {:>10}",
        "ms a picture", "depth", "labels", "colour"
    );
    for (name, terrain) in grounds {
        let eye = Vector3::y() * (terrain.height(0.0, 0.0).unwrap() + 1.0);
        let (rays, look) = (camera(eye), look());
        let scene = PictureScene::new(&*terrain, None, None, Vec::new());
        let shot = |sun| Shot {
            range: 90.0,
            pixel: 0.006,
            sun,
        };
        let sun = Vector3::new(-0.35, 0.8, 0.5).normalize();
        let depth = time(|| drop(black_box(cast(&*terrain, black_box(&rays), 90.0))));
        let [labels, colour] = [None, Some(sun)]
            .map(|sun| time(|| drop(black_box(take(&scene, &look, black_box(&rays), &shot(sun))))));
        let [depth, labels, colour] = [depth, labels, colour].map(|time| 1e3 * time);
        println!("{name:<32} {depth:>10.1} {labels:>10.1} {colour:>10.1}");
    }
}
