//! `ModelStructure`: which variables are outputs and initial unknowns, and on what they depend.
//!
//! FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8. FMI 2.0 counts scalar variables from 1, FMI 3.0 names value references.

use crate::version::FmiVersion;
use crate::xml::Element;
use fmu_core::description::{TIME, Variable, settable};
use fmu_core::{Causality, Description};
use std::collections::{BTreeMap, BTreeSet};

/// The model structure of a model whose outputs change through steps only.
pub(super) fn structure(description: &Description, version: FmiVersion) -> Element {
    let numbering = Numbering::of(description, version);
    let outputs = || numbering.variables.iter().filter(|(v, _)| v.causality == Causality::Output);
    // All our outputs are initial="calculated", so the initial unknowns are all of them and the calculated parameters
    // (2.2.8; 2.4.8), in the order of the variables.
    let initial = || {
        numbering
            .variables
            .iter()
            .filter(|(v, _)| matches!(v.causality, Causality::Output | Causality::CalculatedParameter))
    };
    // At a communication point no set changes an output, only fmi2DoStep or fmi3DoStep does: dependencies="".
    let outputs: Vec<_> = outputs().flat_map(|(_, numbers)| numbers).map(|&number| (number, Some(vec![]))).collect();
    let initial: Vec<_> =
        initial().flat_map(|(v, numbers)| numbers.iter().map(|&number| (number, numbering.known(v)))).collect();
    let root = Element::new("ModelStructure");
    match version {
        FmiVersion::V2 => {
            let list = |name: &str, unknowns: Vec<_>| {
                let unknowns = unknowns.into_iter().map(|u| unknown("Unknown", "index", u));
                Element::new(name).children(unknowns)
            };
            // A list that is there must not be empty.
            let lists = [list("Outputs", outputs), list("InitialUnknowns", initial)];
            root.children(lists.into_iter().filter(|list| !list.children.is_empty()))
        }
        FmiVersion::V3 => {
            let unknown = |name, u| unknown(name, "valueReference", u);
            root.children(outputs.into_iter().map(|u| unknown("Output", u)))
                .children(initial.into_iter().map(|u| unknown("InitialUnknown", u)))
        }
    }
}

fn unknown(element: &str, attribute: &str, (number, dependencies): (u32, Option<Vec<u32>>)) -> Element {
    let join = |words: Vec<String>| words.join(" ");
    let kinds = dependencies.as_ref().filter(|d| !d.is_empty()).map(|d| vec!["dependent".to_owned(); d.len()]);
    Element::new(element)
        .with(attribute, number.to_string())
        .with_some("dependencies", dependencies.map(|d| join(d.iter().map(u32::to_string).collect())))
        .with_some("dependenciesKind", kinds.map(join))
}

/// How the model structure numbers the variables.
struct Numbering<'a> {
    /// Every variable with the numbers of the variables that it is in the XML: one per element in FMI 2.0.
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
                if settable(v.causality) {
                    known.insert(reference, number);
                }
            }
            if version == FmiVersion::V3 {
                numbers.truncate(1);
            }
            variables.push((v, numbers));
        }
        Self { variables, known }
    }

    /// Numbers of what the initial value depends on, ascending, each once.
    fn known(&self, v: &Variable) -> Option<Vec<u32>> {
        let references = v.initial_dependencies.as_ref()?;
        let numbers: BTreeSet<u32> = references.iter().filter_map(|r| self.known.get(r).copied()).collect();
        Some(numbers.into_iter().collect())
    }
}
