//! The turns of many rovers, distributed over threads.
//!
//! In its turn a rover is given its commands, takes its steps and is read, all on one thread. The
//! threads take the rovers in groups from a queue, and each thread steps its group as a batch
//! ([`super::lane_batch`]). The calling thread is one of them; it also asks whether to continue.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use rayon::ThreadPool;

use super::error::BatchError;
use super::lane_batch::{BatchRover, LaneBatch};
use super::reading::ReadingScratch;
use super::rover::RoverSimulation;
use crate::caught::{Fault, caught};
use crate::integrator::StepError;
use crate::pool::Pool;
use crate::scalar::Instructions;

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
    /// Whether the rover took any steps.
    pub has_moved: bool,
    /// The step that it could not take.
    pub error: Option<&'a StepError>,
}

/// A rover with its data.
pub type RoverTurn<'a, P> = (
    (&'a mut RoverSimulation, &'a mut Option<StepError>),
    &'a mut P,
);

/// Most rovers of a group: enough that solved lanes find new problems, few enough that their data
/// stay in the cache.
const GROUP: usize = 32;

/// Number of rovers that a thread takes next of those that are `left`, of `n` in all. All threads
/// get work, in whole blocks where there are enough rovers. Where a thread takes several groups,
/// the last ones are smaller, so that no thread waits long for another.
fn group_size((n, left): (usize, usize), threads: usize, lanes: usize) -> usize {
    let takes_one = n <= GROUP * threads;
    let share = if takes_one { n } else { left }.div_ceil(threads);
    share.next_multiple_of(lanes).clamp(1, GROUP)
}

/// What a thread needs for the turns of its rovers. Holds no state between calls.
struct Worker {
    /// With the widest registers, and with those that few rovers fill.
    wide: LaneBatch,
    narrow: LaneBatch,
    reading: ReadingScratch,
}

impl Default for Worker {
    fn default() -> Self {
        let instructions = Instructions::of_this_machine();
        Self {
            wide: LaneBatch::new(instructions),
            narrow: LaneBatch::new(instructions.for_rovers(1)),
            reading: ReadingScratch::default(),
        }
    }
}

impl Worker {
    /// The batch with so many lanes.
    fn batch(&mut self, lanes: usize) -> &mut LaneBatch {
        if lanes < Instructions::of_this_machine().lanes() {
            &mut self.narrow
        } else {
            &mut self.wide
        }
    }
}

/// The threads that step rovers.
pub struct Workers {
    /// Threads besides the caller's; None if the caller does all the work.
    pool: Option<Pool>,
    /// One for each thread.
    workers: Vec<Worker>,
}

impl Workers {
    /// For a number of rovers; `threads`: None for one per core.
    ///
    /// # Errors
    /// `Threads`.
    pub fn new(n_rovers: usize, threads: Option<usize>) -> Result<Self, BatchError> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        // More threads than rovers would have nothing to do.
        let threads = threads.unwrap_or_else(cores).clamp(1, n_rovers.max(1));
        let pool = (threads > 1).then(|| Pool::start(threads - 1));
        Ok(Self {
            pool: pool.transpose()?,
            workers: (0..threads).map(|_| Worker::default()).collect(),
        })
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.workers.len()
    }

    /// The threads that help the caller's, for other work on the rovers; none where that one does
    /// all the work.
    ///
    /// # Errors
    /// `Threads`: in a process forked from the one that made them, they could not be started anew.
    pub fn pool(&mut self) -> Result<Option<&ThreadPool>, BatchError> {
        Ok(self.pool.as_mut().map(Pool::of_this_process).transpose()?)
    }

    /// Gives every rover its turn of `n` steps. Once `go_on` returns false, each rover stops after
    /// a whole step.
    ///
    /// # Errors
    /// As [`Self::pool`]. No rover has moved then.
    pub fn take_turns<'a, P: Send + 'a>(
        &mut self,
        slots: impl ExactSizeIterator<Item = RoverTurn<'a, P>> + Send,
        n: usize,
        turn: &impl Turn<P>,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<(), BatchError> {
        let pool = self.pool.as_mut().map(Pool::of_this_process).transpose()?;
        take_turns(slots, n, turn, &mut self.workers, pool, go_on);
        Ok(())
    }
}

/// Notes a panic in a rover's turn outside its steps.
fn note(rover: &RoverSimulation, fault: Fault, error: &mut Option<StepError>) {
    let time = rover.time();
    *error = Some(StepError::Internal { time, fault });
}

/// Gives every rover its turn of `n` steps. A panic ends the turn of its own rover.
///
/// `workers`: one for each thread, at least one; `pool`: the threads besides the calling one. Once
/// `go_on` returns false, each rover stops after a whole step.
fn take_turns<'a, P: Send + 'a>(
    slots: impl ExactSizeIterator<Item = RoverTurn<'a, P>> + Send,
    n: usize,
    turn: &impl Turn<P>,
    workers: &mut [Worker],
    pool: Option<&ThreadPool>,
    go_on: &mut dyn FnMut() -> bool,
) {
    let (n_rovers, threads) = (slots.len(), workers.len().max(1));
    let share = n_rovers.div_ceil(threads);
    let lanes = Instructions::of_this_machine().for_rovers(share).lanes();
    let queue = Mutex::new(slots);
    let work = |worker: &mut Worker, go_on: &mut dyn FnMut() -> bool| {
        let mut own = Vec::with_capacity(GROUP);
        loop {
            own.extend({
                let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
                let group = group_size((n_rovers, queue.len()), threads, lanes);
                (0..group).map_while(|_| queue.next()).collect::<Vec<_>>()
            });
            if own.is_empty() {
                return;
            }
            let may_move = go_on();
            let mut rovers = Vec::with_capacity(GROUP);
            for ((rover, error), place) in &mut own {
                **error = None;
                if may_move && turn.is_moving(place) {
                    match caught(|| turn.begin(rover, place)) {
                        Ok(()) => rovers.push(BatchRover { rover, error }),
                        Err(fault) => note(rover, fault, error),
                    }
                }
            }
            worker.batch(lanes).advance(&mut rovers, n, go_on);
            drop(rovers);
            for ((rover, error), place) in own.drain(..) {
                let done = Done {
                    has_moved: may_move && turn.is_moving(place),
                    error: error.as_ref(),
                };
                if let Err(fault) = caught(|| turn.end(rover, done, place, &mut worker.reading)) {
                    worker.reading = ReadingScratch::default();
                    note(rover, fault, error);
                }
            }
        }
    };
    let [own, others @ ..] = workers else {
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
        for worker in others {
            let done = done.clone();
            scope.spawn(move |_| {
                work(worker, &mut || !stop.load(Ordering::Relaxed));
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes of the groups that threads take, one after the other.
    fn groups(n: usize, threads: usize, lanes: usize) -> Vec<usize> {
        let (mut left, mut sizes) = (n, Vec::new());
        while left > 0 {
            let size = group_size((n, left), threads, lanes).min(left);
            sizes.push(size);
            left -= size;
        }
        sizes
    }

    #[test]
    fn every_thread_has_work() {
        assert_eq!(groups(64, 16, 4), [4; 16]);
        assert_eq!(groups(64, 2, 8), [32, 32]);
        assert_eq!(groups(100, 2, 8), [32, 32, 24, 8, 4]);
    }

    /// Groups of 32 to the end would leave threads idle while the last ones are stepped.
    #[test]
    fn the_last_groups_are_small() {
        let sizes = groups(1024, 16, 8);
        assert!(sizes.len() > 2 * 16);
        assert!(sizes.is_sorted_by(|a, b| a >= b));
        assert_eq!(sizes[..16], [32; 16]);
        assert_eq!(sizes[sizes.len() - 16..], [8; 16]);
    }
}
