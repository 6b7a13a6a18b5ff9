//! The components of a contact: normal, tangent, and in space a second tangent.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use std::fmt::Debug;
use std::ops::{Index, IndexMut};

/// Numbers along n, t and in space b of a contact: an array of two or three.
pub trait Local<T>: Copy + Debug + Index<usize, Output = T> + IndexMut<usize> {
    /// How many.
    const N: usize;

    /// The number `x` along every direction.
    fn splat(x: T) -> Self;

    /// From a slice of that length.
    fn of(numbers: &[T]) -> Self;

    /// The numbers of all contacts, one after the other.
    fn flat(all: &[Self]) -> &[T];

    /// The numbers of all contacts, one after the other.
    fn flat_mut(all: &mut [Self]) -> &mut [T];

    /// With `zero` along a direction that it does not have.
    fn triple(&self, zero: T) -> [T; 3];
}

impl<T: Copy + Debug, const N: usize> Local<T> for [T; N] {
    const N: usize = N;

    #[inline(always)]
    fn splat(x: T) -> Self {
        [x; N]
    }

    #[inline]
    fn of(numbers: &[T]) -> Self {
        std::array::from_fn(|k| numbers[k])
    }

    #[inline(always)]
    fn flat(all: &[Self]) -> &[T] {
        all.as_flattened()
    }

    #[inline(always)]
    fn flat_mut(all: &mut [Self]) -> &mut [T] {
        all.as_flattened_mut()
    }

    #[inline(always)]
    fn triple(&self, zero: T) -> [T; 3] {
        let mut own = [zero; 3];
        own[..N].copy_from_slice(self);
        own
    }
}
