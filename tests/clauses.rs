//! The clauses of the FMI standards that the sources cite exist in the version that they name.
//!
//! A citation is a version and its clauses, with ", " or " and " between them: FMI 2.0.5, 2.2.7 and 4.2.4; FMI 3.0.2, 2.4.7.4.
//! "FMI" may be missing. A clause without a version is a fault as well. Only a reader can verify that a clause supports a
//! sentence: `tests/data/fmi-clauses.txt` has the titles.
#![allow(missing_docs)]

use std::collections::BTreeSet;
use std::path::Path;

const LIST: &str = include_str!("data/fmi-clauses.txt");
const VERSIONS: [&str; 2] = ["2.0.5", "3.0.2"];

struct Citation {
    line: usize,
    version: Option<&'static str>,
    clause: String,
}

/// The numbers with dots and their positions, except in names, ranges and requirements (`v1.2`, `==1.2`).
fn numbers(text: &str) -> Vec<(usize, &str)> {
    let (mut found, mut end) = (Vec::new(), 0);
    while let Some(digit) = text[end..].find(|c: char| c.is_ascii_digit()) {
        let at = end + digit;
        let length = text[at..].find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len() - at);
        end = at + length;
        let number = text[at..end].trim_end_matches('.');
        let before = text[..at].chars().next_back().is_some_and(|c| c.is_alphanumeric() || "_.=~^<>-".contains(c));
        let after = text[end..].chars().next().is_some_and(|c| c.is_alphanumeric() || c == '_');
        if number.contains('.') && !number.contains("..") && !before && !after {
            found.push((at, number));
        }
    }
    found
}

/// Two dots or more, as in 4.2.4; not a release of a standard, which has a 0 somewhere, a clause of ZIP's, a
/// release of a tool, or a table's cell with a version.
fn is_bare_clause(before: &str, number: &str, after: &str) -> bool {
    let cell = before.ends_with("| ") && after.starts_with(" |");
    number.matches('.').count() >= 2
        && number.starts_with(['2', '3', '4', '5'])
        && !number.split('.').any(|part| part == "0")
        && !["APPNOTE ", "CasADi ", "gemseo-fmu "].iter().any(|name| before.ends_with(name))
        && !cell
}

fn citations(source: &str) -> Vec<Citation> {
    // One text without comment markers, because a citation may continue on the next line.
    let (mut text, mut starts) = (String::new(), Vec::new());
    for line in source.lines() {
        starts.push(text.len());
        text.push_str(line.trim_start().trim_start_matches(['/', '!', '#', '*', '>']).trim());
        text.push(' ');
    }
    let mut found = Vec::new();
    let mut open: Option<(&'static str, usize)> = None;
    for (at, number) in numbers(&text) {
        let end = at + number.len();
        if let Some(version) = VERSIONS.into_iter().find(|v| *v == number) {
            open = Some((version, end));
            continue;
        }
        open = open.filter(|(_, last)| [", ", " and "].contains(&&text[*last..at])).map(|(version, _)| (version, end));
        if open.is_some() || is_bare_clause(&text[..at], number, &text[end..]) {
            let line = starts.partition_point(|start| *start <= at);
            found.push(Citation { line, version: open.map(|(version, _)| version), clause: number.into() });
        }
    }
    found
}

/// The number of clauses that the source cites, and the line and reason of each wrong one.
fn faults(source: &str) -> (usize, Vec<(usize, String)>) {
    let listed = |version: &str, clause: &str| {
        LIST.lines().any(|l| l.split(' ').take(2).eq([version, clause]) && !l.starts_with('#'))
    };
    let cited = citations(source);
    let reason = |c: &Citation| match c.version {
        Some(version) if listed(version, &c.clause) => None,
        Some(version) => Some((c.line, format!("FMI {version} has no clause {}", c.clause))),
        None => Some((c.line, format!("the clause {0} names no version: write 2.0.5, {0} or 3.0.2, {0}", c.clause))),
    };
    (cited.len(), cited.iter().filter_map(reason).collect())
}

fn walk(folder: &Path, visit: &mut dyn FnMut(&Path)) {
    let entries: BTreeSet<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    for path in entries {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                walk(&path, visit);
            }
        } else if path
            .extension()
            .is_some_and(|e| ["rs", "md", "py", "pyi", "toml", "html", "c", "sh"].iter().any(|x| e == *x))
        {
            visit(&path);
        }
    }
}

#[test]
fn cited_clauses_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut cited, mut wrong) = (0, Vec::new());
    walk(root, &mut |path| {
        // This file has wrong citations below.
        if path == root.join("tests/clauses.rs") {
            return;
        }
        let (count, faults) = faults(&std::fs::read_to_string(path).unwrap());
        cited += count;
        let file = path.strip_prefix(root).unwrap().display().to_string();
        wrong.extend(faults.into_iter().map(|(line, why)| format!("{file}:{line}: {why}")));
    });
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(cited > 500, "{cited} citations: the sources have more");
}

#[test]
fn wrong_clauses_are_found() {
    let of = |source: &str| citations(source).into_iter().map(|c| (c.line, c.version, c.clause)).collect::<Vec<_>>();
    let cited = |line, version, clause: &str| (line, Some(version), clause.to_owned());
    assert_eq!(
        of("/// Set (FMI 2.0.5, 2.2.7 and 4.2.4; FMI 3.0.2,\n    /// 2.4.7.4, 4.2.1.1). 3.5 s\n"),
        [
            cited(1, "2.0.5", "2.2.7"),
            cited(1, "2.0.5", "4.2.4"),
            cited(2, "3.0.2", "2.4.7.4"),
            cited(2, "3.0.2", "4.2.1.1")
        ]
    );
    assert_eq!(of("| 2.0.5, 2.3; 3.0.2, 2.5; APPNOTE 4.4.17 |").len(), 2);
    assert_eq!(of("see FMI 2.0, 4.2.4 or (2.2.8)"), [(1, None, "4.2.4".into()), (1, None, "2.2.8".into())]);
    for nothing in
        ["FMI 3.0.2: 2.5 times", "numpy==2.4.6", "GLIBC_2.2.5", "| jaxonomy | 3.4.1 | 2.0, 3.0 |", "0.5, 2.5"]
    {
        assert!(of(nothing).is_empty(), "{nothing}");
    }
    let (_, wrong) = faults("FMI 2.0.5, 4.2.4\n\nFMI 3.0.2, 4.2.4, 2.2.6.4 and 2.2.7.4");
    let lines: Vec<_> = wrong.iter().map(|(line, why)| format!("{line}: {why}")).collect();
    assert_eq!(lines, ["3: FMI 3.0.2 has no clause 4.2.4", "3: FMI 3.0.2 has no clause 2.2.6.4"]);
}
