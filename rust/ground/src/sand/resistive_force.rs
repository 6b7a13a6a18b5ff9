//! Three-dimensional resistive force theory of dry sand, with sand that flows.
//!
//! A small piece of a surface that moves through sand at the depth z feels a stress that grows
//! linearly with the depth, `σ = ξ z α(n, v̂)`, with the outward unit normal n of the piece and the
//! direction v̂ of its motion. With the direction g of gravity,
//!
//! ```text
//! α = f₁ n + f₂ v̂ + f₃ g,    f_k a cubic in (v̂·g, n·g, n·v̂)
//! ξ = ρ |g| (894 μ³ − 386 μ² + 89 μ)
//! ```
//!
//! The part of α along the surface is limited to μ_s times its part along n. ρ is the density of
//! the sand, and μ the tangent of its angle of repose. The cubics are generic: they are not fitted
//! to any wheel.
//!
//! Four changes are fitted to measurements of one wheel (`docs/sand.md`):
//!
//! - *Sand does not follow a surface that slides past.* The motion along the surface enters v̂ with
//!   at most k times the motion along n.
//! - *Sand dilates.* Sliding counts as motion along n, `x_n + ψ |x_t|`.
//! - *Sand leaves a surface that recedes.* The stress is multiplied by
//!   `min(1, max(0, b + x_n / (w |x|)))`.
//! - *Sand that flows lifts less.* A stress that points up is multiplied by
//!   `1 − η (n·g) (1 − |v̂·g|)²` on a piece that faces down.
//!
//! This page takes the displacement x of the piece relative to the sand in place of its velocity,
//! in units of the length over which sand forgets ([`super::memory`]). In steady motion both have
//! the same direction. A small displacement mobilises only the part `|x| / √(|x|² + s²)` of the
//! stress, so the force is continuous where the velocity is zero.
//!
//! Source: Agarwal, Goldman and Kamrin 2023, with the coefficients of table S3.

use friction_contact::scalar::{Lane, LaneMask, Vec3};

/// Coefficients of f₁, f₂, f₃ over 1, a, b, c, a², b², c², ab, bc, ca, a³, b³, c³, ab², ba², bc²,
/// cb², ca², ac² and abc, with `a = v̂·g`, `b = n·g` and `c = n·v̂`.
const CUBICS: [[f64; 20]; 3] = [
    [
        0.00212, -0.02320, -0.20890, -0.43083, -0.00259, 0.48872, -0.00415, 0.07204, -0.02750,
        -0.08772, 0.01992, -0.45961, 0.40799, -0.10107, -0.06576, 0.05664, -0.09269, 0.01892,
        0.01033, 0.15120,
    ],
    [
        -0.06796, -0.10941, 0.04725, -0.06914, -0.05835, -0.65880, -0.11985, -0.25739, -0.26834,
        0.02692, -0.00736, 0.63758, 0.08997, 0.21069, 0.04748, 0.20406, 0.18519, 0.04934, 0.13527,
        -0.33207,
    ],
    [
        -0.02634, -0.03436, 0.45256, 0.00835, 0.02553, -1.31290, -0.05532, 0.06790, -0.16404,
        0.02287, 0.02927, 0.95406, -0.00131, -0.11028, 0.01487, -0.20770, 0.10911, -0.04097,
        0.07881, -0.27519,
    ],
];

/// How sand meets one kind of surface: bare metal, or sand held between grousers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interface {
    /// μ_s, largest ratio of the stress along the surface to that along its normal.
    pub friction: f64,
    /// k, largest ratio of the motion along the surface to that along its normal.
    pub follow: f64,
}

impl Interface {
    /// A surface of which the share `x` is `other`.
    #[must_use]
    pub fn mixed(&self, other: &Self, x: f64) -> Self {
        Self {
            friction: (1.0 - x) * self.friction + x * other.friction,
            follow: (1.0 - x) * self.follow + x * other.follow,
        }
    }
}

/// Properties of the sand that the law uses, beyond ξ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// ψ, dilatancy.
    pub dilatancy: f64,
    /// b, part of the stress on a surface that only slides.
    pub grip: f64,
    /// w, width of the change from a surface that recedes to one that pushes.
    pub width: f64,
    /// η, part of the lift that flowing sand loses.
    pub fluidity: f64,
    /// s, displacement that mobilises the stress.
    pub mobilisation: f64,
}

/// Stress on a piece of a surface per unit of ξ z, and its derivative by the displacement.
#[derive(Clone, Copy, Debug)]
pub struct Traction<T> {
    /// α.
    pub alpha: Vec3<T>,
    /// `∂α/∂x`, by columns; zero if it is not wanted.
    pub slope: [Vec3<T>; 3],
}

/// Length below which a vector has no direction.
const TINY: f64 = 1e-12;

/// Motion along the normal, relative to all motion, below which a surface slides only.
const SLIDES: f64 = 1e-9;

/// The law for pieces with outward unit normals `n` that were displaced by `x`; `g`: unit vector
/// into the sand, against the normal of its surface.
#[inline(always)]
#[must_use]
pub fn traction<T: Lane>(
    n: Vec3<T>,
    x: Vec3<T>,
    g: Vec3<T>,
    (surface, flow): (&Interface, &Flow),
    wants_slope: bool,
) -> Traction<T> {
    let token = n.x.token();
    let zero = T::splat(token, 0.0);
    let nothing = Vec3::new(zero, zero, zero);
    let mut found = Traction {
        alpha: nothing,
        slope: [nothing; 3],
    };
    let share = Share::of(n, x, flow);
    if !share.is_felt.any() {
        return found;
    }
    let seen = Seen::of(n, x, share.size, (surface, flow));
    let flowing = Flowing::of(n, seen.direction, g, (surface, flow));
    let alpha = flowing.alpha;
    found.alpha = Vec3::select(share.is_felt, alpha * share.value, nothing);
    if wants_slope {
        // The direction has two ways to turn: in the plane of n and x, and out of it.
        let inward = flowing.changed(seen.turn);
        let outward = flowing.changed(seen.side) * share.value;
        let by_inward = seen.by_inward * share.value;
        let by_outward = seen.side * seen.by_outward;
        let columns = [
            [by_inward.x, by_outward.x, share.slope.x],
            [by_inward.y, by_outward.y, share.slope.y],
            [by_inward.z, by_outward.z, share.slope.z],
        ];
        for (column, [turn, side, size]) in found.slope.iter_mut().zip(columns) {
            let slope = inward * turn + outward * side + alpha * size;
            *column = Vec3::select(share.is_felt, slope, nothing);
        }
    }
    found
}

/// The part of the stress that a displacement mobilises on a surface that may recede.
struct Share<T: Lane> {
    value: T,
    /// By the displacement.
    slope: Vec3<T>,
    /// |x|, not zero.
    size: T,
    is_felt: T::Mask,
}

impl<T: Lane> Share<T> {
    #[inline(always)]
    fn of(n: Vec3<T>, x: Vec3<T>, flow: &Flow) -> Self {
        let number = |value: f64| n.x.like(value);
        let (zero, one) = (number(0.0), number(1.0));
        let square = x.dot(x);
        let length = square.sqrt();
        let size = length.max(number(TINY));
        let per_size = one / size;
        let along = x * per_size;
        let rho = along.dot(n);
        let gate = number(flow.grip) + rho * number(1.0 / flow.width);
        let rest = number(flow.mobilisation * flow.mobilisation);
        let per_root = one / (square + rest).sqrt();
        let mobilised = size * per_root;
        let by_size = rest * per_root * per_root * per_root;
        let is_partial = gate.lt(one);
        let limited = T::select(is_partial, gate, one);
        let by_gate = mobilised * per_size * number(1.0 / flow.width);
        let by_gate = T::select(is_partial, by_gate, zero);
        Self {
            value: mobilised * limited,
            slope: along * (by_size * limited) + (n - along * rho) * by_gate,
            size,
            is_felt: gate.gt(zero) & length.ge(number(TINY)),
        }
    }
}

/// The direction that sand sees of a displacement: that along the surface counts at most k times
/// that along the normal. Of a surface that recedes it is the limit of one that slides.
struct Seen<T> {
    direction: Vec3<T>,
    /// Unit vectors to which the direction turns: in the plane of n and x, and out of it.
    turn: Vec3<T>,
    side: Vec3<T>,
    /// Derivatives of the angles by the displacement: a vector, and a factor of `side`.
    by_inward: Vec3<T>,
    by_outward: T,
}

impl<T: Lane> Seen<T> {
    /// ```text
    /// v̂ = (p n + s x_t)/√(p² + s² t²),    p = x_n + ψ t,    s = k p/√(k² p² + t²),    t = |x_t|
    /// ```
    #[inline(always)]
    fn of(n: Vec3<T>, x: Vec3<T>, size: T, (surface, flow): (&Interface, &Flow)) -> Self {
        let number = |value: f64| n.x.like(value);
        let (zero, one, k) = (number(0.0), number(1.0), number(surface.follow));
        let psi = number(flow.dilatancy);
        let x_n = x.dot(n);
        let x_t = x - n * x_n;
        let t = x_t.norm();
        let mut along = x_t * (one / t.max(number(TINY)));
        let has_no_side = t.lt(number(TINY));
        if has_no_side.any() {
            along = Vec3::select(has_no_side, perpendicular(n), along);
        }
        let (p, least) = (x_n + psi * t, size * number(SLIDES));
        let is_ahead = p.gt(least);
        let p = T::select(is_ahead, p, least);
        let kp = k * p;
        let per_q = one / (kp * kp + t * t).sqrt();
        let share = kp * per_q;
        let counted = share * t;
        let per_size = one / (p * p + counted * counted).sqrt();
        let [d_n, d_t] = [p * per_size, counted * per_size];
        // Changes of p and of s t with x_n and with t.
        let by_share = k * per_q * per_q * per_q * t;
        let p_by_n = T::select(is_ahead, one, zero);
        let p_by_t = T::select(is_ahead & t.ge(number(TINY)), psi, zero);
        let counted_by_p = by_share * t * t;
        let by_n = (d_n * counted_by_p - d_t) * p_by_n;
        let by_t = d_n * (share + counted_by_p * p_by_t - by_share * p * t) - d_t * p_by_t;
        Self {
            direction: n * d_n + along * d_t,
            turn: along * d_n - n * d_t,
            side: n.cross(along),
            by_inward: (n * by_n + along * by_t) * per_size,
            by_outward: share * per_size,
        }
    }
}

/// A unit vector perpendicular to another one.
#[inline(always)]
fn perpendicular<T: Lane>(n: Vec3<T>) -> Vec3<T> {
    let token = n.x.token();
    let z = Vec3::splat(token, [0.0, 0.0, 1.0]);
    let x = Vec3::splat(token, [1.0, 0.0, 0.0]);
    let other = Vec3::select(n.z.abs().lt(n.x.like(0.7)), z, x);
    let across = n.cross(other);
    across * (n.x.like(1.0) / across.norm())
}

/// α of a motion along a unit vector.
struct Flowing<T: Lane> {
    alpha: Vec3<T>,
    n: Vec3<T>,
    v: Vec3<T>,
    g: Vec3<T>,
    /// The three cubics, by a and by c.
    values: [T; 3],
    by_a: [T; 3],
    by_c: [T; 3],
    /// The stress along the surface is limited: its direction, μ with the sign of the normal
    /// stress, and the part of it that is left.
    is_limited: T::Mask,
    along: Vec3<T>,
    signed_mu: T,
    left: T,
    /// Part of the lift that is lost, and its derivative by a; none where there is no lift.
    lift: T,
    lost: T,
    lost_by_a: T,
}

impl<T: Lane> Flowing<T> {
    #[inline(always)]
    fn of(n: Vec3<T>, v: Vec3<T>, g: Vec3<T>, (surface, flow): (&Interface, &Flow)) -> Self {
        let number = |value: f64| n.x.like(value);
        let (zero, one, tiny) = (number(0.0), number(1.0), number(TINY));
        let (a, b, c) = (v.dot(g), n.dot(g), n.dot(v));
        let cubics = CUBICS.each_ref().map(|cubic| evaluated(cubic, a, b, c));
        let alpha = n * cubics[0][0] + v * cubics[1][0] + g * cubics[2][0];
        let normal = alpha.dot(n);
        let tangential = alpha - n * normal;
        let size = tangential.norm();
        let mu = number(surface.friction);
        let most = mu * normal.abs();
        let is_limited = size.gt(most) & size.ge(tiny);
        let per_size = one / size.max(tiny);
        let along = tangential * per_size;
        let alpha = Vec3::select(is_limited, n * normal + along * most, alpha);
        let lift = -alpha.dot(g);
        let is_lifting = lift.gt(zero) & b.gt(zero);
        let still = one - a.abs().min(one);
        let by_still = number(flow.fluidity) * b * still;
        let by_a = T::select(a.lt(zero), by_still, -by_still) * number(2.0);
        let lost = T::select(is_lifting, by_still * still, zero);
        Self {
            alpha: alpha + g * (lift * lost),
            n,
            v,
            g,
            values: cubics.map(|cubic| cubic[0]),
            by_a: cubics.map(|cubic| cubic[1]),
            by_c: cubics.map(|cubic| cubic[2]),
            is_limited,
            along,
            signed_mu: T::select(normal.lt(zero), -mu, mu),
            left: most * per_size,
            lift,
            lost,
            lost_by_a: T::select(is_lifting, by_a, zero),
        }
    }

    /// Change of α with the direction.
    #[inline(always)]
    fn changed(&self, change: Vec3<T>) -> Vec3<T> {
        let (n, g) = (self.n, self.g);
        let (a, c) = (g.dot(change), n.dot(change));
        let of = |k: usize| self.by_a[k] * a + self.by_c[k] * c;
        let free = n * of(0) + self.v * of(1) + change * self.values[1] + g * of(2);
        let normal = n.dot(free);
        let tangential = free - n * normal;
        let turned = tangential - self.along * self.along.dot(tangential);
        let limited = (n + self.along * self.signed_mu) * normal + turned * self.left;
        let alpha = Vec3::select(self.is_limited, limited, free);
        alpha + g * (self.lift * self.lost_by_a * a - g.dot(alpha) * self.lost)
    }
}

/// A cubic, and its derivatives by a and c.
#[inline(always)]
fn evaluated<T: Lane>(k: &[f64; 20], a: T, b: T, c: T) -> [T; 3] {
    let number = |i: usize| a.like(k[i]);
    let (two, three) = (a.like(2.0), a.like(3.0));
    // f = p + a (q + a (r + a k₁₀)), with p, q and r in c and b
    let p = [
        number(0) + b * (number(2) + b * (number(5) + b * number(11))),
        number(3) + b * (number(8) + b * number(16)),
        number(6) + b * number(15),
    ];
    let q = [
        number(1) + b * (number(7) + b * number(13)),
        number(9) + b * number(19),
    ];
    let q_at = q[0] + c * (q[1] + c * number(18));
    let r = number(4) + b * number(14) + c * number(17);
    let at =
        p[0] + c * (p[1] + c * (p[2] + c * number(12))) + a * (q_at + a * (r + a * number(10)));
    let by_a = q_at + a * (two * r + a * (three * number(10)));
    let by_c = p[1]
        + c * (two * p[2] + c * (three * number(12)))
        + a * (q[1] + c * (two * number(18)) + a * number(17));
    [at, by_a, by_c]
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    const FLOW: Flow = Flow {
        dilatancy: 0.02,
        grip: 0.2,
        width: 0.05,
        fluidity: 0.7,
        mobilisation: 0.05,
    };
    const METAL: Interface = Interface {
        friction: 0.6,
        follow: 7.0,
    };

    fn unit(x: f64, y: f64, z: f64) -> Vector3<f64> {
        Vector3::new(x, y, z).normalize()
    }

    fn law(n: &Vector3<f64>, x: &Vector3<f64>, g: &Vector3<f64>) -> [Vector3<f64>; 4] {
        let found = traction::<f64>((*n).into(), (*x).into(), (*g).into(), (&METAL, &FLOW), true);
        let [a, b, c] = found.slope.map(Vector3::from);
        [found.alpha.into(), a, b, c]
    }

    /// On a level plate that is pressed straight down, all three cubics act along the vertical, and
    /// `α = −(f₁ + f₂ + f₃)` at (1, 1, 1).
    #[test]
    fn a_plate_is_pressed_up_by_the_sum_of_the_coefficients() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        let sum: f64 = CUBICS.iter().flatten().sum();
        let found = law(&down, &(down * 1e3), &down)[0];
        assert!((found - down * sum).norm() < 1e-8, "{found}");
        assert!(sum < -0.9 && sum > -1.3, "{sum}");
    }

    #[test]
    fn the_slope_is_the_derivative_by_finite_differences() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        let normals = [
            unit(0.3, -1.0, 0.1),
            unit(0.1, 0.0, 1.0),
            unit(-0.4, -0.6, 0.2),
        ];
        let places = [
            Vector3::new(0.5, -0.3, 0.2),
            Vector3::new(0.01, -0.02, 0.03),
            Vector3::new(-0.2, -0.4, 0.9),
            Vector3::new(1.0, 0.28, 0.0),
        ];
        let mut n_felt = 0;
        for n in &normals {
            for x in &places {
                let of = |x: &Vector3<f64>| law(n, x, &down);
                let found = of(x);
                n_felt += usize::from(found[0].norm() > 0.0);
                for k in 0..3 {
                    let mut step = Vector3::zeros();
                    step[k] = 1e-7;
                    let change = (of(&(x + step))[0] - of(&(x - step))[0]) / 2e-7;
                    let error = (found[1 + k] - change).norm();
                    assert!(error < 1e-5 * (1.0 + change.norm()), "{n} {x} {k}: {error}");
                }
            }
        }
        assert!(n_felt >= 8, "{n_felt}");
    }

    #[test]
    fn a_surface_that_recedes_feels_nothing_and_a_sliding_one_its_grip() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        let back = law(&down, &Vector3::new(0.5, 0.5, 0.0), &down);
        assert_eq!(back, [Vector3::zeros(); 4]);
        let sliding = law(&down, &Vector3::x(), &down)[0];
        let pushing = law(&down, &unit(1.0, -0.1, 0.0), &down)[0];
        assert!(0.0 < sliding.y && sliding.y < pushing.y);
    }

    #[test]
    fn friction_is_limited_and_the_stress_resists_the_motion() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        for k in 0..60 {
            let turn = 0.1 * f64::from(k);
            let x = Vector3::new(turn.cos(), -turn.sin().abs() - 0.05, (2.0 * turn).sin());
            let found = law(&down, &x, &down)[0];
            assert!(found.dot(&x) <= 0.0, "{x}: {found}");
        }
    }
}
