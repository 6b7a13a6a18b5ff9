//! Whole behaviour of the driving task: starts and episodes.

mod episodes;
