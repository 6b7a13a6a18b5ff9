//! Planar and spatial contacts.

/// Whether contacts have one tangent (planar scenes) or two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// Normal and one tangent.
    Two,
    /// Normal and two tangents.
    Three,
}

impl Dimension {
    /// Components per contact, 2 or 3.
    #[inline]
    #[must_use]
    pub const fn components(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Three => 3,
        }
    }
}
