//! Forward kinematics: attitude, origin and mass centre of every body, and the motion of every
//! joint velocity.
//!
//! World axes. Positions in a tree are relative to its origin: that of its root if the root is
//! free, otherwise the world's. A rover far from the world's origin thus loses no precision.

use super::inertias::{Inertia, Inertias};
use super::joint::{Free, Joint, JointModel, JointPlacement, Motion};
use super::lane_configuration::LaneConfiguration;
use super::mechanism::{Link, Mechanism};
use crate::scalar::elementary::{sin_cos, sines_cosines};
use crate::scalar::{Lane, Mat3, Vec3, inlined};

/// Poses of all bodies.
#[derive(Clone, Debug)]
pub struct Poses<T: Lane> {
    token: T::Token,
    /// Origin of the first tree, world, m.
    pub origin: Vec3<T>,
    /// Origins of the other trees, world, m.
    pub(super) other_origins: Vec<Vec3<T>>,
    /// One entry a body.
    pub bodies: Vec<Pose<T>>,
    /// Motion of each joint velocity, in the order of the bodies; see [`Mechanism::movers`].
    pub motions: Vec<Motion<T>>,
    angles: JointAngles<T>,
}

/// Pose of a body.
#[derive(Clone, Copy, Debug)]
pub struct Pose<T> {
    /// `R_WB`; of a spinner, the attitude before its own rotation, except after
    /// [`Poses::spin`].
    pub R: Mat3<T>,
    /// Origin of its frame, m.
    pub r: Vec3<T>,
    /// Mass centre, m.
    pub c: Vec3<T>,
    /// From its carrier's origin to its own, m.
    pub lever: Vec3<T>,
}

impl<T: Lane> Poses<T> {
    /// Speed at which a wheel's point of contact travels over its tread, R |ω·s|, m/s, and (s·n)²
    /// with the contact's normal n. `wheel`: its body, its unit axle s in the body's frame, its
    /// radius, m; `v`: each velocity.
    #[inline(always)]
    pub(crate) fn rolling(
        &self,
        mechanism: &Mechanism,
        (body, axle, radius): (usize, [f64; 3], f64),
        n: Vec3<T>,
        v: impl Fn(usize) -> T,
    ) -> [T; 2] {
        let s = self.bodies[body].R.times_shared(axle);
        let mut spin = match mechanism.base_of(body) {
            Some(first) => Vec3::new(v(first + 3), v(first + 4), v(first + 5)).dot(s),
            None => s.x.like(0.0),
        };
        for mover in mechanism.movers(body) {
            spin += self.motions[mover.motion].axis.dot(s) * v(mover.velocity);
        }
        let lean = s.dot(n);
        [spin.abs() * s.x.like(radius), lean * lean]
    }

    /// Room for a mechanism.
    #[must_use]
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let zero = Vec3::splat(token, [0.0; 3]);
        let motion = Motion {
            axis: zero,
            swing: zero,
        };
        Self {
            token,
            origin: zero,
            other_origins: vec![zero; mechanism.trees.len().saturating_sub(1)],
            bodies: vec![Pose::of_world(token); mechanism.n_bodies()],
            motions: vec![motion; mechanism.n_motions()],
            angles: JointAngles::new(token, mechanism),
        }
    }

    /// Recomputes all poses.
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    pub fn update(
        &mut self,
        mechanism: &Mechanism,
        inertias: &Inertias<T>,
        q: &LaneConfiguration<T>,
    ) {
        inlined!(
            T::vectorize,
            self.token,
            self.update_here(mechanism, inertias, q)
        );
    }

    #[inline(always)]
    fn update_here(
        &mut self,
        mechanism: &Mechanism,
        inertias: &Inertias<T>,
        q: &LaneConfiguration<T>,
    ) {
        let n = mechanism.links.len();
        let (links, inertias) = (&mechanism.links[..n], &inertias.bodies[..n]);
        let bodies = &mut self.bodies[..n];
        let motions = &mut self.motions[..mechanism.n_motions()];
        let mut angles = self.angles.of(mechanism, q);
        self.origin = q.position;
        for (t, tree) in mechanism.trees.iter().enumerate() {
            let (root, end) = (tree.bodies.start, tree.bodies.end.min(n)); // below n: no checks
            if tree.is_free {
                let free = Free { pose: tree.pose };
                if t > 0 {
                    self.other_origins[t - 1] = *q.pose(tree.pose).0;
                }
                let trunk = &mut bodies[root];
                trunk.R = free.place(&trunk.R, q, || None).R;
                if !links[root].is_centred {
                    trunk.c = trunk.R.times(inertias[root].centre);
                }
            } else {
                let world = Pose::of_world(self.token);
                let (link, inertia) = (&links[root], &inertias[root]);
                bodies[root] = follow_world(link, inertia, &world, q, &mut angles, motions);
            }
            for b in root + 1..end {
                let (link, inertia) = (&links[b], &inertias[b]);
                let (before, own) = bodies.split_at_mut(b);
                let carrier = &before[link.parent];
                // Nearly all joints are revolute: their code stands apart from the choice.
                own[0] = if let Joint::Revolute(joint) = &link.joint {
                    follow(joint, link, inertia, carrier, q, &mut angles, motions)
                } else {
                    follow(&link.joint, link, inertia, carrier, q, &mut angles, motions)
                };
            }
        }
    }

    /// World position of the origin of a tree, m.
    #[inline(always)]
    #[must_use]
    pub fn origin_of(&self, tree: usize) -> Vec3<T> {
        match tree.checked_sub(1) {
            None => self.origin,
            Some(other) => self.other_origins[other],
        }
    }

    /// Turns the spinners, whose own rotation changes only their appearance; after
    /// [`Self::update`].
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    pub fn spin(&mut self, mechanism: &Mechanism, q: &LaneConfiguration<T>) {
        for b in 0..self.bodies.len() {
            self.bodies[b].R = self.spun(mechanism, q, b);
        }
    }

    /// Attitude of a body with its own rotation, which [`Self::update`] leaves out of a spinner's.
    pub(crate) fn spun(
        &self,
        mechanism: &Mechanism,
        q: &LaneConfiguration<T>,
        b: usize,
    ) -> Mat3<T> {
        let (link, pose) = (&mechanism.links[b], &self.bodies[b]);
        match link.joint.angle().filter(|_| link.is_spinner) {
            Some((joint, coupling)) => {
                let number = q.joints[joint];
                let angle = coupling.map_or(number, |coupling| coupling.value(number));
                let turn = || Some(sin_cos(angle));
                link.joint.place(&pose.R, q, turn).R
            }
            None => pose.R,
        }
    }
}

impl<T: Lane> Pose<T> {
    /// Pose of the world's frame.
    fn of_world(token: T::Token) -> Self {
        let nowhere = Vec3::splat(token, [0.0; 3]);
        Self {
            R: Mat3::identity(token),
            r: nowhere,
            c: nowhere,
            lever: nowhere,
        }
    }
}

/// Places a root that a joint connects to the world.
#[cold]
fn follow_world<T: Lane>(
    link: &Link,
    inertia: &Inertia<T>,
    world: &Pose<T>,
    q: &LaneConfiguration<T>,
    angles: &mut NextAngle<'_, T>,
    motions: &mut [Motion<T>],
) -> Pose<T> {
    follow(&link.joint, link, inertia, world, q, angles, motions)
}

/// Places a body on its carrier and writes the motions of its joint.
#[inline(always)]
fn follow<T: Lane, J: JointModel>(
    joint: &J,
    link: &Link,
    inertia: &Inertia<T>,
    carrier: &Pose<T>,
    q: &LaneConfiguration<T>,
    angles: &mut NextAngle<'_, T>,
    motions: &mut [Motion<T>],
) -> Pose<T> {
    let mut lever = link.lever(&carrier.R);
    let frame = link.frame(&carrier.R);
    let turn = || (!link.is_spinner).then(|| angles.next());
    let JointPlacement { R, shift } = joint.place(&frame, q, turn);
    if let Some(shift) = shift {
        lever += shift;
    }
    let r = carrier.r + lever;
    joint.screws(&frame, |k, screw| {
        motions[link.motion + k] = screw.motion(r);
    });
    if let Some((before, combined)) = joint.combined() {
        let (before, own) = (motions[before], motions[link.motion]);
        motions[combined] = Motion {
            axis: before.axis + own.axis,
            swing: before.swing + own.swing,
        };
    }
    let c = if link.is_centred {
        r
    } else {
        r + R.times(inertia.centre)
    };
    Pose { R, r, c, lever }
}

/// Sines and cosines of the joints that a step turns.
#[derive(Clone, Debug)]
pub(super) struct JointAngles<T> {
    /// Angles, sines and cosines; those of a single rover fill up whole registers.
    numbers: [Vec<T>; 3],
}

/// Reader of the sines and cosines of [`JointAngles`], one joint after the other.
pub(super) struct NextAngle<'a, T> {
    sines: &'a [T],
    cosines: &'a [T],
    at: usize,
}

impl<T: Lane> JointAngles<T> {
    pub(super) fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let n = mechanism.angles.len();
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
    pub(super) fn of(
        &mut self,
        mechanism: &Mechanism,
        q: &LaneConfiguration<T>,
    ) -> NextAngle<'_, T> {
        let turning = &mechanism.angles[..];
        let [angles, sines, cosines] = &mut self.numbers;
        let angles = &mut angles[..];
        for k in 0..turning.len() {
            angles[k] = q.joints[turning[k]];
        }
        for (k, coupling) in &mechanism.coupled_angles {
            angles[*k] = coupling.value(angles[*k]);
        }
        sines_cosines(angles, sines, cosines);
        NextAngle {
            sines,
            cosines,
            at: 0,
        }
    }
}

impl<T: Lane> NextAngle<'_, T> {
    #[inline(always)]
    pub(super) fn next(&mut self) -> (T, T) {
        let k = self.at;
        self.at += 1;
        (self.sines[k], self.cosines[k])
    }
}
