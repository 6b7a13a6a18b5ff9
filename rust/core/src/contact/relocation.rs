//! Re-evaluates a contact in another configuration: the same feature of the same pair.

use nalgebra::Vector3;

use super::body_motion::{BodyMotion, Still};
use super::detection::PASSING;
use super::frame::ContactFrame;
use super::pair::{Contact, ON_SURFACE, Opposite, OtherSide};
use super::part::Part;
use super::rollers::turn_to_rollers;
use crate::geometry::query::{dispatch, pairs};
use crate::geometry::{PlacedShape, Primitive, Sphere, Terrain};
use crate::multibody::{Kinematics, Model};

/// Updates point, frame and gap of a contact to the poses of `kinematics`. A joint's stop and a
/// contact with a grain stay as they are.
pub fn relocate(
    model: &Model,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
    contact: &mut Contact,
) {
    let machine = Still::new(model.mechanism(), kinematics.poses(), &[]);
    relocate_to(model, &machine, terrain, contact);
}

/// Updates point, frame and gap of a contact to the poses of `motion`, as [`relocate`].
#[inline]
pub(crate) fn relocate_to(
    model: &Model,
    motion: &impl BodyMotion,
    terrain: &dyn Terrain,
    contact: &mut Contact,
) {
    let primitive = match (contact.key.opposite, contact.other) {
        (Opposite::Ground(primitive), _) => primitive,
        (Opposite::Part(_), Some(other)) => {
            relocate_pair(model, motion, other, contact);
            return;
        }
        (Opposite::Part(_), None) | (Opposite::Grain(_) | Opposite::Stop, _) => return,
    };
    let base = &motion.origin(contact.body);
    let feature = contact.key.feature as usize & !ON_SURFACE;
    let (R, r) = motion.pose(contact.body);
    let shape = contact.part.place_at(model, (&R, &r));
    let point = match terrain.primitive(primitive) {
        Primitive::Plane(plane) => dispatch::point_on_plane(&shape, &plane, base, feature),
        Primitive::Sphere(sphere) if contact.key.feature == PASSING => {
            let n = &contact.frame.n;
            dispatch::point_over_tangent(&shape, n, &touch(&sphere, n, base))
        }
        Primitive::Sphere(sphere) => dispatch::point_on_sphere(&shape, &sphere, base),
        Primitive::Face(face) => dispatch::point_on_plane(&shape, &face.plane, base, feature),
        Primitive::Edge(edge) => dispatch::point_at_edge(&shape, &edge, base, feature),
        Primitive::Vertex(vertex) => dispatch::point_at_vertex(&shape, &vertex, base),
    };
    contact.frame = ContactFrame::on_ground(&shape, &point);
    turn_to_rollers(model, contact);
    (contact.point, contact.gap) = (point.point, point.gap + contact.excess);
}

fn relocate_pair(model: &Model, motion: &impl BodyMotion, other: OtherSide, contact: &mut Contact) {
    let (first, second) = place_pair(model, motion, other.part, contact.part);
    let feature = contact.key.feature as usize;
    let point = pairs::point_of_pair(&first, &second, feature);
    contact.frame = ContactFrame::of_pair(&second, &point);
    (contact.point, contact.gap) = (point.point, point.gap);
}

/// Two parts, both relative to the origin of the second one's tree.
pub(super) fn place_pair<'a>(
    model: &'a Model,
    motion: &impl BodyMotion,
    first: Part,
    second: Part,
) -> (PlacedShape<'a>, PlacedShape<'a>) {
    let place = |part: Part| {
        let (R, r) = motion.pose(part.body(model));
        part.place_at(model, (&R, &r))
    };
    let shift = motion.origin(first.body(model)) - motion.origin(second.body(model));
    (place(first).moved(&shift), place(second))
}

/// The sphere's point with the outward normal n, relative to `base`.
fn touch(sphere: &Sphere, n: &Vector3<f64>, base: &Vector3<f64>) -> Vector3<f64> {
    sphere.centre - base + n * sphere.radius
}
