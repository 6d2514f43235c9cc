//! The evidence of a probe: its findings, its calls, its console, and the resulting verdict.

use crate::check::{Conclusion, Verdict};
use crate::confidence::Confidence;
use crate::level::Level;
use crate::lines::Line;
use crate::session::{BEGUN, FOUND};
use fmu_import::guard::End;
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

pub(super) fn read(out: &Path) -> Vec<Line> {
    let text = fs::read_to_string(out).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// The message of a panic of this program, if one has ended a probe; the panic of an FMU in Rust does not reach this point.
pub(super) fn panic(end: &End, out: &Path) -> Option<String> {
    let End::Ended(status) = end else { return None };
    let console = fs::read(out.with_file_name("console")).ok().filter(|_| status.code() == Some(101))?;
    let console = String::from_utf8_lossy(&console);
    let (_, text) = console.rsplit_once(" panicked at ")?;
    Some(text.lines().take(2).collect::<Vec<_>>().join(" "))
}

/// Whether a call is one of a further instance, and the same function of the first instance of the case has returned.
pub(super) fn is_of_second(call: &str, out: &Path) -> bool {
    let Some((_, call)) = call.get(2..).filter(|c| c.starts_with('[')).and_then(|c| c.split_once("] ")) else {
        return false;
    };
    let function = call.split('(').next().unwrap_or_default();
    let log = fs::read_to_string(out.with_extension("log")).unwrap_or_default();
    let case = log.rsplit("# case ").next().unwrap_or_default();
    case.lines().any(|line| line.strip_prefix(function).is_some_and(|rest| rest.contains(" -> ")))
}

/// Whether a call creates an instance after this process has freed one.
pub(super) fn is_after_free(call: &str, out: &Path) -> bool {
    let log = fs::read_to_string(out.with_extension("log")).unwrap_or_default();
    let freed = || log.rsplit(BEGUN).next().is_some_and(|log| log.lines().any(|line| line.contains("FreeInstance")));
    call.contains("Instantiate") && (call.contains("after FreeInstance") || freed())
}

/// The calls of the first case with a finding: the marked one, or the last one.
pub(super) fn calls(log: &str) -> Vec<String> {
    const MOST: usize = 60;
    let cases: Vec<&str> = log.split("# case ").collect();
    let found = cases.iter().find(|case| case.contains(FOUND)).or(cases.last());
    let lines: Vec<_> =
        found.map_or("", |case| case).lines().filter(|l| !l.is_empty() && *l != FOUND && *l != BEGUN).collect();
    // The first line of every part except the first is the number of the case.
    let first = usize::from(cases.len() > 1 && found.is_some_and(|f| !std::ptr::eq(*f, cases[0])));
    let calls: Vec<String> = lines.iter().skip(first).map(|l| (*l).to_owned()).collect();
    if calls.len() <= MOST {
        return calls;
    }
    let left_out = format!("({} calls)", calls.len() - MOST);
    [&calls[..MOST / 2], &[left_out], &calls[calls.len() - MOST / 2..]].concat()
}

/// All calls before the first finding: the calls of its case and the calls before the first case. `log` comes from a probe that
/// records every call, and ends with the finding.
pub(super) fn script(log: &str) -> Vec<String> {
    let cases: Vec<&str> = log.split("# case ").collect();
    let found = cases.iter().position(|case| case.contains(FOUND)).unwrap_or(cases.len() - 1);
    let before = cases.first().filter(|_| found > 0).map_or(Vec::new(), |first| first.lines().collect());
    let lines = before.into_iter().chain(cases[found].lines().skip(usize::from(found > 0)));
    lines
        .take_while(|line| *line != FOUND)
        .filter(|line| !line.is_empty() && *line != BEGUN)
        .map(str::to_owned)
        .collect()
}

/// Console output of a process.
fn console(folder: &Path) -> String {
    let mut console = Vec::new();
    if let Ok(file) = File::open(folder.join("console")) {
        let _ = file.take(64 << 10).read_to_end(&mut console);
    }
    String::from_utf8_lossy(&console).into_owned()
}

/// The first lines on the console of a process that failed, which may name the cause.
pub(super) fn printed(folder: &Path) -> Vec<String> {
    let console = console(folder);
    console.lines().filter(|l| !l.trim().is_empty()).take(3).map(|l| format!("on the console: {l}")).collect()
}

/// Unwanted console output and files of the process.
pub(super) fn side_effects(folder: &Path, working_directory: &Path) -> Vec<String> {
    let console = console(folder);
    let mut findings: Vec<_> = console.lines().take(5).map(|l| format!("wrote to the console: {l:?}")).collect();
    let files = fs::read_dir(working_directory).into_iter().flatten().flatten().take(5);
    findings.extend(
        files.map(|f| format!("created a file in the working directory: {:?}", f.file_name().to_string_lossy())),
    );
    findings
}

/// The verdict from the lines of the probe and from its crashes (how, and in which call).
pub(super) fn conclude(id: &str, lines: Vec<Line>, crashes: Vec<(String, String)>, slow: Option<String>) -> Conclusion {
    let (mut violated, mut notes, mut not_determined, mut not_applicable) = (Vec::new(), Vec::new(), slow, None);
    let mut fatal = false;
    for line in lines {
        match line {
            Line::Violated(lower, confidence, text) => violated.push((lower, confidence, text)),
            Line::Note(text) => notes.push(text),
            Line::NotDetermined(why) => not_determined = not_determined.or(Some(why)),
            Line::NotApplicable(why) => not_applicable = not_applicable.or(Some(why)),
            Line::Case(_) | Line::Integrator(_) | Line::Varies(_) | Line::Done => {}
        }
    }
    for (how, call) in crashes {
        let marks = [(Some(Level::Should), "S "), (Some(Level::Hard), "H "), (None, "C ")];
        let marked = marks.iter().find_map(|(level, mark)| Some((*level, call.strip_prefix(mark)?)));
        // Preparing the probe failed: another check reports that, except in a minimal run.
        let prepared = call.strip_prefix("P ").unwrap_or("the start");
        let minimal = id == "B00" || (["L00", "E00"].contains(&id) && !prepared.starts_with("loading"));
        match marked.or(minimal.then_some((None, prepared))) {
            Some((level, call)) => {
                violated.push((level, Confidence::Certain, format!("{call} {how}")));
                fatal = true;
            }
            None => not_determined = not_determined.or(Some(format!("{prepared} {how}, before the probe began"))),
        }
    }
    // A smaller level is more binding, and the check's own comes first.
    violated.sort_by_key(|(lower, ..)| lower.is_some());
    let lower = violated.iter().map(|(lower, ..)| *lower).min().flatten();
    let decisive = violated.iter().filter(|(of, ..)| *of == lower);
    let confidence = decisive.map(|(_, confidence, _)| *confidence).min().unwrap_or(Confidence::Certain);
    // A message that a run repeats is one finding.
    let mut seen = HashSet::new();
    let violated: Vec<_> =
        violated.into_iter().map(|(.., text)| text).filter(|text| seen.insert(text.clone())).collect();
    let verdict = match (violated.is_empty(), not_determined, not_applicable) {
        (false, ..) => Verdict::Violated(violated),
        (_, Some(why), _) => Verdict::NotDetermined(why),
        (_, _, Some(why)) => Verdict::NotApplicable(why),
        _ => Verdict::Pass(notes),
    };
    Conclusion { verdict, lower, confidence, fatal, calls: Vec::new(), script: Vec::new() }
}
