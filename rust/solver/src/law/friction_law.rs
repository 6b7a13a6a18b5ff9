//! What a law of friction is to a solver: the set of tangential impulses that it admits at one
//! normal impulse.
//!
//! Signorini's condition holds along the normal. Across it the impulse is the projection
//!
//! ```text
//! p_T = Π_{C(p_N)}(p_T − ρ u_T)    for any ρ > 0,
//! ```
//!
//! on a convex set `C(p_N)`, the section of the law: a disc of radius μ p_N for Coulomb's. It says
//! that `−u_T` is normal to the section at `p_T`: sticking in its interior, slip on its boundary,
//! by the principle of maximal dissipation. A law is therefore this projection. Violation, answer
//! of one contact and linearisation follow from it, and a law that knows better overrides them.
//!
//! Source: Alart and Curnier 1991; Moreau 1988.

use super::mode::{ContactMode, Mode};
use super::signorini;
use crate::cone::tangential_norm;

/// Passes over the normal and the tangential part in search of one contact's answer.
const MOST_PASSES: usize = 2000;

/// Largest turning stiffness of a slide, in units of 1/ρ_T: that of a contact about to open is
/// infinite.
const LARGEST: f64 = 1e12;

/// Change of a pass, relative to the impulse, at which the search ends.
const SETTLED: f64 = 1e-14;

/// A law of friction with a convex section, see the page above.
///
/// Vectors are `[normal, tangent, (tangent)]`.
pub trait FrictionLaw<const D: usize> {
    /// The admissible tangential impulse nearest to that of `z`, N s, under the normal impulse
    /// `p_N`, N s, which may be negative in an iteration. The normal component passes through.
    fn project(&self, p_N: f64, z: &[f64; D]) -> [f64; D];

    /// Violation by the impulse p, N s, at the velocity u, m/s: a velocity, m/s, that vanishes
    /// exactly where the law and Signorini's condition hold.
    ///
    /// `rho`: `[ρ_N, ρ_T]`, kg, about the inverse diagonal of the contact's block of W.
    #[inline]
    fn violation(&self, p: &[f64; D], u: &[f64; D], [rho_N, rho_T]: [f64; 2]) -> [f64; D] {
        let mut z = *p;
        for k in 1..D {
            z[k] -= rho_T * u[k];
        }
        let projected = self.project(p[0], &z);
        let inverse = 1.0 / rho_T;
        let mut violation = *u;
        violation[0] = signorini::violation(u[0], p[0], rho_N);
        for k in 1..D {
            violation[k] = (p[k] - projected[k]) * inverse;
        }
        violation
    }

    /// Impulse of one contact with all others fixed, N s: `u = W p + q` and p obey the law.
    ///
    /// By default in passes over the normal and the tangential part, which converge where the
    /// block's coupling between them is not larger than its diagonal. `W`: block of the contact,
    /// 1/kg; `q`: velocity without its impulse, m/s.
    fn answer(&self, W: &[[f64; D]; D], q: &[f64; D]) -> [f64; D] {
        let mut p = [0.0; D];
        let tangential: f64 = (1..D).map(|k| W[k][k]).sum();
        if W[0][0] <= 0.0 {
            return p;
        }
        let velocity = |k: usize, p: &[f64; D]| -> f64 {
            q[k] + W[k].iter().zip(p).map(|(w, p)| w * p).sum::<f64>()
        };
        for _ in 0..MOST_PASSES {
            let before = p;
            p[0] = (p[0] - velocity(0, &p) / W[0][0]).max(0.0);
            if tangential > 0.0 {
                let mut z = p;
                for k in 1..D {
                    z[k] -= velocity(k, &p) / tangential;
                }
                p = self.project(p[0], &z);
            }
            let size = p.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let change = (p.iter().zip(&before)).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
            if change <= SETTLED * size {
                break;
            }
        }
        p
    }

    /// The law linearised where the projection puts `p − ρ u`, which at a solution is p itself. The
    /// section is taken to grow in proportion to the normal impulse.
    fn linearise(&self, p: &[f64; D], u: &[f64; D], [rho_N, rho_T]: [f64; 2]) -> Mode<f64> {
        let mut z: [f64; D] = std::array::from_fn(|k| p[k] - rho_T * u[k]);
        z[0] = p[0] - rho_N * u[0];
        if z[0] <= 0.0 {
            return Mode::new(ContactMode::Open);
        }
        let projected = self.project(z[0], &z);
        let mut off = z;
        for k in 1..D {
            off[k] -= projected[k];
        }
        let (off, norm) = (tangential_norm(&off), tangential_norm(&projected));
        if off <= f64::EPSILON * norm {
            return Mode::new(ContactMode::Stick);
        }
        let gamma = (off / (rho_T * norm)).min(LARGEST / rho_T);
        Mode::along(norm / z[0], &projected, norm, gamma)
    }
}
