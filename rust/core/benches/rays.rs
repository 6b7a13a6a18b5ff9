//! Rays a second on each kind of ground, on one thread.
//!
//! Run: `cargo bench -p rover-core --bench rays`. It only reports. A depth camera of 160 x 120
//! pixels looks 20 degrees down from 1 m above the ground, with a view of 87 by 58 degrees; a laser
//! scanner of 16 rings of 720 rays, 2 degrees apart, turns at the same place. Both reach 20 m. The
//! figures are means over pictures for at least half a second, in CPU time where Linux tells it.

#![allow(clippy::print_stdout)] // a bench prints
#![allow(clippy::unwrap_used)] // and stops where its own scenes are wrong

use std::f64::consts::TAU;
use std::hint::black_box;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use nalgebra::Vector3;
use rover_core::geometry::ray::{Ray, cast};
use rover_core::geometry::{HeightField, Plane, SphereField, Terrain, TriangleMesh, Union};
use rover_core::nalgebra;

/// Least time spent on a measurement, s.
const ENOUGH: f64 = 0.5;
const RANGE: f64 = 20.0;

/// Heights of waves of several lengths, m.
fn height(x: f64, z: f64) -> f64 {
    let waves = [(9.0, 0.4), (4.1, 0.2), (1.9, 0.08), (0.83, 0.03)];
    let of_wave = |(length, height): &(f64, f64)| {
        height * ((TAU * x / length).sin() + (TAU * (0.6 * x + 0.8 * z) / length).sin())
    };
    waves.iter().map(of_wave).sum()
}

/// A map of n x n heights about the origin.
fn map(n: u32, cell: f64) -> HeightField {
    let half = 0.5 * f64::from(n - 1) * cell;
    let at = |k: u32| f64::from(k) * cell - half;
    #[allow(clippy::cast_possible_truncation)] // as maps are kept
    let heights = (0..n * n).map(|k| height(at(k % n), at(k / n)) as f32);
    let shape = [n as usize; 2];
    HeightField::new(heights.collect(), shape, [cell; 2], [-half; 2]).unwrap()
}

/// Triangle mesh of the heights of a map.
fn mesh(field: &HeightField) -> TriangleMesh {
    let [rows, columns] = field.shape();
    let ([dx, dz], [x, z]) = (field.spacing(), field.origin());
    let corner = |k: usize| {
        let (i, j) = ((k % columns) as f64, (k / columns) as f64);
        [x + i * dx, f64::from(field.heights()[k]), z + j * dz]
    };
    let corners: Vec<_> = (0..rows * columns).map(corner).collect();
    let mut triangles = Vec::new();
    for j in 0..rows - 1 {
        for i in 0..columns - 1 {
            let at = j * columns + i;
            triangles.push([at, at + columns + 1, at + 1]);
            triangles.push([at, at + columns, at + columns + 1]);
        }
    }
    TriangleMesh::new(&corners, &triangles).unwrap()
}

/// Rocks of 3 to 25 cm, one per 0.25 m².
fn rocks(n: u32, ground: Option<Plane>) -> SphereField {
    let side = (f64::from(n) * 0.25).sqrt();
    let mut state = 1_u64;
    let mut uniform = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 * 2.0_f64.powi(-53)
    };
    let mut centres = Vec::new();
    let mut radii = Vec::new();
    for _ in 0..n {
        let (x, z) = (side * (uniform() - 0.5), side * (uniform() - 0.5));
        let y = if ground.is_some() { 0.0 } else { height(x, z) };
        radii.push(0.03 + 0.22 * uniform().powi(3));
        centres.push([x, y, z]);
    }
    SphereField::new(&centres, &radii, ground).unwrap()
}

/// CPU time of this thread, or wall time where the system does not provide it, s.
fn seconds() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let statistics = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = statistics.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    let start = START.get_or_init(Instant::now);
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |time| time * 1e-9)
}

fn camera(eye: Vector3<f64>) -> Vec<Ray> {
    let (columns, rows) = (160, 120);
    let [wide, high] = [87.0_f64, 58.0].map(|angle| (0.5 * angle.to_radians()).tan());
    let down = 20.0_f64.to_radians();
    let pixels = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
    let ray = |(i, j): (i32, i32)| {
        let right = wide * (2.0 * (f64::from(i) + 0.5) / f64::from(columns) - 1.0);
        let up = high * (1.0 - 2.0 * (f64::from(j) + 0.5) / f64::from(rows));
        let (sine, cosine) = down.sin_cos();
        let direction = Vector3::new(cosine + sine * up, cosine * up - sine, right);
        Ray::new(eye, direction).unwrap()
    };
    pixels.map(ray).collect()
}

fn scanner(eye: Vector3<f64>) -> Vec<Ray> {
    let rings = (0..16).map(|k| (2.0 * f64::from(k) - 15.0).to_radians());
    let ring = |rise: f64| {
        (0..720).map(move |k| {
            let around = TAU * f64::from(k) / 720.0;
            let flat = rise.cos();
            let direction = Vector3::new(flat * around.cos(), rise.sin(), flat * around.sin());
            Ray::new(eye, direction).unwrap()
        })
    };
    rings.flat_map(ring).collect()
}

fn main() {
    let field = map(501, 0.1);
    let grounds: [(&str, Arc<dyn Terrain>); 7] = [
        ("plane", Arc::new(Plane::ground())),
        (
            "2000 rocks on a plane",
            Arc::new(rocks(2000, Some(Plane::ground()))),
        ),
        (
            "100 000 rocks on a plane",
            Arc::new(rocks(100_000, Some(Plane::ground()))),
        ),
        ("height field, 501 x 501, 0.1 m", Arc::new(field.clone())),
        (
            "height field, 2001 x 2001, 0.025 m",
            Arc::new(map(2001, 0.025)),
        ),
        ("mesh, 500 000 triangles", Arc::new(mesh(&field))),
        (
            "2000 rocks on the height field",
            Arc::new(Union::new(vec![Arc::new(field), Arc::new(rocks(2000, None))]).unwrap()),
        ),
    ];
    let eye = |terrain: &dyn Terrain| {
        let ground = terrain.height(0.0, 0.0).unwrap();
        Vector3::new(0.0, ground + 1.0, 0.0)
    };
    println!(
        "{:<36} {:>12} {:>12}  met",
        "million rays a second", "depth image", "laser scan"
    );
    for (name, terrain) in grounds {
        let eye = eye(&*terrain);
        let views = [camera(eye), scanner(eye)];
        let mut met = Vec::new();
        let mut rates = Vec::new();
        for rays in &views {
            let hits = cast(&*terrain, rays, RANGE);
            met.push(hits.iter().flatten().count() as f64 / rays.len() as f64);
            let (start, mut pictures) = (seconds(), 0);
            while pictures < 3 || seconds() - start < ENOUGH {
                black_box(cast(&*terrain, black_box(rays), RANGE));
                pictures += 1;
            }
            let spent = seconds() - start;
            rates.push((rays.len() * pictures) as f64 / spent * 1e-6);
        }
        println!(
            "{name:<36} {:>12.2} {:>12.2}  {:.0}%, {:.0}%",
            rates[0],
            rates[1],
            100.0 * met[0],
            100.0 * met[1]
        );
    }
}
