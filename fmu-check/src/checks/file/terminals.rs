//! Terminals and icons (FMI 3.0.2, 2.4.9; FMI 2.0.5, 2.3 takes the folder of FMI 3.0).

use crate::check::{Check, Levels, Run, Verdict};
use crate::checks::file::shared::schema;
use crate::checks::process::shared::copies::{copy, failed};
use crate::fmu_file::FmuFile;
use crate::session::{NotDetermined, Session};
use crate::trajectory::trajectory;
use crate::zip_headers;
use fmu_import::limits;
use fmu_import::raw::Raw;
use model_description::{Causality, Element, FmiVersion, Terminal, TerminalsAndIcons, read_terminals};

const TERMINALS: &str = "2.0.5, 2.3.2; 3.0.2, 2.4.9.2";
const FOLDER: &str = "terminalsAndIcons";
const FILE: &str = "terminalsAndIcons/terminalsAndIcons.xml";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "I01", clause: "2.0.5, 2.3.2; 3.0.2, 2.4.9", levels: Levels::MUST, run: Run::File(elements),
        requirement: "terminalsAndIcons.xml has the elements and version of the standard and names variables that exist.",
        tried: "Compares the file with rules that have the content of the schema, and looks variable names up.",
        fix: "Correct the line that is named; fmiVersion is 3.0 in both standards." },
    Check { id: "I01n", clause: TERMINALS, levels: Levels::MUST, run: Run::File(names),
        requirement: "Terminal names are present and unique, and so are member names wherever members are matched by name.",
        tried: "Compares the names of terminals and members.", fix: "Give each terminal and, for plug and bus, each member a unique name." },
    Check { id: "I01k", clause: TERMINALS, levels: Levels::MUST, run: Run::File(kinds),
        requirement: "Members are inputs, outputs or parameters; inflows and outflows are scalar; vendor-specific matching rules have reverse domain names.",
        tried: "Looks up what the members are, and the matching rules.",
        fix: "Use inputs, outputs and parameters as members, and reverse domain names for rules of your own." },
    Check { id: "I01p", clause: "2.0.5, 2.3.2; 3.0.2, 2.4.9.1", levels: Levels::MUST, run: Run::File(pictures),
        requirement: "Pictures are available as PNG, and the corners of the coordinate system are in order.",
        tried: "Looks for the PNG of every icon and reads the coordinate system.", fix: "Pack the PNG of every iconBaseName; x1 < x2 and y1 < y2." },
    Check { id: "I02", clause: "2.0.5, 2.3.1; 3.0.2, 2.5.1.6", levels: Levels::MUST, run: Run::Probe(stripped),
        requirement: "Without terminalsAndIcons/ and extra/ the FMU gives the same results.",
        tried: "Runs 20 steps from a copy of the folder without them, and compares.", fix: "Read at run time from resources/ only." },
];

/// The file's text; `None` if absent.
fn text(fmu: &FmuFile) -> Option<Result<String, String>> {
    let bytes = zip_headers::contents(&fmu.source, fmu.zip.find(FILE)?, limits::XML.most);
    Some(bytes.and_then(|bytes| String::from_utf8(bytes).map_err(|_| "is not UTF-8".to_owned())))
}

/// Findings about the parsed file; I01 reports a file that cannot be parsed.
fn read(fmu: &FmuFile, findings: impl FnOnce(&TerminalsAndIcons) -> Vec<String>) -> Verdict {
    match text(fmu) {
        None => Verdict::NotApplicable("the archive has no terminalsAndIcons.xml".into()),
        Some(text) => match text.and_then(|t| read_terminals(t).map_err(|e| e.to_string())) {
            Ok(file) => {
                Verdict::of(findings(&file).into_iter().map(|f| format!("terminalsAndIcons.xml: {f}")).collect())
            }
            Err(cause) => Verdict::NotDetermined(format!("terminalsAndIcons.xml: {cause}")),
        },
    }
}

/// All terminals, including nested ones.
fn all(terminals: &[Terminal]) -> Vec<&Terminal> {
    terminals.iter().flat_map(|t| std::iter::once(t).chain(all(&t.terminals))).collect()
}

fn elements(fmu: &FmuFile) -> Verdict {
    let Some(text) = text(fmu) else {
        return Verdict::NotApplicable("the archive has no terminalsAndIcons.xml".into());
    };
    let tree = match text.and_then(|t| Element::parse(&t).map_err(|e| e.to_string())) {
        Ok(tree) => tree,
        Err(cause) => return Verdict::Violated(vec![format!("terminalsAndIcons.xml: {cause}")]),
    };
    let mut findings = schema::deviations_of_terminals(&tree);
    let version = tree.get("fmiVersion").unwrap_or_default();
    let own = fmu.root().and_then(|root| root.get("fmiVersion")).unwrap_or_default();
    match fmu.version {
        FmiVersion::V2 if !version.starts_with("3.") => findings.push(format!(
            "fmiVersion={version:?}, which does not define this file: in an FMU of FMI 2.0 it must be the version of FMI 3.0"
        )),
        FmiVersion::V3 if version != own => {
            findings.push(format!("fmiVersion={version:?}, but the model description has {own:?}"));
        }
        _ => {}
    }
    if let Ok(description) = &fmu.description {
        let mut open = vec![&tree];
        while let Some(element) = open.pop() {
            open.extend(&element.children);
            for attribute in ["variableName", "inStreamVariableName", "outStreamVariableName"] {
                if let Some(name) = element.get(attribute).filter(|name| description.variable(name).is_none()) {
                    findings.push(format!("line {}: there is no variable {name:?}", element.line));
                }
            }
        }
    }
    Verdict::of(findings.into_iter().map(|f| format!("terminalsAndIcons.xml: {f}")).collect())
}

fn names(fmu: &FmuFile) -> Verdict {
    read(fmu, |file| {
        let mut findings = Vec::new();
        let mut level = |terminals: &[Terminal]| {
            for (k, t) in terminals.iter().enumerate() {
                if terminals[..k].iter().any(|before| before.name == t.name) {
                    findings.push(format!("line {}: the terminal {} occurs twice", t.line, t.name));
                }
            }
        };
        level(&file.terminals);
        let terminals = all(&file.terminals);
        for t in &terminals {
            level(&t.terminals);
        }
        for t in terminals.iter().filter(|t| ["plug", "bus"].contains(&&*t.matching_rule)) {
            let mut seen: Vec<&str> = Vec::new();
            for m in &t.members {
                match &m.name {
                    None => {
                        findings.push(format!(
                            "line {}: a member of the {} {} has no memberName",
                            m.line, t.matching_rule, t.name
                        ));
                    }
                    Some(name) if seen.contains(&name.as_str()) => {
                        findings.push(format!("line {}: the member {name} of {} occurs twice", m.line, t.name));
                    }
                    Some(name) => seen.push(name),
                }
            }
        }
        findings
    })
}

fn kinds(fmu: &FmuFile) -> Verdict {
    let Ok(description) = &fmu.description else {
        return Verdict::NotDetermined("the description cannot be read".into());
    };
    read(fmu, |file| {
        let mut findings = Vec::new();
        let legal = [Causality::Input, Causality::Output, Causality::Parameter, Causality::CalculatedParameter];
        for t in all(&file.terminals) {
            let rule = t.matching_rule.as_str();
            if !["plug", "bus", "sequence", "none"].contains(&rule) && !rule.contains('.') {
                findings.push(format!(
                    "line {}: matchingRule={rule:?} is neither a rule of the standard nor a reverse domain name",
                    t.line
                ));
            }
            for m in &t.members {
                let variable = description.variable(&m.variable);
                let flow = ["inflow", "outflow"].contains(&&*m.kind);
                // A vendor-specific kind need not be a reverse domain name; this is only recommended.
                if !flow && m.kind != "signal" {
                    continue;
                }
                if let Some(v) = variable.filter(|v| !legal.contains(&v.causality)) {
                    findings.push(format!(
                        "line {}: {} is an {} but has the causality {}",
                        m.line, v.name, m.kind, v.causality
                    ));
                }
                if let Some(v) = variable.filter(|v| flow && v.is_array()) {
                    findings.push(format!("line {}: {} is an {} but an array", m.line, v.name, m.kind));
                }
            }
            let flows = t.members.iter().filter(|m| m.kind == "inflow" || m.kind == "outflow").count();
            if !t.streams.is_empty() && flows > 1 {
                findings.push(format!(
                    "line {}: {} has stream members and {flows} flows; at most one is allowed",
                    t.line, t.name
                ));
            }
        }
        findings
    })
}

fn pictures(fmu: &FmuFile) -> Verdict {
    const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
    let png = |base: &str| -> Option<String> {
        let path = format!("{FOLDER}/{base}.png");
        let Some(entry) = fmu.zip.find(&path) else { return Some(format!("{path} is missing")) };
        let bytes = zip_headers::contents(&fmu.source, entry, limits::XML.most).unwrap_or_default();
        (!bytes.starts_with(SIGNATURE)).then(|| format!("{path} is not a PNG"))
    };
    read(fmu, |file| {
        let mut findings = Vec::new();
        let area = file.coordinates.area;
        if !(area.x1 < area.x2 && area.y1 < area.y2) {
            findings.push(format!(
                "the coordinate system goes from ({}, {}) to ({}, {}): expected from the lower left to the upper right",
                area.x1, area.y1, area.x2, area.y2
            ));
        }
        let icons = fmu.zip.find(&format!("{FOLDER}/icon.png")).is_some();
        findings.extend(file.icon.filter(|_| icons).and_then(|_| png("icon")));
        for t in all(&file.terminals) {
            let Some(picture) = &t.picture else { continue };
            findings.extend(png(&picture.icon).map(|what| format!("line {}: {what}", picture.line)));
        }
        findings
    })
}

fn stripped(session: &Session) -> Result<(), NotDetermined> {
    const EXTRAS: [&str; 2] = [FOLDER, "extra"];
    if !EXTRAS.iter().any(|folder| session.dir.join(folder).is_dir()) {
        return session.not_applicable("the FMU has neither terminalsAndIcons/ nor extra/");
    }
    let whole = trajectory(&session.stepping()?, 20)?;
    // Below the working directory of the probe, which is temporary.
    let target = session.home.join("stripped");
    copy(&session.dir, &target, &EXTRAS).map_err(|e| failed(&e))?;
    let inside = session.binary.strip_prefix(&session.dir).map_err(|e| NotDetermined(e.to_string()))?;
    let raw = Raw::open(&target.join(inside), session.description.version).map_err(NotDetermined)?;
    let duplicate = session.duplicate_at(&target, raw, 30)?;
    match duplicate.stepping().and_then(|instance| trajectory(&instance, 20)) {
        Err(why) => session.failed(&format!("without {}", EXTRAS.join("/ and ")), why),
        Ok(rows) => session.compare("without them", &whole, &rows),
    }
    Ok(())
}
