//! A tree of rigid bodies in the plane: the kinematics and dynamics of every planar machine.
//!
//! The coordinates are x, y of the base's origin, m, then an angle of each part, rad, positive to
//! the left: relative to the part that carries it, or in the world ([`PlanarBody::is_absolute`]).
//! On the path from part b to the base, each part i turns about its origin o_i. A point x of part b
//! thus moves with
//!
//! ```text
//! (ẋ, ẏ) + Σ_i e_z × (x_i − o_i) q̇_i
//! ```
//!
//! where x_i is x itself below the first part with an absolute angle, and above it the origin of
//! that part. M, the bias and the contacts' rows are sums of these columns.

use nalgebra::Vector2;

use crate::multibody::{Energy, Motor};
use crate::scalar::elementary::sin_cos;

/// A body of the tree.
#[derive(Clone, Debug)]
pub struct PlanarBody {
    /// The part that carries it; 0 for the base itself. It stands before this one.
    pub parent: usize,
    /// Joint in the parent's axes, m.
    pub joint: Vector2<f64>,
    /// kg.
    pub mass: f64,
    /// Mass centre in its own axes, m.
    pub centre: Vector2<f64>,
    /// About the mass centre, kg m².
    pub inertia: f64,
    /// Whether the part's coordinate is its angle in the world, not relative to its parent.
    pub is_absolute: bool,
    /// Whether the part's rotation changes neither the mass distribution nor what it carries.
    pub is_spinner: bool,
}

impl PlanarBody {
    /// A base, or a wheel on the base's axle at `joint`, with its mass centre at its origin.
    pub(super) fn centred(joint: Vector2<f64>, mass: f64, inertia: f64) -> Self {
        Self {
            parent: 0,
            joint,
            mass,
            centre: Vector2::zeros(),
            inertia,
            is_absolute: true,
            is_spinner: true,
        }
    }
}

/// A wheel, or a pair of them, that touches the ground as one disc.
#[derive(Clone, Debug)]
pub struct DiscWheel {
    /// The part that it is fixed to.
    pub part: usize,
    /// In the part's axes, m.
    pub centre: Vector2<f64>,
    /// m.
    pub radius: f64,
    /// Largest command, either way, N m.
    pub torque_limit: f64,
    /// Torque on the part of a unit of command: the number of wheels and their sign; 0 where the
    /// joint is locked. A part that another one carries pushes itself off from that.
    pub gain: f64,
    /// Torque–speed line of each wheel's motor; without one the torque is the command at any speed.
    pub motor: Option<Motor>,
}

impl DiscWheel {
    /// A wheel about its part's origin whose motor drives it forward at any speed.
    pub(super) fn driven(part: usize, radius: f64) -> Self {
        Self {
            part,
            centre: Vector2::zeros(),
            radius,
            torque_limit: f64::INFINITY,
            // A wheel that rolls forward turns to the right.
            gain: -1.0,
            motor: None,
        }
    }
}

/// A disc of a machine in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarDisc {
    /// m.
    pub centre: Vector2<f64>,
    /// m.
    pub radius: f64,
}

/// The motors of one torque: equal, and with a common angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarMotor {
    /// Torque–speed line of each.
    pub motor: Motor,
    /// The coordinate that they drive, relative to their carrier.
    pub coordinate: usize,
    /// Torque about that coordinate of a unit forward: their number and their sign.
    pub gain: f64,
}

/// Origin and x axis of every part at a configuration, and scratch for their motion.
#[derive(Clone, Debug, Default)]
pub struct PlanarPoses {
    /// Origin of the base in the world, m. All other places are relative to it, so a machine far
    /// away loses no precision.
    base: Vector2<f64>,
    origin: Vec<Vector2<f64>>,
    x_axis: Vec<Vector2<f64>>,
    /// Angular rate, rad/s.
    rate: Vec<f64>,
    /// Acceleration of the origin while no rate changes, m/s².
    acceleration: Vec<Vector2<f64>>,
}

impl PlanarPoses {
    /// A point of a part, relative to the base's origin.
    fn point(&self, part: usize, p: &Vector2<f64>) -> Vector2<f64> {
        let x_axis = &self.x_axis[part];
        self.origin[part] + x_axis * p.x + left(x_axis) * p.y
    }
}

/// Rotation by a quarter turn to the left: the velocity at `r` for a unit rate.
fn left(r: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-r.y, r.x)
}

/// A planar machine: parts, wheels and, for a test rig, inertia added to single coordinates.
#[derive(Clone, Debug)]
pub struct PlanarTree {
    parts: Vec<PlanarBody>,
    wheels: Vec<DiscWheel>,
    n_inputs: usize,
    armature: Vec<f64>,
    arms: Vec<f64>,
    fingerprint: u64,
}

impl PlanarTree {
    /// A machine of these parts, the first of which is the base. `fingerprint`: a number that is
    /// equal for two machines only if they are of the same kind, with the same masses, inertias and
    /// lengths.
    pub(super) fn new(parts: Vec<PlanarBody>, wheels: Vec<DiscWheel>, fingerprint: u64) -> Self {
        let arms = arms(&parts, &wheels);
        let armature = vec![0.0; arms.len()];
        Self {
            n_inputs: wheels.len(),
            parts,
            wheels,
            armature,
            arms,
            fingerprint,
        }
    }

    /// Without torques, and with inertia added to each coordinate, kg and kg m².
    pub(super) fn held_by(self, armature: Vec<f64>) -> Self {
        Self {
            n_inputs: 0,
            armature,
            ..self
        }
    }

    /// Number of coordinates.
    #[must_use]
    pub fn nv(&self) -> usize {
        2 + self.parts.len()
    }

    /// Number of torques that can be set: one of each wheel, or none.
    #[must_use]
    pub fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    /// Number of wheels.
    #[must_use]
    pub fn n_wheels(&self) -> usize {
        self.wheels.len()
    }

    /// See [`DiscWheel::torque_limit`].
    #[must_use]
    pub fn torque_limit(&self, wheel: usize) -> f64 {
        self.wheels[wheel].torque_limit
    }

    /// The motors of a wheel, if they have a torque–speed line.
    #[must_use]
    pub fn motor(&self, wheel: usize) -> Option<PlanarMotor> {
        let wheel = &self.wheels[wheel];
        let motor = wheel.motor.filter(|_| wheel.gain != 0.0)?;
        Some(PlanarMotor {
            motor,
            coordinate: 2 + wheel.part,
            gain: wheel.gain,
        })
    }

    /// Fingerprint of the numbers that it was made of.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// The poses of a configuration (nv).
    #[must_use]
    pub fn poses(&self, q: &[f64]) -> PlanarPoses {
        let mut poses = PlanarPoses::default();
        self.place(q, &mut poses);
        poses
    }

    /// [`Self::poses`] without a new allocation.
    pub fn place(&self, q: &[f64], poses: &mut PlanarPoses) {
        poses.base = Vector2::new(q[0], q[1]);
        let PlanarPoses { origin, x_axis, .. } = poses;
        origin.clear();
        x_axis.clear();
        for (b, part) in self.parts.iter().enumerate() {
            let (at, carrier) = if b == 0 {
                (Vector2::zeros(), Vector2::x())
            } else {
                let (p, joint) = (part.parent, &part.joint);
                let carrier = x_axis[p];
                let at = origin[p] + carrier * joint.x + left(&carrier) * joint.y;
                (
                    at,
                    if part.is_absolute {
                        Vector2::x()
                    } else {
                        carrier
                    },
                )
            };
            origin.push(at);
            x_axis.push(if part.is_spinner {
                carrier
            } else {
                let (s, c) = sin_cos(q[2 + b]);
                carrier * c + left(&carrier) * s
            });
        }
    }

    /// The parts that move a point x of part b (relative to the base's origin), from b itself to
    /// the base: each with the velocity of x for a unit of its rate, and whether it turns b.
    fn movers<'a>(
        &'a self,
        poses: &'a PlanarPoses,
        b: usize,
        x: Vector2<f64>,
    ) -> impl Iterator<Item = (usize, Vector2<f64>, bool)> + 'a {
        let mut next = Some((b, x, true));
        std::iter::from_fn(move || {
            let (i, x, turns) = next?;
            let (part, origin) = (&self.parts[i], poses.origin[i]);
            let above = if part.is_absolute {
                (part.parent, origin, false)
            } else {
                (part.parent, x, turns)
            };
            next = (i > 0).then_some(above);
            Some((i, left(&(x - origin)), turns))
        })
    }

    /// `M(q)` (nv × nv, row-major), kg, kg m, kg m².
    pub fn mass_matrix(&self, poses: &PlanarPoses, M: &mut [f64]) {
        let n = self.nv();
        M.fill(0.0);
        for (b, part) in self.parts.iter().enumerate() {
            let (m, c) = (part.mass, poses.point(b, &part.centre));
            M[0] += m;
            M[n + 1] += m;
            for (i, turn, turns) in self.movers(poses, b, c) {
                M[2 + i] += m * turn.x;
                M[n + 2 + i] += m * turn.y;
                for (j, other, turn_too) in self.movers(poses, b, c).filter(|(j, ..)| *j <= i) {
                    let inertia = if turns && turn_too { part.inertia } else { 0.0 };
                    M[(2 + j) * n + 2 + i] += m * turn.dot(&other) + inertia;
                }
            }
        }
        for k in 0..n {
            M[k * n + k] += self.armature[k];
            for i in 0..k {
                M[k * n + i] = M[i * n + k];
            }
        }
    }

    /// `F(q, v)` (nv), N and N m: gravity (m/s²), torques (N m, positive forward) and terms
    /// quadratic in v, so that `M v̇ = F` without contacts.
    pub fn force(
        &self,
        poses: &mut PlanarPoses,
        v: &[f64],
        gravity: &Vector2<f64>,
        torques: &[f64],
        F: &mut [f64],
    ) {
        F.fill(0.0);
        poses.rate.clear();
        poses.acceleration.clear();
        for (b, part) in self.parts.iter().enumerate() {
            let p = part.parent;
            let (mut rate, mut a) = (v[2 + b], Vector2::zeros());
            if b > 0 {
                let carrier = poses.rate[p];
                let arm = poses.origin[b] - poses.origin[p];
                a = poses.acceleration[p] - arm * (carrier * carrier);
                rate += if part.is_absolute { 0.0 } else { carrier };
            }
            poses.rate.push(rate);
            poses.acceleration.push(a);
            let c = poses.point(b, &part.centre);
            let centripetal = (c - poses.origin[b]) * (rate * rate);
            let f = (gravity - a + centripetal) * part.mass;
            F[0] += f.x;
            F[1] += f.y;
            for (i, turn, _) in self.movers(poses, b, c) {
                F[2 + i] += turn.dot(&f);
            }
        }
        self.add_torques(torques, F);
    }

    /// `F += ` the force (nv) of torques alone, N m, positive forward.
    pub fn add_torques(&self, torques: &[f64], F: &mut [f64]) {
        for (wheel, torque) in self.wheels.iter().zip(torques) {
            let torque = wheel.gain * torque;
            F[2 + wheel.part] += torque;
            // The reaction acts on every angle that turns the carrier; a relative angle has none.
            let mut b = wheel.part;
            if b > 0 && self.parts[b].is_absolute {
                loop {
                    b = self.parts[b].parent;
                    F[2 + b] -= torque;
                    if b == 0 || self.parts[b].is_absolute {
                        break;
                    }
                }
            }
        }
    }

    /// Potential energy `−Σ m g · x`, J.
    #[must_use]
    pub fn potential(&self, poses: &PlanarPoses, gravity: &Vector2<f64>) -> f64 {
        let of = |(b, part): (usize, &PlanarBody)| {
            let centre = poses.base + poses.point(b, &part.centre);
            part.mass * gravity.dot(&centre)
        };
        -self.parts.iter().enumerate().map(of).sum::<f64>()
    }

    /// Total mass, kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.parts.iter().map(|part| part.mass).sum()
    }

    /// Energy, J, and linear momentum, kg m/s, at a state (nv, nv).
    #[must_use]
    pub fn energy(&self, q: &[f64], v: &[f64], gravity: &Vector2<f64>) -> (Energy, [f64; 2]) {
        let (n, poses) = (self.nv(), self.poses(q));
        let mut M = vec![0.0; n * n];
        self.mass_matrix(&poses, &mut M);
        let dot = |a: &[f64]| a.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
        let momentum: Vec<f64> = M.chunks_exact(n).map(dot).collect();
        let energy = Energy {
            kinetic: 0.5 * dot(&momentum),
            potential: self.potential(&poses, gravity),
        };
        (energy, [momentum[0], momentum[1]])
    }

    /// Largest angular speed of a frame whose pose matters, rad/s.
    #[must_use]
    pub fn turning(&self, v: &[f64]) -> f64 {
        let rate = |b: usize| {
            if self.parts[b].is_spinner {
                0.0
            } else {
                v[2 + b].abs()
            }
        };
        rate(0) + (1..self.parts.len()).map(rate).fold(0.0, f64::max)
    }

    /// The disc of a wheel.
    #[must_use]
    pub fn disc(&self, wheel: usize, poses: &PlanarPoses) -> PlanarDisc {
        let wheel = &self.wheels[wheel];
        PlanarDisc {
            centre: poses.base + poses.point(wheel.part, &wheel.centre),
            radius: wheel.radius,
        }
    }

    /// Rows `dᵀ J` (nv each) of the velocity of a wheel's material point (world, m) along some
    /// directions; appended to `out`.
    pub fn push_rows(
        &self,
        wheel: usize,
        poses: &PlanarPoses,
        point: &Vector2<f64>,
        directions: &[Vector2<f64>],
        out: &mut Vec<f64>,
    ) {
        let (n, begin) = (self.nv(), out.len());
        out.resize(begin + n * directions.len(), 0.0);
        for (row, d) in out[begin..].chunks_exact_mut(n).zip(directions) {
            (row[0], row[1]) = (d.x, d.y);
            let x = point - poses.base;
            for (i, turn, _) in self.movers(poses, self.wheels[wheel].part, x) {
                row[2 + i] = turn.dot(d);
            }
        }
    }

    /// Velocity (m/s) of a wheel's material point (world, m).
    #[must_use]
    pub fn point_velocity(
        &self,
        wheel: usize,
        poses: &PlanarPoses,
        point: &Vector2<f64>,
        v: &[f64],
    ) -> Vector2<f64> {
        let movers = self.movers(poses, self.wheels[wheel].part, point - poses.base);
        movers.fold(Vector2::new(v[0], v[1]), |sum, (i, turn, _)| {
            sum + turn * v[2 + i]
        })
    }

    /// Largest displacement, m, that a change of the coordinates (nv) causes.
    #[must_use]
    pub fn displacement(&self, y: &[f64]) -> f64 {
        let own = y.iter().zip(&self.arms);
        own.map(|(y, arm)| (y * arm).abs()).fold(0.0, f64::max)
    }
}

/// Lengths that convert the change of a coordinate into a displacement, m: 1 for places, the
/// longest reach to a wheel's rim for angles.
fn arms(parts: &[PlanarBody], wheels: &[DiscWheel]) -> Vec<f64> {
    let mut arms = vec![0.0_f64; 2 + parts.len()];
    (arms[0], arms[1]) = (1.0, 1.0);
    for wheel in wheels {
        let mut reach = wheel.centre.norm() + wheel.radius;
        let mut b = wheel.part;
        loop {
            arms[2 + b] = arms[2 + b].max(reach);
            if b == 0 {
                break;
            }
            let beyond = if parts[b].is_absolute { 0.0 } else { reach };
            reach = beyond + parts[b].joint.norm();
            b = parts[b].parent;
        }
    }
    arms
}

/// Fingerprint of a kind of machine with the numbers that describe it.
pub(super) fn fingerprint(kind: &str, numbers: impl IntoIterator<Item = f64>) -> u64 {
    let numbers = numbers.into_iter().flat_map(|x| x.to_bits().to_le_bytes());
    crate::multibody::fingerprint(kind.bytes().chain(numbers))
}
