//! Scripts for FMPy that repeat a finding, for the author of the FMU.

use crate::check::{Finding, Verdict};
use crate::checks::GROUPS;
use crate::runner::PLAIN_RUNS;
use std::fmt::Write;

/// Calls of the binary.
const REPEAT: &str = include_str!("repeat.py");
/// Lines of the description and entries of the archive.
const LOOK: &str = include_str!("look.py");

/// The script for a violated check; `None` for any other.
pub(super) fn script(file: &str, finding: &Finding) -> Option<String> {
    let Verdict::Violated(evidence) = &finding.verdict else { return None };
    let name = file.rsplit(['/', '\\']).next().unwrap_or_default();
    let python = |value: serde_json::Value| value.to_string();
    let mut out = String::new();
    let _ = writeln!(out, "# {}: {}", finding.id, finding.requirement);
    let _ = writeln!(
        out,
        "# Repeats what fmu check found in {name}: python THIS_FILE.py [FILE.fmu], after pip install fmpy."
    );
    let _ = writeln!(out, "FILE = {}", python(name.into()));
    let list = |name: &str, of: &[String]| {
        let items: Vec<_> = of.iter().map(|item| python(item.as_str().into())).collect();
        let items: String =
            if items.is_empty() { String::new() } else { format!("\n    {},\n", items.join(",\n    ")) };
        format!("{name} = [{items}]\n")
    };
    out += &list("EVIDENCE", evidence);
    let probe = GROUPS.iter().flat_map(|g| g.checks).any(|c| c.id == finding.id && c.is_probe());
    if !probe {
        return Some(out + LOOK);
    }
    let _ = writeln!(out, "# The calls with what they returned, up to the finding.");
    out += &list("CALLS", &finding.script);
    let varies = match finding.id {
        PLAIN_RUNS => "instances",
        "T10p" => "processes",
        _ => "",
    };
    let _ = writeln!(out, "VARIES = {varies:?}  # the finding is that the results differ between two of these");
    Some(out + REPEAT)
}
