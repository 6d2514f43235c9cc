//! modelDescription.xml: syntax, header, interface (FMI 2.0.5, 2.2.1, 2.2.5, 4.3.1; FMI 3.0.2, 2.4.1, 2.4.2, 2.4.6, 4.4).

use crate::check::{Check, Levels, Run, Verdict};
use crate::checks::file::shared::schema;
use crate::fmu_file::FmuFile;
use crate::level::Level;
use model_description::{Element, FmiVersion, Interface, ModelDescription};

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "X01a", clause: "2.0.5, 2.2; 3.0.2, 2.4", levels: Levels::MUST, run: Run::File(well_formed),
        requirement: "modelDescription.xml is well-formed XML in UTF-8, declares UTF-8 in its first line, and declares every prefix.",
        tried: "Parses the file and reads its first line.", fix: "Begin with <?xml version=\"1.0\" encoding=\"UTF-8\"?> and write UTF-8." },
    Check { id: "X01m", clause: "hardening", levels: Levels::HARD, run: Run::File(no_mark),
        requirement: "modelDescription.xml does not start with a byte order mark, which some importers cannot read.",
        tried: "Reads the first three bytes.", fix: "Write UTF-8 without a mark; in .NET, new UTF8Encoding(false)." },
    Check { id: "X01b", clause: "2.0.5, 2.2; 3.0.2, 2.4", levels: Levels::MUST, run: Run::File(valid),
        requirement: "Elements and attributes are those of the standard, in its order and with values of its types.",
        tried: "Compares elements, attributes and values with rules equivalent to the official schema.",
        fix: "Validate the file against the XSD of the standard while you develop, and correct the line named in the finding." },
    Check { id: "X01s", clause: "3.0.2, 2.4.2", levels: Levels(None, Some(Level::Should)), run: Run::File(spelling),
        requirement: "Capability flags are spelled as in the standard: its schema allows other attributes there, but importers read a misspelled flag as \
            false.",
        tried: "Compares the attributes of the interfaces with the standard.",
        fix: "Correct the spelling; store data of the tool in annotations." },
    Check { id: "X02a", clause: "2.0.5, 2.2.1; 3.0.2, 2.4.1", levels: Levels::MUST, run: Run::File(version),
        requirement: "fmiVersion is 2.0 or 3.0, without a patch release.",
        tried: "Reads the attribute fmiVersion.", fix: "Write 2.0 or 3.0." },
    Check { id: "X05", clause: "2.0.5, 2.2.1; 3.0.2, 2.4.1", levels: Levels::SHOULD, run: Run::File(date),
        requirement: "generationDateAndTime has the form YYYY-MM-DDThh:mm:ssZ.",
        tried: "Reads the attribute generationDateAndTime.", fix: "Write UTC with a Z, for example 2026-01-02T03:04:05Z, without fractions and offset." },
    Check { id: "X06", clause: "fmi-guides, 3", levels: Levels::SHOULD, run: Run::File(metadata),
        requirement: "The attributes description, author, version, copyright, license and generationTool are given.",
        tried: "Reads the attributes of the root element.", fix: "Let users of the exporter enter these texts, and write them." },
    Check { id: "X08", clause: "2.0.5, 4.3.1; 3.0.2, 2.4.2", levels: Levels::MUST, run: Run::File(flags),
        requirement: "Every capability flag that requires another flag is accompanied by it.",
        tried: "Reads the capability flags of the interfaces.", fix: "Set the required flag too, or drop the flag that requires it." },
    Check { id: "X10", clause: "2.0.5, 2.2.5; 3.0.2, 2.4.6", levels: Levels::SHOULD, run: Run::File(experiment),
        requirement: "In the default experiment, stop follows start, the step is positive and shorter than the experiment, the tolerance is finite \
            and not negative, and fixedInternalStepSize is positive.",
        tried: "Reads DefaultExperiment and fixedInternalStepSize.", fix: "Correct the numbers, or leave out those that are not known." },
    Check { id: "X11", clause: "2.0.5, 2.2.7", levels: Levels(Some(Level::Must), None), run: Run::File(reinit),
        requirement: "An FMU without model exchange does not use the attribute reinit.",
        tried: "Looks for the attribute reinit where the FMU has no ModelExchange.", fix: "Write reinit only for continuous states of Model Exchange." },
    Check { id: "X12", clause: "2.0.5, 2.2", levels: Levels(Some(Level::Must), None), run: Run::File(numbers),
        requirement: "Numbers are finite and spelled as xs:double.",
        tried: "Reads all numbers of the file.", fix: "Leave out a limit that does not exist instead of writing INF or NaN." },
    Check { id: "G-L1a", clause: "2.0.5, 2.2.4; 3.0.2, 2.4.5", levels: Levels::MUST, run: Run::File(categories),
        requirement: "Log categories have unique names.",
        tried: "Reads LogCategories.", fix: "List each category once." },
];

/// A check of the elements.
fn with_root(fmu: &FmuFile, check: impl Fn(&Element) -> Vec<String>) -> Verdict {
    match &fmu.tree {
        Ok(root) => Verdict::of(check(root)),
        Err(cause) => Verdict::NotDetermined(cause.clone()),
    }
}

/// A check of the description.
pub(crate) fn with_description(fmu: &FmuFile, check: impl Fn(&ModelDescription) -> Vec<String>) -> Verdict {
    match &fmu.description {
        Ok(description) => Verdict::of(check(description)),
        Err(cause) => Verdict::NotDetermined(cause.clone()),
    }
}

/// An element and all elements below it.
pub(crate) fn all(root: &Element) -> Vec<&Element> {
    let (mut found, mut open) = (Vec::new(), vec![root]);
    while let Some(element) = open.pop() {
        found.push(element);
        open.extend(element.children.iter().rev());
    }
    found
}

fn well_formed(fmu: &FmuFile) -> Verdict {
    let mut findings: Vec<_> = fmu.tree.as_ref().err().cloned().into_iter().collect();
    let text = String::from_utf8_lossy(&fmu.xml);
    let first = text.lines().next().unwrap_or_default().trim_start_matches('\u{feff}');
    let declaration = first.split("?>").next().unwrap_or_default();
    if !declaration.starts_with("<?xml ") {
        findings.push("line 1: there is no XML declaration".into());
    } else if !declaration.to_ascii_lowercase().contains("utf-8") {
        findings.push(format!("line 1: {declaration}?> does not declare encoding=\"UTF-8\""));
    }
    findings.extend(fmu.root().and_then(forbidden));
    findings.extend(fmu.root().and_then(schema::undeclared));
    Verdict::of(findings)
}

/// An attribute with a character that XML does not allow, not even as a reference (XML 1.0, 2.2).
fn forbidden(element: &Element) -> Option<String> {
    let is_bad = |c: char| (c < ' ' && !"\t\n\r".contains(c)) || matches!(c, '\u{fffe}' | '\u{ffff}');
    let bad = element.attributes.iter().find_map(|(name, value)| Some((name, value.chars().find(|c| is_bad(*c))?)));
    let own = bad.map(|(name, c)| {
        format!("line {}: {name} of <{}> has the character U+{:04X}", element.line, element.name, u32::from(c))
    });
    own.or_else(|| element.children.iter().find_map(forbidden))
}

fn no_mark(fmu: &FmuFile) -> Verdict {
    let mark = fmu.xml.starts_with(b"\xef\xbb\xbf");
    Verdict::of(mark.then(|| "line 1: starts with a byte order mark".into()).into_iter().collect())
}

fn valid(fmu: &FmuFile) -> Verdict {
    with_root(fmu, |root| {
        let mut findings = schema::deviations(root, fmu.version);
        // Errors that prevent reading the file and that the rules do not cover.
        if let (true, Err(cause)) = (findings.is_empty(), &fmu.description) {
            // X02a reports another version.
            findings.extend((!cause.contains("fmiVersion")).then(|| cause.clone()));
        }
        findings
    })
}

fn spelling(fmu: &FmuFile) -> Verdict {
    with_root(fmu, schema::unknown_capabilities)
}

fn version(fmu: &FmuFile) -> Verdict {
    with_root(fmu, |root| {
        let found = root.get("fmiVersion").unwrap_or_default();
        let good = found == fmu.version.to_string();
        if good { Vec::new() } else { vec![format!("line {}: fmiVersion={found:?}", root.line)] }
    })
}

fn date(fmu: &FmuFile) -> Verdict {
    with_root(fmu, |root| {
        let Some(found) = root.get("generationDateAndTime") else {
            return vec![format!("line {}: there is no generationDateAndTime", root.line)];
        };
        let form = "dddd-dd-ddTdd:dd:ddZ";
        let same = |(f, c): (char, char)| if f == 'd' { c.is_ascii_digit() } else { f == c };
        let good = found.len() == form.len() && form.chars().zip(found.chars()).all(same);
        if good { Vec::new() } else { vec![format!("line {}: generationDateAndTime={found:?}", root.line)] }
    })
}

fn metadata(fmu: &FmuFile) -> Verdict {
    with_root(fmu, |root| {
        let missing = |a: &&&str| root.get(a).is_none_or(|v| v.trim().is_empty());
        let names = ["description", "author", "version", "copyright", "license", "generationTool"];
        names.iter().filter(missing).map(|a| format!("line {}: there is no {a}", root.line)).collect()
    })
}

fn flags(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |description| {
        let mut findings = Vec::new();
        let mut implies = |i: &Interface, holds: bool, what: &str| {
            if !holds {
                findings.push(format!("line {}: {what}", i.line));
            }
        };
        let all = [&description.co_simulation, &description.model_exchange, &description.scheduled_execution];
        for i in all.into_iter().flatten() {
            let state = i.can_get_and_set_state() || !i.can_serialize_state();
            implies(i, state, "canSerializeFMUState requires canGetAndSetFMUState");
        }
        let Some(i) = &description.co_simulation else { return findings };
        if description.version == FmiVersion::V3 {
            let early = !i.flag("canReturnEarlyAfterIntermediateUpdate") || i.flag("providesIntermediateUpdate");
            implies(i, early, "canReturnEarlyAfterIntermediateUpdate without providesIntermediateUpdate (4.4)");
            let clocked = description.variables.iter().any(|v| v.base == model_description::BaseType::Clock);
            implies(i, !clocked || i.has_event_mode(), "there are clocks, but hasEventMode is false (4.4)");
        }
        findings
    })
}

fn experiment(fmu: &FmuFile) -> Verdict {
    let Some(root) = fmu.root() else { return Verdict::NotDetermined("the XML cannot be read".into()) };
    let simulation = root.child("CoSimulation");
    let fixed = simulation
        .and_then(|i| Some((i.line, model_description::parse_number(i.get("fixedInternalStepSize")?.trim())?)));
    if let Some((line, step)) = fixed.filter(|(_, step)| *step <= 0.0) {
        return Verdict::Violated(vec![format!("line {line}: fixedInternalStepSize = {step} is not positive")]);
    }
    let Some(element) = root.child("DefaultExperiment") else {
        return Verdict::NotApplicable("there is no default experiment".into());
    };
    with_description(fmu, |description| {
        let x = description.default_experiment;
        let (start, mut findings) = (x.start.unwrap_or(0.0), Vec::new());
        let mut wrong = |bad: bool, text: String| {
            if bad {
                findings.push(format!("line {}: {text}", element.line));
            }
        };
        if let Some(stop) = x.stop {
            wrong(stop <= start, format!("stopTime = {stop} does not follow startTime = {start}"));
            if let Some(step) = x.step {
                wrong(step > stop - start && stop > start, format!("stepSize = {step} is longer than the experiment"));
            }
        }
        wrong(x.step.is_some_and(|h| h <= 0.0), "stepSize is not positive".into());
        let tolerance = x.tolerance.unwrap_or(0.0);
        wrong(
            !(tolerance >= 0.0 && tolerance.is_finite()),
            format!("tolerance = {tolerance} is negative or not finite"),
        );
        findings
    })
}

fn reinit(fmu: &FmuFile) -> Verdict {
    if fmu.root().is_some_and(|r| r.child("ModelExchange").is_some()) {
        return Verdict::NotApplicable("there is a model exchange interface".into());
    }
    with_root(fmu, |root| {
        let found = all(root).into_iter().filter(|e| e.get("reinit").is_some());
        found.map(|e| format!("line {}: <{}> has an attribute reinit", e.line, e.name)).collect()
    })
}

fn numbers(fmu: &FmuFile) -> Verdict {
    let names =
        ["start", "min", "max", "nominal", "factor", "offset", "startTime", "stopTime", "stepSize", "tolerance"];
    with_root(fmu, |root| {
        let numeric = |e: &&Element| e.name != "String";
        let bad = |e: &Element, a: &str| {
            let value = e.get(a)?.trim().to_ascii_lowercase();
            (value.contains("inf") || value.contains("nan"))
                .then(|| format!("line {}: {a}={:?}", e.line, e.get(a).unwrap_or_default()))
        };
        all(root).into_iter().filter(numeric).flat_map(|e| names.iter().filter_map(move |a| bad(e, a))).collect()
    })
}

fn categories(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |description| {
        let names: Vec<&str> = description.log_categories.iter().map(|c| c.name.as_str()).collect();
        let mut findings = Vec::new();
        for (i, name) in names.iter().enumerate() {
            if names[..i].contains(name) {
                findings.push(format!("the log category {name:?} occurs twice"));
            }
        }
        findings
    })
}
