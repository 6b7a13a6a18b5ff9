//! Passivity: scales down an approximate answer that would add energy. An exact one never does.
//!
//! Over a step with θ = 1 the energy changes by `pᵀu − ½ |v⁺ − v⁻|²_M`, and `pᵀu ≤ 0` wherever the
//! law holds. The work of `s p` is `s² pᵀWp + s pᵀq`. It vanishes at `s = −pᵀq / pᵀWp`, a shorter
//! impulse within the same cones.

/// The fraction of an impulse, in [0, 1], that adds no energy; none if the whole impulse adds none
/// beyond the rounding of its sums.
///
/// `work = pᵀu` and `free = pᵀq`, J.
#[must_use]
pub(crate) fn passive_share(work: f64, free: f64) -> Option<f64> {
    (work > f64::EPSILON * free.abs()).then(|| (-free / (work - free)).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_does_no_work() {
        // p = 2, W = 3, q = -5: u = 1, work 2.
        let share = passive_share(2.0, -10.0).expect("it adds energy");
        let p = 2.0 * share;
        assert!((p * (3.0 * p - 5.0)).abs() < 1e-14);
        assert_eq!(passive_share(-1.0, -10.0), None);
        // q points along p: only the zero impulse does no work.
        assert_eq!(passive_share(2.0, 1.0), Some(0.0));
    }
}
