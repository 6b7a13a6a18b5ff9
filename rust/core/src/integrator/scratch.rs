//! The state that a step of one system advances, and its scratch.

use super::data::{Data, Obstacle};
use super::dynamics::Dynamics;
use super::listed::{List, Posed};
use super::local::Local;
use super::mechanical_system::{ConfigurationOf, KeyOf, MechanicalSystem, UnilateralContact};
use super::report::StepReport;
use super::warm_start::WarmStart;
use crate::scalar::Single;

/// The state that a step advances.
#[derive(Debug)]
pub struct StateMut<'a, Q> {
    /// Configuration.
    pub configuration: &'a mut Q,
    /// Velocity (nv).
    pub v: &'a mut [f64],
    /// s.
    pub time: &'a mut f64,
}

/// Scratch of a step of configurations `Q` and contacts `C`. Nothing in it is state: a fresh one
/// gives the same bits.
///
/// After a step it holds the step's contacts, impulses and local velocities, all measured at its
/// end. Of a step that was taken in parts it holds the sums of the impulses (`Whole`).
#[derive(Clone, Debug)]
pub struct StepScratch<Q, C: UnilateralContact> {
    pub(super) data: Data<f64, Q, C::Local, C::Key>,
    pub(super) list: List<C>,
    /// The friction-contact problem, and that of the position projection.
    pub(super) problems: Posed<C::Local>,
    pub(super) gaps: Posed<C::Local>,
    whole: Whole<C>,
    /// Whether the next step was tried as a whole, and its contact problem not solved.
    pub(super) is_unsolved: bool,
}

/// Scratch of a system's steps.
pub type ScratchOf<S> = StepScratch<ConfigurationOf<S>, <S as MechanicalSystem>::Contact>;

/// The contacts of all parts of a step that was taken in parts; empty otherwise.
#[derive(Clone, Debug)]
struct Whole<C: UnilateralContact> {
    contacts: Vec<C>,
    /// Sums over the parts, N s, each along the contact's frame in its part.
    p: Vec<C::Local>,
    /// After the last part with the contact, m/s.
    u: Vec<C::Local>,
}

impl<C: UnilateralContact + Clone> Whole<C> {
    const fn new() -> Self {
        Self {
            contacts: Vec::new(),
            p: Vec::new(),
            u: Vec::new(),
        }
    }

    fn clear(&mut self) {
        self.contacts.clear();
        self.p.clear();
        self.u.clear();
    }

    /// Adds a contact of a part.
    fn add(&mut self, contact: &C, p: C::Local, u: C::Local) {
        let known = self.contacts.iter().position(|c| c.key() == contact.key());
        if let Some(k) = known {
            self.contacts[k] = contact.clone();
            for i in 0..C::Local::N {
                self.p[k][i] += p[i];
            }
            self.u[k] = u;
        } else {
            self.contacts.push(contact.clone());
            self.p.push(p);
            self.u.push(u);
        }
    }
}

impl<Q: Clone, C: UnilateralContact + Clone> StepScratch<Q, C> {
    /// Room for n contacts; `q` is any configuration.
    #[must_use]
    pub fn new(q: &Q, n: usize) -> Self {
        let problems = Posed {
            q: Vec::with_capacity(n),
            p: Vec::with_capacity(n),
            u: Vec::with_capacity(n),
            report: StepReport::default(),
        };
        Self {
            data: Data::empty(Single::Baseline, q),
            list: List::with_capacity(n),
            gaps: problems.clone(),
            problems,
            whole: Whole::new(),
            is_unsolved: false,
        }
    }

    /// Notes why the next step was not taken with the usual effort.
    pub(crate) fn note(&mut self, obstacle: Obstacle) {
        self.is_unsolved = obstacle == Obstacle::Solver;
    }

    /// Takes over a state and its memory at the start of a step.
    pub(super) fn load<S>(
        &mut self,
        system: &S,
        state: &StateMut<'_, Q>,
        memory: &WarmStart<KeyOf<S>>,
    ) where
        S: MechanicalSystem<Contact = C>,
        S::Machine: Dynamics<Configuration = Q>,
        Q: PartialEq,
    {
        let n = system.machine().n_clusters();
        if self.is_fresh()
            || self.data.v.len() != system.machine().nv()
            || self.data.n_clusters() != n
        {
            self.data = Data::new(Single::Baseline, state.configuration, system.machine());
            self.data.is_new = true;
        }
        let d = &mut self.data;
        if d.v != *state.v || d.start != *state.configuration {
            d.is_new = true;
            d.start.clone_from(state.configuration);
            d.v.copy_from_slice(state.v);
        }
        d.time = *state.time;
        d.load_memory(0, memory);
        self.whole.clear();
        self.list.begin(n);
    }

    /// Whether no step was taken yet.
    fn is_fresh(&self) -> bool {
        !self.data.occupied
    }

    /// Gives the state and the memory back.
    pub(super) fn store(&self, state: &mut StateMut<'_, Q>, memory: &mut WarmStart<C::Key>) {
        state.configuration.clone_from(&self.data.start);
        state.v.copy_from_slice(&self.data.v);
        *state.time = self.data.time;
        self.data.store_memory(0, memory);
    }

    /// Adds the contacts of a part that was taken to those of the whole step.
    pub(super) fn add_part(&mut self) {
        let local = self.data.p.iter().zip(&self.data.u);
        for (contact, (p, u)) in self.list.contacts.iter().zip(local) {
            self.whole.add(contact, *p, *u);
        }
    }

    /// Makes a step that was taken elsewhere the last one: `list` hands its contacts with their
    /// impulses and local velocities to its argument. `q` and `mu`: free velocity and friction.
    pub(crate) fn show<'a>(
        &mut self,
        list: impl FnOnce(&mut dyn FnMut(C, C::Local, C::Local)),
        q: impl Iterator<Item = &'a f64>,
        mu: impl Iterator<Item = &'a f64>,
    ) {
        self.whole.clear();
        self.list.contacts.clear();
        let (p, u) = (&mut self.data.p, &mut self.data.u);
        p.clear();
        u.clear();
        list(&mut |contact, impulse, velocity| {
            self.list.contacts.push(contact);
            p.push(impulse);
            u.push(velocity);
        });
        self.problems.resize(p.len());
        self.problems.p.copy_from_slice(p);
        for (own, q) in Local::flat_mut(&mut self.problems.q).iter_mut().zip(q) {
            *own = *q;
        }
        self.list.mu.clear();
        self.list.mu.extend(mu);
    }

    /// Whether the last step was taken in parts, with contacts.
    fn is_split(&self) -> bool {
        !self.whole.contacts.is_empty()
    }

    /// Contacts of the last step, or of all its parts.
    #[must_use]
    pub fn contacts(&self) -> &[C] {
        if self.is_split() {
            &self.whole.contacts
        } else {
            &self.list.contacts
        }
    }

    /// Impulses of the last step (d n_c), N s, summed over its parts.
    #[must_use]
    pub fn impulses(&self) -> &[f64] {
        Local::flat(if self.is_split() {
            &self.whole.p
        } else {
            &self.data.p
        })
    }

    /// Local velocities after the last step, or after the last part with the contact (d n_c), m/s.
    #[must_use]
    pub fn velocities(&self) -> &[f64] {
        Local::flat(if self.is_split() {
            &self.whole.u
        } else {
            &self.data.u
        })
    }

    /// Free velocity of the last step's friction-contact problem, with restitution (d n_c), m/s. Of
    /// a step that was taken in parts, the problem is that of its last part.
    #[must_use]
    pub fn free_velocity(&self) -> &[f64] {
        Local::flat(&self.problems.q)
    }

    /// Impulses of the same problem (d n_c), N s.
    #[must_use]
    pub fn impulses_of_problem(&self) -> &[f64] {
        Local::flat(&self.problems.p)
    }

    /// Friction coefficients of the last step's contacts (n_c).
    #[must_use]
    pub fn friction_coefficients(&self) -> &[f64] {
        &self.list.mu
    }
}
