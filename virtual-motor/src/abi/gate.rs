//! The gate: every exported function that can fail passes through it. It catches panics, and keeps the text of the thread's last
//! error.

use crate::error::{Error, ErrorCode, Result};
use std::any::Any;
use std::cell::RefCell;
use std::fmt::Write as _;
use std::mem::MaybeUninit;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Size in bytes of the longest text that is kept.
const LONGEST: usize = 1024;

/// A text of limited length, which is never allocated.
struct Kept {
    bytes: [u8; LONGEST],
    len: usize,
}

thread_local! {
    static LAST: RefCell<Kept> = const { RefCell::new(Kept { bytes: [0; LONGEST], len: 0 }) };
}

impl std::fmt::Write for Kept {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        // Ends before a character that does not fit.
        let end = text.floor_char_boundary(LONGEST - self.len);
        self.bytes[self.len..self.len + end].copy_from_slice(&text.as_bytes()[..end]);
        self.len += end;
        Ok(())
    }
}

/// Runs the body of an exported function; returns 0, or the code of the error.
pub(super) fn gate(body: impl FnOnce() -> Result<()>) -> i32 {
    // A panic leaves its motor marked as busy: later calls on it are refused.
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => 0,
        Ok(Err(error)) => fail(&error),
        Err(payload) => fail(&Error::new(ErrorCode::Panicked, format_args!("panic: {}", said(payload.as_ref())))),
    }
}

/// [`gate`] for a function with a result, which is made only if there is a place for it.
pub(super) fn give<T>(place: Result<&mut MaybeUninit<T>>, make: impl FnOnce() -> Result<T>) -> i32 {
    gate(|| {
        place?.write(make()?);
        Ok(())
    })
}

#[cold]
fn fail(error: &Error) -> i32 {
    LAST.with_borrow_mut(|last| {
        last.len = 0;
        // Never fails.
        let _ = write!(last, "{error}");
    });
    error.code() as i32
}

fn said(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no text")
}

/// Passes the text of the thread's last error to `show`.
pub(super) fn last<T>(show: impl FnOnce(&str) -> T) -> T {
    LAST.with_borrow(|last| show(str::from_utf8(&last.bytes[..last.len]).unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::VirtualMotor;
    use crate::pool;

    #[test]
    fn a_panic_ends_the_call_and_the_motor() {
        let id = pool::insert(|| Ok(VirtualMotor::default())).unwrap();
        let call = |body: fn(&mut VirtualMotor) -> Result<()>| gate(|| pool::with(id, body));
        assert_eq!(call(|motor| motor.advance_duties(1e-4, [0.5; 3], true)), 0);
        assert_eq!(call(|_| panic!("a bug, on purpose")), ErrorCode::Panicked as i32);
        last(|text| assert_eq!(text, "panic: a bug, on purpose"));
        assert_eq!(call(|motor| motor.advance_duties(2e-4, [0.5; 3], true)), ErrorCode::Panicked as i32);
        last(|text| assert!(text.ends_with("an earlier call on this motor panicked: destroy it"), "{text}"));
        assert!(pool::contains(id));
        assert_eq!(gate(|| pool::remove(id)), 0);
        assert_eq!(call(|_| Ok(())), ErrorCode::BadId as i32);
        // The slot is free for another motor.
        let next = pool::insert(|| Ok(VirtualMotor::default())).unwrap();
        assert_eq!(gate(|| pool::with(next, |motor| motor.advance_duties(1e-4, [0.5; 3], true))), 0);
        pool::remove(next).unwrap();
    }

    #[test]
    fn a_long_text_ends_with_a_whole_character() {
        let text = "\u{3c8}".repeat(LONGEST);
        assert_eq!(gate(|| Err(Error::new(ErrorCode::BadFile, format_args!("x{text}")))), ErrorCode::BadFile as i32);
        last(|kept| assert_eq!((kept.len(), kept.starts_with("x\u{3c8}")), (LONGEST - 1, true)));
    }
}
