//! The sources that run over one rover or several to a register, against those for any machine.
#![allow(
    clippy::unwrap_used,
    clippy::too_many_lines,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp
)] // one long comparison; numbers drawn by a sine; equal bits are the claim

#[cfg(target_arch = "x86_64")]
use rover_core::scalar::{Eights, Fours};
use rover_core::scalar::{Instructions, Lane, Single};

mod contacts;
mod joined;
mod lane_batch;
mod machines;
mod on_sand;
mod rigid_bodies;
mod solver;
mod surfaces;
mod tree;

/// What is compared for every number of lanes.
trait OverLanes {
    fn run<T: Lane>(&mut self, token: T::Token);
}

/// Runs `work` over one lane, and over the registers of each instruction set of this machine.
fn on_every_register(work: &mut impl OverLanes) {
    for instructions in Instructions::all_of_this_machine() {
        match instructions {
            Instructions::Baseline => work.run::<f64>(Single::Baseline),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(token) => work.run::<Fours>(token),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(token) => work.run::<Eights>(token),
        }
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
