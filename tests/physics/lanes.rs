//! The sources that run over one rover or several to a register, against those for any machine.
#![allow(
    clippy::unwrap_used,
    clippy::too_many_lines,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss
)] // one long comparison; numbers drawn by a sine

use rover_core::scalar::Lane;

#[path = "lanes/contacts.rs"]
mod contacts;
#[path = "lanes/tree.rs"]
mod tree;

#[path = "lanes/fleet.rs"]
mod fleet;

/// Repeatable numbers in [−1, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 * 2.0_f64.powi(-52) - 1.0
    }
}

/// The numbers of several rovers, one rover a lane.
fn spread<T: Lane, R>(token: T::Token, rovers: &[R], of: impl Fn(&R) -> Vec<f64>) -> Vec<T> {
    let mut out = vec![T::splat(token, 0.0); of(&rovers[0]).len()];
    for (lane, rover) in rovers.iter().enumerate() {
        for (out, x) in out.iter_mut().zip(of(rover)) {
            out.set(lane, x);
        }
    }
    out
}
#[path = "lanes/surfaces.rs"]
mod surfaces;
