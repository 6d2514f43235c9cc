//! Small FMUs of the C sources and descriptions here, with faults, for the test programs that use them.
#![allow(dead_code, reason = "each test program uses some of it")]

use crate::zip::{Entry, write};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

/// Start of the buffer for the names of faults in a library (`fault.h`), and its length.
const BUFFER: &[u8] = b"The faults of this library: ";
const LONGEST: usize = 96;

/// A library of a C file here with these faults, which are words between blanks; `None` without a compiler. It is compiled once for
/// the same options; the faults are written into a copy.
pub fn library(source: &str, options: &[&str], faults: &str) -> Option<Vec<u8>> {
    static COMPILED: Mutex<Option<HashMap<String, Vec<u8>>>> = Mutex::new(None);
    let key = format!("{source} {}", options.join(" "));
    let mut compiled = COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    let compiled = compiled.get_or_insert_default();
    if !compiled.contains_key(&key) {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("x.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults").join(source);
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-w", "-fvisibility=hidden"]).args(options).arg(source);
        let output = cc.arg("-o").arg(&out).arg("-lm").output().ok()?;
        assert!(output.status.success(), "{key}: {}", String::from_utf8_lossy(&output.stderr));
        compiled.insert(key.clone(), std::fs::read(out).unwrap());
    }
    let mut bytes = compiled[&key].clone();
    let at = bytes.windows(BUFFER.len()).position(|window| window == BUFFER).unwrap() + BUFFER.len();
    assert!(BUFFER.len() + faults.len() < LONGEST, "{faults}");
    bytes[at..at + faults.len()].copy_from_slice(faults.as_bytes());
    bytes[at + faults.len()] = 0;
    Some(bytes)
}

/// An FMU with this description and binary.
pub fn pack_with(dir: &Path, name: &str, xml: &str, binary: &[u8]) -> PathBuf {
    let path = dir.join(format!("{name}.fmu"));
    let platform = if xml.contains("fmiVersion=\"2.0\"") { "linux64" } else { "x86_64-linux" };
    let entries = [
        Entry::new("modelDescription.xml", xml.as_bytes()),
        Entry::new(&format!("binaries/{platform}/Small.so"), binary),
        Entry::new("documentation/index.html", b"x"),
        Entry::new("terminalsAndIcons/terminalsAndIcons.xml", b"<fmiTerminalsAndIcons fmiVersion=\"3.0\"/>"),
    ];
    write(&path, &entries);
    path
}

/// Checks all rows, several at a time because some wait; fails with the problems of all rows.
pub fn each<T: Sync>(rows: &[T], look: impl Fn(&T) -> Result<(), String> + Sync) {
    let (wrong, next) = (Mutex::new(Vec::new()), Mutex::new(rows.iter()));
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                loop {
                    let Some(row) = next.lock().unwrap().next() else { return };
                    if let Err(text) = look(row) {
                        wrong.lock().unwrap().push(text);
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Faults of the symbols, in a separate library.
const OF_SYMBOLS: [&str; 4] = ["B01", "B02a", "B02b", "UNDEFINED"];

/// The small FMU with these faults; `None` without a compiler.
pub fn compile(version: u8, faults: &str) -> Option<Vec<u8>> {
    let option = format!("-DFAULT_{faults}");
    let options = if OF_SYMBOLS.contains(&faults) { &[option.as_str()][..] } else { &[] };
    library(if version == 2 { "fmu.c" } else { "fmu3.c" }, options, faults)
}

pub fn pack(dir: &Path, version: u8, fault: &str, binary: &[u8]) -> PathBuf {
    let xml = if version == 2 { include_str!("fmu.xml") } else { include_str!("fmu3.xml") };
    pack_with(dir, &format!("{version}-{fault}"), xml, binary)
}
