//! Masses, mass centres and moments of inertia of the bodies, lane by lane.

use super::mechanism::{Mechanism, Symmetry};
use crate::scalar::{Lane, Mat3, Vec3};

/// Inertias of all bodies.
#[derive(Clone, Debug)]
pub struct Inertias<T: Lane> {
    pub(super) bodies: Vec<Inertia<T>>,
    /// Inertias of the rotors, kg m² or kg, in the order of the joints that have one.
    pub(super) rotors: Vec<T>,
    /// Mass of each tree, kg.
    pub(super) trees: Vec<T>,
    /// Total mass, kg.
    pub mass: T,
}

/// Inertia of a body. With the unit vectors `a` and `b` of two principal axes it is
/// `rest 1 + first a aᵀ + second b bᵀ` about the mass centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inertia<T> {
    /// kg.
    pub mass: T,
    /// Mass centre in the body's frame, m.
    pub centre: Vec3<T>,
    /// Moments, kg m²; with [`Symmetry::AboutX`] and its like `second` is zero and not used.
    pub rest: T,
    pub first: T,
    pub second: T,
    /// The axes a and b in the body's frame, for [`Symmetry::Turned`].
    pub axes: [Vec3<T>; 2],
}

impl<T: Lane> Inertias<T> {
    /// Unit masses, until [`Self::set_lane`].
    #[must_use]
    pub fn new(token: T::Token, mechanism: &Mechanism) -> Self {
        let (zero, one) = (T::splat(token, 0.0), T::splat(token, 1.0));
        let inertia = Inertia {
            mass: one,
            centre: Vec3::splat(token, [0.0; 3]),
            rest: one,
            first: zero,
            second: zero,
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|axis| Vec3::splat(token, axis)),
        };
        Self {
            bodies: vec![inertia; mechanism.n_bodies()],
            rotors: vec![zero; mechanism.rotors.len()],
            trees: vec![one; mechanism.trees.len()],
            mass: one,
        }
    }

    /// Gives a lane the inertias of a machine with the same mechanism.
    pub fn set_lane(&mut self, lane: usize, other: &Inertias<f64>) {
        for (own, other) in self.bodies.iter_mut().zip(&other.bodies) {
            own.set_lane(lane, other);
        }
        for (own, other) in self.rotors.iter_mut().zip(&other.rotors) {
            own.set(lane, *other);
        }
        for (own, other) in self.trees.iter_mut().zip(&other.trees) {
            own.set(lane, *other);
        }
        self.mass.set(lane, other.mass);
    }
}

impl<T: Lane> Inertias<T> {
    /// Mass of a cluster, kg.
    #[inline(always)]
    pub(crate) fn mass_of(&self, mechanism: &Mechanism, cluster: usize) -> T {
        if mechanism.n_clusters() == 1 {
            return self.mass;
        }
        let own = mechanism.trees.iter().zip(&self.trees);
        let own = own.filter(|(tree, _)| tree.cluster == cluster);
        own.map(|(_, mass)| *mass)
            .reduce(|sum, mass| sum + mass)
            .unwrap_or(self.mass)
    }

    /// Multiplies mass and moments of a body.
    pub fn scale(&mut self, mechanism: &Mechanism, body: usize, factor: T) {
        let own = &mut self.bodies[body];
        let more = own.mass * (factor - factor.like(1.0));
        for x in [
            &mut own.mass,
            &mut own.rest,
            &mut own.first,
            &mut own.second,
        ] {
            *x *= factor;
        }
        self.trees[mechanism.links[body].tree] += more;
        self.mass += more;
    }
}

impl<T: Lane> Inertia<T> {
    fn set_lane(&mut self, lane: usize, other: &Inertia<f64>) {
        self.mass.set(lane, other.mass);
        self.centre.set(lane, other.centre.get(0));
        self.rest.set(lane, other.rest);
        self.first.set(lane, other.first);
        self.second.set(lane, other.second);
        for (own, axis) in self.axes.iter_mut().zip(&other.axes) {
            own.set(lane, axis.get(0));
        }
    }

    /// World axes `a` and, unless the body is symmetric, `b` of a body with the attitude `R`.
    #[inline(always)]
    pub(super) fn axes(&self, symmetry: Symmetry, R: &Mat3<T>) -> (Vec3<T>, Option<Vec3<T>>) {
        match symmetry {
            Symmetry::AboutX => (R.x, None),
            Symmetry::AboutY => (R.y, None),
            Symmetry::AboutZ => (R.z, None),
            Symmetry::None => (R.x, Some(R.y)),
            Symmetry::Turned => (R.times(self.axes[0]), Some(R.times(self.axes[1]))),
        }
    }
}
