//! The sources that run over one rover or several to a register, against those for any machine.
#![allow(
    clippy::unwrap_used,
    clippy::too_many_lines,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss
)] // one long comparison; numbers drawn by a sine

#[path = "lanes/contacts.rs"]
mod contacts;
#[path = "lanes/tree.rs"]
mod tree;

#[path = "lanes/fleet.rs"]
mod fleet;
