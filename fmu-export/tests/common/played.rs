//! Scenarios that play in a process of their own, whose environment asks for a call log, and the files that they leave.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Name of the scenario that a process of a test plays.
const SCENARIO: &str = "FMU_EXPORT_TEST_SCENARIO";

/// The scenario of this process, if it plays one.
pub fn scenario() -> Option<String> {
    std::env::var(SCENARIO).ok()
}

/// Plays a scenario, the test `scenarios` of this program, in a process whose variable is `folder`; returns its output.
pub fn play(scenario: &str, folder: Option<&Path>) -> String {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "scenarios", "--nocapture"]).env(SCENARIO, scenario).env_remove("FMU_CALL_LOG");
    if let Some(folder) = folder {
        command.env("FMU_CALL_LOG", folder);
    }
    let output = command.output().unwrap();
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// A new folder.
pub fn folder() -> PathBuf {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("fmu-call-log-{}-{number}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir(&folder).unwrap();
    folder
}

/// The files of a scenario in the order of their instances.
pub fn logs(scenario: &str) -> Vec<String> {
    let folder = folder();
    play(scenario, Some(&folder));
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    for (i, file) in files.iter().enumerate() {
        let name = file.file_name().unwrap().to_str().unwrap();
        assert!(name.ends_with(&format!("-{}.calls", i + 1)), "{name}");
    }
    let texts = files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    std::fs::remove_dir_all(&folder).unwrap();
    texts
}
