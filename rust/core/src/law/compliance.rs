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

/// Spring and damper of a contact, the same along the normal and along the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance {
    /// k, N/m.
    pub stiffness: f64,
    /// d, N s/m.
    pub damping: f64,
}

/// Law of one contact over a step: Coulomb's law between impulse p and `u + diagonal p + shift`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Yielding {
    /// Term on the diagonal of W, 1/kg; 0 for a rigid contact.
    pub diagonal: f64,
    /// Shift of the free velocity along n, t, b, m/s.
    pub shift: [f64; 3],
    /// Gap that the law knows, m.
    pub gap: f64,
    /// Penetration that no elastic force explains, m, as a negative gap.
    pub unexplained: f64,
    /// k, N/m.
    stiffness: f64,
    /// Tangential impulse at the start, N s.
    friction: [f64; 2],
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
    #[must_use]
    pub fn over(&self, (h, theta): (f64, f64), gap: f64, u_N: f64, before: [f64; 3]) -> Yielding {
        let Self { stiffness, damping } = *self;
        let moved = h * u_N;
        let deflection = (moved - gap).max(0.0);
        let gap = gap - theta * moved;
        // The damper bore a part of the force while the deflection grew.
        let force = before[0] / h;
        let by_force = (force + damping * u_N).clamp(0.0, force) / stiffness;
        let known = gap.max(-((2.0 * deflection).min(by_force) + SLACK));
        let weight = h * stiffness + damping;
        let diagonal = 1.0 / (h * weight);
        // The damper acts on the deflection, which begins when the gap is closed.
        let approach = if known > 0.0 {
            known / h
        } else {
            known * stiffness / weight
        };
        // Of an impact's friction only what the deflection holds is elastic.
        let held = (deflection / by_force.max(f64::MIN_POSITIVE)).min(1.0);
        let friction = [held * before[1], held * before[2]];
        let [t, b] = friction.map(|p| -diagonal * p);
        Yielding {
            diagonal,
            shift: [approach, t, b],
            gap: known,
            unexplained: gap - known,
            stiffness,
            friction,
        }
    }
}

impl Yielding {
    /// Energy that a step of `h` may gain by the contact, J. `u_N`: normal velocities before and
    /// after; `p`: impulse.
    ///
    /// It is what the springs give off, negative where they store energy. The normal force is that
    /// at the end of the step and acts over all of it: where it does more work, `p_N (u_N + u_N⁺) /
    /// 2`, that counts.
    #[must_use]
    pub fn supplied(&self, h: f64, u_N: [f64; 2], p: [f64; 3]) -> f64 {
        let before = self.gap.min(0.0);
        let after = (self.gap + h * u_N[1]).min(0.0);
        let released = 0.5 * self.stiffness * (before * before - after * after);
        let work = 0.5 * p[0] * (u_N[0] + u_N[1]);
        let [t, b] = self.friction;
        let sheared = (t * t + b * b) - (p[1] * p[1] + p[2] * p[2]);
        released.max(work) + 0.5 * self.diagonal * sheared
    }
}
