//! Threads that survive a fork: a child process has none of its parent's, so it starts its own.

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::error::BatchError;

/// Threads of one process.
pub(super) struct Pool {
    /// None only where a child process could not start its own.
    threads: Option<ThreadPool>,
    count: usize,
    process: u32,
}

impl Pool {
    /// Starts `count` threads.
    ///
    /// # Errors
    /// `Threads`.
    pub(super) fn start(count: usize) -> Result<Self, BatchError> {
        Ok(Self {
            threads: Some(start(count)?),
            count,
            process: std::process::id(),
        })
    }

    /// The threads, started anew where the process is a child of the one that started them.
    ///
    /// # Errors
    /// `Threads`.
    pub(super) fn of_this_process(&mut self) -> Result<&ThreadPool, BatchError> {
        self.forget_a_parents();
        let threads = match self.threads.take() {
            Some(threads) => threads,
            None => start(self.count)?,
        };
        self.process = std::process::id();
        Ok(self.threads.insert(threads))
    }

    /// Threads of a parent do not run here, and what they held at the fork they hold for ever: to
    /// drop the pool, which talks to them, could wait without end.
    fn forget_a_parents(&mut self) {
        if self.process != std::process::id() {
            std::mem::forget(self.threads.take());
        }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.forget_a_parents();
    }
}

fn start(count: usize) -> Result<ThreadPool, BatchError> {
    let built = ThreadPoolBuilder::new().num_threads(count).build();
    built.map_err(|error| BatchError::Threads {
        count,
        reason: error.to_string(),
    })
}
