//! `numpy.random.SeedSequence`: hashes a seed so that near seeds give states without relation.
//!
//! Source: O'Neill 2015.

/// Words of the pool.
const POOL: usize = 4;

/// A hash whose multiplier changes with each word.
struct Hash {
    constant: u32,
    multiplier: u32,
}

impl Hash {
    fn of(&mut self, word: u32) -> u32 {
        let word = word ^ self.constant;
        self.constant = self.constant.wrapping_mul(self.multiplier);
        let word = word.wrapping_mul(self.constant);
        word ^ (word >> 16)
    }
}

fn mix(a: u32, b: u32) -> u32 {
    let mixed = (a.wrapping_mul(0xCA01_F9DD)).wrapping_sub(b.wrapping_mul(0x4973_F715));
    mixed ^ (mixed >> 16)
}

/// The pool of a seed.
pub(super) struct SeedSequence([u32; POOL]);

impl SeedSequence {
    /// From the words of a whole number, the lowest first.
    pub(super) fn new(seed: &[u32]) -> Self {
        let mut hash = Hash {
            constant: 0x43B0_D7E5,
            multiplier: 0x931E_8875,
        };
        let mut pool: [u32; POOL] =
            std::array::from_fn(|i| hash.of(seed.get(i).copied().unwrap_or(0)));
        for from in 0..POOL {
            for to in (0..POOL).filter(|&to| to != from) {
                pool[to] = mix(pool[to], hash.of(pool[from]));
            }
        }
        for &word in seed.iter().skip(POOL) {
            for to in &mut pool {
                *to = mix(*to, hash.of(word));
            }
        }
        Self(pool)
    }

    /// `generate_state(4, numpy.uint64)`.
    pub(super) fn words(&self) -> [u64; 4] {
        let mut hash = Hash {
            constant: 0x8B51_F9DD,
            multiplier: 0x58F3_8DED,
        };
        let halves: [u32; 8] = std::array::from_fn(|i| hash.of(self.0[i % POOL]));
        std::array::from_fn(|i| u64::from(halves[2 * i]) | (u64::from(halves[2 * i + 1]) << 32))
    }
}
