//! `ModelStructure`: which variables are outputs and initial unknowns, and on what they depend.
//!
//! FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8. FMI 2.0 counts scalar variables from 1, FMI 3.0 names value references.

use crate::version::FmiVersion;
use crate::xml::Element;
use fmu_core::description::{TIME, Variable};
use fmu_core::{Causality, Description};
use std::collections::{BTreeMap, BTreeSet};

/// An entry: the number of the variable and those of its dependencies, `None` if they are unknown.
type Unknown = (u32, Option<Vec<u32>>);

/// The model structure of a model whose outputs change only in steps.
pub(super) fn structure(description: &Description, version: FmiVersion) -> Element {
    let numbering = Numbering::of(description, version);
    let (mut outputs, mut initial) = (Vec::new(), Vec::new());
    for (v, numbers) in &numbering.variables {
        let output = v.causality == Causality::Output;
        if output {
            // No dependencies: only fmi2DoStep and fmi3DoStep change outputs; setting an input does not.
            outputs.extend(numbers.iter().map(|&number| (number, Some(Vec::new()))));
        }
        // Every output is initial="calculated", hence an initial unknown, and so is a calculated parameter. FMI 2.0 wants
        // them in the order of the variables.
        if output || v.causality == Causality::CalculatedParameter {
            initial.extend(numbers.iter().map(|&number| (number, numbering.known(v))));
        }
    }
    let root = Element::new("ModelStructure");
    match version {
        FmiVersion::V2 => {
            let list = |name: &str, unknowns: Vec<Unknown>| {
                Element::new(name).children(unknowns.iter().map(|u| unknown("Unknown", "index", u)))
            };
            // A list must not be empty.
            let lists = [list("Outputs", outputs), list("InitialUnknowns", initial)];
            root.children(lists.into_iter().filter(|list| !list.children.is_empty()))
        }
        FmiVersion::V3 => root
            .children(outputs.iter().map(|u| unknown("Output", "valueReference", u)))
            .children(initial.iter().map(|u| unknown("InitialUnknown", "valueReference", u))),
    }
}

fn unknown(element: &str, attribute: &str, (number, dependencies): &Unknown) -> Element {
    let list = |d: &Vec<u32>| d.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
    // The only kind that is valid for every function of a parameter in initialization mode.
    let kinds = |d: &Vec<u32>| vec!["dependent"; d.len()].join(" ");
    Element::new(element)
        .with(attribute, number.to_string())
        .with_some("dependencies", dependencies.as_ref().map(list))
        .with_some("dependenciesKind", dependencies.as_ref().filter(|d| !d.is_empty()).map(kinds))
}

/// How the model structure numbers the variables.
struct Numbering<'a> {
    /// Every variable with its numbers: one, or one per element of an array in FMI 2.0.
    variables: Vec<(&'a Variable, Vec<u32>)>,
    /// From the value reference of what an unknown may depend on (inputs, parameters, time), array elements too.
    known: BTreeMap<u32, u32>,
}

impl<'a> Numbering<'a> {
    fn of(description: &'a Description, version: FmiVersion) -> Self {
        let mut index = 1; // time is the first
        let mut known = BTreeMap::from([(TIME, if version == FmiVersion::V2 { index } else { TIME })]);
        let mut variables = Vec::new();
        for v in &description.variables {
            let mut numbers = Vec::new();
            for (_, reference) in (0..v.dimension.unwrap_or(1)).zip(v.value_reference..) {
                index += 1;
                let number = if version == FmiVersion::V2 { index } else { v.value_reference };
                numbers.push(number);
                if v.causality.is_settable() {
                    known.insert(reference, number);
                }
            }
            numbers.dedup(); // FMI 3.0 has one variable, whatever its size
            variables.push((v, numbers));
        }
        Self { variables, known }
    }

    /// Numbers of the variables that the initial value depends on, ascending and without duplicates.
    fn known(&self, v: &Variable) -> Option<Vec<u32>> {
        let references = v.initial_dependencies.as_ref()?;
        let numbers: BTreeSet<u32> = references.iter().filter_map(|r| self.known.get(r).copied()).collect();
        Some(numbers.into_iter().collect())
    }
}
