//! A mirror-symmetric rover driven straight, reduced to its plane of symmetry.
//!
//! In a scene that is symmetric about the vertical plane through the heading (equal torques left
//! and right, no steering, ground that falls or rises along the heading only), the motion is
//! symmetric: z, roll, heading and every joint that does not turn about z stay at zero, and the two
//! joints of a mirrored pair have one angle. With `v = P w`, where the columns of P span the
//! remaining motion, the machine is
//!
//! ```text
//! Pᵀ M P ẇ + Pᵀ (N v + G) = Pᵀ T u + Pᵀ H p
//! ```
//!
//! This is a planar tree whose bodies are the pairs, twice as heavy. The two contacts of a pair of
//! wheels share one normal and one tangent; their impulses add up, and their lateral parts vanish.
//!
//! Coordinates: x, y of the base's origin, its angle, then the angle of each pair's joint relative
//! to its carrier. Only wheels touch the ground; boxes do not.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::error::PlanarError;
use super::machine::{Disc, PlanarMachine, PlanarMotor};
use crate::multibody::{Body, Joint, JointAxis, JointProperties, Model, Motor, Passive};
use crate::scalar::elementary::sin_cos;

/// Relative difference up to which two sides count as mirror images.
const ALIKE: f64 = 1e-9;

/// A pair of mirrored bodies, or one body in the plane of symmetry.
#[derive(Clone, Debug)]
struct Part {
    /// Bodies of the model.
    bodies: Vec<usize>,
    /// Part that carries it (0 for the base itself).
    parent: usize,
    /// Joint in the parent's axes, m.
    joint: Vector2<f64>,
    /// kg, of all its bodies.
    mass: f64,
    /// Mass centre in its own axes, m.
    centre: Vector2<f64>,
    /// About the mass centre, kg m².
    inertia: f64,
    /// Its rotation does not change the mass distribution.
    is_spinner: bool,
}

/// A pair of mirrored wheels.
#[derive(Clone, Debug)]
struct WheelPair {
    names: Vec<String>,
    part: usize,
    /// In its part's axes, m.
    centre: Vector2<f64>,
    /// m.
    radius: f64,
    /// Largest torque of each wheel, N m.
    torque_limit: f64,
    /// Joint torque of a unit of command: the number of wheels and their
    /// sign; 0 where the joint is locked.
    gain: f64,
    /// Torque–speed line of each wheel's motor.
    motor: Option<Motor>,
}

/// The planar image of a mirrored rover, with `NV` coordinates: 3 of the
/// base, one for each pair of joints.
#[derive(Clone, Debug)]
pub struct MirroredRover<const NV: usize> {
    model: Model,
    parts: Vec<Part>,
    wheels: Vec<WheelPair>,
}

/// Origin and direction of its x axis of every part.
struct Placed<const NV: usize> {
    origin: [Vector2<f64>; NV],
    x_axis: [Vector2<f64>; NV],
}

impl<const NV: usize> Placed<NV> {
    fn point(&self, part: usize, p: &Vector2<f64>) -> Vector2<f64> {
        let x_axis = &self.x_axis[part];
        self.origin[part] + x_axis * p.x + left(x_axis) * p.y
    }
}

/// Rotation by a quarter turn to the left: the velocity at `r` for a unit rate.
fn left(r: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-r.y, r.x)
}

fn inertia_of(body: &Body) -> Matrix3<f64> {
    let I = Matrix3::from_diagonal(&body.principal_inertia);
    body.principal_axes.map_or(I, |P| P * I * P.transpose())
}

impl<const NV: usize> MirroredRover<NV> {
    /// The planar image of a model, all joints that do not turn about z locked at zero.
    ///
    /// # Errors
    /// A joint that a lock has turned out of the plane, a body without its
    /// mirror image, another number of coordinates.
    pub fn new(model: &Model) -> Result<Self, PlanarError> {
        let across: Vec<(String, f64)> = model.bodies()[1..]
            .iter()
            .filter(|b| b.joint.axis().is_some_and(|axis| *axis != JointAxis::Z))
            .map(|b| (b.name.clone(), 0.0))
            .collect();
        let model = model
            .with_locked_joints(&across)
            .map_err(|_| PlanarError::NotMirrored {
                body: model.bodies()[0].name.clone(),
            })?;
        let parts = pair_bodies(&model)?;
        if parts.len() + 2 != NV {
            return Err(PlanarError::CoordinateCount {
                expected: NV,
                count: parts.len() + 2,
            });
        }
        let wheels = pair_wheels(&model, &parts)?;
        Ok(Self {
            model,
            parts,
            wheels,
        })
    }

    /// The model with all joints locked that the plane does not have.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Names of the joints that share each coordinate from the fourth on.
    #[must_use]
    pub fn joints(&self) -> Vec<Vec<String>> {
        let name = |&b: &usize| self.model.bodies()[b].name.clone();
        let names = |part: &Part| part.bodies.iter().map(name).collect();
        self.parts[1..].iter().map(names).collect()
    }

    /// Names of the wheels of each disc.
    #[must_use]
    pub fn wheel_names(&self) -> Vec<Vec<String>> {
        self.wheels.iter().map(|w| w.names.clone()).collect()
    }

    /// Velocity indices of [`Self::model`] that follow planar coordinate
    /// `k`: the entries of P's column that are 1.
    #[must_use]
    pub fn full_indices(&self, k: usize) -> Vec<usize> {
        match k {
            0 | 1 => vec![k],
            2 => vec![5],
            _ => {
                let bodies = self.parts[k - 2].bodies.iter();
                bodies.map(|&b| self.model.bodies()[b].velocity).collect()
            }
        }
    }

    fn place(&self, q: &SVector<f64, NV>) -> Placed<NV> {
        let mut placed = Placed {
            origin: [Vector2::zeros(); NV],
            x_axis: [Vector2::x(); NV],
        };
        for (b, part) in self.parts.iter().enumerate() {
            if b == 0 {
                placed.origin[0] = Vector2::new(q[0], q[1]);
            } else {
                placed.origin[b] = placed.point(part.parent, &part.joint);
            }
            let carrier = placed.x_axis[part.parent];
            placed.x_axis[b] = if part.is_spinner {
                carrier
            } else {
                let (s, c) = sin_cos(q[2 + b]);
                carrier * c + left(&carrier) * s
            };
        }
        placed
    }

    /// Calls `visit` with the part itself and all that carry it, up to the base.
    fn for_path(&self, part: usize, mut visit: impl FnMut(usize)) {
        let mut a = part;
        loop {
            visit(a);
            if a == 0 {
                return;
            }
            a = self.parts[a].parent;
        }
    }
}

/// Groups the bodies of a planar tree by mirror images.
fn pair_bodies(model: &Model) -> Result<Vec<Part>, PlanarError> {
    let bodies = model.bodies();
    // Nothing rotates out of the plane, so z adds up along the tree.
    let mut z = vec![0.0; bodies.len()];
    for (b, body) in bodies.iter().enumerate() {
        let is_in_plane = match (&body.joint, body.parent) {
            (Joint::Free(_), _) => b == 0,
            (Joint::Revolute(joint), Some(_)) => {
                let is_own = joint.coordinate.coupling.is_none();
                body.rotation.is_none() && joint.axis == JointAxis::Z && is_own
            }
            _ => false,
        };
        if !is_in_plane {
            return Err(PlanarError::NotMirrored {
                body: body.name.clone(),
            });
        }
        z[b] = body.parent.map_or(0.0, |parent| z[parent]) + body.position.z;
    }
    let is_plain = |joint: &&JointProperties| {
        joint.passive == Passive::default() && joint.limits.is_none() && joint.drive.is_none()
    };
    if let Some(joint) = model.joints().iter().find(|joint| !is_plain(joint)) {
        return Err(PlanarError::NotMirrored {
            body: bodies[joint.body].name.clone(),
        });
    }
    let size = bodies
        .iter()
        .map(|b| b.position.norm())
        .fold(1e-3, f64::max);
    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let are_alike = |a: usize, b: usize| {
        let (p, q) = (&bodies[a], &bodies[b]);
        let (I, J) = (inertia_of(p), mirror * inertia_of(q) * mirror);
        (p.mass - q.mass).abs() <= ALIKE * p.mass
            && (p.position.xy() - q.position.xy()).norm() <= ALIKE * size
            && (p.centre_of_mass.xy() - q.centre_of_mass.xy()).norm() <= ALIKE * size
            && (z[a] + p.centre_of_mass.z + z[b] + q.centre_of_mass.z).abs() <= ALIKE * size
            && (I - J).norm() <= ALIKE * I.norm()
    };
    let mut part_of: Vec<Option<usize>> = vec![None; bodies.len()];
    let mut parts: Vec<Part> = Vec::new();
    for (a, body) in bodies.iter().enumerate() {
        if part_of[a].is_some() {
            continue;
        }
        let part_of_parent = |b: usize| bodies[b].parent.and_then(|parent| part_of[parent]);
        let parent = part_of_parent(a).unwrap_or(0);
        let partner = (a..bodies.len()).find(|&b| {
            let has_same_parent = b == a || (a > 0 && part_of_parent(b) == Some(parent));
            has_same_parent && part_of[b].is_none() && are_alike(a, b)
        });
        let Some(partner) = partner else {
            return Err(PlanarError::NotMirrored {
                body: body.name.clone(),
            });
        };
        let group = if partner == a {
            vec![a]
        } else {
            vec![a, partner]
        };
        for &b in &group {
            part_of[b] = Some(parts.len());
        }
        parts.push(Part {
            parent,
            joint: body.position.xy(),
            mass: group.iter().map(|&b| bodies[b].mass).sum(),
            centre: body.centre_of_mass.xy(),
            inertia: group.iter().map(|&b| inertia_of(&bodies[b])[(2, 2)]).sum(),
            is_spinner: group.iter().all(|&b| bodies[b].is_spinner),
            bodies: group,
        });
    }
    Ok(parts)
}

/// Groups the wheels by the parts that carry them.
fn pair_wheels(model: &Model, parts: &[Part]) -> Result<Vec<WheelPair>, PlanarError> {
    let mut pairs: Vec<(WheelPair, f64)> = Vec::new();
    for wheel in model.wheels() {
        let refused = || PlanarError::NotMirrored {
            body: wheel.name.clone(),
        };
        let part = parts.iter().position(|p| p.bodies.contains(&wheel.body));
        let part = part.ok_or_else(refused)?;
        if wheel.axle.xy().norm() > ALIKE {
            return Err(refused());
        }
        let gain = wheel.joint.map_or(0.0, |_| wheel.drive_sign);
        let known = pairs.iter_mut().find(|(pair, _)| {
            pair.part == part
                && (pair.centre - wheel.centre.xy()).norm() <= ALIKE * (1.0 + pair.centre.norm())
        });
        if let Some((pair, sign)) = known {
            let differs = |a: f64, b: f64| (a - b).abs() > ALIKE * a.abs();
            if differs(pair.radius, wheel.radius)
                || differs(pair.torque_limit, wheel.torque_limit)
                || differs(*sign, gain)
                || pair.motor != wheel.motor
            {
                return Err(refused());
            }
            pair.gain += gain;
            pair.names.push(wheel.name.clone());
        } else {
            let pair = WheelPair {
                names: vec![wheel.name.clone()],
                part,
                centre: wheel.centre.xy(),
                radius: wheel.radius,
                torque_limit: wheel.torque_limit,
                gain,
                motor: wheel.motor,
            };
            pairs.push((pair, gain));
        }
    }
    for (pair, _) in &pairs {
        if pair.names.len() != parts[pair.part].bodies.len() {
            return Err(PlanarError::NotMirrored {
                body: pair.names[0].clone(),
            });
        }
    }
    Ok(pairs.into_iter().map(|(pair, _)| pair).collect())
}

impl<const NV: usize> PlanarMachine<NV> for MirroredRover<NV> {
    fn mass_matrix(&self, q: &SVector<f64, NV>) -> SMatrix<f64, NV, NV> {
        let placed = self.place(q);
        let mut M = SMatrix::<f64, NV, NV>::zeros();
        for (b, part) in self.parts.iter().enumerate() {
            let (m, c) = (part.mass, placed.point(b, &part.centre));
            M[(0, 0)] += m;
            M[(1, 1)] += m;
            self.for_path(b, |i| {
                let turn = left(&(c - placed.origin[i]));
                M[(0, 2 + i)] += m * turn.x;
                M[(1, 2 + i)] += m * turn.y;
                self.for_path(i, |j| {
                    let other = left(&(c - placed.origin[j]));
                    M[(2 + j, 2 + i)] += m * turn.dot(&other) + part.inertia;
                });
            });
        }
        M.fill_lower_triangle_with_upper_triangle();
        M
    }

    fn force(
        &self,
        q: &SVector<f64, NV>,
        v: &SVector<f64, NV>,
        gravity: &Vector2<f64>,
        torques: &[f64],
    ) -> SVector<f64, NV> {
        let placed = self.place(q);
        let mut omega = [0.0; NV];
        // Acceleration of each part's origin while no rate changes.
        let mut a = [Vector2::zeros(); NV];
        let mut F = SVector::<f64, NV>::zeros();
        for (b, part) in self.parts.iter().enumerate() {
            let p = part.parent;
            if b > 0 {
                a[b] = a[p] - (placed.origin[b] - placed.origin[p]) * (omega[p] * omega[p]);
            }
            omega[b] = v[2 + b] + if b > 0 { omega[p] } else { 0.0 };
            let c = placed.point(b, &part.centre);
            let centripetal = (c - placed.origin[b]) * (omega[b] * omega[b]);
            let f = (gravity - a[b] + centripetal) * part.mass;
            F[0] += f.x;
            F[1] += f.y;
            self.for_path(b, |i| F[2 + i] += left(&(c - placed.origin[i])).dot(&f));
        }
        for (wheel, torque) in self.wheels.iter().zip(torques) {
            F[2 + wheel.part] += wheel.gain * torque;
        }
        F
    }

    fn potential(&self, q: &SVector<f64, NV>, gravity: &Vector2<f64>) -> f64 {
        let placed = self.place(q);
        let of =
            |(b, part): (usize, &Part)| part.mass * gravity.dot(&placed.point(b, &part.centre));
        -self.parts.iter().enumerate().map(of).sum::<f64>()
    }

    fn n_inputs(&self) -> usize {
        self.wheels.len()
    }

    fn torque_limit(&self, i: usize) -> f64 {
        self.wheels[i].torque_limit
    }

    fn motor(&self, i: usize) -> Option<PlanarMotor> {
        let wheel = &self.wheels[i];
        let motor = wheel.motor.filter(|_| wheel.gain != 0.0)?;
        Some(PlanarMotor {
            motor,
            coordinate: 2 + wheel.part,
            gain: wheel.gain,
        })
    }

    fn turning(&self, v: &SVector<f64, NV>) -> f64 {
        let turns = self.parts.iter().enumerate().skip(1);
        let joints = turns.filter(|(_, part)| !part.is_spinner);
        v[2].abs() + joints.fold(0.0_f64, |most, (b, _)| most.max(v[2 + b].abs()))
    }

    fn n_discs(&self) -> usize {
        self.wheels.len()
    }

    fn disc(&self, i: usize, q: &SVector<f64, NV>) -> Disc {
        let wheel = &self.wheels[i];
        Disc {
            centre: self.place(q).point(wheel.part, &wheel.centre),
            radius: wheel.radius,
        }
    }

    fn point_jacobian(
        &self,
        i: usize,
        q: &SVector<f64, NV>,
        point: &Vector2<f64>,
    ) -> SMatrix<f64, 2, NV> {
        let placed = self.place(q);
        let mut J = SMatrix::<f64, 2, NV>::zeros();
        J[(0, 0)] = 1.0;
        J[(1, 1)] = 1.0;
        self.for_path(self.wheels[i].part, |a| {
            J.set_column(2 + a, &left(&(point - placed.origin[a])));
        });
        J
    }

    fn arms(&self) -> SVector<f64, NV> {
        let mut arms = SVector::<f64, NV>::zeros();
        arms[0] = 1.0;
        arms[1] = 1.0;
        for wheel in &self.wheels {
            let mut reach = wheel.centre.norm() + wheel.radius;
            let mut b = wheel.part;
            loop {
                arms[2 + b] = arms[2 + b].max(reach);
                if b == 0 {
                    break;
                }
                reach += self.parts[b].joint.norm();
                b = self.parts[b].parent;
            }
        }
        arms
    }

    fn fingerprint(&self) -> u64 {
        self.model.fingerprint()
    }
}
