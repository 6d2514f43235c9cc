//! The calls of one thread as lines, `fmi3DoStep -> OK`, for a user who wants to follow a run.

use std::cell::{Cell, RefCell};

thread_local! {
    static ON: Cell<bool> = const { Cell::new(false) };
    static LINES: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// Does the work; returns its result and a line for each FMU call that this thread makes meanwhile.
pub fn traced<T>(work: impl FnOnce() -> T) -> (T, Vec<String>) {
    /// Ends the trace, also when the work panics.
    struct Off;
    impl Drop for Off {
        fn drop(&mut self) {
            ON.set(false);
        }
    }
    LINES.take();
    ON.set(true);
    let off = Off;
    let result = work();
    drop(off);
    (result, LINES.take())
}

/// Records a call and its result.
#[inline]
pub(crate) fn note(function: &str, ended: impl FnOnce() -> String) {
    if ON.get() {
        LINES.with_borrow_mut(|lines| lines.push(format!("{function} -> {}", ended())));
    }
}
