//! Scratch of a step, sized once, and what one step hands to the next.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::contact::{Contact, ContactKey, ContactSystem};
use crate::multibody::bias::BiasScratch;
use crate::multibody::{
    Configuration, FactoredMassMatrix, Kinematics, MassMatrix, Model, Momentum,
};
use crate::solver::SolverWorkspace;

/// Impulses of the last step by contact: where the next solve starts. Part of what a snapshot holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WarmStart {
    /// (key, impulse along n, t, b in N s), in the order of detection.
    pub impulses: Vec<(ContactKey, [f64; 3])>,
    /// Generalized impulse of persistent contact in the last step (nv), N s and N m s; empty where a contact was new,
    /// left, or struck.
    pub persistent: Vec<f64>,
}

impl WarmStart {
    /// Room for what a model can touch a plane with.
    #[must_use]
    pub fn with_capacity(model: &Model) -> Self {
        Self {
            impulses: Vec::with_capacity(contact_capacity(model)),
            persistent: Vec::with_capacity(model.nv()),
        }
    }

    /// Fills `p` (3 n_c) with what is remembered of these contacts, zero for new ones.
    pub fn recall(&self, contacts: &[Contact], p: &mut [f64]) {
        for (i, (contact, out)) in contacts.iter().zip(p.chunks_exact_mut(3)).enumerate() {
            // Mostly the same contacts in the same order: look at the same place first.
            let same = self.impulses.get(i).filter(|(key, _)| *key == contact.key);
            let found = same.or_else(|| self.impulses.iter().find(|(key, _)| *key == contact.key));
            out.copy_from_slice(&found.map_or([0.0; 3], |(_, p)| *p));
        }
    }

    /// Whether the last step had exactly these contacts.
    #[must_use]
    pub fn is_of(&self, contacts: &[Contact]) -> bool {
        self.impulses.len() == contacts.len()
            && self
                .impulses
                .iter()
                .zip(contacts)
                .all(|((key, _), c)| *key == c.key)
    }

    /// Remembers the impulses `p` (3 n_c).
    pub fn remember(&mut self, contacts: &[Contact], p: &[f64]) {
        self.impulses.clear();
        self.impulses.extend(
            contacts
                .iter()
                .zip(p.chunks_exact(3))
                .map(|(c, p)| (c.key, [p[0], p[1], p[2]])),
        );
    }
}

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

/// Scratch of a step. Nothing in it is state: a fresh one gives the same bits.
#[derive(Clone, Debug)]
pub struct Workspace {
    pub(super) configuration: Configuration,
    pub(super) end: Configuration,
    pub(super) kinematics: Kinematics,
    pub(super) kinematics_end: Kinematics,
    pub(super) mass_matrix: MassMatrix,
    pub(super) factor: FactoredMassMatrix,
    pub(super) bias_scratch: BiasScratch,
    pub(super) momenta: Vec<Momentum>,
    pub(super) momenta_end: Vec<Momentum>,
    pub(super) sums: Vec<Momentum>,
    pub(super) c_start: Vec<Vector3<f64>>,
    pub(super) theta_held: Vec<f64>,
    pub(super) force: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) correction: Vec<f64>,
    pub(super) v: Vec<f64>,
    pub(super) v_mean: Vec<f64>,
    pub(super) contacts: Vec<Contact>,
    pub(super) system: ContactSystem,
    pub(super) q_free: Vec<f64>,
    pub(super) mu: Vec<f64>,
    pub(super) p: Vec<f64>,
    pub(super) p_last: Vec<f64>,
    pub(super) u: Vec<f64>,
    pub(super) u_before: Vec<f64>,
    pub(super) gap_end: Vec<f64>,
    pub(super) p_position: Vec<f64>,
    pub(super) u_position: Vec<f64>,
    pub(super) solver: SolverWorkspace,
    pub(super) active: Vec<ActiveContact>,
}

impl Workspace {
    /// Room for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let (nv, n) = (model.nv(), contact_capacity(model));
        let momenta = vec![Momentum::default(); model.bodies().len()];
        let room = || Vec::with_capacity(3 * n);
        Self {
            configuration: Configuration::zero(model),
            end: Configuration::zero(model),
            kinematics: Kinematics::new(model),
            kinematics_end: Kinematics::new(model),
            mass_matrix: MassMatrix::new(model),
            factor: FactoredMassMatrix::new(model),
            bias_scratch: BiasScratch::new(model),
            momenta: momenta.clone(),
            momenta_end: momenta.clone(),
            sums: momenta,
            c_start: vec![Vector3::zeros(); model.bodies().len()],
            theta_held: vec![0.0; model.n_joints()],
            force: vec![0.0; nv],
            y: vec![0.0; nv],
            correction: vec![0.0; nv],
            v: vec![0.0; nv],
            v_mean: vec![0.0; nv],
            contacts: Vec::with_capacity(n),
            system: ContactSystem::with_capacity(model, n),
            q_free: room(),
            mu: Vec::with_capacity(n),
            p: room(),
            p_last: room(),
            u: room(),
            u_before: room(),
            gap_end: Vec::with_capacity(n),
            p_position: room(),
            u_position: room(),
            solver: SolverWorkspace::default(),
            active: Vec::with_capacity(n),
        }
    }

    /// Contacts of the last step.
    #[must_use]
    pub fn active(&self) -> &[ActiveContact] {
        &self.active
    }

    /// Delassus operator (row-major), free velocity (with restitution) and friction of the last step's problem.
    #[must_use]
    pub fn last_problem(&self) -> (&[f64], &[f64], &[f64]) {
        (&self.system.W, &self.q_free, &self.mu)
    }
}

/// Most contacts on a plane: three rim points a wheel, four corners a box.
fn contact_capacity(model: &Model) -> usize {
    3 * model.wheels().len() + 4 * model.boxes().len()
}
