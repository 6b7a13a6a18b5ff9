//! Detection of the contacts with the ground that a step must consider.

use nalgebra::Vector3;

use super::activation::Activation;
use super::body_motion::{BodyMotion, Still};
use super::frame::ContactFrame;
use super::pair::{Contact, ContactKey, ON_SURFACE, Opposite};
use super::part::{Part, wheel_shape};
use super::ways_out::{OverSurfaces, TOUCH, WaysOut, shallow};
use crate::geometry::query::sweep::{DEEP, first_touch};
use crate::geometry::query::{
    SurfacePoint, box_sphere, disc_triangle, dispatch, is_lowest, roller_sphere, sphere_sphere,
};
use crate::geometry::{
    Coverage, Disc, Neighbourhood, PlacedShape, Primitive, Roller, Roundness, Sphere, SupportMap,
    Terrain,
};
use crate::law::compliance::Tread;
use crate::multibody::{Kinematics, Model};

/// On a sphere: the nearest point.
const NEAREST: usize = 0;

/// On a sphere: the point over the tangent plane at first contact, for a part that passes the
/// sphere within this step.
pub(super) const PASSING: u32 = 1;

/// Collects the ground contacts of a configuration with velocity `v` (nv) into `out`, which is
/// cleared first.
///
/// `kinematics`: poses at the step's midpoint, where gaps are measured. `end`: poses at the
/// predicted end of the step, which determine the motion within the step. The contacts keep the
/// geometry of the midpoint; see [`super::relocate`]. Returns a place (x, z, m) near the machine
/// where the ground is not known, if there is one.
pub fn detect(
    model: &Model,
    kinematics: &Kinematics,
    end: &Kinematics,
    terrain: &dyn Terrain,
    v: &[f64],
    activation: &Activation,
    out: &mut Vec<Contact>,
) -> Option<[f64; 2]> {
    out.clear();
    let machine = MovingMachine {
        model,
        middle: &Still::new(model.mechanism(), kinematics.poses(), v),
        end: &Still::new(model.mechanism(), end.poses(), v),
    };
    detect_parts(Part::all(model), &machine, terrain, activation, out)
}

/// A machine in a step: at its midpoint, where gaps and velocities are measured, and at its
/// predicted end.
#[derive(Clone, Copy)]
pub(crate) struct MovingMachine<'a, S> {
    pub model: &'a Model,
    pub middle: &'a S,
    pub end: &'a S,
}

/// [`detect`] for some parts; adds to `out`.
#[inline]
pub(crate) fn detect_parts<S: BodyMotion>(
    parts: impl Iterator<Item = Part>,
    machine: &MovingMachine<'_, S>,
    terrain: &dyn Terrain,
    activation: &Activation,
    out: &mut Vec<Contact>,
) -> Option<[f64; 2]> {
    let mut gate = Gate {
        machine,
        activation,
        reach: activation.hover,
        can_be_passed: terrain.can_be_passed(),
        unknown: None,
        ways: WaysOut::default(),
        out,
    };
    for part in parts {
        candidates(part, terrain, &mut gate);
    }
    gate.unknown
}

/// Deepest gap of any part with the ground, m; 0 where nothing overlaps.
#[must_use]
pub fn deepest_overlap(model: &Model, kinematics: &Kinematics, terrain: &dyn Terrain) -> f64 {
    let (at_rest, touching) = (vec![0.0; model.nv()], Activation::default());
    let mut contacts = Vec::new();
    detect(
        model,
        kinematics,
        kinematics,
        terrain,
        &at_rest,
        &touching,
        &mut contacts,
    );
    let gaps = contacts.iter().map(|contact| contact.gap);
    gaps.fold(0.0, f64::min)
}

/// Upper bound on the speed at which any place of the surface of a body's shape moves along its
/// normal, m/s.
///
/// A forecast follows material points, but only motion of the shape brings it to the ground: a
/// wheel that spins about its axle stays where it is, and a ball however it turns.
pub(crate) fn fastest_way<S: BodyMotion>(shape: &PlacedShape<'_>, body: usize, motion: &S) -> f64 {
    let centre = shape.centre();
    let velocity = motion.point_velocity(body, &centre);
    let beside = |arm: Vector3<f64>| {
        (motion.point_velocity(body, &(centre + arm)) - velocity).norm_squared()
    };
    let square = match shape.roundness() {
        Roundness::Ball => 0.0,
        Roundness::About(axle) => beside(axle),
        // Of ω × e along three axes.
        Roundness::None => {
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            0.5 * axes.into_iter().map(beside).sum::<f64>()
        }
    };
    velocity.norm() + square.sqrt() * shape.bound()
}

/// Admits the candidates that become contacts.
struct Gate<'a, S> {
    machine: &'a MovingMachine<'a, S>,
    activation: &'a Activation,
    reach: f64,
    can_be_passed: bool,
    unknown: Option<[f64; 2]>,
    ways: WaysOut,
    out: &'a mut Vec<Contact>,
}

/// A part and its placement.
struct Placed<'a> {
    part: Part,
    body: usize,
    shape: PlacedShape<'a>,
}

impl Placed<'_> {
    /// Contact of the part with the ground at a point of a primitive.
    #[inline]
    fn contact(&self, point: &SurfacePoint, primitive: u32) -> Contact {
        Contact {
            key: ContactKey::on_ground(self.part, point.feature, primitive),
            part: self.part,
            body: self.body,
            other: None,
            point: point.point,
            frame: ContactFrame::on_ground(&self.shape, point),
            gap: point.gap,
            excess: 0.0,
        }
    }
}

impl<S: BodyMotion> Gate<'_, S> {
    #[inline]
    fn offer(&mut self, placed: &Placed<'_>, point: &SurfacePoint, primitive: u32) {
        let u_N = || {
            let middle = self.machine.middle;
            point
                .n
                .dot(&middle.point_velocity(placed.body, &point.point))
        };
        if self.activation.admits(point.gap, u_N) {
            self.out.push(placed.contact(point, primitive));
        }
    }

    /// Removes contacts with a surface that do not lead out of it, among those of one part: the
    /// contacts from `first` on.
    #[cold]
    fn keep_ways_out(&mut self, first: usize, part: &OverSurfaces<'_>) {
        let Self { ways, out, .. } = self;
        ways.sift(part);
        let mut kept = first;
        for k in first..out.len() {
            let mut contact = out[k];
            let counts = match contact.key.opposite {
                Opposite::Ground(id) if contact.key.feature as usize & ON_SURFACE != 0 => {
                    let (x, n) = (contact.point, &contact.frame.n);
                    let point = SurfacePoint::of_normal(NEAREST, x, n, contact.gap);
                    let piece = part.terrain.primitive(id);
                    contact.excess = part.excess((id, &piece), &point);
                    contact.gap += contact.excess;
                    ways.counts(part, id, &point)
                }
                _ => true,
            };
            if counts {
                out[kept] = contact;
                kept += 1;
            }
        }
        out.truncate(kept);
    }

    /// A contact with a sphere: at the nearest point, or the passing one if `touch` finds a normal.
    ///
    /// `motion`: upper bound on the part's motion in half a step, m.
    #[inline]
    fn offer_sphere(
        &mut self,
        placed: &Placed<'_>,
        (primitive, sphere): (u32, &Sphere),
        near: &SurfacePoint,
        motion: f64,
        touch: impl FnOnce() -> Option<Vector3<f64>>,
    ) {
        if near.gap - motion < -DEEP * sphere.radius
            && let Some(n) = touch()
        {
            let mut contact = placed.contact(near, primitive);
            contact.key.feature = PASSING;
            contact.frame.n = n;
            self.out.push(contact);
        } else if near.gap <= self.reach {
            self.offer(placed, near, primitive);
        }
    }
}

/// Offers the ground contacts of one part.
#[inline]
fn candidates<S: BodyMotion>(part: Part, terrain: &dyn Terrain, gate: &mut Gate<'_, S>) {
    let MovingMachine { model, middle, end } = *gate.machine;
    let body = part.body(model);
    let base = &middle.origin(body);
    let (R, r) = middle.pose(body);
    let placed = Placed {
        part,
        body,
        shape: part.place_at(model, (&R, &r)),
    };
    let (centre, bound) = (placed.shape.centre(), placed.shape.bound());
    gate.reach = (gate.activation).reach(|| fastest_way(&placed.shape, placed.body, middle));
    let (half_way, motion) = if gate.can_be_passed {
        let (R_end, r_end) = end.pose(body);
        let half_way = end.origin(body) - base + (r_end + R_end * part.centre(model)) - centre;
        let turning = match placed.shape.roundness() {
            // Wheels are treated as balls; the sweep of others includes their rotation.
            Roundness::Ball => 0.0,
            Roundness::About(_) if placed.shape.wheel().is_some() => 0.0,
            Roundness::About(axle) => (R_end * R.tr_mul(&axle) - axle).norm() * bound,
            Roundness::None => (R_end - R).norm() * bound,
        };
        (half_way, half_way.norm() + turning)
    } else {
        (Vector3::zeros(), 0.0)
    };
    if let Coverage::Unknown(place) = terrain.coverage(&(base + centre), bound) {
        gate.unknown = Some(place);
    }
    let around = Neighbourhood {
        motion,
        ..Neighbourhood::new(&placed.shape, base, gate.reach)
    };
    let first = gate.out.len();
    let over = OverSurfaces {
        shape: &placed.shape,
        terrain,
        base,
        shallow: shallow(bound, part.own_tread(model)),
    };
    gate.ways.clear();
    let may_overlap = terrain.may_overlap();
    terrain.visit_around(&around, &mut |id, primitive| match primitive {
        Primitive::Plane(plane) => {
            dispatch::visit_on_plane(&placed.shape, plane, base, gate.reach, |point| {
                gate.offer(&placed, point, id);
            });
        }
        Primitive::Sphere(sphere) => {
            let between = sphere.centre - base - centre;
            if placed
                .shape
                .is_beyond(&between, sphere.radius + gate.reach + motion)
            {
                return;
            }
            let near = dispatch::point_on_sphere(&placed.shape, sphere, base);
            gate.offer_sphere(&placed, (id, sphere), &near, motion, || {
                touch(&placed, gate.machine, sphere, base, &half_way)
            });
        }
        piece => {
            let reach = gate.reach.max(TOUCH);
            visit_on_surface(&over, (id, piece), reach, |point| {
                gate.ways.add(id, point, over.shallow);
                gate.offer(&placed, &on_surface(point), id);
            });
        }
    });
    if gate.ways.are_doubtful() {
        gate.keep_ways_out(first, &over);
    }
    if may_overlap && gate.out.len() - first > 1 {
        drop_copies(gate.out, first, SAME * bound);
    }
}

/// Removes contacts that equal an earlier one, among those from `first` on, as where parts of the
/// ground coincide: at the same point and gap, within a distance (m).
#[cold]
fn drop_copies(contacts: &mut Vec<Contact>, first: usize, within: f64) {
    let mut kept = first;
    for k in first..contacts.len() {
        let own = contacts[k];
        let is_same = |other: &Contact| {
            (own.point - other.point).norm() <= within
                && (own.gap - other.gap).abs() <= within
                && (own.frame.n - other.frame.n).norm() <= SAME
        };
        if !contacts[first..kept].iter().any(is_same) {
            contacts[kept] = own;
            kept += 1;
        }
    }
    contacts.truncate(kept);
}

/// Difference of two contacts of a part that are the same, in bounding radii, and of their normals:
/// as parts of a ground meet.
const SAME: f64 = 1e-5;

/// Visits the points of a shape on a piece of a surface whose gap is at most `reach`, m.
///
/// One behind the piece's plane must be in the ground, and not only beyond the far side of a ridge
/// or a rock.
#[inline]
pub(crate) fn visit_on_surface(
    part: &OverSurfaces<'_>,
    (id, piece): (u32, &Primitive),
    reach: f64,
    mut visit: impl FnMut(&SurfacePoint),
) {
    let still = Vector3::zeros();
    let OverSurfaces {
        shape,
        terrain,
        base,
        shallow,
    } = *part;
    let is_covered = |point: &SurfacePoint| {
        terrain.may_overlap() && {
            let place = base + point.point - point.n * point.gap;
            terrain.is_buried(id, &place, &point.n)
        }
    };
    let overlaps = |point: &SurfacePoint| {
        !is_covered(point) && (point.gap >= -shallow || part.overlaps((id, piece), point, &still))
    };
    match piece {
        Primitive::Face(face) => dispatch::visit_on_face(shape, face, base, reach, |point| {
            if overlaps(point) {
                visit(point);
            }
        }),
        Primitive::Edge(edge) => dispatch::visit_at_edge(shape, edge, base, reach, |point| {
            if overlaps(point) {
                visit(point);
            }
        }),
        Primitive::Vertex(vertex) => {
            let near = dispatch::point_at_vertex(shape, vertex, base);
            let is_pushing = near.gap <= reach && dispatch::pushes(vertex, shape, &near.n);
            let is_near = is_pushing && !is_covered(&near);
            let within = || match shape {
                PlacedShape::Disc(disc) => disc_triangle::pierced(disc, vertex, &near, base),
                _ => Some(vertex.place - vertex.inward() * near.gap),
            };
            let pierces = || within().is_some_and(|place| terrain.is_inside(id, &place));
            if is_near && (overlaps(&near) || pierces()) {
                visit(&near);
            }
        }
        Primitive::Plane(_) | Primitive::Sphere(_) => {}
    }
}

/// The point with its feature marked.
#[inline]
fn on_surface(point: &SurfacePoint) -> SurfacePoint {
    SurfacePoint {
        feature: point.feature | ON_SURFACE,
        ..*point
    }
}

/// Normal from a sphere of the ground to a part at their first contact in this step, if the part
/// passes the sphere.
fn touch<S: BodyMotion>(
    placed: &Placed<'_>,
    machine: &MovingMachine<'_, S>,
    ground: &Sphere,
    base: &Vector3<f64>,
    half_way: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    match &placed.shape {
        PlacedShape::Disc(disc) => touch_of_wheel(&Roller::thin(*disc), ground, base, half_way),
        PlacedShape::Roller(roller) => touch_of_wheel(roller, ground, base, half_way),
        PlacedShape::Box(solid) => {
            let middle = solid.R.tr_mul(&(ground.centre - base - solid.centre));
            let (R, r) = machine.end.pose(placed.body);
            let PlacedShape::Box(at_end) = placed.part.place_at(machine.model, (&R, &r)) else {
                return None;
            };
            let origin = machine.end.origin(placed.body);
            let last = (at_end.R).tr_mul(&(ground.centre - origin - at_end.centre));
            let distance = |x: &Vector3<f64>| {
                let (_, n, distance) = box_sphere::nearest_local(x, &solid.half_size);
                (n, distance)
            };
            first_touch(distance, &middle, &last, ground.radius).map(|n| solid.R * n)
        }
        PlacedShape::Sphere(sphere) => {
            let middle = ground.centre - base - sphere.centre;
            let distance = |x: &Vector3<f64>| {
                let ball = Sphere::new(*x, 0.0);
                let own = Sphere::new(Vector3::zeros(), sphere.radius);
                let near = sphere_sphere::nearest_point(&own, &ball, &Vector3::zeros());
                (near.n, near.gap)
            };
            first_touch(distance, &middle, &(middle - half_way), ground.radius)
        }
        shape => {
            // The sphere's centre as the body at its midpoint sees it.
            let ((R, r), (R_end, r_end)) = (
                machine.middle.pose(placed.body),
                machine.end.pose(placed.body),
            );
            let middle = ground.centre - base;
            let from_end = ground.centre - machine.end.origin(placed.body) - r_end;
            let last = r + R * R_end.tr_mul(&from_end);
            let distance = |x: &Vector3<f64>| {
                let place = Sphere::new(*x, 0.0);
                let near = dispatch::point_on_sphere(shape, &place, &Vector3::zeros());
                (near.n, near.gap)
            };
            first_touch(distance, &middle, &last, ground.radius)
        }
    }
}

/// Normal from a sphere of the ground to a wheel at their first contact in a step, if the wheel
/// passes the sphere. The wheel moves by `half_way` (m) in half a step and keeps its midpoint axes
/// throughout.
pub(crate) fn touch_of_wheel(
    wheel: &Roller,
    ground: &Sphere,
    base: &Vector3<f64>,
    half_way: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let middle = ground.centre - base - wheel.core.centre;
    let distance = |x: &Vector3<f64>| {
        let ball = Sphere::new(x + wheel.core.centre, 0.0);
        let near = roller_sphere::nearest_point(wheel, &ball, &Vector3::zeros());
        (near.n, near.gap)
    };
    first_touch(distance, &middle, &(middle - half_way), ground.radius)
}

/// Gap, nearest point (relative to the trunk origin) and frame of every wheel over a terrain, as
/// [`wheel_contact`] gives them.
#[must_use]
pub fn wheel_contacts(
    model: &Model,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
) -> Vec<Contact> {
    let wheels = 0..model.wheels().len();
    wheels
        .map(|i| wheel_contact(model, kinematics, terrain, i))
        .collect()
}

/// Gap, nearest point (relative to the trunk origin) and frame of wheel `i` with respect to the
/// nearest primitive.
///
/// A wheel with no primitive within 10 km (impossible over a plane) keeps a gap of +∞.
#[must_use]
pub fn wheel_contact(
    model: &Model,
    kinematics: &Kinematics,
    terrain: &dyn Terrain,
    i: usize,
) -> Contact {
    let part = Part::Wheel(i);
    let (body, shape) = (
        part.body(model),
        wheel_shape(&model.wheels()[i], kinematics),
    );
    let mut best = SurfacePoint::of_normal(NEAREST, shape.centre(), &Vector3::y(), f64::INFINITY);
    let mut primitive = 0;
    let over = OverSurfaces {
        shape: &shape,
        terrain,
        base: kinematics.origin(body),
        shallow: shallow(shape.bound(), part.own_tread(model)),
    };
    visit_nearer(&over, &mut |id, point| {
        (best, primitive) = (*point, id);
    });
    Placed { part, body, shape }.contact(&best, primitive)
}

/// The gap of [`wheel_contact`], m, of a rigid disc whose coordinates have their origin at `base`
/// (m, world).
#[must_use]
pub fn disc_gap(disc: &Disc, base: &Vector3<f64>, terrain: &dyn Terrain) -> f64 {
    wheel_gap(&PlacedShape::Disc(*disc), None, base, terrain)
}

/// Gap between a wheel's shape, with or without a width, and a terrain, m, as [`wheel_contact`]
/// finds it; `tread`: of a wheel that yields, `base` as for [`disc_gap`].
#[must_use]
pub fn wheel_gap(
    shape: &PlacedShape<'_>,
    tread: Option<&Tread>,
    base: &Vector3<f64>,
    terrain: &dyn Terrain,
) -> f64 {
    // Only a surface, and no sphere or plane that may be nearer.
    if terrain.has_surface() && !terrain.can_be_passed() && terrain.ground().is_none() {
        let (centre, radius) = (base + shape.centre(), shape.bound());
        if let Some(plane) = terrain.level_near(&centre, 2.0 * radius) {
            let low = dispatch::lowest_on_plane(shape, &plane, base);
            if low.gap <= radius {
                return low.gap;
            }
        }
    }
    let mut gap = f64::INFINITY;
    let over = OverSurfaces {
        shape,
        terrain,
        base,
        shallow: shallow(shape.bound(), tread),
    };
    visit_nearer(&over, &mut |_, point| {
        gap = point.gap;
    });
    gap
}

/// Visits points of the ground near a wheel, each nearer than those before; the last one is the
/// nearest.
#[inline]
fn visit_nearer(over: &OverSurfaces<'_>, visit: &mut impl FnMut(u32, &SurfacePoint)) {
    let OverSurfaces {
        shape,
        terrain,
        base,
        shallow,
    } = *over;
    let radius = shape.bound();
    let mut gap = f64::INFINITY;
    let mut ways = WaysOut::default();
    let is_surface = terrain.has_surface();
    let is_soft = terrain.soft().is_some();
    let mut ahead = radius;
    if is_surface {
        // The ground under the wheel's lowest point is no nearer than the nearest.
        let low = base + shape.support(&-Vector3::y());
        let under = terrain.height(low.x, low.z).unwrap_or(low.y);
        ahead = (1.01 * (low.y - under)).max(CLOSE * radius);
    }
    // A primitive that is not visited is further from the wheel than this.
    while ahead < FAR {
        ways.clear();
        let mut take = |id: u32, point: &SurfacePoint| {
            if point.gap < gap {
                gap = point.gap;
                visit(id, point);
            }
        };
        let mut look = |id: u32, primitive: &Primitive| match primitive {
            Primitive::Plane(plane) => {
                take(id, &dispatch::lowest_on_plane(shape, plane, base));
            }
            Primitive::Sphere(sphere) => {
                take(id, &dispatch::point_on_sphere(shape, sphere, base));
            }
            piece => {
                visit_on_surface(over, (id, piece), f64::INFINITY, |point| {
                    if is_lowest(point.feature) {
                        ways.add(id, point, shallow);
                        if point.gap >= -shallow {
                            take(id, &on_surface(point));
                        }
                    }
                });
            }
        };
        if is_soft {
            // A wheel's neighbourhood leaves out the sand that it sinks into.
            terrain.visit_near(&(base + shape.centre()), radius + ahead, &mut look);
        } else {
            terrain.visit_around(&Neighbourhood::new(shape, base, ahead), &mut look);
        }
        if let Some((id, point)) = ways.deepest(over) {
            take(id, &on_surface(&point));
        }
        if gap <= ahead {
            if is_surface && !is_soft && gap > CLOSE * radius {
                look_all_around(over, gap, visit);
            }
            return;
        }
        ahead = if is_surface {
            2.0 * ahead
        } else {
            2.0 * ahead + radius
        };
    }
}

/// Visits points of a surface that are nearer to a wheel above it than a gap (m), each nearer than
/// those before.
///
/// The other searches are for what is about to touch: of a face they know what is over it and over
/// no other one. From well above steep ground the nearest place may be in a face that the wheel is
/// not over.
#[cold]
fn look_all_around(
    over: &OverSurfaces<'_>,
    mut gap: f64,
    visit: &mut impl FnMut(u32, &SurfacePoint),
) {
    let OverSurfaces {
        shape,
        terrain,
        base,
        ..
    } = *over;
    let within = shape.bound() + gap;
    terrain.visit_near(&(base + shape.centre()), within, &mut |id, piece| {
        let mut take = |point: &SurfacePoint| {
            if is_lowest(point.feature) && point.gap < gap && point.gap >= 0.0 {
                gap = point.gap;
                visit(id, &on_surface(point));
            }
        };
        match piece {
            Primitive::Plane(_) | Primitive::Sphere(_) => {}
            Primitive::Face(face) => {
                let low = dispatch::lowest_on_plane(shape, &face.plane, base);
                if face.has(&(base + low.point - low.n * low.gap)) {
                    take(&low);
                }
            }
            piece => visit_on_surface(over, (id, piece), f64::INFINITY, take),
        }
    });
}

/// How far beyond a wheel's rim a search on a surface looks first, in radii: its pieces are many,
/// and most wheels stand.
const CLOSE: f64 = 0.02;

/// Search distance of a wheel for the nearest ground, m.
const FAR: f64 = 1e4;
