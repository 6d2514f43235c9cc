//! Reports for other programs: JUnit's XML, which every CI shows, and SARIF 2.1.0, which code hosts show.

use crate::check::{Finding, Verdict};
use crate::checks::GROUPS;
use crate::level::Level;
use crate::report::{Report, escape, level};
use serde_json::{Value, json};
use std::fmt::Write;

/// The evidence, or the reason.
fn evidence(finding: &Finding) -> String {
    match &finding.verdict {
        Verdict::Pass(lines) | Verdict::Violated(lines) => lines.join("\n"),
        Verdict::NotApplicable(reason) | Verdict::NotDetermined(reason) => reason.clone(),
    }
}

/// Text for XML 1.0, which has no control characters.
fn xml(text: &str) -> String {
    let allowed = |c: &char| !c.is_control() || matches!(c, '\n' | '\t');
    escape(&text.chars().filter(allowed).collect::<String>())
}

/// JUnit: a suite for each file, a case for each check. Checks that are in the baseline, do not apply or are not determined are
/// skipped.
pub(super) fn junit(reports: &[Report]) -> String {
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n");
    for report in reports {
        let failures = report.unknown().count();
        let skipped = report.findings.len() - report.counts().passed - failures;
        let (name, tests) = (xml(&report.file), report.findings.len());
        let _ = writeln!(
            out,
            "  <testsuite name=\"{name}\" tests=\"{tests}\" failures=\"{failures}\" errors=\"0\" skipped=\"{skipped}\">"
        );
        for f in &report.findings {
            let (requirement, why) = (xml(f.requirement), xml(&evidence(f)));
            let _ = write!(out, "    <testcase classname=\"{}.{}\" name=\"{} {requirement}\"", name, f.group, f.id);
            let _ = match &f.verdict {
                Verdict::Pass(_) => writeln!(out, "/>"),
                Verdict::Violated(_) if report.counts_for(f) => writeln!(
                    out,
                    "><failure type=\"{}\" message=\"{requirement}\">{why}\nsee {}</failure></testcase>",
                    level(f.level),
                    xml(f.clause)
                ),
                _ => writeln!(out, "><skipped message=\"{}\"/></testcase>", why.replace('\n', " ")),
            };
        }
        out.push_str("  </testsuite>\n");
    }
    out + "</testsuites>\n"
}

/// A line of modelDescription.xml that evidence names.
fn line(evidence: &str) -> Option<u64> {
    evidence.strip_prefix("line ")?.split(':').next()?.parse().ok()
}

/// SARIF: a result for each violated check, a must as an error, a should as a warning, a hard as a note.
pub(super) fn sarif(reports: &[Report]) -> Value {
    let rule = |check: &crate::check::Check| {
        json!({
            "id": check.id,
            "shortDescription": { "text": check.requirement },
            "help": { "text": format!("{} See {}.", check.fix, check.clause) },
        })
    };
    let rules: Vec<_> = GROUPS.iter().flat_map(|g| g.checks).map(rule).collect();
    let result = |report: &Report, f: &Finding| {
        let words = match f.level {
            Level::Must => "error",
            Level::Should => "warning",
            Level::Hard => "note",
        };
        let text = evidence(f);
        let uri = report.file.replace('\\', "/");
        let at = match line(&text) {
            Some(line) => json!({
                "artifactLocation": { "uri": format!("{uri}/modelDescription.xml") },
                "region": { "startLine": line },
            }),
            None => json!({ "artifactLocation": { "uri": uri } }),
        };
        let mut result = json!({
            "ruleId": f.id,
            "level": words,
            "message": { "text": format!("{}\n{text}", f.requirement) },
            "properties": { "confidence": f.confidence },
            "locations": [{ "physicalLocation": at }],
        });
        if f.known {
            result["suppressions"] = json!([{ "kind": "external", "status": "accepted" }]);
        }
        result
    };
    let results: Vec<_> = reports.iter().flat_map(|r| r.violated().map(move |f| result(r, f))).collect();
    json!({
        "version": "2.1.0",
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "runs": [{
            "tool": { "driver": { "name": "fmu check", "version": env!("CARGO_PKG_VERSION"), "rules": rules } },
            "results": results,
        }],
    })
}
