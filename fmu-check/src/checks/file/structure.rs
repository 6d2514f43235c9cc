//! ModelStructure (FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8). Checks the file; `dependencies` checks the binary against it.

use crate::check::{Check, Levels, Run, Verdict};
use crate::checks::exchange::shared::dependencies::dependencies_hold;
use crate::checks::file::shared::clock_rules::lists;
use crate::checks::file::shared::clocked::clocked_states;
use crate::checks::file::xml::with_description;
use crate::fmu_file::FmuFile;
use crate::level::Level;
use model_description::{
    BaseType, Causality, FmiVersion, Initial, ModelDescription, ModelVariable, Unknown, Variability,
};
use std::collections::BTreeSet;

const CLAUSE: &str = "2.0.5, 2.2.8; 3.0.2, 2.4.8";

const NO_DERIVATIVES: &str = "the list of state derivatives is empty";
const INITIAL: &str = "initial unknown";
const INDICATOR: &str = "event indicator";
const CLOCKED: &str = "clocked state";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "S01", clause: CLAUSE, levels: Levels::MUST, run: Run::File(outputs),
        requirement: "Outputs lists every variable with causality output exactly once, and nothing else.",
        tried: "Compares Outputs with the variables.", fix: "Write the list from the variables, each output once." },
    Check { id: "S02a", clause: CLAUSE, levels: Levels::MUST, run: Run::File(initial_unknowns),
        requirement: "InitialUnknowns lists exactly the outputs, calculated parameters, states and state derivatives whose initial is calculated or approx.",
        tried: "Computes the list from the variables and compares.",
        fix: "List outputs and calculated parameters, and states and derivatives unless their initial is exact; an empty list is right only without these." },
    Check { id: "S02b", clause: "2.0.5, 2.2.8", levels: Levels(Some(Level::Must), None), run: Run::File(sorted),
        requirement: "InitialUnknowns are sorted by index.",
        tried: "Compares the indices of neighbors.", fix: "Sort the list by index before writing it." },
    Check { id: "S07", clause: "2.0.5, 2.2.8; 3.0.2, 2.4.8", levels: Levels::MUST, run: Run::File(lists),
        requirement: "A list of the model structure has each entry once, and event indicators are continuous output or local variables.",
        tried: "Compares the entries of each list, and looks the event indicators up.", fix: "List each once, and indicators as local continuous variables." },
    Check { id: "S03a", clause: CLAUSE, levels: Levels::MUST, run: Run::File(dependencies_exist),
        requirement: "Every dependency exists.",
        tried: "Looks every dependency up among the variables.", fix: "Refer to indices from 1 in FMI 2.0, to value references in FMI 3.0." },
    Check { id: "S03k", clause: CLAUSE, levels: Levels::SHOULD, run: Run::File(knowns),
        requirement: "Every dependency is a known of its list and is named once.",
        tried: "Compares dependencies with the knowns that the standard lists.",
        fix: "Leave out fixed parameters: only inputs, states and the independent variable count, initially also variables with initial exact." },
    Check { id: "S03b", clause: CLAUSE, levels: Levels::MUST, run: Run::File(kinds),
        requirement: "dependenciesKind has one word for each dependency; initial unknowns use only dependent and constant.",
        tried: "Counts dependenciesKind and reads its words.", fix: "Write one word for each dependency, or leave the attribute out." },
    Check { id: "S04", clause: CLAUSE, levels: Levels::MUST, run: Run::Probe(dependencies_hold),
        requirement: "An initial unknown changes only with the variables among its dependencies.",
        tried: "Changes one known at a time in Initialization Mode and reads the unknowns that do not name it.",
        fix: "Add the known to dependencies, or leave dependencies out, which means all." },
    Check { id: "S05", clause: CLAUSE, levels: Levels::MUST, run: Run::File(derivatives),
        requirement: "A state derivative refers to its state with the attribute derivative, and every attribute derivative to another floating-point \
            variable.",
        tried: "Follows the attribute derivative of every listed derivative and of every variable.",
        fix: "Let derivative refer to the variable, by index in FMI 2.0, by value reference in FMI 3.0." },
    Check { id: "S08", clause: CLAUSE, levels: Levels::SHOULD, run: Run::File(continuous),
        requirement: "The states and state derivatives of Model Exchange are continuous variables.",
        tried: "Reads variability of every listed derivative and of its state.", fix: "Write variability=\"continuous\", or leave it out." },
    Check { id: "S06", clause: "3.0.2, 2.4.8", levels: Levels(None, Some(Level::Must)), run: Run::File(clocked_states),
        requirement: "A clocked state is a discrete variable on a clock and refers to its previous value with the attribute previous; no two share one.",
        tried: "Follows the attribute previous of every clocked state.",
        fix: "Give the state clocks and previous, and a separate variable for the previous value." },
];

fn name(d: &ModelDescription, reference: u32) -> String {
    d.referenced(reference).map_or_else(|| format!("{reference} (does not exist)"), |v| v.name.clone())
}

fn list(d: &ModelDescription, unknowns: &[Unknown]) -> BTreeSet<String> {
    unknowns.iter().map(|u| name(d, u.reference)).collect()
}

/// The line of this name in the list, or the variable's line.
fn line(d: &ModelDescription, unknowns: &[Unknown], of: &str) -> usize {
    let listed = unknowns.iter().find(|u| name(d, u.reference) == of).map(|u| u.line);
    listed.or_else(|| d.variables.iter().find(|v| v.name == of).map(|v| v.line)).unwrap_or_default()
}

fn twice(d: &ModelDescription, unknowns: &[Unknown]) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let again = unknowns.iter().filter(|u| !seen.insert(u.reference));
    again.map(|u| format!("line {}: {} occurs twice", u.line, name(d, u.reference))).collect()
}

fn outputs(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut findings = twice(d, &d.outputs);
        let listed = list(d, &d.outputs);
        let all: BTreeSet<_> =
            d.variables.iter().filter(|v| v.causality == Causality::Output).map(|v| v.name.clone()).collect();
        let line = |n: &str| line(d, &d.outputs, n);
        findings.extend(all.difference(&listed).map(|n| format!("line {}: Outputs lacks the output {n}", line(n))));
        findings.extend(
            listed.difference(&all).map(|n| format!("line {}: Outputs lists {n}, which is not an output", line(n))),
        );
        findings
    })
}

/// State derivatives and the states that they refer to.
fn states_and_derivatives(d: &ModelDescription) -> Vec<&ModelVariable> {
    let derivatives = d.derivatives.iter().filter_map(|u| d.referenced(u.reference));
    derivatives.flat_map(|v| [Some(v), v.derivative.and_then(|s| d.referenced(s))]).flatten().collect()
}

fn initial_unknowns(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut findings = twice(d, &d.initial_unknowns);
        let open = |v: &&ModelVariable| matches!(v.initial_or_default(), Some(Initial::Approx | Initial::Calculated));
        let clocked = |v: &&ModelVariable| !v.clocks.is_empty() || v.base == BaseType::Clock;
        let output = |v: &&ModelVariable| v.causality == Causality::Output;
        let calculated = |v: &&ModelVariable| v.causality == Causality::CalculatedParameter;
        let variables = || d.variables.iter().filter(open);
        let needed: BTreeSet<String> = variables()
            .filter(|v| output(v) && !clocked(v) || calculated(v))
            .chain(states_and_derivatives(d).into_iter().filter(open))
            .map(|v| v.name.clone())
            .collect();
        // FMI 3.0 leaves clocked variables to the exporter.
        let optional: BTreeSet<String> = variables().filter(clocked).map(|v| v.name.clone()).collect();
        let listed = list(d, &d.initial_unknowns);
        let line = |n: &str| line(d, &d.initial_unknowns, n);
        findings.extend(needed.difference(&listed).map(|n| format!("line {}: InitialUnknowns lacks {n}", line(n))));
        let more = listed.difference(&needed).filter(|n| !optional.contains(*n));
        findings.extend(
            more.map(|n| format!("line {}: InitialUnknowns lists {n}, which is not an initial unknown", line(n))),
        );
        findings
    })
}

fn sorted(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let unsorted = d.initial_unknowns.windows(2).filter(|w| w[0].reference > w[1].reference);
        unsorted.map(|w| format!("line {}: index {} after {}", w[1].line, w[1].reference, w[0].reference)).collect()
    })
}

/// Every entry of the lists: the list, and line and name for a finding.
fn entries(d: &ModelDescription) -> impl Iterator<Item = (&'static str, &Unknown, String)> {
    let lists: [(_, &[Unknown]); 5] = [
        ("output", &d.outputs),
        ("derivative", &d.derivatives),
        (INITIAL, &d.initial_unknowns),
        (INDICATOR, &d.event_indicators),
        (CLOCKED, &d.clocked_states),
    ];
    let all = lists.into_iter().flat_map(|(kind, unknowns)| unknowns.iter().map(move |u| (kind, u)));
    all.map(|(kind, u)| (kind, u, format!("line {}: {kind} {}", u.line, name(d, u.reference))))
}

fn dependencies_exist(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut findings = Vec::new();
        for (_, unknown, at) in entries(d) {
            for reference in unknown.dependencies.iter().flatten().filter(|r| d.referenced(**r).is_none()) {
                findings.push(format!("{at}: the dependency {reference} does not exist"));
            }
        }
        findings
    })
}

fn knowns(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let states: BTreeSet<&str> = states_and_derivatives(d).iter().map(|v| v.name.as_str()).collect();
        let mut findings = Vec::new();
        for (kind, unknown, at) in entries(d).filter(|(kind, ..)| ![INDICATOR, CLOCKED].contains(kind)) {
            let dependencies = unknown.dependencies.as_deref().unwrap_or_default();
            for (i, &reference) in dependencies.iter().enumerate() {
                if dependencies[..i].contains(&reference) {
                    findings.push(format!("{at}: the dependency {reference} occurs twice"));
                }
                let Some(v) = d.referenced(reference) else { continue };
                if !is_known(d, v, kind == INITIAL, &states) {
                    findings.push(format!("{at}: {} is not a known here ({}, {})", v.name, v.causality, v.variability));
                }
            }
        }
        findings
    })
}

fn is_known(d: &ModelDescription, v: &ModelVariable, initial: bool, states: &BTreeSet<&str>) -> bool {
    let exact = v.initial_or_default() == Some(Initial::Exact) && v.variability != Variability::Constant;
    match v.causality {
        Causality::Input | Causality::Independent => true,
        _ if initial => exact || (v.base == BaseType::Clock),
        // In FMI 2.0 the functions have tunable parameters as arguments, but the list of the knowns lacks them.
        Causality::Parameter | Causality::StructuralParameter => {
            d.version == FmiVersion::V3 || v.variability == Variability::Tunable
        }
        _ => states.contains(v.name.as_str()) || !v.clocks.is_empty() || v.base == BaseType::Clock,
    }
}

fn kinds(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut findings = Vec::new();
        for (kind, unknown, at) in entries(d) {
            let Some(words) = &unknown.kinds else { continue };
            let count = unknown.dependencies.as_ref().map_or(0, Vec::len);
            if words.len() != count {
                findings.push(format!("{at}: {} kinds for {count} dependencies", words.len()));
            }
            let bad = |w: &&String| kind == INITIAL && !["dependent", "constant"].contains(&w.as_str());
            findings.extend(words.iter().find(bad).map(|word| format!("{at}: the kind {word}")));
        }
        findings
    })
}

fn continuous(fmu: &FmuFile) -> Verdict {
    if fmu.description.as_ref().is_ok_and(|d| d.derivatives.is_empty()) {
        return Verdict::NotApplicable(NO_DERIVATIVES.into());
    }
    with_description(fmu, |d| {
        let other = states_and_derivatives(d).into_iter().filter(|v| v.variability != Variability::Continuous);
        other.map(|v| format!("line {}: {} is {}", v.line, v.name, v.variability)).collect()
    })
}

fn derivatives(fmu: &FmuFile) -> Verdict {
    if fmu
        .description
        .as_ref()
        .is_ok_and(|d| d.derivatives.is_empty() && d.variables.iter().all(|v| v.derivative.is_none()))
    {
        return Verdict::NotApplicable("no variable is a derivative".into());
    }
    with_description(fmu, |d| {
        let bad = |u: &Unknown| {
            let state = d.referenced(u.reference)?.derivative.and_then(|s| d.referenced(s));
            let good = state.is_some_and(|s| matches!(s.causality, Causality::Local | Causality::Output));
            (!good).then(|| {
                format!("line {}: {} refers to no state that is local or an output", u.line, name(d, u.reference))
            })
        };
        let lost = |v: &ModelVariable| {
            let of = v.derivative?;
            let fault = match d.referenced(of) {
                None => format!("derivative={of}, which does not exist"),
                Some(other) if other.name == v.name => format!("derivative={of}, which is the variable itself"),
                Some(other) if !(other.base.is_float() && v.base.is_float()) => {
                    format!("derivative={of}, but derivatives and their variables are floating-point")
                }
                Some(_) => return None,
            };
            Some(format!("line {}: {} has {fault}", v.line, v.name))
        };
        d.derivatives.iter().filter_map(bad).chain(d.variables.iter().filter_map(lost)).collect()
    })
}
