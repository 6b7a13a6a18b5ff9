//! A planar machine on a ground as a mechanical system: contacts with one
//! tangent, `M = L Lᵀ`, `Z = L⁻¹ H`.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::fitted_theta::implicit_weight;
use super::planar_matrices::{PlanarMatrices, sum_of_products};
use crate::contact::Activation;
use crate::integrator::{
    Dynamics, Forces, MechanicalSystem, StepOptions, StepStart, UnilateralContact, Work,
};
use crate::multibody::MotorLine;
use crate::planar::{
    ContactRule, PlanarDisc, PlanarFacing, PlanarGround, PlanarMotor, PlanarPoses, PlanarTree,
};
use crate::problem::{Dimension, FrictionContactProblem};
use crate::scalar::{Single, Vec3};

/// Key of a contact between a disc and the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct PlanarKey {
    /// Which disc.
    pub disc: u32,
    /// Which of the points that face it, in the order of x.
    pub feature: u32,
}

/// A contact of a disc with the ground.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanarContact {
    /// Key of the contact from step to step.
    pub key: PlanarKey,
    /// Point of the disc's rim, world, m.
    pub point: Vector2<f64>,
    /// Point of the ground, world, m.
    pub foot: Vector2<f64>,
    /// Unit normal, out of the ground.
    pub n: Vector2<f64>,
    /// m.
    pub gap: f64,
}

impl PlanarContact {
    /// Tangent n × e_z: forward on level ground.
    #[must_use]
    pub fn t(&self) -> Vector2<f64> {
        Vector2::new(self.n.y, -self.n.x)
    }

    fn meet(&mut self, disc: &PlanarDisc, facing: &PlanarFacing, rule: ContactRule) {
        self.n = facing.n;
        self.foot = facing.foot;
        self.point = disc.centre - facing.n * disc.radius;
        self.gap = match rule {
            ContactRule::Nearest => facing.distance - disc.radius,
            ContactRule::CentreHeight => facing.distance,
        };
    }
}

impl UnilateralContact for PlanarContact {
    type Key = PlanarKey;
    type Local = [f64; 2];

    fn key(&self) -> PlanarKey {
        self.key
    }

    fn gap(&self) -> f64 {
        self.gap
    }
}

/// Matrices of a step: scratch.
#[derive(Clone, Debug, Default)]
pub struct PlanarScratch {
    middle: PlanarPoses,
    end: PlanarPoses,
    matrices: PlanarMatrices,
    /// Rows n, t of Zᵀ of each contact (nv each).
    Z: Vec<f64>,
    W: Vec<f64>,
    facing: Vec<PlanarFacing>,
    motors: Vec<Driven>,
    torques: Vec<f64>,
    /// Their generalized force (nv).
    driving: Vec<f64>,
}

impl PlanarScratch {
    /// Delassus operator of the last step, row-major, 1/kg.
    #[must_use]
    pub fn operator(&self) -> &[f64] {
        &self.W
    }
}

/// A machine on a ground, driven by torques. Motors on their torque–speed line are implicit, as in
/// the rover's tree.
#[derive(Debug)]
pub struct PlanarSystem<'a> {
    /// The machine.
    pub machine: &'a PlanarTree,
    /// The ground.
    pub ground: &'a dyn PlanarGround,
    /// How discs meet it.
    pub rule: ContactRule,
    /// Commanded torques, N m, positive forward.
    pub inputs: &'a [f64],
    /// Scratch of the system.
    pub parts: &'a mut PlanarScratch,
}

/// The points of the ground that face a disc, with their contact's number.
fn facing(
    ground: &dyn PlanarGround,
    rule: ContactRule,
    disc: &PlanarDisc,
    reach: f64,
    out: &mut Vec<PlanarFacing>,
) {
    out.clear();
    match rule {
        ContactRule::Nearest => ground.facing(&disc.centre, disc.radius + reach, out),
        ContactRule::CentreHeight => out.push(ground.below(&disc.centre)),
    }
}

/// The motors of an input that have a torque–speed line, in a step.
#[derive(Clone, Debug)]
struct Driven {
    input: usize,
    motor: PlanarMotor,
    /// Torque–speed line of a single motor, with its command.
    line: MotorLine<f64>,
    /// θ_j.
    theta: f64,
}

impl Driven {
    /// Rate with which they turn forward, rad/s.
    fn rate(&self, v: &[f64]) -> f64 {
        self.motor.gain.signum() * v[self.motor.coordinate]
    }

    /// The rate at which a step evaluates the torque, rad/s.
    fn implicit_rate(&self, start: &[f64], v_end: &[f64]) -> f64 {
        let (begin, end) = (self.rate(start), self.rate(v_end));
        begin + self.theta * (end - begin)
    }
}

impl PlanarSystem<'_> {
    /// Mean torques of a step that ends with the iterate `v_end`, into `parts.torques`.
    fn set_torques(&mut self, start: &[f64], v_end: &[f64]) {
        let PlanarScratch {
            torques, motors, ..
        } = &mut *self.parts;
        torques.clear();
        torques.extend_from_slice(self.inputs);
        for own in motors {
            torques[own.input] = own.line.torque(own.implicit_rate(start, v_end));
        }
    }

    /// Generalized force of the torques of a step that ends with `v_end`, into `parts.driving`.
    fn set_driving(&mut self, start: &[f64], v_end: &[f64]) {
        self.set_torques(start, v_end);
        let PlanarScratch {
            torques, driving, ..
        } = &mut *self.parts;
        driving.clear();
        driving.resize(self.machine.nv(), 0.0);
        self.machine.add_torques(torques, driving);
    }
}

impl Dynamics for PlanarSystem<'_> {
    type T = f64;
    type Configuration = Vec<f64>;

    fn nv(&self) -> usize {
        self.machine.nv()
    }

    fn advance(&self, q: &mut Vec<f64>, v: &[f64], h: f64) {
        for (q, v) in q.iter_mut().zip(v) {
            *q += h * v;
        }
    }

    fn translation_axis(&self, velocity: usize) -> Option<usize> {
        (velocity < 2).then_some(velocity)
    }

    fn is_finite(&self, q: &Vec<f64>) -> bool {
        q.iter().all(|x| x.is_finite())
    }

    fn place_middle(&mut self, q: &Vec<f64>) {
        self.machine.place(q, &mut self.parts.middle);
    }

    fn place_end(&mut self, q: &Vec<f64>) {
        self.machine.place(q, &mut self.parts.end);
    }

    fn update_mass_matrix(&mut self, options: &StepOptions, _: bool, _: bool) {
        let parts = &mut *self.parts;
        parts.matrices.set_mass(self.machine, &parts.middle);
        let step = (options.time_step, options.theta);
        for own in &mut parts.motors {
            let inertia = *parts.matrices.inertia(own.motor.coordinate) / own.motor.gain.abs();
            own.theta = implicit_weight(step, (own.line.slope(), 0.0), inertia);
        }
    }

    fn factorise(&mut self, options: &StepOptions) -> bool {
        let parts = &mut *self.parts;
        for own in &parts.motors {
            let damping = own.motor.gain.abs() * own.line.damping();
            let inertia = parts.matrices.inertia(own.motor.coordinate);
            *inertia += options.time_step * own.theta * damping;
        }
        parts.matrices.factorise()
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        self.parts.matrices.multiply_mass(v, out);
    }

    fn turning(&mut self, _: &StepOptions, v: &[f64], _: &mut [bool]) -> Option<f64> {
        Some(self.machine.turning(v))
    }

    fn is_audited(&self) -> bool {
        true
    }

    fn energies(
        &mut self,
        options: &StepOptions,
        q: &Vec<f64>,
        v: &[f64],
        mut each: impl FnMut(usize, [f64; 2], Vec3<f64>),
    ) {
        let (energy, [x, y]) = self.machine.energy(q, v, &options.gravity.xy());
        each(0, energy.kinetic_and_potential(), Vec3::new(x, y, 0.0));
    }

    fn mass(&self, _cluster: usize) -> Option<f64> {
        Some(self.machine.mass())
    }

    fn half_solve(&self, y: &mut [f64]) {
        self.parts.matrices.forward(y);
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        self.parts.matrices.backward(y);
    }

    fn displacement(&self, y: &[f64], _cluster: usize) -> f64 {
        self.machine.displacement(y)
    }
}

impl Forces for PlanarSystem<'_> {
    fn load(
        &mut self,
        options: &StepOptions,
        start: StepStart<'_, Vec<f64>>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        self.load_at_end(options, start, start.v, v_mean, y);
    }

    fn choose_branches(&mut self, v: &[f64]) {
        let motors = &mut self.parts.motors;
        motors.clear();
        for (input, &torque) in self.inputs.iter().enumerate() {
            if let Some(motor) = self.machine.motor(input) {
                let mut own = Driven {
                    input,
                    motor,
                    line: MotorLine::new(Single::Baseline),
                    theta: 0.5,
                };
                own.line.set_lane(0, Some(&motor.motor), torque, None);
                own.line.choose(own.rate(v));
                motors.push(own);
            }
        }
    }

    fn revise(&mut self, _: bool, v: &[f64], v_end: &[f64]) -> bool {
        let mut is_new = false;
        for own in &mut self.parts.motors {
            let rate = own.implicit_rate(v, v_end);
            is_new |= own.line.revise(true, rate);
        }
        is_new
    }

    fn load_at_end(
        &mut self,
        options: &StepOptions,
        start: StepStart<'_, Vec<f64>>,
        v_end: &[f64],
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        self.set_torques(start.v, v_end);
        let PlanarScratch {
            middle, torques, ..
        } = &mut *self.parts;
        let gravity = options.gravity.xy();
        self.machine.force(middle, v_mean, &gravity, torques, y);
        for y in y {
            *y *= options.time_step;
        }
    }

    fn work_of_displacement(
        &mut self,
        _options: &StepOptions,
        start: StepStart<'_, Vec<f64>>,
        v_end: &[f64],
        displacement: &[f64],
    ) -> Option<f64> {
        self.set_driving(start.v, v_end);
        Some(sum_of_products(&self.parts.driving, displacement))
    }

    fn work(
        &mut self,
        options: &StepOptions,
        start: StepStart<'_, Vec<f64>>,
        v_end: &[f64],
        out: &mut [Work],
    ) {
        self.set_driving(start.v, v_end);
        let parts = &*self.parts;
        let (h, theta) = (options.time_step, options.theta);
        let mean = |k: usize| theta * v_end[k] + (1.0 - theta) * start.v[k];
        let driving = parts.driving.iter().enumerate();
        let power: f64 = driving.map(|(k, f)| f * mean(k)).sum();
        let mut work = h * power;
        for own in &parts.motors {
            let torque = parts.torques[own.input];
            let turned = h * own.motor.gain.signum() * mean(own.motor.coordinate);
            let surplus = torque * turned - own.line.work(torque, turned);
            work -= own.motor.gain.abs() * surplus;
        }
        out.fill(Work {
            supplied: work,
            ..Work::default()
        });
    }
}

impl MechanicalSystem for PlanarSystem<'_> {
    type Machine = Self;

    fn machine(&self) -> &Self {
        self
    }

    fn machine_mut(&mut self) -> &mut Self {
        self
    }

    const DIMENSION: Dimension = Dimension::Two;

    const SETTLES: bool = true;

    type Contact = PlanarContact;

    fn detect(&mut self, v: &[f64], activation: Activation, out: &mut Vec<PlanarContact>) {
        out.clear();
        let PlanarScratch {
            middle,
            facing: found,
            ..
        } = &mut *self.parts;
        for i in 0..self.machine.n_wheels() {
            let disc = self.machine.disc(i, middle);
            let velocity = self.machine.point_velocity(i, middle, &disc.centre, v);
            let reach = activation.reach(|| velocity.norm());
            facing(self.ground, self.rule, &disc, reach, found);
            for (feature, facing) in (0..).zip(&*found) {
                let mut contact = PlanarContact {
                    key: PlanarKey {
                        disc: u32::try_from(i).unwrap_or(u32::MAX),
                        feature,
                    },
                    point: disc.centre,
                    foot: facing.foot,
                    n: facing.n,
                    gap: 0.0,
                };
                contact.meet(&disc, facing, self.rule);
                if activation.admits(contact.gap, || contact.n.dot(&velocity)) {
                    out.push(contact);
                }
            }
        }
    }

    fn relocate(&mut self, contacts: &mut [PlanarContact]) {
        for contact in contacts {
            let i = contact.key.disc as usize;
            let disc = self.machine.disc(i, &self.parts.end);
            let moved = (disc.centre - contact.foot).norm();
            // The same minimum of the distance is the one whose foot is next to the old foot.
            facing(self.ground, self.rule, &disc, moved, &mut self.parts.facing);
            let next = self.parts.facing.iter().min_by(|a, b| {
                let away = |f: &PlanarFacing| (f.foot - contact.foot).norm();
                away(a).total_cmp(&away(b))
            });
            let tangent = PlanarFacing {
                foot: contact.foot,
                n: contact.n,
                distance: contact.n.dot(&(disc.centre - contact.foot)),
            };
            let next = *next.unwrap_or(&tangent);
            contact.meet(&disc, &next, self.rule);
        }
    }

    fn assemble(&mut self, contacts: &[PlanarContact], v: &[f64], u: &mut [f64]) {
        let n = 2 * contacts.len();
        let PlanarScratch {
            end,
            matrices,
            Z,
            W,
            ..
        } = &mut *self.parts;
        matrices.clear_rows(v.len());
        Z.clear();
        for contact in contacts {
            let (wheel, frame) = (contact.key.disc as usize, [contact.n, contact.t()]);
            matrices.push_contact((self.machine, end), wheel, &contact.point, &frame, Z);
        }
        W.resize(n * n, 0.0);
        let row = |i: usize| &Z[i * v.len()..(i + 1) * v.len()];
        for i in 0..n {
            for j in 0..=i {
                W[i * n + j] = sum_of_products(row(i), row(j));
                W[j * n + i] = W[i * n + j];
            }
        }
        u.fill(0.0);
        self.add_local_of_velocity(contacts, v, u);
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        for (row, out) in self.parts.Z.chunks_exact(y.len()).zip(out) {
            *out = sum_of_products(row, y);
        }
    }

    fn add_local_of_velocity(&self, _contacts: &[PlanarContact], v: &[f64], out: &mut [f64]) {
        for (i, out) in out.chunks_exact_mut(2).enumerate() {
            self.parts.matrices.add_local(i, v, out);
        }
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        for (row, p) in self.parts.Z.chunks_exact(y.len()).zip(p) {
            for (y, z) in y.iter_mut().zip(row) {
                *y += z * p;
            }
        }
    }

    fn generalized_impulse(&self, _contacts: &[PlanarContact], p: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (i, p) in p.as_chunks::<2>().0.iter().enumerate() {
            self.parts.matrices.add_impulse(i, p, out);
        }
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled(Dimension::Two, &self.parts.W, q, mu)
    }
}
