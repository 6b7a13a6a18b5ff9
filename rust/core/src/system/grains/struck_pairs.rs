//! Pairs that a step has to look at beside those that it forecasts.

use super::contact::{GrainKey, WALL};

/// Most repetitions of a step for such pairs: what strikes may throw in turn.
pub(super) const MOST_REPETITIONS: usize = 4;

/// Pairs that a step has to look at beside those that it forecasts.
#[derive(Clone, Debug, Default)]
pub(super) struct Struck {
    /// In the order of the keys. For walls and ground together `b` is [`WALL`].
    pairs: Vec<GrainKey>,
    /// Their largest gap at the start of the step, m.
    pub reach: f64,
}

impl Struck {
    /// Number of pairs.
    pub fn n(&self) -> usize {
        self.pairs.len()
    }

    pub fn clear(&mut self) {
        self.pairs.clear();
        self.reach = 0.0;
    }

    /// Whether a pair is one of them.
    #[inline]
    pub fn has(&self, a: u32, b: u32) -> bool {
        let key = GrainKey { a, b: b.min(WALL) };
        !self.pairs.is_empty() && self.pairs.binary_search(&key).is_ok()
    }

    #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
    pub fn add(&mut self, a: usize, b: usize, gap: f64) {
        let [a, b] = [a, b].map(|i| i as u32);
        let key = GrainKey { a, b };
        if let Err(place) = self.pairs.binary_search(&key) {
            self.pairs.insert(place, key);
        }
        // The search compares with a sum in another order.
        self.reach = self.reach.max(gap * (1.0 + 1e-9));
    }
}
