//! Scratch of a rover's step, sized once, and the contacts that a step reports.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::tree::TreeScratch;
use crate::contact::Contact;
use crate::integrator::Scratch;
use crate::multibody::{Configuration, Model};

/// A contact of the last step with what it did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActiveContact {
    /// Point, frame and gap where the step evaluated them.
    pub contact: Contact,
    /// The contact's point, world, m.
    pub position: Vector3<f64>,
    /// Impulse along n, t, b, N s.
    pub impulse: [f64; 3],
    /// Local velocity after the step along n, t, b, m/s.
    pub velocity: [f64; 3],
}

/// Scratch of a rover's step. Nothing in it is state: a fresh one gives the same bits.
#[derive(Clone, Debug)]
pub struct Workspace {
    /// The tree's own.
    pub tree: TreeScratch,
    /// What every system's step needs.
    pub step: Scratch<Configuration, Contact>,
}

impl Workspace {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let n = contact_capacity(model);
        Self {
            tree: TreeScratch::new(model, n),
            step: Scratch::new(&Configuration::zero(model), model.nv(), n, 3),
        }
    }

    /// Lists the contacts of the last step in `out`, cleared first.
    pub fn list_active(&self, out: &mut Vec<ActiveContact>) {
        out.clear();
        let local = self
            .step
            .impulses()
            .chunks_exact(3)
            .zip(self.step.velocities().chunks_exact(3));
        let active = |(contact, (p, u)): (&Contact, (&[f64], &[f64]))| ActiveContact {
            contact: *contact,
            position: self.tree.origin_of_contacts(contact.body) + contact.point,
            impulse: [p[0], p[1], p[2]],
            velocity: [u[0], u[1], u[2]],
        };
        out.extend(self.step.contacts().iter().zip(local).map(active));
    }

    /// Delassus operator (row-major), free velocity (with restitution) and friction of the last step's problem.
    #[must_use]
    pub fn last_problem(&self) -> (&[f64], &[f64], &[f64]) {
        (
            self.tree.operator(),
            self.step.free_velocity(),
            self.step.friction_coefficients(),
        )
    }
}

/// Most contacts on a plane: three rim points a wheel, four corners a box, one point a ball.
pub(crate) fn contact_capacity(model: &Model) -> usize {
    3 * model.wheels().len() + 4 * model.boxes().len() + model.spheres().len()
}
