//! Arguments and answers of the [`calls`](super::calls).

use super::log::Status;
use crate::standard::{Outcome, Refusal, judge};
use crate::trace;
use std::ffi::c_void;
use std::marker::PhantomData;
use std::ptr;

/// The answer of a call: the function, and its result if the library has the function.
pub(super) struct Answer<T = ()>(pub(super) &'static str, pub(super) Option<(Status, T)>);

impl<T> Answer<T> {
    /// The answer with another form of its value.
    pub(super) fn map<U>(self, form: impl FnOnce(T) -> U) -> Answer<U> {
        Answer(self.0, self.1.map(|(status, value)| (status, form(value))))
    }

    /// For the facade: the value of a call that succeeded.
    #[inline]
    pub(super) fn outcome(self) -> Outcome<T> {
        let (status, value) = self.1.ok_or_else(|| missing(self.0))?;
        trace::note(self.0, || status.to_string());
        judge(self.0, status).map(|()| value)
    }

    /// Whether the function returned this status.
    #[inline]
    pub(super) fn was(&self, status: Status) -> bool {
        self.1.as_ref().is_some_and(|(found, _)| *found == status)
    }

    /// For the checker; `None` if the function is missing.
    pub(super) fn result(self) -> Option<(Status, T)> {
        self.1
    }
}

impl Answer {
    /// For the checker; `None` if the function is missing.
    pub(super) fn status(self) -> Option<Status> {
        self.1.map(|(status, ())| status)
    }
}

/// The error of a call whose function is missing from the library.
#[cold]
fn missing(name: &str) -> Refusal {
    Refusal::Impossible(format!("the function {name} is missing"))
}

/// A pointer from an FMU to an instance or to a saved state, or NULL.
#[derive(Clone, Copy)]
pub(super) struct Given<'a>(pub(super) *mut c_void, PhantomData<&'a ()>);

impl Given<'_> {
    pub(super) const NULL: Self = Self(ptr::null_mut(), PhantomData);

    /// # Safety
    /// The pointer comes from the library whose functions receive it and is not freed during the lifetime, or it is NULL.
    #[inline]
    pub(super) unsafe fn new(pointer: *mut c_void) -> Self {
        Self(pointer, PhantomData)
    }
}

/// An array that a function reads, with its count.
#[derive(Clone, Copy)]
pub(super) struct Array<'a, T>(Option<&'a [T]>, pub(super) usize);

impl<'a, T> Array<'a, T> {
    /// An array that may be NULL; the count may be less than its length.
    ///
    /// # Panics
    /// The array has fewer than `n` elements.
    pub(super) fn of(values: Option<&'a [T]>, n: usize) -> Self {
        assert!(values.is_none_or(|v| n <= v.len()), "the array has fewer than n elements");
        Self(values, n)
    }

    /// The pointer, for a function that takes the count from another array.
    pub(super) fn holding(&self, n: usize) -> *const T {
        assert!(self.0.is_none_or(|v| n <= v.len()), "the array has fewer than n elements");
        self.0.map_or(ptr::null(), <[T]>::as_ptr)
    }

    #[inline]
    pub(super) fn pointer(&self) -> *const T {
        self.0.map_or(ptr::null(), <[T]>::as_ptr)
    }
}

impl<'a, T> From<&'a [T]> for Array<'a, T> {
    #[inline]
    fn from(values: &'a [T]) -> Self {
        Self(Some(values), values.len())
    }
}

/// An array that a function writes, with its count.
pub(super) struct ArrayMut<'a, T>(Option<&'a mut [T]>, pub(super) usize);

impl<'a, T> ArrayMut<'a, T> {
    /// Like [`Array::of`].
    ///
    /// # Panics
    /// The array has fewer than `n` elements.
    pub(super) fn of(values: Option<&'a mut [T]>, n: usize) -> Self {
        assert!(values.as_ref().is_none_or(|v| n <= v.len()), "the array has fewer than n elements");
        Self(values, n)
    }

    pub(super) fn holding(&mut self, n: usize) -> *mut T {
        assert!(self.0.as_ref().is_none_or(|v| n <= v.len()), "the array has fewer than n elements");
        self.pointer()
    }

    #[inline]
    pub(super) fn pointer(&mut self) -> *mut T {
        self.0.as_mut().map_or(ptr::null_mut(), |v| v.as_mut_ptr())
    }
}

impl<'a, T> From<&'a mut [T]> for ArrayMut<'a, T> {
    #[inline]
    fn from(values: &'a mut [T]) -> Self {
        let n = values.len();
        Self(Some(values), n)
    }
}
