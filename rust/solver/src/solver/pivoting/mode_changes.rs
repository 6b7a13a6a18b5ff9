//! How contacts change their modes after a full step.

use super::iteration::{ALIKE, Pivoting};
use super::limit::return_to_cone;
use super::mode_memory::weight;
use super::store::Store;
use super::system::System;
use crate::law::mode::ContactMode;
use crate::scalar::{Lane, LaneMask};
use crate::solver::draws::Draws;

/// Factor by which `α` shrinks when a full step with the right modes gains nothing.
const SHRINK: f64 = 1e-3;

/// Share of the squared residual that a full step must leave, if it gains nothing, and if it gains
/// so much that the modes stay.
pub(crate) const NO_GAIN: f64 = 0.25;
const HOLD: f64 = 1e-4;

/// Steps without progress after which the modes go in circles.
const PATIENCE: f64 = 4.0;

/// Impulses that stick may leave the cone by this share, which is rounding.
const BEYOND: f64 = 1.0 + 1e-12;

impl<T: Lane, B: Store> Pivoting<T, B> {
    /// The next modes of the lanes of a mask, where the last step was a full one and did not solve.
    #[inline(always)]
    pub(super) fn correct<S: System<T, B>>(&mut self, system: &mut S, active: T::Mask) {
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
        let number = self.number(system.places());
        self.memory.enter(full, number, relative);
        let looks = full & !gain.lt(like.like(HOLD));
        if !looks.any() {
            return;
        }
        let mut worst = self.worst_contradiction(system.places(), looks);
        if self.draws.is_some() {
            worst = self.scale_at_random(system.places());
        }
        // With the right modes nothing but α is left in the way.
        let is_settled = gains_nothing & looks & !zero.lt(worst);
        let (least, again) = (S::SMALLEST_ALPHA, S::SMALLEST_ALPHA_AGAIN);
        let least = T::select(zero.lt(self.asked), like.like(again), like.like(least)) * self.mean;
        let smaller = (like.like(SHRINK) * self.alpha).max(least);
        let mut circles = looks & like.like(PATIENCE).lt(self.memory.idle);
        if self.draws.is_none() {
            self.alpha = T::select(is_settled, smaller, self.alpha);
        } else {
            circles = circles & !circles;
        }
        let stuck = circles | is_settled;
        let reversed = if stuck.any() {
            self.reverse(system.places(), stuck)
        } else {
            stuck
        };
        self.lost = self.lost | (circles & !reversed);
        let mut moved = reversed;
        let found = zero.lt(worst) & !reversed;
        let least = worst * zero.like(ALIKE);
        for i in system.places() {
            let here = found & least.le(self.contradictions[i]);
            self.freed[i] = here;
            if here.any() {
                moved = moved | self.change_mode(system, i, here);
            }
        }
        if moved.any() {
            self.renew_velocities(system, moved);
        }
        if reversed.any() {
            self.judge(system.places());
            let [relative, _] = self.residual();
            self.last = T::select(reversed, relative, self.last);
        }
    }

    /// The modes as a number that is not zero.
    #[inline(always)]
    fn number(&self, places: impl Iterator<Item = usize>) -> T {
        let one = self.mean.like(1.0);
        let (zero, two) = (one.like(0.0), one.like(2.0));
        let mut number = one;
        for i in places {
            let digit = T::select(self.closed[i], T::select(self.sticks[i], one, two), zero);
            number += digit * one.like(weight(i));
        }
        number
    }

    /// How much the contacts contradict their modes, unless they are barred, in the lanes of a
    /// mask; returns the largest amount, zero where none does.
    #[inline(always)]
    fn worst_contradiction(&mut self, places: impl Iterator<Item = usize>, lanes: T::Mask) -> T {
        let zero = self.mean.like(0.0);
        let mut worst = zero;
        for i in places {
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
            self.contradictions[i] = amount;
            worst = amount.max(worst);
        }
        worst
    }

    /// Scales the contradictions at random; returns the largest. The worst of several that are
    /// about as large is not always the one to correct: correcting it may bring about the next, and
    /// that one the first again.
    fn scale_at_random(&mut self, places: impl Iterator<Item = usize>) -> T {
        let mut worst = self.mean.like(0.0);
        for i in places {
            let weight = self.draws.as_mut().map_or(1.0, Draws::next);
            let amount = self.contradictions[i] * worst.like(weight);
            self.contradictions[i] = amount;
            worst = amount.max(worst);
        }
        worst
    }

    /// Turns the friction of barred contacts against their slip and frees them, in the lanes of a
    /// mask. Returns where there was one.
    #[inline(always)]
    fn reverse(&mut self, places: impl Iterator<Item = usize>, stuck: T::Mask) -> T::Mask {
        let zero = self.mean.like(0.0);
        let may = stuck & zero.lt(self.reversals);
        let mut reversed = !stuck & stuck;
        for i in places {
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
        self.memory.forget(reversed);
        reversed
    }

    /// Gives contact `i` the mode that its contradiction asks for, in the lanes of a mask. Returns
    /// where its impulse moved.
    #[inline(always)]
    fn change_mode<S: System<T, B>>(&mut self, system: &S, i: usize, lanes: T::Mask) -> T::Mask {
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
            self.close(system, i, bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
        opens | slides | closes
    }

    /// Closes contact `i` of a lane with its own solution, all others fixed, since it may slide at
    /// once.
    #[inline(always)]
    fn close<S: System<T, B>>(&mut self, system: &S, i: usize, lane: usize) {
        // Its impulse is zero, so that u is its free velocity.
        let free = self.u[i].map(|u| u.get(lane));
        let mu = self.laws[i].mu.get(lane);
        let (mode, impulse) = system.solve_one(i, lane, &free, mu);
        for (p, own) in self.p[i].iter_mut().zip(impulse) {
            p.set(lane, own);
        }
        let here = T::mask(self.mean.token(), 1 << lane);
        self.sticks[i] = self.sticks[i] & !here;
        if mode == ContactMode::Stick {
            self.sticks[i] = self.sticks[i] | here;
        }
    }
}
