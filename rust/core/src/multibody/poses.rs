//! Forward kinematics: attitude, origin and mass centre of every body, and the motion of every
//! joint velocity.
//!
//! World axes. Positions in a tree are relative to its origin: that of its root if the root is
//! free, otherwise the world's. A rover far from the world's origin thus loses no precision.

use super::inertias::{Inertia, Inertias};
use super::joint::Coupling;
use super::lane_configuration::LaneConfiguration;
use super::mechanism::{Link, LinkJoint, Mechanism};
use crate::scalar::elementary::{sin_cos, sines_cosines};
use crate::scalar::quaternion::rotation;
use crate::scalar::{Lane, Mat3, Vec3};

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
    turns: Turns<T>,
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

/// The motion that a unit of a joint velocity imparts to everything the joint carries: a rotation,
/// a translation, or both.
#[derive(Clone, Copy, Debug)]
pub struct Motion<T> {
    /// Angular velocity: the unit axis of a revolute joint, zero of a prismatic one.
    pub axis: Vec3<T>,
    /// Velocity of the material point at the tree's origin: `r × axis` of a revolute joint, the
    /// unit axis of a prismatic one.
    pub swing: Vec3<T>,
}

impl<T: Lane> Motion<T> {
    /// Velocity of the material point at `x`, relative to the tree's origin.
    #[inline(always)]
    pub fn velocity_at(&self, x: Vec3<T>) -> Vec3<T> {
        self.axis.cross(x) + self.swing
    }

    /// Generalized force on its velocity of a force and its moment about the tree's origin.
    #[inline(always)]
    pub fn power(&self, force: Vec3<T>, moment: Vec3<T>) -> T {
        self.axis.dot(moment) + self.swing.dot(force)
    }
}

impl<T: Lane> Poses<T> {
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
            turns: Turns::new(token, mechanism),
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
        place: &LaneConfiguration<T>,
    ) {
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.update_here(mechanism, inertias, place),
        );
    }

    #[inline(always)]
    fn update_here(
        &mut self,
        mechanism: &Mechanism,
        inertias: &Inertias<T>,
        place: &LaneConfiguration<T>,
    ) {
        let n = mechanism.links.len();
        let (links, inertias) = (&mechanism.links[..n], &inertias.bodies[..n]);
        let bodies = &mut self.bodies[..n];
        let motions = &mut self.motions[..mechanism.n_motions()];
        let mut turns = self.turns.of(mechanism, place);
        self.origin = place.position;
        for (t, tree) in mechanism.trees.iter().enumerate() {
            let (root, end) = (tree.bodies.start, tree.bodies.end.min(n)); // below n: no checks
            if tree.is_free {
                let (position, attitude) = place.pose(tree.pose);
                if t > 0 {
                    self.other_origins[t - 1] = *position;
                }
                let trunk = &mut bodies[root];
                trunk.R = rotation(attitude);
                if !links[root].is_centred {
                    trunk.c = trunk.R.times(inertias[root].centre);
                }
            } else {
                let world = Pose::of_world(self.token);
                let (link, inertia) = (&links[root], &inertias[root]);
                bodies[root] = follow_world(link, inertia, &world, place, &mut turns, motions);
            }
            for b in root + 1..end {
                let link = &links[b];
                let (before, own) = bodies.split_at_mut(b);
                let (carrier, own) = (&before[link.parent], &mut own[0]);
                if link.joint != LinkJoint::Turn {
                    *own = follow(link, &inertias[b], carrier, place, &mut turns, motions);
                    continue;
                }
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

    /// Turns the spinners, whose own rotation changes only their appearance; after
    /// [`Self::update`].
    ///
    /// # Panics
    /// If an argument is of another mechanism.
    pub fn spin(&mut self, mechanism: &Mechanism, place: &LaneConfiguration<T>) {
        for (link, pose) in mechanism.links.iter().zip(&mut self.bodies) {
            if let Some(joint) = link.spin {
                let angle = link.coordinate(place.joints[joint]);
                let axis = link.axis.turned(&pose.R);
                pose.R = link.axis.rotate(&pose.R, axis, sin_cos(angle));
            }
        }
    }
}

impl<T: Lane> Pose<T> {
    /// That of the world's frame.
    fn of_world(token: T::Token) -> Self {
        let unit = |v| Vec3::splat(token, v);
        let nowhere = unit([0.0; 3]);
        Self {
            R: Mat3 {
                x: unit([1.0, 0.0, 0.0]),
                y: unit([0.0, 1.0, 0.0]),
                z: unit([0.0, 0.0, 1.0]),
            },
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
    place: &LaneConfiguration<T>,
    turns: &mut NextTurn<'_, T>,
    motions: &mut [Motion<T>],
) -> Pose<T> {
    follow(link, inertia, world, place, turns, motions)
}

/// Places a body whose joint is not a plain rotation, and writes the motions of the joint.
#[inline(always)]
fn follow<T: Lane>(
    link: &Link,
    inertia: &Inertia<T>,
    carrier: &Pose<T>,
    place: &LaneConfiguration<T>,
    turns: &mut NextTurn<'_, T>,
    motions: &mut [Motion<T>],
) -> Pose<T> {
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
            R = frame.product(&rotation(&place.balls[ball]));
            for (motion, axis) in motions[link.motion..].iter_mut().zip(frame.columns()) {
                let swing = at.cross(axis);
                *motion = Motion { axis, swing };
            }
        }
        LinkJoint::Base => {}
    }
    if let Some(coupling) = &link.coupling {
        couple(motions, link.motion, coupling);
    }
    let r = carrier.r + lever;
    let c = if link.is_centred {
        r
    } else {
        r + R.times(inertia.centre)
    };
    Pose { R, r, c, lever }
}

/// The motion of a coupled joint per unit of the velocity that it follows, and the combined motion
/// of what it carries.
#[inline(always)]
fn couple<T: Lane>(motions: &mut [Motion<T>], m: usize, coupling: &Coupling) {
    let own = &mut motions[m];
    let ratio = own.axis.x.like(coupling.ratio);
    (own.axis, own.swing) = (own.axis * ratio, own.swing * ratio);
    let own = *own;
    if let Some((before, combined)) = coupling.combined {
        let before = motions[before];
        motions[combined] = Motion {
            axis: before.axis + own.axis,
            swing: before.swing + own.swing,
        };
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
        place: &LaneConfiguration<T>,
    ) -> NextTurn<'_, T> {
        let turning = &mechanism.angles[..];
        let [angles, sines, cosines] = &mut self.numbers;
        let angles = &mut angles[..];
        for k in 0..turning.len() {
            angles[k] = place.joints[turning[k]];
        }
        for (k, coupling) in &mechanism.coupled_angles {
            angles[*k] = coupling.value(angles[*k]);
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
