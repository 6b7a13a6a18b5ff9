//! A multibody tree on a terrain as a mechanical system: the rover.
//!
//! `M̂ = M + h θ_j K_d + h² θ_j θ K_p` on held joints. The PD control of a held joint is implicit
//! with an exponentially fitted θ_j ([`super::fitted_theta`]), so it is stable for every gain and
//! step size. A motor on its torque–speed line is treated in the same way. `M̂ = Lᵀ D L` along the
//! tree; the contact system stores `Z` along each contact's path.

use nalgebra::Vector3;

use super::command::Command;
use super::drives::Drives;
use super::extent::{Turning, displacement};
use super::gyroscopic::GyroscopicScratch;
use super::sand::SandContact;
use super::sand_patch::SandScene;
use crate::contact::{
    Activation, Contact, ContactKey, ContactSystem, Opposite, PairSearch, detect, detect_limits,
    detect_pairs, generalized_impulse, relocate, relocate_limit,
};
use crate::geometry::{SoftLayer, Terrain};
use crate::integrator::mechanical_system::MOST_REVISIONS;
use crate::integrator::{
    MechanicalEnergy, MechanicalSystem, Start, StepOptions, UnilateralContact,
};
use crate::law::compliance::Compliance;
use crate::law::newton_impact::rebound;
use crate::multibody::bias::{BiasScratch, bias};
use crate::multibody::energy::energy;
use crate::multibody::momentum::body_momenta;
use crate::multibody::{
    Configuration, EnergyScratch, Factor, Joint, Kinematics, LaneConfiguration, MassMatrix, Model,
    Momentum, Tree,
};
use crate::problem::{Dimension, FrictionContactProblem};
use crate::sand::{RutMap, SandState};
use crate::scalar::Single;

impl UnilateralContact for Contact {
    type Key = ContactKey;

    #[inline]
    fn key(&self) -> ContactKey {
        self.key.lasting()
    }

    #[inline]
    fn gap(&self) -> f64 {
        self.gap
    }

    fn is_internal(&self) -> bool {
        self.other.is_some() || self.key.opposite == Opposite::Stop
    }
}

/// Poses, matrices and momenta of a tree: scratch, allocated once.
#[derive(Clone, Debug)]
pub struct TreeScratch {
    pub(super) kinematics: Kinematics,
    pub(super) kinematics_end: Kinematics,
    mass_matrix: MassMatrix<f64>,
    pub(super) factor: Factor<f64>,
    bias_scratch: BiasScratch<f64>,
    momenta: Vec<Momentum>,
    momenta_end: Vec<Momentum>,
    sums: Vec<Momentum>,
    c_start: Vec<Vector3<f64>>,
    drives: Drives<f64>,
    place: LaneConfiguration<f64>,
    energy: EnergyScratch<f64>,
    gyroscopic: GyroscopicScratch,
    force: Vec<f64>,
    pairs: PairSearch,
    /// Found by the last detection, x and z, m.
    unknown_ground: Option<[f64; 2]>,
    /// Joint coordinates at the midpoint and at the end of the step (n_joints); empty if no joint
    /// has a stop.
    joints_middle: Vec<f64>,
    joints_end: Vec<f64>,
    pub(super) system: ContactSystem,
    /// Of a machine on soft ground.
    sand: Option<Box<SandContact>>,
}

impl TreeScratch {
    /// Scratch for a model with n contacts.
    #[must_use]
    pub fn new(model: &Model, n: usize) -> Self {
        let momenta = vec![Momentum::default(); model.bodies().len()];
        let (token, mechanism) = (Single::best(), model.mechanism());
        let limited = if model.limited_joints().is_empty() {
            Vec::new()
        } else {
            vec![0.0; model.n_joints()]
        };
        Self {
            kinematics: Kinematics::new(model),
            kinematics_end: Kinematics::new(model),
            mass_matrix: MassMatrix::new(token, mechanism),
            factor: Factor::new(token, mechanism),
            bias_scratch: BiasScratch::new(token, mechanism),
            momenta: momenta.clone(),
            momenta_end: momenta.clone(),
            sums: momenta,
            c_start: vec![Vector3::zeros(); model.bodies().len()],
            drives: Drives::new(token, mechanism),
            place: LaneConfiguration::new(token, mechanism),
            energy: EnergyScratch::new(token, mechanism),
            gyroscopic: GyroscopicScratch::default(),
            force: vec![0.0; model.nv()],
            pairs: PairSearch::new(model),
            unknown_ground: None,
            joints_middle: limited.clone(),
            joints_end: limited,
            system: ContactSystem::with_capacity(model, n),
            sand: None,
        }
    }

    /// Resets the impulses of the drives at the start of a step. `work`: of each drive since the
    /// call began (n_joints), J.
    pub fn begin_step(&mut self, work: &[f64]) {
        self.drives.begin_step();
        self.drives.set_work(0, work);
    }

    /// Takes over the sand at the start of a step; none on firm ground.
    pub(crate) fn begin_sand(
        &mut self,
        model: &Model,
        ground: Option<SoftLayer<'_>>,
        state: Option<&SandState>,
    ) {
        let (Some(ground), Some(state)) = (ground, state) else {
            self.sand = None;
            return;
        };
        let known = self.sand.take().filter(|sand| sand.is_of(ground));
        let mut sand = known.unwrap_or_else(|| Box::new(SandContact::new(model, ground)));
        sand.begin(state);
        self.sand = Some(sand);
    }

    /// Adds the impulse of the sand over a step of h that ends with the velocity `v`.
    fn add_sand(&self, h: f64, v: &[f64], y: &mut [f64]) {
        if let Some(sand) = &self.sand {
            sand.add_impulse(h, v, y);
        }
    }

    /// Writes the sand at the end of a step that led to a configuration.
    pub(crate) fn end_sand(
        &mut self,
        model: &Model,
        ground: Option<SoftLayer<'_>>,
        q: &Configuration,
        state: Option<&mut SandState>,
    ) {
        if let (Some(sand), Some(ground), Some(state)) = (&self.sand, ground, state) {
            self.kinematics.update_for_step(model, q);
            sand.end(model, ground, &self.kinematics, state);
        }
    }

    /// Impulses and work of the drives, with those of all accepted parts of the step.
    #[must_use]
    pub fn drives(&self) -> &Drives<f64> {
        &self.drives
    }

    /// Makes a step of the first tree that was taken elsewhere the last one: the world position of
    /// its origin where contacts were evaluated, m.
    pub(crate) fn show(&mut self, origin: [f64; 3]) {
        self.kinematics_end.set_origin(0, origin.into());
    }

    /// Delassus operator of the last step, row-major, 1/kg.
    #[must_use]
    pub fn operator(&self) -> &[f64] {
        &self.system.W
    }

    /// World position of the origin of a body's tree at the pose of the last contact evaluation, m.
    #[must_use]
    pub fn origin_of_contacts(&self, body: usize) -> &Vector3<f64> {
        self.kinematics_end.origin(body)
    }
}

/// A model on a terrain, with its actuator command.
pub struct TreeSystem<'a> {
    /// The machine.
    pub model: &'a Model,
    /// The ground.
    pub terrain: &'a dyn Terrain,
    /// Actuator torques and held joints.
    pub command: &'a Command,
    /// Where wheels have been in soft ground.
    pub ruts: Option<&'a RutMap>,
    /// Scratch of the system.
    pub parts: &'a mut TreeScratch,
}

impl TreeSystem<'_> {
    /// μ and e of a contact whose two materials have a law of their own.
    #[inline]
    fn between_materials(&self, options: &StepOptions, contact: &Contact) -> Option<[f64; 2]> {
        if options.materials.is_empty() {
            return None;
        }
        contact.between_materials(self.model, self.terrain, &options.materials)
    }
}

impl TreeSystem<'_> {
    /// Forces and tangents of the sand at the last guess of the velocity.
    fn linearise_sand(&mut self, options: &StepOptions) {
        if let Some((sand, place, _)) = self.sand() {
            sand.linearise(place, options);
        }
    }

    /// The sand with its ground and poses, and the factor of M̂.
    fn sand(&mut self) -> Option<(&mut SandContact, SandScene<'_>, &Factor<f64>)> {
        let TreeScratch {
            sand,
            kinematics,
            factor,
            ..
        } = &mut *self.parts;
        let place = SandScene {
            model: self.model,
            ground: self.terrain.soft()?,
            ruts: self.ruts?,
            kinematics,
        };
        Some((sand.as_mut()?, place, factor))
    }

    /// Whether the sand asks for another solution.
    fn revise_sand(&mut self, v_end: &[f64]) -> bool {
        (self.sand()).is_some_and(|(sand, place, factor)| sand.revise(place, factor, v_end))
    }

    /// Work of the sand over a step between two velocities, J.
    fn work_of_sand(&mut self, v: &[f64], v_end: &[f64]) -> f64 {
        (self.sand()).map_or(0.0, |(sand, place, _)| sand.work(place, v, v_end))
    }

    /// Adds what is implicit to the mass matrix and factors it; whether it is positive.
    fn factor_implicit(&mut self, options: &StepOptions) -> bool {
        let (mechanism, parts) = (self.model.mechanism(), &mut *self.parts);
        let mass_matrix = &mut parts.mass_matrix;
        let add = |k, a| mass_matrix.add_to_diagonal(mechanism, k, a);
        (parts.drives).add_implicit(mechanism, step(options), add);
        if let Some(sand) = &parts.sand {
            sand.add_to_mass(self.model, options.time_step, mass_matrix);
        }
        mass_matrix.factorise(mechanism, &mut parts.factor)
    }

    /// Adds `h τ` of the drives and of the sand to `y`, for a step that ends with the iterate
    /// `v_end`.
    fn add_actuation(
        &self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_end: &[f64],
        y: &mut [f64],
    ) {
        let (mechanism, places) = (self.model.mechanism(), &start.configuration.joints);
        let velocities = [start.v, v_end];
        (self.parts.drives).add_impulse(mechanism, step(options), places, velocities, y);
        self.parts.add_sand(options.time_step, v_end, y);
    }
}

impl MechanicalSystem for TreeSystem<'_> {
    type Configuration = Configuration;
    type Contact = Contact;

    const DIMENSION: Dimension = Dimension::Three;

    #[inline]
    fn nv(&self) -> usize {
        self.model.nv()
    }

    #[inline]
    fn advance(&self, q: &mut Configuration, v: &[f64], h: f64) {
        q.advance(self.model, v, h);
    }

    #[inline]
    fn is_finite(&self, q: &Configuration) -> bool {
        q.is_finite()
    }

    #[inline]
    fn normalise(&self, q: &mut Configuration) {
        q.normalise();
    }

    #[inline]
    fn place_middle(&mut self, q: &Configuration) {
        self.parts.kinematics.update_for_step(self.model, q);
        keep(&mut self.parts.joints_middle, &q.joints);
    }

    #[inline]
    fn place_end(&mut self, q: &Configuration) {
        self.parts.kinematics_end.update_for_step(self.model, q);
        keep(&mut self.parts.joints_end, &q.joints);
    }

    #[inline]
    fn detect(&mut self, v: &[f64], mut activation: Activation, out: &mut Vec<Contact>) {
        // Two trees may approach each other.
        let (mut fastest, mut next) = (0.0_f64, 0.0_f64);
        for tree in self.model.trees() {
            let places = |body: usize| self.parts.kinematics.r(body);
            let speed = self.model.fastest_point(tree, places, v);
            (fastest, next) = (fastest.max(speed), next.max(fastest.min(speed)));
        }
        activation.margin = activation.lead.abs() * (fastest + next);
        self.parts.unknown_ground = detect(
            self.model,
            &self.parts.kinematics,
            &self.parts.kinematics_end,
            self.terrain,
            v,
            &activation,
            out,
        );
        let TreeScratch {
            kinematics,
            pairs,
            joints_middle,
            ..
        } = &mut *self.parts;
        detect_pairs(self.model, kinematics, v, &activation, pairs, out);
        detect_limits(self.model, kinematics, joints_middle, v, &activation, out);
    }

    fn unknown_ground(&self) -> Option<[f64; 2]> {
        self.parts.unknown_ground
    }

    #[inline]
    fn relocate(&mut self, contacts: &mut [Contact]) {
        let parts = &*self.parts;
        for contact in contacts {
            if contact.key.opposite == Opposite::Stop {
                relocate_limit(
                    self.model,
                    &parts.kinematics_end,
                    &parts.joints_end,
                    contact,
                );
            } else {
                relocate(self.model, &parts.kinematics_end, self.terrain, contact);
            }
        }
    }

    #[inline]
    fn friction_coefficient(&self, options: &StepOptions, contact: &Contact) -> f64 {
        match contact.key.opposite {
            Opposite::Stop => 0.0,
            Opposite::Ground(_) | Opposite::Part(_) | Opposite::Grain(_) => {
                let of_pair = self.between_materials(options, contact);
                of_pair.map_or(options.friction_coefficient, |[mu, _]| mu)
            }
        }
    }

    #[inline]
    fn normal_shift(&self, options: &StepOptions, contact: &Contact, u_N_before: f64) -> f64 {
        let of_pair = self.between_materials(options, contact);
        rebound(of_pair.map_or(options.restitution, |[_, e]| e), u_N_before)
    }

    #[inline]
    fn compliant_mass(&self) -> Option<f64> {
        let model = &self.model;
        model.has_compliance().then(|| model.mass())
    }

    fn compliance(&self, contact: &Contact) -> Option<Compliance> {
        let other = contact.other.map(|other| other.part);
        Compliance::in_series(
            contact.part.compliance(self.model),
            other.and_then(|part| part.compliance(self.model)),
        )
    }

    fn soften(&mut self, diagonal: impl Iterator<Item = f64>) {
        self.parts.system.soften(diagonal);
    }

    #[inline]
    fn update_mass_matrix(&mut self, options: &StepOptions) {
        self.linearise_sand(options);
        let (mechanism, parts) = (self.model.mechanism(), &mut *self.parts);
        let mass_matrix = &mut parts.mass_matrix;
        mass_matrix.update(mechanism, self.model.inertias(), parts.kinematics.poses());
        let inertia = |k| mass_matrix.diagonal(mechanism, k);
        (parts.drives).set_theta(mechanism, step(options), inertia);
    }

    #[inline]
    fn factorise(&mut self, options: &StepOptions) -> bool {
        if self.factor_implicit(options) {
            return true;
        }
        // Tangents of sand whose sizes differ too much leave no factor.
        let parts = &mut *self.parts;
        let Some(sand) = &mut parts.sand else {
            return false;
        };
        sand.drop_tangents();
        let (mechanism, inertias) = (self.model.mechanism(), self.model.inertias());
        (parts.mass_matrix).update(mechanism, inertias, parts.kinematics.poses());
        self.factor_implicit(options)
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        (self.parts.mass_matrix).times(self.model.mechanism(), v, out);
    }

    #[inline]
    fn load(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        let parts = &mut *self.parts;
        bias(
            self.model.mechanism(),
            self.model.inertias(),
            parts.kinematics.poses(),
            v_mean,
            options.gravity.into(),
            &mut parts.bias_scratch,
            &mut parts.force,
        );
        for (y, f) in y.iter_mut().zip(&parts.force) {
            *y = -options.time_step * f;
        }
        self.add_actuation(options, start, start.v, y);
    }

    #[inline]
    fn is_gyroscopic(&self, options: &StepOptions, v: &[f64]) -> bool {
        Turning::of(0.0, self.model.mechanism(), v).is_gyroscopic(options.time_step)
    }

    #[inline]
    fn turning(&self, v: &[f64]) -> f64 {
        Turning::of(0.0, self.model.mechanism(), v).of_frames()
    }

    fn translation_axis(&self, velocity: usize) -> Option<usize> {
        let mut trees = self.model.trees().iter();
        let tree = trees.find(|tree| tree.velocities.contains(&velocity))?;
        let axis = velocity - tree.velocities.start;
        (tree.is_free && axis < 3).then_some(axis)
    }

    fn conserves_momenta(&self) -> bool {
        self.model.is_free_tree()
    }

    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_mean: &[f64],
        impulse: &[f64],
        y: &mut [f64],
    ) {
        let parts = &mut *self.parts;
        let model = self.model;
        // The bias at rest is gravity's.
        y.fill(0.0);
        bias(
            model.mechanism(),
            model.inertias(),
            parts.kinematics.poses(),
            y,
            options.gravity.into(),
            &mut parts.bias_scratch,
            &mut parts.force,
        );
        for (y, f) in y.iter_mut().zip(&parts.force) {
            *y = -options.time_step * f;
        }
        self.add_actuation(options, start, start.v, y);
        let parts = &mut *self.parts;
        parts.gyroscopic.solve(
            model,
            &parts.kinematics,
            &parts.mass_matrix,
            (options.time_step, options.theta),
            (start.v, v_mean),
            impulse,
            y,
        );
        parts.factor.half_solve(model.mechanism(), y);
    }

    #[inline]
    fn choose_branches(&mut self, start: Start<'_, Configuration>) {
        let drives = &mut self.parts.drives;
        drives.set_lane(0, self.model.joints(), self.command);
        drives.finish_loading();
        drives.choose_branches(self.model.mechanism(), start.v);
        if let Some(sand) = &mut self.parts.sand {
            sand.start_from(start.v);
        }
    }

    fn most_revisions(&self) -> usize {
        if self.parts.sand.is_some() {
            MOST_REVISIONS_IN_SAND
        } else {
            MOST_REVISIONS
        }
    }

    fn revise(&mut self, start: Start<'_, Configuration>, v_end: &[f64]) -> bool {
        let mechanism = self.model.mechanism();
        let is_new = (self.parts.drives).revise(mechanism, true, start.v, v_end);
        is_new | self.revise_sand(v_end)
    }

    fn energy(
        &mut self,
        options: &StepOptions,
        q: &Configuration,
        v: &[f64],
    ) -> Option<MechanicalEnergy> {
        let TreeScratch {
            place,
            energy: scratch,
            ..
        } = &mut *self.parts;
        place.set_lane(0, q);
        let (mechanism, inertias) = (self.model.mechanism(), self.model.inertias());
        let gravity = options.gravity.into();
        let (energy, momentum) = energy(mechanism, inertias, place, v, gravity, scratch);
        Some(MechanicalEnergy {
            kinetic: energy.kinetic,
            potential: energy.potential,
            // A tree on a fixed base passes momentum on to the world.
            momentum: if self.model.is_free() {
                momentum.into()
            } else {
                Vector3::zeros()
            },
            mass: self.model.mass(),
        })
    }

    fn work(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_end: &[f64],
    ) -> f64 {
        let (mechanism, places) = (self.model.mechanism(), &start.configuration.joints);
        let velocities = [start.v, v_end];
        let of_drives = (self.parts.drives).work(mechanism, step(options), places, velocities);
        of_drives + self.work_of_sand(start.v, v_end)
    }

    fn work_of_displacement(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_end: &[f64],
        displacement: &[f64],
    ) -> f64 {
        let (mechanism, places) = (self.model.mechanism(), &start.configuration.joints);
        let motion = [start.v, v_end, displacement];
        (self.parts.drives).work_of_displacement(mechanism, step(options), places, motion)
    }

    #[inline]
    fn accept(&mut self) {
        let parts = &mut *self.parts;
        parts.drives.accept_part();
        if let Some(sand) = &mut parts.sand {
            sand.accept();
        }
    }

    fn begin_balance(&mut self, start: Start<'_, Configuration>) {
        let parts = &mut *self.parts;
        parts
            .kinematics
            .update_for_step(self.model, start.configuration);
        for (b, c) in parts.c_start.iter_mut().enumerate() {
            *c = parts.kinematics.c(b);
        }
        body_momenta(
            self.model,
            &parts.kinematics,
            start.v,
            |_| Vector3::zeros(),
            &mut parts.momenta,
        );
    }

    /// In momentum form, exact at both ends; see [`crate::integrator::moreau_jean_newton`].
    fn balance(
        &mut self,
        options: &StepOptions,
        start: Start<'_, Configuration>,
        v_end: &[f64],
        _v_mean: &[f64],
        _scratch: &mut [f64],
        y: &mut [f64],
    ) {
        momentum_residual(
            self.model,
            &options.gravity,
            (options.time_step, options.theta),
            start,
            v_end,
            self.parts,
            y,
        );
        self.add_actuation(options, start, v_end, y);
    }

    #[inline]
    fn half_solve(&self, y: &mut [f64]) {
        self.parts.factor.half_solve(self.model.mechanism(), y);
    }

    #[inline]
    fn half_solve_back(&self, y: &mut [f64]) {
        (self.parts.factor).half_solve_back(self.model.mechanism(), y);
    }

    #[inline]
    fn assemble(&mut self, contacts: &[Contact], v: &[f64], u: &mut [f64]) {
        let parts = &mut *self.parts;
        parts.system.assemble(
            self.model,
            &parts.kinematics_end,
            &parts.factor,
            contacts,
            v,
        );
        u.copy_from_slice(&parts.system.u);
    }

    #[inline]
    fn local(&self, y: &[f64], out: &mut [f64]) {
        self.parts.system.local(self.model, y, out);
    }

    #[inline]
    fn add_local_of_velocity(&self, contacts: &[Contact], v: &[f64], out: &mut [f64]) {
        self.parts.system.add_local_of_velocity(
            self.model,
            &self.parts.kinematics_end,
            contacts,
            v,
            out,
        );
    }

    #[inline]
    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        self.parts.system.add_impulses(self.model, p, y);
    }

    #[inline]
    fn generalized_impulse(&self, contacts: &[Contact], p: &[f64], out: &mut [f64]) {
        generalized_impulse(self.model, &self.parts.kinematics_end, contacts, p, out);
    }

    #[inline]
    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled(Dimension::Three, &self.parts.system.W, q, mu)
    }

    fn displacement(&self, y: &[f64]) -> f64 {
        displacement(0.0, self.model.mechanism(), y)
    }
}

/// Copies the joint coordinates; `kept` is empty if no joint has a stop.
#[inline]
fn keep(kept: &mut [f64], joints: &[f64]) {
    for (kept, q) in kept.iter_mut().zip(joints) {
        *kept = *q;
    }
}

/// Most repetitions of a step in sand. Wheels that fall and come to rest in a long step need them.
const MOST_REVISIONS_IN_SAND: usize = 24;

/// h and θ.
#[inline]
fn step(options: &StepOptions) -> (f64, f64) {
    (options.time_step, options.theta)
}

/// `y = −(left-hand side)` of the principle of [`crate::integrator::moreau_jean_newton`] at the
/// iterate `v_end`, without commands and contacts.
fn momentum_residual(
    model: &Model,
    gravity: &Vector3<f64>,
    (h, theta): (f64, f64),
    start: Start<'_, Configuration>,
    v_end: &[f64],
    parts: &mut TreeScratch,
    y: &mut [f64],
) {
    let origin_of = |tree: &Tree| match model.bodies()[tree.bodies.start].joint {
        Joint::Free(free) => start.configuration.pose(free).position,
        _ => Vector3::zeros(),
    };
    let end_of = |tree: &Tree| parts.kinematics_end.origin(tree.bodies.start) - origin_of(tree);
    body_momenta(
        model,
        &parts.kinematics_end,
        v_end,
        |tree| end_of(&model.trees()[tree]),
        &mut parts.momenta_end,
    );
    let bodies = model.bodies();
    parts.sums.copy_from_slice(&parts.momenta_end);
    for tree in model.trees() {
        let end = end_of(tree);
        for b in tree.bodies.clone() {
            let (sum, begin) = (&mut parts.sums[b], &parts.momenta[b]);
            let weight = gravity * (bodies[b].mass * h);
            // Both mass centres relative to the reference point: the tree's origin at the start of
            // the step.
            let centre =
                (parts.kinematics_end.c(b) + end) * theta + parts.c_start[b] * (1.0 - theta);
            sum.linear -= begin.linear + weight;
            sum.angular -= begin.angular + centre.cross(&weight);
        }
    }
    y.fill(0.0);
    for tree in model.trees() {
        let middle = parts.kinematics.origin(tree.bodies.start) - origin_of(tree);
        for b in tree.bodies.clone().rev() {
            let body = &bodies[b];
            let (P, L) = (parts.sums[b].linear, parts.sums[b].angular);
            // About the tree's origin at the midpoint, the reference of the screws.
            let about_middle = L - middle.cross(&P);
            if let Joint::Free(_) = body.joint {
                for k in 0..3 {
                    y[body.velocity + k] = -P[k];
                    y[body.velocity + 3 + k] = -about_middle[k];
                }
            } else {
                for (y, m) in y[body.velocity..].iter_mut().zip(body.motions()) {
                    *y -= parts.kinematics.power(m, &P, &about_middle);
                }
            }
            if let Some(parent) = body.parent {
                parts.sums[parent].linear += P;
                parts.sums[parent].angular += L;
            }
        }
    }
    for &(k, inertia) in model.armatures() {
        y[k] -= inertia * (v_end[k] - start.v[k]);
    }
}
