//! The instruction set of this machine, found at run time.

use std::sync::OnceLock;

#[cfg(target_arch = "x86_64")]
use fearless_simd::{Avx2, Level, Simd, f64x4};
#[cfg(all(target_arch = "x86_64", eight_lanes))]
use fearless_simd::{Avx512, f64x8};
use thiserror::Error;

/// Four rovers to a register, with AVX2.
#[cfg(target_arch = "x86_64")]
pub type Fours = f64x4<Avx2>;

/// Eight rovers to a register, with AVX-512.
#[cfg(all(target_arch = "x86_64", eight_lanes))]
pub type Eights = f64x8<Avx512>;

/// Proof that this machine has the instructions of [`Eights`].
#[cfg(all(target_arch = "x86_64", eight_lanes))]
type OfEights = Avx512;

/// Stands for eight rovers to a register in a build that has none, so that nothing more is compiled
/// for them.
#[cfg(all(target_arch = "x86_64", not(eight_lanes)))]
pub type Eights = Fours;

/// Proof that this machine has the instructions of [`Eights`].
#[cfg(all(target_arch = "x86_64", not(eight_lanes)))]
type OfEights = Avx2;

/// Instructions that a single rover's step is compiled for. Its bits do not depend on them.
#[derive(Clone, Copy, Debug)]
pub enum Single {
    /// Instructions that every machine of this architecture has.
    Baseline,
    /// AVX2. Wider registers gain nothing for one rover (within 2% in drives on a plane).
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
}

impl Single {
    /// The best of those that this process uses.
    #[must_use]
    pub fn best() -> Self {
        match Instructions::of_this_machine() {
            Instructions::Baseline => Self::Baseline,
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(token) => Self::Avx2(token),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(_) => Level::new().as_avx2().map_or(Self::Baseline, Self::Avx2),
        }
    }

    /// Runs `f` compiled for these instructions.
    #[inline(always)]
    pub fn vectorize<R>(self, f: impl FnOnce() -> R) -> R {
        match self {
            Self::Baseline => f(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(token) => token.vectorize(f),
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
    /// Eight rovers to a register; never in builds for development.
    #[cfg(target_arch = "x86_64")]
    Avx512(OfEights),
}

/// Instructions that this process cannot use.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum InstructionsError {
    /// No instruction set of this machine has the name.
    #[error("{name:?} is no instruction set of this machine, which has {}", known.join(", "))]
    Unknown {
        /// The name.
        name: String,
        /// Names of those that it has.
        known: Vec<&'static str>,
    },
    /// Steps were taken with others.
    #[error("this process already uses {used}")]
    InUse {
        /// Their name.
        used: &'static str,
    },
}

/// What this process uses, once it is chosen or first asked for.
static USED: OnceLock<Instructions> = OnceLock::new();

impl Instructions {
    /// Instructions that this process uses: the widest of the machine, unless others were chosen.
    #[must_use]
    pub fn of_this_machine() -> Self {
        *USED.get_or_init(|| Self::all_of_this_machine()[0])
    }

    /// Makes this process use others than the widest. Has to come before the first step.
    ///
    /// # Errors
    /// The machine has none of that name, or the process already uses others.
    pub fn choose(name: &str) -> Result<(), InstructionsError> {
        let all = Self::all_of_this_machine();
        let Some(chosen) = all.iter().find(|one| one.name() == name) else {
            return Err(InstructionsError::Unknown {
                name: name.to_owned(),
                known: all.iter().map(|one| one.name()).collect(),
            });
        };
        let used = USED.get_or_init(|| *chosen).name();
        if used == name {
            Ok(())
        } else {
            Err(InstructionsError::InUse { used })
        }
    }

    /// All that this machine has and this build knows, the widest first.
    #[must_use]
    pub fn all_of_this_machine() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        let wide = {
            let level = Level::new();
            #[cfg(eight_lanes)]
            let eight = level.as_avx512().map(Self::Avx512);
            #[cfg(not(eight_lanes))]
            let eight = None;
            let four = level.as_avx2().map(Self::Avx2);
            eight.into_iter().chain(four)
        };
        #[cfg(not(target_arch = "x86_64"))]
        let wide = std::iter::empty();
        wide.chain([Self::Baseline]).collect()
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

    /// These, or narrower ones of which so many rovers fill a register.
    #[must_use]
    pub fn for_rovers(self, n: usize) -> Self {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) if n <= 4 => Level::new().as_avx2().map_or(self, Self::Avx2),
            _ => self,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_register_is_no_wider_than_the_rovers_that_fill_it() {
        for all in Instructions::all_of_this_machine() {
            let few = all.for_rovers(4);
            assert_eq!(few.lanes(), all.lanes().min(4));
            assert_eq!(few.for_rovers(4).name(), few.name());
            assert_eq!(all.for_rovers(5).name(), all.name());
        }
    }

    #[test]
    fn what_is_used_stays() {
        let used = Instructions::of_this_machine().name();
        assert_eq!(Instructions::choose(used), Ok(()));
        for other in &Instructions::all_of_this_machine()[1..] {
            let refused = Instructions::choose(other.name());
            assert_eq!(refused, Err(InstructionsError::InUse { used }));
        }
        let error = Instructions::choose("AVX").unwrap_err().to_string();
        assert!(
            error.starts_with("\"AVX\" is no instruction set"),
            "{error}"
        );
        assert!(error.ends_with("baseline"), "{error}");
    }
}
