//! The scripts of the HTML page repeat a finding in FMPy.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::zip::{Entry, write};
use crate::{PROGRAM, common};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A small FMU of fmu-check's tests with a fault; `None` without a compiler.
fn faulty(dir: &Path, (source, xml, version): (&str, &str, u8), fault: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fmu-check/tests/faults");
    let library = dir.join("Small.so");
    let mut cc = Command::new("cc");
    cc.args(["-shared", "-fPIC", "-O1", "-w", "-fvisibility=hidden"]).arg(format!("-DFAULTS=\"{fault}\""));
    if version == 3 {
        cc.arg("-DFMI3");
    }
    let output = cc.arg(folder.join(source)).arg("-o").arg(&library).arg("-lm").output().ok()?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let path = dir.join(format!("{fault}{version}.fmu"));
    let (xml, library) = (std::fs::read(folder.join(xml)).unwrap(), std::fs::read(library).unwrap());
    let platform = if version == 2 { "linux64" } else { "x86_64-linux" };
    let entries =
        [Entry::new("modelDescription.xml", &xml), Entry::new(&format!("binaries/{platform}/Small.so"), &library)];
    write(&path, &entries);
    Some(path)
}

/// The script of a check on the page.
fn script(page: &str, id: &str) -> String {
    let scripts = page.split("<summary>Repeat it in FMPy</summary><pre>").skip(1);
    let mut scripts = scripts.map(|rest| rest.split("</pre>").next().unwrap());
    let found = scripts.find(|script| script.starts_with(&format!("# {id}: "))).unwrap_or_else(|| panic!("no {id}"));
    found.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&")
}

/// An FMU: source, description, major version of the standard.
type Source = (&'static str, &'static str, u8);

const SMALL2: Source = ("fmu.c", "fmu.xml", 2);
const SMALL3: Source = ("fmu3.c", "fmu3.xml", 3);
const BOTH2: Source = ("exchange.c", "exchange2.xml", 2);
const BOTH3: Source = ("exchange.c", "exchange3.xml", 3);

/// Of each: the FMU, the fault, the check, and a line that the script prints.
const REPEATED: &[(Source, &str, &str, &str)] = &[
    (SMALL2, "L06", "L06", "fmi2Reset -> OK"),
    (SMALL2, "F02", "F02a", "fmi2SetFMUState -> OK"),
    (SMALL2, "G13", "G13", "the parameter gain was"),
    (SMALL2, "X04", "X04", "guid="),
    (SMALL2, "T03", "T03", "results with steps of"),
    (SMALL2, "NOISE", "T10", "differs between two runs"),
    (SMALL2, "L04g", "L04a", "[2] fmi2Instantiate"),
    (SMALL3, "G02", "G02", "fmi3"),
    (SMALL3, "F02", "F02b", "fmi3SetFMUState -> OK"),
    (SMALL3, "L12", "L12", "fmi3DoStep"),
    (BOTH2, "E06k", "E06a", "fmi2SetContinuousStates("),
    (BOTH2, "E19t", "E19", "in Model Exchange"),
    (BOTH3, "E16", "E16", "fmi3EnterContinuousTimeMode -> OK"),
    (BOTH3, "E12", "E12", "fmi3Reset -> OK"),
];

/// The scripts run in FMPy and reproduce the checker's findings there; on the FMU without the fault they find nothing.
#[test]
fn the_scripts_of_the_page_repeat_their_findings() {
    let dir = tempfile::tempdir().unwrap();
    let python =
        common::python::environment(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/requirements.txt"));
    let repeat = |script: &Path, fmu: &Path| {
        let output = Command::new(&python).arg(script).arg(fmu).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    for (small, fault, id, line) in REPEATED {
        let Some(fmu) = faulty(dir.path(), *small, fault) else { return };
        let mut command = Command::new(PROGRAM);
        let output = command.arg("check").arg(&fmu).args(["--format", "html", "--only", id]).output().unwrap();
        let path = dir.path().join(format!("{id}.py"));
        std::fs::write(&path, script(&String::from_utf8_lossy(&output.stdout), id)).unwrap();
        let (status, printed) = repeat(&path, &fmu);
        assert!(status == Some(0) && printed.contains(line), "{fault}, {id}: {status:?}: {printed}");
        let (status, printed) = repeat(&path, &faulty(dir.path(), *small, "NONE").unwrap());
        assert_eq!(status, Some(1), "NONE, {id}: {printed}");
    }
    // Of the file: the line of the description and FMPy's own findings.
    let fmu = faulty(dir.path(), SMALL2, "NONE").unwrap();
    let broken = dir.path().join("broken.fmu");
    let xml = include_str!("../../fmu-check/tests/faults/fmu.xml")
        .replace("initial=\"calculated\"><Real/>", "><Real start=\"1\"/>");
    write(&broken, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/x.c", b"x")]);
    let output =
        Command::new(PROGRAM).arg("check").arg(&broken).args(["--format", "html", "--only", "V04c"]).output().unwrap();
    let path = dir.path().join("V04c.py");
    std::fs::write(&path, script(&String::from_utf8_lossy(&output.stdout), "V04c")).unwrap();
    let (status, printed) = repeat(&path, &broken);
    assert!(status == Some(0) && printed.contains("<Real start=\"1\"/>"), "{status:?}: {printed}");
    assert!(repeat(&path, &fmu).0 == Some(0));
}
