//! Shared libraries: loading one, and finding its functions.

use crate::abi::journal::{self, Call};
use crate::error::Error;
use crate::text::file_uri;
use fmu_core::description::Dependencies;
use libloading::Library;
use std::ffi::{CString, c_char, c_int, c_void};
use std::path::Path;

/// Loads a shared library.
pub(super) fn load(path: &Path) -> Result<Library, Error> {
    // SAFETY: loading runs the library's initializers. That is inherent in running an FMU: its code has every right of this
    // process, and the user named the file.
    unsafe { Library::new(path) }.map_err(|e| Error::file(path, reason(&e)))
}

/// The system's error message, which libloading wraps, with what may be done about it.
fn reason(error: &libloading::Error) -> String {
    advised(std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string))
}

fn advised(reason: String) -> String {
    if reason.contains("failed to map segment") {
        let folder = std::env::temp_dir();
        let cause =
            format!("the folder for temporary files, {}, may be mounted without execution (noexec)", folder.display());
        return format!("{reason}: {cause}; set TMPDIR to another one");
    }
    if reason.contains("undefined symbol: Py") || reason.contains("undefined symbol: _Py") {
        let remedy = "preload it, LD_PRELOAD=libpython3.X.so.1.0, or run the FMU with fmurun";
        return format!("{reason}: the FMU needs Python's library: {remedy}");
    }
    reason
}

type Sink = extern "C" fn(context: *mut c_void, bytes: *const u8, len: usize);
type Describe =
    unsafe extern "C" fn(sink: Sink, context: *mut c_void, resources: *const c_char, dependencies: c_int) -> c_int;

/// The description that a library made with `fmu_export::export!` returns, with the folder of the model's resources. Large
/// models take seconds to find their dependencies.
///
/// # Errors
/// The file is not a library for this platform, or was not built with this version of the exporter; or the model refuses its
/// resources.
pub fn describe(
    path: &Path,
    resources: Option<&Path>,
    dependencies: Dependencies,
) -> Result<fmu_core::Description, Error> {
    extern "C" fn collect(context: *mut c_void, bytes: *const u8, len: usize) {
        if context.is_null() || bytes.is_null() {
            return;
        }
        // SAFETY: the context is the vector below, not borrowed elsewhere during the call; the library promises `len`
        // bytes.
        let (text, bytes) = unsafe { (&mut *context.cast::<Vec<u8>>(), std::slice::from_raw_parts(bytes, len)) };
        text.extend_from_slice(bytes);
    }
    let library = load(path)?;
    let resources = resources.map(|folder| CString::new(file_uri(folder)).unwrap_or_default());
    let resources = resources.as_ref().map_or(std::ptr::null(), |uri| uri.as_ptr());
    let mut json: Vec<u8> = Vec::new();
    // SAFETY: the symbol belongs to this exporter, which gives it this type.
    let describe = unsafe { library.get::<Describe>("fmu_description") }.map_err(|_| {
        Error::file(path, "has no function fmu_description: not a library made with fmu_export::export!")
    })?;
    let dependencies = c_int::from(dependencies == Dependencies::Probed);
    journal::note(journal::name(&path.to_string_lossy()), Call::Describe);
    // SAFETY: the function calls the sink with the context, before it returns; both live until then, and so does the text.
    let status = unsafe { describe(collect, (&raw mut json).cast(), resources, dependencies) };
    if status != 0 {
        let said = String::from_utf8_lossy(&json);
        return Err(Error::file(path, format!("fmu_description returned {status}: {said}")));
    }
    serde_json::from_slice(&json).map_err(|e| Error::file(path, format!("the description is of another version: {e}")))
}

#[cfg(test)]
mod tests {
    use super::advised;

    #[test]
    fn a_library_that_does_not_load_says_what_may_help() {
        let said = advised("M.so: failed to map segment from shared object".into());
        assert!(said.ends_with("may be mounted without execution (noexec); set TMPDIR to another one"), "{said}");
        assert!(said.contains(&std::env::temp_dir().display().to_string()), "{said}");
        let said = advised("M.so: undefined symbol: _Py_NoneStruct".into());
        assert!(said.contains("LD_PRELOAD") && said.contains("fmurun"), "{said}");
        assert_eq!(advised("M.so: file too short".into()), "M.so: file too short");
    }
}
