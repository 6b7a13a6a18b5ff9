//! Energy and linear momentum of a state in one sweep, without poses for any other use.

use super::inertias::{Inertia, Inertias};
use super::joint::{Free, Joint, JointModel, JointPlacement, Motion, free};
use super::lane_configuration::LaneConfiguration;
use super::mechanism::{BASE, Link, Mechanism};
use super::poses::{JointAngles, NextAngle};
use crate::scalar::{Lane, Mat3, Vec3, inlined};

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
    angles: JointAngles<T>,
    /// Sums over the bodies of each cluster.
    sums: Vec<Sums<T>>,
    found: Vec<EnergyOfCluster<T>>,
}

/// Energy and linear momentum (kg m/s, world) of a cluster of trees.
#[derive(Clone, Copy, Debug)]
pub struct EnergyOfCluster<T> {
    /// J.
    pub energy: Energy<T>,
    /// kg m/s, world.
    pub momentum: Vec3<T>,
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
#[derive(Clone, Copy, Debug)]
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
            angles: JointAngles::new(token, mechanism),
            sums: vec![Sums::new(token); mechanism.n_clusters()],
            found: Vec::with_capacity(mechanism.n_clusters()),
        }
    }
}

impl<T: Lane> Sums<T> {
    #[inline(always)]
    fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            twice_kinetic: zero,
            momentum: Vec3::new(zero, zero, zero),
            fall: zero,
        }
    }

    #[inline(always)]
    fn energy(&self) -> EnergyOfCluster<T> {
        EnergyOfCluster {
            energy: Energy {
                kinetic: self.twice_kinetic * self.fall.like(0.5),
                potential: -self.fall,
            },
            momentum: self.momentum,
        }
    }
}

/// Energy and linear momentum (kg m/s, world) of a state.
///
/// # Panics
/// If an argument is of another mechanism.
pub fn energy<T: Lane>(
    mechanism: &Mechanism,
    inertias: &Inertias<T>,
    q: &LaneConfiguration<T>,
    v: &[T],
    gravity: Vec3<T>,
    scratch: &mut EnergyScratch<T>,
) -> (Energy<T>, Vec3<T>) {
    let of_clusters = energies(mechanism, inertias, q, v, gravity, scratch);
    let ([first], rest) = of_clusters.split_at(1) else {
        unreachable!("invariant: a mechanism has a cluster")
    };
    let (mut energy, mut momentum) = (first.energy, first.momentum);
    for own in rest {
        energy.kinetic += own.energy.kinetic;
        energy.potential += own.energy.potential;
        momentum += own.momentum;
    }
    (energy, momentum)
}

/// Energies and linear momenta of the clusters in a state.
///
/// `v`: (nv). `gravity`: m/s², world.
///
/// # Panics
/// If an argument is of another mechanism.
pub fn energies<'a, T: Lane>(
    mechanism: &Mechanism,
    inertias: &Inertias<T>,
    q: &LaneConfiguration<T>,
    v: &[T],
    gravity: Vec3<T>,
    scratch: &'a mut EnergyScratch<T>,
) -> &'a [EnergyOfCluster<T>] {
    let token = scratch.token;
    inlined!(T::vectorize, token, {
        let n = mechanism.links.len();
        let (links, own_inertias) = (&mechanism.links[..n], &inertias.bodies[..n]);
        let bodies = &mut scratch.bodies[..n];
        let world = Moving::of_world(scratch.token);
        let mut angles = scratch.angles.of(mechanism, q);
        let zero = T::splat(scratch.token, 0.0);
        scratch.sums.fill(Sums::new(scratch.token));
        for (tree, &mass) in mechanism.trees.iter().zip(&inertias.trees) {
            let (root, end) = (tree.bodies.start, tree.bodies.end.min(n)); // below n: no checks
            let mut sums = scratch.sums[tree.cluster];
            bodies[root] = if tree.is_free {
                let free = Free { pose: tree.pose };
                sums.fall += gravity.dot(*q.pose(tree.pose).0) * mass;
                let Motion { axis, swing } = free::velocity(&v[tree.velocities.start..][..BASE]);
                Moving {
                    R: free.place(&world.R, q, || None).R,
                    velocity: swing,
                    omega: axis,
                    fall: zero,
                }
            } else {
                world.carry_root(&links[root], (q, v, gravity), &mut angles)
            };
            sums.add(&links[root], &own_inertias[root], &bodies[root], gravity);
            for b in root + 1..end {
                let (before, own) = bodies.split_at_mut(b);
                let link = &links[b];
                let carrier = &before[link.parent];
                let state = (q, v, gravity);
                let body = if let Joint::Revolute(joint) = &link.joint {
                    carrier.carry(joint, link, state, &mut angles)
                } else {
                    carrier.carry(&link.joint, link, state, &mut angles)
                };
                sums.add(link, &own_inertias[b], &body, gravity);
                if !link.is_leaf {
                    own[0] = body;
                }
            }
            scratch.sums[tree.cluster] = sums;
        }
        for (&joint, &inertia) in mechanism.rotors.iter().zip(&inertias.rotors) {
            let own = &mechanism.joints[joint];
            let rate = v[own.velocity];
            scratch.sums[own.cluster].twice_kinetic += inertia * (rate * rate);
        }
        scratch.found.clear();
        scratch.found.extend(scratch.sums.iter().map(Sums::energy));
    });
    &scratch.found
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
        angles: &mut NextAngle<'_, T>,
    ) -> Self {
        self.carry(&link.joint, link, state, angles)
    }

    /// A body that it carries.
    #[inline(always)]
    fn carry<J: JointModel>(
        &self,
        joint: &J,
        link: &Link,
        (q, v, gravity): (&LaneConfiguration<T>, &[T], Vec3<T>),
        angles: &mut NextAngle<'_, T>,
    ) -> Self {
        let mut lever = link.lever(&self.R);
        let frame = link.frame(&self.R);
        let turn = || (!link.is_spinner).then(|| angles.next());
        let JointPlacement { R, shift } = joint.place(&frame, q, turn);
        if let Some(shift) = shift {
            lever += shift;
        }
        let mut own = Self {
            R,
            velocity: self.velocity + self.omega.cross(lever),
            omega: self.omega,
            fall: self.fall + gravity.dot(lever),
        };
        joint.screws(&frame, |k, screw| {
            let rate = screw.times(v[link.velocity + k]);
            if let Some(spin) = rate.turning {
                own.omega += spin;
            }
            if let Some(slide) = rate.sliding {
                own.velocity += slide;
            }
        });
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
