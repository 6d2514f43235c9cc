//! `fmu merge`: one archive from several, or a line with the reason why not.
#![allow(missing_docs)]

mod common;

use cargo_fmu::build::Linux64;
use fmu::commands::merge::{self, Merge};
use fmu_check as check;
use fmu_import::platform::Platform;
use fmu_import::{Fmu, contents, machine};
use fmu_pack::archive::{GenerationTime, PackedFile, archive, write};
use model_description::FmiVersion;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

type Files = BTreeMap<String, Vec<u8>>;

const STANDARDS: [(&str, FmiVersion); 2] = [("fmi2", FmiVersion::V2), ("fmi3", FmiVersion::V3)];
/// A folder for an unknown platform; its binaries are not checked.
const ELSEWHERE: &str = "binaries/riscv64-linux/PmsmPlant.so";

fn plant(standard: &str) -> PathBuf {
    common::archives().join(standard).join("PmsmPlant.fmu")
}

/// The plant's binary in the archive.
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
        (name, PackedFile { bytes, executable })
    };
    let files = files.into_iter().map(entry).collect();
    write(path, &archive(&files, GenerationTime::fixed(0)).unwrap()).unwrap();
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
        assert!(fs::read(&one).unwrap() == fs::read(&two).unwrap(), "the order makes no difference");

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

/// FMUs that must not be merged are refused in one line with both files, the difference and the remedy; nothing is written.
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
        refused(&here, &[&own(version), "differs", "in only one of them"]);

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
        refused(&plant("fmi2"), &["binaries/x86_64-linux/PmsmPlant.so", "binaries/linux64", "in only one of them"]);
    }

    elsewhere("fmi3", FmiVersion::V3, &other);
    refused(&plant("fmi2"), &["is of FMI 3.0", "of FMI 2.0", "merge archives of one standard"]);
    fs::write(&other, "no archive").unwrap();
    let error = merged(&[&plant("fmi2"), &other], &out).unwrap_err();
    assert!(error.contains("other.fmu: not a ZIP archive") && !out.exists(), "{error}");
}

/// The headers of a shared library of macOS, with a text behind them that distinguishes two builds.
fn dylib(platform: Platform, build: &str) -> Vec<u8> {
    let cpu: u32 = if platform == Platform::ArmDarwin { 0x0100_000c } else { 0x0100_0007 };
    let words = [0xfeed_facf, cpu, 3, 6, 0, 0, 0, 0];
    words.iter().flat_map(|word: &u32| word.to_le_bytes()).chain(build.bytes()).collect()
}

/// The headers of a shared library of Linux.
fn shared_object(platform: Platform) -> Vec<u8> {
    let machine = if platform == Platform::ArmLinux { 183 } else { 62 };
    let mut bytes = vec![0; 64];
    bytes[..8].copy_from_slice(b"\x7fELF\x02\x01\x01\0");
    (bytes[16], bytes[18], bytes[20]) = (3, machine, 1);
    bytes[52] = 64;
    bytes
}

/// A copy of the plant with foreign libraries.
fn with_libraries(standard: &str, version: FmiVersion, path: &Path, libraries: &[(&str, &[u8])]) {
    changed(standard, path, |files| {
        files.remove(&own(version)).unwrap();
        files.extend(libraries.iter().map(|(name, bytes)| (format!("binaries/{name}"), bytes.to_vec())));
    });
}

fn binaries(path: &Path) -> Files {
    contents(path).unwrap().1.into_iter().filter(|(name, _)| name.starts_with("binaries/")).collect()
}

/// Importers of FMI 2.0 look into darwin64 on either processor, so it contains a library for both.
#[test]
fn libraries_for_macos_become_a_universal_one() {
    use Platform::{ArmDarwin, X64Darwin};
    let dir = tempfile::tempdir().unwrap();
    let [intel, arm, old, other, out] = ["intel", "arm", "old", "other", "out"].map(|n| dir.path().join(n));
    let (x64, arm64) = (dylib(X64Darwin, "1"), dylib(ArmDarwin, "1"));
    with_libraries("fmi2", FmiVersion::V2, &intel, &[("darwin64/PmsmPlant.dylib", &x64)]);
    with_libraries("fmi2", FmiVersion::V2, &arm, &[("darwin64/PmsmPlant.dylib", &arm64)]);
    with_libraries("fmi2", FmiVersion::V2, &old, &[("aarch64-darwin/PmsmPlant.dylib", &arm64)]);
    let universal = machine::universal(&[&x64, &arm64]).unwrap();
    let expected = Files::from([("binaries/darwin64/PmsmPlant.dylib".into(), universal)]);
    for parts in [[&*intel, &arm], [&arm, &intel], [&old, &intel]] {
        merged(&parts, &out).unwrap();
        assert!(binaries(&out) == expected, "{parts:?}: {:?}", binaries(&out).keys());
    }
    // A merged archive can be merged again with one of its parts, but not with another build for one of its processors.
    let both = dir.path().join("both");
    merged(&[&intel, &arm], &both).unwrap();
    merged(&[&both, &intel, &plant("fmi2")], &out).unwrap();
    assert_eq!(binaries(&out).len(), 2);
    with_libraries("fmi2", FmiVersion::V2, &other, &[("darwin64/PmsmPlant.dylib", &dylib(ArmDarwin, "2"))]);
    let error = merged(&[&both, &other], &out).unwrap_err();
    assert!(
        error.contains("binaries/darwin64/PmsmPlant.dylib: differs") && error.contains("in only one of them"),
        "{error}"
    );
    let error = merged(&[&both, &old], &out).unwrap_err();
    assert!(error.contains("is for aarch64-darwin, as binaries/darwin64 of"), "{error}");
    // The checker looks at both images.
    merged(&[&intel, &arm], &out).unwrap();
    let b10 = |path: &Path| {
        let options = check::Options { only: vec!["B10".into()], ..check::Options::default() };
        check::run(path, &options).unwrap().text(false)
    };
    assert!(b10(&out).contains("1 checks: 1 passed"), "{}", b10(&out));
    let mut cut = machine::universal(&[&x64, &arm64]).unwrap();
    cut.truncate(5000);
    with_libraries("fmi2", FmiVersion::V2, &other, &[("darwin64/PmsmPlant.dylib", &cut)]);
    assert!(b10(&other).contains("lies outside"), "{}", b10(&other));
    with_libraries("fmi2", FmiVersion::V2, &other, &[("darwin64/PmsmPlant.dylib", &shared_object(Platform::X64Linux))]);
    assert!(b10(&other).contains("is Elf for X86_64"), "{}", b10(&other));
    // In FMI 3.0 every processor has its folder.
    let tuples = [("x86_64-darwin/PmsmPlant.dylib", &x64[..]), ("aarch64-darwin/PmsmPlant.dylib", &arm64)];
    with_libraries("fmi3", FmiVersion::V3, &intel, &tuples[..1]);
    with_libraries("fmi3", FmiVersion::V3, &arm, &tuples[1..]);
    merged(&[&intel, &arm], &out).unwrap();
    assert!(binaries(&out) == tuples.map(|(name, bytes)| (format!("binaries/{name}"), bytes.to_vec())).into());
}

/// `linux64` of FMI 2.0 is for the processor that `--linux64` names; an importer here still finds the other one.
#[test]
fn linux64_is_for_one_processor() {
    use Platform::{ArmLinux, X64Linux};
    let dir = tempfile::tempdir().unwrap();
    let [intel, arm, out] = ["intel.fmu", "arm.fmu", "out.fmu"].map(|n| dir.path().join(n));
    let (x64, arm64) = (shared_object(X64Linux), shared_object(ArmLinux));
    with_libraries("fmi2", FmiVersion::V2, &intel, &[("linux64/PmsmPlant.so", &x64)]);
    let place = |linux64: Option<Linux64>| {
        let files = vec![intel.clone(), arm.clone()];
        merge::run(&Merge { files, out: out.clone(), linux64 }).unwrap();
        binaries(&out).into_iter().map(|(name, bytes)| (name, machine::platforms(&bytes))).collect::<Vec<_>>()
    };
    for folder in ["aarch64-linux", "linux64"] {
        with_libraries("fmi2", FmiVersion::V2, &arm, &[(&format!("{folder}/PmsmPlant.so"), &arm64)]);
        let expected = [("aarch64-linux", ArmLinux), ("linux64", X64Linux)];
        let named = |(folder, p): (&str, Platform)| (format!("binaries/{folder}/PmsmPlant.so"), vec![p]);
        assert_eq!(place(None), expected.map(named));
        let expected = [("linux64", ArmLinux), ("x86_64-linux", X64Linux)];
        assert_eq!(place(Some(Linux64::Arm)), expected.map(named));
    }
    // The plant's library for this machine, in either folder.
    if Platform::host() == X64Linux {
        let bytes = contents(&plant("fmi2")).unwrap().1.remove(&own(FmiVersion::V2)).unwrap();
        let libraries = [("linux64/PmsmPlant.so", &arm64[..]), ("x86_64-linux/PmsmPlant.so", &bytes)];
        with_libraries("fmi2", FmiVersion::V2, &out, &libraries);
        Fmu::open(&out).unwrap().instantiate("elsewhere", false).unwrap();
        let program = Some(PathBuf::from(env!("CARGO_BIN_EXE_fmu")));
        let only = ["B00", "B10", "L00"].map(String::from).to_vec();
        let report = check::run(&out, &check::Options { only, program, ..Default::default() }).unwrap();
        assert!(report.text(false).contains("3 checks: 3 passed"), "{}", report.text(false));
        with_libraries("fmi2", FmiVersion::V2, &out, &libraries[..1]);
        let error = Fmu::open(&out).err().expect("it is not for this machine").to_string();
        let printed = "binaries/linux64/PmsmPlant.so is for aarch64-linux, not for this platform (x86_64-linux)";
        assert!(error.contains(printed), "{error}");
    }
}

/// `fmu build --library` packs them so, and `fmu info` names the processors.
#[test]
fn build_places_libraries_as_merge_does() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (_, files) = contents(&plant("fmi2")).unwrap();
    fs::write(path("own"), &files[&own(FmiVersion::V2)]).unwrap();
    let foreign =
        Platform::ALL.into_iter().filter(|p| *p != Platform::host() && ["so", "dylib"].contains(&p.extension()));
    let mut arguments = vec!["build".to_owned(), "--library".into(), path("own"), "--out".into(), path("out")];
    for platform in foreign.clone() {
        let bytes = if platform.extension() == "so" { shared_object(platform) } else { dylib(platform, "") };
        fs::write(path(platform.tuple()), bytes).unwrap();
        arguments.extend(["--library".to_owned(), format!("{platform}={}", path(platform.tuple()))]);
    }
    let run = |arguments: &[String]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let info = |standard: &str| {
        let archive = path("out") + &format!("/{standard}/PmsmPlant.fmu");
        let (_, text, _) = run(&["info".to_owned(), archive]);
        text.lines().find_map(|line| line.trim().strip_prefix("platforms")).unwrap().trim().to_owned()
    };
    if Platform::host() != Platform::X64Linux {
        return;
    }
    let (code, _, said) = run(&arguments);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(info("fmi2"), "aarch64-linux, darwin64 (x86_64-darwin and aarch64-darwin), linux64 (x86_64-linux)");
    assert_eq!(info("fmi3"), "aarch64-darwin, aarch64-linux, x86_64-darwin, x86_64-linux");
    let (code, _, said) = run(&[&arguments[..], &["--linux64".into(), "aarch64".into()]].concat());
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("note: linux64 of FMI 2.0 contains the libraries for aarch64: an importer on x86_64"),
        "{said}"
    );
    assert_eq!(info("fmi2"), "darwin64 (x86_64-darwin and aarch64-darwin), linux64 (aarch64-linux), x86_64-linux");
    let (code, _, said) = run(&[&arguments[..5], &["--linux64".into(), "aarch64".into()]].concat());
    assert_eq!(code, Some(2));
    assert!(
        said.contains("PmsmPlant has no library for aarch64-linux; add --target aarch64-unknown-linux-gnu"),
        "{said}"
    );
}
