//! Forward kinematics: attitude, origin and mass centre of every body, and the motion of every
//! joint velocity.
//!
//! World axes. Positions are relative to the trunk's origin, so that a rover far from the world's
//! origin loses no precision.

use super::inertias::{Inertia, Inertias};
use super::machine::{Axis, Coupled, Link, LinkJoint, Machine};
use super::place::Place;
use crate::scalar::elementary::sines_cosines;
use crate::scalar::{Lane, Mat3, Vec3};

/// Poses of all bodies.
#[derive(Clone, Debug)]
pub struct Poses<T: Lane> {
    token: T::Token,
    /// Origin of the trunk, world, m.
    pub origin: Vec3<T>,
    /// One entry a body.
    pub bodies: Vec<Pose<T>>,
    /// Motion of each joint velocity, indexed like [`crate::multibody::Model::motions`].
    pub motions: Vec<Motion<T>>,
    turns: Turns<T>,
}

/// Pose of a body.
#[derive(Clone, Copy, Debug)]
pub struct Pose<T> {
    /// `R_WB`; of a spinner, the attitude before its own rotation.
    pub R: Mat3<T>,
    /// Origin of its frame, m.
    pub r: Vec3<T>,
    /// Mass centre, m.
    pub c: Vec3<T>,
    /// From its carrier's origin to its own, m.
    pub lever: Vec3<T>,
}

/// The motion that a unit of a joint velocity imparts to everything the joint carries: a rotation,
/// a translation, or both.
#[derive(Clone, Copy, Debug)]
pub struct Motion<T> {
    /// Angular velocity: the unit axis of a revolute joint, zero of a prismatic one.
    pub axis: Vec3<T>,
    /// Velocity of the material point at the trunk's origin: `r × axis` of a revolute joint, the
    /// unit axis of a prismatic one.
    pub swing: Vec3<T>,
}

impl<T: Lane> Motion<T> {
    /// Velocity of the material point at `x`, relative to the trunk's origin.
    #[inline(always)]
    pub fn velocity_at(&self, x: Vec3<T>) -> Vec3<T> {
        self.axis.cross(x) + self.swing
    }

    /// Generalized force on its velocity of a force and its moment about the trunk's origin.
    #[inline(always)]
    pub fn power(&self, force: Vec3<T>, moment: Vec3<T>) -> T {
        self.axis.dot(moment) + self.swing.dot(force)
    }
}

impl<T: Lane> Poses<T> {
    /// Room for a machine.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        let zero = Vec3::splat(token, [0.0; 3]);
        let pose = Pose {
            R: Mat3 {
                x: zero,
                y: zero,
                z: zero,
            },
            r: zero,
            c: zero,
            lever: zero,
        };
        let motion = Motion {
            axis: zero,
            swing: zero,
        };
        Self {
            token,
            origin: zero,
            bodies: vec![pose; machine.n_bodies()],
            motions: vec![motion; machine.n_motions()],
            turns: Turns::new(token, machine),
        }
    }

    /// Recomputes all poses.
    ///
    /// # Panics
    /// If an argument is of another machine.
    pub fn update(&mut self, machine: &Machine, inertias: &Inertias<T>, place: &Place<T>) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.update_here(machine, inertias, place),
        );
    }

    #[inline(always)]
    fn update_here(&mut self, machine: &Machine, inertias: &Inertias<T>, place: &Place<T>) {
        let n = machine.links.len();
        let (links, inertias) = (&machine.links[..n], &inertias.bodies[..n]);
        let bodies = &mut self.bodies[..n];
        let motions = &mut self.motions[..machine.n_motions()];
        let mut turns = self.turns.of(machine, place);
        self.origin = place.position;
        let trunk = &mut bodies[0];
        trunk.R = rotation(&place.attitude);
        if !links[0].is_centred {
            trunk.c = trunk.R.times(inertias[0].centre);
        }
        for b in 1..n {
            let link = &links[b];
            if link.joint != LinkJoint::Turn {
                follow(link, b, inertias, place, &mut turns, (bodies, motions));
                continue;
            }
            let (before, own) = bodies.split_at_mut(b);
            let (carrier, own) = (&before[link.parent], &mut own[0]);
            let lever = link.lever(&carrier.R);
            let r = carrier.r + lever;
            let frame = link.frame(&carrier.R);
            let axis = link.axis.turned(&frame);
            own.R = if link.is_spinner {
                frame
            } else {
                link.axis.rotate(&frame, axis, turns.next())
            };
            own.c = if link.is_centred {
                r
            } else {
                r + own.R.times(inertias[b].centre)
            };
            (own.r, own.lever) = (r, lever);
            let swing = r.cross(axis);
            motions[link.motion] = Motion { axis, swing };
        }
    }
}

/// Places a body whose joint is not a plain rotation, and writes the motions of the joint.
#[inline(always)]
fn follow<T: Lane>(
    link: &Link,
    b: usize,
    inertias: &[Inertia<T>],
    place: &Place<T>,
    turns: &mut NextTurn<'_, T>,
    (bodies, motions): (&mut [Pose<T>], &mut [Motion<T>]),
) {
    let carrier = bodies[link.parent];
    let mut lever = link.lever(&carrier.R);
    let frame = link.frame(&carrier.R);
    let mut R = frame;
    let axis = link.axis.turned(&frame);
    let at = carrier.r + lever;
    match link.joint {
        LinkJoint::Slide(coordinate) => {
            lever += axis * link.coordinate(place.joints[coordinate]);
            motions[link.motion] = Motion {
                axis: Vec3::splat(at.x.token(), [0.0; 3]),
                swing: axis,
            };
        }
        LinkJoint::Turn | LinkJoint::CoupledTurn => {
            if !link.is_spinner {
                R = link.axis.rotate(&frame, axis, turns.next());
            }
            let swing = at.cross(axis);
            motions[link.motion] = Motion { axis, swing };
        }
        LinkJoint::Ball(ball) => {
            R = product(&frame, &rotation(&place.balls[ball]));
            for (motion, axis) in motions[link.motion..].iter_mut().zip(frame.columns()) {
                let swing = at.cross(axis);
                *motion = Motion { axis, swing };
            }
        }
        LinkJoint::Base => {}
    }
    if let Some(coupled) = &link.coupling {
        couple(motions, link.motion, coupled);
    }
    let r = carrier.r + lever;
    let c = if link.is_centred {
        r
    } else {
        r + R.times(inertias[b].centre)
    };
    bodies[b] = Pose { R, r, c, lever };
}

/// The motion of a coupled joint per unit of the velocity that it follows, and the combined motion
/// of what it carries.
#[inline(always)]
fn couple<T: Lane>(motions: &mut [Motion<T>], m: usize, coupled: &Coupled) {
    let own = &mut motions[m];
    let ratio = own.axis.x.like(coupled.ratio.ratio);
    (own.axis, own.swing) = (own.axis * ratio, own.swing * ratio);
    let own = *own;
    if let Some((before, combined)) = coupled.combined {
        let before = motions[before];
        motions[combined] = Motion {
            axis: before.axis + own.axis,
            swing: before.swing + own.swing,
        };
    }
}

impl Link {
    /// The frame of its joint, on a carrier with the attitude `R`.
    #[inline(always)]
    pub(super) fn frame<T: Lane>(&self, R: &Mat3<T>) -> Mat3<T> {
        match &self.rotation {
            None => *R,
            Some(fixed) => times_columns(R, fixed),
        }
    }

    /// The coordinate of its joint, where that of its own or the one that it follows is `q`.
    #[inline(always)]
    pub(super) fn coordinate<T: Lane>(&self, q: T) -> T {
        match &self.coupling {
            None => q,
            Some(coupled) => coupled.ratio.of(q),
        }
    }

    /// The rate of its joint, where that of its own or the one that it follows is `v`.
    #[inline(always)]
    pub(super) fn rate<T: Lane>(&self, v: T) -> T {
        match &self.coupling {
            None => v,
            Some(coupled) => v.like(coupled.ratio.ratio) * v,
        }
    }
}

/// Sines and cosines of the joints that a step turns.
#[derive(Clone, Debug)]
pub(super) struct Turns<T> {
    /// Angles, sines and cosines; those of a single rover fill up whole registers.
    numbers: [Vec<T>; 3],
}

/// The same, one after the other.
pub(super) struct NextTurn<'a, T> {
    sines: &'a [T],
    cosines: &'a [T],
    at: usize,
}

impl<T: Lane> Turns<T> {
    pub(super) fn new(token: T::Token, machine: &Machine) -> Self {
        let n = machine.angles.len();
        let n = if T::LANES == 1 {
            n.next_multiple_of(8)
        } else {
            n
        };
        let zeros = || vec![T::splat(token, 0.0); n];
        Self {
            numbers: [zeros(), zeros(), zeros()],
        }
    }

    #[inline(always)]
    pub(super) fn of(&mut self, machine: &Machine, place: &Place<T>) -> NextTurn<'_, T> {
        let turning = &machine.angles[..];
        let [angles, sines, cosines] = &mut self.numbers;
        let angles = &mut angles[..];
        for k in 0..turning.len() {
            angles[k] = place.joints[turning[k]];
        }
        for (k, ratio) in &machine.coupled_angles {
            angles[*k] = ratio.of(angles[*k]);
        }
        sines_cosines(angles, sines, cosines);
        NextTurn {
            sines,
            cosines,
            at: 0,
        }
    }
}

impl<T: Lane> NextTurn<'_, T> {
    #[inline(always)]
    pub(super) fn next(&mut self) -> (T, T) {
        let k = self.at;
        self.at += 1;
        (self.sines[k], self.cosines[k])
    }
}

/// Rotation matrix of a unit quaternion x, y, z, w.
#[inline(always)]
pub(super) fn rotation<T: Lane>(q: &[T; 4]) -> Mat3<T> {
    let [x, y, z, w] = *q;
    let (xx, yy, zz, ww) = (x * x, y * y, z * z, w * w);
    let two = x.like(2.0);
    let (xy, xz, yz) = (two * x * y, two * x * z, two * y * z);
    let (wx, wy, wz) = (two * w * x, two * w * y, two * w * z);
    Mat3 {
        x: Vec3::new(ww + xx - yy - zz, xy + wz, xz - wy),
        y: Vec3::new(xy - wz, ww - xx + yy - zz, yz + wx),
        z: Vec3::new(xz + wy, yz - wx, ww - xx - yy + zz),
    }
}

/// `R A` for a matrix that all lanes share, by its columns.
#[inline(always)]
pub(super) fn times_columns<T: Lane>(R: &Mat3<T>, A: &[[f64; 3]; 3]) -> Mat3<T> {
    Mat3 {
        x: R.times_shared(A[0]),
        y: R.times_shared(A[1]),
        z: R.times_shared(A[2]),
    }
}

/// `A B`.
#[inline(always)]
pub(super) fn product<T: Lane>(A: &Mat3<T>, B: &Mat3<T>) -> Mat3<T> {
    Mat3 {
        x: A.times(B.x),
        y: A.times(B.y),
        z: A.times(B.z),
    }
}

impl Axis {
    /// The axis in the frame that `R` maps to.
    #[inline(always)]
    pub(super) fn turned<T: Lane>(&self, R: &Mat3<T>) -> Vec3<T> {
        match self {
            Self::X => R.x,
            Self::Y => R.y,
            Self::Z => R.z,
            Self::General(u) => R.times_shared(*u),
        }
    }

    /// `R · Rot(axis, angle)` for the sine and cosine of the angle; `turned` is the axis in the
    /// frame that `R` maps to.
    #[inline(always)]
    pub(super) fn rotate<T: Lane>(&self, R: &Mat3<T>, turned: Vec3<T>, sin_cos: (T, T)) -> Mat3<T> {
        let (s, c) = sin_cos;
        let Mat3 { x, y, z } = *R;
        match self {
            Self::X => {
                let (y, z) = (y * c + z * s, z * c - y * s);
                Mat3 { x, y, z }
            }
            Self::Y => {
                let (z, x) = (z * c + x * s, x * c - z * s);
                Mat3 { x, y, z }
            }
            Self::Z => {
                let (x, y) = (x * c + y * s, y * c - x * s);
                Mat3 { x, y, z }
            }
            Self::General(u) => {
                // Rodrigues: e ↦ c e + s (u × e) + (1 − c) (u · e) u, with R (u × e) = R u × R e.
                let rest = c.like(1.0) - c;
                let column = |e: Vec3<T>, along: f64| {
                    e * c + turned.cross(e) * s + turned * (rest * c.like(along))
                };
                Mat3 {
                    x: column(x, u[0]),
                    y: column(y, u[1]),
                    z: column(z, u[2]),
                }
            }
        }
    }
}
