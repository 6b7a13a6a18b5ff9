//! A planar machine on a ground as a mechanical system: contacts with one
//! tangent, `M = L Lᵀ`, `Z = L⁻¹ H`.

use nalgebra::{Cholesky, SMatrix, SVector, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::command::Drive;
use super::motor_branch::{MotorBranch, line_slope};
use crate::contact::Activation;
use crate::integrator::{
    MechanicalEnergy, MechanicalSystem, Start, StepOptions, UnilateralContact,
};
use crate::planar::{ContactRule, Disc, Facing, Ground, PlanarMachine, PlanarMotor};
use crate::problem::{Dimension, FrictionContactProblem};

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
    /// Its key from step to step.
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

    fn meet(&mut self, disc: &Disc, facing: &Facing, rule: ContactRule) {
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

    fn key(&self) -> PlanarKey {
        self.key
    }

    fn gap(&self) -> f64 {
        self.gap
    }
}

/// Matrices of a step: scratch.
#[derive(Clone, Debug)]
pub struct PlanarScratch<const NV: usize> {
    middle: SVector<f64, NV>,
    end: SVector<f64, NV>,
    mass: SMatrix<f64, NV, NV>,
    /// Lower factor, `M = L Lᵀ`.
    L: SMatrix<f64, NV, NV>,
    /// Columns n, t of each contact.
    H: Vec<SMatrix<f64, NV, 2>>,
    Z: Vec<SMatrix<f64, NV, 2>>,
    W: Vec<f64>,
    facing: Vec<Facing>,
    /// Of each input.
    motors: Vec<MotorBranch>,
    torques: Vec<f64>,
}

impl<const NV: usize> Default for PlanarScratch<NV> {
    fn default() -> Self {
        Self {
            middle: SVector::zeros(),
            end: SVector::zeros(),
            mass: SMatrix::identity(),
            L: SMatrix::identity(),
            H: Vec::new(),
            Z: Vec::new(),
            W: Vec::new(),
            facing: Vec::new(),
            motors: Vec::new(),
            torques: Vec::new(),
        }
    }
}

impl<const NV: usize> PlanarScratch<NV> {
    /// Delassus operator of the last step, row-major, 1/kg.
    #[must_use]
    pub fn operator(&self) -> &[f64] {
        &self.W
    }
}

/// A machine on a ground, driven by torques. Motors on their torque–speed line are implicit, as in
/// the rover's tree.
#[derive(Debug)]
pub struct PlanarSystem<'a, const NV: usize, M> {
    /// The machine.
    pub machine: &'a M,
    /// The ground.
    pub ground: &'a dyn Ground,
    /// How discs meet it.
    pub rule: ContactRule,
    /// Commanded torques, N m, positive forward.
    pub inputs: &'a [f64],
    /// Its scratch.
    pub parts: &'a mut PlanarScratch<NV>,
}

/// The points of the ground that face a disc, with their contact's number.
fn facing(ground: &dyn Ground, rule: ContactRule, disc: &Disc, reach: f64, out: &mut Vec<Facing>) {
    out.clear();
    match rule {
        ContactRule::Nearest => ground.facing(&disc.centre, disc.radius + reach, out),
        ContactRule::CentreHeight => out.push(ground.below(&disc.centre)),
    }
}

/// One of the motors of a torque, with its command, N m.
fn drive(motor: &PlanarMotor, torque: f64) -> Drive {
    Drive {
        torque,
        motor: Some(motor.motor),
    }
}

/// Rates before and after a step with which the motors of input i turn, forward, rad/s.
fn motor_rates(motor: &PlanarMotor, begin: &[f64], end: &[f64]) -> (f64, f64) {
    let (k, sign) = (motor.coordinate, motor.gain.signum());
    (sign * begin[k], sign * end[k])
}

impl<const NV: usize, M: PlanarMachine<NV>> PlanarSystem<'_, NV, M> {
    /// Mean torques of a step that ends with the iterate `v_end`, into `parts.torques`.
    fn set_torques(&mut self, start: &[f64], v_end: &[f64]) {
        let parts = &mut *self.parts;
        parts.torques.clear();
        parts.torques.extend_from_slice(self.inputs);
        for (i, (torque, branch)) in parts.torques.iter_mut().zip(&parts.motors).enumerate() {
            if let Some(motor) = self.machine.motor(i) {
                *torque = branch.torque(|| motor_rates(&motor, start, v_end));
            }
        }
    }

    /// `y = h F(q_m, v_mean)` with the torques of a step that ends with the iterate `v_end`.
    fn impulse(
        &mut self,
        options: &StepOptions,
        (start, v_end): (&[f64], &[f64]),
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        self.set_torques(start, v_end);
        let parts = &*self.parts;
        let v = SVector::<f64, NV>::from_column_slice(v_mean);
        let gravity = options.gravity.xy();
        let force = self
            .machine
            .force(&parts.middle, &v, &gravity, &parts.torques);
        y.copy_from_slice((force * options.time_step).as_slice());
    }
}

impl<const NV: usize, M: PlanarMachine<NV>> MechanicalSystem for PlanarSystem<'_, NV, M> {
    type Configuration = SVector<f64, NV>;
    type Contact = PlanarContact;

    const DIMENSION: Dimension = Dimension::Two;

    fn nv(&self) -> usize {
        NV
    }

    fn set_moved(&self, from: &SVector<f64, NV>, v: &[f64], h: f64, to: &mut SVector<f64, NV>) {
        for ((to, from), v) in to.iter_mut().zip(from).zip(v) {
            *to = from + h * v;
        }
    }

    fn advance(&self, q: &mut SVector<f64, NV>, v: &[f64], h: f64) {
        for (q, v) in q.iter_mut().zip(v) {
            *q += h * v;
        }
    }

    fn is_finite(&self, q: &SVector<f64, NV>) -> bool {
        q.iter().all(|x| x.is_finite())
    }

    fn place_middle(&mut self, q: &SVector<f64, NV>) {
        self.parts.middle = *q;
    }

    fn place_end(&mut self, q: &SVector<f64, NV>) {
        self.parts.end = *q;
    }

    fn detect(&mut self, v: &[f64], mut activation: Activation, out: &mut Vec<PlanarContact>) {
        out.clear();
        let v = SVector::<f64, NV>::from_column_slice(v);
        let q = self.parts.middle;
        for i in 0..self.machine.n_discs() {
            let disc = self.machine.disc(i, &q);
            let J = self.machine.point_jacobian(i, &q, &disc.centre);
            let velocity = J * v;
            activation.margin = activation.lead.abs() * velocity.norm();
            facing(
                self.ground,
                self.rule,
                &disc,
                activation.reach(),
                &mut self.parts.facing,
            );
            for (feature, facing) in (0..).zip(&self.parts.facing) {
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
        let q = self.parts.end;
        for contact in contacts {
            let i = contact.key.disc as usize;
            let disc = self.machine.disc(i, &q);
            let moved = (disc.centre - contact.foot).norm();
            // The same minimum of the distance is the one whose foot is next to the old foot.
            facing(self.ground, self.rule, &disc, moved, &mut self.parts.facing);
            let next = self.parts.facing.iter().min_by(|a, b| {
                let away = |f: &Facing| (f.foot - contact.foot).norm();
                away(a).total_cmp(&away(b))
            });
            let tangent = Facing {
                foot: contact.foot,
                n: contact.n,
                distance: contact.n.dot(&(disc.centre - contact.foot)),
            };
            let next = *next.unwrap_or(&tangent);
            contact.meet(&disc, &next, self.rule);
        }
    }

    fn update_mass_matrix(&mut self, options: &StepOptions) {
        let parts = &mut *self.parts;
        parts.mass = self.machine.mass_matrix(&parts.middle);
        let step = (options.time_step, options.theta);
        for (i, branch) in parts.motors.iter_mut().enumerate() {
            if let Some(motor) = self.machine.motor(i) {
                let k = motor.coordinate;
                let inertia = parts.mass[(k, k)] / motor.gain.abs();
                let command = drive(&motor, 0.0);
                branch.set_theta(step, (line_slope(Some(&command)), 0.0), inertia);
            }
        }
    }

    fn factorise(&mut self, options: &StepOptions) -> bool {
        let parts = &mut *self.parts;
        for (i, branch) in parts.motors.iter().enumerate() {
            if let Some(motor) = self.machine.motor(i) {
                let damping = motor.gain.abs() * branch.damping();
                let k = motor.coordinate;
                parts.mass[(k, k)] += options.time_step * branch.theta() * damping;
            }
        }
        match Cholesky::new(self.parts.mass) {
            Some(factor) => {
                self.parts.L = factor.l();
                true
            }
            None => false,
        }
    }

    fn multiply_mass(&self, v: &[f64], out: &mut [f64]) {
        let momentum = self.parts.mass * SVector::<f64, NV>::from_column_slice(v);
        out.copy_from_slice(momentum.as_slice());
    }

    fn load(
        &mut self,
        options: &StepOptions,
        start: Start<'_, SVector<f64, NV>>,
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        self.impulse(options, (start.v, start.v), v_mean, y);
    }

    fn choose_branches(&mut self, start: Start<'_, SVector<f64, NV>>) {
        let parts = &mut *self.parts;
        parts
            .motors
            .resize(self.inputs.len(), MotorBranch::default());
        for (i, (branch, torque)) in parts.motors.iter_mut().zip(self.inputs).enumerate() {
            if let Some(motor) = self.machine.motor(i) {
                let (rate, _) = motor_rates(&motor, start.v, start.v);
                branch.choose(Some(&drive(&motor, *torque)), rate);
            }
        }
    }

    fn revise(&mut self, start: Start<'_, SVector<f64, NV>>, v_end: &[f64]) -> bool {
        let parts = &mut *self.parts;
        let mut is_new = false;
        for (i, (branch, torque)) in parts.motors.iter_mut().zip(self.inputs).enumerate() {
            if let Some(motor) = self.machine.motor(i) {
                let (begin, end) = motor_rates(&motor, start.v, v_end);
                let command = drive(&motor, *torque);
                is_new |= branch.revise(Some(&command), begin, end);
            }
        }
        is_new
    }

    fn turning(&self, v: &[f64]) -> f64 {
        self.machine.turning(&SVector::from_column_slice(v))
    }

    fn load_at_end(
        &mut self,
        options: &StepOptions,
        start: Start<'_, SVector<f64, NV>>,
        v_end: &[f64],
        v_mean: &[f64],
        y: &mut [f64],
    ) {
        self.impulse(options, (start.v, v_end), v_mean, y);
    }

    fn energy(
        &mut self,
        options: &StepOptions,
        q: &SVector<f64, NV>,
        v: &[f64],
    ) -> Option<MechanicalEnergy> {
        let v = SVector::<f64, NV>::from_column_slice(v);
        let momentum = self.machine.mass_matrix(q) * v;
        // A force along x or y acts on the whole mass.
        let mass = self.machine.mass_matrix(q)[(0, 0)];
        Some(MechanicalEnergy {
            kinetic: 0.5 * momentum.dot(&v),
            potential: self.machine.potential(q, &options.gravity.xy()),
            momentum: Vector3::new(momentum[0], momentum[1], 0.0),
            mass,
        })
    }

    fn work_of_displacement(
        &mut self,
        _options: &StepOptions,
        start: Start<'_, SVector<f64, NV>>,
        v_end: &[f64],
        displacement: &[f64],
    ) -> f64 {
        let (still, none) = (SVector::zeros(), Vector2::zeros());
        self.set_torques(start.v, v_end);
        let parts = &*self.parts;
        let torques = self
            .machine
            .force(&parts.middle, &still, &none, &parts.torques);
        torques.iter().zip(displacement).map(|(f, d)| f * d).sum()
    }

    fn work(
        &mut self,
        options: &StepOptions,
        start: Start<'_, SVector<f64, NV>>,
        v_end: &[f64],
    ) -> f64 {
        let (still, none) = (SVector::zeros(), Vector2::zeros());
        self.set_torques(start.v, v_end);
        let parts = &*self.parts;
        let torques = self
            .machine
            .force(&parts.middle, &still, &none, &parts.torques);
        let (h, theta) = (options.time_step, options.theta);
        let mean = |k: usize| theta * v_end[k] + (1.0 - theta) * start.v[k];
        let power: f64 = torques.iter().enumerate().map(|(k, f)| f * mean(k)).sum();
        let mut work = h * power;
        for (i, &torque) in parts.torques.iter().enumerate() {
            if let Some(motor) = self.machine.motor(i) {
                let turned = h * motor.gain.signum() * mean(motor.coordinate);
                let command = drive(&motor, self.inputs[i]);
                let surplus = torque * turned - MotorBranch::work(Some(&command), torque, turned);
                work -= motor.gain.abs() * surplus;
            }
        }
        work
    }

    fn half_solve(&self, y: &mut [f64]) {
        let L = &self.parts.L;
        for i in 0..NV {
            let known: f64 = (0..i).map(|k| L[(i, k)] * y[k]).sum();
            y[i] = (y[i] - known) / L[(i, i)];
        }
    }

    fn half_solve_back(&self, y: &mut [f64]) {
        let L = &self.parts.L;
        for i in (0..NV).rev() {
            let known: f64 = (i + 1..NV).map(|k| L[(k, i)] * y[k]).sum();
            y[i] = (y[i] - known) / L[(i, i)];
        }
    }

    fn assemble(&mut self, contacts: &[PlanarContact], v: &[f64], u: &mut [f64]) {
        let n = 2 * contacts.len();
        let q = self.parts.end;
        let velocity = SVector::<f64, NV>::from_column_slice(v);
        self.parts.H.clear();
        self.parts.Z.clear();
        for (contact, u) in contacts.iter().zip(u.chunks_exact_mut(2)) {
            let J = self
                .machine
                .point_jacobian(contact.key.disc as usize, &q, &contact.point);
            let mut H = SMatrix::<f64, NV, 2>::zeros();
            H.set_column(0, &J.tr_mul(&contact.n));
            H.set_column(1, &J.tr_mul(&contact.t()));
            u.copy_from_slice(H.tr_mul(&velocity).as_slice());
            let mut Z = H;
            for column in Z.as_mut_slice().chunks_exact_mut(NV) {
                self.half_solve(column);
            }
            self.parts.H.push(H);
            self.parts.Z.push(Z);
        }
        let parts = &mut *self.parts;
        parts.W.resize(n * n, 0.0);
        for (i, a) in parts.Z.iter().enumerate() {
            for (j, b) in parts.Z[..=i].iter().enumerate() {
                let block = a.tr_mul(b);
                for r in 0..2 {
                    for s in 0..2 {
                        parts.W[(2 * i + r) * n + 2 * j + s] = block[(r, s)];
                        parts.W[(2 * j + s) * n + 2 * i + r] = block[(r, s)];
                    }
                }
            }
        }
    }

    fn local(&self, y: &[f64], out: &mut [f64]) {
        let y = SVector::<f64, NV>::from_column_slice(y);
        for (Z, out) in self.parts.Z.iter().zip(out.chunks_exact_mut(2)) {
            out.copy_from_slice(Z.tr_mul(&y).as_slice());
        }
    }

    fn add_local_of_velocity(&self, _contacts: &[PlanarContact], v: &[f64], out: &mut [f64]) {
        let v = SVector::<f64, NV>::from_column_slice(v);
        for (H, out) in self.parts.H.iter().zip(out.chunks_exact_mut(2)) {
            let u = H.tr_mul(&v);
            out[0] += u[0];
            out[1] += u[1];
        }
    }

    fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        for (Z, p) in self.parts.Z.iter().zip(p.chunks_exact(2)) {
            for (y, row) in y.iter_mut().zip(Z.row_iter()) {
                *y += row[0] * p[0] + row[1] * p[1];
            }
        }
    }

    fn generalized_impulse(&self, _contacts: &[PlanarContact], p: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (H, p) in self.parts.H.iter().zip(p.chunks_exact(2)) {
            for (out, row) in out.iter_mut().zip(H.row_iter()) {
                *out += row[0] * p[0] + row[1] * p[1];
            }
        }
    }

    fn problem<'a>(&'a self, q: &'a [f64], mu: &'a [f64]) -> FrictionContactProblem<'a> {
        FrictionContactProblem::from_assembled(Dimension::Two, &self.parts.W, q, mu)
    }

    fn displacement(&self, y: &[f64]) -> f64 {
        let arms = self.machine.arms();
        y.iter()
            .zip(&arms)
            .fold(0.0_f64, |m, (y, arm)| m.max((y * arm).abs()))
    }
}

/// `Hᵀ` of contacts at a configuration, rows n and t of each: for checks and for other schemes.
#[must_use]
pub fn contact_rows<const NV: usize, M: PlanarMachine<NV>>(
    machine: &M,
    q: &SVector<f64, NV>,
    contacts: &[PlanarContact],
) -> Vec<[SVector<f64, NV>; 2]> {
    let rows = |contact: &PlanarContact| {
        let J = machine.point_jacobian(contact.key.disc as usize, q, &contact.point);
        [J.tr_mul(&contact.n), J.tr_mul(&contact.t())]
    };
    contacts.iter().map(rows).collect()
}
