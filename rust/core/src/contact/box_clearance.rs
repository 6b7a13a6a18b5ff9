//! How far a box is from the surfaces of a terrain, by a plane between them.
//!
//! Most boxes of a rover are clear of the ground. A plane with the box on one side and all places
//! of the surface around it on the other says so at a small part of the cost of its pieces.

use nalgebra::Vector3;

use crate::geometry::{OrientedBox, SupportMap, Terrain};

/// A distance (m) larger than `need` that no piece of a surface comes nearer to the box than, if a
/// plane shows one: level, along the box, or along the slope under it.
///
/// Coordinates are the world's. `ahead`: distances (m) around the box that are looked at with the
/// level plane and with the others, which the result does not exceed.
pub(crate) fn over_surfaces(
    terrain: &dyn Terrain,
    solid: &OrientedBox,
    ahead: [f64; 2],
    need: f64,
) -> Option<f64> {
    let bound = solid.bound();
    let over = |n: &Vector3<f64>, ahead: f64| {
        let from = n.dot(&solid.support(&-n));
        let clearance = from - terrain.furthest(n, &solid.centre, bound + ahead);
        Some(clearance.min(ahead)).filter(|clearance| *clearance > need)
    };
    let [level, tilted] = ahead;
    over(&Vector3::y(), level)
        .or_else(|| over(&most_upright(solid), tilted))
        .or_else(|| over(&slope_under(terrain, &solid.centre, bound)?, tilted))
}

/// The axis of a box that is nearest to the vertical, pointing up.
fn most_upright(solid: &OrientedBox) -> Vector3<f64> {
    let rises = |k: usize| solid.R[(1, k)].abs();
    let axis = solid.axis((1..3).fold(0, |best, k| if rises(k) > rises(best) { k } else { best }));
    axis * axis.y.signum()
}

/// Unit normal of the mean slope of a surface within `radius` (m) of `centre`, seen from above.
fn slope_under(terrain: &dyn Terrain, centre: &Vector3<f64>, radius: f64) -> Option<Vector3<f64>> {
    let height = |x: f64, z: f64| terrain.height(centre.x + x, centre.z + z);
    let along = height(radius, 0.0)? - height(-radius, 0.0)?;
    let across = height(0.0, radius)? - height(0.0, -radius)?;
    Some(Vector3::new(-along, 2.0 * radius, -across).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{HeightField, Primitive};
    use nalgebra::{Matrix3, UnitQuaternion};
    use proptest::prelude::*;

    proptest! {
        /// No vertex of the map, and no corner of the box, is nearer than the clearance.
        #[test]
        fn nothing_is_nearer_than_the_clearance(
            heights in prop::collection::vec(-0.1_f32..0.1, 81),
            turn in prop::array::uniform3(-0.6..0.6_f64),
            centre in [-0.2..0.2, 0.1..0.6, -0.2..0.2_f64],
            half_size in prop::array::uniform3(0.03..0.2_f64),
        ) {
            let field = HeightField::new(heights, [9, 9], [0.15; 2], [-0.6; 2]).unwrap();
            let R: Matrix3<f64> = *UnitQuaternion::from_euler_angles(turn[0], turn[1], turn[2])
                .to_rotation_matrix()
                .matrix();
            let solid = OrientedBox { centre: centre.into(), R, half_size: half_size.into() };
            let Some(clearance) = over_surfaces(&field, &solid, [0.3, 0.1], 0.0) else {
                return Ok(());
            };
            field.visit_near(&solid.centre, 2.0, &mut |_, piece| {
                if let Primitive::Vertex(vertex) = piece {
                    let local = solid.R.tr_mul(&(vertex.place - solid.centre));
                    let outside = (local.abs() - solid.half_size).map(|x| x.max(0.0));
                    assert!(outside.norm() >= clearance - 1e-12);
                }
            });
            for k in 0..8 {
                let sign = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
                let corner = solid.half_size.component_mul(&Vector3::new(sign(0), sign(1), sign(2)));
                let corner = solid.centre + solid.R * corner;
                let surface = field.height(corner.x, corner.z).unwrap_or(f64::NEG_INFINITY);
                prop_assert!(corner.y - surface >= clearance - 1e-12);
            }
        }
    }
}
