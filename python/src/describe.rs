//! A model description as plain Python values; `fmurun/fmpy.py` creates objects like FMPy's from them.

use model_description::{
    BaseType, Dimension, Experiment, FmiVersion, Interface, ModelDescription, ModelVariable, Unknown, format_number,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Name of a type as in the file.
pub(crate) fn type_name(version: FmiVersion, base: BaseType) -> &'static str {
    match (version, base) {
        (FmiVersion::V2, BaseType::Float64) => "Real",
        (FmiVersion::V2, BaseType::Int32) => "Integer",
        (_, other) => other.as_str(),
    }
}

/// `; did you mean a or b?` with the names that resemble the written one, as the command says it, or nothing.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn suggest(written: &str, names: Vec<String>) -> String {
    fmu_import::suggest(written, names.iter().map(String::as_str))
}

/// Extents of an array; an extent given by a structural parameter is its start value, or 0 without one.
pub(crate) fn shape(description: &ModelDescription, variable: &ModelVariable) -> Vec<usize> {
    let start = |reference| {
        let size = description.variables.iter().find(|v| v.value_reference == reference)?;
        size.start.as_ref()?.trim().parse().ok()
    };
    let extent = |dimension: &Dimension| match *dimension {
        Dimension::Fixed(n) => usize::try_from(n).ok(),
        Dimension::Variable(reference) => start(reference),
    };
    variable.dimensions.iter().map(|d| extent(d).unwrap_or(0)).collect()
}

/// A dictionary from pairs.
macro_rules! dict {
    ($py:expr, $($key:literal: $value:expr),* $(,)?) => {{
        let dict = PyDict::new($py);
        $(dict.set_item($key, $value)?;)*
        dict
    }};
}

pub(crate) fn dictionary<'py>(py: Python<'py>, d: &ModelDescription) -> PyResult<Bound<'py, PyDict>> {
    let numbers = |x: Option<f64>| x.map(format_number);
    let Experiment { start, stop, step, tolerance } = d.default_experiment;
    let experiment = dict!(py, "startTime": numbers(start), "stopTime": numbers(stop), "stepSize": numbers(step),
        "tolerance": numbers(tolerance));
    let units = PyList::empty(py);
    for unit in &d.units {
        let shown: Vec<_> = unit.display_units.iter().map(|u| (&u.name, u.factor, u.offset)).collect();
        units.append((&unit.name, unit.base.as_ref().map(|b| (b.exponents, b.factor, b.offset)), shown))?;
    }
    let types = PyList::empty(py);
    for t in &d.types {
        let items: Vec<_> = t.items.iter().map(|i| (&i.name, i.value.to_string(), &i.description)).collect();
        types.append(
            dict!(py, "name": &t.name, "type": type_name(d.version, t.base), "description": &t.description,
            "quantity": &t.quantity, "unit": &t.unit, "displayUnit": &t.display_unit, "min": numbers(t.min),
            "max": numbers(t.max), "nominal": numbers(t.nominal), "items": items,
            "relativeQuantity": t.relative.unwrap_or(false)),
        )?;
    }
    let variables = PyList::empty(py);
    for v in &d.variables {
        let aliases: Vec<_> = v.aliases.iter().map(|a| (&a.name, &a.description, &a.display_unit)).collect();
        variables.append(dict!(py, "name": &v.name, "valueReference": v.value_reference,
            "type": type_name(d.version, v.base), "description": &v.description, "causality": v.causality.as_str(),
            "variability": v.variability.as_str(), "initial": v.initial_or_default().map(model_description::Initial::as_str),
            "declaredType": &v.declared_type, "quantity": &v.quantity, "unit": &v.unit, "displayUnit": &v.display_unit,
            "relativeQuantity": v.relative, "min": numbers(v.min), "max": numbers(v.max), "nominal": numbers(v.nominal),
            "start": v.start_texts.first().or(v.start.as_ref()), "shape": shape(d, v), "aliases": aliases,
            "derivative": v.derivative.and_then(|r| d.referenced(r)).map(|s| &s.name), "sourceline": v.line))?;
    }
    let unknowns = |list: &[Unknown]| -> Vec<_> {
        let name = |r: u32| d.referenced(r).map(|v| v.name.clone());
        list.iter()
            .map(|u| {
                let dependencies = u.dependencies.as_ref().map(|all| all.iter().map(|&r| name(r)).collect::<Vec<_>>());
                (name(u.reference), dependencies, u.kinds.clone(), u.line)
            })
            .collect()
    };
    let whole = |i: &Option<Interface>| i.as_ref().map(|c| (c.model_identifier.clone(), c.attributes.clone()));
    let identifier = |interface: &Option<Interface>| interface.as_ref().map(|i| i.model_identifier.clone());
    Ok(dict!(py, "fmiVersion": &d.fmi_version, "modelName": &d.model_name, "instantiationToken": &d.token,
        "description": &d.description, "author": &d.author, "version": &d.model_version, "copyright": &d.copyright,
        "license": &d.license, "generationTool": &d.generation_tool,
        "generationDateAndTime": &d.generation_date_and_time, "structured": d.structured_names,
        "coSimulation": whole(&d.co_simulation), "modelExchange": whole(&d.model_exchange),
        "scheduledExecution": identifier(&d.scheduled_execution),
        "defaultExperiment": experiment, "units": units, "types": types, "variables": variables,
        "logCategories": d.log_categories.iter().map(|c| (&c.name, &c.description)).collect::<Vec<_>>(),
        "outputs": unknowns(&d.outputs), "derivatives": unknowns(&d.derivatives),
        "initialUnknowns": unknowns(&d.initial_unknowns)))
}
