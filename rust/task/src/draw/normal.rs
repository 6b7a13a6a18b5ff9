//! Standard normal numbers by the ziggurat, as `numpy.random.Generator.standard_normal` draws them.
//!
//! 256 layers of equal area cover the half of `f(x) = exp(−x²/2)`. A number that falls into the
//! part of its layer below the next one is taken at once, 993 of 1000; the others are compared with
//! `f`, and the lowest layer has a tail.
//!
//! Sources: Marsaglia and Tsang 2000; the tail from Marsaglia 1964.

use std::sync::LazyLock;

use super::normal_layers::EDGES;
use super::pcg64::Pcg64;
use rover_core::scalar::elementary::{exp, ln_1p};

/// Where the tail begins: the edge of the lowest layer above it.
const TAIL: f64 = EDGES[255];

/// 2⁵²: a draw has 52 bits for its place in a layer.
const BITS: f64 = 4_503_599_627_370_496.0;

/// For each layer the numbers of 52 bits below which a draw lies under the next layer too.
static INSIDE: LazyLock<[u64; 256]> = LazyLock::new(|| {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0 and 2⁵²
    let share = |part: f64| (part * BITS).round_ties_even() as u64;
    std::array::from_fn(|i| match i {
        0 => share(TAIL / EDGES[0]),
        1 => 0,
        _ => share(EDGES[i - 1] / EDGES[i]),
    })
});

/// `f` at the edge of a layer; 1 at the top.
fn height(layer: usize) -> f64 {
    if layer == 0 {
        1.0
    } else {
        exp(-0.5 * EDGES[layer] * EDGES[layer])
    }
}

impl Pcg64 {
    /// A standard normal number; `Generator.standard_normal()`.
    ///
    /// The logarithm of a number of the tail, one of 4000, is not the C library's, which NumPy
    /// takes: such a number may differ from NumPy's in the last bit.
    #[allow(clippy::cast_possible_truncation)] // the eight lowest bits are meant
    pub fn normal(&mut self) -> f64 {
        let inside = &*INSIDE;
        loop {
            let bits = self.bits();
            let layer = (bits & 0xFF) as usize;
            let place = (bits >> 9) & 0x000F_FFFF_FFFF_FFFF;
            let size = place as f64 * (EDGES[layer] / BITS);
            let x = if (bits >> 8) & 1 == 1 { -size } else { size };
            if place < inside[layer] {
                return x;
            }
            if layer == 0 {
                let beyond = TAIL + self.tail();
                let is_negative = (place >> 8) & 1 == 1;
                return if is_negative { -beyond } else { beyond };
            }
            let (low, high) = (height(layer), height(layer - 1));
            if (high - low) * self.unit() + low < exp(-0.5 * x * x) {
                return x;
            }
        }
    }

    /// How far beyond [`TAIL`] a number of the tail lies.
    fn tail(&mut self) -> f64 {
        loop {
            let x = -(1.0 / TAIL) * ln_1p(-self.unit());
            let y = -ln_1p(-self.unit());
            if y + y > x * x {
                return x;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `Generator(PCG64(11)).standard_normal(200_000)`: the sum of `floor(2**40 x)` modulo 2⁶⁴, and
    /// the state afterwards. Each branch is taken: 51 numbers lie in the tail.
    #[test]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // two's complement is meant
    fn seeds_give_the_normal_numbers_of_numpy() {
        let mut random = Pcg64::seeded(&[11]);
        let floor = |x: f64| (x * 2.0_f64.powi(40)).floor() as i64 as u64;
        let sum = (0..200_000).fold(0_u64, |sum, _| sum.wrapping_add(floor(random.normal())));
        assert_eq!(sum, 0xFFFD_5E2B_185B_68EC);
        assert_eq!(
            random.state().state,
            0xAE3B_0F99_F437_A722_38DC_0CE2_CF9B_BD00
        );
    }
}
