//! Which variables an importer can set, and which are further names of others.

use fmu_import::raw::type_name;
use model_description::{Causality, FmiVersion, Initial, ModelDescription, ModelVariable, Variability};
use std::collections::HashSet;

/// Which variables are further names of a value (FMI 2.0): an earlier variable has the same value reference and can be set, or
/// cannot be set, as well. V02b looks at the names; the other checks would find one fault several times.
pub(super) fn aliases(description: &ModelDescription) -> Vec<bool> {
    let all = &description.variables;
    // Ascending references, as most files have them, are no names of the same value.
    if description.version == FmiVersion::V3 || all.is_sorted_by(|a, b| a.value_reference < b.value_reference) {
        return vec![false; all.len()];
    }
    let mut seen = HashSet::new();
    let key = |v: &ModelVariable| (type_name(v.base, description.version), v.value_reference, settable(v));
    all.iter().map(|v| !seen.insert(key(v))).collect()
}

/// Whether a variable can be set before initialization mode ends.
pub(super) fn settable(v: &ModelVariable) -> bool {
    v.variability != Variability::Constant
        && v.causality != Causality::Independent
        && v.clocks.is_empty()
        && match v.causality {
            Causality::Input | Causality::Parameter => true,
            Causality::StructuralParameter | Causality::CalculatedParameter => false,
            _ => v.initial_or_default() == Some(Initial::Exact),
        }
}
