//! The associated law, a convex relaxation of Coulomb's: `K_μ* ∋ u ⊥ p ∈ K_μ` without De Saxcé's
//! shift. A sliding contact separates at the speed `μ|u_T|`.

use crate::cone::SecondOrderCone;

/// Natural map of one contact, `p − Π_K(p − ρ u)`, N s: zero exactly where the law holds.
///
/// `p`: impulse, N s. `u`: velocity, m/s. `rho`: positive scale, kg.
#[inline]
#[must_use]
pub fn natural_map<const D: usize>(
    p: &[f64; D],
    u: &[f64; D],
    friction_coefficient: f64,
    rho: f64,
) -> [f64; D] {
    let mut z = *p;
    for k in 0..D {
        z[k] -= rho * u[k];
    }
    let projected = SecondOrderCone::new(friction_coefficient).project(&z);
    let mut map = *p;
    for k in 0..D {
        map[k] -= projected[k];
    }
    map
}
