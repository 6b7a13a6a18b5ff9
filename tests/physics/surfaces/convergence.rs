//! A smooth surface is met to second order of the spacing.

use rover_core::contact::detection::disc_gap;
use rover_core::nalgebra::Vector3;

use super::surface_scenes::{disc, map};
use crate::rover::scenes::order;

#[test]
fn gaps_over_a_sine_converge_with_the_square_of_the_spacing() {
    let sine = |x: f64, z: f64| 0.1 * (2.0 * x + 0.7).sin() * (1.5 * z).cos();
    let gaps = |spacing: f64| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole, positive
        let field = map((4.0 / spacing).round() as u32, spacing, sine);
        let places = (0..60).map(|k| {
            let s = f64::from(k) / 60.0;
            let (heading, lean) = (3.0 * s, 0.2 * (9.0 * s).sin());
            let axle = Vector3::new(heading.sin(), lean, heading.cos()).normalize();
            let (x, z) = (-1.4 + 2.8 * s, 1.2 * (5.0 * s).sin());
            let centre = Vector3::new(x, sine(x, z) + 0.25, z);
            let disc = disc(centre, axle, 0.2);
            disc_gap(&disc, &Vector3::zeros(), &field)
        });
        places.collect::<Vec<_>>()
    };
    let reference = gaps(1.0 / 512.0);
    let spacings = [0.25, 0.125, 0.0625, 0.03125];
    let errors = spacings.map(|spacing| {
        let errors = gaps(spacing);
        let squares = errors.iter().zip(&reference).map(|(a, b)| (a - b).powi(2));
        (squares.sum::<f64>() / reference.len() as f64).sqrt()
    });
    let order = order(&spacings, &errors);
    assert!((1.8..2.3).contains(&order), "{order}: {errors:?}");
}
