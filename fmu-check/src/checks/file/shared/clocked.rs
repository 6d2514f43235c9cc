//! Checks that only FMI 3.0 needs: aliases with display units, clocked states.

use crate::check::Verdict;
use crate::checks::file::xml::with_description;
use crate::fmu_file::FmuFile;

/// Examines the XML elements, because the parsed description does not contain clocked states.
pub(crate) fn clocked_states(fmu: &FmuFile) -> Verdict {
    let Some(root) = fmu.root() else { return Verdict::NotDetermined("the description is not well-formed XML".into()) };
    let variables = || root.child("ModelVariables").map_or(&[][..], |list| &list.children).iter();
    let find = |reference: &str| variables().find(|v| v.get("valueReference") == Some(reference));
    let states: Vec<_> = root.child("ModelStructure").into_iter().flat_map(|s| s.all("ClockedState")).collect();
    if states.is_empty() {
        return Verdict::NotApplicable("there are no clocked states".into());
    }
    let (mut findings, mut taken) = (Vec::new(), Vec::new());
    for state in states {
        let mut say = |what: &str| findings.push(format!("line {}: {what}", state.line));
        let Some(v) = state.get("valueReference").and_then(&find) else {
            say("the clocked state does not exist");
            continue;
        };
        let name = v.get("name").unwrap_or_default();
        if v.name == "Clock" || v.get("variability").is_some_and(|word| word != "discrete") || v.get("clocks").is_none()
        {
            say(&format!("{name} is not a discrete variable with clocks"));
        }
        match v.get("previous") {
            None => say(&format!("{name} has no attribute previous")),
            // V15 looks at the variable that it names.
            Some(previous) => {
                if taken.contains(&previous) {
                    say(&format!("another clocked state has the same previous as {name}"));
                }
                taken.push(previous);
            }
        }
    }
    Verdict::of(findings)
}

pub(crate) fn alias_units(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut findings = Vec::new();
        for v in &d.variables {
            for alias in &v.aliases {
                let Some(display) = &alias.display_unit else { continue };
                let unit = v.unit.as_deref().and_then(|unit| d.unit(unit));
                if !v.base.is_float() {
                    findings.push(format!(
                        "line {}: the alias {} of a {} variable has a display unit",
                        v.line, alias.name, v.base
                    ));
                } else if !unit.is_some_and(|unit| unit.display_units.iter().any(|u| u.name == *display)) {
                    findings.push(format!(
                        "line {}: the alias {} has the display unit {display}, which {} does not define",
                        v.line,
                        alias.name,
                        v.unit.as_deref().unwrap_or("a variable without unit")
                    ));
                }
            }
        }
        findings
    })
}
