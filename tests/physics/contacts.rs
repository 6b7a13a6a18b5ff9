//! Contacts between bodies: a machine that touches itself, stones that are
//! pushed, machines that meet.
#![allow(clippy::unwrap_used)]

#[path = "contacts/contact_scenes.rs"]
mod contact_scenes;

#[path = "contacts/derivatives.rs"]
mod derivatives;
#[path = "contacts/loose.rs"]
mod loose;
#[path = "contacts/self_contact.rs"]
mod self_contact;
