//! The mode of a contact, open, stick or slip, and the law linearised in it.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::cone::tangential_norm;
use crate::scalar::Lane;

/// Impulses below the limit of friction by less than this share slide.
const AT_THE_LIMIT: f64 = 1e-9;

/// The three states of a contact with friction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactMode {
    /// No impulse, `p = 0` and `u_N ≥ 0`.
    Open,
    /// No velocity, `u = 0` and `|p_T| ≤ μ p_N`.
    Stick,
    /// `u_N = 0` and `p_T = −μ p_N u_T/|u_T|`.
    Slip,
}

/// The law of one contact linearised in a mode, for one problem or several side by side.
///
/// The impulse is `p = C y`, and the equations are the rows `Bᵀ` of `u + γ y = 0`:
///
/// ```text
///          C                      B                  γ
/// open     -                      0 0 0              1 1 1
/// stick    1 0 0                  1 0 0              0 0 0
///          0 1 0                  0 1 0
///          0 0 1                  0 0 1
/// slide    1    0    -            1 0    0           0 γ 1
///          μ e1 −e2  -            0 −e2  0
///          μ e2 e1   -            0 e1   0
/// ```
///
/// A column marked `-` may be anything, since its unknown is zero. A slide has the direction e of
/// its tangential impulse and the velocity `u_T = −γ p_T` against it, with γ = `|u_T|/|p_T|` at a
/// solution. Without friction or tangential impulse it has no direction, and e is zero. In the
/// plane e2 is zero.
#[derive(Clone, Copy, Debug)]
pub struct Mode<T: Lane> {
    /// `μ e`, zero unless sliding.
    pub a: [T; 2],
    /// `(−e2, e1)`; (1, 0) if sticking, zero if open.
    pub b: [T; 2],
    /// Lanes where the contact is closed.
    pub closed: T::Mask,
    /// Lanes where the contact sticks.
    pub stick: T::Mask,
    /// Turning stiffness γ of the second equation, 1/kg; 1 where `b` is zero.
    pub gamma: T,
}

/// Lanes where a contact is closed, and where it sticks, as its impulse shows by itself.
///
/// Closed contacts stick within the cone and slide on it; a contact without impulse sticks if it
/// approaches. `p_N` and `size`: normal and tangential impulse, N s; `u_N`: normal velocity, m/s.
#[inline(always)]
#[must_use]
pub fn recall<T: Lane>(mu: T, p_N: T, size: T, u_N: T) -> [T::Mask; 2] {
    let zero = mu.like(0.0);
    let (pressed, approaches) = (zero.lt(p_N), u_N.lt(zero));
    let inside = zero.lt(mu) & size.lt(mu * p_N * zero.like(1.0 - AT_THE_LIMIT));
    [
        pressed | approaches,
        (pressed & inside) | (!pressed & approaches),
    ]
}

impl<T: Lane> Mode<T> {
    /// An open contact in every lane.
    #[inline(always)]
    #[must_use]
    pub fn open(like: T) -> Self {
        let zero = like.like(0.0);
        let none = zero.lt(zero);
        Self::with(zero, [none; 3], [zero; 2], zero)
    }

    /// Open, sticking or sliding along the present impulse `p`, N s, with the velocity `u`, m/s.
    #[inline(always)]
    #[must_use]
    pub fn of(mu: T, closed: T::Mask, sticks: T::Mask, p: &[T; 3], u: &[T; 3]) -> Self {
        let zero = mu.like(0.0);
        let norm = (p[1] * p[1] + p[2] * p[2]).sqrt();
        let inverse = zero.like(1.0) / norm;
        let along = p[1] * u[1] + p[2] * u[2];
        let gamma = (-(along * inverse) * inverse).max(zero);
        let slides = closed & !sticks & zero.lt(mu) & zero.lt(norm);
        let e = [p[1] * inverse, p[2] * inverse];
        Self::with(mu, [closed, closed & sticks, slides], e, gamma)
    }

    /// The equations of contacts that are closed, that stick, and that slide along `e` with the
    /// turning stiffness `gamma`, 1/kg, in the lanes of three masks.
    #[inline(always)]
    fn with(mu: T, [closed, stick, slides]: [T::Mask; 3], e: [T; 2], gamma: T) -> Self {
        let (zero, one) = (mu.like(0.0), mu.like(1.0));
        let e = [T::select(slides, e[0], zero), T::select(slides, e[1], zero)];
        Self {
            a: [mu * e[0], mu * e[1]],
            b: [T::select(stick, one, -e[1]), e[0]],
            closed,
            stick,
            gamma: T::select(slides, gamma, T::select(stick, zero, one)),
        }
    }

    /// `Bᵀ x` of a contact.
    #[inline(always)]
    #[must_use]
    pub fn across(&self, x: [T; 3]) -> [T; 3] {
        let zero = x[0].like(0.0);
        [
            T::select(self.closed, x[0], zero),
            self.b[0] * x[1] + self.b[1] * x[2],
            T::select(self.stick, x[2], zero),
        ]
    }

    /// `C y` of a contact.
    #[inline(always)]
    #[must_use]
    pub fn impulse(&self, [y0, y1, y2]: [T; 3]) -> [T; 3] {
        let Self { a, b, .. } = self;
        [y0, a[0] * y0 + b[0] * y1, a[1] * y0 + b[1] * y1 + y2]
    }
}

impl Mode<f64> {
    /// Open, sticking, or sliding without a direction.
    #[inline]
    #[must_use]
    pub fn new(kind: ContactMode) -> Self {
        let (closed, sticks) = (kind != ContactMode::Open, kind == ContactMode::Stick);
        Self::with(0.0, [closed, sticks, false], [0.0; 2], 0.0)
    }

    /// A slide whose tangential impulse has the direction of that of `z`, which is of size `norm`.
    /// Contact vectors are `[normal, tangent, (tangent)]`; `gamma`: turning stiffness, 1/kg.
    #[inline]
    #[must_use]
    pub fn along<const D: usize>(mu: f64, z: &[f64; D], norm: f64, gamma: f64) -> Self {
        let slides = mu > 0.0 && norm > 0.0;
        let second = if D == 2 { 0.0 } else { z[D - 1] };
        let e = [z[1] / norm, second / norm];
        Self::with(mu, [true, false, slides], e, gamma)
    }

    /// A slide at impulse `p`, N s, and velocity `u`, m/s.
    #[inline]
    #[must_use]
    pub fn sliding<const D: usize>(mu: f64, p: &[f64; D], u: &[f64; D]) -> Self {
        let norm = tangential_norm(p);
        let along: f64 = p[1..].iter().zip(&u[1..]).map(|(p, u)| p * u).sum();
        Self::along(mu, p, norm, (-along / (norm * norm)).max(0.0))
    }

    /// The mode without its equations.
    #[inline]
    #[must_use]
    pub fn kind(&self) -> ContactMode {
        match (self.closed, self.stick) {
            (false, _) => ContactMode::Open,
            (true, true) => ContactMode::Stick,
            (true, false) => ContactMode::Slip,
        }
    }

    /// Direction e of the tangential impulse of a slide, zero if it has none.
    #[inline]
    #[must_use]
    pub fn direction(&self) -> [f64; 2] {
        [self.b[1], -self.b[0]]
    }
}
