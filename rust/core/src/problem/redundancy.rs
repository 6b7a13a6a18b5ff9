//! Redundant contacts: loads that equilibrium leaves open.

/// Pivot, relative to the largest entry on the diagonal, below which a contact adds nothing.
const DEPENDENT: f64 = 1e-9;

/// Number of independent sets of normal forces of the closed contacts that balance one another:
/// their number less the rank of their part of W.
///
/// 0 means that equilibrium and friction determine the loads. Otherwise they depend on what no
/// rigid body has: they are one of many answers, chosen by rounding. A rigid chassis on four wheels
/// has one such set.
///
/// `W` (d n_c, d n_c), row-major; `p` (d n_c): impulses, N s. Friction does not enter.
#[must_use]
pub fn undetermined_loads(d: usize, W: &[f64], p: &[f64]) -> usize {
    let size = p.len();
    let closed: Vec<usize> = (0..size).step_by(d).filter(|&i| p[i] > 0.0).collect();
    let mut left: Vec<f64> = closed.iter().map(|&i| W[i * (size + 1)]).collect();
    let largest = left.iter().fold(0.0_f64, |most, x| most.max(*x));
    // Cholesky's factor of the normal part by columns, the largest pivot first.
    let mut columns: Vec<Vec<f64>> = Vec::new();
    while columns.len() < closed.len() {
        let pivot = (0..left.len()).fold(0, |best, i| if left[i] > left[best] { i } else { best });
        if left[pivot] <= DEPENDENT * largest {
            break;
        }
        let root = left[pivot].sqrt();
        let column: Vec<f64> = (0..closed.len())
            .map(|i| {
                let known: f64 = columns.iter().map(|c| c[i] * c[pivot]).sum();
                (W[closed[i] * size + closed[pivot]] - known) / root
            })
            .collect();
        for (left, entry) in left.iter_mut().zip(&column) {
            *left -= entry * entry;
        }
        left[pivot] = 0.0;
        columns.push(column);
    }
    closed.len() - columns.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W of normals at places x on a rigid beam of unit mass and inertia: 1 + x y.
    fn beam(places: &[f64]) -> Vec<f64> {
        let row = |x: &f64| places.iter().map(|y| 1.0 + x * y).collect::<Vec<_>>();
        places.iter().flat_map(row).collect()
    }

    #[test]
    fn a_beam_on_two_supports_is_determined_and_each_further_support_is_not() {
        let W = beam(&[-1.0, 0.3, 0.7, 1.0]);
        assert_eq!(undetermined_loads(1, &W, &[1.0, 0.0, 0.0, 1.0]), 0);
        assert_eq!(undetermined_loads(1, &W, &[1.0, 0.0, 1.0, 1.0]), 1);
        assert_eq!(undetermined_loads(1, &W, &[1.0; 4]), 2);
        assert_eq!(undetermined_loads(1, &W, &[0.0; 4]), 0);
    }

    #[test]
    fn supports_that_yield_are_determined() {
        let mut W = beam(&[-1.0, 0.0, 1.0]);
        for i in 0..3 {
            W[4 * i] += 1e-3;
        }
        assert_eq!(undetermined_loads(1, &W, &[1.0; 3]), 0);
    }
}
