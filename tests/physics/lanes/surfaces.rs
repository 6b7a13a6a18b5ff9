//! Height fields for the lanes' tests.

use std::sync::Arc;

use rover_core::geometry::{HeightField, Rocks, SphereField, Terrain, Union};

/// At least 8 m wide.
fn map(spacing: f64, height: impl Fn(f64, f64) -> f64) -> Arc<HeightField> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few hundred
    let half = (4.0 / spacing).ceil().max(40.0) as usize;
    let n = 2 * half + 1;
    let low = -(half as f64) * spacing;
    #[allow(clippy::cast_possible_truncation)] // a map is single
    let heights = (0..n * n)
        .map(|k| {
            height(
                low + spacing * (k % n) as f64,
                low + spacing * (k / n) as f64,
            ) as f32
        })
        .collect();
    Arc::new(HeightField::new(heights, [n, n], [spacing; 2], [low; 2]).unwrap())
}

pub fn level(spacing: f64) -> Arc<dyn Terrain> {
    map(spacing, |_, _| 0.0)
}

fn waves(spacing: f64, seed: u64) -> Arc<HeightField> {
    let phase = seed as f64;
    map(spacing, |x, z| {
        0.04 * (2.0 * x + phase).sin() * (1.5 * z + 2.0 * phase).cos() + 0.01 * (7.0 * x - z).sin()
    })
}

pub fn hills(spacing: f64, seed: u64) -> Arc<dyn Terrain> {
    waves(spacing, seed)
}

pub fn hills_with_rocks(seed: u64) -> Arc<dyn Terrain> {
    let hills = waves(0.2, seed);
    let rocks = Rocks {
        abundance: 0.05,
        area: [12.0, 12.0],
        seed,
        max_diameter: 0.2,
        ..Rocks::default()
    };
    let rocks = SphereField::rocks_on(&rocks, &*hills).unwrap();
    Arc::new(Union::new(vec![hills, Arc::new(rocks)]).unwrap())
}
