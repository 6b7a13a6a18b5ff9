//! What is known of one contact with the others held: its exact solution,
//! its mode, and the sweep that visits one after the other.

pub(super) mod modes;
pub(super) mod one_contact;
pub(super) mod sweep;
