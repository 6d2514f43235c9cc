//! `fmu prove` of FMUs whose inputs and outputs are not all real numbers.

use super::{archive, packed};
use model_description::FmiVersion::V3;
use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// An archive with the reference files of a run that `stimuli` feed, the first text of `change` replaced by the second.
fn fed(package: &str, stimuli: &str, folder: &Path, change: (&str, &str)) -> PathBuf {
    let (plain, file) = (archive(package, V3), folder.join("stimuli.csv"));
    fs::write(&file, stimuli).unwrap();
    let library = super::package::library(package);
    let description = fmu_import::describe(&library, None, fmu_core::description::Dependencies::Omitted).unwrap();
    let more = fmu_pack::reference::files(&plain, &description, &file, None).unwrap();
    let (_, files) = fmu_import::contents(&plain).unwrap();
    let changed = |bytes| String::from_utf8(bytes).unwrap().replace(change.0, change.1).into_bytes();
    let more = more.into_iter().map(|(name, entry)| (name, changed(entry.bytes)));
    let all: BTreeMap<_, _> = files.into_iter().chain(more).collect();
    let path = folder.join(plain.file_name().unwrap());
    let mut zip = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    for (name, bytes) in all {
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&bytes).unwrap();
    }
    zip.finish().unwrap();
    path
}

fn prove(folder: &Path, archives: &[PathBuf]) -> Output {
    let python = super::python::environment(Path::new("tests/fmpy/requirements.txt"));
    let mut fmu = Command::new(env!("CARGO_BIN_EXE_fmu"));
    fmu.arg("prove").arg(folder).args(archives).arg("--python").arg(python).output().unwrap()
}

/// Integers and arrays, in this program and in FMPy: an array is a column with spaces between its elements.
#[test]
fn arrays_and_integers_are_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let array = "\"time\",\"u\"\n0,1 2 3\n4,1 2 3\n4,-1 0 2.5\n10,-1 0 2.5\n";
    let mut archives = packed("stair");
    archives.push(fed("state-space", array, folder.path(), ("\0", "")));
    let output = prove(&folder.path().join("out"), &archives);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("not replayed"), "{said}");
    let read = |file: &str| fs::read_to_string(folder.path().join("out/fmi3").join(file)).unwrap();
    let stair = read("Stair/Stair_ref.csv");
    assert!(stair.starts_with("\"time\",\"counter\"\n0,1\n") && stair.trim_end().ends_with(",10"), "{stair}");
    let y = read("StateSpace/StateSpace_ref.csv");
    let line = |k: usize| y.lines().nth(k).unwrap();
    assert_eq!((line(0), line(1), y.lines().count()), ("\"time\",\"y\"", "0,1 2 3", 12));
    assert!(line(11).split(',').nth(1).unwrap().split(' ').count() == 3 && line(11) != line(10), "{y}");
    assert!(read("StateSpace/StateSpace_in.csv").contains(",-1 0 2.5\n"));
    for name in ["Stair", "StateSpace"] {
        let readme = read(&format!("{name}/Readme.txt"));
        assert!(readme.contains("fmu 0.1.0: 0.0e0\n") && readme.contains("FMPy 0.3.32: "), "{readme}");
    }
    assert!(read("StateSpace/Readme.txt").contains("arrays, structural parameters"));
}

/// A reference with a wrong element is found, by each importer.
#[test]
fn a_wrong_element_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = fed("state-space", "time,u\n0,1 2 3\n", folder.path(), ("\n0,1 2 3\n1,", "\n0,1 2 1e6\n1,"));
    let output = prove(&folder.path().join("out"), &[path]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert_eq!(said.matches(": 1.0e0").count(), 2, "{said}");
}

/// FMPy records bytes but not texts.
#[test]
fn outputs_that_fmpy_does_not_record_are_left_out_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = fed("feedthrough", "time,Int32_input\n0,3\n1,3\n", folder.path(), ("\0", ""));
    let output = prove(&folder.path().join("out"), &[path]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("not replayed"), "{said}");
    let readme = fs::read_to_string(folder.path().join("out/fmi3/Feedthrough/Readme.txt")).unwrap();
    assert!(readme.contains("FMPy 0.3.32: 0.0e0\n"), "{readme}");
}

/// Feeds texts and bytes in this program, because FMPy cannot feed them.
#[test]
fn texts_and_bytes_are_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let stimuli = "time,Int32_input,String_input,Binary_input,Float64_continuous_input\n\
                   0,3,\"a, b\",00ff,0\n1,4,\"say \"\"so\"\"\",,1\n2,4,c,aa,1\n";
    let path = fed("feedthrough", stimuli, folder.path(), ("\0", ""));
    let output = prove(&folder.path().join("out"), &[path]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("not replayed in FMPy: FMPy feeds no texts"), "{said}");
    let read = |file: &str| fs::read_to_string(folder.path().join("out/fmi3/Feedthrough").join(file)).unwrap();
    assert!(read("Readme.txt").contains("fmu 0.1.0: 0.0e0\n"));
    let inputs = read("Feedthrough_in.csv");
    assert!(inputs.contains(",4,\"say \"\"so\"\"\",,1\n") && inputs.contains(",3,\"a, b\",00ff,"), "{inputs}");
}
