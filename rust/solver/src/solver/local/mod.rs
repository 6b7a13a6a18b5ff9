//! One contact with all others fixed: its mode, and the sweep over all contacts.

pub(super) mod modes;
pub(super) mod sweep;
