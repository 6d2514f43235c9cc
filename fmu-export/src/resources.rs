//! The folder of the FMU's resources, as passed by an importer.

use std::ffi::CStr;
use std::path::PathBuf;

/// The folder, from the URI of FMI 2.0 (2.0.5, 2.1.5: `file:///`, with percent codes) or the path of FMI 3.0 (3.0.2, 2.3.1).
/// Importers also use other forms, to which neither standard gives another meaning: `file:/` and `file://localhost/`, a path in
/// FMI 2.0, a URI in FMI 3.0. `None` for NULL, for an empty text, and for another scheme.
pub(crate) fn folder(location: Option<&CStr>) -> Option<PathBuf> {
    let location = location?.to_bytes();
    let scheme = location.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case(b"file:"));
    let Some(scheme) = scheme else {
        let other = location.windows(3).any(|part| part == b"://");
        return (!location.is_empty() && !other).then(|| path(location.to_vec()));
    };
    let rest = &location[scheme.len()..];
    let local = match rest.strip_prefix(b"//") {
        Some(rest) => {
            let rest = rest.strip_prefix(b"localhost").unwrap_or(rest);
            // Another computer.
            rest.first().filter(|first| **first == b'/')?;
            rest
        }
        None => rest,
    };
    let decoded = decode(local);
    // On Windows, file:///C:/folder.
    let drive = matches!(decoded.as_slice(), [b'/', letter, b':', ..] if letter.is_ascii_alphabetic());
    Some(path(if drive && cfg!(windows) { decoded[1..].to_vec() } else { decoded }))
}

/// Replaces percent codes by their bytes (RFC 3986, 2.1); anything else stays as it is.
fn decode(text: &[u8]) -> Vec<u8> {
    let digit = |byte: Option<&u8>| char::from(*byte?).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    let (mut decoded, mut i) = (Vec::with_capacity(text.len()), 0);
    while i < text.len() {
        let code = (text[i] == b'%').then(|| Some(16 * digit(text.get(i + 1))? + digit(text.get(i + 2))?)).flatten();
        decoded.push(code.unwrap_or(text[i]));
        i += if code.is_some() { 3 } else { 1 };
    }
    decoded
}

#[cfg(unix)]
fn path(bytes: Vec<u8>) -> PathBuf {
    use std::os::unix::ffi::OsStringExt;
    std::ffi::OsString::from_vec(bytes).into()
}

/// Both standards have texts in UTF-8.
#[cfg(not(unix))]
fn path(bytes: Vec<u8>) -> PathBuf {
    String::from_utf8_lossy(&bytes).into_owned().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(location: &str) -> Option<PathBuf> {
        folder(Some(&std::ffi::CString::new(location).unwrap()))
    }

    #[test]
    fn every_form_in_use_is_understood() {
        for location in [
            "file:///tmp/a%20b/resources",
            "file:/tmp/a%20b/resources",
            "FILE://localhost/tmp/a%20b/resources",
            "file:///tmp/a b/resources",
            "/tmp/a b/resources",
        ] {
            assert_eq!(of(location), Some("/tmp/a b/resources".into()), "{location}");
        }
        assert_eq!(of("/tmp/50%25/"), Some("/tmp/50%25/".into()), "a path has no percent codes");
        assert_eq!(of("file:///tmp/50%/%zz/%c3%BC"), Some("/tmp/50%/%zz/ü".into()));
        for none in ["", "http://example.org/resources", "file://server/share"] {
            assert_eq!(of(none), None, "{none}");
        }
        assert_eq!(folder(None), None);
    }
}
