//! Removal and exchange of grains in a running simulation: those that stay keep their state, and
//! each contact of two that stay keeps its impulse under its new key.

use super::contact::{GrainKey, WALL};
use super::error::GrainError;

/// New numbers of bodies after the removal or exchange of grains. Those that stay keep their order.
#[derive(Clone, Debug)]
pub struct Renumbering {
    /// New number of each grain (n), if it stays.
    grains: Vec<Option<u32>>,
    /// How many grains there are afterwards.
    left: u32,
}

impl Renumbering {
    /// Without the grains that are marked (n).
    #[must_use]
    pub fn without(marked: &[bool]) -> Self {
        let mut left = 0;
        let grains = marked
            .iter()
            .map(|is_taken| {
                let number = left;
                left += u32::from(!is_taken);
                (!is_taken).then_some(number)
            })
            .collect();
        Self { grains, left }
    }

    /// With grains that were, or were not, among the `n` so far: the number of each there.
    ///
    /// # Errors
    /// A number that is not below `n` or not above the ones before it.
    pub fn of(before: &[Option<u32>], n: usize) -> Result<Self, GrainError> {
        let mut grains = vec![None; n];
        let mut least = 0;
        for (number, old) in (0_u32..).zip(before) {
            let Some(old) = *old else {
                continue;
            };
            if old < least || old as usize >= n {
                return Err(GrainError::Before {
                    grain: number as usize,
                    value: old as usize,
                });
            }
            least = old + 1;
            grains[old as usize] = Some(number);
        }
        #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
        let left = before.len() as u32;
        Ok(Self { grains, left })
    }

    /// How many grains there are afterwards.
    #[must_use]
    pub fn left(&self) -> usize {
        self.left as usize
    }

    /// The new key of a contact, if both of its bodies stay.
    #[must_use]
    pub fn key(&self, key: GrainKey) -> Option<GrainKey> {
        Some(GrainKey {
            a: self.body(key.a)?,
            b: self.body(key.b)?,
        })
    }

    fn body(&self, body: u32) -> Option<u32> {
        if body >= WALL {
            return Some(body);
        }
        match self.grains.get(body as usize) {
            Some(number) => *number,
            // Wheels are numbered after the grains.
            #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
            None => Some(body - self.grains.len() as u32 + self.left),
        }
    }

    /// The rows (`width` entries each) of the grains that stay, and whatever follows them.
    #[must_use]
    pub fn keep<T: Copy>(&self, rows: &[T], width: usize) -> Vec<T> {
        let (own, rest) = rows.split_at(width * self.grains.len());
        let kept = own.chunks_exact(width).zip(&self.grains);
        let mut out: Vec<T> = kept
            .filter(|(_, number)| number.is_some())
            .flat_map(|(row, _)| row.iter().copied())
            .collect();
        out.extend_from_slice(rest);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_that_stay_among_others_take_their_contacts_with_them() {
        let renumbering = Renumbering::of(&[None, Some(1), None, Some(2)], 4).expect("in order");
        let key = |a, b| GrainKey { a, b };
        assert_eq!(renumbering.left(), 4);
        assert_eq!(renumbering.key(key(1, 2)), Some(key(1, 3)));
        assert_eq!(renumbering.key(key(0, 1)), None);
        assert_eq!(renumbering.key(key(2, WALL)), Some(key(3, WALL)));
        assert_eq!(
            renumbering.key(key(5, 2)),
            Some(key(5, 3)),
            "the second wheel"
        );
        for wrong in [[Some(2), Some(1)], [Some(1), Some(1)], [None, Some(4)]] {
            let refused = Renumbering::of(&wrong, 4).expect_err("not in order");
            assert_eq!(refused.field(), "before[1]");
        }
    }

    #[test]
    fn those_that_stay_move_up_and_walls_and_wheels_stay_what_they_are() {
        let renumbering = Renumbering::without(&[false, true, false, true]);
        assert_eq!(renumbering.left(), 2);
        let key = |a, b| GrainKey { a, b };
        assert_eq!(renumbering.key(key(0, 2)), Some(key(0, 1)));
        assert_eq!(renumbering.key(key(1, 2)), None);
        assert_eq!(renumbering.key(key(2, WALL + 3)), Some(key(1, WALL + 3)));
        assert_eq!(
            renumbering.key(key(5, 2)),
            Some(key(3, 1)),
            "the second wheel"
        );
        assert_eq!(
            renumbering.keep(&[0, 0, 1, 1, 2, 2, 3, 3, 9], 2),
            [0, 0, 2, 2, 9]
        );
    }
}
