//! The contacts of the systems that a step advances, one in each lane of a scalar.
//!
//! A system with one lane has the scalar `f64`. Vectors run over the velocities (nv) or over the
//! places of contacts, see [`Grouped`]. A scheme calls in the order of [`super::scheme`]; between
//! `half_solve` and `half_solve_back` a vector is in the factor coordinates of
//! [`super::mechanical_system`]. `lanes` restrict what a call changes.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::forces::Forces;
use super::grouped::Grouped;
use super::local::Local;
use super::options::StepOptions;
use super::report::StepReport;
use super::warm_start::WarmStart;
use crate::law::compliance::{Compliance, Yielding};
use crate::scalar::{Lane, Vec3};

/// The mask of a kind of systems.
pub(crate) type MaskOf<S> = <<S as Systems>::T as Lane>::Mask;

/// The token of the scalar of a kind of systems.
pub(crate) type TokenOf<S> = <<S as Systems>::T as Lane>::Token;

/// What the lanes remember of their contacts.
pub(crate) type MemoryOf<S> = WarmStart<<S as Systems>::Key>;

/// Systems in the lanes of a scalar, with their matrices, without their state.
pub(crate) trait Systems {
    /// The scalar.
    type T: Lane;
    /// Configurations of all lanes.
    type Configuration: Clone;
    /// What moves in the lanes.
    type Machine: Forces<T = Self::T, Configuration = Self::Configuration>;
    /// Components of a contact.
    type Local: Local<Self::T>;
    /// What a contact is known by in the next step.
    type Key: Copy + Ord;
    /// The contacts of a step.
    type Contacts: Grouped<Self::T>;
    /// Friction-contact problems, as they are posed and answered.
    type Problems: ?Sized;

    /// Whether a step that is taken again may have other contacts. By default it has the same.
    const RELISTS: bool = false;

    /// Runs `f` with the instructions of the token where that pays.
    #[inline(always)]
    fn run<R>(_token: TokenOf<Self>, f: impl FnOnce() -> R) -> R {
        f()
    }

    /// What moves.
    fn machine(&self) -> &Self::Machine;

    /// What moves.
    fn machine_mut(&mut self) -> &mut Self::Machine;

    /// m/s².
    fn gravity(&self) -> Vec3<Self::T>;

    /// The contacts of the step.
    fn contacts(&self) -> &Self::Contacts;

    /// Number of places that contacts may have.
    fn n_places(&self) -> usize;

    /// Finds the contacts of the step and their laws; `q`: at its middle and at its predicted end.
    /// Returns the lanes that cannot have them.
    fn detect(
        &mut self,
        options: &StepOptions,
        q: (&Self::Configuration, &Self::Configuration),
        v: &[Self::T],
        going: MaskOf<Self>,
    ) -> MaskOf<Self>;

    /// Lets a lane's problems start from what it remembers of its contacts. Marks in `is_same` each
    /// cluster whose group had exactly these contacts in the last step.
    fn recall(
        &mut self,
        lane: usize,
        memory: &MemoryOf<Self>,
        problems: &mut Self::Problems,
        is_same: &mut [MaskOf<Self>],
    );

    /// The impulses from which the problems start, by place.
    fn read_start(&self, problems: &Self::Problems, p: &mut [Self::Local]);

    /// Builds the contacts' rows, their operator, and [`Self::u_before`].
    fn assemble(&mut self, v: &[Self::T]);

    /// Local velocities before the step by place, m/s.
    fn u_before(&self) -> &[Self::Local];

    /// What a unit of a place's gap counts as where it is compared with lengths, m: of a stop the
    /// arm of its joint.
    fn lever(&self, place: usize) -> Option<Self::T>;

    /// Whether any contact yields.
    fn yields(&self) -> bool;

    /// Springs and damper at a place, and the lanes that have them.
    fn compliance(
        &self,
        place: usize,
        v: &[Self::T],
    ) -> (Option<Compliance<Self::T>>, MaskOf<Self>);

    /// Whether a lane's memory has a contact of a cluster.
    fn remembers(&self, lane: usize, memory: &MemoryOf<Self>, cluster: usize) -> bool;

    /// The cluster of the body that a place's contact is on in a lane.
    fn own_cluster(&self, place: usize, lane: usize) -> usize;

    /// Coefficient of restitution at a place.
    fn restitution(&self, options: &StepOptions, place: usize) -> Self::T;

    /// Adds what the contacts yield to the operator.
    fn soften(&mut self, laws: &[Yielding<Self::T>]);

    /// Makes the operator regular where nothing moves a contact. By default it is.
    fn close_held(&mut self) {}

    /// Lanes in which nothing moves a place's contact along its normal.
    fn immovable(&self, place: usize) -> MaskOf<Self>;

    /// `u = Zᵀ y + Hᵀ v`, m/s: local velocities after a change `y` of the velocity before the step.
    fn local(&self, y: &[Self::T], u: &mut [Self::Local]);

    /// `y += Z p` in some lanes.
    fn add_impulses(&self, lanes: MaskOf<Self>, p: &[Self::Local], y: &mut [Self::T]);

    /// `y +=` the effect of moments that contacts bear besides p. By default there are none.
    #[inline(always)]
    fn add_moments(&self, _y: &mut [Self::T]) {}

    /// `out = H p` in some lanes, 0 in the others.
    fn generalized_impulse(&self, lanes: MaskOf<Self>, p: &[Self::Local], out: &mut [Self::T]);

    /// Adds to normal velocities, times a sign, what turns `0 ≤ u_N ⊥ p_N ≥ 0` into the contacts'
    /// laws: restitution, and dry friction of joints. Contacts that yield are left out of the
    /// first; `laws` is empty if there are none.
    fn add_shifts(
        &self,
        options: &StepOptions,
        sign: f64,
        laws: &[Yielding<Self::T>],
        u: &mut [Self::Local],
    );

    /// Poses the problems of some lanes: free velocity by place, and the free change of the
    /// velocity in factor coordinates; `start`: impulses of the last step.
    fn pose(
        &mut self,
        options: &StepOptions,
        free: (&[Self::Local], &[Self::T]),
        start: &[Self::Local],
        is_same: &[MaskOf<Self>],
        lanes: MaskOf<Self>,
        problems: &mut Self::Problems,
    );

    /// Enters the answers in the lanes' reports and memories; returns the lanes whose problems are
    /// solved.
    fn take_answers(
        &mut self,
        options: &StepOptions,
        going: MaskOf<Self>,
        problems: &mut Self::Problems,
        reports: &mut [StepReport],
        memories: &mut [MemoryOf<Self>],
    ) -> MaskOf<Self>;

    /// Impulses, N s, and velocities, m/s, of the answers by place.
    fn read(&self, problems: &Self::Problems, p: &mut [Self::Local], u: &mut [Self::Local]);

    /// Place of a lane's contact in its memory.
    fn place_in_memory(&self, place: usize, lane: usize) -> usize;

    /// Sums of the squares of u_N of the closed contacts, and of q, of a group: its leader and
    /// lane.
    fn norms(
        &self,
        problems: &Self::Problems,
        group: (usize, usize),
        u: &[Self::Local],
    ) -> Option<[f64; 2]>;

    /// Turns the problems into those of the position projection in the lanes of each cluster's
    /// mask; `pushes` (by place) is overwritten.
    fn pose_gaps(
        &mut self,
        gaps: &[Self::Local],
        is_deep: &[MaskOf<Self>],
        pushes: &mut [Self::Local],
        problems: &mut Self::Problems,
    );

    /// Enters the answers to [`Self::pose_gaps`]; returns the lanes of which one is not solved.
    /// `farthest`: by leader, the largest displacement of a contact, m.
    fn take_displacements(
        &mut self,
        options: &StepOptions,
        going: MaskOf<Self>,
        problems: &mut Self::Problems,
        is_deep: &[MaskOf<Self>],
        reports: &mut [StepReport],
        farthest: &mut [Self::T],
    ) -> MaskOf<Self>;

    /// Impulses of the projection by place.
    fn read_pushes(&self, problems: &Self::Problems, pushes: &mut [Self::Local]);
}
