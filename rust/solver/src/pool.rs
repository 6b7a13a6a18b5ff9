//! Threads that survive a fork: a child process inherits none of its parent's and starts its own.

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Threads that the operating system did not start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("threads: {count} could not be started ({reason})")]
pub struct PoolError {
    /// Requested number; 0 stands for one per core.
    pub count: usize,
    /// Message of the operating system.
    pub reason: String,
}

/// Threads of one process.
#[derive(Debug)]
pub struct Pool {
    /// None only where a child process could not start its own.
    threads: Option<ThreadPool>,
    count: usize,
    process: u32,
}

impl Pool {
    /// Starts `count` threads.
    ///
    /// # Errors
    /// The operating system does not start them.
    pub fn start(count: usize) -> Result<Self, PoolError> {
        Ok(Self {
            threads: Some(start(count)?),
            count,
            process: std::process::id(),
        })
    }

    /// How many there are; 0 stands for one per core.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The threads, restarted if the process is a child of the one that started them.
    ///
    /// # Errors
    /// The operating system does not start them.
    pub fn of_this_process(&mut self) -> Result<&ThreadPool, PoolError> {
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

fn start(count: usize) -> Result<ThreadPool, PoolError> {
    let built = ThreadPoolBuilder::new().num_threads(count).build();
    built.map_err(|error| PoolError {
        count,
        reason: error.to_string(),
    })
}
