//! Re-evaluates a contact in another configuration: the same feature of the same pair.

use nalgebra::Vector3;

use super::detection::PASSING;
use super::frame::ContactFrame;
use super::pair::{Contact, ON_SURFACE, Opposite, OtherSide};
use super::part::Part;
use crate::geometry::query::dispatch;
use crate::geometry::{PlacedShape, Primitive, Sphere, Terrain};
use crate::multibody::{Kinematics, Model};

/// Updates point, frame and gap of a contact to the poses of `kinematics`. For a joint's stop use
/// [`super::relocate_limit`]; one with a grain stays as it is.
pub fn relocate(
    model: &Model,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
    contact: &mut Contact,
) {
    let primitive = match (contact.key.opposite, contact.other) {
        (Opposite::Ground(primitive), _) => primitive,
        (Opposite::Part(_), Some(other)) => {
            relocate_pair(model, kinematics, other, contact);
            return;
        }
        (Opposite::Part(_), None) | (Opposite::Grain(_) | Opposite::Stop, _) => return,
    };
    let base = kinematics.origin(contact.body);
    let feature = usize::from(contact.key.feature) & !ON_SURFACE;
    let shape = contact.part.place(model, kinematics);
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
    (contact.point, contact.gap) = (point.point, point.gap + contact.excess);
}

fn relocate_pair(model: &Model, kinematics: &Kinematics, other: OtherSide, contact: &mut Contact) {
    let (first, second) = place_pair(model, kinematics, other.part, contact.part);
    let feature = usize::from(contact.key.feature);
    let point = dispatch::point_of_pair(&first, &second, feature);
    contact.frame = ContactFrame::of_pair(&second, &point);
    (contact.point, contact.gap) = (point.point, point.gap);
}

/// Two parts, both relative to the origin of the second one's tree.
pub(super) fn place_pair(
    model: &Model,
    kinematics: &Kinematics,
    first: Part,
    second: Part,
) -> (PlacedShape, PlacedShape) {
    let shift = kinematics.origin(first.body(model)) - kinematics.origin(second.body(model));
    let mut shape = first.place(model, kinematics);
    match &mut shape {
        PlacedShape::Disc(disc) => disc.centre += shift,
        PlacedShape::Roller(roller) => roller.core.centre += shift,
        PlacedShape::Box(solid) => solid.centre += shift,
        PlacedShape::Sphere(sphere) => sphere.centre += shift,
    }
    (shape, second.place(model, kinematics))
}

/// The sphere's point with the outward normal n, relative to `base`.
fn touch(sphere: &Sphere, n: &Vector3<f64>, base: &Vector3<f64>) -> Vector3<f64> {
    sphere.centre - base + n * sphere.radius
}
