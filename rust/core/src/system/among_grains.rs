//! A multibody tree among balls as one system: block-diagonal M, the contacts of each, and those
//! of the tree's wheels, boxes and balls with the grains.
//!
//! Each side runs its own code, and its coordinates and velocities keep their order: grains, then
//! the tree; so do the contacts: grains, the tree's own, the touches between. With the factors of
//! M̂ = diag(M̂_a, M̂_b)
//!
//! ```text
//! Z = diag(F_a, F_b)⁻ᵀ H,        W = Zᵀ Z.
//! ```
//!
//! The law of a touch is that of the grains ([`super::grains`]): frames are those of the start of
//! the step, and a pair may close by its gap. Both sides are pushed at the same point, that of the
//! grain's surface, so the impulses conserve linear and angular momentum. With touches, all
//! contacts of a step are one problem, solved on the bodies' velocities
//! ([`crate::problem::BodyPairs`]): forces go both ways within the step. Without, each side is
//! solved by its own method and moves as it would alone.
//!
//! Decisions about a whole step apply to both: whether to repeat it, and whether the last step's
//! impulses serve as a forecast. The energy is not audited, as that of grains is not.

use std::sync::OnceLock;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::grains::search::Search;
use super::grains::system::gap_law;
use super::grains::{COORDINATES, GrainContact, GrainKey, GrainSystem};
use super::tree::{TreeScratch, TreeSystem};
use crate::contact::{
    Activation, Contact, ContactFrame, ContactKey, ContactSystem, Part, generalized_impulse,
};
use crate::geometry::query::dispatch;
use crate::geometry::{PlacedShape, Sphere, SupportMap};
use crate::integrator::{MechanicalSystem, Start, StepOptions, UnilateralContact};
use crate::multibody::{Configuration, Kinematics, Model};
use crate::problem::{BlockSparseDelassus, BodyPairs, Dimension, FrictionContactProblem};
use crate::solver::{SolveReport, SolverOptions, SolverWorkspace};

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

/// A contact of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AmongContact {
    /// Of the grains.
    Grains(GrainContact<3>),
    /// Of the tree, with anything else.
    Tree(Contact),
    /// Between them.
    Touch(GrainTouch),
}

/// Key of a contact, in the order of the lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AmongKey {
    /// Of the grains.
    Grains(GrainKey),
    /// Of the tree.
    Tree(ContactKey),
    /// Of a touch.
    Touch(GrainKey),
}

impl UnilateralContact for AmongContact {
    type Key = AmongKey;

    fn key(&self) -> AmongKey {
        match self {
            Self::Grains(contact) => AmongKey::Grains(contact.key),
            Self::Tree(contact) => AmongKey::Tree(contact.key),
            Self::Touch(touch) => AmongKey::Touch(touch.key),
        }
    }

    fn gap(&self) -> f64 {
        match self {
            Self::Grains(contact) => contact.gap,
            Self::Tree(contact) => contact.gap,
            Self::Touch(touch) => touch.contact.gap,
        }
    }
}

/// Scratch of the two together.
#[derive(Clone, Debug)]
pub struct AmongParts {
    /// The contacts of a step, sorted by kind.
    of_grains: Vec<GrainContact<3>>,
    of_tree: Vec<Contact>,
    touches: Vec<GrainTouch>,
    /// The touches as contacts of the tree, and their rows.
    contacts: Vec<Contact>,
    rows: ContactSystem,
    /// Grains near a part: number, centre in the world (m), radius (m).
    near: Vec<(u32, Vector3<f64>, f64)>,
    /// W of a step without touches, assembled on request.
    operator: OnceLock<BlockSparseDelassus>,
}

impl AmongParts {
    /// Scratch for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            of_grains: Vec::new(),
            of_tree: Vec::new(),
            touches: Vec::new(),
            contacts: Vec::new(),
            rows: ContactSystem::with_capacity(model, 0),
            near: Vec::new(),
            operator: OnceLock::new(),
        }
    }

    fn sort(&mut self, contacts: &[AmongContact]) {
        self.of_grains.clear();
        self.of_tree.clear();
        self.touches.clear();
        for contact in contacts {
            match *contact {
                AmongContact::Grains(contact) => self.of_grains.push(contact),
                AmongContact::Tree(contact) => self.of_tree.push(contact),
                AmongContact::Touch(touch) => self.touches.push(touch),
            }
        }
    }

    fn listed(&self) -> impl Iterator<Item = AmongContact> + '_ {
        let of_grains = self.of_grains.iter().copied().map(AmongContact::Grains);
        let of_tree = self.of_tree.iter().copied().map(AmongContact::Tree);
        let touches = self.touches.iter().copied().map(AmongContact::Touch);
        of_grains.chain(of_tree).chain(touches)
    }

    /// Where the local components of each kind end and the next begin.
    fn ends(&self) -> [usize; 2] {
        let n = 3 * self.of_grains.len();
        [n, n + 3 * self.of_tree.len()]
    }

    /// The local components of each kind.
    fn split<'v>(&self, local: &'v [f64]) -> [&'v [f64]; 3] {
        let [a, b] = self.ends();
        [&local[..a], &local[a..b], &local[b..]]
    }

    fn split_mut<'v>(&self, local: &'v mut [f64]) -> [&'v mut [f64]; 3] {
        let [a, b] = self.ends();
        let (local, touches) = local.split_at_mut(b);
        let (of_grains, of_tree) = local.split_at_mut(a);
        [of_grains, of_tree, touches]
    }
}

/// A tree among balls in a step.
pub struct AmongGrains<'a> {
    /// The balls.
    pub bed: GrainSystem<'a, 3>,
    /// The tree.
    pub tree: TreeSystem<'a>,
    /// μ of the tree's parts on grains.
    pub friction: f64,
    /// Scratch.
    pub parts: &'a mut AmongParts,
}

type Both = (Vec<f64>, Configuration);

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

/// Grains within `reach` (m) of a box about a place, in the order of their numbers.
fn gather(
    bed: &GrainSystem<'_, 3>,
    (centre, half): (&Vector3<f64>, &Vector3<f64>),
    reach: f64,
    near: &mut Vec<(u32, Vector3<f64>, f64)>,
) {
    near.clear();
    let reach = reach + bed.scene.grains.largest();
    let place: [f64; 3] = (*centre).into();
    bed.parts.grid.near(&place, half.max() + reach, |item| {
        let apart = Vector3::from(item.centre) - centre;
        if apart.iter().zip(half).all(|(x, h)| x.abs() <= h + reach) {
            near.push((item.index, item.centre.into(), item.radius));
        }
    });
    near.sort_unstable_by_key(|(index, ..)| *index);
}

/// Report of the harder of two solves, with the work of both.
fn harder(a: &SolveReport, b: &SolveReport) -> SolveReport {
    let worst = if a.is_converged() && (!b.is_converged() || b.residual > a.residual) {
        b
    } else {
        a
    };
    SolveReport {
        iterations: a.iterations + b.iterations,
        work: a.work + b.work,
        residual: a.residual.max(b.residual),
        velocity_error: a.velocity_error.max(b.velocity_error),
        ..*worst
    }
}

impl AmongGrains<'_> {
    /// Velocities of the grains, and of the tree.
    fn halves<'v>(&self, v: &'v [f64]) -> (&'v [f64], &'v [f64]) {
        v.split_at(self.bed.nv())
    }

    fn halves_mut<'v>(&self, v: &'v mut [f64]) -> (&'v mut [f64], &'v mut [f64]) {
        v.split_at_mut(self.bed.nv())
    }

    /// Where a step begins, of each side.
    fn starts<'q>(
        &self,
        start: Start<'q, Both>,
    ) -> (Start<'q, Vec<f64>>, Start<'q, Configuration>) {
        let ((q_a, q_b), (v_a, v_b)) = (start.configuration, self.halves(start.v));
        let of_grains = Start {
            configuration: q_a,
            v: v_a,
        };
        let of_tree = Start {
            configuration: q_b,
            v: v_b,
        };
        (of_grains, of_tree)
    }

    /// Normal velocity of a touch's two sides, m/s.
    fn approach_of(&self, touch: &GrainTouch, (v_a, v_b): (&[f64], &[f64])) -> f64 {
        let Contact {
            body, point, frame, ..
        } = &touch.contact;
        let tree = &self.tree;
        let own = (tree.parts.kinematics).point_velocity(tree.model, *body, point, v_b);
        let mut u = [frame.n.dot(&own), 0.0, 0.0];
        (self.bed).subtract_rim(touch.grain(), v_a, &frame.rows(), &mut u);
        u[0]
    }

    /// Subtracts the grains' velocities from those of the touches.
    fn subtract_rims(&self, touches: &[GrainTouch], v: &[f64], u: &mut [f64]) {
        for (touch, u) in touches.iter().zip(u.as_chunks_mut::<3>().0) {
            (self.bed).subtract_rim(touch.grain(), v, &touch.contact.frame.rows(), u);
        }
    }

    /// Finds the touches of a step. Both sides are placed and have found their own contacts.
    fn find_touches(&mut self, v: (&[f64], &[f64]), activation: Activation) {
        let mut touches = std::mem::take(&mut self.parts.touches);
        let mut near = std::mem::take(&mut self.parts.near);
        touches.clear();
        let (bed, tree) = (&self.bed, &self.tree);
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
            gather(bed, (&centre, &extent(&shape)), search.reach, &mut near);
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
                    if search.admits(point.gap, self.approach_of(&touch, v)) {
                        touches.push(touch);
                    }
                });
            }
        }
        touches.sort_by_key(|touch| touch.key);
        self.parts.touches = touches;
        self.parts.near = near;
    }

    /// Rows of the touches, and all contacts of the tree among the grains' pairs of bodies.
    fn assemble_touches(&mut self, v: (&[f64], &[f64]), u: &mut [f64]) {
        let AmongParts {
            touches,
            contacts,
            rows,
            ..
        } = &mut *self.parts;
        contacts.clear();
        contacts.extend(touches.iter().map(|touch| touch.contact));
        if touches.is_empty() {
            return;
        }
        let TreeScratch {
            kinematics, factor, ..
        } = &*self.tree.parts;
        rows.assemble_rows(self.tree.model, kinematics, factor, contacts, v.1);
        u.copy_from_slice(&rows.u);
        self.subtract_rims(&self.parts.touches, v.0, u);
        let mut pairs = std::mem::take(&mut self.bed.parts.pairs);
        self.push_tree(&mut pairs);
        self.bed.parts.pairs = pairs;
    }

    /// Adds the tree as the machine of the grains' pairs, with its own contacts and the touches.
    fn push_tree(&self, pairs: &mut BodyPairs<3>) {
        let (bed, parts, model) = (&self.bed, &*self.parts, self.tree.model);
        let own = parts.of_tree.iter().map(|c| (None, c));
        let touches = parts.touches.iter();
        let touches = touches.map(|touch| (Some(touch.grain()), &touch.contact));
        let pair = |(grain, c): (_, &Contact)| bed.pair_with(grain, &c.frame.rows());
        pairs.machine.clear();
        pairs.machine.extend(own.chain(touches).map(pair));
        pairs.rows.clear();
        pairs.width = model.nv();
        pairs.n_coordinates = pairs.machine_at + pairs.width;
        for c in 0..parts.of_tree.len() {
            (self.tree.parts.system).push_dense_rows(model, c, &mut pairs.rows);
        }
        for c in 0..parts.touches.len() {
            parts.rows.push_dense_rows(model, c, &mut pairs.rows);
        }
    }

    fn operator(&self) -> &BlockSparseDelassus {
        let pairs = &self.bed.parts.pairs;
        if !self.parts.touches.is_empty() {
            return self.bed.parts.operator();
        }
        self.parts.operator.get_or_init(|| {
            let mut pairs = pairs.clone();
            self.push_tree(&mut pairs);
            pairs.operator()
        })
    }
}

impl MechanicalSystem for AmongGrains<'_> {
    type Configuration = Both;
    type Contact = AmongContact;

    const DIMENSION: Dimension = Dimension::Three;

    fn nv(&self) -> usize {
        self.bed.nv() + self.tree.nv()
    }

    fn set_moved(&self, from: &Both, v: &[f64], h: f64, to: &mut Both) {
        let (v_a, v_b) = self.halves(v);
        self.bed.set_moved(&from.0, v_a, h, &mut to.0);
        self.tree.set_moved(&from.1, v_b, h, &mut to.1);
    }

    fn advance(&self, q: &mut Both, v: &[f64], h: f64) {
        let (v_a, v_b) = self.halves(v);
        self.bed.advance(&mut q.0, v_a, h);
        self.tree.advance(&mut q.1, v_b, h);
    }

    fn is_finite(&self, q: &Both) -> bool {
        self.bed.is_finite(&q.0) && self.tree.is_finite(&q.1)
    }

    fn normalise(&self, q: &mut Both) {
        self.tree.normalise(&mut q.1);
    }

    fn place_middle(&mut self, q: &Both) {
        self.bed.place_middle(&q.0);
        self.tree.place_middle(&q.1);
    }

    fn place_end(&mut self, q: &Both) {
        self.bed.place_end(&q.0);
        self.tree.place_end(&q.1);
    }

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<AmongContact>) {
        let v = self.halves(v);
        let AmongParts {
            of_grains, of_tree, ..
        } = &mut *self.parts;
        self.bed.detect(v.0, activation, of_grains);
        self.tree.detect(v.1, activation, of_tree);
        // The order of the keys, in which the last step's impulses are looked up.
        of_tree.sort_by_key(UnilateralContact::key);
        self.find_touches(v, activation);
        out.clear();
        out.extend(self.parts.listed());
    }

    fn unknown_ground(&self) -> Option<[f64; 2]> {
        self.tree.unknown_ground()
    }

    fn relocate(&mut self, contacts: &mut [AmongContact]) {
        let parts = &mut *self.parts;
        parts.sort(contacts);
        self.bed.relocate(&mut parts.of_grains);
        self.tree.relocate(&mut parts.of_tree);
        let (model, kinematics) = (self.tree.model, &self.tree.parts.kinematics_end);
        for touch in &mut parts.touches {
            let centre = centre_of(&self.bed.parts.end, touch.grain());
            let radius = self.bed.scene.grains.radius()[touch.grain() as usize];
            let (ball, shape) = placed(model, kinematics, touch.contact.part, &centre, radius);
            touch.contact.gap = dispatch::nearest_points(&ball, &shape).gap;
        }
        for (place, contact) in contacts.iter_mut().zip(parts.listed()) {
            *place = contact;
        }
    }

    fn friction_coefficient(&self, options: &StepOptions, contact: &AmongContact) -> f64 {
        match contact {
            AmongContact::Grains(contact) => self.bed.friction_coefficient(options, contact),
            AmongContact::Tree(contact) => self.tree.friction_coefficient(options, contact),
            AmongContact::Touch(_) => self.friction,
        }
    }

    fn update_mass_matrix(&mut self, options: &StepOptions) {
        self.bed.update_mass_matrix(options);
        self.tree.update_mass_matrix(options);
    }

    fn factorise(&mut self, options: &StepOptions) -> bool {
        self.bed.factorise(options) && self.tree.factorise(options)
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        let ((v_a, v_b), (out_a, out_b)) = (self.halves(v), self.halves_mut(out));
        self.bed.multiply_mass(v_a, out_a);
        self.tree.multiply_mass(v_b, out_b);
    }

    fn load(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Both>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let ((v_a, v_b), (y_a, y_b)) = (self.halves(v_mean), self.halves_mut(y));
        self.bed.load(options, start_a, v_a, y_a);
        self.tree.load(options, start_b, v_b, y_b);
    }

    fn is_gyroscopic(&self, options: &StepOptions, v: &[f64]) -> bool {
        self.tree.is_gyroscopic(options, self.halves(v).1)
    }

    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Both>,
        v_mean: &[f64],
        impulse: &[f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let ((v_a, v_b), (y_a, y_b)) = (self.halves(v_mean), self.halves_mut(y));
        let (own, theirs) = self.halves(impulse);
        (self.bed).load_gyroscopic(options, start_a, v_a, own, y_a);
        (self.tree).load_gyroscopic(options, start_b, v_b, theirs, y_b);
    }

    fn choose_branches(&mut self, start: Start<'_, Both>) {
        let (_, start) = self.starts(start);
        self.tree.choose_branches(start);
    }

    fn most_revisions(&self) -> usize {
        self.tree.most_revisions()
    }

    fn revise(&mut self, start: Start<'_, Both>, v_end: &[f64]) -> bool {
        let (_, start) = self.starts(start);
        let (_, v_end) = self.halves(v_end);
        self.tree.revise(start, v_end)
    }

    fn turning(&self, v: &[f64]) -> f64 {
        self.tree.turning(self.halves(v).1)
    }

    fn accept(&mut self) {
        self.tree.accept();
    }

    fn begin_balance(&mut self, start: Start<'_, Both>) {
        let (_, start) = self.starts(start);
        self.tree.begin_balance(start);
    }

    fn balance(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Both>,
        v_end: &[f64],
        v_mean: &[f64],
        scratch: &mut [f64],
        y: &mut [f64],
    ) {
        let (start_a, start_b) = self.starts(start);
        let ((end_a, end_b), (v_a, v_b)) = (self.halves(v_end), self.halves(v_mean));
        let ((own, theirs), (y_a, y_b)) = (self.halves_mut(scratch), self.halves_mut(y));
        (self.bed).balance(options, start_a, end_a, v_a, own, y_a);
        (self.tree).balance(options, start_b, end_b, v_b, theirs, y_b);
    }

    fn half_solve(&self, y: &mut [f64]) {
        let (y_a, y_b) = self.halves_mut(y);
        self.bed.half_solve(y_a);
        self.tree.half_solve(y_b);
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        let (y_a, y_b) = self.halves_mut(y);
        self.bed.half_solve_back(y_a);
        self.tree.half_solve_back(y_b);
    }

    fn assemble(&mut self, contacts: &[AmongContact], v: &[f64], u: &mut [f64]) {
        let v = self.halves(v);
        let parts = &mut *self.parts;
        parts.sort(contacts);
        parts.operator.take();
        let [u_a, u_b, u] = parts.split_mut(u);
        self.bed.assemble(&parts.of_grains, v.0, u_a);
        self.tree.assemble(&parts.of_tree, v.1, u_b);
        self.assemble_touches(v, u);
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        let (y_a, y_b) = self.halves(y);
        let parts = &*self.parts;
        let [out_a, out_b, touches] = parts.split_mut(out);
        self.bed.local(y_a, out_a);
        self.tree.local(y_b, out_b);
        parts.rows.local(self.tree.model, y_b, touches);
        let pairs = (self.bed.parts.pairs.machine.iter()).skip(parts.of_tree.len());
        for (out, pair) in touches.as_chunks_mut::<3>().0.iter_mut().zip(pairs) {
            for (out, u) in out.iter_mut().zip(pair.local(y_a)) {
                *out += u;
            }
        }
    }

    fn add_local_of_velocity(&self, _contacts: &[AmongContact], v: &[f64], out: &mut [f64]) {
        let (v_a, v_b) = self.halves(v);
        let (tree, parts) = (&self.tree, &*self.parts);
        let [out_a, out_b, touches] = parts.split_mut(out);
        self.bed.add_local_of_velocity(&parts.of_grains, v_a, out_a);
        tree.add_local_of_velocity(&parts.of_tree, v_b, out_b);
        let (rows, kinematics) = (&parts.rows, &tree.parts.kinematics);
        rows.add_local_of_velocity(tree.model, kinematics, &parts.contacts, v_b, touches);
        self.subtract_rims(&parts.touches, v_a, touches);
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        let (y_a, y_b) = self.halves_mut(y);
        let parts = &*self.parts;
        let [p_a, p_b, touches] = parts.split(p);
        self.bed.add_impulses(p_a, y_a);
        self.tree.add_impulses(p_b, y_b);
        parts.rows.add_impulses(self.tree.model, touches, y_b);
        let pairs = (self.bed.parts.pairs.machine.iter()).skip(parts.of_tree.len());
        for (p, pair) in touches.as_chunks::<3>().0.iter().zip(pairs) {
            pair.add(*p, y_a);
        }
    }

    fn generalized_impulse(&self, _contacts: &[AmongContact], p: &[f64], out: &mut [f64]) {
        let (out_a, out_b) = self.halves_mut(out);
        let (tree, parts) = (&self.tree, &*self.parts);
        let [p_a, p_b, touches] = parts.split(p);
        (self.bed).generalized_impulse(&parts.of_grains, p_a, out_a);
        tree.generalized_impulse(&parts.of_tree, p_b, out_b);
        let mut own = vec![0.0; out_b.len()];
        let kinematics = &tree.parts.kinematics;
        generalized_impulse(tree.model, kinematics, &parts.contacts, touches, &mut own);
        for (out, own) in out_b.iter_mut().zip(own) {
            *out += own;
        }
        for (touch, p) in parts.touches.iter().zip(touches.as_chunks::<3>().0) {
            (self.bed).push_grain(touch.grain(), &touch.contact.frame.rows(), p, out_a);
        }
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled_sparse(self.operator(), q, mu)
    }

    fn normal_shift(&self, options: &StepOptions, contact: &AmongContact, u_N_before: f64) -> f64 {
        match contact {
            AmongContact::Grains(contact) => self.bed.normal_shift(options, contact, u_N_before),
            AmongContact::Tree(contact) => self.tree.normal_shift(options, contact, u_N_before),
            AmongContact::Touch(touch) => gap_law(options, touch.gap_start, u_N_before),
        }
    }

    fn solves_to_the_end(&self) -> bool {
        self.bed.solves_to_the_end()
    }

    fn solve(
        &self,
        q: &[f64],
        mu: &[f64],
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        let parts = &*self.parts;
        if !parts.touches.is_empty() {
            return self.bed.solve(q, mu, options, p, u, workspace);
        }
        let (mu_a, mu_b) = mu.split_at(parts.of_grains.len());
        let ([q_a, q_b, _], [p_a, p_b, _]) = (parts.split(q), parts.split_mut(p));
        let [u_a, u_b, _] = parts.split_mut(u);
        harder(
            &self.bed.solve(q_a, mu_a, options, p_a, u_a, workspace),
            &self.tree.solve(q_b, mu_b, options, p_b, u_b, workspace),
        )
    }

    fn solve_step(
        &mut self,
        (v, y): (&[f64], &[f64]),
        (q, mu): (&[f64], &[f64]),
        options: &SolverOptions,
        p: &mut [f64],
        u: &mut [f64],
        workspace: &mut SolverWorkspace,
    ) -> SolveReport {
        let free = (self.halves(v).0, self.halves(y).0);
        let parts = &*self.parts;
        if !parts.touches.is_empty() {
            return (self.bed).solve_step(free, (q, mu), options, p, u, workspace);
        }
        let (mu_a, mu_b) = mu.split_at(parts.of_grains.len());
        let ([q_a, q_b, _], [p_a, p_b, _]) = (parts.split(q), parts.split_mut(p));
        let [u_a, u_b, _] = parts.split_mut(u);
        harder(
            &(self.bed).solve_step(free, (q_a, mu_a), options, p_a, u_a, workspace),
            &self.tree.solve(q_b, mu_b, options, p_b, u_b, workspace),
        )
    }

    fn add_moments(&self, y: &mut [f64]) {
        let (y_a, _) = self.halves_mut(y);
        self.bed.add_moments(y_a);
    }

    fn displacement(&self, y: &[f64]) -> f64 {
        let (y_a, y_b) = self.halves(y);
        (self.bed.displacement(y_a)).max(self.tree.displacement(y_b))
    }
}
