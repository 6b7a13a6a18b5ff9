//! Scratch of a step, common to all systems: vectors over velocities and over contacts.

use super::contacting::{Contacting, UnilateralContact};
use super::dynamics::{Dynamics, MechanicalEnergy};
use super::excess::Balance;
use super::groups::{Group, Groups};
use super::island::{Island, left_of};
use super::mechanical_system::MechanicalSystem;
use super::work::Work;
use crate::law::compliance::Yielding;
use crate::problem::Redundancy;
use crate::solver::{SolverOptions, SolverWorkspace};

/// Scratch of a step of configurations `Q` and contacts `C`. Nothing in it
/// is state: a fresh one gives the same bits.
///
/// After a step it holds the step's contacts, impulses and local velocities, all measured at its
/// end. Of a step that was taken in parts it holds the sums of the impulses (`Whole`).
#[derive(Clone, Debug)]
pub struct Scratch<Q, C> {
    pub(super) middle: Q,
    pub(super) end: Q,
    /// A generalized impulse (nv), N s and N m s, before its conversion into factor coordinates.
    pub(super) impulse: Vec<f64>,
    /// The change of the velocity in factor coordinates (nv), `y = F Δv`.
    pub(super) y: Vec<f64>,
    /// The change of the velocity itself (nv), m/s and rad/s, or a displacement, m and rad.
    pub(super) dv: Vec<f64>,
    /// The deferred correction r, an impulse (nv) that is half solved in place.
    pub(super) correction: Vec<f64>,
    /// Forecast of the contacts' generalized impulse (nv).
    pub(super) forecast: Vec<f64>,
    /// Velocity at the end of the step (nv), and the one at which forces are evaluated.
    pub(super) v: Vec<f64>,
    pub(super) v_mean: Vec<f64>,
    pub(super) contacts: Vec<C>,
    pub(super) q_free: Vec<f64>,
    pub(super) mu: Vec<f64>,
    /// Law of each contact along its normal; empty if all are rigid.
    pub(super) yielding: Vec<Yielding>,
    /// Contacts that would yield and bounce; empty where nothing yields.
    pub(super) bounces: Vec<bool>,
    /// Energy in contacts that yield before and after the step, as [`WarmStart::stored`].
    pub(super) elastic: [Vec<f64>; 2],
    pub(super) p: Vec<f64>,
    pub(super) p_last: Vec<f64>,
    pub(super) u: Vec<f64>,
    pub(super) u_before: Vec<f64>,
    pub(super) gap_end: Vec<f64>,
    /// Which contacts are in impact (n_c).
    pub(super) impact: Vec<bool>,
    /// The position projection's problem: gaps, m, or in its course the step's free velocity.
    pub(super) q_position: Vec<f64>,
    pub(super) p_position: Vec<f64>,
    pub(super) u_position: Vec<f64>,
    pub(super) solver: SolverWorkspace,
    pub(super) redundancy: Redundancy,
    /// Whether impulses that the motion leaves open stay as the solver finds them.
    pub(super) leaves_open: bool,
    pub(super) audited: Audited<Q>,
    /// Groups of touching clusters.
    pub(super) groups: Groups,
    /// Whether the gyroscopic terms of the step are implicit, for each cluster.
    pub(super) gyroscopic: Vec<bool>,
    /// Energies of the clusters before and after the step, the work of their own forces, and what
    /// their springs store before and after it, J.
    pub(super) before: Vec<MechanicalEnergy>,
    pub(super) after: Vec<MechanicalEnergy>,
    pub(super) work: Vec<Work>,
    pub(super) stored: [Vec<f64>; 2],
    /// Balances of the groups that the audit has judged.
    pub(super) judged: Vec<(usize, Balance)>,
    /// A configuration and a velocity (nv) of which other groups keep their part.
    pub(super) kept: Q,
    pub(super) v_kept: Vec<f64>,
    /// The contacts of one group, and their problem.
    pub(super) island: Island,
    /// Work of the step's solves so far, in the solver's unit.
    pub(super) work_spent: u64,
    pub(super) whole: Whole<C>,
}

/// The contacts of all parts of a step that was taken in parts; empty otherwise.
#[derive(Clone, Debug)]
pub(super) struct Whole<C> {
    contacts: Vec<C>,
    /// Sums over the parts (d n_c), N s, each along the contact's frame in its part.
    p: Vec<f64>,
    /// After the last part with the contact (d n_c), m/s.
    u: Vec<f64>,
}

impl<C> Whole<C> {
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
}

impl<C: UnilateralContact + Clone> Whole<C> {
    /// Adds a contact of a part.
    fn add(&mut self, contact: &C, p: &[f64], u: &[f64]) {
        let d = p.len();
        let known = self.contacts.iter().position(|c| c.key() == contact.key());
        if let Some(k) = known {
            self.contacts[k] = contact.clone();
            for (sum, p) in self.p[d * k..].iter_mut().zip(p) {
                *sum += p;
            }
            self.u[d * k..][..d].copy_from_slice(u);
        } else {
            self.contacts.push(contact.clone());
            self.p.extend_from_slice(p);
            self.u.extend_from_slice(u);
        }
    }
}

/// Scratch of a system's steps.
pub type ScratchOf<S> = Scratch<<S as Dynamics>::Configuration, <S as Contacting>::Contact>;

/// A state whose energy is known: the end of a step is the start of the next.
#[derive(Clone, Debug)]
pub(super) struct Audited<Q> {
    pub(super) configuration: Q,
    pub(super) v: Vec<f64>,
    /// Energy and momentum of each cluster; empty if they are not known.
    pub(super) energies: Vec<MechanicalEnergy>,
}

impl<Q> Audited<Q> {
    fn new(configuration: Q, nv: usize) -> Self {
        Self {
            configuration,
            v: vec![f64::NAN; nv],
            energies: Vec::new(),
        }
    }
}

impl<Q: Clone> Audited<Q> {
    /// Stores the energy of a state.
    pub(super) fn is(&mut self, configuration: &Q, v: &[f64], energies: &[MechanicalEnergy]) {
        self.configuration.clone_from(configuration);
        self.v.clear();
        self.v.extend_from_slice(v);
        self.energies.clear();
        self.energies.extend_from_slice(energies);
    }
}

impl<Q: Clone, C> Scratch<Q, C> {
    /// Keeps the configuration and the velocity at the end of the step, for
    /// [`Self::return_ends`].
    pub(super) fn keep_ends<S>(&mut self, system: &S)
    where
        S: MechanicalSystem<Configuration = Q, Contact = C>,
    {
        if system.n_clusters() > 1 {
            self.kept.clone_from(&self.end);
            self.v_kept.copy_from_slice(&self.v);
        }
    }

    /// Returns to some groups what was kept of them.
    pub(super) fn return_ends<S>(&mut self, system: &S, is_meant: impl Fn(usize, &Group) -> bool)
    where
        S: MechanicalSystem<Configuration = Q, Contact = C>,
    {
        if system.n_clusters() == 1 {
            return;
        }
        let groups = &self.groups;
        let is_meant = |cluster: usize| {
            let number = groups.of_cluster(cluster);
            is_meant(number, groups.group(number))
        };
        system.take_clusters(&self.kept, &is_meant, &mut self.end);
        for (k, (v, kept)) in self.v.iter_mut().zip(&self.v_kept).enumerate() {
            if is_meant(system.cluster_of_velocity(k)) {
                *v = *kept;
            }
        }
    }
}

impl<Q: Clone, C> Scratch<Q, C> {
    /// Room for nv velocities and n contacts of d components; `q` is any
    /// configuration of the right size.
    #[must_use]
    pub fn new(q: &Q, nv: usize, n: usize, d: usize) -> Self {
        let room = || Vec::with_capacity(d * n);
        Self {
            middle: q.clone(),
            end: q.clone(),
            impulse: vec![0.0; nv],
            y: vec![0.0; nv],
            dv: vec![0.0; nv],
            correction: vec![0.0; nv],
            forecast: vec![0.0; nv],
            v: vec![0.0; nv],
            v_mean: vec![0.0; nv],
            contacts: Vec::with_capacity(n),
            q_free: room(),
            mu: Vec::with_capacity(n),
            yielding: Vec::new(),
            bounces: Vec::new(),
            elastic: [Vec::new(), Vec::new()],
            p: room(),
            p_last: room(),
            u: room(),
            u_before: room(),
            gap_end: Vec::with_capacity(n),
            impact: Vec::with_capacity(n),
            q_position: room(),
            p_position: room(),
            u_position: room(),
            solver: SolverWorkspace::default(),
            redundancy: Redundancy::default(),
            leaves_open: false,
            audited: Audited::new(q.clone(), nv),
            groups: Groups::default(),
            gyroscopic: Vec::new(),
            before: Vec::new(),
            after: Vec::new(),
            work: Vec::new(),
            stored: [Vec::new(), Vec::new()],
            judged: Vec::new(),
            kept: q.clone(),
            v_kept: vec![0.0; nv],
            island: Island::default(),
            work_spent: 0,
            whole: Whole::new(),
        }
    }

    /// Begins a step: makes the velocities' vectors fit a system whose nv may have changed since
    /// the last one.
    /// `n`: clusters.
    pub(super) fn fit(&mut self, nv: usize, n: usize) {
        self.work_spent = 0;
        self.leaves_open = false; // a panic may have left it
        self.island.begin(n);
        self.work.resize(n, Work::default());
        for stored in &mut self.stored {
            stored.resize(n, 0.0);
        }
        self.whole.clear();
        for vector in [
            &mut self.impulse,
            &mut self.y,
            &mut self.dv,
            &mut self.correction,
            &mut self.forecast,
            &mut self.v,
            &mut self.v_mean,
            &mut self.v_kept,
        ] {
            vector.resize(nv, 0.0);
        }
    }

    /// `y = F⁻ᵀ impulse`: the impulse into factor coordinates. Destroys `impulse`.
    #[inline]
    pub(super) fn half_solve(&mut self, half_solve: impl FnOnce(&mut [f64])) {
        half_solve(&mut self.impulse);
        std::mem::swap(&mut self.impulse, &mut self.y);
    }

    /// `dv = F⁻¹ y`: factor coordinates into a velocity. Destroys `y`.
    #[inline]
    pub(super) fn half_solve_back(&mut self, half_solve_back: impl FnOnce(&mut [f64])) {
        half_solve_back(&mut self.y);
        std::mem::swap(&mut self.y, &mut self.dv);
    }

    /// Adds the contacts of a part that was taken to those of the whole step.
    pub(super) fn add_part(&mut self, d: usize)
    where
        C: UnilateralContact + Clone,
    {
        let local = self.p.chunks_exact(d).zip(self.u.chunks_exact(d));
        for (contact, (p, u)) in self.contacts.iter().zip(local) {
            self.whole.add(contact, p, u);
        }
    }

    /// The options of the step's next solve: all solves of a step share one budget.
    pub(super) fn solver_options(&self, options: &SolverOptions) -> SolverOptions {
        let whole = options.budget_of(self.contacts.len());
        SolverOptions {
            budget: Some(left_of(whole, self.work_spent)),
            ..*options
        }
    }

    /// Whether the step's solves have left some of its budget.
    pub(super) fn has_work_left(&self, options: &SolverOptions) -> bool {
        self.work_spent < options.budget_of(self.contacts.len())
    }

    /// Makes a step that was taken elsewhere the last one: `list` hands its contacts with their
    /// impulses and local velocities to its argument. `q` and `mu`: free velocity and friction.
    pub(crate) fn show<'a, const D: usize>(
        &mut self,
        list: impl FnOnce(&mut dyn FnMut(C, [f64; D], [f64; D])),
        q: impl Iterator<Item = &'a f64>,
        mu: impl Iterator<Item = &'a f64>,
    ) {
        self.whole.clear();
        self.contacts.clear();
        self.p.clear();
        self.u.clear();
        list(&mut |contact, p, u| {
            self.contacts.push(contact);
            self.p.extend_from_slice(&p);
            self.u.extend_from_slice(&u);
        });
        self.q_free.clear();
        self.q_free.extend(q);
        self.mu.clear();
        self.mu.extend(mu);
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
            &self.contacts
        }
    }

    /// Impulses of the last step (d n_c), N s, summed over its parts.
    #[must_use]
    pub fn impulses(&self) -> &[f64] {
        if self.is_split() {
            &self.whole.p
        } else {
            &self.p
        }
    }

    /// Local velocities after the last step, or after the last part with the contact (d n_c), m/s.
    #[must_use]
    pub fn velocities(&self) -> &[f64] {
        if self.is_split() {
            &self.whole.u
        } else {
            &self.u
        }
    }

    /// Free velocity of the last step's friction-contact problem, with restitution (d n_c), m/s. Of
    /// a step that was taken in parts, the problem is that of its last part.
    #[must_use]
    pub fn free_velocity(&self) -> &[f64] {
        &self.q_free
    }

    /// Impulses of the same problem (d n_c), N s.
    #[must_use]
    pub fn impulses_of_problem(&self) -> &[f64] {
        &self.p
    }

    /// Friction coefficients of the last step's contacts (n_c).
    #[must_use]
    pub fn friction_coefficients(&self) -> &[f64] {
        &self.mu
    }
}
