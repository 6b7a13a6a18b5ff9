//! Bias `N(q, v) v + G(q)` by recursive Newton–Euler: the generalized force at zero acceleration.
//!
//! Moments are about each body's own origin. Gravity is an acceleration of the roots. What a body
//! without others on it needs is passed to its carrier at once, so only carriers are swept twice.
//!
//! Source: Luh, Walker and Paul 1980; here in world axes.

use super::inertias::{Inertia, Inertias};
use super::joint::{Joint, JointModel, Motion, Screw, free};
use super::mechanism::{BASE, Link, Mechanism};
use super::poses::{Pose, Poses};
use crate::scalar::{Lane, Vec3, inlined};

/// Scratch of the bias.
#[derive(Clone, Debug)]
pub struct BiasScratch<T: Lane> {
    token: T::Token,
    bodies: Vec<Moved<T>>,
}

/// A body at zero joint accelerations.
#[derive(Clone, Copy, Debug)]
struct Moved<T> {
    omega: Vec3<T>,
    alpha: Vec3<T>,
    /// Acceleration of its origin, relative to free fall, m/s².
    origin: Vec3<T>,
    /// Force (N) and moment about its origin (N m) on it and everything it carries.
    force: Vec3<T>,
    moment: Vec3<T>,
}

impl<T: Lane> BiasScratch<T> {
    /// Room for a mechanism.
    #[must_use]
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let at_rest = Moved::at_rest(Vec3::splat(token, [0.0; 3]));
        Self {
            token,
            bodies: vec![at_rest; mechanism.n_bodies()],
        }
    }
}

/// Bias `b` in `M v̇ + b = τ`: Coriolis, centrifugal, gyroscopic and gravity terms.
///
/// `v`, `out`: (nv), N along a velocity in m/s, N m about one in rad/s. `gravity`: m/s², world.
///
/// # Panics
/// If an argument is of another mechanism.
pub fn bias<T: Lane>(
    mechanism: &Mechanism,
    inertias: &Inertias<T>,
    poses: &Poses<T>,
    v: &[T],
    gravity: Vec3<T>,
    scratch: &mut BiasScratch<T>,
    out: &mut [T],
) {
    inlined!(T::vectorize, scratch.token, {
        let n = mechanism.links.len();
        let (links, inertias) = (&mechanism.links[..n], &inertias.bodies[..n]);
        let motions = &poses.motions[..mechanism.n_motions()];
        let (poses, moved) = (&poses.bodies[..n], &mut scratch.bodies[..n]);
        let world = Moved::at_rest(-gravity);
        for tree in &mechanism.trees {
            let (root, end) = (tree.bodies.start, tree.bodies.end.min(n)); // below n: no checks
            moved[root] = if tree.is_free {
                let v = &v[tree.velocities.start..][..BASE];
                Moved {
                    omega: free::velocity(v).axis,
                    ..world
                }
            } else {
                world.carry_root(&links[root], motions, poses[root].lever, v)
            };
            moved[root].load(&links[root], &inertias[root], &poses[root]);
            for b in root + 1..end {
                let (before, own) = moved.split_at_mut(b);
                let (link, pose) = (&links[b], &poses[b]);
                let carrier = &mut before[link.parent];
                let mut body = if let Joint::Revolute(joint) = &link.joint {
                    carrier.carry(joint, link, motions, pose.lever, v)
                } else {
                    carrier.carry(&link.joint, link, motions, pose.lever, v)
                };
                body.load(link, &inertias[b], pose);
                if link.is_plain_leaf {
                    body.share(link, motions, |k, x| out[k] = x);
                    body.rest_on(carrier, pose);
                } else {
                    own[0] = body;
                }
            }
            for b in (root + 1..end).rev() {
                let link = &links[b];
                if link.is_plain_leaf {
                    continue;
                }
                let (before, own) = moved.split_at_mut(b);
                own[0].rest_on(&mut before[link.parent], &poses[b]);
                if !link.is_coupled() {
                    own[0].share(link, motions, |k, x| out[k] = x);
                }
            }
            let Moved { force, moment, .. } = moved[root];
            if tree.is_free {
                let own = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
                out[tree.velocities.start..][..BASE].copy_from_slice(&own);
            } else {
                moved[root].share(&links[root], motions, |k, x| out[k] = x);
            }
        }
        // A coupled joint adds to the joint that it follows.
        for &b in &mechanism.coupled {
            moved[b].share(&links[b], motions, |k, x| out[k] += x);
        }
    });
}

impl<T: Lane> Moved<T> {
    /// A body that does not turn, without load.
    #[inline(always)]
    fn at_rest(origin: Vec3<T>) -> Self {
        let zero = Vec3::splat(origin.x.token(), [0.0; 3]);
        Self {
            omega: zero,
            alpha: zero,
            origin,
            force: zero,
            moment: zero,
        }
    }

    /// A body that it carries, `d` from its origin, without load.
    ///
    /// The axes of the joint are fixed in the carrier: a slide s adds the Coriolis acceleration
    /// `2 ω × s`.
    #[inline(always)]
    fn carry<J: JointModel>(
        &self,
        joint: &J,
        link: &Link,
        motions: &[Motion<T>],
        d: Vec3<T>,
        v: &[T],
    ) -> Self {
        let mut rate = Screw::NONE;
        for i in 0..joint.n_motions() {
            let screw = joint.screw(&motions[link.motion + i]);
            rate = rate.plus(screw.times(v[link.velocity + i]));
        }
        let omega = self.omega;
        let zero = Vec3::splat(d.x.token(), [0.0; 3]);
        let mut body = Self {
            omega,
            alpha: self.alpha,
            origin: self.origin + self.alpha.cross(d) + omega.cross(omega.cross(d)),
            force: zero,
            moment: zero,
        };
        if let Some(spin) = rate.turning {
            body.omega += spin;
            body.alpha += omega.cross(spin);
        }
        if let Some(slide) = rate.sliding {
            body.origin += omega.cross(slide) * d.x.like(2.0);
        }
        body
    }

    /// A root that a joint connects to the world, `d` from the world's origin, without load.
    #[cold]
    fn carry_root(&self, link: &Link, motions: &[Motion<T>], d: Vec3<T>, v: &[T]) -> Self {
        self.carry(&link.joint, link, motions, d, v)
    }

    /// Sets force and moment to those of the body alone.
    #[inline(always)]
    fn load(&mut self, link: &Link, inertia: &Inertia<T>, pose: &Pose<T>) {
        let Self { omega, alpha, .. } = *self;
        // A symmetric part of the inertia has no gyroscopic moment; the part k a aᵀ has
        // a k (a · α) + (ω × a) k (a · ω).
        let (a, b) = inertia.axes(link.symmetry, &pose.R);
        let mut moment = alpha * inertia.rest + turning(inertia.first, a, omega, alpha);
        if let Some(b) = b {
            moment += turning(inertia.second, b, omega, alpha);
        }
        let mut acceleration = self.origin;
        if link.is_centred {
            self.force = acceleration * inertia.mass;
        } else {
            let lever = pose.c - pose.r;
            acceleration += alpha.cross(lever) + omega.cross(omega.cross(lever));
            self.force = acceleration * inertia.mass;
            moment += lever.cross(self.force);
        }
        self.moment = moment;
    }

    /// Calls `set(k, x)` with the generalized force x of the load on each velocity of its joint.
    #[inline(always)]
    fn share(&self, link: &Link, motions: &[Motion<T>], set: impl FnMut(usize, T)) {
        if let Joint::Revolute(joint) = &link.joint {
            self.share_of(joint, link, motions, set);
        } else {
            self.share_of(&link.joint, link, motions, set);
        }
    }

    #[inline(always)]
    fn share_of<J: JointModel>(
        &self,
        joint: &J,
        link: &Link,
        motions: &[Motion<T>],
        mut set: impl FnMut(usize, T),
    ) {
        for i in 0..joint.n_motions() {
            let screw = joint.screw(&motions[link.motion + i]);
            set(link.velocity + i, screw.power(self.force, self.moment));
        }
    }

    /// Adds its force and moment to its carrier's.
    #[inline(always)]
    fn rest_on(&self, carrier: &mut Self, pose: &Pose<T>) {
        carrier.force += self.force;
        carrier.moment += self.moment + pose.lever.cross(self.force);
    }
}

/// Moment of the inertia `k a aᵀ` at the angular velocity ω and acceleration α.
#[inline(always)]
fn turning<T: Lane>(k: T, a: Vec3<T>, omega: Vec3<T>, alpha: Vec3<T>) -> Vec3<T> {
    a * (k * a.dot(alpha)) + omega.cross(a) * (k * a.dot(omega))
}
