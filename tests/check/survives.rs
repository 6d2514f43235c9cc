//! The checker survives any file.

use crate::zip::{Entry, write};
use crate::{check, common};
use fmu_core::draw::Draw;
use std::path::Path;
use std::process::Command;

fn status(path: &Path, more: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_fmu")).arg("check").arg(path).args(more).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn what_is_no_fmu_is_status_2() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let whole = std::fs::read(common::archives().join("fmi3/PmsmPlant.fmu")).unwrap();
    let mut cases: Vec<(&str, Vec<u8>)> =
        vec![("nothing", Vec::new()), ("text", b"hello".to_vec()), ("end only", b"PK\x05\x06".to_vec())];
    cases.push(("cut", whole[..whole.len() / 2].to_vec()));
    cases.push(("end record alone", whole[whole.len() - 22..].to_vec()));
    for (what, bytes) in cases {
        std::fs::write(&path, bytes).unwrap();
        let (code, error) = status(&path, &[]);
        assert_eq!(code, Some(2), "{what}: {error}");
        assert!(error.starts_with("error: ") && error.lines().count() == 1, "{what}: {error}");
    }
    assert_eq!(status(dir.path(), &[]).0, Some(2));
    assert_eq!(status(&dir.path().join("none.fmu"), &[]).0, Some(2));
    write(&path, &[Entry::new("modelDescription.xml", br#"<fmiModelDescription fmiVersion="1.0"/>"#)]);
    assert_eq!(status(&path, &[]).0, Some(2));
}

/// With any byte changed, the result is a verdict or a message, never a crash.
#[test]
fn changed_bytes_are_judged() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    write(
        &path,
        &[
            Entry::new("modelDescription.xml", include_bytes!("../../fmu-check/tests/faults/fmu.xml")),
            Entry::new("sources/x.c", b"x"),
        ],
    );
    let good = std::fs::read(&path).unwrap();
    let mut draw = Draw(1);
    for _ in 0..400 {
        let mut bytes = good.clone();
        for _ in 0..3 {
            let at = draw.below(bytes.len());
            bytes[at] = u8::try_from(draw.below(256)).unwrap();
        }
        std::fs::write(&path, bytes).unwrap();
        if let Ok(report) = fmu_check::run(&path, &fmu_check::Options::default()) {
            assert!(!report.text(true).is_empty() && !report.html().is_empty() && report.json().is_ok());
        }
    }
}

/// Names outside, a bomb, an XML tree without end.
#[test]
fn bad_intent_is_harmless() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let xml = Entry::new("modelDescription.xml", include_bytes!("../../fmu-check/tests/faults/fmu.xml"));
    write(&path, &[xml.clone(), Entry::new("resources/../../../../tmp/evil-of-fmu-check", b"x")]);
    assert_eq!(status(&path, &[]).0, Some(1));
    // The page begins with the violations.
    assert!(check(&path, &["archive"]).html().contains("<li><a href=\"#Z01b\">Z01b</a> (must)"));
    assert!(!Path::new("/tmp/evil-of-fmu-check").exists());
    let deep = format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?><a fmiVersion=\"2.0\">{}", "<a>".repeat(200_000));
    write(&path, &[Entry::new("modelDescription.xml", deep.as_bytes())]);
    assert_eq!(status(&path, &[]).0, Some(1));
}

#[test]
fn the_command_line() {
    let plant = common::archives().join("fmi3/PmsmPlant.fmu");
    let run = |more: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_fmu")).arg("check").arg(&plant).args(more).output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap())
    };
    let (code, text) = run(&["--only", "Z01a,xml"]);
    assert!(code == Some(0) && text.contains("11 checks: 11 passed"), "{text}");
    let (code, json) = run(&["--only", "archive", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(
        code == Some(0) && json["findings"][0]["id"] == "Z01a" && json["findings"][0]["verdict"] == "pass",
        "{json}"
    );
    let (_, html) = run(&["--only", "archive", "--format", "html"]);
    assert!(html.starts_with("<!DOCTYPE html>") && html.contains("id=\"Z01a\"") && !html.contains("href"));
    assert_eq!(run(&["--only", "nonsense"]).0, Some(2));
}
