//! Messages of the importer's logger.

use fmu_export::abi::types::*;
use std::cell::RefCell;
use std::ffi::CStr;

/// One message of the logger.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    pub instance: Option<String>,
    pub status: c_int,
    pub category: String,
    pub text: String,
}

/// Record of the logger. Its address is the environment pointer, so it lives in an [`Rc`](std::rc::Rc): moving a `Box` asserts
/// that no other pointer to the content is in use.
#[derive(Default)]
pub struct Journal(pub RefCell<Vec<Message>>);

fn string(text: Text) -> String {
    unsafe { CStr::from_ptr(text) }.to_str().unwrap().into()
}

pub extern "C" fn log2(environment: *mut c_void, name: Text, status: c_int, category: Text, text: Text) {
    let journal = unsafe { &*environment.cast::<Journal>() };
    let (instance, category, text) = (Some(string(name)), string(category), string(text));
    journal.0.borrow_mut().push(Message { instance, status, category, text });
}

pub extern "C" fn log3(environment: *mut c_void, status: c_int, category: Text, text: Text) {
    let journal = unsafe { &*environment.cast::<Journal>() };
    let (category, text) = (string(category), string(text));
    journal.0.borrow_mut().push(Message { instance: None, status, category, text });
}

/// Whether instances of a standard can have a logger here: Miri rightly refuses [`variadic`].
pub const fn has_logger(version: u8) -> bool {
    !(cfg!(miri) && version == 2)
}

/// A function with fixed arguments as the variadic logger: the first five are passed in the same way on our platforms.
pub fn variadic(f: extern "C" fn(*mut c_void, Text, c_int, Text, Text)) -> Fmi2Logger {
    unsafe { std::mem::transmute(f) }
}
