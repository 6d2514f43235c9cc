//! The text of a panic where panics do not unwind: in a module of WebAssembly, a panic ends the call in the host, which then
//! reads the text.

use super::gate::panicked;
use super::types::Text;
use std::ffi::CString;
use std::panic::PanicHookInfo;
use std::ptr::null;
use std::sync::Mutex;

static TEXT: Mutex<Option<CString>> = Mutex::new(None);

/// Keeps the message and location of a panic. If panics unwind, the gate reports them, and no text is stored.
pub(super) fn keep(info: &PanicHookInfo<'_>) {
    if cfg!(panic = "unwind") {
        return;
    }
    let place = info.location().map(|at| format!(" ({}:{})", at.file(), at.line())).unwrap_or_default();
    let text = format!("{}{place}", panicked(info.payload()));
    // A second panic while the first is being reported must not cause a deadlock.
    if let Ok(mut kept) = TEXT.try_lock() {
        *kept = CString::new(text.replace('\0', " ")).ok();
    }
}

/// The text; it remains valid until the next panic.
pub(super) fn text() -> Text {
    TEXT.try_lock().ok().and_then(|kept| kept.as_ref().map(|text| text.as_ptr())).unwrap_or(null())
}
