//! Where pivoting keeps the numbers of the contacts.

use std::fmt::Debug;
use std::ops::IndexMut;

/// Entries of a contact along n, t, b.
pub type Triple<T> = [T; 3];

/// Storage of something by contact.
pub(crate) trait Store: Clone + Debug + 'static {
    /// One `X` a contact.
    type Of<X: Copy + Debug>: IndexMut<usize, Output = X> + Clone + Debug;

    /// Storage filled with `x` for every contact that there is room for.
    fn filled<X: Copy + Debug>(x: X) -> Self::Of<X>;
}

/// At most `C` contacts.
#[derive(Clone, Debug)]
pub(crate) struct Few<const C: usize>;

impl<const C: usize> Store for Few<C> {
    type Of<X: Copy + Debug> = [X; C];

    #[inline(always)]
    fn filled<X: Copy + Debug>(x: X) -> [X; C] {
        [x; C]
    }
}

/// Any number of contacts; without room to begin with.
#[derive(Clone, Debug)]
pub(crate) struct Many;

impl Store for Many {
    type Of<X: Copy + Debug> = Vec<X>;

    fn filled<X: Copy + Debug>(_: X) -> Vec<X> {
        Vec::new()
    }
}
