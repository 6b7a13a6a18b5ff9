//! A multibody tree among balls: the contacts of its wheels, boxes and balls with the grains.
//!
//! The law is that of the grains ([`super::grains`]): frames are those of the start of the step,
//! and a pair may close by its gap. Both sides are pushed at the same point, that of the grain's
//! surface, so the impulses conserve linear and angular momentum. All contacts of a step, among
//! grains and of the tree, are one problem, solved on the bodies' velocities
//! ([`crate::problem::BodyPairs`]): forces go both ways within the step.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::composite::Coupling;
use super::grains::search::Search;
use super::grains::system::gap_law;
use super::grains::{COORDINATES, GrainKey, GrainSystem};
use super::tree::{TreeScratch, TreeSystem};
use crate::contact::{
    Activation, Contact, ContactFrame, ContactKey, ContactSystem, Part, generalized_impulse,
};
use crate::geometry::query::dispatch;
use crate::geometry::{PlacedShape, Sphere, SupportMap};
use crate::integrator::{StepOptions, UnilateralContact};
use crate::multibody::{Kinematics, Model};
use crate::solver::{ManyBodies, SolveReport, SolverOptions, SolverWorkspace, solve_many_bodies};

/// A contact of a part of the tree with a grain. Its normal points from the grain to the part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GrainTouch {
    /// Its key among all contacts of grains: the part's code after the grains, then the grain.
    pub key: GrainKey,
    /// As a contact of the tree.
    pub contact: Contact,
    /// Gap at the start of the step, m.
    pub gap_start: f64,
}

impl GrainTouch {
    /// The grain's number.
    #[must_use]
    pub fn grain(&self) -> u32 {
        self.key.b
    }
}

impl UnilateralContact for GrainTouch {
    type Key = GrainKey;

    fn key(&self) -> GrainKey {
        self.key
    }

    fn gap(&self) -> f64 {
        self.contact.gap
    }
}

/// Scratch of the coupling.
#[derive(Clone, Debug)]
pub struct AmongParts {
    rows: ContactSystem,
    contacts: Vec<Contact>,
    /// Grains near a part: number, centre in the world (m), radius (m).
    near: Vec<(u32, Vector3<f64>, f64)>,
    /// Number of the tree's own contacts that precede those with grains.
    n_own: usize,
}

impl AmongParts {
    /// Scratch for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            rows: ContactSystem::with_capacity(model, 0),
            contacts: Vec::new(),
            near: Vec::new(),
            n_own: 0,
        }
    }
}

/// The coupling of balls and a tree.
#[derive(Debug)]
pub struct AmongGrains<'a> {
    /// μ of the tree's parts on grains.
    pub friction: f64,
    /// Scratch.
    pub parts: &'a mut AmongParts,
}

type Bed<'a> = GrainSystem<'a, 3>;

/// Upper bound on the speed at which a point of a part's surface approaches anything, m/s. The spin
/// of a wheel about its axle moves its surface within itself.
fn approach(tree: &TreeSystem<'_>, part: Part, shape: &PlacedShape, v: &[f64]) -> f64 {
    let (model, kinematics) = (tree.model, &tree.parts.kinematics);
    let (body, centre) = (part.body(model), shape.centre());
    let velocity = |x: &Vector3<f64>| kinematics.point_velocity(model, body, x, v);
    let at_centre = velocity(&centre);
    let turning = |e: &Vector3<f64>| (velocity(&(centre + e)) - at_centre).norm();
    let turning = match shape {
        PlacedShape::Sphere(_) => 0.0,
        PlacedShape::Disc(disc) => turning(&disc.axle),
        PlacedShape::Roller(roller) => turning(&roller.core.axle),
        PlacedShape::Box(_) => [Vector3::x(), Vector3::y(), Vector3::z()]
            .iter()
            .map(turning)
            .sum(),
    };
    at_centre.norm() + turning * shape.bound()
}

/// Half sides of a box with the world's axes about a shape, m.
fn extent(shape: &PlacedShape) -> Vector3<f64> {
    let centre = shape.centre();
    let along = |e: &Vector3<f64>| (shape.support(e) - centre).dot(e);
    Vector3::new(
        along(&Vector3::x()),
        along(&Vector3::y()),
        along(&Vector3::z()),
    )
}

impl AmongGrains<'_> {
    /// Grains within `reach` (m) of a box about a place, in the order of their numbers.
    fn gather(&mut self, bed: &Bed<'_>, centre: &Vector3<f64>, half: &Vector3<f64>, reach: f64) {
        let grains = &bed.scene.grains;
        let near = &mut self.parts.near;
        near.clear();
        let reach = reach + grains.largest();
        let place: [f64; 3] = (*centre).into();
        bed.parts.grid.near(&place, half.max() + reach, |item| {
            let apart = Vector3::from(item.centre) - centre;
            if apart.iter().zip(half).all(|(x, h)| x.abs() <= h + reach) {
                near.push((item.index, item.centre.into(), item.radius));
            }
        });
        near.sort_unstable_by_key(|(index, ..)| *index);
    }

    /// Local velocity of a touch's two sides, m/s.
    fn approach_of(
        touch: &GrainTouch,
        (bed, tree): (&Bed<'_>, &TreeSystem<'_>),
        (v_a, v_b): (&[f64], &[f64]),
    ) -> f64 {
        let Contact {
            body, point, frame, ..
        } = &touch.contact;
        let kinematics = &tree.parts.kinematics;
        let own = kinematics.point_velocity(tree.model, *body, point, v_b);
        let mut u = [frame.n.dot(&own), 0.0, 0.0];
        bed.subtract_rim(touch.grain(), v_a, &frame.rows(), &mut u);
        u[0]
    }
}

/// A shape of the tree and a grain, both relative to the origin of the part's tree.
fn placed(
    model: &Model,
    kinematics: &Kinematics,
    part: Part,
    centre: &Vector3<f64>,
    radius: f64,
) -> (PlacedShape, PlacedShape) {
    let origin = kinematics.origin(part.body(model));
    let ball = Sphere {
        centre: centre - origin,
        radius,
    };
    (PlacedShape::Sphere(ball), part.place(model, kinematics))
}

/// Centre of a ball of the coordinates q, m.
fn centre_of(q: &[f64], grain: u32) -> Vector3<f64> {
    Vector3::from_column_slice(&q[COORDINATES * grain as usize..][..3])
}

impl<'a, 'b> Coupling<Bed<'a>, TreeSystem<'b>> for AmongGrains<'_> {
    type Contact = GrainTouch;

    fn detect(
        &mut self,
        (bed, tree): (&Bed<'a>, &TreeSystem<'b>),
        v: (&[f64], &[f64]),
        activation: Activation,
        out: &mut Vec<GrainTouch>,
    ) {
        let (model, kinematics) = (tree.model, &tree.parts.kinematics);
        let grains = &bed.scene.grains;
        #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
        let n = grains.len() as u32;
        for part in Part::all(model) {
            let shape = part.place(model, kinematics);
            let speed = approach(tree, part, &shape, v.1).max(bed.parts.search.fastest);
            let sizes = [grains.smallest(), grains.largest()];
            let search = Search::new(&activation, sizes, speed);
            let origin = *kinematics.origin(part.body(model));
            let centre = origin + shape.centre();
            self.gather(bed, &centre, &extent(&shape), search.reach);
            let near = std::mem::take(&mut self.parts.near);
            for (index, centre, radius) in &near {
                let ball = PlacedShape::Sphere(Sphere {
                    centre: centre - origin,
                    radius: *radius,
                });
                dispatch::visit_pair(&ball, &shape, search.reach, |point| {
                    let touch = GrainTouch {
                        key: GrainKey {
                            a: n + u32::from(part.code()),
                            b: *index,
                        },
                        contact: Contact {
                            key: ContactKey::on_grain(part, point.feature, *index),
                            part,
                            body: part.body(model),
                            other: None,
                            point: point.on_first(),
                            frame: ContactFrame::of_normal(&point.n),
                            gap: point.gap,
                            excess: 0.0,
                        },
                        gap_start: point.gap,
                    };
                    if search.admits(point.gap, Self::approach_of(&touch, (bed, tree), v)) {
                        out.push(touch);
                    }
                });
            }
            self.parts.near = near;
        }
        out.sort_by_key(|touch| touch.key);
    }

    fn relocate(&mut self, (bed, tree): (&Bed<'a>, &TreeSystem<'b>), contacts: &mut [GrainTouch]) {
        let (model, kinematics) = (tree.model, &tree.parts.kinematics_end);
        for touch in contacts {
            let centre = centre_of(&bed.parts.end, touch.grain());
            let radius = bed.scene.grains.radius()[touch.grain() as usize];
            let (ball, shape) = placed(model, kinematics, touch.contact.part, &centre, radius);
            touch.contact.gap = dispatch::nearest_points(&ball, &shape).gap;
        }
    }

    fn friction_coefficient(
        &self,
        _systems: (&Bed<'a>, &TreeSystem<'b>),
        _options: &StepOptions,
        _contact: &GrainTouch,
    ) -> f64 {
        self.friction
    }

    fn normal_shift(
        &self,
        _systems: (&Bed<'a>, &TreeSystem<'b>),
        options: &StepOptions,
        contact: &GrainTouch,
        u_N_before: f64,
    ) -> f64 {
        gap_law(options, contact.gap_start, u_N_before)
    }

    fn assemble(
        &mut self,
        (bed, tree): (&mut Bed<'a>, &TreeSystem<'b>),
        of_tree: &[Contact],
        touches: &[GrainTouch],
        (v_a, v_b): (&[f64], &[f64]),
        u: &mut [f64],
    ) {
        let model = tree.model;
        let AmongParts {
            rows,
            contacts,
            n_own,
            ..
        } = &mut *self.parts;
        contacts.clear();
        contacts.extend(touches.iter().map(|touch| touch.contact));
        *n_own = 0;
        if touches.is_empty() {
            return;
        }
        let TreeScratch {
            kinematics,
            factor,
            system,
            ..
        } = &*tree.parts;
        rows.assemble_rows(model, kinematics, factor, contacts, v_b);
        u.copy_from_slice(&rows.u);
        for (touch, u) in touches.iter().zip(u.as_chunks_mut::<3>().0) {
            bed.subtract_rim(touch.grain(), v_a, &touch.contact.frame.rows(), u);
        }
        *n_own = of_tree.len();
        let own = of_tree.iter().map(|c| bed.pair_with(None, &c.frame.rows()));
        let with_grains = touches
            .iter()
            .map(|t| bed.pair_with(Some(t.grain()), &t.contact.frame.rows()));
        let all: Vec<_> = own.chain(with_grains).collect();
        let pairs = &mut bed.parts.pairs;
        pairs.machine.clear();
        pairs.machine.extend(all);
        pairs.rows.clear();
        pairs.width = model.nv();
        pairs.n_coordinates = pairs.machine_at + pairs.width;
        for c in 0..of_tree.len() {
            system.push_dense_rows(model, c, &mut pairs.rows);
        }
        for c in 0..touches.len() {
            rows.push_dense_rows(model, c, &mut pairs.rows);
        }
    }

    fn local(
        &self,
        (bed, tree): (&Bed<'a>, &TreeSystem<'b>),
        (y_a, y_b): (&[f64], &[f64]),
        out: &mut [f64],
    ) {
        self.parts.rows.local(tree.model, y_b, out);
        let pairs = bed.parts.pairs.machine.iter().skip(self.parts.n_own);
        for (out, pair) in out.as_chunks_mut::<3>().0.iter_mut().zip(pairs) {
            for (out, u) in out.iter_mut().zip(pair.local(y_a)) {
                *out += u;
            }
        }
    }

    fn add_local_of_velocity(
        &self,
        (bed, tree): (&Bed<'a>, &TreeSystem<'b>),
        touches: &[GrainTouch],
        (v_a, v_b): (&[f64], &[f64]),
        out: &mut [f64],
    ) {
        let contacts = &self.parts.contacts;
        let kinematics = &tree.parts.kinematics;
        let rows = &self.parts.rows;
        rows.add_local_of_velocity(tree.model, kinematics, contacts, v_b, out);
        for (touch, u) in touches.iter().zip(out.as_chunks_mut::<3>().0) {
            bed.subtract_rim(touch.grain(), v_a, &touch.contact.frame.rows(), u);
        }
    }

    fn add_impulses(
        &self,
        (bed, tree): (&Bed<'a>, &TreeSystem<'b>),
        p: &[f64],
        (y_a, y_b): (&mut [f64], &mut [f64]),
    ) {
        self.parts.rows.add_impulses(tree.model, p, y_b);
        let pairs = bed.parts.pairs.machine.iter().skip(self.parts.n_own);
        for (p, pair) in p.as_chunks::<3>().0.iter().zip(pairs) {
            pair.add(*p, y_a);
        }
    }

    fn add_generalized_impulse(
        &self,
        (bed, tree): (&Bed<'a>, &TreeSystem<'b>),
        touches: &[GrainTouch],
        p: &[f64],
        (out_a, out_b): (&mut [f64], &mut [f64]),
    ) {
        let mut own = vec![0.0; out_b.len()];
        let kinematics = &tree.parts.kinematics;
        generalized_impulse(tree.model, kinematics, &self.parts.contacts, p, &mut own);
        for (out, own) in out_b.iter_mut().zip(own) {
            *out += own;
        }
        for (touch, p) in touches.iter().zip(p.as_chunks::<3>().0) {
            bed.push_grain(touch.grain(), &touch.contact.frame.rows(), p, out_a);
        }
    }

    fn solve(
        &self,
        (bed, _): (&Bed<'a>, &TreeSystem<'b>),
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> Option<SolveReport> {
        let bodies = ManyBodies {
            pairs: &bed.parts.pairs,
            q,
            mu,
            operator: &|| bed.parts.operator(),
        };
        Some(solve_many_bodies(&bodies, options, p, u, workspace))
    }
}
