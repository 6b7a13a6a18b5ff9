//! Which contacts a step must consider.

use nalgebra::Vector3;

use super::activation::Activation;
use super::contact_frame::ContactFrame;
use super::contact_point::{Contact, ContactKey, Part};
use super::sweep::{DEEP, first_touch};
use super::wheel_plane::{self, PlacedWheel};
use super::wheel_sphere::{self, NearestPoint};
use super::{box_plane, box_sphere};
use crate::geometry::{Primitive, Sphere, Terrain};
use crate::multibody::{Kinematics, Model, Wheel};

/// On a sphere: the nearest point of the pose.
const NEAREST: u16 = 0;

/// On a sphere: the point over the tangent plane where it was first met, for a part that passes it in this step.
const PASSING: u16 = 1;

/// Collects the contacts of a configuration with velocity `v` (nv) into `out`, cleared first.
///
/// `kinematics`: the poses at the step's midpoint, where they are measured; `end`: at its predicted end, which tells
/// the motion within the step. They are left where they were measured: see [`relocate`].
pub fn detect(
    model: &Model,
    kinematics: &Kinematics,
    end: &Kinematics,
    terrain: &dyn Terrain,
    v: &[f64],
    activation: &Activation,
    out: &mut Vec<Contact>,
) {
    out.clear();
    let mut gate = Gate {
        model,
        kinematics,
        v,
        activation,
        reach: activation.reach(),
        can_be_passed: terrain.can_be_passed(),
        out,
    };
    for i in 0..model.wheels().len() {
        wheel_candidates(i, end, terrain, &mut gate);
    }
    for i in 0..model.boxes().len() {
        box_candidates(i, end, terrain, &mut gate);
    }
}

/// Lets in the candidates that become contacts.
struct Gate<'a> {
    model: &'a Model,
    kinematics: &'a Kinematics,
    v: &'a [f64],
    activation: &'a Activation,
    reach: f64,
    can_be_passed: bool,
    out: &'a mut Vec<Contact>,
}

impl Gate<'_> {
    #[inline]
    fn offer(&mut self, contact: Contact) {
        let u_N = || {
            let velocity =
                self.kinematics
                    .point_velocity(self.model, contact.body, &contact.point, self.v);
            contact.frame.n.dot(&velocity)
        };
        if !self.activation.admits(contact.gap, u_N) {
            return;
        }
        self.out.push(contact);
    }

    /// A contact with a sphere: the nearest point's, or, where `touch` finds a normal, the passing one.
    ///
    /// `motion`: how far the part moves in half a step, at most.
    #[inline]
    fn offer_sphere(
        &mut self,
        (part, body, id): (Part, usize, u32),
        sphere: &Sphere,
        near: &NearestPoint,
        motion: f64,
        touch: impl FnOnce() -> Option<Vector3<f64>>,
    ) {
        let mut contact = Contact {
            key: ContactKey::new(part, usize::from(NEAREST), id),
            part,
            body,
            point: near.point,
            frame: near.frame,
            gap: near.gap,
        };
        if near.gap - motion < -DEEP * sphere.radius
            && let Some(n) = touch()
        {
            contact.key.feature = PASSING;
            contact.frame.n = n;
            self.out.push(contact);
        } else if near.gap <= self.reach {
            self.offer(contact);
        }
    }
}

fn wheel_candidates(i: usize, end: &Kinematics, terrain: &dyn Terrain, gate: &mut Gate<'_>) {
    let kinematics = gate.kinematics;
    let wheel = &gate.model.wheels()[i];
    let (part, body) = (Part::Wheel(i), wheel.body);
    let base = kinematics.origin(body);
    let placed = place_wheel(kinematics, wheel);
    let half_way = if gate.can_be_passed {
        end.origin(body) - base + end.point(body, &wheel.centre) - placed.centre
    } else {
        Vector3::zeros()
    };
    let motion = half_way.norm();
    terrain.visit_near(
        &(base + placed.centre),
        wheel.radius + gate.reach + motion,
        &mut |id, primitive| match primitive {
            Primitive::Plane(plane) => {
                wheel_plane::rim_points(&placed, plane, base, gate.reach, |p| {
                    gate.offer(Contact {
                        key: ContactKey::new(part, p.feature, id),
                        part,
                        body,
                        point: p.point,
                        frame: p.frame,
                        gap: p.gap,
                    });
                });
            }
            Primitive::Sphere(sphere) => {
                let aside = placed.axle.dot(&(sphere.centre - base - placed.centre));
                if aside.abs() > sphere.radius + gate.reach + motion {
                    return;
                }
                let near = wheel_sphere::nearest_point(&placed, sphere, base);
                gate.offer_sphere((part, body, id), sphere, &near, motion, || {
                    // The disc's axes are taken as those of the midpoint all along.
                    let middle = sphere.centre - base - placed.centre;
                    let distance = |x: &Vector3<f64>| {
                        let ball = Sphere {
                            centre: x + base + placed.centre,
                            radius: 0.0,
                        };
                        let near = wheel_sphere::nearest_point(&placed, &ball, base);
                        (near.frame.n, near.gap)
                    };
                    first_touch(distance, &middle, &(middle - half_way), sphere.radius)
                });
            }
        },
    );
}

fn box_candidates(i: usize, end: &Kinematics, terrain: &dyn Terrain, gate: &mut Gate<'_>) {
    let kinematics = gate.kinematics;
    let solid = &gate.model.boxes()[i];
    let (part, body) = (Part::Box(i), solid.body);
    let base = kinematics.origin(body);
    let R = kinematics.R[body] * solid.rotation;
    let centre = kinematics.point(body, &solid.centre);
    let end_centre = end.point(body, &solid.centre);
    let size = solid.half_size.norm();
    let motion = if gate.can_be_passed {
        (end.origin(body) - base + end_centre - centre).norm()
            + (end.R[body] - kinematics.R[body]).norm() * size
    } else {
        0.0
    };
    terrain.visit_near(
        &(base + centre),
        size + gate.reach + motion,
        &mut |id, primitive| match primitive {
            Primitive::Plane(plane) => {
                box_plane::corners(
                    &centre,
                    &R,
                    &solid.half_size,
                    plane,
                    base,
                    gate.reach,
                    |corner, point, gap| {
                        gate.offer(Contact {
                            key: ContactKey::new(part, corner, id),
                            part,
                            body,
                            point,
                            frame: ContactFrame::of_normal(plane.normal()),
                            gap,
                        });
                    },
                );
            }
            Primitive::Sphere(sphere) => {
                let local = R.tr_mul(&(sphere.centre - base - centre));
                let outside = (local.abs() - solid.half_size).map(|x| x.max(0.0));
                let within = sphere.radius + gate.reach + motion;
                if outside.norm_squared() > within * within {
                    return;
                }
                let near = box_sphere::nearest_point(&centre, &R, &solid.half_size, sphere, base);
                gate.offer_sphere((part, body, id), sphere, &near, motion, || {
                    let end_R = end.R[body] * solid.rotation;
                    let end = end_R.tr_mul(&(sphere.centre - end.origin(body) - end_centre));
                    let distance = |x: &Vector3<f64>| {
                        let (_, n, distance) = box_sphere::nearest_local(x, &solid.half_size);
                        (n, distance)
                    };
                    first_touch(distance, &local, &end, sphere.radius).map(|n| R * n)
                });
            }
        },
    );
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
    let base = kinematics.origin(contact.body);
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
        (_, Primitive::Sphere(sphere)) => relocate_on_sphere(model, kinematics, &sphere, contact),
    }
}

fn relocate_on_sphere(
    model: &Model,
    kinematics: &Kinematics,
    sphere: &Sphere,
    contact: &mut Contact,
) {
    let base = kinematics.origin(contact.body);
    let n = &contact.frame.n;
    let is_passing = contact.key.feature == PASSING;
    let near = match contact.part {
        Part::Wheel(i) => {
            let placed = place_wheel(kinematics, &model.wheels()[i]);
            if is_passing {
                wheel_sphere::point_over_tangent(&placed, n, &touch(sphere, n, base))
            } else {
                wheel_sphere::nearest_point(&placed, sphere, base)
            }
        }
        Part::Box(i) => {
            let solid = &model.boxes()[i];
            let R = kinematics.R[solid.body] * solid.rotation;
            let centre = kinematics.point(solid.body, &solid.centre);
            let half = &solid.half_size;
            if is_passing {
                box_sphere::point_over_tangent(&centre, &R, half, n, &touch(sphere, n, base))
            } else {
                box_sphere::nearest_point(&centre, &R, half, sphere, base)
            }
        }
    };
    (contact.point, contact.frame, contact.gap) = (near.point, near.frame, near.gap);
}

/// The sphere's point with the outward normal n, relative to `base`.
fn touch(sphere: &Sphere, n: &Vector3<f64>, base: &Vector3<f64>) -> Vector3<f64> {
    sphere.centre - base + n * sphere.radius
}

/// Gap, nearest point (relative to the trunk origin) and frame of every wheel over a terrain: the nearest primitive's.
///
/// A wheel with no primitive within 10 km (which no plane allows) keeps a gap of +∞.
#[must_use]
pub fn wheel_contacts(
    model: &Model,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
) -> Vec<Contact> {
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
        // What is not visited is further from the centre than `reach`, thus from the wheel than reach − R.
        let mut reach = 2.0 * wheel.radius;
        while reach < FAR && best.gap + wheel.radius > reach {
            look_around(&placed, kinematics, terrain, reach, &mut best);
            reach *= 2.0;
        }
        best
    };
    model.wheels().iter().enumerate().map(nearest).collect()
}

/// How far a wheel looks for the nearest ground, m.
const FAR: f64 = 1e4;

/// Enters the nearest primitive within `reach` of a wheel's centre into `best`, if it is nearer than that.
fn look_around(
    placed: &PlacedWheel,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
    reach: f64,
    best: &mut Contact,
) {
    let base = kinematics.origin(best.body);
    terrain.visit_near(&(base + placed.centre), reach, &mut |id, primitive| {
        let (point, frame, gap) = match primitive {
            Primitive::Plane(plane) => {
                let rim = wheel_plane::rim_point(placed, plane, base, 0);
                (rim.point, rim.frame, rim.gap)
            }
            Primitive::Sphere(sphere) => {
                let near = wheel_sphere::nearest_point(placed, sphere, base);
                (near.point, near.frame, near.gap)
            }
        };
        if gap < best.gap {
            best.key.primitive = id;
            (best.point, best.frame, best.gap) = (point, frame, gap);
        }
    });
}
