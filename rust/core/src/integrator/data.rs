//! State and vectors of a step of [`Systems`].
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::balance::{Balance, Energies};
use super::dynamics::Dynamics;
use super::local::Local;
use super::options::StepOptions;
use super::report::{StepReport, StepStatus};
use super::systems::Systems;
use super::warm_start::WarmStart;
use crate::law::compliance::Yielding;
use crate::scalar::{Lane, LaneMask, MAX_LANES};

/// Rotation of a frame in a step, rad, above which the step is split.
pub(crate) const MOST_TURN: f64 = 0.5;

/// Why a lane's step was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// The machine turns too fast for one step.
    Turning,
    /// There are more contacts than slots or a problem hold, a joint may reach both of its stops,
    /// or the ground is unknown.
    Contact,
    /// The mass matrix has no factor.
    MassMatrix,
    /// The contact problem was not solved.
    Solver,
    /// The force of the sand is still another one after all repetitions.
    Sand,
    /// The energy audit asks for a safer step.
    Energy,
    /// The position projection was not solved, or moves too far.
    Projection,
    /// A loop stays open.
    Loop,
    /// Something is not finite.
    NotFinite,
}

impl Obstacle {
    /// Whether no step can be taken past it.
    fn is_fatal(self) -> bool {
        matches!(self, Self::MassMatrix | Self::NotFinite)
    }
}

/// The data of a step: of the state, over velocities (nv), over clusters, and by place of a
/// contact. Scalar T, configurations Q, components L and keys K of contacts.
#[derive(Clone, Debug)]
pub(crate) struct Data<T: Lane, Q, L, K> {
    pub token: T::Token,
    /// Options of the step; gravity and friction are each lane's own.
    pub options: StepOptions,
    /// Rotation of a frame in a step, rad, that is too fast for it.
    pub most_turn: f64,
    /// Lanes that hold a system; those that take part in the present step and still can.
    pub occupied: T::Mask,
    pub going: T::Mask,
    pub obstacles: [Option<Obstacle>; MAX_LANES],
    pub reports: [StepReport; MAX_LANES],
    /// Whether there is no other way to take the step: whatever it meets is reported.
    pub is_last: bool,
    /// Lanes whose step is taken again, and how often each lane's was.
    pub retaken: T::Mask,
    pub n_retaken: [usize; MAX_LANES],
    /// State before the step, and memory of the last one.
    pub start: Q,
    pub v: Vec<T>,
    pub time: T,
    pub memories: Vec<WarmStart<K>>,
    /// Impulses of each lane's present step.
    pub next_memories: Vec<WarmStart<K>>,
    /// Generalized impulse of contacts that persisted in the last step; by cluster, lanes of which
    /// it is known.
    pub persistent: Vec<T>,
    pub has_persistent: Vec<T::Mask>,
    /// Cluster of each velocity, and the axis along which it translates its tree. By cluster:
    /// whether it passes its momentum on to the world.
    pub cluster_of: Vec<usize>,
    pub axis_of: Vec<Option<usize>>,
    pub is_held: Vec<bool>,
    pub middle: Q,
    pub end: Q,
    pub v_end: Vec<T>,
    pub v_mean: Vec<T>,
    /// By cluster: lanes in which the contacts of its group are those of the last step, which
    /// persisted.
    pub persists: Vec<T::Mask>,
    /// By cluster: lanes in which the contacts of its group are those of the last step.
    pub is_same: Vec<T::Mask>,
    /// By cluster: lanes in which the gyroscopic terms of its group are implicit.
    pub is_gyroscopic: Vec<T::Mask>,
    /// By place: impulses of the step and of the projection, N s; velocities, m/s; impulses of the
    /// last step, N s; gaps that the projection removes, along the normal, m.
    pub p: Vec<L>,
    pub pushes: Vec<L>,
    pub u: Vec<L>,
    pub p_last: Vec<L>,
    pub gaps: Vec<L>,
    /// Laws of contacts that yield; empty where all are rigid.
    pub laws: Vec<Yielding<T>>,
    /// Lanes whose contact bounces although it yields.
    pub bounces: Vec<T::Mask>,
    /// Lanes whose contact is in impact, by place, and with an impact in its group, by cluster.
    pub impact: Vec<T::Mask>,
    pub has_impact: Vec<T::Mask>,
    /// An impulse, or its factor coordinates, or a change of the velocity.
    pub y: Vec<T>,
    /// Generalized impulse of the contacts; of the contacts and loops as far as it is foreseen; the
    /// free change of velocity with implicit gyroscopic terms, in factor coordinates.
    pub pushed: Vec<T>,
    pub foreseen: Vec<T>,
    pub y_implicit: Vec<T>,
    /// Energies of the clusters, and their balances: that of a group is its first cluster's.
    pub energies: Energies<T>,
    pub balances: Vec<Balance<T>>,
    /// Lanes whose energy at the start is not known yet.
    pub is_new: T::Mask,
    /// By cluster: lanes in which the position of its group must be projected, and its deepest gap,
    /// m.
    pub is_deep: Vec<T::Mask>,
    pub deepest: Vec<T>,
    /// Which share of the displacement each cluster makes; empty if all make the whole.
    pub shares: Vec<T>,
    /// Whether contacts are measured at the end itself.
    pub is_at_end: bool,
}

/// The data of a kind of systems.
pub(crate) type DataOf<S> = Data<
    <S as Systems>::T,
    <S as Systems>::Configuration,
    <S as Systems>::Local,
    <S as Systems>::Key,
>;

impl<T: Lane, Q: Clone, L: Local<T>, K: Clone> Data<T, Q, L, K> {
    /// Room for systems; `q` is any configuration.
    pub fn new(token: T::Token, q: &Q, machine: &impl Dynamics<T = T>) -> Self {
        let (nv, n_clusters) = (machine.nv(), machine.n_clusters());
        let cluster_of: Vec<usize> = (0..nv).map(|k| machine.cluster_of_velocity(k)).collect();
        // Only audited velocities are corrected.
        let n_axes = if machine.is_audited() { nv } else { 0 };
        let axis_of = (0..n_axes).map(|k| machine.translation_axis(k)).collect();
        let is_held = (0..n_clusters).map(|own| machine.is_held(own)).collect();
        Self::with(token, q, (cluster_of, axis_of), is_held)
    }

    /// Room for no system; `q` is any configuration.
    pub fn empty(token: T::Token, q: &Q) -> Self {
        Self::with(token, q, (Vec::new(), Vec::new()), Vec::new())
    }

    /// Room for systems with these clusters and axes of their velocities (nv); `is_held`: by
    /// cluster.
    fn with(
        token: T::Token,
        q: &Q,
        (cluster_of, axis_of): (Vec<usize>, Vec<Option<usize>>),
        is_held: Vec<bool>,
    ) -> Self {
        let n_clusters = is_held.len();
        let zero = T::splat(token, 0.0);
        let nobody = T::mask(token, 0);
        let vector = || vec![zero; cluster_of.len()];
        let masks = || vec![nobody; n_clusters];
        let memories = || (0..T::LANES).map(|_| WarmStart::default()).collect();
        Self {
            token,
            options: StepOptions::default(),
            most_turn: MOST_TURN,
            occupied: nobody,
            going: nobody,
            obstacles: [None; MAX_LANES],
            reports: [StepReport::default(); MAX_LANES],
            is_last: false,
            retaken: nobody,
            n_retaken: [0; MAX_LANES],
            start: q.clone(),
            v: vector(),
            time: zero,
            memories: memories(),
            next_memories: memories(),
            persistent: vector(),
            has_persistent: masks(),
            middle: q.clone(),
            end: q.clone(),
            v_end: vector(),
            v_mean: vector(),
            persists: masks(),
            is_same: masks(),
            is_gyroscopic: masks(),
            p: Vec::new(),
            pushes: Vec::new(),
            u: Vec::new(),
            p_last: Vec::new(),
            gaps: Vec::new(),
            laws: Vec::new(),
            bounces: Vec::new(),
            impact: Vec::new(),
            has_impact: masks(),
            y: vector(),
            pushed: vector(),
            foreseen: vector(),
            y_implicit: vector(),
            energies: Energies::new(token, n_clusters),
            balances: vec![Balance::new(token); n_clusters],
            is_new: nobody,
            is_deep: masks(),
            deepest: vec![zero; n_clusters],
            shares: Vec::new(),
            is_at_end: false,
            cluster_of,
            axis_of,
            is_held,
        }
    }

    /// Makes room for `n` places; `yields`: whether any contact yields.
    pub fn fit_places(&mut self, n: usize, yields: bool) {
        let n_laws = if yields { n } else { 0 };
        // A step that was taken elsewhere and is shown has its impulses alone.
        let is_room = self.p.len() == n && self.gaps.len() == n;
        if is_room && self.laws.len() == n_laws {
            return;
        }
        let zero = T::splat(self.token, 0.0);
        let nobody = T::mask(self.token, 0);
        for all in [
            &mut self.p,
            &mut self.pushes,
            &mut self.u,
            &mut self.p_last,
            &mut self.gaps,
        ] {
            all.resize(n, L::splat(zero));
        }
        self.impact.resize(n, nobody);
        self.bounces.resize(n_laws, nobody);
        self.laws.resize(n_laws, Yielding::none(zero));
    }

    /// h and θ.
    #[inline(always)]
    pub fn step(&self) -> (T, T) {
        (
            self.number(self.options.time_step),
            self.number(self.options.theta),
        )
    }

    /// The number `x` in all lanes.
    #[inline(always)]
    pub fn number(&self, x: f64) -> T {
        T::splat(self.token, x)
    }

    /// Takes lanes out of the present step, or reports that it is not converged if it is the last
    /// way to take it.
    #[inline(always)]
    pub fn fall_back(&mut self, obstacle: Obstacle, lanes: T::Mask) {
        let mut lost = (self.going & lanes).bits();
        if lost == 0 {
            return;
        }
        let stays = self.is_last && !obstacle.is_fatal();
        if !stays {
            self.going = self.going & !lanes;
        }
        while lost != 0 {
            let lane = lost.trailing_zeros() as usize;
            if stays {
                self.reports[lane].status = StepStatus::NotConverged;
            } else {
                self.obstacles[lane] = Some(obstacle);
            }
            lost &= lost - 1;
        }
    }

    /// Lanes in which any cluster is marked.
    #[inline(always)]
    pub fn any(&self, masks: &[T::Mask]) -> T::Mask {
        let nobody = T::mask(self.token, 0);
        masks.iter().fold(nobody, |all, own| all | *own)
    }

    /// Number of clusters.
    #[inline(always)]
    pub fn n_clusters(&self) -> usize {
        self.balances.len()
    }

    /// Whether any system of the step has implicit gyroscopic terms.
    #[inline(always)]
    pub fn is_any_implicit(&self) -> bool {
        (self.any(&self.is_gyroscopic) & self.going).any()
    }

    /// Whether any group of any system of the step has explicit gyroscopic terms.
    #[inline(always)]
    pub fn is_any_explicit(&self) -> bool {
        let explicit = self.is_gyroscopic.iter().map(|own| !*own & self.going);
        explicit.fold(false, |any, own| any | own.any()) || !self.is_any_implicit()
    }

    /// Lanes whose problems are solved: those of lanes that are retaken unless `is_first`.
    #[inline(always)]
    pub fn asked(&self, is_first: bool) -> T::Mask {
        if is_first {
            self.occupied
        } else {
            self.retaken
        }
    }

    /// Takes over what a lane's system remembers.
    pub fn load_memory(&mut self, lane: usize, memory: &WarmStart<K>) {
        let own = &mut self.memories[lane];
        own.impulses.clone_from(&memory.impulses);
        own.stored.clone_from(&memory.stored);
        let persistent = &memory.persistent;
        for (own, x) in self.persistent.iter_mut().zip(persistent) {
            own.set(lane, *x);
        }
        let own = T::mask(self.token, 1 << lane);
        let is_one = self.n_clusters() == 1;
        for (cluster, has) in self.has_persistent.iter_mut().enumerate() {
            *has = *has & !own;
            // Of several clusters, those that did not persist have zeros.
            let mut all = persistent.iter().zip(&self.cluster_of);
            if !persistent.is_empty() && (is_one || all.any(|(x, of)| *of == cluster && *x != 0.0))
            {
                *has = *has | own;
            }
        }
    }

    /// Gives a lane's system its memory back.
    pub fn store_memory(&self, lane: usize, memory: &mut WarmStart<K>) {
        let own = &self.memories[lane];
        memory.impulses.clone_from(&own.impulses);
        memory.stored.clone_from(&own.stored);
        memory.persistent.clear();
        if self.any(&self.has_persistent).get(lane) {
            let persistent = self.persistent.iter().zip(&self.cluster_of);
            let persistent = persistent.map(|(x, cluster)| {
                if self.has_persistent[*cluster].get(lane) {
                    x.get(lane)
                } else {
                    0.0
                }
            });
            memory.persistent.extend(persistent);
        }
    }
}

impl<T: Lane, Q: Clone, L: Local<T>, K: Clone> Data<T, Q, L, K> {
    /// The state with the memory.
    pub fn keep(&self) -> Kept<T, Q, K> {
        Kept {
            start: self.start.clone(),
            v: self.v.clone(),
            time: self.time,
            memories: self.memories.clone(),
            persistent: self.persistent.clone(),
            has_persistent: self.has_persistent.clone(),
            before: self.energies.before.clone(),
        }
    }

    /// Goes back to a state.
    pub fn restore(&mut self, kept: Kept<T, Q, K>) {
        self.start = kept.start;
        self.v = kept.v;
        self.time = kept.time;
        self.memories = kept.memories;
        self.persistent = kept.persistent;
        self.has_persistent = kept.has_persistent;
        self.energies.before = kept.before;
    }

    /// Multiplies every remembered impulse, as for a step of another length.
    pub fn scale_memory(&mut self, share: f64) {
        for memory in &mut self.memories {
            memory.scale(share);
        }
        let share = self.number(share);
        for x in &mut self.persistent {
            *x *= share;
        }
    }
}

/// A state of [`Data`], with its memory.
pub(crate) struct Kept<T: Lane, Q, K> {
    start: Q,
    v: Vec<T>,
    time: T,
    memories: Vec<WarmStart<K>>,
    persistent: Vec<T>,
    has_persistent: Vec<T::Mask>,
    before: Vec<[T; 2]>,
}
