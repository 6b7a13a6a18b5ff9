//! A contact without friction: Signorini's condition alone, the limit μ = 0 of Coulomb's law.

use super::friction_law::FrictionLaw;

/// No tangential impulse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Frictionless;

/// Impulse of one contact alone, N s: it stops the approach `q`, m/s, and nothing else.
///
/// `W_NN`: positive, 1/kg.
#[inline]
#[must_use]
pub fn answer<const D: usize>(W_NN: f64, q: &[f64; D]) -> [f64; D] {
    let mut p = [0.0; D];
    if q[0] < 0.0 {
        p[0] = -q[0] / W_NN;
    }
    p
}

impl<const D: usize> FrictionLaw<D> for Frictionless {
    fn project(&self, _p_N: f64, z: &[f64; D]) -> [f64; D] {
        let mut p = [0.0; D];
        p[0] = z[0];
        p
    }

    fn answer(&self, W: &[[f64; D]; D], q: &[f64; D]) -> [f64; D] {
        if W[0][0] > 0.0 {
            answer(W[0][0], q)
        } else {
            [0.0; D]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_stops_the_approach_and_leaves_the_slip() {
        let W = [[0.5, 0.1, 0.0], [0.1, 0.5, 0.0], [0.0, 0.0, 0.5]];
        let p = Frictionless.answer(&W, &[-1.0, 3.0, 0.0]);
        assert!((p[0] - 2.0).abs() < 1e-15 && p[1].abs() < 1e-300 && p[2].abs() < 1e-300);
        let open = Frictionless.answer(&W, &[0.1, 3.0, 0.0]);
        assert!(open.iter().all(|p| p.abs() < 1e-300));
        let off = Frictionless.violation(&p, &[0.0, 3.2, 0.0], [2.0; 2]);
        assert!(off.iter().all(|v: &f64| v.abs() < 1e-15));
    }
}
