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

use nalgebra::{Matrix3, Vector3};

/// Coefficients of f₁, f₂, f₃ over the monomials of [`monomials`].
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

/// Monomials of the cubics in `a = v̂·g`, `b = n·g` and `c = n·v̂`.
fn monomials(a: f64, b: f64, c: f64) -> [f64; 20] {
    [
        1.0,
        a,
        b,
        c,
        a * a,
        b * b,
        c * c,
        a * b,
        b * c,
        c * a,
        a * a * a,
        b * b * b,
        c * c * c,
        a * b * b,
        b * a * a,
        b * c * c,
        c * b * b,
        c * a * a,
        a * c * c,
        a * b * c,
    ]
}

/// Their derivatives by a, and by c.
fn slopes(a: f64, b: f64, c: f64) -> [[f64; 20]; 2] {
    let by_a = [
        0.0,
        1.0,
        0.0,
        0.0,
        2.0 * a,
        0.0,
        0.0,
        b,
        0.0,
        c,
        3.0 * a * a,
        0.0,
        0.0,
        b * b,
        2.0 * a * b,
        0.0,
        0.0,
        2.0 * a * c,
        c * c,
        b * c,
    ];
    let by_c = [
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        0.0,
        2.0 * c,
        0.0,
        b,
        a,
        0.0,
        0.0,
        3.0 * c * c,
        0.0,
        0.0,
        2.0 * b * c,
        b * b,
        a * a,
        2.0 * a * c,
        a * b,
    ];
    [by_a, by_c]
}

fn dot(a: &[f64; 20], b: &[f64; 20]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// How sand meets one kind of surface: bare metal, or sand held between grousers.
#[derive(Clone, Copy, Debug, PartialEq)]
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
#[derive(Clone, Copy, Debug, PartialEq)]
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traction {
    /// α.
    pub alpha: Vector3<f64>,
    /// `∂α/∂x`.
    pub slope: Matrix3<f64>,
}

impl Traction {
    /// None.
    pub const NONE: Self = Self {
        alpha: Vector3::new(0.0, 0.0, 0.0),
        slope: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };
}

/// Length below which a vector has no direction.
const TINY: f64 = 1e-12;

/// The law for a piece with outward unit normal `n` that was displaced by `x`; `g`: unit vector
/// into the sand, against the normal of its surface.
#[must_use]
pub fn traction(
    n: &Vector3<f64>,
    x: &Vector3<f64>,
    g: &Vector3<f64>,
    surface: &Interface,
    flow: &Flow,
) -> Traction {
    let size = x.norm();
    if size < TINY {
        return Traction::NONE;
    }
    let rho = x.dot(n) / size;
    let gate = flow.grip + rho / flow.width;
    if gate <= 0.0 {
        return Traction::NONE;
    }
    let root = (size * size + flow.mobilisation * flow.mobilisation).sqrt();
    let mobilised = size / root;
    let by_size = flow.mobilisation * flow.mobilisation / (root * root * root);
    let along = x / size;
    let (mut share, mut share_slope) = (mobilised, along * by_size);
    if gate < 1.0 {
        share_slope = share_slope * gate + (n - along * rho) * (mobilised / (size * flow.width));
        share *= gate;
    }
    let (direction, turning) = direction(n, x, surface, flow);
    let Traction { alpha, slope } = steady(n, &direction, g, surface, flow);
    Traction {
        alpha: alpha * share,
        slope: slope * turning * share + alpha * share_slope.transpose(),
    }
}

/// The direction that sand sees of a displacement, and its derivative by the displacement.
fn direction(
    n: &Vector3<f64>,
    x: &Vector3<f64>,
    surface: &Interface,
    flow: &Flow,
) -> (Vector3<f64>, Matrix3<f64>) {
    let x_n = x.dot(n);
    let x_t = x - n * x_n;
    let t = x_t.norm();
    let k = surface.follow;
    let p = x_n + flow.dilatancy * t;
    let identity = Matrix3::identity();
    let along = if t > TINY { x_t / t } else { Vector3::zeros() };
    // A surface that recedes: the direction of sliding at the limit.
    if p <= TINY {
        let limit = n + along * k;
        let length = limit.norm();
        let turn = if t > TINY {
            (identity - n * n.transpose() - along * along.transpose()) * (k / (t * length))
        } else {
            Matrix3::zeros()
        };
        return (limit / length, turn);
    }
    let dp = n + along * flow.dilatancy;
    let q = (k * k * p * p + t * t).sqrt();
    let share = k * p / q;
    let by_share = (dp * (t * t) - x_t * p) * (k / (q * q * q));
    let seen = n * p + x_t * share;
    let slope =
        n * dp.transpose() + x_t * by_share.transpose() + (identity - n * n.transpose()) * share;
    let size = seen.norm();
    let direction = seen / size;
    let turn = (slope - direction * slope.tr_mul(&direction).transpose()) / size;
    (direction, turn)
}

/// α of a motion along `v`, and its derivative by v.
fn steady(
    n: &Vector3<f64>,
    v: &Vector3<f64>,
    g: &Vector3<f64>,
    surface: &Interface,
    flow: &Flow,
) -> Traction {
    let (a, b, c) = (v.dot(g), n.dot(g), n.dot(v));
    let powers = monomials(a, b, c);
    let [by_a, by_c] = slopes(a, b, c);
    let f = CUBICS.map(|cubic| dot(&cubic, &powers));
    let gradients = CUBICS.map(|cubic| g * dot(&cubic, &by_a) + n * dot(&cubic, &by_c));
    let mut alpha = n * f[0] + v * f[1] + g * f[2];
    let mut slope = Matrix3::from_diagonal_element(f[1])
        + n * gradients[0].transpose()
        + v * gradients[1].transpose()
        + g * gradients[2].transpose();
    limit_friction(n, surface.friction, &mut alpha, &mut slope);
    let lift = -alpha.dot(g);
    if lift > 0.0 && b > 0.0 {
        let still = 1.0 - a.abs().min(1.0);
        let lost = flow.fluidity * b * still * still;
        let by_v = g * (-2.0 * flow.fluidity * b * still * a.signum());
        let by_lift = -(slope.tr_mul(g));
        alpha += g * (lift * lost);
        slope += g * (by_lift * lost + by_v * lift).transpose();
    }
    Traction { alpha, slope }
}

/// Limits the part of α along the surface to μ times its part along n.
fn limit_friction(n: &Vector3<f64>, mu: f64, alpha: &mut Vector3<f64>, slope: &mut Matrix3<f64>) {
    let normal = alpha.dot(n);
    let along = *alpha - n * normal;
    let size = along.norm();
    let most = mu * normal.abs();
    if size <= most || size < TINY {
        return;
    }
    let direction = along / size;
    let by_normal = slope.tr_mul(n).transpose();
    let by_along = *slope - n * by_normal;
    let turning = by_along - direction * by_along.tr_mul(&direction).transpose();
    *alpha = n * normal + direction * most;
    *slope = (n + direction * (mu * normal.signum())) * by_normal + turning * (most / size);
}

#[cfg(test)]
mod tests {
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

    /// Of a level plate that is pressed straight down, all three cubics act along the vertical, and
    /// `α = −(f₁ + f₂ + f₃)` at (1, 1, 1).
    #[test]
    fn a_plate_is_pressed_up_by_the_sum_of_the_coefficients() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        let sum: f64 = CUBICS.iter().flatten().sum();
        let found = traction(&down, &(down * 1e3), &down, &METAL, &FLOW).alpha;
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
                let of = |x: &Vector3<f64>| traction(n, x, &down, &METAL, &FLOW);
                let found = of(x);
                n_felt += usize::from(found.alpha.norm() > 0.0);
                for k in 0..3 {
                    let mut step = Vector3::zeros();
                    step[k] = 1e-7;
                    let change = (of(&(x + step)).alpha - of(&(x - step)).alpha) / 2e-7;
                    let error = (found.slope.column(k) - change).norm();
                    assert!(error < 1e-5 * (1.0 + change.norm()), "{n} {x} {k}: {error}");
                }
            }
        }
        assert!(n_felt >= 8, "{n_felt}");
    }

    #[test]
    fn a_surface_that_recedes_feels_nothing_and_a_sliding_one_its_grip() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        let back = traction(&down, &Vector3::new(0.5, 0.5, 0.0), &down, &METAL, &FLOW);
        assert_eq!(back, Traction::NONE);
        let sliding = traction(&down, &Vector3::x(), &down, &METAL, &FLOW).alpha;
        let pushing = traction(&down, &unit(1.0, -0.1, 0.0), &down, &METAL, &FLOW).alpha;
        assert!(0.0 < sliding.y && sliding.y < pushing.y);
    }

    #[test]
    fn friction_is_limited_and_the_stress_resists_the_motion() {
        let down = Vector3::new(0.0, -1.0, 0.0);
        for k in 0..60 {
            let turn = 0.1 * f64::from(k);
            let x = Vector3::new(turn.cos(), -turn.sin().abs() - 0.05, (2.0 * turn).sin());
            let found = traction(&down, &x, &down, &METAL, &FLOW).alpha;
            assert!(found.dot(&x) <= 0.0, "{x}: {found}");
        }
    }
}
