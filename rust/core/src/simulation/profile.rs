//! A profile of a step: mean time of each part.

use std::collections::BTreeMap;
use std::time::Instant;

use crate::integrator::{Phase, Probe};

/// Seconds spent in each phase.
#[derive(Clone, Debug)]
pub struct Stopwatch {
    last: Instant,
    seconds: BTreeMap<Phase, f64>,
    steps: usize,
}

impl Stopwatch {
    /// Starts now.
    #[must_use]
    pub fn start() -> Self {
        Self {
            last: Instant::now(),
            seconds: BTreeMap::new(),
            steps: 0,
        }
    }

    pub(super) fn finish(&mut self, steps: usize) {
        self.steps = steps;
    }

    /// Mean microseconds per step of each phase, in the order of the step.
    #[must_use]
    pub fn microseconds(&self) -> Vec<(Phase, f64)> {
        let scale = 1e6 / self.steps.max(1) as f64;
        self.seconds
            .iter()
            .map(|(phase, s)| (*phase, s * scale))
            .collect()
    }
}

impl Probe for Stopwatch {
    fn end(&mut self, phase: Phase) {
        let now = Instant::now();
        *self.seconds.entry(phase).or_default() += (now - self.last).as_secs_f64();
        self.last = Instant::now();
    }
}
