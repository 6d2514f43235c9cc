//! A limit of the checker and the state of this computer are not the FMU's fault.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::{check, compile, listed, pack, verdict, violated};
use fmu_check::{Options, Verdict};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

/// An FMU that reserves more address space than a probe may have.
#[test]
fn the_limit_on_memory_is_ours() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(2, "RESERVES") else { return };
    let path = pack(dir.path(), 2, "reserves", &binary);
    let report = check(&path, &["L00", "L06"]);
    assert!(violated(&report).is_empty(), "{}", listed(&report));
    for id in ["L00", "L06"] {
        let Verdict::NotDetermined(why) = verdict(&report, id) else { panic!("{id}: {:?}", verdict(&report, id)) };
        assert!(why.contains("returned NULL") && why.contains("use --memory 16"), "{id}: {why}");
    }
    let mut options = Options { program: Some(crate::PROGRAM.into()), only: vec!["L00".into()], ..Options::default() };
    options.allowance.memory = 16 << 30;
    let report = fmu_check::run(&path, &options).unwrap();
    assert!(matches!(verdict(&report, "L00"), Verdict::Pass(_)), "{:?}", verdict(&report, "L00"));
}

/// An FMU that needs more open files than a probe may have.
#[test]
fn the_limit_on_files_is_ours() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(2, "FILES") else { return };
    let hard = Command::new("sh").args(["-c", "ulimit -Hn"]).output().unwrap();
    let hard = String::from_utf8_lossy(&hard.stdout).trim().to_owned();
    if hard.parse::<u64>().is_ok_and(|files| files < 1400) {
        eprintln!("not tested: this system allows {hard} open files");
        return;
    }
    let path = pack(dir.path(), 2, "files", &binary);
    let report = check(&path, &["L00"]);
    let Verdict::NotDetermined(why) = verdict(&report, "L00") else { panic!("{:?}", verdict(&report, "L00")) };
    assert!(why.contains("1024 open files") && why.ends_with("use --memory 0"), "{why}");
    let mut options = Options { program: Some(crate::PROGRAM.into()), only: vec!["L00".into()], ..Options::default() };
    options.allowance.memory = 0;
    let report = fmu_check::run(&path, &options).unwrap();
    assert!(matches!(verdict(&report, "L00"), Verdict::Pass(_)), "{:?}", verdict(&report, "L00"));
}

/// A license that is missing here: the FMU reports it, or its tool's FMUs need one. Any other refusal is a finding.
#[test]
fn a_license_is_missing() {
    let dir = tempfile::tempdir().unwrap();
    let xml = include_str!("fmu.xml");
    let made = |tool: &str| xml.replace("generationTool=\"cc\"", &format!("generationTool=\"{tool}\""));
    let of = |faults: &str, xml: &str| {
        Some(check(&crate::pack_with(dir.path(), faults, xml, &compile(2, faults)?), &["L00", "L06"]))
    };
    let Some(report) = of("LICENSE", xml) else { return };
    let Verdict::NotDetermined(why) = verdict(&report, "L00") else { panic!("{:?}", verdict(&report, "L00")) };
    assert!(why.contains("the server has no license for this model"), "{why}");
    for (tool, needs) in [("Dymola Version 2024x", true), ("Somebody's exporter", false)] {
        let report = of("SILENT", &made(tool)).unwrap();
        let found = verdict(&report, "L00");
        assert_eq!(matches!(&found, Verdict::NotDetermined(why) if why.contains(tool)), needs, "{tool}: {found:?}");
        assert_eq!(violated(&report).is_empty(), needs, "{tool}: {}", listed(&report));
    }
}

/// The limited resource of this computer, and a shell script that runs `"$0" "$@"` under that limit; `$TMP_HERE` is a folder for
/// a mount.
const LIMITS: &[(&str, &str)] = &[
    ("RLIMIT_AS", "ulimit -v 200000; exec \"$0\" \"$@\""),
    ("RLIMIT_NOFILE", "ulimit -n 14; exec \"$0\" \"$@\""),
    ("RLIMIT_NPROC", "exec setpriv --reuid 65534 --clear-groups prlimit --nproc=2 -- \"$0\" \"$@\""),
    ("noexec", "mount -t tmpfs -o noexec,mode=777 none \"$TMP_HERE\" && TMPDIR=$TMP_HERE exec \"$0\" \"$@\""),
    ("no temporary folder", "TMPDIR=/there/is/none exec \"$0\" \"$@\""),
    ("full disk", "mount -t tmpfs -o size=64k none \"$TMP_HERE\" && TMPDIR=$TMP_HERE exec \"$0\" \"$@\""),
    ("read-only home", "mount -t tmpfs -o ro none \"$TMP_HERE\" && HOME=$TMP_HERE exec \"$0\" \"$@\""),
];

/// Status, output and errors of the checker under such a limit; `None` where this user cannot set it.
fn under(name: &str, script: &str, path: &Path) -> Option<(Option<i32>, String, String)> {
    let dir = path.parent().unwrap();
    let here = dir.join("here");
    std::fs::create_dir_all(&here).unwrap();
    let program = dir.join("fmu-check");
    let mut command = Command::new(if script.contains("mount ") { "unshare" } else { "sh" });
    if script.contains("mount ") {
        command.args(["--mount", "--map-root-user", "sh"]);
    }
    command.arg("-c").arg(script).arg(&program).arg(path).env("TMP_HERE", &here);
    let ids = "B00,L00,L06,T10,L04a,L04b,F02a,B08p,B08g,B08r,Z09,I02";
    let output = command.args(["--format", "json", "--only", ids]).output().ok()?;
    let [out, errors] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    let refused = ["unshare: ", "mount: ", "setpriv: ", "prlimit: ", "ulimit"].iter().any(|who| errors.contains(who));
    if refused {
        eprintln!("{name}: not tested: {}", errors.trim());
        return None;
    }
    Some((output.status.code(), out, errors))
}

/// A good FMU violates nothing if the computer runs short of a resource: the report gives a reason, or one line and status 2.
#[test]
fn a_computer_that_is_short_of_something_is_no_fault() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::set_permissions(dir.path(), PermissionsExt::from_mode(0o777)).unwrap();
    // Another user cannot read the program in its folder; a copy made by this process may be busy while another thread starts a
    // process.
    assert!(Command::new("cp").arg(crate::PROGRAM).arg(dir.path().join("fmu-check")).status().unwrap().success());
    let Some(binary) = compile(2, "NONE") else { return };
    let path = pack(dir.path(), 2, "good", &binary);
    for (name, script) in LIMITS {
        let Some((status, out, errors)) = under(name, script, &path) else { continue };
        if status == Some(2) {
            assert!(errors.starts_with("error: ") && errors.lines().count() == 1, "{name}: {errors}");
            assert!(*name != "no temporary folder" || errors.contains("set TMPDIR"), "{name}: {errors}");
            continue;
        }
        let report: serde_json::Value = serde_json::from_str(&out).unwrap_or_else(|e| panic!("{name}: {e}: {errors}"));
        let found = report["findings"].as_array().unwrap();
        let violated: Vec<_> = found.iter().filter(|f| f["verdict"] == "violated").collect();
        assert!(status == Some(0) && violated.is_empty(), "{name}: {status:?} {violated:?}");
        let of = |id: &str| found.iter().find(|f| f["id"] == id).unwrap();
        if *name == "noexec" {
            assert_eq!(of("B00")["verdict"], "not_determined", "{name}: {}", of("B00"));
            assert!(of("B00")["evidence"].as_str().unwrap().contains("set TMPDIR="), "{name}: {}", of("B00"));
        }
    }
}
