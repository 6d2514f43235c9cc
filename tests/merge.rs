//! `fmu merge`: one archive out of several, or a line that says why not.
#![allow(missing_docs)]

mod common;

use fmu::commands::merge::{self, Merge};
use fmu::pack::{Entry, Moment, archive, write};
use fmu_check as check;
use fmu_import::platform::Platform;
use fmu_import::{Fmu, contents};
use model_description::FmiVersion;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

type Files = BTreeMap<String, Vec<u8>>;

const STANDARDS: [(&str, FmiVersion); 2] = [("fmi2", FmiVersion::V2), ("fmi3", FmiVersion::V3)];
/// A folder for a platform that no importer of today is on; nothing is known of what its binaries must be.
const ELSEWHERE: &str = "binaries/riscv64-linux/PmsmPlant.so";

fn plant(standard: &str) -> PathBuf {
    common::archives().join(standard).join("PmsmPlant.fmu")
}

/// The plant's own binary in the archive.
fn own(version: FmiVersion) -> String {
    let host = Platform::host();
    format!("binaries/{}/PmsmPlant.{}", host.folders(version)[0], host.extension())
}

/// The plant's files, changed, as another archive.
fn changed(standard: &str, path: &Path, change: impl Fn(&mut Files)) {
    let (_, mut files) = contents(&plant(standard)).unwrap();
    change(&mut files);
    let entry = |(name, bytes): (String, Vec<u8>)| {
        let executable = name.starts_with("binaries/");
        (name, Entry { bytes, executable })
    };
    let files = files.into_iter().map(entry).collect();
    write(path, &archive(&files, Moment::fixed(0)).unwrap()).unwrap();
}

fn replace(files: &mut Files, name: &str, from: &str, to: &str) {
    let bytes = files.get_mut(name).unwrap();
    let text = String::from_utf8(bytes.clone()).unwrap();
    assert!(text.contains(from), "{name} has no {from}");
    *bytes = text.replace(from, to).into_bytes();
}

fn merged(files: &[&Path], out: &Path) -> Result<(), String> {
    let files = files.iter().map(|p| p.to_path_buf()).collect();
    merge::run(&Merge { files, out: out.into(), linux64: None }).map_err(|e| format!("{e:#}"))
}

/// A copy of the plant for another platform, built an hour later.
fn elsewhere(standard: &str, version: FmiVersion, path: &Path) {
    let date = contents(&plant(standard)).unwrap().0.generation_date_and_time.unwrap();
    changed(standard, path, |files| {
        let binary = files.remove(&own(version)).unwrap();
        files.insert(ELSEWHERE.into(), binary);
        for bytes in files.values_mut() {
            if let Ok(text) = String::from_utf8(bytes.clone()) {
                *bytes = text.replace(&date, "2200-01-01T00:00:00Z").into_bytes();
            }
        }
    });
}

#[test]
fn two_platforms_become_one_archive() {
    let dir = tempfile::tempdir().unwrap();
    for (standard, version) in STANDARDS {
        let [other, one, two] = ["other.fmu", "one.fmu", "two.fmu"].map(|n| dir.path().join(standard).join(n));
        let here = plant(standard);
        elsewhere(standard, version, &other);
        merged(&[&here, &other], &one).unwrap();
        merged(&[&other, &here, &here], &two).unwrap();
        assert!(fs::read(&one).unwrap() == fs::read(&two).unwrap(), "the order tells");

        let (md, files) = contents(&one).unwrap();
        let (before, mut expected) = contents(&here).unwrap();
        assert_eq!(md.token, before.token);
        assert_eq!(md.generation_date_and_time.as_deref(), Some("2200-01-01T00:00:00Z"), "the latest");
        expected.insert(ELSEWHERE.into(), expected[&own(version)].clone());
        assert!(files.keys().eq(expected.keys()), "{:?}", files.keys());
        assert!(files[ELSEWHERE] == expected[ELSEWHERE] && files[&own(version)] == expected[&own(version)]);

        let program = Some(PathBuf::from(env!("CARGO_BIN_EXE_fmu")));
        let only = ["archive", "xml", "variables", "structure", "binary"].map(String::from).to_vec();
        let report = check::run(&one, &check::Options { only, program, ..Default::default() }).unwrap();
        assert!(report.conforms(), "{}", report.text(false));
        assert!(report.counts().passed > 50, "{}", report.text(false));
        Fmu::open(&one).unwrap().instantiate("merged", false).unwrap();
    }
}

/// What must not be merged is told in one line with both files, what and where, and what to do; nothing is written.
#[test]
fn what_does_not_fit_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out.fmu");
    let other = dir.path().join("other.fmu");
    let refused = |here: &Path, parts: &[&str]| {
        let error = merged(&[here, &other], &out).expect_err("it does not fit");
        assert!(error.starts_with(&format!("{}: ", other.display())), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
        let names = [here.display().to_string()];
        for part in parts.iter().copied().chain(names.iter().map(String::as_str)) {
            assert!(error.contains(part), "{part:?} is not in {error}");
        }
        assert!(!out.exists());
    };
    for (standard, version) in STANDARDS {
        let here = plant(standard);
        let token = contents(&here).unwrap().0.token;
        let xml = "modelDescription.xml";
        let without = |files: &mut Files| files.remove(&own(version)).unwrap();

        changed(standard, &other, |files| {
            without(files);
            replace(files, xml, &token, "{another}");
        });
        let attribute = if version == FmiVersion::V2 { "guid" } else { "instantiationToken" };
        refused(&here, &[xml, attribute, &token, "{another}", "build both from the same sources"]);

        changed(standard, &other, |files| {
            without(files);
            replace(files, xml, "start=\"325\"", "start=\"326\"");
        });
        refused(&here, &["modelDescription.xml, line ", "build both from the same sources"]);

        changed(standard, &other, |files| files.get_mut(&own(version)).unwrap().push(0));
        refused(&here, &[&own(version), "differs", "in one of them only"]);

        changed(standard, &other, |files| {
            without(files);
            files.insert("resources/map.csv".into(), b"1".into());
        });
        let error = merged(&[&here, &other], &out).unwrap_err();
        assert_eq!(error.lines().count(), 1);
        assert!(error.contains("has no resources/map.csv") && error.contains("other.fmu has"), "{error}");
        assert!(!out.exists());

        changed(standard, &other, |files| {
            without(files);
            replace(files, "documentation/index.html", "</html>", "</html> ");
        });
        refused(&here, &["documentation/index.html, line ", "build both from the same sources"]);
    }

    // FMI 2.0 has two names for one platform.
    if Platform::host() == Platform::X64Linux {
        changed("fmi2", &other, |files| {
            let binary = files.remove(&own(FmiVersion::V2)).unwrap();
            files.insert("binaries/x86_64-linux/PmsmPlant.so".into(), binary);
        });
        refused(&plant("fmi2"), &["binaries/x86_64-linux/PmsmPlant.so", "binaries/linux64", "in one of them only"]);
    }

    elsewhere("fmi3", FmiVersion::V3, &other);
    refused(&plant("fmi2"), &["is of FMI 3.0", "of FMI 2.0", "merge those of one standard"]);
    fs::write(&other, "no archive").unwrap();
    let error = merged(&[&plant("fmi2"), &other], &out).unwrap_err();
    assert!(error.contains("other.fmu: not a ZIP archive") && !out.exists(), "{error}");
}
