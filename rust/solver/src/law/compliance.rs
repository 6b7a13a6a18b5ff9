//! Compliance: a contact whose two sides yield.
//!
//! A linear spring and a damper act in parallel while the contact is closed, `f = k δ + d δ̇` with
//! the deflection `δ = −gap ≥ 0`. Over a step of h, with the impulse `p_N = h f` and both terms
//! implicit, `δ⁺ = δ − h u_N⁺` and `δ̇⁺ = −u_N⁺`, the force law is a complementarity problem again:
//!
//! ```text
//! 0 ≤ u_N⁺ + p_N / (h (h k + d)) + k gap / (h k + d)  ⊥  p_N ≥ 0        where gap ≤ 0
//! ```
//!
//! An open contact has gap/h in place of the last term: the deflection begins when it has closed.
//! Compliance is thus a term on the diagonal of W and a shift of the free velocity. Its limit for
//! k → ∞ is Signorini's law, and it is stable for every k and every step.
//!
//! Along the surface a spring k_T acts between the wheel and the tread that touches, and what slips
//! is the rest. Tread that enters the contact is not deflected yet: a wheel that travels at V over
//! its tread loses its deflection y over the relaxation length σ, `ẏ = u_T − V y/σ` as long as
//! nothing slips. With `f_T = −k_T y` at the end of the step and the impulse p_T⁻ of the step
//! before, Coulomb's law holds between p_T and
//!
//! ```text
//! u_T + ((1 + h V/σ) p_T − p_T⁻) / (h² k_T)
//! ```
//!
//! In steady rolling `u_T/V = −f_T/(k_T σ)`: a side force needs a slip angle, and k_T σ is the
//! cornering stiffness. A parked wheel has V = 0 and does not creep. Where the last step is not
//! known, the contact is taken in steady rolling, `p_T⁻ = p_T`, and where it hardly rolls a share
//! of the spring acts. The limit for k → ∞ is the rigid wheel. Along the surface there is no
//! damper: relaxation and the implicit step take its place. W has a positive diagonal, and a
//! machine on more contacts than it needs has one set of loads.
//!
//! Sources: Anitescu and Potra 2002, *A time-stepping method for stiff multibody dynamics with
//! contact and friction*, IJNME 55, 753–784; for the relaxation Pacejka 2012, *Tire and Vehicle
//! Dynamics*, ch. 7.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::scalar::Lane;

/// Tread of a wheel that yields: what its description says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tread {
    /// Normal stiffness k, N/m.
    pub stiffness: f64,
    /// Normal damping d, N s/m.
    pub damping: f64,
    /// Stiffness along the surface relative to the normal one, k_T/k.
    pub tangential_ratio: f64,
    /// Relaxation length σ, m.
    pub relaxation_length: f64,
    /// Radius of the wheel, m.
    pub radius: f64,
}

impl Tread {
    /// The deflection at which half the length of the contact is the relaxation length, m: that of
    /// a wheel at rest, unless its description states another length.
    #[inline]
    #[must_use]
    pub fn usual_deflection(&self) -> f64 {
        0.5 * self.relaxation_length * self.relaxation_length / self.radius
    }

    /// The contact of a wheel that travels at a speed V (m/s) over its tread; `lean`: squared
    /// cosine of the angle between its axle and the contact's normal.
    ///
    /// A tread yields along its radius, of whose deflection and force the normal sees the sine: it
    /// is stiffer by 1/sin², and a wheel that lies flat is all but rigid.
    #[inline(always)]
    #[must_use]
    pub fn rolling<T: Lane>(&self, [travel, lean]: [T; 2]) -> Compliance<T> {
        let one = travel.like(1.0);
        let upright = one / (one - lean).max(travel.like(LYING));
        Compliance {
            stiffness: travel.like(self.stiffness) * upright,
            damping: travel.like(self.damping) * upright,
            tangential: travel.like(self.tangential_ratio * self.stiffness),
            fading: travel * travel.like(1.0 / self.relaxation_length),
            slack: travel.like(SLACK * self.radius),
        }
    }
}

/// Springs and damper of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance<T = f64> {
    /// k, N/m.
    pub stiffness: T,
    /// d, N s/m.
    pub damping: T,
    /// k_T, N/m.
    pub tangential: T,
    /// V/σ, 1/s.
    pub fading: T,
    /// Deflection that counts as elastic whatever the forces, m.
    pub slack: T,
}

/// Law of one contact over a step: Coulomb's law between impulse p and `u + diagonal p + shift`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Yielding<T = f64> {
    /// Terms on the diagonal of W along n, t, b, 1/kg; 0 for a rigid contact.
    pub diagonal: [T; 3],
    /// Shift of the free velocity along n, t, b, m/s.
    pub shift: [T; 3],
    /// Gap that the law knows, m.
    pub gap: T,
    /// Penetration that no elastic force explains, m, as a negative gap.
    pub unexplained: T,
    /// k, N/m.
    stiffness: T,
    /// 1/(h² k_T), 1/kg; and that of the last step's force, 0 where it is not known.
    spring: T,
    tangential: T,
    /// Tangential impulse at the start, N s.
    friction: [T; 2],
    /// Normal impulse at the start, N s.
    load: T,
    /// Deflection at the start of the step, m.
    start: T,
}

/// What the springs of contacts hold over a step, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringEnergy<T = f64> {
    /// At its start, if nothing else says it.
    pub before: T,
    /// The most that they may hold at its end.
    pub most: T,
    /// What they gave: work of the impulse, and what slip took.
    pub given: T,
}

impl<T: Lane> SpringEnergy<T> {
    /// At the end, if they held `before` at the start: what they did not give, no less than nothing
    /// and no more than the deflection says.
    #[inline(always)]
    #[must_use]
    pub fn after(&self, before: T) -> T {
        (before - self.given).min(self.most).max(before.like(0.0))
    }
}

/// Deflection that counts as elastic whatever the forces, as a share of the wheel's radius: 1e-6 m
/// for the built-in rover's wheels.
const SLACK: f64 = 1e-5;

/// Least squared sine of the angle between a wheel's axle and the normal for its stiffness.
const LYING: f64 = 1e-4;

/// Share of the spring along the surface that acts where the last step is not known and the contact
/// hardly rolls. It makes loads unique; a rover parked across a slope of 10 degrees creeps by 0.1
/// mm/s if no step is remembered.
const UNKNOWN: f64 = 0.01;

impl<T: Lane> Compliance<T> {
    /// Compliance of two sides in series, of which a rigid one is `None`.
    #[inline(always)]
    #[must_use]
    pub fn in_series(first: Option<Self>, second: Option<Self>) -> Option<Self> {
        match (first, second) {
            (Some(a), Some(b)) => {
                let one = a.stiffness.like(1.0);
                let share = b.stiffness / (a.stiffness + b.stiffness);
                let rest = one - share;
                let along = b.tangential / (a.tangential + b.tangential);
                Some(Self {
                    stiffness: a.stiffness * share,
                    // Both deflect in proportion to their springs.
                    damping: a.damping * share * share + b.damping * rest * rest,
                    tangential: a.tangential * along,
                    fading: a.fading * along + b.fading * (one - along),
                    slack: a.slack + b.slack,
                })
            }
            (one, other) => one.or(other),
        }
    }

    /// Compliance `other` in the lanes where the mask `here` is true, this one elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn or(self, here: T::Mask, other: &Self) -> Self {
        let both = |own: T, other: T| T::select(here, other, own);
        Self {
            stiffness: both(self.stiffness, other.stiffness),
            damping: both(self.damping, other.damping),
            tangential: both(self.tangential, other.tangential),
            fading: both(self.fading, other.fading),
            slack: both(self.slack, other.slack),
        }
    }

    /// The law over a step of `h`, s, with the scheme's `theta`.
    ///
    /// - `gap`, `u_N`: gap (m) and normal velocity (m/s) at the pose that the step reaches without
    ///   impulses. The law begins with the gap less θ h u_N: a stiff contact then comes to rest
    ///   within a step.
    /// - `before`: impulse of the last step, N s, in the contact's frame.
    /// - `unknown`: where no last step is remembered, and the normal impulse that a contact may
    ///   have had there: the machine's weight times h.
    ///
    /// A body that strikes a stiff contact penetrates it within the step by more than any spring
    /// would allow. That part is not elastic and is not given back: it is `unexplained`, and
    /// position projection removes it. A deflection that the impulse before explains is elastic.
    #[inline(always)]
    #[must_use]
    pub fn over(
        &self,
        (h, theta): (T, T),
        gap: T,
        u_N: T,
        before: [T; 3],
        (unknown, weight): (T::Mask, T),
    ) -> Yielding<T> {
        let Self {
            stiffness,
            damping,
            tangential,
            fading,
            slack,
        } = *self;
        let (zero, one) = (h.like(0.0), h.like(1.0));
        let moved = h * u_N;
        let deflection = (moved - gap).max(zero);
        let gap = gap - theta * moved;
        // The damper bore a part of the force while the deflection grew, and keeps more of it than
        // the force says while it shrinks: no more than twice, so that an impact leaves little.
        let force = T::select(unknown, weight, before[0]) / h;
        let most = force * h.like(2.0);
        let by_force = (force + damping * u_N).max(zero).min(most) / stiffness;
        let elastic = (h.like(2.0) * deflection).min(by_force);
        let known = gap.max(-(elastic + slack));
        let pressed = weight / (h * stiffness);
        let start = ((one - theta) * moved - known).max(zero);
        let start = T::select(unknown, start.min(pressed.max(-known)), start);
        let weight = h * stiffness + damping;
        let diagonal = one / (h * weight);
        // The damper acts on the deflection, which begins when the gap is closed.
        let approach = T::select(zero.lt(known), known / h, known * stiffness / weight);
        // Of an impact's friction only what the deflection holds is elastic.
        let held = (deflection / by_force.max(h.like(f64::MIN_POSITIVE))).min(one);
        let friction = [held * before[1], held * before[2]];
        let spring = one / (h * h * tangential);
        let steady = fading / (h * tangential);
        let along = T::select(
            unknown,
            steady.max(spring * h.like(UNKNOWN)),
            steady + spring,
        );
        let tangential = T::select(unknown, zero, spring);
        Yielding {
            diagonal: [diagonal, along, along],
            shift: [
                approach,
                -tangential * friction[0],
                -tangential * friction[1],
            ],
            gap: known,
            unexplained: gap - known,
            stiffness,
            spring,
            tangential,
            friction,
            load: force * h,
            start,
        }
    }
}

impl<T: Lane> Yielding<T> {
    /// Law of a rigid contact; `zero`: 0 in every lane.
    #[must_use]
    pub fn none(zero: T) -> Self {
        Self {
            diagonal: [zero; 3],
            shift: [zero; 3],
            gap: zero,
            unexplained: zero,
            stiffness: zero,
            spring: zero,
            tangential: zero,
            friction: [zero; 2],
            load: zero,
            start: zero,
        }
    }

    /// Where the contact yields.
    #[inline(always)]
    #[must_use]
    pub fn is_soft(&self) -> T::Mask {
        self.stiffness.like(0.0).lt(self.stiffness)
    }

    /// The law where the mask is true, that of a rigid contact elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn only(&self, here: T::Mask) -> Self {
        let only = |x: T| T::select(here, x, x.like(0.0));
        Self {
            diagonal: self.diagonal.map(only),
            shift: self.shift.map(only),
            gap: only(self.gap),
            unexplained: only(self.unexplained),
            stiffness: only(self.stiffness),
            spring: only(self.spring),
            tangential: only(self.tangential),
            friction: self.friction.map(only),
            load: only(self.load),
            start: only(self.start),
        }
    }

    /// What the problem's velocity has more than the contact's at the impulse `p`, m/s.
    #[inline(always)]
    #[must_use]
    pub fn yielded(&self, p: [T; 3]) -> [T; 3] {
        [0, 1, 2].map(|k| self.shift[k] + self.diagonal[k] * p[k])
    }

    /// Work of the tangential impulse of `p` that neither moves the machine nor is stored, J,
    /// negative: slip, and the deflection that leaves the contact with the tread. `u`: velocities
    /// after the step.
    #[inline(always)]
    #[must_use]
    pub fn slip_work(&self, u: [T; 3], p: [T; 3]) -> T {
        let more = self.yielded(p);
        let slip = p[1] * (u[1] + more[1]) + p[2] * (u[2] + more[2]);
        slip - (self.diagonal[1] - self.tangential) * (p[1] * p[1] + p[2] * p[2])
    }

    /// What the springs hold over a step of `h` with the scheme's θ. `u`: velocities before and
    /// after; `p`: impulse, N s.
    ///
    /// The energy at the start is a function of the pose that the law begins with. The law's own
    /// deflection at the end leads the pose by `(1 − θ) h u⁺`, and the springs may hold what either
    /// says. The deflection along the surface is that of `p_T`, or where it grows evenly over the
    /// step that of `θ p_T + (1 − θ) p_T⁻`. A contact without a force holds nothing. Where the last
    /// step is not known, the force along the surface was the same part of the load.
    #[inline(always)]
    #[must_use]
    pub fn held(&self, (h, theta): (T, T), u: [[T; 3]; 2], p: [T; 3]) -> SpringEnergy<T> {
        let (zero, half) = (h.like(0.0), h.like(0.5));
        let is_known = zero.lt(self.tangential);
        let moved = h * u[1][0];
        let deepest = (-(self.gap + moved))
            .max(-(self.gap + theta * moved))
            .max(zero);
        let mut before = self.stiffness * self.start * self.start;
        let mut most = self.stiffness * deepest * deepest;
        let share = (self.load / p[0].max(h.like(f64::MIN_POSITIVE))).min(h.like(1.0));
        for (last, force) in self.friction.iter().zip([p[1], p[2]]) {
            let last = T::select(is_known, *last, share * force);
            let after = last + theta * (force - last);
            before += self.spring * last * last;
            most += self.spring * (after * after).max(force * force);
        }
        let work = |k: usize| p[k] * (u[0][k] + u[1][k]);
        let work = half * ((work(0) + work(1)) + work(2));
        SpringEnergy {
            before: half * before,
            most: T::select(zero.lt(p[0]), half * most, zero),
            given: work - self.slip_work(u[1], p),
        }
    }

    /// The impulse `p` of a step of `h`, at most that of a `share` of the deflection at its start.
    #[must_use]
    pub fn relaxed(&self, h: T, share: T, p: [T; 3]) -> [T; 3] {
        let zero = h.like(0.0);
        let pressed = h * self.stiffness * (-self.gap).max(zero);
        [share * p[0].min(pressed), share * p[1], share * p[2]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TREAD: Tread = Tread {
        stiffness: 2e5,
        damping: 900.0,
        tangential_ratio: 0.7,
        relaxation_length: 0.012,
        radius: 0.1,
    };

    /// Law of a contact at rest on its spring, with a tangential impulse before.
    fn law(travel: f64, h: f64, before: [f64; 2]) -> Yielding {
        let load = 50.0;
        let gap = -load / TREAD.stiffness;
        let before = [load * h, before[0], before[1]];
        TREAD
            .rolling([travel, 0.0])
            .over((h, 0.5), gap, 0.0, before, (false, 0.0))
    }

    /// The tangential impulse that lets nothing slip at a velocity `u`.
    fn sticking(law: &Yielding, u: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| -(u[k] + law.shift[k + 1]) / law.diagonal[k + 1])
    }

    #[test]
    fn a_rolling_wheel_comes_to_its_cornering_stiffness_at_every_step() {
        let (travel, u) = (0.8, [1e-3, -2e-3]);
        for h in [1e-4, 1e-3, 5e-3, 2e-2] {
            let mut p = [0.0; 2];
            for _ in 0..5000 {
                p = sticking(&law(travel, h, p), u);
            }
            let stiffness = TREAD.stiffness * TREAD.tangential_ratio * TREAD.relaxation_length;
            for k in 0..2 {
                let expected = -stiffness * u[k] / travel;
                assert!((p[k] / h / expected - 1.0).abs() < 1e-9, "{h}: {p:?}");
            }
        }
    }

    #[test]
    fn the_deflection_fades_over_the_relaxation_length() {
        // 2400 steps are a way of the relaxation length.
        let (travel, h) = (0.5, 1e-5);
        let mut p = [1e-4, 0.0];
        let start = p[0];
        for _ in 0..2400 {
            p = sticking(&law(travel, h, p), [0.0; 2]);
        }
        assert!((p[0] / start - (-1.0_f64).exp()).abs() < 1e-3);
    }

    #[test]
    fn a_parked_wheel_keeps_its_force_and_does_not_creep() {
        let before = [0.03, -0.01];
        let law = law(0.0, 5e-3, before);
        let slip = law.yielded([0.25, before[0], before[1]]);
        assert!(slip[1].abs() < 1e-16 && slip[2].abs() < 1e-16, "{slip:?}");
    }

    #[test]
    fn without_a_last_step_a_wheel_is_in_steady_rolling() {
        let (travel, h, u) = (0.8, 5e-3, [1e-3, 0.0]);
        let spring = TREAD.rolling([travel, 0.0]);
        let law = spring.over((h, 0.5), -2e-4, 0.0, [0.0; 3], (true, 1.0));
        let stiffness = TREAD.stiffness * TREAD.tangential_ratio * TREAD.relaxation_length;
        let p = sticking(&law, u);
        assert!((p[0] / h / (-stiffness * u[0] / travel) - 1.0).abs() < 0.05);
    }

    #[test]
    fn two_equal_sides_yield_twice_as_much() {
        let own: Compliance = TREAD.rolling([0.3, 0.0]);
        let both = Compliance::in_series(Some(own), Some(own)).unwrap();
        assert!((both.stiffness / own.stiffness - 0.5).abs() < 1e-15);
        assert!((both.tangential / own.tangential - 0.5).abs() < 1e-15);
        assert!((both.damping / own.damping - 0.5).abs() < 1e-15);
        assert!((both.fading / own.fading - 1.0).abs() < 1e-15);
        assert_eq!(Compliance::in_series(Some(own), None), Some(own));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

        /// The contact took more from the machine than it stored, and what left with the tread was
        /// neither stored nor booked.
        #[test]
        fn what_the_contact_takes_is_stored_or_booked_and_never_created(
            before in prop::array::uniform2(-0.1..0.1f64),
            u in prop::array::uniform2(-0.1..0.1f64),
            travel in 0.0..3.0f64,
            h in 1e-4..0.02f64,
        ) {
            let law = law(travel, h, before);
            let [t, b] = sticking(&law, u);
            let p = [0.0, t, b];
            let taken = -(t * u[0] + b * u[1]);
            let spring = 1.0 / (h * h * TREAD.tangential_ratio * TREAD.stiffness);
            let energy = |p: [f64; 2]| 0.5 * spring * (p[0] * p[0] + p[1] * p[1]);
            let stored = energy([t, b]) - energy(before);
            let booked = -law.slip_work([0.0, u[0], u[1]], p);
            let size = taken.abs() + stored.abs() + booked.abs();
            prop_assert!(booked >= -1e-12 * size);
            // The rest is what the implicit step takes.
            prop_assert!(taken - stored - booked >= -1e-9 * size);
        }
    }
}
