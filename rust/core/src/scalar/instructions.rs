//! The instruction set of this machine, found at run time.

use std::sync::OnceLock;

#[cfg(target_arch = "x86_64")]
use fearless_simd::{Avx2, Avx512};
use fearless_simd::{Level, Simd};

/// Instructions that a single rover's step is compiled for. Its bits do not depend on them.
#[derive(Clone, Copy, Debug)]
pub enum Single {
    /// Those that every machine of its kind has.
    Baseline,
    /// AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// AVX-512.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl Single {
    /// The best of this machine.
    #[must_use]
    pub fn best() -> Self {
        match Instructions::of_this_machine() {
            Instructions::Baseline => Self::Baseline,
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(token) => Self::Avx2(token),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(token) => Self::Avx512(token),
        }
    }

    /// Runs `f` compiled for these instructions.
    #[inline(always)]
    pub fn vectorize<R>(self, f: impl FnOnce() -> R) -> R {
        match self {
            Self::Baseline => f(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(token) => token.vectorize(f),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(token) => token.vectorize(f),
        }
    }
}

/// What this machine can do.
#[derive(Clone, Copy, Debug)]
pub enum Instructions {
    /// One rover at a time.
    Baseline,
    /// Four rovers to a register.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// Eight rovers to a register.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl Instructions {
    /// Asks the processor once.
    #[must_use]
    pub fn of_this_machine() -> Self {
        static FOUND: OnceLock<Instructions> = OnceLock::new();
        *FOUND.get_or_init(|| {
            let level = Level::new();
            #[cfg(target_arch = "x86_64")]
            if let Some(token) = level.as_avx512() {
                return Self::Avx512(token);
            }
            #[cfg(target_arch = "x86_64")]
            if let Some(token) = level.as_avx2() {
                return Self::Avx2(token);
            }
            let _ = level;
            Self::Baseline
        })
    }

    /// This machine's best, and all that it could do with less.
    #[must_use]
    pub fn all_of_this_machine() -> Vec<Self> {
        let best = Self::of_this_machine();
        let mut all = vec![best];
        #[cfg(target_arch = "x86_64")]
        if let (Self::Avx512(_), Some(token)) = (best, Level::new().as_avx2()) {
            all.push(Self::Avx2(token));
        }
        if best.lanes() > 1 {
            all.push(Self::Baseline);
        }
        all
    }

    /// Rovers to a register.
    #[must_use]
    pub fn lanes(self) -> usize {
        match self {
            Self::Baseline => 1,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => 4,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => 8,
        }
    }

    /// Name of the instruction set.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "AVX-512",
        }
    }
}
