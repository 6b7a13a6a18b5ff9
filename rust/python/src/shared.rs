//! What several Python threads may hold, and long calls that leave the
//! interpreter free and still hear Ctrl-C.

use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use rover_core::caught::caught;

use crate::errors::{BorderError, Result};

/// How often a long call looks for signals.
const LOOKING: Duration = Duration::from_millis(20);

/// What several Python objects or threads may hold.
pub type Shared<T> = Mutex<T>;

/// One call at a time; a second one is refused, not kept waiting: it may
/// come from a signal handler inside the first.
pub trait Open<T> {
    /// The inside, for one call.
    ///
    /// # Errors
    /// Another call is going on.
    fn open(&self) -> Result<MutexGuard<'_, T>, BorderError>;
}

impl<T> Open<T> for Shared<T> {
    fn open(&self) -> Result<MutexGuard<'_, T>, BorderError> {
        match self.try_lock() {
            Ok(inner) => Ok(inner),
            Err(TryLockError::Poisoned(inner)) => Ok(inner.into_inner()),
            Err(TryLockError::WouldBlock) => Err(BorderError::busy()),
        }
    }
}

/// Long work without the interpreter lock.
pub trait Release {
    /// Releases the lock for a piece of work.
    ///
    /// # Errors
    /// `InternalError`: it panicked.
    fn release<T: Send>(self, work: impl FnOnce() -> T + Send) -> Result<T>;
}

impl Release for Python<'_> {
    fn release<T: Send>(self, work: impl FnOnce() -> T + Send) -> Result<T> {
        Ok(self.detach(|| caught(work))?)
    }
}

/// Runs Python's signal handlers now and then during a call that has released the interpreter lock.
pub struct Watch {
    next: Instant,
    raised: Option<PyErr>,
}

impl Watch {
    pub fn new() -> Self {
        Self {
            next: Instant::now() + LOOKING,
            raised: None,
        }
    }

    /// Whether the call may continue: false once a signal handler has raised an exception.
    pub fn go_on(&mut self) -> bool {
        if self.raised.is_none() && Instant::now() >= self.next {
            // Nothing to attach to: the interpreter is shutting down.
            self.raised = Python::try_attach(|py| py.check_signals().err()).flatten();
            self.next = Instant::now() + LOOKING;
        }
        self.raised.is_none()
    }

    /// What a handler raised.
    pub fn raised(self) -> Result<()> {
        Ok(self.raised.map_or(Ok(()), Err)?)
    }

    /// The call's result, or the exception of a signal handler.
    pub fn result<T>(self, result: Result<T, impl Into<BorderError>>) -> Result<T> {
        self.raised()?;
        result.map_err(Into::into)
    }
}
