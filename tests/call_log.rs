//! Call logs of packed FMUs: another command is the importer that they record, and `fmu simulate --replay` repeats them.
#![allow(missing_docs)]

mod common;

use common::packed::packed;
use common::python::scratch;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The archives of a package of FMI 2.0, if it has one, and of FMI 3.0.
fn archives(folder: &str, package: &str) -> Vec<PathBuf> {
    packed(folder, package, &scratch().join("call-log"))
}

fn every_type() -> &'static [PathBuf] {
    static FILES: OnceLock<Vec<PathBuf>> = OnceLock::new();
    FILES.get_or_init(|| archives("tests/types", "types-fmu"))
}

/// The logs that the FMUs write while the command runs, in the order of their instances.
fn logs(name: &str, arguments: &[&str]) -> Vec<PathBuf> {
    let folder = scratch().join(format!("call-log-{name}"));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir(&folder).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).env("FMU_CALL_LOG", &folder).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    let mut files: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{arguments:?}");
    files
}

fn replay(fmu: &Path, log: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
    command.args(["simulate"]).arg(fmu).arg("--replay").arg(log).env_remove("FMU_CALL_LOG").output().unwrap()
}

/// The number of calls of a log, all of which end as in it.
fn replayed(fmu: &Path, log: &Path) -> usize {
    let output = replay(fmu, log);
    let (said, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert!(output.status.success(), "{}: {error}", log.display());
    let last = said.lines().last().unwrap();
    last.strip_suffix(" calls replayed, all as in the log").unwrap_or_else(|| panic!("{said}")).parse().unwrap()
}

/// The message of a repetition that fails with this status.
fn refused(fmu: &Path, log: &Path, status: i32) -> String {
    let output = replay(fmu, log);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{error}");
    error
}

/// A log of EveryType in FMI 3.0 with another text.
fn changed(name: &str, change: impl Fn(&str) -> String) -> PathBuf {
    let fmu = every_type()[1].to_str().unwrap();
    let arguments = ["simulate", fmu, "--stop", "0.3", "--step", "0.1", "--set", "label=a \"b\" \u{e4}", "--set"];
    let log = &logs(name, &[&arguments[..], &["vector=1 2 1e-300"]].concat())[0];
    let text = change(&fs::read_to_string(log).unwrap());
    fs::write(log, text).unwrap();
    log.clone()
}

#[test]
fn co_simulation_and_model_exchange_are_repeated_in_both_standards() {
    for (version, fmu) in every_type().iter().enumerate() {
        let fmu_text = fmu.to_str().unwrap();
        for way in [&[][..], &["--me"]] {
            let name = format!("run-{version}-{}", way.len());
            let arguments = ["simulate", fmu_text, "--stop", "0.3", "--step", "0.1", "--set", "label=a \"b\" \u{e4}"];
            let log = &logs(&name, &[&arguments[..], way].concat())[0];
            let text = fs::read_to_string(log).unwrap();
            assert!(text.contains(r#"values=["a \"b\" ä"]"#), "{text}");
            let prefix = ["fmi2", "fmi3"][version];
            let steps = text.matches(&format!(" {prefix}DoStep(")).count();
            let exchanges = text.matches(&format!(" {prefix}SetTime(")).count();
            assert_eq!((steps > 0, exchanges > 0), (way.is_empty(), !way.is_empty()), "{text}");
            assert_eq!(replayed(fmu, log), text.lines().count() - 6, "a line for each call");
        }
    }
}

/// The archive of a reference FMU.
fn reference(package: &str) -> PathBuf {
    archives(&format!("examples/reference-fmus/{package}"), package).pop().unwrap()
}

#[test]
fn bytes_are_repeated() {
    let fmu = reference("feedthrough");
    let arguments = ["simulate", fmu.to_str().unwrap(), "--stop", "0.3", "--step", "0.1", "--set", "Binary_input=01ff"];
    let log = &logs("bytes", &arguments)[0];
    let text = fs::read_to_string(log).unwrap();
    assert!(text.contains("sizes=[2], values=[0x01ff], m=1) -> OK"), "{text}");
    assert!(text.contains("-> OK sizes=[2] values=[0x01ff]"), "{text}");
    assert!(replayed(&fmu, log) > 10);
}

/// The checker makes calls that other importers do not make: of partitions and in callbacks.
#[test]
fn clocks_partitions_and_callbacks_are_repeated() {
    let scheduled = ["fmi3InstantiateScheduledExecution(", "fmi3ActivateModelPartition(", "  2.0 clockUpdate() {"];
    let inside = ["intermediateUpdate(can_return=1)", "required=[1]", "-> done early_return="];
    for (package, checks, words) in [("clocks", "P00,P04", scheduled), ("dahlquist", "U02", inside)] {
        let fmu = reference(package);
        let files = logs(package, &["check", fmu.to_str().unwrap(), "--only", checks]);
        let texts: String = files.iter().map(|file| fs::read_to_string(file).unwrap()).collect();
        for word in words {
            assert!(texts.contains(word), "{package}: {word} is missing in {texts}");
        }
        for file in files {
            replayed(&fmu, &file);
        }
    }
}

#[test]
fn the_first_difference_is_named() {
    // An output after the second step, and a later one.
    let log = changed("value", |text| {
        let mut steps = 0;
        let lines = text.lines().map(|line| {
            steps += usize::from(line.contains("fmi3DoStep("));
            let is_output = steps > 1 && line.contains("fmi3GetFloat64(vr=[22]");
            if is_output { line.replace("values=[", "values=[9e99, ").replace(", 5.5]", "]") } else { line.to_owned() }
        });
        lines.collect::<Vec<_>>().join("\n") + "\n"
    });
    let text = fs::read_to_string(&log).unwrap();
    let line = 1 + text.lines().position(|line| line.contains("9e99")).unwrap();
    let said = refused(&every_type()[1], &log, 1);
    let wanted = format!("line {line}: 0.2 fmi3GetFloat64(vr=[22], n=1, values=?2, m=2): the log has values");
    assert!(said.contains(&wanted) && said.contains("9e99") && said.contains(", now values"), "{said}");
    let log = changed("status", |text| text.replace("fmi3Terminate() -> OK", "fmi3Terminate() -> Error"));
    let said = refused(&every_type()[1], &log, 1);
    assert!(said.contains("fmi3Terminate(): the log has Error, now OK"), "{said}");
    let log = changed("refused", |text| {
        text.replace("fmi3Terminate() -> OK", "1.0 fmi3Reset() -> OK\n1.0 fmi3Reset() -> Error")
    });
    assert_eq!(replay(&every_type()[1], &log).status.code(), Some(2), "a line with two times");
}

#[test]
fn a_log_of_another_version_or_standard_is_refused() {
    let token = "{00000000-0000-0000-0000-000000000000}";
    let log = changed("token", |text| {
        let of_log = text.lines().nth(4).unwrap().strip_prefix("token: ").unwrap().to_owned();
        text.replace(&of_log, token)
    });
    let description = fmu_import::outline(&every_type()[1]).unwrap().description;
    let said = refused(&every_type()[1], &log, 2);
    assert!(said.contains("the log is of another version of the FMU"), "{said}");
    assert!(said.contains(token) && said.contains(&description.token), "{said}");
    let log = changed("standard", str::to_owned);
    let said = refused(&every_type()[0], &log, 2);
    assert!(said.contains("the log is of FMI 3.0, the FMU of FMI 2.0"), "{said}");
}

#[test]
fn a_line_that_is_no_call_is_named() {
    let log = changed("wrong", |text| text.replacen("0.1 fmi3GetFloat64(vr=[", "0.1 fmi3GetFloat64(vr=(", 1));
    let line = 1 + fs::read_to_string(&log).unwrap().lines().position(|line| line.contains("vr=(")).unwrap();
    let said = refused(&every_type()[1], &log, 2);
    assert!(said.contains(&format!("line {line}: column ")), "{said}");
    let log = changed("argument", |text| text.replace("fmi3DoStep(t=0.1,", "fmi3DoStep(time=0.1,"));
    let said = refused(&every_type()[1], &log, 2);
    assert!(said.contains("the argument t is missing"), "{said}");
}

/// The importer crashed in a step.
#[test]
fn a_log_that_ends_in_a_call_is_repeated_up_to_it() {
    let log = changed("cut", |text| {
        let step = text.rfind(" fmi3DoStep(").unwrap();
        let end = step + text[step..].find(" -> ").unwrap();
        text[..end].to_owned()
    });
    let output = replay(&every_type()[1], &log);
    let (said, error) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert!(output.status.success(), "{error}");
    assert!(error.contains("the log ends in this call: 0.2 fmi3DoStep(t=0.2"), "{error}");
    assert!(said.contains("the log ends in the middle, and this call now returns: line "), "{said}");
    assert!(said.contains("all as in the log"), "{said}");
}
