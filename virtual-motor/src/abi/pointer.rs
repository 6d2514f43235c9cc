//! From the pointers of C to references and values. Only this file follows one.

use crate::error::{Error, ErrorCode, Result};
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;

#[cold]
fn null(name: &str) -> Error {
    Error::value(ErrorCode::NullPointer, name, "NULL", "a pointer that is not NULL")
}

/// The place of a result.
///
/// # Safety
/// The pointer is NULL, or that of a `T` in C that nothing else uses during the call.
pub(super) unsafe fn out<'a, T>(pointer: *mut T, name: &'static str) -> Result<&'a mut MaybeUninit<T>> {
    // SAFETY: the caller's promise; the memory need not have a value yet.
    unsafe { pointer.cast::<MaybeUninit<T>>().as_mut() }.ok_or_else(|| null(name))
}

/// A value that is passed by a pointer.
///
/// # Safety
/// The pointer is NULL, or that of a `T` in C.
pub(super) unsafe fn value<T: Copy>(pointer: *const T, name: &'static str) -> Result<T> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_ref() }.copied().ok_or_else(|| null(name))
}

/// A text.
///
/// # Safety
/// The pointer is NULL, or that of a C string that lasts for the call.
pub(super) unsafe fn text<'a>(pointer: *const c_char, name: &'static str) -> Result<&'a str> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: not NULL, and the caller's promise.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|e| Error::new(ErrorCode::BadValue, format_args!("{name} is not a text in UTF-8: {e}")))
}

/// Writes a text that ends with 0 into `size` bytes; what does not fit is left out.
///
/// # Safety
/// The pointer is NULL, or that of `size` bytes that nothing else uses during the call.
pub(super) unsafe fn copy(text: &str, pointer: *mut c_char, size: usize) {
    if pointer.is_null() || size == 0 {
        return;
    }
    let text = &text[..text.floor_char_boundary(size - 1)];
    // SAFETY: `size` bytes are free to write, and the text with its 0 is not longer; a text of Rust does not overlap them.
    unsafe {
        std::ptr::copy_nonoverlapping(text.as_ptr(), pointer.cast(), text.len());
        pointer.add(text.len()).write(0);
    }
}
