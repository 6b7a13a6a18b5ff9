//! Energy and linear momentum of a state in one sweep, without poses for any other use.

use super::inertias::{Inertia, Inertias};
use super::machine::{Link, Machine};
use super::place::Place;
use super::poses::{Turns, rotation, times_columns};
use crate::multibody::model::BASE;
use crate::scalar::{Lane, Mat3, Vec3};

/// Energy and linear momentum.
#[derive(Clone, Copy, Debug)]
pub struct Energy<T> {
    /// `½ vᵀ M v`, J.
    pub kinetic: T,
    /// `−Σ m g · x`, zero with all mass centres at the world's origin, J.
    pub potential: T,
    /// kg m/s, world.
    pub momentum: Vec3<T>,
}

impl<T: Lane> Energy<T> {
    /// J.
    pub(super) fn kinetic_and_potential(&self) -> [T; 2] {
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
    /// `g · r`, m²/s², with r the origin's position relative to the trunk's.
    fall: T,
}

/// Sums over the bodies so far.
struct Sums<T> {
    twice_kinetic: T,
    momentum: Vec3<T>,
    fall: T,
}

impl<T: Lane> EnergyScratch<T> {
    /// Room for a machine.
    #[must_use]
    pub fn new(token: T::Token, machine: &Machine) -> Self {
        let zero = Vec3::splat(token, [0.0; 3]);
        let moving = Moving {
            R: Mat3 {
                x: zero,
                y: zero,
                z: zero,
            },
            velocity: zero,
            omega: zero,
            fall: zero.x,
        };
        Self {
            token,
            bodies: vec![moving; machine.n_bodies()],
            turns: Turns::new(token, machine),
        }
    }
}

/// Energy and linear momentum of a state.
///
/// `v`: (nv). `gravity`: m/s², world.
///
/// # Panics
/// If an argument is of another machine.
pub fn energy<T: Lane>(
    machine: &Machine,
    inertias: &Inertias<T>,
    place: &Place<T>,
    v: &[T],
    gravity: Vec3<T>,
    scratch: &mut EnergyScratch<T>,
) -> Energy<T> {
    T::vectorize(
        scratch.token,
        #[inline(always)]
        || {
            let n = machine.links.len();
            let (links, own_inertias) = (&machine.links[..n], &inertias.bodies[..n]);
            let bodies = &mut scratch.bodies[..n];
            let (base, rates) = v.split_at(BASE);
            let rates = &rates[..n - 1];
            let mut turns = scratch.turns.of(machine, place);
            let zero = T::splat(scratch.token, 0.0);
            let mut sums = Sums {
                twice_kinetic: zero,
                momentum: Vec3::new(zero, zero, zero),
                fall: gravity.dot(place.position) * inertias.mass,
            };
            bodies[0] = Moving {
                R: rotation(&place.attitude),
                velocity: Vec3::new(base[0], base[1], base[2]),
                omega: Vec3::new(base[3], base[4], base[5]),
                fall: zero,
            };
            let Moving {
                R,
                velocity,
                omega,
                fall,
            } = &bodies[0];
            sums.add(
                &links[0],
                &own_inertias[0],
                (R, *velocity, *omega, *fall),
                gravity,
            );
            for b in 1..n {
                let (before, own) = bodies.split_at_mut(b);
                let link = &links[b];
                let carrier = &before[link.parent];
                let lever = link.lever(&carrier.R);
                let velocity = carrier.velocity + carrier.omega.cross(lever);
                let fall = carrier.fall + gravity.dot(lever);
                let frame = match &link.rotation {
                    None => carrier.R,
                    Some(fixed) => times_columns(&carrier.R, fixed),
                };
                let axis = link.axis.turned(&frame);
                let omega = carrier.omega + axis * rates[b - 1];
                let inertia = &own_inertias[b];
                if link.is_spinner {
                    sums.add(link, inertia, (&frame, velocity, omega, fall), gravity);
                    continue;
                }
                let R = link.axis.rotate(&frame, axis, turns.next());
                sums.add(link, inertia, (&R, velocity, omega, fall), gravity);
                own[0] = Moving {
                    R,
                    velocity,
                    omega,
                    fall,
                };
            }
            Energy {
                kinetic: sums.twice_kinetic * zero.like(0.5),
                potential: -sums.fall,
                momentum: sums.momentum,
            }
        },
    )
}

impl<T: Lane> Sums<T> {
    /// Adds a body with the entries of a [`Moving`].
    #[inline(always)]
    fn add(
        &mut self,
        link: &Link,
        inertia: &Inertia<T>,
        (R, mut velocity, omega, mut fall): (&Mat3<T>, Vec3<T>, Vec3<T>, T),
        gravity: Vec3<T>,
    ) {
        if !link.is_centred {
            let lever = R.times(inertia.centre);
            velocity += omega.cross(lever);
            fall += gravity.dot(lever);
        }
        let (a, b) = inertia.axes(link.symmetry, R);
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
