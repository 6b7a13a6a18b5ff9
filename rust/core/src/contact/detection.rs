//! Which contacts a step must consider.

use nalgebra::Vector3;

use super::box_plane;
use super::contact_frame::ContactFrame;
use super::contact_point::{Contact, ContactKey, Part};
use super::wheel_plane::{self, PlacedWheel};
use crate::geometry::{Primitive, Terrain};
use crate::multibody::{Kinematics, Model, Wheel};

/// When a candidate becomes a contact of the step: `gap + lead · u_N ≤ 0`, or nearly at rest within `hover`.
///
/// The first is the forecast of Moreau–Jean stepping; `lead` is what is left of γ h after the configuration that the
/// gap was measured in. The second keeps a contact that rests a rounding error above the ground closed, instead of
/// letting it fall for a step: within `hover` metres and slower than `slow` m/s.
#[derive(Clone, Copy, Debug, Default)]
pub struct Activation {
    /// s.
    pub lead: f64,
    /// m.
    pub hover: f64,
    /// m/s.
    pub slow: f64,
    /// m: a bound of `|lead · u_N|` over the machine, so that the search knows how far to look.
    pub margin: f64,
}

/// Collects the contacts of a configuration with velocity `v` (nv) into `out`, cleared first.
pub fn detect(
    model: &Model,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
    v: &[f64],
    activation: &Activation,
    out: &mut Vec<Contact>,
) {
    out.clear();
    let reach = activation.hover.max(activation.margin);
    let base = &kinematics.base;
    let mut offer = |contact: Contact| {
        let is_touching = contact.gap <= 0.0;
        if activation.lead.abs() > 0.0 || !is_touching {
            let u_N = contact.frame.n.dot(&kinematics.point_velocity(
                model,
                contact.body,
                &contact.point,
                v,
            ));
            let forecast = contact.gap + activation.lead * u_N;
            let is_hovering = contact.gap <= activation.hover && u_N.abs() <= activation.slow;
            if forecast > 0.0 && !is_hovering {
                return;
            }
        }
        out.push(contact);
    };
    for (i, wheel) in model.wheels().iter().enumerate() {
        let placed = place_wheel(kinematics, wheel);
        let part = Part::Wheel(i);
        terrain.visit_near(
            &(base + placed.centre),
            wheel.radius + reach,
            &mut |id, primitive| match primitive {
                Primitive::Plane(plane) => {
                    wheel_plane::rim_points(&placed, plane, base, reach, |p| {
                        offer(Contact {
                            key: ContactKey::new(part, p.feature, id),
                            part,
                            body: wheel.body,
                            point: p.point,
                            frame: p.frame,
                            gap: p.gap,
                        });
                    });
                }
            },
        );
    }
    for (i, solid) in model.boxes().iter().enumerate() {
        let R = kinematics.R[solid.body] * solid.rotation;
        let centre = kinematics.point(solid.body, &solid.centre);
        let part = Part::Box(i);
        terrain.visit_near(
            &(base + centre),
            solid.half_size.norm() + reach,
            &mut |id, primitive| match primitive {
                Primitive::Plane(plane) => {
                    box_plane::corners(
                        &centre,
                        &R,
                        &solid.half_size,
                        plane,
                        base,
                        reach,
                        |corner, point, gap| {
                            offer(Contact {
                                key: ContactKey::new(part, corner, id),
                                part,
                                body: solid.body,
                                point,
                                frame: ContactFrame::of_normal(plane.normal()),
                                gap,
                            });
                        },
                    );
                }
            },
        );
    }
}

fn place_wheel(kinematics: &Kinematics, wheel: &Wheel) -> PlacedWheel {
    let R = &kinematics.R[wheel.body];
    PlacedWheel {
        centre: kinematics.point(wheel.body, &wheel.centre),
        axle: R * wheel.axle,
        spoke: R * wheel.spoke,
        radius: wheel.radius,
    }
}

/// Point, frame and gap of a contact in another configuration: the same feature on the same primitive.
pub fn relocate(
    model: &Model,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
    contact: &mut Contact,
) {
    let base = &kinematics.base;
    let feature = usize::from(contact.key.feature);
    match (contact.part, terrain.primitive(contact.key.primitive)) {
        (Part::Wheel(i), Primitive::Plane(plane)) => {
            let placed = place_wheel(kinematics, &model.wheels()[i]);
            let rim = wheel_plane::rim_point(&placed, &plane, base, feature);
            (contact.point, contact.frame, contact.gap) = (rim.point, rim.frame, rim.gap);
        }
        (Part::Box(i), Primitive::Plane(plane)) => {
            let solid = &model.boxes()[i];
            let R = kinematics.R[solid.body] * solid.rotation;
            let centre = kinematics.point(solid.body, &solid.centre);
            contact.point = box_plane::corner(&centre, &R, &solid.half_size, feature);
            contact.gap = plane.distance(&(base + contact.point));
        }
    }
}

/// Gap, lowest point (relative to the trunk origin) and frame of every wheel over a terrain: the nearest primitive's.
///
/// A wheel that no primitive is near (which no plane allows) keeps a gap of +∞.
#[must_use]
pub fn wheel_contacts(
    model: &Model,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
) -> Vec<Contact> {
    let base = &kinematics.base;
    let nearest = |(i, wheel): (usize, &Wheel)| {
        let placed = place_wheel(kinematics, wheel);
        let mut best = Contact {
            key: ContactKey::new(Part::Wheel(i), 0, 0),
            part: Part::Wheel(i),
            body: wheel.body,
            point: placed.centre,
            frame: ContactFrame::of_wheel(&Vector3::y(), &placed.axle, &placed.spoke),
            gap: f64::INFINITY,
        };
        terrain.visit_near(
            &(base + placed.centre),
            f64::INFINITY,
            &mut |id, primitive| match primitive {
                Primitive::Plane(plane) => {
                    wheel_plane::rim_points(&placed, plane, base, f64::INFINITY, |p| {
                        if p.feature == 0 && p.gap < best.gap {
                            best.key.primitive = id;
                            (best.point, best.frame, best.gap) = (p.point, p.frame, p.gap);
                        }
                    });
                }
            },
        );
        best
    };
    model.wheels().iter().enumerate().map(nearest).collect()
}
