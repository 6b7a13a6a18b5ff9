//! Taking disks out of a running soil: the others keep their state, and each contact its impulse under its new name.

use super::contact::{SoilKey, WALL};

/// New numbers of bodies after disks were taken out; the order stays.
#[derive(Clone, Debug)]
pub(crate) struct Renumbering {
    /// New number of each disk (n), if it stays.
    disks: Vec<Option<u32>>,
    /// How many disks stay.
    left: u32,
}

impl Renumbering {
    /// Without the disks that are marked (n).
    pub(crate) fn without(marked: &[bool]) -> Self {
        let mut left = 0;
        let disks = marked
            .iter()
            .map(|is_taken| {
                let number = left;
                left += u32::from(!is_taken);
                (!is_taken).then_some(number)
            })
            .collect();
        Self { disks, left }
    }

    /// How many disks stay.
    pub(crate) fn left(&self) -> usize {
        self.left as usize
    }

    /// The same contact's new name, if both of its bodies stay.
    pub(crate) fn key(&self, key: SoilKey) -> Option<SoilKey> {
        Some(SoilKey {
            a: self.body(key.a)?,
            b: self.body(key.b)?,
        })
    }

    fn body(&self, body: u32) -> Option<u32> {
        if body >= WALL {
            return Some(body);
        }
        match self.disks.get(body as usize) {
            Some(number) => *number,
            // Wheels are numbered after the disks.
            #[allow(clippy::cast_possible_truncation)] // disks are numbered by u32
            None => Some(body - self.disks.len() as u32 + self.left),
        }
    }

    /// The rows (`width` entries each) of the disks that stay, and whatever follows them.
    pub(crate) fn keep<T: Copy>(&self, rows: &[T], width: usize) -> Vec<T> {
        let (own, rest) = rows.split_at(width * self.disks.len());
        let kept = own.chunks_exact(width).zip(&self.disks);
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
    fn those_that_stay_move_up_and_walls_and_wheels_stay_what_they_are() {
        let renumbering = Renumbering::without(&[false, true, false, true]);
        assert_eq!(renumbering.left(), 2);
        let key = |a, b| SoilKey { a, b };
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
