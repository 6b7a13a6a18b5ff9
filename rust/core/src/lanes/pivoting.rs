//! Pivoting on the contact modes of several problems side by side: the rules of
//! [`crate::solver`]'s pivoting, in lanes.
//!
//! From a warm start a step goes to the [answer of the present modes](super::equations) as far as
//! all cones allow. The contact that blocks then slides or opens. After a full step the contact
//! whose velocity contradicts its mode most is corrected, with those that do so as much, unless the
//! residual falls fast: then the modes are right, and the next step removes the curvature of the
//! slides. A contact whose friction pushes along its slip, but which would leave its cone at once
//! if it stuck, is barred, so that another one changes its mode. If none is left, its friction is
//! reversed.

use super::modes::{Law, Limit, Mode, Violations, is_pressed_to_slide, judge, limit};
use super::problem::{MAX_CONTACTS, Triple};
use super::system::System;
use super::visits::Visits;
use crate::law::coulomb::ContactMode;
use crate::scalar::{Lane, LaneMask};
use crate::solver::solve_one_contact;

/// Squared relative residual below which a rover without a slide counts as parked.
const PARKED: f64 = 1e-12;

/// Factor by which `α` shrinks when a full step with the right modes gains nothing.
const SHRINK: f64 = 1e-3;

/// Share of the squared residual that a full step must leave, if it gains nothing, and if it gains
/// so much that the modes stay.
const NO_GAIN: f64 = 0.25;
const HOLD: f64 = 1e-4;

/// Fraction of a step below which the impulse stays where it was.
const NO_MOVE: f64 = 1e-6;

/// Contacts that block at the same place, or contradict their modes as much, to this share, change
/// together: in a machine that is its own mirror image one of a pair must not go first.
const ALIKE: f64 = 1.0 - 1e-6;

/// Steps without progress after which the modes go in circles.
const PATIENCE: f64 = 4.0;

/// Most reversals of friction.
const REVERSALS: f64 = 2.0;

/// Impulses that stick may leave the cone by this share, which is rounding.
const BEYOND: f64 = 1.0 + 1e-12;

/// The weights of the modes in their number: exact for as many contacts as a problem can have.
const POWERS_OF_3: [f64; MAX_CONTACTS + 1] = {
    let mut powers = [1.0; MAX_CONTACTS + 1];
    let mut i = 1;
    while i <= MAX_CONTACTS {
        powers[i] = 3.0 * powers[i - 1];
        i += 1;
    }
    powers
};

/// Problems of at most `C` contacts that are being solved, one a lane.
#[derive(Clone, Debug)]
pub(super) struct Pivoting<T: Lane, const C: usize, S: System<T, C>> {
    pub(super) system: S,
    pub(super) q: [Triple<T>; C],
    pub(super) laws: [Law<T>; C],
    /// Mean diagonal of `W`, 1/kg.
    pub(super) mean: T,
    /// Impulses and their velocities.
    pub(super) p: [Triple<T>; C],
    pub(super) u: [Triple<T>; C],
    /// Violations of the law by them.
    pub(super) sums: Violations<T>,
    /// Lanes whose modes go in circles.
    pub(super) lost: T::Mask,
    /// Squares of `1/|q|` and `1/|(ρ_i q_i)|`.
    pub(super) inverses: [T; 2],
    /// `α` that an attempt asks for, relative to the mean diagonal of `W`; 0 for that which suits
    /// the start.
    pub(super) asked: T,
    /// Impulses that a step stays near, where the system [returns](System::RETURNS) to them.
    pub(super) centre: [Triple<T>; C],
    alpha: T,
    first_alpha: T,
    trial: [Triple<T>; C],
    modes: [Mode<T>; C],
    closed: [T::Mask; C],
    sticks: [T::Mask; C],
    barred: [T::Mask; C],
    /// The contact that has just been let stick.
    freed: [T::Mask; C],
    /// Lanes whose last step was a full one.
    full: T::Mask,
    /// Squared relative residual after the last full step.
    last: T,
    visits: Visits<T>,
    reversals: T,
}

impl<T: Lane, const C: usize, S: System<T, C>> Pivoting<T, C, S> {
    #[inline(always)]
    pub(super) fn new(token: T::Token) -> Self {
        let (zero, one) = (T::splat(token, 0.0), T::splat(token, 1.0));
        let none = T::mask(token, 0);
        Self {
            system: S::new(token),
            q: [[zero; 3]; C],
            laws: [Law::new(zero); C],
            mean: one,
            p: [[zero; 3]; C],
            u: [[zero; 3]; C],
            sums: Violations::none(zero),
            lost: none,
            inverses: [zero, one],
            asked: zero,
            alpha: one,
            first_alpha: one,
            centre: [[zero; 3]; C],
            trial: [[zero; 3]; C],
            modes: [Mode::open(zero); C],
            closed: [none; C],
            sticks: [none; C],
            barred: [none; C],
            freed: [none; C],
            full: none,
            last: zero,
            visits: Visits::new(zero),
            reversals: zero,
        }
    }

    /// Squares of the two numbers of the residual.
    #[inline(always)]
    pub(super) fn residual(&self) -> [T; 2] {
        let speed = self.sums.squares * self.inverses[0];
        let impulse = self.sums.weighted * self.inverses[1];
        [speed.max(impulse), self.sums.largest]
    }

    /// Where squares of the residual are within tolerances.
    #[inline(always)]
    pub(super) fn is_solved(&self, tolerances: [T; 2]) -> T::Mask {
        let [relative, largest] = self.residual();
        relative.le(tolerances[0]) & largest.le(tolerances[1])
    }

    /// Forgets mode and velocity of a place where a lane has no contact. When another lane begins
    /// to use the place they would count among this one's modes and violations.
    #[inline(always)]
    pub(super) fn vacate(&mut self, place: usize, lane: usize) {
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
    pub(super) fn begin(&mut self, lanes: T::Mask) {
        let zero = self.mean.like(0.0);
        self.renew_velocities(lanes);
        self.judge();
        let mut slides = !lanes & lanes;
        for i in self.system.places() {
            let (p, mu) = (&self.p[i], self.laws[i].mu);
            let pressed = zero.lt(p[0]);
            let approaches = self.u[i][0].lt(zero);
            let limit = is_pressed_to_slide(mu, p);
            let sticks = (pressed & !limit) | (!pressed & approaches);
            slides = slides | (limit & zero.lt(mu));
            self.closed[i] = replaced::<T>(lanes, pressed | approaches, self.closed[i]);
            self.sticks[i] = replaced::<T>(lanes, sticks, self.sticks[i]);
            self.barred[i] = self.barred[i] & !lanes;
            self.freed[i] = self.freed[i] & !lanes;
        }
        let [relative, _] = self.residual();
        self.last = T::select(lanes, relative, self.last);
        let is_parked = !slides & relative.lt(zero.like(PARKED));
        let first = T::select(is_parked, zero.like(S::PARKED_ALPHA), zero.like(S::ALPHA));
        let first = T::select(zero.lt(self.asked), self.asked, first) * self.mean;
        self.first_alpha = T::select(lanes, first, self.first_alpha);
        self.alpha = T::select(lanes, first, self.alpha);
        self.visits.forget(lanes);
        self.reversals = T::select(lanes, zero.like(REVERSALS), self.reversals);
        self.full = self.full & !lanes;
        self.lost = self.lost & !lanes;
    }

    /// `u = W p + q` in the lanes of a mask.
    #[inline(always)]
    fn renew_velocities(&mut self, lanes: T::Mask) {
        (self.system).velocities(&self.q, &self.p, &mut self.trial);
        select(self.system.places(), lanes, &self.trial, &mut self.u);
    }

    /// A step of the lanes of a mask, as far as the cones allow; a blocking contact changes its
    /// mode.
    #[inline(always)]
    pub(super) fn step(&mut self, active: T::Mask) {
        let (zero, one) = (self.mean.like(0.0), self.mean.like(1.0));
        self.find_modes();
        self.system.factorise(self.alpha, &self.modes);
        let centre = if S::RETURNS { &self.centre } else { &self.p };
        self.system
            .newton_point(&self.q, centre, self.alpha, &self.modes, &mut self.trial);
        let fine = active & self.alpha.lt(one.like(S::SMALLEST_ALPHA) * self.mean);
        if S::SMALLEST_ALPHA_AGAIN < S::SMALLEST_ALPHA && fine.any() {
            self.improve_trial(fine);
        }
        let mut first = one;
        let mut limits = [Limit {
            t: one,
            slides: active,
        }; C];
        for i in self.system.places() {
            let trial = &mut self.trial[i];
            let slides = self.closed[i] & !self.sticks[i] & zero.lt(trial[0]);
            return_to_cone::<T>(slides, self.laws[i].mu, trial);
            let (closed, sticks) = (self.closed[i], self.sticks[i]);
            limits[i] = limit((closed, sticks), self.laws[i].mu, &self.p[i], trial);
            first = limits[i].t.min(first);
        }
        let blocked = active & first.lt(one);
        if blocked.any() {
            self.stop_at(blocked, first, &limits);
        } else {
            for i in self.system.places() {
                self.p[i] = self.trial[i];
            }
        }
        for i in self.system.places() {
            self.freed[i] = self.freed[i] & !active;
        }
        self.full = active & !blocked;
        if S::RETURNS {
            select(self.system.places(), self.full, &self.p, &mut self.centre);
        }
        (self.system).velocities(&self.q, &self.p, &mut self.u);
        self.judge();
    }

    /// Removes the rounding of the Newton point in the lanes of a mask, with the factors that found
    /// it.
    #[inline(always)]
    fn improve_trial(&mut self, lanes: T::Mask) {
        let left = self.left_by_trial();
        let mut change = left;
        (self.system).correction(&left, &self.modes, &mut change);
        for i in self.system.places() {
            for k in 0..3 {
                let improved = self.trial[i][k] + change[i][k];
                self.trial[i][k] = T::select(lanes, improved, self.trial[i][k]);
            }
        }
    }

    /// What the Newton point leaves of its equations, which are these velocities
    /// [across](super::equations) the modes.
    #[inline(always)]
    fn left_by_trial(&mut self) -> [Triple<T>; C] {
        let centre = if S::RETURNS { &self.centre } else { &self.p };
        let mut left = self.u;
        (self.system).velocities(&self.q, &self.trial, &mut left);
        for i in self.system.places() {
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
    fn judge(&mut self) {
        self.sums = judge(self.system.places(), &self.laws, &self.p, &self.u);
    }

    /// Modes at the present impulses.
    #[inline(always)]
    fn find_modes(&mut self) {
        for i in self.system.places() {
            let (mu, p, u) = (self.laws[i].mu, &self.p[i], &self.u[i]);
            self.modes[i] = Mode::of(mu, self.closed[i], self.sticks[i], p, u);
        }
    }

    /// Where the last step was a full one and came near the answer.
    #[inline(always)]
    pub(super) fn is_near(&self) -> T::Mask {
        let [relative, _] = self.residual();
        self.full & relative.lt(relative.like(S::NEAR))
    }

    /// Corrects the impulses of the lanes of a mask with the factors of their last step, where that
    /// makes the violations smaller.
    #[inline(always)]
    pub(super) fn refine(&mut self, lanes: T::Mask) {
        let zero = self.mean.like(0.0);
        self.find_modes();
        (self.system).correction(&self.u, &self.modes, &mut self.trial);
        let mut u = self.u;
        for i in self.system.places() {
            let trial = &mut self.trial[i];
            for (trial, p) in trial.iter_mut().zip(self.p[i]) {
                *trial += p;
            }
            let slides = self.closed[i] & !self.sticks[i] & zero.lt(trial[0]);
            return_to_cone::<T>(slides, self.laws[i].mu, trial);
        }
        (self.system).velocities(&self.q, &self.trial, &mut u);
        let sums = judge(self.system.places(), &self.laws, &self.trial, &u);
        let better = lanes & sums.weighted.lt(self.sums.weighted);
        select(self.system.places(), better, &self.trial, &mut self.p);
        select(self.system.places(), better, &u, &mut self.u);
        self.sums = Violations::select(better, &sums, &self.sums);
    }

    /// Moves the impulses of blocked lanes to where the first contacts block, which change their
    /// modes; those of the others to the trial.
    #[inline(always)]
    fn stop_at(&mut self, blocked: T::Mask, first: T, limits: &[Limit<T>; C]) {
        let (zero, one) = (first.like(0.0), first.like(1.0));
        let moves = zero.like(NO_MOVE).lt(first);
        for i in self.system.places() {
            let (p, trial) = (&mut self.p[i], &self.trial[i]);
            for k in 0..3 {
                let between = p[k] + first * (trial[k] - p[k]);
                p[k] = T::select(blocked, between, trial[k]);
            }
            let t = limits[i].t;
            let hit = blocked & t.lt(one) & (t * zero.like(ALIKE)).le(first);
            let opens = hit & !limits[i].slides;
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

    /// The next modes of the lanes of a mask, where the last step was a full one and did not solve.
    #[inline(always)]
    pub(super) fn correct(&mut self, active: T::Mask) {
        let full = self.full & active;
        if !full.any() {
            return;
        }
        let like = self.mean;
        let zero = like.like(0.0);
        let [relative, _] = self.residual();
        let gain = relative / self.last;
        self.last = T::select(full, relative, self.last);
        let gains_nothing = full & like.like(NO_GAIN).lt(gain);
        self.visits.enter(full, self.number(), relative);
        let looks = full & !gain.lt(like.like(HOLD));
        if !looks.any() {
            return;
        }
        let (found, worst) = self.worst_contradiction(looks);
        // With the right modes nothing but α is left in the way.
        let is_settled = gains_nothing & looks & !zero.lt(worst);
        let (least, again) = (S::SMALLEST_ALPHA, S::SMALLEST_ALPHA_AGAIN);
        let least = T::select(zero.lt(self.asked), like.like(again), like.like(least)) * self.mean;
        let smaller = (like.like(SHRINK) * self.alpha).max(least);
        self.alpha = T::select(is_settled, smaller, self.alpha);
        let circles = looks & like.like(PATIENCE).lt(self.visits.idle);
        let stuck = circles | is_settled;
        let reversed = if stuck.any() {
            self.reverse(stuck)
        } else {
            stuck
        };
        self.lost = self.lost | (circles & !reversed);
        let mut moved = reversed;
        for i in self.system.places() {
            let here = found[i] & !reversed;
            self.freed[i] = here;
            if here.any() {
                moved = moved | self.change_mode(i, here);
            }
        }
        if moved.any() {
            self.renew_velocities(moved);
        }
        if reversed.any() {
            self.judge();
            let [relative, _] = self.residual();
            self.last = T::select(reversed, relative, self.last);
        }
    }

    /// The modes as a number that is not zero.
    #[inline(always)]
    fn number(&self) -> T {
        let one = self.mean.like(1.0);
        let (zero, two) = (one.like(0.0), one.like(2.0));
        let mut number = one;
        for i in self.system.places() {
            let digit = T::select(self.closed[i], T::select(self.sticks[i], one, two), zero);
            number += digit * one.like(POWERS_OF_3[i + 1]);
        }
        number
    }

    /// The contacts that contradict their modes most, unless they are barred, in the lanes of a
    /// mask, and by how much; zero where none does.
    #[inline(always)]
    fn worst_contradiction(&self, lanes: T::Mask) -> ([T::Mask; C], T) {
        let zero = self.mean.like(0.0);
        let mut worst = zero;
        let mut found = [!lanes & lanes; C];
        let mut amounts = [zero; C];
        for i in self.system.places() {
            let (p, u, mu) = (&self.p[i], &self.u[i], self.laws[i].mu);
            let norm = (p[1] * p[1] + p[2] * p[2]).sqrt();
            let beyond = zero.lt(p[0]) & (mu * p[0] * zero.like(BEYOND)).lt(norm);
            let of_stick = T::select(beyond | p[0].lt(zero), zero.like(f64::INFINITY), zero);
            // Friction that pushes along the slip.
            let along = (p[1] * u[1] + p[2] * u[2]) / norm;
            let of_slide = T::select(zero.lt(norm), along, zero);
            let amount = T::select(self.sticks[i], of_stick, of_slide);
            let amount = T::select(self.closed[i], amount, -u[0]);
            let amount = T::select(lanes & !self.barred[i], amount, zero);
            amounts[i] = amount;
            worst = amount.max(worst);
        }
        let least = worst * zero.like(ALIKE);
        let is_any = zero.lt(worst);
        for i in self.system.places() {
            found[i] = is_any & least.le(amounts[i]);
        }
        (found, worst)
    }

    /// Turns the friction of barred contacts against their slip and frees them, in the lanes of a
    /// mask. Returns where there was one.
    #[inline(always)]
    fn reverse(&mut self, stuck: T::Mask) -> T::Mask {
        let zero = self.mean.like(0.0);
        let may = stuck & zero.lt(self.reversals);
        let mut reversed = !stuck & stuck;
        for i in self.system.places() {
            let (p, u, mu) = (&mut self.p[i], &self.u[i], self.laws[i].mu);
            let slip = (u[1] * u[1] + u[2] * u[2]).sqrt();
            let here = may & self.barred[i] & zero.lt(slip);
            reversed = reversed | here;
            self.barred[i] = self.barred[i] & !here;
            let scale = -(mu * p[0].max(zero)) / slip;
            p[1] = T::select(here, scale * u[1], p[1]);
            p[2] = T::select(here, scale * u[2], p[2]);
        }
        let left = self.reversals - zero.like(1.0);
        self.reversals = T::select(reversed, left, self.reversals);
        self.alpha = T::select(reversed, self.first_alpha, self.alpha);
        self.visits.forget(reversed);
        reversed
    }

    /// Gives contact `i` the mode that its contradiction asks for, in the lanes of a mask. Returns
    /// where its impulse moved.
    #[inline(always)]
    fn change_mode(&mut self, i: usize, lanes: T::Mask) -> T::Mask {
        let zero = self.mean.like(0.0);
        let p = &mut self.p[i];
        let (closed, stuck) = (
            lanes & self.closed[i],
            lanes & self.sticks[i] & self.closed[i],
        );
        let opens = stuck & p[0].lt(zero);
        let slides = stuck & !opens;
        let closes = lanes & !closed;
        return_to_cone::<T>(slides, self.laws[i].mu, p);
        for p in p {
            *p = T::select(opens, zero, *p);
        }
        self.closed[i] = (self.closed[i] & !opens) | closes;
        self.sticks[i] = (self.sticks[i] & !stuck) | (closed & !stuck);
        let mut bits = closes.bits();
        while bits != 0 {
            self.close(i, bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
        opens | slides | closes
    }

    /// Closes contact `i` of a lane with its own solution, all others fixed, since it may slide at
    /// once.
    #[inline(always)]
    fn close(&mut self, i: usize, lane: usize) {
        let [a, b, c, d, e, f, g, h, k] = self.system.diagonal(i).map(|w| w.get(lane));
        // Its impulse is zero, so that u is its free velocity.
        let free = self.u[i].map(|u| u.get(lane));
        let mu = self.laws[i].mu.get(lane);
        let own = solve_one_contact(&[[a, b, c], [d, e, f], [g, h, k]], &free, mu);
        for (p, own) in self.p[i].iter_mut().zip(own.impulse) {
            p.set(lane, own);
        }
        let here = T::mask(self.mean.token(), 1 << lane);
        self.sticks[i] = self.sticks[i] & !here;
        if own.mode == ContactMode::Stick {
            self.sticks[i] = self.sticks[i] | here;
        }
    }
}

/// `new` in the lanes of a mask, `old` elsewhere.
#[inline(always)]
fn replaced<T: Lane>(lanes: T::Mask, new: T::Mask, old: T::Mask) -> T::Mask {
    (lanes & new) | (old & !lanes)
}

/// `out = new` in the lanes of a mask.
#[inline(always)]
fn select<T: Lane, const C: usize>(
    places: impl Iterator<Item = usize>,
    lanes: T::Mask,
    new: &[Triple<T>; C],
    out: &mut [Triple<T>; C],
) {
    for i in places {
        for k in 0..3 {
            out[i][k] = T::select(lanes, new[i][k], out[i][k]);
        }
    }
}

/// Scales the tangential impulse to `μ p_N` in the lanes of a mask.
#[inline(always)]
fn return_to_cone<T: Lane>(lanes: T::Mask, mu: T, p: &mut Triple<T>) {
    if !lanes.any() {
        return;
    }
    let zero = mu.like(0.0);
    let norm = (p[1] * p[1] + p[2] * p[2]).sqrt();
    let scale = T::select(zero.lt(norm), mu * p[0].max(zero) / norm, zero);
    for p in &mut p[1..] {
        *p = T::select(lanes, *p * scale, *p);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::equations::across;
    use crate::lanes::problem::MAX_DENSE;
    use crate::lanes::velocity_equations::VelocitySystem;
    use crate::lanes::velocity_equations::tests::{pattern, problem};
    use crate::scalar::Single;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn the_newton_point_of_a_small_alpha_is_as_accurate_as_that_of_a_large_one(
            numbers in prop::collection::vec(-1.0..1.0_f64, 600), modes in prop::collection::vec(0..3, MAX_DENSE),
        ) {
            let pattern = pattern();
            let problem = problem(&pattern, &mut numbers.iter().copied());
            let mut own =
                Pivoting::<f64, MAX_CONTACTS, VelocitySystem<f64, MAX_CONTACTS>>::new(Single::best());
            prop_assert_eq!(own.system.load(0, &problem).count(), MAX_DENSE);
            let mut more = numbers.iter().rev().copied();
            for i in 0..MAX_DENSE {
                for x in own.q[i].iter_mut().chain(&mut own.centre[i]) {
                    *x = more.next().unwrap();
                }
                // Friction that opposes the slip, so that its direction turns.
                let p = own.centre[i];
                let u = [0.0, -p[1], -p[2]];
                own.modes[i] = Mode::of(0.3, modes[i] > 0, modes[i] == 1, &p, &u);
            }
            own.alpha = 1e-8;
            own.system.factorise(own.alpha, &own.modes);
            own.system.newton_point(&own.q, &own.centre, own.alpha, &own.modes, &mut own.trial);
            let largest = |own: &mut Pivoting<f64, MAX_CONTACTS, _>| {
                let left = own.left_by_trial();
                let left = left[..MAX_DENSE].iter().zip(&own.modes).flat_map(|(u, mode)| across(mode, *u));
                left.fold(0.0, |most: f64, x| most.max(x.abs()))
            };
            prop_assume!(own.trial.iter().flatten().all(|x| x.abs() < 1e2));
            let before = largest(&mut own);
            own.improve_trial(true);
            let after = largest(&mut own);
            prop_assert!(before < 1e-4, "{before:e}");
            prop_assert!(after < 1e-12, "{before:e} {after:e}");
        }
    }
}
