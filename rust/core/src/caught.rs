//! Panics of this library, caught: a fault of ours ends the call that met it, not the caller's
//! program.

use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Where this thread has panicked last.
    static PLACE: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// A panic that was caught.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("internal error{}: {message}", place.as_ref().map_or(String::new(), |own| format!(" at {own}")))]
pub struct Fault {
    /// What the panic said.
    pub message: String,
    /// Source file, line and column, after [`remember_places`].
    pub place: Option<String>,
}

/// From now on every thread remembers where it panics. The hook before goes on to report panics.
pub fn remember_places() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            let place = panic.location().map(ToString::to_string);
            let _ = PLACE.try_with(|own| own.replace(place));
            before(panic);
        }));
    });
}

/// What a call returns, or the panic that ended it. What it has left half done is the caller's
/// matter: state is restored, scratch made anew.
///
/// # Errors
/// `Fault`: it panicked.
pub fn caught<R>(call: impl FnOnce() -> R) -> Result<R, Fault> {
    catch_unwind(AssertUnwindSafe(call)).map_err(|payload| Fault {
        message: message_of(&*payload),
        place: PLACE.with(RefCell::take),
    })
}

fn message_of(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic without a message".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_fault_with_its_message_and_place() {
        remember_places();
        let entries = [1, 2, 3];
        let fault = caught(|| entries[entries.len()]).unwrap_err();
        assert!(fault.message.contains("out of bounds"), "{fault}");
        let place = fault.place.clone().unwrap();
        assert!(place.contains("caught.rs"), "{place}");
        assert!(
            fault
                .to_string()
                .starts_with(&format!("internal error at {place}: index"))
        );
        assert_eq!(caught(|| entries[0]), Ok(1));
    }
}
