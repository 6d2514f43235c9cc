//! Paths that exist only on the machine where the FMU was built: files below a user's home folder.

use crate::check::Verdict;
use crate::checks::file::shared::libraries::libraries;
use crate::fmu_file::FmuFile;
use fmu_import::machine;
use model_description::BaseType;
use object::{Object, ObjectSection, SectionKind};

/// Where home folders are, on Linux, macOS and Windows; on Unix a user name follows, except for root.
const HOMES: [&str; 4] = ["/home/", "/Users/", "/root/", ":\\Users\\"];

/// Extensions of source files and of compiler outputs. Messages of a panic or an assertion name a source, and a library may name
/// the file of its symbols: no program opens them.
const SOURCES: [&str; 28] = [
    "rs", "c", "h", "cc", "cpp", "cxx", "c++", "hh", "hpp", "hxx", "inc", "inl", "s", "asm", "f", "f90", "for", "mo",
    "mos", "py", "pyx", "go", "java", "pas", "adb", "o", "obj", "pdb",
];

/// Folders of packages and compilers; messages also contain paths of their sources.
const TOOLS: [&str; 4] = ["/.cargo/", "/.rustup/", "\\.cargo\\", "\\.rustup\\"];

/// Further findings in one library are alike.
const MOST: usize = 5;

/// Reads the parts of a library that are loaded at run time, without debug information, and the start values of strings.
pub(crate) fn paths(fmu: &FmuFile) -> Verdict {
    let mut found = Vec::new();
    for binary in libraries(fmu) {
        let paths = binary.bytes().and_then(|bytes| in_library(&bytes));
        let Ok(mut paths) = paths else { continue };
        paths.sort();
        paths.dedup();
        found.extend(paths.into_iter().take(MOST).map(|path| format!("{}: contains {path}", binary.name)));
    }
    let variables = fmu.description.iter().flat_map(|d| &d.variables).filter(|v| v.base == BaseType::String);
    for v in variables {
        let start = v.start.as_deref().unwrap_or_default();
        if let Some(path) = first(start.as_bytes()).or_else(|| on_a_drive(start)) {
            found.push(format!("line {}: the start value of {} is {path}", v.line, v.name));
        }
    }
    Verdict::of(found)
}

fn in_library(bytes: &[u8]) -> Result<Vec<String>, String> {
    let mut found = Vec::new();
    for image in machine::images(bytes)? {
        let file = object::File::parse(image).map_err(|e| e.to_string())?;
        let read = |kind| {
            use SectionKind::{Data, ReadOnlyData, ReadOnlyDataWithRel, ReadOnlyString};
            matches!(kind, Data | ReadOnlyData | ReadOnlyDataWithRel | ReadOnlyString)
        };
        for data in file.sections().filter(|s| read(s.kind())).filter_map(|s| s.data().ok()) {
            let starts = data.iter().enumerate().filter(|(_, byte)| matches!(byte, b'/' | b':'));
            found.extend(starts.filter_map(|(at, _)| path_at(data, at)));
        }
    }
    Ok(found)
}

/// The first such path in a text.
fn first(text: &[u8]) -> Option<String> {
    (0..text.len()).find_map(|at| path_at(text, at))
}

/// A text that begins with the letter of a drive.
fn on_a_drive(text: &str) -> Option<String> {
    let mut bytes = text.bytes();
    let drive = bytes.next()?.is_ascii_alphabetic() && bytes.next()? == b':' && matches!(bytes.next()?, b'/' | b'\\');
    drive.then(|| text.to_owned())
}

/// The path whose home folder begins here, if it names a file or folder that a program might open.
fn path_at(text: &[u8], at: usize) -> Option<String> {
    let home = HOMES.iter().find(|home| text[at..].starts_with(home.as_bytes()))?;
    let windows = home.starts_with(':');
    let before = &text[..at];
    let begins = match before.last() {
        None => true,
        Some(letter) if windows => letter.is_ascii_alphabetic(),
        Some(b'/') => before.ends_with(b"file://"),
        Some(other) => !(other.is_ascii_alphanumeric() || b"._-~}".contains(other)),
    };
    if !begins {
        return None;
    }
    let within = |byte: &u8| byte.is_ascii_graphic() && !b"\"'<>|:*?;,()[]{}$`%".contains(byte) || *byte >= 0x80;
    let rest = &text[at + home.len()..];
    let rest = &rest[..rest.iter().position(|byte| !within(byte)).unwrap_or(rest.len())];
    let rest = std::str::from_utf8(rest).ok()?.trim_end_matches(['/', '\\', '.']);
    let parts = rest.split(['/', '\\']).filter(|part| !part.is_empty()).count();
    let path = format!("{}{home}{rest}", if windows { char::from(*before.last()?).to_string() } else { String::new() });
    let ending = rest.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
    let is_source = ending.is_some_and(|ending| {
        // Texts of Rust follow each other without an end.
        SOURCES.contains(&ending.as_str()) || rest.contains(".rs")
    });
    let below_a_user = parts > usize::from(*home != "/root/");
    (below_a_user && !is_source && !TOOLS.iter().any(|tool| path.contains(tool))).then_some(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_a_machine_is_told_from_the_name_of_a_source() {
        let path = |text: &str| first(text.as_bytes());
        for (text, found) in [
            ("/home/ann/model/table.csv", Some("/home/ann/model/table.csv")),
            ("x\0/Users/ann/model/\0", Some("/Users/ann/model")),
            ("open file:///home/ann/t.mat: no", Some("/home/ann/t.mat")),
            ("\"/root/data\"", Some("/root/data")),
            ("D:\\Users\\ann\\t.txt", Some("D:\\Users\\ann\\t.txt")),
            ("/home/ann/model/src/lib.rscalled `unwrap`", None),
            ("/home/ann/.cargo/registry/src/x/table", None),
            ("/home/ann/model.c:12: assertion", None),
            ("C:\\Users\\ann\\x.pdb", None),
            ("/home/%s/table.csv", None),
            ("/home/ann", None),
            ("https://x.org/home/ann/table.csv", None),
            ("/srv/home/ann/table.csv", None),
            ("/usr/share/table.csv", None),
        ] {
            assert_eq!(path(text).as_deref(), found, "{text}");
        }
        assert_eq!(on_a_drive("e:/tables/x.txt").as_deref(), Some("e:/tables/x.txt"));
        assert!(["a:b", "", "e:", "https://x.org"].iter().all(|text| on_a_drive(text).is_none()));
    }
}
