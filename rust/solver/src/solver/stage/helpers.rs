//! Threads that help with a solve, kept from one solve to the next.

use crate::pool::Pool;

/// A pool of threads, started when it is first needed. A copy starts its own.
#[derive(Debug, Default)]
pub(super) struct Helpers {
    pool: Option<Pool>,
}

impl Clone for Helpers {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Helpers {
    /// Runs `work` on a pool of `threads` threads; on the caller's alone where that is one, or
    /// where the operating system starts no others.
    pub(super) fn run<T: Send>(&mut self, threads: usize, work: impl FnOnce() -> T + Send) -> T {
        if threads <= 1 {
            return work();
        }
        if self
            .pool
            .as_ref()
            .is_none_or(|pool| pool.count() != threads)
        {
            self.pool = Pool::start(threads).ok();
        }
        match self.pool.as_mut().map(Pool::of_this_process) {
            Some(Ok(threads)) => threads.install(work),
            _ => work(),
        }
    }
}
