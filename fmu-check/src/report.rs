//! The report of `fmu check` as text, JSON and HTML.

use crate::check::{Finding, Verdict};
use crate::checks::GROUPS;
use crate::checks::life::shared::calls;
use crate::confidence::Confidence;
use crate::fmu_file::FmuFile;
use crate::level::Level;
use crate::scripts::script;
use serde::Serialize;
use std::fmt::Write;

/// All findings about one file.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Path of the checked file.
    pub file: String,
    /// The standard: 2.0 or 3.0.
    pub fmi_version: String,
    /// Name of the model, where the description can be read.
    pub model: Option<String>,
    /// Attribute generationTool.
    pub generation_tool: Option<String>,
    /// One for each check.
    pub findings: Vec<Finding>,
    /// Names of the variables that were not compared, because two plain runs differ in them (T10).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub varying: Vec<String>,
    /// Findings of a lower confidence do not count.
    #[serde(skip)]
    pub confidence: Confidence,
}

/// The number of checks with each verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Requirements that hold.
    pub passed: usize,
    /// Violated: must, should, hard.
    pub violated: [usize; 3],
    /// Not applicable to this FMU.
    pub not_applicable: usize,
    /// Not determined.
    pub not_determined: usize,
    /// Violated, but known.
    pub known: usize,
}

impl Report {
    pub(super) fn new(fmu: &FmuFile, findings: Vec<Finding>, varying: Vec<String>) -> Self {
        let description = fmu.description.as_ref().ok();
        Self {
            file: fmu.path.display().to_string(),
            fmi_version: fmu.version.to_string(),
            model: description.map(|d| d.model_name.clone()),
            generation_tool: description.and_then(|d| d.generation_tool.clone()),
            findings,
            varying,
            confidence: Confidence::default(),
        }
    }

    /// The variables that were not compared, for the end of the report.
    fn not_compared(&self) -> Option<String> {
        const NAMED: usize = 10;
        let (named, more) = self.varying.split_at(self.varying.len().min(NAMED));
        let more = if more.is_empty() { String::new() } else { format!(" and {} others", more.len()) };
        let text = || format!("Not compared, because two plain runs differ (T10): {}{more}.", named.join(", "));
        (!named.is_empty()).then(text)
    }

    /// The finding of a check.
    pub fn finding(&self, id: &str) -> Option<&Finding> {
        self.findings.iter().find(|f| f.id == id)
    }

    /// The violated checks.
    pub fn violated(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|f| matches!(f.verdict, Verdict::Violated(_)))
    }

    /// Whether a finding counts: it is neither in `--allow` nor in the baseline, and it is sufficiently certain.
    pub(super) fn counts_for(&self, finding: &Finding) -> bool {
        !finding.known && finding.confidence <= self.confidence
    }

    /// The violated checks that count.
    pub fn unknown(&self) -> impl Iterator<Item = &Finding> {
        self.violated().filter(|f| self.counts_for(f))
    }

    /// Whether no requirement of the standard is violated, except for what is known.
    pub fn conforms(&self) -> bool {
        self.unknown().all(|f| f.level != Level::Must)
    }

    /// Marks the findings of these checks as known.
    pub fn allow(&mut self, ids: &[String]) {
        for finding in &mut self.findings {
            finding.known |= ids.iter().any(|id| id.eq_ignore_ascii_case(finding.id));
        }
    }

    /// Whether all applicable requirements are met.
    pub fn is_clean(&self) -> bool {
        let is_clean = |f: &Finding| match f.verdict {
            Verdict::Pass(_) | Verdict::NotApplicable(_) => true,
            Verdict::Violated(_) => !self.counts_for(f),
            Verdict::NotDetermined(_) => f.known,
        };
        self.findings.iter().all(is_clean)
    }

    /// The number of checks with each verdict.
    pub fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        for finding in &self.findings {
            match &finding.verdict {
                Verdict::Pass(_) => counts.passed += 1,
                Verdict::Violated(_) if finding.known => counts.known += 1,
                Verdict::Violated(_) => counts.violated[finding.level as usize] += 1,
                Verdict::NotApplicable(_) => counts.not_applicable += 1,
                Verdict::NotDetermined(_) => counts.not_determined += 1,
            }
        }
        counts
    }

    pub(super) fn summary(&self) -> String {
        let c = self.counts();
        let [must, should, hard] = c.violated;
        let known = if c.known > 0 { format!(", {} known", c.known) } else { String::new() };
        format!(
            "{} checks: {} passed; violated: {must} must, {should} should, {hard} hard{known}; {} not applicable, {} not determined",
            self.findings.len(),
            c.passed,
            c.not_applicable,
            c.not_determined
        )
    }

    /// The ids of the findings that would have taken an importer down with them.
    pub fn fatal(&self) -> Vec<&'static str> {
        self.violated().filter(|f| f.fatal).map(|f| f.id).collect()
    }

    pub(super) fn heading(&self) -> String {
        let model = self.model.as_deref().unwrap_or("?");
        let tool = self.generation_tool.as_deref().unwrap_or("an unnamed tool");
        format!("{}: {model}, FMI {}, made by {tool}", self.file, self.fmi_version)
    }

    fn groups(&self) -> impl Iterator<Item = (&'static str, Vec<&Finding>)> {
        let of = |group: &str| self.findings.iter().filter(|f| f.group == group).collect::<Vec<_>>();
        GROUPS.iter().map(move |g| (g.title, of(g.name))).filter(|(_, findings)| !findings.is_empty())
    }

    /// Text for a terminal: violated and undetermined checks; with `verbose` also all others.
    pub fn text(&self, verbose: bool) -> String {
        let mut out = format!("{}\n", self.heading());
        // A reason that checks share is printed once, at the end.
        let mut shared: Vec<(&str, Vec<&str>)> = Vec::new();
        for f in self.findings.iter().filter(|_| !verbose) {
            let Verdict::NotDetermined(reason) = &f.verdict else { continue };
            match shared.iter_mut().find(|(other, _)| *other == reason.as_str()) {
                Some((_, ids)) => ids.push(f.id),
                None => shared.push((reason, vec![f.id])),
            }
        }
        shared.retain(|(_, ids)| ids.len() > 1);
        for (title, findings) in self.groups() {
            let passed = findings.iter().filter(|f| matches!(f.verdict, Verdict::Pass(_))).count();
            let _ = writeln!(out, "\n{title} ({passed} of {} passed)", findings.len());
            for f in &findings {
                match &f.verdict {
                    Verdict::Pass(_) | Verdict::NotApplicable(_) if !verbose => {}
                    Verdict::NotDetermined(_) if shared.iter().any(|(_, ids)| ids.contains(&f.id)) => {}
                    _ => line(&mut out, f, verbose),
                }
            }
        }
        for (reason, ids) in shared {
            let _ = writeln!(out, "\nNot determined, {} checks: {reason}\n  {}", ids.len(), ids.join(", "));
        }
        let _ = writeln!(out, "\n{}", self.summary());
        if let Some(text) = self.not_compared() {
            let _ = writeln!(out, "{text}");
        }
        if !self.fatal().is_empty() {
            let _ = writeln!(out, "An importer would have crashed or hung in: {}.", self.fatal().join(", "));
        }
        let c = self.counts();
        let applicable = self.findings.len() - c.not_applicable;
        if c.not_determined > 0 {
            let _ = writeln!(out, "{} of {applicable} requirements could be checked.", applicable - c.not_determined);
        }
        let end = match (self.conforms(), self.unknown().count()) {
            (true, _) if 2 * c.not_determined > applicable => "Most requirements could not be checked.",
            (true, 0) if self.counts().known > 0 => "All findings are known.",
            (true, 0) if self.counts().not_determined > 0 => "All requirements that could be checked are met.",
            (true, 0) => "All requirements hold.",
            (true, _) => "No requirement of the standard (must) is violated.",
            (false, _) => "Requirements of the standard (must) are violated.",
        };
        out + end + "\n"
    }

    /// The report as JSON.
    ///
    /// # Errors
    /// The report cannot be written as JSON, which no report has shown.
    pub fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }

    /// A self-contained HTML page.
    pub fn html(&self) -> String {
        html(std::slice::from_ref(self))
    }

    fn section(&self) -> String {
        let mut out = format!("<h1>{}</h1>\n<p>{}</p>\n", escape(&self.heading()), escape(&self.summary()));
        if let Some(text) = self.not_compared() {
            let _ = writeln!(out, "<p>{}</p>", escape(&text));
        }
        // Violations first.
        if self.violated().next().is_some() {
            out.push_str("<ul>\n");
            for f in self.violated() {
                let (level, requirement) = (level(f.level), escape(f.requirement));
                let fatal = if f.fatal { ", takes the importer down" } else { "" };
                let _ = writeln!(out, "<li><a href=\"#{0}\">{0}</a> ({level}{fatal}): {requirement}</li>", f.id);
            }
            out.push_str("</ul>\n");
        }
        for (title, findings) in self.groups() {
            let _ = writeln!(out, "<h2>{}</h2>\n<table>", escape(title));
            for f in findings {
                let (word, evidence) = verdict_text(f);
                let class = match &f.verdict {
                    Verdict::Violated(_) => format!("violated {}", level(f.level)),
                    Verdict::Pass(_) => "pass".into(),
                    _ => "not".into(),
                };
                let mut evidence: Vec<_> = evidence.iter().map(|e| format!("<code>{}</code>", escape(e))).collect();
                if let Some(script) = script(&self.file, f) {
                    let script = escape(&script);
                    evidence
                        .push(format!("<details><summary>Repeat it in FMPy</summary><pre>{script}</pre></details>"));
                }
                let _ = writeln!(
                    out,
                    "<tr class=\"{class}\" id=\"{0}\"><td>{0}</td><td>{1}{6}</td><td>{2}</td><td>{3} <small>({4})</small><br>{5}</td></tr>",
                    f.id,
                    level(f.level),
                    word,
                    escape(f.requirement),
                    escape(f.clause),
                    evidence.join("<br>"),
                    sure(f)
                );
            }
            out.push_str("</table>\n");
        }
        out
    }
}

/// One HTML page for several files.
pub fn html(reports: &[Report]) -> String {
    let title: Vec<_> = reports.iter().map(Report::heading).collect();
    let head = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{}</title><style>\
         body{{font:16px/1.4 sans-serif;max-width:70em;margin:2em auto;padding:0 1em}}table{{border-collapse:collapse;width:100%}}\
         td,th{{border-top:1px solid #ccc;padding:.3em .6em;text-align:left;vertical-align:top}}td:first-child{{white-space:nowrap}}\
         .violated{{background:#fdd}}.violated.hard,.violated.should{{background:#fec}}.not{{color:#666}}small{{color:#555}}\
         code{{overflow-wrap:anywhere}}pre{{overflow:auto;max-height:30em}}</style></head><body>\n",
        escape(&title.join("; "))
    );
    reports.iter().map(Report::section).fold(head, |page, section| page + &section) + "</body></html>\n"
}

/// Text for several files: first the findings shared by several files; then the findings of single files; then a line for each
/// file.
pub fn texts(reports: &[Report], verbose: bool) -> String {
    if let [report] = reports {
        return report.text(verbose);
    }
    let mut out = String::new();
    let violated = |r: &Report, id: &str| r.violated().find(|f| f.id == id).cloned();
    let name = |r: &Report| r.file.rsplit(['/', '\\']).next().unwrap_or_default().to_owned();
    let mut common = Vec::new();
    for check in GROUPS.iter().flat_map(|g| g.checks) {
        let hits: Vec<_> = reports.iter().filter_map(|r| Some((r, violated(r, check.id)?))).collect();
        let [(_, first), _, ..] = hits.as_slice() else { continue };
        common.push(check.id);
        let (word, _) = verdict_text(first);
        let level = level(hits.iter().map(|(_, f)| f.level).min().unwrap_or(first.level));
        let files: Vec<_> = hits.iter().map(|(r, _)| name(r)).collect();
        let (id, requirement) = (check.id, check.requirement);
        let counts = format!("{} of {} files", hits.len(), reports.len());
        let _ = writeln!(out, "  {id:<6} {word} ({level}) in {counts}, {}: {requirement}", files.join(", "));
    }
    if !common.is_empty() {
        out = format!("In several files:\n{out}\n");
    }
    for report in reports {
        let mut own = report.clone();
        own.findings.retain(|f| !common.contains(&f.id) || !matches!(f.verdict, Verdict::Violated(_)));
        if verbose || own.violated().next().is_some() {
            let _ = writeln!(out, "{}", report.heading());
            for finding in own.findings.iter().filter(|f| verbose || matches!(f.verdict, Verdict::Violated(_))) {
                line(&mut out, finding, verbose);
            }
            out.push('\n');
        }
    }
    for report in reports {
        let fatal = report.fatal();
        let fatal = if fatal.is_empty() { String::new() } else { format!("; crash or hang: {}", fatal.join(", ")) };
        let _ = writeln!(out, "{}: {}{fatal}", report.file, report.summary());
    }
    let bad = reports.iter().filter(|r| !r.conforms()).count();
    out + &format!("{} files, {bad} of which violate requirements of the standard (must).\n", reports.len())
}

/// The word for a level.
pub(super) fn level(level: Level) -> &'static str {
    match level {
        Level::Must => "must",
        Level::Should => "should",
        Level::Hard => "hard",
    }
}

/// The word for a verdict, and its evidence.
fn verdict_text(finding: &Finding) -> (&'static str, Vec<&str>) {
    match &finding.verdict {
        Verdict::Pass(evidence) => ("pass", evidence.iter().map(String::as_str).collect()),
        Verdict::Violated(evidence) if finding.fatal => {
            ("VIOLATED, takes the importer down", evidence.iter().map(String::as_str).collect())
        }
        Verdict::Violated(evidence) => ("VIOLATED", evidence.iter().map(String::as_str).collect()),
        Verdict::NotApplicable(reason) => ("not applicable", vec![reason]),
        Verdict::NotDetermined(reason) => ("not determined", vec![reason]),
    }
}

/// How sure a violation is, after its level, unless it is certain.
fn sure(finding: &Finding) -> &'static str {
    match (&finding.verdict, finding.confidence) {
        (Verdict::Violated(_), Confidence::Likely) => ", likely",
        (Verdict::Violated(_), Confidence::Hint) => ", a hint",
        _ => "",
    }
}

/// Pieces of evidence in the text.
const MAX_EVIDENCE: usize = 8;

fn line(out: &mut String, finding: &Finding, calls: bool) {
    let (word, evidence) = verdict_text(finding);
    let known = if finding.known { ", known" } else { "" };
    let (level, sure) = (level(finding.level), sure(finding));
    let _ = writeln!(out, "  {:<6} {word} ({level}{sure}{known}): {}", finding.id, finding.requirement);
    if matches!(finding.verdict, Verdict::Violated(_)) {
        let clause = finding.clause;
        let _ =
            writeln!(out, "         see {}{clause}", if clause.starts_with(char::is_numeric) { "FMI " } else { "" });
    }
    for text in evidence.iter().take(MAX_EVIDENCE) {
        let _ = writeln!(out, "         - {}", text.lines().collect::<Vec<_>>().join(" "));
    }
    if evidence.len() > MAX_EVIDENCE {
        let _ = writeln!(out, "         - and {} more; --format json shows them", evidence.len() - MAX_EVIDENCE);
    }
    if calls && !finding.calls.is_empty() {
        let _ = writeln!(out, "         calls:");
        for call in &finding.calls {
            let _ = writeln!(out, "           {call}");
        }
    }
}

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The subject of a check, for `--explain`.
pub(super) fn explain(id: &str) -> Option<String> {
    let mut all = GROUPS.iter().flat_map(|g| g.checks.iter().map(move |c| (g, c)));
    let (group, c) = all.find(|(_, c)| c.id.eq_ignore_ascii_case(id))?;
    let of = |name: &str, l: Option<Level>| l.map(|l| format!("{} in FMI {name}", level(l)));
    let calls = calls::explained(c.id);
    let head = "\nThe calls, and the states in which they are made\n  ";
    let calls = if calls.is_empty() { String::new() } else { format!("{head}{}\n", calls.join("\n  ")) };
    let levels: Vec<_> = [of("2.0", c.levels.0), of("3.0", c.levels.1)].into_iter().flatten().collect();
    Some(format!(
        "{} ({}): {}; confidence: {}\n\nRequirement, in our words\n  {}\n\nClause\n  {}\n\nHow it is tried\n  {}\n\nUsual fix\n  {}\n{calls}",
        c.id,
        group.name,
        levels.join(", "),
        Confidence::highest(c.id).as_str(),
        c.requirement,
        c.clause,
        c.tried,
        c.fix
    ))
}

/// The index of the list: a Markdown table of the groups, each with its checks and a link to its table.
pub fn index() -> String {
    let mut out = String::from("| group | `--only` | checks |\n|---|---|---|\n");
    for group in GROUPS {
        let heading = format!("{} {}", group.title, group.name).to_lowercase();
        let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-'));
        let anchor = kept.collect::<String>().replace(' ', "-");
        let ids: Vec<_> = group.checks.iter().map(|c| c.id).collect();
        let _ = writeln!(out, "| [{}](#{anchor}) | `{}` | {} |", group.title, group.name, ids.join(", "));
    }
    out
}

/// The list of all checks: one Markdown table per group.
pub fn list() -> String {
    let mut out = String::new();
    for group in GROUPS {
        let _ = writeln!(
            out,
            "### {} (`{}`)\n\n| id | 2.0 | 3.0 | requirement | clause |\n|---|---|---|---|---|",
            group.title, group.name
        );
        for c in group.checks {
            let word = |l: Option<Level>| l.map_or("-", level);
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} |",
                c.id,
                word(c.levels.0),
                word(c.levels.1),
                c.requirement,
                c.clause
            );
        }
        out.push('\n');
    }
    out
}
