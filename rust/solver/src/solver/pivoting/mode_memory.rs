//! Which modes a solve has tried, and with what success.

use crate::scalar::{Lane, LaneMask};

/// Modes remembered.
const MEMORY: usize = 8;

/// Contacts whose modes have a number of their own.
const NUMBERED: usize = 32;

/// Their weights in it.
const POWERS_OF_3: [f64; NUMBERED] = {
    let mut powers = [3.0; NUMBERED];
    let mut i = 1;
    while i < NUMBERED {
        powers[i] = 3.0 * powers[i - 1];
        i += 1;
    }
    powers
};

/// Weight of a contact's mode in the number of all modes. Numbers of 32 contacts are distinct; with
/// more, two that are equal end a solve early.
#[inline(always)]
pub(super) fn weight(contact: usize) -> f64 {
    if contact < NUMBERED {
        return POWERS_OF_3[contact];
    }
    // Multiplicative hashing (Knuth), 44 bits of it: the sum over many contacts is nearly exact.
    ((contact as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20) as f64
}

/// Share of a squared residual that counts as a smaller one.
const LEAST_GAIN: f64 = 0.25;

/// The modes of past full steps and the smallest squared residual with each, lane by lane.
#[derive(Clone, Debug)]
pub(super) struct ModeMemory<T> {
    modes: [T; MEMORY],
    least: [T; MEMORY],
    /// Place of the next modes.
    next: T,
    /// Full steps since the last with new modes or a smaller residual.
    pub(super) idle: T,
}

impl<T: Lane> ModeMemory<T> {
    /// Nothing visited.
    #[inline(always)]
    pub(super) fn new(zero: T) -> Self {
        Self {
            modes: [zero; MEMORY],
            least: [zero; MEMORY],
            next: zero,
            idle: zero,
        }
    }

    /// Forgets the visits of the lanes of a mask.
    #[inline(always)]
    pub(super) fn forget(&mut self, lanes: T::Mask) {
        let zero = self.idle.like(0.0);
        for modes in &mut self.modes {
            *modes = T::select(lanes, zero, *modes);
        }
        self.next = T::select(lanes, zero, self.next);
        self.idle = T::select(lanes, zero, self.idle);
    }

    /// Enters the modes of a full step in the lanes of a mask, as a number that is not zero, and
    /// the squared residual after it.
    #[inline(always)]
    pub(super) fn enter(&mut self, lanes: T::Mask, modes: T, residual: T) {
        let (zero, one) = (modes.like(0.0), modes.like(1.0));
        let mut known = !lanes & lanes;
        let mut better = known;
        for k in 0..MEMORY {
            let here = lanes & !known & equal(self.modes[k], modes);
            known = known | here;
            let smaller = here & residual.lt(modes.like(LEAST_GAIN) * self.least[k]);
            better = better | smaller;
            self.least[k] = T::select(smaller, residual, self.least[k]);
        }
        let new = lanes & !known;
        if new.any() {
            for k in 0..MEMORY {
                let here = new & equal(modes.like(k as f64), self.next);
                self.modes[k] = T::select(here, modes, self.modes[k]);
                self.least[k] = T::select(here, residual, self.least[k]);
            }
            let next = self.next + one;
            let next = T::select(next.lt(one.like(MEMORY as f64)), next, zero);
            self.next = T::select(new, next, self.next);
        }
        let idle = T::select(new | better, zero, self.idle + one);
        self.idle = T::select(lanes, idle, self.idle);
    }
}

#[inline(always)]
fn equal<T: Lane>(a: T, b: T) -> T::Mask {
    a.le(b) & b.le(a)
}
