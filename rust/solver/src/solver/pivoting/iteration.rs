//! The steps of pivoting on the contact modes of several problems side by side.
//!
//! From a warm start a step goes to the answer of the present [modes](Mode) as far as all
//! cones allow. The contact that blocks then slides or opens. After a full step the contact whose
//! velocity contradicts its mode most is corrected, with those that do so as much, unless the
//! residual falls fast: then the modes are right, and the next step removes the curvature of the
//! slides. With right modes two or three systems solve a step, as with Newton's method.
//!
//! Two modes may contradict each other at one contact: its friction pushes along its slip, and if
//! it sticks, it leaves the cone at once. Such a contact is barred, so that another one changes its
//! mode. If none is left, its slip has changed its sign, and its friction is reversed.

use super::limit::{limit, return_to_cone};
use super::mode_memory::ModeMemory;
use super::store::{Many, Store, Triple};
use super::system::System;
use super::violation::{LaneViolations, LawParameters, judge};
use crate::law::mode::{self, Mode};
use crate::problem::Residual;
use crate::scalar::{Lane, LaneMask, Single};
use crate::solver::draws::Draws;

/// Squared relative residual below which a rover without a slide counts as parked.
const PARKED: f64 = 1e-12;

/// Fraction of a step below which the impulse stays where it was.
const NO_MOVE: f64 = 1e-6;

/// Contacts that block at the same place, or contradict their modes as much, to this share, change
/// together: in a machine that is its own mirror image one of a pair must not go first.
pub(super) const ALIKE: f64 = 1.0 - 1e-6;

/// Change of the velocities, relative to those that the impulses cause, that removing null vectors
/// may cause.
const NULL_VELOCITY: f64 = 1e-13;

/// Change of the impulses at another application of `α (W + α)⁻¹`, relative to the largest, up to
/// which they are null vectors.
const NULL_CHANGE: f64 = 1e-5;

/// Most applications.
const MOST_NULL_STEPS: usize = 4;

/// Excess over a cone, relative to the largest impulse, that counts as rounding.
const AT_REST_IN_CONE: f64 = 1e-13;

/// Most reversals of friction.
const REVERSALS: f64 = 2.0;

/// Share of the squared residual that a correction leaves if another one follows.
const GAIN: f64 = 0.1;

/// Problems that are being solved, one a lane. Each method is given their systems.
#[derive(Clone, Debug)]
pub(crate) struct Pivoting<T: Lane, B: Store> {
    pub(crate) laws: B::Of<LawParameters<T>>,
    /// Mean diagonal of `W`, 1/kg.
    pub(crate) mean: T,
    /// Impulses and their velocities.
    pub(crate) p: B::Of<Triple<T>>,
    pub(crate) u: B::Of<Triple<T>>,
    /// Violations of the law by them.
    pub(super) sums: LaneViolations<T>,
    /// Lanes whose modes go in circles, or whose system has no factors.
    pub(crate) lost: T::Mask,
    /// Squares of `1/|q|` and `1/|(ρ_i q_i)|`.
    pub(crate) inverses: [T; 2],
    /// `α` that an attempt asks for, relative to the mean diagonal of `W`; 0 for that which suits
    /// the start.
    pub(crate) asked: T,
    /// Lanes whose operator is definite, which begin with the smallest `α`.
    pub(crate) definite: T::Mask,
    /// Impulses that a step stays near, where the system [returns](System::RETURNS) to them.
    pub(crate) centre: B::Of<Triple<T>>,
    pub(super) alpha: T,
    pub(super) first_alpha: T,
    pub(super) trial: B::Of<Triple<T>>,
    /// Velocities of the trial.
    pub(super) renewed: B::Of<Triple<T>>,
    pub(super) modes: B::Of<Mode<T>>,
    pub(super) closed: B::Of<T::Mask>,
    pub(super) sticks: B::Of<T::Mask>,
    pub(super) barred: B::Of<T::Mask>,
    /// The contacts that have just been let stick.
    pub(super) freed: B::Of<T::Mask>,
    /// Fraction of the step at which each contact blocks; how much it contradicts its mode.
    pub(super) fractions: B::Of<T>,
    pub(super) contradictions: B::Of<T>,
    /// Lanes whose last step was a full one.
    pub(super) full: T::Mask,
    /// Squared relative residual after the full step before the last.
    pub(super) last: T,
    pub(super) memory: ModeMemory<T>,
    pub(super) reversals: T,
    /// In an attempt at random, what chooses the contact that changes its mode. `α` stays then, and
    /// the modes may go in circles.
    pub(crate) draws: Option<Draws>,
}

impl<T: Lane> Pivoting<T, Many> {
    /// Makes room for `n` contacts.
    pub(crate) fn resize(&mut self, n: usize) {
        let zero = self.mean.like(0.0);
        let none = zero.lt(zero);
        self.laws.resize(n, LawParameters::new(zero));
        self.modes.resize(n, Mode::open(zero));
        for triples in [
            &mut self.p,
            &mut self.u,
            &mut self.centre,
            &mut self.trial,
            &mut self.renewed,
        ] {
            triples.resize(n, [zero; 3]);
        }
        for masks in [
            &mut self.closed,
            &mut self.sticks,
            &mut self.barred,
            &mut self.freed,
        ] {
            masks.resize(n, none);
        }
        self.fractions.resize(n, zero);
        self.contradictions.resize(n, zero);
    }
}

impl Default for Pivoting<f64, Many> {
    fn default() -> Self {
        Self::new(Single::Baseline)
    }
}

impl<T: Lane, B: Store> Pivoting<T, B> {
    #[inline(always)]
    pub(crate) fn new(token: T::Token) -> Self {
        let (zero, one) = (T::splat(token, 0.0), T::splat(token, 1.0));
        let none = T::mask(token, 0);
        Self {
            laws: B::filled(LawParameters::new(zero)),
            mean: one,
            p: B::filled([zero; 3]),
            u: B::filled([zero; 3]),
            sums: LaneViolations::none(zero),
            lost: none,
            inverses: [zero, one],
            asked: zero,
            definite: none,
            alpha: one,
            first_alpha: one,
            centre: B::filled([zero; 3]),
            trial: B::filled([zero; 3]),
            renewed: B::filled([zero; 3]),
            modes: B::filled(Mode::open(zero)),
            closed: B::filled(none),
            sticks: B::filled(none),
            barred: B::filled(none),
            freed: B::filled(none),
            fractions: B::filled(one),
            contradictions: B::filled(zero),
            full: none,
            last: zero,
            memory: ModeMemory::new(zero),
            reversals: zero,
            draws: None,
        }
    }

    /// Squares of the two numbers of the residual.
    #[inline(always)]
    pub(super) fn residual(&self) -> [T; 2] {
        let speed = self.sums.squares * self.inverses[0];
        let impulse = self.sums.weighted * self.inverses[1];
        [speed.max(impulse), self.sums.largest]
    }

    /// The residual of a lane.
    #[inline(always)]
    pub(crate) fn residual_of(&self, lane: usize) -> Residual {
        if !self.is_finite().get(lane) {
            return Residual::UNSOLVED;
        }
        let [relative, velocity] = self.residual().map(|square| square.get(lane).sqrt());
        Residual { relative, velocity }
    }

    /// The last `α` of a lane, 1/kg.
    #[inline(always)]
    pub(crate) fn alpha_of(&self, lane: usize) -> f64 {
        self.alpha.get(lane)
    }

    /// Takes from the impulses of the lanes of a mask, whose contacts stick or are open, their part
    /// in the null space of W, with the factors of the last step. Returns the lanes where that
    /// leaves the velocities as they are and the impulses within their cones; the others keep
    /// theirs.
    ///
    /// `α (W + α)⁻¹` leaves that part and shrinks all others by `α/(λ + α)`. It is applied until
    /// another time changes so little that what is left of them moves nothing.
    #[inline(always)]
    pub(crate) fn remove_null_part<S: System<T, B>>(
        &mut self,
        system: &mut S,
        lanes: T::Mask,
    ) -> T::Mask {
        let zero = self.mean.like(0.0);
        let mut size = zero;
        for i in system.places() {
            self.trial[i] = self.p[i];
            for p in &self.p[i] {
                size = p.abs().max(size);
            }
        }
        let share = zero.like(NULL_VELOCITY) * (self.mean / self.alpha);
        let tolerated = share.min(zero.like(NULL_CHANGE)) * size;
        let mut done = !lanes & lanes;
        for _ in 0..MOST_NULL_STEPS {
            for i in system.places() {
                self.renewed[i] = self.trial[i];
            }
            system.solve(&self.modes, &mut self.trial);
            let mut change = zero;
            for i in system.places() {
                for k in 0..3 {
                    let (scaled, last) = (self.alpha * self.trial[i][k], self.renewed[i][k]);
                    change = (scaled - last).abs().max(change);
                    // A lane that is done waits for the others as it is.
                    self.trial[i][k] = T::select(done, last, scaled);
                }
            }
            done = done | (change.le(tolerated) & lanes);
            if (lanes & !done).bits() == 0 {
                break;
            }
        }
        let nothing = zero.like(-AT_REST_IN_CONE) * size;
        for i in system.places() {
            let (p, mu) = (&self.p[i], self.laws[i].mu);
            let null = &self.trial[i];
            let own = [p[0] - null[0], p[1] - null[1], p[2] - null[2]];
            let norm = (own[1] * own[1] + own[2] * own[2]).sqrt();
            done = done & nothing.le(own[0]) & (nothing.le(mu * own[0] - norm));
            self.renewed[i] = own;
        }
        select::<T, B>(system.places(), done, &self.renewed, &mut self.p);
        done
    }

    /// Whether a lane's contact touches, and whether it sticks.
    #[inline(always)]
    pub(crate) fn mode_of(&self, place: usize, lane: usize) -> (bool, bool) {
        (self.closed[place].get(lane), self.sticks[place].get(lane))
    }

    /// Where squares of the residual are within tolerances.
    #[inline(always)]
    pub(crate) fn is_solved(&self, tolerances: [T; 2]) -> T::Mask {
        let [relative, largest] = self.residual();
        relative.le(tolerances[0]) & largest.le(tolerances[1])
    }

    /// Whether impulses and velocities are finite.
    #[inline(always)]
    pub(crate) fn is_finite(&self) -> T::Mask {
        self.sums.is_finite()
    }

    /// Where the last step was a full one that left more than a share of the squared residual.
    #[inline(always)]
    pub(crate) fn leaves(&self, share: f64) -> T::Mask {
        let [relative, _] = self.residual();
        self.full & relative.like(share).lt(relative / self.last)
    }

    /// Corrects modes and takes a step, in the lanes of a mask. Near the answer the factors serve
    /// again.
    #[inline(always)]
    pub(crate) fn advance<S: System<T, B>>(
        &mut self,
        system: &mut S,
        active: T::Mask,
        tolerances: [T; 2],
    ) {
        self.correct(system, active);
        self.step(system, active);
        let mut nearly = active & self.is_near(S::NEAR) & !self.is_solved(tolerances);
        for _ in 0..S::CORRECTIONS {
            if !nearly.any() {
                break;
            }
            let [before, _] = self.residual();
            self.refine(system, nearly);
            let [after, _] = self.residual();
            let gains = after.lt(before.like(GAIN) * before);
            nearly = nearly & gains & !self.is_solved(tolerances);
        }
    }

    /// Forgets mode and velocity of a place where a lane has no contact. When another lane begins
    /// to use the place they would count among this one's modes and violations.
    #[inline(always)]
    pub(crate) fn vacate(&mut self, place: usize, lane: usize) {
        for u in &mut self.u[place] {
            u.set(lane, 0.0);
        }
        let others = !T::mask(self.mean.token(), 1 << lane);
        for modes in [
            &mut self.closed,
            &mut self.sticks,
            &mut self.barred,
            &mut self.freed,
        ] {
            modes[place] = modes[place] & others;
        }
    }

    /// Begins the lanes of a mask: velocities, violations and modes of their impulses.
    #[inline(always)]
    pub(crate) fn begin<S: System<T, B>>(&mut self, system: &mut S, lanes: T::Mask) {
        let zero = self.mean.like(0.0);
        self.renew_velocities(system, lanes);
        self.judge(system.places());
        let mut slides = !lanes & lanes;
        for i in system.places() {
            let (p, mu) = (&self.p[i], self.laws[i].mu);
            let size = (p[1] * p[1] + p[2] * p[2]).sqrt();
            let [closed, sticks] = mode::recall(mu, p[0], size, self.u[i][0]);
            slides = slides | (closed & !sticks & zero.lt(mu));
            self.closed[i] = replaced::<T>(lanes, closed, self.closed[i]);
            self.sticks[i] = replaced::<T>(lanes, sticks, self.sticks[i]);
            self.barred[i] = self.barred[i] & !lanes;
            self.freed[i] = self.freed[i] & !lanes;
        }
        let [relative, _] = self.residual();
        self.last = T::select(lanes, relative, self.last);
        let is_parked = !slides & relative.lt(zero.like(PARKED));
        let first = T::select(is_parked, zero.like(S::PARKED_ALPHA), zero.like(S::ALPHA));
        let first = T::select(self.definite, zero.like(S::SMALLEST_ALPHA), first);
        let first = T::select(zero.lt(self.asked), self.asked, first) * self.mean;
        self.first_alpha = T::select(lanes, first, self.first_alpha);
        self.alpha = T::select(lanes, first, self.alpha);
        self.memory.forget(lanes);
        self.reversals = T::select(lanes, zero.like(REVERSALS), self.reversals);
        self.full = self.full & !lanes;
        self.lost = self.lost & !lanes;
    }

    /// `u = W p + q` in the lanes of a mask.
    #[inline(always)]
    pub(super) fn renew_velocities<S: System<T, B>>(&mut self, system: &mut S, lanes: T::Mask) {
        system.velocities(&self.p, &mut self.trial);
        select::<T, B>(system.places(), lanes, &self.trial, &mut self.u);
    }

    /// A step of the lanes of a mask, as far as the cones allow; a blocking contact changes its
    /// mode.
    #[inline(always)]
    fn step<S: System<T, B>>(&mut self, system: &mut S, active: T::Mask) {
        let (zero, one) = (self.mean.like(0.0), self.mean.like(1.0));
        self.find_modes(system.places());
        if !system.factorise(self.alpha, &self.modes) {
            self.lost = self.lost | active;
            self.full = self.full & !active;
            return;
        }
        let centre = if S::RETURNS { &self.centre } else { &self.p };
        newton_point::<T, B, S>(system, centre, self.alpha, &self.modes, &mut self.trial);
        let fine = active & self.alpha.lt(one.like(S::SMALLEST_ALPHA) * self.mean);
        if S::SMALLEST_ALPHA_AGAIN < S::SMALLEST_ALPHA && fine.any() {
            self.improve_trial(system, fine);
        }
        let mut first = one;
        for i in system.places() {
            let trial = &mut self.trial[i];
            let slides = self.closed[i] & !self.sticks[i] & zero.lt(trial[0]);
            return_to_cone::<T>(slides, self.laws[i].mu, trial);
            let (closed, sticks) = (self.closed[i], self.sticks[i]);
            let t = limit((closed, sticks), self.laws[i].mu, &self.p[i], trial);
            self.fractions[i] = t;
            first = t.min(first);
        }
        let blocked = active & first.lt(one);
        if blocked.any() {
            self.stop_at(system.places(), blocked, first);
        } else {
            for i in system.places() {
                self.p[i] = self.trial[i];
            }
        }
        for i in system.places() {
            self.freed[i] = self.freed[i] & !active;
        }
        self.full = active & !blocked;
        if S::RETURNS {
            select::<T, B>(system.places(), self.full, &self.p, &mut self.centre);
        }
        system.velocities(&self.p, &mut self.u);
        self.judge(system.places());
    }

    /// Removes the rounding of the Newton point in the lanes of a mask, with the factors that found
    /// it.
    #[inline(always)]
    fn improve_trial<S: System<T, B>>(&mut self, system: &mut S, lanes: T::Mask) {
        let left = self.left_by_trial(system);
        let mut change = left;
        correction::<T, B, S>(system, &self.modes, &mut change);
        for i in system.places() {
            for k in 0..3 {
                let improved = self.trial[i][k] + change[i][k];
                self.trial[i][k] = T::select(lanes, improved, self.trial[i][k]);
            }
        }
    }

    /// What the Newton point leaves of its equations, which are these velocities
    /// [across](Mode::across) the modes.
    #[inline(always)]
    fn left_by_trial<S: System<T, B>>(&mut self, system: &mut S) -> B::Of<Triple<T>> {
        let centre = if S::RETURNS { &self.centre } else { &self.p };
        let mut left = self.u.clone();
        system.velocities(&self.trial, &mut left);
        for i in system.places() {
            let (left, trial, centre, mode) =
                (&mut left[i], &self.trial[i], &centre[i], &self.modes[i]);
            for k in 0..3 {
                left[k] += self.alpha * (trial[k] - centre[k]);
            }
            // The turn of a slide.
            let [b0, b1] = mode.b;
            let turn = mode.gamma * (b0 * trial[1] + b1 * trial[2]);
            left[1] += turn * b0;
            left[2] += turn * b1;
        }
        left
    }

    /// Violations by the present impulses.
    #[inline(always)]
    pub(super) fn judge(&mut self, places: impl Iterator<Item = usize>) {
        self.sums = judge::<T, B>(places, &self.laws, &self.p, &self.u, self.mean.like(0.0));
    }

    /// Modes at the present impulses.
    #[inline(always)]
    fn find_modes(&mut self, places: impl Iterator<Item = usize>) {
        for i in places {
            let (mu, p, u) = (self.laws[i].mu, &self.p[i], &self.u[i]);
            self.modes[i] = Mode::of(mu, self.closed[i], self.sticks[i], p, u);
        }
    }

    /// Where the last step was a full one and came near the answer.
    #[inline(always)]
    fn is_near(&self, near: f64) -> T::Mask {
        let [relative, _] = self.residual();
        self.full & relative.lt(relative.like(near))
    }

    /// Corrects the impulses of the lanes of a mask with the factors of their last step, where that
    /// makes the violations smaller.
    #[inline(always)]
    fn refine<S: System<T, B>>(&mut self, system: &mut S, lanes: T::Mask) {
        let zero = self.mean.like(0.0);
        self.find_modes(system.places());
        for i in system.places() {
            self.trial[i] = self.u[i];
        }
        correction::<T, B, S>(system, &self.modes, &mut self.trial);
        for i in system.places() {
            let trial = &mut self.trial[i];
            for (trial, p) in trial.iter_mut().zip(self.p[i]) {
                *trial += p;
            }
            let slides = self.closed[i] & !self.sticks[i] & zero.lt(trial[0]);
            return_to_cone::<T>(slides, self.laws[i].mu, trial);
        }
        system.velocities(&self.trial, &mut self.renewed);
        let sums = judge::<T, B>(
            system.places(),
            &self.laws,
            &self.trial,
            &self.renewed,
            zero,
        );
        let better = lanes & sums.weighted.lt(self.sums.weighted);
        select::<T, B>(system.places(), better, &self.trial, &mut self.p);
        select::<T, B>(system.places(), better, &self.renewed, &mut self.u);
        self.sums = LaneViolations::select(better, &sums, &self.sums);
    }

    /// Moves the impulses of blocked lanes to where the first contacts block, which change their
    /// modes; those of the others to the trial.
    #[inline(always)]
    fn stop_at(&mut self, places: impl Iterator<Item = usize>, blocked: T::Mask, first: T) {
        let (zero, one) = (first.like(0.0), first.like(1.0));
        let moves = zero.like(NO_MOVE).lt(first);
        for i in places {
            let (p, trial) = (&mut self.p[i], &self.trial[i]);
            for k in 0..3 {
                let between = p[k] + first * (trial[k] - p[k]);
                p[k] = T::select(blocked, between, trial[k]);
            }
            let t = self.fractions[i];
            let hit = blocked & t.lt(one) & (t * zero.like(ALIKE)).le(first);
            let opens = hit & !(self.closed[i] & self.sticks[i]);
            self.barred[i] = (self.barred[i] & !(blocked & moves)) | (hit & !moves & self.freed[i]);
            self.sticks[i] = self.sticks[i] & !hit;
            self.closed[i] = self.closed[i] & !opens;
            let slides = blocked & self.closed[i] & !self.sticks[i];
            return_to_cone::<T>(slides, self.laws[i].mu, p);
            for p in p {
                *p = T::select(opens, zero, *p);
            }
        }
    }
}

/// The impulses of the Newton step about the impulses `centre`, into `y`.
#[inline(always)]
fn newton_point<T: Lane, B: Store, S: System<T, B>>(
    system: &mut S,
    centre: &B::Of<Triple<T>>,
    alpha: T,
    modes: &B::Of<Mode<T>>,
    y: &mut B::Of<Triple<T>>,
) {
    for i in system.places() {
        let (c, q) = (&centre[i], system.free_velocity(i));
        for k in 0..3 {
            y[i][k] = alpha * c[k] - q[k];
        }
    }
    system.solve(modes, y);
}

/// The change of the impulses that removes the velocities `u` as far as the modes allow, in their
/// place.
#[inline(always)]
fn correction<T: Lane, B: Store, S: System<T, B>>(
    system: &mut S,
    modes: &B::Of<Mode<T>>,
    u: &mut B::Of<Triple<T>>,
) {
    for i in system.places() {
        for u in &mut u[i] {
            *u = -*u;
        }
    }
    system.solve(modes, u);
}

/// `new` in the lanes of a mask, `old` elsewhere.
#[inline(always)]
fn replaced<T: Lane>(lanes: T::Mask, new: T::Mask, old: T::Mask) -> T::Mask {
    (lanes & new) | (old & !lanes)
}

/// `out = new` in the lanes of a mask.
#[inline(always)]
fn select<T: Lane, B: Store>(
    places: impl Iterator<Item = usize>,
    lanes: T::Mask,
    new: &B::Of<Triple<T>>,
    out: &mut B::Of<Triple<T>>,
) {
    for i in places {
        for k in 0..3 {
            out[i][k] = T::select(lanes, new[i][k], out[i][k]);
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The largest rest that a Newton point leaves of its equations, before and after its
    /// improvement; none where the impulses are large.
    pub(crate) fn rests<B: Store, S: System<f64, B>>(
        system: &mut S,
        alpha: f64,
        modes: B::Of<Mode<f64>>,
        centre: B::Of<Triple<f64>>,
    ) -> Option<[f64; 2]> {
        let mut own = Pivoting::<f64, B>::new(Single::Baseline);
        (own.alpha, own.modes, own.centre) = (alpha, modes, centre);
        assert!(S::RETURNS && system.factorise(alpha, &own.modes));
        newton_point::<f64, B, S>(system, &own.centre, alpha, &own.modes, &mut own.trial);
        let entries = |x: Triple<f64>| x.into_iter().map(f64::abs);
        let is_small = |x: f64| x < 1e2;
        if !(system.places()).all(|i| entries(own.trial[i]).all(is_small)) {
            return None;
        }
        let largest = |own: &mut Pivoting<f64, B>, system: &mut S| {
            let left = own.left_by_trial(system);
            let left = system.places().map(|i| own.modes[i].across(left[i]));
            left.flat_map(entries).fold(0.0, f64::max)
        };
        let before = largest(&mut own, system);
        own.improve_trial(system, true);
        Some([before, largest(&mut own, system)])
    }
}
