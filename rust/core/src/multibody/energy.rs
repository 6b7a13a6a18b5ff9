//! Energy and linear momentum of a state in one sweep, without poses for any other use.

use super::inertias::{Inertia, Inertias};
use super::lane_configuration::LaneConfiguration;
use super::mechanism::{BASE, Link, LinkJoint, Mechanism};
use super::poses::{NextTurn, Turns};
use crate::scalar::quaternion::rotation;
use crate::scalar::{Lane, Mat3, Vec3};

/// Kinetic and potential energy, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy<T = f64> {
    /// `½ vᵀ M v`.
    pub kinetic: T,
    /// `−Σ m g · x`, zero with all mass centres at the world's origin.
    pub potential: T,
}

impl Energy {
    /// Sum of both.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential
    }
}

impl<T: Lane> Energy<T> {
    /// J.
    #[inline(always)]
    pub(crate) fn kinetic_and_potential(&self) -> [T; 2] {
        [self.kinetic, self.potential]
    }
}

/// Scratch of the energy.
#[derive(Clone, Debug)]
pub struct EnergyScratch<T: Lane> {
    token: T::Token,
    bodies: Vec<Moving<T>>,
    turns: Turns<T>,
}

/// Pose and velocity of a body's frame.
#[derive(Clone, Copy, Debug)]
struct Moving<T> {
    R: Mat3<T>,
    velocity: Vec3<T>,
    omega: Vec3<T>,
    /// `g · r`, m²/s², with r the origin's position relative to the tree's.
    fall: T,
}

/// Sums over the bodies so far.
struct Sums<T> {
    twice_kinetic: T,
    momentum: Vec3<T>,
    fall: T,
}

impl<T: Lane> EnergyScratch<T> {
    /// Room for a mechanism.
    #[must_use]
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        Self {
            token,
            bodies: vec![Moving::of_world(token); mechanism.n_bodies()],
            turns: Turns::new(token, mechanism),
        }
    }
}

/// Energy and linear momentum (kg m/s, world) of a state.
///
/// `v`: (nv). `gravity`: m/s², world.
///
/// # Panics
/// If an argument is of another mechanism.
pub fn energy<T: Lane>(
    mechanism: &Mechanism,
    inertias: &Inertias<T>,
    place: &LaneConfiguration<T>,
    v: &[T],
    gravity: Vec3<T>,
    scratch: &mut EnergyScratch<T>,
) -> (Energy<T>, Vec3<T>) {
    T::vectorize(
        scratch.token,
        #[inline(always)]
        || {
            let n = mechanism.links.len();
            let (links, own_inertias) = (&mechanism.links[..n], &inertias.bodies[..n]);
            let bodies = &mut scratch.bodies[..n];
            let world = Moving::of_world(scratch.token);
            let mut turns = scratch.turns.of(mechanism, place);
            let zero = T::splat(scratch.token, 0.0);
            let mut sums = Sums {
                twice_kinetic: zero,
                momentum: Vec3::new(zero, zero, zero),
                fall: zero,
            };
            for (tree, &mass) in mechanism.trees.iter().zip(&inertias.trees) {
                let (root, end) = (tree.bodies.start, tree.bodies.end.min(n)); // below n: no checks
                bodies[root] = if tree.is_free {
                    let (position, attitude) = place.pose(tree.pose);
                    sums.fall += gravity.dot(*position) * mass;
                    let v = &v[tree.velocities.start..][..BASE];
                    Moving {
                        R: rotation(attitude),
                        velocity: Vec3::new(v[0], v[1], v[2]),
                        omega: Vec3::new(v[3], v[4], v[5]),
                        fall: zero,
                    }
                } else {
                    world.carry_root(&links[root], (place, v, gravity), &mut turns)
                };
                sums.add(&links[root], &own_inertias[root], &bodies[root], gravity);
                for b in root + 1..end {
                    let (before, own) = bodies.split_at_mut(b);
                    let link = &links[b];
                    let carrier = &before[link.parent];
                    let lever = link.lever(&carrier.R);
                    let frame = link.frame(&carrier.R);
                    let body = if link.joint == LinkJoint::Turn {
                        let axis = link.axis.turned(&frame);
                        let R = if link.is_spinner {
                            frame
                        } else {
                            link.axis.rotate(&frame, axis, turns.next())
                        };
                        Moving {
                            R,
                            velocity: carrier.velocity + carrier.omega.cross(lever),
                            omega: carrier.omega + axis * v[link.velocity],
                            fall: carrier.fall + gravity.dot(lever),
                        }
                    } else {
                        carrier.carry(link, (&frame, lever), (place, v, gravity), &mut turns)
                    };
                    sums.add(link, &own_inertias[b], &body, gravity);
                    if !link.is_leaf {
                        own[0] = body;
                    }
                }
            }
            for (&joint, &inertia) in mechanism.rotors.iter().zip(&inertias.rotors) {
                let rate = v[mechanism.joints[joint].velocity];
                sums.twice_kinetic += inertia * (rate * rate);
            }
            let energy = Energy {
                kinetic: sums.twice_kinetic * zero.like(0.5),
                potential: -sums.fall,
            };
            (energy, sums.momentum)
        },
    )
}

impl<T: Lane> Moving<T> {
    /// The world's frame.
    fn of_world(token: T::Token) -> Self {
        let unit = |v| Vec3::splat(token, v);
        let nothing = unit([0.0; 3]);
        Self {
            R: Mat3 {
                x: unit([1.0, 0.0, 0.0]),
                y: unit([0.0, 1.0, 0.0]),
                z: unit([0.0, 0.0, 1.0]),
            },
            velocity: nothing,
            omega: nothing,
            fall: nothing.x,
        }
    }

    /// A root that a joint connects to the world.
    #[cold]
    fn carry_root(
        &self,
        link: &Link,
        state: (&LaneConfiguration<T>, &[T], Vec3<T>),
        turns: &mut NextTurn<'_, T>,
    ) -> Self {
        let (frame, lever) = (link.frame(&self.R), link.lever(&self.R));
        self.carry(link, (&frame, lever), state, turns)
    }

    /// A body that it carries by a joint that is not a plain rotation. `frame` and `lever`: the
    /// joint's frame, and the way to it.
    #[inline(always)]
    fn carry(
        &self,
        link: &Link,
        (frame, mut lever): (&Mat3<T>, Vec3<T>),
        (place, v, gravity): (&LaneConfiguration<T>, &[T], Vec3<T>),
        turns: &mut NextTurn<'_, T>,
    ) -> Self {
        let k = link.velocity;
        let mut own = Self { R: *frame, ..*self };
        let axis = link.axis.turned(frame);
        match link.joint {
            LinkJoint::Turn | LinkJoint::CoupledTurn => {
                own.omega += axis * link.rate(v[k]);
                if !link.is_spinner {
                    own.R = link.axis.rotate(frame, axis, turns.next());
                }
            }
            LinkJoint::Slide(coordinate) => {
                lever += axis * link.coordinate(place.joints[coordinate]);
                own.velocity += axis * link.rate(v[k]);
            }
            LinkJoint::Ball(ball) => {
                own.R = frame.product(&rotation(&place.balls[ball]));
                own.omega += frame.times(Vec3::new(v[k], v[k + 1], v[k + 2]));
            }
            LinkJoint::Base => {}
        }
        own.velocity += self.omega.cross(lever);
        own.fall += gravity.dot(lever);
        own
    }
}

impl<T: Lane> Sums<T> {
    /// Adds a body.
    #[inline(always)]
    fn add(&mut self, link: &Link, inertia: &Inertia<T>, body: &Moving<T>, gravity: Vec3<T>) {
        let Moving {
            R,
            mut velocity,
            omega,
            mut fall,
        } = *body;
        if !link.is_centred {
            let lever = R.times(inertia.centre);
            velocity += omega.cross(lever);
            fall += gravity.dot(lever);
        }
        let (a, b) = inertia.axes(link.symmetry, &R);
        let along = a.dot(omega);
        let mut turning = inertia.rest * omega.dot(omega) + inertia.first * (along * along);
        if let Some(b) = b {
            let along = b.dot(omega);
            turning += inertia.second * (along * along);
        }
        let momentum = velocity * inertia.mass;
        self.twice_kinetic += momentum.dot(velocity) + turning;
        self.momentum += momentum;
        self.fall += fall * inertia.mass;
    }
}
