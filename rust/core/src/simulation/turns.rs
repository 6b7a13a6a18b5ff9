//! The turns of many rovers, distributed over threads.
//!
//! In its turn a rover is given its commands, takes its steps and is read, all on one thread. The
//! threads take the rovers one by one from a queue. The calling thread is one of them; it also asks
//! whether to continue.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use rayon::ThreadPool;

use super::reading::ReadingScratch;
use super::rover::RoverSimulation;
use crate::integrator::StepError;

/// Interval at which the calling thread asks whether to continue while others still step.
const ASKING: Duration = Duration::from_millis(20);

/// What is done with a rover before and after its steps. `P`: the rover's own data.
pub trait Turn<P>: Sync {
    /// Whether the rover moves.
    fn is_moving(&self, place: &P) -> bool;

    /// Gives a rover that moves its commands.
    fn begin(&self, rover: &mut RoverSimulation, place: &mut P);

    /// Reads the rover, whether it has moved or not. `error`: the step that it could not take.
    fn end(
        &self,
        rover: &RoverSimulation,
        done: Done<'_>,
        place: &mut P,
        scratch: &mut ReadingScratch,
    );
}

/// How a rover's steps went.
#[derive(Clone, Copy, Debug)]
pub struct Done<'a> {
    /// Whether it took any steps.
    pub has_moved: bool,
    /// The step that it could not take.
    pub error: Option<&'a StepError>,
}

/// A rover with its data.
pub(super) type Seat<'a, P> = (
    (&'a mut RoverSimulation, &'a mut Option<StepError>),
    &'a mut P,
);

/// Gives every rover its turn of `n` steps.
///
/// `scratch`: one for each thread, at least one; `pool`: the threads besides the calling one. Once
/// `go_on` returns false, each rover stops after a whole step.
pub(super) fn take_turns<'a, P: Send + 'a>(
    seats: impl Iterator<Item = Seat<'a, P>> + Send,
    n: usize,
    turn: &impl Turn<P>,
    scratch: &mut [ReadingScratch],
    pool: Option<&ThreadPool>,
    go_on: &mut dyn FnMut() -> bool,
) {
    let queue = Mutex::new(seats);
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = |scratch: &mut ReadingScratch, go_on: &mut dyn FnMut() -> bool| {
        while let Some(((rover, error), place)) = next() {
            let has_moved = turn.is_moving(place) && go_on();
            *error = None;
            if has_moved {
                turn.begin(rover, place);
                *error = rover.step_while(n, go_on).err();
            }
            let done = Done {
                has_moved,
                error: error.as_ref(),
            };
            turn.end(rover, done, place, scratch);
        }
    };
    let [own, others @ ..] = scratch else {
        return;
    };
    let Some(pool) = pool else {
        work(own, go_on);
        return;
    };
    let stop = AtomicBool::new(false);
    pool.in_place_scope(|scope| {
        let (done, is_done) = channel::<()>();
        let (stop, work) = (&stop, &work);
        for scratch in others {
            let done = done.clone();
            scope.spawn(move |_| {
                work(scratch, &mut || !stop.load(Ordering::Relaxed));
                drop(done); // tells the calling thread, also where a rover panics
            });
        }
        drop(done);
        let mut ask = || {
            if !go_on() {
                stop.store(true, Ordering::Relaxed);
            }
            !stop.load(Ordering::Relaxed)
        };
        work(own, &mut ask);
        while is_done.recv_timeout(ASKING) == Err(RecvTimeoutError::Timeout) {
            ask();
        }
    });
}
