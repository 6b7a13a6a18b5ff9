//! Contacts between bodies: a machine that touches itself, stones that are
//! pushed, machines that meet.
#![allow(clippy::unwrap_used)]

pub mod contact_scenes;
pub mod heap_scenes;

mod derivatives;
mod heaps;
mod loose;
mod self_contact;
