//! Machines with wide wheels that the tests share.

use rover_core::geometry::{Disc, PlacedShape, Roller};
use rover_core::multibody::{Model, ModelDescription};
use rover_core::nalgebra::{Rotation3, Vector3};

use crate::spheres::sphere_scenes::lone_wheel;

/// A model whose wheels all have this width and rounding, m, and are rigid.
pub fn widened(mut description: ModelDescription, width: f64, rounding: f64) -> Model {
    for wheel in &mut description.wheels {
        (wheel.width, wheel.rounding) = (Some(width), Some(rounding));
        wheel.stiffness = Some(0.0);
    }
    Model::from_description(description).unwrap()
}

/// The rover with wide wheels.
pub fn wide_rover(width: f64, rounding: f64) -> Model {
    widened(ModelDescription::rover(), width, rounding)
}

/// One wide wheel and nothing else, of the radius of [`lone_wheel`]. Its inertia is that of a solid
/// cylinder.
pub fn lone(width: f64, rounding: f64) -> Model {
    let mut description = lone_wheel().description().clone();
    let solid = &mut description.solids[0];
    let (m, r) = (solid.mass, description.wheels[0].radius);
    let across = m / 12.0 * (3.0 * r * r + width * width);
    solid.inertia = Some([across, across, 0.5 * m * r * r, 0.0, 0.0, 0.0]);
    widened(description, width, rounding)
}

/// Width and rounding of a wheel whose edges are rounded by this share of half the width.
pub fn roller(centre: [f64; 3], turn: [f64; 3], [radius, width, share]: [f64; 3]) -> Roller {
    let [a, b, c] = turn;
    let R = *Rotation3::from_euler_angles(a, b, c).matrix();
    let disc = Disc {
        centre: centre.into(),
        axle: R.column(2).into(),
        spoke: R.column(0).into(),
        radius,
    };
    Roller::new(disc, width, 0.5 * width * share)
}

/// Points of the whole surface, relative to the world, and the outward normals there: some
/// `around` the axle for each of about `across` places from side to side.
pub fn surface(roller: &Roller, around: u32, across: u32) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let (core, half, rounding) = (&roller.core, roller.half, roller.rounding);
    let side = core.axle.cross(&core.spoke);
    let share = |k: u32| f64::from(k) / f64::from(across);
    let mut profile = Vec::new();
    for k in 0..=across {
        let x = 2.0 * share(k) - 1.0;
        profile.push(([core.radius + rounding, half * x], [1.0, 0.0]));
        let angle = share(k) * std::f64::consts::FRAC_PI_2;
        for end in [-1.0, 1.0] {
            let (out, along) = (angle.cos(), end * angle.sin());
            let edge = [core.radius + rounding * out, end * half + rounding * along];
            profile.push((edge, [out, along]));
            let face = [core.radius * share(k), end * (half + rounding)];
            profile.push((face, [0.0, end]));
        }
    }
    let mut points = Vec::new();
    for j in 0..around {
        let phi = std::f64::consts::TAU * f64::from(j) / f64::from(around);
        let spoke = core.spoke * phi.cos() + side * phi.sin();
        points.extend(profile.iter().map(|([out, along], [n_out, n_along])| {
            let point = core.centre + spoke * *out + core.axle * *along;
            (point, spoke * *n_out + core.axle * *n_along)
        }));
    }
    points
}

/// The shape that contacts see.
pub fn shape(roller: &Roller) -> PlacedShape<'static> {
    PlacedShape::Roller(*roller)
}
