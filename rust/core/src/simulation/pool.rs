//! Threads that survive a fork: a child process inherits none of its parent's and starts its own.

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

    /// The threads, restarted if the process is a child of the one that started them.
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

    /// The parent's threads do not run here, and locks that they held at the fork are never
    /// released: dropping the pool, which communicates with them, could block for ever.
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
