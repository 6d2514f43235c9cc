//! Clocks, clocked variables, and lists of the model structure that only some variables fit (FMI 3.0.2, 2.4.4, 2.4.7.4, 2.4.8).

use crate::check::Verdict;
use crate::checks::file::shared::schema;
use crate::checks::file::xml::with_description;
use crate::encoding::attribute;
use crate::fmu_file::FmuFile;
use model_description::{Element, FmiVersion, parse_number};
use std::collections::HashMap;

fn variables(root: &Element) -> &[Element] {
    root.child("ModelVariables").map_or(&[][..], |list| &list.children)
}

/// Applies a rule to each variable, with all of them by their value references.
fn each(fmu: &FmuFile, rule: impl Fn(&Element, &HashMap<&str, &Element>) -> Vec<String>) -> Verdict {
    let Some(root) = fmu.root() else { return Verdict::NotDetermined("the description is not well-formed XML".into()) };
    let by_reference = variables(root).iter().filter_map(|v| Some((v.get("valueReference")?, v))).collect();
    let tell = |v: &Element| {
        let (line, name) = (v.line, v.get("name").unwrap_or_default());
        rule(v, &by_reference).into_iter().map(move |what| format!("line {line}: {name} {what}")).collect::<Vec<_>>()
    };
    Verdict::of(variables(root).iter().flat_map(tell).collect())
}

/// `clocks` and `previous` lead to variables that they fit.
pub(crate) fn references(fmu: &FmuFile) -> Verdict {
    each(fmu, |v, all| {
        let mut found = Vec::new();
        let discrete =
            |v: &Element| v.get("variability").map_or(!v.name.starts_with("Float"), |word| word == "discrete");
        if v.name == "Clock" && !discrete(v) {
            found.push("is a clock and not discrete".into());
        }
        if let Some(list) = v.get("clocks") {
            if list.trim().is_empty() {
                found.push("has an empty list of clocks".into());
            }
            for reference in list.split_whitespace() {
                match all.get(reference) {
                    None => found.push(format!("belongs to the clock {reference}, which does not exist")),
                    Some(other) if std::ptr::eq(*other, v) => found.push("belongs to itself as a clock".into()),
                    Some(other) if other.name != "Clock" => {
                        let name = other.get("name").unwrap_or_default();
                        found.push(format!("belongs to {name}, which is a {} and no clock", other.name));
                    }
                    Some(_) => {}
                }
            }
            if !discrete(v) && v.name != "Clock" && v.get("variability") != Some("tunable") {
                found.push("is clocked, and neither discrete nor tunable".into());
            }
        }
        if let Some(reference) = v.get("previous") {
            if v.get("clocks").is_none() || v.name == "Clock" || !discrete(v) {
                found.push("has the attribute previous, and is not a discrete variable with clocks".into());
            }
            match all.get(reference.trim()) {
                None => found.push(format!("has previous={reference}, which does not exist")),
                Some(other) if std::ptr::eq(*other, v) => found.push("has itself as previous".into()),
                Some(other) if other.name != v.name => {
                    found.push(format!("has a previous of another type, {}", other.name));
                }
                Some(other) if other.get("causality") == Some("input") || !discrete(other) => {
                    found.push("has a previous that is an input or not discrete".into());
                }
                Some(_) => {}
            }
        }
        found
    })
}

/// Intervals, shifts and priorities.
pub(crate) fn intervals(fmu: &FmuFile) -> Verdict {
    each(fmu, |v, _| {
        if v.name != "Clock" {
            return Vec::new();
        }
        let mut found: Vec<String> = Vec::new();
        let kind = v.get("intervalVariability").unwrap_or_default();
        let periodic = matches!(kind, "constant" | "fixed" | "tunable");
        let number = |name: &str| v.get(name).map(|text| parse_number(text.trim()).unwrap_or(f64::NAN));
        for name in ["intervalDecimal", "intervalCounter", "resolution"] {
            if let Some(x) = number(name) {
                if !periodic {
                    found.push(format!("is a {kind} clock with the attribute {name}"));
                } else if !(x > 0.0 && x.is_finite()) {
                    found.push(format!("has {name}={x}"));
                }
            }
        }
        if periodic && v.get("intervalDecimal").is_none() && v.get("intervalCounter").is_none() {
            found.push(format!("is a {kind} clock without an interval"));
        }
        for (name, interval) in [("shiftDecimal", "intervalDecimal"), ("shiftCounter", "intervalCounter")] {
            if let Some(x) = number(name) {
                if !(x >= 0.0 && x.is_finite()) {
                    found.push(format!("has {name}={x}"));
                }
                if v.get(interval).is_none() {
                    found.push(format!("has the attribute {name} without {interval}"));
                }
            }
        }
        if v.get("causality") == Some("output") && v.get("priority").is_some() {
            found.push("is an output clock with a priority".into());
        }
        found
    })
}

/// Which clocks there are.
pub(crate) fn kinds(fmu: &FmuFile) -> Verdict {
    each(fmu, |v, _| {
        if v.name != "Clock" {
            return Vec::new();
        }
        let causality = v.get("causality").unwrap_or("local");
        let kind = v.get("intervalVariability").unwrap_or_default();
        let mut found = Vec::new();
        if !["input", "output", "local"].contains(&causality) {
            found.push(format!("is a clock with causality {causality}"));
        }
        if causality != "input" && kind != "triggered" {
            found.push(format!("is a {kind} {causality} clock: the FMU makes it tick, so it must be triggered"));
        }
        found
    })
}

/// Only a continuous state has the attribute reinit.
pub(crate) fn reinit(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let states = d.states();
        let derived = |v: &model_description::ModelVariable| {
            let same =
                |s: &&&model_description::ModelVariable| s.value_reference == v.value_reference && s.base == v.base;
            states.iter().find(same).is_some()
                || d.variables
                    .iter()
                    .any(|der| der.derivative.and_then(|r| d.referenced(r)).is_some_and(|s| s.name == v.name))
        };
        d.variables
            .iter()
            .filter(|v| v.reinit && !derived(v))
            .map(|v| format!("line {}: {} has reinit, and is not a continuous state", v.line, v.name))
            .collect()
    })
}

/// No type has the name of a variable.
pub(crate) fn names_of_types(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let names: std::collections::HashSet<&str> = d.variables.iter().map(|v| v.name.as_str()).collect();
        d.types
            .iter()
            .filter(|t| names.contains(t.name.as_str()))
            .map(|t| format!("line {}: the type {:?} has the name of a variable", t.line, t.name))
            .collect()
    })
}

/// Lists of the model structure: each entry once, and event indicators that are continuous outputs or local variables.
pub(crate) fn lists(fmu: &FmuFile) -> Verdict {
    let Some(root) = fmu.root() else { return Verdict::NotDetermined("the description is not well-formed XML".into()) };
    let Some(structure) = root.child("ModelStructure") else {
        return Verdict::NotApplicable("there is no model structure".into());
    };
    let mut found = Vec::new();
    let mut once = |what: &str, entries: &[&Element], attribute: &str| {
        let mut seen = HashMap::new();
        for e in entries {
            let reference = e.get(attribute).unwrap_or_default().trim().to_owned();
            if let Some(first) = seen.insert(reference.clone(), e.line) {
                found.push(format!("line {}: the {what} {reference} is already in line {first}", e.line));
            }
        }
    };
    if fmu.version == FmiVersion::V2 {
        for list in &structure.children {
            once(&format!("entry of {}", list.name), &list.all("Unknown").collect::<Vec<_>>(), "index");
        }
        return Verdict::of(found);
    }
    for name in ["Output", "ContinuousStateDerivative", "ClockedState", "InitialUnknown", "EventIndicator"] {
        once(name, &structure.all(name).collect::<Vec<_>>(), "valueReference");
    }
    for indicator in structure.all("EventIndicator") {
        let reference = indicator.get("valueReference").unwrap_or_default();
        let line = indicator.line;
        let Some(v) = variables(root).iter().find(|v| v.get("valueReference") == Some(reference)) else {
            found.push(format!("line {line}: the event indicator {reference} does not exist"));
            continue;
        };
        let continuous = v.name.starts_with("Float") && v.get("variability").is_none_or(|word| word == "continuous");
        let parameter =
            v.get("causality").is_some_and(|c| c.ends_with("arameter") || c == "input" || c == "independent");
        if !continuous || parameter {
            let name = v.get("name").unwrap_or_default();
            found.push(format!("line {line}: the event indicator {name} is not a continuous output or local variable"));
        }
    }
    Verdict::of(found)
}

/// The description of how the sources are built.
pub(crate) fn build_description(fmu: &FmuFile) -> Verdict {
    const FILE: &str = "sources/buildDescription.xml";
    let Some(entry) = fmu.zip.find(FILE) else { return Verdict::NotApplicable(format!("there is no {FILE}")) };
    let text = crate::zip_headers::contents(&fmu.source, entry, fmu_import::limits::XML.most);
    let root =
        match text.and_then(|t| model_description::decode(&t).and_then(Element::parse).map_err(|e| e.to_string())) {
            Ok(root) => root,
            Err(cause) => return Verdict::Violated(vec![format!("{FILE}: {cause}")]),
        };
    let mut found: Vec<_> = schema::deviations_of_build(&root).into_iter().map(|f| format!("{FILE}: {f}")).collect();
    // FMI 2.0 borrowed the file from FMI 3.0.
    let (own, version) = (fmu.root().and_then(|r| r.get("fmiVersion")), root.get("fmiVersion"));
    if version.is_none() || (fmu.version == FmiVersion::V3 && version != own) {
        found.push(format!(
            "{FILE}: fmiVersion is {}, and {} in modelDescription.xml",
            attribute(version),
            attribute(own)
        ));
    }
    let mut fallback = HashMap::new();
    for configuration in root.all("BuildConfiguration") {
        let model = configuration.get("modelIdentifier").unwrap_or_default();
        let line = configuration.line;
        let known = fmu.description.as_ref().is_ok_and(|d| {
            let all = [&d.model_exchange, &d.scheduled_execution, &d.co_simulation];
            all.into_iter().flatten().any(|interface| interface.model_identifier == model)
        });
        if !known {
            found.push(format!("{FILE}: line {line}: no interface has the modelIdentifier {model:?}"));
        }
        if configuration.get("platform").is_none()
            && let Some(first) = fallback.insert(model, line)
        {
            found
                .push(format!("{FILE}: line {line}: another BuildConfiguration without a platform is in line {first}"));
        }
        for file in configuration.all("SourceFileSet").flat_map(|set| set.all("SourceFile").collect::<Vec<_>>()) {
            let name = file.get("name").unwrap_or_default();
            if !is_source(fmu, name) {
                found.push(format!("{FILE}: line {}: the file sources/{name} is missing", file.line));
            }
        }
    }
    Verdict::of(found)
}

/// Whether a file below sources/ is in the archive. Its name may contain `.` as a part, as in OpenModelica.
fn is_source(fmu: &FmuFile, name: &str) -> bool {
    let parts: Vec<_> = name.split('/').filter(|part| *part != ".").collect();
    fmu.zip.find(&format!("sources/{}", parts.join("/"))).is_some()
}

/// Files that modelDescription.xml of FMI 2.0 lists.
pub(crate) fn source_files(fmu: &FmuFile) -> Verdict {
    let Some(root) = fmu.root() else { return Verdict::NotDetermined("the description is not well-formed XML".into()) };
    let interfaces = ["CoSimulation", "ModelExchange"].into_iter().filter_map(|name| root.child(name));
    let lists: Vec<_> = interfaces.filter_map(|interface| interface.child("SourceFiles")).collect();
    if lists.is_empty() {
        return Verdict::NotApplicable("there are no SourceFiles".into());
    }
    let files = lists.iter().flat_map(|list| list.all("File"));
    let missing = files.filter_map(|file| {
        let name = file.get("name").unwrap_or_default();
        (!is_source(fmu, name)).then(|| format!("line {}: the file sources/{name} is missing", file.line))
    });
    Verdict::of(missing.collect())
}

/// Intervals longer than any default experiment, as result from values in milliseconds.
pub(crate) fn long_intervals(fmu: &FmuFile) -> Verdict {
    let experiment = fmu.description.as_ref().ok().map(|d| d.default_experiment);
    let Some(span) = experiment.and_then(|x| Some(x.stop? - x.start.unwrap_or(0.0))) else {
        return Verdict::NotApplicable("the default experiment has no stopTime".into());
    };
    each(fmu, |v, _| {
        let interval = v.get("intervalDecimal").and_then(|text| parse_number(text.trim()));
        let long = interval.filter(|x| v.name == "Clock" && *x > span && span > 0.0);
        long.map(|x| format!("has an interval of {x} s, and the default experiment takes {span} s"))
            .into_iter()
            .collect()
    })
}
