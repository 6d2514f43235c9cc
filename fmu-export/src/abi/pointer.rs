//! From C pointers to slices, texts and references, with every check that is possible.

use fmu_core::Fault;
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::slice;

/// An array of `n` elements. NULL is an empty array.
///
/// # Safety
/// A non-NULL aligned `pointer` is readable for `n` elements, and is not written during `'a`.
#[inline]
pub(crate) unsafe fn array<'a, T>(pointer: *const T, n: usize, name: &str) -> Result<&'a [T], Fault> {
    if !fits(pointer, n) {
        return if n == 0 { Ok(&[]) } else { Err(refuse(pointer.is_null(), n, name)) };
    }
    // SAFETY: not NULL, aligned, no larger than an allocation can be; readable by the caller's promise.
    Ok(unsafe { slice::from_raw_parts(pointer, n) })
}

/// Room for `n` elements that the importer need not have initialized. NULL is empty room.
///
/// # Safety
/// A non-NULL aligned `pointer` is writable for `n` elements, and is not used elsewhere during `'a`.
#[inline]
pub(crate) unsafe fn room<'a, T>(pointer: *mut T, n: usize, name: &str) -> Result<&'a mut [MaybeUninit<T>], Fault> {
    if !fits(pointer, n) {
        return if n == 0 { Ok(&mut []) } else { Err(refuse(pointer.is_null(), n, name)) };
    }
    // SAFETY: not NULL, aligned, no larger than an allocation can be; ours by the caller's promise; it may be uninitialized.
    Ok(unsafe { slice::from_raw_parts_mut(pointer.cast(), n) })
}

/// The importer's array of `n` numbers to be written; they become 0 first.
///
/// # Safety
/// As [`room`].
#[inline]
pub(crate) unsafe fn numbers<'a>(pointer: *mut f64, n: usize, name: &str) -> Result<&'a mut [f64], Fault> {
    // SAFETY: the caller's promise.
    let room = unsafe { room(pointer, n, name)? };
    for place in room.iter_mut() {
        place.write(0.0);
    }
    // SAFETY: every element was just written, and `MaybeUninit<f64>` has the layout of `f64`.
    Ok(unsafe { slice::from_raw_parts_mut(room.as_mut_ptr().cast(), room.len()) })
}

/// A reference to one value of the importer.
///
/// # Safety
/// As [`room`] of one element.
#[inline]
pub(crate) unsafe fn place<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut MaybeUninit<T>, Fault> {
    if !fits(pointer, 1) {
        return Err(refuse(pointer.is_null(), 1, name));
    }
    // SAFETY: not NULL, aligned; ours by the caller's promise; it may be uninitialized.
    Ok(unsafe { &mut *pointer.cast() })
}

/// A C string, `None` for NULL.
///
/// # Safety
/// A non-NULL `pointer` points to bytes that end with a null byte and do not change during `'a`.
pub(crate) unsafe fn text<'a>(pointer: *const c_char) -> Option<&'a CStr> {
    // SAFETY: not NULL; terminated by the caller's promise.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
}

#[inline]
fn fits<T>(pointer: *const T, n: usize) -> bool {
    !pointer.is_null() && pointer.is_aligned() && n <= isize::MAX.unsigned_abs() / size_of::<T>()
}

#[cold]
fn refuse(null: bool, n: usize, name: &str) -> Fault {
    let why = if null { "NULL" } else { "not aligned for its type, or too long" };
    Fault::new(format!("{name} is {why}; an array of {n} is expected"))
}
