//! Detection of the contacts between a tree and balls: every part of the tree asks the grid of the
//! grains for those nearby.

use nalgebra::Vector3;

use super::contact::GrainTouch;
use crate::contact::body_motion::{BodyMotion, Still};
use crate::contact::detection::fastest_way;
use crate::contact::rollers::turn_to_rollers;
use crate::contact::{Activation, Contact, ContactFrame, ContactKey, Part};
use crate::geometry::query::{dispatch, pairs};
use crate::geometry::{PlacedShape, Sphere, SupportMap};
use crate::system::grains::search::Search;
use crate::system::grains::{COORDINATES, GrainKey, GrainSystem};
use crate::system::tree::TreeSystem;

/// A grain near a part.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearGrain {
    index: u32,
    /// World, m.
    centre: Vector3<f64>,
    /// m.
    radius: f64,
}

/// Finds the touches of a step, in the order of their keys. Both sides are placed and have found
/// their own contacts. `v`: velocities of the grains and of the tree.
pub(super) fn find(
    bed: &GrainSystem<'_, 3>,
    tree: &TreeSystem<'_>,
    v: (&[f64], &[f64]),
    activation: Activation,
    near: &mut Vec<NearGrain>,
    touches: &mut Vec<GrainTouch>,
) {
    touches.clear();
    let (model, middle) = (tree.model, tree.middle(v.1));
    let grains = &bed.scene.grains;
    #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
    let n = grains.len() as u32;
    for part in Part::all(model) {
        let shape = part.placed(model, &middle);
        let speed = fastest_way(&shape, part.body(model), &middle).max(bed.parts.search.fastest);
        let sizes = [grains.smallest(), grains.largest()];
        let search = Search::new(&activation, sizes, speed);
        let origin = middle.origin(part.body(model));
        let centre = origin + shape.centre();
        gather(bed, (&centre, &extent(&shape)), search.reach, near);
        for grain in &*near {
            let ball = ball(grain.centre - origin, grain.radius);
            pairs::visit_pair(&ball, &shape, search.reach, |point| {
                let mut touch = GrainTouch {
                    key: GrainKey {
                        a: n + u32::from(part.code()),
                        b: grain.index,
                    },
                    contact: Contact {
                        key: ContactKey::on_grain(part, point.feature, grain.index),
                        part,
                        body: part.body(model),
                        other: None,
                        point: point.on_second(),
                        frame: ContactFrame::of_pair(&shape, point),
                        gap: point.gap,
                        excess: 0.0,
                    },
                    gap_start: point.gap,
                };
                turn_to_rollers(model, &mut touch.contact);
                if search.admits(point.gap, approach_of(bed, &middle, &touch, v.0)) {
                    touches.push(touch);
                }
            });
        }
    }
    touches.sort_by_key(|touch| touch.key);
}

/// Gap of a touch where both sides are at the end of the step, m.
pub(super) fn gap_at_end(
    bed: &GrainSystem<'_, 3>,
    tree: &TreeSystem<'_>,
    touch: &GrainTouch,
) -> f64 {
    let (model, end) = (tree.model, tree.end(&[]));
    let (part, i) = (touch.contact.part, touch.grain() as usize);
    let centre = Vector3::from_column_slice(&bed.parts.end[COORDINATES * i..][..3]);
    let origin = end.origin(part.body(model));
    let ball = ball(centre - origin, bed.scene.grains.radius()[i]);
    dispatch::nearest_points(&ball, &part.placed(model, &end)).gap
}

fn ball(centre: Vector3<f64>, radius: f64) -> PlacedShape<'static> {
    PlacedShape::Sphere(Sphere { centre, radius })
}

/// Normal velocity of a touch's two sides, m/s.
fn approach_of(bed: &GrainSystem<'_, 3>, middle: &Still<'_>, touch: &GrainTouch, v: &[f64]) -> f64 {
    let Contact {
        body, point, frame, ..
    } = &touch.contact;
    let own = middle.point_velocity(*body, point);
    let mut u = [frame.n.dot(&own), 0.0, 0.0];
    bed.subtract_point(touch.pushed(), v, &frame.rows(), &mut u);
    u[0]
}

/// Half sides of a box with the world's axes about a shape, m.
fn extent(shape: &PlacedShape<'_>) -> Vector3<f64> {
    let centre = shape.centre();
    let along = |e: &Vector3<f64>| (shape.support(e) - centre).dot(e);
    Vector3::new(
        along(&Vector3::x()),
        along(&Vector3::y()),
        along(&Vector3::z()),
    )
}

/// Grains within `reach` (m) of a box about a place, in the order of their numbers.
fn gather(
    bed: &GrainSystem<'_, 3>,
    (centre, half): (&Vector3<f64>, &Vector3<f64>),
    reach: f64,
    near: &mut Vec<NearGrain>,
) {
    near.clear();
    let reach = reach + bed.scene.grains.largest();
    let place: [f64; 3] = (*centre).into();
    bed.parts.grid.near(&place, half.max() + reach, |item| {
        let apart = Vector3::from(item.centre) - centre;
        if apart.iter().zip(half).all(|(x, h)| x.abs() <= h + reach) {
            near.push(NearGrain {
                index: item.index,
                centre: item.centre.into(),
                radius: item.radius,
            });
        }
    });
    near.sort_unstable_by_key(|grain| grain.index);
}
