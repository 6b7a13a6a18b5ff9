//! One contact with all others fixed: its exact solution, its mode, and the sweep over all
//! contacts.

pub(super) mod modes;
pub(super) mod one_contact;
pub(super) mod sweep;
