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
//! Along the surface the contact yields by the same k and d to changes of friction, and what slips
//! is the rest: Coulomb's law holds between p_T and `u_T + (p_T − p_T⁻) / (h (h k + d))`, with the
//! impulse p_T⁻ of the step before. In steady rolling and at rest the two impulses are equal, so
//! nothing creeps. The term is the same as that along the normal: W has a positive diagonal, and a
//! machine on more contacts than it needs has one set of loads.
//!
//! Source: Anitescu and Potra 2002, *A time-stepping method for stiff multibody dynamics with
//! contact and friction*, IJNME 55, 753–784.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::scalar::Lane;

/// Spring and damper of a contact, the same along the normal and along the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance<T = f64> {
    /// k, N/m.
    pub stiffness: T,
    /// d, N s/m.
    pub damping: T,
}

/// Law of one contact over a step: Coulomb's law between impulse p and `u + diagonal p + shift`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Yielding<T = f64> {
    /// Term on the diagonal of W, 1/kg; 0 for a rigid contact.
    pub diagonal: T,
    /// Shift of the free velocity along n, t, b, m/s.
    pub shift: [T; 3],
    /// Gap that the law knows, m.
    pub gap: T,
    /// Penetration that no elastic force explains, m, as a negative gap.
    pub unexplained: T,
    /// k, N/m.
    stiffness: T,
    /// Tangential impulse at the start, N s.
    friction: [T; 2],
}

/// Deflection that counts as elastic whatever the forces, m.
const SLACK: f64 = 1e-6;

impl Compliance {
    /// Of two sides in series, of which a rigid one is `None`.
    #[must_use]
    pub fn in_series(first: Option<Self>, second: Option<Self>) -> Option<Self> {
        match (first, second) {
            (Some(a), Some(b)) => {
                let share = b.stiffness / (a.stiffness + b.stiffness);
                Some(Self {
                    stiffness: a.stiffness * share,
                    // Both deflect in proportion to their springs.
                    damping: a.damping * share * share + b.damping * (1.0 - share) * (1.0 - share),
                })
            }
            (one, other) => one.or(other),
        }
    }
}

impl<T: Lane> Compliance<T> {
    /// The law over a step of `h`, s, with the scheme's `theta`.
    ///
    /// - `gap`, `u_N`: gap (m) and normal velocity (m/s) at the pose that the step reaches without
    ///   impulses. The law begins with the gap less θ h u_N: a stiff contact then comes to rest
    ///   within a step.
    /// - `before`: impulse of the last step, N s, in the contact's frame. Where none is remembered
    ///   it is the machine's weight times h along the normal.
    ///
    /// A body that strikes a stiff contact penetrates it within the step by more than any spring
    /// would allow. That part is not elastic and is not given back: it is `unexplained`, and
    /// position projection removes it. A deflection that the impulse before explains is elastic.
    #[inline(always)]
    #[must_use]
    pub fn over(&self, (h, theta): (T, T), gap: T, u_N: T, before: [T; 3]) -> Yielding<T> {
        let Self { stiffness, damping } = *self;
        let (zero, one) = (h.like(0.0), h.like(1.0));
        let moved = h * u_N;
        let deflection = (moved - gap).max(zero);
        let gap = gap - theta * moved;
        // The damper bore a part of the force while the deflection grew.
        let force = before[0] / h;
        let by_force = (force + damping * u_N).max(zero).min(force) / stiffness;
        let elastic = (h.like(2.0) * deflection).min(by_force);
        let known = gap.max(-(elastic + h.like(SLACK)));
        let weight = h * stiffness + damping;
        let diagonal = one / (h * weight);
        // The damper acts on the deflection, which begins when the gap is closed.
        let approach = T::select(zero.lt(known), known / h, known * stiffness / weight);
        // Of an impact's friction only what the deflection holds is elastic.
        let held = (deflection / by_force.max(h.like(f64::MIN_POSITIVE))).min(one);
        let friction = [held * before[1], held * before[2]];
        Yielding {
            diagonal,
            shift: [approach, -diagonal * friction[0], -diagonal * friction[1]],
            gap: known,
            unexplained: gap - known,
            stiffness,
            friction,
        }
    }
}

impl<T: Lane> Yielding<T> {
    /// That of a rigid contact; `zero`: 0 in every lane.
    #[must_use]
    pub fn none(zero: T) -> Self {
        Self {
            diagonal: zero,
            shift: [zero; 3],
            gap: zero,
            unexplained: zero,
            stiffness: zero,
            friction: [zero; 2],
        }
    }

    /// The law where the mask is true, that of a rigid contact elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn only(&self, here: T::Mask) -> Self {
        let only = |x: T| T::select(here, x, x.like(0.0));
        Self {
            diagonal: only(self.diagonal),
            shift: self.shift.map(only),
            gap: only(self.gap),
            unexplained: only(self.unexplained),
            stiffness: only(self.stiffness),
            friction: self.friction.map(only),
        }
    }

    /// Energy that a step of `h` may gain by the contact, J. `u_N`: normal velocities before and
    /// after; `p`: impulse.
    ///
    /// It is what the springs give off, negative where they store energy. The normal force is that
    /// at the end of the step and acts over all of it: where it does more work, `p_N (u_N + u_N⁺) /
    /// 2`, that counts.
    #[inline(always)]
    #[must_use]
    pub fn supplied(&self, h: T, u_N: [T; 2], p: [T; 3]) -> T {
        let (zero, half) = (h.like(0.0), h.like(0.5));
        let before = self.gap.min(zero);
        let after = (self.gap + h * u_N[1]).min(zero);
        let released = half * self.stiffness * (before * before - after * after);
        let work = half * p[0] * (u_N[0] + u_N[1]);
        let [t, b] = self.friction;
        let sheared = (t * t + b * b) - (p[1] * p[1] + p[2] * p[2]);
        released.max(work) + half * self.diagonal * sheared
    }
}
