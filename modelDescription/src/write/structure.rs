//! `ModelStructure`: outputs and initial unknowns, and their dependencies.
//!
//! FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8. FMI 2.0 counts scalar variables from 1, FMI 3.0 names value references.

use crate::version::FmiVersion;
use crate::xml::Element;
use fmu_core::description::{TIME, Variable};
use fmu_core::table::DENSE;
use fmu_core::{Causality, Description};
use std::collections::{BTreeMap, BTreeSet};

/// An entry: the numbers of the variable and of its dependencies, `None` if they are unknown.
type Unknown = (u32, Option<Vec<u32>>);

/// A longer list of dependencies is omitted, which means that everything counts: a large table would repeat its parameters in
/// thousands of lists.
const LONGEST: usize = 1000;

/// The model structure: outputs, derivatives of the states, initial unknowns, event indicators.
pub(super) fn structure(description: &Description, version: FmiVersion) -> Element {
    let numbering = Numbering::of(description, version);
    let exchange = description.model_exchange.as_ref();
    let (mut outputs, mut initial) = (Vec::new(), Vec::new());
    for (v, numbers) in &numbering.variables {
        if v.causality == Causality::Output {
            // A model for co-simulation only has none: only DoStep changes its outputs, and setting an input does not.
            let known = numbering.between(v);
            outputs.extend(numbers.iter().map(|&number| (number, known.clone())));
        }
        // All of them are initial="calculated". FMI 2.0 requires the order of the variables.
        if v.initial_dependencies.is_some() {
            initial.extend(numbers.iter().map(|&number| (number, numbering.at_start(v))));
        }
    }
    // The order of the states in every call.
    let derivatives: Vec<Unknown> = exchange.map_or(Vec::new(), |exchange| {
        let one = |reference: &u32| numbering.variables.iter().find(|(v, _)| v.value_reference == *reference);
        let found = exchange.derivatives.iter().filter_map(one);
        found.flat_map(|(v, numbers)| numbers.iter().map(|&number| (number, numbering.between(v)))).collect()
    });
    let root = Element::new("ModelStructure");
    match version {
        FmiVersion::V2 => {
            let list = |name: &str, unknowns: Vec<Unknown>| {
                Element::new(name).children(unknowns.iter().map(|u| unknown("Unknown", "index", u)))
            };
            // A list must not be empty.
            let lists = [list("Outputs", outputs), list("Derivatives", derivatives), list("InitialUnknowns", initial)];
            root.children(lists.into_iter().filter(|list| !list.children.is_empty()))
        }
        FmiVersion::V3 => {
            let list = |name: &'static str, unknowns: Vec<Unknown>| {
                unknowns.into_iter().map(move |u| unknown(name, "valueReference", &u))
            };
            let indicators = exchange.map_or(Vec::new(), |exchange| exchange.indicators.clone());
            root.children(list("Output", outputs))
                .children(list("ContinuousStateDerivative", derivatives))
                .children(list("InitialUnknown", initial))
                .children(list("EventIndicator", indicators.into_iter().map(|reference| (reference, None)).collect()))
        }
    }
}

fn unknown(element: &str, attribute: &str, (number, dependencies): &Unknown) -> Element {
    let list = |d: &Vec<u32>| d.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
    // Without `dependenciesKind`, each of them is "dependent".
    let listed = dependencies.as_ref().filter(|d| d.len() <= LONGEST);
    Element::new(element).with(attribute, number.to_string()).with_some("dependencies", listed.map(list))
}

/// How the model structure numbers the variables.
struct Numbering<'a> {
    /// Every variable with its numbers: one, or one per element of an array in FMI 2.0.
    variables: Vec<(&'a Variable, Vec<u32>)>,
    /// By value reference of the knowns (inputs, parameters, states, time), array elements included.
    known: BTreeMap<u32, u32>,
    /// Parameters may be knowns between events (FMI 3.0).
    parameters: bool,
    /// Without values between events, the model is for co-simulation only.
    steps_only: bool,
}

impl<'a> Numbering<'a> {
    fn of(description: &'a Description, version: FmiVersion) -> Self {
        let states = description.model_exchange.as_ref().map_or(&[][..], |exchange| &exchange.states);
        let mut index = 0;
        // In FMI 2.0, time is not a variable and cannot be named.
        let mut known: BTreeMap<u32, u32> = (version == FmiVersion::V3).then_some((TIME, TIME)).into_iter().collect();
        let mut variables = Vec::new();
        for v in &description.variables {
            let mut numbers = Vec::new();
            for (_, reference) in (0..v.elements()).zip(v.value_reference..) {
                index += 1;
                let number = if version == FmiVersion::V2 { index } else { v.value_reference };
                numbers.push(number);
                if v.takes_start() || states.contains(&v.value_reference) {
                    known.insert(reference, number);
                }
            }
            numbers.dedup(); // FMI 3.0 has one variable of any size
            variables.push((v, numbers));
        }
        let steps_only = description.model_exchange.is_none();
        Self { variables, known, parameters: version == FmiVersion::V3, steps_only }
    }

    /// Numbers of the variables that the initial value depends on.
    fn at_start(&self, v: &Variable) -> Option<Vec<u32>> {
        let of = v.initial_dependencies.as_ref()?;
        (!self.has_wide(of)).then(|| self.numbers(of.iter().copied()))
    }

    /// Whether a wide array is among these: FMI 2.0 would have to list each of its elements, so the list is omitted, which
    /// means that all count. An array of variable size counts by its maximum size, and is recognized by its first element.
    fn has_wide(&self, references: &[u32]) -> bool {
        let alone = |r: u32| !references.contains(&(r + 1));
        let is_wide = |v: &Variable, n: usize| n > DENSE || n > 1 && !v.sized.is_empty() && alone(v.value_reference);
        let wide = |r: &u32| self.variables.iter().any(|(v, n)| v.value_reference == *r && is_wide(v, n.len()));
        references.iter().any(wide)
    }

    /// Numbers of the variables that the value depends on between events. FMI 2.0 allows no parameters there.
    fn between(&self, v: &Variable) -> Option<Vec<u32>> {
        if self.steps_only {
            return Some(Vec::new());
        }
        if v.dependencies.as_ref().is_some_and(|of| self.has_wide(of)) {
            return None;
        }
        let parameter = |reference: &u32| {
            self.variables.iter().any(|(v, _)| v.value_reference == *reference && v.causality == Causality::Parameter)
        };
        let references = v.dependencies.as_ref()?.iter().copied();
        Some(self.numbers(references.filter(|reference| self.parameters || !parameter(reference))))
    }

    /// Ascending and without duplicates.
    fn numbers(&self, references: impl Iterator<Item = u32>) -> Vec<u32> {
        references.filter_map(|r| self.known.get(&r).copied()).collect::<BTreeSet<u32>>().into_iter().collect()
    }
}
