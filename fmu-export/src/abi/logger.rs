//! The importer's logging callbacks.

use crate::log::{Sink, Status};
use std::ffi::{CString, c_char, c_int, c_void};

/// `fmi2CallbackLogger`: printf-like.
pub type Fmi2Logger = unsafe extern "C" fn(
    environment: *mut c_void,
    instance: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
    ...
);

/// `fmi3LogMessageCallback`.
pub type Fmi3Logger =
    unsafe extern "C" fn(environment: *mut c_void, status: c_int, category: *const c_char, message: *const c_char);

/// The logging callback of FMI 2.0: copied at instantiation, since the importer may free its struct afterwards.
pub(crate) struct Fmi2Sink {
    pub(crate) logger: Option<Fmi2Logger>,
    pub(crate) environment: *mut c_void,
    pub(crate) instance: CString,
}

/// The logging callback of FMI 3.0.
pub(crate) struct Fmi3Sink {
    pub(crate) logger: Option<Fmi3Logger>,
    pub(crate) environment: *mut c_void,
}

impl Sink for Fmi2Sink {
    fn hears(&self) -> bool {
        self.logger.is_some()
    }

    fn write(&self, status: Status, category: &str, message: &str) {
        let Some(logger) = self.logger else { return };
        // The message is a format (FMI 2.0.5, 2.1.5), and `#` begins a reference to a variable in both standards.
        let (category, message) = (c_text(category), c_text(&message.replace('%', "%%").replace('#', "##")));
        // SAFETY: the importer's function of this type; its arguments are valid during the call; no conversion is
        // left in the format, so no further argument is read.
        unsafe {
            logger(self.environment, self.instance.as_ptr(), status as c_int, category.as_ptr(), message.as_ptr());
        }
    }
}

impl Sink for Fmi3Sink {
    fn hears(&self) -> bool {
        self.logger.is_some()
    }

    fn write(&self, status: Status, category: &str, message: &str) {
        let Some(logger) = self.logger else { return };
        let (category, message) = (c_text(category), c_text(&message.replace('#', "##")));
        // SAFETY: the importer's function of this type; its arguments are valid during the call.
        unsafe { logger(self.environment, status as c_int, category.as_ptr(), message.as_ptr()) }
    }
}

/// A text for C, without null bytes, which a C string cannot contain.
fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}
