//! Masses, mass centres and moments of inertia of the bodies, lane by lane.

use super::machine::{Link, Machine, Symmetry};
use crate::multibody::{Body, Model};
use crate::scalar::{Lane, Mat3, Vec3};

/// Inertias of all bodies.
#[derive(Clone, Debug)]
pub struct Inertias<T: Lane> {
    pub(super) bodies: Vec<Inertia<T>>,
    /// Inertias of the rotors, kg m² or kg, in the order of the machine's joints that have one.
    pub(super) rotors: Vec<T>,
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
    pub fn new(token: T::Token, machine: &Machine) -> Self {
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
            bodies: vec![inertia; machine.n_bodies()],
            rotors: vec![zero; machine.rotors.len()],
            mass: one,
        }
    }

    /// Gives a lane the inertias of a model that the machine [fits](Machine::fits).
    pub fn set_lane(&mut self, lane: usize, machine: &Machine, model: &Model) {
        let own = self.bodies.iter_mut().zip(&machine.links);
        for ((own, link), body) in own.zip(model.bodies()) {
            own.set_lane(lane, link, body);
        }
        for (own, &joint) in self.rotors.iter_mut().zip(&machine.rotors) {
            own.set(lane, model.joints()[joint].passive.armature);
        }
        self.mass.set(lane, model.mass());
    }
}

impl<T: Lane> Inertia<T> {
    fn set_lane(&mut self, lane: usize, link: &Link, body: &Body) {
        let I = &body.principal_inertia;
        let [rest, first, second] = match link.symmetry {
            Symmetry::AboutX => [I.y, I.x - I.y, 0.0],
            Symmetry::AboutY => [I.x, I.y - I.x, 0.0],
            Symmetry::AboutZ => [I.x, I.z - I.x, 0.0],
            Symmetry::None | Symmetry::Turned => [I.z, I.x - I.z, I.y - I.z],
        };
        self.mass.set(lane, body.mass);
        self.centre.set(lane, body.centre_of_mass.into());
        self.rest.set(lane, rest);
        self.first.set(lane, first);
        self.second.set(lane, second);
        if let Some(P) = &body.principal_axes {
            for (k, axis) in self.axes.iter_mut().enumerate() {
                axis.set(lane, P.column(k).into_owned().into());
            }
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
