//! The checker's findings in a file, for the test programs that use it; each names its `PROGRAM`.
#![allow(dead_code, reason = "each test program uses some of it")]

use fmu_check::{Options, Verdict, report::Report};
use std::path::Path;
use std::sync::Once;
use std::time::Duration;

/// All findings about a file. Timing has no influence here, however busy the machine is.
pub fn check(path: &Path, only: &[&str]) -> Report {
    check_within(path, only, 120)
}

/// [`check`] with the seconds that a probe may take: few for an FMU that hangs.
pub fn check_within(path: &Path, only: &[&str], seconds: u64) -> Report {
    static TEMPORARY: Once = Once::new();
    TEMPORARY.call_once(in_memory);
    let options = Options {
        only: only.iter().map(ToString::to_string).collect(),
        patience: Some(Duration::from_secs(seconds)),
        timeout: None,
        program: Some(super::PROGRAM.to_owned().into()),
        ..Options::default()
    };
    let report = fmu_check::run(path, &options).unwrap_or_else(|e| panic!("{e}"));
    let unclear = unclear(&report);
    assert!(unclear.is_empty(), "{}: evidence that nobody understands:\n{}", path.display(), unclear.join("\n"));
    report
}

/// Puts temporary files into memory if this computer has room for programs there: a probe makes some files and removes them at once,
/// which takes ext4 as long as everything else.
fn in_memory() {
    const FOLDER: &str = "/dev/shm";
    // A name of the checker's own: it does not take the folder for one that an FMU leaves behind.
    let own = Path::new(FOLDER).join("fmu-probe-tests");
    let mounts = std::fs::read_to_string("/proc/mounts").unwrap_or_default();
    let options = mounts.lines().find_map(|line| match line.split(' ').collect::<Vec<_>>()[..] {
        [_, FOLDER, _, options, ..] => Some(options.split(',').collect::<Vec<_>>()),
        _ => None,
    });
    let large = |option: &&str| option.strip_prefix("size=").is_some_and(|size| size.len() >= "1000000k".len());
    let fits = options.is_some_and(|all| !all.contains(&"noexec") && all.iter().any(large));
    // The folder may belong to another user.
    if fits && std::fs::create_dir_all(&own).is_ok() && tempfile::tempfile_in(&own).is_ok() {
        let _ = tempfile::env::override_temp_dir(&own);
    }
}

/// Evidence that shows a value of the checker or of Rust instead of one of the FMU, that occurs twice, or that names no value, call
/// or file.
fn unclear(report: &Report) -> Vec<String> {
    let pattern = 0xc5c5_c5c5_c5c5_c5c5_u64;
    let (half, word) = (0xc5c5_c5c5_u32, format!("{:?}", f64::from_bits(pattern)));
    let fill = [word, format!("{:?}", f32::from_bits(half)), pattern.to_string(), pattern.cast_signed().to_string()];
    let fill = fill.into_iter().chain([half.to_string(), half.cast_signed().to_string()]).collect::<Vec<_>>();
    let rust = ["Some(", " None", "Ok(", "Err(", "Results {", "Intermediate {", "NotDetermined", "  "];
    let results = ["NULL", "OK", "Error", "Warning", "Discard", "Fatal", "Pending"];
    let mut wrong = Vec::new();
    for finding in &report.findings {
        let (texts, violated) = match &finding.verdict {
            Verdict::Violated(texts) => (texts.clone(), true),
            Verdict::NotDetermined(text) | Verdict::NotApplicable(text) => (vec![text.clone()], false),
            Verdict::Pass(texts) => (texts.clone(), false),
        };
        for (k, text) in texts.iter().enumerate() {
            let ours = fill.iter().any(|fill| text.contains(fill)) || rust.iter().any(|word| text.contains(word));
            let result = results.iter().any(|word| text.contains(word));
            let concrete = result || text.contains(|c: char| c.is_ascii_digit() || "\"/(._".contains(c));
            if ours || text.trim() != text || (violated && (!concrete || texts[..k].contains(text))) {
                wrong.push(format!("{}: {text:?}", finding.id));
            }
        }
    }
    wrong
}

/// The ids of the violated checks.
pub fn violated(report: &Report) -> Vec<&'static str> {
    report.violated().map(|f| f.id).collect()
}

/// The result of a check that should have failed.
pub fn listed(report: &Report) -> String {
    report.violated().map(|f| format!("{}: {:?}", f.id, f.verdict)).collect::<Vec<_>>().join("\n")
}
