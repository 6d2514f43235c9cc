//! Where a panic began, for its message; and its text where panics do not unwind: in a module of WebAssembly, a panic ends the call
//! in the host, which then reads the text.

use super::types::Text;
use fmu_core::Fault;
use std::any::Any;
use std::cell::RefCell;
use std::ffi::CString;
use std::panic::PanicHookInfo;
use std::ptr::null;
use std::sync::Mutex;

static TEXT: Mutex<Option<CString>> = Mutex::new(None);

thread_local! {
    /// File and line of the last panic of this thread.
    static PLACE: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Keeps the location of a panic and, if panics do not unwind, its message: otherwise the gate reports it.
pub(super) fn keep(info: &PanicHookInfo<'_>) {
    let place = info.location().map(|at| format!("{}:{}", at.file().trim_start_matches("./"), at.line()));
    // A second panic while the first is being reported must not cause a deadlock or a third.
    let _ = PLACE.try_with(|kept| kept.try_borrow_mut().map(|mut kept| *kept = place));
    if cfg!(panic = "unwind") {
        return;
    }
    keep_text(&panicked(info.payload()).to_string());
}

fn keep_text(text: &str) {
    if let Ok(mut kept) = TEXT.try_lock() {
        *kept = CString::new(text.replace('\0', " ")).ok();
    }
}

/// The message of a panic, with the file and the line where it began.
pub(super) fn panicked(payload: &(dyn Any + Send)) -> Fault {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    let place = PLACE.try_with(|kept| kept.try_borrow_mut().ok()?.take()).ok().flatten();
    let place = place.map(|place| format!(" ({place})")).unwrap_or_default();
    Fault::new(format!("a fault in the model's code (panic): {}{place}", text.unwrap_or("no message")))
}

/// The text; it remains valid until the next panic.
pub(super) fn text() -> Text {
    TEXT.try_lock().ok().and_then(|kept| kept.as_ref().map(|text| text.as_ptr())).unwrap_or(null())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;
    use std::panic::{catch_unwind, set_hook, take_hook};

    #[test]
    fn a_panic_is_reported_with_its_place_once() {
        let before = take_hook();
        set_hook(Box::new(keep));
        let payload = catch_unwind(|| panic!("no more than {} A", 5)).unwrap_err();
        set_hook(before);
        let line = line!() - 2;
        let said = panicked(payload.as_ref()).to_string();
        let wanted = "a fault in the model's code (panic): no more than 5 A";
        assert!(said.starts_with(wanted) && said.ends_with(&format!("abi/fault.rs:{line})")), "{said}");
        assert_eq!(panicked(payload.as_ref()).to_string(), wanted);
    }
    #[test]
    #[expect(clippy::undocumented_unsafe_blocks, reason = "a host reads the text")]
    fn a_host_reads_the_last_text() {
        assert!(text().is_null());
        for (kept, read) in [("no more than 5 A", c"no more than 5 A"), ("a\0b", c"a b"), ("", c"")] {
            keep_text(kept);
            assert_eq!(unsafe { CStr::from_ptr(text()) }, read);
        }
    }
}
